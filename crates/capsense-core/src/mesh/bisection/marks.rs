//! Which elements to refine, from what each contributes to an error.

/// The elements with the largest indicators, largest first, the earlier of equal ones first, that make up a share of
/// the sum of all (Dörfler, "A convergent adaptive algorithm for Poisson's equation", 1996). Indicators that are not
/// positive are none; of a share of 1 all others are there.
pub fn largest_first(indicators: &[f64], share: f64) -> Vec<u32> {
    let mut order: Vec<u32> =
        (0..).zip(indicators).filter(|(_, value)| **value > 0.0).map(|(element, _)| element).collect();
    let of = |element: u32| indicators[element as usize];
    order.sort_by(|&a, &b| of(b).total_cmp(&of(a)).then(a.cmp(&b)));
    let wanted = share * order.iter().map(|&element| of(element)).sum::<f64>();
    let mut sum = 0.0;
    let count = order.iter().take_while(|&&element| {
        let is_wanted = sum < wanted;
        sum += of(element);
        is_wanted
    });
    let count = if share >= 1.0 { order.len() } else { count.count() };
    order.truncate(count);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_come_first_and_make_up_the_share() {
        let indicators = [1.0, 4.0, f64::NAN, 0.0, 4.0, -3.0, 2.0, 1e-30];
        assert_eq!(largest_first(&indicators, 1.0), [1, 4, 6, 0, 7]);
        assert_eq!(largest_first(&indicators, 0.75), [1, 4, 6]);
        assert_eq!(largest_first(&indicators, 8.0 / 11.0), [1, 4]);
        assert_eq!(largest_first(&indicators, 1e-9), [1]);
        assert!(largest_first(&indicators, 0.0).is_empty());
        assert!(largest_first(&[], 1.0).is_empty());
    }
}

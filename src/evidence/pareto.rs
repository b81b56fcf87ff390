//! The Pareto front: points that no other point beats in both coordinates.

/// Indices of the points that nothing beats, from left to right; less is better in both coordinates. A point is beaten by
/// one that is not worse in either coordinate and better in one; of equal points the first counts. Points that are not finite
/// beat nothing.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| points[i].0.is_finite() && points[i].1.is_finite()).collect();
    // A stable sort: equal points stay in their order.
    order.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)));
    let mut lowest = f64::INFINITY;
    order.retain(|&index| {
        let is_lower = points[index].1 < lowest;
        lowest = lowest.min(points[index].1);
        is_lower
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_beaten_is_not_on_the_front() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 5.0), (2.0, 2.0), (4.0, 1.0), (2.0, 2.0), (5.0, 0.5)];
        assert_eq!(front(&points), [1, 3, 0, 6]);
        assert_eq!(front(&[]), [0usize; 0]);
        assert_eq!(front(&[(f64::NAN, 0.0), (1.0, f64::INFINITY), (7.0, 7.0)]), [2]);
    }

    proptest! {
        /// The definition, point by point. Few values make ties.
        #[test]
        fn the_front_is_what_nothing_beats(points in prop::collection::vec((0u8..12, 0u8..12), 0..40)) {
            let points: Vec<(f64, f64)> = points.into_iter().map(|(x, y)| (f64::from(x), f64::from(y))).collect();
            let on_front = front(&points);
            let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
            for (index, &point) in points.iter().enumerate() {
                let is_beaten = points.iter().any(|&other| beats(other, point));
                let is_repeated = points[..index].contains(&point);
                prop_assert_eq!(on_front.contains(&index), !is_beaten && !is_repeated, "{:?}", point);
            }
            prop_assert!(on_front.windows(2).all(|w| points[w[0]].0 < points[w[1]].0 && points[w[0]].1 > points[w[1]].1));
        }
    }
}

//! The relative permittivity of what is there without objects.

/// Relative permittivities of many elements or edges. Most sensors have no substrate in their mesh, so what is the same
/// everywhere is stored once.
#[derive(Clone, Debug, PartialEq)]
pub struct Background {
    count: usize,
    /// One for all, or one for each.
    values: Vec<f64>,
}

impl Background {
    /// Vacuum at so many places.
    pub fn vacuum(count: usize) -> Self {
        Self { count, values: vec![1.0] }
    }

    /// Given one by one.
    pub fn new(mut values: Vec<f64>) -> Self {
        let count = values.len();
        if values.windows(2).all(|pair| pair[0].to_bits() == pair[1].to_bits()) {
            values.truncate(1);
            values.shrink_to_fit();
        }
        Self { count, values }
    }

    /// That of one place.
    ///
    /// # Panics
    /// When there is no such place.
    #[inline(always)]
    pub fn at(&self, index: usize) -> f64 {
        assert!(index < self.count, "place {index} of {}", self.count);
        if let [of_all] = *self.values { of_all } else { self.values[index] }
    }

    /// Whether all are known to be the same.
    pub(crate) fn is_uniform(&self) -> bool {
        self.values.len() == 1
    }

    /// Those of all places in turn.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f64> + Clone {
        (0..self.count).map(|index| self.at(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_the_same_everywhere_is_stored_once_and_reads_the_same() {
        let uniform = Background::new(vec![4.4; 100]);
        assert_eq!(uniform.values.len(), 1);
        assert!(uniform.iter().len() == 100 && uniform.iter().all(|value| value == 4.4));
        let mixed = Background::new(vec![1.0, 4.4, 1.0]);
        assert_eq!(mixed.iter().collect::<Vec<_>>(), [1.0, 4.4, 1.0]);
        assert_eq!(Background::new(vec![1.0; 3]), Background::vacuum(3));
        assert_eq!(Background::new(Vec::new()).iter().len(), 0);
    }
}

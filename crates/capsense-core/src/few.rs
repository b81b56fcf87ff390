//! Values of few of many things, the others having one in common: far smaller than all of them, and quicker to be passed over.

/// Something without a place.
const NOWHERE: u32 = u32::MAX;

/// Values by number.
#[derive(Clone, Debug)]
pub(crate) struct Few<T> {
    /// What most have.
    common: T,
    /// Where those of the others are, and places that are free.
    places: Vec<u32>,
    values: Vec<T>,
    free: Vec<u32>,
}

impl<T> Few<T> {
    /// So many that have a value in common.
    pub(crate) fn of(count: usize, common: T) -> Self {
        Self { common, places: vec![NOWHERE; count], values: Vec::new(), free: Vec::new() }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether one of them has its own value.
    #[inline(always)]
    pub(crate) fn has_own(&self, number: usize) -> bool {
        self.places[number] != NOWHERE
    }

    /// The value of one of those that have their own.
    #[inline(always)]
    pub(crate) fn own(&self, number: usize) -> Option<&T> {
        self.values.get(self.places[number] as usize)
    }

    /// Numbers of those that have their own value, in increasing order.
    pub(crate) fn all_own(&self) -> impl Iterator<Item = (usize, &T)> {
        let own = |(number, &place): (usize, &u32)| Some((number, self.values.get(place as usize)?));
        self.places.iter().enumerate().filter_map(own)
    }

    #[inline(always)]
    pub(crate) fn get(&self, number: usize) -> &T {
        self.own(number).unwrap_or(&self.common)
    }

    /// The values of some successive ones.
    #[inline(always)]
    pub(crate) fn successive<const N: usize>(&self, first: usize) -> [T; N]
    where
        T: Copy,
    {
        let places = &self.places[first..first + N];
        std::array::from_fn(|at| self.values.get(places[at] as usize).copied().unwrap_or(self.common))
    }

    /// Takes another value, or that which most have. Returns the one before.
    #[inline]
    pub(crate) fn set(&mut self, number: usize, own: Option<T>) -> T
    where
        T: Copy,
    {
        let Self { common, places, values, free } = self;
        let place = &mut places[number];
        match (own, values.get_mut(*place as usize)) {
            (Some(own), Some(value)) => return std::mem::replace(value, own),
            (Some(own), None) => match free.pop() {
                Some(other) => {
                    values[other as usize] = own;
                    *place = other;
                }
                None => {
                    *place = values.len() as u32;
                    values.push(own);
                }
            },
            (None, Some(value)) => {
                let before = *value;
                free.push(std::mem::replace(place, NOWHERE));
                return before;
            }
            (None, None) => {}
        }
        *common
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_has_the_value_that_it_was_given_last() {
        let (mut few, mut all, mut state) = (Few::of(50, 0), [0; 50], 1_u64);
        let mut most = 0;
        for round in 1..2000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (number, is_own) = ((state >> 33) as usize % 50, state >> 62 == 0);
            all[number] = if is_own { round } else { 0 };
            let before = *few.get(number);
            assert_eq!(few.set(number, is_own.then_some(round)), before);
            assert!((0..50).all(|number| *few.get(number) == all[number]), "{round}");
            assert!((0..50).all(|number| few.has_own(number) == few.own(number).is_some()), "{round}");
            let own = |number: &usize| few.own(*number).is_some();
            let count = (0..50).filter(own).count();
            assert_eq!(count, all.iter().filter(|value| **value != 0).count());
            most = most.max(count);
        }
        assert_eq!(few.values.len(), most, "places are used again");
    }
}

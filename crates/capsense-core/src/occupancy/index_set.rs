//! Numbers of nodes or edges, collected in any order and each met once: in increasing order, or as they were collected.

use std::ops::Range;

/// A set of numbers below a bound.
#[derive(Clone, Debug)]
pub(super) struct IndexSet {
    /// One bit for each number.
    words: Vec<u64>,
    /// The words outside of which there is nothing.
    used: Range<usize>,
}

const BITS: usize = u64::BITS as usize;

/// No words, that which becomes some by a minimum and a maximum.
const NO_WORDS: Range<usize> = Range { start: usize::MAX, end: 0 };

impl Default for IndexSet {
    fn default() -> Self {
        Self::below(0)
    }
}

/// No more numbers are visited together.
pub(super) const RUN: usize = BITS;

impl IndexSet {
    /// An empty set of numbers below a bound.
    pub(super) fn below(bound: usize) -> Self {
        Self { words: vec![0; bound.div_ceil(BITS)], used: NO_WORDS }
    }

    #[inline]
    pub(super) fn insert(&mut self, number: usize) {
        let word = number / BITS;
        self.words[word] |= 1 << (number % BITS);
        self.use_words(word, word);
    }

    /// Takes note that numbers of a range may be inserted by [`IndexSet::insert_expected`].
    pub(super) fn expect(&mut self, numbers: Range<usize>) {
        let end = numbers.end.min(BITS * self.words.len());
        if numbers.start < end {
            self.use_words(numbers.start / BITS, (end - 1) / BITS);
        }
    }

    /// Inserts a number of a range that [`IndexSet::expect`] was told, which takes less than to keep account of any.
    #[inline]
    pub(super) fn insert_expected(&mut self, number: usize) {
        debug_assert!(self.used.contains(&(number / BITS)));
        self.words[number / BITS] |= 1 << (number % BITS);
    }

    #[inline]
    pub(super) fn remove(&mut self, number: usize) {
        self.words[number / BITS] &= !(1 << (number % BITS));
    }

    #[inline]
    pub(super) fn contains(&self, number: usize) -> bool {
        self.words[number / BITS] >> (number % BITS) & 1 != 0
    }

    /// Adds all numbers of a range.
    pub(super) fn insert_all(&mut self, numbers: Range<usize>) {
        if numbers.is_empty() {
            return;
        }
        let (first, last) = (numbers.start / BITS, (numbers.end - 1) / BITS);
        let from = u64::MAX << (numbers.start % BITS);
        let to = u64::MAX >> (BITS - 1 - (numbers.end - 1) % BITS);
        if first == last {
            self.words[first] |= from & to;
        } else {
            self.words[first] |= from;
            self.words[first + 1..last].fill(u64::MAX);
            self.words[last] |= to;
        }
        self.use_words(first, last);
    }

    #[inline]
    fn use_words(&mut self, first: usize, last: usize) {
        self.used = self.used.start.min(first)..self.used.end.max(last + 1);
    }

    /// Takes all numbers of another set below the same bound, which is left empty.
    pub(super) fn unite(&mut self, other: &mut Self) {
        let words = std::mem::replace(&mut other.used, NO_WORDS);
        if !words.is_empty() {
            self.use_words(words.start, words.end - 1);
            let pairs = self.words[words.clone()].iter_mut().zip(&mut other.words[words]);
            pairs.for_each(|(word, other)| *word |= std::mem::take(other));
        }
    }

    /// Visits all numbers of this set and of another below the same bound in increasing order, each once, tells whether it
    /// is in this one, and leaves both empty.
    #[inline]
    pub(super) fn drain_with(&mut self, other: &mut Self, mut visit: impl FnMut(usize, bool)) {
        Self::cut([self, other], 1).for_each(|part| part.drain(&mut visit));
    }

    /// Cuts sets below the same bound into so many parts at most, of about as many numbers each. They are empty once all parts are
    /// drained.
    pub(super) fn cut<const N: usize>(
        sets: [&mut Self; N],
        parts: usize,
    ) -> impl Iterator<Item = Part<'_, N>> + Send {
        let used = sets
            .iter()
            .filter(|set| !set.used.is_empty())
            .fold(NO_WORDS, |all, set| all.start.min(set.used.start)..all.end.max(set.used.end));
        let used = if used.is_empty() { 0..0 } else { used };
        let mut first = used.start;
        let mut words = sets.map(|set| {
            set.used = NO_WORDS;
            &mut set.words[used.clone()]
        });
        fn numbers<const N: usize>(words: &[&mut [u64]; N], at: usize) -> usize {
            words.iter().fold(0, |all, words| all | words[at]).count_ones() as usize
        }
        let all: usize = if parts > 1 { (0..used.len()).map(|at| numbers(&words, at)).sum() } else { 0 };
        let of_part = all.div_ceil(parts.max(1));
        std::iter::from_fn(move || {
            let left = words.first().map_or(0, |words| words.len());
            let mut count = 0;
            let mut is_last = |at: usize| {
                count += numbers(&words, at);
                count >= of_part
            };
            let last = if parts > 1 { (0..left).find(|&at| is_last(at)) } else { None };
            let taken = last.map_or(left, |last| last + 1);
            let part = Part {
                first,
                words: words.each_mut().map(|words| words.split_off_mut(..taken).unwrap_or_default()),
            };
            first += taken;
            (taken > 0).then_some(part)
        })
    }
}

/// A part of sets.
pub(super) struct Part<'a, const N: usize> {
    /// Number of the first word.
    first: usize,
    words: [&'a mut [u64]; N],
}

impl<const N: usize> Part<'_, N> {
    /// One more than the last number that it can have.
    pub(super) fn end(&self) -> usize {
        (self.first + self.words.first().map_or(0, |words| words.len())) * BITS
    }
}

impl Part<'_, 1> {
    /// Visits all numbers in increasing order, those next to each other together, up to [`RUN`] of them, and leaves it empty.
    #[inline]
    pub(super) fn drain_runs(self, mut visit: impl FnMut(Range<usize>)) {
        let [words] = self.words;
        for (word, bits) in (self.first..).zip(words) {
            let mut bits = std::mem::take(bits);
            while bits != 0 {
                let from = bits.trailing_zeros();
                let count = (bits >> from).trailing_ones();
                let first = word * BITS + from as usize;
                visit(first..first + count as usize);
                // What is carried beyond the run ends it.
                bits &= bits.wrapping_add(1 << from);
            }
        }
    }
}

impl Part<'_, 2> {
    /// Visits all numbers in increasing order, each once, tells whether it is in the first of the sets, and leaves both empty.
    #[inline]
    pub(super) fn drain(self, mut visit: impl FnMut(usize, bool)) {
        let [own, other] = self.words;
        for (word, (own, other)) in (self.first..).zip(own.iter_mut().zip(other)) {
            let own = std::mem::take(own);
            let all = own | std::mem::take(other);
            for_bits(all, |bit| visit(word * BITS + bit, own >> bit & 1 != 0));
        }
    }
}

/// Visits the bits that are set, the lowest first.
#[inline]
fn for_bits(mut bits: u64, mut visit: impl FnMut(usize)) {
    while bits != 0 {
        visit(bits.trailing_zeros() as usize);
        bits &= bits - 1;
    }
}

/// Numbers below a bound, in the order in which they were added. For few of many.
#[derive(Clone, Debug)]
pub(crate) struct IndexList {
    numbers: Vec<u32>,
    set: IndexSet,
}

impl IndexList {
    /// An empty list of numbers below a bound.
    pub(crate) fn below(bound: usize) -> Self {
        Self { numbers: Vec::new(), set: IndexSet::below(bound) }
    }

    /// An empty list again, without room for as many as there were.
    pub(crate) fn release(&mut self) {
        self.clear();
        self.numbers = Vec::new();
    }

    /// Adds a number that is not there yet.
    #[inline]
    pub(crate) fn insert(&mut self, number: usize) {
        if !self.set.contains(number) {
            self.set.insert(number);
            self.numbers.push(number as u32);
        }
    }

    /// Puts the numbers in increasing order, which is that of their bits.
    pub(crate) fn sort(&mut self) {
        self.numbers.clear();
        let Self { numbers, set } = self;
        for word in set.used.clone() {
            for_bits(set.words[word], |bit| numbers.push((word * BITS + bit) as u32));
        }
    }

    /// Takes out the numbers for which something does not hold.
    pub(crate) fn retain(&mut self, holds: impl Fn(usize) -> bool) {
        let Self { numbers, set } = self;
        numbers.retain(|&number| {
            let holds = holds(number as usize);
            if !holds {
                set.remove(number as usize);
            }
            holds
        });
    }

    pub(crate) fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    pub(crate) fn clear(&mut self) {
        let Self { numbers, set } = self;
        numbers.drain(..).for_each(|number| set.words[number as usize / BITS] = 0);
        set.used = NO_WORDS;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_met_in_order_and_once() {
        let mut set = IndexSet::below(300);
        let drained = |set: &mut IndexSet| {
            let mut numbers = Vec::new();
            IndexSet::cut([set], 1).for_each(|part| part.drain_runs(|run| numbers.extend(run)));
            numbers
        };
        [299, 3, 64, 3].into_iter().for_each(|number| set.insert(number));
        assert_eq!(drained(&mut set), [3, 64, 299]);
        assert_eq!(drained(&mut set), []);
        let mut other = IndexSet::below(300);
        [3, 200].into_iter().for_each(|number| set.insert(number));
        [3, 5, 64].into_iter().for_each(|number| other.insert(number));
        let mut numbers = Vec::new();
        set.drain_with(&mut other, |number, is_own| numbers.push((number, is_own)));
        assert_eq!(numbers, [(3, true), (5, false), (64, false), (200, true)]);
        assert_eq!([drained(&mut set), drained(&mut other)], [[], []]);
        for parts in 1..6 {
            [3, 64, 130, 131].into_iter().for_each(|number| set.insert(number));
            [3, 65, 131, 290].into_iter().for_each(|number| other.insert(number));
            let (mut numbers, mut count, mut from) = (Vec::new(), 0, 0);
            for part in IndexSet::cut([&mut set, &mut other], parts) {
                let end = part.end();
                part.drain(|number, _| {
                    assert!((from..end).contains(&number), "{number} in {from}..{end}");
                    numbers.push(number);
                });
                (count, from) = (count + 1, end);
            }
            assert_eq!(numbers, [3, 64, 65, 130, 131, 290]);
            assert!(count <= parts && (parts == 1 || count > 1), "{count} of {parts}");
            assert_eq!([drained(&mut set), drained(&mut other)], [[], []]);
        }
        assert!(IndexSet::cut([&mut set, &mut other], 3).next().is_none());
        [64, 130].into_iter().for_each(|number| set.insert(number));
        [65, 250].into_iter().for_each(|number| other.insert(number));
        set.unite(&mut other);
        assert_eq!(drained(&mut set), [64, 65, 130, 250]);
        assert_eq!(drained(&mut other), []);
        set.expect(60..500);
        [130, 60].into_iter().for_each(|number| set.insert_expected(number));
        assert_eq!(drained(&mut set), [60, 130]);
        for range in [0..1, 5..5, 63..64, 64..128, 60..70, 1..300, 127..257] {
            set.insert_all(range.clone());
            assert_eq!(drained(&mut set), range.collect::<Vec<_>>());
        }
    }
}

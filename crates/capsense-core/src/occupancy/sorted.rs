//! A sorted list that loses and gains a few items from frame to frame.

/// Items in increasing order, none twice. What the list is does not depend on how it came about.
#[derive(Clone, Debug)]
pub(super) struct SortedList<T> {
    items: Vec<T>,
    added: Vec<T>,
    /// Storage of the list before the last merge.
    spare: Vec<T>,
}

impl<T: Copy + Ord> SortedList<T> {
    pub(super) fn new() -> Self {
        Self { items: Vec::new(), added: Vec::new(), spare: Vec::new() }
    }

    pub(super) fn items(&self) -> &[T] {
        &self.items
    }

    /// Notes an item, in any order, for the next [`SortedList::merge`].
    pub(super) fn add(&mut self, item: T) {
        self.added.push(item);
    }

    /// Whether items were noted since the last merge.
    pub(super) fn grows(&self) -> bool {
        !self.added.is_empty()
    }

    /// Drops the items that are not to be kept and takes in those noted.
    pub(super) fn merge(&mut self, keep: impl Fn(&T) -> bool) {
        std::mem::swap(&mut self.items, &mut self.spare);
        self.items.clear();
        self.added.sort_unstable();
        self.added.dedup();
        let mut added = self.added.drain(..).peekable();
        for &old in self.spare.iter().filter(|old| keep(old)) {
            while let Some(new) = added.next_if(|new| *new <= old) {
                if new < old {
                    self.items.push(new);
                }
            }
            self.items.push(old);
        }
        self.items.extend(added);
    }
}

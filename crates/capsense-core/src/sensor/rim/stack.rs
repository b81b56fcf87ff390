//! What lies above or below the rim of an electrode, as a wave along the electrode's plane sees it: on the lattice, and as
//! it is.

/// A cell of a lattice below a node, or above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// In any length; the waves that are asked for are in the same.
    pub(super) height: f64,
    /// Relative.
    pub(super) permittivity: f64,
}

/// Cells one after the other away from the plane.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stack {
    /// The one at the plane. It is always there.
    first: Cell,
    /// Those behind it, the nearest first.
    others: Vec<Cell>,
    /// Whether the last ends at a node that is held, as by a shield; or else cells like the last go on for ever.
    is_held: bool,
}

impl Stack {
    pub(super) fn new(first: Cell, others: Vec<Cell>, is_held: bool) -> Self {
        Self { first, others, is_held }
    }

    #[cfg(test)]
    pub(super) fn uniform(height: f64, permittivity: f64) -> Self {
        Self::new(Cell { height, permittivity }, Vec::new(), false)
    }

    pub(super) fn first(&self) -> Cell {
        self.first
    }

    /// Weight of an edge in the plane that is as long as rows are apart, this side's half, for each unit of length across.
    pub(super) fn half_of_row(&self) -> f64 {
        0.5 * self.first.height * self.first.permittivity
    }

    /// Whether it is the same cell for ever.
    pub(super) fn is_endless(&self) -> bool {
        self.others.is_empty() && !self.is_held
    }

    /// The same in another unit of length.
    pub(super) fn in_units_of(&self, length: f64) -> Self {
        let scaled = |cell: &Cell| Cell { height: cell.height / length, ..*cell };
        Self {
            first: scaled(&self.first),
            others: self.others.iter().map(scaled).collect(),
            is_held: self.is_held,
        }
    }

    /// Relative permittivity over the distance to the shield, of the plate capacitor down to it.
    pub(super) fn plate(&self) -> f64 {
        let distance: f64 = self.outward().map(|cell| cell.height / cell.permittivity).sum();
        if self.is_held { 1.0 / distance } else { 0.0 }
    }

    /// Charge over potential in the plane, for waves on the lattice with 4 sin²(k/2) = `square`, k per unit of length.
    pub(super) fn on_lattice(&self, square: f64) -> f64 {
        let half_row = |cell: Cell| 0.5 * cell.permittivity * cell.height * square;
        let last = self.others.last().copied().unwrap_or(self.first);
        let end = if self.is_held { f64::INFINITY } else { last.endless(square) };
        self.inward().fold(end, |beyond, cell| {
            let (across, along) = (cell.permittivity / cell.height, half_row(cell));
            let next = beyond + along;
            along + if next.is_finite() { across * next / (across + next) } else { across }
        })
    }

    /// The same without a lattice, for waves of a wave number.
    pub(super) fn exact(&self, wave: f64) -> f64 {
        let last = self.others.last().copied().unwrap_or(self.first);
        let end = if self.is_held { f64::INFINITY } else { last.permittivity * wave };
        self.inward().fold(end, |beyond, cell| {
            let (own, tanh) = (cell.permittivity * wave, (wave * cell.height).tanh());
            if beyond.is_finite() { own * (beyond + own * tanh) / (own + beyond * tanh) } else { own / tanh }
        })
    }

    fn outward(&self) -> impl DoubleEndedIterator<Item = Cell> {
        std::iter::once(self.first).chain(self.others.iter().copied())
    }

    fn inward(&self) -> impl Iterator<Item = Cell> {
        self.outward().rev()
    }
}

impl Cell {
    /// Charge over potential for cells like this one for ever.
    pub(super) fn endless(self, square: f64) -> f64 {
        self.permittivity * (square * (1.0 + 0.25 * self.height * self.height * square)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_are_the_same_are_endless() {
        let cell = Cell { height: 0.7, permittivity: 3.0 };
        let stack = Stack::new(cell, vec![cell; 3], false);
        assert!((stack.on_lattice(0.9) / cell.endless(0.9) - 1.0).abs() < 1e-14);
        assert!((stack.exact(0.9) / 2.7 - 1.0).abs() < 1e-14);
    }

    #[test]
    fn long_waves_do_not_see_cells() {
        let cells = [(0.5, 4.4), (1.0, 1.0), (0.25, 2.0)];
        let [first, second, third] = cells.map(|(height, permittivity)| Cell { height, permittivity });
        for is_held in [true, false] {
            let stack = Stack::new(first, vec![second, third], is_held);
            let ratio = |wave: f64| stack.on_lattice(4.0 * (0.5 * wave).sin().powi(2)) / stack.exact(wave);
            assert!((ratio(1e-3) - 1.0).abs() < 1e-6, "{}", ratio(1e-3));
            assert!((ratio(2e-3) - 1.0).abs() < 4e-6);
            assert!((stack.plate() > 0.0) == is_held);
        }
    }
}

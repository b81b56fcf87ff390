//! What the iteration needs of a stiffness matrix, its preconditioner and its vectors, whatever their layout.

/// Fields x of several terminals on one mesh with everything around them: K, an approximate inverse M, the residual
/// r = -K x (zero on fixed rows), the preconditioned residual z, and the last step p.
///
/// Columns advance together. One that is not `active` needs no more work: its z is not read again, its step is zero, and what is told
/// of it but for its energies may be that of before.
///
/// A cycle has two halves. The way down from the residual, [`Operator::descend`], tells RᵀMR, how much energy there is to
/// shed as far as M knows; z is made on the way up, by [`Operator::precondition`] or [`Operator::precondition_and_step`].
pub(super) trait Operator {
    /// Number of columns.
    fn columns(&self) -> usize;

    /// Where the fields stand. `residual` must be called before when rows changed.
    fn state(&self) -> &State;

    /// r = -K x, recomputed everywhere, and with it [`Operator::state`].
    fn evaluate(&mut self);

    /// Takes the fields for where a steady motion leads them, if they are known to be in one, and [`Operator::state`] with
    /// them; they need not be moved for that. What has to be told of rows that changed before the way down may be told meanwhile.
    fn go_ahead(&mut self) {}

    /// RᵀMR of the active columns, row by row, all pairs.
    fn descend(&mut self, active: &[bool]);

    /// What [`Operator::descend`] told last.
    fn gains(&self) -> &[f64];

    /// The part of it that the sweep on the finest level told, which sees errors of a few elements only.
    fn finest_gains(&self) -> &[f64];

    /// Whether gains are told of all pairs, after so many steps, by an M that leaves little to guess. Where there are bodies
    /// of very high permittivity, several steps may leave much that it does not know of: measured with contrasts of a
    /// million, up to three and a half times the tolerance, and more from frame to frame.
    fn foretells(&self, steps: usize) -> bool;

    /// z = M r, after [`Operator::descend`].
    fn precondition(&mut self, active: &[bool]);

    /// [`Operator::precondition`], then [`Operator::step`] by a z: for operators that can do both in one go.
    fn precondition_and_step(&mut self, active: &[bool], a: &[f64], b: &[f64]) {
        self.precondition(active);
        self.step(a, b);
    }

    /// zᵀKz and zᵀKp of each column.
    fn curvatures(&mut self, active: &[bool]) -> (&[f64], &[f64]);

    /// p = a z + b p, x += p, then as [`Operator::evaluate`], with rᵀp.
    fn step(&mut self, a: &[f64], b: &[f64]);
}

/// What is known of the fields after they were evaluated.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// XᵀKX over all rows, row by row: the energies of all pairs of columns.
    pub(super) energies: Vec<f64>,
    /// rᵀp of each column, p the last step, after it.
    pub(super) along: Vec<f64>,
    /// Σ (Kx)² over free rows, which is Σ r², and over the rows at 1 V, of each column.
    pub(super) residual: Vec<f64>,
    pub(super) charge: Vec<f64>,
}

impl State {
    pub(super) fn new(columns: usize) -> Self {
        let zeros = || vec![0.0; columns];
        Self { energies: vec![0.0; columns * columns], along: zeros(), residual: zeros(), charge: zeros() }
    }

    pub(super) fn clear(&mut self) {
        for sums in [&mut self.energies, &mut self.along, &mut self.residual, &mut self.charge] {
            sums.fill(0.0);
        }
    }
    /// Adds another's sums.
    pub(super) fn add(&mut self, other: &Self) {
        let Self { energies, along, residual, charge } = self;
        let pairs = energies.iter_mut().zip(&other.energies).chain(along.iter_mut().zip(&other.along));
        let squares = residual.iter_mut().zip(&other.residual).chain(charge.iter_mut().zip(&other.charge));
        pairs.chain(squares).for_each(|(sum, part)| *sum += part);
    }
}

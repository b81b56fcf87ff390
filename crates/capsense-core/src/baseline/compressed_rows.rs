//! A sparse matrix in compressed rows with 32-bit indices, for one column at a time.

/// Values by rows.
#[derive(Clone, Debug)]
pub(super) struct CompressedRows {
    pub(super) offsets: Vec<u32>,
    pub(super) columns: Vec<u32>,
    pub(super) values: Vec<f64>,
}

impl CompressedRows {
    /// y = A x; returns xᵀy.
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64]) -> f64 {
        let mut product = 0.0;
        for ((y, x_here), ends) in y.iter_mut().zip(x).zip(self.offsets.windows(2)) {
            let entries = ends[0] as usize..ends[1] as usize;
            let row = self.columns[entries.clone()].iter().zip(&self.values[entries]);
            *y = row.map(|(&column, value)| value * x[column as usize]).sum();
            product += x_here * *y;
        }
        product
    }
}

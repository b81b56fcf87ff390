//! What a body changes of C, and by how much two such changes differ.

use crate::capacitance::{CapacitanceMatrix, upper_triangle};

/// Electrodes that feel less than this part of what the one that feels most does are compared as if they felt so much.
const FELT: f64 = 0.01;

/// What a body changes of C, the upper triangle row by row, in farads.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    size: usize,
    farads: Vec<f64>,
}

/// By how much entries of a change are off, relative to √(ΔC_ii ΔC_jj).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeError {
    /// The root of the mean square over all entries.
    pub of_all: f64,
    /// That of the worst entry.
    pub largest: f64,
}

impl Change {
    /// The difference of two matrices of one sensor: of the empty scene, and with the body.
    pub fn between(empty: &CapacitanceMatrix, with_body: &CapacitanceMatrix) -> Self {
        let size = empty.size();
        let farads = upper_triangle(size).map(|(i, j)| with_body.get(i, j) - empty.get(i, j)).collect();
        Self { size, farads }
    }

    /// A change that was worked out elsewhere: the upper triangle row by row, in farads. None where these are not as many as
    /// `size` electrodes have, or one is not finite.
    pub fn from_farads(size: usize, farads: Vec<f64>) -> Option<Self> {
        let fits = farads.len() == size * (size + 1) / 2 && farads.iter().all(|value| value.is_finite());
        fits.then_some(Self { size, farads })
    }

    /// The upper triangle row by row, in farads.
    pub fn farads(&self) -> &[f64] {
        &self.farads
    }

    /// By how much the change is off a reference of the same sensor; none where that is felt by no electrode.
    pub fn error(&self, reference: &Self) -> Option<ChangeError> {
        let scales = reference.scales()?;
        let squares = self
            .farads
            .iter()
            .zip(&reference.farads)
            .zip(&scales)
            .map(|((ours, theirs), scale)| ((ours - theirs) / scale).powi(2));
        let (sum, largest) = squares.fold((0.0, 0.0f64), |(sum, most), e| (sum + e, most.max(e)));
        Some(ChangeError { of_all: (sum / self.farads.len() as f64).sqrt(), largest: largest.sqrt() })
    }

    /// What errors of entries are relative to, √(ΔC_ii ΔC_jj), in farads; none where no electrode feels the body.
    pub(super) fn scales(&self) -> Option<Vec<f64>> {
        let felt: Vec<f64> = upper_triangle(self.size)
            .zip(&self.farads)
            .filter_map(|((i, j), farads)| (i == j).then_some(*farads))
            .collect();
        let most = felt.iter().copied().fold(0.0, f64::max);
        let felt = |i: usize| felt[i].max(FELT * most);
        (most > 0.0).then(|| upper_triangle(self.size).map(|(i, j)| (felt(i) * felt(j)).sqrt()).collect())
    }
}

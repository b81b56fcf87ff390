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
        let felt: Vec<f64> = upper_triangle(self.size)
            .zip(&reference.farads)
            .filter_map(|((i, j), farads)| (i == j).then_some(*farads))
            .collect();
        let most = felt.iter().copied().fold(0.0, f64::max);
        if most <= 0.0 {
            return None;
        }
        let scales: Vec<f64> = felt.into_iter().map(|felt| felt.max(FELT * most)).collect();
        let entries = self.farads.iter().zip(&reference.farads);
        let squares = upper_triangle(self.size)
            .zip(entries)
            .map(|((i, j), (ours, theirs))| (ours - theirs).powi(2) / (scales[i] * scales[j]));
        let (sum, largest) = squares.fold((0.0, 0.0f64), |(sum, most), e| (sum + e, most.max(e)));
        Some(ChangeError { of_all: (sum / self.farads.len() as f64).sqrt(), largest: largest.sqrt() })
    }
}

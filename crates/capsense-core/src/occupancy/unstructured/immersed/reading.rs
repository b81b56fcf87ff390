//! Which corners of an element are in a body, as the spans of its edges say: each way to divide the corners is a reading of them.
//!
//! A plane between the corners explains an edge if the body fills it from a corner inside up to some point, or all or nothing of it. What it
//! does not explain of any edge is a doubt, and the reading with the least is that which counts. At a corner that comes to be in a surface alone, two readings have no
//! doubt, and their planes are the same. Elsewhere, as in a body thinner than the element, whose one surface may pass a corner while the
//! other is far away, two readings come to have the same doubt and other planes. So all that have less than twice the least doubt count, the more
//! the less they have, and nothing jumps. A reading with all corners on one side stands for the edge rule, to which bodies are left that lie between corners.

use super::super::super::Filled;
use crate::mesh::EdgeShare;

/// Readings with as many times the least doubt count no more.
const DOUBTFUL: f64 = 2.0;

/// How much more it speaks against a corner inside that an edge from there begins beside the body, than what is in the body of an edge between corners
/// beside it speaks against these. With 1, a body in the middle of an edge would be taken to reach one end of it.
const BESIDE: f64 = 2.0;

/// A way to divide an element's corners.
pub(super) struct Reading {
    /// Which corners are in the body.
    pub(super) inside: [bool; 4],
    /// Those of all readings add up to 1.
    pub(super) share: f64,
}

/// The readings that count.
pub(super) fn readings(filled: &[Filled; 6]) -> impl Iterator<Item = Reading> {
    let of_edges = filled.each_ref().map(doubts);
    let doubt = |reading: usize| -> f64 {
        let edges = of_edges.iter().zip(EdgeShare::CORNERS);
        edges.map(|(doubts, [i, j])| doubts[reading >> i & 1][reading >> j & 1]).sum()
    };
    let all: [f64; 16] = std::array::from_fn(doubt);
    let least = all.into_iter().fold(f64::INFINITY, f64::min);
    let share = move |doubt: f64| match least > 0.0 {
        true => (DOUBTFUL - doubt / least).max(0.0),
        false => f64::from(u8::from(doubt == least)),
    };
    let sum: f64 = all.into_iter().map(share).sum();
    let counts = all.into_iter().enumerate().filter(move |(_, doubt)| share(*doubt) > 0.0);
    counts.map(move |(reading, doubt)| Reading {
        inside: std::array::from_fn(|corner| reading >> corner & 1 == 1),
        share: share(doubt) / sum,
    })
}

/// What an edge has against each of its corners being inside (1) or not (0), in squares of parts of it.
fn doubts(filled: &Filled) -> [[f64; 2]; 2] {
    let part = filled.part();
    let before = BESIDE * part.min(filled.span.enter);
    let after = BESIDE * part.min(1.0 - filled.span.exit);
    [[part, after], [before, 1.0 - part]].map(|of_first| of_first.map(|doubt| doubt * doubt))
}

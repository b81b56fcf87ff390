//! What a sensor measures of a body at any place on a surface: computed at the points of a grid, smooth in between.

use capsense::Scene;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::geometry::Pose;
use capsense::core::glam::DVec2;
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;

/// Capacitance matrices over a surface with two coordinates.
pub(crate) struct Map {
    origin: DVec2,
    step: DVec2,
    size: [usize; 2],
    entries: Vec<(usize, usize)>,
    /// Of each point all entries in farads.
    values: Vec<Vec<f64>>,
}

impl Map {
    /// Puts the scene's only object at the places that `pose` has for the points of a grid.
    pub(crate) fn new(
        scene: &Scene,
        (low, high): (DVec2, DVec2),
        step: DVec2,
        pose: impl Fn(DVec2) -> Pose,
    ) -> anyhow::Result<Self> {
        let size = ((high - low) / step).to_array().map(|n| n.round() as usize + 1);
        let electrodes = scene.electrodes.len();
        let entries: Vec<_> =
            (0..electrodes).flat_map(|row| (row..electrodes).map(move |column| (row, column))).collect();
        let mut simulator = Simulator::with_interface(
            scene.build_sensor()?,
            vec![scene.objects[0].material],
            scene.solver,
            scene.interface,
        )?;
        let mut solids = Solids::new(&[scene.objects[0].shape.clone()])?;
        let mut values = Vec::with_capacity(size[0] * size[1]);
        for point in 0..size[0] * size[1] {
            // There and back, so that each field begins at a neighbour's.
            let row = point / size[0];
            let column = if row % 2 == 0 { point % size[0] } else { size[0] - 1 - point % size[0] };
            let place = low + step * DVec2::new(column as f64, row as f64);
            solids.place(&[pose(place)])?;
            let _ = simulator.step(&solids)?;
            values.push(listed(&entries, simulator.capacitance()));
        }
        for row in values.chunks_mut(size[0]).skip(1).step_by(2) {
            row.reverse();
        }
        Ok(Self { origin: low, step, size, entries, values })
    }

    /// Number of an entry.
    pub(crate) fn entry(&self, row: usize, column: usize) -> usize {
        self.entries.iter().position(|entry| *entry == (row, column)).unwrap_or_default()
    }

    /// An entry with the body at a place: Catmull and Rom's cubic in both directions; at places beyond the grid, what is on
    /// its border.
    pub(crate) fn at(&self, entry: usize, place: DVec2) -> f64 {
        let scaled = (place - self.origin) / self.step;
        let (columns, by_x) = cubic(scaled.x, self.size[0]);
        let (rows, by_y) = cubic(scaled.y, self.size[1]);
        let row_of = |row: usize| -> f64 {
            (0..4).map(|k| by_x[k] * self.values[row * self.size[0] + columns[k]][entry]).sum()
        };
        (0..4).map(|k| by_y[k] * row_of(rows[k])).sum()
    }
}

fn listed(entries: &[(usize, usize)], matrix: &CapacitanceMatrix) -> Vec<f64> {
    entries.iter().map(|&(row, column)| matrix.get(row, column)).collect()
}

/// The four points around a place on a line, and their weights.
fn cubic(place: f64, points: usize) -> ([usize; 4], [f64; 4]) {
    let place = place.clamp(0.0, (points - 1) as f64);
    let first = (place as usize).min(points - 2);
    let t = place - first as f64;
    let index = |offset: usize| (first + offset).saturating_sub(1).min(points - 1);
    let weights = [
        0.5 * t * (-1.0 + t * (2.0 - t)),
        1.0 + 0.5 * t * t * (-5.0 + 3.0 * t),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (-1.0 + t),
    ];
    ([0, 1, 2, 3].map(index), weights)
}

//! Lattices that suit a sensor's electrodes and board.

use super::grading::{Grading, Pattern, Variation};
use super::{IN_PLANE, SensorDesign, SensorError};
use crate::electrode::{Electrode, Outline, join_near};
use crate::geometry::Aabb;
use crate::mesh::{Along, InvalidAxis, Lattice, spaced_axis};
use glam::DVec2;

/// Bisections of the lattice spacing: to 1e-6 of it. The count jumps there, and closer to the jump rounding would give
/// mirrored intervals different numbers of cells.
pub(super) const SPACING_STEPS: usize = 24;

/// Heights of layers that are tried, in relation to what usually is best; the first is the most.
const HEIGHTS: [f64; 9] = [3.0, 2.0, 1.5, 1.3, 1.15, 1.0, 0.9, 0.8, 0.7];

/// What unusual heights cost.
const UNUSUAL: f64 = 1.5;

/// By which factors cells at an electrode's edge may be larger than the room to the next plane, besides any.
const CROWDING: [f64; 2] = [1.0, 2.0];

/// How many of the smallest distances between electrode edges are tried as that within which edges share a plane, and the
/// largest, in parts of a cell.
const SHARINGS: usize = 3;
const LARGEST_SHARING: f64 = 0.7;

/// Where there are fewer tetrahedra, cells are as large as electrodes, and neither helps in general.
const FEW: usize = 12_000;

/// Cells on both sides of an electrode's edge may differ by this factor before that costs something.
const UNEVEN: f64 = 1.6;

/// What it costs that edges are in no plane, by how far they are from it in relation to cells.
const DISPLACED: f64 = 1.0;

/// How lattices vary that are compared with each other: in the heights of layers, and by which factor cells are longer along x
/// and shorter along y.
const VARIED_HEIGHTS: [f64; 5] = [1.0, 1.2, 1.45, 0.9, 0.8];
const VARIED_ASPECTS: [f64; 3] = [1.0, 0.8, 1.25];

/// How high lower layers are.
const LOWER_HEIGHTS: [f64; 4] = [0.95, 0.9, 0.85, 0.8];

/// Lattices of less than this part of the tetrahedra are none of those that vary.
const WORTH_COMPARING: f64 = 0.6;

/// Intervals in which outlines are curved or oblique are one where fewer cells than this fit between them: planes at the ends
/// of each would be squeezed.
const JOINED: f64 = 2.5;

/// How far from electrodes a wall still tells where bodies move, in parts of what the electrodes extend over, and in metres
/// at least. Bodies move half as far.
const REACH: f64 = 5.0;
const LEAST_REACH: f64 = 0.5;

impl SensorDesign {
    /// The finest graded lattice of at most so many tetrahedra: electrode planes and the board lie in lattice planes, as do
    /// electrode edges, unless those of different electrodes are so close to each other that they share one; spacing is smallest
    /// there and grows away from them.
    ///
    /// # Errors
    /// When the design is invalid or even the coarsest lattice has more tetrahedra.
    pub fn lattice(&self, max_tets: usize) -> Result<Lattice, SensorError> {
        self.validate()?;
        let pattern = self.pattern();
        let highest = Variation { height: HEIGHTS[0], ..Variation::USUAL };
        let extent = self.domain.size().max_element();
        let coarsest = self.graded_lattice(Grading::for_workspace(extent, highest, max_tets, pattern))?;
        if coarsest.tet_count() > max_tets {
            return Err(SensorError::TooFewElements { allowed: max_tets, needed: coarsest.tet_count() });
        }
        // Electrodes allow for few spacings along x and y; what these leave of the elements goes into the layers. Where they are
        // so narrow that none of a lattice's nodes are within them, they need more than their part.
        let uneven = if max_tets < FEW { f64::INFINITY } else { UNEVEN };
        let mut best = ((true, f64::INFINITY), coarsest);
        for height in HEIGHTS {
            for (finest, lattice) in self.finest_lattices(max_tets, height, 1.0)? {
                // As many elements are as good with finer layers as with finer cells in them, but for what is unusual.
                let fit = self.fit(&lattice);
                let coarseness = finest.min(pattern.feature)
                    * height.sqrt()
                    * (1.0 + UNUSUAL * height.ln().powi(2))
                    * (fit.unevenness / uneven).max(1.0)
                    * (1.0 + DISPLACED * fit.displacement / finest);
                let rank = (!self.is_resolved_by(&lattice), coarseness);
                if lattice.tet_count() <= max_tets && rank < best.0 {
                    best = (rank, lattice);
                }
            }
        }
        Ok(best.1)
    }

    /// Lattices of at most so many tetrahedra, one of which may suit the electrodes better than [`SensorDesign::lattice`], which may
    /// be among them: with higher or lower layers, finer along x or along y, with cells that follow electrode edges close to each
    /// other more or less, or with planes that these share. None twice.
    ///
    /// # Errors
    /// When the design is invalid.
    pub fn varied_lattices(&self, max_tets: usize) -> Result<Vec<Lattice>, SensorError> {
        self.validate()?;
        let mut lattices = Vec::new();
        let least = (WORTH_COMPARING * max_tets as f64) as usize;
        for aspect in VARIED_ASPECTS {
            for height in VARIED_HEIGHTS {
                for (_, lattice) in self.finest_lattices(max_tets, height, aspect)? {
                    let is_worth =
                        (least..=max_tets).contains(&lattice.tet_count()) && self.is_resolved_by(&lattice);
                    if is_worth && !lattices.contains(&lattice) {
                        lattices.push(lattice);
                    }
                }
            }
        }
        Ok(lattices)
    }

    /// The finest lattices of at most so many tetrahedra whose layers are 0.95 to 0.8 times as high, in relation to cells at electrodes'
    /// edges, as those of [`SensorDesign::lattice`] usually are; of so few that there is none, fewer. Where there are many, bodies that
    /// are away from the electrodes may need them.
    ///
    /// # Errors
    /// When the design is invalid.
    pub fn lattices_of_lower_layers(&self, max_tets: usize) -> Result<Vec<Lattice>, SensorError> {
        self.validate()?;
        let mut lattices = Vec::new();
        for height in LOWER_HEIGHTS {
            let (_, lattice) = self.finest_varied(max_tets, Variation { height, ..Variation::USUAL })?;
            if lattice.tet_count() <= max_tets {
                lattices.push(lattice);
            }
        }
        Ok(lattices)
    }

    /// The finest lattices of at most so many tetrahedra, with the spacing at electrodes: one for each crowding that makes a
    /// difference, and one for each distance within which electrode edges may share a plane. Of few tetrahedra the usual one.
    fn finest_lattices(
        &self,
        max_tets: usize,
        height: f64,
        aspect: f64,
    ) -> Result<Vec<(f64, Lattice)>, SensorError> {
        let usual = Variation { height, aspect, ..Variation::USUAL };
        let finest = |variation| self.finest_varied(max_tets, variation);
        let mut lattices = vec![finest(usual)?];
        if max_tets < FEW {
            return Ok(lattices);
        }
        for crowding in CROWDING {
            let crowded = finest(Variation { crowding, ..usual })?;
            if crowded.1 == lattices[0].1 {
                break;
            }
            lattices.push(crowded);
        }
        // With a plane between its own edges, an electrode would be a line.
        let own = |outline: &Outline| (0..2).flat_map(|axis| distances(outline.axis_planes(axis))).collect();
        let narrowest = self.outlines().flat_map::<Vec<f64>, _>(own).fold(f64::INFINITY, f64::min);
        let largest = (LARGEST_SHARING * lattices[0].0).min((1.0 - IN_PLANE) * narrowest);
        let mut sharings = self.distances();
        sharings.dedup_by(|b, a| *b - *a <= self.slack());
        for sharing in sharings.into_iter().take(SHARINGS).take_while(|sharing| *sharing <= largest) {
            lattices.push(finest(Variation { sharing: sharing * (1.0 + IN_PLANE), ..usual })?);
        }
        Ok(lattices)
    }

    /// The finest lattice of one variation, as of [`SensorDesign::finest_lattice`].
    fn finest_varied(&self, max_tets: usize, variation: Variation) -> Result<(f64, Lattice), SensorError> {
        let pattern = self.pattern();
        self.finest_lattice(max_tets, |finest| Grading::for_workspace(finest, variation, max_tets, pattern))
    }

    fn outlines(&self) -> impl Iterator<Item = &Outline> {
        self.electrodes.iter().map(|electrode| &electrode.outline)
    }

    /// Coordinates that differ by no more than this are the same but for rounding.
    fn slack(&self) -> f64 {
        IN_PLANE * self.domain.size().max_element()
    }

    /// How far electrode edges that follow each other along x or y are apart, ascending.
    fn distances(&self) -> Vec<f64> {
        let of_axis =
            |axis| distances(self.outlines().flat_map(|outline| outline.axis_planes(axis)).collect());
        let mut all: Vec<f64> = (0..2).flat_map(of_axis).filter(|d| *d > self.slack()).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    /// How a lattice fits the electrodes' edges.
    fn fit(&self, lattice: &Lattice) -> Fit {
        let mut fit = Fit { displacement: 0.0, unevenness: 1.0 };
        let mut edges = 0;
        for axis in 0..2 {
            let planes = &lattice.axes()[axis];
            for edge in self.outlines().flat_map(|outline| outline.axis_planes(axis)) {
                let from = |at: &usize| (planes[*at] - edge).abs();
                let nearest = (1..planes.len() - 1).min_by(|a, b| from(a).total_cmp(&from(b)));
                let Some(at) = nearest else { continue };
                let ratio = (planes[at + 1] - planes[at]) / (planes[at] - planes[at - 1]);
                fit.unevenness = fit.unevenness.max(ratio).max(ratio.recip());
                fit.displacement += from(&at);
                edges += 1;
            }
        }
        fit.displacement /= f64::from(edges.max(1));
        fit
    }

    /// Whether each electrode has a node within its rim.
    fn is_resolved_by(&self, lattice: &Lattice) -> bool {
        let [xs, ys, _] = lattice.axes();
        let slack = IN_PLANE * self.domain.size().max_element();
        self.electrodes.iter().all(|Electrode { outline, .. }| {
            let [low, high] = outline.bounds();
            let between = |low: f64, high: f64| move |x: &&f64| (low..=high).contains(*x);
            xs.iter().filter(between(low.x, high.x)).any(|&x| {
                let mut nodes = ys.iter().filter(between(low.y, high.y)).map(|&y| DVec2::new(x, y));
                nodes.any(|node| outline.contains(node) && outline.distance_to_rim(node) > slack)
            })
        })
    }

    /// The lattice of the finest spacing that has no more tetrahedra, and this spacing; the coarsest if that has more.
    pub(super) fn finest_lattice(
        &self,
        max_tets: usize,
        grading: impl Fn(f64) -> Grading,
    ) -> Result<(f64, Lattice), SensorError> {
        let extent = self.domain.size().max_element();
        // The count falls with the spacing (but for rounding): bisect on the logarithm of the spacing.
        let (mut fits, mut exceeds) = (extent, 1e-5 * extent);
        let mut best = self.graded_lattice(grading(extent))?;
        for _ in 0..SPACING_STEPS {
            let middle = (fits * exceeds).sqrt();
            let lattice = self.graded_lattice(grading(middle))?;
            if lattice.tet_count() <= max_tets {
                (fits, best) = (middle, lattice);
            } else {
                exceeds = middle;
            }
        }
        Ok((fits, best))
    }

    /// What a lattice should know of the electrodes.
    fn pattern(&self) -> Pattern {
        let rims = self.outlines().map(Outline::rim_along_axes).sum();
        let distances = self.distances();
        Pattern { rims, feature: distances.get(distances.len() / 2).copied().unwrap_or(f64::INFINITY) }
    }

    /// The graded lattice whose spacing at the electrodes is `finest` metres, and away from them grows by a factor from
    /// cell to cell.
    ///
    /// # Errors
    /// When the coordinates are no lattice, as for a spacing that is not positive or a factor below one.
    pub fn lattice_of_spacing(&self, finest: f64, growth: f64) -> Result<Lattice, SensorError> {
        if !(finest > 0.0 && growth >= 1.0 && growth.is_finite()) {
            return Err(InvalidAxis { axis: 0 }.into());
        }
        self.graded_lattice(Grading::even(finest, growth - 1.0))
    }

    /// The part of the domain that spacing is chosen for. Bodies move within reach of the sensor, however far the wall is.
    fn near(&self) -> Aabb {
        let bounds = self
            .electrodes
            .iter()
            .flat_map(|electrode| electrode.outline.bounds().map(|corner| corner.extend(electrode.z)));
        let around = Aabb::around(bounds);
        let reach = (REACH * around.size().max_element()).max(LEAST_REACH);
        Aabb {
            min: (around.min - reach).max(self.domain.min),
            max: (around.max + reach).min(self.domain.max),
        }
    }

    fn graded_lattice(&self, grading: Grading) -> Result<Lattice, SensorError> {
        let board = self.substrate.map(|board| board.bounds());
        let near = self.near();
        let mut axes = [const { Vec::new() }; 3];
        for (axis, coordinates) in axes.iter_mut().enumerate() {
            let faces: Vec<f64> = board.iter().flat_map(|board| [board.min[axis], board.max[axis]]).collect();
            let mut planes = Vec::new();
            let mut fine = Vec::new();
            if axis == 2 {
                planes.extend(self.electrodes.iter().map(|electrode| electrode.z));
            } else {
                let edges = self.outlines().flat_map(|outline| outline.axis_planes(axis)).collect();
                planes = with_planes_shared(edges, &faces, grading.sharing());
                fine.extend(self.outlines().flat_map(|outline| outline.fine_intervals(axis)));
                join_near(&mut fine, JOINED * grading.finest(axis));
            }
            planes.extend(faces);
            let fixed = || planes.iter().chain(fine.iter().flatten()).copied();
            let ends = [fixed().fold(f64::INFINITY, f64::min), fixed().fold(f64::NEG_INFINITY, f64::max)];
            let spacing = |place: Along| {
                let beyond = (near.min[axis] - place.coordinate).max(place.coordinate - near.max[axis]);
                grading.spacing(axis, &near, ends, place) + grading.far(beyond.max(0.0))
            };
            let (low, high) = (self.domain.min[axis], self.domain.max[axis]);
            *coordinates = spaced_axis(low, high, &planes, &fine, grading.unequal(axis), spacing);
        }
        Ok(Lattice::new(axes)?)
    }
}

/// How a lattice fits the electrodes' edges.
#[derive(Clone, Copy, Debug)]
struct Fit {
    /// How far edges are from the nearest planes, the mean, in metres.
    displacement: f64,
    /// By which factor cells on both sides of an edge differ at most.
    unevenness: f64,
}

/// From each coordinate to the next.
fn distances(mut coordinates: Vec<f64>) -> Vec<f64> {
    coordinates.sort_by(f64::total_cmp);
    coordinates.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Edges of which those that follow each other within a distance are replaced by the middle between the first and the last,
/// unless there are so many that one would be farther than half of that away, or a face that has a plane of its own is as near.
fn with_planes_shared(mut edges: Vec<f64>, faces: &[f64], within: f64) -> Vec<f64> {
    edges.sort_by(f64::total_cmp);
    let groups = edges.chunk_by(|a, b| b - a <= within).flat_map(|group| {
        let (first, last) = (group[0], group[group.len() - 1]);
        let has_face = faces.iter().any(|face| (first - within..=last + within).contains(face));
        match last - first <= within && !has_face {
            true => vec![0.5 * (first + last)],
            false => group.to_vec(),
        }
    });
    groups.collect()
}

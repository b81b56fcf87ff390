//! What a sensor is meant to be, before it has a mesh: its electrodes, the board below them, and the lattices that suit
//! them.

use super::grading::{Grading, Pattern};
use super::{FREE, IN_PLANE, SensorError, Wall};
use crate::electrode::Electrode;
use crate::geometry::Aabb;
use crate::material::RelativePermittivity;
use crate::mesh::{InvalidAxis, Lattice, spaced_axis};
use glam::{DVec2, DVec3};

/// Bisections of the lattice spacing: to 1e-6 of it. The count jumps there, and closer to the jump rounding would give
/// mirrored intervals different numbers of cells.
pub(super) const SPACING_STEPS: usize = 24;

/// Heights of layers that are tried, in relation to what usually is best; the first is the most.
const HEIGHTS: [f64; 9] = [3.0, 2.0, 1.5, 1.3, 1.15, 1.0, 0.9, 0.8, 0.7];

/// How far from electrodes a wall still tells where bodies move, in parts of what the electrodes extend over, and in metres
/// at least. Bodies move half as far.
const REACH: f64 = 5.0;
const LEAST_REACH: f64 = 0.5;

/// What unusual heights cost.
const UNUSUAL: f64 = 1.5;

/// The board below the electrodes: its top is the plane z = 0, its centre the sensor's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substrate {
    /// Thickness in metres.
    pub thickness: f64,
    /// Relative permittivity of the board.
    pub relative_permittivity: RelativePermittivity,
    /// Extent along x and y in metres.
    pub size: DVec2,
    /// Whether its far side is a grounded shield plane.
    pub grounded_back: bool,
}

impl Substrate {
    /// The space the board takes.
    pub fn bounds(&self) -> Aabb {
        let half = 0.5 * self.size;
        Aabb { min: (-half).extend(-self.thickness), max: half.extend(0.0) }
    }

    /// Whether a point lies on the far side, give or take `slack` metres.
    pub fn is_on_back(&self, point: DVec3, slack: f64) -> bool {
        (point.z + self.thickness).abs() <= slack
            && (point.truncate().abs() - 0.5 * self.size).max_element() <= slack
    }
}

/// What a sensor is meant to be, before it has a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorDesign {
    /// The simulated space.
    pub domain: Aabb,
    /// Electrodes in the order of the capacitance matrix.
    pub electrodes: Vec<Electrode>,
    /// The board below them.
    pub substrate: Option<Substrate>,
    /// What lies beyond the wall of the simulated space.
    pub wall: Wall,
}

impl SensorDesign {
    /// Checks what can be checked without a mesh.
    ///
    /// # Errors
    /// For an empty domain, no electrodes, names that repeat, unusable outlines, electrodes that touch each other or the wall or
    /// lie outside, and a board that does not fit.
    pub fn validate(&self) -> Result<(), SensorError> {
        let Aabb { min, max } = self.domain;
        if !(min.is_finite() && max.is_finite() && min.cmplt(max).all()) {
            return Err(SensorError::Domain);
        }
        check_names(self.electrodes.iter().map(|electrode| electrode.name.as_str()))?;
        for electrode in &self.electrodes {
            self.check_place(electrode)?;
        }
        let slack = IN_PLANE * self.domain.size().max_element();
        for (number, first) in self.electrodes.iter().enumerate() {
            let meets = |other: &&Electrode| {
                (other.z - first.z).abs() <= slack && first.outline.meets(&other.outline)
            };
            if let Some(second) = self.electrodes[number + 1..].iter().find(meets) {
                return Err(SensorError::Meet { first: first.name.clone(), second: second.name.clone() });
            }
        }
        if let Some(board) = &self.substrate {
            let bounds = board.bounds();
            if !(board.thickness > 0.0 && board.size.min_element() > 0.0 && bounds.min.is_finite()) {
                return Err(SensorError::Substrate("must have a positive thickness and size"));
            }
            if !(self.domain.contains(bounds.min) && self.domain.contains(bounds.max)) {
                return Err(SensorError::Substrate("reaches out of the domain"));
            }
        }
        Ok(())
    }

    fn check_place(&self, electrode: &Electrode) -> Result<(), SensorError> {
        let name = || electrode.name.clone();
        if let Some(defect) = electrode.outline.defect() {
            return Err(SensorError::Outline { name: name(), defect });
        }
        if !electrode.z.is_finite() {
            return Err(SensorError::Outline { name: name(), defect: "is not finite" });
        }
        let [low, high] = electrode.outline.bounds().map(|corner| corner.extend(electrode.z));
        if !(self.domain.contains(low) && self.domain.contains(high)) {
            return Err(SensorError::OutsideDomain(name()));
        }
        let slack = IN_PLANE * self.domain.size().max_element();
        if (low - self.domain.min).min_element() <= slack || (self.domain.max - high).min_element() <= slack {
            return Err(SensorError::TouchesWall(name()));
        }
        Ok(())
    }

    /// The finest graded lattice of at most so many tetrahedra: electrode edges, electrode planes and the board lie
    /// in lattice planes, spacing is smallest there and grows away from them.
    ///
    /// # Errors
    /// When the design is invalid or even the coarsest lattice has more tetrahedra.
    pub fn lattice(&self, max_tets: usize) -> Result<Lattice, SensorError> {
        self.validate()?;
        let extent = self.domain.size().max_element();
        let pattern = self.pattern();
        let grading = |finest: f64, height: f64| Grading::for_workspace(finest, height, max_tets, pattern);
        let coarsest = self.graded_lattice(grading(extent, HEIGHTS[0]))?;
        if coarsest.tet_count() > max_tets {
            return Err(SensorError::TooFewElements { allowed: max_tets, needed: coarsest.tet_count() });
        }
        // Electrodes allow for few spacings along x and y; what these leave of the elements goes into the layers. Where they are
        // so narrow that none of a lattice's nodes are within them, they need more than their part.
        let mut best = ((true, f64::INFINITY), coarsest);
        for height in HEIGHTS {
            let (finest, lattice) = self.finest_lattice(max_tets, |finest| grading(finest, height))?;
            // As many elements are as good with finer layers as with finer cells in them, but for what is unusual.
            let coarseness =
                finest.min(pattern.feature) * height.sqrt() * (1.0 + UNUSUAL * height.ln().powi(2));
            let rank = (!self.is_resolved_by(&lattice), coarseness);
            if lattice.tet_count() <= max_tets && rank < best.0 {
                best = (rank, lattice);
            }
        }
        Ok(best.1)
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
        let rims = self.electrodes.iter().map(|electrode| electrode.outline.rim_along_axes()).sum();
        let mut gaps: Vec<f64> = (0..2)
            .flat_map(|axis| {
                let mut edges: Vec<f64> = self
                    .electrodes
                    .iter()
                    .flat_map(|electrode| electrode.outline.axis_planes(axis))
                    .collect();
                edges.sort_by(f64::total_cmp);
                edges.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>()
            })
            .filter(|gap| *gap > IN_PLANE * self.domain.size().max_element())
            .collect();
        gaps.sort_by(f64::total_cmp);
        Pattern { rims, feature: gaps.get(gaps.len() / 2).copied().unwrap_or(f64::INFINITY) }
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
            let mut planes: Vec<f64> = board.iter().flat_map(|b| [b.min[axis], b.max[axis]]).collect();
            let mut fine = Vec::new();
            for electrode in &self.electrodes {
                if axis == 2 {
                    planes.push(electrode.z);
                } else {
                    planes.extend(electrode.outline.axis_planes(axis));
                    fine.extend(electrode.outline.fine_intervals(axis));
                }
            }
            let fixed = || planes.iter().chain(fine.iter().flatten()).copied();
            let ends = [fixed().fold(f64::INFINITY, f64::min), fixed().fold(f64::NEG_INFINITY, f64::max)];
            let spacing = |place: f64, distance: f64| {
                let far = (near.min[axis] - place).max(place - near.max[axis]).max(0.0);
                grading.spacing(axis, &near, ends, place, distance) + grading.far(far)
            };
            let (low, high) = (self.domain.min[axis], self.domain.max[axis]);
            *coordinates = spaced_axis(low, high, &planes, &fine, grading.unequal(axis), spacing);
        }
        Ok(Lattice::new(axes)?)
    }
}

/// Names must be there, be few enough to be numbered, and differ.
pub(super) fn check_names<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), SensorError> {
    let mut sorted: Vec<&str> = names.collect();
    sorted.sort_unstable();
    if sorted.is_empty() {
        return Err(SensorError::NoElectrodes);
    }
    if sorted.len() > usize::from(FREE) / 2 {
        return Err(SensorError::TooManyElectrodes(sorted.len()));
    }
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(SensorError::DuplicateName(pair[0].to_owned())),
        None => Ok(()),
    }
}

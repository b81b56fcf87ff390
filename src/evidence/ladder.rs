//! Which settings are measured: series of meshes of growing size, each with one thing set otherwise than usual.

use super::published::PAPER_TIMES;
use super::setting::{MeshPlan, Method, Setting, Storage};
use super::stage::Patience;
use crate::device::Device;
use crate::scene::GeometrySource;
use capsense_core::baseline::CgOptions;
use capsense_core::occupancy::Interface;
use capsense_core::solver::Preconditioner;
use capsense_render::fields::has_adapter;

/// Tetrahedra of the meshes.
pub const SIZES: [usize; 6] = [3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000];

/// The largest of a quick run.
const LARGEST_OF_QUICK: usize = 100_000;

/// The tolerance of C in all series but those of other tolerances: that of scene files by default.
pub const TOLERANCE: f64 = 1e-4;

const OTHER_TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-5, 1e-7];

/// Errors of ΔC that meshes are asked for.
const ERRORS: [f64; 2] = [0.03, 0.01];

/// What is usual: the graded lattice, cut edges, exact solids, multigrid, one thread.
pub const USUAL: Setting = Setting {
    method: Method::Simulator,
    mesh: MeshPlan::Adapted(SIZES[0]),
    storage: Storage::Lattice,
    interface: Interface::EdgeCut,
    geometry: GeometrySource::Solids,
    preconditioner: Preconditioner::Multigrid,
    tolerance: TOLERANCE,
    device: Device::Cpu,
    threads: 1,
    patience: Patience::All,
};

/// The paper's method as it was published.
pub const PAPER: Setting = Setting {
    method: Method::Paper,
    storage: Storage::Csr,
    interface: Interface::Centroid,
    geometry: GeometrySource::Camera,
    preconditioner: Preconditioner::None,
    tolerance: CgOptions::PAPER.relative_residual,
    ..USUAL
};

/// All settings of the chart; those of a graphics device where there is a real one.
pub fn full() -> Vec<Setting> {
    let adapted = |base: Setting| ladder(base, MeshPlan::Adapted, usize::MAX);
    let mut all = adapted(USUAL);
    all.extend(paper());
    all.extend(adapted(Setting { geometry: GeometrySource::Camera, ..USUAL }));
    for interface in [Interface::Centroid, Interface::VolumeFraction] {
        for geometry in [GeometrySource::Solids, GeometrySource::Camera] {
            all.extend(adapted(Setting { interface, geometry, ..USUAL }));
        }
    }
    for interface in [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction] {
        for geometry in [GeometrySource::Solids, GeometrySource::Camera] {
            all.extend(ladder(Setting { interface, geometry, ..USUAL }, MeshPlan::Uniform, usize::MAX));
        }
    }
    for tolerance in OTHER_TOLERANCES {
        all.extend(adapted(Setting { tolerance, ..USUAL }));
    }
    let csr = Setting { storage: Storage::Csr, ..USUAL };
    all.extend(adapted(csr));
    all.extend(ladder(csr, MeshPlan::Bisected, LARGEST_OF_OTHERS));
    for (preconditioner, largest) in [
        (Preconditioner::Ic0, LARGEST_OF_OTHERS),
        (Preconditioner::Jacobi, LARGEST_OF_OTHERS),
        (Preconditioner::None, LARGEST_WITHOUT),
        (Preconditioner::Direct, LARGEST_OF_DIRECT),
    ] {
        all.extend(ladder(Setting { preconditioner, ..csr }, MeshPlan::Adapted, largest));
    }
    if has_adapter() {
        all.extend(adapted(Setting { device: Device::Gpu, ..USUAL }));
    }
    all.extend(ERRORS.map(|error| Setting { mesh: MeshPlan::ForError(error), ..USUAL }));
    all
}

/// Those of a run that ends within two minutes.
pub fn quick() -> Vec<Setting> {
    let adapted = |base: Setting| ladder(base, MeshPlan::Adapted, LARGEST_OF_QUICK);
    let mut all = adapted(USUAL);
    all.extend(paper().into_iter().take(2));
    all.extend(adapted(Setting { geometry: GeometrySource::Camera, ..USUAL }));
    for interface in [Interface::Centroid, Interface::VolumeFraction] {
        all.extend(adapted(Setting { interface, ..USUAL }));
    }
    all.extend(ladder(USUAL, MeshPlan::Uniform, LARGEST_OF_QUICK));
    all.extend(adapted(Setting { tolerance: 1e-2, ..USUAL }));
    let csr = Setting { storage: Storage::Csr, ..USUAL };
    for preconditioner in [Preconditioner::Multigrid, Preconditioner::Ic0, Preconditioner::Jacobi] {
        all.extend(ladder(Setting { preconditioner, ..csr }, MeshPlan::Adapted, 30_000));
    }
    all.extend(ladder(Setting { preconditioner: Preconditioner::Direct, ..csr }, MeshPlan::Adapted, 10_000));
    all
}

/// Numbers of tetrahedra above which a frame takes seconds.
const LARGEST_OF_OTHERS: usize = 300_000;
const LARGEST_WITHOUT: usize = 100_000;
const LARGEST_OF_DIRECT: usize = 100_000;

/// The paper's method on meshes as large as those that its times were published of.
fn paper() -> Vec<Setting> {
    PAPER_TIMES.map(|(tets, _)| Setting { patience: patience_of_paper(tets), ..sized(PAPER, tets) }).to_vec()
}

/// The paper's method on a mesh of so many tetrahedra is run for so many frames.
pub(super) fn patience_of_paper(tets: usize) -> Patience {
    match tets {
        ..=10_000 => Patience::All,
        10_001..=40_000 => Patience::Some,
        _ => Patience::Little,
    }
}

fn sized(base: Setting, tets: usize) -> Setting {
    Setting { mesh: MeshPlan::Adapted(tets), ..base }
}

/// A setting on meshes of all sizes up to the largest.
fn ladder(base: Setting, plan: fn(usize) -> MeshPlan, largest: usize) -> Vec<Setting> {
    let sizes = SIZES.into_iter().filter(|size| *size <= largest);
    sizes.map(|size| Setting { mesh: plan(size), patience: patience(&base, size), ..base }).collect()
}

/// Preconditioners that take long on large meshes are run for few frames.
fn patience(base: &Setting, tets: usize) -> Patience {
    let is_slow = base.preconditioner != Preconditioner::Multigrid;
    match tets {
        100_000.. if is_slow => Patience::Little,
        30_000.. if is_slow => Patience::Some,
        _ => Patience::All,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::table::Row;

    #[test]
    fn no_setting_is_measured_twice_and_a_quick_run_is_a_part_of_the_whole() {
        let (full, quick) = (full(), quick());
        for settings in [&full, &quick] {
            for (index, setting) in settings.iter().enumerate() {
                let row = Row::of(setting);
                assert!(settings[..index].iter().all(|other| !row.is_of(other)), "{setting:?}");
            }
        }
        assert!(quick.iter().all(|setting| full.contains(setting)));
    }

    #[test]
    fn what_the_chart_is_to_show_is_measured() {
        let full = full();
        let has = |wanted: &dyn Fn(&Setting) -> bool| assert!(full.iter().any(wanted));
        for size in SIZES {
            has(&|s| s.mesh == MeshPlan::Uniform(size) && s.geometry == GeometrySource::Camera);
            for interface in [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction] {
                for geometry in [GeometrySource::Camera, GeometrySource::Solids] {
                    let is = |s: &Setting| s.interface == interface && s.geometry == geometry;
                    has(&|s| s.mesh == MeshPlan::Adapted(size) && is(s));
                }
            }
        }
        for preconditioner in
            [Preconditioner::Ic0, Preconditioner::Jacobi, Preconditioner::None, Preconditioner::Direct]
        {
            has(&|s| s.preconditioner == preconditioner);
        }
        for (tets, _) in PAPER_TIMES {
            has(&|s| s.method == Method::Paper && s.mesh == MeshPlan::Adapted(tets));
        }
        has(&|s| matches!(s.mesh, MeshPlan::ForError(_)));
    }
}

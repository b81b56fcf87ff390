//! Coarser levels that follow later than the finest one.

use super::*;
use crate::instructions::EightLanes;
use crate::mesh::Edges;
use crate::solver::lattice::hierarchy::Hierarchy;
use crate::solver::lattice::layout::Layout;
use std::cell::Cell;

/// Lets a hierarchy follow a matrix, coarser levels for so many stages behind the second level.
fn refresh(hierarchy: &mut Hierarchy, scene: &Scene, changed: &[u32], stages: usize) {
    let (arch, left) = (EightLanes::new(), Cell::new(stages));
    hierarchy.refresh_finest(arch, &scene.matrix, &scene.fixed, changed, false);
    let (finest, coarser) = hierarchy.split();
    let _ = finest.refresh(arch);
    coarser.unwrap().refresh(&Workers::default(), arch, || left.replace(left.get().saturating_sub(1)) > 0);
}

fn networks(hierarchy: &Hierarchy) -> Vec<Vec<f32>> {
    let numbers = |stencil: &Stencil<f32>| {
        stencil.next.iter().chain([&stencil.centre]).flatten().flatten().copied().collect()
    };
    hierarchy.levels.iter().map(|level| numbers(&level.stencil)).collect()
}

/// What the way down from residuals without a pattern leaves on the second level, and what it tells.
fn descend(hierarchy: &mut Hierarchy, workers: &Workers, seed: u64) -> (Vec<f32>, [Vec<f64>; 2]) {
    let mut next = noise(seed);
    hierarchy.levels[0].b.iter_mut().flatten().for_each(|b| *b = next() as f32);
    let mut gains = [vec![0.0; COLUMNS * COLUMNS], vec![0.0; COLUMNS * COLUMNS]];
    let told = gains.each_mut().map(|gains| &mut gains[..]);
    hierarchy.descend(workers, EightLanes::new(), &[0, 1, 2], told);
    (hierarchy.levels[1].b.concat(), gains)
}

/// Levels that were left behind after any stage follow beside the way down, which tells the same, and at the latest before the
/// finest level changes again; however threads share the planes meanwhile, and whether or not outer planes are fixed.
#[test]
fn levels_that_are_behind_follow_when_they_are_needed() {
    let [mut scene, mut moved] = [Scene::new(), Scene::new()];
    let all: Vec<u32> = (0..scene.nodes.len() as u32).collect();
    scene.step(0.1);
    moved.step(0.1);
    moved.step(0.3);
    let changed: Vec<u32> =
        moved.matrix.changed_rows().iter().chain(moved.occupancy.changed_nodes()).copied().collect();
    let Edges::Lattice(lattice) = scene.matrix.network().edges() else { panic!("no lattice") };
    let (alone, two) = (Workers::default(), Workers::new(2, 1_000_000));
    let _awake = two.wake_all();
    for (margin, threads) in [0, 1].into_iter().flat_map(|margin| [1, 2, 3].map(|threads| (margin, threads)))
    {
        let layout = Layout::new(lattice.node_counts(), [margin; 2]);
        let mut before = Hierarchy::new(lattice, layout, COLUMNS, threads);
        refresh(&mut before, &scene, &all, usize::MAX);
        // Of that, nothing may be told again.
        let _ = descend(&mut before, &alone, 6);
        let mut whole = before.clone();
        refresh(&mut whole, &moved, &changed, usize::MAX);
        let (expected, told) = (networks(&whole), descend(&mut whole, &alone, 5));
        let mut were_behind = 0;
        for stages in 0..20 {
            let mut behind = before.clone();
            refresh(&mut behind, &moved, &changed, stages);
            were_behind += usize::from(networks(&behind) != expected);
            let mut follows = behind.clone();
            follows.follow_all(&alone, EightLanes::new());
            assert!(networks(&follows) == expected, "{margin} {threads} {stages}");
            for workers in [&alone, &two] {
                let mut follows = behind.clone();
                assert!(descend(&mut follows, workers, 5) == told, "{margin} {threads} {stages}");
                assert!(networks(&follows) == expected, "{margin} {threads} {stages}");
            }
        }
        assert!((3..20).contains(&were_behind), "{were_behind}");
    }
}

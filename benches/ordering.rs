//! What the order of nodes and elements in memory means for frames on meshes that are no lattice: as the mesh was made,
//! shuffled, and as scenes sort meshes from files (`TetMesh::order_in_space`).
//!
//! Prints the mean milliseconds of an update and of a solve, one thread, C to 1e-4; the orders take turns. Arguments are
//! Gmsh files in metres that fit the domain of the benches, with nodes on the three electrodes; without any, bisected
//! lattices are measured.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense::gmsh;
use capsense_core::material::{Connection, Material};
use capsense_core::mesh::{Bisection, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::units::LengthUnit;
use common::{Motion, design, is_large, is_test, solver_options};
use std::time::Instant;

/// Every n-th image of a motion is a frame: 4 mm.
const STRIDE: usize = 4;

/// Ways there and back that count; one before does not.
const WAYS: usize = 2;

/// A lattice with an eighth of the elements, refined towards the electrodes.
fn bisected(elements: usize) -> TetMesh {
    let mut mesh = Bisection::new(&design().lattice(elements / 8).unwrap()).unwrap();
    let _ = mesh.refine_to_size(
        |at| 5e-4 + 0.02 * (at.z.abs() + (at.x.abs() - 0.05).max(0.0) + (at.y.abs() - 0.04).max(0.0)),
        elements,
    );
    mesh.into_tet_mesh().unwrap()
}

fn sensor(mesh: TetMesh) -> Sensor {
    let (bounds, slack) = (mesh.bounds(), 1e-9);
    let on_wall = |node: &u32| {
        let at = mesh.nodes()[*node as usize];
        (at - bounds.min).min_element() < slack || (bounds.max - at).min_element() < slack
    };
    let ground: Vec<u32> = (0..mesh.nodes().len() as u32).filter(on_wall).collect();
    let electrodes = design().electrodes.into_iter();
    let electrodes = electrodes.map(|electrode| (electrode.name.clone(), ElectrodeNodes::Shape(electrode)));
    Sensor::on_mesh(mesh, &ground, electrodes.collect()).unwrap()
}

/// The same nodes in an order that has nothing to do with where they are.
fn shuffled(mesh: &TetMesh) -> Vec<u32> {
    let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    order.sort_by_cached_key(|&node| {
        // The finaliser of SplitMix64.
        let bits = (u64::from(node) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb)
    });
    order
}

fn measure(name: &str, mesh: &TetMesh) {
    let made = (0..mesh.nodes().len() as u32).collect();
    let orders: [(&str, Vec<u32>); 3] =
        [("as made", made), ("shuffled", shuffled(mesh)), ("in space", mesh.order_in_space())];
    let mut simulators = orders.map(|(order, nodes)| {
        let grounded = vec![Material::Conductor(Connection::Grounded)];
        let sensor = sensor(mesh.renumbered(&nodes));
        (order, Simulator::new(sensor, grounded, solver_options(Some(1))).unwrap(), [0.0; 2])
    });
    for mut motion in Motion::all() {
        let frames = motion.len() / STRIDE;
        for way in 0..=if is_test() { 1 } else { WAYS } {
            let images: Vec<_> = (0..frames)
                .map(|_| {
                    (1..STRIDE).for_each(|_| _ = motion.next());
                    motion.next().clone()
                })
                .collect();
            for (_, simulator, took) in &mut simulators {
                if way == 1 {
                    *took = [0.0; 2];
                }
                for image in &images {
                    let start = Instant::now();
                    let _ = simulator.update(image).unwrap();
                    let updated = Instant::now();
                    let _ = simulator.solve().unwrap();
                    took[0] += (updated - start).as_secs_f64();
                    took[1] += updated.elapsed().as_secs_f64();
                }
            }
        }
        let counted = (frames * if is_test() { 1 } else { WAYS }) as f64;
        for (order, _, took) in &simulators {
            let [update, solve] = took.map(|seconds| 1e3 * seconds / counted);
            let tets = mesh.tets().len();
            println!("{name:<24} {tets:>8} {:<9} {order:<9} {update:>7.3} {solve:>7.3}", motion.name);
        }
    }
}

fn main() {
    println!("mesh                         tets motion    order      update   solve");
    let files: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    for file in &files {
        let mesh =
            gmsh::parse(&std::fs::read(file).unwrap()).unwrap().to_tet_mesh(LengthUnit::Metre).unwrap();
        measure(file, &mesh);
    }
    let sizes: &[usize] = match (files.is_empty(), is_test(), is_large()) {
        (false, _, _) => &[],
        (true, true, _) => &[20_000],
        (true, false, false) => &[300_000],
        (true, false, true) => &[300_000, 1_000_000],
    };
    for &size in sizes {
        measure("bisected", &bisected(size));
    }
}

//! What a simulator keeps in memory, in bytes a tetrahedron: all that is allocated once frames have been solved, the mesh
//! included. Not a timing, but it belongs beside them.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::material::{Connection, Material};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use common::{Motion, design, mesh_sizes, on_lattice, on_tetrahedra, solver_options};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};

/// Bytes that are allocated now.
static ALLOCATED: AtomicIsize = AtomicIsize::new(0);

/// The system's allocator, with a count.
struct Counting;

#[global_allocator]
static COUNTING: Counting = Counting;

// SAFETY: both functions hand their arguments on to the system's allocator unchanged and return what it returns; the
// default ones for zeroed and resized memory are made of these two.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of this trait, which is that of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATED.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the pointer came from `alloc` above with this layout, and so from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Bytes a tetrahedron of a simulator that has seen a few frames.
fn bytes(sensor: impl FnOnce() -> Sensor, motion: &mut Motion) -> f64 {
    let before = ALLOCATED.load(Ordering::Relaxed);
    let grounded = Material::Conductor(Connection::Grounded);
    let mut simulator = Simulator::new(sensor(), vec![grounded], solver_options(Some(1))).unwrap();
    for _ in 0..5 {
        let _ = simulator.step(motion.next()).unwrap();
    }
    let after = ALLOCATED.load(Ordering::Relaxed);
    (after - before) as f64 / simulator.sensor().mesh().tets().len() as f64
}

fn main() {
    println!("bytes a tetrahedron   lattice   csr");
    for size in mesh_sizes() {
        let lattice = design().lattice(size).unwrap();
        let [_, mut towards] = Motion::all();
        let of_lattice = bytes(|| on_lattice(&lattice), &mut towards);
        let of_csr = bytes(|| on_tetrahedra(&lattice), &mut towards);
        println!("{size:>19}   {of_lattice:>7.0}   {of_csr:>3.0}");
    }
}

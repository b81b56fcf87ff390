//! The mathematics of CapSense: from a tetrahedral mesh, electrodes and objects to a capacitance matrix.
//!
//! No files, no clocks, no GPU. [`simulator::Simulator::step`] is the one main path; what it calls stands in the other
//! modules, which build on each other in this order: [`units`], [`geometry`], [`mesh`], [`electrode`], [`material`],
//! [`sensor`], [`occupancy`], [`solids`], [`stiffness`], [`solver`], [`capacitance`], [`estimate`], [`simulator`]. Beside it stand
//! [`batch`], many simulators at once, [`measurement`], what converters make of capacitances, and [`baseline`], the methods it is compared with.

#![forbid(unsafe_code)]

pub mod baseline;
pub mod batch;
pub mod capacitance;
pub mod electrode;
pub mod estimate;
mod few;
mod fields;
pub mod geometry;
mod instructions;
pub mod material;
pub mod measurement;
pub mod mesh;
pub mod occupancy;
pub mod sensor;
pub mod simulator;
pub mod solids;
pub mod solver;
pub mod stiffness;
pub mod units;
mod workers;
pub mod workspace;

pub use glam;
pub use instructions::instruction_set;

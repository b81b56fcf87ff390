//! The mathematics of CapSense: from a tetrahedral mesh, electrodes and objects to a capacitance matrix.
//!
//! No files, no clocks, no GPU. The modules build on each other in this order.

#![forbid(unsafe_code)]

pub mod geometry;
pub mod material;
pub mod mesh;
pub mod occupancy;
pub mod units;

//! Fields on a graphics device: conjugate gradients with multigrid, on lattices for one scene or many at once.
//!
//! [`GpuFields`] is what [`Simulator::with_remote`](capsense_core::simulator::Simulator::with_remote) takes. Objects are
//! found there ([`GpuFields::with_camera`], [`GpuFields::with_solids`]), or the processor finds them and sends the rows that
//! differ; only energies come back. Potentials are in single
//! precision, energies are sums that keep what rounding takes from them: errors of capacitances are quadratic in those of
//! potentials, so both are far below a tolerance of 1e-5. `twin.rs` is the same arithmetic on the processor; tests compare
//! the two step by step.

mod binding;
mod device;
mod finder;
mod gpu;
mod iteration;
mod launch;
mod memory;
mod network;
#[cfg(test)]
mod object_tests;
mod plan;
mod rules;
mod shader;
mod solids;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
#[cfg(test)]
mod twin_fields;

pub use device::Traffic;
pub use finder::{Camera, Objects};
pub use gpu::{GpuFields, has_adapter};
pub use network::GpuNetwork;

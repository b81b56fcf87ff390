//! Fields on meshes that are no lattice: K in compressed rows, conjugate gradients with multigrid by aggregation.
//!
//! Aggregates are those of the processor's solver, formed once in the empty scene; coarse networks are sums over lists that
//! never change, made anew in each frame. The processor's sweeps take what they found at other rows before; here all rows are
//! swept at once, damped, and steps are kept apart by what the cycle really did (`iteration.wgsl`). `twin.rs` is the same
//! arithmetic on the processor; tests compare the two step by step.

mod changes;
mod device;
mod gpu;
mod launch;
mod plan;
mod rules;
mod shader;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
#[cfg(test)]
mod twin_fields;

pub use gpu::GpuNetwork;

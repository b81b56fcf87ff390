//! x

pub mod gmsh;

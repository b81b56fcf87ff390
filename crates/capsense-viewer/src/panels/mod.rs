//! The panels of the window. Each draws one thing, and changes it through the session alone.

pub mod curves;
pub mod dialogs;
pub mod matrix;
pub mod measurements;
pub mod objects;
pub mod performance;
pub mod simulation;
pub mod transport;

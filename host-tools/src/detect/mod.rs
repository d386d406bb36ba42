//! What no model predicts, and what a model leaves: contact, bursts, and the statistics of residuals.

pub mod black_box;
pub(crate) mod bursts;
pub(crate) mod contact;
pub mod mismatch;
pub mod residual;
pub(crate) mod series;
pub(crate) mod twist;

pub use series::JointSeries;

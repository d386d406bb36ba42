//! From data to a model's values: one estimator for `identify`, `diagnose` and `compare`.
//!
//! 1. `limb_data`: a limb's motion and, apart from it, the torque that was measured.
//! 2. `whitening`, `accumulate`, [`proprio_solve::factor`], `blocks`, `groups`: rows made independent of their neighbours, one square-root factor per block of time and joint;
//!    from here on the data are not needed (`design.md` §3).
//! 3. [`proprio_solve::bounded`]: one solve, every body one that could exist and every effect within its bounds. `r_factor`: the same without
//!    bounds, ordered so that many nested models can be read off.
//! 4. `fit`, with `grid`, `shapes`, `compliance_scan`, `refit`, `limit` and `directions`: Gauss-Newton over the predictor's derivatives. `robot`: all limbs, and what they share.
//! 5. `residuals`: what a fit predicts, and what it leaves. `nested`: a fit as factors, from which every model that leaves effects out of it can be read.
//! 6. `deviation`: standard deviations that hold where residuals remember; `between_blocks`: by how much values differ from stretch to stretch;
//!    [`parameter_estimate`]: what is told of a parameter.

pub(crate) mod accumulate;
pub(crate) mod added_variables;
pub(crate) mod between_blocks;
pub(crate) mod blocks;
pub(crate) mod compliance_scan;
pub(crate) mod deviation;
pub(crate) mod directions;
pub(crate) mod fit;
pub(crate) mod grid;
mod groups;
pub(crate) mod limb_data;
pub(crate) mod limit;
pub(crate) mod method;
pub(crate) mod nested;
pub mod parameter_estimate;
pub(crate) mod r_factor;
mod refit;
mod residuals;
pub(crate) mod robot;
pub(crate) mod shape_deviation;
pub(crate) mod shapes;
pub(crate) mod stages;
pub(crate) mod uncertainty;
pub(crate) mod whitening;

pub(crate) use proprio_solve::{bounded, factor};

pub use method::Method;
pub use parameter_estimate::*;

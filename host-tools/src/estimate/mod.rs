//! From data to a model's values: one estimator for `identify`, `diagnose` and `compare`.
//!
//! 1. `limb_data`: a limb's motion and, apart from it, the torque that was measured.
//! 2. `whitening`, `folding`, [`proprio_solve::factor`], `blocks`, `groups`: rows made independent of their neighbours, one square-root factor per block of time and joint;
//!    from here on the data are not needed (`design.md` §3).
//! 3. [`proprio_solve::bounded`]: one solve, every body one that could exist and every effect within its bounds. `triangle`: the same without
//!    bounds, ordered so that many nested models can be read off.
//! 4. `fit`, with `grid`, `shapes`, `looseness`, `refit`, `limit` and `directions`: Gauss-Newton over the predictor's derivatives. `robot`: all limbs, and what they share.
//! 5. `leaves`: what a fit predicts, and what it leaves. `nested`: a fit as factors, from which every model that leaves effects out of it can be read.
//! 6. `deviation`: standard deviations that hold where residuals remember; `spread`: by how much values differ from stretch to stretch;
//!    [`parameter_estimate`]: what is told of a parameter.

pub(crate) mod blocks;
pub(crate) mod deviation;
pub(crate) mod directions;
pub(crate) mod fit;
pub(crate) mod folding;
pub(crate) mod grid;
mod groups;
pub(crate) mod known;
mod leaves;
pub(crate) mod left_over;
pub(crate) mod limb_data;
pub(crate) mod limit;
pub(crate) mod looseness;
pub(crate) mod method;
pub(crate) mod nested;
pub mod parameter_estimate;
mod refit;
pub(crate) mod robot;
pub(crate) mod shape_deviation;
pub(crate) mod shapes;
pub(crate) mod spread;
pub(crate) mod stages;
pub(crate) mod triangle;
pub(crate) mod whitening;

pub(crate) use proprio_solve::{bounded, factor};

pub use method::Method;
pub use parameter_estimate::*;

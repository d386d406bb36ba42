//! From data to a model's values: one estimator for `identify`, `diagnose` and `compare`.
//!
//! 1. `limb_data`: a limb's motion and, apart from it, the torque that was measured.
//! 2. `whitening`, `blocks`, `groups`: rows made independent of their neighbours, one square-root factor per block of time and joint;
//!    from here on the data are not needed (`design.md` §3).
//! 3. `bounded`: one solve, every body one that could exist and every effect within its bounds. `triangle`: the same without
//!    bounds, ordered so that many nested models can be read off.
//! 4. `fit`, with `shapes`: Gauss-Newton over the predictor's derivatives. `robot`: all limbs, and what they share.
//! 5. `deviation`: standard deviations that hold where residuals remember; [`parameter_estimate`]: what is told of a parameter.

pub(crate) mod blocks;
pub(crate) mod bounded;
pub(crate) mod deviation;
pub(crate) mod fit;
pub(crate) mod gap;
mod groups;
pub(crate) mod limb_data;
pub(crate) mod method;
pub mod parameter_estimate;
pub(crate) mod robot;
pub(crate) mod shapes;
pub(crate) mod stages;
pub(crate) mod triangle;
pub(crate) mod whitening;

pub use method::Method;
pub use parameter_estimate::*;

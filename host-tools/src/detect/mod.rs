//! What no model predicts, and what a model leaves: contact, bursts, and the statistics of residuals.
//!
//! Files beside:
//!
//! - `black_box`: what a black box could still take away: how far a model's error falls if something that knows no physics is shown more
//!   and more of the motion
//! - `bodies`: bodies far from the CAD's: another body, or what the model lacks
//! - `every_window`: what models make of every window of logs of which a part was drawn
//! - `floor`: the noise floor of a log: the error that no model can take away
//! - `frame`: a joint whose frame stands elsewhere than the description has it, by what that does to the torque
//! - `ladder`: what every result is held against, the same in every command
//! - `load_change`: a load that comes or goes within a log
//! - `mismatch`: whether a log is of the robot that the model is of: what a person would see at once and no effect should have to explain
//! - `regime`: where an error lives: a range of position, speed, direction, load, temperature or time
//! - `residual`: what a residual says of the model: where it fails, when, whether anything but noise is left, and how far it is from the
//!   noise
//! - `series`: a joint's windows as series: what was measured, what a model says, and what the joint did meanwhile
//! - `twist`: what a second encoder, at the link, shows of a gear: how far link and motor turn against each other under the torque between
//!   them
//! - `waves`: what of a series is a wave of a joint's position, whatever its length

pub mod black_box;
pub(crate) mod bodies;
pub(crate) mod bursts;
pub(crate) mod contact;
pub mod every_window;
pub(crate) mod floor;
pub(crate) mod frame;
pub mod ladder;
pub(crate) mod load_change;
pub mod mismatch;
pub mod regime;
pub mod residual;
pub(crate) mod series;
pub(crate) mod twist;
pub(crate) mod waves;

pub use series::JointSeries;

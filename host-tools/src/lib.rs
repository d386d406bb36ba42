//! Logs, model files, commands: the desktop side of proprio.
//!
//! Rooms in the order in which data flow; a room uses only those above it: [`log`], [`formula`], [`model`], [`gate`], `trajectory`, [`recording`],
//! `equation`, `predict`, [`estimate`], `rollout`, [`fleet`], [`free_base`], [`identifiability`], `select`, [`detect`], then the results [`diagnose`],
//! [`compare`], [`identify`] and [`kinematics`], [`dynamics`], [`spectrum`], [`excite`], [`advise`] and [`validate`], and [`report`]; [`command`] is what a user types. The truth of tests and
//! demos, independent of them, is a crate of its own: [`proprio_simulator`].

pub mod advise;
pub mod capture;
pub mod catalogue;
mod clock;
pub mod command;
pub mod compare;
pub mod detect;
pub mod device;
pub mod diagnose;
pub mod dynamics;
mod equation;
pub mod estimate;
pub mod excite;
pub mod factors;
pub mod fleet;
pub mod formula;
pub mod free_base;
pub mod gate;
pub mod identifiability;
pub mod identify;
pub mod kinematics;
pub mod live;
pub mod log;
pub mod model;
pub mod monitor;
mod name;
mod once;
pub mod output;
mod parallel;
pub mod parameter;
mod predict;
mod progress;
pub mod recording;
pub mod report;
mod robust;
mod rollout;
mod select;
mod signs;
pub mod spectrum;
pub mod summary;
pub mod table;
mod trajectory;
pub mod validate;

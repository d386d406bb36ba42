//! What is linear in a limb's parameters, and the derivatives of what is not.
//!
//! 1. `motion`: a limb's motion without any torque, cut into windows of time; `joint_states`: with `links` (`backlash`, `spring`, `coupled_springs`) and `presliding`,
//!    what effects see of it under a model; `free_tree` and `recoil`, what joints feel of a base that their motion moves; `transmitted_torque`, what its gears transmit, smoothed by a `local_line`, for links that move by a `torque_filter`, and kept in `transmitted_torque_cache`.
//! 2. `values`: the numbers of a limb's model; `body`: its rigid body with them; `encoder`: the motion behind what encoders report.
//! 3. `column`, `rows`: the momentum equation integrated over windows (`quadrature`), a column per parameter; `contribution`: what an effect adds
//!    to a torque.
//!    `unfollowed`: what of a window its smooth motion may lack.
//! 4. `folds`: time cut into what is held out in turn. `velocity`: what positions say of the reported velocity; `hysteresis`: the state of
//!    friction inside a gear by its twist.

mod backlash;
pub(crate) mod body;
pub(crate) mod column;
pub(crate) mod contribution;
pub(crate) mod coupled_springs;
pub(crate) mod encoder;
pub(crate) mod folds;
pub(crate) mod foot;
pub(crate) mod free_tree;
pub(crate) mod hysteresis;
pub(crate) mod integrals;
pub(crate) mod joint_states;
pub(crate) mod link_response;
mod links;
pub(crate) mod local_line;
pub(crate) mod motion;
pub(crate) mod presliding;
mod quadrature;
pub(crate) mod recoil;
pub(crate) mod reversal;
pub(crate) mod rigid_body;
pub(crate) mod rows;
mod spring;
mod torque_filter;
pub(crate) mod transmitted_torque;
pub(crate) mod transmitted_torque_cache;
mod unfollowed;
pub(crate) mod values;
pub(crate) mod velocity;

pub(crate) use proprio_solve::dot;

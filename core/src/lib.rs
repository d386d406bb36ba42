//! The core of proprio: what turns a legged robot's motor-bus bytes into its physical parameters.
//!
//! One crate runs unchanged on the microcontroller, on the desktop and in the tests: no allocation, no unsafe code, no
//! panic on any input, sizes fixed by const generics, the scalar generic over `f32` and `f64` ([`Real`]).
//!
//! # Reading order
//!
//! Data flows one way, and so do the modules:
//!
//! 1. [`spatial`], [`inertia`]: spatial vectors, and the ten inertial parameters of a body in which all is linear.
//! 2. [`tree`], [`robot`]: a kinematic tree with a fixed or free base; what a robot is to the rest: legs, motors, gears, a bus.
//! 3. [`dynamics`]: inverse and forward dynamics, H, C and g.
//! 4. [`regressor`]: the same quantities as matrices that multiply the parameters; all of them from one bilinear form.
//! 5. [`effect`]: the catalogue of what a rigid body lacks: friction, rotor inertia, bias.
//! 6. [`window`]: samples in, integrated rows out: the momentum equation, which needs no acceleration; with a moving base and
//!    feet on the ground by [`contact`], the projector that takes contact forces out.
//! 7. [`factor`]: square-root information: the rows folded into a triangle by rotations; no data is stored.
//! 8. [`estimator`]: a limb's factors, its prior and its solution in bounded steps.
//! 9. [`consistent`]: the solution in which every body could exist and no friction is negative.
//! 10. [`go2`]: the robot that this has been built for, the first of its kind.
//! 11. [`walk`]: all of that for a robot that walks, trunk and legs together, one bounded step at a time; it and [`app`] know the Go2.
//! 12. [`bus`], [`wire`]: bytes of the motor bus, messages to the host; they know nothing of dynamics.
//! 13. [`app`]: the whole line, one bounded step at a time, with time as an argument; what it knows outlives the power in flash, for which
//!     [`storage`] has a stand-in.
//!
//! # Features
//!
//! `default` is `app`, all of the above. Without features the crate is the mathematics (1 to 11), which needs nalgebra and heapless alone.
//!
//! | feature | what it adds |
//! |---|---|
//! | `bus` | [`bus`]: frames of the motor bus |
//! | `wire` | [`wire`]: messages between a device and its host |
//! | `app` | [`app`], [`storage`]: the whole line; with `bus` and `wire` |
//! | `serde` | `Serialize` and `Deserialize` of bodies, transforms, effects, priors, settings and frames |
//! | `defmt` | `Format` of errors, events, effects and frames |
//!
//! # The equation
//!
//! With θ the inertial and effect parameters, a window [t1, t2] gives one row per joint (`design.md` §2; Ljung & others
//! call W the regressor)
//!
//! ```text
//! [W_m θ] from t1 to t2 − ∫ W_c θ dt + ∫ W_g θ dt + effect columns = ∫ τ dt
//! ```
//!
//! from H q̇ = W_m θ, Cᵀ q̇ = W_c θ and g = W_g θ, since Ḣ = C + Cᵀ.
//!
//! # Units
//!
//! SI throughout, joint side: rad, rad/s, N m, kg, s, °C; time stamps are whole microseconds.
#![no_std]
#![forbid(unsafe_code)]
// What is left out of a build is not linked to in its documentation, and not used by what is left.
#![cfg_attr(
    not(feature = "app"),
    allow(dead_code, rustdoc::broken_intra_doc_links)
)]

#[cfg(test)]
extern crate std;

#[cfg(feature = "app")]
pub mod app;
pub mod base_parameters;
#[cfg(feature = "bus")]
pub mod bus;
pub mod consistent;
pub mod contact;
pub mod criticism;
pub mod dynamics;
pub mod effect;
pub mod estimator;
pub mod factor;
pub mod go2;
pub mod inertia;
pub mod regressor;
pub mod robot;
mod scalar;
mod slot;
pub mod spatial;
#[cfg(feature = "app")]
pub mod storage;
pub mod tree;
pub mod walk;
pub mod window;
#[cfg(feature = "wire")]
pub mod wire;

pub use scalar::Real;

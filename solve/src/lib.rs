//! Fits from square-root factors alone, without the data that were folded into them.
//!
//! [`factor`] is a triangle of many rows. [`bounded`] is one solve: bodies that could exist, effects within their bounds. [`group`]
//! turns factors into its rows, and [`far`] releases bodies that the data carry far from the CAD's.
//! [`nested`] fits every model that leaves effects out of a larger one, and tells its error on data that the fit has not seen.
//! The desktop's estimator and the page of a report run this same code; for the page it is compiled to wasm32
//! (`solve/build`), where `browser` is what the page's script calls.

// What the page calls has names for the linker, and no unsafe block.
#![cfg_attr(not(target_arch = "wasm32"), forbid(unsafe_code))]

pub mod bounded;
#[cfg(target_arch = "wasm32")]
mod browser;
pub mod dot;
pub mod factor;
pub mod far;
pub mod group;
pub mod nested;

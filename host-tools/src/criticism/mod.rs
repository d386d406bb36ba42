//! Model criticism: where a model fails, whether the data can be trusted, what is missing.

pub mod gate;
pub mod residual;

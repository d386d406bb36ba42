//! The Python module `proprio`: the library's loop with NumPy arrays in and tables out. It computes nothing itself.
//!
//! Files beside:
//!
//! - `arrays`: numbers from and to NumPy, pandas, Polars and Arrow
//! - `dynamics`: regressors, torques, mass matrices over many samples
//! - `error`: errors as exceptions, with the hint
//! - `fleet`: blocks of many robots, as an engine that spreads the work passes them
//! - `log`: a log, of files or arrays
//! - `model`: a robot and what is known of it
//! - `motion`: the motion that `excite` designs
//! - `results`: what the steps of the loop return
//! - `work`: long work without the interpreter's lock, until Ctrl-C

mod arrays;
mod dynamics;
mod error;
mod fleet;
mod log;
mod model;
mod motion;
mod results;
mod work;

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command `proprio` with these words, the first of which is the program: its exit status.
#[pyfunction]
fn run_command(py: Python<'_>, words: Vec<OsString>) -> u8 {
    let text = |word: &OsString| word.to_string_lossy().into_owned();
    let rest: Vec<String> = words.iter().skip(1).map(text).collect();
    let all = [vec!["proprio".to_owned()], rest].concat();
    proprio_host::log::set_command_line(all.join(" "));
    py.detach(|| proprio_host::command::run_words(words))
}

#[pymodule]
mod _proprio {
    #[pymodule_export]
    use super::dynamics::{
        forward_dynamics, inverse_dynamics, mass_matrix, regressor_parameters, regressor_seconds,
        torque_regressor,
    };
    #[pymodule_export]
    use super::error::{
        DynamicsError, Error, LogError, ModelError, MotionError, UnknownNameError, WriteError,
    };
    #[pymodule_export]
    use super::fleet::{fleet_final, fleet_partial, fleet_schema};
    #[pymodule_export]
    use super::log::Log;
    #[pymodule_export]
    use super::model::{Model, add};
    #[pymodule_export]
    use super::motion::{Motion, excite};
    #[pymodule_export]
    use super::results::{
        Comparison, Diagnosis, Fitted, JointSeries, Parameter, compare, diagnose, identify, predict,
    };
    #[pymodule_export]
    use super::run_command;
}

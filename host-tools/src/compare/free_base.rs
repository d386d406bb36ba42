//! What `proprio compare --free-base` does: a model against walks, coordinate by coordinate, in the equations that contact forces leave.

use std::fmt;
use std::path::PathBuf;

use nalgebra::DVector;
use proprio_core::go2::{JOINT_NAMES, JOINTS};
use proprio_core::inertia::INERTIAL;
use serde::Serialize;

use super::ValuesFrom;
use crate::free_base::data::{Data, Left};
use crate::free_base::fit::bare;
use crate::free_base::rows::{BODIES, COORDINATES};
use crate::free_base::structure::ModelStructure;
use crate::free_base::{FootEpisode, FreeBaseError, StanceShares, Walks, Windows};
use crate::log::Samples;
use crate::model::{BASE, Model};
use crate::table::Table;

/// What `proprio compare --free-base` says.
#[derive(Debug, Clone, Serialize)]
pub struct FreeBaseComparison {
    /// Root mean square of what the model leaves of an equation: mean torque over a window, N m; equations of the base are scaled to the
    /// same noise.
    pub rms: f64,
    /// The same with the CAD's bodies and no effect.
    pub cad_rms: f64,
    /// Whether parameters were fitted, to every part of the time but the one that is predicted.
    pub fitted: bool,
    /// Moments on the base, forces on it, each joint's torque.
    pub coordinates: Vec<CoordinateError>,
    /// What became of the windows.
    pub windows: Windows,
    /// Why feet were projected out, log by log.
    pub stance: Vec<StanceShares>,
    /// What became of the samples; one sample is all of the robot's.
    pub samples: Samples,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// What is said of each foot when; for plots.
    #[serde(skip)]
    pub feet: Vec<FootEpisode>,
    /// Measured and predicted torque of each joint in the equations that contact forces leave; for plots.
    #[serde(skip)]
    pub series: Vec<WalkSeries>,
}

/// A joint's torque over time in the equations that contact forces leave, N m.
#[derive(Debug, Clone)]
pub struct WalkSeries {
    /// Its name.
    pub joint: String,
    /// When each window began, s.
    pub t: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// By the CAD's bodies alone.
    pub cad: Vec<f64>,
    /// By the model.
    pub model: Vec<f64>,
}

/// How well one coordinate's equation is met, root mean square.
#[derive(Debug, Clone, Serialize)]
pub struct CoordinateError {
    /// `moment_x:base`, `force_x:base`, `FR_hip`, …
    pub name: String,
    /// `N m`, or `N` of forces.
    pub unit: &'static str,
    /// What the model leaves.
    pub rms: f64,
    /// What the CAD's bodies leave without any effect.
    pub cad_rms: f64,
    /// What is left if nothing is predicted: the measured torques of joints, zero of the base's equations.
    pub zero_rms: f64,
}

/// Compares a Go2's `model` with logs of it walking, taken together; what sensors get wrong, which is no robot's, is fitted always.
/// `progress` hears of logs read, and of how many in all.
///
/// # Errors
/// [`FreeBaseError`]: a log that is bad or, if values are to be fitted, too short, or a model that walks are not judged with.
pub fn compare_free_base(
    logs: &[PathBuf],
    model: &Model,
    values: ValuesFrom,
    progress: impl FnMut(u64, u64),
) -> Result<FreeBaseComparison, FreeBaseError> {
    let structure = ModelStructure::of(model)?;
    let walks = Walks::read(logs, progress)?;
    let data = Data::of(&walks, &structure, &structure.candidates(model))?;
    let lacks_values = model.effects().iter().any(|e| e.estimate().is_none());
    let fitted = match values {
        ValuesFrom::Auto => lacks_values,
        ValuesFrom::Fitted => true,
        ValuesFrom::Given | ValuesFrom::GivenAlsoAtRest => false,
    };
    let cad = ModelStructure::of(&Model::default())?;
    let cad = data.with_sensors(&bare(&data, &cad));
    let (model, rms) = if fitted {
        let parts = data.held_out(&structure).ok_or(FreeBaseError::TooShort)?;
        let rms = crate::free_base::fit::rms(&parts);
        (parts.into_iter().map(|part| part.theta).collect(), rms)
    } else {
        let theta = data.with_sensors(&given(&data, model));
        let rms = data.rms(&theta);
        (vec![theta], rms)
    };
    let zero = DVector::zeros(data.columns().len());
    let thetas = [model.iter().collect(), vec![&cad], vec![&zero]];
    let mut series = empty_series();
    let by_coordinate = data.by_coordinate_and(&walks, &thetas, |equation| {
        let joint = equation.coordinate.checked_sub(6);
        if let Some(own) = joint.and_then(|joint| series.get_mut(joint)) {
            own.t.push(equation.t);
            own.measured.push(equation.measured);
            own.model.push(equation.predicted[0]);
            own.cad.push(equation.predicted[1]);
        }
    });
    Ok(FreeBaseComparison {
        rms,
        cad_rms: data.rms(&cad),
        fitted,
        coordinates: coordinates(&by_coordinate),
        windows: data.windows,
        stance: walks.stance(),
        samples: walks.samples(),
        logs: logs.to_vec(),
        feet: walks.episodes(),
        series,
        warnings: [walks.warnings, data.warnings()].concat(),
    })
}

/// No equation yet.
fn empty_series() -> Vec<WalkSeries> {
    let series = |joint: &&str| WalkSeries {
        joint: (*joint).to_owned(),
        t: Vec::new(),
        measured: Vec::new(),
        cad: Vec::new(),
        model: Vec::new(),
    };
    JOINT_NAMES.iter().map(series).collect()
}

/// The parameters that a model file gives; what has no value does nothing.
fn given(data: &Data, model: &Model) -> DVector<f64> {
    let mut theta = DVector::zeros(data.columns().len());
    let bodies = std::iter::once(BASE).chain(0..JOINTS);
    for (b, body) in bodies.enumerate().take(BODIES) {
        let inertia = model.inertia(body).0;
        theta.rows_mut(INERTIAL * b, INERTIAL).copy_from(&inertia);
    }
    for (k, n, linear) in data.columns().effects() {
        let (effect, joint) = data.columns().sites[n].place;
        let own = model.effect(effect, joint);
        let value = own.and_then(|own| own.estimates[linear.parameter]);
        theta[k] = value.map_or(0.0, |own| own.value - linear.neutral);
    }
    theta
}

fn coordinates(left: &[Left]) -> Vec<CoordinateError> {
    let name = |c: usize| match c {
        0..6 => format!(
            "{}_{}:base",
            ["moment", "force"][c / 3],
            ["x", "y", "z"][c % 3]
        ),
        _ => JOINT_NAMES[c - 6].to_owned(),
    };
    let of = |c: usize| CoordinateError {
        name: name(c),
        unit: if (3..6).contains(&c) { "N" } else { "N m" },
        rms: left[0].rms[c],
        cad_rms: left[1].rms[c],
        zero_rms: left[2].rms[c],
    };
    (0..COORDINATES).map(of).collect()
}

impl fmt::Display for FreeBaseComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = if self.fitted {
            "on time that the fit has not seen"
        } else {
            "as the model file has it"
        };
        writeln!(
            f,
            "rms {:.4} N m {how}; {:.4} with the CAD alone\n",
            self.rms, self.cad_rms
        )?;
        let mut table = Table::default();
        table.row(["", "unit", "rms", "CAD", "nothing"].map(str::to_owned));
        for own in &self.coordinates {
            let errors = [own.rms, own.cad_rms, own.zero_rms].map(|rms| format!("{rms:.4}"));
            table.row(
                [own.name.clone(), own.unit.to_owned()]
                    .into_iter()
                    .chain(errors),
            );
        }
        writeln!(
            f,
            "{table}\nMeasured less predicted mean over a window, in the {} equations of {} windows that contact forces leave.",
            self.windows.equations, self.windows.used
        )
    }
}

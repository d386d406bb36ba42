//! What `proprio compare --free-base` does: a model against walks, coordinate by coordinate, in the equations that contact forces leave.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::asked::{Asked, names};
use super::{Baselines, Comparison, JointComparison, ValuesFrom, Yardsticks, ranking};
use crate::detect::JointSeries;
use crate::detect::residual;
use crate::equation::free_tree::OF_BASE;
use crate::free_base::channels::Channels;
use crate::free_base::data::{Data, Left};
use crate::free_base::doubtful;
use crate::free_base::legged::Legged;
use crate::free_base::rungs::{given, rungs};
use crate::free_base::structure::ModelStructure;
use crate::free_base::{FootEpisode, FreeBaseError, StanceShares, Walks, Windows};
use crate::log::Samples;
use crate::model::{Model, ModelEffect};
use crate::summary::Summary;
use crate::table::Table;

/// What `proprio compare --free-base` says.
#[derive(Debug, Clone, Serialize)]
pub struct FreeBaseComparison {
    /// As of a robot that hangs. Errors over all are of the equations that contact forces leave, those of the base scaled to the same noise.
    #[serde(flatten)]
    pub comparison: Comparison,
    /// Moments on the base, forces on it, each joint's torque.
    pub coordinates: Vec<CoordinateError>,
    /// What became of the windows.
    pub windows: Windows,
    /// Why feet were projected out, log by log.
    pub stance: Vec<StanceShares>,
    /// What became of the samples; one sample is all of the robot's.
    pub samples: Samples,
    /// What is said of each foot when; for plots.
    #[serde(skip)]
    pub feet: Vec<FootEpisode>,
    /// Their names, in the order in which those count them.
    #[serde(skip)]
    pub names_of_feet: Vec<String>,
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

/// Compares a robot's `model` with logs of it walking, taken together; what sensors get wrong, which is no robot's, is fitted always.
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
    compare_free_base_without(logs, model, &[], values, progress)
}

/// The same of a model from which the effects `left_out` were removed: the model that had them is what it is held against.
///
/// # Errors
/// As [`compare_free_base`].
pub fn compare_free_base_without(
    logs: &[PathBuf],
    model: &Model,
    left_out: &[ModelEffect],
    values: ValuesFrom,
    progress: impl FnMut(u64, u64),
) -> Result<FreeBaseComparison, FreeBaseError> {
    let asked = Asked::of((logs, &[]), &|_| true, model, left_out, values);
    let structure = ModelStructure::of(model)?;
    let before = asked.before.as_ref();
    let before = before.map(|model| Ok::<_, FreeBaseError>((model, ModelStructure::of(model)?)));
    let before = before.transpose()?;
    let robot = structure.robot.clone();
    let walks = Walks::read(logs, (model, &robot), progress)?;
    // The same rows for both: what one of them has is a candidate of the other.
    let candidates = structure.candidates(model);
    let (data, structure) = Data::believed(&walks, structure, &candidates)?;
    let judged = |model: &Model, structure: &ModelStructure| {
        if asked.fitted {
            let parts = data.held_out(structure).ok_or(FreeBaseError::TooShort)?;
            let rms = crate::free_base::fit::rms(&parts);
            let thetas: Vec<_> = parts.into_iter().map(|part| part.theta).collect();
            return Ok((thetas, rms));
        }
        let theta = data.with_sensors(&given(&data, model, structure));
        let rms = data.rms(&theta);
        Ok::<_, FreeBaseError>((vec![theta], rms))
    };
    let before = before.map(|(model, own)| {
        let robot = structure.robot.clone();
        judged(model, &ModelStructure { robot, ..own })
    });
    let before = before.transpose()?;
    let (model_thetas, rms) = judged(model, &structure)?;
    let doubtful = (model_thetas.first())
        .map(|theta| doubtful::sensors(data.columns(), theta))
        .unwrap_or_default();
    let rungs = rungs(&data, &asked.file)?;
    let mut thetas = vec![model_thetas.iter().collect()];
    thetas.extend(rungs.iter().map(|theta| vec![theta]));
    thetas.extend(before.iter().map(|(thetas, _)| thetas.iter().collect()));
    let mut all = vec![empty_series(&robot); thetas.len()];
    let by_coordinate = data.by_coordinate_and(&walks, &thetas, |equation| {
        let Some(joint) = equation.coordinate.checked_sub(OF_BASE) else {
            return;
        };
        let walk = &walks.walks[equation.log].0;
        let end = equation.start + equation.window;
        let [first, end] = [equation.start, end].map(|t| walk.index_at(t));
        let mean = |of: &Channels| {
            let own = first..end.max(first + 1);
            let count = own.len() as f64;
            own.map(|n| of[n][joint]).sum::<f64>() / count
        };
        for (series, predicted) in all.iter_mut().zip(equation.predicted) {
            let own = &mut series[joint];
            own.t.push(equation.t + 0.5 * equation.window);
            own.q.push(mean(&walk.q));
            own.dq.push(mean(&walk.dq));
            own.tau.push(equation.measured);
            own.predicted.push(*predicted);
            own.residual.push(equation.measured - predicted);
            own.whole.push(true);
        }
    });
    let mut all = all.into_iter();
    let series = all.next().unwrap_or_default();
    let [zero_series, cad_series, file_series] = [(); 3].map(|()| all.next().unwrap_or_default());
    let baselines = Baselines {
        cad: cad_series,
        before: all.next(),
    };
    let views: Vec<_> = series.iter().map(JointSeries::view).collect();
    let criticism = residual::criticise(&views);
    let joints = series.iter().zip(&criticism).enumerate();
    let joints: Vec<JointComparison> = joints
        .map(|(k, (series, criticism))| {
            let [zero, cad, file] = [&zero_series, &baselines.cad, &file_series];
            let yardsticks = Yardsticks::of_walk([zero, cad, file].map(|of| of[k].rms()));
            JointComparison::of(series, criticism, (yardsticks, baselines.before_rms(k)))
        })
        .collect();
    let yardsticks = Yardsticks::of_walk(rungs.each_ref().map(|theta| data.rms(theta)));
    let starts = walks.starts();
    let moment = |t: f64| {
        let n = starts.partition_point(|start| *start <= t).max(1) - 1;
        (&logs[n], t - starts[n])
    };
    Ok(FreeBaseComparison {
        comparison: Comparison {
            data: Vec::new(),
            contact: Vec::new(),
            joints,
            rms,
            yardsticks,
            before_rms: before.map(|(_, rms)| rms),
            above_noise_percent: None,
            added: names(model, &asked.added),
            left_out: names(model, left_out),
            fitted: asked.fitted,
            effects: Vec::new(),
            patterns: ranking::patterns(&criticism),
            regimes: Vec::new(),
            episodes: ranking::episodes(&criticism, moment),
            black_box: None,
            elastic: None,
            criticism,
            every_window: None,
            logs: logs.to_vec(),
            warnings: [walks.warnings.clone(), data.warnings(), doubtful].concat(),
            series,
            baselines: baselines.named(),
        },
        coordinates: coordinates(&by_coordinate, &robot),
        windows: data.windows.clone(),
        stance: walks.stance(),
        samples: walks.samples(),
        feet: walks.episodes(),
        names_of_feet: robot.feet.iter().map(|foot| foot.name.clone()).collect(),
    })
}

/// No equation yet.
fn empty_series(robot: &Legged) -> Vec<JointSeries> {
    let series = |joint: &String| JointSeries {
        joint: joint.clone(),
        ..JointSeries::default()
    };
    robot.names.iter().map(series).collect()
}

fn coordinates(left: &[Left], robot: &Legged) -> Vec<CoordinateError> {
    let name = |c: usize| match c {
        0..6 => format!(
            "{}_{}:base",
            ["moment", "force"][c / 3],
            ["x", "y", "z"][c % 3]
        ),
        _ => robot.name(c - OF_BASE).to_owned(),
    };
    let of = |c: usize| CoordinateError {
        name: name(c),
        unit: if (3..6).contains(&c) { "N" } else { "N m" },
        rms: left[0].rms[c],
        cad_rms: left[1].rms[c],
        zero_rms: left[2].rms[c],
    };
    (0..robot.coordinates()).map(of).collect()
}

impl FreeBaseComparison {
    /// The first screen, as [`Comparison::summary`].
    pub fn summary(&self, model: Option<&Path>) -> Summary {
        let mut summary = self.comparison.summary(model);
        for command in &mut summary.next {
            for name in ["proprio diagnose ", "proprio identify "] {
                *command = command.replacen(name, &format!("{name}--free-base "), 1);
            }
        }
        summary
    }

    /// The comparison in words, as [`Comparison::text`], and each coordinate's error.
    pub fn text(&self, all: bool) -> String {
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
        format!(
            "{}\n{table}\nMeasured less predicted mean over a window, in the {} equations of {} windows, contact forces eliminated.\n",
            self.comparison.text(all),
            self.windows.equations,
            self.windows.used
        )
    }
}

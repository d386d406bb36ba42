//! Several models of one robot against the same recording, over the windows in which all of them are judged.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Comparison, JointSeries};
use crate::detect::ladder;
use crate::equation::folds::Blocks;
use crate::recording::{LogGates, Recording};
use crate::select::criteria::statistics::sum_and_error;
use crate::summary::{ErrorRange, torque, typed, wrapped};
use crate::table::Table;

/// A difference of so many standard errors is significant: 5 % of differences of equal models are larger (a normal variable's two-sided quantile).
const SIGNIFICANT: f64 = 2.0;

/// What `proprio compare` says of several models.
#[derive(Debug, Clone, Serialize)]
pub struct ModelsComparison {
    /// What the samples of each log are worth.
    pub data: Vec<LogGates>,
    /// The models, in the order in which they were named.
    pub models: Vec<ModelError>,
    /// The model of the smallest error, counted from 0.
    pub best: usize,
    /// Windows of a joint, over all joints, in which every model is judged.
    pub windows: usize,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    #[serde(skip)]
    error: ErrorRange,
    /// Measured torque and what the first model predicts, and the same of each other one; for plots.
    #[serde(skip)]
    pub series: Vec<Vec<JointSeries>>,
}

/// One of the models.
#[derive(Debug, Clone, Serialize)]
pub struct ModelError {
    /// Its file, as it was named.
    pub model: PathBuf,
    /// Root mean square over all joints of measured − predicted mean torque over a window, N m.
    pub rms: f64,
    /// NRMSE fit, 100 (1 − |error| / |torque − its mean|), as `compare` of the System Identification Toolbox has it; over all joints.
    pub fit_percent: f64,
    /// Whether values were fitted, held out, rather than taken from the file.
    pub fitted: bool,
    /// By how much its error is larger than the best one's, N m, and the standard error of that difference; no standard error where the log has too few blocks.
    pub beyond_best: f64,
    /// See `beyond_best`.
    pub beyond_best_std: Option<f64>,
    /// Whether the difference is more than chance; always of the best itself: not.
    pub significant: bool,
    /// Each joint.
    pub joints: Vec<ModelJoint>,
}

/// A joint under a model.
#[derive(Debug, Clone, Serialize)]
pub struct ModelJoint {
    /// Which.
    pub joint: String,
    /// As [`ModelError::rms`].
    pub rms: f64,
    /// As [`ModelError::fit_percent`].
    pub fit_percent: f64,
    /// Error that no model can remove, N m.
    pub floor: Option<f64>,
}

impl ModelsComparison {
    /// Of comparisons of the same recording, two or more, each with its model's file; none if there is none.
    pub fn of(recording: &Recording, all: &[(PathBuf, Comparison)]) -> Option<Self> {
        let series = common(all);
        let (_, first) = all.first()?;
        let rms = |of: &Vec<JointSeries>| over_joints(of.iter().map(|s| (s, s.rms())));
        let errors: Vec<f64> = series.iter().map(rms).collect();
        let best = (0..all.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]))?;
        let models = all.iter().zip(&series).enumerate();
        let model = |(n, ((path, comparison), own)): (usize, (&(PathBuf, Comparison), &Vec<_>))| {
            let std = difference_std(recording, (own, &series[best]), errors[n] + errors[best]);
            let std = std.filter(|_| n != best);
            let beyond_best = errors[n] - errors[best];
            ModelError {
                model: path.clone(),
                rms: errors[n],
                fit_percent: fit_percent(own),
                fitted: comparison.fitted,
                beyond_best,
                beyond_best_std: std,
                significant: std.is_some_and(|std| beyond_best > SIGNIFICANT * std),
                joints: own.iter().map(|s| joint(s, comparison)).collect(),
            }
        };
        let models: Vec<ModelError> = models.map(model).collect();
        let yardsticks = &first.yardsticks;
        Some(Self {
            error: ErrorRange {
                before: Some(yardsticks.cad_rms),
                ..yardsticks.error(errors[best])
            },
            data: first.data.clone(),
            best,
            windows: series[best].iter().map(|s| s.t.len()).sum(),
            logs: first.logs.clone(),
            warnings: warnings(all),
            models,
            series,
        })
    }

    /// The error over all joints: of the CAD, and of the best model.
    pub fn error(&self) -> ErrorRange {
        self.error
    }

    /// What to ask next, as it can be typed.
    pub fn next(&self) -> String {
        let best = typed(&self.logs, Some(&self.models[self.best].model));
        format!("proprio diagnose {best}")
    }

    /// The error of the best, and how far that is from the log's noise.
    pub fn headline(&self) -> String {
        let best = &self.models[self.best];
        let floor = match self.error.floor {
            Some(floor) => format!("noise floor {}", torque(floor.min(best.rms))),
            None => "noise floor unknown".to_owned(),
        };
        let cad = self
            .error
            .before
            .map_or(String::new(), |cad| format!("CAD alone {}, ", torque(cad)));
        let (name, joints) = (best.model.display(), best.joints.len());
        let error = torque(best.rms);
        format!("{name} is best: error {error} N m rms over {joints} joints ({cad}{floor})")
    }

    /// A sentence for each other model, how it differs from the best.
    pub fn differences(&self) -> Vec<String> {
        let best = self.models[self.best].model.display();
        let others = self
            .models
            .iter()
            .enumerate()
            .filter(|(n, _)| *n != self.best);
        let sentence = |(_, own): (usize, &ModelError)| {
            let name = own.model.display();
            match own.beyond_best_std {
                Some(0.0) => format!("{name}: the same predictions as {best}"),
                None => format!("{name}: the log is too short to compare it with {best}"),
                Some(std) if own.significant => format!(
                    "{name}: error larger by {:.4} ± {std:.4} N m",
                    own.beyond_best
                ),
                Some(std) => format!(
                    "{name}: no significant difference from {best} on this log ({:.4} ± {std:.4} N m)",
                    own.beyond_best
                ),
            }
        };
        others.map(sentence).collect()
    }

    /// The errors as a table: a row per joint if `verbose`, then one over all.
    pub fn table(&self, verbose: bool) -> String {
        let mut table = Table::default();
        let models = || self.models.iter();
        let names = models().map(|m| short(&m.model));
        table.row(
            ["N m rms".to_owned()]
                .into_iter()
                .chain(names)
                .chain(["floor".to_owned()]),
        );
        let joints = self.models[self.best].joints.iter().enumerate();
        for (j, joint) in joints.filter(|_| verbose) {
            let cells = models().map(|m| torque(m.joints[j].rms));
            let floor = joint.floor.map_or(String::new(), torque);
            table.row(
                [joint.joint.clone()]
                    .into_iter()
                    .chain(cells)
                    .chain([floor]),
            );
        }
        let floor = self.error.floor.map_or(String::new(), torque);
        let all = models().map(|m| torque(m.rms)).chain([floor]);
        table.row(["all joints".to_owned()].into_iter().chain(all));
        let fit = models().map(|m| format!("{:.1} %", m.fit_percent));
        table.row(["fit".to_owned()].into_iter().chain(fit));
        table.to_string()
    }

    /// The screen.
    pub fn text(&self, verbose: bool) -> Text<'_> {
        Text(self, verbose)
    }
}

/// [`ModelsComparison`] in words.
#[derive(Debug)]
pub struct Text<'a>(&'a ModelsComparison, bool);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(of, verbose) = self;
        write!(f, "{}", wrapped(&of.headline(), "", "  "))?;
        for sentence in of.differences() {
            write!(f, "{}", wrapped(&sentence, "  • ", "    "))?;
        }
        write!(f, "\n{}", of.table(*verbose))?;
        writeln!(f, "\n  $ {}", of.next())
    }
}

/// What is to be known, each sentence once.
fn warnings(all: &[(PathBuf, Comparison)]) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    for warning in all.iter().flat_map(|(_, comparison)| &comparison.warnings) {
        if !said.contains(warning) {
            said.push(warning.clone());
        }
    }
    said
}

/// A file's name without its folders.
fn short(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Each comparison's series, of the joints and windows that all have, in the order of the first one's joints.
fn common(all: &[(PathBuf, Comparison)]) -> Vec<Vec<JointSeries>> {
    let mut common = vec![Vec::new(); all.len()];
    for first in all.first().iter().flat_map(|(_, first)| &first.series) {
        let same = |(_, other): &'_ (PathBuf, Comparison)| {
            other.series.iter().position(|s| s.joint == first.joint)
        };
        let Some(places) = all.iter().map(same).collect::<Option<Vec<_>>>() else {
            continue;
        };
        let own = || {
            all.iter()
                .zip(&places)
                .map(|((_, c), &place)| &c.series[place])
        };
        let times = |s: &JointSeries| s.t.iter().map(|t| t.to_bits()).collect::<BTreeSet<_>>();
        let in_all = own().map(times).reduce(|a, b| &a & &b).unwrap_or_default();
        for (common, series) in common.iter_mut().zip(own()) {
            let windows = (0..series.t.len()).filter(|&k| in_all.contains(&series.t[k].to_bits()));
            common.push(series.only(&windows.collect::<Vec<_>>()));
        }
    }
    common
}

/// A root mean square over the windows of all joints.
fn over_joints<'a>(joints: impl Iterator<Item = (&'a JointSeries, f64)>) -> f64 {
    ladder::over_all(joints.map(|(s, rms)| (s.t.len() as f64, rms)))
}

fn joint(series: &JointSeries, comparison: &Comparison) -> ModelJoint {
    let own = comparison.joints.iter().find(|j| j.joint == series.joint);
    ModelJoint {
        joint: series.joint.clone(),
        rms: series.rms(),
        fit_percent: fit_percent(std::slice::from_ref(series)),
        floor: own.and_then(|own| own.yardsticks.noise_floor_rms),
    }
}

/// 100 (1 − |error| / |torque − its mean|), each joint with its own mean (Ljung 1999, *System Identification*, section 16.4).
fn fit_percent(joints: &[JointSeries]) -> f64 {
    let squares = |s: &JointSeries| {
        let mean = s.tau.iter().sum::<f64>() / s.tau.len().max(1) as f64;
        let error: f64 = s.residual.iter().map(|r| r * r).sum();
        let torque: f64 = s.tau.iter().map(|x| (x - mean).powi(2)).sum();
        [error, torque]
    };
    let sums = joints.iter().map(squares);
    let [error, torque] = sums.fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
    100.0 * (1.0 - (error / torque.max(f64::MIN_POSITIVE)).sqrt())
}

/// Standard error of the difference of two models' errors, N m, from its spread over blocks of time: a² − b² is (a − b) (a + b), which is
/// `sum`. None of fewer than four blocks, whose spread says little.
fn difference_std(
    recording: &Recording,
    (one, other): (&[JointSeries], &[JointSeries]),
    sum: f64,
) -> Option<f64> {
    const LEAST_BLOCKS: usize = 4;
    let blocks = Blocks::of(&recording.limbs.first()?.1)?;
    let mut of_block = vec![(0.0, 0.0); blocks.count()];
    for (a, b) in one.iter().zip(other) {
        for (k, t) in a.t.iter().enumerate() {
            let at = (t * 1e6) as u64;
            if let Some(block) = blocks.of_window(at, at) {
                of_block[block].0 += a.residual[k].powi(2) - b.residual[k].powi(2);
                of_block[block].1 += 1.0;
            }
        }
    }
    of_block.retain(|(_, windows)| *windows > 0.0);
    if of_block.len() < LEAST_BLOCKS || sum <= 0.0 {
        return None;
    }
    let differences: Vec<f64> = of_block.iter().map(|(square, _)| *square).collect();
    let windows: f64 = of_block.iter().map(|(_, windows)| windows).sum();
    let (_, std) = sum_and_error(&differences);
    Some(std / (windows * sum))
}

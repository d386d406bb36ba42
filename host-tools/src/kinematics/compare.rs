//! Measured poses against a model as it is: where it fails, by target and by pose.

use serde::Serialize;

use super::chain::Chain;
use super::columns::rows;
use super::error::CalibrateError;
use super::fit::Problem;
use super::held_out::place_rms;
use super::poses::Poses;
use super::result::{nominal, stated};
use super::text::mm;
use super::{gates, start};
use crate::model::Model;
use crate::summary::{ErrorRange, Summary, typed};

/// Poses that are shown on the first screen.
const WORST: usize = 3;

/// The error at a pose.
#[derive(Debug, Clone, Serialize)]
pub struct ComparedPose {
    /// The pose: line, row.
    pub pose: String,
    /// The target.
    pub target: String,
    /// Distance between measured and predicted, mm.
    pub error: f64,
}

/// The error of a target.
#[derive(Debug, Clone, Serialize)]
pub struct ComparedTarget {
    /// Its name.
    pub target: String,
    /// Poses that measure it.
    pub poses: usize,
    /// Root mean square distance, mm.
    pub rms: f64,
    /// Mean error along the measuring system's axes, mm.
    pub mean: [f64; 3],
    /// Greatest, mm.
    pub max: f64,
}

/// Measured against model.
#[derive(Debug, Clone, Serialize)]
pub struct PoseComparison {
    /// Root mean square distance over all poses and targets, mm.
    pub rms: f64,
    /// The same with mount and targets alone placed by these poses, held out; the description's kinematics, mm.
    pub placed_rms: f64,
    /// Whether mount and targets were placed by these poses, since the file does not state them.
    pub placed: bool,
    /// Whether the file's values come from these very poses.
    pub fitted_to_these: bool,
    /// By target.
    pub targets: Vec<ComparedTarget>,
    /// By pose, worst first.
    pub poses: Vec<ComparedPose>,
}

/// Compares poses with a model file as it is; what it does not place (mount, targets) is placed by the poses, each left out in turn.
///
/// # Errors
/// [`CalibrateError`] of poses that cannot be.
pub fn compare_poses(poses: &Poses, model: &Model) -> Result<PoseComparison, CalibrateError> {
    let chain = Chain::new(model);
    let (nominal, _) = nominal(poses, model)?;
    let problem = Problem {
        chain: &chain,
        poses,
        used: (0..poses.count()).collect(),
    };
    let (started, _) = gates::check(&chain, &nominal, poses, model)?;
    let placed_fit = problem.fit_fixtures(&started);
    let stated = stated(poses, model)?;
    let (errors, units, rows) = match &stated {
        Some(state) => {
            let rows = rows(&chain, state, &problem.used(), &[], start::UNKNOWN_NOISE);
            (rows.b.clone(), rows.unit.clone(), rows)
        }
        None => {
            let fit = placed_fit.clone();
            (fit.held_out, fit.rows.unit.clone(), fit.rows)
        }
    };
    let mut by_pose = Vec::new();
    let mut sums = vec![(0_usize, 0.0_f64, [0.0_f64; 3], 0.0_f64); poses.targets.len()];
    for (pose, range) in &rows.poses {
        let mut row = range.start;
        while row < range.end {
            let target = rows.target[row];
            let error = [0, 1, 2].map(|k| 1e3 * errors[row + k] * units[row + k]);
            let size = error.iter().map(|x| x * x).sum::<f64>().sqrt();
            let sum = &mut sums[target];
            sum.0 += 1;
            sum.1 += size * size;
            for k in 0..3 {
                sum.2[k] += error[k];
            }
            sum.3 = sum.3.max(size);
            by_pose.push(ComparedPose {
                pose: poses.called(*pose),
                target: poses.targets[target].clone(),
                error: size,
            });
            row += 3;
            while row < range.end && !rows.is_place[row] {
                row += 1;
            }
        }
    }
    by_pose.sort_by(|a, b| b.error.total_cmp(&a.error));
    let targets = poses
        .targets
        .iter()
        .zip(sums)
        .map(|(name, (count, squares, sum, max))| {
            let count_f = count.max(1) as f64;
            ComparedTarget {
                target: name.clone(),
                poses: count,
                rms: (squares / count_f).sqrt(),
                mean: sum.map(|x| x / count_f),
                max,
            }
        });
    Ok(PoseComparison {
        rms: 1e3 * place_rms(&rows, &errors),
        placed_rms: placed_fit.error_mm(),
        placed: stated.is_none(),
        fitted_to_these: stated.is_some() && model.is_of(&poses.files, &[]),
        targets: targets.collect(),
        poses: by_pose,
    })
}

impl PoseComparison {
    /// The errors, as JSON has them.
    pub fn error(&self) -> ErrorRange {
        ErrorRange {
            before: Some(self.placed_rms),
            after: Some(self.rms),
            floor: None,
            floor_unknown: Some("no pose was measured twice"),
            unit: "mm",
        }
    }

    /// What matters most.
    pub fn summary(&self, poses: &Poses, model: Option<&std::path::Path>) -> Summary {
        let from = if self.placed {
            "mount and targets placed by these poses, held out".to_owned()
        } else {
            format!(
                "the description with mount and targets placed: {} mm",
                mm(self.placed_rms)
            )
        };
        let mut points = Vec::new();
        if self.targets.len() > 1 {
            let by = self
                .targets
                .iter()
                .map(|t| format!("{} {} mm", t.target, mm(t.rms)));
            points.push(format!("By target: {}", by.collect::<Vec<_>>().join(", ")));
        }
        let worst = self
            .poses
            .iter()
            .take(WORST)
            .map(|p| format!("{} {} mm", p.pose, mm(p.error)));
        points.push(format!("Worst: {}", worst.collect::<Vec<_>>().join(", ")));
        if self.fitted_to_these {
            points.push(
                "The values are from these very poses: measure others for a held-out error"
                    .to_owned(),
            );
        }
        Summary {
            headline: format!(
                "Error {} mm rms over {} poses ({from})",
                mm(self.rms),
                poses.count()
            ),
            points,
            next: vec![match (self.fitted_to_these, model) {
                (true, Some(_)) => {
                    format!(
                        "proprio excite --poses 30 {} -o chosen.csv",
                        typed(&[], model)
                    )
                }
                _ => format!("proprio calibrate {}", typed(&poses.files, model)),
            }],
            ..Summary::default()
        }
    }

    /// Every target and pose.
    pub fn details(&self) -> String {
        let mut out =
            String::from("\ntarget            poses    rms mm    max mm    mean x y z mm\n");
        for t in &self.targets {
            out += &format!(
                "{:<16} {:>6} {:>9} {:>9}    {:.3} {:.3} {:.3}\n",
                t.target,
                t.poses,
                mm(t.rms),
                mm(t.max),
                t.mean[0],
                t.mean[1],
                t.mean[2]
            );
        }
        out += "\npose                 target           error mm\n";
        for p in &self.poses {
            out += &format!("{:<20} {:<14} {:>10}\n", p.pose, p.target, mm(p.error));
        }
        out
    }
}

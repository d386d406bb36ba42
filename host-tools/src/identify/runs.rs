//! Which run can be trusted: the same parameters from each log on its own, and where they disagree beyond their errors.
//!
//! A parameter that a run identifies is compared with the mean of the other runs, weighted by their errors. What differs by
//! more than chance would once in twenty such reports (Bonferroni 1936; Student's t, since errors come from some thirty
//! blocks of time) is a disagreement: the model lacks something that differs between the runs, or a run is bad.

use std::path::PathBuf;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::estimate::{ParameterEstimate, Status};
use crate::recording::Recording;

/// Chance of any disagreement among runs that agree.
const CHANCE: f64 = 0.05;
/// Degrees of freedom of an error from blocks of time.
const FREEDOM: f64 = 20.0;

/// One log on its own.
#[derive(Debug, Clone, Serialize)]
pub struct Run {
    /// The log.
    pub log: PathBuf,
    /// Root mean square of the fit's residuals, N m.
    pub rms: f64,
    /// The same on stretches of time that the fit has not seen.
    pub held_out_rms: Option<f64>,
    /// Mean temperature of the motors, °C, where recorded.
    pub temperature: Option<f64>,
    /// Root mean square of all joints' speeds, rad/s.
    pub speed: f64,
    /// Root mean square of all joints' torques, N m.
    pub torque: f64,
    /// Parameters that this run disagrees on with the others.
    pub disagreements: usize,
}

/// A parameter that runs identify, and how far the one that differs most is from the others.
#[derive(Debug, Clone, Serialize)]
pub struct Consistency {
    /// The parameter.
    pub parameter: String,
    /// Its unit.
    pub unit: &'static str,
    /// Value and standard deviation in each run that identifies it.
    pub runs: Vec<RunValue>,
    /// Which of the runs differs most from the others.
    pub differs: usize,
    /// By how many standard deviations of the difference.
    pub sigma: f64,
    /// Whether that is no more than chance.
    pub consistent: bool,
}

/// A parameter in one run.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct RunValue {
    /// Which log, counted from 0.
    pub run: usize,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
}

impl Run {
    /// Of a recording, and what its fit leaves: root mean square of the residuals, also on stretches that the fit has not seen, N m.
    pub(super) fn of(recording: &Recording, rms: f64, held_out_rms: Option<f64>) -> Self {
        let size = |of: &dyn Fn(&crate::recording::LimbRecording) -> &[f64]| {
            let (sum, n) = recording
                .limbs
                .iter()
                .fold((0.0, 0), |(sum, n), (_, limb)| {
                    let x = of(limb);
                    (sum + x.iter().map(|x| x * x).sum::<f64>(), n + x.len())
                });
            (sum / n.max(1) as f64).sqrt()
        };
        let warm = recording
            .limbs
            .iter()
            .flat_map(|(_, limb)| &limb.temperature);
        let (sum, n) = warm
            .filter(|t| t.is_finite())
            .fold((0.0, 0u64), |(sum, n), t| (sum + t, n + 1));
        Self {
            log: recording.logs.first().cloned().unwrap_or_default(),
            rms,
            held_out_rms,
            temperature: (n > 0).then(|| sum / n as f64),
            speed: size(&|limb| &limb.dq),
            torque: size(&|limb| &limb.tau),
            disagreements: 0,
        }
    }
}

/// Compares runs parameter by parameter; those that fewer than two runs identify are left out. The worst first. Of each run its estimates, each
/// with by how much its value differs within the run (standard deviation).
pub(super) fn compare(runs: &[Vec<(&ParameterEstimate, f64)>]) -> Vec<Consistency> {
    let Some(first) = runs.first() else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for (parameter, _) in first {
        let name = &parameter.name;
        let told: Vec<RunValue> = runs
            .iter()
            .enumerate()
            .filter_map(|(run, own)| {
                let (estimate, within) = own.iter().find(|(own, _)| own.name == *name)?;
                // An effect that one run shows to be absent differs from one that another run shows.
                let counts = estimate.status != Status::Unexcited
                    && estimate.std <= 0.5 * estimate.prior_std
                    && !estimate.at_bound
                    && estimate.std > 0.0;
                counts.then_some(RunValue {
                    run,
                    value: estimate.value,
                    // What differs within a run is no reason to take less notice of what differs between runs.
                    std: (estimate.std.powi(2) - within.powi(2)).sqrt(),
                })
            })
            .collect();
        let most = (0..told.len())
            .map(|k| (k, difference(&told, k)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((differs, sigma)) = most.filter(|_| told.len() > 1) {
            all.push(Consistency {
                parameter: name.clone(),
                unit: parameter.unit,
                differs: told[differs].run,
                runs: told,
                sigma,
                consistent: true,
            });
        }
    }
    let tests: usize = all.iter().map(|c| c.runs.len()).sum();
    let limit = limit(tests);
    all.iter_mut().for_each(|c| c.consistent = c.sigma <= limit);
    all.sort_by(|a, b| b.sigma.total_cmp(&a.sigma));
    all
}

/// The difference that one of so many tests passes by chance once in twenty times, in standard deviations.
fn limit(tests: usize) -> f64 {
    StudentsT::new(0.0, 1.0, FREEDOM).map_or(f64::INFINITY, |t| {
        t.inverse_cdf(1.0 - 0.5 * CHANCE / tests.max(1) as f64)
    })
}

/// How far one run is from the weighted mean of the others, in standard deviations.
fn difference(runs: &[RunValue], one: usize) -> f64 {
    let others = runs.iter().enumerate().filter(|(k, _)| *k != one);
    let (weights, sum) = others.fold((0.0, 0.0), |(weights, sum), (_, run)| {
        let weight = run.std.powi(-2);
        (weights + weight, sum + weight * run.value)
    });
    let spread = (runs[one].std.powi(2) + 1.0 / weights).sqrt();
    ((runs[one].value - sum / weights) / spread).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(run: usize, value: f64) -> RunValue {
        RunValue {
            run,
            value,
            std: 0.1,
        }
    }

    #[test]
    fn a_run_that_is_off_is_told_by_its_distance_from_the_others() {
        let runs = [run(0, 1.0), run(1, 1.0), run(2, 2.0)];
        // Against a mean of two: √(0.1² + 0.1²/2).
        assert!((difference(&runs, 2) - 1.0 / 0.015f64.sqrt()).abs() < 1e-9);
        assert!(difference(&runs, 2) > difference(&runs, 0));
    }

    #[test]
    fn more_tests_need_a_larger_difference() {
        assert!(
            (limit(1) - 2.086).abs() < 1e-3,
            "Student's t of 20 at 97.5 %: {}",
            limit(1)
        );
        assert!(limit(100) > 3.5);
    }
}

//! What feedback would be left with on a recorded motion.

use std::collections::VecDeque;
use std::path::Path;

use super::{Candidate, Feedback, Sums, ValidateError, feedback};
use crate::excite::Feedforward;
use crate::log::{LogReader, Selection, Warning};
use crate::model::{Limb, Model};

/// Samples on either side of the one in the middle that velocity and acceleration are taken from, and the longest time they may
/// span, s: five at 500 Hz are the 20 ms that the identification looks at. Of slower logs it is as many as the time holds, three at least.
const SIDE: usize = 5;
const SPAN: f64 = 0.04;
const LEAST: usize = 3;

/// One row of a log, of one limb.
#[derive(Debug, Clone)]
struct Sample {
    t: f64,
    q: Vec<f64>,
    dq: Vec<f64>,
    tau: Vec<f64>,
    asked: Vec<f64>,
}

/// The feedback torque of `log` with each candidate, all of one robot, and what a user should know about the log; limbs that the log does not
/// have are left out.
///
/// # Errors
/// [`ValidateError`].
pub fn recorded(
    robot: &Model,
    log: &Path,
    candidates: &[Candidate],
    mut progress: impl FnMut(u64, u64),
) -> Result<(Vec<Feedback>, Vec<Warning>), ValidateError> {
    let mut reader = LogReader::open_of(log, Selection::Everything, robot.robot())?;
    let mut limbs = Vec::new();
    for limb in robot.robot().limbs() {
        limbs.push(OfLimb::new(limb, candidates)?);
    }
    while let Some(row) = reader.next_row()? {
        let part = |all: &[f64], limb: &Limb| {
            all.get(limb.bodies.clone())
                .map_or_else(Vec::new, <[f64]>::to_vec)
        };
        for of in &mut limbs {
            let sample = Sample {
                t: row.t(),
                q: part(row.q(), &of.limb),
                dq: part(row.dq(), &of.limb),
                tau: part(row.tau(), &of.limb),
                asked: part(row.q_des(), &of.limb),
            };
            of.push(sample);
        }
        let (done, total) = reader.progress();
        progress(done, total);
    }
    let warnings = reader.finish()?;
    reader.long_enough()?;
    let names = |of: &OfLimb| -> Vec<String> {
        of.limb
            .bodies
            .clone()
            .map(|b| robot.joint_name(b).to_owned())
            .collect()
    };
    limbs.retain(|of| of.seen);
    if limbs.is_empty() {
        return Err(ValidateError::NoStretch(log.display().to_string()));
    }
    let of_candidate = |c: usize| {
        let joints = limbs
            .iter()
            .flat_map(|of| names(of).into_iter().zip(of.sums[c].iter().cloned()));
        feedback(&candidates[c], &joints.collect::<Vec<_>>())
    };
    Ok(((0..candidates.len()).map(of_candidate).collect(), warnings))
}

struct OfLimb {
    limb: Limb,
    foresights: Vec<Option<Feedforward>>,
    window: VecDeque<Sample>,
    /// Samples since the last one that was judged.
    since: usize,
    /// By candidate, by joint.
    sums: Vec<Vec<Sums>>,
    seen: bool,
}

impl OfLimb {
    fn new(limb: Limb, candidates: &[Candidate]) -> Result<Self, ValidateError> {
        let mut foresights = Vec::new();
        for candidate in candidates {
            foresights.push(match &candidate.model {
                None => None,
                Some(model) => Some(
                    Feedforward::new(model, &limb)
                        .ok_or_else(|| ValidateError::TooLarge(limb.name.clone()))?,
                ),
            });
        }
        Ok(Self {
            sums: vec![vec![Sums::default(); limb.bodies.len()]; candidates.len()],
            limb,
            foresights,
            window: VecDeque::with_capacity(2 * SIDE + 2),
            since: 0,
            seen: false,
        })
    }

    fn push(&mut self, sample: Sample) {
        if sample
            .q
            .iter()
            .chain(&sample.dq)
            .chain(&sample.tau)
            .any(|x| !x.is_finite())
        {
            return;
        }
        // A repeated message was not measured when it is stamped.
        if self.window.back().is_some_and(|last| {
            last.q == sample.q && last.dq == sample.dq && last.tau == sample.tau
        }) {
            return;
        }
        self.window.push_back(sample);
        // Stamps have microseconds.
        let is_long = |span: f64| span > SPAN + 1e-6;
        while self.window.len() > 2 * SIDE + 1 || self.window.len() > LEAST && is_long(self.span())
        {
            self.window.pop_front();
        }
        self.since += 1;
        let (count, span) = (self.window.len(), self.span());
        let is_full = count == 2 * SIDE + 1 || count >= LEAST && span > 0.5 * SPAN;
        if is_full && self.since > count / 2 && !is_long(span) {
            self.since = 0;
            self.judge();
        }
    }

    /// Time from the window's first sample to its last, s.
    fn span(&self) -> f64 {
        match (self.window.front(), self.window.back()) {
            (Some(first), Some(last)) => last.t - first.t,
            _ => 0.0,
        }
    }

    /// The torque in the middle of the window: velocity is the slope of the positions, acceleration that of the velocities, and the
    /// torque the mean, so that all three look at the same stretch.
    fn judge(&mut self) {
        let n = self.limb.bodies.len();
        let count = self.window.len() as f64;
        let middle = self.window.iter().map(|s| s.t).sum::<f64>() / count;
        let square: f64 = self.window.iter().map(|s| (s.t - middle).powi(2)).sum();
        let mean = |of: &dyn Fn(&Sample) -> f64| self.window.iter().map(of).sum::<f64>() / count;
        let slope = |of: &dyn Fn(&Sample) -> f64| {
            self.window
                .iter()
                .map(|s| (s.t - middle) * of(s))
                .sum::<f64>()
                / square
        };
        let each = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(f).collect() };
        let q = each(&|j| mean(&|s| s.q[j]));
        let dq = each(&|j| slope(&|s| s.q[j]));
        let ddq = each(&|j| slope(&|s| s.dq[j]));
        let torque = each(&|j| mean(&|s| s.tau[j]));
        let error = each(&|j| mean(&|s| s.asked.get(j).copied().unwrap_or(f64::NAN) - s.q[j]));
        for (foresight, sums) in self.foresights.iter().zip(&mut self.sums) {
            let forward = foresight
                .as_ref()
                .map_or_else(|| vec![0.0; n], |f| f.torque(&q, &dq, &ddq));
            for j in 0..n {
                sums[j].add(middle, torque[j] - forward[j], torque[j], error[j]);
            }
        }
        self.seen = true;
    }
}

//! `contact`: a force at the foot that the model does not know, found by its direction, its episodes and the joints' agreement.
//!
//! A force λ of the ground adds −Jᵀλ to what the motors give. It is unknown at every instant, and a leg has as many joints
//! as the force has components, so any residual is that of *some* force. What tells a contact from any other effect:
//!
//! - It comes in episodes, with a swing between them in which the catalogue explains the torque. So the catalogue is fitted
//!   to the swing alone, and what is in contact is found anew with that fit, until both agree (a trimmed fit: Rousseeuw &
//!   Leroy 1987, ch. 4).
//! - The ground pushes and does not pull, within a cone of friction.
//! - It lasts: a weak one shows in the median over a run of windows, not in each.
//! - The joints agree: the force, from all joints but one, predicts that one's residual. What acts on one joint alone looks
//!   to it like a force that the others would feel, and do not.
//!
//! For a weak force swing and contact are found under the model's own effects, and the fit of the whole catalogue begins there. Begun anew it
//! would take a weak force in a quarter of the windows for its effects, and not find back (a trimmed fit ends at the minimum next to its start).
//!
//! All residuals are of time that the fit has not seen.

mod judge;
mod look;
mod report;
mod residuals;
mod text;

use nalgebra::{Matrix3, Matrix3xX, Vector3};

use proprio_core::effect::EffectKind;

use crate::equation::column::Columns;
use crate::equation::dot::dot;
use crate::equation::foot::Foot;
use crate::equation::rows::Rows;
use crate::equation::values::Values;
use crate::estimate::accumulate::Folding;
use crate::estimate::factor::HeapFactor;
use crate::estimate::fit::LimbFit;
use crate::estimate::r_factor::RFactor;
use crate::robust::{MEDIAN_OF_NORMAL, QUARTER_OF_NORMAL, quantile};
use crate::select::score_test::{cad_prior, possible};
use look::Look;
pub(crate) use report::{LeftOut, leave_out_contact};
use residuals::Residuals;
pub(crate) use text::words;

/// Coefficient of friction of the ground at most: rubber on dry concrete.
const FRICTION: f64 = 1.0;
/// Windows whose residuals together exceed so many standard deviations of the swing's are no swing.
const LEAST_DEVIATION: f64 = 6.0;
/// Shortest episode, windows of 20 ms.
const SHORTEST: usize = 3;
/// Fewest episodes: from fewer, nothing can be said of how they agree.
const LEAST_EPISODES: usize = 4;
/// Least share of windows in swing that the catalogue can be fitted to.
const LEAST_SWING: f64 = 0.1;
/// Least noise of a joint, as a share of the friction that is expected of it.
const LEAST_NOISE: f64 = 0.1;
/// A force weaker than this is not told from what the model has wrong, N.
const LEAST_FORCE: f64 = 1.0;
/// Size of the mean force in units of its standard deviation from which on it counts. Four legs are tested, not a hundred
/// candidates: chance gives one of them this much once in ten thousand logs.
const LEAST_Z: f64 = 4.0;
/// The same where the joints agree on the force up to [`AGREED`]: from few episodes chance reaches no more, and nothing else in
/// a leg acts on all its joints as a force at the foot does.
const LEAST_Z_AGREED: f64 = 3.0;
/// Share of the residuals' sum of squares that the other joints predict, from which on they agree.
const AGREED: f64 = 0.9;
/// Least share of the residuals' sum of squares that the other joints must predict.
const LEAST_GAIN: f64 = 0.3;
/// Least share of the windows that are no swing in which the ground pushes: any other effect pulls as often.
const LEAST_PUSHING: f64 = 0.7;

/// What a limb's residuals say of a force at its foot.
#[derive(Debug, Clone)]
pub(crate) struct Contact {
    /// Normal force during episodes, N: its mean over episodes.
    pub(crate) force: f64,
    /// Standard deviation of that, from the spread over episodes.
    pub(crate) std: f64,
    /// The mean in units of its standard deviation, as a normal variable has it.
    pub(crate) z: f64,
    /// 1 − the held-out sum of squares in contact, each joint's residual less what the others predict of it, over that without.
    pub(crate) gain: f64,
    /// Error of that, from the spread over folds.
    pub(crate) gain_error: f64,
    /// Share of time in contact.
    pub(crate) share: f64,
    /// Of the windows that are no swing, the share in which the ground pushes.
    pub(crate) pushing: f64,
    /// Number of episodes.
    pub(crate) episodes: usize,
    /// Correlation of contact with the foot's sensor, where there is one.
    pub(crate) sensor: Option<f64>,
    /// Samples in contact, as ranges \[first, last\], ascending.
    pub(crate) samples: Vec<[usize; 2]>,
    /// Whether the place of the foot is in the robot's description.
    pub(crate) described: bool,
}

impl Contact {
    /// The effect that it is.
    pub(crate) const EFFECT: EffectKind = EffectKind::Contact;

    /// Whether there is a contact beyond chance, and nothing but a contact looks like it.
    pub(crate) fn is_significant(&self) -> bool {
        self.force > LEAST_FORCE
            && (self.z >= LEAST_Z || self.z >= LEAST_Z_AGREED && self.gain > AGREED)
            && self.gain > LEAST_GAIN
            && self.gain > 2.0 * self.gain_error
            && self.pushing >= LEAST_PUSHING
    }
}

/// One window of the limb.
struct Window {
    fold: usize,
    samples: [usize; 2],
    jacobian: Matrix3xX<f64>,
}

/// What a window is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Swing,
    /// The ground pushes.
    Contact,
    /// Neither: torques of another cause.
    Other,
}

struct Search<'a> {
    fit: &'a LimbFit<'a>,
    /// The columns of the model and, where it is asked for, of the whole catalogue.
    columns: Columns,
    rows: Rows,
    windows: Vec<Window>,
    described: bool,
    /// Away from the ground.
    up: Vector3<f64>,
    residuals: Residuals,
    look: Look,
    /// Their medians over runs of windows; none before the first fit, or where they are not looked at.
    runs: Residuals,
    phases: Vec<Phase>,
}

impl<'a> Search<'a> {
    fn new(fit: &'a LimbFit<'a>, look: Look, catalogue: bool) -> Option<Self> {
        let data = fit.data;
        let foot = Foot::of(data.model, data.limb)?;
        let (n, base) = (data.joints(), data.body.base(&fit.values));
        let of = |(w, window): (usize, &crate::equation::motion::Window)| {
            let mean = |j: usize| {
                data.motion
                    .mean(window, |k| data.motion.joint[j].state[k][0])
            };
            Window {
                fold: data.fold(w),
                samples: window.samples,
                jacobian: foot.jacobian(&base, &(0..n).map(mean).collect::<Vec<_>>()),
            }
        };
        let windows: Vec<Window> = data.motion.windows.iter().enumerate().map(of).collect();
        // Two joints or fewer cannot vouch for each other.
        if n < 3 || windows.len() < 10 * SHORTEST || !data.blocks.can_hold_out() {
            return None;
        }
        let candidates = if catalogue {
            possible(fit, &[])
        } else {
            Vec::new()
        };
        let columns = data.columns(&fit.values, &fit.places, &candidates);
        Some(Self {
            rows: data.rows(&fit.values, &columns),
            columns,
            described: foot.described,
            up: Vector3::z(),
            residuals: Residuals::default(),
            look,
            runs: Residuals::default(),
            phases: vec![Phase::Swing; windows.len()],
            windows,
            fit,
        })
    }

    /// Finds swing and contact, beginning with the phases that are given or the model as it is given; false if too little swing is found.
    ///
    /// On little swing the whole catalogue may predict worse than the model as it is given: of each joint, the one that
    /// predicts unseen swing better is taken.
    fn run(&mut self, begin: Option<Vec<Phase>>) -> bool {
        let given = self.given();
        self.residuals.own.clone_from(&given);
        let friction = self.friction();
        // Generous with contact at first: a force that the fit takes for swing it explains away.
        self.residuals.noise = friction.iter().map(|noise| 0.5 * noise).collect();
        let mut begin = begin;
        for round in 0..self.look.rounds() {
            let before = self.phases.clone();
            match begin.take() {
                Some(phases) => self.phases = phases,
                None => self.classify(),
            }
            if (self.count(Phase::Swing) as f64) < LEAST_SWING * self.windows.len() as f64 {
                return false;
            }
            // Before the first fit a weak force hides in the friction that the file does not know.
            if round > 0 && before == self.phases {
                return true;
            }
            let fitted = self.predict(&self.fit_swing());
            let swing = |w: usize| self.phases[w] == Phase::Swing;
            let scales = [&given, &fitted].map(|of| self.scale(of, 0.5, MEDIAN_OF_NORMAL, swing));
            for joint in 0..friction.len() {
                let better = usize::from(scales[1][joint] < scales[0][joint]);
                let chosen = [&given, &fitted][better];
                for (to, from) in self.residuals.own.iter_mut().zip(chosen) {
                    to[joint] = from[joint];
                }
                // A leg at rest has less noise than one that moves.
                let least = LEAST_NOISE * friction[joint];
                self.residuals.noise[joint] = scales[better][joint].max(least);
            }
            if self.look == Look::Runs {
                self.runs.own = self.residuals.runs();
                let noise = self.scale(&self.runs.own, 0.5, MEDIAN_OF_NORMAL, swing);
                let least = friction.iter().map(|friction| LEAST_NOISE * friction);
                self.runs.noise = noise.iter().zip(least).map(|(n, l)| n.max(l)).collect();
            }
        }
        true
    }

    /// What the model as it is given may have wrong in swing, of each joint, N m: friction as the catalogue expects it, or
    /// less where a quarter of all windows says so; half of the time or more may be contact.
    fn friction(&self) -> Vec<f64> {
        let small = self.scale(&self.residuals.own, 0.25, QUARTER_OF_NORMAL, |_| true);
        let of = |(joint, small): (usize, f64)| {
            let (mean, std) = self.fit.data.prior((EffectKind::Coulomb, joint), 0);
            small.min(mean + std)
        };
        small.into_iter().enumerate().map(of).collect()
    }

    fn count(&self, phase: Phase) -> usize {
        self.phases.iter().filter(|p| **p == phase).count()
    }

    /// Residuals of the model as its file gives it.
    fn given(&self) -> Vec<Vec<f64>> {
        let data = self.fit.data;
        let predicted = data.predicted(&Values::given(data.model, data.limb), &|_| true);
        let differences: Vec<f64> = data
            .torque
            .iter()
            .zip(predicted)
            .map(|(y, p)| y - p)
            .collect();
        differences
            .chunks(data.joints())
            .map(<[f64]>::to_vec)
            .collect()
    }

    /// Residuals under each fold's θ.
    fn predict(&self, theta: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let data = self.fit.data;
        let own: Vec<Vec<Vec<f64>>> = theta
            .iter()
            .map(|theta| self.columns.combined(theta))
            .collect();
        let residual = |w: usize, j: usize| {
            let torque = data.torque[w * data.joints() + j];
            torque - dot(&own[data.fold(w)][j], self.rows.row(w, j))
        };
        (0..self.windows.len())
            .map(|w| (0..data.joints()).map(|j| residual(w, j)).collect())
            .collect()
    }

    /// Standard deviation of each joint's `residuals` from what a `share` of their sizes is below, which is `normal` for a normal variable.
    fn scale(
        &self,
        residuals: &[Vec<f64>],
        share: f64,
        normal: f64,
        chosen: impl Fn(usize) -> bool,
    ) -> Vec<f64> {
        let of = |joint: usize| {
            let own = (0..self.windows.len()).filter(|&w| chosen(w));
            let sizes = own.map(|w| residuals[w][joint].abs());
            let size = quantile(sizes, share).unwrap_or(0.0) / normal;
            size.max(1e-3 * self.fit.noise[joint])
        };
        (0..self.fit.data.joints()).map(of).collect()
    }

    /// θ of each fold by the swing of all others: the whole catalogue within its priors, so that nothing which another
    /// effect explains is left to a force.
    fn fit_swing(&self) -> Vec<Vec<f64>> {
        let data = self.fit.data;
        let swing = |w: usize| self.phases[w] == Phase::Swing;
        let theta = self.columns.theta(&self.fit.values);
        let correlation = &self.fit.correlation;
        let folding = Folding {
            data,
            columns: &self.columns,
            rows: &self.rows,
            theta: &theta,
            correlation,
            noise: &self.residuals.noise,
        };
        let folds = folding.folds(&swing);
        let all = self.columns.entries.len();
        let prior = cad_prior(data);
        let solve = |train: &Vec<HeapFactor>| {
            RFactor::new(&self.columns, &prior, train, &self.residuals.noise, all).solve(&[])
        };
        let (trains, _) = folds.without_each(&self.columns);
        trains.iter().map(solve).collect()
    }

    /// Says of each window what it is.
    fn classify(&mut self) {
        let phase = |w: usize| {
            let looks = [&self.residuals, &self.runs].into_iter();
            let mut looks = looks.filter(|of| !of.own.is_empty());
            let Some(unlike) = looks.find(|of| of.deviation(w) >= LEAST_DEVIATION.powi(2)) else {
                return Phase::Swing;
            };
            let force = self.force(unlike, w, None, &weak());
            let normal = force.dot(&self.up);
            let tangential = (force - self.up * normal).norm();
            if normal > LEAST_FORCE && tangential <= FRICTION * normal {
                Phase::Contact
            } else {
                Phase::Other
            }
        };
        self.phases = (0..self.windows.len()).map(phase).collect();
        self.tidy();
    }

    /// Closes gaps of one window in a contact, and what is shorter than an episode is no contact.
    fn tidy(&mut self) {
        for w in 1..self.phases.len().saturating_sub(1) {
            if self.phases[w - 1] == Phase::Contact && self.phases[w + 1] == Phase::Contact {
                self.phases[w] = Phase::Contact;
            }
        }
        for [first, last] in self.episodes(Phase::Contact) {
            if last - first < SHORTEST {
                self.phases[first..last].fill(Phase::Other);
            }
        }
    }

    /// Runs of windows of one phase, each as [first, one past the last].
    fn episodes(&self, phase: Phase) -> Vec<[usize; 2]> {
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for w in (0..self.phases.len()).filter(|&w| self.phases[w] == phase) {
            match runs.last_mut() {
                Some(run) if run[1] == w => run[1] = w + 1,
                _ => runs.push([w, w + 1]),
            }
        }
        runs
    }

    /// The most likely force on the foot in window w (N) from `residuals` of all joints but `without`; `likely` is the inverse of the second
    /// moment that forces are expected to have, 1/N².
    fn force(
        &self,
        residuals: &Residuals,
        w: usize,
        without: Option<usize>,
        likely: &Matrix3<f64>,
    ) -> Vector3<f64> {
        let (mut information, mut right) = (*likely, Vector3::zeros());
        let window = &self.windows[w];
        for (j, r) in residuals.own[w].iter().enumerate() {
            if Some(j) != without {
                let (column, weight) = (window.jacobian.column(j), residuals.noise[j].powi(-2));
                information += column * column.transpose() * weight;
                right -= column * (r * weight);
            }
        }
        let solved = information.cholesky().map(|c| c.solve(&right));
        solved.unwrap_or_else(Vector3::zeros)
    }
}

/// What is expected of a force before any data: some hundred newtons in any direction.
fn weak() -> Matrix3<f64> {
    Matrix3::identity() / 200f64.powi(2)
}

#[cfg(test)]
mod tests;

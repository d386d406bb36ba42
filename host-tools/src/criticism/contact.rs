//! `contact`: a force at the foot that the model does not know, found by its direction, its episodes and the joints' agreement.
//!
//! A force λ of the ground adds −Jᵀλ to what the motors give. It is unknown at every instant, and a leg has as many joints
//! as the force has components, so any residual is that of *some* force. What tells a contact from any other effect:
//!
//! - It comes in episodes, with a swing between them in which the catalogue explains the torque. So the catalogue is fitted
//!   to the swing alone, and what is in contact is found anew with that fit, until both agree (a trimmed fit: Rousseeuw &
//!   Leroy 1987, ch. 4).
//! - The ground pushes and does not pull, within a cone of friction.
//! - The joints agree: the force, from all joints but one, predicts that one's residual. What acts on one joint alone looks
//!   to it like a force that the others would feel, and do not.
//!
//! All residuals are of time that the fit has not seen.

mod judge;
mod report;

use nalgebra::{Matrix3, Matrix3xX, Vector3};

use proprio_core::effect::EffectKind;

use super::blocks::HeapFactor;
use super::foot::Foot;
use super::limb::LimbCriticism;
use super::triangle::Triangle;
use super::windows;
pub(crate) use report::{LeftOut, leave_out_contact, reason, words};

/// Coefficient of friction of the ground at most: rubber on dry concrete.
const FRICTION: f64 = 1.0;
/// Windows whose residuals together exceed so many standard deviations of the swing's are no swing.
const LEAST_DEVIATION: f64 = 6.0;
/// Shortest episode, windows of 20 ms.
const SHORTEST: usize = 3;
/// Fewest episodes: from fewer, nothing can be said of how they agree.
const LEAST_EPISODES: usize = 4;
/// Times that the swing and the fit to it are found anew.
const ROUNDS: usize = 6;
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
    /// Whether there is a contact beyond chance, and nothing but a contact looks like it.
    pub(crate) fn is_significant(&self) -> bool {
        self.force > LEAST_FORCE
            && (self.z >= LEAST_Z || self.z >= LEAST_Z_AGREED && self.gain > AGREED)
            && self.gain > LEAST_GAIN
            && self.gain > 2.0 * self.gain_error
            && self.pushing >= LEAST_PUSHING
    }

    /// What a limb's residuals say; `None` if hardly anything is unlike swing, or the limb is too short to tell.
    pub(crate) fn of(limb: &LimbCriticism) -> Option<Self> {
        let mut search = Search::new(limb)?;
        search.run().then(|| search.judge())?
    }
}

/// Whether a contact is worth looking for: a look with the effects of the model alone, without the columns of a catalogue that
/// it does not have. A force that is no larger than what these have wrong in swing is overlooked.
pub(crate) fn is_suspected(limb: &LimbCriticism) -> bool {
    let Some(mut search) = Search::new(limb) else {
        return false;
    };
    // Little swing is what a leg on the ground has.
    !search.run() || search.episodes(Phase::Contact).len() >= LEAST_EPISODES
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
    limb: &'a LimbCriticism<'a>,
    windows: Vec<Window>,
    described: bool,
    /// Away from the ground.
    up: Vector3<f64>,
    /// Measured − predicted torque of each window's joints, N m.
    residuals: Vec<Vec<f64>>,
    /// Of each joint in swing, N m.
    noise: Vec<f64>,
    phases: Vec<Phase>,
}

impl<'a> Search<'a> {
    fn new(limb: &'a LimbCriticism<'a>) -> Option<Self> {
        let foot = Foot::of(limb.model, limb.limb)?;
        let (n, base) = (limb.recording.joints, limb.rows().base);
        let of = |window: windows::Window| {
            let [first, last] = window.samples;
            let mean = |j: usize| {
                let sum: f64 = (first..=last).map(|k| limb.motion.q[k * n + j]).sum();
                sum / (last - first + 1) as f64
            };
            Window {
                fold: limb.fold(window.block),
                samples: window.samples,
                jacobian: foot.jacobian(&base, &(0..n).map(mean).collect::<Vec<_>>()),
            }
        };
        let windows: Vec<Window> = limb.windows.iter().map(of).collect();
        // Two joints or fewer cannot vouch for each other.
        if n < 3 || windows.len() < 10 * SHORTEST || !limb.blocks.can_hold_out() {
            return None;
        }
        Some(Self {
            limb,
            described: foot.described,
            up: Vector3::z(),
            residuals: Vec::new(),
            noise: limb.fit.noise.clone(),
            phases: vec![Phase::Swing; windows.len()],
            windows,
        })
    }

    /// Finds swing and contact, beginning with the model as it is given; false if too little swing is found.
    ///
    /// On little swing the whole catalogue may predict worse than the model as it is given: of each joint, the one that
    /// predicts unseen swing better is taken.
    fn run(&mut self) -> bool {
        let given = self.predict(&vec![self.limb.given(); self.limb.tests.len()]);
        self.residuals.clone_from(&given);
        let friction = self.friction();
        // Generous with contact at first: a force that the fit takes for swing it explains away.
        self.noise = friction.iter().map(|noise| 0.5 * noise).collect();
        for _ in 0..ROUNDS {
            let before = self.phases.clone();
            self.classify();
            if (self.count(Phase::Swing) as f64) < LEAST_SWING * self.windows.len() as f64 {
                return false;
            }
            if before == self.phases {
                return true;
            }
            let fitted = self.predict(&self.fit_swing());
            let swing = |w: usize| self.phases[w] == Phase::Swing;
            let scales = [&given, &fitted].map(|of| self.scale(of, 0.5, 0.6745, swing));
            for joint in 0..friction.len() {
                let better = usize::from(scales[1][joint] < scales[0][joint]);
                let chosen = [&given, &fitted][better];
                for (to, from) in self.residuals.iter_mut().zip(chosen) {
                    to[joint] = from[joint];
                }
                // A leg at rest has less noise than one that moves.
                self.noise[joint] = scales[better][joint].max(LEAST_NOISE * friction[joint]);
            }
        }
        true
    }

    /// What the model as it is given may have wrong in swing, of each joint, N m: friction as the catalogue expects it, or
    /// less where a quarter of all windows says so; half of the time or more may be contact.
    fn friction(&self) -> Vec<f64> {
        let small = self.scale(&self.residuals, 0.25, 0.3186, |_| true);
        let of = |(joint, small): (usize, f64)| {
            let body = self.limb.limb.bodies.start + joint;
            let prior = self
                .limb
                .model
                .robot()
                .effect_prior(EffectKind::Coulomb, body);
            small.min(prior.mean + prior.std)
        };
        small.into_iter().enumerate().map(of).collect()
    }

    fn count(&self, phase: Phase) -> usize {
        self.phases.iter().filter(|p| **p == phase).count()
    }

    /// Residuals under each fold's θ.
    fn predict(&self, theta: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let theta: Vec<Vec<Vec<f64>>> = theta
            .iter()
            .map(|theta| self.limb.columns.combined(theta))
            .collect();
        let of = |window: windows::Window| {
            let theta = &theta[self.limb.fold(window.block)];
            (theta.iter().enumerate())
                .map(|(joint, theta)| window.residual(joint, theta))
                .collect()
        };
        self.limb.windows.iter().map(of).collect()
    }

    /// Standard deviation of each joint's `residuals` from a quantile of their size, which is `normal` for a normal variable.
    fn scale(
        &self,
        residuals: &[Vec<f64>],
        quantile: f64,
        normal: f64,
        chosen: impl Fn(usize) -> bool,
    ) -> Vec<f64> {
        let of = |joint: usize| {
            let mut sizes: Vec<f64> = (0..self.windows.len())
                .filter(|&w| chosen(w))
                .map(|w| residuals[w][joint].abs())
                .collect();
            sizes.sort_unstable_by(f64::total_cmp);
            let at = (quantile * sizes.len() as f64) as usize;
            let size = sizes.get(at).copied().unwrap_or(0.0) / normal;
            size.max(1e-3 * self.limb.fit.noise[joint])
        };
        (0..self.limb.recording.joints).map(of).collect()
    }

    /// θ of each fold by the swing of all others: the whole catalogue within its priors, so that nothing which another
    /// effect explains is left to a force.
    fn fit_swing(&self) -> Vec<Vec<f64>> {
        let columns = &self.limb.columns;
        let folds = self.limb.fold_windows(|w| self.phases[w] == Phase::Swing);
        let all: Vec<usize> = (0..columns.entries.len()).collect();
        let solve = |train: &Vec<HeapFactor>| {
            Triangle::new(columns, &self.limb.prior, train, &self.noise, &all, &[])
                .solve(all.len(), &[])
        };
        let (trains, _) = folds.without_each(columns);
        trains.iter().map(solve).collect()
    }

    /// Says of each window what it is.
    fn classify(&mut self) {
        let phase = |w: usize| {
            let sizes = self.residuals[w].iter().zip(&self.noise);
            let deviation: f64 = sizes.map(|(r, noise)| (r / noise).powi(2)).sum();
            if deviation < LEAST_DEVIATION.powi(2) {
                return Phase::Swing;
            }
            let force = self.force(w, None, &weak());
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

    /// The most likely force on the foot in window w (N) from all joints but `without`; `likely` is the inverse of the second
    /// moment that forces are expected to have, 1/N².
    fn force(&self, w: usize, without: Option<usize>, likely: &Matrix3<f64>) -> Vector3<f64> {
        let (mut information, mut right) = (*likely, Vector3::zeros());
        let window = &self.windows[w];
        for (j, r) in self.residuals[w].iter().enumerate() {
            if Some(j) != without {
                let (column, weight) = (window.jacobian.column(j), self.noise[j].powi(-2));
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

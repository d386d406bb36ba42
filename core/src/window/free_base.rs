//! The momentum equation of a robot whose base moves and whose feet touch the ground: integrated rows from gyro and
//! accelerometer, without attitude, velocity or contact forces.
//!
//! Dynamics is the same in every frame that moves uniformly, and in a freely falling one gravity is absent. Inside a window the
//! equations are written in the frame that has the IMU's velocity when the window opens and falls freely from then on. With the
//! accelerometer's specific force s and the gyro's ω, both in the IMU's axes, the IMU's velocity in that frame follows from
//!
//! ```text
//! v̇ = s − ω × v,     v(t1) = 0
//! ```
//!
//! over some tens of milliseconds, and with P of [`Projector`] the equations are
//!
//! ```text
//! ∫ P d(W_m θ) − ∫ P W_c θ dt + effect columns = ∫ P Sᵀτ dt,     ∫ P dM = [P M] − ∫ Ṗ M dt
//! ```
//!
//! from d(H q̇)/dt = Cᵀq̇ + Sᵀτ + Jᵀλ (`design.md` §2). The integral over dM is a Stieltjes sum, ½ (P_k + P_k+1)(M_k+1 − M_k):
//! partial integration with Ṗ has the same error of second order, but takes noise of the joint velocities into Ṗ, three times the
//! products, and a derivative that does not exist where P changes rank.
//!
//! An accelerometer that reads s + b makes the frame fall by b too fast: each body then feels its mass times b. With the robot's
//! inertia matrix H as `tree` has it, the column of b is −∫ P H_l dt, H_l the columns of the base's translation in the IMU's axes.
//! It is a derivative at that H: with parameters far from the tree's, make the rows again.
//!
//! Dry friction that holds a joint is anything up to its size, as a force at a foot is anything. So the equation of a joint that may rest within a
//! window is left out of it, with zero in place of its [`scale`](FreeBaseSetup::scale): P then takes the contact forces out of the
//! others alone, which is the projector onto what neither the feet's forces nor that joint's friction reaches.
//!
//! A window ends when a foot touches down or lifts off, so that P is of the same feet all through it, and no impact lies inside:
//! the time between two samples that differ in what is loaded belongs to no window.

use super::{Implausible, Plausible, Settings, joint_state, microseconds};
use crate::contact::{Foot, Projector};
use crate::effect::{JointState, Term};
use crate::inertia::INERTIAL;
use crate::regressor::RegressorRows;
use crate::spatial::{Motion, Transform};
use crate::tree::{Kinematics, Tree};
use crate::window::sequence::implausible;
use crate::window::{EffectList, Sample};
use crate::{Real, scalar::real};
use nalgebra::{SMatrix, SVector, Vector3};

mod rows;

pub use rows::FreeBaseRows;
use rows::Share;

/// One measurement of a robot with a free base, `J` joints and `F` feet; SI, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeBaseSample<T: Real, const J: usize, const F: usize> {
    /// The joints.
    pub joints: Sample<T, J>,
    /// Angular velocity, rad/s, in the IMU's axes.
    pub gyro: Vector3<T>,
    /// Specific force, m/s², in the IMU's axes: what an accelerometer reads.
    pub acc: Vector3<T>,
    /// Unit vector along gravity, in the IMU's axes.
    pub down: Vector3<T>,
    /// Which feet may carry a force.
    pub loaded: [bool; F],
    /// Joints that dry friction may hold within the window that this sample may open. Their equations are left out of it, for what
    /// friction is at rest, up to its size, no sensor tells.
    pub resting: [bool; J],
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FreeBasePush {
    /// It was used.
    Used,
    /// It was used and a window was closed, by it or just before it: [`FreeBaseWindow::rows`] has new rows.
    Closed,
    /// It was used, but a foot touched down or lifted off since the last one, and the open window, too short for rows, is lost.
    Cut,
    /// It was used, but the time since the last one is not bridged, or the clock was set back; the open window is lost.
    Gap,
    /// All readings of the joints equal the last sample's: skipped.
    Repeated,
    /// Its time is not after the last sample's: skipped.
    Late,
    /// It cannot be true: skipped.
    Rejected(Implausible),
}

/// What a robot's rows need beside its tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeBaseSetup<T: Real, const V: usize, const J: usize, const F: usize> {
    /// Placement of the IMU in the base.
    pub imu: Transform<T>,
    /// The feet.
    pub feet: [Foot<T>; F],
    /// What the equations are multiplied by before contact forces are projected out, so that their noise is alike; > 0.
    pub scale: [T; V],
    /// What the joints can do.
    pub plausible: [Plausible<T>; J],
    /// Window lengths.
    pub settings: Settings,
    /// The accelerometer reads this too much, m/s².
    pub acc_bias: Vector3<T>,
    /// Speeds below which the sign of a joint's may be noise, rad/s; > 0.
    pub speed_noise: [T; J],
}

/// The window being filled: `B` bodies, the first one the base on its free joint, `V` = 6 + `J` velocity coordinates, `F` feet,
/// `R` = 3 `F`, `E` effects per joint.
///
/// Everything is computed in place, with the same instructions whatever touches the ground.
#[derive(Clone, Debug)]
pub struct FreeBaseWindow<
    T: Real,
    const B: usize,
    const V: usize,
    const J: usize,
    const F: usize,
    const R: usize,
    const E: usize,
    L,
> {
    tree: Tree<T, B, V>,
    effects: L,
    setup: FreeBaseSetup<T, V, J, F>,
    last: Option<FreeBaseSample<T, J, F>>,
    /// When the sample that was skipped last came, if it was late and none was used since.
    late_us: Option<u64>,
    start_us: u64,
    /// [`FreeBaseSetup::scale`], but zero for equations that are left out of this window.
    scale: [T; V],
    resting: [bool; J],
    /// The IMU's velocity in the falling frame, m/s, in its axes.
    velocity: Vector3<T>,
    kinematics: Kinematics<T, B, V>,
    inertia: SMatrix<T, V, V>,
    projector: Projector<T, V, R>,
    /// W_m and the effects' boundary terms at the last sample, and at this one.
    momentum: RegressorRows<T, B, V>,
    next_momentum: RegressorRows<T, B, V>,
    boundary: [[T; E]; J],
    /// The Coriolis-transpose regressor at the last sample.
    coriolis: RegressorRows<T, B, V>,
    /// What the last sample's projector will be multiplied with.
    share: Share<T, B, V, J, E>,
    rows: FreeBaseRows<T, B, V, J, E>,
    sum: FreeBaseRows<T, B, V, J, E>,
}

impl<
    T: Real,
    const B: usize,
    const V: usize,
    const J: usize,
    const F: usize,
    const R: usize,
    const E: usize,
    L: EffectList<E>,
> FreeBaseWindow<T, B, V, J, F, R, E, L>
{
    /// An empty window for `tree`, whose root has a free joint.
    pub fn new(tree: Tree<T, B, V>, effects: L, setup: FreeBaseSetup<T, V, J, F>) -> Self {
        const { assert!(V == J + 6 && R == 3 * F) }
        let nothing = [[[T::zero(); INERTIAL]; B]; V];
        Self {
            tree,
            effects,
            setup,
            last: None,
            late_us: None,
            start_us: 0,
            scale: setup.scale,
            resting: [false; J],
            velocity: Vector3::zeros(),
            kinematics: Kinematics::new(),
            inertia: SMatrix::zeros(),
            projector: Projector::new(),
            momentum: nothing,
            next_momentum: nothing,
            boundary: [[T::zero(); E]; J],
            coriolis: nothing,
            share: Share::zero(),
            rows: FreeBaseRows::zero(),
            sum: FreeBaseRows::zero(),
        }
    }

    /// The rows of the window closed last; of use after [`FreeBasePush::Closed`].
    pub fn rows(&self) -> &FreeBaseRows<T, B, V, J, E> {
        &self.rows
    }

    /// Forgets the open window and the last sample.
    pub fn clear(&mut self) {
        self.last = None;
        self.late_us = None;
    }

    /// Takes the next sample; of late ones as [`Window::push`](super::Window::push) says.
    pub fn push(&mut self, sample: &FreeBaseSample<T, J, F>) -> FreeBasePush {
        if let Some(reason) = self.implausible(sample) {
            return FreeBasePush::Rejected(reason);
        }
        let now = sample.joints.time_us;
        let Some(last) = self.last else {
            self.open(sample);
            return FreeBasePush::Used;
        };
        if now <= last.joints.time_us {
            if self.late_us.replace(now).is_none_or(|before| now <= before) {
                return FreeBasePush::Late;
            }
            self.open(sample);
            return FreeBasePush::Gap;
        }
        let (a, b) = (&sample.joints, &last.joints);
        if a.q == b.q && a.dq == b.dq && a.tau == b.tau {
            return FreeBasePush::Repeated;
        }
        let step_us = now - last.joints.time_us;
        if step_us > self.setup.settings.max_gap_us {
            self.open(sample);
            return FreeBasePush::Gap;
        }
        if sample.loaded != last.loaded {
            // Closed at the last sample, if there is enough of it to be worth a row.
            let closed = self.close(last.joints.time_us, self.setup.settings.window_us / 2);
            self.open(sample);
            return if closed {
                FreeBasePush::Closed
            } else {
                FreeBasePush::Cut
            };
        }
        self.late_us = None;
        self.advance(&last, sample, microseconds(step_us));
        if now - self.start_us >= self.setup.settings.window_us && self.close(now, 0) {
            self.open(sample);
            return FreeBasePush::Closed;
        }
        FreeBasePush::Used
    }

    /// Opens a window at a sample.
    fn open(&mut self, sample: &FreeBaseSample<T, J, F>) {
        self.late_us = None;
        self.start_us = sample.joints.time_us;
        self.velocity = Vector3::zeros();
        self.sum.clear();
        self.share = Share::zero();
        self.resting = sample.resting;
        self.scale = self.setup.scale;
        for j in (0..J).filter(|j| sample.resting[*j]) {
            self.scale[6 + j] = T::zero();
        }
        self.measure(sample);
        core::mem::swap(&mut self.momentum, &mut self.next_momentum);
        self.boundary = self.boundaries(sample);
        self.project(sample);
        self.last = Some(*sample);
    }

    /// Takes the window one step further.
    fn advance(
        &mut self,
        last: &FreeBaseSample<T, J, F>,
        sample: &FreeBaseSample<T, J, F>,
        step: T,
    ) {
        let half = step * real(0.5);
        self.accelerate(last, sample, step);
        // The last sample's trapezium of the time between, then this one's.
        self.add_rates(last, half);
        self.measure(sample);
        let boundary = self.boundaries(sample);
        self.share
            .add_half_difference(&self.momentum, &self.next_momentum);
        self.share.add_effects(&self.boundary, &boundary);
        self.sum
            .add_projected(&self.tree, &self.projector, &self.share, &self.scale);
        self.share.keep_differences();
        core::mem::swap(&mut self.momentum, &mut self.next_momentum);
        self.boundary = boundary;
        self.project(sample);
        self.add_rates(sample, half);
        self.last = Some(*sample);
    }

    /// Ends the window with the sample at `now_us`, if it is at least `least_us` long and has an inside.
    fn close(&mut self, now_us: u64, least_us: u64) -> bool {
        if now_us < self.start_us + least_us.max(1) {
            return false;
        }
        self.sum
            .add_projected(&self.tree, &self.projector, &self.share, &self.scale);
        let per_second = T::one() / microseconds(now_us - self.start_us);
        self.rows.set_mean(&self.sum, per_second);
        self.rows.span_us = [self.start_us, now_us];
        let left_out = self.resting.iter().filter(|resting| **resting).count();
        self.rows.rank = V - left_out - self.projector.rank();
        self.rows.resting = self.resting;
        true
    }

    /// The IMU's velocity one sample later (Heun's method).
    fn accelerate(
        &mut self,
        last: &FreeBaseSample<T, J, F>,
        sample: &FreeBaseSample<T, J, F>,
        step: T,
    ) {
        let rate = |at: &FreeBaseSample<T, J, F>, v: &Vector3<T>| {
            at.acc - self.setup.acc_bias - at.gyro.cross(v)
        };
        let first = rate(last, &self.velocity);
        let second = rate(sample, &(self.velocity + first * step));
        self.velocity += (first + second) * (step * real(0.5));
    }

    /// Kinematics, momentum, Coriolis-transpose and inertia at a sample.
    fn measure(&mut self, sample: &FreeBaseSample<T, J, F>) {
        let base = self.setup.imu.act(&Motion::new(sample.gyro, self.velocity));
        let mut q = SVector::<T, V>::zeros();
        let mut v = SVector::<T, V>::zeros();
        for n in 0..3 {
            v[n] = base.angular[n];
            v[3 + n] = base.linear[n];
        }
        for j in 0..J {
            q[6 + j] = sample.joints.q[j];
            v[6 + j] = sample.joints.dq[j];
        }
        let frame = Transform::identity();
        self.tree
            .update_kinematics(&mut self.kinematics, &frame, &q, &v);
        self.tree
            .write_momentum_regressor(&self.kinematics, &mut self.next_momentum);
        self.tree
            .write_coriolis_transpose_regressor(&self.kinematics, &mut self.coriolis);
        self.tree
            .write_inertia_matrix(&self.kinematics.placements, &mut self.inertia);
    }

    /// The projector at the sample that was just measured.
    fn project(&mut self, sample: &FreeBaseSample<T, J, F>) {
        let down = self.setup.imu.rotation * sample.down;
        self.projector.update(
            &self.tree,
            &self.kinematics.placements,
            &self.setup.feet,
            sample.loaded,
            &down,
            &self.scale,
        );
    }

    /// The rates at the sample that was measured last, for `duration` (s).
    fn add_rates(&mut self, sample: &FreeBaseSample<T, J, F>, duration: T) {
        self.share.add_coriolis(&self.coriolis, duration);
        for j in 0..J {
            self.share.torque[j] += sample.joints.tau[j] * duration;
            let terms: [Term<T>; E] = self.effects.terms(&self.joint_state(&sample.joints, j));
            for e in 0..E {
                self.share.effects[j][e] += terms[e].rate * duration;
            }
        }
        let axes = &self.setup.imu.rotation;
        for c in 0..V {
            for n in 0..3 {
                let felt = (0..3).fold(T::zero(), |sum, k| {
                    sum + self.inertia[(c, 3 + k)] * axes[(k, n)]
                });
                self.share.acceleration[c][n] -= felt * duration;
            }
        }
    }

    fn joint_state(&self, sample: &Sample<T, J>, j: usize) -> JointState<T> {
        JointState {
            speed_noise: self.setup.speed_noise[j],
            ..joint_state(sample, j)
        }
    }

    fn boundaries(&self, sample: &FreeBaseSample<T, J, F>) -> [[T; E]; J] {
        core::array::from_fn(|j| {
            self.effects
                .terms(&self.joint_state(&sample.joints, j))
                .map(|term: Term<T>| term.boundary)
        })
    }

    fn implausible(&self, sample: &FreeBaseSample<T, J, F>) -> Option<Implausible> {
        let FreeBaseSample {
            gyro, acc, down, ..
        } = sample;
        let finite = |v: &Vector3<T>| v.iter().all(|x| x.is_finite());
        if !(finite(gyro) && finite(acc) && finite(down)) {
            return Some(Implausible::NotFinite);
        }
        implausible(&self.setup.plausible, &sample.joints)
    }
}

#[cfg(test)]
pub(crate) mod tests;

//! The equations of a robot that walks, window by window, in the frame that falls freely from the IMU's velocity when the window opens and
//! has the base's axes and origin of then: rows of the columns of [`super::columns`], with the forces at loaded feet eliminated.
//!
//! In that frame, which neither turns nor is pulled by gravity, the whole robot's momentum changes by the feet's forces alone: six rows,
//! the difference of a window's ends. A loaded foot's force is what its leg's joints say it is: with J the leg's Jacobian and J_b the
//! base's of that foot, X = −J⁻¹ J_b is how the joints turn if the foot stays and the base moves, and
//!
//! ```text
//! [M_base] + Σ_loaded ∫ Xᵀ (dM_leg − C_leg dt) + … = Σ_loaded ∫ Xᵀ τ dt
//! ```
//!
//! has no force left ((1, X) spans the null space of all loaded feet's Jacobians: what [`crate::contact::Projector`] projects on). These six
//! rows take a loaded leg's three in: what is left of a window is six rows that touch all columns and three of each leg in the air, which
//! touch that leg and the accelerometer alone. With D the noise's inverse, as the desktop scales its rows before it projects, the six
//! have the covariance D_b⁻² + Σ XᵀX and are divided by its root: nothing is told or lost against the projector but by X's change
//! within the window.
//!
//! ∫ Xᵀ dM is the Stieltjes sum ½ (X_k + X_k+1)ᵀ (M_k+1 − M_k), as in [`crate::window::FreeBaseWindow`], of which this is the sibling at a tenth of
//! the cost: it needs a Go2's legs.

use super::columns::{ACC, EFFECTS, OWN};
use super::leg::{INERTIA, KEPT, LegFrame};
use super::pose::{Pose, Ready};
use super::rows::{JOINT_ROW, JointRow, WalkRows, noise_root, solve_lower};
use crate::effect::{EffectKind, JointState, Term};
use crate::go2::{JOINTS, JOINTS_PER_LEG, LEGS};
use crate::spatial::Transform;
use crate::tree::Tree;
use crate::window::microseconds;
use crate::{Real, scalar::real};
use nalgebra::Vector3;

/// Of them those that are differences between the window's ends in part.
const BOUNDARY: usize = INERTIA + EFFECTS;

/// A joint at one instant.
#[derive(Clone, Copy, Debug)]
struct Joint<T> {
    /// What is differentiated, and what is integrated.
    boundary: [T; BOUNDARY],
    rates: [T; JOINT_ROW],
    /// How fast it turns with each motion of the base if its foot is loaded and stays; zero if it is not.
    planted: [T; 6],
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Advance {
    Used,
    Closed,
    /// The open window was lost: a loaded leg is singular.
    Singular,
}

/// The window being filled.
#[derive(Clone, Debug)]
pub(super) struct WalkWindow<T: Real> {
    legs: [LegFrame<T>; LEGS],
    imu: Transform<T>,
    /// The CAD's trunk: mass (kg) and first moment (kg m).
    trunk: (T, Vector3<T>),
    window_us: u64,
    open: bool,
    start_us: u64,
    last: Ready<T>,
    loaded: [bool; LEGS],
    pose: Pose<T>,
    joints: [Joint<T>; JOINTS],
    shares: [JointRow<T>; JOINTS],
    /// The accelerometer's columns of the base's rows at the last sample.
    felt: [[T; 3]; 6],
    sum: WalkRows<T>,
}

impl<T: Real> WalkWindow<T> {
    /// A window that has to [`begin`](Self::begin); all zeros, a constant.
    pub(super) const fn unset() -> Self {
        let zero = Vector3::new(T::ZERO, T::ZERO, T::ZERO);
        Self {
            legs: [LegFrame::NOTHING; LEGS],
            imu: super::no_transform(),
            trunk: (T::ZERO, zero),
            window_us: 0,
            open: false,
            start_us: 0,
            last: Ready {
                time_us: 0,
                q: [T::ZERO; JOINTS],
                dq: [T::ZERO; JOINTS],
                tau: [T::ZERO; JOINTS],
                gyro: zero,
                acc: zero,
                down: zero,
            },
            loaded: [false; LEGS],
            pose: Pose {
                rotation: super::no_transform().rotation,
                velocity: zero,
                moved: zero,
            },
            joints: [Joint {
                boundary: [T::ZERO; BOUNDARY],
                rates: [T::ZERO; JOINT_ROW],
                planted: [T::ZERO; 6],
            }; JOINTS],
            shares: [[T::ZERO; JOINT_ROW]; JOINTS],
            felt: [[T::ZERO; 3]; 6],
            sum: WalkRows::zero(),
        }
    }

    /// Becomes that of a robot with its IMU at `imu` in the base, of windows of `window_us`. Not inlined: its stack is given back.
    #[inline(never)]
    pub(super) fn begin(&mut self, robot: &Tree<T, 13, 18>, imu: &Transform<T>, window_us: u64) {
        for (leg, frame) in self.legs.iter_mut().enumerate() {
            *frame = LegFrame::of(robot, leg);
        }
        if let Some(trunk) = robot.bodies().first() {
            self.trunk = (trunk.inertia.mass(), trunk.inertia.first_moment());
        }
        self.imu = *imu;
        self.window_us = window_us;
        self.open = false;
        // What a joint does not feel is never written.
        for joint in &mut self.joints {
            joint.boundary.fill(T::zero());
            joint.rates.fill(T::zero());
        }
    }

    /// The legs, for whoever judges feet.
    pub(super) fn legs(&self) -> &[LegFrame<T>; LEGS] {
        &self.legs
    }

    /// Loses the open window; the next sample opens one. Whether there was one.
    pub(super) fn clear(&mut self) -> bool {
        core::mem::replace(&mut self.open, false)
    }

    /// Whether a window is open.
    pub(super) fn is_open(&self) -> bool {
        self.open
    }

    /// Whether the feet are not as they were in the open window.
    pub(super) fn differs(&self, loaded: [bool; LEGS]) -> bool {
        self.open && self.loaded != loaded
    }

    /// Opens a window at the last sample that [`advance`](Self::advance) took, or at this one.
    fn open_at(&mut self, sample: &Ready<T>, loaded: [bool; LEGS]) -> bool {
        self.open = true;
        self.start_us = sample.time_us;
        self.loaded = loaded;
        self.pose = Pose::start();
        self.sum.clear();
        self.shares.as_flattened_mut().fill(T::zero());
        let fine = self.measure(sample, Some(-T::one()));
        self.last = *sample;
        fine
    }

    /// Takes the next sample, whose feet are those of the open window; the rows of a window that closes go into `rows` if they are `free`.
    pub(super) fn advance(
        &mut self,
        sample: &Ready<T>,
        loaded: [bool; LEGS],
        rows: &mut WalkRows<T>,
        free: bool,
    ) -> Advance {
        if !self.open {
            return self.opened(sample, loaded);
        }
        let half = microseconds::<T>(sample.time_us.saturating_sub(self.last.time_us)) * real(0.5);
        self.pose.advance(&self.imu, &self.last, sample, half);
        let before = self.joints;
        self.add_rates(half);
        let closes = sample.time_us.saturating_sub(self.start_us) >= self.window_us;
        let fine = self.measure(sample, closes.then_some(T::one()));
        self.add_differences(&before);
        flush(&self.shares, &before, &mut self.sum);
        self.keep_differences(&before);
        self.add_rates(half);
        self.last = *sample;
        if !fine {
            self.open = false;
            return Advance::Singular;
        }
        if closes {
            if free {
                self.finish(sample.time_us, rows);
            }
            self.opened(sample, loaded);
            return Advance::Closed;
        }
        Advance::Used
    }

    fn opened(&mut self, sample: &Ready<T>, loaded: [bool; LEGS]) -> Advance {
        match self.open_at(sample, loaded) {
            true => Advance::Used,
            false => {
                self.open = false;
                Advance::Singular
            }
        }
    }

    /// Closes the window at the last sample, if it is half as long as one should be; the next sample opens another.
    pub(super) fn cut(&mut self, rows: &mut WalkRows<T>, free: bool) -> bool {
        let long = self.open
            && self.last.time_us.saturating_sub(self.start_us) >= (self.window_us / 2).max(1);
        if long && free {
            let last = self.last;
            // The base's momentum at the end, which was not yet known to be one.
            self.measure(&last, Some(T::one()));
            self.finish(last.time_us, rows);
        }
        self.open = false;
        long
    }

    /// Makes the joints of a sample; the base's momentum, times `sign`, goes into the sum at a window's ends. False if a loaded leg is
    /// singular.
    fn measure(&mut self, sample: &Ready<T>, sign: Option<T>) -> bool {
        let axes = &self.imu.rotation;
        let (w, down) = (axes * sample.gyro, axes * sample.down);
        let pose = &self.pose;
        let place = pose.place(&self.imu);
        let v = pose.rotation.tr_mul(&pose.velocity) - w.cross(&self.imu.translation);
        let (mut mass, mut moment) = self.trunk;
        let mut fine = true;
        for (leg, frame) in self.legs.iter().enumerate() {
            let of = |x: &[T; JOINTS]| -> [T; JOINTS_PER_LEG] {
                core::array::from_fn(|j| x[JOINTS_PER_LEG * leg + j])
            };
            let (q, dq, tau) = (of(&sample.q), of(&sample.dq), of(&sample.tau));
            let moves = frame.motion(&q, &dq, &w, &v);
            let (torques, own, first) = frame.weight(&moves.posture);
            mass += own;
            moment += first;
            let foot = frame.foot(&moves.posture, &down);
            fine &= !(foot.singular && self.loaded[leg]);
            let counts = if self.loaded[leg] {
                T::one()
            } else {
                T::zero()
            };
            let planted = foot.planted(&pose.rotation, &place);
            let (joints, _) = self.joints.as_chunks_mut::<JOINTS_PER_LEG>();
            let Some(joints) = joints.get_mut(leg) else {
                break;
            };
            for (j, joint) in joints.iter_mut().enumerate() {
                joint.planted = planted[j].map(|x| x * counts);
                joint.set_effects(q[j], dq[j], tau[j]);
                let felt = axes.tr_mul(&torques[j]);
                for n in 0..3 {
                    joint.rates[BOUNDARY + n] = -felt[n];
                }
            }
            let momenta = frame.rows(&moves, |joint, body, momentum, coriolis| {
                if let Some(joint) = joints.get_mut(joint) {
                    for n in 0..KEPT {
                        joint.boundary[KEPT * body + n] = momentum[n];
                        joint.rates[KEPT * body + n] = -coriolis[n];
                    }
                }
            });
            if let Some(sign) = sign {
                for (body, momenta) in momenta.iter().enumerate() {
                    let there = frame.in_base(&moves, momenta, &pose.rotation, &place);
                    self.sum.add_momenta(OWN * leg + KEPT * body, &there, sign);
                }
            }
        }
        if let Some(sign) = sign {
            self.sum.add_trunk(&w, &v, &pose.rotation, &place, sign);
        }
        // The whole robot, accelerated along the IMU's axes.
        let moment = pose.rotation * moment + place * mass;
        let turned = pose.rotation * axes;
        for n in 0..3 {
            let axis = turned.column(n).into_owned();
            let couple = moment.cross(&axis);
            for k in 0..3 {
                self.felt[k][n] = -couple[k];
                self.felt[3 + k][n] = -(axis[k] * mass);
            }
        }
        fine
    }

    /// Rates of the sample measured last, for `duration` (s).
    fn add_rates(&mut self, duration: T) {
        for (share, joint) in self.shares.iter_mut().zip(&self.joints) {
            for (sum, rate) in share.iter_mut().zip(&joint.rates) {
                *sum += *rate * duration;
            }
        }
        for (n, column) in (0..3).zip(&mut self.sum.base[ACC..]) {
            for (sum, felt) in column.iter_mut().zip(&self.felt) {
                *sum += felt[n] * duration;
            }
        }
    }

    /// Half of what has changed since the sample `before`.
    fn add_differences(&mut self, before: &[Joint<T>; JOINTS]) {
        let joints = self.joints.iter().zip(before);
        for (share, (now, before)) in self.shares.iter_mut().zip(joints) {
            let ends = now.boundary.iter().zip(&before.boundary);
            for (sum, (now, before)) in share.iter_mut().zip(ends) {
                *sum += (*now - *before) * real(0.5);
            }
        }
    }

    /// The next sample's share begins with its half of the differences.
    fn keep_differences(&mut self, before: &[Joint<T>; JOINTS]) {
        self.shares.as_flattened_mut().fill(T::zero());
        self.add_differences(before);
    }

    /// The rows of the window that ends now.
    fn finish(&mut self, now_us: u64, rows: &mut WalkRows<T>) {
        // Not copied: the joints are a third of a microcontroller's stack.
        flush(&self.shares, &self.joints, &mut self.sum);
        let per_second = T::one() / microseconds::<T>(now_us.saturating_sub(self.start_us).max(1));
        let root = noise_root(self.joints.iter().map(|joint| &joint.planted));
        for (to, from) in rows.base.iter_mut().zip(&self.sum.base) {
            *to = solve_lower(&root, &from.map(|x| x * per_second));
        }
        rows.equations = 6;
        for (j, (to, from)) in rows.joints.iter_mut().zip(&self.sum.joints).enumerate() {
            let loaded = self.loaded.get(j / JOINTS_PER_LEG).is_some_and(|x| *x);
            let counts = if loaded { T::zero() } else { per_second };
            rows.equations += usize::from(!loaded);
            *to = from.map(|x| x * counts);
        }
    }
}

/// Adds a sample's share to the rows.
fn flush<T: Real>(shares: &[JointRow<T>; JOINTS], at: &[Joint<T>; JOINTS], sum: &mut WalkRows<T>) {
    for (j, (share, joint)) in shares.iter().zip(at).enumerate() {
        sum.add_share(j, share, &joint.planted);
    }
}

impl<T: Real> Joint<T> {
    /// Viscous and Coulomb friction, rotor, bias, and the motor's torque.
    #[inline(always)]
    fn set_effects(&mut self, q: T, dq: T, tau: T) {
        let state = JointState::reported(q, dq, tau);
        let terms: [Term<T>; EFFECTS] = [
            EffectKind::Viscous.term(&state),
            EffectKind::Coulomb.term(&state),
            EffectKind::Armature.term(&state),
            EffectKind::Bias.term(&state),
        ];
        for (e, term) in terms.into_iter().enumerate() {
            self.boundary[INERTIA + e] = term.boundary;
            self.rates[INERTIA + e] = term.rate;
        }
        self.rates[JOINT_ROW - 1] = tau;
    }
}

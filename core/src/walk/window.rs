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

use super::columns::{ACC, COLUMNS, EFFECTS, OWN, TRUNK};
use super::leg::{INERTIA, KEPT, LegFrame, Momenta};
use crate::effect::{EffectKind, JointState, Term};
use crate::factor::ROWS;
use crate::go2::{JOINTS, JOINTS_PER_LEG, LEGS};
use crate::spatial::Transform;
use crate::tree::Tree;
use crate::window::microseconds;
use crate::{Real, scalar::real};
use nalgebra::{Matrix3, Vector3};

/// The inverse of the noise of the base's equations beside a joint's torque: of moments (1), of forces (m).
pub(super) const SCALE: [f64; 2] = [0.3, 0.06];

/// What a joint's row has: its leg's inertial columns, its own effects, the accelerometer's, the right-hand side.
pub(super) const JOINT_ROW: usize = INERTIA + EFFECTS + 4;
/// Of them those that are differences between the window's ends in part.
const BOUNDARY: usize = INERTIA + EFFECTS;

/// One measurement of the whole robot, made ready: velocities smoothed, feet judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ready<T: Real> {
    pub(super) time_us: u64,
    pub(super) q: [T; JOINTS],
    pub(super) dq: [T; JOINTS],
    pub(super) tau: [T; JOINTS],
    /// Angular velocity (rad/s), specific force (m/s²) and the unit vector along gravity, in the IMU's axes.
    pub(super) gyro: Vector3<T>,
    pub(super) acc: Vector3<T>,
    pub(super) down: Vector3<T>,
}

/// A joint at one instant.
#[derive(Clone, Copy, Debug)]
struct Joint<T> {
    /// What is differentiated, and what is integrated.
    boundary: [T; BOUNDARY],
    rates: [T; JOINT_ROW],
    /// How fast it turns with each motion of the base if its foot is loaded and stays; zero if it is not.
    planted: [T; 6],
}

/// What a sample's `planted` is multiplied with.
type JointRow<T> = [T; JOINT_ROW];

/// Where the base is in the window's frame.
#[derive(Clone, Copy, Debug)]
struct Pose<T: Real> {
    rotation: Matrix3<T>,
    /// The IMU's velocity (m/s) and displacement (m).
    velocity: Vector3<T>,
    moved: Vector3<T>,
}

/// The rows of a closed window: mean forces and torques over it per unit of the parameters.
#[derive(Clone, Debug)]
pub(super) struct WalkRows<T> {
    /// The base's six, column by column, divided by their noise's.
    pub(super) base: [[T; ROWS]; COLUMNS + 1],
    /// Each joint's; zero of a loaded leg.
    pub(super) joints: [JointRow<T>; JOINTS],
    /// How many equations that are.
    pub(super) equations: usize,
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
    pub(super) fn new(robot: &Tree<T, 13, 18>, imu: Transform<T>, window_us: u64) -> Self {
        let zero = T::zero();
        let trunk = robot.bodies().first().map(|body| body.inertia);
        Self {
            legs: core::array::from_fn(|leg| LegFrame::of(robot, leg)),
            imu,
            trunk: trunk.map_or((zero, Vector3::zeros()), |body| {
                (body.mass(), body.first_moment())
            }),
            window_us,
            open: false,
            start_us: 0,
            last: Ready {
                time_us: 0,
                q: [zero; JOINTS],
                dq: [zero; JOINTS],
                tau: [zero; JOINTS],
                gyro: Vector3::zeros(),
                acc: Vector3::zeros(),
                down: Vector3::zeros(),
            },
            loaded: [false; LEGS],
            pose: Pose::start(),
            joints: [Joint {
                boundary: [zero; BOUNDARY],
                rates: [zero; JOINT_ROW],
                planted: [zero; 6],
            }; JOINTS],
            shares: [[zero; JOINT_ROW]; JOINTS],
            felt: [[zero; 3]; 6],
            sum: WalkRows::zero(),
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
        self.flush(&before);
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

    /// Adds the last sample's share to the rows.
    fn flush(&mut self, at: &[Joint<T>; JOINTS]) {
        for (j, (share, joint)) in self.shares.iter().zip(at).enumerate() {
            self.sum.add_share(j, share, &joint.planted);
        }
    }

    /// The rows of the window that ends now.
    fn finish(&mut self, now_us: u64, rows: &mut WalkRows<T>) {
        let at = self.joints;
        self.flush(&at);
        let per_second = T::one() / microseconds::<T>(now_us.saturating_sub(self.start_us).max(1));
        let root = noise_root(&at);
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

impl<T: Real> Pose<T> {
    fn start() -> Self {
        Self {
            rotation: Matrix3::identity(),
            velocity: Vector3::zeros(),
            moved: Vector3::zeros(),
        }
    }

    /// The base's origin, m.
    fn place(&self, imu: &Transform<T>) -> Vector3<T> {
        self.moved + imu.translation - self.rotation * imu.translation
    }

    /// From one sample to the next, twice `half` (s) later.
    fn advance(&mut self, imu: &Transform<T>, last: &Ready<T>, now: &Ready<T>, half: T) {
        let axes = &imu.rotation;
        let before = self.rotation * (axes * last.acc);
        self.rotation *= turned(&(axes * ((last.gyro + now.gyro) * half)));
        let after = self.rotation * (axes * now.acc);
        let gained = (before + after) * half;
        self.moved += (self.velocity * real::<T>(2.0) + gained) * half;
        self.velocity += gained;
    }
}

/// The rotation by a vector of up to 0.2 rad, to 1e-10.
pub(super) fn turned<T: Real>(angle: &Vector3<T>) -> Matrix3<T> {
    let square = angle.dot(angle);
    let a = T::one() - square * (real::<T>(1.0 / 6.0) - square * real(1.0 / 120.0));
    let b = real::<T>(0.5) - square * (real::<T>(1.0 / 24.0) - square * real(1.0 / 720.0));
    let cross = angle.cross_matrix();
    Matrix3::identity() + cross * a + cross * cross * b
}

impl<T: Real> WalkRows<T> {
    /// No rows: all zeros.
    pub(super) const fn zero() -> Self {
        Self {
            base: [[T::ZERO; ROWS]; COLUMNS + 1],
            joints: [[T::ZERO; JOINT_ROW]; JOINTS],
            equations: 0,
        }
    }

    fn clear(&mut self) {
        self.base.as_flattened_mut().fill(T::zero());
        self.joints.as_flattened_mut().fill(T::zero());
    }

    /// Adds a leg's body's momenta.
    fn add_momenta(&mut self, column: usize, momenta: &Momenta<T>, sign: T) {
        let columns = self.base.get_mut(column..).unwrap_or(&mut []);
        for (n, (to, couple)) in columns.iter_mut().zip(&momenta.couple).enumerate() {
            for k in 0..3 {
                to[k] += couple[k] * sign;
            }
            if let Some(force) = momenta.force.get(n) {
                for k in 0..3 {
                    to[3 + k] += force[k] * sign;
                }
            }
        }
    }

    /// Adds the trunk's.
    fn add_trunk(
        &mut self,
        w: &Vector3<T>,
        v: &Vector3<T>,
        rotation: &Matrix3<T>,
        place: &Vector3<T>,
        sign: T,
    ) {
        let o = T::zero();
        let mut columns = self.base.iter_mut().skip(TRUNK);
        let mut add = |couple: Vector3<T>, force: Vector3<T>| {
            let force = rotation * force;
            let couple = rotation * couple + place.cross(&force);
            if let Some(to) = columns.next() {
                for k in 0..3 {
                    to[k] += couple[k] * sign;
                    to[3 + k] += force[k] * sign;
                }
            }
        };
        add(Vector3::zeros(), *v);
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            add(axis.cross(v), w.cross(&axis));
        }
        for couple in [
            Vector3::new(w.x, o, o),
            Vector3::new(w.y, w.x, o),
            Vector3::new(w.z, o, w.x),
            Vector3::new(o, w.y, o),
            Vector3::new(o, w.z, w.y),
            Vector3::new(o, o, w.z),
        ] {
            add(couple, Vector3::zeros());
        }
    }

    /// Adds a joint's share to its own row and, by what it turns with the base, to the base's.
    fn add_share(&mut self, joint: usize, share: &JointRow<T>, planted: &[T; 6]) {
        if let Some(own) = self.joints.get_mut(joint) {
            for (sum, x) in own.iter_mut().zip(share) {
                *sum += *x;
            }
        }
        let (leg, own) = (joint / JOINTS_PER_LEG, joint % JOINTS_PER_LEG);
        let mut add = |column: usize, numbers: &[T]| {
            let columns = self.base.get_mut(column..).unwrap_or(&mut []);
            for (to, x) in columns.iter_mut().zip(numbers) {
                for (to, along) in to.iter_mut().zip(planted) {
                    *to += *along * *x;
                }
            }
        };
        let (inertia, rest) = share.split_at(INERTIA);
        let (effects, rest) = rest.split_at(EFFECTS);
        // What the joint does not move it does not feel.
        add(OWN * leg + KEPT * own, &inertia[KEPT * own..]);
        add(OWN * leg + INERTIA + EFFECTS * own, effects);
        add(ACC, rest);
    }
}

/// The root L of the base rows' covariance, lower triangle, its diagonal inverted: that of the base's own noise and of the loaded joints'.
fn noise_root<T: Real>(joints: &[Joint<T>; JOINTS]) -> [[T; 6]; 6] {
    let mut l = [[T::zero(); 6]; 6];
    for r in 0..6 {
        for c in 0..=r {
            let own = match r == c {
                true => real(1.0 / (SCALE[r / 3] * SCALE[r / 3])),
                false => T::zero(),
            };
            l[r][c] = joints
                .iter()
                .fold(own, |sum, j| sum + j.planted[r] * j.planted[c]);
        }
    }
    for c in 0..6 {
        for k in 0..c {
            for r in c..6 {
                let product = l[r][k] * l[c][k];
                l[r][c] -= product;
            }
        }
        let inverse = l[c][c].inverse_sqrt();
        for r in c + 1..6 {
            l[r][c] *= inverse;
        }
        l[c][c] = inverse;
    }
    l
}

/// L⁻¹ x.
fn solve_lower<T: Real>(l: &[[T; 6]; 6], x: &[T; 6]) -> [T; 6] {
    let mut y = *x;
    for r in 0..6 {
        for c in 0..r {
            let known = l[r][c] * y[c];
            y[r] -= known;
        }
        y[r] *= l[r][r];
    }
    y
}

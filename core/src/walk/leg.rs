//! A leg of a robot that moves, hip about x, thigh and calf about y: its bodies' momenta as columns of their parameters, and its foot.
//!
//! A body with velocity (ω, v) in its own axes has the angular momentum h × v + Ī ω about its origin and the momentum m v + ω × h:
//! linear in its parameters, six rows of them. Carried up the leg they say what each joint feels (the row of its axis) and, at the end,
//! what the base does; d/dt of a joint's momentum is what acts on it and (v_c × S)·h of its axis S, which turns with its body.
//!
//! Of a body's ten columns seven are kept: m, the first moment along the joint's axis and Izz are felt as the parent's are
//! ([`super::columns`]).

use crate::go2::JOINTS_PER_LEG;
use crate::inertia::{INERTIAL, InertialParameters};
use crate::scalar::{real, sin_cos};
use crate::tree::Tree;
use crate::{Real, go2};
use nalgebra::{ArrayStorage, Matrix3, SVector, Vector3};

/// Columns of a body of a leg.
pub(super) const KEPT: usize = 7;
/// Inertial columns of a leg.
pub(super) const INERTIA: usize = KEPT * JOINTS_PER_LEG;
/// A loaded leg of which six times its volume (the determinant of its Jacobian, m³) is less is too straight or too folded to tell its
/// foot's force from its torques; a Go2 that stands has 0.01.
const LEAST_VOLUME: f64 = 5e-4;

/// What of a leg its motion is made of; its axes are the base's where its joints are at zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegFrame<T: Real> {
    /// Origins of hip, thigh and calf, each in the body before, m.
    at: [Vector3<T>; JOINTS_PER_LEG],
    /// The foot's centre in the calf, m, and its radius, m.
    foot: (Vector3<T>, T),
    /// The bodies by the CAD.
    cad: [InertialParameters<T>; JOINTS_PER_LEG],
}

impl<T: Real> LegFrame<T> {
    /// No leg: all zeros.
    pub(super) const NOTHING: Self = {
        let zero = Vector3::new(T::ZERO, T::ZERO, T::ZERO);
        let body = InertialParameters(SVector::from_array_storage(ArrayStorage([
            [T::ZERO; INERTIAL]
        ])));
        Self {
            at: [zero; JOINTS_PER_LEG],
            foot: (zero, T::ZERO),
            cad: [body; JOINTS_PER_LEG],
        }
    };

    /// Leg number `leg` of the free robot.
    pub(super) fn of(robot: &Tree<T, 13, 18>, leg: usize) -> Self {
        let foot = go2::feet().get(leg).map(|foot| (foot.centre, foot.radius));
        let bodies = robot.bodies();
        let body = |n: usize| bodies.get(1 + JOINTS_PER_LEG * leg + n);
        Self {
            at: core::array::from_fn(|n| {
                body(n).map_or(Vector3::zeros(), |body| body.placement.translation)
            }),
            foot: foot.unwrap_or((Vector3::zeros(), T::zero())),
            cad: core::array::from_fn(|n| {
                body(n).map_or(InertialParameters::zero(), |body| body.inertia)
            }),
        }
    }

    /// The leg's posture, at joint positions `q`, rad.
    pub(super) fn posture(&self, q: &[T; JOINTS_PER_LEG]) -> Posture<T> {
        Posture(q.map(Turn::of))
    }

    /// How the leg moves, at joint positions `q` (rad) and velocities `dq` (rad/s), on a base with angular velocity `w` (rad/s) whose
    /// origin has velocity `v` (m/s), both in its own axes.
    pub(super) fn motion(
        &self,
        q: &[T; JOINTS_PER_LEG],
        dq: &[T; JOINTS_PER_LEG],
        w: &Vector3<T>,
        v: &Vector3<T>,
    ) -> LegMotion<T> {
        let posture = self.posture(q);
        let [hip, thigh, calf] = &posture.0;
        let [at_hip, at_thigh, at_calf] = &self.at;
        let moved = |w: &Vector3<T>, v: &Vector3<T>, p: &Vector3<T>| v + w.cross(p);
        let mut w1 = hip.x_down(w);
        let v1 = hip.x_down(&moved(w, v, at_hip));
        w1.x += dq[0];
        let mut w2 = thigh.y_down(&w1);
        let v2 = thigh.y_down(&moved(&w1, &v1, at_thigh));
        w2.y += dq[1];
        let mut w3 = calf.y_down(&w2);
        let v3 = calf.y_down(&moved(&w2, &v2, at_calf));
        w3.y += dq[2];
        LegMotion {
            posture,
            w: [w1, w2, w3],
            v: [v1, v2, v3],
        }
    }

    /// What the joints feel of the bodies' columns, into `momentum` and `coriolis` (joint's row by joint's row, hip's bodies' columns
    /// first; what a joint does not move is left as it is), and the bodies' momenta in the hip's frame.
    pub(super) fn rows(
        &self,
        moves: &LegMotion<T>,
        mut tell: impl FnMut(usize, usize, [T; KEPT], [T; KEPT]),
    ) -> [Momenta<T>; JOINTS_PER_LEG] {
        let [_, thigh, calf] = &moves.posture.0;
        let [_, at_thigh, at_calf] = &self.at;
        let mut row = |joint: usize, body: usize, momenta: &Momenta<T>| {
            let (w, v) = (&moves.w[joint], &moves.v[joint]);
            let axis = |x: &Vector3<T>| if joint == 0 { x.x } else { x.y };
            // ω × S and v × S of the joint's axis S.
            let across = |x: &Vector3<T>| match joint {
                0 => Vector3::new(T::zero(), x.z, -x.y),
                _ => Vector3::new(-x.z, T::zero(), x.x),
            };
            let (turning, sliding) = (across(w), across(v));
            let mut coriolis = momenta.couple.map(|couple| turning.dot(&couple));
            coriolis[0] += sliding.dot(&momenta.force[0]);
            coriolis[1] += sliding.dot(&momenta.force[1]);
            tell(
                joint,
                body,
                momenta.couple.map(|couple| axis(&couple)),
                coriolis,
            );
        };
        let own = |n: usize| Momenta::of(&moves.w[n], &moves.v[n], n == 0);
        let [m1, mut m2, mut m3] = [own(0), own(1), own(2)];
        row(2, 2, &m3);
        m3 = m3.carried(at_calf, |x| calf.y_up(x));
        row(1, 1, &m2);
        row(1, 2, &m3);
        m2 = m2.carried(at_thigh, |x| thigh.y_up(x));
        m3 = m3.carried(at_thigh, |x| thigh.y_up(x));
        row(0, 0, &m1);
        row(0, 1, &m2);
        row(0, 2, &m3);
        [m1, m2, m3]
    }

    /// A body's momenta in the frame in which the base is turned by `rotation` and placed at `p`, from those in the hip's.
    pub(super) fn in_base(
        &self,
        moves: &LegMotion<T>,
        momenta: &Momenta<T>,
        rotation: &Matrix3<T>,
        p: &Vector3<T>,
    ) -> Momenta<T> {
        let hip = &moves.posture.0[0];
        let base = momenta.carried(&self.at[0], |x| hip.x_up(x));
        base.carried(p, |x| rotation * x)
    }

    /// The foot, with gravity along the unit vector `down` in the axes of the base.
    pub(super) fn foot(&self, posture: &Posture<T>, down: &Vector3<T>) -> LegFoot<T> {
        let [hip, thigh, calf] = &posture.0;
        let [at_hip, at_thigh, at_calf] = &self.at;
        let in_calf = calf.y_down(&thigh.y_down(&hip.x_down(down)));
        let (centre, radius) = &self.foot;
        let in_hip = |x: &Vector3<T>| at_thigh + thigh.y_up(&(at_calf + calf.y_up(x)));
        let knee = at_thigh + thigh.y_up(at_calf);
        let point = in_hip(&(centre + in_calf * *radius));
        let jacobian = [
            Vector3::new(T::zero(), -point.z, point.y),
            about_y(&(point - at_thigh)),
            about_y(&(point - knee)),
        ];
        let [a, b, c] = &jacobian;
        let across = [b.cross(c), c.cross(a), a.cross(b)];
        let volume = a.dot(&across[0]);
        // Selections rather than branches: the cost must not tell the posture.
        let singular = volume.abs() < real(LEAST_VOLUME);
        let per_volume = T::one() / if singular { T::one() } else { volume };
        LegFoot {
            point: at_hip + hip.x_up(&point),
            centre: at_hip + hip.x_up(&in_hip(centre)),
            inverse: across.map(|row| hip.x_up(&row) * per_volume),
            jacobian,
            singular,
        }
    }

    /// What the CAD's leg feels of a base accelerated by 1 m/s² along each of its axes: torques of the joints, and the leg's mass (kg) and
    /// first moment (kg m) about the base's origin.
    pub(super) fn weight(
        &self,
        posture: &Posture<T>,
    ) -> ([Vector3<T>; JOINTS_PER_LEG], T, Vector3<T>) {
        let [hip, thigh, calf] = &posture.0;
        let [at_hip, at_thigh, at_calf] = &self.at;
        let [h1, h2, h3] = self.cad.each_ref().map(|body| body.first_moment());
        let [m1, m2, m3] = self.cad.each_ref().map(|body| body.mass());
        let from_calf = calf.y_up(&h3);
        let from_thigh = thigh.y_up(&(h2 + from_calf + at_calf * m3));
        let from_hip = hip.x_up(&(h1 + from_thigh + at_thigh * (m2 + m3)));
        let mass = m1 + m2 + m3;
        let torques = [
            Vector3::new(T::zero(), -from_hip.z, from_hip.y),
            hip.x_up(&about_y(&from_thigh)),
            hip.x_up(&about_y(&thigh.y_up(&from_calf))),
        ];
        (torques, mass, from_hip + at_hip * mass)
    }
}

/// What of a body a torque is made of: angular velocity (rad/s) and acceleration (rad/s²), and the specific force at its origin (m/s²), in its
/// own axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Felt<T: Real> {
    pub(super) w: Vector3<T>,
    pub(super) turning: Vector3<T>,
    pub(super) specific: Vector3<T>,
}

impl<T: Real> LegFrame<T> {
    /// The joints' torques (N m) that the CAD's leg needs with its foot in the air, at velocities `dq` (rad/s) and accelerations `ddq` (rad/s²),
    /// on a base that moves so: Newton and Euler's equations from the base to the calf and back.
    pub(super) fn torques(
        &self,
        posture: &Posture<T>,
        dq: &[T; JOINTS_PER_LEG],
        ddq: &[T; JOINTS_PER_LEG],
        base: &Felt<T>,
    ) -> [T; JOINTS_PER_LEG] {
        let [hip, thigh, calf] = &posture.0;
        let [at_hip, at_thigh, at_calf] = &self.at;
        let first = base.carried(at_hip, Vector3::x(), [dq[0], ddq[0]], |x| hip.x_down(x));
        let second = first.carried(at_thigh, Vector3::y(), [dq[1], ddq[1]], |x| thigh.y_down(x));
        let third = second.carried(at_calf, Vector3::y(), [dq[2], ddq[2]], |x| calf.y_down(x));
        let [body1, body2, body3] = &self.cad;
        let (couple3, force3) = third.needs(body3);
        let (own, force) = second.needs(body2);
        let there = calf.y_up(&force3);
        let couple2 = own + calf.y_up(&couple3) + at_calf.cross(&there);
        let force2 = force + there;
        let there = thigh.y_up(&force2);
        let couple1 = first.needs(body1).0 + thigh.y_up(&couple2) + at_thigh.cross(&there);
        [couple1.x, couple2.y, couple3.y]
    }
}

impl<T: Real> Felt<T> {
    /// A body whose origin is at `p` in this one and which turns about `axis` with these velocity and acceleration; `down` leads to its axes.
    #[inline(always)]
    fn carried(
        &self,
        p: &Vector3<T>,
        axis: Vector3<T>,
        [rate, gain]: [T; 2],
        down: impl Fn(&Vector3<T>) -> Vector3<T>,
    ) -> Self {
        let Self {
            w,
            turning,
            specific,
        } = self;
        let specific = specific + turning.cross(p) + w.cross(&w.cross(p));
        let above = down(w);
        let w = above + axis * rate;
        Self {
            w,
            turning: down(turning) + axis * gain + above.cross(&axis) * rate,
            specific: down(&specific),
        }
    }

    /// The couple about its origin (N m) and the force (N) that a body needs to be so.
    #[inline(always)]
    fn needs(&self, body: &InertialParameters<T>) -> (Vector3<T>, Vector3<T>) {
        let Self {
            w,
            turning,
            specific,
        } = self;
        let h = body.first_moment();
        let force = specific * body.mass() + turning.cross(&h) + w.cross(&w.cross(&h));
        let couple = body.turned(turning) + w.cross(&body.turned(w)) + h.cross(specific);
        (couple, force)
    }
}

/// y × x.
fn about_y<T: Real>(x: &Vector3<T>) -> Vector3<T> {
    Vector3::new(x.z, T::zero(), -x.x)
}

/// Sine and cosine of a joint's angle.
#[derive(Clone, Copy, Debug)]
struct Turn<T>(T, T);

impl<T: Real> Turn<T> {
    fn of(angle: T) -> Self {
        let (sin, cos) = sin_cos(angle);
        Self(sin, cos)
    }

    /// From the axes of a body that turns about x into its parent's, and back.
    fn x_up(&self, v: &Vector3<T>) -> Vector3<T> {
        let Self(sin, cos) = *self;
        Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z)
    }

    fn x_down(&self, v: &Vector3<T>) -> Vector3<T> {
        let Self(sin, cos) = *self;
        Vector3::new(v.x, cos * v.y + sin * v.z, cos * v.z - sin * v.y)
    }

    /// The same about y.
    fn y_up(&self, v: &Vector3<T>) -> Vector3<T> {
        let Self(sin, cos) = *self;
        Vector3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x)
    }

    fn y_down(&self, v: &Vector3<T>) -> Vector3<T> {
        let Self(sin, cos) = *self;
        Vector3::new(cos * v.x - sin * v.z, v.y, cos * v.z + sin * v.x)
    }
}

/// Sines and cosines of a leg's joints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posture<T>([Turn<T>; JOINTS_PER_LEG]);

/// A leg's motion at one instant: the velocity of each body's axes (rad/s) and origin (m/s), in its own axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegMotion<T: Real> {
    pub(super) posture: Posture<T>,
    w: [Vector3<T>; JOINTS_PER_LEG],
    v: [Vector3<T>; JOINTS_PER_LEG],
}

/// A body's momentum as columns of its parameters: the first moments across the joint's axis, then Ixx, Ixy, Ixz, Iyy, Iyz.
#[derive(Clone, Copy, Debug)]
pub(super) struct Momenta<T: Real> {
    /// About the origin of the frame, N m s per unit.
    pub(super) couple: [Vector3<T>; KEPT],
    /// N s per unit; the inertias have none.
    pub(super) force: [Vector3<T>; 2],
}

impl<T: Real> Momenta<T> {
    /// In the body's own frame; its joint turns about x, or else about y.
    fn of(w: &Vector3<T>, v: &Vector3<T>, about_x: bool) -> Self {
        let o = T::zero();
        // e × v and ω × e of the axes e across the joint's.
        let [across_z, force_z] = [Vector3::new(-v.y, v.x, o), Vector3::new(w.y, -w.x, o)];
        let (first, force) = if about_x {
            (Vector3::new(v.z, o, -v.x), Vector3::new(-w.z, o, w.x))
        } else {
            (Vector3::new(o, -v.z, v.y), Vector3::new(o, w.z, -w.y))
        };
        Self {
            couple: [
                first,
                across_z,
                Vector3::new(w.x, o, o),
                Vector3::new(w.y, w.x, o),
                Vector3::new(w.z, o, w.x),
                Vector3::new(o, w.y, o),
                Vector3::new(o, w.z, w.y),
            ],
            force: [force, force_z],
        }
    }

    /// In a frame whose axes `turn` leads to and in which this one's origin is at `p`.
    #[inline(always)]
    fn carried(&self, p: &Vector3<T>, turn: impl Fn(&Vector3<T>) -> Vector3<T>) -> Self {
        let mut couple = self.couple.map(|x| turn(&x));
        let force = self.force.map(|x| turn(&x));
        couple[0] += p.cross(&force[0]);
        couple[1] += p.cross(&force[1]);
        Self { couple, force }
    }
}

/// A leg's foot.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegFoot<T: Real> {
    /// Where it touches the ground, if it does, and the sphere's centre; in the base, m.
    pub(super) point: Vector3<T>,
    pub(super) centre: Vector3<T>,
    /// The rows of the inverse of the leg's Jacobian J, whose columns are in the base's axes, 1/m; finite if it has none.
    pub(super) inverse: [Vector3<T>; JOINTS_PER_LEG],
    /// The columns of J in the hip's axes, m.
    pub(super) jacobian: [Vector3<T>; JOINTS_PER_LEG],
    /// Whether J has no inverse worth the name.
    pub(super) singular: bool,
}

impl<T: Real> LegFoot<T> {
    /// How fast the joints turn if the foot's point stays where it is and a body that is fixed to the base moves with each unit twist of a
    /// frame in which the base is turned by `rotation` and placed at `p`, angular ones first: rad/s.
    pub(super) fn planted(
        &self,
        rotation: &Matrix3<T>,
        p: &Vector3<T>,
    ) -> [[T; 6]; JOINTS_PER_LEG] {
        let point = p + rotation * self.point;
        self.inverse.map(|row| {
            let along = -(rotation * row);
            let about = point.cross(&along);
            [about.x, about.y, about.z, along.x, along.y, along.z]
        })
    }

    /// The size of the force at the foot (N) that the joints' torques `left` (N m) would be; damped, so that a straight leg's torques tell
    /// nothing of a force along it.
    pub(super) fn force(&self, left: &[T; JOINTS_PER_LEG]) -> T {
        let j = Matrix3::from_columns(&self.jacobian);
        let square = j * j.transpose() + Matrix3::identity() * real::<T>(1e-4);
        let right = j * Vector3::from(*left);
        let [a, b, c] = [0, 1, 2].map(|n| square.column(n).into_owned());
        let across = [b.cross(&c), c.cross(&a), a.cross(&b)];
        // Positive: a sum of squares and the damping.
        let per_volume = T::one() / a.dot(&across[0]);
        let force = Vector3::new(
            across[0].dot(&right),
            across[1].dot(&right),
            across[2].dot(&right),
        ) * per_volume;
        crate::scalar::sqrt(force.dot(&force))
    }
}

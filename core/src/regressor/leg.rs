//! A leg whose hip turns about x and whose thigh and calf turn about y, as those of many quadrupeds do: its base columns, at the cost that they ask for.
//!
//! Of such a leg on a fixed base more is known than its tree says. The hip's axis stands still, so that its columns turn with nothing
//! (Ṡ = 0) and of them gravity alone has a rate. The axes of thigh and calf are parallel, so that the calf's inertia is to the thigh
//! what it is to the calf. Of 60 numbers that a joint's row may depend on 36 are independent ([`crate::base_parameters`]: a test compares
//! [`COLUMNS`] with the analysis); they need 25 momenta and 20 rates. [`Tree::write_momentum_regressor`] and
//! [`Tree::write_momentum_rate_regressor`] say the same of any tree.

use crate::Real;
use crate::scalar::sin_cos;
use crate::spatial::Transform;
use crate::tree::Tree;
use nalgebra::Vector3;

/// Joints of such a leg: hip, thigh and calf.
pub(crate) const JOINTS_PER_LEG: usize = 3;

/// Base parameters of each joint.
pub(crate) const BASE_COLUMNS: [usize; JOINTS_PER_LEG] = [15, 14, 7];

/// Momenta of which a leg's columns are differences.
pub(crate) const MOMENTA: usize = 25;
/// Rates of which they are integrals.
pub(crate) const RATES: usize = 20;

/// No momentum, or no rate.
const NONE: usize = usize::MAX;

/// A base column of a joint's row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LegColumn {
    /// The body whose parameter it is the column of, and which of the ten.
    #[cfg(test)]
    pub(crate) of: (usize, usize),
    /// Its place among the momenta and among the rates.
    momentum: usize,
    rate: usize,
}

const fn column(_body: usize, _parameter: usize, momentum: usize, rate: usize) -> LegColumn {
    LegColumn {
        #[cfg(test)]
        of: (_body, _parameter),
        momentum,
        rate,
    }
}

/// The base columns of hip, thigh and calf, one after the other, by body and parameter.
#[rustfmt::skip]
pub(crate) const COLUMNS: [LegColumn; 36] = [
    // Hip: hy, hz, Ixx of itself, hx, hz, Ixx, Ixy, Ixz, Iyz of thigh and calf.
    column(0, 2, NONE, 0), column(0, 3, NONE, 1), column(0, 4, 0, NONE),
    column(1, 1, 1, 2), column(1, 3, 2, 3),
    column(1, 4, 3, NONE), column(1, 5, 4, NONE), column(1, 6, 5, NONE), column(1, 8, 6, NONE),
    column(2, 1, 7, 4), column(2, 3, 8, 5),
    column(2, 4, 9, NONE), column(2, 5, 10, NONE), column(2, 6, 11, NONE), column(2, 8, 12, NONE),
    // Thigh: hx, hz, Ixx, Ixy, Ixz, Iyy, Iyz of itself and of the calf.
    column(1, 1, 13, 6), column(1, 3, 14, 7),
    column(1, 4, NONE, 8), column(1, 5, 15, 9), column(1, 6, NONE, 10), column(1, 7, 16, NONE), column(1, 8, 17, 11),
    column(2, 1, 18, 12), column(2, 3, 19, 13),
    column(2, 4, NONE, 16), column(2, 5, 22, 17), column(2, 6, NONE, 18), column(2, 7, 23, NONE), column(2, 8, 24, 19),
    // Calf: the same of itself.
    column(2, 1, 20, 14), column(2, 3, 21, 15),
    column(2, 4, NONE, 16), column(2, 5, 22, 17), column(2, 6, NONE, 18), column(2, 7, 23, NONE), column(2, 8, 24, 19),
];

impl LegColumn {
    /// What the column has of momenta's differences and rates' integrals.
    #[inline(always)]
    pub(crate) fn of<T: Real>(&self, momenta: &[T; MOMENTA], rates: &[T; RATES]) -> T {
        let momentum = momenta.get(self.momentum).copied();
        let rate = rates.get(self.rate).copied();
        momentum.unwrap_or(T::zero()) + rate.unwrap_or(T::zero())
    }
}

/// What of a leg its motion is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LegFrame<T: Real> {
    /// Gravity in the axes of the base, m/s².
    gravity: Vector3<T>,
    /// The thigh in the hip and the calf in the thigh, m.
    thigh: Vector3<T>,
    calf: Vector3<T>,
}

impl<T: Real> LegFrame<T> {
    /// A leg, the chain of hip, thigh and calf about these axes, on a base that is mounted at `base` in the world.
    pub(crate) fn new(leg: &Tree<T, JOINTS_PER_LEG, JOINTS_PER_LEG>, base: &Transform<T>) -> Self {
        let [_, thigh, calf] = leg.bodies();
        Self {
            gravity: base.rotation.tr_mul(&leg.gravity()),
            thigh: thigh.placement.translation,
            calf: calf.placement.translation,
        }
    }

    /// How the leg moves at joint positions `q` (rad) and velocities `dq` (rad/s).
    #[inline(always)]
    pub(crate) fn motion(&self, q: &[T; JOINTS_PER_LEG], dq: &[T; JOINTS_PER_LEG]) -> LegMotion<T> {
        let [hip, thigh, calf] = q.map(sin_cos);
        let g = &self.gravity;
        let (sin, cos) = hip;
        let in_hip = Vector3::new(g.x, cos * g.y + sin * g.z, cos * g.z - sin * g.y);
        let in_thigh = about_y(thigh, &in_hip);
        // The hip's axis, and how the origins of thigh and calf move as it turns: in the axes of each.
        let (sin, cos) = thigh;
        let axis = [cos, sin];
        let lever = about_y(thigh, &Vector3::new(T::zero(), -self.thigh.z, self.thigh.y));
        // axis × calf, axis = (x, 0, z).
        let ([x, z], p) = (axis, &self.calf);
        let at_calf = Vector3::new(
            lever.x - z * p.y,
            lever.y + z * p.x - x * p.z,
            lever.z + x * p.y,
        );
        let (sin, cos) = calf;
        LegMotion {
            rates: *dq,
            gravity: [in_hip, in_thigh, about_y(calf, &in_thigh)],
            axis: [axis, [cos * x - sin * z, cos * z + sin * x]],
            lever: [lever, about_y(calf, &at_calf)],
            shank: [cos * p.z + sin * p.x, sin * p.z - cos * p.x],
            calf: *p,
            knee: calf,
        }
    }
}

/// A leg's motion at one instant, each body's in its own axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LegMotion<T: Real> {
    /// The joints' velocities, rad/s.
    rates: [T; JOINTS_PER_LEG],
    /// Gravity in hip, thigh and calf, m/s².
    gravity: [Vector3<T>; JOINTS_PER_LEG],
    /// The hip's axis in thigh and calf: x and z; both turn about y.
    axis: [[T; 2]; 2],
    /// Velocity of their origins as the hip turns by 1 rad/s, m.
    lever: [Vector3<T>; 2],
    /// Velocity of the calf's origin as the thigh turns by 1 rad/s: x and z, m.
    shank: [T; 2],
    /// The calf in the thigh, m; sine and cosine of its angle.
    calf: Vector3<T>,
    knee: (T, T),
}

/// The velocity of a body's axes and origin.
struct Moved<T: Real> {
    angular: Vector3<T>,
    linear: Vector3<T>,
}

impl<T: Real> LegMotion<T> {
    #[inline(always)]
    fn thigh(&self) -> Moved<T> {
        let ([x, z], [a, b, _]) = (self.axis[0], self.rates);
        Moved {
            angular: Vector3::new(a * x, b, a * z),
            linear: self.lever[0] * a,
        }
    }

    #[inline(always)]
    fn calf(&self) -> Moved<T> {
        let ([x, z], [a, b, c]) = (self.axis[1], self.rates);
        let ([along, across], lever) = (self.shank, self.lever[1] * a);
        Moved {
            angular: Vector3::new(a * x, b + c, a * z),
            linear: Vector3::new(lever.x + b * along, lever.y, lever.z + b * across),
        }
    }

    /// What the columns are the differences of between a window's ends: entries of W_m.
    #[inline(always)]
    pub(crate) fn momenta(&self) -> [T; MOMENTA] {
        let (thigh, calf) = (self.thigh(), self.calf());
        let [hx1, hz1, xx1, xy1, xz1, yz1] = self.hip_momenta(0, &thigh);
        let [hx2, hz2, xx2, xy2, xz2, yz2] = self.hip_momenta(1, &calf);
        let (u, w, [along, across]) = (&calf.linear, &calf.angular, self.shank);
        #[rustfmt::skip]
        let all = [
            self.rates[0],
            hx1, hz1, xx1, xy1, xz1, yz1,
            hx2, hz2, xx2, xy2, xz2, yz2,
            -thigh.linear.z, thigh.linear.x, thigh.angular.x, thigh.angular.y, thigh.angular.z,
            -u.z - across * w.y, u.x + along * w.y,
            -u.z, u.x, w.x, w.y, w.z,
        ];
        all
    }

    /// r(S, v) of the hip's axis and a body's hx, hz, Ixx, Ixy, Ixz, Iyz.
    #[inline(always)]
    fn hip_momenta(&self, body: usize, moved: &Moved<T>) -> [T; 6] {
        let ([x, z], l) = (self.axis[body], &self.lever[body]);
        let (u, w) = (&moved.linear, &moved.angular);
        [
            u.y * z + (l.y * w.z - l.z * w.y),
            (l.x * w.y - l.y * w.x) - u.y * x,
            x * w.x,
            x * w.y,
            x * w.z + z * w.x,
            z * w.y,
        ]
    }

    /// What they are the integrals of: entries of W_g − W_c.
    #[inline(always)]
    pub(crate) fn rates(&self) -> [T; RATES] {
        let (thigh, calf) = (self.thigh(), self.calf());
        let [g0, g1, g2] = &self.gravity;
        let [[x1, z1], [x2, z2]] = self.axis;
        let [hx1, hz1, xx1, xy1, xz1, yz1] = own_rates(&thigh, g1);
        let [hx2, hz2, xx2, xy2, xz2, yz2] = own_rates(&calf, g2);
        let [hx12, hz12] = self.thigh_rates(&thigh, &calf);
        [
            -g0.z,
            g0.y,
            -z1 * g1.y,
            x1 * g1.y,
            -z2 * g2.y,
            x2 * g2.y,
            hx1,
            hz1,
            xx1,
            xy1,
            xz1,
            yz1,
            hx12,
            hz12,
            hx2,
            hz2,
            xx2,
            xy2,
            xz2,
            yz2,
        ]
    }

    /// r(S, −γ) − r(Ṡ, v) of the thigh's axis and the calf's hx and hz: Ṡ is that of the thigh, ω × y and u × y, at the calf.
    #[inline(always)]
    fn thigh_rates(&self, thigh: &Moved<T>, calf: &Moved<T>) -> [T; 2] {
        let (w1, u1, p) = (&thigh.angular, &thigh.linear, &self.calf);
        let turning = Vector3::new(
            -u1.z - w1.x * p.y,
            w1.x * p.x + w1.z * p.z,
            u1.x - w1.z * p.y,
        );
        let l = about_y(self.knee, &turning);
        let (w, u, g) = (&calf.angular, &calf.linear, &self.gravity[2]);
        // u × Ṡ + l × ω with Ṡ = (−ω.z, 0, ω.x).
        [
            g.z - (u.y * w.x + (l.y * w.z - l.z * w.y)),
            -g.x - (u.y * w.z + (l.x * w.y - l.y * w.x)),
        ]
    }
}

/// The same of a body's own joint about y: hx, hz, Ixx, Ixy, Ixz, Iyz.
#[inline(always)]
fn own_rates<T: Real>(moved: &Moved<T>, g: &Vector3<T>) -> [T; 6] {
    let (w, u) = (&moved.angular, &moved.linear);
    let xz = w.x * w.z;
    [
        g.z - (w.x * u.y - w.y * u.x),
        (w.y * u.z - w.z * u.y) - g.x,
        xz,
        w.y * w.z,
        (w.z - w.x) * (w.z + w.x),
        -(w.x * w.y),
    ]
}

/// A vector in the axes of a body that is turned about y, given in its parent's.
#[inline(always)]
fn about_y<T: Real>((sin, cos): (T, T), v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(cos * v.x - sin * v.z, v.y, cos * v.z + sin * v.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::go2::{Leg, leg};
    use crate::inertia::INERTIAL;
    use crate::spatial::tests::transform;
    use crate::tree::joint_frame::JointKind;
    use nalgebra::SVector;
    use proptest::prelude::*;
    use std::prelude::rust_2024::*;

    /// Of which joint's row each column is.
    fn row(n: usize) -> usize {
        usize::from(n >= 15) + usize::from(n >= 29)
    }

    proptest! {
        /// Of any such leg, however long and on whatever base.
        #[test]
        fn momenta_and_rates_are_the_regressors_entries(
            base in transform(),
            at in prop::array::uniform9(-0.4..0.4f64),
            q in prop::array::uniform3(-3.0..3.0f64),
            dq in prop::array::uniform3(-20.0..20.0f64),
        ) {
            let mut bodies = *leg::<f64>(Leg::FL).bodies();
            for (body, at) in bodies.iter_mut().zip(at.chunks_exact(3)) {
                body.placement.translation = Vector3::new(at[0], at[1], at[2]);
            }
            let tree = Tree::<f64, 3, 3>::new(bodies).unwrap();
            let k = tree.kinematics(&base, &SVector::from(q), &SVector::from(dq));
            let (mut momentum, mut rate) = ([[[0.0; INERTIAL]; 3]; 3], [[[0.0; INERTIAL]; 3]; 3]);
            tree.write_momentum_regressor(&k, &mut momentum);
            tree.write_momentum_rate_regressor(&k, &mut rate);
            let motion = LegFrame::new(&tree, &base).motion(&q, &dq);
            let (momenta, rates) = (motion.momenta(), motion.rates());
            for (n, column) in COLUMNS.iter().enumerate() {
                let (body, parameter) = column.of;
                let [momentum, rate] = [momentum, rate].map(|w| w[row(n)][body][parameter]);
                let close = |a: f64, b: f64| (a - b).abs() < 1e-10 * (1.0 + b.abs());
                prop_assert!(close(column.of(&momenta, &[0.0; RATES]), momentum), "{:?}", column.of);
                prop_assert!(close(column.of(&[0.0; MOMENTA], &rates), rate), "{:?}", column.of);
            }
        }
    }

    #[test]
    fn the_legs_of_a_go2_are_such_chains() {
        use JointKind::{AboutX, AboutY};
        for which in Leg::ALL {
            let leg = leg::<f64>(which);
            assert_eq!([0, 1, 2].map(|b| leg.kind(b)), [AboutX, AboutY, AboutY]);
            let parents = leg.bodies().map(|body| body.parent);
            assert_eq!(parents, [None, Some(0), Some(1)]);
        }
    }
}

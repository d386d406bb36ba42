//! Whether a motion keeps its limits at every instant, not at samples only.
//!
//! Over a stretch of time of half-length h about m, position, velocity and acceleration lie within h |f'(m)| + h² sup|f''| / 2 of
//! their values at m, the suprema being sums of the series' amplitudes. From these intervals follow those of the torque
//! regressor's entries and, each parameter appearing once, of the torque for all parameters of the stated uncertainty. A
//! distance changes by no more than the joints' ways times how far from their axes what they move can reach. Where a stretch
//! cannot be shown to be within the limits it is halved, until it is or a motion at its middle is seen to be beyond.

use nalgebra::Vector3;
use proprio_core::inertia::INERTIAL;

use super::columns::Column;
use super::fourier::Motion;
use super::interval::{Interval, SLACK, Vector};
use super::limb::{Instant, Limb};
use super::problem::Problem;

/// Length of the stretches that a proof begins with, s, and of those that it gives up on.
const STRETCH: (f64, f64) = (4e-3, 1e-6);

/// A limit that is not kept, or that could not be shown to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// What is limited: `torque`, or two shapes that come too close.
    pub what: String,
    /// The joint, as a number in its limb, if it is one's.
    pub joint: Option<usize>,
    /// When, s.
    pub t: f64,
    /// By how much it is beyond, as a share of the limit (of 0.1 m for a distance).
    pub beyond: f64,
}

/// Position, velocity, acceleration of all joints over a stretch.
pub(super) struct Stretch {
    pub(super) q: Vec<Interval>,
    pub(super) dq: Vec<Interval>,
    pub(super) ddq: Vec<Interval>,
}

/// A motion as a proof sees it: what the joints may do between `middle` − `half` and `middle` + `half`, s.
pub(super) type Enclosure<'a> = &'a dyn Fn(f64, f64) -> Stretch;

/// The limits that a motion does not keep, each at its worst; empty if all hold at every instant.
pub(super) fn violations(problem: &Problem, motion: &Motion) -> Vec<Violation> {
    let bounds: Vec<[f64; 3]> = motion
        .joints
        .iter()
        .map(|series| [2, 3, 4].map(|d| series.derivative_bound(motion.period, d)))
        .collect();
    let stretch = |middle: f64, half: f64| series_over(motion, &bounds, middle, half);
    // One period: the others are the same.
    violations_of(
        problem,
        motion.period,
        &stretch,
        &vec![0.0; problem.joints()],
    )
}

/// The same of any motion of `length` seconds, whose motors give up to `more` (N m) beside what moves the bodies.
pub(super) fn violations_of(
    problem: &Problem,
    length: f64,
    stretch: Enclosure<'_>,
    more: &[f64],
) -> Vec<Violation> {
    let limb = problem.limb.as_ref();
    let proof = Proof {
        problem,
        stretch,
        more,
        frames: Frames::new(limb),
        reach: problem.limits.clearance.reach(limb),
    };
    let mut found: Vec<Violation> = Vec::new();
    let count = (length / STRETCH.0).ceil();
    let length = length / count;
    for n in 0..count as usize {
        proof.check((n as f64 + 0.5) * length, length / 2.0, &mut found);
    }
    found
}

/// A series over a stretch, its derivatives within these bounds.
fn series_over(motion: &Motion, bounds: &[[f64; 3]], middle: f64, half: f64) -> Stretch {
    let n = motion.joints.len();
    let mut of = Stretch {
        q: Vec::with_capacity(n),
        dq: Vec::with_capacity(n),
        ddq: Vec::with_capacity(n),
    };
    let bend = half * half / 2.0;
    for (series, bound) in motion.joints.iter().zip(bounds) {
        let [q, dq, ddq, jerk] = series.at(motion.period, middle);
        of.q.push(Interval::around(q, half * dq.abs() + bend * bound[0]));
        of.dq
            .push(Interval::around(dq, half * ddq.abs() + bend * bound[1]));
        of.ddq
            .push(Interval::around(ddq, half * jerk.abs() + bend * bound[2]));
    }
    of
}

struct Proof<'a> {
    problem: &'a Problem,
    stretch: Enclosure<'a>,
    more: &'a [f64],
    frames: Frames,
    reach: Vec<f64>,
}

impl Proof<'_> {
    fn check(&self, middle: f64, half: f64, found: &mut Vec<Violation>) {
        let stretch = (self.stretch)(middle, half);
        let beyond = self.beyond(&stretch);
        if beyond.iter().all(|(b, ..)| *b <= 0.0) {
            return;
        }
        if 2.0 * half > STRETCH.1 {
            let here = self.beyond(&(self.stretch)(middle, 0.0));
            // What is beyond at an instant needs no closer look; what is not may be within on shorter stretches.
            if here.iter().all(|(b, ..)| *b <= 0.0) {
                self.check(middle - half / 2.0, half / 2.0, found);
                self.check(middle + half / 2.0, half / 2.0, found);
                return;
            }
            return note(here, middle, found);
        }
        note(beyond, middle, found);
    }

    /// By how much each limit may be exceeded, with what it limits and the joint.
    fn beyond(&self, at: &Stretch) -> Vec<(f64, String, Option<usize>)> {
        let limits = &self.problem.limits;
        let mut all = Vec::new();
        let torques = self.torques(at);
        for (c, limit) in limits.joints.iter().enumerate() {
            let [lower, upper] = limit.position;
            let range = (upper - lower).max(1e-9);
            let mut add = |b: f64, what: &str| all.push((b + SLACK, what.to_owned(), Some(c)));
            add(
                (at.q[c].upper - upper).max(lower - at.q[c].lower) / range,
                "position",
            );
            add(at.dq[c].size() / limit.velocity - 1.0, "velocity");
            add(at.ddq[c].size() / limit.acceleration - 1.0, "acceleration");
            add(torques[c].size() / limit.torque - 1.0, "torque");
            add((torques[c] * at.dq[c]).size() / limit.power - 1.0, "power");
        }
        if limits.clearance.count() > 0 {
            let limb = self.problem.limb.as_ref();
            let q: Vec<f64> = at.q.iter().map(|q| (q.lower + q.upper) / 2.0).collect();
            let ways = at.q.iter().zip(&self.reach);
            let moved: f64 = ways
                .map(|(q, reach)| (q.upper - q.lower) / 2.0 * reach)
                .sum();
            for (n, d) in limits.clearance.distances(limb, &q).all.iter().enumerate() {
                let b = (limits.margin - d.value + moved) / 0.1 + SLACK;
                all.push((b, limits.clearance.name(n), None));
            }
        }
        all
    }

    /// The joints' torques for all parameters within their uncertainty, N m.
    fn torques(&self, at: &Stretch) -> Vec<Interval> {
        let problem = self.problem;
        let off = problem.limits.uncertainty;
        let uncertain = |value: f64| Interval::around(value, off * value.abs());
        let rows = self.frames.regressor(at);
        let n = problem.limb.joints();
        (0..n)
            .map(|c| {
                let row = &rows[INERTIAL * n * c..INERTIAL * n * (c + 1)];
                let zero = Interval::point(0.0);
                let entries = row.iter().zip(&problem.theta);
                let [rigid, mut torque] = entries.fold([zero; 2], |[exact, sum], (w, theta)| {
                    [exact + *w * *theta, sum + *w * uncertain(*theta)]
                });
                for (column, value) in problem.known.iter().filter(|(column, _)| column.joint == c)
                {
                    torque = torque + term(column, at, rigid) * uncertain(*value);
                }
                torque + Interval::around(0.0, self.more[c])
            })
            .collect()
    }
}

/// Keeps the worst of each limit.
fn note(beyond: Vec<(f64, String, Option<usize>)>, t: f64, found: &mut Vec<Violation>) {
    for (beyond, what, joint) in beyond.into_iter().filter(|(b, ..)| *b > 0.0) {
        match found
            .iter_mut()
            .find(|v| v.what == what && v.joint == joint)
        {
            Some(known) if known.beyond >= beyond => {}
            Some(known) => (known.t, known.beyond) = (t, beyond),
            None => found.push(Violation {
                what,
                joint,
                t,
                beyond,
            }),
        }
    }
}

/// An effect's torque per unit of its parameter over a stretch.
fn term(column: &Column, at: &Stretch, rigid: Interval) -> Interval {
    use proprio_core::effect::EffectKind as E;
    let j = column.joint;
    let (q, dq, ddq) = (at.q[j], at.dq[j], at.ddq[j]);
    let value = |q: f64, dq: f64, ddq: f64| column.term([q, dq, ddq], 0.0).value;
    match (column.effect, column.part) {
        (E::Viscous | E::Coulomb | E::QuadraticDrag | E::SaturatingViscous, _)
        | (E::AsymmetricCoulomb, 0) => dq.grown(|v| value(0.0, v, 0.0)),
        (E::AsymmetricViscous, _) => dq.grown(|v| super::columns::sign(v).0) * dq,
        (E::Armature, _) => ddq,
        (E::Spring, 0) => q,
        (E::Bias, _) | (E::Spring, _) => Interval::point(1.0),
        (E::LoadFriction, _) => dq.grown(|v| super::columns::sign(v).0) * rigid.abs(),
        (E::TorqueGain, _) => rigid,
        // Cogging, Stribeck friction and friction in one direction are never more than their size.
        _ => Interval::new(-1.0, 1.0),
    }
}

/// A limb's geometry.
struct Frames {
    parents: Vec<Option<usize>>,
    /// Placement A + B sin q + C cos q of a turning joint's frame: rotation parts, row by row; and its origin.
    rotation: Vec<[nalgebra::Matrix3<f64>; 3]>,
    origin: Vec<Vector3<f64>>,
    /// Axis in the joint's own frame, and whether it turns.
    axes: Vec<(Vector3<f64>, bool)>,
    /// Axis of a sliding joint in its parent's frame.
    slide: Vec<Vector3<f64>>,
    gravity: Vector3<f64>,
}

impl Frames {
    fn new(limb: &dyn Limb) -> Self {
        let (frames, axes) = (limb.frames(), limb.axes());
        let rotation = frames
            .iter()
            .zip(&axes)
            .map(|(frame, (axis, turns))| {
                let cross = if *turns {
                    axis.cross_matrix()
                } else {
                    nalgebra::Matrix3::zeros()
                };
                let square = frame.rotation * cross * cross;
                [frame.rotation + square, frame.rotation * cross, -square]
            })
            .collect();
        Self {
            parents: limb.parents(),
            rotation,
            origin: frames.iter().map(|frame| frame.translation).collect(),
            slide: frames
                .iter()
                .zip(&axes)
                .map(|(frame, (axis, _))| frame.rotation * axis)
                .collect(),
            axes,
            gravity: limb.gravity(),
        }
    }

    /// Entries of the torque regressor over a stretch, row-major: the same steps as the regressor's of one instant.
    fn regressor(&self, at: &Stretch) -> Vec<Interval> {
        let n = self.parents.len();
        let mut rows = vec![Interval::point(0.0); INERTIAL * n * n];
        let zero = (Vector::zero(), Vector::zero());
        // Per body: velocity, felt acceleration, gravity and the Jacobian's columns, each as angular and linear part.
        let mut velocity = vec![zero; n];
        let mut acceleration = vec![zero; n];
        let mut columns = vec![vec![zero; n]; n];
        for b in 0..n {
            let turn = self.turn(b, at.q[b]);
            let mut origin = Vector::point(&self.origin[b]);
            if !self.axes[b].1 {
                origin = origin + Vector::point(&self.slide[b]).scale(at.q[b]);
            }
            let down = |(angular, linear): &(Vector, Vector)| {
                (
                    rotated(&turn, angular),
                    rotated(&turn, &(*linear + angular.cross(&origin))),
                )
            };
            let (mut v, mut a) = match self.parents[b] {
                Some(p) => (down(&velocity[p]), down(&acceleration[p])),
                // At rest under gravity is accelerated upwards.
                None => (
                    zero,
                    (
                        Vector::zero(),
                        rotated(&turn, &Vector::point(&-self.gravity)),
                    ),
                ),
            };
            let mut above = self.parents[b];
            while let Some(c) = above {
                columns[b][c] = down(&columns[self.parents[b].unwrap_or(c)][c]);
                above = self.parents[c];
            }
            let axis = Vector::point(&self.axes[b].0);
            let s = if self.axes[b].1 {
                (axis, Vector::zero())
            } else {
                (Vector::zero(), axis)
            };
            columns[b][b] = s;
            v = (v.0 + s.0.scale(at.dq[b]), v.1 + s.1.scale(at.dq[b]));
            let rate = cross(&v, &s);
            a = (
                a.0 + s.0.scale(at.ddq[b]) + rate.0.scale(at.dq[b]),
                a.1 + s.1.scale(at.ddq[b]) + rate.1.scale(at.dq[b]),
            );
            (velocity[b], acceleration[b]) = (v, a);
            let mut moved_by = Some(b);
            while let Some(c) = moved_by {
                let s = &columns[b][c];
                let start = INERTIAL * (n * c + b);
                let (first, second) = (row(s, &a), row(&cross(&v, s), &v));
                for k in 0..INERTIAL {
                    rows[start + k] = first[k] - second[k];
                }
                moved_by = self.parents[c];
            }
        }
        rows
    }

    /// Rows of the rotation from a body's frame to its parent's.
    fn turn(&self, b: usize, q: Interval) -> [[Interval; 3]; 3] {
        let (sin, cos) = q.sin_cos();
        let [a, s, c] = &self.rotation[b];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| Interval::point(a[(i, j)]) + sin * s[(i, j)] + cos * c[(i, j)])
        })
    }
}

/// The transpose of a rotation times a vector.
fn rotated(turn: &[[Interval; 3]; 3], v: &Vector) -> Vector {
    Vector(std::array::from_fn(|j| {
        turn[0][j] * v.0[0] + turn[1][j] * v.0[1] + turn[2][j] * v.0[2]
    }))
}

/// v × m of spatial motions.
fn cross(v: &(Vector, Vector), m: &(Vector, Vector)) -> (Vector, Vector) {
    (v.0.cross(&m.0), v.1.cross(&m.0) + v.0.cross(&m.1))
}

/// The row of [`proprio_core::inertia::momentum_row`].
fn row(u: &(Vector, Vector), v: &(Vector, Vector)) -> [Interval; INERTIAL] {
    let h = v.1.cross(&u.0) + u.1.cross(&v.0);
    let ([ax, ay, az], [bx, by, bz]) = (u.0.0, v.0.0);
    [
        u.1.dot(&v.1),
        h.0[0],
        h.0[1],
        h.0[2],
        ax * bx,
        ax * by + ay * bx,
        ax * bz + az * bx,
        ay * by,
        ay * bz + az * by,
        az * bz,
    ]
}

/// The largest share of each limit that a motion uses at `rate` instants a second: a check of the proof that shares nothing
/// with it but the limits.
pub(super) fn densest(problem: &Problem, motion: &Motion, rate: f64) -> f64 {
    let n = problem.limb.joints();
    let p = INERTIAL * n;
    let mut worst = f64::NEG_INFINITY;
    let mut w = vec![0.0; n * p];
    for k in 0..=(motion.period * rate) as usize {
        let mut at = Instant::zero(n);
        for j in 0..n {
            [at.q[j], at.dq[j], at.ddq[j], _] = motion.at(j, k as f64 / rate);
        }
        problem.limb.regressor(&at, &mut w);
        let constraints = problem.constraints_at(&at, &w);
        worst = constraints.into_iter().fold(worst, f64::max);
    }
    worst
}

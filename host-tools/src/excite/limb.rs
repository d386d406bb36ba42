//! A limb's torque as a matrix that multiplies its inertial parameters, and the gradient of anything made of that matrix.
//!
//! Row (c, b) of the torque regressor is, in body b's coordinates ([`proprio_core::regressor`]),
//!
//! ```text
//! w_cb = r(S_c, A) − r(v × S_c, v),     r(u, w)·φ = uᵀ I(φ) w
//! ```
//!
//! with A the body's acceleration less gravity's. A cost whose slope by w_cb is the ten numbers g_cb therefore changes by
//! S_cᵀ I(g_cb) A − (v × S_c)ᵀ I(g_cb) v as if g_cb were a body, and its slopes by q, q̇ and q̈ follow from how the
//! Jacobian's columns turn: ∂S_c/∂q_i = S_c × S_i for joints i below c, ∂γ/∂q_i = γ × S_i (Featherstone ch. 2), hence
//!
//! ```text
//! ∂v/∂q_i = Ṡ_i,   ∂v/∂q̇_i = S_i,   ∂A/∂q_i = A_p × S_i + Ṡ_i × (v − v_p),   ∂A/∂q̇_i = Ṡ_i + S_i × (v − v_p),   ∂A/∂q̈_i = S_i
//! ```
//!
//! where p is the part of the sum over joints above i. One pass backwards gives all 3 n slopes for about three times the
//! cost of the matrix itself, whatever the cost is.

use nalgebra::{SVector, Vector3};
use proprio_core::estimator::EFFECTS;
use proprio_core::inertia::{INERTIAL, InertialParameters, momentum_row};
use proprio_core::spatial::{Motion, Transform};
use proprio_core::tree::{Body, Jacobians, Joint, Kinematics, Tree};
use proprio_core::window::{self, Plausible, Push, Sample, Window};

use crate::model::{self, Model};

/// Position (rad), velocity (rad/s) and acceleration (rad/s²) of a limb's joints; or slopes by them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Instant {
    pub(super) q: Vec<f64>,
    pub(super) dq: Vec<f64>,
    pub(super) ddq: Vec<f64>,
}

impl Instant {
    pub(super) fn zero(joints: usize) -> Self {
        Self {
            q: vec![0.0; joints],
            dq: vec![0.0; joints],
            ddq: vec![0.0; joints],
        }
    }

    pub(super) fn clear(&mut self) {
        for part in [&mut self.q, &mut self.dq, &mut self.ddq] {
            part.fill(0.0);
        }
    }
}

/// A limb on a fixed base, whatever its number of joints n; matrices are row-major, n × 10 n.
pub(super) trait Limb: Send + Sync {
    fn joints(&self) -> usize;

    /// W with W θ = τ.
    fn regressor(&self, at: &Instant, w: &mut [f64]);

    /// Adds to `slopes` those of Σ g · W, `g` being the slopes by W's entries.
    fn pull_back(&self, at: &Instant, g: &[f64], slopes: &mut Instant);

    /// Each body's frame in the base's at a position.
    fn placements(&self, q: &[f64]) -> Vec<Transform<f64>>;

    /// The body that carries each body.
    fn parents(&self) -> Vec<Option<usize>>;

    /// How each joint moves: its axis in its body's frame, and whether it turns about it or slides along it.
    fn axes(&self) -> Vec<(Vector3<f64>, bool)>;

    /// Each body's joint frame in its parent's at zero position.
    fn frames(&self) -> Vec<Transform<f64>>;

    /// Gravity in the base's frame, m/s².
    fn gravity(&self) -> Vector3<f64>;

    /// Columns of a log's row: ten inertial parameters per body, then each joint's [`EFFECTS`].
    fn log_columns(&self) -> usize {
        (INERTIAL + EFFECTS.len()) * self.joints()
    }

    /// An empty window for a log's samples.
    fn log_window(&self) -> Box<dyn LogWindow>;
}

/// One sample of a limb in a log.
pub(super) struct LogSample<'a> {
    pub(super) time_us: u64,
    pub(super) q: &'a [f64],
    pub(super) dq: &'a [f64],
    pub(super) tau: &'a [f64],
}

/// The window that is being filled.
pub(super) trait LogWindow {
    /// Takes a sample, and hands on the rows that it closes: the joint and its row without the torque.
    fn push(&mut self, sample: &LogSample<'_>, row: &mut dyn FnMut(usize, &[f64]));
}

struct Filling<const N: usize, const P: usize>(Window<f64, N, P, { EFFECTS.len() }>);

impl<const N: usize, const P: usize> LogWindow for Filling<N, P> {
    fn push(&mut self, sample: &LogSample<'_>, row: &mut dyn FnMut(usize, &[f64])) {
        let of = |values: &[f64]| std::array::from_fn(|j| values[j]);
        let pushed = self.0.push(&Sample {
            time_us: sample.time_us,
            q: of(sample.q),
            dq: of(sample.dq),
            tau: of(sample.tau),
        });
        if pushed != Push::Closed {
            return;
        }
        let rows = self.0.rows();
        let mut all = vec![0.0; INERTIAL * N + EFFECTS.len() * N];
        for joint in 0..N {
            all.fill(0.0);
            for (to, from) in all.iter_mut().zip(rows.inertial.row(joint).iter()) {
                *to = *from;
            }
            let own = INERTIAL * N + EFFECTS.len() * joint;
            all[own..own + EFFECTS.len()].copy_from_slice(&rows.effects[joint]);
            row(joint, &all);
        }
    }
}

/// A tree with its base's attitude.
struct Fixed<const N: usize, const P: usize> {
    tree: Tree<f64, N, N>,
    base: Transform<f64>,
    plausible: [Plausible<f64>; N],
}

impl<const N: usize, const P: usize> Fixed<N, P> {
    fn kinematics(&self, at: &Instant) -> Kinematics<f64, N, N> {
        let (q, dq) = (vector(&at.q), vector(&at.dq));
        self.tree.kinematics(&self.base, &q, &dq)
    }

    /// The joints that move body `b`, from the root down.
    fn chain(&self, b: usize) -> ([usize; N], usize) {
        let (mut reversed, mut count, mut next) = ([0; N], 0, Some(b));
        while let Some(a) = next {
            reversed[count] = a;
            count += 1;
            next = self.tree.bodies()[a].parent;
        }
        reversed[..count].reverse();
        (reversed, count)
    }
}

fn vector<const N: usize>(of: &[f64]) -> SVector<f64, N> {
    SVector::from_column_slice(&of[..N])
}

fn upward(gravity: &Vector3<f64>) -> Motion<f64> {
    Motion::new(Vector3::zeros(), -gravity)
}

/// Velocity and felt acceleration above each joint of a chain and, last, of the body itself, in the body's coordinates.
fn sums<const N: usize>(
    k: &Kinematics<f64, N, N>,
    jacobians: &Jacobians<f64, N, N>,
    at: &Instant,
    b: usize,
    chain: &[usize],
) -> Vec<(Motion<f64>, Motion<f64>)> {
    let mut sums = Vec::with_capacity(chain.len() + 1);
    let (mut v, mut a) = (Motion::zero(), upward(&k.gravity[b]));
    sums.push((v, a));
    for &c in chain {
        let (s, rate) = (&jacobians.subspace[b][c], &jacobians.subspace_rate[b][c]);
        v = v + s.scale(at.dq[c]);
        a = a + s.scale(at.ddq[c]) + rate.scale(at.dq[c]);
        sums.push((v, a));
    }
    sums
}

impl<const N: usize, const P: usize> Limb for Fixed<N, P> {
    fn joints(&self) -> usize {
        N
    }

    fn regressor(&self, at: &Instant, w: &mut [f64]) {
        let k = self.kinematics(at);
        let jacobians = self.tree.jacobians(&k);
        w.fill(0.0);
        for b in 0..N {
            let (chain, count) = self.chain(b);
            let sums = sums(&k, &jacobians, at, b, &chain[..count]);
            let (v, a) = sums[count];
            for &c in &chain[..count] {
                let s = &jacobians.subspace[b][c];
                let row = momentum_row(s, &a) - momentum_row(&v.cross(s), &v);
                let start = (c * N + b) * INERTIAL;
                w[start..start + INERTIAL].copy_from_slice(row.as_slice());
            }
        }
    }

    fn pull_back(&self, at: &Instant, g: &[f64], slopes: &mut Instant) {
        let k = self.kinematics(at);
        let jacobians = self.tree.jacobians(&k);
        for b in 0..N {
            let (chain, count) = self.chain(b);
            let chain = &chain[..count];
            let sums = sums(&k, &jacobians, at, b, chain);
            let (v, a) = sums[count];
            // Slopes by A and, with the opposite sign, by v; and what a joint above i adds to the slope by q_i.
            let (mut by_a, mut by_v) = (force(), force());
            let mut turned = force();
            let mut above = Vec::with_capacity(count);
            for &c in chain {
                above.push(turned);
                let start = (c * N + b) * INERTIAL;
                let body = InertialParameters(SVector::<f64, INERTIAL>::from_column_slice(
                    &g[start..start + INERTIAL],
                ));
                let s = &jacobians.subspace[b][c];
                let momentum = body.momentum(&v);
                by_a = by_a + body.momentum(s);
                by_v = by_v + s.cross_force(&momentum) + body.momentum(&v.cross(s));
                turned = turned + s.cross_force(&(body.momentum(&a) + v.cross_force(&momentum)));
            }
            for (n, &i) in chain.iter().enumerate() {
                let (s, rate) = (&jacobians.subspace[b][i], &jacobians.subspace_rate[b][i]);
                let (v_above, a_above) = sums[n];
                let rest = v - v_above;
                slopes.q[i] += (a_above.cross(s) + rate.cross(&rest)).dot(&by_a)
                    - rate.dot(&by_v)
                    - s.dot(&above[n]);
                slopes.dq[i] += (*rate + s.cross(&rest)).dot(&by_a) - s.dot(&by_v);
                slopes.ddq[i] += s.dot(&by_a);
            }
        }
    }

    fn placements(&self, q: &[f64]) -> Vec<Transform<f64>> {
        let at_rest = SVector::zeros();
        // Places are told in the base's own frame: how that is mounted does not matter to them.
        let level = Transform::identity();
        let k = self.tree.kinematics(&level, &vector(q), &at_rest);
        let mut placements: Vec<Transform<f64>> = Vec::with_capacity(N);
        for (b, body) in self.tree.bodies().iter().enumerate() {
            placements.push(match body.parent {
                Some(parent) => placements[parent].compose(&k.placements.from_parent[b]),
                None => k.placements.from_parent[b],
            });
        }
        placements
    }

    fn parents(&self) -> Vec<Option<usize>> {
        self.tree.bodies().iter().map(|body| body.parent).collect()
    }

    fn axes(&self) -> Vec<(Vector3<f64>, bool)> {
        let axis = |body: &Body<f64>| match body.joint {
            Joint::Revolute(axis) => (axis, true),
            Joint::Prismatic(axis) => (axis, false),
            Joint::Free => (Vector3::zeros(), false),
        };
        self.tree.bodies().iter().map(axis).collect()
    }

    fn frames(&self) -> Vec<Transform<f64>> {
        self.tree
            .bodies()
            .iter()
            .map(|body| body.placement)
            .collect()
    }

    fn gravity(&self) -> Vector3<f64> {
        self.base.rotation.tr_mul(&self.tree.gravity())
    }

    fn log_window(&self) -> Box<dyn LogWindow> {
        let settings = window::Settings::default();
        Box::new(Filling::<N, P>(Window::new(
            self.tree,
            self.base,
            EFFECTS,
            self.plausible,
            settings,
        )))
    }
}

fn force() -> proprio_core::spatial::Force<f64> {
    proprio_core::spatial::Force::zero()
}

/// Most joints of a limb.
pub(super) const MAX_JOINTS: usize = 8;

macro_rules! sizes {
    ($model:ident, $limb:ident: $($n:literal)*) => {
        match $limb.bodies.len() {
            $($n => $model.limb_tree::<$n>($limb).map(|tree| {
                let plausible = std::array::from_fn(|j| plausible($model, $limb.bodies.start + j));
                let base = $model.base();
                Box::new(Fixed::<$n, { $n * INERTIAL }> { tree, base, plausible }) as Box<dyn Limb>
            }),)*
            _ => None,
        }
    };
}

/// What a log may say of a joint: twice its limits, half a turn beyond its stops.
fn plausible(model: &Model, joint: usize) -> Plausible<f64> {
    let body = &model.robot().bodies()[joint];
    let half_turn = std::f64::consts::PI;
    Plausible {
        position: [body.limits[0] - half_turn, body.limits[1] + half_turn],
        speed: 2.0 * body.velocity,
        torque: 2.0 * body.effort,
    }
}

/// A limb of `model`; `None` for more than [`MAX_JOINTS`].
pub(super) fn of(model: &Model, limb: &model::Limb) -> Option<Box<dyn Limb>> {
    sizes!(model, limb: 1 2 3 4 5 6 7 8)
}

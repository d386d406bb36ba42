//! Rows of the free Go2 against a simulation by forward dynamics, which shares nothing with them but the kinematics: random
//! motion, random forces at feet that slide as they like, an accelerometer with a bias.

use super::*;
use crate::contact::SINGULAR;
use crate::effect::{EffectKind, STANDING_NOISE};
use crate::go2;
use crate::inertia::InertialParameters;
use crate::inertia::tests::physical;
use crate::spatial::tests::vector;
use nalgebra::Rotation3;
use proptest::prelude::*;
use std::prelude::rust_2024::*;
use std::vec;

const EFFECTS: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
    EffectKind::Bias,
];
/// Viscous, coulomb, armature, bias of hip, thigh and calf.
const TRUE_EFFECTS: [[f64; 4]; 3] = [
    [0.1, 0.3, 0.005, -0.1],
    [0.2, 0.2, 0.006, 0.2],
    [0.05, 0.9, 0.017, 0.05],
];

pub(crate) type Go2Window = FreeBaseWindow<f64, 13, 18, 12, 4, 12, 4, [EffectKind; 4]>;
type Go2Rows = FreeBaseRows<f64, 13, 18, 12, 4>;

/// A robot, how it is pushed about, and where it starts.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    inertia: Vec<InertialParameters<f64>>,
    pub(crate) imu: Transform<f64>,
    pub(crate) bias: Vector3<f64>,
    pub(crate) loaded: [bool; 4],
    /// Each foot's force in the world is its first vector plus the second times a sine.
    forces: [[Vector3<f64>; 2]; 4],
    start: [f64; 18],
    rates: [f64; 18],
    pub(crate) scale: [f64; 18],
    pub(crate) straight: bool,
    /// Times the Coulomb friction, whose corner at standstill no trapezium follows.
    dry: f64,
}

pub(crate) fn case() -> impl Strategy<Value = Case> {
    let pair = || prop::array::uniform2(vector());
    (
        prop::collection::vec(physical(), 13),
        (vector(), vector()),
        prop::array::uniform4(any::<bool>()),
        prop::array::uniform4(pair()),
        prop::array::uniform18(-1.0..1.0f64),
        prop::array::uniform18(-2.0..2.0f64),
        prop::array::uniform18(0.2..1.0f64),
        any::<bool>(),
    )
        .prop_map(
            |(inertia, (turn, place), loaded, forces, start, rates, scale, straight)| Case {
                inertia,
                imu: Transform {
                    rotation: *Rotation3::from_scaled_axis(turn).matrix(),
                    translation: place * 0.1,
                },
                bias: place * 0.1,
                loaded,
                forces,
                start,
                rates,
                scale,
                straight,
                dry: 1.0,
            },
        )
}

/// The state of the simulated robot.
#[derive(Clone)]
struct State {
    base: Transform<f64>,
    q: SVector<f64, 18>,
    v: SVector<f64, 18>,
    t: f64,
}

impl Case {
    pub(crate) fn tree(&self) -> Tree<f64, 13, 18> {
        // The Go2's bodies and a tenth of other ones.
        let cad = go2::free::<f64>();
        let mixed = core::array::from_fn(|b| {
            InertialParameters(cad.bodies()[b].inertia.0 + self.inertia[b].0 * 0.1)
        });
        cad.with_inertia(&mixed)
    }

    fn start(&self) -> State {
        let mut q = SVector::from(self.start);
        for leg in 0..4 {
            q[7 + 3 * leg] += 0.8;
            q[8 + 3 * leg] = if self.straight {
                0.0
            } else {
                q[8 + 3 * leg] - 1.7
            };
        }
        let turn = Vector3::new(self.start[0], self.start[1], self.start[2]);
        State {
            base: Transform {
                rotation: *Rotation3::from_scaled_axis(turn).matrix(),
                translation: Vector3::zeros(),
            },
            q,
            v: SVector::from(self.rates),
            t: 0.0,
        }
    }

    /// Viscous, coulomb, armature, bias of a joint.
    pub(crate) fn effects(&self, joint: usize) -> [f64; 4] {
        let [viscous, coulomb, armature, bias] = TRUE_EFFECTS[joint % 3];
        [viscous, coulomb * self.dry, armature, bias]
    }

    /// Motor torques.
    fn torque(&self, state: &State) -> [f64; 12] {
        core::array::from_fn(|j| {
            let swing = (31.0 * state.t + j as f64).sin();
            20.0 * self.start[6 + j] * swing - 0.5 * state.v[6 + j]
        })
    }

    /// Velocity's derivative: forward dynamics under motors, friction and the feet's forces.
    fn acceleration(&self, tree: &Tree<f64, 13, 18>, state: &State) -> SVector<f64, 18> {
        let k = tree.kinematics(&state.base, &state.q, &state.v);
        let (mut force, mut armature) = (SVector::zeros(), SVector::zeros());
        for (j, torque) in self.torque(state).into_iter().enumerate() {
            let [viscous, coulomb, rotor, bias] = self.effects(j);
            let speed = state.v[6 + j];
            let sign = (speed / 0.035).clamp(-1.0, 1.0);
            force[6 + j] = torque - viscous * speed - coulomb * sign - bias;
            armature[6 + j] = rotor;
        }
        let down = state.base.rotation.tr_mul(&-Vector3::z());
        for (f, foot) in go2::feet().iter().enumerate() {
            if self.loaded[f] {
                let [mean, swing] = self.forces[f];
                let pushed = (mean + swing * (23.0 * state.t).sin()) * 40.0;
                let in_base = state.base.rotation.tr_mul(&pushed);
                force += tree
                    .contact_jacobian(&k.placements, foot, &down)
                    .tr_mul(&in_base);
            }
        }
        tree.forward_dynamics(&k, &state.v, &force, &armature)
            .unwrap()
    }

    /// What the sensors say.
    fn sample(&self, tree: &Tree<f64, 13, 18>, state: &State) -> FreeBaseSample<f64, 12, 4> {
        let rate = self.acceleration(tree, state);
        let part = |x: &SVector<f64, 18>, n: usize| Vector3::new(x[n], x[n + 1], x[n + 2]);
        let (w, v, r) = (part(&state.v, 0), part(&state.v, 3), self.imu.translation);
        let gravity = state.base.rotation.tr_mul(&tree.gravity());
        let (turning, moving) = (part(&rate, 0), part(&rate, 3));
        let classical = moving + w.cross(&v) + turning.cross(&r) + w.cross(&w.cross(&r));
        let to_imu = self.imu.rotation.transpose();
        FreeBaseSample {
            joints: Sample {
                time_us: (state.t * 1e6).round() as u64,
                q: core::array::from_fn(|j| state.q[6 + j]),
                dq: core::array::from_fn(|j| state.v[6 + j]),
                tau: self.torque(state),
            },
            gyro: to_imu * w,
            acc: to_imu * (classical - gravity) + self.bias,
            down: to_imu * gravity.normalize(),
            loaded: self.loaded,
            resting: [false; 12],
        }
    }

    /// Samples every `every` of so many steps of 0.1 ms.
    pub(crate) fn samples(&self, steps: usize, every: usize) -> Vec<FreeBaseSample<f64, 12, 4>> {
        let tree = self.tree();
        let mut state = self.start();
        let mut samples = vec![];
        for step in 0..=steps {
            if step % every == 0 {
                samples.push(self.sample(&tree, &state));
            }
            state = self.step(&tree, &state, 1e-4);
        }
        samples
    }

    /// One step of the midpoint rule.
    fn step(&self, tree: &Tree<f64, 13, 18>, state: &State, dt: f64) -> State {
        let moved = |v: &SVector<f64, 18>, rate: &SVector<f64, 18>, dt: f64| {
            let turn = Rotation3::from_scaled_axis(v.fixed_rows::<3>(0) * dt);
            let slide = v.fixed_rows::<3>(3) * dt;
            State {
                base: Transform {
                    rotation: state.base.rotation * turn.matrix(),
                    translation: state.base.translation + state.base.rotation * slide,
                },
                q: state.q + v * dt,
                v: state.v + rate * dt,
                t: state.t + dt,
            }
        };
        let middle = moved(&state.v, &self.acceleration(tree, state), dt / 2.0);
        moved(&middle.v, &self.acceleration(tree, &middle), dt)
    }

    pub(crate) fn window(&self) -> Go2Window {
        FreeBaseWindow::new(self.tree(), EFFECTS, setup(self.imu, self.scale))
    }

    /// Greatest misfit of the rows under the truth, as a share of the forces that they are made of.
    fn misfit(&self, rows: &Go2Rows) -> f64 {
        let theta = self.tree().parameters::<130>();
        let misfit = |c: usize| {
            let inertial = rows.inertial[c].as_flattened().iter().zip(&theta);
            let effects = rows.effects[c].iter().enumerate();
            let inertial: f64 = inertial.map(|(w, x)| w * x).sum();
            let effects: f64 = effects
                .map(|(j, w)| (0..4).map(|e| w[e] * self.effects(j)[e]).sum::<f64>())
                .sum();
            let bias: f64 = (0..3).map(|n| rows.acceleration[c][n] * self.bias[n]).sum();
            (inertial + effects + bias - rows.torque[c]).abs()
        };
        (0..18).map(misfit).fold(0.0, f64::max)
    }
}

fn setup(imu: Transform<f64>, scale: [f64; 18]) -> FreeBaseSetup<f64, 18, 12, 4> {
    FreeBaseSetup {
        imu,
        feet: go2::feet(),
        scale,
        plausible: [Plausible {
            position: [-10.0, 10.0],
            speed: 1000.0,
            torque: 1000.0,
        }; 12],
        settings: Settings::default(),
        acc_bias: Vector3::zeros(),
        speed_noise: [STANDING_NOISE; 12],
    }
}

fn rows_of(
    window: &mut Go2Window,
    samples: &[FreeBaseSample<f64, 12, 4>],
) -> (Vec<Go2Rows>, Vec<FreeBasePush>) {
    let (mut rows, mut pushes) = (vec![], vec![]);
    for sample in samples {
        let push = window.push(sample);
        if push == FreeBasePush::Closed {
            rows.push(*window.rows());
        }
        pushes.push(push);
    }
    (rows, pushes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn rows_hold_with_any_forces_at_any_feet(case in case()) {
        let (rows, _) = rows_of(&mut case.window(), &case.samples(400, 2));
        prop_assert_eq!(rows.len(), 2);
        for rows in &rows {
            let misfit = case.misfit(rows);
            // Forces of 100 N; of the rows of a singular posture a share passes.
            let whole = rows.rank == 18 - 3 * case.loaded.iter().filter(|x| **x).count();
            prop_assert!(misfit < if whole { 0.02 } else { 0.02 + 200.0 * SINGULAR }, "{misfit}");
        }
    }
}

/// The mean over a few robots of the misfit, sampled every so many steps of 0.1 ms.
fn mean_misfit(every: usize) -> f64 {
    let mut sum = 0.0;
    for n in 0..8 {
        let case = example(n, [true, n % 2 == 0, false, true]);
        let (rows, _) = rows_of(&mut case.window(), &case.samples(200, every));
        sum += case.misfit(&rows[0]) / 8.0;
    }
    sum
}

/// A case without chance.
pub(crate) fn example(n: usize, loaded: [bool; 4]) -> Case {
    let number = |k: usize| ((n * 37 + k * 11) as f64 * 0.7).sin();
    let three = |k: usize| Vector3::new(number(k), number(k + 1), number(k + 2));
    Case {
        inertia: vec![InertialParameters::zero(); 13],
        imu: Transform {
            rotation: *Rotation3::from_scaled_axis(three(1)).matrix(),
            translation: three(4) * 0.1,
        },
        bias: three(7) * 0.1,
        loaded,
        forces: core::array::from_fn(|f| [three(10 + 6 * f), three(13 + 6 * f)]),
        start: core::array::from_fn(|k| 0.5 * number(40 + k)),
        rates: core::array::from_fn(|k| 3.0 * number(60 + k)),
        scale: [1.0; 18],
        straight: false,
        dry: 0.0,
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_misfit_is_that_of_the_trapezium() {
    let (coarse, fine) = (mean_misfit(20), mean_misfit(5));
    std::println!("misfit of 2 ms samples {coarse:.1e}, of 0.5 ms {fine:.1e} N m and N");
    assert!(coarse < 0.05 && fine < coarse / 10.0, "{coarse} {fine}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_force_at_a_foot_that_is_taken_to_be_in_the_air_is_felt() {
    let case = example(3, [true; 4]);
    let mut samples = case.samples(200, 2);
    samples.iter_mut().for_each(|s| s.loaded[2] = false);
    let (rows, _) = rows_of(&mut case.window(), &samples);
    assert!(case.misfit(&rows[0]) > 1.0);
    // … and a foot in the air that is taken to be loaded costs rows only.
    let mut case = example(3, [false; 4]);
    let samples = case.samples(200, 2);
    case.loaded = [true; 4];
    let loaded: Vec<_> = samples
        .into_iter()
        .map(|s| FreeBaseSample {
            loaded: [true; 4],
            ..s
        })
        .collect();
    let (rows, _) = rows_of(&mut case.window(), &loaded);
    assert!(case.misfit(&rows[0]) < 0.01 && rows[0].rank == 6);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_known_bias_is_taken_off() {
    let mut case = example(5, [true, false, false, true]);
    let samples = case.samples(200, 2);
    let known = FreeBaseSetup {
        acc_bias: case.bias,
        ..setup(case.imu, case.scale)
    };
    let mut window = FreeBaseWindow::new(case.tree(), EFFECTS, known);
    let (rows, _) = rows_of(&mut window, &samples);
    case.bias = Vector3::zeros();
    assert!(case.misfit(&rows[0]) < 0.01);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_window_ends_where_a_foot_lifts_off() {
    let case = example(1, [true; 4]);
    let mut samples = case.samples(600, 20);
    // 0 to 20 ms whole, 20 to 34 with another stance from 36 ms on, then 36 to 38 and 40 to 60.
    samples[18].loaded[0] = false;
    samples[19].loaded[0] = false;
    let (rows, pushes) = rows_of(&mut case.window(), &samples);
    let spans: Vec<_> = rows.iter().map(|rows| rows.span_us).collect();
    assert_eq!(spans, [[0, 20_000], [20_000, 34_000], [40_000, 60_000]]);
    assert_eq!(pushes[18], FreeBasePush::Closed);
    assert_eq!(pushes[20], FreeBasePush::Cut);
    assert!(rows.iter().all(|rows| case.misfit(rows) < 0.1));
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_no_measurement_is_told_by_name() {
    let case = example(2, [false; 4]);
    let samples = case.samples(100, 20);
    let mut window = case.window();
    assert_eq!(window.push(&samples[0]), FreeBasePush::Used);
    assert_eq!(window.push(&samples[0]), FreeBasePush::Late);
    let mut held = samples[0];
    held.joints.time_us += 2_000;
    assert_eq!(window.push(&held), FreeBasePush::Repeated);
    let mut late = samples[1];
    late.joints.time_us += 20_000;
    assert_eq!(window.push(&late), FreeBasePush::Gap);
    let mut unknown = samples[2];
    unknown.joints.time_us += 22_000;
    unknown.gyro.y = f64::NAN;
    let rejected = |reason| FreeBasePush::Rejected(reason);
    assert_eq!(window.push(&unknown), rejected(Implausible::NotFinite));
    unknown.gyro.y = 0.0;
    unknown.joints.tau[3] = 1e4;
    assert_eq!(window.push(&unknown), rejected(Implausible::Torque));
}

/// Rank of the rows of many windows: what motion of that stance can tell of 130 inertial parameters.
fn structural_rank(loaded: [bool; 4], with_bias: bool) -> usize {
    const COLUMNS: usize = 130 + 3;
    let mut stack = nalgebra::DMatrix::<f64>::zeros(18 * 60, COLUMNS);
    for n in 0..60 {
        let case = example(n, loaded);
        let (rows, _) = rows_of(&mut case.window(), &case.samples(200, 20));
        for c in 0..18 {
            let inertial = rows[0].inertial[c].as_flattened();
            let bias = rows[0].acceleration[c].iter();
            for (k, x) in inertial.iter().chain(bias).enumerate() {
                stack[(18 * n + c, k)] = *x;
            }
        }
    }
    let mut stack = stack
        .columns(0, if with_bias { COLUMNS } else { 130 })
        .into_owned();
    for mut column in stack.column_iter_mut() {
        let length = column.norm();
        column /= length.max(1e-300);
    }
    let singular = stack.svd(false, false).singular_values;
    singular.iter().filter(|s| **s > 1e-7 * singular[0]).count()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn structural_ranks() {
    let stances = [
        ("no foot", [false; 4], 18),
        ("FR", [true, false, false, false], 15),
        ("FR RL", [true, false, false, true], 12),
        ("FR FL RR", [true, true, true, false], 9),
        ("all feet", [true; 4], 6),
    ];
    std::println!(
        "loaded      equations  rank of 130 inertial columns  … and 3 of the accelerometer's bias"
    );
    for (name, loaded, equations) in stances {
        let case = example(0, loaded);
        let (rows, _) = rows_of(&mut case.window(), &case.samples(200, 20));
        let [rank, with_bias] = [false, true].map(|bias| structural_rank(loaded, bias));
        std::println!("{name:<12}{:>9}{rank:>10}{with_bias:>20}", rows[0].rank);
        assert_eq!(rows[0].rank, equations, "{name}");
        assert_eq!((rank, with_bias), (94, 97), "{name}");
    }
}

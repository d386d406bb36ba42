//! Torque, H, g, C q̇, energies and every regressor against Pinocchio (`tests/oracle/`), in f64 and in f32.

use nalgebra::{DMatrix, Matrix3, Quaternion, SMatrix, SVector, UnitQuaternion, Vector3};
use proprio_core::Real;
use proprio_core::go2;
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use proprio_tests::oracle::{Oracle, State};

/// Greatest error of each quantity over all states, relative to the largest entry of that quantity in the state.
#[derive(Default)]
struct Worst(Vec<(&'static str, f64)>);

impl Worst {
    fn note<T: Real>(
        &mut self,
        name: &'static str,
        ours: impl IntoIterator<Item = T>,
        theirs: &[f64],
    ) {
        let ours: Vec<f64> = ours.into_iter().map(to_f64).collect();
        assert_eq!(ours.len(), theirs.len(), "{name}");
        let size = theirs.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let error = ours
            .iter()
            .zip(theirs)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
            / size;
        assert!(!error.is_nan(), "{name} is not a number");
        match self.0.iter_mut().find(|(n, _)| *n == name) {
            Some((_, worst)) => *worst = worst.max(error),
            None => self.0.push((name, error)),
        }
    }
}

fn to_f64<T: Real>(x: T) -> f64 {
    nalgebra::try_convert(x).expect("f32 and f64 are numbers")
}

fn row_major<T: Real, const R: usize, const C: usize>(m: &SMatrix<T, R, C>) -> Vec<T> {
    m.transpose().as_slice().to_vec()
}

fn vector<T: Real, const N: usize>(values: &[f64]) -> SVector<T, N> {
    SVector::from_iterator(values.iter().map(|x| nalgebra::convert(*x)))
}

fn base<T: Real>(state: &State) -> Transform<T> {
    let Some((p, _)) = state.get("base_position") else {
        return Transform::identity();
    };
    let q = state.field("base_quaternion");
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    let rotation: Matrix3<f64> = *turn.to_rotation_matrix().matrix();
    Transform {
        rotation: rotation.map(nalgebra::convert),
        translation: vector::<T, 3>(p),
    }
}

fn check_state<T: Real, const B: usize, const V: usize, const P: usize>(
    tree: &Tree<T, B, V>,
    state: &State,
    worst: &mut Worst,
) {
    let base = base::<T>(state);
    let joints = state.field("q");
    let skip = V - joints.len();
    let q = SVector::<T, V>::from_fn(|r, _| {
        if r < skip {
            T::zero()
        } else {
            nalgebra::convert(joints[r - skip])
        }
    });
    let (v, a) = (
        vector::<T, V>(state.field("v")),
        vector::<T, V>(state.field("a")),
    );
    let k = tree.kinematics(&base, &q, &v);

    worst.note(
        "tau",
        tree.inverse_dynamics(&k, &v, &a).iter().copied(),
        state.field("tau"),
    );
    worst.note(
        "g",
        tree.gravity_torque(&k).iter().copied(),
        state.field("g"),
    );
    worst.note(
        "Cv",
        tree.coriolis_torque(&k, &v).iter().copied(),
        state.field("Cv"),
    );
    let c = tree.coriolis_matrix(&k);
    worst.note("C v", (c * v).iter().copied(), state.field("Cv"));
    worst.note(
        "Cᵀ v",
        (c.transpose() * v).iter().copied(),
        state.field("Ctv"),
    );
    let h = tree.inertia_matrix(&k);
    worst.note(
        "H",
        row_major(&h),
        &row_major(&state.symmetric::<V>("H_lower")),
    );
    let (kinetic, potential) = tree.energy(&k, &base);
    worst.note("kinetic", [kinetic], state.field("kinetic"));
    worst.note("potential", [potential], state.field("potential"));

    let (w_kinetic, w_potential) = tree.energy_regressor::<P>(&k, &base);
    let energy = SMatrix::<T, 2, P>::from_rows(&[w_kinetic.transpose(), w_potential.transpose()]);
    let regressors = [
        ("torque", tree.inverse_dynamics_regressor::<P>(&k, &v, &a)),
        ("momentum", tree.momentum_regressor::<P>(&k)),
        ("coriolis", tree.coriolis_transpose_regressor::<P>(&k)),
        ("gravity", tree.gravity_regressor::<P>(&k)),
    ];
    let mut seen = 0;
    for (name, w) in &regressors {
        if let Some((whole, _)) = state.get(&format!("W_{name}")) {
            worst.note(name, row_major(w), whole);
            seen += 1;
        }
        if let Some((contracted, _)) = state.get(&format!("uW_{name}")) {
            let u = vector::<T, V>(state.field("u"));
            worst.note(name, (w.transpose() * u).iter().copied(), contracted);
            seen += 1;
        }
    }
    assert!(
        seen >= regressors.len(),
        "the oracle holds each regressor, whole or contracted"
    );
    if let Some((whole, _)) = state.get("W_energy") {
        worst.note("energy", row_major(&energy), whole);
    } else {
        let u = vector::<T, 2>(state.field("u_energy"));
        worst.note(
            "energy",
            (energy.transpose() * u).iter().copied(),
            state.field("uW_energy"),
        );
    }
    let rate = regressors[3].1 - regressors[2].1;
    let ours = row_major(&tree.momentum_rate_regressor::<P>(&k));
    worst.note("momentum rate", ours, &row_major(&rate.map(to_f64)));
}

fn check<T: Real, const B: usize, const V: usize, const P: usize>(
    system: &str,
    tree: &Tree<T, B, V>,
    tolerance: f64,
) {
    let oracle = Oracle::load(system).expect("the committed oracle");
    assert!(oracle.states().len() >= 200);
    let mut worst = Worst::default();
    for state in oracle.states() {
        check_state::<T, B, V, P>(tree, &state, &mut worst);
    }
    let theta: Vec<T> = tree.parameters::<P>().iter().copied().collect();
    worst.note("theta", theta, oracle.theta());
    println!("{system}, {}", std::any::type_name::<T>());
    for (name, error) in &worst.0 {
        println!("  {name:14} {error:.1e}");
    }
    for (name, error) in &worst.0 {
        assert!(*error <= tolerance, "{system}: {name} is off by {error:e}");
    }
}

#[test]
fn a_pinned_leg_in_f64() {
    check::<f64, 3, 3, 30>("leg", &go2::leg(go2::Leg::FR), 1e-10);
}

#[test]
fn a_pinned_leg_in_f32() {
    check::<f32, 3, 3, 30>("leg", &go2::leg(go2::Leg::FR), 1e-4);
}

#[test]
fn the_pinned_robot_in_f64() {
    check::<f64, 12, 12, 120>("pinned", &go2::pinned(), 1e-10);
}

#[test]
fn the_pinned_robot_in_f32() {
    check::<f32, 12, 12, 120>("pinned", &go2::pinned(), 1e-4);
}

#[test]
fn the_free_robot_in_f64() {
    check::<f64, 13, 18, 130>("free", &go2::free(), 1e-10);
}

#[test]
fn the_free_robot_in_f32() {
    check::<f32, 13, 18, 130>("free", &go2::free(), 1e-4);
}

/// Structural rank of W over random states: what of θ any motion can show (Gautier & Khalil 1990).
fn rank<const B: usize, const V: usize, const P: usize>(
    system: &str,
    tree: &Tree<f64, B, V>,
) -> usize {
    let oracle = Oracle::load(system).expect("the committed oracle");
    let blocks: Vec<_> = oracle
        .states()
        .map(|state| {
            let skip = V - state.field("q").len();
            let q = SVector::from_fn(|r, _| {
                if r < skip {
                    0.0
                } else {
                    state.field("q")[r - skip]
                }
            });
            let (v, a) = (state.vector::<V>("v"), state.vector::<V>("a"));
            tree.inverse_dynamics_regressor::<P>(&tree.kinematics(&base(&state), &q, &v), &v, &a)
        })
        .collect();
    let stacked = DMatrix::from_fn(V * blocks.len(), P, |r, c| blocks[r / V][(r % V, c)]);
    let scaled = DMatrix::from_columns(
        &stacked
            .column_iter()
            .map(|c| c.into_owned() / c.norm().max(1e-12))
            .collect::<Vec<_>>(),
    );
    let singular = scaled.singular_values();
    singular.iter().filter(|s| **s > 1e-9 * singular[0]).count()
}

#[test]
fn structural_ranks_are_those_of_the_field() {
    assert_eq!(rank::<3, 3, 30>("leg", &go2::leg(go2::Leg::FR)), 17);
    assert_eq!(rank::<12, 12, 120>("pinned", &go2::pinned()), 68);
    assert_eq!(rank::<13, 18, 130>("free", &go2::free()), 94);
}

#[test]
fn gravity_points_down_in_the_world() {
    assert_eq!(go2::free::<f64>().gravity(), Vector3::new(0.0, 0.0, -9.81));
}

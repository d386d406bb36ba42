use super::*;
use crate::estimator::tests::LegEstimator;
use crate::estimator::{EFFECTS, LegFactors, LegSolver};
use crate::go2::Leg;
use crate::inertia::tests::physical;
use crate::window::tests::exact;
use nalgebra::Cholesky;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use std::prelude::rust_2024::*;

/// A leg that moved for `seconds`, with noise of `noise` N m (a fixed pseudo-random sequence) on the torque.
fn moved(seconds: u64, noise: f64) -> LegEstimator<f64> {
    let mut estimator = LegEstimator::new(Leg::FR);
    let mut state = 7_u64;
    for n in 0..seconds * 500 {
        let mut sample = exact(Leg::FR, n * 2_000);
        for tau in &mut sample.tau {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            *tau += noise * ((state >> 33) as f64 / f64::from(1 << 30) - 1.0);
        }
        estimator.push(&sample);
    }
    estimator
}

fn solver(estimator: &LegEstimator<f64>) -> LegConsistentSolver<f64> {
    ConsistentSolver::new(
        estimator.prior(),
        LegSolver::default(),
        [0.0; LEG_PARAMETERS],
        [0.0; packed_len(LEG_INERTIAL)],
    )
}

/// Least physical value of an effect.
fn lower(effect: usize) -> f64 {
    EFFECTS[effect].description().parameters[0].lower
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn where_the_free_solution_is_physical_the_cost_is_that_of_the_free_solution() {
    let estimator = moved(20, 0.5);
    let free = crate::estimator::tests::solved(&estimator);
    assert!((0..3).all(|b| body(free.values(), b).is_physical()));
    let mut solver = solver(&estimator);
    solver.solve(estimator.factors()).unwrap();
    let (ours, theirs) = (
        solver.cost(solver.values()).unwrap(),
        solver.cost(free.values()).unwrap(),
    );
    assert!(ours <= theirs * (1.0 + 1e-9), "{ours} {theirs}");
    assert!(ours > 0.99 * theirs, "{ours} {theirs}");
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn every_start_ends_at_the_same_bodies() {
    let estimator = moved(10, 1.0);
    let mut solver = solver(&estimator);
    solver.solve(estimator.factors()).unwrap();
    let expected = solver.clone();
    let mut runner = TestRunner::deterministic();
    for _ in 0..20 {
        // The CAD's bodies times a random positive definite matrix: masses and lengths several times too large or small.
        let start = solver.prior.cad().map(|cad| {
            let random = physical()
                .new_tree(&mut runner)
                .unwrap()
                .current()
                .pseudo_inertia();
            let l = Cholesky::new(cad.pseudo_inertia()).unwrap().l();
            InertialParameters::from_pseudo_inertia(&(l * random * l.transpose()))
        });
        solver.start_at(estimator.factors(), &start);
        while !solver.advance().unwrap() {}
        assert!(
            solver.iterations() < MAX_ITERATIONS,
            "{}",
            solver.iterations()
        );
        for k in 0..LEG_PARAMETERS {
            let off = (solver.values()[k] - expected.values()[k]).abs() / expected.std()[k];
            assert!(off < 1e-3, "parameter {k} is {off} sigma off");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Data from bodies that cannot exist and negative friction, hardly any noise: the answer is physical all the same.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn impossible_data_give_possible_bodies(
        wrong in prop::array::uniform32(-2.0..2.0f64), effects in prop::array::uniform12(-1.0..1.0f64),
    ) {
        let estimator = moved(4, 0.0);
        let mut lying = LegFactors::default();
        let mut window = LegEstimator::<f64>::new(Leg::FR);
        for n in 0..2_000 {
            if window.push(&exact(Leg::FR, n * 2_000)) == crate::window::Push::Closed {
                let mut rows = *window.rows();
                for j in 0..3 {
                    rows.torque[j] = (0..30).map(|c| rows.inertial[(j, c)] * wrong[c]).sum::<f64>()
                        + (0..4).map(|e| rows.effects[j][e] * effects[4 * j + e]).sum::<f64>();
                }
                lying.fold_window(&rows).unwrap();
            }
        }
        let mut solver = solver(&estimator);
        solver.solve(&lying).unwrap();
        let values = solver.values();
        prop_assert!(solver.iterations() <= MAX_ITERATIONS);
        for b in 0..3 {
            prop_assert!(body(values, b).is_physical());
        }
        for j in 0..3 {
            for e in 0..3 {
                prop_assert!(values[LEG.effect_index(j, e)] >= 0.0);
            }
        }
    }
}

/// Legs that rest, that swing at the limit of what is plausible, and others between, whose torques have nothing to do with it.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn data_as_wild_as_can_be_come_to_an_end() {
    let mut state = 1_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state as i32 >> 8) / f64::from(1 << 23)
    };
    for set in 0..12 {
        let scale = if set == 0 {
            1e-9
        } else {
            f64::from(set) / 12.0
        };
        let mut estimator = LegEstimator::<f64>::new(Leg::FR);
        for n in 0..65 {
            let mut draw = |size: f64| scale * size * random();
            estimator.push(&crate::window::Sample {
                time_us: 1 + n * 2_000,
                q: [0.0, 0.8, -1.7].map(|middle| middle + draw(1.0)),
                dq: core::array::from_fn(|_| draw(25.0)),
                tau: core::array::from_fn(|_| draw(40.0)),
            });
        }
        let mut solver = solver(&estimator);
        solver.solve(estimator.factors()).unwrap();
        assert!(solver.iterations() <= 20, "{set}: {}", solver.iterations());
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_minimum_has_no_slope_but_at_bounds() {
    let estimator = moved(3, 2.0);
    let mut solver = solver(&estimator);
    solver.solve(estimator.factors()).unwrap();
    let least = solver.cost(solver.values()).unwrap();
    for k in 0..LEG_PARAMETERS {
        for side in [-0.01, 0.01] {
            let mut near: [f64; LEG_PARAMETERS] = core::array::from_fn(|k| solver.values()[k]);
            near[k] += side * solver.std()[k];
            let physical_bound = k >= 30 && near[k] < lower((k - 30) % 4);
            assert!(
                physical_bound || solver.cost(&near).unwrap() > least,
                "parameter {k}, side {side}"
            );
        }
    }
}

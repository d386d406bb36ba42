//! Dynamics and regressors of the Go2's leg, of its four legs on a fixed base and of the free robot, kinematics included:
//! `cargo bench -p proprio-core --bench dynamics`. `studies/duel/run` times the same beside Pinocchio.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use proprio_core::go2::{self, Leg};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Kinematics, Placements, Tree};

/// States that are gone through, so that no call sees the numbers of the one before.
const STATES: usize = 64;

struct State<const V: usize> {
    base: Transform<f64>,
    q: SVector<f64, V>,
    v: SVector<f64, V>,
    a: SVector<f64, V>,
}

/// States that look random and are the same on every machine.
fn states<const V: usize>() -> Vec<State<V>> {
    let mut seed = 1_u32;
    let mut next = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed as i32 >> 8) / f64::from(1 << 23)
    };
    let mut state = || {
        let turn = Vector3::from_fn(|_, _| next());
        State {
            base: Transform {
                rotation: *Rotation3::new(turn).matrix(),
                translation: Vector3::from_fn(|_, _| next()),
            },
            q: SVector::from_fn(|_, _| 2.0 * next()),
            v: SVector::from_fn(|_, _| 5.0 * next()),
            a: SVector::from_fn(|_, _| 25.0 * next()),
        }
    };
    (0..STATES).map(|_| state()).collect()
}

fn bench<const B: usize, const V: usize>(c: &mut Criterion, name: &str, tree: &Tree<f64, B, V>) {
    let states = states::<V>();
    let mut group = c.benchmark_group(name);
    let mut work = |name: &str, call: &mut dyn FnMut(&State<V>)| {
        let mut turn = states.iter().cycle();
        group.bench_function(name, |bench| {
            bench.iter(|| turn.next().map(|state| call(black_box(state))));
        });
    };
    let mut placements = Placements::new();
    let mut kinematics = Kinematics::new();
    let mut rows = Box::new([[[0.0; 10]; B]; V]);
    let (mut numbers, mut inertia) = (SVector::zeros(), SMatrix::zeros());
    let armature = SVector::zeros();
    work("torque regressor", &mut |s| {
        tree.update_placements(&mut placements, &s.base, &s.q);
        tree.write_inverse_dynamics_regressor(&placements, &s.v, &s.a, &mut rows);
        black_box(&rows);
    });
    work("momentum rate regressor", &mut |s| {
        tree.update_kinematics(&mut kinematics, &s.base, &s.q, &s.v);
        tree.write_momentum_rate_regressor(&kinematics, &mut rows);
        black_box(&rows);
    });
    work("inverse dynamics", &mut |s| {
        tree.update_placements(&mut placements, &s.base, &s.q);
        tree.write_inverse_dynamics(&placements, &s.v, &s.a, &mut numbers);
        black_box(&numbers);
    });
    work("inertia matrix", &mut |s| {
        tree.update_placements(&mut placements, &s.base, &s.q);
        tree.write_inertia_matrix(&placements, &mut inertia);
        black_box(&inertia);
    });
    work("forward dynamics", &mut |s| {
        tree.update_placements(&mut placements, &s.base, &s.q);
        let (v, torque) = (&s.v, &s.a);
        black_box(tree.write_forward_dynamics(&placements, v, torque, &armature, &mut numbers));
        black_box(&numbers);
    });
    group.finish();
}

fn all(c: &mut Criterion) {
    bench(c, "leg", &go2::leg(Leg::FR));
    bench(c, "four legs pinned", &go2::pinned());
    bench(c, "free robot", &go2::free());
}

criterion_group!(benches, all);
criterion_main!(benches);

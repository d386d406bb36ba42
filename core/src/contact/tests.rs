//! The contact point's Jacobian against differences of positions, and what a projector has to be, on the free Go2.

use super::*;
use crate::go2::{self, Leg};
use crate::spatial::Transform;
use crate::spatial::tests::{transform, vector};
use nalgebra::Rotation3;
use proptest::prelude::*;
use std::prelude::rust_2024::*;

type Go2 = Tree<f64, 13, 18>;

/// Base and joints after a small motion `by` of the velocity coordinates.
fn moved(
    base: &Transform<f64>,
    q: &SVector<f64, 18>,
    by: &SVector<f64, 18>,
) -> (Transform<f64>, SVector<f64, 18>) {
    let turn = Rotation3::from_scaled_axis(by.fixed_rows::<3>(0).into_owned());
    let slide = by.fixed_rows::<3>(3).into_owned();
    let base = Transform {
        rotation: base.rotation * turn.matrix(),
        translation: base.translation + base.rotation * slide,
    };
    (base, q + by)
}

/// A point of a body in the world.
fn in_world(
    tree: &Go2,
    base: &Transform<f64>,
    q: &SVector<f64, 18>,
    body: usize,
    point: &Vector3<f64>,
) -> Vector3<f64> {
    let placements = tree.placements(base, q);
    let (mut at, mut next) = (*point, Some(body));
    while let Some(b) = next {
        let placed = &placements.from_parent[b];
        at = placed.rotation * at + placed.translation;
        next = tree.bodies()[b].parent;
    }
    at
}

fn joints() -> impl Strategy<Value = SVector<f64, 18>> {
    prop::array::uniform18(-1.5..1.5f64).prop_map(SVector::from)
}

fn numbers() -> impl Strategy<Value = SVector<f64, 18>> {
    prop::array::uniform18(-1.0..1.0f64).prop_map(SVector::from)
}

/// What the equations are scaled by: anything positive.
fn scale() -> impl Strategy<Value = [f64; 18]> {
    prop::array::uniform18(0.1..2.0f64)
}

fn matrix(p: &Projector<f64, 18, 12>) -> SMatrix<f64, 18, 18> {
    let mut matrix = SMatrix::<f64, 18, 18>::zeros();
    for c in 0..18 {
        let unit = SVector::from_fn(|r, _| f64::from(u8::from(r == c)));
        matrix.set_column(c, &p.apply(&unit));
    }
    matrix
}

/// The Jacobian of the loaded feet, times D.
fn scaled(
    tree: &Go2,
    q: &SVector<f64, 18>,
    loaded: [bool; 4],
    down: &Vector3<f64>,
    scale: &[f64; 18],
) -> Vec<SMatrix<f64, 3, 18>> {
    let placements = tree.placements(&Transform::identity(), q);
    let feet = go2::feet::<f64>();
    let rows = (0..4).filter(|f| loaded[*f]).map(|f| {
        let j = tree.contact_jacobian(&placements, &feet[f], down);
        SMatrix::from_fn(|r, c| j[(r, c)] * scale[c])
    });
    rows.collect()
}

proptest! {
    #[test]
    fn the_jacobian_is_the_slope_of_the_lowest_points_position(
        base in transform(), q in joints(), by in numbers(), leg in 0..4usize,
    ) {
        let tree = go2::free::<f64>();
        let foot = go2::feet::<f64>()[leg];
        let placements = tree.placements(&base, &q);
        let down = base.rotation.tr_mul(&-Vector3::z());
        // The material point that is lowest now, below the centre in the world, in the body's coordinates.
        let origin = in_world(&tree, &base, &q, foot.body, &Vector3::zeros());
        let axis = |n: usize| in_world(&tree, &base, &q, foot.body, &Vector3::ith(n, 1.0)) - origin;
        let rotation = Matrix3::from_columns(&[axis(0), axis(1), axis(2)]);
        let point = foot.centre + rotation.tr_mul(&(-Vector3::z() * foot.radius));
        let at = |x: f64| {
            let (base, q) = moved(&base, &q, &(by * x));
            in_world(&tree, &base, &q, foot.body, &point)
        };
        let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
        let told = base.rotation * (tree.contact_jacobian(&placements, &foot, &down) * by);
        prop_assert!((slope - told).norm() < 1e-8, "{slope} {told}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_force_at_a_loaded_foot_passes(
        q in joints(), loaded in prop::array::uniform4(any::<bool>()), down in vector(), d in scale(), x in numbers(),
        force in prop::array::uniform4(vector()),
    ) {
        prop_assume!(down.norm() > 0.1);
        let (tree, down) = (go2::free::<f64>(), down.normalize());
        let mut p = Projector::<f64, 18, 12>::new();
        p.update(&tree, &tree.placements(&Transform::identity(), &q), &go2::feet(), loaded, &down, &d);
        let jacobians = scaled(&tree, &q, loaded, &down, &d);
        for (j, force) in jacobians.iter().zip(&force) {
            let generalised = j.tr_mul(&(force * 100.0));
            prop_assert!(p.apply(&generalised).norm() < 2.0 * SINGULAR * generalised.norm());
            if p.rank() == 3 * jacobians.len() {
                prop_assert!(p.apply(&generalised).norm() < 1e-9 * generalised.norm());
            }
        }
        // Symmetric, idempotent, of the rank that the forces leave.
        let m = matrix(&p);
        prop_assert!((m - m.transpose()).norm() < 1e-12 && (m * m - m).norm() < 1e-12);
        prop_assert!((m.trace() - (18 - p.rank()) as f64).abs() < 1e-12);
        prop_assert!(p.rank() <= 3 * jacobians.len());
        // … and what is orthogonal to every force passes whole.
        let free = p.apply(&x);
        let felt: f64 = jacobians.iter().map(|j| (j * free).norm()).sum();
        prop_assert!(felt < 1e-2 * x.norm());
    }

    /// Straight knees: the legs cannot shorten. Two feet whose line both legs are stretched along lose a direction.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn singular_legs_leave_a_projector(q in joints(), loaded in prop::array::uniform4(any::<bool>()), d in scale()) {
        let tree = go2::free::<f64>();
        let mut q = q;
        for leg in 0..4 {
            q[6 + 3 * leg + 2] = 0.0;
        }
        let mut p = Projector::<f64, 18, 12>::new();
        p.update(&tree, &tree.placements(&Transform::identity(), &q), &go2::feet(), loaded, &-Vector3::z(), &d);
        let m = matrix(&p);
        prop_assert!(m.iter().all(|x| x.is_finite()) && (m * m - m).norm() < 1e-12);
        prop_assert_eq!(p.rank(), 3 * loaded.iter().filter(|x| **x).count());
    }
}

/// The same foot twice: three rows of six are spanned by the others.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn rows_that_others_span_add_no_direction() {
    let tree = go2::free::<f64>();
    let foot = go2::feet::<f64>()[0];
    let q = SVector::from_fn(|n, _| 0.1 * n as f64);
    let placements = tree.placements(&Transform::identity(), &q);
    let mut p = Projector::<f64, 18, 6>::new();
    p.update(
        &tree,
        &placements,
        &[foot; 2],
        [true; 2],
        &-Vector3::z(),
        &[1.0; 18],
    );
    assert_eq!(p.rank(), 3);
    let mut one = Projector::<f64, 18, 3>::new();
    one.update(
        &tree,
        &placements,
        &[foot],
        [true],
        &-Vector3::z(),
        &[1.0; 18],
    );
    let x = SVector::from_fn(|n, _| 1.0 + n as f64);
    assert!((p.apply(&x) - one.apply(&x)).norm() < 1e-12);
}

#[test]
fn a_foot_on_no_body_moves_with_nothing() {
    let tree = go2::leg::<f64>(Leg::FR);
    let foot = Foot {
        body: 7,
        centre: Vector3::zeros(),
        radius: 0.0,
    };
    let placements = tree.placements(&Transform::identity(), &SVector::zeros());
    assert_eq!(
        tree.contact_jacobian(&placements, &foot, &-Vector3::z())
            .norm(),
        0.0
    );
}

proptest! {
    /// A body that turns as it likes and shakes: the direction follows, for the gyro turns it and the shaking averages out.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn gravitys_direction_follows_a_turning_body(rate in vector(), shake in vector()) {
        let (rate, dt) = (rate * 0.5, 2e-3);
        let mut filter = GravityDirection::new(&Vector3::new(0.0, 0.0, 9.81));
        let mut rotation = Rotation3::identity();
        for n in 0..5000 {
            let t = n as f64 * dt;
            let acceleration = shake * (TROT * t).sin() + Vector3::z() * 9.81;
            filter.update(&rate, &(rotation.inverse() * acceleration), dt, 2.0);
            rotation *= Rotation3::from_scaled_axis(rate * dt);
        }
        let error = (filter.down() - rotation.inverse() * -Vector3::z()).norm();
        prop_assert!(error < 0.03, "{error}");
    }
}

/// Steps of a trot at 2.5 Hz, rad/s.
const TROT: f64 = 2.0 * core::f64::consts::PI * 2.5;

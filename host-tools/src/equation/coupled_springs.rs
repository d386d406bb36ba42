//! How links move on the springs of several joints at once, whose dampers are known.
//!
//! The motors' motion is measured; the links fall behind it by x, under the torques L that it would take to follow and their own acceleration against the
//! motors, which each of them passes on to the others:
//!
//! ```text
//! M ẍ + D ẋ + K x = −L(t)
//! ```
//!
//! with M the limb's inertia matrix where the motors are, to first order in x (Spong 1987, *ASME J. Dyn. Syst. Meas. Control* 109:310, eq. 5). One joint
//! alone ([`spring`](super::spring)) misses what it does to its neighbours: beyond the lowest antiresonance that is as much as its own motion.

use nalgebra::{DMatrix, DVector};

use super::spring::Course;
use crate::recording::PIECE_US;

/// The fastest swing's angle in a step of the trapezoidal rule, rad: its frequency is then right within 0.03²·… = 1e-3.
const ANGLE: f64 = 0.1;
/// Most steps between two samples.
const MOST_STEPS: f64 = 64.0;

/// A free swing has decayed to 3 % after so many of its time constants.
const DECAYED: f64 = 3.5;
/// The longest wait for it, s: half of the pieces to which long recordings are thinned ([`PIECE_US`]).
const LONGEST: f64 = 0.5e-6 * PIECE_US as f64;

/// How long a link swings that a spring with a damper holds (kg m², N m s/rad) after what was not seen, s.
pub(crate) fn settling(inertia: f64, damping: f64) -> f64 {
    (DECAYED * 2.0 * inertia / damping).min(LONGEST)
}

/// A joint's spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spring {
    pub(super) joint: usize,
    /// N m/rad.
    pub(super) stiffness: f64,
    /// N m s/rad.
    pub(super) damping: f64,
}

/// Position and velocity of each spring's link against its motor (rad, rad/s) at the times `t`, spring by spring; `load` are the torques that each
/// takes to follow its motor, and `inertia` is the springs' part of M (kg m²) at each time.
pub(super) fn coupled(
    t: &[f64],
    springs: &[Spring],
    load: &[Course],
    inertia: impl Fn(usize) -> DMatrix<f64>,
) -> Vec<Vec<[f64; 2]>> {
    let n = springs.len();
    let mut all: Vec<Vec<[f64; 2]>> = vec![Vec::with_capacity(t.len()); n];
    if t.is_empty() {
        return all;
    }
    let of = |f: fn(&Spring) -> f64| DVector::from_iterator(n, springs.iter().map(f));
    let (k, d) = (of(|s| s.stiffness), of(|s| s.damping));
    let mut last = inertia(0);
    // What was before is not known: links begin where the mean load over one of their swings holds them, and what they swung then is lacking until it has
    // decayed ([`settling`]).
    let mut x = DVector::from_fn(n, |i, _| {
        let swing = std::f64::consts::TAU * (last[(i, i)] / k[i]).sqrt();
        let count = t.partition_point(|own| *own <= t[0] + swing).max(1);
        -load[i].at[..count].iter().sum::<f64>() / (count as f64 * k[i])
    });
    let mut v = DVector::zeros(n);
    let mut momentum = &last * &v;
    for now in 0..t.len() {
        if now > 0 {
            let own = inertia(now);
            let mass = (&last + &own) * 0.5;
            last = own;
            let step = t[now] - t[now - 1];
            if let Some(inverse) = mass.clone().try_inverse()
                && step > 0.0
            {
                // As the pose changes the momentum stays.
                v = &inverse * &momentum;
                // The sum of all squares of natural frequencies, the greatest of which it exceeds.
                let square: f64 = (0..n).map(|i| k[i] * inverse[(i, i)]).sum();
                let count = (step * square.sqrt() / ANGLE).clamp(1.0, MOST_STEPS).ceil();
                let h = step / count;
                let held = DMatrix::from_diagonal(&(&d * 0.5 + &k * (0.25 * h)));
                let moved = &mass / h - &held;
                if let Some(solve) = (&mass / h + &held).try_inverse() {
                    for sub in 0..count as usize {
                        let share = (sub as f64 + 0.5) / count;
                        let torque = DVector::from_fn(n, |i, _| {
                            let Course { at, beyond } = load[i];
                            at[now - 1] + share * (at[now] - at[now - 1]) + beyond[now]
                        });
                        let next = &solve * (&moved * &v - k.component_mul(&x) - torque);
                        x += (&v + &next) * (0.5 * h);
                        v = next;
                    }
                }
                momentum = mass * &v;
            }
        }
        for (i, own) in all.iter_mut().enumerate() {
            own.push([x[i], v[i]]);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two links that pass their acceleration on, under a sine at one of them: the transfer function's amplitudes.
    #[test]
    fn two_links_answer_as_the_transfer_matrix_says() {
        use realfft::num_complex::Complex64;
        let mass = DMatrix::from_row_slice(2, 2, &[2.0, 0.6, 0.6, 0.5]);
        let springs = [(4e3, 4.0), (900.0, 0.8)];
        let springs = [0, 1].map(|joint| Spring {
            joint,
            stiffness: springs[joint].0,
            damping: springs[joint].1,
        });
        for omega in [5.0_f64, 40.0, 90.0] {
            let t: Vec<f64> = (0..40_000).map(|k| 5e-4 * f64::from(k)).collect();
            let sine: Vec<f64> = t.iter().map(|t| (omega * t).sin()).collect();
            let load = [sine, vec![0.0; t.len()]];
            let none = vec![0.0; t.len()];
            let courses = load.each_ref().map(|at| Course { at, beyond: &none });
            let moved = coupled(&t, &springs, &courses, |_| mass.clone());
            let s = Complex64::new(0.0, omega);
            let a = DMatrix::from_fn(2, 2, |i, j| {
                let spring = springs[i].stiffness + s * springs[i].damping;
                s * s * mass[(i, j)] + if i == j { spring } else { Complex64::from(0.0) }
            });
            let g = a.try_inverse().unwrap();
            for i in 0..2 {
                // Fifteen of the slower swing's seconds: it has decayed to 10⁻⁵.
                let steady = &moved[i][30_000..];
                let most = steady
                    .iter()
                    .fold(0.0_f64, |most, [x, _]| most.max(x.abs()));
                let gain = g[(i, 0)].norm();
                assert!(
                    (most / gain - 1.0).abs() < 0.01,
                    "{omega} {i}: {most} {gain}"
                );
            }
        }
    }

    /// One spring alone is that of a joint alone, but for its damper, which is that of the other's damping ratio here.
    #[test]
    fn one_spring_is_the_spring_of_one_joint() {
        use super::super::spring::{Gear, spring};
        let (inertia, stiffness) = (0.7, 900.0_f64);
        let damping = 2.0 * 0.08 * (inertia * stiffness).sqrt();
        let t: Vec<f64> = (0..3000).map(|k| 2e-3 * f64::from(k)).collect();
        let load: Vec<f64> = t
            .iter()
            .map(|t| 3.0 * (9.0 * t).sin() + (50.0 * t).cos())
            .collect();
        let gear = Gear {
            compliance: 1.0 / stiffness,
            friction: 0.0,
            displacement: 0.0,
        };
        let torque = Course {
            at: &load,
            beyond: &vec![0.0; t.len()],
        };
        let alone = spring(&t, torque, &vec![inertia; t.len()], gear);
        let one = Spring {
            joint: 0,
            stiffness,
            damping,
        };
        let own = coupled(&t, &[one], &[torque], |_| {
            DMatrix::from_element(1, 1, inertia)
        });
        let most = alone.iter().fold(0.0_f64, |most, [x, _]| most.max(x.abs()));
        for (a, b) in alone.iter().zip(&own[0]).skip(1000) {
            assert!((a[0] - b[0]).abs() < 0.01 * most, "{a:?} {b:?}");
        }
    }
}

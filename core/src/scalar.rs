//! The scalar: `f32` or `f64`, and sines whose cost does not depend on their argument.

use nalgebra::RealField;

/// A real number, `f32` or `f64`.
///
/// The firmware picks one in a single alias; everything else is generic.
pub trait Real: RealField + Copy {
    /// Zero, where a constant is needed: what a static of the firmware starts as.
    const ZERO: Self;

    /// 1/√x for a positive x, by the same instructions whatever the number; finite at zero.
    ///
    /// A library's square root is software on a microcontroller, four times the instructions, and ends early for some
    /// numbers. Here Newton's iteration refines a first guess from the bits of the number (error below 3.5 %, squared and
    /// halved in each step). Relative error below 4e-16 in `f64`; `f32` is computed in `f64` and rounded once.
    fn inverse_sqrt(self) -> Self;
}

impl Real for f64 {
    const ZERO: Self = 0.0;

    fn inverse_sqrt(self) -> Self {
        newton(self, 4)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;

    fn inverse_sqrt(self) -> Self {
        newton(Self::into(self), 3).min(Self::MAX.into()) as Self
    }
}

/// 1/√x after so many steps of Newton's iteration.
fn newton(x: f64, steps: usize) -> f64 {
    // Halving the exponent and changing its sign halves and negates the logarithm; the constant centres the error.
    let mut y = f64::from_bits(0x5FE6_EB50_C7B5_37A9_u64.wrapping_sub(x.to_bits() >> 1));
    for _ in 0..steps {
        y *= 1.5 - 0.5 * x * y * y;
    }
    y
}

/// √x for x ≥ 0, by the same instructions whatever the number.
pub(crate) fn sqrt<T: Real>(x: T) -> T {
    x * x.inverse_sqrt()
}

/// A literal as a [`Real`].
pub(crate) fn real<T: Real>(value: f64) -> T {
    nalgebra::convert(value)
}

/// Sine and cosine of `angle` (rad), by the same instructions whatever the angle.
///
/// A library's `sin` branches on the size of its argument, so that a tick's cost would depend on the posture. Here the
/// angle is reduced to (−π, π], quartered, put into Taylor polynomials that are exact to rounding on (−π/4, π/4], and
/// doubled twice. Error for |angle| ≤ 100 rad: below 2e-14 in `f64`, 2e-5 in `f32` (dominated by the reduction; below 1e-6
/// within one turn).
#[inline]
pub(crate) fn sin_cos<T: Real>(angle: T) -> (T, T) {
    // Adding and subtracting 1.5/ε rounds to a whole number: the mantissa has no room left for a fraction.
    let rounder = real::<T>(1.5) / T::default_epsilon();
    let turns = (angle * real(1.0 / core::f64::consts::TAU) + rounder) - rounder;
    let y = (angle - turns * T::two_pi()) * real(0.25);
    let square = y * y;
    let sin = y * polynomial(
        square,
        [
            1.0,
            -1.0 / 6.0,
            1.0 / 120.0,
            -1.0 / 5040.0,
            1.0 / 362880.0,
            -1.0 / 39916800.0,
            1.0 / 6227020800.0,
            -1.0 / 1307674368000.0,
        ],
    );
    let cos = polynomial(
        square,
        [
            1.0,
            -0.5,
            1.0 / 24.0,
            -1.0 / 720.0,
            1.0 / 40320.0,
            -1.0 / 3628800.0,
            1.0 / 479001600.0,
            -1.0 / 87178291200.0,
        ],
    );
    let (sin, cos) = double_angle(sin, cos);
    double_angle(sin, cos)
}

/// The natural logarithm of a positive number that is not denormal, by the same instructions whatever it is; error below 4e-16 of one and of itself.
pub(crate) fn ln<T: Real>(x: T) -> T {
    const ROOT_HALF: u64 = core::f64::consts::FRAC_1_SQRT_2.to_bits();
    let bits = nalgebra::try_convert(x).unwrap_or(f64::NAN).to_bits();
    // x = 2^k m with m from √½ to √2.
    let k = (bits.wrapping_sub(ROOT_HALF) as i64) >> 52;
    let m = f64::from_bits(bits.wrapping_sub((k as u64) << 52));
    // ln m = 2 artanh s; |s| ≤ 0.172.
    let s = (m - 1.0) / (m + 1.0);
    let series = (0..11)
        .rev()
        .fold(0.0, |sum, n| sum * (s * s) + 1.0 / f64::from(2 * n + 1));
    real(k as f64 * core::f64::consts::LN_2 + 2.0 * s * series)
}

/// e^(−x) for x ≥ 0, by the same instructions whatever the number; relative error below 1e-10 for x ≤ 40, and e^(−40)
/// beyond, which is nothing beside one.
pub(crate) fn exp_minus<T: Real>(x: T) -> T {
    // e^(−x) = (e^(−x/1024))^1024: a short Taylor polynomial, squared ten times.
    let y = -x.min(real(40.0)) * real(1.0 / 1024.0);
    let series = [
        1.0,
        1.0,
        1.0 / 2.0,
        1.0 / 6.0,
        1.0 / 24.0,
        1.0 / 120.0,
        1.0 / 720.0,
        1.0 / 5040.0,
    ];
    (0..10).fold(polynomial(y, series), |power, _| power * power)
}

/// c₀ + c₁ x + … + c₇ x⁷ by Estrin's scheme: terms side by side rather than one after the other.
#[inline(always)]
fn polynomial<T: Real>(x: T, c: [f64; 8]) -> T {
    let pair = |n: usize| real::<T>(c[n]) + real::<T>(c[n + 1]) * x;
    let square = x * x;
    let (low, high) = (pair(0) + pair(2) * square, pair(4) + pair(6) * square);
    low + high * (square * square)
}

#[inline(always)]
fn double_angle<T: Real>(sin: T, cos: T) -> (T, T) {
    (
        real::<T>(2.0) * sin * cos,
        T::one() - real::<T>(2.0) * sin * sin,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_inverse_square_root_of_zero_is_finite() {
        assert!(0.0f64.inverse_sqrt().is_finite() && 0.0f32.inverse_sqrt().is_finite());
        assert_eq!((sqrt(0.0f64), sqrt(0.0f32)), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn inverse_square_roots_are_right_to_rounding(exponent in -300.0..300.0f64) {
            let x = 10f64.powf(exponent);
            prop_assert!((x.inverse_sqrt() * x.sqrt() - 1.0).abs() < 4.5e-16);
            let x = 10f64.powf(exponent / 8.0) as f32;
            prop_assert!((f64::from(x.inverse_sqrt()) * f64::from(x).sqrt() - 1.0).abs() < 6.1e-8);
        }

        #[test]
        fn logarithms_agree_with_the_library(exponent in -300.0..300.0f64, near in 0.5..2.0f64) {
            for x in [10f64.powf(exponent), near] {
                let expected = x.ln();
                prop_assert!((ln(x) - expected).abs() < 4e-16 * (1.0 + expected.abs()), "{x}");
            }
        }

        #[test]
        fn exponentials_agree_with_the_library(x in 0.0..60.0f64) {
            let expected = (-x.min(40.0)).exp();
            prop_assert!((exp_minus(x) / expected - 1.0).abs() < 1e-10);
            prop_assert!((f64::from(exp_minus(x as f32)) - expected).abs() < 2e-4);
        }

        #[test]
        fn sines_agree_with_the_library(angle in -100.0..100.0f64) {
            let (sin, cos) = sin_cos(angle);
            prop_assert!((sin - angle.sin()).abs() < 2e-14 && (cos - angle.cos()).abs() < 2e-14);
            let (sin, cos) = sin_cos(angle as f32);
            prop_assert!((f64::from(sin) - f64::from(angle as f32).sin()).abs() < 2e-5);
            prop_assert!((f64::from(cos) - f64::from(angle as f32).cos()).abs() < 2e-5);
        }

        #[test]
        fn sines_within_a_turn_are_close_to_rounding_in_f32(angle in -3.1f32..3.1) {
            let (sin, cos) = sin_cos(angle);
            prop_assert!((f64::from(sin) - f64::from(angle).sin()).abs() < 1e-6);
            prop_assert!((f64::from(cos) - f64::from(angle).cos()).abs() < 1e-6);
        }
    }
}

//! Numbers known to lie between two others (Moore 1966), and vectors of them: what a proof over a stretch of time needs.
//!
//! Rounding is to the nearest, not outwards: an enclosure is right to about 1e-15 of its terms, which a proof makes up for by
//! asking for [`SLACK`] more.

use std::ops::{Add, Mul, Neg, Sub};

use nalgebra::Vector3;

/// Share of a bound that rounding may cost: thousands of operations of 1e-16 each.
pub(super) const SLACK: f64 = 1e-9;

/// All numbers from `lower` to `upper`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Interval {
    pub(super) fn new(lower: f64, upper: f64) -> Self {
        Self { lower, upper }
    }

    pub(super) fn point(x: f64) -> Self {
        Self::new(x, x)
    }

    pub(super) fn around(middle: f64, radius: f64) -> Self {
        Self::new(middle - radius, middle + radius)
    }

    /// The greatest size.
    pub(super) fn size(self) -> f64 {
        self.lower.abs().max(self.upper.abs())
    }

    /// What a function that grows everywhere makes of it.
    pub(super) fn grown(self, f: impl Fn(f64) -> f64) -> Self {
        Self::new(f(self.lower), f(self.upper))
    }

    /// Sizes.
    pub(super) fn abs(self) -> Self {
        if self.lower >= 0.0 {
            self
        } else if self.upper <= 0.0 {
            -self
        } else {
            Self::new(0.0, self.size())
        }
    }

    pub(super) fn sin_cos(self) -> (Self, Self) {
        let (middle, radius) = (
            (self.lower + self.upper) / 2.0,
            (self.upper - self.lower) / 2.0,
        );
        let (sin, cos) = middle.sin_cos();
        // |sin(m + d) − sin m − d cos m| ≤ d²/2, and the like for the cosine.
        let bend = radius * radius / 2.0;
        let within = |value: f64, slope: f64| {
            let reach = (slope.abs() * radius + bend).min(2.0);
            Self::new((value - reach).max(-1.0), (value + reach).min(1.0))
        };
        (within(sin, cos), within(cos, sin))
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.lower + other.lower, self.upper + other.upper)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.lower - other.upper, self.upper - other.lower)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.upper, -self.lower)
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let products = [
            self.lower * other.lower,
            self.lower * other.upper,
            self.upper * other.lower,
            self.upper * other.upper,
        ];
        let (mut lower, mut upper) = (products[0], products[0]);
        for product in &products[1..] {
            lower = lower.min(*product);
            upper = upper.max(*product);
        }
        Self::new(lower, upper)
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        if factor < 0.0 {
            Self::new(self.upper * factor, self.lower * factor)
        } else {
            Self::new(self.lower * factor, self.upper * factor)
        }
    }
}

/// A vector of intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vector(pub(super) [Interval; 3]);

impl Vector {
    pub(super) fn zero() -> Self {
        Self([Interval::point(0.0); 3])
    }

    pub(super) fn point(v: &Vector3<f64>) -> Self {
        Self([
            Interval::point(v.x),
            Interval::point(v.y),
            Interval::point(v.z),
        ])
    }

    pub(super) fn cross(&self, other: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    pub(super) fn dot(&self, other: &Self) -> Interval {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        a * x + b * y + c * z
    }

    pub(super) fn scale(&self, factor: Interval) -> Self {
        Self(self.0.map(|x| x * factor))
    }
}

impl Add for Vector {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }
}

impl Sub for Vector {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] - other.0[n]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn within() -> impl Strategy<Value = (Interval, f64)> {
        (-3.0..3.0f64, 0.0..2.0f64, 0.0..=1.0f64).prop_map(|(lower, width, at)| {
            (Interval::new(lower, lower + width), lower + width * at)
        })
    }

    fn holds(interval: Interval, x: f64) -> bool {
        interval.lower - 1e-12 <= x && x <= interval.upper + 1e-12
    }

    proptest! {
        #[test]
        fn what_lies_within_stays_within((a, x) in within(), (b, y) in within(), factor in -2.0..2.0f64) {
            prop_assert!(holds(a + b, x + y));
            prop_assert!(holds(a - b, x - y));
            prop_assert!(holds(a * b, x * y));
            prop_assert!(holds(a * factor, x * factor));
            prop_assert!(holds(a.abs(), x.abs()));
            let (sin, cos) = a.sin_cos();
            prop_assert!(holds(sin, x.sin()) && holds(cos, x.cos()));
        }
    }
}

//! Torques of physical effects per unit of their parameter, with slopes by the motion.
//!
//! The identification integrates its columns over windows; a design looks at one instant, for which a column is the torque
//! itself. The sign of the velocity is a smooth one, since a design follows slopes.

use proprio_core::effect::EffectKind;

/// Velocity at which the smooth sign is at 0.76, rad/s: near the standing noise of a Go2's velocity (go2.md), below which the
/// identification gives friction's sign less weight too.
const SIGN_SPEED: f64 = 0.05;

/// One parameter's torque at one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Column {
    /// Joint of the limb.
    pub(super) joint: usize,
    /// The effect.
    pub(super) effect: EffectKind,
    /// Which of its columns.
    pub(super) part: usize,
    /// Its shape parameter, if it has one.
    pub(super) shape: f64,
}

/// A torque with its slopes by position, velocity, acceleration and the rigid body's torque at the same joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Term {
    pub(super) value: f64,
    pub(super) by_q: f64,
    pub(super) by_dq: f64,
    pub(super) by_ddq: f64,
    pub(super) by_torque: f64,
}

/// tanh(v / v₀) and its slope.
pub(super) fn sign(velocity: f64) -> (f64, f64) {
    let t = (velocity / SIGN_SPEED).tanh();
    (t, (1.0 - t * t) / SIGN_SPEED)
}

/// Whether a design knows the effect's torque at an instant.
pub(super) fn is_known(effect: EffectKind) -> bool {
    use EffectKind as E;
    matches!(
        effect,
        E::Viscous
            | E::Coulomb
            | E::Armature
            | E::Bias
            | E::AsymmetricCoulomb
            | E::AsymmetricViscous
            | E::Stribeck
            | E::LoadFriction
            | E::QuadraticDrag
            | E::SaturatingViscous
            | E::Spring
            | E::Cogging
            | E::TorqueGain
    )
}

impl Column {
    /// The torque in a motion in which the rigid body asks for `torque` (N m); zero for an effect of which
    /// [`is_known`] says no.
    pub(super) fn term(&self, [q, dq, ddq]: [f64; 3], torque: f64) -> Term {
        use EffectKind as E;
        let (s, slope) = sign(dq);
        let none = Term::default();
        match (self.effect, self.part) {
            (E::Viscous, _) => Term {
                value: dq,
                by_dq: 1.0,
                ..none
            },
            (E::Coulomb, _) => Term {
                value: s,
                by_dq: slope,
                ..none
            },
            // Each direction's.
            (E::AsymmetricCoulomb, part) => Term {
                value: 0.5 * if part == 0 { s + 1.0 } else { s - 1.0 },
                by_dq: 0.5 * slope,
                ..none
            },
            (E::AsymmetricViscous, _) => Term {
                value: dq * s,
                by_dq: s + dq * slope,
                ..none
            },
            (E::Armature, _) => Term {
                value: ddq,
                by_ddq: 1.0,
                ..none
            },
            (E::Bias, _) | (E::Spring, 1) => Term { value: 1.0, ..none },
            (E::Spring, _) => Term {
                value: q,
                by_q: 1.0,
                ..none
            },
            (E::Stribeck, _) => {
                let x = dq / self.shape;
                let size = (-x * x).exp();
                Term {
                    value: size * s,
                    by_dq: size * (slope - 2.0 * x / self.shape * s),
                    ..none
                }
            }
            (E::QuadraticDrag, _) => Term {
                value: dq * dq.abs(),
                by_dq: 2.0 * dq.abs(),
                ..none
            },
            (E::SaturatingViscous, _) => {
                let left = (-dq.abs() / self.shape).exp();
                Term {
                    value: (1.0 - left) * s,
                    by_dq: (1.0 - left) * slope + left / self.shape * dq.signum() * s,
                    ..none
                }
            }
            (E::Cogging, part) => {
                let (sin, cos) = (self.shape * q).sin_cos();
                let (value, slope) = if part == 0 { (sin, cos) } else { (cos, -sin) };
                Term {
                    value,
                    by_q: self.shape * slope,
                    ..none
                }
            }
            (E::LoadFriction, _) => Term {
                value: torque.abs() * s,
                by_dq: torque.abs() * slope,
                by_torque: torque.signum() * s,
                ..none
            },
            (E::TorqueGain, _) => Term {
                value: torque,
                by_torque: 1.0,
                ..none
            },
            _ => none,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_values() {
        let h = 1e-6;
        for &effect in EffectKind::ALL.iter().filter(|e| is_known(**e)) {
            for part in 0..effect.columns().max(1) {
                let column = Column {
                    joint: 0,
                    effect,
                    part,
                    shape: 0.3,
                };
                for n in 0..50 {
                    let x = f64::from(n);
                    let at = [(0.7 * x).sin(), 0.2 * (1.3 * x).cos(), (2.1 * x).sin()];
                    let torque = 2.0 * (0.9 * x + 0.3).sin();
                    let term = column.term(at, torque);
                    let difference = |change: &dyn Fn(f64) -> ([f64; 3], f64)| {
                        let value = |h: f64| {
                            let (at, torque) = change(h);
                            column.term(at, torque).value
                        };
                        (value(h) - value(-h)) / (2.0 * h)
                    };
                    let moved = |k: usize| {
                        move |h: f64| {
                            let mut there = at;
                            there[k] += h;
                            (there, torque)
                        }
                    };
                    for (k, slope) in [term.by_q, term.by_dq, term.by_ddq].into_iter().enumerate() {
                        let expected = difference(&moved(k));
                        assert!(
                            (slope - expected).abs() < 1e-5,
                            "{effect:?} {k}: {slope} {expected}"
                        );
                    }
                    let expected = difference(&|h| (at, torque + h));
                    assert!((term.by_torque - expected).abs() < 1e-6, "{effect:?}");
                }
            }
        }
    }
}

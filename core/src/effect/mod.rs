//! The catalogue of physical effects beyond the rigid body: one type, one place to add a new one.
//!
//! An effect's torque is linear in its parameters. Integrated over a window, a parameter's column is
//!
//! ```text
//! [boundary] from t1 to t2 + ∫ rate dt
//! ```
//!
//! and many effects need no integral of a noisy signal at all: viscous friction Fv q̇ gives Δq, armature Ia q̈ gives Δq̇.
//! An effect states the two parts as a [`Term`] per parameter; the window does the rest.
//!
//! # Adding an effect
//!
//! One file beside this one implements [`Effect`] on a unit type; one line of `catalogue!` below lists it. Names are
//! snake_case and are the same in code, command line, JSON and reports.

mod armature;
mod bias;
mod coulomb;
mod viscous;

use crate::Real;
use crate::go2::Actuator;

/// What is known of one joint at one instant; SI, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState<T> {
    /// Position, rad.
    pub q: T,
    /// Velocity, rad/s.
    pub dq: T,
    /// Motor torque, N m.
    pub tau: T,
}

/// A parameter's share of the torque before integration: its window column is \[boundary\] + ∫ rate dt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T> {
    /// The part that integrates to a difference between the window's ends (N m s per unit of the parameter).
    pub boundary: T,
    /// The part that has to be integrated (N m per unit of the parameter).
    pub rate: T,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The field's symbol, such as `Fv`.
    pub symbol: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Least value that is physical.
    pub lower: f64,
    /// Greatest value that is physical.
    pub upper: f64,
}

/// What a parameter is taken to be before any data: mean and standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Expected value.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

/// What an effect is, in words and bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// The effect's name everywhere.
    pub name: &'static str,
    /// Its torque as a formula.
    pub torque: &'static str,
    /// Its parameters, in column order.
    pub parameters: &'static [Parameter],
    /// What it is, in a sentence for the user.
    pub words: &'static str,
    /// Names of effects, or inertial parameters, that look alike on poor data.
    pub look_alikes: &'static [&'static str],
    /// The motion that tells it from them.
    pub separated_by: &'static str,
    /// Attribute of URDF's `<dynamics>`, if it has one.
    pub urdf: Option<&'static str>,
    /// Attribute of MJCF's `<joint>`, if it has one.
    pub mjcf: Option<&'static str>,
}

/// A physical effect at one joint.
pub trait Effect {
    /// Name, bounds, words.
    const DESCRIPTION: Description;

    /// Prior of the effect's parameter at a joint driven by `actuator`.
    fn prior(actuator: &Actuator) -> Prior;

    /// The parameter's window term at one instant.
    fn term<T: Real>(state: &JointState<T>) -> Term<T>;
}

macro_rules! catalogue {
    ($($(#[$doc:meta])* $name:ident = $module:ident),* $(,)?) => {
        /// The effects of the catalogue, by name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum EffectKind { $($(#[$doc])* $name),* }

        impl EffectKind {
            /// The whole catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Name, bounds, words.
            pub const fn description(self) -> &'static Description {
                match self { $(Self::$name => &<$module::$name as Effect>::DESCRIPTION),* }
            }

            /// Prior of the effect at a joint driven by `actuator`.
            pub fn prior(self, actuator: &Actuator) -> Prior {
                match self { $(Self::$name => $module::$name::prior(actuator)),* }
            }

            /// The effect's window term at one instant.
            pub fn term<T: Real>(self, state: &JointState<T>) -> Term<T> {
                match self { $(Self::$name => $module::$name::term(state)),* }
            }
        }
    };
}

catalogue! {
    /// Friction that grows with speed.
    Viscous = viscous,
    /// Friction of constant size against the motion.
    Coulomb = coulomb,
    /// Rotor inertia seen through the gear.
    Armature = armature,
    /// A constant torque.
    Bias = bias,
}

impl EffectKind {
    /// The effect's name everywhere: code, command line, JSON, reports.
    pub const fn name(self) -> &'static str {
        self.description().name
    }

    /// The effect of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|effect| effect.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::go2::ACTUATORS;

    #[test]
    fn names_are_snake_case_unique_and_found() {
        for (n, effect) in EffectKind::ALL.iter().enumerate() {
            let name = effect.name();
            assert!(
                name.chars().all(|c| c.is_ascii_lowercase() || c == '_'),
                "{name}"
            );
            assert_eq!(EffectKind::from_name(name), Some(EffectKind::ALL[n]));
        }
        assert_eq!(EffectKind::from_name("friction"), None);
    }

    #[test]
    fn priors_lie_within_bounds() {
        for effect in EffectKind::ALL {
            for actuator in &ACTUATORS {
                let prior = effect.prior(actuator);
                let parameter = effect.description().parameters[0];
                assert!(prior.std > 0.0);
                assert!((parameter.lower..=parameter.upper).contains(&prior.mean));
            }
        }
    }

    /// A term integrates to the impulse of the torque it stands for: checked on q = sin t against the closed form.
    #[test]
    fn terms_integrate_to_the_impulse_of_the_torque() {
        let torque = |effect, t: f64| match effect {
            EffectKind::Viscous => t.cos(),
            EffectKind::Coulomb => t.cos().signum(),
            EffectKind::Armature => -t.sin(),
            EffectKind::Bias => 1.0,
        };
        let (start, end, steps) = (0.2, 1.2, 10_000);
        let dt = (end - start) / f64::from(steps);
        for &effect in EffectKind::ALL {
            let term = |t: f64| {
                effect.term(&JointState {
                    q: t.sin(),
                    dq: t.cos(),
                    tau: 0.0,
                })
            };
            let mut column = term(end).boundary - term(start).boundary;
            let mut impulse = 0.0;
            for n in 0..steps {
                let middle = start + (f64::from(n) + 0.5) * dt;
                column += term(middle).rate * dt;
                impulse += torque(effect, middle) * dt;
            }
            assert!(
                (column - impulse).abs() < 1e-8,
                "{}: {column} {impulse}",
                effect.name()
            );
        }
    }
}

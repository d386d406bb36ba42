//! The catalogue of physical effects beyond the rigid body: one type, one place to add a new one.
//!
//! Most effects are a torque that is linear in their parameters. Integrated over a window, a parameter's column is
//!
//! ```text
//! [boundary] from t1 to t2 + ∫ rate dt
//! ```
//!
//! and many effects need no integral of a noisy signal at all: viscous friction Fv q̇ gives Δq, armature Ia q̈ gives Δq̇.
//! An effect states the two parts as a [`Term`] per parameter; the window does the rest.
//!
//! What is no torque of its own has another [`Form`]: it changes the motion that the rigid body makes of what the sensors
//! say, the direction of gravity, or the inertia. A shape parameter, in which the torque is not linear, is scanned.
//!
//! # Adding an effect
//!
//! One file beside this one implements [`Effect`] on a unit type; one line of `catalogue!` below lists it. Names are
//! snake_case and are the same in code, command line, JSON and reports. What an effect is stands in its [`Description`] (`description`):
//! whoever decides anything by an effect asks that. A program's own effect is an [`OwnEffect`] (`own`): the same facts, as data.
//!
//! # Example
//!
//! ```
//! use proprio_core::effect::{EffectKind, JointState};
//!
//! let coulomb = EffectKind::from_name("coulomb").expect("it is in the catalogue");
//! // At 2 rad/s, N m of torque per N m of friction: the column's integrand.
//! let joint = JointState::reported(0.3, 2.0, 1.5);
//! assert_eq!(coulomb.term(&joint).rate, 1.0);
//! // Viscous friction needs no integral: its column is how far the joint has turned.
//! let viscous = EffectKind::Viscous.term(&joint);
//! assert_eq!((viscous.boundary, viscous.rate), (0.3, 0.0));
//! println!("{}", coulomb.description().words);
//! ```

mod armature;
mod asymmetric_coulomb;
mod asymmetric_viscous;
mod backlash;
mod base_recoil;
mod base_tilt;
mod bias;
mod cogging;
mod contact;
mod coulomb;
mod coupled_armature;
mod coupled_coulomb;
mod coupled_viscous;
mod current_lag;
mod dead_band;
mod delay;
mod description;
mod eccentricity;
mod elastic_hysteresis;
mod elasticity;
mod encoder_offset;
mod load_friction;
mod own;
mod payload;
mod presliding;
mod quadratic_drag;
mod saturating_viscous;
mod saturation;
mod spring;
mod stribeck;
mod thermal_viscous;
mod torque_gain;
mod velocity_gain;
mod viscous;

pub use own::{CoupledTerms, OwnEffect, Terms};

pub use description::{
    Description, Enters, Form, Grid, Input, Mjcf, Moved, Parameter, Prior, Reach, Transmission,
    Varies,
};

use crate::robot::Actuator;
use crate::{Real, scalar::real};

/// Most window columns of an effect of [`Form::Columns`].
pub const MAX_COLUMNS: usize = 2;

/// Most shapes of an effect: parameters in which its torque is not linear. One that is scanned over each costs the product of both grids.
pub const MAX_SHAPES: usize = 2;

/// Values of an effect's shapes in the order of its parameters; one where it has none. Effects of the catalogue have one at most.
pub type Shapes = [f64; MAX_SHAPES];

/// Most parameters of an effect.
pub const MAX_PARAMETERS: usize = 5;

/// What is known of one joint at one instant; SI, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState<T> {
    /// Position, rad.
    pub q: T,
    /// Velocity as reported, rad/s.
    pub dq: T,
    /// Motor torque, N m.
    pub tau: T,
    /// The best known velocity near standstill, rad/s: on the desktop the slope of the position, whose quantum is fine.
    pub speed: T,
    /// Speed below which [`speed`](Self::speed) may be noise, rad/s.
    pub speed_noise: T,
    /// The torque that the gear transmits, N m: the motor's; where later samples are known, smoothed and without what turns the
    /// rotor and rubs before the gear.
    pub load: T,
    /// How the link's position (rad) and velocity (rad/s) against the motor change with the compliance between them, per rad/(N m);
    /// where later samples are not known, the load against it.
    pub give: [T; 2],
    /// Position (rad) and velocity (rad/s) of the link against the motor, per radian of the play between them; where later
    /// samples are not known, the side that the torque pushes it to.
    pub play: [T; 2],
    /// What the joint's bristles have transmitted since the recording's start per N m of presliding friction,
    /// ∫ z/zs dt, s; zero where the motion before is not known.
    pub presliding: T,
    /// What the joint feels of a base that moves freely by the limbs' momentum: the part that enters by its difference (N m s), and the one that is
    /// integrated (N m); zero where the whole robot's motion is not known.
    pub recoil: [T; 2],
    /// The motor's temperature, °C; not finite where it is not known.
    pub temperature: T,
    /// Time since the recording's start, s; zero where it is not known.
    pub time: T,
}

/// Noise of a standing Go2's velocity, rad/s (go2.md).
pub const STANDING_NOISE: f64 = 0.035;

impl<T: Real> JointState<T> {
    /// What a listener on the bus knows at once: no later sample, no temperature.
    pub fn reported(q: T, dq: T, tau: T) -> Self {
        Self {
            q,
            dq,
            tau,
            speed: dq,
            speed_noise: real(STANDING_NOISE),
            load: tau,
            give: [-tau, T::zero()],
            play: [real::<T>(-0.5) * tau.signum(), T::zero()],
            presliding: T::zero(),
            recoil: [T::zero(); 2],
            temperature: real(f64::NAN),
            time: T::zero(),
        }
    }

    /// The sign of the velocity: a straight line through zero where the speed may be noise, so that noise has no weight on
    /// average.
    pub fn sign(&self) -> T {
        (self.speed / self.speed_noise).max(-T::one()).min(T::one())
    }
}

/// A parameter's share of the torque before integration: its window column is \[boundary\] + ∫ rate dt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T> {
    /// The part that integrates to a difference between the window's ends (N m s per unit of the parameter).
    pub boundary: T,
    /// The part that has to be integrated (N m per unit of the parameter).
    pub rate: T,
}

impl<T: Real> Term<T> {
    /// No torque.
    pub fn zero() -> Self {
        Self {
            boundary: T::zero(),
            rate: T::zero(),
        }
    }

    /// A torque that is a derivative by time.
    pub fn boundary(boundary: T) -> Self {
        Self {
            boundary,
            ..Self::zero()
        }
    }

    /// A torque.
    pub fn rate(rate: T) -> Self {
        Self {
            rate,
            ..Self::zero()
        }
    }
}

/// A physical effect at one joint.
pub trait Effect {
    /// Name, bounds, words.
    const DESCRIPTION: Description;

    /// Prior of a parameter (by its place in the description) at a joint driven by `actuator`.
    fn prior(actuator: &Actuator, parameter: usize) -> Prior;

    /// The window terms of the columns of [`Form::Columns`] at one instant; `shape` is the value of the shape parameter.
    fn terms<T: Real>(_state: &JointState<T>, _shape: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::zero(); MAX_COLUMNS]
    }

    /// For [`Form::Coupled`]: the window terms at one joint, `own`, where the `other` moves so; the same for either of the two.
    fn coupled<T: Real>(_own: &JointState<T>, _other: &JointState<T>) -> [Term<T>; MAX_COLUMNS] {
        [Term::zero(); MAX_COLUMNS]
    }

    /// For [`Form::Motion`]: what has to be added to the reported position (rad) and velocity (rad/s) of this joint, per unit
    /// of the parameter (by its place in the description) beyond its neutral value, to get those of the link.
    fn motion<T: Real>(_state: &JointState<T>, _parameter: usize) -> [T; 2] {
        [T::zero(); 2]
    }
}

macro_rules! catalogue {
    ($($(#[$doc:meta])* $name:ident = $module:ident),* $(,)?) => {
        /// An effect: of the catalogue, or a program's own.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum EffectKind {
            $($(#[$doc])* $name,)*
            /// One from outside the catalogue.
            Own(&'static OwnEffect),
        }

        impl EffectKind {
            /// The whole catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Name, bounds, words.
            pub const fn description(self) -> &'static Description {
                match self {
                    $(Self::$name => &<$module::$name as Effect>::DESCRIPTION,)*
                    Self::Own(own) => &own.description,
                }
            }

            /// Prior of a parameter (by its place in the description) at a joint driven by `actuator`.
            pub fn prior_of(self, actuator: &Actuator, parameter: usize) -> Prior {
                match self {
                    $(Self::$name => $module::$name::prior(actuator, parameter),)*
                    Self::Own(own) => own.prior(parameter),
                }
            }

            /// The window terms of the effect's columns at one instant; the first [`columns`](Self::columns) of them count.
            /// `shape` is the value of the shape parameter, if the effect has one.
            pub fn terms<T: Real>(self, state: &JointState<T>, shape: T) -> [Term<T>; MAX_COLUMNS] {
                match self {
                    $(Self::$name => $module::$name::terms(state, shape),)*
                    Self::Own(own) => own.terms(state, shape),
                }
            }

            /// The window terms at one of two joints that the effect couples, at one instant; of [`Form::Coupled`] only.
            pub fn coupled<T: Real>(self, own: &JointState<T>, other: &JointState<T>) -> [Term<T>; MAX_COLUMNS] {
                match self {
                    $(Self::$name => $module::$name::coupled(own, other),)*
                    Self::Own(_) => [Term::zero(); MAX_COLUMNS],
                }
            }

            /// What has to be added to the reported position (rad) and velocity (rad/s) per unit of the parameter (by its place in the
            /// description) beyond its neutral value to get those of the link; of [`Form::Motion`] only.
            pub fn motion<T: Real>(self, state: &JointState<T>, parameter: usize) -> [T; 2] {
                match self {
                    $(Self::$name => $module::$name::motion(state, parameter),)*
                    Self::Own(_) => [T::zero(); 2],
                }
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
    /// Coulomb friction that differs with the direction.
    AsymmetricCoulomb = asymmetric_coulomb,
    /// Viscous friction that differs with the direction.
    AsymmetricViscous = asymmetric_viscous,
    /// Friction that is larger near standstill.
    Stribeck = stribeck,
    /// Friction that builds up over a displacement.
    Presliding = presliding,
    /// Friction that grows with the load.
    LoadFriction = load_friction,
    /// Drag that grows with the square of the speed.
    QuadraticDrag = quadratic_drag,
    /// Viscous friction that levels off with speed.
    SaturatingViscous = saturating_viscous,
    /// Viscous friction that changes with temperature.
    ThermalViscous = thermal_viscous,
    /// Inertia that turns with two joints.
    CoupledArmature = coupled_armature,
    /// Viscous friction of what turns with two joints.
    CoupledViscous = coupled_viscous,
    /// Coulomb friction of what turns with two joints.
    CoupledCoulomb = coupled_coulomb,
    /// A spring across the joint.
    Spring = spring,
    /// A torque that repeats with the rotor's turning.
    Cogging = cogging,
    /// A wrong torque constant.
    TorqueGain = torque_gain,
    /// A wrong velocity.
    VelocityGain = velocity_gain,
    /// A zero position that is off.
    EncoderOffset = encoder_offset,
    /// A position that is wrong once per turn.
    Eccentricity = eccentricity,
    /// Torque reported late.
    Delay = delay,
    /// Torque that follows what is reported.
    CurrentLag = current_lag,
    /// Gravity not where the model thinks.
    BaseTilt = base_tilt,
    /// A base that its limbs move.
    BaseRecoil = base_recoil,
    /// A load on a body.
    Payload = payload,
    /// A force at a foot.
    Contact = contact,
    /// A spring between motor and link.
    Elasticity = elasticity,
    /// Friction inside a gear that gives way.
    ElasticHysteresis = elastic_hysteresis,
    /// Play between motor and link.
    Backlash = backlash,
    /// Less torque than reported.
    Saturation = saturation,
    /// No torque for a small one reported.
    DeadBand = dead_band,
}

/// The effects of the catalogue of which a fact is true, in its order.
macro_rules! all_that {
    ($is:expr, $count:literal) => {{
        let (mut found, mut count, mut n) = ([Self::ALL[0]; $count], 0, 0);
        while n < Self::ALL.len() {
            if $is(Self::ALL[n].description()) {
                found[count] = Self::ALL[n];
                count += 1;
            }
            n += 1;
        }
        assert!(count == $count);
        found
    }};
}

impl EffectKind {
    /// The effects of every geared drive.
    pub const PLAIN: [Self; 4] = all_that!(Description::is_plain, 4);

    /// Those of a base that is not quite fixed.
    pub const OF_BASE: [Self; 1] = all_that!(Description::is_of_base, 1);

    /// Those that let a link move against its motor.
    pub const COMPLIANT: [Self; 2] = all_that!(Description::is_compliant, 2);

    /// The effect's name everywhere: code, command line, JSON, reports.
    pub const fn name(self) -> &'static str {
        self.description().name
    }

    /// The effect of the catalogue of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|effect| effect.name() == name)
    }

    /// How many window columns of its own joint the effect has: its parameters that are no shape, if its form is columns.
    pub fn columns(self) -> usize {
        let description = self.description();
        match description.form {
            Form::Columns | Form::Clock => description.linear().count(),
            Form::Coupled if !self.couples_with_parent() => description.linear().count(),
            _ => 0,
        }
    }

    /// Whether it couples its joint with the one that carries it, as all couplings of the catalogue do.
    pub fn couples_with_parent(self) -> bool {
        self.description().form == Form::Coupled && !matches!(self, Self::Own(_))
    }

    /// Prior of the first parameter at a joint driven by `actuator`.
    pub fn prior(self, actuator: &Actuator) -> Prior {
        self.prior_of(actuator, 0)
    }

    /// The window terms of the effect's columns at joint `at` of a limb whose `joints` are in these states; [`terms`](Self::terms) is the same
    /// where no other joint matters. Nothing at a joint that the limb does not have.
    pub fn terms_among(
        self,
        joints: &[JointState<f64>],
        at: usize,
        shapes: Shapes,
    ) -> [Term<f64>; MAX_COLUMNS] {
        match (self, joints.get(at)) {
            (_, None) => [Term::zero(); MAX_COLUMNS],
            (Self::Own(own), Some(_)) => (own.terms)(joints, at, shapes),
            (_, Some(state)) => self.terms(state, shapes[0]),
        }
    }

    /// The other joints of the limb that the effect sees, by how many places after its own they are.
    pub fn others(self) -> &'static [isize] {
        match self {
            Self::Own(own) => own.others,
            _ => &[],
        }
    }

    /// The first column's window term at one instant, for effects without a shape.
    pub fn term<T: Real>(self, state: &JointState<T>) -> Term<T> {
        let [first, _] = self.terms(state, T::one());
        first
    }
}

/// An effect is its name.
#[cfg(feature = "serde")]
impl serde::Serialize for EffectKind {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Of the catalogue: who has effects of his own knows their names.
#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for EffectKind {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl serde::de::Visitor<'_> for Name {
            type Value = EffectKind;

            fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str("the name of an effect of the catalogue")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<EffectKind, E> {
                let unknown = || E::invalid_value(serde::de::Unexpected::Str(name), &self);
                EffectKind::from_name(name).ok_or_else(unknown)
            }
        }
        deserializer.deserialize_str(Name)
    }
}

#[cfg(test)]
mod tests;

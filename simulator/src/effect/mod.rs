//! What a simulated joint can have beyond its rigid bodies: one file per effect, in continuous time.
//!
//! These are written from the physics alone and share no code with the identification's window columns: a log that they
//! shape is a test of those. Torques are on the joint side and count what the motor has to give: the motor's torque is
//! the rigid bodies' plus the effects'. An effect overrides the few methods of [`Effect`] that concern it; the integrator
//! ([`super::plant`]), the motor and the sensors ask all effects of a joint.
//!
//! The last ones, from `PositionCoulomb` on, are outside the identification's catalogue on purpose: a test of honesty.
//!
//! # Adding an effect
//!
//! One file here with its `DESCRIPTION` and `new`, one line in `effects!` below, one in [`super::sizes::SIZES`]. A program brings its own
//! as an [`OwnHidden`].

use nalgebra::Vector3;
use proprio_core::inertia::InertialParameters;

/// What an effect sees of its joint at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointState {
    /// Time, s.
    pub(crate) t: f64,
    /// Position of the motor (joint side), rad.
    pub(crate) q: f64,
    /// Velocity of the motor (joint side), rad/s.
    pub(crate) dq: f64,
    /// Position of the link, rad; the motor's unless something gives between them.
    pub(crate) link_q: f64,
    /// Velocity of the link, rad/s.
    pub(crate) link_dq: f64,
    /// Torque that the gear hands to the link, N m.
    pub(crate) transmitted: f64,
    /// Motor temperature, °C.
    pub(crate) temperature: f64,
    /// The effect's own memory; zero at the start.
    pub(crate) memory: f64,
}

/// What lies between motor and link if the gear is not rigid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Transmission {
    /// Stiffness, N m/rad.
    pub(crate) stiffness: f64,
    /// Damping, N m s/rad.
    pub(crate) damping: f64,
    /// Play, rad, from stop to stop.
    pub(crate) gap: f64,
    /// Friction inside the spring, N m, and the displacement (rad) of the one end against the other over which it builds up.
    pub(crate) friction: f64,
    pub(crate) displacement: f64,
}

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Site {
    /// Motor turns per joint turn.
    pub(crate) gear: f64,
    /// Middle of the joint's motion, rad.
    pub(crate) centre: f64,
    /// Length of the log, s.
    pub(crate) duration: f64,
}

/// One effect at one joint. Each method's default is no effect.
pub(crate) trait Effect: Send {
    /// Torque on the motor's side of the gear without dry friction and rotor inertia, N m.
    fn motor_torque(&self, _: &JointState) -> f64 {
        0.0
    }

    /// Torque on the link itself, N m.
    fn link_torque(&self, _: &JointState) -> f64 {
        0.0
    }

    /// Size of the dry friction in positive and in negative motion, N m ≥ 0.
    fn dry_friction(&self, _: &JointState) -> [f64; 2] {
        [0.0; 2]
    }

    /// Whether [`dry_friction`](Self::dry_friction) depends on the transmitted torque.
    fn depends_on_load(&self) -> bool {
        false
    }

    /// Whether the effect has a memory.
    fn has_memory(&self) -> bool {
        false
    }

    /// The memory after `h` seconds at velocity `dq`.
    fn remember(&self, memory: f64, _dq: f64, _h: f64) -> f64 {
        memory
    }

    /// Torques on the motors of this joint and of the one that carries it, N m, by each one's position and velocity.
    fn coupled_torque(&self, _own: [f64; 2], _carrier: [f64; 2]) -> [f64; 2] {
        [0.0; 2]
    }

    /// Inertia of a rotor that turns with the sum of this joint and the one that carries it, as either feels it, kg m².
    fn coupled_inertia(&self) -> f64 {
        0.0
    }

    /// Inertia of the rotor as the joint feels it, kg m².
    fn armature(&self) -> f64 {
        0.0
    }

    /// The motor's true torque where it was `tau` before this effect, N m.
    fn true_torque(&self, tau: f64, _: &JointState) -> f64 {
        tau
    }

    /// Time constant of the lag with which the motor's torque follows what is asked for, s.
    fn lag(&self) -> f64 {
        0.0
    }

    /// Reported position and velocity where they were `q` and `dq` before this effect.
    fn reported(&self, q: f64, dq: f64) -> (f64, f64) {
        (q, dq)
    }

    /// How late the reported torque is, s.
    fn delay(&self) -> f64 {
        0.0
    }

    /// What lies between motor and link.
    fn transmission(&self) -> Option<Transmission> {
        None
    }

    /// What the joint's body carries more.
    fn load(&self) -> InertialParameters<f64> {
        InertialParameters::zero()
    }

    /// Roll and pitch of the base beyond the known ones, rad.
    fn tilt(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// How much of the motion of a base that nothing holds the base has.
    fn recoil(&self) -> f64 {
        0.0
    }

    /// Force on the leg's foot at time `t`, N, in the base's frame.
    fn foot_force(&self, _t: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Whether the temperature matters.
    fn is_thermal(&self) -> bool {
        false
    }
}

/// Most effects of one joint that have a memory: as many as there are such effects.
pub(crate) const MEMORIES: usize = 3;

/// The effects of a joint, each with the place of its memory.
pub(crate) fn with_slots(
    effects: &[Box<dyn Effect>],
) -> impl Iterator<Item = (&dyn Effect, usize)> {
    let mut next = 0;
    effects.iter().map(move |effect| {
        let slot = next;
        next += usize::from(effect.has_memory());
        (effect.as_ref(), slot.min(MEMORIES - 1))
    })
}

/// One parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// As in `NAME=VALUE`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Its value if none is given; the first parameter of an effect is always given.
    pub default: f64,
    /// Least possible value.
    pub lower: f64,
    /// Greatest possible value.
    pub upper: f64,
}

impl Parameter {
    /// Any number.
    pub const fn new(name: &'static str, unit: &'static str, default: f64) -> Self {
        Self::within(name, unit, default, f64::NEG_INFINITY, f64::INFINITY)
    }

    /// Zero or more.
    pub const fn positive(name: &'static str, unit: &'static str, default: f64) -> Self {
        Self::within(name, unit, default, 0.0, f64::INFINITY)
    }

    /// Within bounds.
    pub const fn within(
        name: &'static str,
        unit: &'static str,
        default: f64,
        lower: f64,
        upper: f64,
    ) -> Self {
        Self {
            name,
            unit,
            default,
            lower,
            upper,
        }
    }
}

/// Where an effect can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// At a joint, or on the body it moves.
    Joint,
    /// At a joint that another one carries.
    Pair,
    /// At a foot, named by the calf that carries it.
    Foot,
    /// At the base: all legs feel it.
    Base,
}

/// What an effect is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// As in `--hide`, and in the catalogue if it has it.
    pub name: &'static str,
    /// What it is, in a line.
    pub words: &'static str,
    /// Where it can be.
    pub scope: Scope,
    /// Its parameters; the first is the one that `EFFECT=VALUE` gives.
    pub parameters: &'static [Parameter],
    /// Whether the identification's catalogue has it.
    pub in_catalogue: bool,
}

mod own;

pub use own::{CoupledTorque, Instant, OwnHidden};

macro_rules! effects {
    ($($(#[$doc:meta])* $name:ident = $module:ident),* $(,)?) => {
        $(mod $module;)*

        /// An effect that a simulation can have.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum HiddenKind {
            $($(#[$doc])* $name,)*
            /// One that a program brings.
            Own(&'static OwnHidden),
        }

        impl HiddenKind {
            /// All but those that programs bring; those outside the identification's catalogue last.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Name, parameters, words.
            pub const fn description(self) -> &'static Description {
                match self {
                    $(Self::$name => &$module::DESCRIPTION,)*
                    Self::Own(own) => &own.description,
                }
            }

            /// The effect with these values of all its parameters.
            pub(crate) fn build(self, values: &[f64], site: &Site) -> Box<dyn Effect> {
                debug_assert_eq!(values.len(), self.description().parameters.len());
                match self {
                    $(Self::$name => Box::new($module::new(values, site)),)*
                    Self::Own(own) => Box::new(own::new(own, values)),
                }
            }
        }
    };
}

effects! {
    /// Friction that grows with speed.
    Viscous = viscous,
    /// Friction of constant size.
    Coulomb = coulomb,
    /// Rotor inertia.
    Armature = armature,
    /// A constant torque.
    Bias = bias,
    /// Friction that differs with direction.
    AsymmetricCoulomb = asymmetric_coulomb,
    /// Viscous friction that differs with direction.
    AsymmetricViscous = asymmetric_viscous,
    /// Friction that falls with speed.
    Stribeck = stribeck,
    /// Friction that builds up over a displacement.
    Presliding = presliding,
    /// Friction that grows with the load.
    LoadFriction = load_friction,
    /// Drag that grows with the speed squared.
    QuadraticDrag = quadratic_drag,
    /// Viscous friction that levels off with speed.
    SaturatingViscous = saturating_viscous,
    /// Viscous friction that depends on temperature.
    ThermalViscous = thermal_viscous,
    /// Inertia that turns with two joints.
    CoupledArmature = coupled_armature,
    /// Viscous friction of what turns with two joints.
    CoupledViscous = coupled_viscous,
    /// Coulomb friction of what turns with two joints.
    CoupledCoulomb = coupled_coulomb,
    /// A spring beside the joint.
    Spring = spring,
    /// Torque that repeats with the motor's turn.
    Cogging = cogging,
    /// A torque reported in a wrong scale.
    TorqueGain = torque_gain,
    /// A velocity reported in a wrong scale.
    VelocityGain = velocity_gain,
    /// A position reported with an offset.
    EncoderOffset = encoder_offset,
    /// A position that is wrong once per turn.
    Eccentricity = eccentricity,
    /// A torque reported late.
    Delay = delay,
    /// A torque that follows what is reported.
    CurrentLag = current_lag,
    /// A base that is not level.
    BaseTilt = base_tilt,
    /// A base that the legs move.
    BaseRecoil = base_recoil,
    /// A mass on a body.
    Payload = payload,
    /// Force episodes at a foot.
    Contact = contact,
    /// A spring between motor and link.
    Elasticity = elasticity,
    /// Play between motor and link.
    Backlash = backlash,
    /// A torque limit that the report does not show.
    Saturation = saturation,
    /// A band of the report in which there is no torque.
    DeadBand = dead_band,
    /// Dry friction that depends on position.
    PositionCoulomb = position_coulomb,
    /// A disturbance tied to time.
    PeriodicTorque = periodic_torque,
    /// A torque constant that falls as the motor warms.
    TorqueConstantDrift = torque_constant_drift,
    /// A torque that depends on where the joint came from.
    Hysteresis = hysteresis,
    /// Friction that changes suddenly.
    FrictionStep = friction_step,
    /// A cable that jerks at one position.
    CableSnag = cable_snag,
}

impl HiddenKind {
    /// The effect's name everywhere.
    pub const fn name(self) -> &'static str {
        self.description().name
    }

    /// The effect of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }
}

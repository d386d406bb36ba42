//! An effect at a place with its values: what `--hide` says, and what a battery of tests is made of.

use std::fmt::Display;
use std::str::FromStr;
use std::sync::Arc;

use super::effect::{HiddenKind, Scope};
use crate::TrueValue;
use proprio_core::go2::{JOINTS_PER_LEG, JointId, Leg};

/// The base, where a payload names it.
const BASE: &str = "base";

/// A joint that an effect can be at; it is displayed as its name.
pub trait HiddenJoint: Clone + PartialEq + Display {
    /// Whether another joint carries it: what couples two joints needs one.
    fn is_carried(&self) -> bool;

    /// The names of the joints of its limb that a coupling may be with, in their order, and which of them it is: where one carries it, the one before it.
    fn limb(&self) -> (Vec<Arc<str>>, usize);

    /// Whether its body bears a foot.
    fn bears_foot(&self) -> bool;
}

impl HiddenJoint for JointId {
    fn is_carried(&self) -> bool {
        self.place() > 0
    }

    fn limb(&self) -> (Vec<Arc<str>>, usize) {
        let names = Self::of(self.leg()).map(|joint| joint.name().into());
        (names.to_vec(), self.place())
    }

    fn bears_foot(&self) -> bool {
        self.place() + 1 == JOINTS_PER_LEG
    }
}

/// An effect at a joint, or of the base, with a value for each of its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenEffect<J = JointId> {
    kind: HiddenKind,
    joint: Option<J>,
    values: Vec<f64>,
}

/// Why an effect cannot be as asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HiddenError {
    /// Not `EFFECT[:JOINT]=VALUE[,NAME=VALUE…]`.
    #[error("expected EFFECT[:JOINT]=VALUE[,NAME=VALUE…]")]
    Form,
    /// No such effect, joint or parameter.
    #[error("`{name}` is not one of {}", .known.join(", "))]
    Name {
        /// What was written.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// Not a number.
    #[error("`{0}` is not a number")]
    Number(String),
    /// A value that cannot be.
    #[error("{name} must lie between {lower} and {upper}")]
    Bounds {
        /// The effect, or its parameter.
        name: String,
        /// Least value.
        lower: f64,
        /// Greatest value.
        upper: f64,
    },
    /// An effect that cannot be at such a place.
    #[error("{0} {1}")]
    Place(&'static str, &'static str),
    /// An effect that a robot on its feet is not simulated with.
    #[error("{0} cannot be hidden from a robot that walks; what can: {walking}", walking = walking())]
    Walking(&'static str),
}

/// The effects that a robot on its feet is not simulated with: its gears are rigid, its motors have no temperature, its feet stand on the
/// ground, and nothing holds its base.
const NOT_WALKING: [HiddenKind; 7] = [
    HiddenKind::ThermalViscous,
    HiddenKind::TorqueConstantDrift,
    HiddenKind::Elasticity,
    HiddenKind::Backlash,
    HiddenKind::Contact,
    HiddenKind::BaseTilt,
    HiddenKind::BaseRecoil,
];

/// The names of the effects that a robot on its feet can have.
pub fn walking() -> String {
    let all = HiddenKind::ALL
        .iter()
        .filter(|kind| !NOT_WALKING.contains(kind));
    let names: Vec<&str> = all.map(|kind| kind.name()).collect();
    names.join(", ")
}

/// `name` was looked for in `known`.
fn unknown(name: &str, known: impl IntoIterator<Item = impl Display>) -> HiddenError {
    HiddenError::Name {
        name: name.to_owned(),
        known: known.into_iter().map(|name| name.to_string()).collect(),
    }
}

impl<J: HiddenJoint> HiddenEffect<J> {
    /// The effect at `joint` (`None`: the base, which may carry a payload) with this value of its first parameter and the others' defaults.
    ///
    /// # Errors
    /// [`HiddenError::Bounds`] or [`HiddenError::Place`].
    pub fn new(kind: HiddenKind, joint: Option<J>, value: f64) -> Result<Self, HiddenError> {
        let description = kind.description();
        let misplaced = |why| Err(HiddenError::Place(description.name, why));
        match (description.scope, &joint) {
            (Scope::Base, Some(_)) => return misplaced("is of the base: name no joint"),
            (Scope::Joint, None) if kind == HiddenKind::Payload => {}
            (Scope::Joint | Scope::Pair | Scope::Foot, None) => return misplaced("needs a joint"),
            (Scope::Pair, Some(joint)) if !joint.is_carried() => {
                return misplaced(
                    "couples a joint with the one that carries it: name a joint that another carries",
                );
            }
            (Scope::Foot, Some(joint)) if !joint.bears_foot() => {
                return misplaced("is at a foot: name the joint that carries it");
            }
            _ => {}
        }
        let values = description.parameters.iter().map(|p| p.default).collect();
        let effect = Self {
            kind,
            joint,
            values,
        };
        effect.put(0, value)
    }

    /// The same effect with another value of the parameter called `name`.
    ///
    /// # Errors
    /// [`HiddenError::Name`] or [`HiddenError::Bounds`].
    pub fn with(self, name: &str, value: f64) -> Result<Self, HiddenError> {
        let parameters = self.kind.description().parameters;
        let names = || parameters.iter().map(|p| p.name);
        let found = names().position(|known| known == name);
        let n = found.ok_or_else(|| unknown(name, names()))?;
        self.put(n, value)
    }

    fn put(mut self, n: usize, value: f64) -> Result<Self, HiddenError> {
        let description = self.kind.description();
        let parameter = &description.parameters[n];
        if !value.is_finite() || !(parameter.lower..=parameter.upper).contains(&value) {
            let name = match n {
                0 => description.name.to_owned(),
                _ => format!("{} of {}", parameter.name, description.name),
            };
            let (lower, upper) = (parameter.lower, parameter.upper);
            return Err(HiddenError::Bounds { name, lower, upper });
        }
        self.values[n] = value;
        Ok(self)
    }

    /// Those of `effects` that a joint has, in the order of their kinds; of several of a kind the last.
    pub(crate) fn at_joint<'a>(effects: &'a [Self], joint: &J) -> Vec<&'a Self> {
        let here = || effects.iter().filter(|e| e.joint.as_ref() == Some(joint));
        let mut kinds = HiddenKind::ALL.to_vec();
        for kind in here().map(Self::kind) {
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        let last = |kind| here().rfind(|e| e.kind() == kind);
        kinds.into_iter().filter_map(last).collect()
    }

    /// Which effect.
    pub fn kind(&self) -> HiddenKind {
        self.kind
    }

    /// At which joint; `None` for the base.
    pub fn joint(&self) -> Option<J> {
        self.joint.clone()
    }

    /// The same at the joint that `to` says.
    pub fn moved<K>(self, to: impl FnOnce(J) -> K) -> HiddenEffect<K> {
        HiddenEffect {
            kind: self.kind,
            joint: self.joint.map(to),
            values: self.values,
        }
    }

    /// Its parameters' values, in the order of its description.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// `stribeck:FR_calf`, `payload:base`, `base_tilt`.
    pub fn place(&self) -> String {
        match &self.joint {
            Some(joint) => format!("{}:{joint}", self.kind.name()),
            None if self.kind.description().scope == Scope::Base => self.kind.name().to_owned(),
            None => format!("{}:{BASE}", self.kind.name()),
        }
    }

    /// Its parameters by name: the first bears the effect's, the others `NAME:EFFECT:JOINT`.
    pub fn parameters(&self) -> impl Iterator<Item = TrueValue> {
        let described = self.kind.description().parameters.iter();
        described
            .zip(&self.values)
            .enumerate()
            .map(|(n, (parameter, &value))| TrueValue {
                name: match n {
                    0 => self.place(),
                    _ => format!("{}:{}", parameter.name, self.place()),
                },
                unit: parameter.unit,
                value,
            })
    }
}

/// Friction, rotor inertia and bias of a Go2's motors in the middle of what recorded data show.
pub fn typical(legs: &[Leg]) -> Vec<HiddenEffect> {
    // At hip, thigh and calf.
    let table = [
        (HiddenKind::Viscous, [0.03, 0.04, 0.05]),
        (HiddenKind::Coulomb, [0.15, 0.12, 0.6]),
        // Not quite the rotors' on paper, which an estimate takes as its prior.
        (HiddenKind::Armature, [0.005, 0.005, 0.018]),
        (HiddenKind::Bias, [-0.1, 0.1, -0.1]),
    ];
    let at = |joint: JointId| {
        table.map(|(kind, values)| HiddenEffect {
            kind,
            joint: Some(joint),
            values: vec![values[joint.place()]],
        })
    };
    let joints = legs.iter().flat_map(|&leg| JointId::of(leg));
    joints.flat_map(at).collect()
}

/// Friction, rotor inertia and bias of another robot's motors: a Go2's in the middle of its joints. A torque is so many times as large as the robot is
/// heavier and its legs longer; times grow with the root of the length, as those of a pendulum.
pub(crate) fn typical_of<J: HiddenJoint>(
    joints: &[J],
    heavier: f64,
    longer: f64,
) -> Vec<HiddenEffect<J>> {
    let unit = heavier * longer;
    let at = |(n, joint): (usize, &J)| {
        let side = if n.is_multiple_of(2) { -1.0 } else { 1.0 };
        let table = [
            (HiddenKind::Viscous, 0.04 * unit * longer.sqrt()),
            (HiddenKind::Coulomb, 0.15 * unit),
            (HiddenKind::Armature, 0.006 * unit * longer),
            (HiddenKind::Bias, 0.1 * unit * side),
        ];
        table.map(|(kind, value)| HiddenEffect {
            kind,
            joint: Some(joint.clone()),
            values: vec![value],
        })
    };
    joints.iter().enumerate().flat_map(at).collect()
}

/// What `EFFECT[:JOINT]=VALUE[,NAME=VALUE…]` says; without a joint, at all joints that can have it.
#[derive(Debug, Clone, PartialEq)]
pub struct Hide<J = JointId> {
    kind: HiddenKind,
    joint: Option<J>,
    on_base: bool,
    value: f64,
    others: Vec<(String, f64)>,
}

impl Hide {
    /// The effects it asks for on a pinned robot with these legs.
    ///
    /// # Errors
    /// [`HiddenError`].
    pub fn on(&self, legs: &[Leg]) -> Result<Vec<HiddenEffect>, HiddenError> {
        if self.on_base {
            let why = "on the base is felt only by a robot that walks (simulate --walk)";
            return Err(HiddenError::Place(self.kind.name(), why));
        }
        let joints: Vec<JointId> = legs.iter().flat_map(|&leg| JointId::of(leg)).collect();
        self.places(&joints)
    }
}

impl<J: HiddenJoint> Hide<J> {
    /// What the text says on a robot of these joints.
    ///
    /// # Errors
    /// [`HiddenError`].
    pub fn parse(text: &str, joints: &[J]) -> Result<Self, HiddenError> {
        let (place, values) = text.split_once('=').ok_or(HiddenError::Form)?;
        let (effect, joint) = match place.split_once(':') {
            Some((effect, place)) => (effect, Some(place)),
            None => (place, None),
        };
        let names = || HiddenKind::ALL.iter().map(|kind| kind.name());
        let kind = HiddenKind::from_name(effect).ok_or_else(|| unknown(effect, names()))?;
        let on_base = joint == Some(BASE) && kind == HiddenKind::Payload;
        // What is of the base anyway may say so.
        let is_of_base = on_base || kind.description().scope == Scope::Base;
        let joint = joint.filter(|&name| !(is_of_base && name == BASE));
        let named = |name: &str| {
            let found = joints.iter().find(|joint| joint.to_string() == name);
            found.cloned().ok_or_else(|| unknown(name, joints))
        };
        let joint = joint.map(named).transpose()?;
        let mut values = values.split(',');
        let value = number(values.next().unwrap_or(""))?;
        let mut others = Vec::new();
        for other in values {
            let (name, value) = other.split_once('=').ok_or(HiddenError::Form)?;
            others.push((name.to_owned(), number(value)?));
        }
        let hide = Self {
            kind,
            joint,
            on_base,
            value,
            others,
        };
        // What is wrong with it is wrong wherever it is.
        hide.places(joints)?;
        Ok(hide)
    }

    /// The joint it names, if it does.
    pub fn joint(&self) -> Option<J> {
        self.joint.clone()
    }

    /// The effects it asks for on a whole robot that walks on these joints.
    ///
    /// # Errors
    /// [`HiddenError`], such as [`HiddenError::Walking`].
    pub fn on_walker(&self, joints: &[J]) -> Result<Vec<HiddenEffect<J>>, HiddenError> {
        if NOT_WALKING.contains(&self.kind) {
            return Err(HiddenError::Walking(self.kind.name()));
        }
        self.places(joints)
    }

    fn places(&self, joints: &[J]) -> Result<Vec<HiddenEffect<J>>, HiddenError> {
        let all = |can: fn(&J) -> bool| joints.iter().filter(move |j| can(j)).cloned().map(Some);
        let places: Vec<Option<J>> = match (&self.joint, self.kind.description().scope) {
            (None, _) if self.on_base => vec![None],
            (Some(joint), _) => vec![Some(joint.clone())],
            (None, Scope::Base) => vec![None],
            (None, Scope::Joint) => all(|_| true).collect(),
            (None, Scope::Pair) => all(J::is_carried).collect(),
            (None, Scope::Foot) => all(J::bears_foot).collect(),
        };
        let at = |joint| {
            let effect = HiddenEffect::new(self.kind, joint, self.value)?;
            let mut others = self.others.iter();
            others.try_fold(effect, |effect, (name, value)| effect.with(name, *value))
        };
        places.into_iter().map(at).collect()
    }
}

impl FromStr for Hide {
    type Err = HiddenError;

    /// On a Go2.
    fn from_str(text: &str) -> Result<Self, HiddenError> {
        Self::parse(text, &JointId::all().collect::<Vec<_>>())
    }
}

fn number(text: &str) -> Result<f64, HiddenError> {
    text.parse()
        .map_err(|_| HiddenError::Number(text.to_owned()))
}

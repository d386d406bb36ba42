//! What `--hide` says: an effect of the simulator, or a torque by a formula.

use proprio_core::go2::{JointId, Leg};
use proprio_simulator::{
    CoupledTorque, Description, EffectParameter, HiddenEffect, HiddenError, HiddenKind, Hide,
    OwnHidden, Scope,
};

use clap::error::ErrorKind;
use proprio_simulator::poses::PoseKind;

use super::super::usage_error;
use super::parse_hide;
use crate::formula::{FormulaError, Instant, Names, coupled_torque, over_time, torque};

/// What `--hide` says.
#[derive(Debug, Clone)]
pub(super) enum Hidden {
    /// An effect that the simulator has.
    Effect(Hide),
    /// A torque at these joints.
    Formula(HiddenKind, Vec<JointId>),
}

/// What `--hide` says, as it was written: an arm's poses have other effects and other joints than a Go2's logs.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    /// As written.
    pub(super) text: String,
    /// As a Go2's, or why it is none.
    parsed: Result<Hidden, String>,
}

impl Asked {
    /// Refuses nothing that poses or frequency responses may hide.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let parsed = parse(text);
        let name = text.split(['=', ':']).next().unwrap_or_default();
        let of_poses = PoseKind::ALL.iter().any(|(known, _)| *known == name)
            || super::frf::HIDDEN.contains(&name);
        match parsed {
            Err(message) if !of_poses => Err(message),
            parsed => Ok(Self {
                text: text.to_owned(),
                parsed,
            }),
        }
    }

    /// As a Go2's; ends the program where it is none.
    pub(super) fn hidden(&self) -> &Hidden {
        match &self.parsed {
            Ok(hidden) => hidden,
            Err(message) => {
                let message = format!(
                    "invalid value '{}' for '--hide <EFFECT[:JOINT]=VALUE[,NAME=VALUE...]>': {message}",
                    self.text
                );
                usage_error("simulate", ErrorKind::ValueValidation, message)
            }
        }
    }
}

/// `EFFECT[:JOINT]=VALUE…` or `JOINT[,JOINT…]: FORMULA`.
pub(super) fn parse(text: &str) -> Result<Hidden, String> {
    let parts = text.split_once(':').and_then(|(joints, formula)| {
        let joints = joints
            .split(',')
            .map(|name| JointId::from_name(name.trim()));
        Some((joints.collect::<Option<Vec<_>>>()?, formula.trim()))
    });
    match parts {
        Some((joints, formula)) => Ok(Hidden::Formula(kind(formula, &joints)?, joints)),
        None => parse_hide(text).map(Hidden::Effect),
    }
}

/// The formula as an effect that the simulator can have, once.
fn kind(text: &str, joints: &[JointId]) -> Result<HiddenKind, String> {
    let refused = |error: FormulaError| error.to_string();
    // Names of other joints are of one leg.
    let limb = joints.first().map(|joint| JointId::of(joint.leg()));
    let limb = limb.map(|limb| limb.map(JointId::name));
    let own = joints.first().map_or(0, |joint| joint.place());
    let names = limb.as_ref().map(|joints| Names { joints, own });
    let is_one = joints.len() == 1;
    let coupled = match names.filter(|_| is_one) {
        Some(names) => coupled_torque(text, names).map_err(refused)?,
        None => None,
    };
    let alone = match coupled {
        Some(_) => "0",
        None => text,
    };
    let torque = torque(alone).map_err(refused)?;
    let times = EffectParameter::within("times", "1", 1.0, f64::NEG_INFINITY, f64::INFINITY);
    // As long as the program runs, as the simulator asks of what a program brings.
    let own = OwnHidden {
        description: Description {
            name: String::from(text).leak(),
            words: "a torque by a formula",
            scope: Scope::Joint,
            parameters: vec![times].leak(),
            in_catalogue: false,
        },
        torque: Box::leak(Box::new(
            move |values: &[f64], seen: &proprio_simulator::Instant| {
                values[0]
                    * torque(&Instant {
                        q: seen.q,
                        dq: seen.dq,
                        transmitted: seen.transmitted,
                        temperature: seen.temperature,
                        t: seen.t,
                    })
            },
        )),
        coupled: coupled.map(|coupled| -> &'static CoupledTorque {
            Box::leak(Box::new(
                move |values: &[f64], own: [f64; 2], carrier: [f64; 2]| {
                    coupled(own, carrier).map(|torque| values[0] * torque)
                },
            ))
        }),
    };
    Ok(HiddenKind::Own(Box::leak(Box::new(own))))
}

impl Hidden {
    /// The joints that it names.
    pub(super) fn joints(&self) -> Vec<JointId> {
        match self {
            Self::Effect(hide) => hide.joint().into_iter().collect(),
            Self::Formula(_, joints) => joints.clone(),
        }
    }

    /// Why it is of no other motion, if it is over time.
    pub(super) fn over_time(&self) -> Option<FormulaError> {
        match self {
            Self::Effect(_) => None,
            // The formula is its name.
            Self::Formula(kind, _) => over_time(kind.description().name),
        }
    }

    /// The effects that it asks for on a robot with these legs, which hangs or walks.
    pub(super) fn on(&self, legs: &[Leg], walks: bool) -> Result<Vec<HiddenEffect>, HiddenError> {
        match self {
            Self::Effect(hide) if walks => hide.on_walker(),
            Self::Effect(hide) => hide.on(legs),
            Self::Formula(kind, joints) => (joints.iter())
                .map(|joint| HiddenEffect::new(*kind, Some(*joint), 1.0))
                .collect(),
        }
    }
}

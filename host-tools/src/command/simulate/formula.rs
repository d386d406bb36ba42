//! What `--hide` says: an effect of the simulator, or a torque by a formula.

use proprio_simulator::{
    CoupledTorque, Description, EffectParameter, HiddenEffect, HiddenError, HiddenJoint,
    HiddenKind, Hide, OwnHidden, Scope,
};

use super::hide_on;
use crate::formula::{FormulaError, Instant, Names, coupled_torque, over_time, torque};

/// What `--hide` says of a robot with such joints.
#[derive(Debug, Clone)]
pub(super) enum Hidden<J> {
    /// An effect that the simulator has.
    Effect(Hide<J>),
    /// A torque at these joints.
    Formula(HiddenKind, Vec<J>),
}

/// `EFFECT[:JOINT]=VALUE…` or `JOINT[,JOINT…]: FORMULA`, of a robot with these joints.
pub(super) fn parse<J: HiddenJoint>(text: &str, joints: &[J]) -> Result<Hidden<J>, String> {
    let named = |name: &str| joints.iter().find(|joint| joint.to_string() == name);
    let parts = text.split_once(':').and_then(|(names, formula)| {
        let own = names.split(',').map(|name| named(name.trim()).cloned());
        Some((own.collect::<Option<Vec<_>>>()?, formula.trim()))
    });
    match parts {
        Some((joints, formula)) => Ok(Hidden::Formula(kind(formula, &joints)?, joints)),
        None => hide_on(text, joints).map(Hidden::Effect),
    }
}

/// The formula as an effect that the simulator can have, once.
fn kind<J: HiddenJoint>(text: &str, joints: &[J]) -> Result<HiddenKind, String> {
    let refused = |error: FormulaError| error.to_string();
    let coupled = match joints {
        // Names of other joints are of one joint's limb.
        [joint] => {
            let (limb, own) = joint.limb();
            let joints: Vec<&str> = limb.iter().map(|name| &**name).collect();
            let names = Names {
                joints: &joints,
                own,
            };
            coupled_torque(text, names).map_err(refused)?
        }
        _ => None,
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

impl<J: HiddenJoint> Hidden<J> {
    /// Why it is of no other motion, if it is over time.
    pub(super) fn over_time(&self) -> Option<FormulaError> {
        match self {
            Self::Effect(_) => None,
            // The formula is its name.
            Self::Formula(kind, _) => over_time(kind.description().name),
        }
    }

    /// The effects that it asks for, those of the simulator where `on` says.
    pub(super) fn on(
        &self,
        on: impl Fn(&Hide<J>) -> Result<Vec<HiddenEffect<J>>, HiddenError>,
    ) -> Result<Vec<HiddenEffect<J>>, HiddenError> {
        match self {
            Self::Effect(hide) => on(hide),
            Self::Formula(kind, joints) => (joints.iter())
                .map(|joint| HiddenEffect::new(*kind, Some(joint.clone()), 1.0))
                .collect(),
        }
    }
}

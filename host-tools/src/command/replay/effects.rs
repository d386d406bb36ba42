//! Effects on a running device: what it finds of each, and what it is asked to add or drop.

use std::fmt;

use crate::device::names::{self, place};
use crate::model::UnknownName;
use crate::parameter;
use crate::table::{Table, with_std};
use proprio_core::effect::EffectKind;
use proprio_core::go2::{JointId, Leg};
use proprio_core::wire::{Action, Diagnosis, EffectAt, Hello, Outcome};
use serde::Serialize;

use crate::command::Error;

/// Candidates of a joint that the table shows.
const SHOWN: usize = 2;

/// An effect to be added or dropped before the log is played.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wish {
    add: bool,
    effect: EffectKind,
    joint: JointId,
}

/// What became of a wish.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    change: &'static str,
    effect: &'static str,
    joint: &'static str,
    outcome: &'static str,
}

/// What the device found last of an effect at a joint.
#[derive(Debug, Serialize)]
pub(super) struct Found {
    pub(super) joint: &'static str,
    effect: &'static str,
    /// The device estimates it; else it is a candidate.
    active: bool,
    windows: u32,
    /// 1 − squared error with / without the effect, on held-out data.
    held_out_gain: f32,
    held_out_gain_error: f32,
    value: f64,
    std: f64,
    unit: &'static str,
}

/// The wishes of `EFFECT[:JOINT]`; without a joint, at every joint of `legs`.
pub(super) fn wishes(add: bool, text: &str, legs: &[Leg]) -> Result<Vec<Wish>, Error> {
    let (effect, joint) = match text.split_once(':') {
        Some((effect, joint)) => (effect, Some(joint)),
        None => (text, None),
    };
    let known = || EffectKind::ALL.iter().map(|effect| effect.name());
    let effect =
        EffectKind::from_name(effect).ok_or_else(|| UnknownName::new("effect", effect, known()))?;
    let joints = || legs.iter().flat_map(|&leg| JointId::of(leg));
    let wanted: Vec<JointId> = match joint {
        None => joints().collect(),
        Some(name) => {
            let found = joints().find(|joint| joint.name() == name);
            let names = joints().map(JointId::name);
            vec![found.ok_or_else(|| UnknownName::new("joint", name, names))?]
        }
    };
    let wish = |joint| Wish { add, effect, joint };
    Ok(wanted.into_iter().map(wish).collect())
}

impl Wish {
    /// As the device is asked.
    pub(super) fn action(&self, hello: &Hello) -> Result<Action, Error> {
        let name = self.effect.name();
        let effect = names::kept(self.effect, hello)
            .map_err(|kept| Error::NotOnDevice { effect: name, kept })?;
        let at = EffectAt {
            leg: self.joint.leg().index() as u8,
            joint: self.joint.place() as u8,
            effect,
        };
        Ok(match self.add {
            true => Action::AddEffect(at),
            false => Action::DropEffect(at),
        })
    }
}

impl Answer {
    pub(super) fn new(action: &Action, outcome: Outcome, hello: &Hello) -> Option<Self> {
        let (change, at) = match action {
            Action::AddEffect(at) => ("add", at),
            Action::DropEffect(at) => ("drop", at),
            Action::Reset
            | Action::SetMemory(_)
            | Action::SetEffectPrior(..)
            | Action::SetBodyPrior(_)
            | Action::SetLegs(_)
            | Action::SetPositions(_)
            | Action::SetZero(_)
            | Action::TrustZeros
            | Action::TrustWiring
            | Action::SetUp(_)
            | Action::Keep => return None,
        };
        let (joint, effect) = place(at, hello)?;
        Some(Self {
            change,
            effect: effect.name(),
            joint: joint.name(),
            outcome: match outcome {
                Outcome::Accepted => "accepted",
                Outcome::AlreadyActive => "already active",
                Outcome::NotActive => "not active",
                Outcome::NoSuchLeg => "no such leg",
                Outcome::NoSuchJoint => "no such joint",
                Outcome::NoSuchEffect => "no such effect",
                Outcome::OutOfRange => "out of range",
                Outcome::NotHeard => "its motor does not answer",
                Outcome::Moves => "it moves",
                Outcome::NoZero => "no zero is kept",
                Outcome::NoTrial => "no leg is on trial",
                Outcome::NoStorage => "no storage",
            },
        })
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            change,
            effect,
            joint,
            outcome,
        } = self;
        writeln!(f, "{change} {effect}:{joint}: {outcome}")
    }
}

/// The last that was told of each effect at each joint, the joints in the robot's order, each joint's best first.
pub(super) fn found(diagnoses: &[Diagnosis], hello: &Hello) -> Vec<Found> {
    let mut last: Vec<&Diagnosis> = Vec::new();
    for diagnosis in diagnoses {
        match last.iter_mut().find(|known| known.at == diagnosis.at) {
            Some(known) => *known = diagnosis,
            None => last.push(diagnosis),
        }
    }
    last.sort_by(|a, b| {
        let joint = |d: &Diagnosis| (d.at.leg, d.at.joint);
        joint(a).cmp(&joint(b)).then(b.gain.total_cmp(&a.gain))
    });
    let found = last.into_iter().filter_map(|diagnosis| {
        let (joint, effect) = place(&diagnosis.at, hello)?;
        Some(Found {
            joint: joint.name(),
            effect: effect.name(),
            active: diagnosis.active,
            windows: diagnosis.windows,
            held_out_gain: diagnosis.gain,
            held_out_gain_error: diagnosis.gain_error,
            value: diagnosis.value.into(),
            std: diagnosis.std.into(),
            unit: parameter::unit(effect),
        })
    });
    found.collect()
}

/// Each joint's best candidates, and the active effects that bring nothing.
pub(super) fn table(found: &[Found]) -> Table {
    let mut table = Table::default();
    let heading = ["joint", "effect", "", "held-out gain", "value", "unit"];
    table.row(heading.map(str::to_owned));
    let (mut joint, mut shown) = ("", 0);
    for found in found {
        if found.joint != joint {
            (joint, shown) = (found.joint, 0);
        }
        let useless = found.active && found.held_out_gain <= 0.0;
        if !useless && (found.active || shown == SHOWN) {
            continue;
        }
        shown += usize::from(!found.active);
        let percent = |x: f32| 100.0 * f64::from(x);
        let gain = with_std(
            percent(found.held_out_gain),
            percent(found.held_out_gain_error),
        );
        table.row([
            found.joint.to_owned(),
            found.effect.to_owned(),
            if found.active { "active" } else { "candidate" }.to_owned(),
            format!("{gain} %"),
            with_std(found.value, found.std),
            found.unit.to_owned(),
        ]);
    }
    table
}

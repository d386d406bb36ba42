//! `proprio export`: a model into the files of simulators.

use std::path::PathBuf;

use crate::catalogue;
use crate::model::export::{Exported, mjcf, urdf};
use crate::model::{Model, Robot};
use crate::output;
use crate::summary::{joints_in_words, wrapped};
use clap::{ArgGroup, Args};
use serde::Serialize;

use super::Error;
use super::add::joint_names;
use super::result::result;

/// Write a model for simulators: URDF or MJCF
///
/// Identified inertias go into the file given, and with them damping, friction and limits of effort (URDF) or armature, damping,
/// frictionloss, springs, couplings and actuatorfrcrange (MJCF); nothing else in it changes. Without a file a whole one is written.
#[derive(Debug, Args)]
#[command(
    group = ArgGroup::new("format").required(true).args(["urdf", "mjcf"]),
    after_help = "Examples:
  proprio export -m go2.toml --urdf -o identified.urdf
  proprio export -m go2.toml --mjcf scene/go2.xml -o scene/identified.xml"
)]
pub(crate) struct Export {
    /// The model file
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// As URDF, written into IN [default: the URDF the model is of; a whole file for the built-in Go2]
    #[arg(long, value_name = "IN", num_args = 0..=1)]
    urdf: Option<Option<PathBuf>>,
    /// As MJCF, written into IN [default: a whole file]
    #[arg(long, value_name = "IN", num_args = 0..=1)]
    mjcf: Option<Option<PathBuf>>,
    /// Write a model that has formulas over the time `t` too: what else it has may hold for a part of their log only
    #[arg(long)]
    with_time: bool,
    /// Where the result goes; may be IN [default: standard output]
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `export` reports.
#[derive(Debug, Serialize)]
struct Report {
    output: Option<PathBuf>,
    /// Bodies written.
    bodies: Vec<String>,
    /// Joints whose origins were corrected.
    origins: Vec<String>,
    /// Effects written.
    effects: Vec<String>,
    /// What the format cannot state.
    notes: Vec<String>,
    /// The file's text, if it went nowhere else.
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
}

impl Export {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = Model::load(&self.model)?;
        if !self.with_time {
            refuse_time(&model)?;
        }
        let Exported {
            text,
            bodies,
            origins,
            effects,
            notes,
        } = match (&self.urdf, &self.mjcf) {
            (Some(input), _) => urdf(&model, input.as_deref())?,
            (None, input) => mjcf(&model, input.iter().flatten().next().map(PathBuf::as_path))?,
        };
        if let Some(path) = &self.output {
            output::write(path, &text)?;
        }
        if self.json {
            let text = self.output.is_none().then_some(text);
            let output = self.output;
            return Ok(result(
                "export",
                &Report {
                    output,
                    bodies,
                    origins,
                    effects,
                    notes,
                    text,
                },
            ));
        }
        for note in together(&notes, model.robot()) {
            eprint!("{}", wrapped(&format!("note: {note}"), "", "  "));
        }
        Ok(match self.output {
            Some(path) => {
                let counts = [
                    (bodies.len(), ["body", "bodies"]),
                    (origins.len(), ["joint origin", "joint origins"]),
                    (effects.len(), ["effect", "effects"]),
                ];
                let some = counts.into_iter().filter(|(n, _)| *n > 0);
                let counts: Vec<String> = some
                    .map(|(n, [one, many])| format!("{n} {}", if n == 1 { one } else { many }))
                    .collect();
                let what = match counts.is_empty() {
                    true => "no body and no effect, for none has a value".to_owned(),
                    false => counts.join(", "),
                };
                format!("Wrote {}: {what}.\n", path.display())
            }
            None => text,
        })
    }
}

/// Refuses a model with a formula over time.
fn refuse_time(model: &Model) -> Result<(), Error> {
    let over_time = model.effects().iter().find_map(|e| {
        let at = catalogue::formula_of(e.effect)?.over_time()?;
        Some((e, at))
    });
    match over_time {
        None => Ok(()),
        Some((e, at)) => Err(Error::OverTime {
            effect: format!("{}:{}", e.effect.name(), model.joint_name(e.joint)),
            at,
        }),
    }
}

/// An effect and its joints.
type Joints<'a> = (&'a str, Vec<String>);

/// Notes of effects that are left out for the same reason, as one: `bias (all joints), velocity_gain (FR_hip) are left out: …`.
fn together(notes: &[String], robot: &Robot) -> Vec<String> {
    const LEFT_OUT: &str = " is left out: ";
    let all = joint_names(robot);
    let mut told: Vec<String> = Vec::new();
    let mut reasons: Vec<(&str, Vec<Joints>)> = Vec::new();
    for note in notes {
        let place = note.split_once(LEFT_OUT).and_then(|(place, reason)| {
            let (effect, joint) = place.split_once(':')?;
            Some((effect, joint.to_owned(), reason))
        });
        let Some((effect, joint, reason)) = place else {
            told.push(note.clone());
            continue;
        };
        let known = reasons.iter().position(|(known, _)| *known == reason);
        let n = known.unwrap_or_else(|| {
            reasons.push((reason, Vec::new()));
            reasons.len() - 1
        });
        let effects = &mut reasons[n].1;
        match effects.iter_mut().find(|(known, _)| *known == effect) {
            Some((_, joints)) => joints.push(joint),
            None => effects.push((effect, vec![joint])),
        }
    }
    told.extend(reasons.into_iter().map(|(reason, effects)| {
        let one =
            |(effect, joints): Joints| format!("{effect} ({})", joints_in_words(&joints, &all));
        let list: Vec<String> = effects.into_iter().map(one).collect();
        format!("left out: {}: {reason}", list.join(", "))
    }));
    told
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_for_one_reason_is_one_note() {
        let robot = Robot::go2();
        let calves = ["FR", "FL", "RR", "RL"];
        let mut notes: Vec<String> = (calves.iter())
            .map(|leg| format!("bias:{leg}_calf is left out: MJCF has no word for it"))
            .collect();
        notes.push("delay:FR_hip is left out: MJCF has no word for it".to_owned());
        notes.push("the base is fixed".to_owned());
        assert_eq!(
            together(&notes, &robot),
            [
                "the base is fixed",
                "left out: bias (all calves), delay (FR_hip): MJCF has no word for it"
            ]
        );
    }
}

//! `proprio add`: effects into a model file.

use std::path::PathBuf;

use crate::catalogue;
use crate::model::{Model, Robot};
use crate::summary::{places_in_words, wrapped};
use clap::Args;
use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::Error;
use super::result::result;

/// Add effects to a model file
///
/// The file is made from the default model, the Go2's rigid body, if it does not exist. What is added has no value until
/// it is identified; `compare` then fits it, and shows the error before and after. Without JOINT an effect is added at every
/// joint of the robot. --help lists the effects.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct Add {
    /// Effects of the catalogue, each at one joint, at several (`bias:hip,knee`) or at all; or a torque of your own, `JOINT: FORMULA`
    #[arg(value_name = "EFFECT[:JOINT]", required = true)]
    effects: Vec<String>,
    /// The model file
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// The robot of a model file that does not exist yet [default: the Go2]
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// With --urdf: a joint that does not move and is not recorded, and where it is held, rad or m
    #[arg(long, value_name = "JOINT=POSITION", value_parser = held, requires = "urdf")]
    hold: Vec<(String, f64)>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// `finger=0.02`.
fn held(text: &str) -> Result<(String, f64), String> {
    let (joint, position) = text.split_once('=').ok_or("write JOINT=POSITION")?;
    let position: f64 = position
        .parse()
        .map_err(|_| format!("`{position}` is not a number"))?;
    if !position.is_finite() {
        return Err(format!("`{position}` is no position"));
    }
    Ok((joint.to_owned(), position))
}

const EXAMPLES: &str = "Examples:
  proprio add viscous coulomb -m go2.toml
  proprio add armature:FR_calf bias:FR_hip -m go2.toml --json
  proprio add 'FR_calf: c*sin(3*q)*sign(dq)' -m go2.toml
  proprio add 'cable = RL_thigh: k*max(q - q0, 0)' -m go2.toml
  proprio add coulomb -m arm.toml --urdf arm.urdf --hold finger=0.02";

/// Examples, then every effect of the catalogue.
fn long_help() -> String {
    let mut text = format!("{EXAMPLES}\n\nEffects:\n");
    for effect in catalogue::effects().map(EffectKind::description) {
        text += &format!("  {}\n      {}\n", effect.name, effect.words);
    }
    text.trim_end().to_owned()
}

/// What `add` reports.
#[derive(Debug, Serialize)]
struct Report {
    model: PathBuf,
    /// Whether the file is new.
    created: bool,
    /// `EFFECT:JOINT` that the model did not have.
    added: Vec<String>,
    /// Those it had.
    present: Vec<String>,
    /// What of a new robot was taken otherwise than its URDF has it.
    notes: Vec<String>,
    /// The robot's joints, in its order.
    #[serde(skip)]
    joints: Vec<String>,
}

impl Add {
    pub(crate) fn run(self) -> Result<String, Error> {
        let created = !self.model.exists();
        let mut model = match &self.urdf {
            Some(_) if !created => return Err(Error::RobotIsSet(self.model)),
            None if !created => Model::load(&self.model)?,
            Some(urdf) => Model::new(Robot::from_urdf_held(urdf, &self.hold)?),
            None => Model::default(),
        };
        let mut places = Vec::new();
        for text in &self.effects {
            places.extend(model.asked(text)?);
        }
        let new = model.add_last(&places);
        let name =
            |&(effect, joint): &Place| format!("{}:{}", effect.name(), model.joint_name(joint));
        let added: Vec<String> = new.iter().map(name).collect();
        let mut present: Vec<String> = Vec::new();
        for place in places.iter().filter(|place| !new.contains(place)).map(name) {
            if !present.contains(&place) {
                present.push(place);
            }
        }
        if created || !added.is_empty() {
            model.save(&self.model)?;
        }
        let notes = if created {
            model.robot().notes().to_vec()
        } else {
            Vec::new()
        };
        let report = Report {
            model: self.model,
            created,
            added,
            present,
            notes,
            joints: joint_names(model.robot()),
        };
        Ok(if self.json {
            result("add", &report)
        } else {
            report.to_string()
        })
    }
}

/// The names of a robot's joints, in its order.
pub(super) fn joint_names(robot: &Robot) -> Vec<String> {
    let bodies = robot.bodies().iter();
    bodies.map(|body| body.name.clone()).collect()
}

/// An effect at a joint.
type Place = (EffectKind, usize);

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.model.display();
        if self.created {
            writeln!(f, "{path} is new.")?;
        }
        for note in &self.notes {
            writeln!(f, "Note: {note}.")?;
        }
        if !self.added.is_empty() {
            let added = places_in_words(&self.added, &self.joints);
            let added = format!("Added to {path}: {added}");
            write!(f, "{}", wrapped(&added, "", "  "))?;
        }
        if !self.present.is_empty() {
            let rest = places_in_words(&self.present, &self.joints);
            let present = format!("Already in {path}, unchanged: {rest}");
            write!(f, "{}", wrapped(&present, "", "  "))?;
        }
        Ok(())
    }
}

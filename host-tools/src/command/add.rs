//! `proprio add`: effects into a model file.

use std::path::PathBuf;

use clap::Args;
use proprio::model::{Model, Robot, UnknownName};
use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::{Error, json};

/// Add effects to a model file
///
/// The file is made from the default model, the Go2's rigid body, if it does not exist. What is added has no value until
/// it is identified. Without JOINT an effect is added at every joint of the robot.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio add viscous coulomb -m go2.toml
  proprio add armature:FR_calf bias:FR_hip -m go2.toml --json
  proprio add coulomb -m arm.toml --urdf arm.urdf")]
pub(crate) struct Add {
    /// Effects of the catalogue (`proprio add --help` lists them)
    #[arg(value_name = "EFFECT[:JOINT]", required = true)]
    effects: Vec<String>,
    /// The model file
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// The robot of a model file that does not exist yet [default: the Go2]
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
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
}

impl Add {
    pub(crate) fn run(self) -> Result<String, Error> {
        let created = !self.model.exists();
        let mut model = match &self.urdf {
            Some(_) if !created => return Err(Error::RobotIsSet(self.model)),
            None if !created => Model::load(&self.model)?,
            Some(urdf) => Model::new(Robot::from_urdf(urdf)?),
            None => Model::default(),
        };
        let (mut added, mut present) = (Vec::new(), Vec::new());
        for text in &self.effects {
            let (effect, joints) = parse(text, model.robot())?;
            for joint in joints {
                let name = format!("{}:{}", effect.name(), model.joint_name(joint));
                if model.add_effect(effect, joint) {
                    added.push(name);
                } else if !added.contains(&name) && !present.contains(&name) {
                    present.push(name);
                }
            }
        }
        if created || !added.is_empty() {
            model.save(&self.model)?;
        }
        let report = Report {
            model: self.model,
            created,
            added,
            present,
        };
        Ok(if self.json {
            json(&report)
        } else {
            report.to_string()
        })
    }
}

/// The effect and joints of `EFFECT[:JOINT]`.
fn parse(text: &str, robot: &Robot) -> Result<(EffectKind, Vec<usize>), UnknownName> {
    let (effect, joint) = match text.split_once(':') {
        Some((effect, joint)) => (effect, Some(joint)),
        None => (text, None),
    };
    let effect = EffectKind::from_name(effect).ok_or_else(|| {
        UnknownName::new("effect", effect, EffectKind::ALL.iter().map(|e| e.name()))
    })?;
    Ok((effect, robot.place(effect, joint)?))
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.model.display();
        if self.created {
            writeln!(f, "{path} is new.")?;
        }
        if !self.added.is_empty() {
            writeln!(f, "Added to {path}: {}", self.added.join(", "))?;
        }
        if !self.present.is_empty() {
            let rest = self.present.join(", ");
            writeln!(f, "Already in {path}, unchanged: {rest}")?;
        }
        Ok(())
    }
}

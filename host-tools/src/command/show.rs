//! `proprio show`: what a model file says.

use std::path::{Path, PathBuf};

use crate::model::{BASE, Model, Source, Witnessed};
use crate::summary::{Summary, joints_in_words, typed};
use crate::table::{self, RangeValue, Table, with_std};
use clap::Args;
use serde::Serialize;

use super::Error;
use super::result::result;

/// Show a model file
///
/// The robot, its effects with their values, the bodies that differ from the CAD, and from which logs they were identified.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio show go2.toml
  proprio show go2.toml --verbose
  proprio show go2.toml --json")]
pub(crate) struct Show {
    /// The model file
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Print each joint's values
    #[arg(short, long)]
    verbose: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Kinds of effects that the first screen has room for.
const KINDS: usize = 8;

/// What `show` reports.
#[derive(Debug, Serialize)]
struct Report {
    model: PathBuf,
    robot: String,
    /// `built in`, or the URDF.
    source: String,
    limbs: Vec<Limb>,
    effects: Vec<Effect>,
    /// What several witnesses measured.
    witnesses: Vec<Witnessed>,
    bodies: Vec<Body>,
    /// Joints whose frames are corrected.
    corrected: Vec<String>,
    /// Joints that are held, and where, rad or m.
    held: Vec<Held>,
    /// What was taken otherwise than the URDF has it.
    notes: Vec<String>,
    logs: Vec<String>,
    command: Option<String>,
}

#[derive(Debug, Serialize)]
struct Limb {
    limb: String,
    joints: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Effect {
    effect: &'static str,
    joint: String,
    value: Option<f64>,
    std: Option<f64>,
    unit: &'static str,
}

#[derive(Debug, Serialize)]
struct Body {
    body: String,
    /// Mass, kg, as identified and as the CAD has it.
    mass: f64,
    cad_mass: f64,
}

#[derive(Debug, Serialize)]
struct Held {
    joint: String,
    position: f64,
}

impl Show {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = Model::load(&self.model)?;
        let report = Report::of(self.model, &model);
        Ok(match (self.json, self.verbose) {
            (true, _) => result("show", &report),
            (false, true) => report.to_string(),
            (false, false) => report.screen(),
        })
    }
}

impl Report {
    fn of(path: PathBuf, model: &Model) -> Self {
        let robot = model.robot();
        let name = |joint: usize| model.joint_name(joint).to_owned();
        let limbs = robot.limbs().into_iter().map(|limb| Limb {
            joints: limb.bodies.clone().map(name).collect(),
            limb: limb.name,
        });
        let effects = model.effects().iter().map(|e| Effect {
            effect: e.effect.name(),
            joint: if e.joint == BASE {
                "base".to_owned()
            } else {
                name(e.joint)
            },
            value: e.estimate().map(|estimate| estimate.value),
            std: e.estimate().and_then(|estimate| estimate.std),
            unit: model.unit(e.effect, e.joint, 0),
        });
        let bodies = [BASE].into_iter().chain(0..robot.bodies().len());
        let bodies = bodies.filter(|body| model.is_identified(*body));
        let bodies = bodies.map(|body| Body {
            body: name(body),
            mass: model.inertia(body).mass(),
            cad_mass: match body {
                BASE => robot.base_inertia().mass(),
                _ => robot.bodies()[body].inertia.mass(),
            },
        });
        let provenance = model.provenance();
        Self {
            model: path,
            robot: robot.name().to_owned(),
            source: match robot.source() {
                Source::Go2 => "built in".to_owned(),
                Source::Urdf(urdf) => urdf.display().to_string(),
            },
            limbs: limbs.collect(),
            effects: effects.collect(),
            witnesses: model.witnessed(),
            bodies: bodies.collect(),
            corrected: model.corrected_joints(),
            held: robot
                .held()
                .iter()
                .map(|(joint, position)| Held {
                    joint: joint.clone(),
                    position: *position,
                })
                .collect(),
            notes: robot.notes().to_vec(),
            logs: provenance.map_or_else(Vec::new, |p| {
                p.logs.iter().map(|l| l.path.clone()).collect()
            }),
            command: provenance.map(|p| p.command.clone()),
        }
    }

    /// The first screen: the effects by kind with the range of their values, the bodies, where they are from.
    fn screen(&self) -> String {
        let joints = self.joints();
        let kinds = self.kinds();
        let mut table = Table::default();
        for kind in kinds.iter().take(KINDS) {
            let own: Vec<&Effect> = self.effects.iter().filter(|e| e.effect == *kind).collect();
            let at: Vec<String> = own.iter().map(|e| e.joint.clone()).collect();
            let unit = own.first().map_or("", |effect| effect.unit);
            let unit = if unit == "1" { "" } else { unit };
            table.row([
                (*kind).to_owned(),
                joints_in_words(&at, &joints),
                format!("{} {unit}", range(&own)),
            ]);
        }
        let table = table.to_string();
        let mut rows: Vec<String> = table.lines().map(|line| format!("  {line}")).collect();
        if kinds.len() > KINDS {
            rows.push(format!("  … and {} more", kinds.len() - KINDS));
        }
        let held =
            (self.held.iter()).map(|held| format!("{} is held at {}", held.joint, held.position));
        let notes: Vec<String> = held.chain(self.notes.iter().cloned()).collect();
        let from = self
            .command
            .as_ref()
            .map(|command| format!("from {}: {command}", self.logs.join(", ")));
        let points = (!notes.is_empty())
            .then(|| notes.join("; "))
            .into_iter()
            .chain(self.frames_in_words(&joints))
            .chain(from)
            .chain(self.witnesses.iter().map(ToString::to_string));
        let found = self.logs.iter().all(|log| Path::new(log).exists());
        let logs: Vec<PathBuf> = self.logs.iter().map(PathBuf::from).collect();
        // Logs of a walk are compared as such: the command that made the model said so.
        let is_walk = |word: &str| ["--free-base", "--floating-base"].contains(&word);
        let walked = (self.command.iter()).any(|made| made.split_whitespace().any(is_walk));
        let on_feet = if walked { "--free-base " } else { "" };
        let next = (found && !logs.is_empty()).then(|| {
            format!(
                "proprio compare {on_feet}{}",
                typed(&logs, Some(&self.model))
            )
        });
        let screen = Summary {
            headline: format!(
                "{}: {} ({}), {} joints; {} effects, {} bodies that are not the CAD's",
                self.model.display(),
                self.robot,
                self.source,
                joints.len(),
                kinds.len(),
                self.bodies.len()
            ),
            rows,
            points: points.collect(),
            next: next.into_iter().collect(),
        };
        screen.screen(&[], "--verbose (each joint's values ± 1σ, bodies)")
    }

    /// Which joints' frames are not where the description has them.
    fn frames_in_words(&self, joints: &[String]) -> Option<String> {
        let corrected = joints_in_words(&self.corrected, joints);
        (!self.corrected.is_empty())
            .then(|| format!("joint frames corrected against the description: {corrected}"))
    }

    fn joints(&self) -> Vec<String> {
        (self
            .limbs
            .iter()
            .flat_map(|limb| limb.joints.iter().cloned()))
        .collect()
    }

    /// The kinds of effects, in the file's order.
    fn kinds(&self) -> Vec<&'static str> {
        let mut kinds: Vec<&'static str> = Vec::new();
        for effect in &self.effects {
            if !kinds.contains(&effect.effect) {
                kinds.push(effect.effect);
            }
        }
        kinds
    }

    /// The effects, one line each kind: `coulomb  N m        FR_hip 0.146 ±0.004; not identified yet: FL_hip`.
    fn effect_lines(&self) -> Vec<String> {
        let kinds = self.kinds();
        let width = kinds.iter().map(|kind| kind.len()).max().unwrap_or(0);
        let units = self
            .effects
            .iter()
            .map(|effect| effect.unit.chars().count());
        let unit_width = units.max().unwrap_or(0);
        let line = |kind: &&'static str| {
            let own: Vec<&Effect> = self.effects.iter().filter(|e| e.effect == *kind).collect();
            let unit = own.first().map_or("", |effect| effect.unit);
            format!("  {kind:width$}  {unit:unit_width$}  {}", self.values(&own))
        };
        kinds.iter().map(line).collect()
    }

    /// The values of effects of one kind, and where there is none yet.
    fn values(&self, effects: &[&Effect]) -> String {
        let known: Vec<String> = effects.iter().filter_map(|effect| effect.words()).collect();
        let unknown = effects.iter().filter(|effect| effect.value.is_none());
        let unknown: Vec<&str> = unknown.map(|effect| effect.joint.as_str()).collect();
        let all: usize = self.limbs.iter().map(|limb| limb.joints.len()).sum();
        let unknown = match unknown.len() {
            0 => None,
            n if n == all => Some("not identified yet, at every joint".to_owned()),
            _ => Some(format!("not identified yet: {}", unknown.join(", "))),
        };
        let known = (!known.is_empty()).then(|| known.join(", "));
        known
            .into_iter()
            .chain(unknown)
            .collect::<Vec<_>>()
            .join("; ")
    }
}

/// `0.043–0.211` of those that have a value; how many have none.
fn range(effects: &[&Effect]) -> String {
    let values: Vec<RangeValue> = (effects.iter())
        .filter_map(|effect| {
            Some(RangeValue {
                value: effect.value?,
                std: effect.std,
                at_bound: false,
            })
        })
        .collect();
    match (
        table::range(&values, table::MOST_DECIMALS),
        effects.len() - values.len(),
    ) {
        (None, _) => "not identified yet,".to_owned(),
        (Some(known), 0) => known,
        (Some(known), n) => format!("{known} ({n} not identified yet)"),
    }
}

impl Effect {
    fn words(&self) -> Option<String> {
        let value = self.value?;
        let value = match self.std {
            Some(std) => with_std(value, std),
            None => format!("{value:.4}"),
        };
        Some(format!("{} {value}", self.joint))
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "{}: {} ({})",
            self.model.display(),
            self.robot,
            self.source
        )?;
        for limb in &self.limbs {
            writeln!(f, "  {}: {}", limb.limb, limb.joints.join(", "))?;
        }
        for held in &self.held {
            writeln!(f, "  {} is held at {}", held.joint, held.position)?;
        }
        for note in &self.notes {
            writeln!(f, "  {note}")?;
        }
        if self.effects.is_empty() {
            writeln!(f, "\nNo effects: the rigid body alone.")?;
        } else {
            writeln!(f, "\nEffects:")?;
            self.effect_lines()
                .iter()
                .try_for_each(|line| writeln!(f, "{line}"))?;
        }
        for witnessed in &self.witnesses {
            writeln!(f, "  {witnessed}")?;
        }
        if !self.bodies.is_empty() {
            writeln!(f, "\nBodies of its own (mass, kg; the CAD's):")?;
            for body in &self.bodies {
                writeln!(
                    f,
                    "  {}  {:.4}  ({:.4})",
                    body.body, body.mass, body.cad_mass
                )?;
            }
        }
        if let Some(frames) = self.frames_in_words(&self.joints()) {
            writeln!(f, "\n{frames}")?;
        }
        if let Some(command) = &self.command {
            writeln!(f, "\nFrom {}: {command}", self.logs.join(", "))?;
        }
        Ok(())
    }
}

//! Which of two look-alikes a robot has: told from a first log, and from the motion that is designed to tell them apart.

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{JOINTS_PER_LEG, JointId};
use proprio_host::diagnose::{Diagnosis, diagnose};
use proprio_host::excite::Goal;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::{Followed, HiddenKind, Simulation, Sizes};

use super::condition::designed;
use super::robots::{LEG, PLAIN, SLOW, chirp, log_of, model_with, played, robot, settings};
use super::{Failure, each};

/// Two effects that may be taken for each other, and where.
pub type Pair = (EffectKind, EffectKind, &'static str);

/// The pairs of the study.
pub const PAIRS: [Pair; 4] = [
    (EffectKind::Stribeck, EffectKind::QuadraticDrag, "FR_thigh"),
    (EffectKind::LoadFriction, EffectKind::Coulomb, "FR_thigh"),
    (EffectKind::Payload, EffectKind::Armature, "FR_calf"),
    (EffectKind::Spring, EffectKind::Payload, "FR_thigh"),
];

/// Which of the sizes that a Go2 may have: medium ones, but of a load on a thigh the large one, 0.4 kg. A load is bodies that
/// differ from the CAD's, and the medium one, 0.15 kg on 1.15 kg, is hardly more than the 10 % by which a body may be off: no
/// motion tells that from a body off the CAD.
fn size(effect: EffectKind, joint: JointId) -> usize {
    let is_calf = joint.place() + 1 == JOINTS_PER_LEG;
    match effect {
        EffectKind::Payload if !is_calf => 2,
        _ => 1,
    }
}

/// What a log says of the joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    /// The right name and no other, and the other of the pair is no alternative to it.
    Right,
    /// The right name, and besides another name or the other of the pair as an alternative.
    Both,
    /// Another name, or none.
    Wrong,
}

/// One robot: what the first log says, and the next one.
struct Case {
    pair: Pair,
    truth: EffectKind,
    number: u64,
    told: [Told; 2],
}

/// What the study is about.
#[derive(Debug, Clone)]
pub struct Asked {
    /// Robots of each set for each of the two truths of each pair.
    pub robots: usize,
    /// The number of the first robot of each set.
    pub first_robots: Vec<u64>,
    /// Only pairs with this effect.
    pub pairs_of: Option<String>,
}

/// The study. What is said of a robot that the next log does not tell goes to stderr.
///
/// # Errors
/// No motion, a simulation that diverges.
pub fn study(asked: &Asked) -> Result<String, Failure> {
    let cad = Model::default();
    let first = chirp(SLOW)?;
    let wanted = |effect: EffectKind| {
        let name = asked.pairs_of.as_deref();
        name.is_none_or(|name| name == effect.name())
    };
    let pairs = PAIRS
        .into_iter()
        .filter(|(a, b, _)| wanted(*a) || wanted(*b));
    let pairs: Vec<Pair> = pairs.collect();
    let mut next = Vec::new();
    for (a, b, joint) in &pairs {
        let settings = settings(Goal::Separation {
            effects: [*a, *b],
            joint: Some((*joint).to_owned()),
        });
        next.push(played(&cad, &designed(&[LEG.index()], &settings)?.0)?);
    }
    let numbers = asked.first_robots.iter();
    let numbers: Vec<u64> = numbers.flat_map(|&n| n..n + asked.robots as u64).collect();
    let cases = each("look-alikes", 2 * pairs.len() * numbers.len(), |n| {
        let (pair, which) = (n / (2 * numbers.len()), n / numbers.len() % 2);
        let number = numbers[n % numbers.len()];
        case(pairs[pair], which, number, &first, &next[pair])
    })?;
    report(asked, &pairs, &cases)
}

fn case(
    pair: Pair,
    which: usize,
    number: u64,
    first: &Arc<Followed>,
    next: &Arc<Followed>,
) -> Result<Case, Failure> {
    let (a, b, joint) = pair;
    let (truth, other) = if which == 0 { (a, b) } else { (b, a) };
    let joint = JointId::from_name(joint).ok_or("no such joint")?;
    let robot = with_effect(robot(number), [a, b], truth, joint)?;
    let mut model = model_with(&PLAIN);
    let place = model.robot().joint(joint.name())?;
    for effect in [a, b] {
        model.remove_effect(effect, place);
    }
    let folders = [tempfile::tempdir()?, tempfile::tempdir()?];
    let logs = [
        log_of(&robot, first, folders[0].path())?,
        log_of(&robot, next, folders[1].path())?,
    ];
    let said = |logs: &[PathBuf]| -> Result<Diagnosis, Failure> {
        let recording = Recording::read(logs, &model, |_, _| {})?;
        Ok(diagnose(&recording, &model)?)
    };
    let said = [said(&logs[..1])?, said(&logs[1..])?];
    let told = [0, 1].map(|n| of(&said[n], truth, other, joint));
    if told[1] != Told::Right {
        eprintln!(
            "robot {number}, {} at {joint}: {}",
            truth.name(),
            words(&said[1], joint)
        );
    }
    Ok(Case {
        pair,
        truth,
        number,
        told,
    })
}

/// The steps of a diagnosis, and what is listed beside the effects of a joint.
fn words(diagnosis: &Diagnosis, joint: JointId) -> String {
    let steps = diagnosis.path.iter().map(|step| {
        let sign = if step.removed { "-" } else { "+" };
        format!("{sign}{}:{}", step.effect, step.joints.join("+"))
    });
    let steps: Vec<String> = steps.collect();
    let beside = diagnosis
        .candidates
        .iter()
        .filter(|c| c.significant && c.joints.iter().any(|j| j == joint.name()))
        .map(|c| {
            let others = c.alternatives.iter();
            let others = others.map(|a| format!("{}:{}", a.effect, a.joints.join("+")));
            let others: Vec<String> = others.collect();
            let (gain, value) = (c.held_out_gain, c.value);
            let others = others.join(" ");
            format!(
                "{} (gain {gain:.3}, value {value:.3}; or {others})",
                c.effect
            )
        });
    let beside: Vec<String> = beside.collect();
    format!("path {}; candidates {}", steps.join(" "), beside.join(", "))
}

/// The robot with one effect of the two at the joint, and not the other.
fn with_effect(
    mut robot: Simulation,
    pair: [EffectKind; 2],
    truth: EffectKind,
    joint: JointId,
) -> Result<Simulation, Failure> {
    let names = pair.map(EffectKind::name);
    robot
        .effects
        .retain(|e| !(e.joint() == Some(joint) && names.contains(&e.kind().name())));
    let kind = HiddenKind::from_name(truth.name()).ok_or("the simulator has every effect")?;
    robot
        .effects
        .push(Sizes::of(kind).at(size(truth, joint), joint)?);
    Ok(robot)
}

fn of(diagnosis: &Diagnosis, truth: EffectKind, other: EffectKind, joint: JointId) -> Told {
    let here = |joints: &[String]| joints.iter().any(|j| j == joint.name());
    // What the search has added to the joint and not taken out again.
    let mut named: Vec<&str> = Vec::new();
    for step in diagnosis.path.iter().filter(|step| here(&step.joints)) {
        if step.removed {
            named.retain(|name| *name != step.effect);
        } else {
            named.push(step.effect);
        }
    }
    if !named.contains(&truth.name()) {
        return Told::Wrong;
    }
    let own = diagnosis.candidates.iter();
    let own = own.filter(|c| c.effect == truth.name() && here(&c.joints));
    let mut alternatives = own.flat_map(|c| &c.alternatives);
    let open = alternatives.any(|a| a.effect == other.name() && here(&a.joints));
    match open || named.iter().any(|name| *name != truth.name()) {
        true => Told::Both,
        false => Told::Right,
    }
}

fn report(asked: &Asked, pairs: &[Pair], cases: &[Case]) -> Result<String, Failure> {
    let robots = asked.robots;
    let mut text = format!(
        "{robots} simulated legs of each set of numbers for each truth: typical friction, bodies off the CAD by 6 %, and one effect that the model lacks, of \
         medium size (a load on a thigh, 0.4 kg, of large size: less is within what the CAD leaves open). The first log is a \
         cautious chirp of 10 s (0.1 to {SLOW} Hz, all joints in phase), the next one the motion of `excite --separate` for that \
         pair. Told: at that joint `diagnose` says that the effect is missing and nothing else, and does not list the other of \
         the pair beside it. Last columns: the robots of which the first log did not tell it, and of how many of these the next \
         one does.\n\n\
         | pair | truth | robots | first log: told | next log: told | not told by the first | of these told by the next |\n\
         |---|---|---|---|---|---|---|\n"
    );
    let row = |text: &mut String, name: &str, own: &[&Case]| -> Result<(), Failure> {
        let told = |log: usize| own.iter().filter(|c| c.told[log] == Told::Right).count();
        let open = own.iter().filter(|c| c.told[0] != Told::Right);
        let open: Vec<&&Case> = open.collect();
        let then = open.iter().filter(|c| c.told[1] == Told::Right).count();
        let share = match open.len() {
            0 => "–".to_owned(),
            n => format!("{:.0} %", 100.0 * then as f64 / n as f64),
        };
        Ok(writeln!(
            text,
            "| {name} | {} | {} | {} | {share} |",
            told(0),
            told(1),
            open.len()
        )?)
    };
    for pair in pairs {
        let (a, b, joint) = pair;
        for truth in [a, b] {
            for first in &asked.first_robots {
                let last = first + robots as u64 - 1;
                let is_own = |c: &&Case| {
                    c.pair == *pair && c.truth == *truth && (*first..=last).contains(&c.number)
                };
                let own: Vec<&Case> = cases.iter().filter(is_own).collect();
                let (a, b, truth) = (a.name(), b.name(), truth.name());
                let name = format!("{a}, {b} at {joint} | {truth} | {first}–{last}");
                row(&mut text, &name, &own)?;
            }
        }
    }
    let all: Vec<&Case> = cases.iter().collect();
    row(&mut text, "all | | ", &all)?;
    Ok(text)
}

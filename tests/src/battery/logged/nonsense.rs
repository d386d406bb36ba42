//! Torque that has nothing to do with the motion: whatever explains it looks at the torque.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use proprio_core::effect::EffectKind;
use proprio_host::log::{Channel, LogWriter};
use proprio_host::model::Model;
use proprio_simulator::{HiddenEffect, SimulatedSample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::simulated::model;
use super::verdict;
use crate::battery::case::Case;

/// Size of the square wave and standard deviation of the noise, N m.
const SIZE: f64 = 20.0;
/// Share of such a torque that an effect may explain: what chance leaves of a thousand windows and some forty parameters.
pub const MOST: f64 = 0.05;
/// Longest time between two edges, samples: a quarter of a second.
const LONGEST: usize = 125;
/// Samples of a window: 20 ms at 500 Hz.
const WINDOW: usize = 10;

/// What a joint's torque is replaced by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nonsense {
    /// ±20 N m, edges at random.
    SquareWave,
    /// White, of 20 N m.
    Noise,
    /// Another joint's.
    OtherJoint,
}

impl Nonsense {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::SquareWave, Self::Noise, Self::OtherJoint];
}

/// How much of such a torque one effect explains.
#[derive(Debug, Clone)]
pub struct Explained {
    /// What was put there.
    pub nonsense: Nonsense,
    /// Where.
    pub joint: String,
    /// With which effect beside the four plain ones; none: with them alone.
    pub effect: Option<&'static str>,
    /// 1 − held-out error² / torque², both of means over 20 ms.
    pub r2: f64,
}

/// What each effect of the catalogue explains of nonsense at a place (0 hip, 1 thigh, 2 calf) of a leg. A contact's force is found by a
/// detector, and predicted by nothing.
///
/// # Errors
/// In words.
pub fn explained(
    program: &Path,
    nonsense: Nonsense,
    place: usize,
    seed: u64,
) -> Result<Vec<Explained>, String> {
    let wrong = |error: &dyn std::fmt::Display| format!("{nonsense:?}: {error}");
    let case: Case = format!("complete:FR:{seed}")
        .parse()
        .map_err(|e| wrong(&e))?;
    let simulation = case.simulation();
    let joint = case.leg.joint_names()[place].to_owned();
    let mut samples: Vec<SimulatedSample> = simulation.samples().map_while(Result::ok).collect();
    replace(&mut samples, nonsense, place, seed);
    let folder = tempfile::tempdir().map_err(|e| wrong(&e))?;
    let log = folder.path().join("log.csv");
    write(&log, &simulation.legs, &samples).map_err(|e| wrong(&e))?;
    let known: Vec<String> = case
        .known()
        .effects
        .iter()
        .map(HiddenEffect::place)
        .collect();
    let total = mean_square(&samples, place);
    // A hip turns with no joint before it.
    let robot = Model::default();
    let is_there = |kind: &EffectKind| robot.robot().place(*kind, Some(&joint)).is_ok();
    let kinds = EffectKind::ALL
        .iter()
        .filter(|kind| ![EffectKind::Contact, EffectKind::ElasticHysteresis].contains(kind))
        .filter(|kind| **kind == EffectKind::BaseTilt || is_there(kind));
    let names = std::iter::once(None).chain(kinds.map(|kind| Some(kind.name())));
    let mut explained = Vec::new();
    for effect in names {
        let mut places = known.clone();
        if let Some(effect) = effect {
            let at = if effect == "base_tilt" {
                effect.to_owned()
            } else {
                format!("{effect}:{joint}")
            };
            places.retain(|place| *place != at);
            places.push(at);
        }
        let file = folder.path().join("model.toml");
        std::fs::write(&file, model(&places)).map_err(|e| wrong(&e))?;
        let compared = verdict::held_out(program, &log, &file)?;
        let own = compared.joints.iter().find(|j| j.joint == joint);
        let rms = own.ok_or_else(|| wrong(&"the joint is not compared"))?.rms;
        explained.push(Explained {
            nonsense,
            joint: joint.clone(),
            effect,
            r2: 1.0 - rms * rms / total,
        });
    }
    Ok(explained)
}

fn replace(samples: &mut [SimulatedSample], nonsense: Nonsense, place: usize, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut level, mut left) = (SIZE, 0);
    for sample in samples {
        if left == 0 {
            level = if rng.random_bool(0.5) { SIZE } else { -SIZE };
            left = rng.random_range(1..=LONGEST);
        }
        left -= 1;
        sample.tau[place] = match nonsense {
            Nonsense::SquareWave => level,
            Nonsense::Noise => SIZE * rng.sample::<f64, _>(StandardNormal),
            Nonsense::OtherJoint => sample.tau[(place + 2) % 3],
        };
    }
}

fn write(
    path: &Path,
    legs: &[proprio_core::go2::Leg],
    samples: &[SimulatedSample],
) -> std::io::Result<()> {
    let mut log = LogWriter::with(BufWriter::new(File::create(path)?), legs, &[Channel::Temp])?;
    for s in samples {
        let temperature = s.temp.as_deref().unwrap_or_default();
        log.row_with(s.t, [&s.q, &s.dq, &s.tau], &[temperature])?;
    }
    log.finish().map(|_| ())
}

/// Of the torque's mean over windows, about nothing: N² m².
fn mean_square(samples: &[SimulatedSample], place: usize) -> f64 {
    let windows = samples.chunks_exact(WINDOW);
    let count = windows.len() as f64;
    windows
        .map(|w| w.iter().map(|s| s.tau[place]).sum::<f64>() / WINDOW as f64)
        .map(|mean| mean * mean / count)
        .sum()
}

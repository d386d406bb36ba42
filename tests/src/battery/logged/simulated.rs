//! The battery's cases in noise: complete models and every effect of the catalogue, at each level of the torque's noise.

use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use proprio_host::log::{Channel, LogWriter};
use proprio_simulator::{HiddenEffect, HiddenKind, SIZES, Scope, Sensors, Simulation};
use serde_json::json;

use crate::battery::bound::{Signature, noise};
use crate::battery::case::Case;

/// Standard deviation of the torque's noise, N m, and its memory, s.
const LEVELS: [(f64, f64); 9] = [
    (0.0, 0.0),
    (0.05, 0.0),
    (0.05, 0.02),
    (0.1, 0.0),
    (0.1, 0.01),
    (0.2, 0.0),
    (0.2, 0.005),
    (0.4, 0.0),
    (0.4, 0.01),
];
/// What goes round with the cases, by numbers that share no factor with each other or with the levels: noise of the velocity, rad/s;
/// samples a second; share of repeated samples.
const VELOCITY: [f64; 5] = [0.0, 0.05, 0.01, 0.035, 0.02];
const RATES: [f64; 4] = [500.0, 250.0, 1000.0, 100.0];
const REPEATS: [f64; 7] = [0.0, 0.02, 0.17, 0.0, 0.08, 0.0, 0.01];
/// Complete models at each level: none of a hundred is one in a hundred at most.
const COMPLETE: usize = 100;
/// Joints of a leg.
const PLACES: [&str; 3] = ["FR_hip", "FL_thigh", "RR_calf"];
/// The simulator's own rate, at which [`noise`] counts windows, Hz.
const RATE: f64 = 500.0;

/// A case of the battery in noise.
#[derive(Debug, Clone)]
pub struct NoisyCase {
    case: Case,
    /// Standard deviation, N m; memory, s.
    torque: (f64, f64),
    velocity: f64,
    rate: f64,
    repeats: f64,
}

/// All of them, in their order.
pub fn all() -> Vec<NoisyCase> {
    let mut cases = Vec::new();
    for (level, torque) in LEVELS.into_iter().enumerate() {
        for n in 0..COMPLETE {
            let leg = ["FR", "FL", "RR", "RL"][n % 4];
            let seed = 1000 + n + level * COMPLETE;
            cases.push(NoisyCase::new(&format!("complete:{leg}:{seed}"), torque, n));
        }
        let known = SIZES
            .iter()
            .map(|sizes| sizes.kind.description())
            // A base's recoil is told by all legs, and these logs are of one.
            .filter(|d| d.in_catalogue && d.name != "base_recoil");
        for (k, effect) in known.enumerate() {
            for size in 0..3 {
                let place = match effect.scope {
                    Scope::Joint => PLACES[(k + level + size) % 3],
                    Scope::Pair => PLACES[1 + (k + level + size) % 2],
                    Scope::Foot | Scope::Base => PLACES[2],
                };
                let seed = 1 + k * LEVELS.len() + level;
                let name = format!("{}:{place}:{size}:{seed}", effect.name);
                cases.push(NoisyCase::new(&name, torque, k + size));
            }
        }
    }
    cases
}

/// Writes logs, models and truths of cases to `folder`, two at a time. `progress` hears how many are done.
///
/// # Errors
/// In words, of the first that cannot be written.
pub fn write(
    cases: &[NoisyCase],
    folder: &Path,
    progress: impl Fn(usize) + Sync,
) -> Result<(), String> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
            case.write(folder)?;
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..super::super::THREADS)
            .map(|_| scope.spawn(work))
            .collect();
        let join = |thread: std::thread::ScopedJoinHandle<_>| {
            thread
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads.into_iter().try_for_each(join)
    })
}

impl NoisyCase {
    fn new(name: &str, torque: (f64, f64), n: usize) -> Self {
        Self {
            case: name.parse().expect("names of the battery's cases"),
            torque,
            velocity: VELOCITY[n % VELOCITY.len()],
            rate: RATES[n % RATES.len()],
            repeats: REPEATS[n % REPEATS.len()],
        }
    }

    /// `spring-FR_hip-2-7-0.2w`.
    pub fn name(&self) -> String {
        let colour = if self.torque.1 > 0.0 { "c" } else { "w" };
        let case = self.case.to_string().replace(':', "-");
        format!("{case}-{}{colour}", self.torque.0)
    }

    fn noisy(&self, simulation: Simulation, rate: f64, torque: f64) -> Simulation {
        Simulation {
            rate,
            sensors: Sensors {
                torque_noise: torque,
                torque_memory: self.torque.1,
                velocity_noise: self.velocity,
                repeats: self.repeats,
                ..simulation.sensors
            },
            ..simulation
        }
    }

    /// The hidden effect's size in standard deviations. White noise averages out with the number of samples.
    fn size_over_std(&self) -> Option<f64> {
        if self.case.hidden.is_empty() {
            return None;
        }
        let torque = match self.torque {
            (std, 0.0) => std * (RATE / self.rate).sqrt(),
            (std, _) => std,
        };
        let noise = noise(&self.noisy(self.case.known(), RATE, torque));
        let signature = Signature::new(&self.case, &self.case.hidden);
        Some(signature.bound(&self.case, &noise, &[]).snr)
    }

    /// Writes log, models and truth to `folder`.
    ///
    /// # Errors
    /// In words.
    fn write(&self, folder: &Path) -> Result<(), String> {
        let name = self.name();
        let wrong = |error: &dyn std::fmt::Display| format!("{name}: {error}");
        let simulation = self.noisy(self.case.simulation(), self.rate, self.torque.0);
        let file = File::create(folder.join(format!("{name}.csv"))).map_err(|e| wrong(&e))?;
        let mut log = LogWriter::with(BufWriter::new(file), &simulation.legs, &[Channel::Temp])
            .map_err(|e| wrong(&e))?;
        for sample in simulation.samples() {
            let s = sample.map_err(|e| wrong(&e))?;
            let temperature = s.temp.as_deref().unwrap_or_default();
            log.row_with(s.t, [&s.q, &s.dq, &s.tau], &[temperature])
                .map_err(|e| wrong(&e))?;
        }
        log.finish().map_err(|e| wrong(&e))?;
        let known: Vec<String> = self
            .case
            .known()
            .effects
            .iter()
            .map(HiddenEffect::place)
            .collect();
        let hidden: Vec<String> = self.case.hidden.iter().map(HiddenEffect::place).collect();
        let whole: Vec<String> = known.iter().chain(&hidden).cloned().collect();
        let write = |ending: &str, text: String| {
            std::fs::write(folder.join(format!("{name}{ending}")), text).map_err(|e| wrong(&e))
        };
        write(".toml", model(&known))?;
        write(".true.toml", model(&whole))?;
        write(".json", self.truth(&name).to_string())
    }

    fn truth(&self, name: &str) -> serde_json::Value {
        let hidden = self.case.hidden.first();
        let joint = hidden.and_then(|e| Some(e.joint()?.name()));
        let missing: Vec<_> = (self.case.hidden.iter())
            .map(|e| (e.kind().name(), e.joint().map(|j| j.name())))
            .collect();
        let general = hidden.is_some_and(|e| e.kind() == HiddenKind::AsymmetricCoulomb);
        let equal: Vec<_> = (["coulomb", "bias"].into_iter())
            .filter(|_| general)
            .map(|plain| (plain, joint))
            .collect();
        json!({
            "name": name,
            "effect": hidden.map(|e| e.kind().name()),
            "joint": joint,
            "size": self.case.size,
            "missing": missing,
            "equal": equal,
            "value": hidden.and_then(leading),
            "snr": self.size_over_std(),
            "torque_noise": self.torque.0,
            "torque_memory": self.torque.1,
            "velocity_noise": self.velocity,
            "rate": self.rate,
            "repeats": self.repeats,
        })
    }
}

/// The parameter that `diagnose` calls the value, as the catalogue means it.
fn leading(effect: &HiddenEffect) -> Option<f64> {
    let values = effect.values();
    let first = *values.first()?;
    match effect.kind() {
        // A mean over what it takes for an episode.
        HiddenKind::Contact => None,
        HiddenKind::Elasticity => Some(1.0 / first),
        HiddenKind::Cogging => Some(first * values[1].cos()),
        _ => Some(first),
    }
}

/// A model file of the Go2 that has these effects, without values.
pub fn model(places: &[String]) -> String {
    let mut text =
        String::from("format = 1\n\n[robot]\nbuiltin = \"go2\"\n\n[base]\nmount = \"pinned\"\n");
    for place in places {
        let (effect, joint) = place.split_once(':').unwrap_or((place, "base"));
        let _ = write!(
            text,
            "\n[[effect]]\nname = \"{effect}\"\njoint = \"{joint}\"\n"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_name_of_its_own() {
        let mut names: Vec<String> = all().iter().map(NoisyCase::name).collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    /// Every level of every noise comes with every effect, and none with only some of another.
    #[test]
    fn every_effect_is_there_at_every_level() {
        let cases = all();
        for torque in LEVELS {
            let of = cases.iter().filter(|c| c.torque == torque);
            let mut kinds: Vec<_> = of
                .filter_map(|c| Some(c.case.hidden.first()?.kind().name()))
                .collect();
            kinds.sort_unstable();
            kinds.dedup();
            // Friction inside a gear shows to a second encoder alone, a base's recoil to all legs.
            assert_eq!(kinds.len() + 2, proprio_core::effect::EffectKind::ALL.len());
        }
    }
}

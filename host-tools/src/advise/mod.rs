//! What logs could not tell, in words, and the motion that would; on one screen in `summary`.
//!
//! Of each parameter three standard deviations are compared: before any data, after the logs, and after the best and longest of
//! motions ([`crate::excite::told`]). What lies between the last two is what a better motion can still give.

mod summary;

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::catalogue;
use crate::excite::earlier::{self, EarlierError};
use crate::excite::{Identifiability, told};
use crate::model::{Limb, Model};
use crate::parameter::{self, INERTIAL_NAMES};
use crate::summary::{from_standard_input, typed, word};

/// Share of what can be learned of a parameter at all, as a variance, below which it is open, and from which on it is told.
const OPEN: f64 = 0.5;
const TOLD: f64 = 0.9;
/// What no motion can bring below this share of its prior's standard deviation is no motion's fault.
const STRUCTURAL: f64 = 0.9;
/// What the best and longest of motions brings below this share of its prior's standard deviation is told in full: it is no more
/// than rounding, or far below what any log reaches.
const NOTHING: f64 = 0.01;
/// Most parameters that the command for the next motion names.
const NAMED: usize = 6;
/// A command that is no longer stands on one line of a terminal after `Next: `, columns.
const ONE_LINE: usize = 74;
/// Parameters per limb that the lines at the end of another command name.
const CLOSING: usize = 3;

/// How much of what can be learned of a parameter was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Learned {
    /// Nearly all.
    Identified,
    /// Some.
    InPart,
    /// Little or nothing.
    PriorDominated,
    /// No motion of a limb on a fixed base separates it from others.
    NotIdentifiable,
}

/// What the logs say of a parameter.
#[derive(Debug, Clone, Serialize)]
pub struct Advice {
    /// Its name.
    pub parameter: String,
    /// In one word.
    pub learned: Learned,
    /// Share of the variance that a motion can take away which the logs did.
    pub share: f64,
    /// Standard deviation before any data, in its unit.
    pub prior_std: f64,
    /// After the logs.
    pub std: f64,
    /// After the best and longest of motions.
    pub best_std: f64,
    /// Torque that the standard deviation after the logs leaves open on their motion, if nothing else were: rms over windows, of all
    /// the limb's joints together, N m (sliding joints: N).
    pub torque: f64,
}

/// What the logs say of a limb.
#[derive(Debug, Clone, Serialize)]
pub struct LimbAdvice {
    /// Its name.
    pub limb: String,
    /// Its joints.
    #[serde(skip)]
    pub joints: Vec<String>,
    /// Condition number of the identifiable inertias, scaled as `excite` does.
    pub condition_number: f64,
    /// Parameters: first those of which a motion can still tell more, by the torque that they leave open.
    pub parameters: Vec<Advice>,
    /// The command that fills the gap; none if nothing is open.
    pub command: Option<String>,
}

/// What logs could not tell.
#[derive(Debug, Clone, Serialize)]
pub struct Advised {
    /// Limb by limb.
    pub limbs: Vec<LimbAdvice>,
}

/// Judges what `logs` tell of each of `limbs` that they record; `file` is the model's, for the command that fills the gap.
///
/// # Errors
/// [`EarlierError`]: a log that cannot be read, or none with any of the limbs.
pub fn advise(
    model: &Model,
    file: Option<&Path>,
    limbs: &[Limb],
    logs: &[PathBuf],
    progress: impl FnMut(u64, u64),
) -> Result<Advised, EarlierError> {
    let known = earlier::read(model, limbs, logs, progress)?;
    let mut all = Vec::new();
    for limb in limbs {
        let Some(own) = known.iter().find(|known| known.limb == limb.name) else {
            continue;
        };
        let told = told(model, limb, own)?;
        let mut parameters: Vec<Advice> = told.parameters.iter().map(advice).collect();
        parameters.sort_by(|a, b| {
            let kinds = b.is_open().cmp(&a.is_open());
            kinds.then(b.torque.total_cmp(&a.torque))
        });
        let open: Vec<&Advice> = parameters.iter().filter(|a| a.is_open()).collect();
        all.push(LimbAdvice {
            limb: limb.name.clone(),
            joints: (limb.bodies.clone())
                .map(|body| model.joint_name(body).to_owned())
                .collect(),
            condition_number: told.condition_number,
            command: command(file, &limb.name, &open, logs),
            parameters,
        });
    }
    Ok(Advised { limbs: all })
}

fn advice(told: &Identifiability) -> Advice {
    let square = |x: f64| x * x;
    let can = square(told.prior_std) - square(told.best_std);
    let did = square(told.prior_std) - square(told.std);
    let share = if can > 0.0 {
        (did / can).clamp(0.0, 1.0)
    } else {
        1.0
    };
    let learned = if told.best_std > STRUCTURAL * told.prior_std {
        Learned::NotIdentifiable
    } else if share >= TOLD {
        Learned::Identified
    } else if share >= OPEN {
        Learned::InPart
    } else {
        Learned::PriorDominated
    };
    Advice {
        parameter: told.parameter.clone(),
        learned,
        share,
        prior_std: told.prior_std,
        std: told.std,
        best_std: told.best_std,
        torque: told.torque,
    }
}

/// The motion for the first of the `open` parameters, so many as a line of a terminal holds; none if nothing is open.
fn command(file: Option<&Path>, limb: &str, open: &[&Advice], logs: &[PathBuf]) -> Option<String> {
    let logs = typed(logs, None);
    let model = file.map_or_else(String::new, |file| format!("-m {} ", word(file)));
    let asking = |names: &[&str]| {
        let names = names.join(",");
        format!("proprio excite {model}--legs {limb} --for {names} --from {logs} -o next.csv")
    };
    let names: Vec<&str> = open
        .iter()
        .take(NAMED)
        .map(|a| a.parameter.as_str())
        .collect();
    let fits = |n: &usize| asking(&names[..*n]).chars().count() <= ONE_LINE;
    let most = (1..=names.len()).rev().find(fits).unwrap_or(1);
    (!names.is_empty()).then(|| asking(&names[..most]))
}

impl Advised {
    /// Every parameter, limb by limb.
    pub fn text(&self) -> String {
        self.limbs.iter().map(LimbAdvice::text).collect()
    }

    /// The lines that close what another command says of the same logs; none if they have told all that a motion can.
    pub fn closing(&self) -> String {
        let open: Vec<&LimbAdvice> = self.limbs.iter().filter(|l| l.command.is_some()).collect();
        if open.is_empty() {
            return String::new();
        }
        let mut text =
            "\nNot identified by these logs (`proprio advise` lists each parameter):\n".to_owned();
        for limb in open {
            text += &limb.heading();
            for advice in limb.parameters.iter().filter(|a| a.is_open()).take(CLOSING) {
                text += &format!("  {advice}\n");
            }
            text += &limb.way_on();
        }
        text
    }
}

/// [`Advised::closing`] of logs, for the end of another command's words: empty where nothing can be said of them.
pub fn closing(model: &Model, file: Option<&Path>, logs: &[PathBuf]) -> String {
    if from_standard_input(logs) {
        return String::new();
    }
    let limbs = model.robot().limbs();
    advise(model, file, &limbs, logs, |_, _| {})
        .map_or_else(|_| String::new(), |told| told.closing())
}

impl LimbAdvice {
    /// How many parameters are told and how many not.
    fn heading(&self) -> String {
        let of = |learned| {
            self.parameters
                .iter()
                .filter(|a| a.learned == learned)
                .count()
        };
        format!(
            "{}: {} parameters identified, {} in part, {} prior-dominated; {} not identifiable with a fixed base. Condition number {:.0}.\n",
            self.limb,
            of(Learned::Identified),
            of(Learned::InPart),
            of(Learned::PriorDominated),
            of(Learned::NotIdentifiable),
            self.condition_number,
        )
    }

    /// The command for the next motion, as a line.
    fn way_on(&self) -> String {
        let line = |command| format!("  the motion that identifies more: {command}\n");
        self.command.as_ref().map(line).unwrap_or_default()
    }

    fn text(&self) -> String {
        let mut text = self.heading();
        for advice in &self.parameters {
            text += &format!("  {advice}\n");
        }
        text + &self.way_on()
    }
}

impl Advice {
    /// What it is, and of which joint.
    fn split(&self) -> (&str, &str) {
        (self.parameter.split_once(':')).unwrap_or((self.parameter.as_str(), ""))
    }

    /// Whether the best motion leaves nothing of it open.
    fn is_all_told(&self) -> bool {
        self.best_std <= NOTHING * self.prior_std
    }

    /// Whether a motion can still tell more of it.
    fn is_open(&self) -> bool {
        matches!(self.learned, Learned::PriorDominated | Learned::InPart)
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match self.learned {
            Learned::Identified => "identified",
            Learned::InPart => "in part",
            Learned::PriorDominated => "prior-dominated",
            Learned::NotIdentifiable => "not identifiable alone",
        };
        let best = match self.learned {
            Learned::NotIdentifiable => String::new(),
            _ if self.is_all_told() => "; a long, rich motion identifies all of it".to_owned(),
            _ => format!("; the best motion leaves ±{}", figure(self.best_std)),
        };
        write!(
            f,
            "{:<22} {words:<24} ±{} {} now, ±{} before these logs{best}",
            self.parameter,
            figure(self.std),
            unit_of(&self.parameter),
            figure(self.prior_std)
        )
    }
}

/// A standard deviation in two digits that count.
pub(crate) fn figure(std: f64) -> String {
    if (1e-3..1e3).contains(&std) {
        let decimals = (1.0 - std.log10().floor()).max(0.0) as usize;
        format!("{std:.decimals$}")
    } else {
        format!("{std:.1e}")
    }
}

/// The unit of a parameter by its name, `m:FR_calf`, as a joint that turns has it.
pub(crate) fn unit_of(parameter: &str) -> &'static str {
    let what = parameter.split(':').next().unwrap_or_default();
    let inertial = INERTIAL_NAMES.iter().find(|(name, _)| *name == what);
    let effect = || catalogue::effect_named(what).map_or("", parameter::unit);
    inertial.map_or_else(effect, |(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_of_what_a_motion_can_tell() {
        let of = |prior_std, std, best_std| {
            advice(&Identifiability {
                parameter: "m:FR_calf".to_owned(),
                prior_std,
                std,
                best_std,
                torque: 0.0,
            })
        };
        assert_eq!(of(1.0, 0.1, 0.0).learned, Learned::Identified);
        assert_eq!(of(1.0, 0.98, 0.3).learned, Learned::PriorDominated);
        assert_eq!(of(1.0, 0.55, 0.5).learned, Learned::Identified);
        assert_eq!(of(1.0, 0.6, 0.0).learned, Learned::InPart);
        assert_eq!(of(1.0, 0.99, 0.99).learned, Learned::NotIdentifiable);
    }

    #[test]
    fn advice_is_in_words_and_units() {
        let of = |best_std| {
            let told = Identifiability {
                parameter: "hz:FR_hip".to_owned(),
                prior_std: 1.3e-3,
                std: 1.27e-3,
                best_std,
                torque: 0.0,
            };
            advice(&told).to_string()
        };
        let open = "hz:FR_hip              prior-dominated          ±0.0013 kg m now, ±0.0013 before these logs; ";
        assert_eq!(
            of(2e-14),
            format!("{open}a long, rich motion identifies all of it")
        );
        assert_eq!(of(2.1e-4), format!("{open}the best motion leaves ±2.1e-4"));
    }

    /// As many parameters as there is room for, and one at least.
    #[test]
    fn the_command_fits_a_line() {
        let of = |parameter: &str| Advice {
            parameter: parameter.to_owned(),
            learned: Learned::PriorDominated,
            share: 0.0,
            prior_std: 1.0,
            std: 1.0,
            best_std: 0.1,
            torque: 1.0,
        };
        let all = ["m:FR_thigh", "hz:FR_thigh", "hx:FR_calf"].map(of);
        let open: Vec<&Advice> = all.iter().collect();
        let line = command(None, "FR", &open, &["a b.csv".into()]).unwrap();
        assert_eq!(
            line,
            "proprio excite --legs FR --for m:FR_thigh --from 'a b.csv' -o next.csv"
        );
        assert!(line.chars().count() <= ONE_LINE);
        let long = command(None, "FR", &open, &["a/".repeat(40).into()]).unwrap();
        assert!(long.contains("--for m:FR_thigh --from"), "{long}");
        assert_eq!(command(None, "FR", &[], &["log.csv".into()]), None);
    }
}

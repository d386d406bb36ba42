//! What `proprio` says of a log, by the JSON that scripts rely on (design §7): no other door to the program.

use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use super::truth::{LoggedCase, Place};

/// `diagnose --json`, as far as it is judged.
#[derive(Debug, Clone, Deserialize)]
pub struct Verdict {
    /// `missing`, `complete` or `insufficient`.
    pub verdict: String,
    /// Best first.
    pub candidates: Vec<Candidate>,
    /// The forward selection.
    pub path: Vec<Step>,
    /// Held-out error of the model as given, N m.
    pub held_out_rms: f64,
    /// What is said to be left and explained by no effect.
    pub outside_catalogue: Vec<serde_json::Value>,
    /// By joint.
    pub joints: Vec<JointError>,
}

/// An effect that was tried.
#[derive(Debug, Clone, Deserialize)]
pub struct Candidate {
    effect: String,
    joints: Vec<String>,
    /// Of its leading parameter.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    significant: bool,
    alternatives: Vec<Effect>,
}

/// An effect, where it acts.
#[derive(Debug, Clone, Deserialize)]
pub struct Effect {
    effect: String,
    joints: Vec<String>,
}

/// A step of the selection; the model as given and its values fitted anew have no effect.
#[derive(Debug, Clone, Deserialize)]
pub struct Step {
    step: String,
    effect: Option<String>,
    joints: Vec<String>,
    error: f64,
}

/// A joint's held-out error, N m.
#[derive(Debug, Clone, Deserialize)]
pub struct JointError {
    /// Its name.
    pub joint: String,
    /// With the path's effects.
    pub after: f64,
}

/// `compare --json`, as far as it is judged.
#[derive(Debug, Clone, Deserialize)]
pub struct Compared {
    /// Of all joints, N m.
    pub rms: f64,
    /// By joint.
    pub joints: Vec<ComparedJoint>,
}

/// A joint's error.
#[derive(Debug, Clone, Deserialize)]
pub struct ComparedJoint {
    /// Its name.
    pub joint: String,
    /// Held-out error of the mean torque of 20 ms, N m.
    pub rms: f64,
}

/// The joints of an effect as places; the base is none.
fn places(effect: &str, joints: &[String]) -> Vec<Place> {
    let place = |joint: &String| {
        Place(
            effect.to_owned(),
            Some(joint.clone()).filter(|j| j != "base"),
        )
    };
    joints.iter().map(place).collect()
}

impl Verdict {
    /// What is named first: one place, or several of a family; empty if nothing is called missing.
    pub fn named(&self) -> Vec<Place> {
        self.first()
            .map_or_else(Vec::new, |c| places(&c.effect, &c.joints))
    }

    fn first(&self) -> Option<&Candidate> {
        let best = self.candidates.iter().find(|c| c.significant);
        best.filter(|_| self.verdict == "missing")
    }

    /// What is said to explain as much as what is named first.
    pub fn alternatives(&self) -> Vec<Vec<Place>> {
        let all = self.first().map_or(&[][..], |c| &c.alternatives);
        all.iter().map(|a| places(&a.effect, &a.joints)).collect()
    }

    /// What the path has in the end.
    pub fn path(&self) -> Vec<Place> {
        let mut path: Vec<Place> = Vec::new();
        for step in &self.path {
            let effect = step.effect.as_deref().unwrap_or_default();
            for place in places(effect, &step.joints) {
                path.retain(|known| *known != place);
                if step.step == "add" {
                    path.push(place);
                }
            }
        }
        path
    }

    /// Held-out error in the end, N m.
    pub fn after(&self) -> f64 {
        self.path
            .last()
            .map_or(self.held_out_rms, |step| step.error)
    }

    /// The candidate of one effect at one joint alone.
    pub fn candidate(&self, place: &Place) -> Option<&Candidate> {
        self.candidates
            .iter()
            .find(|c| places(&c.effect, &c.joints) == std::slice::from_ref(place))
    }
}

/// Runs `program` with arguments that must succeed, and reads its JSON.
fn json<T: serde::de::DeserializeOwned>(
    program: &Path,
    arguments: &[&std::ffi::OsStr],
) -> Result<T, String> {
    let output = Command::new(program)
        .args(arguments)
        .arg("--json")
        .output()
        .map_err(|e| format!("{}: {e}", program.display()))?;
    let words = || String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if !output.status.success() {
        return Err(words());
    }
    serde_json::from_slice(&output.stdout).map_err(|e| format!("{e}: {}", words()))
}

/// `proprio diagnose` on the case's log with its model.
///
/// # Errors
/// The program's words if it fails.
pub fn diagnose(program: &Path, case: &LoggedCase) -> Result<Verdict, String> {
    let (log, model) = (case.log(), case.model());
    let of = ["diagnose".as_ref(), log.as_os_str()];
    json(
        program,
        &[of[0], of[1], "--model".as_ref(), model.as_os_str()],
    )
}

/// The held-out error of a model whose values are fitted.
///
/// # Errors
/// The program's words if it fails.
pub fn held_out(program: &Path, log: &Path, model: &Path) -> Result<Compared, String> {
    let arguments = [
        "compare".as_ref(),
        log.as_os_str(),
        "--model".as_ref(),
        model.as_os_str(),
        "--fit".as_ref(),
    ];
    json(program, &arguments)
}

//! What is true of a log: the file beside it.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// An effect at a joint; of the base, no joint.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
pub struct Place(pub String, pub Option<String>);

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.1 {
            Some(joint) => write!(f, "{}:{joint}", self.0),
            None => f.write_str(&self.0),
        }
    }
}

/// `NAME.json` of a case.
#[derive(Debug, Clone, Deserialize)]
pub struct Truth {
    /// The case, and its files.
    pub name: String,
    /// What is hidden; none in a log of a complete model.
    pub effect: Option<String>,
    /// Where.
    pub joint: Option<String>,
    /// 0 (hardly there) to 3 (obvious).
    pub size: usize,
    /// All that the model lacks.
    pub missing: Vec<Place>,
    /// What says the same as the hidden effect, all of them together.
    pub equal: Vec<Place>,
    /// The hidden effect's parameter that `diagnose` calls its value; none where it has no single one.
    pub value: Option<f64>,
    /// The hidden effect's size in standard deviations of an efficient estimate.
    pub snr: Option<f64>,
    /// Standard deviation of the reported torque's noise, N m.
    pub torque_noise: f64,
    /// Its memory, s; zero for white noise.
    pub torque_memory: f64,
    /// Standard deviation of the reported velocity's noise, rad/s.
    pub velocity_noise: f64,
    /// Samples a second, Hz.
    pub rate: f64,
    /// Share of samples that repeat the one before.
    pub repeats: f64,
}

/// A log with its truth.
#[derive(Debug, Clone)]
pub struct LoggedCase {
    /// What is true of it.
    pub truth: Truth,
    /// `NAME`, to which the files' endings are added.
    stem: PathBuf,
}

impl LoggedCase {
    /// Reads the case whose truth is in `file`.
    ///
    /// # Errors
    /// What cannot be read, in words.
    pub fn read(file: &Path) -> Result<Self, String> {
        let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
        let text = std::fs::read_to_string(file).map_err(|e| wrong(&e))?;
        let truth: Truth = serde_json::from_str(&text).map_err(|e| wrong(&e))?;
        let stem = file.with_file_name(&truth.name);
        Ok(Self { truth, stem })
    }

    fn file(&self, ending: &str) -> PathBuf {
        let mut name = self.stem.clone().into_os_string();
        name.push(ending);
        name.into()
    }

    /// The log, compressed or not.
    pub fn log(&self) -> PathBuf {
        let plain = self.file(".csv");
        if plain.exists() {
            plain
        } else {
            self.file(".csv.gz")
        }
    }

    /// The model to be criticised.
    pub fn model(&self) -> PathBuf {
        self.file(".toml")
    }

    /// The same with what it lacks, its values to be fitted.
    pub fn true_model(&self) -> PathBuf {
        self.file(".true.toml")
    }

    /// Whether it is `place`, or part of another way to say it, that the model lacks.
    pub fn lacks(&self, place: &Place) -> bool {
        self.truth.missing.contains(place) || self.truth.equal.contains(place)
    }

    /// What is hidden; none in a log of a complete model.
    pub fn hidden(&self) -> Option<Place> {
        let effect = self.truth.effect.clone()?;
        Some(Place(effect, self.truth.joint.clone()))
    }
}

/// All cases of a folder, by name.
///
/// # Errors
/// What cannot be read, in words.
pub fn cases(folder: &Path) -> Result<Vec<LoggedCase>, String> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    files.sort();
    files.iter().map(|file| LoggedCase::read(file)).collect()
}

//! A log's rows as numbers, to be changed by a test and written again.

use std::fs;
use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tempfile::TempDir;

use crate::command::simulated;

/// A leg with the four effects of every drive, whose encoders have noise of 0.2 mrad and 0.03 rad/s: its log is `log.csv`.
pub fn with_noisy_encoders(seed: u64) -> TempDir {
    let folder = simulated(&format!(
        "--legs FR --typical --inertia-error 0.05 --seed {seed} --velocity-noise 0.03"
    ));
    let path = folder.path().join("log.csv");
    let mut log = Rows::read(&path);
    log.add_noise("q", 2e-4, seed);
    log.write(&path);
    folder
}

/// A CSV log. An empty cell is NaN.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Names of the columns.
    pub names: Vec<String>,
    /// The rows, a value a column.
    pub rows: Vec<Vec<f64>>,
}

impl Rows {
    /// The log of a file.
    ///
    /// # Panics
    /// If it cannot be read, or has no header.
    pub fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).expect("a log of the test");
        let (names, rows) = text.split_once('\n').expect("a header");
        let values = |row: &str| -> Vec<f64> {
            let cells = row.split(',');
            cells.map(|x| x.parse().unwrap_or(f64::NAN)).collect()
        };
        Self {
            names: names.split(',').map(str::to_owned).collect(),
            rows: rows.lines().map(values).collect(),
        }
    }

    /// Which column has this name.
    ///
    /// # Panics
    /// If none has.
    pub fn place(&self, name: &str) -> usize {
        let place = self.names.iter().position(|own| own == name);
        place.expect("a column of the log")
    }

    /// Adds normal noise of a standard deviation to all columns of a channel, such as `q`.
    pub fn add_noise(&mut self, channel: &str, deviation: f64, seed: u64) {
        self.change(channel, seed, |random, x| {
            let noise: f64 = StandardNormal.sample(random);
            x + deviation * noise
        });
    }

    /// Changes each number of all columns of a channel, such as `q`, by what is drawn.
    pub fn change(&mut self, channel: &str, seed: u64, with: impl Fn(&mut ChaCha8Rng, f64) -> f64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let of_channel = |name: &String| name.split('/').next() == Some(channel);
        let places: Vec<usize> = (0..self.names.len())
            .filter(|&n| of_channel(&self.names[n]))
            .collect();
        for row in &mut self.rows {
            for &n in &places {
                row[n] = with(&mut random, row[n]);
            }
        }
    }

    /// Writes them as a log.
    ///
    /// # Panics
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) {
        let mut lines = vec![self.names.join(",")];
        for row in &self.rows {
            let row: Vec<String> = row.iter().map(f64::to_string).collect();
            lines.push(row.join(",").replace("NaN", ""));
        }
        fs::write(path, lines.join("\n") + "\n").expect("a folder of the test");
    }
}

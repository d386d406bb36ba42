//! Logs of a recorder that falls behind: the error that `compare` tells is the clean log's.

use std::path::Path;

use proprio_tests::command::{done, json, simulated};
use proprio_tests::rows::Rows;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Stamps rows late: once in 0.3 s for up to `stall` s, less by `speed` periods a row from then on.
fn fall_behind(log: &mut Rows, stall: f64, speed: f64, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let period = log.rows[1][0] - log.rows[0][0];
    let mut late = 0.0_f64;
    for row in &mut log.rows {
        if random.random::<f64>() < period / 0.3 {
            late = late.max(stall * random.random_range(0.5..1.0));
        }
        row[0] += late;
        late = (late - speed * period).max(0.0);
    }
}

fn error(folder: &Path, log: &str) -> f64 {
    let compared = done(folder, &["compare", log, "-m", "drive.toml", "--json"]);
    json(&compared)["error"]["after"].as_f64().unwrap()
}

/// Recorders that catch up at once, and slowly: late with a row in ten to two in three.
#[test]
fn a_recorder_that_falls_behind_does_not_change_the_error() {
    for rate in [250, 1000, 2000, 5000] {
        let folder = simulated(&format!(
            "--legs FR --typical --inertia-error 0.03 --duration 12 --seed 5 --rate {rate}"
        ));
        let path = folder.path();
        let add = "add viscous coulomb armature bias -m drive.toml";
        done(path, &add.split(' ').collect::<Vec<_>>());
        let clean = error(path, "log.csv");
        for (n, (stall, speed)) in [(8e-3, 0.9), (8e-3, 0.2), (30e-3, 0.2)]
            .into_iter()
            .enumerate()
        {
            let mut log = Rows::read(&path.join("log.csv"));
            fall_behind(&mut log, stall, speed, n as u64);
            log.write(&path.join("late.csv"));
            let late = error(path, "late.csv");
            assert!(
                (0.85..=1.15).contains(&(late / clean)),
                "{rate} Hz, {stall} s, {speed}: {late} for {clean}"
            );
        }
    }
}

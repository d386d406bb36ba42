//! How well a design excites a leg, beside random motions and the recorded chirps, and what it costs to find.

use std::fmt::Write;
use std::path::PathBuf;

use proprio_host::excite::{self, LimbDesign, RandomMotions, Settings, earlier, told};
use proprio_host::model::Model;

use super::robots::LEG;
use super::{Failure, Stopwatch, Watched, each};
use proprio_tests::command::recorded_logs;

/// Seeds of the designs.
const SEEDS: [u64; 3] = [1, 2, 3];
/// Samples per second of the check that shares nothing with the proof but the limits.
pub const DENSE: f64 = 1e4;

/// Designs, the time that they took, and the best cost over processor time.
pub type Designed = (Vec<LimbDesign>, Stopwatched, Vec<(f64, f64)>);

/// A design of one leg or of all with `settings`, its time, and the best cost over processor time.
///
/// # Errors
/// No motion within the limits.
pub fn designed(legs: &[usize], settings: &Settings) -> Result<Designed, Failure> {
    let model = Model::default();
    let all = model.robot().limbs();
    let limbs: Vec<_> = legs.iter().map(|&leg| all[leg].clone()).collect();
    let (clock, watched) = (Stopwatch::start(), Watched::to_the_end());
    let designs = excite::design(&model, &limbs, settings, &watched)?;
    let time = Stopwatched {
        wall: clock.wall(),
        processor: clock.processor(),
    };
    Ok((designs, time, watched.costs()))
}

/// How long something took, s.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatched {
    /// On the wall.
    pub wall: f64,
    /// Of all processors.
    pub processor: f64,
}

/// One leg: designs, random motions, recorded chirps.
///
/// # Errors
/// No motion within the limits, a log that cannot be read.
pub fn one_leg(random: usize) -> Result<String, Failure> {
    let mut text = String::from(
        "A Go2's FR leg, 10 s, default settings. σ1/σ17 of the inertial columns, masses, first moments and inertias each scaled by \
         one number; SI: per kg, kg m, kg m². Highest: the largest constraint at 10 000 instants a second, as a share beyond its \
         limit (negative: within).\n\n\
         | motion | σ1/σ17 | SI | violations | highest | processor s |\n|---|---|---|---|---|---|\n",
    );
    let mut curve = Vec::new();
    for seed in SEEDS {
        let settings = Settings {
            seed,
            ..Settings::default()
        };
        let (designs, time, costs) = designed(&[LEG.index()], &settings)?;
        let design = &designs[0];
        writeln!(
            text,
            "| designed, seed {seed} | **{:.2}** | {:.1} | {} | {:.4} | {:.1} |",
            design.measures.condition_number,
            design.measures.condition_number_si,
            design.violations.len(),
            design.dense_check(DENSE),
            time.processor,
        )?;
        curve.push(costs);
    }
    let model = Model::default();
    let limb = &model.robot().limbs()[LEG.index()];
    let motions = RandomMotions::new(&model, limb, &Settings::default())?;
    let clock = Stopwatch::start();
    let found = each("random motions", random, |n| {
        Ok(motions.condition_number(n as u64))
    })?;
    let mut numbers: Vec<f64> = found.into_iter().flatten().collect();
    numbers.sort_by(f64::total_cmp);
    let (best, middle) = (numbers.first(), numbers.get(numbers.len() / 2));
    if let (Some(best), Some(middle)) = (best, middle) {
        writeln!(
            text,
            "| best of {} random Fourier motions, each as large as the limits allow | {best:.2} | | | | {:.1} |\n\
             | their median | {middle:.1} | | | | |",
            numbers.len(),
            clock.processor(),
        )?;
    }
    for (name, number) in chirps(&model)? {
        writeln!(text, "| {name}, FR | {number:.0} | | | | |")?;
    }
    text += "\nBest σ1/σ17 so far after seconds of processor time, to be halved on two cores:\n\n| seed | 1 | 2 | 4 | 8 | 16 | end |\n|---|---|---|---|---|---|---|\n";
    for (seed, costs) in SEEDS.iter().zip(&curve) {
        let after = |most: f64| {
            let until = costs.iter().take_while(|(t, _)| *t <= most).last();
            until.map_or_else(|| "–".to_owned(), |(_, cost)| format!("{:.1}", cost.exp()))
        };
        let cells = [1.0, 2.0, 4.0, 8.0, 16.0, f64::INFINITY].map(after);
        writeln!(text, "| {seed} | {} |", cells.join(" | "))?;
    }
    Ok(text)
}

/// The condition numbers of the recorded chirps, FR.
fn chirps(model: &Model) -> Result<Vec<(String, f64)>, Failure> {
    let Some(folder) = recorded_logs() else {
        return Ok(Vec::new());
    };
    let limb = &model.robot().limbs()[LEG.index()];
    let mut all = Vec::new();
    for log in chirp_logs(&folder)? {
        let name = log.file_stem().unwrap_or_default().to_string_lossy();
        let known = earlier::read(model, std::slice::from_ref(limb), &[&log], |_, _| {})?;
        for own in &known {
            all.push((name.to_string(), told(model, limb, own)?.condition_number));
        }
    }
    Ok(all)
}

/// The recorded chirps, by name.
///
/// # Errors
/// A folder that cannot be read.
pub fn chirp_logs(folder: &std::path::Path) -> Result<Vec<PathBuf>, Failure> {
    let mut logs = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.to_string_lossy().contains("go2_air_chirp_") {
            logs.push(path);
        }
    }
    logs.sort();
    Ok(logs)
}

/// All four legs at once.
///
/// # Errors
/// No motion within the limits.
pub fn four_legs() -> Result<String, Failure> {
    let (designs, time, _) = designed(&[0, 1, 2, 3], &Settings::default())?;
    let mut text = format!(
        "Four legs at once, 10 s, default settings: {:.1} s of processor time, {:.1} s on two cores that nothing else uses \
         (bar: 60 s); {:.1} s here, on a shared machine.\n\n| leg | σ1/σ17 | SI | violations | highest |\n|---|---|---|---|---|\n",
        time.processor,
        time.processor / 2.0,
        time.wall
    );
    for design in &designs {
        writeln!(
            text,
            "| {} | {:.2} | {:.1} | {} | {:.4} |",
            design.limb,
            design.measures.condition_number,
            design.measures.condition_number_si,
            design.violations.len(),
            design.dense_check(DENSE)
        )?;
    }
    Ok(text)
}

//! Measures what a diagnosis costs on the desktop: `cargo run --release -p proprio-tests --bin diagnose_cost [LOG]`.
//!
//! Without a log: 20 s of twelve joints at 500 Hz, simulated, friction in the model, the whole catalogue tried. Processor time
//! of all threads and the process's largest memory, as Linux counts them (`proc(5)`), against the budget: 2 s and
//! 200 MB. Waiting for a busy machine does not count. Ends with status 1 above the budget; a given log has none.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use proprio::diagnose::diagnose;
use proprio::log::LogWriter;
use proprio::model::Model;
use proprio::recording::Recording;
use proprio::simulator::hidden::typical;
use proprio::simulator::{Hide, Simulation};
use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use proprio_tests::excitation::processor_time;

type Failure = Box<dyn std::error::Error>;

/// Half more than it was measured to take.
const MOST_SECONDS: f64 = 2.0;
const MOST_MEGABYTES: f64 = 200.0;

fn main() -> ExitCode {
    match measure() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("diagnose_cost: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<bool, Failure> {
    let folder = tempfile::tempdir()?;
    let given = std::env::args_os().nth(1).map(PathBuf::from);
    let log = match &given {
        Some(log) => log.clone(),
        None => simulated(&folder.path().join("simulated.csv"))?,
    };
    let mut model = Model::default();
    let friction = [
        EffectKind::Viscous,
        EffectKind::Coulomb,
        EffectKind::Armature,
        EffectKind::Bias,
    ];
    let joints = model.robot().bodies().len();
    for effect in friction {
        let places: Vec<_> = (0..joints).map(|joint| (effect, joint)).collect();
        model.add_last(&places);
    }
    let (begin, before) = (std::time::Instant::now(), processor_time());
    let recording = Recording::read(&[log], &model, |_, _| {})?;
    let diagnosis = diagnose(&recording, &model)?;
    let wall = begin.elapsed().as_secs_f64();
    let (Some(before), Some(after), Some(megabytes)) = (before, processor_time(), peak_memory())
    else {
        println!("diagnose: {wall:.2} s; this system does not say what of it was processor time");
        return Ok(true);
    };
    let seconds = after - before;
    println!(
        "diagnose {:.0} s of {joints} joints, {} candidates: {wall:.2} s, {seconds:.2} s of processor time (budget {MOST_SECONDS} s), \
         {megabytes:.0} MB at most (budget {MOST_MEGABYTES} MB)",
        recording.duration,
        diagnosis.candidates.len()
    );
    Ok(given.is_some() || (seconds <= MOST_SECONDS && megabytes <= MOST_MEGABYTES))
}

/// Writes the log of four legs with typical friction and an effect that the model does not know.
fn simulated(path: &Path) -> Result<PathBuf, Failure> {
    let mut effects = typical(&Leg::ALL);
    effects.extend("load_friction:FR_calf=0.1".parse::<Hide>()?.on(&Leg::ALL)?);
    let simulation = Simulation {
        effects,
        ..Simulation::new(&Leg::ALL)
    };
    let mut log = LogWriter::new(BufWriter::new(File::create(path)?), &Leg::ALL)?;
    for sample in simulation.samples() {
        let sample = sample?;
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)?;
    }
    log.finish()?;
    Ok(path.to_owned())
}

/// Most memory that this process has had in RAM, MB.
fn peak_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024e-6)
}

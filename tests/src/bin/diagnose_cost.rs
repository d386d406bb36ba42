//! Measures what a diagnosis costs on the desktop: `cargo run --release -p proprio-tests --bin diagnose_cost [LOG…]`.
//!
//! Without a log: 20 s of twelve joints at 500 Hz, simulated, friction in the model, the whole catalogue tried. Processor time
//! of all threads and the process's largest memory, as Linux counts them (`proc(5)`), against the budget: 2 s and
//! 200 MB. Waiting for a busy machine does not count, and of up to three runs the least counts: what shares the processor's memory can only add.
//! Ends with status 1 above the budget.
//!
//! With logs: a table of what the commands `proprio diagnose` and `proprio identify` take for each, on one thread and on two, from the
//! process's start to its end. There is no budget then.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use proprio_host::diagnose::diagnose;
use proprio_host::log::LogWriter;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::hidden::typical;
use proprio_simulator::{Hide, Simulation};
use proprio_tests::command::binary;
use proprio_tests::cost::{processor_time, processor_time_of_children};

type Failure = Box<dyn std::error::Error>;

/// What a diagnosis of these 20 s may take, s of processor time and MB.
const MOST_SECONDS: f64 = 2.0;
const MOST_MEGABYTES: f64 = 200.0;
/// A diagnosis that takes longer is run again, up to so many times in all.
const RUNS: usize = 3;
/// A short command is repeated for so long, s: processor time is counted in hundredths.
const LONG_ENOUGH: f64 = 1.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match &arguments[..] {
        [] => within_budget(),
        logs => table(logs),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("diagnose_cost: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints a row for each log and command.
fn table(logs: &[String]) -> Result<bool, Failure> {
    println!("| log | command | processor, 1 thread | wall, 1 thread | wall, 2 threads | memory |");
    println!("|---|---|---|---|---|---|");
    for log in logs {
        let name = Path::new(log).file_name().unwrap_or_default();
        for command in ["diagnose", "identify"] {
            let [[processor, one, _], [_, two, memory]] =
                [of_command(command, log, 1)?, of_command(command, log, 2)?];
            println!(
                "| {} | {command} | {processor:.3} s | {one:.3} s | {two:.3} s | {memory:.0} MB |",
                name.display()
            );
        }
    }
    Ok(true)
}

/// Processor time and wall time (s) and most memory (MB) of a command on so many threads.
fn of_command(command: &str, log: &str, threads: u32) -> Result<[f64; 3], Failure> {
    let nothing_known = "this system does not tell processor time";
    let mut run = Command::new(binary());
    run.args([command, log])
        .env("RAYON_NUM_THREADS", threads.to_string())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let (begin, before) = (
        Instant::now(),
        processor_time_of_children().ok_or(nothing_known)?,
    );
    let (mut times, mut megabytes) = (0.0, 0.0_f64);
    while begin.elapsed().as_secs_f64() < LONG_ENOUGH {
        let mut child = run.spawn()?;
        let status = loop {
            // Its peak only grows: the last look before it ends is the peak to within what a millisecond adds.
            megabytes = megabytes.max(peak_memory(&child.id().to_string()).unwrap_or(0.0));
            match child.try_wait()? {
                Some(status) => break status,
                None => std::thread::sleep(Duration::from_millis(1)),
            }
        };
        if !status.success() {
            return Err(format!("proprio {command} {log}: {status}").into());
        }
        times += 1.0;
    }
    let wall = begin.elapsed().as_secs_f64();
    let processor = processor_time_of_children().ok_or(nothing_known)? - before;
    Ok([processor / times, wall / times, megabytes])
}

/// How long a log is (s), and how many candidates were tried.
fn diagnosed(log: &Path, model: &Model) -> Result<(f64, usize), Failure> {
    let recording = Recording::read(&[log.to_owned()], model, |_, _| {})?;
    let diagnosis = diagnose(&recording, model)?;
    Ok((recording.duration, diagnosis.candidates.len()))
}

fn within_budget() -> Result<bool, Failure> {
    let folder = tempfile::tempdir()?;
    let log = simulated(&folder.path().join("simulated.csv"))?;
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
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let (begin, before) = (Instant::now(), processor_time());
        let (duration, candidates) = diagnosed(&log, &model)?;
        let wall = begin.elapsed().as_secs_f64();
        let (Some(before), Some(after)) = (before, processor_time()) else {
            println!(
                "diagnose: {wall:.2} s; this system does not say what of it was processor time"
            );
            return Ok(true);
        };
        let seconds = after - before;
        println!(
            "diagnose {duration:.0} s of {joints} joints, {candidates} candidates: {wall:.2} s, {seconds:.2} s of processor time (budget \
             {MOST_SECONDS} s)",
        );
        least = least.min(seconds);
        if least <= MOST_SECONDS {
            break;
        }
    }
    let megabytes = peak_memory("self").ok_or("this system does not tell memory")?;
    println!("{megabytes:.0} MB at most (budget {MOST_MEGABYTES} MB)");
    Ok(least <= MOST_SECONDS && megabytes <= MOST_MEGABYTES)
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

/// Most memory that a process has had in RAM, MB.
fn peak_memory(process: &str) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024e-6)
}

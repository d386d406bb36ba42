//! What a model lacks, by the library: `cargo run --release -p proprio --example diagnose -- LOG…`. Without a log one is simulated.

use std::error::Error;
use std::path::PathBuf;

use proprio::Model;
use proprio_core::go2::Leg;
use proprio_host::log::LogWriter;
use proprio_simulator::Simulation;
use proprio_simulator::hidden::typical;

fn main() -> Result<(), Box<dyn Error>> {
    let mut logs: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let folder = tempfile::tempdir()?;
    if logs.is_empty() {
        let log = folder.path().join("log.csv");
        std::fs::write(&log, simulated()?)?;
        logs.push(log);
    }
    // The Go2's rigid body from its URDF, and no effect.
    let mut model = Model::go2();
    let recording = proprio::read(&logs, &model)?;
    let diagnosis = proprio::diagnose(&recording, &model)?;
    print!("{diagnosis}");
    for effect in &diagnosis.missing {
        model = proprio::add(&model, effect)?;
    }
    let fitted = proprio::identify(&recording, &model)?;
    println!(
        "{:.4} → {:.4} N m on unseen data; {:.4} with the values that fit all of it",
        diagnosis.before, diagnosis.after, fitted.rms
    );
    Ok(())
}

/// A leg with typical friction, as a CSV log.
fn simulated() -> Result<Vec<u8>, Box<dyn Error>> {
    let simulation = Simulation {
        effects: typical(&[Leg::FR]),
        duration: 10.0,
        ..Simulation::new(&[Leg::FR])
    };
    let mut log = LogWriter::new(Vec::new(), &simulation.legs)?;
    for sample in simulation.samples() {
        let sample = sample?;
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)?;
    }
    Ok(log.finish()?)
}

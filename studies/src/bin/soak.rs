//! Days of an unchanged robot heard by the device's code in this process: `cargo run --release -p proprio-studies --bin soak -- --accept`
//! writes `studies/soak.md`; `--hours 0.1` is a short one. `--board --hours 1 --accept` has the firmware's image on the emulated board hear it, and
//! writes `studies/soak_board.md`.
//!
//! All four legs, 500 samples a second each: 1.7e8 samples of a leg in 24 h. The robot is one whose torques obey the model but for noise
//! with a memory, or, with `--simulated`, forward dynamics with a real Go2's friction and sensors, which takes ten times as long. Nothing may
//! be said to change, nothing may be lost uncounted, no estimate may drift. At the end a load is picked up, which must be
//! noticed as on the first day.

use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;
use proprio_core::estimator::LEG_INERTIAL;
use proprio_core::go2::Leg;
use proprio_core::wire::{ChangeKind, Counters, Estimate};
use proprio_host::device::names::words_of;
use proprio_host::device::{BusStep, DeviceError, Qemu, image};
use proprio_tests::changing::{ExactRobot, Listener, robot};

/// Hears an unchanged robot for long
#[derive(Parser)]
struct Arguments {
    /// Hours of the robot's time
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Seed of the robot's motion and noise
    #[arg(long, default_value_t = 24)]
    seed: u64,
    /// Forward dynamics, friction and sensors of a real Go2
    #[arg(long)]
    simulated: bool,
    /// The firmware's image on the emulated board, not its code in this process
    #[arg(long, conflicts_with = "simulated")]
    board: bool,
    /// Write the table in studies/
    #[arg(long)]
    accept: bool,
}

/// What is picked up at the end.
const LOAD: &str = "payload:RR_calf=0.5,z=-0.12";

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let end_us = (arguments.hours * 3.6e9) as u64;
    let mut listener = match arguments.board {
        false => Listener::new(),
        true => match emulated() {
            Ok(board) => Listener::of(Box::new(board)),
            Err(error) => {
                eprintln!("soak: {error}");
                return ExitCode::FAILURE;
            }
        },
    };
    let (unchanged, loaded) = (robot("", arguments.seed), robot(LOAD, arguments.seed));
    let (rows, found, noticed);
    if arguments.simulated {
        // A simulation that diverges ends early, and the table says so.
        rows = hear(
            &mut listener,
            unchanged.steps().map_while(Result::ok),
            end_us,
        );
        // It stops for a second, and begins again with the load.
        let from_us = end_us + 1_000_000;
        let steps = loaded.steps().map_while(Result::ok).map(|step| BusStep {
            time_us: from_us + step.time_us,
            ..step
        });
        (found, noticed) = pick_up(&mut listener, steps, from_us);
    } else {
        let mut exact = ExactRobot::new(arguments.seed);
        rows = hear(&mut listener, exact.by_ref(), end_us);
        exact.load(Leg::RR, 0.5, [0.0, 0.0, -0.12]);
        (found, noticed) = pick_up(&mut listener, exact, end_us);
    }
    let (text, unharmed) = report(&arguments, &rows);
    let (text, good) = (text + &found, unharmed && noticed);
    print!("{text}");
    if arguments.accept {
        let name = match (arguments.simulated, arguments.board) {
            (true, _) => "soak_simulated.md",
            (_, true) => "soak_board.md",
            _ => "soak.md",
        };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        if let Err(error) = std::fs::write(&path, text) {
            eprintln!("soak: {}: {error}", path.display());
            return ExitCode::FAILURE;
        }
    }
    if good {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// The firmware's image, booted; the buses' bytes come to its memory, as by DMA.
fn emulated() -> Result<Qemu, DeviceError> {
    Qemu::boot_fast(&image::build(image::Scalar::F64)?)
}

/// What a device has heard, and what became of it.
struct Heard {
    /// The table's lines.
    lines: String,
    /// The last counters.
    counters: Counters,
    /// Changes announced.
    changes: usize,
}

/// Has the device hear a robot until a time.
fn hear(listener: &mut Listener, steps: impl Iterator<Item = BusStep>, end_us: u64) -> Heard {
    let mut lines = String::new();
    let mut look_us = 60_000_000;
    for step in steps {
        let now_us = step.time_us;
        listener.hear(&step);
        let last = now_us + 2_000 > end_us;
        if now_us >= look_us || last {
            listener.settle();
            lines += &row(now_us, listener);
            eprint!("{}", row(now_us, listener));
            look_us *= 4;
        }
        if last {
            break;
        }
    }
    Heard {
        lines,
        counters: listener.counters,
        changes: listener.changes.len(),
    }
}

/// What is known after some time.
fn row(now_us: u64, listener: &Listener) -> String {
    let legs = listener.counters.legs;
    let sum = |count: fn(&proprio_core::wire::LegCounters) -> u32| -> u64 {
        legs.iter().map(|leg| u64::from(count(leg))).sum()
    };
    let estimates: Vec<&Estimate> = listener.estimates.iter().flatten().collect();
    let numbers = || estimates.iter().flat_map(|e| e.values.iter().chain(&e.std));
    let finite = numbers().all(|x| x.is_finite());
    let calf = listener.estimates[Leg::FR.index()].as_ref();
    let calf = calf.map_or((f32::NAN, f32::NAN, f32::NAN), |e| {
        let coulomb = LEG_INERTIAL + 4 * 2 + 1;
        (e.values[coulomb], e.std[coulomb], e.noise[2])
    });
    format!(
        "| {:.2} | {} | {} | {} | {} | {:.4} ± {:.4} | {:.4} | {} |\n",
        now_us as f64 / 3.6e9,
        sum(|leg| leg.used),
        sum(|leg| leg.windows),
        sum(|leg| leg.changes),
        sum(|leg| leg.forgotten),
        calf.0,
        calf.1,
        calf.2,
        if finite { "yes" } else { "NO" },
    )
}

/// The table, and whether all is as it should be.
fn report(arguments: &Arguments, heard: &Heard) -> (String, bool) {
    let (rows, counters) = (&heard.lines, &heard.counters);
    let mut text = format!(
        "# An unchanged robot for long\n\nMade by `cargo run --release -p proprio-studies --bin soak -- --hours {}{} --accept`: four legs \
         at 500 samples a second, {}, heard by the\n{} in double precision, seed {}.\n\n| h | samples used | windows folded | changes announced | windows left out | Coulomb \
         friction of FR_calf, N m | its noise, N m | all finite |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n{rows}\n",
        arguments.hours,
        match (arguments.simulated, arguments.board) {
            (true, _) => " --simulated",
            (_, true) => " --board",
            _ => "",
        },
        if arguments.simulated {
            "forward dynamics with a real Go2's friction and sensors"
        } else {
            "torques that obey the model but for noise that remembers 50 ms"
        },
        match arguments.board {
            true => "firmware's image on the emulated board",
            false => "device's code on the desktop",
        },
        arguments.seed
    );
    let expected = u64::from(counters.legs[0].samples);
    let mut good = heard.changes == 0;
    for (leg, counters) in Leg::ALL.into_iter().zip(&counters.legs) {
        let lost = counters.samples - counters.used;
        good &= lost == 0 && counters.late + counters.rejected + counters.gaps == 0;
        good &= counters.unfolded + counters.unsolved == 0;
        good &= u64::from(counters.samples) == expected;
        let _ = writeln!(
            text,
            "{}: {} samples, {} of them not used, {} windows, {} not finite, {} solutions failed.  ",
            leg.name(),
            counters.samples,
            lost,
            counters.windows,
            counters.unfolded,
            counters.unsolved
        );
    }
    if arguments.board {
        let load = &counters.load;
        good &= load.over_budget == 0;
        let _ = writeln!(
            text,
            "\nSteps: {}, {} of them over budget; the dearest {} instructions; stack {} bytes.",
            load.ticks, load.over_budget, load.worst, load.stack_bytes
        );
    }
    (text, good)
}

/// Has the device hear 20 s of the robot with its load, from `from_us` on: what is said of that, and whether it is right.
fn pick_up(
    listener: &mut Listener,
    steps: impl Iterator<Item = BusStep>,
    from_us: u64,
) -> (String, bool) {
    let false_ones = listener.changes.len();
    for step in steps.take_while(|step| step.time_us <= from_us + 20_000_000) {
        listener.hear(&step);
    }
    listener.settle();
    let found = listener.changes.get(false_ones..).unwrap_or(&[]);
    let good = found.first().is_some_and(|change| {
        (change.leg, change.joint, change.kind) == (2, 2, ChangeKind::Load)
            && change.time_us <= from_us + 5_000_000
    });
    let mut text = format!("\nFalse changes: {false_ones}. Then 0.5 kg on RR_calf:");
    for change in found {
        let late = change.time_us.saturating_sub(from_us) as f64 * 1e-6;
        let words = words_of(change).unwrap_or_default();
        let _ = write!(text, " after {late:.1} s `{words}`");
    }
    if found.is_empty() {
        text += " nothing is announced";
    }
    (text + ".\n", good)
}

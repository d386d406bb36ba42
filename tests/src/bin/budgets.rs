//! Measures the firmware and compares it with `budgets.toml`: `cargo run -p proprio-tests --bin budgets`.
//!
//! Counts, never wall time: bytes of the images, the deepest stack, instructions on the emulated board. Ends with status 1
//! if a figure is above what was accepted (of the same compiler), or an operation's instructions depend on the data. `-- --accept` writes what was
//! measured into the file, for a change that is meant to cost; its diff is then reviewed.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use object::{Object, ObjectSection, SectionFlags, elf};
use proprio_core::go2::{JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::window::Sample;
use proprio_core::wire::{Counters, DeviceMessage, HostMessage, Load, Wiring};
use proprio_host::device::image::{self, Scalar};
use proprio_host::device::replay::{bus_step, replay};
use proprio_host::device::{Device, Qemu, qemu};
use proprio_tests::{motion, walks, zeros};
use serde::{Deserialize, Serialize};

type Failure = Box<dyn std::error::Error + Send + Sync>;
/// Figure by name.
type Figures = BTreeMap<String, u64>;

/// Samples of all legs that a tick's cost is measured over: eight seconds, most of them with both folds full enough to be judged.
const SAMPLES: u64 = 4_000;
/// Samples after which all legs are known to be right.
const TRIAL: u64 = 10_000;
/// The counter's resolution, instructions.
const RESOLUTION: u64 = 1;
/// A figure may exceed what was accepted by 1/50.
const SLACK: u64 = 50;

/// Operations that search or decide, and how many instructions more they may take for other data: the application runs no search,
/// a block's verdict takes 85 more of 22 300 where there is more to decide, and a walk's window that closes 4 of 95 000.
const SEARCHES: [(&str, u64); 3] = [
    ("consistent_", u64::MAX),
    ("judge_block", 100),
    ("walk_push_c", 10),
];

/// `budgets.toml`.
#[derive(Default, Serialize, Deserialize)]
struct Budgets {
    /// The compiler that the accepted figures are from, as it names itself in the image.
    compiler: String,
    /// The targets of `docs/code.md`, "Budgets".
    target: Figures,
    /// What was accepted, per scalar.
    #[serde(flatten)]
    accepted: BTreeMap<String, Figures>,
}

fn main() -> ExitCode {
    match check() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("budgets: {error}");
            ExitCode::FAILURE
        }
    }
}

fn check() -> Result<bool, Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../budgets.toml");
    let text = std::fs::read_to_string(&path)?;
    let mut budgets: Budgets = toml::from_str(&text)?;
    let accept = std::env::args().any(|argument| argument == "--accept");
    let mut good = true;
    // A count is the same whatever else the machine does.
    let scalars = [Scalar::F64, Scalar::F32];
    let measured = std::thread::scope(|scope| {
        let runs = scalars.map(|scalar| scope.spawn(move || measure(scalar)));
        runs.map(|run| run.join().expect("a measurement does not panic"))
    });
    for (scalar, measured) in scalars.into_iter().zip(measured) {
        let Measured {
            figures,
            constant,
            compiler,
        } = measured?;
        good &= constant;
        if compiler == budgets.compiler {
            good &= compare(scalar.name(), &figures, &budgets);
        } else {
            compare(scalar.name(), &figures, &budgets);
            println!(
                "not judged: the figures are from {}, the image from {compiler}\n",
                budgets.compiler
            );
        }
        if accept {
            budgets.compiler = compiler;
            budgets.accepted.insert(scalar.name().to_owned(), figures);
        }
    }
    if accept {
        let accepted = toml::to_string(&budgets)?;
        let comment: String = text
            .lines()
            .take_while(|l| l.starts_with('#'))
            .map(|l| format!("{l}\n"))
            .collect();
        std::fs::write(&path, comment + &accepted)?;
        return Ok(true);
    }
    Ok(good)
}

/// What an image costs.
struct Measured {
    figures: Figures,
    /// Whether every operation that does not search takes the same whatever the data.
    constant: bool,
    compiler: String,
}

/// All figures of the images of one scalar.
fn measure(scalar: Scalar) -> Result<Measured, Failure> {
    let mut figures = Figures::new();
    sizes(&image::build(scalar)?, "", &mut figures)?;
    sizes(&image::walking(scalar)?, "walk_", &mut figures)?;
    trial(scalar, &mut figures)?;
    tick(scalar, "tick", motion::sample, &mut figures)?;
    // Every leg needs the consistent solution, all the time.
    tick(scalar, "impossible_tick", motion::impossible, &mut figures)?;
    walk(scalar, &mut figures)?;
    let mut constant = true;
    for image in [
        image::operation_counts(scalar)?,
        image::walk_counts(scalar)?,
    ] {
        constant &= operations(scalar, &image, &mut figures)?;
    }
    Ok(Measured {
        figures,
        constant,
        compiler: compiler(scalar)?,
    })
}

/// The compiler of an image: "rustc version 1.95.0".
fn compiler(scalar: Scalar) -> Result<String, Failure> {
    let image = std::fs::read(image::build(scalar)?)?;
    let file = object::File::parse(&*image)?;
    let comment = file
        .section_by_name(".comment")
        .ok_or("the image names no compiler")?;
    let comment = String::from_utf8_lossy(comment.data()?).into_owned();
    let name = comment.split('\0').find(|name| name.starts_with("rustc"));
    let words = name.unwrap_or_default().split_whitespace().take(3);
    Ok(words.collect::<Vec<_>>().join(" "))
}

/// Bytes of an image in flash and in static RAM.
fn sizes(image: &Path, of: &str, figures: &mut Figures) -> Result<(), Failure> {
    let image = std::fs::read(image)?;
    let file = object::File::parse(&*image)?;
    let (mut flash, mut ram) = (0, 0);
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else {
            continue;
        };
        if sh_flags.0 & elf::SHF_ALLOC.0 == 0 {
            continue;
        }
        // Initialised data lie in flash and are copied to RAM.
        if section.kind() != object::SectionKind::UninitializedData {
            flash += section.size();
        }
        if section.address() >= 0x2000_0000 {
            ram += section.size();
        }
    }
    figures.insert(format!("{of}flash_bytes"), flash);
    figures.insert(format!("{of}static_ram_bytes"), ram);
    Ok(())
}

/// Instructions per tick and the deepest stack, all four legs moving.
fn tick(
    scalar: Scalar,
    name: &str,
    sample: fn(Leg, u64) -> Sample<f64, JOINTS_PER_LEG>,
    figures: &mut Figures,
) -> Result<(), Failure> {
    let steps = || {
        (1..=SAMPLES).map(|n| {
            let instant = Leg::ALL.map(|leg| Some(sample(leg, n)));
            bus_step(n * motion::SAMPLE_US, &instant)
        })
    };
    let mut last = Counters::default();
    let mut hear = |message| {
        // Not the silence after the last sample.
        if let DeviceMessage::Counters(counters) = message
            && counters.time_us <= SAMPLES * motion::SAMPLE_US
        {
            last = counters;
        }
    };
    let mut board = Qemu::boot_fast(&image::build(scalar)?)?;
    replay(steps(), &mut board, &mut hear)?;
    let Load {
        ticks,
        worst,
        total,
        stack_bytes,
        ..
    } = last.load;
    if last
        .legs
        .iter()
        .any(|leg| leg.used == 0 || leg.used != leg.samples)
    {
        return Err("the board did not use every sample".into());
    }
    // One image: the deeper of its stacks.
    let deepest = figures.entry("stack_bytes".into()).or_default();
    *deepest = u64::from(stack_bytes).max(*deepest);
    figures.insert(format!("{name}_worst"), u64::from(worst));
    figures.insert(format!("{name}_mean"), total / u64::from(ticks));
    Ok(())
}

/// Instructions per tick from the zeros of all four legs on, which are on trial until the device has found that their wiring is right.
fn trial(scalar: Scalar, figures: &mut Figures) -> Result<(), Failure> {
    let (mut last, wiring) = (Counters::default(), Cell::new([Wiring::Untested; LEGS]));
    let mut hear = |message| match message {
        DeviceMessage::Counters(counters) => last = counters,
        DeviceMessage::Hello(hello) => wiring.set(hello.wiring),
        _ => {}
    };
    let begins = Leg::ALL.map(motion::hip_out);
    let sample = |leg: Leg, n: u64| motion::sample(leg, begins[leg.index()] + n);
    let mut board = Qemu::boot_fast(&image::build(scalar)?)?;
    let angles = Leg::ALL.map(|leg| sample(leg, 0).q);
    let mut time_us = zeros::set_where_it_rests(&mut board, &angles, &mut hear)?;
    let right = [Wiring::Right; LEGS];
    for n in (0..TRIAL).take_while(|_| wiring.get() != right) {
        let instant = Leg::ALL.map(|leg| Some(sample(leg, n)));
        board.play(&bus_step(time_us, &instant)?, &mut hear)?;
        time_us += motion::SAMPLE_US;
    }
    board.settle(&mut hear)?;
    if wiring.get() != right || last.legs.iter().any(|leg| leg.tried == 0) {
        let heard = wiring.get();
        return Err(format!("the legs of the board are to be right: {heard:?}").into());
    }
    let Load {
        ticks,
        worst,
        total,
        ..
    } = last.load;
    figures.insert("trial_tick_worst".into(), u64::from(worst));
    figures.insert("trial_tick_mean".into(), total / u64::from(ticks));
    Ok(())
}

/// Instructions per tick and the deepest stack of the image for a robot that walks: the committed walks one after the other.
fn walk(scalar: Scalar, figures: &mut Figures) -> Result<(), Failure> {
    let mut last = Counters::default();
    let mut hear = |message| {
        if let DeviceMessage::Counters(counters) = message {
            last = counters;
        }
    };
    let mut board = Qemu::boot_fast(&image::walking(scalar)?)?;
    let mut start = 0;
    for name in ["sway", "trot", "flying", "load"] {
        let samples = walks::samples(name);
        for sample in &samples {
            let mut step = walks::step(sample);
            step.bus.time_us += start;
            board.command(&HostMessage::Imu(step.imu))?;
            board.play(&step.bus, &mut hear)?;
        }
        start += samples.last().map_or(0, |sample| sample.joints.time_us) + 2_000;
    }
    board.settle(&mut hear)?;
    let Load {
        ticks,
        worst,
        total,
        stack_bytes,
        ..
    } = last.load;
    figures.insert("walk_stack_bytes".into(), u64::from(stack_bytes));
    figures.insert("walk_tick_worst".into(), u64::from(worst));
    figures.insert("walk_tick_mean".into(), total / u64::from(ticks));
    Ok(())
}

/// Instructions of the core's operations; whether each that does not search takes the same whatever the data.
fn operations(scalar: Scalar, image: &Path, figures: &mut Figures) -> Result<bool, Failure> {
    let mut constant = true;
    for line in qemu::run(image)?.lines() {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [name, fewest, most] = fields[..] else {
            return Err(format!("unexpected line: {line}").into());
        };
        let (fewest, most): (u64, u64) = (fewest.parse()?, most.parse()?);
        let searches = SEARCHES.iter().find(|(search, _)| name.starts_with(search));
        if most - fewest > searches.map_or(RESOLUTION, |(_, more)| *more) {
            println!(
                "{} {name}: {fewest} to {most} instructions, depending on the data",
                scalar.name()
            );
            constant = false;
        }
        let dearest = figures.entry(name.to_owned()).or_default();
        *dearest = most.max(*dearest);
    }
    Ok(constant)
}

/// Prints a scalar's figures; whether all are accepted.
fn compare(scalar: &str, figures: &Figures, budgets: &Budgets) -> bool {
    let mut good = true;
    println!(
        "{scalar:<18}{:>10}{:>10}{:>10}",
        "measured", "accepted", "target"
    );
    for (name, &measured) in figures {
        let accepted = budgets
            .accepted
            .get(scalar)
            .and_then(|accepted| accepted.get(name))
            .copied();
        let target = budgets.target.get(name).copied();
        let column = |figure: Option<u64>| figure.map_or("-".into(), |figure| figure.to_string());
        let over = accepted.is_none_or(|accepted| measured > accepted + accepted / SLACK);
        let verdict = match (over, target.is_some_and(|target| measured > target)) {
            (true, _) => "  OVER BUDGET",
            (false, true) => "  above the target",
            (false, false) => "",
        };
        println!(
            "{name:<18}{measured:>10}{:>10}{:>10}{verdict}",
            column(accepted),
            column(target)
        );
        good &= !over;
    }
    println!();
    good
}

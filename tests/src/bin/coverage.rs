//! Do the errors hold? `cargo run --release -p proprio-tests --bin coverage [SEEDS [SECONDS]]`.
//!
//! A leg is simulated with bodies 6 % off the CAD and typical friction, fitted by `identify --model`'s engine, and every
//! base parameter that is identified is compared with the truth. Prints `tests/coverage.md`. Three kinds of noise:
//!
//! - *Go2*: the sensors' noise and quanta of a Go2, with dry friction, whose reversals no window sees exactly;
//! - *white*: exact motion without dry friction, torque with independent noise: the statistics alone;
//! - *memory*: the same, torque with first-order autoregressive noise of [`MEMORY`] s.
//!
//! The bound is the inverse of the information that the data's factor holds, without any prior: with white noise the
//! Cramér-Rao bound; with the others what it would be if residuals were independent.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use proprio::criticism::Recording;
use proprio::estimate::Status;
use proprio::identification::{FitOptions, fit_model};
use proprio::model::Model;
use proprio::simulator::{HiddenEffect, Sensors, SimulatedSample, Simulation};
use proprio_core::effect::EffectKind;
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

type Failure = Box<dyn std::error::Error + Send + Sync>;

const LEG: Leg = Leg::FR;
/// Bodies are so far off the CAD.
const INERTIA_ERROR: f64 = 0.06;
/// Standard deviation of the torque's noise where it is made here, N m.
const NOISE: f64 = 0.1;
/// Time in which noise with a memory forgets, s: five windows.
const MEMORY: f64 = 0.1;
/// Two-sided 95 % of a normal distribution.
const NORMAL_95: f64 = 1.959_964;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Noise {
    Go2,
    White,
    Memory,
}

/// Counts over parameters and seeds.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: f64,
    within_95: f64,
    within_3: f64,
    /// Of the deviation for independent residuals.
    independent_95: f64,
    /// Squares of the error over the bound.
    over_bound: f64,
    /// Errors in standard deviations, with their sign: far from zero on average is a bias.
    off: f64,
}

/// What a fit says of each base parameter, by its first standard parameter.
type Told = Vec<(String, Tally)>;
/// Tallies by the base parameter's first standard parameter.
type Tallies = BTreeMap<(Noise, String), Tally>;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|text| text.parse().ok())
        .collect();
    let (seeds, seconds) = (
        numbers.first().copied().unwrap_or(32),
        numbers.get(1).copied().unwrap_or(60),
    );
    match study(seeds, seconds as f64) {
        Ok(tallies) => {
            print(&tallies, seeds, seconds);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("coverage: {error}");
            ExitCode::FAILURE
        }
    }
}

/// All seeds, shared out among the processors.
fn study(seeds: u64, seconds: f64) -> Result<Tallies, Failure> {
    let (next, tallies) = (AtomicU64::new(1), Mutex::new(Tallies::new()));
    let (done, start) = (AtomicU64::new(0), Instant::now());
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || -> Result<(), Failure> {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > seeds {
                return Ok(());
            }
            for (noise, told) in one(seed, seconds)? {
                let mut tallies = tallies.lock().map_err(|_| "a worker panicked")?;
                for (name, tally) in told {
                    tallies.entry((noise, name)).or_default().add(&tally);
                }
            }
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let left = start.elapsed().as_secs_f64() / done as f64 * (seeds - done) as f64;
            eprint!("\r{done} of {seeds} seeds, {:.0} min left   ", left / 60.0);
            if done == seeds {
                eprintln!();
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        threads
            .into_iter()
            .try_for_each(|thread| thread.join().map_err(|_| "a worker panicked")?)
    })?;
    tallies.into_inner().map_err(|_| "a worker panicked".into())
}

/// One seed, with each noise. With exact sensors and no dry friction the motion does not depend on the noise: one for both.
fn one(seed: u64, seconds: f64) -> Result<Vec<(Noise, Told)>, Failure> {
    let real = simulation(seed, seconds, Noise::Go2)?;
    let exact = simulation(seed, seconds, Noise::White)?;
    let samples = |simulation: &Simulation| {
        simulation
            .samples()
            .collect::<Result<Vec<SimulatedSample>, _>>()
    };
    let mut told = vec![(Noise::Go2, fitted(&real, &samples(&real)?)?)];
    let undisturbed = samples(&exact)?;
    for noise in [Noise::White, Noise::Memory] {
        let mut samples = undisturbed.clone();
        disturb(&mut samples, noise, seed, exact.rate);
        told.push((noise, fitted(&exact, &samples)?));
    }
    Ok(told)
}

/// A leg with the four effects; dry friction only where the sensors are a Go2's.
fn simulation(seed: u64, seconds: f64, noise: Noise) -> Result<Simulation, Failure> {
    let mut effects = Vec::new();
    for effect in proprio::parameter::typical_effects(&[LEG]) {
        if noise == Noise::Go2 || effect.effect != EffectKind::Coulomb {
            effects.push(HiddenEffect::try_from(effect)?);
        }
    }
    Ok(Simulation {
        duration: seconds,
        inertia_error: INERTIA_ERROR,
        effects,
        sensors: if noise == Noise::Go2 {
            Sensors::default()
        } else {
            Sensors::ideal()
        },
        seed,
        ..Simulation::new(&[LEG])
    })
}

/// The base parameters that a fit to the samples identifies, against the truth.
fn fitted(simulation: &Simulation, samples: &[SimulatedSample]) -> Result<Told, Failure> {
    let mut model = Model::default();
    let limb = model
        .robot()
        .limbs()
        .into_iter()
        .nth(LEG.index())
        .ok_or("no such limb")?;
    for joint in limb.bodies.clone() {
        for effect in EFFECTS {
            let is_simulated = |e: &HiddenEffect| e.kind().name() == effect.name();
            if simulation.effects.iter().any(is_simulated) {
                model.add_effect(effect, joint);
            }
        }
    }
    let recording = Recording::from_samples(&model, &LEG.joint_names(), samples);
    let fitted = fit_model(&recording, &model, FitOptions::default())?;
    let truth: BTreeMap<String, f64> = simulation
        .truth()
        .into_iter()
        .map(|p| (p.name, p.value))
        .collect();
    let mut all = Vec::new();
    for base in fitted
        .base_parameters
        .iter()
        .filter(|base| base.status == Status::Identified)
    {
        let value: f64 = base
            .terms
            .iter()
            .map(|t| t.coefficient * truth.get(&t.parameter).copied().unwrap_or(f64::NAN))
            .sum();
        let error = (base.value - value).abs();
        let bound = base
            .data_std
            .ok_or("the data leave an identified parameter open")?;
        let tally = Tally {
            count: 1.0,
            within_95: f64::from(error <= NORMAL_95 * base.std),
            within_3: f64::from(error <= 3.0 * base.std),
            independent_95: f64::from(error <= NORMAL_95 * base.std_independent),
            over_bound: (error / bound).powi(2),
            off: (base.value - value) / base.std,
        };
        all.push((base.terms[0].parameter.clone(), tally));
    }
    Ok(all)
}

/// Adds noise to exact torques.
fn disturb(samples: &mut [SimulatedSample], noise: Noise, seed: u64, rate: f64) {
    let keep = match noise {
        Noise::Go2 => return,
        Noise::White => 0.0,
        Noise::Memory => (-1.0 / (MEMORY * rate)).exp(),
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(noise as u64 + 100);
    let mut state: [f64; JOINTS_PER_LEG] = std::array::from_fn(|_| random.sample(StandardNormal));
    for sample in samples {
        for (tau, state) in sample.tau.iter_mut().zip(&mut state) {
            let new: f64 = random.sample(StandardNormal);
            *state = keep * *state + (1.0 - keep * keep).sqrt() * new;
            *tau += NOISE * *state;
        }
    }
}

impl Tally {
    fn cells(&self) -> String {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x / self.count);
        format!(
            "{} | {} | {} | {} | {:.3} | {:+.2}",
            self.count,
            percent(self.within_3),
            percent(self.within_95),
            percent(self.independent_95),
            self.over_bound / self.count,
            self.off / self.count
        )
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.within_95 += other.within_95;
        self.within_3 += other.within_3;
        self.independent_95 += other.independent_95;
        self.over_bound += other.over_bound;
        self.off += other.off;
    }
}

/// What [`Tally::cells`] says.
const HEADING: &str = "number | within 3 σ | 95 % intervals cover | were residuals taken as independent | variance / \
                       bound | mean error, σ";

fn print(tallies: &Tallies, seeds: u64, seconds: u64) {
    println!("# Do the errors hold?\n");
    println!(
        "Made by `cargo run --release -p proprio-tests --bin coverage {seeds} {seconds}`: {seeds} seeds of a simulated FR leg, {seconds} s,"
    );
    println!(
        "bodies 6 % off the CAD; base parameters that are identified. Dry friction with the Go2's noise alone. The bound is that of the data"
    );
    println!(
        "without any prior if residuals are independent: with white noise the Cramér-Rao bound. The prior takes the variance below it.\n"
    );
    println!("| noise | {HEADING} |\n|---|---|---|---|---|---|---|");
    for noise in [Noise::Go2, Noise::White, Noise::Memory] {
        let mut sum = Tally::default();
        tallies
            .iter()
            .filter(|((kind, _), _)| *kind == noise)
            .for_each(|(_, tally)| sum.add(tally));
        println!("| {noise:?} | {} |", sum.cells());
    }
    println!("\nBase parameter by base parameter, named by its first standard parameter:\n");
    println!("| noise | parameter | {HEADING} |\n|---|---|---|---|---|---|---|---|");
    for ((noise, name), tally) in tallies {
        println!("| {noise:?} | {name} | {} |", tally.cells());
    }
}

//! Do the errors hold? `cargo run --release -p proprio-studies --bin coverage [SEEDS [SECONDS]]`.
//!
//! A leg is simulated with bodies 6 % off the CAD and typical friction, fitted by `identify --model`'s engine, and every
//! base parameter that is identified is compared with the truth. Prints `studies/coverage.md`. Three kinds of noise:
//!
//! - *Go2*: the sensors' noise and quanta of a Go2, with dry friction, whose reversals no window sees exactly;
//! - *white*: exact motion without dry friction, torque with independent noise: the statistics alone;
//! - *memory*: the same, torque with first-order autoregressive noise of [`MEMORY`] s.
//!
//! Errors are held against what the fit says of them, and, where nothing but the torque has noise, against the Cramér-Rao
//! bound ([`information`]), which knows the true noise and takes every sample. An estimate that a prior pulls may
//! be better than the bound, so the bound is for a fit to the same data with priors too wide to matter. With a memory the
//! bound is that of generalised least squares with the true covariance; the fit does not know it, takes rows as they come,
//! and owes an honest deviation, not the least one.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use proprio_core::effect::Prior;
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_host::estimate::Status;
use proprio_host::identifiability::BaseParameter;
use proprio_host::identify::{FitOptions, fit_model};
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::hidden::typical;
use proprio_simulator::{HiddenEffect, HiddenKind, Sensors, SimulatedSample, Simulation};
use proprio_studies::information::{self, TorqueNoise};
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
/// Stands for no prior: relative to the CAD, and in SI for an effect.
const NO_PRIOR: f64 = 1e3;
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
    /// Squares of the error over the standard deviation: one on average if that is right.
    over_std: f64,
    /// Squares of the error over the Cramér-Rao bound, without any prior and with it; not a number where there is none.
    over_bound: [f64; 2],
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
    let mut told = vec![(Noise::Go2, fitted(&real, &samples(&real)?, Noise::Go2)?)];
    let undisturbed = samples(&exact)?;
    for noise in [Noise::White, Noise::Memory] {
        let mut samples = undisturbed.clone();
        disturb(&mut samples, noise, seed, exact.rate);
        told.push((noise, fitted(&exact, &samples, noise)?));
    }
    Ok(told)
}

/// A leg with the four effects; dry friction only where the sensors are a Go2's.
fn simulation(seed: u64, seconds: f64, noise: Noise) -> Result<Simulation, Failure> {
    let mut effects = typical(&[LEG]);
    effects.retain(|e| noise == Noise::Go2 || e.kind() != HiddenKind::Coulomb);
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

/// A model of the leg with the simulation's effects.
fn model(simulation: &Simulation) -> Result<Model, Failure> {
    let mut model = Model::default();
    let limbs = model.robot().limbs();
    let limb = limbs.get(LEG.index()).ok_or("no such limb")?;
    for joint in limb.bodies.clone() {
        for effect in EFFECTS {
            let is_simulated = |e: &HiddenEffect| e.kind().name() == effect.name();
            if simulation.effects.iter().any(is_simulated) {
                model.add_effect(effect, joint);
            }
        }
    }
    Ok(model)
}

/// The same with priors too wide to matter.
fn without_prior(model: &Model) -> Result<Model, Failure> {
    let mut model = model.clone();
    model.set_cad_uncertainty(None, NO_PRIOR)?;
    for effect in EFFECTS {
        let (mean, std) = (0.0, NO_PRIOR);
        model.set_general_prior(effect, Prior { mean, std })?;
    }
    Ok(model)
}

/// The base parameters that a fit to the samples identifies, against the truth.
fn fitted(
    simulation: &Simulation,
    samples: &[SimulatedSample],
    noise: Noise,
) -> Result<Told, Failure> {
    let model = model(simulation)?;
    let fit = |model: &Model| {
        let recording = Recording::from_samples(model, &LEG.joint_names(), samples);
        fit_model(&recording, model, FitOptions::default()).map(|fitted| fitted.base_parameters)
    };
    let base = fit(&model)?;
    let none = vec![[f64::NAN; 2]; base.len()];
    let bounds = match noise.of_torque(simulation.rate) {
        None => none,
        Some(noise) => {
            let names: Vec<&str> = base.iter().map(|b| b.terms[0].parameter.as_str()).collect();
            let bound = information::bound(LEG, samples, &names, noise)
                .ok_or("the samples leave a base parameter open")?;
            let free = fit(&without_prior(&model)?)?;
            let values = free.iter().map(|base| base.value);
            values
                .zip(bound)
                .map(|(value, bound)| [value, bound])
                .collect()
        }
    };
    let truth: BTreeMap<String, f64> = simulation
        .truth()
        .into_iter()
        .map(|p| (p.name, p.value))
        .collect();
    let identified = base.iter().zip(bounds);
    let identified = identified.filter(|(base, _)| base.status == Status::Identified);
    let told = identified.map(|(base, bound)| {
        let tally = Tally::of(base, &truth, bound);
        (base.terms[0].parameter.clone(), tally)
    });
    Ok(told.collect())
}

impl Noise {
    /// The torque's noise, where nothing else has any.
    fn of_torque(self, rate: f64) -> Option<TorqueNoise> {
        let correlation = match self {
            Noise::Go2 => return None,
            Noise::White => 0.0,
            Noise::Memory => (-1.0 / (MEMORY * rate)).exp(),
        };
        let std = NOISE;
        Some(TorqueNoise { std, correlation })
    }
}

/// Adds noise to exact torques.
fn disturb(samples: &mut [SimulatedSample], noise: Noise, seed: u64, rate: f64) {
    let Some(TorqueNoise { std, correlation }) = noise.of_torque(rate) else {
        return;
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(noise as u64 + 100);
    let mut state: [f64; JOINTS_PER_LEG] = std::array::from_fn(|_| random.sample(StandardNormal));
    for sample in samples {
        for (tau, state) in sample.tau.iter_mut().zip(&mut state) {
            let new: f64 = random.sample(StandardNormal);
            *state = correlation * *state + (1.0 - correlation * correlation).sqrt() * new;
            *tau += std * *state;
        }
    }
}

impl Tally {
    /// One estimate against the truth; `free` is that without prior.
    fn of(base: &BaseParameter, truth: &BTreeMap<String, f64>, [free, bound]: [f64; 2]) -> Self {
        let of = |name: &str| truth.get(name).copied().unwrap_or(f64::NAN);
        let terms = base.terms.iter();
        let value: f64 = terms.map(|t| t.coefficient * of(&t.parameter)).sum();
        let error = (base.value - value).abs();
        Self {
            count: 1.0,
            within_95: f64::from(error <= NORMAL_95 * base.std),
            within_3: f64::from(error <= 3.0 * base.std),
            independent_95: f64::from(error <= NORMAL_95 * base.std_independent),
            over_std: (error / base.std).powi(2),
            over_bound: [free, base.value].map(|estimate| ((estimate - value) / bound).powi(2)),
            off: (base.value - value) / base.std,
        }
    }

    fn cells(&self) -> String {
        let percent = |x: f64| format!("{:.1} %", 100.0 * x / self.count);
        let [free, held] = self.over_bound.map(|sum| match sum / self.count {
            none if none.is_nan() => "–".to_owned(),
            mean => format!("{mean:.3}"),
        });
        format!(
            "{} | {} | {} | {} | {:.2} | {free} | {held} | {:+.2}",
            self.count,
            percent(self.within_3),
            percent(self.within_95),
            percent(self.independent_95),
            self.over_std / self.count,
            self.off / self.count
        )
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.within_95 += other.within_95;
        self.within_3 += other.within_3;
        self.independent_95 += other.independent_95;
        self.over_std += other.over_std;
        for (sum, other) in self.over_bound.iter_mut().zip(other.over_bound) {
            *sum += other;
        }
        self.off += other.off;
    }
}

/// What [`Tally::cells`] says.
const HEADING: &str = "number | within 3 σ | 95 % intervals cover | were residuals taken as independent | error² / σ² | \
                       error² / bound² without prior | with it | mean error, σ";

/// What the table is of.
const WORDS: &str = "
Fit by `identify --model`, bodies 6 % off the CAD; base parameters that are identified. *Go2*: its sensors' noise and
quanta, and dry friction; *White*: exact motion without dry friction, torque with independent noise; *Memory*: the same,
noise that forgets in 0.1 s, five windows. σ is the standard deviation that the fit states; error² / σ² is one on average
if it is right, and less where the truth is nearer to the prior than the prior says.

The bound is Cramér and Rao's, from every sample and the true noise, stated where nothing but the torque has noise. It is
for unbiased estimates: for a fit to the same data with priors too wide to matter, which with *White* should stay below
1.1. With its priors the fit is better than the bound. With *Memory* the bound is that of least squares weighted by the true
covariance of the noise, which nobody knows of a robot: the fit takes residuals as they come, pays for it in efficiency,
and states deviations that hold all the same.
";

fn print(tallies: &Tallies, seeds: u64, seconds: u64) {
    println!("# Do the errors hold?\n");
    println!(
        "Made by `cargo run --release -p proprio-studies --bin coverage {seeds} {seconds}`: {seeds} seeds of a simulated FR leg, {seconds} s."
    );
    println!("{WORDS}");
    println!("| noise | {HEADING} | least within 3 σ |\n|---|---|---|---|---|---|---|---|---|---|");
    for noise in [Noise::Go2, Noise::White, Noise::Memory] {
        let of = || tallies.iter().filter(|((kind, _), _)| *kind == noise);
        let mut sum = Tally::default();
        of().for_each(|(_, tally)| sum.add(tally));
        // Of a parameter that few seeds identify, a share says little.
        let often = of().filter(|(_, tally)| tally.count >= 0.5 * seeds as f64);
        let least = often
            .min_by(|(_, a), (_, b)| (a.within_3 / a.count).total_cmp(&(b.within_3 / b.count)));
        let least = least.map_or("–".to_owned(), |((_, name), tally)| {
            format!("{:.1} % {name}", 100.0 * tally.within_3 / tally.count)
        });
        println!("| {noise:?} | {} | {least} |", sum.cells());
    }
    println!("\nBase parameter by base parameter, named by its first standard parameter:\n");
    println!("| noise | parameter | {HEADING} |\n|---|---|---|---|---|---|---|---|---|---|");
    for ((noise, name), tally) in tallies {
        println!("| {noise:?} | {name} | {} |", tally.cells());
    }
}

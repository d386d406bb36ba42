//! Synthetic fleets: regressors of simulated motions, right-hand sides of a known truth, every effect among the kept columns.
//!
//! What factors of real rows W would be under another truth follows from their triangle alone: of W = Q R and τ = W θ + e with white e of
//! standard deviation σ, z = R θ + Qᵀ e with Qᵀ e again white, and ρ² is σ² times χ² of as many degrees of freedom as there are rows beyond the columns.
//!
//! Friction has a part that persists from log to log and acts on all joints of a robot, on each by another share, as warmth does.

use std::fmt::Write as _;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use proprio_core::go2::{JointId, Leg};
use proprio_simulator::{SimulatedSample, Simulation};
use proprio_solve::factor::HeapFactor;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::make::factors;
use super::*;
use crate::model::Model;
use crate::recording::Recording;

/// A window's noise, N m, and how many windows ten minutes have for each of those simulated.
const NOISE: f64 = 0.05;
const LONGER: f64 = 20.0;
/// Share of friction that persists, and by how much joints differ in it.
const WARMTH: f64 = 0.03;
const UNLIKE: f64 = 0.3;
/// What all robots have and a plain drive has not, N m s²/rad².
const DRAG: f64 = 0.02;
/// What one robot has at one joint, N m/rad.
const SPRING: f64 = 1.0;
const ODD: (&str, &str) = ("r003", "FR_thigh");
/// Injected drifts: robot, joint, change of Coulomb friction, N m, from a share of the logs on; a step, or a ramp from there.
const DRIFTS: [(&str, &str, f64, bool); 5] = [
    ("r001", "FR_calf", 0.06, false),
    ("r004", "FL_hip", -0.06, false),
    ("r007", "RR_thigh", 0.08, true),
    ("r010", "RL_calf", 0.05, false),
    ("r013", "FL_thigh", 0.10, true),
];
const FROM: f64 = 0.5;

/// The factors of some motions: \[motion\] \[limb\], with columns.
type Motions = Vec<Vec<(Arc<BlockColumns>, Arc<str>, Vec<HeapFactor>)>>;

fn motions() -> &'static Motions {
    static MOTIONS: OnceLock<Motions> = OnceLock::new();
    MOTIONS.get_or_init(simulated)
}

/// Blocks of a few robots: what other tests damage.
pub(super) fn few_blocks(robots: usize, logs: usize) -> Vec<Block> {
    let fleet = Fleet {
        robots,
        logs,
        rho: 0.0,
        seed: 5,
    };
    fleet.make(motions()).blocks
}

fn simulated() -> Motions {
    let model = Model::default();
    let joints: Vec<&str> = Leg::ALL
        .iter()
        .flat_map(|leg| JointId::of(*leg))
        .map(|joint| joint.name())
        .collect();
    let of = |seed: u64| {
        let simulation = Simulation {
            duration: 30.0,
            seed,
            ..Simulation::new(&Leg::ALL)
        };
        let samples: Vec<SimulatedSample> = simulation.samples().map(Result::unwrap).collect();
        let recording = Recording::from_samples(&model, &joints, &samples);
        let limbs = recording.limbs.iter();
        limbs
            .map(|(limb, samples)| {
                let (columns, factors) = factors(&model, limb, samples).unwrap();
                let hash: Arc<str> = Arc::from(columns.hash());
                (columns, hash, factors)
            })
            .collect()
    };
    (1..=3).map(of).collect()
}

/// How a fleet is made.
#[derive(Clone, Copy)]
struct Fleet {
    robots: usize,
    logs: usize,
    rho: f64,
    seed: u64,
}

/// A fleet's blocks and each robot's true values of its limbs' columns.
struct Made {
    blocks: Vec<Block>,
    truth: Vec<Vec<Vec<f64>>>,
}

impl Fleet {
    fn make(self, motions: &Motions) -> Made {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let (mut blocks, mut truth) = (Vec::new(), Vec::new());
        for r in 0..self.robots {
            let (own, limbs) = self.robot(r, motions, &mut normal);
            blocks.extend(own);
            truth.push(limbs);
        }
        Made { blocks, truth }
    }

    /// A robot's blocks, and its true values.
    fn robot(
        self,
        r: usize,
        motions: &Motions,
        normal: &mut impl FnMut() -> f64,
    ) -> (Vec<Block>, Vec<Vec<f64>>) {
        let robot = format!("r{r:03}");
        let limbs: Vec<Vec<f64>> = motions[0]
            .iter()
            .map(|(columns, ..)| robot_truth(&robot, columns, normal))
            .collect();
        let shares: Vec<f64> = (0..12).map(|_| 1.0 + UNLIKE * normal()).collect();
        let (mut blocks, mut warmth) = (Vec::new(), normal());
        for log in 0..self.logs {
            warmth = self.rho * warmth + (1.0 - self.rho * self.rho).sqrt() * normal();
            let motion = &motions[(7 * r + 3 * log + log / 5) % motions.len()];
            for (l, (columns, hash, factors)) in motion.iter().enumerate() {
                let mut now = limbs[l].clone();
                for (k, column) in columns.columns.iter().enumerate() {
                    if matches!(column.kind(), "viscous" | "coulomb") {
                        let joint = columns.place(column.joint()).unwrap();
                        now[k] *= 1.0 + WARMTH * warmth * shares[3 * l + joint];
                    }
                    now[k] += drift(&robot, &column.name, log as f64 / self.logs as f64);
                }
                for (joint, factor) in factors.iter().enumerate() {
                    let name = (robot.as_str(), log);
                    let one = block(name, (columns, hash), (joint, factor), &now, normal);
                    blocks.push(one);
                }
            }
        }
        (blocks, limbs)
    }
}

/// A robot's true values before anything drifts.
fn robot_truth(robot: &str, columns: &BlockColumns, normal: &mut impl FnMut() -> f64) -> Vec<f64> {
    let of = |column: &KeptColumn| {
        let joint = columns.place(column.joint()).unwrap();
        let size = 1.0 + 0.1 * normal();
        match column.kind() {
            "viscous" => (0.05 + 0.04 * joint as f64) * size,
            "coulomb" => (0.25 + 0.1 * joint as f64) * size,
            "armature" => column.mean * (1.0 + 0.02 * normal()),
            "bias" => 0.05 * normal(),
            "quadratic_drag" => DRAG * size,
            "spring" if (robot, column.joint()) == ODD => SPRING,
            _ if column.is_inertial() => column.mean + column.std * normal(),
            _ => 0.0,
        }
    };
    columns.columns.iter().map(of).collect()
}

/// What has been added to a parameter at this part of the time.
fn drift(robot: &str, name: &str, time: f64) -> f64 {
    let of = |(own, joint, size, ramp): &(&str, &str, f64, bool)| {
        let is_it = *own == robot && name.strip_prefix("coulomb:") == Some(joint);
        match is_it && time >= FROM {
            true if *ramp => size * (time - FROM) / (1.0 - FROM),
            true => *size,
            false => 0.0,
        }
    };
    DRIFTS.iter().map(of).sum()
}

fn block(
    (robot, log): (&str, usize),
    (columns, hash): (&Arc<BlockColumns>, &Arc<str>),
    (joint, factor): (usize, &HeapFactor),
    theta: &[f64],
    normal: &mut impl FnMut() -> f64,
) -> Block {
    let of_joint = columns.of_joint(joint);
    let p = of_joint.len();
    let mut numbers = Vec::with_capacity(columns.numbers(joint));
    let longer = LONGER.sqrt();
    for k in 0..p {
        let row: Vec<f64> = factor.row(k)[..p - k].iter().map(|x| longer * x).collect();
        let torque: f64 = row
            .iter()
            .zip(&of_joint[k..])
            .map(|(x, &c)| x * theta[c])
            .sum();
        numbers.extend(row.iter().map(|x| *x as f32));
        numbers.push((torque + NOISE * normal()) as f32);
    }
    let windows = (LONGER * factor.rows()).round();
    let freedom = windows - p as f64;
    // χ² of many degrees of freedom.
    let left = NOISE
        * (freedom + (2.0 * freedom).sqrt() * normal())
            .max(0.0)
            .sqrt();
    numbers.push(left as f32);
    let t0 = 1_790_000_000.0 + 86_400.0 * log as f64;
    Block {
        robot: robot.to_owned(),
        site: None,
        firmware: None,
        log: format!("{robot}-{log}"),
        t0,
        t1: t0 + 600.0,
        received: t0 + 1_000.0,
        limb: columns.limb.clone(),
        joint: columns.joints[joint].clone(),
        fold: 0,
        columns: columns.clone(),
        hash: hash.clone(),
        windows,
        rms: left / windows.sqrt(),
        temperature: None,
        factor: numbers,
        crc32c: 0,
        program: "study".to_owned(),
    }
    .sealed()
}

/// What came out of a fleet.
#[derive(Default)]
struct Outcome {
    factors: usize,
    series: usize,
    found: usize,
    false_drifts: usize,
    /// Of each kind: values within two ±, values.
    covered: std::collections::BTreeMap<String, [usize; 2]>,
    odd: String,
    false_outliers: usize,
    outlier_tests: usize,
    missing: String,
    seconds: f64,
    worst: Vec<String>,
}

fn run(fleet: Fleet, motions: &Motions) -> Outcome {
    let Made { blocks, truth } = fleet.make(motions);
    let mut outcome = Outcome {
        factors: blocks.len(),
        ..Outcome::default()
    };
    let start = Instant::now();
    let mut gate = Gate::default();
    let admitted: Vec<Block> = blocks
        .into_iter()
        .map(|block| gate.admit(block).unwrap())
        .collect();
    let answers = final_answers(partial(admitted));
    outcome.seconds = start.elapsed().as_secs_f64();
    outcome.series = answers.series;
    let is_injected = |robot: &str, name: &str| {
        DRIFTS
            .iter()
            .any(|(own, joint, ..)| *own == robot && name.strip_prefix("coulomb:") == Some(joint))
    };
    for own in &answers.drifts {
        match is_injected(&own.robot, &own.name) {
            true => outcome.found += 1,
            false => {
                outcome.false_drifts += 1;
                outcome.worst.push(format!(
                    "{} {} {} ± {}",
                    own.robot, own.name, own.size, own.std
                ));
            }
        }
    }
    let columns: Vec<&BlockColumns> = motions[0].iter().map(|(columns, ..)| &**columns).collect();
    for own in &answers.values {
        if is_injected(&own.robot, &own.name) {
            continue;
        }
        let r: usize = own.robot[1..].parse().unwrap();
        let places = columns.iter().enumerate();
        let place = |(l, c): (usize, &&BlockColumns)| {
            Some((l, c.columns.iter().position(|k| k.name == own.name)?))
        };
        let (l, k) = places.clone().find_map(place).unwrap();
        let kind = columns[l].columns[k].kind().to_owned();
        let count = outcome.covered.entry(kind).or_default();
        count[0] += usize::from((own.value - truth[r][l][k]).abs() < 2.0 * own.std);
        count[1] += 1;
    }
    for own in &answers.outliers {
        let name = own.name.split_once(':').unwrap();
        match (own.robot.as_str(), name.1) == ODD {
            true => outcome.odd += &format!("{} ", own.name),
            // The injected drift moves a mean: that is no fault.
            false if is_injected(&own.robot, &own.name) => {}
            false => {
                outcome.false_outliers += 1;
                outcome.worst.push(format!(
                    "{} {} {} ± {}",
                    own.robot, own.name, own.difference, own.std
                ));
            }
        }
    }
    outcome.outlier_tests = answers.values.len();
    outcome.missing = answers
        .missing
        .iter()
        .filter(|own| own.is_missing)
        .map(|own| own.effect.clone() + " ")
        .collect();
    outcome
}

impl Outcome {
    fn row(&self, fleet: Fleet, kind: &str) -> String {
        let [inside, all] = self.covered.get(kind).copied().unwrap_or_default();
        format!(
            "| {} | {kind} | {:.1} % of {all} |\n",
            fleet.rho,
            100.0 * inside as f64 / all.max(1) as f64
        )
    }

    fn coverage(&self) -> f64 {
        let sums = self
            .covered
            .values()
            .fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
        sums[0] as f64 / sums[1] as f64
    }

    fn table(&self, fleet: Fleet) -> String {
        format!(
            "| {} | {} × {} | {} of 5 | {} of {} | {} of {} | {}| {}| {:.1} % | {:.0} |\n",
            fleet.rho,
            fleet.robots,
            fleet.logs,
            self.found,
            self.false_drifts,
            self.series,
            self.false_outliers,
            self.outlier_tests,
            self.odd,
            self.missing,
            100.0 * self.coverage(),
            self.factors as f64 / self.seconds,
        )
    }
}

/// What every fleet must show.
fn check(outcome: &Outcome, fleet: Fleet) {
    println!("{}{:?}", outcome.table(fleet), outcome.worst);
    for kind in outcome.covered.keys() {
        print!("{}", outcome.row(fleet, kind));
    }
    assert!(
        outcome.false_drifts * 10_000 <= outcome.series.max(10_000),
        "{:?}",
        outcome.worst
    );
    assert!(
        outcome.odd.split_whitespace().next() == Some("spring:FR_thigh"),
        "{}",
        outcome.odd
    );
    assert!(!outcome.odd.contains("bias"), "{}", outcome.odd);
    assert_eq!(outcome.missing.trim(), "quadratic_drag");
    assert_eq!(outcome.false_outliers, 0, "{:?}", outcome.worst);
    assert!(
        (0.93..0.98).contains(&outcome.coverage()),
        "{}",
        outcome.coverage()
    );
}

fn small(rho: f64) -> Fleet {
    Fleet {
        robots: 60,
        logs: 50,
        rho,
        seed: 11,
    }
}

#[test]
fn a_small_fleets_truth_is_found() {
    let fleet = small(0.0);
    check(&run(fleet, motions()), fleet);
}

/// Friction that persists, and every injected drift.
#[test]
#[ignore = "open: the memory of drifts' series is estimated anew and not yet measured; tests/fleet/table.md"]
fn drifts_are_found_beside_friction_that_persists() {
    for rho in [0.0, 0.9] {
        let fleet = small(rho);
        let outcome = run(fleet, motions());
        check(&outcome, fleet);
        assert_eq!(outcome.found, 5, "injected drifts");
    }
}

/// Greatest memory of this process so far, MB.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes: f64 = line.unwrap().trim_end_matches("kB").trim().parse().unwrap();
    kilobytes / 1000.0
}

/// 2.4 million factors, ten times those of issue 42's fleet, robot by robot as `proprio-fleet` has them: within a gigabyte. It prints processor seconds by the clock.
#[test]
#[ignore = "minutes: memory and time of 2.4 million factors"]
fn ten_times_the_data_is_a_gigabyte_at_most() {
    let fleet = Fleet {
        robots: 400,
        logs: 500,
        rho: 0.0,
        seed: 3,
    };
    let mut random = ChaCha8Rng::seed_from_u64(fleet.seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let (mut limbs, mut factors, mut seconds) = (Vec::new(), 0, [0.0; 4]);
    for r in 0..fleet.robots {
        let (blocks, _) = fleet.robot(r, motions(), &mut normal);
        factors += blocks.len();
        let mut gate = Gate::default();
        let mut start = Instant::now();
        let mut lap = |step: usize| {
            seconds[step] += start.elapsed().as_secs_f64();
            start = Instant::now();
        };
        let admitted: Vec<Block> = blocks
            .into_iter()
            .map(|block| gate.admit(block).unwrap())
            .collect();
        lap(0);
        let kept = partial(admitted);
        lap(1);
        limbs.extend(kept.into_iter().filter_map(solved));
        lap(2);
    }
    let before = peak();
    let start = Instant::now();
    let answers = answers_of(limbs);
    seconds[3] = start.elapsed().as_secs_f64();
    let each = seconds.map(|s| 1e6 * s / factors as f64);
    println!(
        "{factors} factors; gate, partial, solve, answers {each:.1?} µs each; {before:.0}, then {:.0} MB",
        peak()
    );
    assert_eq!(
        (answers.robots, answers.blocks),
        (fleet.robots, fleet.robots * fleet.logs)
    );
    assert!(peak() < 1000.0, "{} MB", peak());
}

/// Makes tests/fleet/table.md; the command stands in it.
#[test]
#[ignore = "minutes: makes tests/fleet/table.md"]
fn the_table_of_large_fleets() {
    let motions = motions();
    let (mut table, mut kinds) = (String::new(), String::new());
    for (rho, seed) in [(0.0, 1), (0.0, 2), (0.9, 1), (0.9, 2)] {
        let fleet = Fleet {
            robots: 200,
            logs: 50,
            rho,
            seed,
        };
        let outcome = run(fleet, motions);
        println!("{}{:?}", outcome.table(fleet), outcome.worst);
        table += &outcome.table(fleet);
        for kind in outcome.covered.keys() {
            kinds += &outcome.row(fleet, kind);
        }
    }
    let mut text = String::from(HEAD);
    let _ = write!(
        text,
        "{table}\n| AR | parameter | within 2 std |\n|---|---|---|\n{kinds}"
    );
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fleet/table.md");
    std::fs::write(path, text).unwrap();
}

const HEAD: &str = "# Synthetic fleets

Regressors of simulated Go2 motions, right-hand sides of a known truth (`host-tools/src/fleet/study.rs`): friction of all joints of a robot varies by 3 % from log to
log, with correlation AR, on each joint by a share of its own (1 ± 0.3). Each parameter of a body is off the CAD by its column's stated standard deviation. Every robot has `quadratic_drag`, which a plain drive lacks; one has a spring at FR_thigh; five
drift in Coulomb friction of one joint by 15–30 % from the middle on. Made by

    cargo test -p proprio-host --lib -- --ignored fleet::study::the_table_of_large_fleets

| AR | robots × logs | drifts found | false drifts, of series | false outliers, of values | named of the odd robot | missing | within 2 std | factors/s, gate to answers |
|---|---|---|---|---|---|---|---|---|
";

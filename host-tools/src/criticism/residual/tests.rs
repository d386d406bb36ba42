//! Error rates of the whole, by seeded Monte Carlo.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// Windows of 20 ms of a chirp from 0.1 to 5 Hz, and a residual.
struct Joint {
    t: Vec<f64>,
    q: Vec<f64>,
    dq: Vec<f64>,
    tau: Vec<f64>,
    residual: Vec<f64>,
    temperature: Vec<f64>,
}

/// A residual's noise.
#[derive(Clone, Copy, Debug)]
struct Noise {
    std: f64,
    /// Share of window-edge noise: each edge's reading enters two windows with opposite signs.
    edge: f64,
    /// AR(1) coefficient of the rest.
    memory: f64,
}

const WHITE: Noise = Noise {
    std: 0.1,
    edge: 0.0,
    memory: 0.0,
};

impl Noise {
    fn series(self, n: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(random) };
        let (mut edge, mut slow) = (normal(), normal());
        (0..n)
            .map(|_| {
                let next = normal();
                let step = (next - edge) * 0.5f64.sqrt();
                edge = next;
                slow = self.memory * slow + (1.0 - self.memory * self.memory).sqrt() * normal();
                self.std * (self.edge.sqrt() * step + (1.0 - self.edge).sqrt() * slow)
            })
            .collect()
    }

    /// γ0 and γ1 over the variance.
    fn neighbours(self) -> f64 {
        -0.5 * self.edge + (1.0 - self.edge) * self.memory
    }
}

impl Joint {
    fn new(n: usize, seed: u64, noise: Noise) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let duration = 0.02 * n as f64;
        let t: Vec<f64> = (0..n).map(|k| 0.02 * (k as f64 + 0.5)).collect();
        let rate = |t: f64| 0.6 + 30.0 * t / duration;
        let phase = |t: f64| 0.6 * t + 15.0 * t * t / duration + seed as f64;
        let residual = noise.series(n, &mut random);
        let q: Vec<f64> = t.iter().map(|&t| 0.3 * phase(t).sin()).collect();
        let predicted = t
            .iter()
            .map(|&t| 2.0 * phase(t).sin() + 0.5 * phase(t).cos());
        Self {
            tau: predicted.zip(&residual).map(|(p, e)| p + e).collect(),
            dq: t.iter().map(|&t| 0.3 * rate(t) * phase(t).cos()).collect(),
            temperature: t
                .iter()
                .map(|t| 30.0 + 10.0 * (1.0 - (-t / 5.0).exp()))
                .collect(),
            q,
            t,
            residual,
        }
    }

    /// Adds to the residual and to the measured torque.
    fn with(mut self, error: impl Fn(&Self, usize) -> f64) -> Self {
        let errors: Vec<f64> = (0..self.t.len()).map(|k| error(&self, k)).collect();
        for (k, error) in errors.into_iter().enumerate() {
            self.residual[k] += error;
            self.tau[k] += error;
        }
        self
    }

    fn series(&self) -> Series<'_> {
        Series {
            joint: "FR_calf",
            t: &self.t,
            q: &self.q,
            dq: &self.dq,
            tau: &self.tau,
            residual: &self.residual,
            temperature: Some(&self.temperature),
            contact: None,
        }
    }

    fn criticise(&self) -> Criticism {
        criticise(&[self.series()]).remove(0)
    }
}

const COLOURED: Noise = Noise {
    std: 0.1,
    edge: 0.4,
    memory: 0.6,
};

const EDGE: Noise = Noise { edge: 1.0, ..WHITE };
const HALF: Noise = Noise { edge: 0.5, ..WHITE };
const SEEDS: u64 = 400;

fn joints(seeds: u64, noise: Noise) -> impl Iterator<Item = (Joint, Runs)> {
    (0..seeds).map(move |seed| {
        let joint = Joint::new(1000, seed, noise);
        let runs = Runs::of(&joint.t);
        (joint, runs)
    })
}

/// At a level of 1 %, 400 trials give more than 3 % alarms once in ten thousand times.
const ALARMS: std::ops::Range<f64> = 0.0..0.03;

#[test]
fn white_noise_and_noise_of_window_edges_pass_as_white() {
    for noise in [WHITE, EDGE, HALF] {
        let tests = joints(SEEDS, noise)
            .map(|(joint, runs)| correlation::whiteness(&joint.series(), &runs).unwrap());
        let tests: Vec<Whiteness> = tests.collect();
        let alarms = tests.iter().filter(|w| !w.white).count() as f64 / SEEDS as f64;
        assert!(ALARMS.contains(&alarms), "{noise:?}: {alarms}");
        let outside = tests
            .iter()
            .flat_map(|w| &w.autocorrelation)
            .map(|c| c.value.abs() > c.band);
        let outside: Vec<bool> = outside.collect();
        let share = outside.iter().filter(|o| **o).count() as f64 / outside.len() as f64;
        assert!(
            (0.005..0.02).contains(&share),
            "{noise:?}: {share} of lags outside their bands"
        );
    }
}

#[test]
fn noise_with_memory_is_not_white() {
    let noise = Noise {
        memory: 0.8,
        ..WHITE
    };
    for (joint, runs) in joints(100, noise) {
        assert!(
            !correlation::whiteness(&joint.series(), &runs)
                .unwrap()
                .white
        );
    }
}

/// Whatever the memory of the noise: a chirp moves slowly at first, so that a band for white residuals would be far too narrow.
#[test]
fn noise_is_independent_of_the_motion() {
    for noise in [WHITE, EDGE, COLOURED] {
        let tests = joints(SEEDS, noise)
            .map(|(joint, runs)| correlation::independence(&joint.series(), &runs));
        let tests: Vec<Vec<Independence>> = tests.collect();
        for input in 0..4 {
            let of_input = || tests.iter().map(|t| &t[input]);
            let alarms = of_input().filter(|i| !i.independent).count() as f64 / SEEDS as f64;
            assert!(
                ALARMS.contains(&alarms),
                "{noise:?} {:?}: {alarms}",
                tests[0][input].input
            );
            let values = || of_input().flat_map(|i| &i.correlation);
            let outside = values().filter(|c| c.value.abs() > c.band).count() as f64;
            let share = outside / values().count() as f64;
            assert!(
                (0.004..0.025).contains(&share),
                "{noise:?} {:?}: {share} outside",
                tests[0][input].input
            );
        }
    }
}

/// Nine variables on each of twelve joints: at a false discovery rate of 1 % one robot in a hundred shows a false pattern.
#[test]
fn no_pattern_is_found_in_noise() {
    for noise in [WHITE, HALF, COLOURED] {
        let mut false_alarms = 0;
        for robot in 0..15 {
            let joints: Vec<Joint> = (0..12)
                .map(|joint| Joint::new(1000, 100 * robot + joint, noise))
                .collect();
            let series: Vec<Series> = joints.iter().map(Joint::series).collect();
            let found = criticise(&series);
            false_alarms += usize::from(found.iter().any(|c| !c.patterns.is_empty()));
        }
        assert!(false_alarms <= 1, "{noise:?}: {false_alarms} of 15 robots");
    }
}

/// The floor is right on average and within its error, whether the noise is white, of window edges, or under slow structure.
#[test]
fn the_noise_floor_is_found_to_five_per_cent() {
    let slow = |joint: &Joint, k: usize| 0.5 * (6.0 * joint.t[k]).sin() + 0.05 * joint.t[k];
    let cases: [(&str, Noise, bool); 4] = [
        ("white", WHITE, false),
        ("half", HALF, false),
        ("edge", EDGE, false),
        ("slow", WHITE, true),
    ];
    for (name, noise, structured) in cases {
        let floors: Vec<NoiseFloor> = (0..200)
            .map(|seed| {
                let joint = Joint::new(1000, seed, noise);
                let joint = if structured { joint.with(slow) } else { joint };
                noise::floor(&joint.series(), &Runs::of(&joint.t)).unwrap()
            })
            .collect();
        let per = 1.0 / floors.len() as f64;
        let mean = floors.iter().map(|f| f.rms).sum::<f64>() * per / noise.std - 1.0;
        let error = floors
            .iter()
            .map(|f| (f.rms / noise.std - 1.0).powi(2))
            .sum::<f64>()
            * per;
        let said = floors.iter().map(|f| f.rms_std).sum::<f64>() * per / noise.std;
        println!(
            "{name}: mean {mean:+.4}, error {:.4}, said {said:.4}",
            error.sqrt()
        );
        assert!(mean.abs() < 0.02, "{name}: {mean}");
        assert!(error.sqrt() < 0.05, "{name}: {}", error.sqrt());
        assert!(
            (0.7..1.4).contains(&(said / error.sqrt())),
            "{name}: {said} for {}",
            error.sqrt()
        );
        let neighbours = floors.iter().map(|f| match f.method {
            NoiseMethod::HighFrequency { neighbours } => neighbours,
            NoiseMethod::RepeatedPeriods { .. } => panic!("a chirp has no period"),
        });
        let neighbours = neighbours.sum::<f64>() * per;
        assert!(
            (neighbours - noise.neighbours()).abs() < 0.1,
            "{name}: {neighbours}"
        );
    }
}

/// Structure faster than windows can tell from noise, but the same in each period.
#[test]
fn a_periodic_motion_tells_noise_from_fast_structure() {
    for seed in 0..20 {
        let mut joint = Joint::new(1000, seed, HALF);
        let wave = |t: f64| (std::f64::consts::TAU * t / 1.4).sin();
        joint.q = joint.t.iter().map(|&t| 0.3 * wave(t)).collect();
        let joint =
            joint.with(|joint, k| 0.4 * wave(joint.t[k]).signum() + 0.2 * wave(13.0 * joint.t[k]));
        let floor = noise::floor(&joint.series(), &Runs::of(&joint.t)).unwrap();
        let NoiseMethod::RepeatedPeriods { period } = floor.method else {
            panic!("{floor:?}");
        };
        assert!(
            (period / 1.4).fract().min(1.0 - (period / 1.4).fract()) < 0.01,
            "{floor:?}"
        );
        assert!(
            (floor.rms / HALF.std - 1.0).abs() < 4.0 * floor.rms_std / HALF.std,
            "{floor:?}"
        );
    }
}

/// What goes wrong in each case, and the variable and shape that tell it.
type Case = (&'static str, fn(&Joint, usize) -> f64, Variable, Shape, f64);

const CASES: [Case; 9] = [
    ("offset", |_, _| 0.1, Variable::Constant, Shape::Offset, 0.1),
    (
        "friction",
        |j, k| 0.2 * j.dq[k].signum(),
        Variable::Velocity,
        Shape::Step,
        0.2,
    ),
    (
        "viscous",
        |j, k| 0.1 * j.dq[k],
        Variable::Velocity,
        Shape::Viscous,
        0.1,
    ),
    (
        "even",
        |j, k| 0.1 * j.dq[k].abs(),
        Variable::Speed,
        Shape::Even,
        0.1,
    ),
    (
        "spring",
        |j, k| 0.5 * j.q[k],
        Variable::Position,
        Shape::Spring,
        0.5,
    ),
    (
        "drift",
        |j, k| 0.02 * j.t[k],
        Variable::Time,
        Shape::Drift,
        0.02,
    ),
    (
        "load friction",
        |j, k| 0.2 * (j.tau[k] - j.residual[k]).abs() * j.dq[k].signum(),
        Variable::Load,
        Shape::LoadFriction,
        0.2,
    ),
    (
        "warmth",
        |j, k| 0.03 * (j.temperature[k] - 37.5),
        Variable::Temperature,
        Shape::Warmth,
        0.03,
    ),
    (
        "too much friction",
        |j, k| -0.2 * j.dq[k].signum(),
        Variable::Velocity,
        Shape::Step,
        -0.2,
    ),
];

#[test]
fn each_pattern_is_recognised() {
    for (name, error, variable, shape, size) in CASES {
        for noise in [HALF, COLOURED] {
            let criticism = Joint::new(1000, 3, noise).with(error).criticise();
            let strongest = criticism.patterns.first();
            let Some(found) = strongest else {
                panic!("{name}: nothing found\n{criticism}");
            };
            println!("{name}\n{criticism}");
            assert_eq!(
                (found.variable, found.shape),
                (variable, Some(shape)),
                "{name}\n{criticism}"
            );
            let [value, std] = found.size.unwrap();
            assert!(
                (value - size).abs() < 5.0 * std + 0.05 * size.abs(),
                "{name}: {value} ± {std}"
            );
        }
    }
}

#[test]
fn cogging_is_recognised_with_its_frequency() {
    let cog = |joint: &Joint, k: usize| 0.2 * (std::f64::consts::TAU * 12.0 * joint.q[k]).sin();
    // Slow enough for windows not to average it away.
    let mut joint = Joint::new(2000, 5, WHITE);
    joint.q = joint.t.iter().map(|t| 0.3 * (1.1 * t).sin()).collect();
    joint.dq = joint.t.iter().map(|t| 0.33 * (1.1 * t).cos()).collect();
    let criticism = joint.with(cog).criticise();
    let found = criticism
        .patterns
        .iter()
        .find(|p| p.variable == Variable::Position)
        .unwrap();
    let Some(Shape::Periodic { per_radian, .. }) = found.shape else {
        panic!("{criticism}");
    };
    assert!((per_radian - 12.0).abs() < 1.0, "{criticism}");
}

/// Both of two errors are told, each with its size.
#[test]
fn two_patterns_are_told_apart() {
    let error = |joint: &Joint, k: usize| 0.3 * joint.dq[k].signum() + 0.03 * joint.t[k];
    let criticism = Joint::new(1000, 4, HALF).with(error).criticise();
    let size = |shape: Shape| {
        let found = criticism.patterns.iter().find(|p| p.shape == Some(shape));
        found
            .unwrap_or_else(|| panic!("no {shape:?}\n{criticism}"))
            .size
            .unwrap()[0]
    };
    assert!((size(Shape::Step) - 0.3).abs() < 0.05, "{criticism}");
    assert!((size(Shape::Drift) - 0.03).abs() < 0.005, "{criticism}");
    assert_eq!(criticism.patterns.len(), 2, "{criticism}");
    assert!(criticism.structure_remains());
}

/// Gravity goes with position: a spring and a torque scale are told as look-alikes.
#[test]
fn look_alikes_are_told() {
    let criticism = Joint::new(1000, 4, HALF)
        .with(|joint, k| 0.8 * joint.q[k])
        .criticise();
    let found = &criticism.patterns[0];
    assert_eq!(
        (found.shape, found.alternatives.as_slice()),
        (Some(Shape::Spring), &[Shape::Gain][..]),
        "{criticism}"
    );
    let echo = criticism
        .everywhere
        .iter()
        .find(|w| w.variable == Variable::Load)
        .unwrap();
    assert_eq!(echo.echo_of, Some(Variable::Position), "{criticism}");
}

/// Nothing panics and nothing is found where there is nothing: no windows, few windows, a joint at rest, a perfect model.
#[test]
fn empty_and_silent_series_are_no_trouble() {
    for n in [0, 1, 2, 10, 200] {
        for residual in [0.0, 0.1] {
            let zero = vec![0.0; n];
            let t: Vec<f64> = (0..n).map(|k| 0.02 * k as f64).collect();
            let series = Series {
                joint: "FR_hip",
                t: &t,
                q: &zero,
                dq: &zero,
                tau: &zero,
                residual: &vec![residual; n],
                temperature: None,
                contact: Some(&zero),
            };
            let found = criticise(&[series]).remove(0);
            let told = found.patterns.len();
            assert!(
                told <= 1 && (residual > 0.0 || told == 0),
                "{n} {residual}: {found}"
            );
        }
    }
}

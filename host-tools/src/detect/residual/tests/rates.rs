//! Error rates by seeded Monte Carlo.

use super::*;

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
        let bounds = floors.iter().filter(|f| f.upper_bound).count();
        assert!(
            bounds <= 4,
            "{name}: {bounds} of 200 are called upper bounds"
        );
        let neighbours = floors.iter().map(|f| match f.method {
            NoiseMethod::HighFrequency { neighbours } => neighbours,
            _ => panic!("a chirp has no period"),
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

/// Friction at 5 Hz is too fast to tell from noise: the floor says that it is an upper bound.
#[test]
fn a_floor_under_fast_structure_is_an_upper_bound() {
    for (joint, runs) in joints(20, WHITE) {
        let joint = joint.with(|joint, k| 0.5 * joint.dq[k].signum());
        let floor = noise::floor(&joint.series(), &runs).unwrap();
        assert!(floor.upper_bound && floor.rms > WHITE.std, "{floor:?}");
    }
}

//! Whether a walk's gyro and accelerometer read what such sensors read, before anything is fitted: their units, their signs, gravity, dead columns.
//!
//! A cause is named only if its own score agrees; what these scores do not decide stays for the fit ([`super::doubtful`]).
//!
//! - *accelerometer*: the mean specific force over a second is gravity's, whatever the gait and the mounting.
//! - *gyro*: planted feet tell how fast the base turns about gravity, from the encoders alone. The gyro's rate along the mean specific
//!   force is the same number for any mounting, for both sensors turn together. Roll and pitch depend on the mounting and are not asked; nor is gravity's
//!   direction, which horizontal accelerations move more than a trotting trunk does.

use nalgebra::Vector3;
use proprio_core::tree::GRAVITY;

use super::error::FreeBaseError;
use super::legged::Legged;
use super::walk::Walk;
use crate::equation::free_tree::Pose;
use crate::robust;

/// Specific forces are averaged over this time, s: two steps or more of a trot, in which a vertical velocity changes by less than 1 m/s.
const MEAN: f64 = 1.0;
/// Fewer such means decide nothing.
const LEAST_MEANS: usize = 4;
/// The middle mean specific force may be this share of gravity's 9.81 m/s². Of MuJoCo's and the simulator's walks it is 0.95 to 1.01 (`tests/oracle/walk`: trot, hop,
/// flying trot, swung by hand); places on Earth and scale errors make some per cent, an accelerometer that clips impacts up to a fifth.
const PLAUSIBLE: [f64; 2] = [0.67, 1.5];
/// Half of the means are this share of a unit's gravity, if it is the unit.
const OF_UNIT: [f64; 2] = [0.8, 1.2];
/// Half of the samples differ from their mean by less than this share of gravity, for feet carry at most half of the time twice the weight: a hop 1.
const LARGEST_MOTION: f64 = 1.2;
/// Other units of a specific force, m/s²: standard gravity (ISO 80000-3), by which data sheets of accelerometers count.
const UNITS: [(&str, f64); 2] = [("g", 9.806_65), ("milli-g", 9.806_65e-3)];

/// Feet are followed over this time, s: a tenth of a step, and hundreds of quanta of an encoder.
const FOLLOW: f64 = 0.02;
/// More pairs of postures than of this many need not be asked: an hour's cost is bounded.
const MOST_POSTURES: usize = 20_000;
/// Planted pairs of feet are found among three feet or more: of two, one swings for most of a walk.
const LEAST_FEET: usize = 3;
/// The least correlation, of either sign, of the gyro's rate about gravity with the feet's. Of MuJoCo's walks it is 0.45 to 1.00, of the simulator's
/// trots 0.35 to 0.52; of robots whose trunk is held (`tests/oracle/walk/swung.csv.gz`) −0.17, and those decide nothing.
const LEAST_CORRELATION: f64 = 0.3;
/// The feet's rate per gyro's, where the unit is right: 0.24 to 0.89 of the same walks, below one for feet roll, slip and swing. Degrees make it 57 times as small.
const SLOPE: [f64; 2] = [0.1, 1.5];

/// Judges a log's sensors.
///
/// # Errors
/// [`FreeBaseError::Imu`].
pub(super) fn judge(walk: &Walk, robot: &Legged) -> Result<(), FreeBaseError> {
    let cause = match walk.imu {
        true => fault(walk, robot),
        false => None,
    };
    cause.map_or(Ok(()), |cause| {
        Err(FreeBaseError::Imu {
            path: walk.path.clone(),
            cause,
        })
    })
}

/// The first cause whose score agrees, and its remedy.
fn fault(walk: &Walk, robot: &Legged) -> Option<String> {
    let means = means(walk);
    if means.len() < LEAST_MEANS {
        return None;
    }
    dead(walk)
        .or_else(|| specific_force(walk, &means))
        .or_else(|| turning(walk, robot))
}

/// A sensor that never changes while the other one does. Both are constant in a noise-free log of a trunk at rest, but an accelerometer feels
/// gravity there.
fn dead(walk: &Walk) -> Option<String> {
    let constant = |all: &[Vector3<f64>]| all.iter().all(|own| *own == all[0]);
    let [gyro, acc] = [constant(&walk.gyro), constant(&walk.acc)];
    let how = |all: &[Vector3<f64>]| match all[0] == Vector3::zeros() {
        true => "zero",
        false => "constant",
    };
    let dead = |columns: &str, all: &[Vector3<f64>]| {
        format!(
            "{columns} are {} in all samples: record the sensor",
            how(all)
        )
    };
    if acc && (!gyro || walk.acc[0] == Vector3::zeros()) {
        Some(dead("acc/x|y|z", &walk.acc))
    } else if gyro && !acc {
        Some(dead("gyro/x|y|z", &walk.gyro))
    } else {
        None
    }
}

/// Means over [`MEAN`] after [`MEAN`] of the specific force as it was read. A step turns the trunk by little, so the IMU's axes will do.
fn means(walk: &Walk) -> Vec<Vector3<f64>> {
    let mut means = Vec::new();
    for piece in walk.pieces() {
        let mut first = piece.start;
        loop {
            let last = walk.index_at(walk.seconds(first) + MEAN);
            if last >= piece.end {
                break;
            }
            let own = &walk.acc[first..last];
            means.push(own.iter().sum::<Vector3<f64>>() / own.len() as f64);
            first = last;
        }
    }
    means
}

/// Whether the specific force is gravity on average; else in which unit it is, or that gravity is taken out.
fn specific_force(walk: &Walk, means: &[Vector3<f64>]) -> Option<String> {
    let share = |share: f64| robust::quantile(means.iter().map(Vector3::norm), share);
    let quartiles = [share(0.25)?, share(0.75)?];
    let middle = share(0.5)?;
    let lies = |x: f64, [least, most]: [f64; 2], of: f64| (least * of..=most * of).contains(&x);
    if lies(middle, PLAUSIBLE, GRAVITY) {
        return None;
    }
    let mean = means.iter().sum::<Vector3<f64>>() / means.len() as f64;
    let motion = robust::median(walk.acc.iter().map(|acc| (acc - mean).norm()))?;
    let is_unit = |one: f64| {
        quartiles.iter().all(|q| lies(*q, OF_UNIT, one)) && motion < LARGEST_MOTION * one
    };
    let unit = UNITS.iter().find(|(_, of)| is_unit(GRAVITY / of));
    Some(match unit {
        Some((name, of)) => format!(
            "acc/x|y|z are in {name}: their mean over a second is {middle:.3}, gravity is 9.81 m/s²; multiply them by {of}"
        ),
        None if middle < PLAUSIBLE[0] * GRAVITY && motion > middle => format!(
            "acc/x|y|z have gravity removed: their mean over a second is {middle:.2} m/s², of an accelerometer 9.81, and they differ \
             from it by {motion:.2}; record the raw accelerometer, not the linear acceleration"
        ),
        None => format!(
            "acc/x|y|z are not in m/s²: their mean over a second is {middle:.3}, gravity is 9.81 m/s²; convert them, or record the raw accelerometer"
        ),
    })
}

/// Whether the base turns about gravity as its planted feet show.
fn turning(walk: &Walk, robot: &Legged) -> Option<String> {
    let Turning {
        correlation,
        slope,
        upright,
    } = follow(walk, robot)?;
    if correlation.is_nan() || correlation.abs() < LEAST_CORRELATION {
        return None;
    }
    let degrees = 1f64.to_degrees();
    let lies = |slope: f64| (SLOPE[0]..=SLOPE[1]).contains(&slope.abs());
    let by = format!(
        "by the planted feet the base turns {slope:.3} times as fast about gravity (correlation {correlation:.2})"
    );
    if lies(slope * degrees) {
        Some(format!(
            "gyro/x|y|z are in °/s: {by}; multiply them by {:.7}",
            1f64.to_radians()
        ))
    } else if lies(slope) && slope < 0.0 {
        // The rate along the specific force has the other sign if either sensor has; the feet are under the base.
        let columns = match upright {
            true => "gyro/x|y|z",
            false => "acc/x|y|z",
        };
        Some(format!(
            "{columns} have the opposite sign: {by}; multiply them by −1"
        ))
    } else {
        None
    }
}

/// The feet's rate of turning about gravity against the gyro's.
struct Turning {
    correlation: f64,
    /// The feet's per gyro's.
    slope: f64,
    /// Whether the specific force points away from the feet, by the mounting that is stated.
    upright: bool,
}

/// Of each posture and the one [`FOLLOW`] later, the pair of feet whose distance in the base changes least: planted feet move as the base turns, a foot
/// in swing is five times as fast.
fn follow(walk: &Walk, robot: &Legged) -> Option<Turning> {
    let span = ((FOLLOW / walk.period.max(1e-6)).round() as usize).max(1);
    let stride = (span / 2).max(walk.len() / MOST_POSTURES).max(1);
    let feet = robot.feet.iter().filter_map(|foot| foot.points.first());
    let feet: Vec<_> = feet.collect();
    if feet.len() < LEAST_FEET {
        return None;
    }
    let mut pose = Pose::default();
    let mut places = |n: usize| -> Vec<Vector3<f64>> {
        robot.tree.place(&walk.q[n], &mut pose);
        feet.iter().map(|foot| foot.place(&pose)).collect()
    };
    // One glitch of the accelerometer is one direction of many.
    let directions = walk.acc.iter().filter_map(|acc| acc.try_normalize(0.0));
    let felt = directions.sum::<Vector3<f64>>().try_normalize(0.0)?;
    let mut under = Vector3::zeros();
    // Of each posture: the pair of feet, one as seen from the other, per its length, its rate of change; and the gyro's mean.
    let mut pairs = Vec::new();
    for n in (0..walk.len().saturating_sub(span)).step_by(stride) {
        let (last, time) = (n + span, walk.seconds(n + span) - walk.seconds(n));
        if time > 2.0 * span as f64 * walk.period {
            continue;
        }
        let [before, after] = [places(n), places(last)];
        under += before.iter().sum::<Vector3<f64>>();
        let pair = |(i, j): (usize, usize)| {
            let [own, then] = [before[i] - before[j], after[i] - after[j]];
            let length = own.norm().max(f64::MIN_POSITIVE);
            [
                (own + then) / (2.0 * length),
                (then - own) / (time * length),
            ]
        };
        let all = (0..feet.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let slowest = all
            .map(pair)
            .min_by(|a, b| a[1].norm().total_cmp(&b[1].norm()));
        let gyro = walk.gyro[n..=last].iter().sum::<Vector3<f64>>() / (span + 1) as f64;
        pairs.extend(slowest.map(|pair| (pair, gyro)));
    }
    let up = -under.try_normalize(0.0)?;
    // A planted pair e changes by −ω × e: along e × up by what the base turns about up.
    let [mut both, mut feet, mut gyro] = [0.0; 3];
    let [mut turns, mut rates] = [0.0; 2];
    for ([own, rate], turning) in &pairs {
        turns += turning.norm_squared();
        rates += rate.norm_squared();
        let aside = own.cross(&up);
        let lever = aside.norm();
        if lever > 0.0 {
            let [by_feet, by_gyro] = [rate.dot(&aside) / lever, turning.dot(&felt) * lever];
            both += by_feet * by_gyro;
            feet += by_feet * by_feet;
            gyro += by_gyro * by_gyro;
        }
    }
    // Nothing planted turns faster than the base, |ω × e| ≤ |ω| |e|: rms 0.4 to 0.8 times as fast in walks, twice in a robot that is swung by hand, whose
    // legs turn the base against their own motion.
    if rates > turns {
        return None;
    }
    Some(Turning {
        correlation: both / (feet * gyro).sqrt(),
        slope: both / gyro,
        upright: (robot.imu.rotation * felt).dot(&up) > 0.0,
    })
}

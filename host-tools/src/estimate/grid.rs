//! Where the parameters are searched in which a torque is far from linear: the values of each [`Grid`] at a joint of a limb.

use proprio_core::effect::{EffectKind, Enters, Grid, Shapes};

use super::limb_data::LimbData;
use crate::equation::values::{NO_SHAPES, Place, Values};

/// Multiples of the gear ratio that harmonics are looked for at.
pub(super) const MULTIPLES: usize = 48;
/// Limits that are looked for, evenly up to the largest torque.
const LIMITS: usize = 40;
/// Torques that a small one is looked for at: from this share of the joint's greatest, where the noise of a drive's torque is, to this, from which
/// on its effect is one on the torque's scale, each so many times the one before.
const SMALL_TORQUES: usize = 8;
const SMALLEST_TORQUE: f64 = 0.003;
const LARGEST_SMALL: f64 = 0.2;
/// Speeds that a shape of friction is looked for at, each so many times the one before.
const SPEEDS: usize = 12;
const FASTER: f64 = 1.45;
/// Where friction levels off is looked for from this share of the joint's greatest speed, below which it is Coulomb friction, to
/// nearly all of it, beyond which it is viscous.
const SLOWEST: f64 = 0.015;
/// Displacements that presliding friction is looked for at: from what the samples resolve to this share of the joint's travel; over
/// a larger one friction is a spring.
const DISPLACEMENTS: usize = 14;
const FARTHEST: f64 = 0.1;
/// The smallest gap that is tried (rad), each so many times as wide as the one before, and how many.
pub(super) const SMALLEST: f64 = 2e-3;
const WIDER: f64 = 1.6;
const GAPS: i32 = 8;
/// Resonances of springs that are tried, from this multiple of the motion's usual frequency on, each so many times the one before: the
/// torque is far from what a column says of it up to three times the motion's frequency.
const LOWEST: f64 = 0.8;
const HIGHER: f64 = 1.25;
const RESONANCES: i32 = 14;
/// Beyond them the link follows without swinging, its torque is nearly linear in the compliance, and wider steps do: up to some 240 times the
/// motion's frequency, where a link lags by 2·10⁻⁵ of how far it swings.
const STIFFER: f64 = 1.6;
const STIFF: i32 = 6;
/// Positions and times that a shape is looked for at. A step in the middle of two is off by a fiftieth of the range, and is refined.
const PLACES: usize = 24;
/// Spatial frequencies that a shape is looked for at, in steps of a quarter turn of phase over the travel: up to eight turns.
const FREQUENCIES: usize = 32;
const SPACING: f64 = 0.5 * std::f64::consts::PI;
/// How many of a grid's values differ from each other as far as chance can tell: neighbouring speeds, limits and gaps look much the
/// same.
const DIFFERENT: f64 = 4.0;

/// The value next to this one that a parameter of an effect may have.
pub(crate) fn possible((effect, n): (EffectKind, usize), shape: f64) -> f64 {
    let parameter = &effect.description().parameters[n];
    shape.clamp(parameter.lower, parameter.upper)
}

/// Whether the best value of one of an effect's grids stands alone: between two of them the torque is another one.
pub(super) fn is_narrow(effect: EffectKind) -> bool {
    let mut grids = effect.description().all_searched();
    grids.any(|(_, grid)| matches!(grid, Grid::Harmonics | Grid::Frequencies))
}

/// Whether the grid's columns are a sine and a cosine of each multiple of one frequency.
pub(super) fn is_harmonic(effect: EffectKind) -> bool {
    matches!(effect.description().searched(), Some((_, Grid::Harmonics)))
}

/// How far parameter `n` of an effect moves that changes by the whole of its size: the value itself where it is one, for a place the range of its grid.
pub(crate) fn size_of(data: &LimbData, (place, n): (Place, usize), shape: f64) -> f64 {
    let range = match place.0.description().parameters[n].grid {
        Some(Grid::Positions) => {
            let [from, to] = data.motion.positions(place.1);
            to - from
        }
        Some(Grid::Times) => {
            let [from, to] = times(data);
            to - from
        }
        Some(Grid::Evenly { least, most, .. }) => most - least,
        _ => shape.abs(),
    };
    range.max(f64::MIN_POSITIVE)
}

/// How many different shapes of an effect are tried, as far as they differ: chance alone makes one of them look good.
pub(crate) fn tried(effect: EffectKind) -> f64 {
    let description = effect.description();
    let tried = description.all_searched().map(|(_, grid)| match grid {
        Grid::Harmonics => MULTIPLES as f64,
        Grid::Frequencies => FREQUENCIES as f64,
        Grid::Positions | Grid::Times | Grid::Evenly { .. } => PLACES as f64,
        _ if description.enters != Enters::Derivative => DIFFERENT,
        // What has a column is tried by that.
        _ => 1.0,
    });
    tried.product()
}

/// Of each parameter of an effect that is searched the values to try, within what is physical; `torque` is what its joint's drive gives at a sample,
/// N m.
pub(super) fn grids(
    data: &LimbData,
    values: &Values,
    place: Place,
    torque: &dyn Fn(usize) -> f64,
) -> Vec<Vec<f64>> {
    let of = |(n, grid): (usize, Grid)| {
        let all = tried_shapes((data, values), (place, n), grid, torque).into_iter();
        all.map(|shape| possible((place.0, n), shape)).collect()
    };
    place.0.description().all_searched().map(of).collect()
}

fn tried_shapes(
    (data, model): (&LimbData, &Values),
    (place, n): (Place, usize),
    grid: Grid,
    torque: &dyn Fn(usize) -> f64,
) -> Vec<f64> {
    match grid {
        Grid::Torques | Grid::SmallTorques => {
            let torques = (0..data.motion.time.len()).map(torque);
            let most = torques.fold(0.0f64, |most, torque| most.max(torque.abs()));
            if grid == Grid::SmallTorques {
                let [least, most] = [SMALLEST_TORQUE, LARGEST_SMALL].map(|share| share * most);
                return geometric(least, most, SMALL_TORQUES);
            }
            (LIMITS / 4..LIMITS)
                .map(|k| most * k as f64 / LIMITS as f64)
                .collect()
        }
        Grid::Gaps | Grid::Resonances => values_to_try(data, model, place),
        _ => {
            let least = least_displacement_of(data, (place, n));
            let range = MotionRange::of(data, place.1, least);
            values(grid, &range).unwrap_or_default()
        }
    }
}

impl MotionRange {
    /// Of a joint of a limb.
    pub(crate) fn of(data: &LimbData, joint: usize, least_displacement: f64) -> Self {
        let trajectory = &data.motion.joint[joint];
        let speeds = trajectory.speed.iter();
        Self {
            gear: gear(data, joint),
            positions: data.motion.positions(joint),
            times: times(data),
            least_displacement,
            fastest: speeds.fold(0.0f64, |most, speed| most.max(speed.abs())),
            speed_noise: trajectory.speed_noise,
        }
    }
}

/// The least displacement that an effect may have and a joint's samples resolve, rad.
fn least_displacement_of(data: &LimbData, ((effect, joint), n): (Place, usize)) -> f64 {
    let state = &data.motion.joint[joint].state;
    let square: f64 = state.iter().map(|state| state[2] * state[2]).sum();
    let acceleration = (square / state.len().max(1) as f64).sqrt();
    least_displacement(acceleration, data.recording.period())
        .max(effect.description().parameters[n].lower)
}

/// When the recording of a limb begins and ends, s.
fn times(data: &LimbData) -> [f64; 2] {
    let time = &data.motion.time;
    [time.first(), time.last()].map(|end| end.copied().unwrap_or_default())
}

/// A joint's gear ratio; one where the motor is not known.
pub(super) fn gear(data: &LimbData, joint: usize) -> f64 {
    let body = &data.model.robot().bodies()[data.limb.bodies.start + joint];
    body.motor.map_or(1.0, |motor| motor.gear)
}

/// What of a joint's motion a grid is made of.
pub(crate) struct MotionRange {
    /// Gear ratio.
    pub(crate) gear: f64,
    /// The least and the greatest position, rad.
    pub(crate) positions: [f64; 2],
    /// When the log begins and ends, s.
    pub(crate) times: [f64; 2],
    /// The least displacement to look for, rad ([`least_displacement`]).
    pub(crate) least_displacement: f64,
    /// Greatest speed, rad/s, and that below which it may be noise.
    pub(crate) fastest: f64,
    pub(crate) speed_noise: f64,
}

/// The values of a grid where a joint moves so; `None` of one that depends on its torque.
pub(crate) fn values(grid: Grid, range: &MotionRange) -> Option<Vec<f64>> {
    let speeds = |first: f64| (0..SPEEDS as i32).map(move |k| first * FASTER.powi(k));
    let [from, to] = range.positions;
    let travel = to - from;
    let within = |least: f64, most: f64, count: usize| {
        // No shape at the ends: there one side of it has no data.
        let step = (most - least) / (count + 1) as f64;
        (1..=count).map(|k| least + step * k as f64).collect()
    };
    Some(match grid {
        Grid::Harmonics => (1..=MULTIPLES).map(|k| k as f64 * range.gear).collect(),
        Grid::Displacements => {
            let least = range.least_displacement;
            geometric(least, (FARTHEST * travel).max(least), DISPLACEMENTS)
        }
        Grid::SpeedsOfMotion => speeds(range.fastest * SLOWEST).collect(),
        Grid::SpeedsAboveNoise => speeds(range.speed_noise).collect(),
        Grid::Values { least, most, count } => geometric(least, most, count),
        Grid::Positions => within(from, to, PLACES),
        Grid::Times => within(range.times[0], range.times[1], PLACES),
        Grid::Evenly { least, most, count } => within(least, most, count),
        Grid::Frequencies => (1..=FREQUENCIES)
            .map(|k| k as f64 * SPACING / travel.max(f64::MIN_POSITIVE))
            .collect(),
        Grid::Torques | Grid::SmallTorques | Grid::Gaps | Grid::Resonances => return None,
    })
}

/// The least displacement that samples resolve, rad: from where a joint turns round it goes ½ a T² in a sampling period T, s, with
/// a the root mean square of its acceleration, rad/s².
pub(crate) fn least_displacement(acceleration: f64, period: f64) -> f64 {
    0.5 * acceleration * period.powi(2)
}

/// How far the neighbours of a gap or a compliance that is known are, a factor.
pub(super) fn step_near(effect: EffectKind) -> f64 {
    match effect.description().searched() {
        Some((_, Grid::Resonances)) => HIGHER * HIGHER,
        _ => WIDER,
    }
}

/// The gaps (rad) or compliances (rad/(N m)) that are tried where none is known, from least to most.
pub(crate) fn values_to_try(data: &LimbData, values: &Values, place: Place) -> Vec<f64> {
    if !matches!(
        place.0.description().searched(),
        Some((_, Grid::Resonances))
    ) {
        return (0..GAPS).map(|k| SMALLEST * WIDER.powi(k)).collect();
    }
    let inertia = (data.motion).mean_inertia(&data.body, values, place.1);
    let lowest = LOWEST * usual_frequency(data, place.1);
    let compliance = |resonance: f64| (inertia * resonance.powi(2)).recip();
    let highest = lowest * HIGHER.powi(RESONANCES - 1);
    let stiff = (1..=STIFF).rev().map(|k| highest * STIFFER.powi(k));
    let swinging = (0..RESONANCES).rev().map(|k| lowest * HIGHER.powi(k));
    stiff.chain(swinging).map(compliance).collect()
}

/// Of a second shape one value in so many is tried beside each of the first: half to twice it, which a refinement finds its way from.
const SECOND: usize = 3;

/// Each value of a first grid beside some of a second, if there is one.
pub(crate) fn pairs(grids: &[Vec<f64>]) -> Vec<Shapes> {
    let none = [NO_SHAPES[1]];
    let first = grids.first().map_or(&none[..], Vec::as_slice);
    let second = grids.get(1).map_or(&none[..], Vec::as_slice);
    let beside = |&second: &f64| first.iter().map(move |&first| [first, second]);
    let second = second
        .iter()
        .skip(SECOND / 2 * usize::from(second.len() > 1));
    second.step_by(SECOND).flat_map(beside).collect()
}

/// So many values from the least to the most, each as many times the one before.
fn geometric(least: f64, most: f64, count: usize) -> Vec<f64> {
    let step = (most / least).powf(1.0 / (count - 1) as f64);
    (0..count as i32).map(|k| least * step.powi(k)).collect()
}

/// Acceleration over velocity of a joint, root mean squares, rad/s.
fn usual_frequency(data: &LimbData, joint: usize) -> f64 {
    let state = &data.motion.joint[joint].state;
    let square = |n: usize| state.iter().map(|state| state[n] * state[n]).sum::<f64>();
    (square(2) / square(1).max(f64::MIN_POSITIVE))
        .sqrt()
        .max(1.0)
}

//! A walk's windows, folded into one square-root factor per block of time.

use nalgebra::Vector3;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::plausible;
use proprio_core::factor::{Factor, packed_len};
use proprio_core::go2::{self, JOINTS, JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use proprio_core::window::{
    FreeBasePush, FreeBaseSample, FreeBaseSetup, FreeBaseWindow, Plausible, Sample, Settings,
};
use serde::Serialize;

use super::stance::Stance;
use super::walk::Walk;

/// Bodies, the base first.
pub(super) const BODIES: usize = JOINTS + 1;
/// Velocity coordinates.
pub(super) const COORDINATES: usize = JOINTS + 6;
/// The effects of every joint, in the order of their columns.
pub(super) const EFFECTS: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
    EffectKind::Bias,
];
/// Inertial columns, the effects' and the accelerometer's.
pub(super) const COLUMNS: usize = INERTIAL * BODIES + EFFECTS.len() * JOINTS + 3;
/// Where the accelerometer's columns begin.
pub(super) const ACC: usize = COLUMNS - 3;

type Window = FreeBaseWindow<f64, BODIES, COORDINATES, JOINTS, LEGS, 12, 4, [EffectKind; 4]>;
/// A factor over all columns.
pub(super) type WholeFactor = Factor<f64, Vec<f64>>;

/// Around a touch-down this much time to both sides belongs to no window, s.
const IMPACT: f64 = 0.004;
/// Windows have at least this many samples.
const LEAST_STEPS: f64 = 2.5;

/// What became of the time of a log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Windows {
    /// Windows with rows.
    pub used: u64,
    /// … of them with so many feet that may carry a force, from none to four.
    pub by_feet: [u64; LEGS + 1],
    /// Equations in them that contact forces leave.
    pub equations: u64,
    /// Windows lost because a foot touched down or lifted off too soon after they began.
    pub cut: u64,
    /// Windows lost to an impact.
    pub impact: u64,
    /// Windows lost to a gap.
    pub gap: u64,
    /// Samples that cannot be true.
    pub rejected: u64,
}

impl Windows {
    pub(super) fn plus(self, other: &Self) -> Self {
        Self {
            used: self.used + other.used,
            by_feet: std::array::from_fn(|f| self.by_feet[f] + other.by_feet[f]),
            equations: self.equations + other.equations,
            cut: self.cut + other.cut,
            impact: self.impact + other.impact,
            gap: self.gap + other.gap,
            rejected: self.rejected + other.rejected,
        }
    }
}

/// One block of time.
pub(super) struct Block {
    pub(super) factor: WholeFactor,
    /// Equations in it.
    pub(super) equations: f64,
}

/// What the rows are made with.
pub(super) struct RowSetup {
    pub(super) tree: Tree<f64, BODIES, COORDINATES>,
    pub(super) imu: Transform<f64>,
    pub(super) scale: [f64; COORDINATES],
    pub(super) acc_bias: Vector3<f64>,
}

pub(super) fn empty() -> WholeFactor {
    Factor::in_storage(COLUMNS, vec![0.0; packed_len(COLUMNS)])
        .expect("the storage has the length asked for")
}

/// Folds a walk into blocks of `seconds`, and counts.
pub(super) fn fold(
    walk: &Walk,
    stance: &Stance,
    setup: &RowSetup,
    seconds: f64,
) -> (Vec<Block>, Windows) {
    let settings = settings(walk.period);
    let mut window = Box::new(Window::new(
        setup.tree,
        EFFECTS,
        FreeBaseSetup {
            imu: setup.imu,
            feet: go2::feet(),
            scale: setup.scale,
            plausible: all_plausible(),
            settings,
            acc_bias: setup.acc_bias,
        },
    ));
    let impacts: Vec<f64> = (0..walk.len())
        .filter(|n| stance.touch_down[*n])
        .map(|n| walk.seconds(n))
        .collect();
    let mut blocks: Vec<Block> = Vec::new();
    let mut counts = Windows::default();
    let mut open = false;
    let mut row = vec![0.0; COLUMNS + 1];
    for n in 0..walk.len() {
        let t = walk.seconds(n);
        let next = impacts.partition_point(|i| *i < t - IMPACT);
        if impacts.get(next).is_some_and(|i| *i <= t + IMPACT) {
            counts.impact += u64::from(open);
            open = false;
            window.clear();
            continue;
        }
        let push = window.push(&sample(walk, stance, n));
        open = true;
        match push {
            FreeBasePush::Closed => {
                let rows = window.rows();
                let block = (rows.span_us[0] as f64 * 1e-6 / seconds) as usize;
                while blocks.len() <= block {
                    blocks.push(Block {
                        factor: empty(),
                        equations: 0.0,
                    });
                }
                for c in 0..COORDINATES {
                    rows.write_row(c, &mut row);
                    // The column is of what the bias is beyond the one taken off: of the whole bias with this on the right.
                    row[COLUMNS] += (0..3)
                        .map(|n| row[ACC + n] * setup.acc_bias[n])
                        .sum::<f64>();
                    // Samples are checked to be finite, so the rows are, and no fold refuses them.
                    let _ = blocks[block].factor.update(&mut row);
                }
                blocks[block].equations += rows.rank as f64;
                counts.used += 1;
                counts.equations += rows.rank as u64;
                counts.by_feet[LEGS - (rows.rank - 6).div_ceil(3).min(LEGS)] += 1;
            }
            FreeBasePush::Cut => counts.cut += 1,
            FreeBasePush::Gap => counts.gap += 1,
            FreeBasePush::Rejected(_) => counts.rejected += 1,
            FreeBasePush::Used | FreeBasePush::Repeated | FreeBasePush::Late => {}
        }
    }
    (blocks, counts)
}

/// Windows of twice the usual length, for the gyro's noise at a window's ends counts the less the longer it is; longer ones at a
/// low rate.
fn settings(period: f64) -> Settings {
    let us = |seconds: f64| (seconds * 1e6) as u64;
    let usual = Settings::default();
    Settings {
        window_us: (2 * usual.window_us).max(us(LEAST_STEPS * period)),
        max_gap_us: usual.max_gap_us.max(us(1.6 * period)),
        ..usual
    }
}

fn sample(walk: &Walk, stance: &Stance, n: usize) -> FreeBaseSample<f64, JOINTS, LEGS> {
    FreeBaseSample {
        joints: Sample {
            time_us: walk.time_us[n],
            q: walk.q[n],
            dq: walk.dq[n],
            tau: walk.tau[n],
        },
        gyro: walk.gyro[n],
        acc: walk.acc[n],
        down: walk.down[n],
        loaded: stance.loaded[n],
    }
}

fn all_plausible() -> [Plausible<f64>; JOINTS] {
    std::array::from_fn(|j| plausible(Leg::ALL[j / JOINTS_PER_LEG])[j % JOINTS_PER_LEG])
}

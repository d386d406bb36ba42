//! The whole robot, walking, on a microcontroller: IMU and joints in, the robot's mass, its trunk, its legs and their friction out; one bounded
//! step at a time, without stored data.
//!
//! What the desktop's `identify --free-base` does with a log in memory, here with 32 ms of samples:
//!
//! 1. `smoother`: joint velocities from positions, the gyro smoothed, gravity's direction.
//! 2. `stance`: which feet may carry a force.
//! 3. `window`: rows of 40 ms in the freely falling frame, forces at loaded feet eliminated; `leg` has a leg's kinematics.
//! 4. `columns`: 145 columns that are independent of each other, and what the CAD says of them.
//! 5. [`crate::factor::ArrowFactor`]: six rows of the base and three of each leg in the air, folded in over several steps.
//! 6. `solution`: the factor and the priors in one triangle of the same size, whose end is the trunk and with it the robot's mass.
//!
//! [`Walker::step`] is to be called once for each sample of 2 ms, after [`Walker::push`] if there is one; both take the same
//! instructions whatever the data, but for whether a window closes.

mod columns;
mod counts;
mod leg;
mod pose;
mod rows;
mod smoother;
mod solution;
pub mod stance;
#[cfg(test)]
mod tests;
mod window;

pub use columns::{ACC, BIAS, COLUMNS, EFFECTS, OWN, REST, TRUNK, WalkPrior, inertial_parameters};
pub use counts::WalkCounts;
pub use solution::WalkEstimate;

use crate::estimator::floor;
use crate::factor::{ArrowFactor, Block, Factor, FactorError, Folding, ROWS, packed_len};
use crate::go2::{self, ACTUATORS, JOINTS, JOINTS_PER_LEG, LEGS, Leg};
use crate::slot::Slot;
use crate::spatial::Transform;
use crate::tree::Tree;
use crate::window::sequence::implausible;
use crate::window::{Plausible, Sample};
use crate::{Real, scalar::real};
use leg::INERTIA;
use nalgebra::{Matrix3, Vector3};
use pose::Ready;
use rows::WalkRows;
use smoother::{GravityLength, Quiet, Smoother};
use solution::Solution;
use stance::Judge;
use window::{Advance, WalkWindow};

/// Length of a window, µs: twice that of a robot that hangs, for half of the equations.
pub const WINDOW_US: u64 = 40_000;
/// Samples further apart than this are not bridged, µs.
const MAX_GAP_US: u64 = 10_000;
/// No gyro of a robot reads more, rad/s, and no accelerometer, m/s².
const MOST_GYRO: f64 = 60.0;
const MOST_ACC: f64 = 400.0;

/// Numbers of the base's triangle that one step changes at most: six rows are folded in in five steps.
const STEP_NUMBERS: usize = 2_200;

/// Columns of a leg's triangle.
const LIMB: usize = OWN + BIAS;
/// The factors of a Go2 that walks.
pub type WalkFactor<T> =
    ArrowFactor<T, LEGS, OWN, REST, BIAS, { packed_len(LIMB) }, { packed_len(COLUMNS) }>;

/// One measurement of the whole robot; SI, joint side, SDK order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkSample<T: Real> {
    /// The joints.
    pub joints: Sample<T, JOINTS>,
    /// Angular velocity, rad/s, in the IMU's axes.
    pub gyro: Vector3<T>,
    /// Specific force, m/s², in the IMU's axes: what an accelerometer reads.
    pub acc: Vector3<T>,
    /// What the feet's sensors read, in any unit; constant, or NaN, of sensors that read nothing.
    pub count: [T; LEGS],
}

impl<T: Real> WalkSample<T> {
    const NOTHING: Self = Self {
        joints: Sample {
            time_us: 0,
            q: [T::ZERO; JOINTS],
            dq: [T::ZERO; JOINTS],
            tau: [T::ZERO; JOINTS],
        },
        gyro: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
        acc: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
        count: [T::ZERO; LEGS],
    };
}

/// The factors and the triangle that is solved, beside the walker: all zeros at first.
pub struct WalkMemory<T> {
    factor: WalkFactor<T>,
    prior: WalkPrior<T>,
    work: [T; packed_len(COLUMNS)],
}

impl<T: Real> WalkMemory<T> {
    /// No data, a constant.
    pub const fn new() -> Self {
        Self {
            factor: WalkFactor::empty(),
            prior: WalkPrior::empty(),
            work: [T::ZERO; packed_len(COLUMNS)],
        }
    }

    /// What is known of the data.
    pub fn factor(&self) -> &WalkFactor<T> {
        &self.factor
    }
}

impl<T: Real> Default for WalkMemory<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// No rotation and no translation either, where a constant is needed.
const fn no_transform<T: Real>() -> Transform<T> {
    let o = T::ZERO;
    Transform {
        rotation: Matrix3::new(o, o, o, o, o, o, o, o, o),
        translation: Vector3::new(o, o, o),
    }
}

/// The rows of a window on their way into the factor.
#[derive(Clone, Debug)]
struct Waiting<T> {
    /// The base's, and how far they are folded in.
    rows: WalkRows<T>,
    folding: Folding,
    busy: bool,
    /// The legs' rows of two windows, and of how many there are.
    limbs: [[[T; ROWS]; LIMB + 1]; LEGS],
    windows: usize,
    /// The leg to fold next; none beyond the last.
    limb: usize,
}

/// The walking robot: samples, window, and what is being folded in and solved.
pub struct Walker<T: Real> {
    smoother: Smoother<T>,
    length: GravityLength<T>,
    last: Slot<Quiet<T>>,
    judge: Judge<T>,
    window: WalkWindow<T>,
    waiting: Waiting<T>,
    solution: Solution<T>,
    late_us: u64,
    counts: WalkCounts,
}

impl<T: Real> Walker<T> {
    /// A walker that has to [`begin`](Self::begin); all zeros, a constant for statics.
    pub const fn unset() -> Self {
        Self {
            smoother: Smoother::new(),
            length: GravityLength::new(),
            last: Slot::Empty,
            judge: Judge::new(),
            window: WalkWindow::unset(),
            waiting: Waiting {
                rows: WalkRows::zero(),
                folding: Folding::from(0),
                busy: false,
                limbs: [[[T::ZERO; ROWS]; LIMB + 1]; LEGS],
                windows: 0,
                limb: 0,
            },
            solution: Solution::new(),
            late_us: 0,
            counts: WalkCounts::ZERO,
        }
    }

    /// Becomes that of a Go2 with its IMU at `imu` in the base, and forgets all data. For the start: the priors take some millions of
    /// instructions.
    ///
    /// # Errors
    /// None with the Go2's constants: as [`WalkPrior::make`].
    #[inline(never)]
    pub fn begin(
        &mut self,
        memory: &mut WalkMemory<T>,
        imu: &Transform<T>,
    ) -> Result<(), FactorError> {
        let robot = robot();
        self.smoother.begin();
        self.length = GravityLength::new();
        self.last = Slot::Empty;
        self.judge.begin(imu);
        self.window.begin(&robot, imu, WINDOW_US);
        self.waiting.busy = false;
        self.waiting.windows = 0;
        self.waiting.limb = LEGS;
        self.waiting
            .limbs
            .as_flattened_mut()
            .as_flattened_mut()
            .fill(T::zero());
        self.solution.begin();
        self.late_us = 0;
        self.counts = WalkCounts::ZERO;
        memory.factor.clear();
        memory.factor.set_floor(floor());
        memory
            .prior
            .make(&robot, &mut memory.work[..columns::PRIOR_WORK])
    }

    /// What became of samples and windows.
    pub fn counts(&self) -> &WalkCounts {
        &self.counts
    }

    /// Whether a window is open.
    pub fn has_window(&self) -> bool {
        self.window.is_open()
    }

    /// Takes a sample; what it says is in the rows 32 ms later.
    #[inline(never)]
    pub fn push(&mut self, sample: &WalkSample<T>) {
        count(&mut self.counts.samples);
        if self.is_implausible(sample) {
            return count(&mut self.counts.rejected);
        }
        let now = sample.joints.time_us;
        let mut step_us = 0;
        if let Some(last) = self.smoother.last() {
            let (a, b) = (&sample.joints, &last.joints);
            if now <= b.time_us {
                let again = core::mem::replace(&mut self.late_us, now);
                if again == 0 || now <= again {
                    return count(&mut self.counts.late);
                }
                // The clock was set back.
                self.restart();
            } else if a.q == b.q && a.dq == b.dq && a.tau == b.tau {
                return count(&mut self.counts.repeated);
            } else if now - b.time_us > MAX_GAP_US {
                self.restart();
            } else {
                step_us = now - b.time_us;
            }
        }
        self.late_us = 0;
        if let Some(quiet) = self.smoother.push(sample, step_us) {
            self.judge_next(&quiet);
        }
    }

    /// After a gap: the samples before it are of no use to those after it.
    fn restart(&mut self) {
        count(&mut self.counts.gaps);
        self.smoother.restart();
        self.length.restart();
        self.judge.restart();
        self.last = Slot::Empty;
        self.window.clear();
    }

    fn is_implausible(&self, sample: &WalkSample<T>) -> bool {
        let within = |v: &Vector3<T>, most: f64| v.iter().all(|x| x.abs() <= real(most));
        let imu = within(&sample.gyro, MOST_GYRO) & within(&sample.acc, MOST_ACC);
        !imu || implausible(&limits(), &sample.joints).is_some()
    }

    fn judge_next(&mut self, quiet: &Quiet<T>) {
        if let Some(last) = self.last.get() {
            self.length.add(last, quiet);
        }
        self.last = Slot::Full(*quiet);
        let window = &mut self.window;
        let Some(judged) = self.judge.push(quiet, window.legs()) else {
            return;
        };
        count(&mut self.counts.judged);
        for (air, loaded) in self.counts.air.iter_mut().zip(judged.loaded) {
            *air = air.wrapping_add(u32::from(!loaded));
        }
        if judged.impact {
            let lost = u32::from(window.clear());
            self.counts.impact = self.counts.impact.wrapping_add(lost);
            return;
        }
        let sample = &judged.quiet.sample;
        let ready = Ready {
            time_us: sample.joints.time_us,
            q: sample.joints.q,
            dq: sample.joints.dq,
            tau: sample.joints.tau,
            gyro: sample.gyro,
            acc: sample.acc,
            down: judged.quiet.down,
        };
        // Rows of a window that closes while the one before is being folded in have no place.
        let free = !self.waiting.busy;
        let mut closed = false;
        if window.differs(judged.loaded) {
            closed = window.cut(&mut self.waiting.rows, free);
            let lost = u32::from(!closed);
            self.counts.cut = self.counts.cut.wrapping_add(lost);
        }
        match window.advance(&ready, judged.loaded, &mut self.waiting.rows, free) {
            Advance::Used => {}
            Advance::Closed => closed = true,
            Advance::Singular => count(&mut self.counts.singular),
        }
        if closed {
            match free {
                true => self.take(),
                false => count(&mut self.counts.unfolded),
            }
        }
    }

    /// Begins to fold the rows of a closed window.
    fn take(&mut self) {
        let waiting = &mut self.waiting;
        let numbers = waiting.rows.base.as_flattened().iter();
        let numbers = numbers.chain(waiting.rows.joints.as_flattened());
        let probe = numbers.fold(T::zero(), |sum, x| sum + *x * T::zero());
        if probe != T::zero() {
            return count(&mut self.counts.unfolded);
        }
        waiting.lay_limbs();
        waiting.folding = Folding::from(0);
        waiting.busy = true;
        count(&mut self.counts.windows);
        let equations = &mut self.counts.equations;
        *equations = equations.wrapping_add(waiting.rows.equations as u32);
    }

    /// One bounded part of what is to be done: folding first, then the solution. True when a solution is ready:
    /// [`estimate`](Self::estimate).
    #[inline(never)]
    pub fn step(&mut self, memory: &mut WalkMemory<T>) -> bool {
        let waiting = &mut self.waiting;
        if waiting.busy {
            // Looked at already, and of the right length.
            let folded =
                memory
                    .factor
                    .fold_base(&mut waiting.folding, STEP_NUMBERS, &mut waiting.rows.base);
            waiting.busy = folded.is_ok() && !waiting.folding.is_done(COLUMNS);
            return false;
        }
        if let Some(block) = waiting.limbs.get_mut(waiting.limb) {
            let folded = memory.factor.fold_limb(waiting.limb, block);
            block.as_flattened_mut().fill(T::zero());
            waiting.limb += 1;
            if folded.is_err() {
                count(&mut self.counts.unfolded);
            }
            return false;
        }
        self.solution
            .advance(memory, &self.length.row(), self.counts.equations)
    }

    /// Begins a solution of all data so far, if none is under way; some 200 [`step`](Self::step)s later it is ready.
    pub fn solve(&mut self) {
        self.solution.start();
    }

    /// The last solution.
    pub fn estimate(&self, memory: &WalkMemory<T>) -> WalkEstimate<T> {
        self.solution.estimate(&memory.prior)
    }

    /// All columns' parameters by the last solution: leg by leg 21 of its bodies and, joint by joint, viscous and Coulomb friction, rotor, bias;
    /// then the trunk with what the legs hand to it, and the accelerometer's bias.
    pub fn parameters(&self) -> &[T; COLUMNS] {
        self.solution.parameters()
    }
}

impl<T: Real> Waiting<T> {
    /// Lays the legs' rows beside those of the window before; two windows make six rows.
    fn lay_limbs(&mut self) {
        let slot = JOINTS_PER_LEG * (self.windows & 1);
        for (j, row) in self.rows.joints.iter().enumerate() {
            let (leg, joint) = (j / JOINTS_PER_LEG, j % JOINTS_PER_LEG);
            let Some(block) = self.limbs.get_mut(leg) else {
                break;
            };
            let (bodies, rest) = row.split_at(INERTIA);
            let (effects, rest) = rest.split_at(EFFECTS);
            let mut put = |column: usize, numbers: &[T]| {
                let columns = block.get_mut(column..).unwrap_or(&mut []);
                for (to, x) in columns.iter_mut().zip(numbers) {
                    if let Some(to) = to.get_mut(slot + joint) {
                        *to = *x;
                    }
                }
            };
            put(0, bodies);
            put(INERTIA + EFFECTS * joint, effects);
            put(OWN, rest);
        }
        self.windows = self.windows.wrapping_add(1);
        if slot > 0 {
            self.limb = 0;
        }
    }
}

/// The robot. Not inlined, like what is made of it: what making it takes of the stack is given back before the next takes its own.
#[inline(never)]
fn robot<T: Real>() -> Tree<T, 13, 18> {
    go2::free()
}

/// What the joints can do.
fn limits<T: Real>() -> [Plausible<T>; JOINTS] {
    let legs = Leg::ALL.map(crate::estimator::plausible);
    core::array::from_fn(|j| legs[j / JOINTS_PER_LEG][j % JOINTS_PER_LEG])
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

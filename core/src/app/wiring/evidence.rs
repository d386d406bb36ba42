//! How well a leg's windows agree with its CAD under one hypothesis after the other, in parts of bounded cost.
//!
//! Each joint has a least squares of its own: viscous and Coulomb friction, armature, bias, and the base parameters of the bodies it moves, with
//! the CAD's prior on these and the data sheet's on the armature. What is left of the torque, and of the priors, says how unlikely the
//! hypothesis makes the readings. The rows are the momentum form's ([`crate::window`]); of a window only its ends are kept, between which
//! the motion is the cubic that they determine.

use super::WINDOWS;
use super::hypothesis::{HYPOTHESES, Reading, Said, mend};
use crate::Real;
use crate::app::messages::single;
use crate::effect::Prior;
use crate::estimator::{BASE_RANK, FRONT, LegBase};
use crate::factor::{Block, Factor, FactorError, ROWS, packed_len};
use crate::go2::{ACTUATORS, Actuator, JOINTS_PER_LEG};
use crate::regressor::leg::{COLUMNS, LegFrame, MOMENTA, RATES};
use crate::scalar::{ln, real, sqrt};
use crate::wire::Fault;

/// What a window's mean torque is off by where the hypothesis is right, N m: what friction leaves that Coulomb and viscous do not explain. In five
/// recorded chirps of a Go2 it is 0.08 to 0.3 at hips and thighs and 0.1 to 0.4 at calves.
pub(super) const NOISE: [f32; JOINTS_PER_LEG] = [0.1, 0.1, 0.2];
/// The least that it can be, N m: a velocity's noise at a window's ends times the rotor's and the leg's inertia.
pub(super) const LEAST_NOISE: [f32; JOINTS_PER_LEG] = [0.02, 0.02, 0.04];
/// What a mean square in units of the noise is taken to be besides: what is left counts no longer where it is less than half the noise.
const FLOOR: f64 = 0.25;
/// How far beyond its stops a joint's angle may read, rad: zeros are set by eye and hand.
const ZERO_ERROR: f32 = 0.1;

/// Priors of viscous (N m s/rad) and Coulomb friction (N m) and bias (N m): means and deviations of what Go2s were measured to have (0.01 to 0.7;
/// 0.1 to 0.6, calf to 1.5; −0.2 to 0.2). Narrower than the catalogue's, which must not rule out what is merely rare. The armature's is the
/// data sheet's, within half of it.
const VISCOUS: Prior = Prior {
    mean: 0.1,
    std: 0.2,
};
const COULOMB: Prior = Prior {
    mean: 0.3,
    std: 0.4,
};
const BIAS: Prior = Prior {
    mean: 0.0,
    std: 0.2,
};

/// Columns of a joint.
const fn columns(joint: usize) -> usize {
    FRONT + BASE_RANK[joint % JOINTS_PER_LEG]
}

/// Columns of the hip, the longest, and its torque.
const LONGEST: usize = columns(0) + 1;

/// Blocks of windows, each folded in in a part: all, and those of a round that only sorts out.
pub(super) const BLOCKS: usize = WINDOWS / ROWS;
pub(super) const COARSE_BLOCKS: usize = 3;
const _: () = assert!(WINDOWS.is_multiple_of(ROWS) && COARSE_BLOCKS <= BLOCKS);

/// How unlikely a hypothesis makes the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Score {
    /// Its place among [`HYPOTHESES`].
    pub(super) hypothesis: usize,
    /// −2/n times the logarithm of the likelihood, each joint's noise being what it leaves.
    pub(super) misfit: f32,
    /// What is left of each joint's mean torques, N m, rms.
    pub(super) left: [f32; JOINTS_PER_LEG],
    /// How far the parameters of the joint where they are furthest off are from what is known of them, in deviations squared.
    pub(super) strain: f32,
}

impl Score {
    /// What an empty trial has: all zeros.
    pub(super) const ZERO: Self = Self {
        hypothesis: 0,
        misfit: 0.0,
        left: [0.0; JOINTS_PER_LEG],
        strain: 0.0,
    };

    /// Of nothing: as unlikely as can be.
    pub(super) const NONE: Self = Self {
        hypothesis: 0,
        misfit: f32::MAX,
        left: [0.0; JOINTS_PER_LEG],
        strain: f32::MAX,
    };
}

/// The best hypotheses of one round.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ranking {
    /// The likeliest, the next, and the one after it.
    pub(super) best: [Score; 3],
}

impl Ranking {
    pub(super) const NONE: Self = Self {
        best: [Score::NONE; 3],
    };

    fn take(&mut self, score: Score) {
        let mut score = score;
        for place in &mut self.best {
            if score.misfit < place.misfit {
                core::mem::swap(place, &mut score);
            }
        }
    }
}

/// What a leg's readings are judged by.
pub(in crate::app) struct Model<'a, T: Real> {
    pub(in crate::app) frame: &'a LegFrame<T>,
    pub(in crate::app) base: &'a LegBase<T>,
    pub(in crate::app) said: Said,
    /// The joints' stops, rad.
    pub(in crate::app) stops: [[f64; 2]; JOINTS_PER_LEG],
}

/// A round of all hypotheses under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// What is wrong before the hypotheses are: a second fault is looked for beside a first.
    pub(super) beside: usize,
    /// Each joint's noise, N m.
    noise: [f32; JOINTS_PER_LEG],
    /// Hypotheses that are asked, bit n for the n-th; and by how many blocks of windows.
    asked: u32,
    blocks: usize,
    hypothesis: usize,
    part: usize,
    /// How far beyond its stops a joint is in the windows so far, rad.
    beyond: f32,
    /// Each hypothesis's misfit.
    pub(super) misfits: [f32; HYPOTHESES.len()],
    pub(super) ranking: Ranking,
}

impl Round {
    /// None: all zeros, as a microcontroller's memory is at first.
    pub(super) const EMPTY: Self = Self {
        beside: 0,
        noise: [0.0; JOINTS_PER_LEG],
        asked: 0,
        blocks: 0,
        hypothesis: 0,
        part: 0,
        beyond: 0.0,
        misfits: [0.0; HYPOTHESES.len()],
        ranking: Ranking {
            best: [Score::ZERO; 3],
        },
    };

    /// Begins anew, beside the fault of that place among [`HYPOTHESES`], with joints of this noise, N m; of the hypotheses only those are asked
    /// whose bit is set, by so many blocks of windows.
    pub(super) fn begin(
        &mut self,
        beside: usize,
        noise: [f32; JOINTS_PER_LEG],
        asked: u32,
        blocks: usize,
    ) {
        self.beside = beside;
        (self.noise, self.asked, self.blocks) = (noise, asked, blocks);
        (self.hypothesis, self.part) = (0, 0);
    }

    /// One part; true after the last. `work` holds [`WORK`] numbers or more, and keeps them between the parts.
    #[inline(never)]
    pub(super) fn advance<T: Real>(
        &mut self,
        readings: &[Reading; WINDOWS],
        model: &Model<T>,
        work: &mut [T],
    ) -> bool {
        let Some(hypothesis) = HYPOTHESES.get(self.hypothesis) else {
            return true;
        };
        if (self.hypothesis, self.part) == (0, 0) {
            self.ranking = Ranking::NONE;
        }
        if self.asked >> self.hypothesis & 1 == 0 {
            self.hypothesis += 1;
            return self.hypothesis >= HYPOTHESES.len();
        }
        let beside = HYPOTHESES.get(self.beside).copied().flatten();
        let (triangles, rows) = work.split_at_mut(TRIANGLES.min(work.len()));
        let (blocks, _) = rows.as_chunks_mut::<ROWS>();
        let (block, folds) = (self.part / 2, self.part % 2 == 1);
        let done = if folds {
            fold(triangles, blocks)
        } else {
            let windows = readings.get(block * ROWS..).unwrap_or(&[]);
            self.write(windows, [beside, *hypothesis], model, blocks);
            match self.part {
                0 => set_priors(model.base, triangles),
                _ => Ok(()),
            }
        };
        self.part += 1;
        if done.is_ok() && self.part < 2 * self.blocks {
            return false;
        }
        // A triangle that was not made has no data, and none of the hypotheses more than another.
        if done.is_ok()
            && let Ok(score) = self.score(model.base, triangles)
        {
            self.ranking.take(score);
            if let Some(misfit) = self.misfits.get_mut(self.hypothesis) {
                *misfit = score.misfit;
            }
        }
        self.part = 0;
        self.hypothesis += 1;
        self.hypothesis >= HYPOTHESES.len()
    }

    fn score<T: Real>(&self, base: &LegBase<T>, work: &mut [T]) -> Result<Score, FactorError> {
        let per_window = 1.0 / (self.blocks * ROWS).max(1) as f64;
        let beyond = self.beyond / ZERO_ERROR;
        let mut score = Score {
            hypothesis: self.hypothesis,
            misfit: beyond * beyond * per_window as f32,
            left: [0.0; JOINTS_PER_LEG],
            strain: 0.0,
        };
        for (joint, left) in score.left.iter_mut().enumerate() {
            let factor = triangle(work, joint)?;
            let mut theta = [T::zero(); LONGEST];
            let theta = theta.get_mut(..columns(joint)).unwrap_or(&mut []);
            factor.solve(theta)?;
            let (effects, bodies) = theta.split_at(FRONT.min(theta.len()));
            let marginal = base.marginal(joint).ok_or(FactorError::Length(joint))?;
            let mut strain = marginal.sum_of_squares(bodies) * base.trust(joint);
            for (value, prior) in effects.iter().zip(priors(joint)) {
                let off = (*value - real(prior.mean)) * real(1.0 / prior.std);
                strain += off * off;
            }
            let all = factor.residual();
            let mean = (all - strain).max(T::zero()) * real(per_window);
            score.misfit += single(ln(all * real(per_window) + real(FLOOR)));
            score.strain = score.strain.max(single(strain));
            *left = single(sqrt(mean)) * self.noise.get(joint).copied().unwrap_or_default();
        }
        Ok(score)
    }

    /// Writes the rows of [`ROWS`] windows, mended of these faults.
    fn write<T: Real>(
        &mut self,
        readings: &[Reading],
        faults: [Option<Fault>; 2],
        model: &Model<T>,
        blocks: &mut Block<T>,
    ) {
        if self.part == 0 {
            self.beyond = 0.0;
        }
        for (slot, reading) in readings.iter().take(ROWS).enumerate() {
            let mut reading = *reading;
            for fault in faults {
                mend(fault, &model.said, &mut reading);
            }
            for (q, [lower, upper]) in reading.q[1].iter().zip(model.stops) {
                self.beyond = self.beyond.max(q - upper as f32).max(lower as f32 - q);
            }
            write(&reading, model.frame, &self.noise, slot, blocks);
        }
    }
}

/// Numbers of all joints' triangles.
const TRIANGLES: usize = start(JOINTS_PER_LEG);
/// The same, and the rows of windows that wait to be folded in.
pub(super) const WORK: usize = TRIANGLES + JOINTS_PER_LEG * LONGEST * ROWS;

/// Folds in the rows that wait.
fn fold<T: Real>(triangles: &mut [T], blocks: &mut Block<T>) -> Result<(), FactorError> {
    for (joint, block) in blocks.chunks_exact_mut(LONGEST).enumerate() {
        let block = block.get_mut(..=columns(joint)).unwrap_or(&mut []);
        triangle(triangles, joint)?.fold_block(0, block)?;
    }
    Ok(())
}

const fn start(joint: usize) -> usize {
    let (mut start, mut before) = (0, 0);
    while before < joint {
        start += packed_len(columns(before));
        before += 1;
    }
    start
}

fn triangle<T: Real>(work: &mut [T], joint: usize) -> Result<Factor<T, &mut [T]>, FactorError> {
    let error = FactorError::Length(work.len());
    let packed = work.get_mut(start(joint)..start(joint + 1)).ok_or(error)?;
    Factor::in_storage(columns(joint), packed)
}

/// What is known of a joint's viscous and Coulomb friction, armature and bias.
fn priors(joint: usize) -> [Prior; FRONT] {
    let armature = ACTUATORS.get(joint).map_or(1.0, Actuator::armature);
    let armature = Prior {
        mean: armature,
        std: 0.5 * armature,
    };
    [VISCOUS, COULOMB, armature, BIAS]
}

/// Empties the triangles but for the priors.
fn set_priors<T: Real>(base: &LegBase<T>, work: &mut [T]) -> Result<(), FactorError> {
    for joint in 0..JOINTS_PER_LEG {
        let mut factor = triangle(work, joint)?;
        factor.clear();
        let marginal = base.marginal(joint).ok_or(FactorError::Length(joint))?;
        factor.place(FRONT, &marginal)?;
        // What the host says that a body is not known so well holds here too.
        factor.forget(base.trust(joint));
        for (n, prior) in priors(joint).iter().enumerate() {
            let mut row = Factor::<T, [T; packed_len(1)]>::new::<1>();
            row.add_prior(0, real(prior.mean), real(prior.std), &mut [T::zero(); 2])?;
            factor.place(n, &row)?;
        }
    }
    Ok(())
}

/// The rows of a window, in one slot of the joints' blocks.
#[inline(never)]
fn write<T: Real>(
    reading: &Reading,
    frame: &LegFrame<T>,
    noise: &[f32; JOINTS_PER_LEG],
    slot: usize,
    blocks: &mut Block<T>,
) {
    let number = |x: f32| real::<T>(f64::from(x));
    let [q, dq] = [&reading.q, &reading.dq].map(|ends| ends.map(|of| of.map(number)));
    let length = number(reading.seconds);
    let per_second = T::one() / length;
    // The cubic's middle.
    let middle = |j: usize| {
        let (half, eighth) = (real::<T>(0.5), length * real(0.125));
        let position = (q[0][j] + q[1][j]) * half + (dq[0][j] - dq[1][j]) * eighth;
        let mean = (q[1][j] - q[0][j]) * per_second;
        let velocity = mean * real(1.5) - (dq[0][j] + dq[1][j]) * real(0.25);
        (position, velocity)
    };
    let middles: [(T, T); JOINTS_PER_LEG] = core::array::from_fn(middle);
    let (middle, speed) = (middles.map(|m| m.0), middles.map(|m| m.1));
    // Differences of momenta, and Simpson's rule for their rates.
    let (mut momenta, mut rates) = ([T::zero(); MOMENTA], [T::zero(); RATES]);
    let sixth: T = real(1.0 / 6.0);
    let states = [
        (&q[0], &dq[0], -per_second, sixth),
        (&middle, &speed, T::zero(), sixth * real(4.0)),
        (&q[1], &dq[1], per_second, sixth),
    ];
    for (q, dq, difference, share) in states {
        let motion = frame.motion(q, dq);
        let sums = momenta.iter_mut().zip(motion.momenta());
        sums.for_each(|(sum, x)| *sum += x * difference);
        let sums = rates.iter_mut().zip(motion.rates());
        sums.for_each(|(sum, x)| *sum += x * share);
    }
    let mut base = COLUMNS.iter();
    let mut places = blocks.chunks_exact_mut(LONGEST).zip(noise).zip(BASE_RANK);
    // Joints are counted to their number, so that the compiler sees that no index is beyond it.
    for joint in 0..JOINTS_PER_LEG {
        let Some(((block, noise), rank)) = places.next() else {
            break;
        };
        let weight = T::one() / number(*noise);
        let own = [
            (q[1][joint] - q[0][joint]) * per_second,
            number(reading.sign[joint]),
            (dq[1][joint] - dq[0][joint]) * per_second,
            T::one(),
        ];
        let bodies = base.by_ref().take(rank);
        let bodies = bodies.map(|column| column.of(&momenta, &rates));
        let torque = number(reading.tau[joint]);
        let row = own.into_iter().chain(bodies).chain([torque]);
        for (place, x) in block.iter_mut().zip(row) {
            if let Some(place) = place.get_mut(slot) {
                *place = x * weight;
            }
        }
    }
}

//! Which leg is this? A leg whose zeros were set is on trial before anything is told of it: is it the leg of this side, are its motors in their
//! places, do they count and pull the way that was said, was a rotor's turn lost, does a velocity read too high?
//!
//! A trial takes windows in which the leg moves ([`WINDOWS`] of them, which go into no estimate), and asks of each hypothesis
//! (`hypothesis`) how likely it makes them by the CAD's gravity and inertia (`evidence`), one part in a step, where the solution and
//! the diagnosis of the leg would be. Then it decides ([`Trial::decide`]):
//!
//! - the likeliest is taken if the next is clearly less likely and it leaves no more than a leg as it should be leaves;
//! - a fault is named if no second one beside it makes the readings clearly likelier: two faults are not one of them;
//! - else it looks at as many windows over twice the time, and if that decides nothing it says so, and goes on.
//!
//! A velocity's gain needs no model: velocities integrate to positions. After a decision a trial costs nothing. It begins anew when a zero is
//! set, and when the leg changes ([`crate::estimator::BlockTest`]): the change is told as one of its physics only if no fault explains it.
//!
//! Positions that are angles by the host's word ([`crate::wire::Positions::Absolute`]) are not tried: recordings and emulators, whose order and
//! signs are not a wiring's.
//!
//! Feet on the ground need no rule of their own: their forces are none of a hanging leg under any hypothesis, so that nothing is named; a
//! flipped sign is one that a hypothesis explains to the end.

mod evidence;
mod hypothesis;
mod span;
#[cfg(test)]
mod tests;

use crate::Real;
use crate::app::messages::single;
use crate::estimator::DeviceRows;
use crate::go2::JOINTS_PER_LEG;
use crate::window::{Push, Sample};
use crate::wire::{Fault, Wiring};
pub(super) use evidence::Model;
use evidence::{BLOCKS, COARSE_BLOCKS, Round, Score, WORK};
pub(super) use hypothesis::Said;
use hypothesis::{HYPOTHESES, Reading};
use span::Span;

/// Windows that a trial looks at. Fewer tell a calf's lost turn less surely, more do not fit a board's memory.
pub(super) const WINDOWS: usize = 30;
/// From one of them to the next, µs: in the first attempt, and in those that follow. Together 7.2 s of motion. Windows so far apart share no friction
/// transient.
const SPACING_US: [u64; 2] = [75_000, 155_000];
/// Mean speed of a joint in a window from which the leg moves, rad/s: five times the noise of a velocity.
const MOVES: f32 = 0.2;

/// By how much a hypothesis is clearly likelier than another, in [`Score::misfit`]: a factor of e^(30/2 × 0.5) = 1800 in likelihood.
const MARGIN: f32 = 0.5;
/// By how much a second fault beside the first makes the readings likelier where there are two: of 640 simulated legs with one fault none is so by
/// 0.1, and most of those with two are.
const SECOND: f32 = 0.12;
/// By how much less likely than the likeliest a hypothesis may be in the coarse round, and still be asked in the fine one.
const NEAR: f32 = 1.0;
/// Root of the coarse round's windows over these less the parameters that they tell, about eight.
const DEGREES: f32 = 1.34;
/// What a joint may leave of its mean torques, in units of [`evidence::NOISE`].
const MOST: f32 = 4.0;
/// How far a joint's parameters may be off, in squared deviations of 11 to 19 parameters: of a leg that is right, and of one with a fault. Recorded
/// chirps of a Go2 have 10 at most; two faults that look like another one have 9 to 70.
const STRAIN: f32 = 25.0;
const FAULT_STRAIN: f32 = 12.0;

/// A velocity's gain beyond which it is named: half of the least that matters, four times what delays of 2 ms make of motions up to 9 Hz.
const GAIN: f32 = 0.04;
/// Least mean of a joint's squared velocities, (rad/s)², by which its gain is judged: the noise then makes 0.5 % of it.
const TRAVEL: f32 = 0.04;

/// What a trial has taken down. Apart from the trial: a line whose parts are further apart costs every step more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Notes {
    /// The last windows.
    span: Span,
    /// The last sample's time, µs, and velocities; integrals of the velocities in the window, rad.
    last_us: u64,
    last: [f32; JOINTS_PER_LEG],
    travel: [f32; JOINTS_PER_LEG],
    /// Sums of squared displacements in windows, and of displacements times integrals of velocities.
    moved: [[f32; 2]; JOINTS_PER_LEG],
    windows: f32,
    readings: [Reading; WINDOWS],
    taken_us: u64,
    round: Round,
    /// What the fine round has found.
    found: Score,
    /// Two faults that are the same here.
    alike: bool,
    stage: Stage,
    /// Each joint's noise by the coarse round, N m.
    noise: [f32; JOINTS_PER_LEG],
}

impl Notes {
    /// None: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            span: Span::EMPTY,
            last_us: 0,
            last: [0.0; JOINTS_PER_LEG],
            travel: [0.0; JOINTS_PER_LEG],
            moved: [[0.0; 2]; JOINTS_PER_LEG],
            windows: 0.0,
            readings: [Reading::ZERO; WINDOWS],
            taken_us: 0,
            round: Round::EMPTY,
            found: Score::ZERO,
            alike: false,
            stage: Stage::Coarse,
            noise: [0.0; JOINTS_PER_LEG],
        }
    }

    /// Begins to collect.
    fn collect(&mut self) {
        self.taken_us = 0;
        self.moved = [[0.0; 2]; JOINTS_PER_LEG];
        self.windows = 0.0;
        self.stage = Stage::Coarse;
        self.round
            .begin(0, evidence::NOISE, u32::MAX, COARSE_BLOCKS);
    }
}

/// What is known of a leg's wiring, and the trial that finds it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    /// What is told.
    known: Wiring,
    /// A trial is under way; and it is of a leg that was right and has changed; and nothing has been noted of it yet.
    running: bool,
    changed: bool,
    fresh: bool,
    /// Attempts that have decided nothing.
    attempts: u8,
    /// Readings that were taken.
    taken: u8,
}

/// What a trial has come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    /// Nothing new.
    Nothing,
    /// The hello has something to tell.
    Told,
    /// The leg is as it should be, or nothing is wrong with its wiring: what was to be told of it may be.
    Cleared,
}

/// The rounds of a decision.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// All hypotheses, with the noise of a leg whose friction is little understood.
    Coarse,
    /// Those that are near, with the noise that the likeliest leaves.
    Fine,
    /// All beside the likeliest.
    Second,
}

/// What a round of hypotheses has come to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Decision {
    Found(Wiring),
    /// Look for a second fault beside this hypothesis.
    Beside(usize),
}

impl Trial {
    /// No trial: what knows nothing is all zeros.
    pub(super) const fn new() -> Self {
        Self {
            known: Wiring::Untested,
            running: false,
            changed: false,
            fresh: false,
            attempts: 0,
            taken: 0,
        }
    }

    /// What is told.
    pub(super) fn known(&self) -> Wiring {
        self.known
    }

    /// Whether what the leg says may be taken for its physics.
    #[inline]
    pub(super) fn allows(&self) -> bool {
        matches!(self.known, Wiring::Untested | Wiring::Right)
    }

    /// Whether windows are the trial's.
    #[inline]
    pub(super) fn is_running(&self) -> bool {
        self.running
    }

    /// Ends a trial, and knows nothing.
    pub(super) fn clear(&mut self) {
        self.known = Wiring::Untested;
        self.running = false;
    }

    /// Ends a trial that has found no fault, by the host's word; false if there is none.
    pub(super) fn trust(&mut self) -> bool {
        let open = matches!(
            self.known,
            Wiring::OnTrial | Wiring::Unclear(_) | Wiring::Unexplained
        );
        if open {
            self.known = Wiring::Right;
            self.running = false;
        }
        open
    }

    /// Begins a trial; `changed`: of a leg that was right.
    pub(super) fn begin(&mut self, changed: bool) {
        self.known = Wiring::OnTrial;
        (self.running, self.changed) = (true, changed);
        (self.attempts, self.taken, self.fresh) = (0, 0, true);
    }

    /// Whether the trial, or the last one, is of a leg that was right and has changed.
    pub(super) fn is_of_a_change(&self) -> bool {
        self.changed
    }

    /// Whether the windows are there, and parts of the evidence wait to be made.
    #[inline]
    pub(super) fn is_ready(&self) -> bool {
        self.running && usize::from(self.taken) >= WINDOWS
    }

    /// Takes in a sample of a leg on trial, and the rows of the window that it has closed.
    #[inline(never)]
    pub(super) fn see<T: Real>(
        &mut self,
        push: Push,
        sample: &Sample<T, JOINTS_PER_LEG>,
        rows: &DeviceRows<T>,
        notes: &mut Notes,
    ) {
        if !matches!(push, Push::Used | Push::Closed | Push::Gap) {
            return;
        }
        if core::mem::take(&mut self.fresh) {
            notes.span = Span::EMPTY;
            notes.last_us = 0;
            notes.collect();
        }
        let dq = sample.dq.map(single);
        let step = sample
            .time_us
            .wrapping_sub(notes.last_us)
            .min(u64::from(u32::MAX)) as u32 as f32;
        let half = step * 0.5e-6;
        let sums = notes.travel.iter_mut().zip(dq.iter().zip(&notes.last));
        sums.for_each(|(sum, (now, before))| *sum += (now + before) * half);
        (notes.last, notes.last_us) = (dq, sample.time_us);
        if push == Push::Used {
            return;
        }
        let q = sample.q.map(single);
        let (edge_us, edge) = notes.span.last();
        if push == Push::Closed && rows.span_us[0] == edge_us {
            let by = core::array::from_fn(|j| q[j] - edge[j]);
            let of = |n: fn(&[T]) -> Option<&T>| {
                core::array::from_fn(|j| n(rows.joint(j)).map_or(0.0, |x| single(*x)))
            };
            // The second column of a joint's row is Coulomb friction's.
            let (tau, sign) = (of(|row| row.last()), of(|row| row.get(1)));
            notes.span.push(sample.time_us, q, tau, sign);
            if !self.is_ready() {
                self.take(&by, rows.span_us, notes);
            }
        } else {
            notes.span.begin(sample.time_us, q);
        }
        notes.travel = [0.0; JOINTS_PER_LEG];
    }

    /// Takes note of a whole window in which the joints moved by so much, rad.
    fn take(&mut self, by: &[f32; JOINTS_PER_LEG], [from, to]: [u64; 2], notes: &mut Notes) {
        let seconds = (to - from).min(u64::from(u32::MAX)) as u32 as f32 * 1e-6;
        let most = by.iter().fold(0.0_f32, |most, by| most.max(by.abs()));
        if most < MOVES * seconds {
            return;
        }
        notes.windows += 1.0;
        for ((sums, by), travel) in notes.moved.iter_mut().zip(by).zip(notes.travel) {
            let scale = 1.0 / (seconds * seconds);
            sums[0] += by * by * scale;
            sums[1] += by * travel * scale;
        }
        let spacing = SPACING_US[usize::from(self.attempts > 0)];
        if from < notes.taken_us.saturating_add(spacing) && self.taken > 0 && from > notes.taken_us
        {
            return;
        }
        if let (Some(place), Some(reading)) = (
            notes.readings.get_mut(usize::from(self.taken)),
            notes.span.reading(),
        ) {
            *place = reading;
            self.taken += 1;
            notes.taken_us = from;
        }
    }

    /// One part of the evidence, and of the decision where it was the last. `carried`: the feet seem to carry the robot.
    pub(super) fn advance<T: Real>(
        &mut self,
        model: &Model<T>,
        carried: bool,
        notes: &mut Notes,
        work: &mut [T],
    ) -> Outcome {
        let work = work.get_mut(..WORK).unwrap_or(&mut []);
        if !notes.round.advance(&notes.readings, model, work) {
            return Outcome::Nothing;
        }
        let best = notes.round.ranking.best[0];
        match notes.stage {
            Stage::Coarse => {
                // What it leaves, for as many windows less the parameters that they tell.
                let noise = core::array::from_fn(|j| {
                    (best.left[j] * DEGREES).max(evidence::LEAST_NOISE[j])
                });
                let near = |misfit: &f32| *misfit < best.misfit + NEAR;
                let asked = (0..).zip(&notes.round.misfits);
                let asked = asked.fold(0, |bits, (n, misfit)| bits | u32::from(near(misfit)) << n);
                notes.noise = noise;
                Self::go_on(notes, Stage::Fine, 0, asked)
            }
            Stage::Fine => match Self::decide(notes) {
                Decision::Beside(hypothesis) => {
                    notes.found = best;
                    Self::go_on(notes, Stage::Second, hypothesis, u32::MAX)
                }
                Decision::Found(wiring) => self.conclude(wiring, carried, notes),
            },
            Stage::Second => {
                let wiring = Self::decide_second(notes);
                self.conclude(wiring, carried, notes)
            }
        }
    }

    fn go_on(notes: &mut Notes, stage: Stage, beside: usize, asked: u32) -> Outcome {
        notes.stage = stage;
        notes.round.begin(beside, notes.noise, asked, BLOCKS);
        Outcome::Nothing
    }

    /// What the second round says.
    fn decide(notes: &mut Notes) -> Decision {
        let [best, second, third] = notes.round.ranking.best;
        let pair = [best, second].map(|score| hypothesis(score.hypothesis));
        // A mirrored leg, and a hip that counts the other way: the same where the zero was set at 0.
        let alike = matches!(
            pair,
            [Some(Fault::OtherSide), Some(Fault::Reversed { joint: 0 })]
                | [Some(Fault::Reversed { joint: 0 }), Some(Fault::OtherSide)]
        );
        notes.alike = alike && second.misfit - best.misfit < MARGIN;
        let next = if alike { third } else { second };
        let left = best.left.iter().zip(evidence::NOISE);
        let most = match best.hypothesis {
            0 => STRAIN,
            _ => FAULT_STRAIN,
        };
        let fits = best.strain < most && left.into_iter().all(|(left, noise)| *left < MOST * noise);
        if !fits {
            return Decision::Found(Wiring::Unexplained);
        }
        if next.misfit - best.misfit < MARGIN {
            // Which of the two is the fault: of two faults the likelier.
            let fault = hypothesis(best.hypothesis).or(hypothesis(next.hypothesis));
            return Decision::Found(fault.map_or(Wiring::Unexplained, Wiring::Unclear));
        }
        match best.hypothesis {
            0 => Decision::Found(Self::velocities(notes).map_or(Wiring::Right, Wiring::Fault)),
            _ if Self::velocities(notes).is_some() => Decision::Found(Wiring::Unexplained),
            fault => Decision::Beside(fault),
        }
    }

    /// What the round beside a fault says.
    fn decide_second(notes: &Notes) -> Wiring {
        if notes.round.ranking.best[0].misfit < notes.found.misfit - SECOND {
            return Wiring::Unexplained;
        }
        match hypothesis(notes.found.hypothesis) {
            _ if notes.alike => Wiring::Fault(Fault::OtherSideOrReversed),
            Some(fault) => Wiring::Fault(fault),
            None => Wiring::Unexplained,
        }
    }

    /// The velocity that integrates to another displacement than its position's, if one does; of several the one that is furthest off.
    fn velocities(notes: &Notes) -> Option<Fault> {
        let mut most = (GAIN, None);
        for (joint, [squares, products]) in notes.moved.iter().enumerate() {
            if *squares <= TRAVEL * notes.windows {
                continue;
            }
            let gain = products / squares - 1.0;
            if gain.abs() > most.0 {
                let per_mille = (gain * 1000.0) as i16;
                let joint = joint as u8;
                most = (gain.abs(), Some(Fault::Velocity { joint, per_mille }));
            }
        }
        most.1
    }

    /// Ends the trial, or tries again.
    fn conclude(&mut self, wiring: Wiring, carried: bool, notes: &mut Notes) -> Outcome {
        let open = matches!(wiring, Wiring::Unclear(_) | Wiring::Unexplained);
        let before = self.known;
        if !open {
            self.known = wiring;
            self.running = false;
        } else if self.changed {
            // It was right, and no fault explains what it has become: its physics has changed.
            self.known = Wiring::Right;
            self.running = false;
        } else {
            // The ground's forces explain that nothing is found: the hello tells of them already.
            if self.attempts > 0 && !carried {
                self.known = wiring;
            }
            self.attempts = 1;
            self.taken = 0;
            notes.collect();
        }
        match self.known {
            Wiring::Right => Outcome::Cleared,
            known if known != before => Outcome::Told,
            _ => Outcome::Nothing,
        }
    }
}

fn hypothesis(n: usize) -> Option<Fault> {
    HYPOTHESES.get(n).copied().flatten()
}

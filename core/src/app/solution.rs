//! The legs' solutions, one after the other and one part in a step: data gathered, least squares alone, and the likeliest that could be where
//! that one could not ([`crate::consistent`]). The diagnosis has the steps between.

use super::leg::LegLine;
use super::{App, ESTIMATE_US, Memory};
use crate::Real;
use crate::factor::FactorError;
use crate::go2::{LEGS, Leg};
use crate::slot::Slot;
use crate::wire::Solution;

/// Steps without a window to fold that rest after one with work for solution or diagnosis: what keeps the mean cost of a
/// step within its budget.
const REST: u8 = 2;

/// A leg that is being solved.
#[derive(Clone, Copy)]
pub(super) struct Solving {
    which: Leg,
    /// When its data end.
    time_us: u64,
    phase: Phase,
    /// [`App::settings`] when its data were gathered.
    settings: u32,
}

/// How far a leg's solution is.
#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Its data are being gathered.
    Gather,
    /// Least squares alone.
    Solve,
    /// Is that one that could be?
    Judge,
    /// The likeliest of those that could.
    Descend,
}

/// What follows a part of a solution.
enum Next {
    /// Another part of the same phase.
    More,
    /// The first part of another phase.
    Phase(Phase),
    /// There is no more to do.
    Solved(Solution),
}

impl<T: Real> App<T> {
    /// One part of a solution, or of the diagnosis where none is due; then a rest. Beside a consistent solution, which takes many parts, the
    /// diagnosis has every second one.
    pub(super) fn work(&mut self, memory: &mut Memory<T>, now_us: u64) {
        if let Some(left) = self.rest.checked_sub(1) {
            self.rest = left;
            return;
        }
        self.rest = REST;
        if self.solving.get().is_none()
            && self.solved.get().is_none()
            && self.legs.iter().any(LegLine::waits_for_trial)
        {
            self.try_wiring(memory);
            return;
        }
        let n = self.diagnosis.leg();
        let identifies = self.identifies(n);
        if !identifies {
            self.diagnosis.skip_leg();
        }
        let descends =
            matches!(&self.solving, Slot::Full(solving) if solving.phase == Phase::Descend);
        self.diagnosed = descends && !self.diagnosed;
        if (self.diagnosed || !self.solve(memory, now_us))
            && identifies
            && let (Some(leg), Some(data)) = (self.legs.get(n), memory.0.get(n))
        {
            self.diagnosis.advance(&leg.evidence(data));
        }
    }

    /// One part of a leg's trial: in the solver's storage, so between two solutions, which wait until the trial is done. Apart: a step without
    /// one costs a look at four flags.
    #[cold]
    #[inline(never)]
    fn try_wiring(&mut self, memory: &mut Memory<T>) {
        let (carried, work) = (self.was_carried, self.solver.storage_mut());
        let lines = self.legs.iter_mut().zip(&mut memory.0).zip(Leg::ALL);
        let mut waiting = lines.filter(|((leg, _), _)| leg.waits_for_trial());
        if let Some(((leg, data), which)) = waiting.next()
            && leg.try_on(data, which, carried, work)
        {
            // What was found is told at once.
            self.hello_at = 0;
        }
    }

    /// One part of a solution: begins the next leg's when it is due, or goes on with the one begun; false if there is none.
    fn solve(&mut self, memory: &mut Memory<T>, now_us: u64) -> bool {
        match self.solving {
            Slot::Full(solving) => self.solve_on(memory, solving),
            Slot::Empty => return self.begin_solving(memory, now_us),
        }
        true
    }

    /// Begins the next leg's solution when it is due; false if it is not.
    fn begin_solving(&mut self, memory: &mut Memory<T>, now_us: u64) -> bool {
        let (which, due) = self.next;
        if !self.identifies(which.index()) {
            // Its turn is the next one's, as soon as there is one to be solved.
            self.next.0 = following(which);
            return false;
        }
        let (leg, data) = (&mut self.legs[which.index()], &mut memory.0[which.index()]);
        if self.solved.get().is_some() || now_us < due || leg.is_forgetting() {
            return false;
        }
        // What waits is folded in before, in steps of its own.
        if leg.fold_on(data) {
            return true;
        }
        leg.gather(data, &mut self.gather, &mut self.solver);
        self.solving = Slot::Full(Solving {
            which,
            time_us: now_us,
            phase: Phase::Gather,
            settings: self.settings,
        });
        // A solver that cannot keep up does not try to catch up.
        let due = due
            .saturating_add(ESTIMATE_US)
            .max(now_us.saturating_sub(ESTIMATE_US));
        self.next = (following(which), due);
        true
    }

    /// Goes on with a solution.
    fn solve_on(&mut self, memory: &mut Memory<T>, solving: Solving) {
        let Solving { which, time_us, .. } = solving;
        if !self.identifies(which.index()) {
            // A zero has become void: nothing of the leg is told.
            self.solving = Slot::Empty;
            return;
        }
        let leg = &self.legs[which.index()];
        let has_prior = match solving.phase {
            Phase::Gather | Phase::Solve => true,
            Phase::Judge => solving.settings == self.settings,
            Phase::Descend => solving.settings == self.settings && !leg.is_stale(),
        };
        if !has_prior {
            // The prior that it was begun with is no more: its turn is once more the next.
            self.solving = Slot::Empty;
            self.next.0 = which;
            return;
        }
        let next = self.solve_part(memory, &solving);
        match next {
            Ok(Next::More) => {}
            Ok(Next::Phase(phase)) => {
                let settings = match phase {
                    // The model may have been set while its data were gathered: it is then gathered anew.
                    Phase::Solve => self.settings,
                    _ => solving.settings,
                };
                self.solving = Slot::Full(Solving {
                    phase,
                    settings,
                    ..solving
                });
            }
            Ok(Next::Solved(solution)) => {
                self.solved = Slot::Full((which, time_us, solution));
                self.solving = Slot::Empty;
            }
            Err(_) => {
                self.solving = Slot::Empty;
                self.legs[which.index()].count_unsolved();
            }
        }
    }

    /// One part of a phase.
    fn solve_part(
        &mut self,
        memory: &mut Memory<T>,
        solving: &Solving,
    ) -> Result<Next, FactorError> {
        let n = solving.which.index();
        let (leg, data) = (&mut self.legs[n], &mut memory.0[n]);
        Ok(match solving.phase {
            Phase::Gather => match leg.gather_on(data, &mut self.gather, &mut self.solver)? {
                true => Next::Phase(Phase::Solve),
                false => Next::More,
            },
            Phase::Solve => match self.solver.advance()? {
                true => {
                    leg.learn(data, &self.solver, self.gather.active());
                    Next::Phase(Phase::Judge)
                }
                false => Next::More,
            },
            Phase::Judge if leg.is_consistent(&self.solver) => Next::Solved(Solution::Free),
            Phase::Judge => {
                leg.descend(&mut self.descent, &mut self.solver);
                Next::Phase(Phase::Descend)
            }
            Phase::Descend => match leg.descend_on(&mut self.descent, &mut self.solver)? {
                true => Next::Solved(Solution::Consistent),
                false => Next::More,
            },
        })
    }
}

/// The leg after this one.
fn following(leg: Leg) -> Leg {
    Leg::ALL[(leg.index() + 1) % LEGS]
}

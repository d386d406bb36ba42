//! The host's requests: one obeyed a step, each once, however often it is heard.

use heapless::Deque;

use super::leg::LegLine;
use super::messages::neutral;
use super::{ALL_LEGS, App, Memory};
use crate::Real;
use crate::estimator::COLUMNS;
use crate::go2::{JOINTS_PER_LEG, Leg};
use crate::wire::{Action, Answer, Belief, BodyPrior, EffectAt, Outcome, Request, SetZero};

/// Requests that may wait, and answers that are remembered: a host has no more under way. One that finds no room is dropped,
/// and asked again by its host.
const REQUESTS: usize = 144;

/// What stands where no answer is.
const NONE: Answer = Answer {
    id: 0,
    outcome: Outcome::Accepted,
};

/// What the host asked, what is to be answered, and what was.
pub(super) struct Requests {
    waiting: Deque<Request, REQUESTS>,
    /// A ring of the last answers, and how many were written to it, less whole rounds.
    answered: [Answer; REQUESTS],
    written: usize,
    /// The answer to be told, if one is: not an `Option`, whose `None` is not zero.
    due: Answer,
    is_due: bool,
}

impl Requests {
    pub(super) const fn new() -> Self {
        Self {
            waiting: Deque::new(),
            answered: [NONE; REQUESTS],
            written: 0,
            due: NONE,
            is_due: false,
        }
    }

    pub(super) fn push(&mut self, request: Request) {
        // Dropped if there is no room: no answer tells the host.
        let _ = self.waiting.push_back(request);
    }

    /// The next request to obey. One that was obeyed before is answered as it was then.
    pub(super) fn next(&mut self) -> Option<Request> {
        if self.is_due {
            return None;
        }
        let request = self.waiting.pop_front()?;
        let mut written = self.answered.iter().take(self.written);
        let answered = written.find(|answer| answer.id == request.id);
        match answered.copied() {
            Some(answer) => {
                self.tell(answer);
                None
            }
            None => Some(request),
        }
    }

    /// What became of a request.
    pub(super) fn answer(&mut self, answer: Answer) {
        if let Some(place) = self.answered.get_mut(self.written % REQUESTS) {
            *place = answer;
        }
        self.written += 1;
        if self.written >= 2 * REQUESTS {
            self.written -= REQUESTS;
        }
        self.tell(answer);
    }

    fn tell(&mut self, answer: Answer) {
        self.due = answer;
        self.is_due = true;
    }

    /// The answer to be told.
    pub(super) fn take(&mut self) -> Option<Answer> {
        let is_due = core::mem::take(&mut self.is_due);
        is_due.then_some(self.due)
    }
}

impl<T: Real> App<T> {
    /// Obeys the request that has waited longest.
    pub(super) fn obey(&mut self, memory: &mut Memory<T>, now_us: u64) {
        let Some(request) = self.requests.next() else {
            return;
        };
        let outcome = self.outcome(memory, request.action, now_us);
        let id = request.id;
        self.requests.answer(Answer { id, outcome });
    }

    /// Does what is asked. Not inlined: a step has none of it nearly always, and its code would be worse for it.
    #[inline(never)]
    fn outcome(&mut self, memory: &mut Memory<T>, action: Action, now_us: u64) -> Outcome {
        if action == Action::Keep {
            return match self.snapshots.want() {
                true => Outcome::Accepted,
                false => Outcome::NoStorage,
            };
        }
        let outcome = match action {
            Action::Keep => Outcome::Accepted,
            // Of the board, not of what it has learnt: no snapshot has it.
            Action::SetUp(setup) => return self.snapshots.set_up(setup),
            Action::Reset => {
                self.reset(memory);
                // Else the next start would bring back what was to be forgotten.
                self.snapshots.want();
                Outcome::Accepted
            }
            Action::AddEffect(at) => self.change(true, at),
            Action::DropEffect(at) => self.change(false, at),
            Action::SetMemory(seconds) => {
                self.legs.iter_mut().for_each(|leg| leg.set_memory(seconds));
                Outcome::Accepted
            }
            Action::SetEffectPrior(at, belief) => self.believe(at, belief),
            Action::SetBodyPrior(prior) => self.know_body(memory, prior),
            Action::SetLegs(legs) if legs & !ALL_LEGS != 0 => Outcome::NoSuchLeg,
            Action::SetLegs(legs) => {
                self.listens_to = legs;
                // Who listens is told by the hello.
                self.hello_at = 0;
                // No snapshot has it.
                return Outcome::Accepted;
            }
            Action::SetPositions(positions) => {
                let mut others = false;
                let legs = self.legs.iter_mut().zip(&mut memory.0);
                legs.for_each(|(leg, data)| others |= leg.set_positions(data, positions));
                if !others {
                    // A host says so whenever it begins: flash wears.
                    return Outcome::Accepted;
                }
                self.keep_zeros()
            }
            Action::SetZero(asked) => self.set_zero(memory, &asked, now_us),
            Action::TrustWiring => {
                let mut trusted = false;
                let legs = self.legs.iter_mut().zip(&mut memory.0);
                legs.for_each(|(leg, data)| trusted |= leg.trust_wiring(data));
                self.hello_at = 0;
                match trusted {
                    true => Outcome::Accepted,
                    false => Outcome::NoTrial,
                }
            }
            Action::TrustZeros => {
                let mut trusted = false;
                let legs = self.legs.iter_mut();
                legs.for_each(|leg| trusted |= leg.trust_zeros());
                match trusted {
                    true => self.keep_zeros(),
                    false => Outcome::NoZero,
                }
            }
        };
        if outcome == Outcome::Accepted {
            self.settings = self.settings.wrapping_add(1);
        }
        outcome
    }

    /// Takes a joint's angle to be what the host says.
    fn set_zero(&mut self, memory: &mut Memory<T>, asked: &SetZero, now_us: u64) -> Outcome {
        let n = usize::from(asked.leg);
        let (Some(which), Some(leg), Some(data)) =
            (Leg::ALL.get(n), self.legs.get_mut(n), memory.0.get_mut(n))
        else {
            return Outcome::NoSuchLeg;
        };
        match leg.set_zero(data, *which, asked, now_us) {
            Outcome::Accepted => self.keep_zeros(),
            refused => refused,
        }
    }

    /// The zeros are others: the hello says so at once, and they outlive the power.
    fn keep_zeros(&mut self) -> Outcome {
        self.hello_at = 0;
        self.snapshots.want();
        Outcome::Accepted
    }

    /// The leg, the joint's place in it, and the effect's in [`COLUMNS`].
    fn place(&mut self, at: EffectAt) -> Result<(&mut LegLine<T>, usize, usize), Outcome> {
        let (joint, effect) = (usize::from(at.joint), usize::from(at.effect));
        match self.legs.get_mut(usize::from(at.leg)) {
            None => Err(Outcome::NoSuchLeg),
            Some(_) if joint >= JOINTS_PER_LEG => Err(Outcome::NoSuchJoint),
            Some(_) if effect >= COLUMNS.len() => Err(Outcome::NoSuchEffect),
            Some(leg) => Ok((leg, joint, effect)),
        }
    }

    /// Adds an effect to a joint's model or drops it.
    fn change(&mut self, add: bool, at: EffectAt) -> Outcome {
        let (leg, joint, effect) = match self.place(at) {
            Ok(place) => place,
            Err(outcome) => return outcome,
        };
        match (leg.set_effect(joint, effect, add), add) {
            (true, _) => Outcome::Accepted,
            (false, true) => Outcome::AlreadyActive,
            (false, false) => Outcome::NotActive,
        }
    }

    /// Sets what is known of an effect's parameter before any data.
    fn believe(&mut self, at: EffectAt, belief: Belief) -> Outcome {
        let (leg, joint, effect) = match self.place(at) {
            Ok(place) => place,
            Err(outcome) => return outcome,
        };
        match leg.believe(joint, effect, belief.mean - neutral(effect), belief.std) {
            true => Outcome::Accepted,
            false => Outcome::OutOfRange,
        }
    }

    /// Sets how well a body is known before any data.
    fn know_body(&mut self, memory: &mut Memory<T>, prior: BodyPrior) -> Outcome {
        let (leg, body) = (usize::from(prior.leg), usize::from(prior.body));
        match (self.legs.get_mut(leg), memory.0.get_mut(leg)) {
            (Some(_), Some(_)) if body >= JOINTS_PER_LEG => Outcome::NoSuchJoint,
            (Some(leg), Some(data)) => match leg.know_body(data, body, prior.uncertainty) {
                true => Outcome::Accepted,
                false => Outcome::OutOfRange,
            },
            _ => Outcome::NoSuchLeg,
        }
    }
}

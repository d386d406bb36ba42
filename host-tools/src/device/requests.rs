//! A host's requests, asked again until they are answered.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::{Duration, Instant};

use proprio_core::wire::{Action, Answer, Request};

/// How long an answer may take before the request is asked again.
const PATIENCE: Duration = Duration::from_secs(2);

/// A random number, different in each process.
pub(crate) fn random() -> u32 {
    RandomState::new().build_hasher().finish() as u32
}

/// The requests under way.
#[derive(Debug)]
pub struct Requests {
    next: u32,
    waiting: Vec<(Request, Instant)>,
}

impl Requests {
    /// None yet; numbers begin at random.
    pub fn new() -> Self {
        Self {
            next: random(),
            waiting: Vec::new(),
        }
    }

    /// A new request, to be sent at `now`.
    pub fn ask(&mut self, action: Action, now: Instant) -> Request {
        let id = self.next;
        self.next = id.wrapping_add(1);
        let request = Request { id, action };
        self.waiting.push((request, now));
        request
    }

    /// What an answer is to; none if it is to nothing that waits.
    pub fn answered(&mut self, answer: &Answer) -> Option<Action> {
        let place = self
            .waiting
            .iter()
            .position(|(request, _)| request.id == answer.id)?;
        Some(self.waiting.remove(place).0.action)
    }

    /// The requests to be sent again at `now`: nothing was heard of them for two seconds.
    pub fn again(&mut self, now: Instant) -> Vec<Request> {
        let late = self
            .waiting
            .iter_mut()
            .filter(|(_, asked)| now.duration_since(*asked) >= PATIENCE);
        late.map(|(request, asked)| {
            *asked = now;
            *request
        })
        .collect()
    }

    /// Asks nothing of what is under way again.
    pub fn give_up(&mut self) {
        self.waiting.clear();
    }

    /// How many are under way.
    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }
}

impl Default for Requests {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::wire::Outcome;

    #[test]
    fn what_is_not_answered_is_asked_again_under_its_number() {
        let mut requests = Requests::new();
        let start = Instant::now();
        let first = requests.ask(Action::Reset, start);
        let second = requests.ask(Action::Reset, start);
        assert_ne!(first.id, second.id);
        let outcome = Outcome::Accepted;
        let answer = Answer {
            id: first.id,
            outcome,
        };
        assert_eq!(requests.answered(&answer), Some(Action::Reset));
        assert_eq!(requests.answered(&answer), None);
        assert_eq!(requests.again(start + PATIENCE / 2), []);
        assert_eq!(requests.again(start + PATIENCE), [second]);
        assert_eq!(requests.again(start + PATIENCE), []);
        assert_eq!(requests.len(), 1);
    }
}

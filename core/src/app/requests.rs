//! The host's requests: one obeyed a step, each once, however often it is heard.

use heapless::Deque;

use crate::wire::{Answer, Outcome, Request};

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

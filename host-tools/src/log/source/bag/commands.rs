//! The command in force at each state: the last one that was received before it, as a drive follows it until the next.

use std::collections::VecDeque;
use std::sync::Arc;

use super::{Message, Messages, check_encapsulation};
use crate::log::error::Problem;

/// Commands that may wait for their state: of more, as of a robot that did not answer for long, the last count.
const WAITING: usize = 1024;

/// States of a recording, each with its command.
///
/// Recorders write messages in the order in which they received them, but for moments: a command that stands before a state of an earlier time waits.
pub(super) struct WithCommands {
    messages: Box<dyn Messages>,
    /// The number of the commands' topic.
    topic: u64,
    /// Commands of later times than the last state's.
    waiting: VecDeque<(i64, Arc<Vec<u8>>)>,
    /// The one in force.
    command: Option<Arc<Vec<u8>>>,
}

impl WithCommands {
    /// Of messages of two topics, of which `topic` has the commands.
    pub(super) fn new(messages: Box<dyn Messages>, topic: u64) -> Self {
        Self {
            messages,
            topic,
            waiting: VecDeque::new(),
            command: None,
        }
    }
}

impl Messages for WithCommands {
    fn next(&mut self, message: &mut Message) -> Result<bool, Problem> {
        while self.messages.next(message)? {
            if message.topic == self.topic {
                check_encapsulation(&message.data)?;
                let command = Arc::new(std::mem::take(&mut message.data));
                self.waiting.push_back((message.time, command));
            }
            let is_state = message.topic != self.topic;
            while let Some((at, _)) = self.waiting.front()
                && (is_state && *at <= message.time || self.waiting.len() > WAITING)
            {
                self.command = self.waiting.pop_front().map(|(_, command)| command);
            }
            if is_state {
                message.command.clone_from(&self.command);
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn progress(&self) -> (u64, u64) {
        self.messages.progress()
    }

    fn is_cut(&self) -> bool {
        self.messages.is_cut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Messages as they stand in a recording: topic, time, number.
    struct Given(std::vec::IntoIter<(u64, i64, u8)>);

    impl Messages for Given {
        fn next(&mut self, message: &mut Message) -> Result<bool, Problem> {
            let Some((topic, time, number)) = self.0.next() else {
                return Ok(false);
            };
            *message = Message {
                topic,
                time,
                data: vec![0, 1, 0, 0, number],
                ..Message::default()
            };
            Ok(true)
        }

        fn progress(&self) -> (u64, u64) {
            (0, 0)
        }

        fn is_cut(&self) -> bool {
            false
        }
    }

    /// The number of each state, and of its command.
    fn with_commands(given: Vec<(u64, i64, u8)>) -> Vec<(u8, Option<u8>)> {
        let mut states = WithCommands::new(Box::new(Given(given.into_iter())), 7);
        let mut message = Message::default();
        let mut found = Vec::new();
        while states.next(&mut message).unwrap() {
            let command = message.command.as_ref().map(|command| command[4]);
            found.push((message.data[4], command));
        }
        found
    }

    #[test]
    fn a_command_holds_until_the_next() {
        let given = vec![
            (1, 10, 1),
            (7, 11, 100),
            (1, 12, 2),
            (1, 14, 3),
            (7, 15, 101),
            // Written before a state that was received before it.
            (7, 18, 102),
            (1, 16, 4),
            (1, 18, 5),
        ];
        let expected = [
            (1, None),
            (2, Some(100)),
            (3, Some(100)),
            (4, Some(101)),
            (5, Some(102)),
        ];
        assert_eq!(with_commands(given), expected);
    }

    /// What was asked of a robot that did not answer takes no memory.
    #[test]
    fn few_commands_wait() {
        let asked = (0..5000).map(|k| (7, 100 + k, (k % 256) as u8));
        let given: Vec<_> = asked.chain([(1, 99, 1), (1, 6000, 2)]).collect();
        let last_that_could_not_wait = ((4999 - WAITING) % 256) as u8;
        let expected = [
            (1, Some(last_that_could_not_wait)),
            (2, Some((4999 % 256) as u8)),
        ];
        assert_eq!(with_commands(given), expected);
    }
}

//! Lines of standard input as they come.

use std::io::{self, BufRead, BufReader, IsTerminal, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Instant;

use super::error::LiveError;
use super::until::{LOOK, Until};

/// Lines that may wait; then whoever writes them waits.
const WAITING: usize = 4096;
/// A longer line, bytes, is no row; it is passed on in parts, and the reader of rows says what is wrong.
const LONGEST: u64 = 1 << 22;

/// Lines of standard input until it ends or `until` says so: always whole ones, so that no row is cut.
///
/// # Errors
/// [`LiveError::Terminal`] if nothing is piped into it; [`LiveError::Thread`].
pub fn lines(until: Until) -> Result<impl Read + Send, LiveError> {
    if io::stdin().is_terminal() {
        return Err(LiveError::Terminal);
    }
    // Waits for the next line: it ends with the process where none comes.
    follow(io::stdin(), until)
}

fn follow(from: impl Read + Send + 'static, until: Until) -> Result<Lines, LiveError> {
    let (send, lines) = sync_channel(WAITING);
    let read = move || {
        let mut from = BufReader::with_capacity(1 << 16, from);
        loop {
            let mut line = Vec::new();
            let read = (&mut from).take(LONGEST).read_until(b'\n', &mut line);
            let last = !matches!(read, Ok(1..));
            if send.send(read.map(|_| line)).is_err() || last {
                return;
            }
        }
    };
    let named = thread::Builder::new().name("stdin".to_owned());
    named.spawn(read).map_err(LiveError::Thread)?;
    Ok(Lines {
        lines,
        line: Vec::new(),
        at: 0,
        first: None,
        until,
    })
}

struct Lines {
    lines: Receiver<io::Result<Vec<u8>>>,
    /// The present line, and how much of it was given.
    line: Vec<u8>,
    at: usize,
    first: Option<Instant>,
    until: Until,
}

impl Read for Lines {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at == self.line.len() {
            if self.until.is_over(self.first) {
                return Ok(0);
            }
            match self.lines.recv_timeout(LOOK) {
                Ok(line) => {
                    (self.line, self.at) = (line?, 0);
                    self.first.get_or_insert_with(Instant::now);
                    if self.line.is_empty() {
                        return Ok(0);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let left = &self.line[self.at..];
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.at += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives its text and then nothing, as a pipe whose writer pauses in the middle of a line.
    struct Pausing(Option<&'static [u8]>);

    impl Read for Pausing {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.0.take() {
                Some(text) => {
                    buffer[..text.len()].copy_from_slice(text);
                    Ok(text.len())
                }
                None => loop {
                    thread::park();
                },
            }
        }
    }

    #[test]
    fn a_line_that_has_not_come_whole_is_not_given() {
        let until = Until::after(Some(std::time::Duration::from_millis(100)));
        let mut text = String::new();
        let mut lines = follow(Pausing(Some(b"t,a\n0,1\n0.5")), until).unwrap();
        lines.read_to_string(&mut text).unwrap();
        assert_eq!(text, "t,a\n0,1\n");
        let mut whole = String::new();
        let mut lines = follow(&b"t,a\n0,1\n0.5,2"[..], Until::default()).unwrap();
        lines.read_to_string(&mut whole).unwrap();
        assert_eq!(whole, "t,a\n0,1\n0.5,2");
    }
}

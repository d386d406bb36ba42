//! Lines of standard input as they come.

use std::io::{self, BufRead, BufReader, IsTerminal, Read};
use std::thread;

use super::error::LiveError;
use super::pieces::Pieces;
use super::until::Until;

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

fn follow(from: impl Read + Send + 'static, until: Until) -> Result<Pieces, LiveError> {
    let (send, lines) = Pieces::new(until);
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
    Ok(lines)
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

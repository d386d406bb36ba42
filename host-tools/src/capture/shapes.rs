//! Frames by their shape: a header, and that of another frame where it ends. Their checksums are not looked at.

use proprio_core::bus::{Command, Reply};

/// Finds frames by their shape in the bytes of one bus.
#[derive(Default)]
pub(crate) struct Shapes {
    /// Bytes that may still become a frame.
    rest: Vec<u8>,
}

impl Shapes {
    /// Goes on with the bytes of a record, and gives `each` frame. What ends with the record ends with a pause.
    pub(crate) fn push(&mut self, record: &[u8], mut each: impl FnMut(&[u8])) {
        self.rest.extend_from_slice(record);
        let mut seen = self.rest.as_slice();
        while let Some(header) = seen.first_chunk() {
            let length = match *header {
                Command::HEADER => Command::LEN,
                Reply::HEADER => Reply::LEN,
                _ => {
                    seen = &seen[1..];
                    continue;
                }
            };
            let Some((frame, after)) = seen.split_at_checked(length) else {
                break;
            };
            // A frame that lacks a byte has no header where it should end: the search goes on within it.
            if opens(after) {
                each(frame);
                seen = after;
            } else {
                seen = &seen[1..];
            }
        }
        let taken = self.rest.len() - seen.len();
        self.rest.drain(..taken);
    }
}

/// Whether these bytes may be the first of a frame.
fn opens(bytes: &[u8]) -> bool {
    [Command::HEADER, Reply::HEADER]
        .iter()
        .any(|header| header.iter().zip(bytes).all(|(one, other)| one == other))
}

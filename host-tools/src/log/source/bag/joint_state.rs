//! `sensor_msgs/msg/JointState`: names, and beside them positions, velocities and efforts, each of any length.
//!
//! Messages need not name the same joints in the same order: several nodes may send on one topic. What is read are the joints
//! of the first messages, found in each by name; a message that lacks one is another node's.

use std::collections::VecDeque;

use super::{Decoder, Message};
use crate::log::error::Problem;

/// What a message may say of a joint, in its order.
const QUANTITIES: [&str; 3] = ["position", "velocity", "effort"];

/// The joint states of a topic.
pub(super) struct JointStates {
    /// (joint, quantity) of each cell.
    cells: Vec<(String, usize)>,
    /// Of the message taken up: its joints.
    joints: Vec<Vec<u8>>,
    /// … and the first byte and number of each quantity.
    arrays: [(usize, usize); 3],
    /// … and for each cell the byte where its number is.
    places: Vec<Option<usize>>,
    stamp: i64,
}

impl JointStates {
    /// What the first messages of a topic say.
    pub(super) fn of(messages: &VecDeque<Message>) -> Result<Self, Problem> {
        let mut states = Self {
            cells: Vec::new(),
            joints: Vec::new(),
            arrays: [(0, 0); 3],
            places: Vec::new(),
            stamp: 0,
        };
        for message in messages {
            states.parse(&message.data)?;
            for quantity in 0..QUANTITIES.len() {
                let count = states.arrays[quantity].1;
                for joint in states.joints.iter().take(count) {
                    let cell = (String::from_utf8_lossy(joint).into_owned(), quantity);
                    if !states.cells.contains(&cell) {
                        states.cells.push(cell);
                    }
                }
            }
        }
        // The next message is looked at afresh.
        states.joints.clear();
        Ok(states)
    }

    /// Whether bytes are a whole message.
    #[cfg(feature = "mcap")]
    pub(super) fn is_whole(data: &[u8]) -> bool {
        let first = VecDeque::from([Message {
            data: data.to_vec(),
            ..Message::default()
        }]);
        Self::of(&first).is_ok()
    }

    /// Finds the arrays of a message; true if it names other joints than the one before, or has others of their quantities.
    fn parse(&mut self, data: &[u8]) -> Result<bool, Problem> {
        let mut cdr = Cdr::new(data);
        let seconds = i64::from(cdr.u32()? as i32);
        let nanoseconds = i64::from(cdr.u32()?);
        self.stamp = seconds * 1_000_000_000 + nanoseconds;
        cdr.bytes()?; // frame_id
        let count = cdr.count(4)?;
        let mut differs = count != self.joints.len();
        self.joints.resize_with(count, Vec::new);
        for joint in &mut self.joints {
            let name = cdr.bytes()?;
            let name = name.strip_suffix(b"\0").unwrap_or(name);
            if name != joint.as_slice() {
                differs = true;
                joint.clear();
                joint.extend_from_slice(name);
            }
        }
        for array in &mut self.arrays {
            let found = cdr.f64s()?;
            differs |= found != *array;
            *array = found;
        }
        Ok(differs)
    }

    /// Where the number of each cell is in the message taken up.
    fn find(&mut self) {
        let (joints, arrays) = (&self.joints, &self.arrays);
        let place = |(name, quantity): &(String, usize)| {
            let n = joints.iter().position(|joint| joint == name.as_bytes())?;
            let (first, count) = arrays[*quantity];
            (n < count).then_some(first + 8 * n)
        };
        self.places = self.cells.iter().map(place).collect();
    }
}

impl Decoder for JointStates {
    fn names(&self) -> Vec<String> {
        let name =
            |(joint, quantity): &(String, usize)| format!("{joint}/{}", QUANTITIES[*quantity]);
        self.cells.iter().map(name).collect()
    }

    fn take(&mut self, data: &[u8]) -> Result<bool, Problem> {
        if self.parse(data)? || self.places.is_empty() {
            self.find();
        }
        Ok(self.places.iter().any(Option::is_some))
    }

    fn stamp(&self, _: &[u8]) -> i64 {
        self.stamp
    }

    fn cell(&self, data: &[u8], cell: usize) -> f64 {
        let number = self.places.get(cell).copied().flatten();
        let bytes = number.and_then(|place| data.get(place..)?.first_chunk().copied());
        bytes.map_or(f64::NAN, f64::from_le_bytes)
    }
}

/// Reads little-endian CDR.
struct Cdr<'a> {
    data: &'a [u8],
    at: usize,
    /// The widest alignment: 8 in XTypes 1, 4 in XTypes 2.
    widest: usize,
}

/// Bytes of the encapsulation header, from after which alignment counts.
const HEADER: usize = 4;

impl<'a> Cdr<'a> {
    fn new(data: &'a [u8]) -> Self {
        let widest = if data.get(1) == Some(&7) { 4 } else { 8 };
        Self {
            data,
            at: HEADER,
            widest,
        }
    }

    fn align(&mut self, width: usize) {
        let width = width.min(self.widest);
        self.at = HEADER + (self.at - HEADER).next_multiple_of(width);
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Problem> {
        let short = || Problem::MessageShort {
            kind: "sensor_msgs/msg/JointState",
            found: self.data.len(),
        };
        let end = self.at.checked_add(length).ok_or_else(short)?;
        let taken = self.data.get(self.at..end).ok_or_else(short)?;
        self.at = end;
        Ok(taken)
    }

    fn u32(&mut self) -> Result<u32, Problem> {
        self.align(4);
        let bytes = self.take(4)?.first_chunk().copied();
        Ok(u32::from_le_bytes(bytes.unwrap_or_default()))
    }

    /// The length of a sequence whose elements take `width` bytes at least.
    fn count(&mut self, width: usize) -> Result<usize, Problem> {
        let count = self.u32()? as usize;
        let left = self.data.len().saturating_sub(self.at);
        if count > left / width {
            return Err(Problem::MessageShort {
                kind: "sensor_msgs/msg/JointState",
                found: self.data.len(),
            });
        }
        Ok(count)
    }

    /// A string with its final zero.
    fn bytes(&mut self) -> Result<&'a [u8], Problem> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    /// The place and number of a sequence of doubles.
    fn f64s(&mut self) -> Result<(usize, usize), Problem> {
        let count = self.u32()? as usize;
        if count == 0 {
            return Ok((self.at, 0));
        }
        self.align(8);
        let first = self.at;
        self.take(count.saturating_mul(8))?;
        Ok((first, count))
    }
}

//! Messages as they are written: numbers, each at a multiple of its size from the byte after the header's four (OMG's CDR, little-endian).

/// The definition of `sensor_msgs/msg/JointState`.
pub(crate) const JOINT_STATE: &str = include_str!("messages/joint_state.msg");
/// The definition of `rcl_interfaces/msg/Log`.
pub(crate) const LOG: &str = include_str!("messages/log.msg");
/// `Log`'s levels (rcl_interfaces).
pub(crate) const INFO: u8 = 20;
#[cfg(feature = "mcap")]
pub(crate) const WARN: u8 = 30;

/// Bytes that say how the others are written.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A message as it grows.
pub(crate) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// A message that begins with a stamp, ns.
    pub(crate) fn new(stamp_ns: u64) -> Self {
        let mut own = Self {
            bytes: HEADER.to_vec(),
        };
        own.u32((stamp_ns / 1_000_000_000) as u32);
        own.u32((stamp_ns % 1_000_000_000) as u32);
        own
    }

    fn align(&mut self, size: usize) {
        let body = self.bytes.len() - HEADER.len();
        self.bytes
            .resize(HEADER.len() + body.next_multiple_of(size), 0);
    }

    /// A byte.
    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// A number.
    pub(crate) fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    /// A string.
    pub(crate) fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    /// A sequence.
    pub(crate) fn numbers(&mut self, numbers: &[f64]) {
        self.u32(numbers.len() as u32);
        if !numbers.is_empty() {
            self.align(8);
        }
        numbers
            .iter()
            .for_each(|x| self.bytes.extend(x.to_le_bytes()));
    }

    /// The message.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// A `sensor_msgs/msg/JointState`: positions, velocities and efforts, each a number per joint or none.
pub(crate) fn joint_state<'a>(
    stamp_ns: u64,
    joints: impl ExactSizeIterator<Item = &'a str>,
    row: &[Vec<f64>; 3],
) -> Vec<u8> {
    let mut cdr = Cdr::new(stamp_ns);
    cdr.text("");
    cdr.u32(joints.len() as u32);
    joints.for_each(|joint| cdr.text(joint));
    row.iter().for_each(|numbers| cdr.numbers(numbers));
    cdr.finish()
}

/// An `rcl_interfaces/msg/Log`: a line of text, of this level, by whoever is called `name`.
pub(crate) fn log(stamp_ns: u64, level: u8, name: &str, text: &str) -> Vec<u8> {
    let mut cdr = Cdr::new(stamp_ns);
    cdr.u8(level);
    cdr.text(name);
    cdr.text(text);
    cdr.text("");
    cdr.text("");
    cdr.u32(0);
    cdr.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OMG's alignment: after the header's four bytes a number lies at a multiple of its size.
    #[test]
    fn numbers_are_aligned_to_the_body() {
        let mut cdr = Cdr::new(1_500_000_000);
        cdr.text("a");
        cdr.numbers(&[2.0]);
        let bytes = cdr.finish();
        let body = &bytes[4..];
        assert_eq!(body[..8], [1, 0, 0, 0, 0x00, 0x65, 0xcd, 0x1d]);
        assert_eq!(body[8..14], [2, 0, 0, 0, b'a', 0]);
        assert_eq!(body[16..20], [1, 0, 0, 0]);
        assert_eq!(body[24..], 2.0f64.to_le_bytes());
    }
}

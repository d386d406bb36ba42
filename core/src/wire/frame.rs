//! Framing: `0x00 | COBS( sequence varint | message | CRC-32 little-endian ) | 0x00`.

use core::marker::PhantomData;

use cobs::{DecodeResult, DecoderState};
use crc::{CRC_32_ISCSI, Crc};
use heapless::String;
use serde::{Serialize, de::DeserializeOwned};

use super::{DeviceMessage, HostMessage, Peer, SCHEMA};

/// Bytes that the largest message takes on the wire; a test fills every field.
pub const MAX_FRAME: usize = 672;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);
const CRC_LEN: usize = 4;

/// Why a frame was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WireError {
    /// It is longer than any message.
    TooLong,
    /// It ended early: bytes are missing or changed.
    Cut,
    /// Its CRC is wrong.
    Crc,
    /// Its CRC is right and it is no message: the peer speaks otherwise.
    Malformed,
    /// It is whole, and of a kind whose layout is another one at the device: [`Peer`]. Nothing was lost on the way.
    OtherLayout,
    /// The device was built from other messages, its hello included.
    Incompatible {
        /// The schema it named.
        theirs: [u8; 8],
        /// The version of its firmware; empty if it does not say it where this program's would.
        firmware: String<24>,
    },
}

impl core::fmt::Display for WireError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooLong => f.write_str("frame longer than any message"),
            Self::Cut => f.write_str("frame cut short"),
            Self::Crc => f.write_str("frame with a wrong checksum"),
            Self::Malformed => f.write_str("frame that holds no known message"),
            Self::OtherLayout => f.write_str("message whose layout is another one at the device"),
            Self::Incompatible { theirs, firmware } => write!(
                f,
                "the device's firmware {firmware} speaks schema {:016x}, this program {} schema {:016x}",
                u64::from_be_bytes(*theirs),
                env!("CARGO_PKG_VERSION"),
                u64::from_be_bytes(SCHEMA)
            ),
        }
    }
}

impl core::error::Error for WireError {}

/// A [`DeviceMessage`] or a [`HostMessage`].
pub trait Message: Serialize + DeserializeOwned + private::Sealed {
    /// Looks at a message's bytes before they are read as one; whether they may end early, what they lack being zeros.
    ///
    /// # Errors
    /// [`WireError::Incompatible`] and [`WireError::OtherLayout`] if their layout is another one.
    fn check(bytes: &[u8], peer: &mut Peer) -> Result<bool, WireError>;
}

impl Message for HostMessage {
    fn check(_: &[u8], _: &mut Peer) -> Result<bool, WireError> {
        Ok(false)
    }
}

impl Message for DeviceMessage {
    fn check(bytes: &[u8], peer: &mut Peer) -> Result<bool, WireError> {
        match bytes.split_first() {
            Some((0, hello)) => {
                *peer = Peer::of(hello)?;
                Ok(peer.is_short)
            }
            Some((kind, _)) if !peer.says(usize::from(*kind)) => Err(WireError::OtherLayout),
            _ => Ok(false),
        }
    }
}

mod private {
    pub trait Sealed {}
    impl Sealed for super::DeviceMessage {}
    impl Sealed for super::HostMessage {}
}

/// Numbers messages and makes frames of them.
#[derive(Clone, Debug, Default)]
pub struct Sender {
    sequence: u16,
}

impl Sender {
    /// The frame of `message`, in `buffer`. Empty only if the message did not fit, which [`MAX_FRAME`] rules out; the
    /// number is used up all the same, so that the receiver knows.
    pub fn encode<'a, M: Message>(
        &mut self,
        message: &M,
        buffer: &'a mut [u8; MAX_FRAME],
    ) -> &'a [u8] {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        encode(&(sequence, message), buffer).unwrap_or_default()
    }
}

/// Where a message is before it is stuffed: behind what stuffing puts before its bytes, a zero and a length for each 254 of them.
const FRONT: usize = 2 + MAX_FRAME.div_ceil(254);

/// Message, checksum and stuffing one after the other, each a loop over all bytes: no byte waits for a call of the other two.
fn encode<'a, V: Serialize>(value: &V, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let plain = buffer.get_mut(FRONT..)?;
    let length = postcard::to_slice(value, plain).ok()?.len();
    let (message, rest) = plain.split_at_mut_checked(length)?;
    *rest.first_chunk_mut()? = CRC.checksum(message).to_le_bytes();
    let length = stuff(buffer, length + CRC_LEN)?;
    buffer.get(..length)
}

/// Consistent overhead byte stuffing (Cheshire & Baker 1999) of the bytes from [`FRONT`] on, towards the buffer's beginning; the frame's length.
/// postcard's own would panic where there is no room.
fn stuff(buffer: &mut [u8], length: usize) -> Option<usize> {
    *buffer.first_mut()? = 0;
    // Where the length of the open run of bytes goes, and where its next byte does.
    let (mut code, mut at) = (1, 2);
    for from in FRONT..FRONT + length {
        let byte = *buffer.get(from)?;
        if byte != 0 {
            *buffer.get_mut(at)? = byte;
            at += 1;
        }
        // A run's length with its own byte is 255 at most.
        if byte == 0 || at - code == 255 {
            *buffer.get_mut(code)? = (at - code) as u8;
            (code, at) = (at, at + 1);
        }
    }
    *buffer.get_mut(code)? = (at - code) as u8;
    *buffer.get_mut(at)? = 0;
    Some(at + 1)
}

/// Finds frames in bytes and the messages in them.
#[derive(Debug)]
pub struct Receiver<M> {
    state: DecoderState,
    buffer: [u8; MAX_FRAME],
    len: usize,
    /// The open frame has outgrown the buffer.
    overflow: bool,
    expected: Option<u16>,
    bad: u32,
    missed: u32,
    peer: Peer,
    message: PhantomData<M>,
}

impl<M: Message> Default for Receiver<M> {
    fn default() -> Self {
        Self {
            state: DecoderState::Idle,
            buffer: [0; MAX_FRAME],
            len: 0,
            overflow: false,
            expected: None,
            bad: 0,
            missed: 0,
            peer: Peer::default(),
            message: PhantomData,
        }
    }
}

impl<M: Message> Receiver<M> {
    /// Frames that were damaged or no message.
    pub fn bad(&self) -> u32 {
        self.bad
    }

    /// Frames that never came, whole, by the sequence numbers: at least those of [`Self::bad`] that had one. A peer that
    /// starts anew starts its numbers anew, which counts as well.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// How the device's messages differ from this program's, by its last hello.
    pub fn peer(&self) -> Peer {
        self.peer
    }

    /// Takes one byte; gives the message that it completes, or why there is none.
    ///
    /// # Errors
    /// [`WireError`] for the frame that the byte ends.
    pub fn push(&mut self, byte: u8) -> Option<Result<M, WireError>> {
        let outcome = match self.state.feed(byte) {
            Ok(DecodeResult::NoData) => return None,
            Ok(DecodeResult::DataContinue(data)) => {
                match self.buffer.get_mut(self.len) {
                    Some(slot) => {
                        *slot = data;
                        self.len += 1;
                    }
                    None => self.overflow = true,
                }
                return None;
            }
            Ok(DecodeResult::DataComplete) if self.overflow => Err(WireError::TooLong),
            Ok(DecodeResult::DataComplete) => self.open(),
            Err(_) => Err(WireError::Cut),
        };
        self.len = 0;
        self.overflow = false;
        if outcome
            .as_ref()
            .is_err_and(|e| *e != WireError::OtherLayout)
        {
            self.bad = self.bad.wrapping_add(1);
        }
        Some(outcome)
    }

    /// The message in the buffer.
    fn open(&mut self) -> Result<M, WireError> {
        let Some((frame, after)) = self.buffer.split_at_mut_checked(self.len) else {
            return Err(WireError::TooLong);
        };
        let Some((content, crc)) = frame.split_last_chunk_mut::<CRC_LEN>() else {
            return Err(WireError::Cut);
        };
        if CRC.checksum(content) != u32::from_le_bytes(*crc) {
            return Err(WireError::Crc);
        }
        let (sequence, message) =
            postcard::take_from_bytes::<u16>(content).map_err(|_| WireError::Malformed)?;
        let expected = self.expected.unwrap_or(sequence);
        self.missed = self
            .missed
            .wrapping_add(u32::from(sequence.wrapping_sub(expected)));
        self.expected = Some(sequence.wrapping_add(1));
        if M::check(message, &mut self.peer)? {
            let begin = content.len() - message.len();
            crc.fill(0);
            after.fill(0);
            let whole = self.buffer.get(begin..).unwrap_or_default();
            return postcard::from_bytes(whole).map_err(|_| WireError::Malformed);
        }
        match postcard::take_from_bytes(message) {
            Ok((message, [])) => Ok(message),
            _ => Err(WireError::Malformed),
        }
    }
}

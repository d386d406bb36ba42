//! Messages over a byte stream.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use proprio_core::wire::{
    DeviceMessage, Hello, HostMessage, MAX_FRAME, Receiver, Sender, WireError,
};

use super::DeviceError;
use super::names::words_of_heard;

/// How long a device may say nothing when an answer is due.
pub(super) const PATIENCE: Duration = Duration::from_secs(20);

/// The host's end of the link: a stream whose reads time out.
pub(super) struct Link<S> {
    stream: S,
    sender: Sender,
    receiver: Receiver<DeviceMessage>,
}

impl<S: Read + Write> Link<S> {
    pub(super) fn new(stream: S) -> Self {
        Self {
            stream,
            sender: Sender::default(),
            receiver: Receiver::default(),
        }
    }

    /// Sends a message.
    ///
    /// # Errors
    /// [`DeviceError::OtherLayout`] if the device would not read it; it is not sent then.
    pub(super) fn send(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
        if !self.receiver.peer().hears(message.kind()) {
            return Err(DeviceError::OtherLayout(words_of_heard(message.kind())));
        }
        let mut buffer = [0; MAX_FRAME];
        self.stream
            .write_all(self.sender.encode(message, &mut buffer))?;
        Ok(())
    }

    /// Sends bytes that need be no message.
    pub(super) fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.stream.write_all(bytes)?;
        Ok(())
    }

    /// Reads what has come, up to one buffer; false if nothing came within the stream's timeout. Damaged frames are only
    /// counted: the sequence numbers tell that a message is missing.
    pub(super) fn receive(
        &mut self,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<bool, DeviceError> {
        let mut buffer = [0; 4096];
        let length = match self.stream.read(&mut buffer) {
            Ok(0) => return Err(std::io::Error::from(ErrorKind::UnexpectedEof).into()),
            Ok(length) => length,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Ok(false);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => return Ok(true),
            Err(error) => return Err(error.into()),
        };
        for &byte in &buffer[..length] {
            match self.receiver.push(byte) {
                Some(Ok(message)) => told(message),
                Some(Err(error @ WireError::Incompatible { .. })) => return Err(error.into()),
                Some(Err(_)) | None => {}
            }
        }
        Ok(true)
    }

    /// Waits for the device to say who it is; what it says before that is not trusted.
    pub(super) fn hello(&mut self) -> Result<Hello, DeviceError> {
        let mut hello = None;
        let started = Instant::now();
        while hello.is_none() {
            self.receive(&mut |message| {
                if let DeviceMessage::Hello(said) = message {
                    hello = Some(said);
                }
            })?;
            if started.elapsed() > PATIENCE {
                return Err(DeviceError::Silent(PATIENCE.as_secs()));
            }
        }
        hello.ok_or(DeviceError::Silent(PATIENCE.as_secs()))
    }

    /// Frames from the device that were damaged, and that never came.
    pub(super) fn losses(&self) -> (u32, u32) {
        (self.receiver.bad(), self.receiver.missed())
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use proprio_core::wire::{Action, Change, ChangeKind, Request, SAID};

    use super::*;
    use crate::device::names::words_of_lacking;
    use crate::device::{Desktop, Device};

    /// What a device says, and what it is sent.
    struct Wires(io::Cursor<Vec<u8>>, Vec<u8>);

    impl Read for Wires {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.0.read(buffer)
        }
    }

    impl Write for Wires {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.1.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// A device that was built when changes and requests were others and walks were not told is watched, and what is missing is named.
    #[test]
    fn an_older_device_is_read_and_what_it_lacks_is_named() {
        let mut hello = Desktop::<f64>::new().hello().clone();
        hello.schema[0] ^= 1;
        hello.says.truncate(SAID - 1);
        hello.says[6][0] ^= 1;
        hello.hears[1][0] ^= 1;
        let change = DeviceMessage::Change(Change {
            leg: 0,
            joint: 0,
            kind: ChangeKind::Bias,
            size: 1.0,
            since_us: 0,
            time_us: 1,
        });
        let counters = DeviceMessage::Counters(Default::default());
        let (mut sender, mut said) = (Sender::default(), Vec::new());
        for message in [DeviceMessage::Hello(hello), change, counters.clone()] {
            said.extend(sender.encode(&message, &mut [0; MAX_FRAME]));
        }
        let mut link = Link::new(Wires(io::Cursor::new(said), Vec::new()));
        let mut messages = Vec::new();
        link.receive(&mut |message| messages.push(message)).unwrap();
        let [DeviceMessage::Hello(hello), read] = &messages[..] else {
            panic!("{messages:?}")
        };
        assert_eq!(*read, counters);
        assert_eq!(link.losses(), (0, 0));
        let words = words_of_lacking(hello).expect("what is missing is named");
        let expected = "not shown: changes, estimates of a walking robot; not taken: requests";
        assert!(words.ends_with(expected), "{words}");

        let (id, action) = (1, Action::Reset);
        let refused = link.send(&HostMessage::Request(Request { id, action }));
        assert!(
            matches!(refused, Err(DeviceError::OtherLayout("requests"))),
            "{refused:?}"
        );
        assert!(link.stream.1.is_empty());
        link.send(&HostMessage::RequestHello).unwrap();
        assert!(!link.stream.1.is_empty());
    }
}

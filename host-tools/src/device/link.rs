//! Messages over a byte stream.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use proprio_core::wire::{
    DeviceMessage, Hello, HostMessage, MAX_FRAME, Receiver, Sender, WireError,
};

use super::DeviceError;

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

    pub(super) fn send(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
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

//! Bytes that a thread reads, piece by piece: lines of text, or what a bus brought without a pause.

use std::io::{self, Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Instant;

use super::gather::gathered;
use super::until::{LOOK, Until};

/// Pieces that may wait; then whoever makes them waits.
const WAITING: usize = 4096;

/// Pieces as bytes, until they end or `until` says so: always whole ones, so that nothing is cut. An empty piece is the end.
pub(super) struct Pieces {
    pieces: Receiver<io::Result<Vec<u8>>>,
    /// The present piece, and how much of it was given.
    piece: Vec<u8>,
    at: usize,
    first: Option<Instant>,
    until: Until,
}

/// Where pieces go.
pub(super) type Sender = SyncSender<io::Result<Vec<u8>>>;

impl Pieces {
    /// None yet, and where they are to go.
    pub(super) fn new(until: Until) -> (Sender, Self) {
        let (send, pieces) = sync_channel(WAITING);
        let pieces = Self {
            pieces,
            piece: Vec::new(),
            at: 0,
            first: None,
            until,
        };
        (send, pieces)
    }
}

impl Read for Pieces {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at == self.piece.len() {
            if self.until.is_over(self.first) {
                return Ok(0);
            }
            match gathered(&self.pieces, LOOK) {
                Ok(piece) => {
                    (self.piece, self.at) = (piece?, 0);
                    self.first.get_or_insert_with(Instant::now);
                    if self.piece.is_empty() {
                        return Ok(0);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let left = &self.piece[self.at..];
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.at += count;
        Ok(count)
    }
}

/// Writes pieces: each write is one.
pub(super) struct PieceWriter(pub(super) Sender);

impl Write for PieceWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let sent = self.0.send(Ok(bytes.to_vec()));
        sent.map_err(|_| io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

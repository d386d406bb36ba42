//! Bytes of one bus that wait to be decoded, and when they came.

/// Bytes that can wait: 5 ms of a bus without a pause.
const CAPACITY: usize = 2048;
/// Pieces that can wait; a piece is what the bus brought without a pause, such as a frame.
const PIECES: usize = 128;

/// A pause between two pieces that no frame bridges, µs: eight bytes of a bus at 4 Mbit/s. Motors send a frame without any; interrupts note the
/// pieces' times to some µs.
const PAUSE_US: u64 = 20;

/// Bytes of one bus that wait, in pieces with the time at which each ended.
///
/// Within a piece the bytes followed each other at the rate of the line, so that the time of every byte is known. All
/// zeros at first, like the rest of a leg's data.
#[derive(Clone, Copy, Debug)]
pub struct Queue {
    bytes: [u8; CAPACITY],
    /// Where the waiting bytes begin and end in `bytes`.
    start: usize,
    end: usize,
    /// Bytes taken so far; counts wrap, like the pieces' ends.
    taken: u32,
    pieces: [Piece; PIECES],
    /// The oldest piece that waits, and how many there are.
    first: usize,
    count: usize,
    byte_ns: u32,
    /// What comes on top of [`PAUSE_US`] where an adapter says when bytes came, µs.
    late_us: u64,
    lost: u32,
}

/// Where a piece ends, counted in bytes since the start, and when its last byte came.
#[derive(Clone, Copy, Debug)]
struct Piece {
    end: u32,
    end_us: u64,
}

impl Default for Queue {
    fn default() -> Self {
        Self::new()
    }
}

impl Queue {
    /// Nothing waits.
    pub const fn new() -> Self {
        Self {
            bytes: [0; CAPACITY],
            start: 0,
            end: 0,
            taken: 0,
            pieces: [Piece { end: 0, end_us: 0 }; PIECES],
            first: 0,
            count: 0,
            byte_ns: 0,
            late_us: 0,
            lost: 0,
        }
    }

    /// The same where an adapter tells when bytes came, up to `late_us` late: as long a pause within a frame is its own.
    pub const fn of_adapter(late_us: u64) -> Self {
        let mut queue = Self::new();
        queue.late_us = late_us;
        queue
    }

    /// Whether the last `length` bytes taken came with a pause among them: bytes of two frames. Where all bytes of a piece have one time, nothing
    /// tells. To be asked after [`Self::taken_us`].
    #[inline]
    pub fn spans_pause(&self, length: u32) -> bool {
        let before = self.pieces.get((self.first + PIECES - 1) % PIECES);
        let began = self.taken.wrapping_sub(length);
        let earlier = before.map_or(0, |piece| piece.end.wrapping_sub(began));
        // Nearly always the piece before ended where this frame begins, or before.
        earlier.wrapping_sub(1) < length && self.pauses(before)
    }

    /// Whether there is a pause between a piece and the one after it, which holds the last byte taken.
    #[cold]
    fn pauses(&self, before: Option<&Piece>) -> bool {
        let (Some(before), Some(piece)) = (before, self.pieces.get(self.first)) else {
            return false;
        };
        if self.byte_ns == 0 {
            return false;
        }
        let bytes = piece.end.wrapping_sub(before.end);
        let length_us = u64::from(bytes.saturating_mul(self.byte_ns) / 1000);
        let pause_us = piece.end_us.saturating_sub(before.end_us);
        pause_us > length_us + PAUSE_US + self.late_us
    }

    /// Forgets what waits and what was lost, in place.
    pub fn clear(&mut self) {
        (self.start, self.end, self.taken) = (0, 0, 0);
        (self.first, self.count, self.lost) = (0, 0, 0);
        if let Some(last) = self.pieces.last_mut() {
            last.end = 0;
        }
    }

    /// Adds a piece whose last byte came at `end_us`, each byte `byte_ns` after the one before: 0 where all came at once.
    /// What finds no room is lost and counted.
    pub fn push(&mut self, bytes: &[u8], end_us: u64, byte_ns: u32) {
        self.byte_ns = byte_ns;
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
        if self.count == PIECES {
            self.forget_passed();
        }
        if self.end + bytes.len() > CAPACITY && self.start <= self.end && self.end <= CAPACITY {
            // Whole words to whole words: a third of the instructions.
            let odd = self.start % size_of::<usize>();
            let words = self.start - odd;
            self.bytes.copy_within(words..self.end, 0);
            (self.start, self.end) = (odd, self.end - words);
        }
        let room = match self.count < PIECES {
            true => CAPACITY - self.end,
            false => 0,
        };
        let (kept, lost) = bytes.split_at(bytes.len().min(room));
        self.lost = self.lost.wrapping_add(lost.len() as u32);
        if kept.is_empty() {
            return;
        }
        let end = self.end + kept.len();
        if let Some(space) = self.bytes.get_mut(self.end..end) {
            copy(kept, space);
            self.end = end;
        }
        // In 32 bits: a division of 64 is a library's on a microcontroller.
        let after_us = (lost.len() as u32).saturating_mul(byte_ns) / 1000;
        let waiting = self.end - self.start;
        if let Some(piece) = self.pieces.get_mut((self.first + self.count) % PIECES) {
            *piece = Piece {
                end: self.taken.wrapping_add(waiting as u32),
                end_us: end_us.saturating_sub(after_us.into()),
            };
            self.count += 1;
        }
    }

    /// The bytes that wait, oldest first.
    pub fn waiting(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or_default()
    }

    /// Takes `n` bytes off the front.
    pub fn take(&mut self, n: usize) {
        let n = n.min(self.end - self.start);
        self.start += n;
        self.taken = self.taken.wrapping_add(n as u32);
    }

    /// When the last of the bytes taken came, µs.
    pub fn taken_us(&mut self) -> u64 {
        self.forget_passed();
        let Some(piece) = self.pieces.get(self.first) else {
            return 0;
        };
        let after_ns = self.ahead(piece).wrapping_mul(self.byte_ns);
        piece.end_us.saturating_sub(u64::from(after_ns / 1000))
    }

    /// Forgets pieces that end before the last byte taken.
    fn forget_passed(&mut self) {
        while let Some(piece) = self.pieces.get(self.first)
            && self.ahead(piece) as usize > CAPACITY
            && self.count > 1
        {
            self.first = (self.first + 1) % PIECES;
            self.count -= 1;
        }
    }

    /// Bytes of a piece that are not taken; more than there can be where it ends before those taken.
    fn ahead(&self, piece: &Piece) -> u32 {
        piece.end.wrapping_sub(self.taken)
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Whether more waits than a listener that keeps up leaves.
    pub fn is_behind(&self) -> bool {
        self.end - self.start > CAPACITY / 2 || self.count > PIECES / 2
    }

    /// Bytes that found no room.
    pub fn lost(&self) -> u32 {
        self.lost
    }
}

/// Copies bytes to as many: 32 at a time in double words, a quarter of the instructions of a microcontroller's library.
#[inline]
fn copy(from: &[u8], to: &mut [u8]) {
    let (Some(last), Some(end)) = (from.last_chunk::<32>(), to.last_chunk_mut::<32>()) else {
        return to.copy_from_slice(from);
    };
    // The last 32 bytes on their own, also where they are others' too: no byte is left over.
    copy_block(last, end);
    let ((from, _), (to, _)) = (from.as_chunks(), to.as_chunks_mut());
    for (from, to) in from.iter().zip(to) {
        copy_block(from, to);
    }
}

/// Word by word and not as one array: of a loop over arrays the compiler would make the library's copy again.
#[inline]
fn copy_block(from: &[u8; 32], to: &mut [u8; 32]) {
    let ((from, _), (to, _)) = (from.as_chunks::<8>(), to.as_chunks_mut::<8>());
    if let ([a, b, c, d], [to_a, to_b, to_c, to_d]) = (from, to) {
        (*to_a, *to_b, *to_c, *to_d) = (*a, *b, *c, *d);
    }
}

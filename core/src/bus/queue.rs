//! Bytes of one bus that wait to be decoded, and when they came.

/// Bytes that can wait: 5 ms of a bus without a pause.
const CAPACITY: usize = 2048;
/// Pieces that can wait; a piece is what the bus brought without a pause, such as a frame.
const PIECES: usize = 128;

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
            lost: 0,
        }
    }

    /// Forgets what waits and what was lost, in place.
    pub fn clear(&mut self) {
        (self.start, self.end, self.taken) = (0, 0, 0);
        (self.first, self.count, self.lost) = (0, 0, 0);
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
            space.copy_from_slice(kept);
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

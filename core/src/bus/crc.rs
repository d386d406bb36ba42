//! CRC-16 with a seed that has to be found.
//!
//! Both frames end in a reflected CCITT CRC (polynomial 0x8408, no final exclusive or), started from a seed. A CRC is
//! linear over GF(2): starting from another seed exclusive-ors a constant that depends on the number of covered bytes and
//! not on what they are. So the constant of a frame is what its CRC differs by from the CRC with seed 0; equal constants
//! in successive, different frames are the seed's, for a chance agreement has probability 2⁻¹⁶ each. [`SeedTracker`]
//! does that; [`seed_of`] runs the register backwards from the constant to the seed itself.

/// Seed of motors sold alone.
pub const SEED_STANDALONE: u16 = 0x0000;
/// Seed of the commands captured on a Go2.
pub const SEED_GO2: u16 = 0x2CBB;

const POLYNOMIAL: u16 = 0x8408;

/// What a byte leaves in the register where n bytes follow it. Four bytes at a time cost a third of one at a time, and checksums
/// are most of what listening costs (slicing, Kounavis & Berry 2005).
const TABLES: [[u16; 256]; 4] = {
    let mut tables = [[0; 256]; 4];
    let mut n = 0;
    while n < 4 {
        let mut byte = 0;
        while byte < 256 {
            tables[n][byte] = constant_of(byte as u16, n + 1);
            byte += 1;
        }
        n += 1;
    }
    tables
};

/// CRC of `body` started from 0: CRC-16/KERMIT.
#[inline]
fn seed_zero(body: &[u8]) -> u16 {
    let (fours, rest) = body.as_chunks::<4>();
    let (pairs, odd) = rest.as_chunks::<2>();
    let entry = |after: usize, byte: u8| TABLES[after][usize::from(byte)];
    let four = |register: u16, bytes: &[u8; 4]| {
        let [a, b, c, d] = (u32::from(register) ^ u32::from_le_bytes(*bytes)).to_le_bytes();
        entry(3, a) ^ entry(2, b) ^ entry(1, c) ^ entry(0, d)
    };
    let two = |register: u16, pair: &[u8; 2]| {
        let [first, second] = (register ^ u16::from_le_bytes(*pair)).to_le_bytes();
        entry(1, first) ^ entry(0, second)
    };
    let one = |register: u16, byte: &u8| {
        let [low, high] = register.to_le_bytes();
        entry(0, low ^ byte) ^ u16::from(high)
    };
    odd.iter()
        .fold(pairs.iter().fold(fours.iter().fold(0, four), two), one)
}

/// CRC of `body` started from `seed`.
pub fn checksum(seed: u16, body: &[u8]) -> u16 {
    seed_zero(body) ^ constant_of(seed, body.len())
}

/// The constant that `seed` exclusive-ors into the CRC of `covered` bytes.
pub const fn constant_of(seed: u16, covered: usize) -> u16 {
    let mut register = seed;
    let mut bit = 0;
    while bit < 8 * covered {
        let carry = register & 1;
        register >>= 1;
        if carry != 0 {
            register ^= POLYNOMIAL;
        }
        bit += 1;
    }
    register
}

/// The seed whose constant over `covered` bytes is `constant`: the inverse of [`constant_of`].
pub const fn seed_of(constant: u16, covered: usize) -> u16 {
    let mut register = constant;
    let mut bit = 0;
    while bit < 8 * covered {
        // The polynomial's top bit is set and a shift right clears it, so the top bit is the carry that was.
        let carry = register >> 15;
        if carry != 0 {
            register ^= POLYNOMIAL;
        }
        register = (register << 1) | carry;
        bit += 1;
    }
    register
}

/// Decides whether a frame's CRC, over `COVERED` bytes, is good when the seed has to be learnt from the frames themselves.
///
/// A frame that fits a known seed ([`SEED_STANDALONE`], [`SEED_GO2`]) is taken at once, and from then on only that seed
/// is good. Any other constant must be met in [`Self::CONFIRMATIONS`] frames in a row, each different from the one before
/// (the same wrong frame repeated proves nothing); the last of them is the first good frame. The same rule replaces a
/// seed that was accepted by chance.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeedTracker<const COVERED: usize> {
    accepted: Option<u16>,
    candidate: Candidate,
}

#[derive(Clone, Copy, Debug, Default)]
struct Candidate {
    constant: u16,
    checksum: u16,
    frames: u8,
}

impl Candidate {
    const NONE: Self = Self {
        constant: 0,
        checksum: 0,
        frames: 0,
    };
}

impl<const COVERED: usize> SeedTracker<COVERED> {
    /// Frames in a row that must agree on an unknown seed: chance agreement is 2⁻⁴⁸.
    pub const CONFIRMATIONS: u8 = 4;

    const KNOWN: [u16; 2] = [
        constant_of(SEED_STANDALONE, COVERED),
        constant_of(SEED_GO2, COVERED),
    ];

    /// A tracker that has met no frame.
    pub const fn new() -> Self {
        Self {
            accepted: None,
            candidate: Candidate::NONE,
        }
    }

    /// The seed in use, once a frame was good.
    pub fn seed(&self) -> Option<u16> {
        self.accepted.map(|constant| seed_of(constant, COVERED))
    }

    /// Whether a frame with this `body` and `received` CRC has the seed in use. Learns nothing from those that do not.
    #[inline]
    pub fn fits(&mut self, body: &[u8; COVERED], received: u16) -> bool {
        let fits = self.accepted == Some(received ^ seed_zero(body));
        if fits {
            self.candidate.frames = 0;
        }
        fits
    }

    /// Whether a frame with this `body` and `received` CRC is good.
    pub fn accept(&mut self, body: &[u8; COVERED], received: u16) -> bool {
        let constant = received ^ seed_zero(body);
        let fits = match self.accepted {
            Some(accepted) => constant == accepted,
            None => Self::KNOWN.contains(&constant),
        };
        if fits || self.confirms(constant, received) {
            self.accepted = Some(constant);
            self.candidate.frames = 0;
            return true;
        }
        false
    }

    fn confirms(&mut self, constant: u16, received: u16) -> bool {
        let candidate = &mut self.candidate;
        if candidate.frames == 0 || candidate.constant != constant {
            *candidate = Candidate {
                constant,
                checksum: received,
                frames: 1,
            };
        } else if candidate.checksum != received {
            candidate.checksum = received;
            candidate.frames += 1;
        }
        candidate.frames >= Self::CONFIRMATIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_catalogues() {
        let kermit = crc::Crc::<u16>::new(&crc::CRC_16_KERMIT);
        let bytes: [u8; 64] = core::array::from_fn(|n| (n * n * 7 + 3 * n) as u8);
        for from in 0..8 {
            for to in from..64 {
                assert_eq!(
                    checksum(0, &bytes[from..to]),
                    kermit.checksum(&bytes[from..to])
                );
            }
        }
    }

    #[test]
    fn constants_of_the_go2_seed() {
        assert_eq!(constant_of(SEED_GO2, 15), 0xE021);
        assert_eq!(constant_of(SEED_GO2, 14), 0x1797);
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn every_seed_is_solved_from_its_constant() {
        for seed in 0..=u16::MAX {
            assert_eq!(seed_of(constant_of(seed, 14), 14), seed);
        }
    }

    #[test]
    fn an_unknown_seed_is_proposed_and_confirmed() {
        let seed = 0xBEEF;
        let mut tracker = SeedTracker::<14>::new();
        let verdicts =
            [0u8, 1, 2, 3, 4].map(|n| tracker.accept(&[n; 14], checksum(seed, &[n; 14])));
        assert_eq!(verdicts, [false, false, false, true, true]);
        assert_eq!(tracker.seed(), Some(seed));
        assert!(!tracker.accept(&[9; 14], checksum(SEED_GO2, &[9; 14])));
    }

    #[test]
    fn the_same_wrong_frame_again_proves_nothing() {
        let mut tracker = SeedTracker::<14>::new();
        for _ in 0..100 {
            assert!(!tracker.accept(&[7; 14], 0x1234));
        }
        assert_eq!(tracker.seed(), None);
    }
}

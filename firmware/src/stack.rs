//! How deep the stack has been: cortex-m-rt paints it before main, and what is still painted was never used.

use core::ptr::{self, addr_of};

/// The word that cortex-m-rt paints with (feature `paint-stack`).
const PAINT: u32 = 0xCCCC_CCCC;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// The deepest stack so far.
pub struct HighWater {
    /// Lowest address not known to be painted; the next look starts there.
    lowest: *const u32,
}

impl HighWater {
    /// Nothing looked at yet.
    pub fn new() -> Self {
        Self {
            lowest: addr_of!(_stack_start),
        }
    }

    /// Bytes used at the deepest so far. Looks at most `PATIENCE` words further than the last time: a frame that left that
    /// much untouched in its middle hides what is below it.
    pub fn bytes(&mut self) -> u32 {
        const PATIENCE: usize = 256;
        let end = addr_of!(_stack_end);
        let mut look = self.lowest;
        let mut painted = 0;
        while look > end && painted < PATIENCE {
            look = look.wrapping_sub(1);
            // SAFETY: an aligned word between the linker's stack bounds, in initialised memory.
            if unsafe { ptr::read_volatile(look) } == PAINT {
                painted += 1;
            } else {
                painted = 0;
                self.lowest = look;
            }
        }
        (addr_of!(_stack_start) as usize - self.lowest as usize) as u32
    }
}

impl Default for HighWater {
    fn default() -> Self {
        Self::new()
    }
}

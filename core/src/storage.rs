//! RAM that behaves as flash does: what snapshots are kept in on the desktop and on emulated boards.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Bytes of a sector, which is erased as a whole: a snapshot fits one.
pub const SECTOR: usize = 64 * 1024;
/// Bytes that are written at once.
pub const WORD: usize = 32;

/// NOR flash in RAM, of whole sectors of [`SECTOR`] bytes: erasing makes all bytes of a sector 0xFF, writing clears bits and is refused
/// where it is not the first since, as a microcontroller's flash with a checksum on every word refuses it.
///
/// Its power can be made to fail at any byte.
///
/// ```
/// use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
/// use proprio_core::storage::{RamFlash, SECTOR};
///
/// let mut memory = vec![0; 2 * SECTOR];
/// let mut flash = RamFlash::new(&mut memory[..]);
/// flash.erase(0, SECTOR as u32).unwrap();
/// flash.write(0, &[7; 32]).unwrap();
/// assert!(flash.write(0, &[7; 32]).is_err());
/// let mut read = [0; 2];
/// flash.read(31, &mut read).unwrap();
/// assert_eq!(read, [7, 0xFF]);
/// ```
#[derive(Clone, Debug)]
pub struct RamFlash<S> {
    bytes: S,
    /// Bytes that are still erased or written before the power fails.
    left: u64,
    /// Bytes that one call erases, and those that the erasure under way has.
    pace: u32,
    erased: u32,
}

/// Why [`RamFlash`] refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RamFlashError {
    /// As the traits say: beyond the end, or not at a multiple of a word or sector.
    Place(NorFlashErrorKind),
    /// A word was written twice without being erased.
    NotErased,
    /// The power failed, in the midst of it or before.
    NoPower,
    /// An erasure is under way: the same call again goes on with it.
    Busy,
}

impl core::fmt::Display for RamFlashError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Place(kind) => write!(f, "{kind}"),
            Self::NotErased => f.write_str("a word was written twice without being erased"),
            Self::NoPower => f.write_str("the power failed"),
            Self::Busy => f.write_str("an erasure is under way"),
        }
    }
}

impl core::error::Error for RamFlashError {}

impl NorFlashError for RamFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place(kind) => *kind,
            _ => NorFlashErrorKind::Other,
        }
    }
}

impl<S: AsRef<[u8]> + AsMut<[u8]>> RamFlash<S> {
    /// Flash that has what is in `bytes`, a number of whole sectors.
    pub const fn new(bytes: S) -> Self {
        Self::with_pace(bytes, u32::MAX)
    }

    /// The same, where a call of `erase` erases so many bytes, at least one, and returns [`RamFlashError::Busy`] until all are: a
    /// microcontroller's flash takes seconds.
    pub const fn with_pace(bytes: S, pace: u32) -> Self {
        Self {
            bytes,
            left: u64::MAX,
            pace,
            erased: 0,
        }
    }

    /// Has the power fail after so many more bytes are erased or written.
    pub fn fail_after(&mut self, bytes: u64) {
        self.left = bytes;
    }

    /// The bytes, as they are.
    pub fn into_inner(self) -> S {
        self.bytes
    }

    /// Changes bytes one by one, until the power fails.
    fn change(
        &mut self,
        from: u32,
        to: u32,
        mut value: impl FnMut(usize, u8) -> u8,
    ) -> Result<(), RamFlashError> {
        let bytes = self.bytes.as_mut().get_mut(from as usize..to as usize);
        for (n, byte) in bytes.unwrap_or(&mut []).iter_mut().enumerate() {
            self.left = self.left.checked_sub(1).ok_or(RamFlashError::NoPower)?;
            *byte = value(n, *byte);
        }
        Ok(())
    }
}

impl<S> ErrorType for RamFlash<S> {
    type Error = RamFlashError;
}

impl<S: AsRef<[u8]> + AsMut<[u8]>> ReadNorFlash for RamFlash<S> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        check_read(self, offset, bytes.len()).map_err(RamFlashError::Place)?;
        let kept = self.bytes.as_ref().get(offset as usize..).unwrap_or(&[]);
        bytes
            .iter_mut()
            .zip(kept)
            .for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.as_ref().len() / SECTOR * SECTOR
    }
}

impl<S: AsRef<[u8]> + AsMut<[u8]>> NorFlash for RamFlash<S> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        check_erase(self, from, to).map_err(RamFlashError::Place)?;
        let start = from.saturating_add(self.erased).min(to);
        let end = start.saturating_add(self.pace.max(1)).min(to);
        self.change(start, end, |_, _| 0xFF)?;
        let done = end == to;
        self.erased = if done { 0 } else { end - from };
        if done {
            Ok(())
        } else {
            Err(RamFlashError::Busy)
        }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        check_write(self, offset, bytes.len()).map_err(RamFlashError::Place)?;
        let end = offset.saturating_add(bytes.len() as u32);
        let kept = self.bytes.as_ref().get(offset as usize..end as usize);
        if kept.unwrap_or(&[]).iter().any(|byte| *byte != 0xFF) {
            return Err(RamFlashError::NotErased);
        }
        self.change(offset, end, |n, byte| {
            byte & bytes.get(n).copied().unwrap_or(0xFF)
        })
    }
}

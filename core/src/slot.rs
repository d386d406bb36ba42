//! A place for what is made later.

/// A value, or none yet. Unlike an `Option`, which may mark nothing by a number that its value cannot hold, an empty slot is
/// all zeros in memory: a static that begins with empty slots takes no flash.
#[derive(Clone, Copy, Debug)]
#[repr(u8)]
pub(crate) enum Slot<T> {
    /// Nothing.
    Empty,
    /// The value.
    Full(T),
}

impl<T> Slot<T> {
    /// The value, if there is one.
    #[inline(always)]
    pub(crate) fn get(&self) -> Option<&T> {
        match self {
            Self::Empty => None,
            Self::Full(value) => Some(value),
        }
    }

    /// The value, if there is one.
    #[inline(always)]
    pub(crate) fn get_mut(&mut self) -> Option<&mut T> {
        match self {
            Self::Empty => None,
            Self::Full(value) => Some(value),
        }
    }
}

impl<T: Copy> Slot<T> {
    /// The value, if there is one; the slot is empty then.
    pub(crate) fn take(&mut self) -> Option<T> {
        let value = self.get().copied();
        *self = Self::Empty;
        value
    }
}

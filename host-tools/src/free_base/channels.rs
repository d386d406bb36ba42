//! Numbers of each joint, or of each foot, sample by sample.

use std::ops::{Index, IndexMut};

/// See the module. `all[n][j]` is sample n's of joint j.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Channels {
    width: usize,
    numbers: Vec<f64>,
}

impl Channels {
    /// None yet, of so many joints.
    pub(crate) fn new(joints: usize) -> Self {
        Self {
            width: joints.max(1),
            numbers: Vec::new(),
        }
    }

    /// Of so many samples.
    pub(crate) fn from_fn(samples: usize, joints: usize, of: impl Fn(usize, usize) -> f64) -> Self {
        let mut all = Self::new(joints);
        all.numbers.reserve(samples * joints);
        for n in 0..samples {
            all.numbers.extend((0..joints).map(|j| of(n, j)));
        }
        all
    }

    /// Adds a sample's.
    pub(crate) fn push(&mut self, sample: &[f64]) {
        self.numbers.extend_from_slice(sample);
    }

    /// Sample by sample.
    pub(crate) fn iter(&self) -> impl DoubleEndedIterator<Item = &[f64]> + Clone {
        self.numbers.chunks_exact(self.width)
    }

    /// The last sample's.
    pub(crate) fn last(&self) -> Option<&[f64]> {
        self.iter().next_back()
    }

    /// How many joints there are.
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// One joint's, sample by sample.
    pub(crate) fn of(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.iter().map(move |all| all[joint])
    }
}

impl Index<usize> for Channels {
    type Output = [f64];

    fn index(&self, sample: usize) -> &[f64] {
        &self.numbers[self.width * sample..][..self.width]
    }
}

impl IndexMut<usize> for Channels {
    fn index_mut(&mut self, sample: usize) -> &mut [f64] {
        &mut self.numbers[self.width * sample..][..self.width]
    }
}

//! Writing a log.

use std::io::{self, Write};

use super::columns::Channel;
use super::joint::JointId;
use proprio_core::go2::Leg;

/// Writes a log of the motion of one or more legs.
pub struct LogWriter<W: Write> {
    out: W,
}

impl<W: Write> LogWriter<W> {
    /// Begins a log of `legs` on `out` with its header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(mut out: W, legs: &[Leg]) -> io::Result<Self> {
        write!(out, "t")?;
        for channel in Channel::MOTION {
            for joint in legs.iter().flat_map(|&leg| JointId::of(leg)) {
                write!(out, ",{}", channel.column(joint))?;
            }
        }
        writeln!(out)?;
        Ok(Self { out })
    }

    /// Adds a row: time in s, then positions (rad), velocities (rad/s) and torques (N m) of the legs' joints, as many
    /// as the header has.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, t: f64, q: &[f64], dq: &[f64], tau: &[f64]) -> io::Result<()> {
        // Six decimals hold microseconds, and are finer than every quantum of the motor bus.
        write!(self.out, "{t:.6}")?;
        for value in q.iter().chain(dq).chain(tau) {
            write!(self.out, ",{value:.7}")?;
        }
        writeln!(self.out)
    }

    /// Ends the log.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

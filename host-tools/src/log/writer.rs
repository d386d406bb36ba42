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
    pub fn new(out: W, legs: &[Leg]) -> io::Result<Self> {
        Self::with_header(out, legs, &Channel::MOTION)
    }

    /// Begins a log that has motor temperatures too: its rows are [`row_with_temperature`](Self::row_with_temperature).
    ///
    /// # Errors
    /// Those of `out`.
    pub fn with_temperature(out: W, legs: &[Leg]) -> io::Result<Self> {
        let [q, dq, tau] = Channel::MOTION;
        Self::with_header(out, legs, &[q, dq, tau, Channel::Temp])
    }

    fn with_header(mut out: W, legs: &[Leg], channels: &[Channel]) -> io::Result<Self> {
        write!(out, "t")?;
        for channel in channels {
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
        self.row_with_temperature(t, q, dq, tau, &[])
    }

    /// [`row`](Self::row) with motor temperatures, °C.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row_with_temperature(
        &mut self,
        t: f64,
        q: &[f64],
        dq: &[f64],
        tau: &[f64],
        temp: &[f64],
    ) -> io::Result<()> {
        // Six decimals hold microseconds, and are finer than every quantum of the motor bus.
        write!(self.out, "{t:.6}")?;
        for value in q.iter().chain(dq).chain(tau) {
            write!(self.out, ",{value:.7}")?;
        }
        for value in temp {
            write!(self.out, ",{value:.2}")?;
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

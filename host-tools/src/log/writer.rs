//! Writing a log.

use std::io::{self, Write};

use super::channel::Channel;
use super::columns::Columns;
use super::row::Row;
use super::slots::{Slots, TIME};
use proprio_core::go2::{JointId, Leg};

/// Writes a log of the motion of one or more legs.
pub struct LogWriter<W: Write> {
    out: W,
    more: Vec<Channel>,
}

impl<W: Write> LogWriter<W> {
    /// Begins a log of `legs` on `out` with its header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, legs: &[Leg]) -> io::Result<Self> {
        Self::with(out, legs, &[])
    }

    /// Begins a log that has `more` channels than those of the motion: its rows are [`row_with`](Self::row_with).
    ///
    /// # Errors
    /// Those of `out`.
    pub fn with(mut out: W, legs: &[Leg], more: &[Channel]) -> io::Result<Self> {
        write!(out, "t")?;
        for channel in Channel::MOTION.iter().chain(more) {
            for joint in legs.iter().flat_map(|&leg| JointId::of(leg)) {
                write!(out, ",{}", channel.column(joint))?;
            }
        }
        writeln!(out)?;
        let more = more.to_vec();
        Ok(Self { out, more })
    }

    /// Adds a row: time in s, then positions (rad), velocities (rad/s) and torques (N m) of the legs' joints, as many
    /// as the header has.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, t: f64, q: &[f64], dq: &[f64], tau: &[f64]) -> io::Result<()> {
        self.row_with(t, [q, dq, tau], &[])
    }

    /// [`row`](Self::row) with the values of the further channels, in the header's order.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row_with(&mut self, t: f64, motion: [&[f64]; 3], more: &[&[f64]]) -> io::Result<()> {
        self.cells(t, motion)?;
        for (channel, values) in self.more.iter().zip(more) {
            let decimals = if *channel == Channel::Temp { 2 } else { 7 };
            for value in *values {
                write!(self.out, ",{value:.decimals$}")?;
            }
        }
        writeln!(self.out)
    }

    /// The cells that every log has.
    fn cells(&mut self, t: f64, motion: [&[f64]; 3]) -> io::Result<()> {
        // Six decimals hold microseconds, and are finer than every quantum of the motor bus.
        write!(self.out, "{t:.6}")?;
        for value in motion.into_iter().flatten() {
            write!(self.out, ",{value:.7}")?;
        }
        Ok(())
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

/// Writes a log of a whole robot on its feet: all joints' motion, the IMU, and the feet's counts.
pub struct WalkWriter<W: Write> {
    motion: LogWriter<W>,
}

impl<W: Write> WalkWriter<W> {
    /// Begins a log of these joints and feet on `out` with its header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(mut out: W, joints: &[String], feet: &[&str]) -> io::Result<Self> {
        write!(out, "t")?;
        for channel in Channel::MOTION {
            for joint in joints {
                write!(out, ",{}", channel.column(joint))?;
            }
        }
        for (sensor, axis) in ["gyro", "acc"]
            .into_iter()
            .flat_map(|sensor| ["x", "y", "z"].map(|axis| (sensor, axis)))
        {
            write!(out, ",{sensor}/{axis}")?;
        }
        for foot in feet {
            write!(out, ",foot/{foot}")?;
        }
        writeln!(out)?;
        let more = Vec::new();
        Ok(Self {
            motion: LogWriter { out, more },
        })
    }

    /// Adds a row: time in s, positions (rad), velocities (rad/s) and torques (N m) of the joints in the header's order, angular velocity
    /// (rad/s) and specific force (m/s²) in the IMU's axes, the feet's counts.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(
        &mut self,
        t: f64,
        motion: [&[f64]; 3],
        imu: [[f64; 3]; 2],
        foot: impl Iterator<Item = f64>,
    ) -> io::Result<()> {
        self.motion.cells(t, motion)?;
        let out = &mut self.motion.out;
        for value in imu.as_flattened() {
            write!(out, ",{value:.7}")?;
        }
        // Whole counts as such, and those of an ideal sensor to what its noise would be a thousand times.
        for value in foot {
            if value.fract() == 0.0 {
                write!(out, ",{value:.0}")?;
            } else {
                write!(out, ",{value:.3}")?;
            }
        }
        writeln!(out)
    }

    /// Ends the log.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(self) -> io::Result<W> {
        self.motion.finish()
    }
}

/// Writes the rows of any log as proprio's own CSV, each number as the shortest that reads back the same.
pub struct CanonicalWriter<W: Write> {
    out: W,
    slots: Vec<usize>,
    start: Option<f64>,
}

impl<W: Write> CanonicalWriter<W> {
    /// Begins a log of all that `columns` records on `out`, with its header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(mut out: W, columns: &Columns) -> io::Result<Self> {
        write!(out, "t")?;
        let mut slots = Vec::new();
        for (name, slot) in named(columns) {
            if columns.has_slot(slot) {
                write!(out, ",{name}")?;
                slots.push(slot);
            }
        }
        writeln!(out)?;
        Ok(Self {
            out,
            slots,
            start: None,
        })
    }

    /// Adds a row; time counts from the first, s.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, row: &Row) -> io::Result<()> {
        let start = *self.start.get_or_insert(row.t());
        write!(self.out, "{}", row.t() - start)?;
        for &slot in &self.slots {
            write!(self.out, ",{}", row.at(slot))?;
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

/// Every column of the format but the time, and its slot.
fn named(columns: &Columns) -> Vec<(String, usize)> {
    let slots: Slots = columns.slots;
    let joints = columns.robot().bodies();
    let of = |channel: Channel| {
        let names = joints.iter().map(move |body| channel.column(&body.name));
        names.zip(slots.all(channel))
    };
    let mut named: Vec<(String, usize)> = Channel::ALL.into_iter().flat_map(of).collect();
    for (prefix, first, axes) in slots.groups() {
        let axes = axes.iter().enumerate();
        named.extend(axes.map(|(n, axis)| (format!("{prefix}/{axis}"), first + n)));
    }
    let limbs = columns.all_limbs().iter();
    named.extend(
        limbs
            .map(|limb| format!("foot/{}", limb.name))
            .zip(slots.feet()),
    );
    debug_assert!(named.iter().all(|(_, slot)| *slot != TIME));
    named
}

//! A row of a log in memory.

use proprio_core::go2::{JOINTS, JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::walk::WalkSample;
use proprio_core::window::Sample;

use super::channel::Channel;
use super::slots::{Slots, TIME};

/// One row of a log. Channels that the log does not have are NaN.
#[derive(Debug, Clone)]
pub struct Row {
    /// Number in the file, in what the file counts in: lines, messages, rows.
    pub line: u64,
    /// Time since the first row, rounded to µs.
    pub time_us: u64,
    slots: Slots,
    pub(super) values: Vec<f64>,
}

impl Row {
    pub(super) fn new(slots: Slots) -> Self {
        Self {
            line: 0,
            time_us: 0,
            slots,
            values: vec![f64::NAN; slots.count()],
        }
    }

    fn part<const N: usize>(&self, first: usize) -> &[f64; N] {
        self.values[first..]
            .first_chunk()
            .expect("every group lies within the slots")
    }

    fn of_joints(&self, channel: Channel) -> &[f64] {
        &self.values[self.slots.all(channel)]
    }

    /// What the estimator of a Go2's leg takes, from a Go2's log; NaN for a leg that the log does not have. Time counts from
    /// the log's first row.
    pub fn sample(&self, leg: Leg) -> Sample<f64, JOINTS_PER_LEG> {
        let first = JOINTS_PER_LEG * leg.index();
        let of = |channel| {
            let own = self.of_joints(channel).get(first..);
            let own = own.and_then(|own| own.first_chunk());
            own.copied().unwrap_or([f64::NAN; JOINTS_PER_LEG])
        };
        Sample {
            time_us: self.time_us,
            q: of(Channel::Q),
            dq: of(Channel::Dq),
            tau: of(Channel::Tau),
        }
    }

    /// What the estimator of a Go2 that walks takes, from a Go2's log with an IMU; NaN where the log has nothing. Time counts from the log's
    /// first row.
    pub fn walk_sample(&self) -> WalkSample<f64> {
        let of = |channel| {
            let all = self.of_joints(channel).first_chunk();
            all.copied().unwrap_or([f64::NAN; JOINTS])
        };
        let feet = self.foot().first_chunk();
        WalkSample {
            joints: Sample {
                time_us: self.time_us,
                q: of(Channel::Q),
                dq: of(Channel::Dq),
                tau: of(Channel::Tau),
            },
            gyro: (*self.gyro()).into(),
            acc: (*self.acc()).into(),
            count: feet.copied().unwrap_or([f64::NAN; LEGS]),
        }
    }

    /// Time, s, as recorded.
    pub fn t(&self) -> f64 {
        self.values[TIME]
    }

    /// Joint positions, rad (m of a prismatic joint), in the order of the robot's joints.
    pub fn q(&self) -> &[f64] {
        self.of_joints(Channel::Q)
    }

    /// Joint velocities, rad/s (m/s).
    pub fn dq(&self) -> &[f64] {
        self.of_joints(Channel::Dq)
    }

    /// Joint torques, N m (forces, N).
    pub fn tau(&self) -> &[f64] {
        self.of_joints(Channel::Tau)
    }

    /// Motor temperatures, degrees Celsius.
    pub fn temp(&self) -> &[f64] {
        self.of_joints(Channel::Temp)
    }

    /// Commanded joint positions, rad (m).
    pub fn q_des(&self) -> &[f64] {
        self.of_joints(Channel::QDes)
    }

    /// What the joints' drives were asked to do, by [`Channel::COMMAND`].
    pub fn command(&self) -> [&[f64]; 5] {
        Channel::COMMAND.map(|channel| self.of_joints(channel))
    }

    /// Positions of second encoders, at the links, rad (m).
    pub fn q_link(&self) -> &[f64] {
        self.of_joints(Channel::QLink)
    }

    /// Attitude quaternion, w x y z.
    pub fn quat(&self) -> &[f64; 4] {
        self.part(self.slots.quat())
    }

    /// Angular velocity of the base, rad/s.
    pub fn gyro(&self) -> &[f64; 3] {
        self.part(self.slots.gyro())
    }

    /// Specific force at the IMU, m/s².
    pub fn acc(&self) -> &[f64; 3] {
        self.part(self.slots.acc())
    }

    /// What lies at a slot.
    pub(super) fn at(&self, slot: usize) -> f64 {
        self.values[slot]
    }

    /// Foot sensors, uncalibrated, in the order of the robot's limbs.
    pub fn foot(&self) -> &[f64] {
        &self.values[self.slots.feet()]
    }
}

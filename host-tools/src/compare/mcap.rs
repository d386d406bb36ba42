//! Measured and predicted torque at the log's own rate as MCAP: messages of ROS 2 that Foxglove, PlotJuggler and Rerun plot as they are.
//!
//! Each topic holds `sensor_msgs/msg/JointState`, all joints in a message: position (rad), velocity (rad/s), and as effort the torque, N m, that the
//! topic is called after. `/events` holds `rcl_interfaces/msg/Log`, lines of text with their time. Bytes are CDR, little-endian (OMG DDSI-RTPS 2.5,
//! section 10), schemas those of ROS 2 Humble. A joint without a sample at a time has NaN.

use std::collections::BTreeMap;
use std::io::{self, Cursor};

use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};

use super::own_rate::own_rate_floors;
use super::{Comparison, own_rate};
use crate::detect::JointSeries;
use crate::log::cdr::{self, INFO, JOINT_STATE, LOG, WARN};
use crate::model::Model;
use crate::recording::Recording;

/// A sample of a series.
type Value = fn(&JointSeries, usize) -> f64;

/// A line of `/events`.
struct Event {
    t: f64,
    level: u8,
    name: String,
    text: String,
}

/// The file's bytes. `model` is what predicts; times are since the first log's start.
///
/// # Errors
/// If it cannot be written.
pub(super) fn bytes(
    comparison: &Comparison,
    recording: &Recording,
    model: &Model,
) -> io::Result<Vec<u8>> {
    let series = own_rate(recording, model);
    let floors = own_rate_floors(recording, model);
    let mut file = File::new()?;
    let times = times(&series);
    let topics: [(&str, Value); 3] = [
        ("/measured", |s, k| s.tau[k]),
        ("/predicted", |s, k| s.predicted[k]),
        ("/residual", |s, k| s.residual[k]),
    ];
    for (topic, effort) in topics {
        let channel = file.channel(topic, true)?;
        let mut next = vec![0; series.len()];
        for &t in &times {
            let mut row = [(); 3].map(|()| Vec::with_capacity(series.len()));
            for (s, next) in series.iter().zip(&mut next) {
                let has = s.t.get(*next) == Some(&t);
                let at = |value: Value| match has {
                    true => value(s, *next),
                    false => f64::NAN,
                };
                row[0].push(at(|s, k| s.q[k]));
                row[1].push(at(|s, k| s.dq[k]));
                row[2].push(at(effort));
                *next += usize::from(has);
            }
            file.write(channel, t, &joint_state(t, &series, &row))?;
        }
    }
    let floor = file.channel("/noise_floor", true)?;
    let of_joint = |s: &JointSeries| floors.get(&s.joint).copied().flatten().unwrap_or(f64::NAN);
    let row = [vec![], vec![], series.iter().map(of_joint).collect()];
    for t in [times.first(), times.last()].into_iter().flatten() {
        file.write(floor, *t, &joint_state(*t, &series, &row))?;
    }
    let channel = file.channel("/events", false)?;
    for event in events(comparison) {
        let Event {
            t,
            level,
            name,
            text,
        } = &event;
        let message = cdr::log(nanoseconds(*t), *level, name, text);
        file.write(channel, *t, &message)?;
    }
    file.finish()
}

/// The times at which any joint has a sample, in order.
fn times(series: &[JointSeries]) -> Vec<f64> {
    let mut times: Vec<f64> = series.iter().flat_map(|s| s.t.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// What is to be known of the logs, and the moments at which the error is worst, in the order of time.
fn events(comparison: &Comparison) -> Vec<Event> {
    let event = |t, level, name: &str, text: String| Event {
        t,
        level,
        name: name.to_owned(),
        text,
    };
    let logs = comparison.data.iter().flat_map(|log| {
        let findings = log.report.findings.iter();
        findings.map(move |finding| event(log.start, WARN, "data", finding.to_string()))
    });
    let warnings = comparison.warnings.iter();
    let warnings = warnings.map(|text| event(0.0, WARN, "compare", text.clone()));
    let feet = comparison.contact_sentences().into_iter();
    let feet = feet.map(|text| event(0.0, INFO, "contact", text));
    let episodes = comparison.episodes.iter().map(|ranked| {
        let episode = &ranked.episode;
        let text = format!(
            "residual {:+.3} N m, {:.1} times the usual one, at {:.3} rad and {:.2} rad/s",
            episode.residual, episode.size, episode.q, episode.dq
        );
        event(episode.t, WARN, &ranked.joint, text)
    });
    let mut all: Vec<Event> = logs.chain(warnings).chain(feet).chain(episodes).collect();
    all.sort_by(|a, b| a.t.total_cmp(&b.t));
    all
}

/// A message of all joints: positions, velocities and efforts, each a number per joint or none.
fn joint_state(t: f64, series: &[JointSeries], row: &[Vec<f64>; 3]) -> Vec<u8> {
    let joints = series.iter().map(|s| s.joint.as_str());
    cdr::joint_state(nanoseconds(t), joints, row)
}

fn nanoseconds(t: f64) -> u64 {
    (t * 1e6).round() as u64 * 1000
}

/// The file as it grows.
struct File {
    writer: Writer<Cursor<Vec<u8>>>,
    sequence: u32,
}

impl File {
    fn new() -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("proprio ", env!("CARGO_PKG_VERSION")));
        let writer = options.create(Cursor::new(Vec::new()));
        Ok(Self {
            writer: writer.map_err(io::Error::other)?,
            sequence: 0,
        })
    }

    /// A topic of joints' states, or else of lines of text.
    fn channel(&mut self, topic: &str, joints: bool) -> io::Result<u16> {
        let (name, definition) = match joints {
            true => ("sensor_msgs/msg/JointState", JOINT_STATE),
            false => ("rcl_interfaces/msg/Log", LOG),
        };
        let schema = self
            .writer
            .add_schema(name, "ros2msg", definition.as_bytes());
        let schema = schema.map_err(io::Error::other)?;
        let channel = self
            .writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new());
        channel.map_err(io::Error::other)
    }

    fn write(&mut self, channel_id: u16, t: f64, message: &[u8]) -> io::Result<()> {
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: nanoseconds(t),
            publish_time: nanoseconds(t),
        };
        self.sequence = self.sequence.wrapping_add(1);
        let written = self.writer.write_to_known_channel(&header, message);
        written.map_err(io::Error::other)
    }

    fn finish(mut self) -> io::Result<Vec<u8>> {
        self.writer.finish().map_err(io::Error::other)?;
        Ok(self.writer.into_inner().into_inner())
    }
}

//! Messages into an MCAP file, as they came, with the definition of their type.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};

use super::cdr::{JOINT_STATE, joint_state};
use super::columns::Columns;
use super::live::LiveMessage;
use super::row::Row;

/// The definitions of the types that are read, as ROS 2 writes them: the message's own fields, then those of each message inside. Sources:
/// unitree_ros2 eea2719, common_interfaces of ROS 2 Humble.
const DEFINITIONS: [(&str, &str); 3] = [
    (
        "unitree_go/msg/LowState",
        include_str!("messages/go_low_state.msg"),
    ),
    (
        "unitree_hg/msg/LowState",
        include_str!("messages/hg_low_state.msg"),
    ),
    ("sensor_msgs/msg/JointState", JOINT_STATE),
];

/// Bytes of a chunk before compression. Of each chunk the writer keeps an entry of the file's index, some 400 bytes: of chunks of the usual 0.75 MB
/// that is half a megabyte an hour. A reader that seeks unpacks a chunk at a time: some 7 s of a robot's LowState at 500 Hz.
const CHUNK: u64 = 1 << 22;

/// Writes messages of one topic as an MCAP file that every reader of ROS 2's knows.
pub struct MessageWriter<W: Write> {
    mcap: Writer<NoSeek<W>>,
    channel: u16,
    count: u32,
}

impl<W: Write> MessageWriter<W> {
    /// Begins a file of messages of `kind`, one of [`super::MESSAGE_KINDS`], on `topic`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, topic: &str, kind: &str) -> io::Result<Self> {
        // From front to back, so that it may go to a pipe.
        let mut mcap = WriteOptions::new()
            .profile("ros2")
            .disable_seeking(true)
            .chunk_size(Some(CHUNK))
            .create(NoSeek::new(out))
            .map_err(failed)?;
        let definition = DEFINITIONS.iter().find(|(known, _)| *known == kind);
        let text = definition.map_or("", |(_, text)| text);
        let schema = mcap.add_schema(kind, "ros2msg", text.as_bytes());
        // A bag of ROS 2 calls topics as ROS does, not as DDS does.
        let name = topic.strip_prefix("rt/").unwrap_or(topic);
        let name = format!("/{}", name.trim_start_matches('/'));
        let channel = mcap.add_channel(schema.map_err(failed)?, &name, "cdr", &BTreeMap::default());
        Ok(Self {
            channel: channel.map_err(failed)?,
            mcap,
            count: 0,
        })
    }

    /// Adds a message.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&mut self, message: &LiveMessage) -> io::Result<()> {
        let time = u64::try_from(message.received_ns).unwrap_or(0);
        let sent = message.sent_ns.and_then(|sent| u64::try_from(sent).ok());
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.count,
            log_time: time,
            publish_time: sent.unwrap_or(time),
        };
        self.count = self.count.wrapping_add(1);
        let written = self.mcap.write_to_known_channel(&header, &message.data);
        written.map_err(failed)
    }

    /// Adds a row, at `time_ns` since 1970, as the `JointState` of its joints, which `columns` names.
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, time_ns: i64, columns: &Columns, row: &Row) -> io::Result<()> {
        let of = |all: &[f64]| columns.joints().map(|joint| all[joint]).collect();
        let numbers = [of(row.q()), of(row.dq()), of(row.tau())];
        let bodies = columns.robot().bodies();
        let names: Vec<&str> = columns.joints().map(|j| bodies[j].name.as_str()).collect();
        let stamp = u64::try_from(time_ns).unwrap_or(0);
        self.write(&LiveMessage {
            received_ns: time_ns,
            sent_ns: None,
            data: joint_state(stamp, names.into_iter(), &numbers),
        })
    }

    /// Ends the file.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.mcap.finish().map_err(failed)?;
        Ok(self.mcap.into_inner().into_inner())
    }
}

fn failed(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{LogReader, MESSAGE_KINDS, Selection, can_be};

    /// The bytes that the fields of a definition take, by CDR's alignment from 0; sequences and strings are not of fixed length.
    fn length(definitions: &str, name: Option<&str>, mut at: usize) -> usize {
        let parts: Vec<&str> = definitions.split(&"=".repeat(80)).collect();
        let own = match name {
            None => parts[0],
            Some(name) => parts
                .iter()
                .find(|part| {
                    part.trim_start()
                        .lines()
                        .next()
                        .unwrap_or("")
                        .ends_with(&format!("/{name}"))
                })
                .unwrap(),
        };
        for line in own
            .lines()
            .filter(|l| !l.is_empty() && !l.starts_with("MSG:"))
        {
            let kind = line.split(' ').next().unwrap();
            let (kind, count) = match kind.split_once('[') {
                Some((kind, count)) => (kind, count.trim_end_matches(']').parse().unwrap()),
                None => (kind, 1usize),
            };
            let digits = kind.trim_start_matches(|c: char| !c.is_ascii_digit());
            for _ in 0..count {
                at = match digits.parse::<usize>() {
                    Ok(bits) => at.next_multiple_of(bits / 8) + bits / 8,
                    Err(_) => length(definitions, Some(kind), at),
                };
            }
        }
        at
    }

    /// The definitions that a file states are those by which its messages are read: of the same length.
    #[test]
    fn definitions_are_of_the_length_of_the_messages() {
        for (kind, text) in &DEFINITIONS[..2] {
            let mut data = vec![0u8; 4 + length(text, None, 0)];
            data[1] = 1;
            assert!(can_be(kind, &data), "{kind}: {}", data.len());
            data.pop();
            assert!(!can_be(kind, &data), "{kind}");
        }
        assert_eq!(DEFINITIONS.map(|(kind, _)| kind), MESSAGE_KINDS);
    }

    /// Of a receiver that took the first messages all at once, the time is the sender's all the same; of a sender that was busy too, that of its
    /// samples; of one whose clock stands or counts another unit, when the messages left; if that is not known either, the receiver's.
    #[test]
    fn a_busy_machine_does_not_set_the_time() {
        struct Given(std::vec::IntoIter<LiveMessage>);
        impl crate::log::LiveMessages for Given {
            fn next(&mut self) -> Option<LiveMessage> {
                self.0.next()
            }
        }
        const MS: i64 = 1_000_000;
        let even = |n: i64| 2 * MS * n;
        let received = |n: i64| if n < 150 { 1_000 * n } else { even(n - 149) };
        // Sent all at once at the beginning, or after 0.15 s, by a writer that had to wait.
        let begins_late = |n: i64| even(n).max(150 * MS);
        let stops = |n: i64| {
            if (60..200).contains(&n) {
                even(200)
            } else {
                even(n)
            }
        };
        type Time<'a> = &'a dyn Fn(i64) -> i64;
        type Case<'a> = (i64, i64, Option<Time<'a>>, Time<'a>);
        let cases: [Case; 8] = [
            (1500, 2, Some(&even), &even),
            (1500, 2, Some(&begins_late), &even),
            // All that there is, a second look at it included.
            (150, 2, Some(&begins_late), &even),
            (1500, 2, Some(&stops), &even),
            (1500, 2, None, &even),
            (1500, 0, Some(&even), &even),
            (1500, 2000, Some(&even), &even),
            (1500, 0, None, &received),
        ];
        for (count, tick, sent, expected) in cases {
            let message = |n: i64| {
                let mut data = vec![0u8; 1180];
                data[1] = 1;
                data[4 + 1096..][..4].copy_from_slice(&((tick * n) as u32).to_le_bytes());
                let sent = sent.map(|sent| 5_000 * MS + sent(n));
                LiveMessage {
                    received_ns: 1_000 * MS
                        + received(n).max(sent.map_or(0, |sent| sent - 5_000 * MS)),
                    sent_ns: sent,
                    data,
                }
            };
            let given: Vec<LiveMessage> = (0..count).map(message).collect();
            let input = crate::log::LiveInput::Messages {
                topic: "rt/lowstate".to_owned(),
                kind: MESSAGE_KINDS[0],
                messages: Box::new(Given(given.into_iter())),
            };
            let robot = crate::model::Robot::go2();
            let mut rows = crate::log::LiveRows::follow("dds".as_ref(), input, &robot).unwrap();
            let mut times = Vec::new();
            while let Some(row) = rows.next_row().unwrap() {
                times.push((row.t() * 1e9).round() as i64);
            }
            let expected: Vec<i64> = (0..count).map(expected).collect();
            assert!(times == expected, "{count} of {tick}: {:?}", &times[..5]);
        }
    }

    #[test]
    fn what_is_written_is_read_back_once_each() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = MessageWriter::new(file, "rt/lowstate", MESSAGE_KINDS[0]).unwrap();
        let message = |n: u32| {
            let mut data = vec![0u8; 1180];
            data[1] = 1;
            data[4 + 1096..][..4].copy_from_slice(&(2 * n).to_le_bytes());
            for motor in 0..12 {
                let q = 0.5 + 1e-3 * n as f32 - if motor % 3 == 2 { 2.0 } else { 0.0 };
                data[4 + 80 + 48 * motor..][..4].copy_from_slice(&q.to_le_bytes());
            }
            let received_ns = 1_000_000_000 + i64::from(n) * 2_000_000;
            LiveMessage {
                received_ns,
                sent_ns: None,
                data,
            }
        };
        for n in 0..300 {
            writer.write(&message(n)).unwrap();
        }
        writer.finish().unwrap();
        let mut reader = LogReader::open(&path, Selection::Motion).unwrap();
        let mut rows = 0;
        while let Some(row) = reader.next_row().unwrap() {
            assert_eq!(row.q()[0], f64::from(0.5 + 1e-3 * rows as f32));
            rows += 1;
        }
        assert_eq!(rows, 300);
    }
}

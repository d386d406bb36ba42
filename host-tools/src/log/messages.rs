//! Messages into an MCAP file, as they came, with the definition of their type.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};

use super::live::LiveMessage;

/// What is said of each field where the type of a message is defined, as ROS 2 writes definitions: the message's own fields, then
/// those of each message inside. Sources: unitree_ros2 eea2719, common_interfaces of ROS 2.
const DEFINITIONS: [(&str, &str); 3] = [
    (
        "unitree_go/msg/LowState",
        "uint8[2] head
uint8 level_flag
uint8 frame_reserve
uint32[2] sn
uint32[2] version
uint16 bandwidth
IMUState imu_state
MotorState[20] motor_state
BmsState bms_state
int16[4] foot_force
int16[4] foot_force_est
uint32 tick
uint8[40] wireless_remote
uint8 bit_flag
float32 adc_reel
int8 temperature_ntc1
int8 temperature_ntc2
float32 power_v
float32 power_a
uint16[4] fan_frequency
uint32 reserve
uint32 crc
================================================================================
MSG: unitree_go/IMUState
float32[4] quaternion
float32[3] gyroscope
float32[3] accelerometer
float32[3] rpy
int8 temperature
================================================================================
MSG: unitree_go/MotorState
uint8 mode
float32 q
float32 dq
float32 ddq
float32 tau_est
float32 q_raw
float32 dq_raw
float32 ddq_raw
int8 temperature
uint32 lost
uint32[2] reserve
================================================================================
MSG: unitree_go/BmsState
uint8 version_high
uint8 version_low
uint8 status
uint8 soc
int32 current
uint16 cycle
int8[2] bq_ntc
int8[2] mcu_ntc
uint16[15] cell_vol
",
    ),
    (
        "unitree_hg/msg/LowState",
        "uint32[2] version
uint8 mode_pr
uint8 mode_machine
uint32 tick
IMUState imu_state
MotorState[35] motor_state
uint8[40] wireless_remote
uint32[4] reserve
uint32 crc
================================================================================
MSG: unitree_hg/IMUState
float32[4] quaternion
float32[3] gyroscope
float32[3] accelerometer
float32[3] rpy
int16 temperature
================================================================================
MSG: unitree_hg/MotorState
uint8 mode
float32 q
float32 dq
float32 ddq
float32 tau_est
int16[2] temperature
float32 vol
uint32[2] sensor
uint32 motorstate
uint32[4] reserve
",
    ),
    (
        "sensor_msgs/msg/JointState",
        "std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
",
    ),
];

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
        let header = MessageHeader {
            channel_id: self.channel,
            sequence: self.count,
            log_time: time,
            publish_time: time,
        };
        self.count = self.count.wrapping_add(1);
        let written = self.mcap.write_to_known_channel(&header, &message.data);
        written.map_err(failed)
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
            LiveMessage { received_ns, data }
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

//! What a capture says of the bus: by the device's own listener, and what only a desktop has room for.

use std::io::Read;

use proprio_core::bus::{
    AssemblyCounters, Command, Decoder, DecoderCounters, Frame, Listener, MOTORS, Queue, Reply,
};
use proprio_core::go2::{ACTUATORS, BEYOND_STOPS, Go2, JOINTS_PER_LEG, Leg, position_limits};
use proprio_core::robot::Robot;
use serde::Serialize;

use super::checksums::Checksums;
use super::{
    CaptureError, CaptureReader, Facts, Grouped, LATE_US, SET_LATENCY_TIMER, Stamps, Told,
};
use crate::device::names::words_of_top_temperature;

/// Bytes given to the listener at once: what its queue always has room for.
const PART: usize = 256;

/// What a UART reads of the headers FE EE and FD EE where A and B are swapped. Every bit is then inverted: a start bit is high, as an idle line
/// is, and a byte seems to begin at the first data bit that is 1, up to the same bit of the next byte.
const SWAPPED: [[u8; 2]; 2] = [[0x80, 0x84], [0x01, 0x84]];
/// One header in so many bytes is no chance where no frame is good: a polling cycle has one in 23 where frames have pauses between them, and
/// one in 33 where they have none (simulated); random bytes have one in 33 000.
const SWAPPED_BYTES: u64 = 200;

/// Ids that a reply can carry.
const IDS: usize = 16;

/// What a capture says.
#[derive(Debug, Clone, Serialize)]
pub struct Explanation {
    /// From the first record to the last, s.
    pub seconds: f64,
    /// Bytes captured.
    pub bytes: u64,
    /// Records: pieces that came without a pause, as the adapter tells.
    pub records: u64,
    /// Bits per second.
    pub baud: u32,
    /// Share of the time in which the bus was busy.
    pub busy: f64,
    /// Good commands.
    pub commands: u32,
    /// Good replies.
    pub replies: u32,
    /// Frames with a bad checksum, of full length.
    pub bad_crc: u32,
    /// Frames with a bad checksum, cut short by the next.
    pub short: u32,
    /// Bytes in no good frame.
    pub skipped_bytes: u32,
    /// Headers of frames as they are read where A and B are swapped.
    pub swapped_headers: u64,
    /// Seed of the commands' checksums.
    pub command_seed: Option<u16>,
    /// The motors that answer, by ascending id.
    pub motors: Vec<MotorExplanation>,
    /// Records of several polling cycles: order, period, offsets, turn-arounds and samples are none then, for nothing says when frames came.
    pub grouped: Option<Grouped>,
    /// Whole commands, if another checksum than this bus's is all that fails.
    pub other_checksum_commands: Option<u32>,
    /// Motors whose replies are whole, if another checksum is all that fails.
    pub other_checksum_motors: Vec<OtherChecksum>,
    /// Ids in the order of polling; empty where it was not learnt.
    pub order: Vec<u8>,
    /// Time from one polling cycle to the next, µs; none where it was not learnt.
    pub period_us: Option<u32>,
    /// Polling cycles of which a sample can be made.
    pub cycles: u64,
    /// Polling cycles in which a motor was not heard.
    pub incomplete_cycles: u32,
    /// Replies in which a motor reports a fault other than heat.
    pub motor_faults: u32,
    /// Replies in which a motor says that it is too hot.
    pub overheated: u32,
    /// Replies of a motor whose encoder is stuck.
    pub stuck: u32,
    /// Share of the good replies that are in a sample.
    pub used: f64,
    /// What is wrong, in words.
    pub warnings: Vec<String>,
}

/// A motor whose replies are whole and fail by their checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct OtherChecksum {
    /// Its id.
    pub id: u8,
    /// Whole replies to commands of its id.
    pub replies: u32,
    /// Those of them whose checksum is good, as by chance.
    pub good: u32,
}

/// What a capture says of one motor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotorExplanation {
    /// Its id.
    pub id: u8,
    /// Good replies.
    pub replies: u32,
    /// Seed of its checksums.
    pub seed: Option<u16>,
    /// How long after the first motor's reply its own comes, µs; none where that was not learnt.
    pub offset_us: Option<u32>,
    /// From the end of a command to the beginning of its reply; none where no pair came in two records.
    pub turnaround: Option<Turnaround>,
    /// Replies with each error code: none, overheat, overcurrent, overvoltage, encoder, and the codes without a name.
    pub errors: [u32; 8],
    /// Least and greatest temperature, °C.
    pub temperature: [i8; 2],
    /// Which joint a motor of this id drives; none where no motor of a leg has it.
    pub joint: Option<&'static str>,
    /// Least and greatest position, rad of the joint: from where the motor counts, if the capture does not say where the joint was.
    pub position: Option<[f64; 2]>,
    /// The joint's limits, rad: of the capture's leg, else those that all legs' limits lie within.
    pub limits: Option<[f64; 2]>,
}

/// Turn-around times, µs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Turnaround {
    /// The shortest.
    pub least: u64,
    /// The median.
    pub median: u64,
    /// The longest.
    pub greatest: u64,
}

/// One motor's replies.
#[derive(Default)]
struct Motor {
    replies: u32,
    errors: [u32; 8],
    temperature: Option<[i8; 2]>,
    /// Least and greatest count, and the first.
    counts: Option<[i32; 3]>,
    turnarounds: Vec<u64>,
}

/// The frames one by one, with their times.
struct Frames {
    queue: Queue,
    decoder: Decoder,
    byte_ns: u32,
    /// Id of the last command, and when its last byte came, if no frame came after it.
    asked: Option<(u8, u64)>,
    motors: [Motor; IDS],
}

impl Frames {
    fn hear(&mut self, bytes: &[u8], end_us: u64) {
        self.queue.push(bytes, end_us, self.byte_ns);
        loop {
            let waiting = self.queue.waiting();
            let mut rest = waiting;
            let frame = self.decoder.next(&mut rest, &mut { usize::MAX });
            let taken = waiting.len() - rest.len();
            self.queue.take(taken);
            match frame {
                Some(Frame::Command(command)) => {
                    self.asked = Some((command.mode.id(), self.queue.taken_us()));
                }
                Some(Frame::Reply(reply)) => self.reply(&reply),
                None => return,
            }
        }
    }

    fn reply(&mut self, reply: &Reply) {
        let id = reply.mode.id();
        let motor = &mut self.motors[usize::from(id)];
        motor.replies += 1;
        motor.errors[usize::from(reply.error())] += 1;
        let [least, greatest] = motor.temperature.get_or_insert([reply.temperature; 2]);
        *least = reply.temperature.min(*least);
        *greatest = reply.temperature.max(*greatest);
        let [low, high, _] = motor.counts.get_or_insert([reply.position; 3]);
        *low = reply.position.min(*low);
        *high = reply.position.max(*high);
        let length_us = Reply::LEN as u64 * u64::from(self.byte_ns) / 1000;
        let began_us = self.queue.taken_us().saturating_sub(length_us);
        if let Some((asked, at_us)) = self.asked.take()
            && asked == id
            // A pair of one record seems to follow without a pause, whatever happened on the bus.
            && began_us > at_us + 1
        {
            motor.turnarounds.push(began_us - at_us);
        }
    }
}

impl Motor {
    fn turnaround(&mut self) -> Option<Turnaround> {
        let times = &mut self.turnarounds;
        times.sort_unstable();
        Some(Turnaround {
            least: *times.first()?,
            median: times[times.len() / 2],
            greatest: *times.last()?,
        })
    }
}

/// Says what a capture holds.
///
/// # Errors
/// [`CaptureError::Read`].
pub fn explain<R: Read>(capture: &mut CaptureReader<R>) -> Result<Explanation, CaptureError> {
    let byte_ns = capture.byte_ns();
    let mut frames = Frames {
        queue: Queue::new(),
        decoder: Decoder::new(),
        byte_ns,
        asked: None,
        motors: Default::default(),
    };
    let (mut queue, mut listener) = (Queue::of_adapter(LATE_US), <Listener>::new());
    let (mut records, mut bytes, mut cycles) = (0, 0, 0);
    let (mut swapped_headers, mut before) = (0, 0);
    let (mut stamps, mut checksums) = (Stamps::new(byte_ns), Checksums::default());
    while let Some(record) = capture.next_record()? {
        records += 1;
        bytes += record.bytes.len() as u64;
        stamps.push(&record, |frame| checksums.push(frame));
        for &byte in &record.bytes {
            swapped_headers += u64::from(SWAPPED.contains(&[before, byte]));
            before = byte;
        }
        let mut left = record.bytes.len();
        for part in record.bytes.chunks(PART) {
            left -= part.len();
            let after_us = left as u64 * u64::from(byte_ns) / 1000;
            let end_us = record.time_us.saturating_sub(after_us);
            frames.hear(part, end_us);
            queue.push(part, end_us, byte_ns);
            while listener.next(&mut queue, &mut { usize::MAX }).is_some() {
                cycles += 1;
            }
        }
    }
    let seconds = stamps.seconds();
    let grouped = stamps.grouped();
    if grouped.is_some() {
        cycles = 0;
    }
    let busy_s = bytes as f64 * f64::from(byte_ns) * 1e-9;
    let DecoderCounters {
        commands,
        replies,
        bad_crc,
        short,
        skipped_bytes,
    } = listener.frames();
    let AssemblyCounters {
        incomplete,
        motor_faults,
        overheated,
        stuck,
        ..
    } = listener.cycles();
    let schedule = listener.schedule();
    let is_timed = grouped.is_none() && schedule.learnt;
    let good = |id: usize| frames.motors[id].replies;
    let others = checksums.of_replies(good).into_iter();
    let others = others.map(|id| OtherChecksum {
        id,
        replies: checksums.answered(id),
        good: good(usize::from(id)),
    });
    let other_checksum_motors = others.collect();
    let mut explanation = Explanation {
        seconds,
        bytes,
        records,
        baud: capture.baud(),
        busy: if seconds > 0.0 { busy_s / seconds } else { 0.0 },
        commands,
        replies,
        bad_crc,
        short,
        skipped_bytes,
        swapped_headers,
        command_seed: listener.decoder().command_seed(),
        motors: motors(&mut frames, &listener, grouped.is_none(), capture.facts()),
        grouped,
        other_checksum_commands: checksums.of_commands(commands, bytes),
        other_checksum_motors,
        order: match is_timed {
            true => schedule.order().map(|motor| schedule.ids[motor]).to_vec(),
            false => Vec::new(),
        },
        period_us: is_timed.then_some(schedule.period_us),
        cycles,
        incomplete_cycles: incomplete,
        motor_faults,
        overheated,
        stuck,
        used: cycles as f64 * MOTORS as f64 / f64::from(replies.max(1)),
        warnings: Vec::new(),
    };
    explanation.warnings = explanation.warn();
    Ok(explanation)
}

/// A leg's joints.
const JOINTS: [&str; JOINTS_PER_LEG] = ["hip", "thigh", "calf"];

/// The joint that a motor of this id drives.
fn joint_of(id: usize) -> Option<usize> {
    let ids = <Go2 as Robot<JOINTS_PER_LEG>>::MOTOR_IDS;
    ids.iter().position(|known| usize::from(*known) == id)
}

/// From where to where a joint was, rad.
fn position(motor: &Motor, joint: usize, facts: &Facts) -> Option<[f64; 2]> {
    let counts = motor.counts?;
    let [low, high, first] = counts.map(|count| {
        let reply = Reply {
            position: count,
            ..Reply::default()
        };
        reply.joint_position(ACTUATORS[joint].gear)
    });
    Some(match facts.told {
        Told::Nothing | Told::Angles => [low, high],
        Told::At(angles) => match angles[joint] {
            (angle, false) => [angle + low - first, angle + high - first],
            (angle, true) => [angle + first - high, angle + first - low],
        },
    })
}

/// A joint's limits, rad: of this leg, or what no leg's go beyond.
fn limits(joint: usize, leg: Option<Leg>) -> [f64; 2] {
    let legs = Leg::ALL
        .into_iter()
        .filter(|known| leg.is_none_or(|leg| leg == *known));
    legs.map(|leg| position_limits(leg)[joint])
        .reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
        .unwrap_or_default()
}

fn motors(
    frames: &mut Frames,
    listener: &Listener,
    is_timed: bool,
    facts: &Facts,
) -> Vec<MotorExplanation> {
    let schedule = listener.schedule();
    let offset = |id: u8| {
        let place = schedule.ids.iter().position(|known| *known == id);
        place
            .filter(|_| is_timed && schedule.learnt)
            .map(|motor| schedule.offsets_us[motor])
    };
    let decoder = &frames.decoder;
    let heard = frames
        .motors
        .iter_mut()
        .enumerate()
        .filter(|(_, motor)| motor.replies > 0);
    let explained = heard.map(|(id, motor)| MotorExplanation {
        id: id as u8,
        replies: motor.replies,
        seed: decoder.reply_seed(id as u8),
        offset_us: offset(id as u8),
        turnaround: motor.turnaround().filter(|_| is_timed),
        errors: motor.errors,
        temperature: motor.temperature.unwrap_or_default(),
        joint: joint_of(id).map(|joint| JOINTS[joint]),
        position: joint_of(id).and_then(|joint| position(motor, joint, facts)),
        limits: joint_of(id).map(|joint| limits(joint, facts.leg)),
    });
    explained.collect()
}

impl Explanation {
    fn warn(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let frames = self.commands + self.replies;
        let others = &self.other_checksum_motors;
        let has_others = !others.is_empty() || self.other_checksum_commands.is_some();
        if self.bytes == 0 {
            warnings.push(
                "nothing was captured: check the wiring, and that the robot is on".to_owned(),
            );
        } else if frames == 0 && self.swapped_headers * SWAPPED_BYTES > self.bytes {
            warnings.push(format!(
                "A and B are swapped: {} headers of frames are inverted, and no frame has a good checksum",
                self.swapped_headers
            ));
        } else if frames == 0 && !has_others {
            warnings.push(format!(
                "no frame has a good checksum: check the baud rate ({}); with A and B swapped there would be inverted headers",
                self.baud
            ));
        } else if self.replies == 0 && others.is_empty() {
            warnings.push(
                "there are commands and no reply: no motor answers, or only the master is received"
                    .to_owned(),
            );
        }
        if let Some(whole) = self.other_checksum_commands {
            warnings.push(format!(
                "commands carry another checksum: {whole} are whole, and {} have a good one",
                self.commands
            ));
        }
        if !others.is_empty() {
            let ids: Vec<String> = others.iter().map(|other| other.id.to_string()).collect();
            let whole: u32 = others.iter().map(|other| other.replies).sum();
            let good: u32 = others.iter().map(|other| other.good).sum();
            warnings.push(format!(
                "replies carry another checksum: {whole} of motors {} are whole and of the ids that were asked, and {good} have a good one: another firmware, no fault of the wiring",
                ids.join(", ")
            ));
        }
        if let Some(Grouped { cycles, every_ms }) = self.grouped {
            let every = every_ms.map_or(String::new(), |ms| format!(" every {ms} ms"));
            warnings.push(format!(
                "the bytes come in pieces of {cycles:.0} polling cycles{every}, and when a frame came is unknown: {SET_LATENCY_TIMER}"
            ));
        }
        // Whole frames of another checksum are no damage.
        let whole_replies = others.iter().map(|other| other.replies - other.good);
        let whole_commands = self
            .other_checksum_commands
            .map_or(0, |whole| whole.saturating_sub(self.commands));
        let other_bytes =
            whole_replies.sum::<u32>() * Reply::LEN as u32 + whole_commands * Command::LEN as u32;
        let damaged = self.skipped_bytes.saturating_sub(other_bytes);
        if (frames > 0 || has_others) && f64::from(damaged) > 0.01 * self.bytes as f64 {
            let share = 100.0 * f64::from(damaged) / self.bytes as f64;
            warnings.push(format!(
                "{share:.1} % of the bytes are in no good frame: check ground and termination"
            ));
        }
        if self.replies > 0 && others.is_empty() && self.motors.len() != MOTORS {
            warnings.push(format!(
                "{} ids answer where a leg has {MOTORS} motors",
                self.motors.len()
            ));
        }
        for motor in &self.motors {
            if motor.temperature[1] == Reply::TOP_TEMPERATURE {
                let words = words_of_top_temperature();
                warnings.push(format!("motor {}: {words}", motor.id));
            }
            if let (Some(joint), Some([least, most]), Some([lower, upper])) =
                (motor.joint, motor.position, motor.limits)
                && (least < lower - BEYOND_STOPS || most > upper + BEYOND_STOPS)
            {
                let id = motor.id;
                warnings.push(format!(
                    "motor {id} reports {least:.3} to {most:.3} rad, and a {joint} is within {lower:.3} to {upper:.3}: it counts from elsewhere than the joint's zero"
                ));
            }
        }
        if self.replies > 0 && others.is_empty() && self.grouped.is_none() && self.used < 0.9 {
            warnings.push(format!(
                "only {:.1} % of the replies are in a sample",
                100.0 * self.used
            ));
        }
        warnings
    }
}

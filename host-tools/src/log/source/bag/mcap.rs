//! Messages of an MCAP file, read from front to back in constant memory; a file that was cut short gives all its whole
//! messages.

use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};

use super::{Message, Messages, Topic};
use crate::log::error::Problem;
use crate::log::source::input::Input;

/// A longer record, bytes, is no message of joint states, and its length not to be believed.
const LONGEST: usize = 1 << 30;

/// Most bytes that are asked of the file at a time.
const PIECE: usize = 1 << 20;

/// An MCAP file.
pub(super) struct Recording {
    file: File,
    size: u64,
}

impl Recording {
    pub(super) fn new(input: Input) -> Self {
        let Input { file, size, .. } = input;
        Self { file, size }
    }

    /// Its topics, from its summary; from all of it, if it was cut short and has none.
    pub(super) fn topics(&mut self) -> Result<Vec<Topic>, Problem> {
        match self.summary() {
            Some(topics) => Ok(topics),
            None => self.scan(),
        }
    }

    fn summary(&mut self) -> Option<Vec<Topic>> {
        let options = SummaryReaderOptions::default()
            .with_file_size(self.size)
            .with_record_length_limit(LONGEST);
        let mut reader = SummaryReader::new_with_options(options);
        while let Some(event) = reader.next_event() {
            match event.ok()? {
                SummaryReadEvent::ReadRequest(need) => {
                    let read = self.file.read(reader.insert(need)).ok()?;
                    reader.notify_read(read);
                }
                SummaryReadEvent::SeekRequest(to) => {
                    let at = self.file.seek(to).ok()?;
                    reader.notify_seeked(at);
                }
            }
        }
        let summary = reader.finish()?;
        let counts = summary.stats.map(|stats| stats.channel_message_counts);
        let mut topics: Vec<Topic> = summary
            .channels
            .iter()
            .map(|(&id, channel)| Topic {
                id: id.into(),
                name: channel.topic.clone(),
                kind: channel
                    .schema
                    .as_ref()
                    .map_or_else(String::new, |s| s.name.clone()),
                count: counts
                    .as_ref()
                    .map(|counts| counts.get(&id).copied().unwrap_or(0)),
            })
            .collect();
        topics.sort_by_key(|topic| topic.id);
        (!topics.is_empty()).then_some(topics)
    }

    fn scan(&mut self) -> Result<Vec<Topic>, Problem> {
        self.file.seek(SeekFrom::Start(0)).map_err(Problem::Read)?;
        let mut reader = Reader::new(&mut self.file);
        let mut kinds = HashMap::new();
        let mut topics: Vec<Topic> = Vec::new();
        while let Some(record) = reader.next()? {
            match record {
                Record::Schema { header, .. } => {
                    kinds.insert(header.id, header.name);
                }
                Record::Channel(channel) => {
                    let id = u64::from(channel.id);
                    if !topics.iter().any(|topic| topic.id == id) {
                        topics.push(Topic {
                            id,
                            name: channel.topic,
                            kind: kinds.get(&channel.schema_id).cloned().unwrap_or_default(),
                            count: Some(0),
                        });
                    }
                }
                Record::Message { header, .. } => {
                    let id = u64::from(header.channel_id);
                    let topic = topics.iter_mut().find(|topic| topic.id == id);
                    if let Some(count) = topic.and_then(|topic| topic.count.as_mut()) {
                        *count += 1;
                    }
                }
                _ => {}
            }
        }
        Ok(topics)
    }

    /// The messages of these topics, from the start.
    pub(super) fn messages(mut self, topics: [u64; 2]) -> impl Messages + use<> {
        let start = self.file.seek(SeekFrom::Start(0));
        TopicMessages {
            reader: Reader::new(self.file),
            failed: start.err(),
            topics,
            size: self.size,
        }
    }
}

struct TopicMessages {
    reader: Reader<File>,
    failed: Option<std::io::Error>,
    topics: [u64; 2],
    size: u64,
}

impl Messages for TopicMessages {
    fn next(&mut self, message: &mut Message) -> Result<bool, Problem> {
        if let Some(error) = self.failed.take() {
            return Err(Problem::Read(error));
        }
        while let Some(record) = self.reader.next()? {
            if let Record::Message { header, data } = record
                && self.topics.contains(&header.channel_id.into())
            {
                message.topic = header.channel_id.into();
                message.time = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                // Recorders that do not know it write zero, or the time of the recording.
                let sent = i64::try_from(header.publish_time).ok();
                message.sent = sent.filter(|sent| *sent > 0);
                message.data.clear();
                message.data.extend_from_slice(&data);
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn progress(&self) -> (u64, u64) {
        (self.reader.read, self.size)
    }

    fn is_cut(&self) -> bool {
        self.reader.cut
    }
}

/// Records from front to back.
struct Reader<R> {
    file: R,
    mcap: LinearReader,
    /// The bytes of the present record.
    record: Vec<u8>,
    read: u64,
    /// The file ended within a record.
    cut: bool,
    ended: bool,
}

impl<R: Read> Reader<R> {
    fn new(file: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        Self {
            file,
            mcap: LinearReader::new_with_options(options),
            record: Vec::new(),
            read: 0,
            cut: false,
            ended: false,
        }
    }

    /// The next record that is a schema, a channel or a message.
    fn next(&mut self) -> Result<Option<Record<'_>>, Problem> {
        let opcode = loop {
            if self.ended {
                return Ok(None);
            }
            // mcap 0.26 subtracts unchecked where a record reaches beyond its chunk (`ChunkRecord` of its linear reader): builds
            // that check overflow panic there, on a file that is only damaged.
            let step = AssertUnwindSafe(|| step(&mut self.mcap, &mut self.record));
            let step = catch_unwind(step)
                .map_err(|_| Problem::Damaged("a record reaches beyond its chunk".to_owned()))?;
            match step {
                Step::End { cut } => {
                    self.ended = true;
                    self.cut = cut;
                }
                Step::Failed(error) => return Err(damaged(error)),
                Step::Read(need) => {
                    // Piece by piece: a length that is not to be believed takes no memory.
                    let piece = self.mcap.insert(need.min(PIECE));
                    let read = self.file.read(piece).map_err(Problem::Read)?;
                    self.mcap.notify_read(read);
                    self.read += read as u64;
                }
                Step::Other => {}
                Step::Record(opcode) => break opcode,
            }
        };
        mcap::parse_record(opcode, &self.record)
            .map(Some)
            .map_err(damaged)
    }
}

/// What the next event of a file is.
enum Step {
    /// The file ends, within a record or after the last.
    End {
        cut: bool,
    },
    /// So many bytes are needed.
    Read(usize),
    /// A schema, a channel or a message, whose bytes have been copied.
    Record(u8),
    /// Another record.
    Other,
    Failed(McapError),
}

fn step(mcap: &mut LinearReader, record: &mut Vec<u8>) -> Step {
    match mcap.next_event() {
        None => Step::End { cut: false },
        Some(Err(McapError::UnexpectedEof)) => Step::End { cut: true },
        Some(Err(error)) => Step::Failed(error),
        Some(Ok(LinearReadEvent::ReadRequest(need))) => Step::Read(need),
        Some(Ok(LinearReadEvent::Record { opcode, data })) => {
            if !matches!(
                opcode,
                mcap::records::op::SCHEMA..=mcap::records::op::MESSAGE
            ) {
                return Step::Other;
            }
            record.clear();
            record.extend_from_slice(data);
            Step::Record(opcode)
        }
    }
}

fn damaged(error: McapError) -> Problem {
    Problem::Damaged(error.to_string())
}

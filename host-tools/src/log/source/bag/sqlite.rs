//! Messages of a rosbag2's SQLite database, in the order in which they were written.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::Path;

use rusqlite::{Connection, OpenFlags, params};
use tempfile::NamedTempFile;

use super::{Message, Messages, Topic};
use crate::log::error::Problem;
use crate::log::source::input::{self, Input};

/// So many messages are fetched at a time.
const BATCH: usize = 500;

/// A rosbag2's database.
pub(super) struct Recording {
    database: Connection,
    /// The whole pages of a file that was cut within one.
    whole: Option<NamedTempFile>,
}

impl Recording {
    pub(super) fn open(path: &Path, input: Input) -> Result<Self, Problem> {
        let whole = whole_pages(input).map_err(Problem::Read)?;
        let file = match &whole {
            Some(whole) => whole.path().to_owned(),
            None => input::path(path).map_err(Problem::Open)?,
        };
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let database = Connection::open_with_flags(&file, flags).map_err(damaged)?;
        // Otherwise SQLite refuses a file shorter than its header says, whole pages and all; nothing is written.
        database
            .execute_batch("PRAGMA writable_schema = ON")
            .map_err(damaged)?;
        Ok(Self { database, whole })
    }

    /// Its topics; how many messages each has only where there is a choice.
    pub(super) fn topics(&self) -> Result<Vec<Topic>, Problem> {
        let mut statement = self
            .database
            .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
            .map_err(not_a_bag)?;
        let rows = statement.query_map([], |row| {
            Ok((
                Topic {
                    id: row.get::<_, i64>(0)?.cast_unsigned(),
                    name: row.get(1)?,
                    kind: row.get(2)?,
                    count: None,
                },
                row.get::<_, String>(3)?,
            ))
        });
        let rows = rows.map_err(damaged)?.collect::<Result<Vec<_>, _>>();
        let mut topics = Vec::new();
        for (mut topic, format) in rows.map_err(damaged)? {
            if format != "cdr" {
                // Of another format none is read; it is told by this name.
                topic.kind = format!("{} as {format}", topic.kind);
            }
            topics.push(topic);
        }
        let known = |topic: &&mut Topic| super::KINDS.contains(&&*topic.kind);
        if topics.iter_mut().filter(known).count() > 1 {
            for topic in topics.iter_mut().filter(known) {
                topic.count = Some(self.count(topic.id));
            }
        }
        Ok(topics)
    }

    /// How many of the first messages are a topic's: enough to tell the fuller one. Of a file that was cut short, of those
    /// that it has.
    fn count(&self, topic: u64) -> u64 {
        let sql = "SELECT COUNT(*) FROM (SELECT topic_id FROM messages ORDER BY id LIMIT ?2) WHERE topic_id = ?1";
        let count = |first: i64| {
            let parameters = params![topic.cast_signed(), first];
            self.database
                .query_row(sql, parameters, |row| row.get::<_, i64>(0))
                .ok()
        };
        let count = [5000, 500, 50, 5].into_iter().find_map(count);
        count.unwrap_or(0).cast_unsigned()
    }

    /// The messages of these topics, from the start.
    pub(super) fn messages(self, topics: [u64; 2]) -> impl Messages + use<> {
        // Only for progress: a file that was cut short does not tell.
        let last = "SELECT COALESCE(MAX(id), 0) FROM messages";
        let last = self
            .database
            .query_row(last, [], |row| row.get::<_, i64>(0));
        TopicMessages {
            database: self.database,
            topics: topics.map(u64::cast_signed),
            batch: VecDeque::new(),
            at: i64::MIN,
            last: last.unwrap_or(0),
            given: 0,
            cut: false,
            was_cut: self.whole.is_some(),
            _whole: self.whole,
        }
    }
}

/// A copy of a file's whole pages, if it ends within one: SQLite would take what is missing of that for zeros.
fn whole_pages(input: Input) -> io::Result<Option<NamedTempFile>> {
    let size = input
        .start()
        .get(16..18)
        .map_or(1, |bytes| u64::from(bytes[0]) << 8 | u64::from(bytes[1]));
    // 1 stands for 65536 (SQLite's file format, §1.3.2).
    let page = if size < 2 { 1 << 16 } else { size };
    if input.size.is_multiple_of(page) {
        return Ok(None);
    }
    let mut whole = NamedTempFile::new()?;
    io::copy(&mut input.file.take(input.size / page * page), &mut whole)?;
    Ok(Some(whole))
}

struct TopicMessages {
    database: Connection,
    topics: [i64; 2],
    batch: VecDeque<Message>,
    /// Number of the message last fetched, and of the database's last.
    at: i64,
    last: i64,
    given: u64,
    /// No more can be fetched: the file ends before its end.
    cut: bool,
    /// The file ended within a page.
    was_cut: bool,
    _whole: Option<NamedTempFile>,
}

impl TopicMessages {
    fn fetch(&mut self) -> Result<(), rusqlite::Error> {
        let mut statement = self.database.prepare(
            "SELECT id, timestamp, data, topic_id FROM messages WHERE topic_id IN (?1, ?2) AND id > ?3 ORDER BY id LIMIT ?4",
        )?;
        let [states, commands] = self.topics;
        let mut rows = statement.query(params![states, commands, self.at, BATCH as i64])?;
        while let Some(row) = rows.next()? {
            let message = Message {
                time: row.get(1)?,
                data: row.get(2)?,
                topic: row.get::<_, i64>(3)?.cast_unsigned(),
                ..Message::default()
            };
            self.at = row.get(0)?;
            self.batch.push_back(message);
        }
        Ok(())
    }
}

impl Messages for TopicMessages {
    fn next(&mut self, message: &mut Message) -> Result<bool, Problem> {
        if self.batch.is_empty()
            && !self.cut
            && let Err(error) = self.fetch()
        {
            let is_cut = error.sqlite_error_code() == Some(rusqlite::ErrorCode::DatabaseCorrupt);
            if !is_cut || (self.given == 0 && self.batch.is_empty()) {
                return Err(damaged(error));
            }
            // The pages before it are whole.
            self.cut = true;
        }
        let Some(next) = self.batch.pop_front() else {
            return Ok(false);
        };
        *message = next;
        self.given += 1;
        Ok(true)
    }

    fn progress(&self) -> (u64, u64) {
        (
            self.at.max(0).cast_unsigned(),
            self.last.max(0).cast_unsigned(),
        )
    }

    fn is_cut(&self) -> bool {
        self.cut || self.was_cut
    }
}

fn damaged(error: rusqlite::Error) -> Problem {
    Problem::Damaged(error.to_string())
}

/// A database without topics is another program's.
fn not_a_bag(error: rusqlite::Error) -> Problem {
    match error.sqlite_error_code() {
        Some(rusqlite::ErrorCode::Unknown) | None => Problem::NotALog {
            what: "an SQLite database, but no rosbag2",
            way: "write its table as CSV, columns t, q/JOINT, dq/JOINT, tau/JOINT",
        },
        _ => damaged(error),
    }
}

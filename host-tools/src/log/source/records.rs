//! Records of separated text: a line without quotes is cut where it lies, anything else is read as RFC 4180 has it.

use std::io::{self, BufRead, Cursor, Read};

use csv::ByteRecord;

/// Text, record by record.
pub(super) struct Records {
    separator: u8,
    bytes: Box<dyn BufRead>,
    /// Lines read, the present record's with them.
    lines: u64,
    /// The present record, without the line's end, and where its cells end.
    line: Vec<u8>,
    ends: Vec<usize>,
    /// From the first line on that has a quote, or a carriage return within: a record may span lines, or a line records.
    quoted: Option<Quoted>,
}

struct Quoted {
    csv: csv::Reader<Box<dyn Read>>,
    record: ByteRecord,
    /// Lines before the first that it reads.
    before: u64,
}

impl Records {
    pub(super) fn new(bytes: Box<dyn BufRead>, separator: u8) -> Self {
        Self {
            separator,
            bytes,
            lines: 0,
            line: Vec::new(),
            ends: Vec::new(),
            quoted: None,
        }
    }

    /// Reads the next record; false at the end. Empty lines are none.
    pub(super) fn read(&mut self) -> io::Result<bool> {
        while self.quoted.is_none() {
            self.line.clear();
            if self.bytes.read_until(b'\n', &mut self.line)? == 0 {
                return Ok(false);
            }
            self.lines += 1;
            let end = self.line.strip_suffix(b"\n").unwrap_or(&self.line);
            let end = end.strip_suffix(b"\r").unwrap_or(end).len();
            if self.line[..end].contains(&b'"') || self.line[..end].contains(&b'\r') {
                self.begin_quoted();
            } else if end > 0 {
                self.line.truncate(end);
                self.cut();
                return Ok(true);
            }
        }
        match &mut self.quoted {
            Some(quoted) => {
                let more = quoted.csv.read_byte_record(&mut quoted.record);
                more.map_err(|error| match error.into_kind() {
                    csv::ErrorKind::Io(error) => error,
                    other => io::Error::other(format!("{other:?}")),
                })
            }
            None => Ok(false),
        }
    }

    /// Where the cells of the present line end.
    fn cut(&mut self) {
        self.ends.clear();
        for (n, byte) in self.line.iter().enumerate() {
            if *byte == self.separator {
                self.ends.push(n);
            }
        }
        self.ends.push(self.line.len());
    }

    /// Reads on as RFC 4180 has it, from the present line.
    fn begin_quoted(&mut self) {
        let rest = std::mem::replace(&mut self.bytes, Box::new(io::empty()));
        let text = Cursor::new(std::mem::take(&mut self.line)).chain(rest);
        let csv = csv::ReaderBuilder::new()
            .has_headers(false)
            // Ragged rows are reported by the reader, with the place.
            .flexible(true)
            .delimiter(self.separator)
            .buffer_capacity(1 << 16)
            .from_reader(Box::new(text) as Box<dyn Read>);
        self.quoted = Some(Quoted {
            csv,
            record: ByteRecord::new(),
            before: self.lines - 1,
        });
    }

    /// Cells of the present record.
    pub(super) fn len(&self) -> usize {
        match &self.quoted {
            Some(quoted) => quoted.record.len(),
            None => self.ends.len(),
        }
    }

    /// A cell of the present record.
    pub(super) fn get(&self, cell: usize) -> Option<&[u8]> {
        if let Some(quoted) = &self.quoted {
            return quoted.record.get(cell);
        }
        let begin = cell
            .checked_sub(1)
            .map_or(Some(0), |before| self.ends.get(before).map(|end| end + 1))?;
        self.line.get(begin..*self.ends.get(cell)?)
    }

    /// The line that the next record begins in, or an empty one before it.
    pub(super) fn next_line(&self) -> u64 {
        match &self.quoted {
            Some(quoted) => quoted.before + quoted.csv.position().line(),
            None => self.lines + 1,
        }
    }

    /// The line that the present record begins in, from 1.
    pub(super) fn line(&self) -> u64 {
        match &self.quoted {
            Some(quoted) => {
                let own = quoted.record.position().map_or(1, csv::Position::line);
                quoted.before + own
            }
            None => self.lines.max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// All records of a text.
    fn all(text: &str) -> Vec<Vec<Vec<u8>>> {
        let mut records = Records::new(Box::new(Cursor::new(text.as_bytes().to_vec())), b',');
        let mut found = Vec::new();
        while records.read().unwrap() {
            let cell = |n| records.get(n).unwrap().to_vec();
            found.push((0..records.len()).map(cell).collect());
            assert_eq!(records.get(records.len()), None);
        }
        found
    }

    proptest! {
        #[test]
        fn any_text_has_the_records_that_the_csv_crate_finds(text in "[a1,\"\r\n]{0,40}") {
            let mut csv = csv::ReaderBuilder::new()
                .has_headers(false)
                .flexible(true)
                .from_reader(text.as_bytes());
            let expected: Vec<Vec<Vec<u8>>> = csv
                .byte_records()
                .map(|record| record.unwrap().iter().map(<[u8]>::to_vec).collect())
                .collect();
            prop_assert_eq!(all(&text), expected);
        }
    }

    #[test]
    fn lines_are_counted_from_one_and_empty_ones_with_them() {
        let text = "a,b\r\n\r\n1,2\n\"3\",4\n5,6";
        let mut records = Records::new(Box::new(text.as_bytes()), b',');
        for line in [1, 3, 4, 5] {
            assert!(records.read().unwrap());
            assert_eq!((records.line(), records.len()), (line, 2));
        }
        assert!(!records.read().unwrap());
    }
}

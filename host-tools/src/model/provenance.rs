//! Where a model's values come from.

/// Where a model's values come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// Version of proprio.
    pub version: String,
    /// The command line.
    pub command: String,
    /// The logs.
    pub logs: Vec<LogRecord>,
    /// The conditions under which they were judged (`--only`): of another part of a log values are new.
    pub only: Vec<String>,
}

/// A log and what was in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogRecord {
    /// Its path as given.
    pub path: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

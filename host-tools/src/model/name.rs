//! Names that are looked up, and the nearest one that exists.

use crate::nearest::nearest;

/// A name that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no {what} `{name}`; there {} {}", if .known.len() == 1 { "is" } else { "are" }, .known.join(", "))]
pub struct UnknownName {
    /// What was looked for: "joint", "effect", "key".
    pub what: &'static str,
    /// The name as written.
    pub name: String,
    /// The names that exist.
    pub known: Vec<String>,
}

impl UnknownName {
    /// `name` was looked for in `known`.
    pub fn new<S: Into<String>>(
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = S>,
    ) -> Self {
        let known = known.into_iter().map(Into::into).collect();
        Self {
            what,
            name: name.to_owned(),
            known,
        }
    }

    /// The existing name nearest in spelling.
    pub fn nearest(&self) -> Option<&str> {
        nearest(&self.name, self.known.iter().map(String::as_str))
    }
}

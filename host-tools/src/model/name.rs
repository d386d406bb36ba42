//! Names that are looked up, and the nearest one that exists.

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

    /// The existing name nearest in spelling, by Jaro-Winkler as for the columns of a log.
    pub fn nearest(&self) -> Option<&str> {
        // What other makers call the Go2's joints.
        let synonyms = [
            ("knee", "calf"),
            ("shin", "calf"),
            ("abduction", "hip"),
            ("abad", "hip"),
        ];
        let wanted = synonyms
            .iter()
            .fold(self.name.to_lowercase(), |name, (theirs, ours)| {
                name.replace(theirs, ours)
            });
        let likeness = |known: &&String| strsim::jaro_winkler(&wanted, &known.to_lowercase());
        let nearest = self
            .known
            .iter()
            .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        nearest.map(String::as_str)
    }
}

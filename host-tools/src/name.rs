//! Names that are looked up, and the nearest one that exists: "did you mean".

use proprio_core::go2::Leg;

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

/// The leg of a Go2 called `name`.
///
/// # Errors
/// [`UnknownName`], with the four names there are.
pub(crate) fn leg_named(name: &str) -> Result<Leg, UnknownName> {
    Leg::from_name(name).ok_or_else(|| UnknownName::new("leg", name, Leg::ALL.map(Leg::name)))
}

/// The name among `known` nearest to `name` in spelling.
///
/// Joint names share their leg, so the distance weighs a common start (Jaro-Winkler); and `FR_knee`, a word of other makers,
/// means the calf although `FR_hip` is spelt more like it.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let synonyms = [
        ("knee", "calf"),
        ("shin", "calf"),
        ("abduction", "hip"),
        ("abad", "hip"),
    ];
    let wanted = synonyms
        .iter()
        .fold(name.to_lowercase(), |name, (theirs, ours)| {
            name.replace(theirs, ours)
        });
    let likeness = |known: &str| strsim::jaro_winkler(&wanted, &known.to_lowercase());
    known
        .into_iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::go2::JOINT_NAMES;

    #[test]
    fn a_wrong_name_suggests_the_nearest() {
        let nearest = |name: &str| nearest(name, JOINT_NAMES).unwrap();
        assert_eq!(nearest("FR_knee"), "FR_calf");
        assert_eq!(nearest("FL_Thigh"), "FL_thigh");
        assert_eq!(nearest("RRcalf"), "RR_calf");
        assert_eq!(nearest("fr_hip"), "FR_hip");
        assert_eq!(nearest("RL_abad"), "RL_hip");
    }
}

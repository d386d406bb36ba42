//! Names that are looked up, and the nearest one that exists: "did you mean".

use proprio_core::go2::Leg;

/// Names that an error lists, at most: those of two robots' legs. Of more it lists so many of the nearest, a line of them.
const LISTED: usize = 24;
const NEAREST: usize = 5;

/// A name that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no {what} `{name}`; {}", self.listed())]
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
        self.by_likeness().into_iter().next()
    }

    fn by_likeness(&self) -> Vec<&str> {
        by_likeness(&self.name, self.known.iter().map(String::as_str))
    }

    /// The names that exist; of many the nearest.
    fn listed(&self) -> String {
        let count = self.known.len();
        if count > LISTED {
            let nearest = self.by_likeness();
            return format!(
                "of {count} the nearest are {}",
                nearest[..NEAREST].join(", ")
            );
        }
        let are = if count == 1 { "is" } else { "are" };
        format!("there {are} {}", self.known.join(", "))
    }
}

/// The leg of a Go2 called `name`.
///
/// # Errors
/// [`UnknownName`], with the four names there are.
pub(crate) fn leg_named(name: &str) -> Result<Leg, UnknownName> {
    Leg::from_name(name).ok_or_else(|| UnknownName::new("leg", name, Leg::ALL.map(Leg::name)))
}

/// The names `known`, the nearest to `name` in spelling first.
///
/// Joint names share their leg, so the distance weighs a common start (Jaro-Winkler); and `FR_knee`, a word of other makers,
/// means the calf although `FR_hip` is spelt more like it.
fn by_likeness<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
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
    let mut known: Vec<&str> = known.into_iter().collect();
    // Of equally near ones the last known comes first.
    known.sort_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    known.reverse();
    known
}

/// The name among `known` nearest to `name` in spelling.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    by_likeness(name, known).into_iter().next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::go2::JOINT_NAMES;

    #[test]
    fn of_many_names_the_nearest_are_listed() {
        let many = (0..30).map(|n| format!("joint_{n}"));
        let unknown = UnknownName::new("joint", "joint_29x", many);
        let text = unknown.to_string();
        assert!(
            text.starts_with("there is no joint `joint_29x`; of 30 the nearest are joint_29, "),
            "{text}"
        );
        assert_eq!(text.matches("joint_").count(), 6, "{text}");
        let few = UnknownName::new("leg", "FX", ["FR", "FL"]).to_string();
        assert_eq!(few, "there is no leg `FX`; there are FR, FL");
    }

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

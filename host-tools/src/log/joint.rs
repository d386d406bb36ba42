//! The joints a log can name, in the order of the SDK and of the motor bus.

use core::fmt;
use core::str::FromStr;

/// A leg; the discriminant is its place in SDK order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Leg {
    /// Front right.
    FR,
    /// Front left.
    FL,
    /// Rear right.
    RR,
    /// Rear left.
    RL,
}

impl Leg {
    /// The four legs in SDK order.
    pub const ALL: [Self; 4] = [Self::FR, Self::FL, Self::RR, Self::RL];

    /// `FR`, `FL`, `RR` or `RL`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FR => "FR",
            Self::FL => "FL",
            Self::RR => "RR",
            Self::RL => "RL",
        }
    }

    /// Place in SDK order, 0 to 3.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Hip, thigh and calf of this leg.
    pub const fn joints(self) -> [JointId; 3] {
        let first = 3 * self as usize;
        [JointId(first), JointId(first + 1), JointId(first + 2)]
    }
}

impl fmt::Display for Leg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Leg {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.into_iter().find(|leg| leg.name() == name);
        found.ok_or_else(|| UnknownName::new(name, Self::ALL.map(Self::name)))
    }
}

/// Number of joints of the robot.
pub const JOINTS: usize = 12;

/// A joint of the robot: its index in SDK order, 0 (`FR_hip`) to 11 (`RL_calf`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointId(usize);

const NAMES: [&str; JOINTS] = [
    "FR_hip", "FR_thigh", "FR_calf", "FL_hip", "FL_thigh", "FL_calf", "RR_hip", "RR_thigh",
    "RR_calf", "RL_hip", "RL_thigh", "RL_calf",
];

impl JointId {
    /// Index in SDK order, 0 to 11.
    pub const fn index(self) -> usize {
        self.0
    }

    /// `FR_hip` … `RL_calf`.
    pub const fn name(self) -> &'static str {
        NAMES[self.0]
    }

    /// The leg this joint belongs to.
    pub const fn leg(self) -> Leg {
        Leg::ALL[self.0 / 3]
    }

    /// Place within the leg: 0 hip, 1 thigh, 2 calf.
    pub const fn place(self) -> usize {
        self.0 % 3
    }

    /// All joints in SDK order.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..JOINTS).map(Self)
    }
}

impl fmt::Display for JointId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for JointId {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let found = NAMES.iter().position(|&n| n == name).map(Self);
        found.ok_or_else(|| UnknownName::new(name, NAMES))
    }
}

/// A name that is not in the list it should come from.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not one of {}", .known.join(", "))]
pub struct UnknownName {
    /// The name as written.
    pub name: String,
    /// The names that would have been right.
    pub known: Vec<&'static str>,
}

impl UnknownName {
    /// `name` was looked for in `known`.
    pub fn new(name: &str, known: impl IntoIterator<Item = &'static str>) -> Self {
        Self { name: name.to_owned(), known: known.into_iter().collect() }
    }

    /// The known name nearest in spelling. Joint names share their leg, so the distance weighs a common start
    /// (Jaro-Winkler): `FR_knee` is nearer to `FR_hip` than to `RL_thigh`, and `FR_knee` means the calf.
    pub fn nearest(&self) -> Option<&'static str> {
        // What other makers call the Go2's joints.
        let wanted = self
            .name
            .replace("knee", "calf")
            .replace("abad", "hip")
            .replace("abduction", "hip")
            .replace("shin", "calf");
        let likeness = |known: &str| strsim::jaro_winkler(&wanted, known);
        self.known.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_in_sdk_order() {
        for (index, joint) in JointId::all().enumerate() {
            assert_eq!(joint.index(), index);
            assert_eq!(joint.name().parse(), Ok(joint));
            assert_eq!(joint.leg().joints()[joint.place()], joint);
            assert!(joint.name().starts_with(joint.leg().name()));
        }
    }

    #[test]
    fn a_wrong_name_suggests_the_nearest() {
        let nearest = |name: &str| name.parse::<JointId>().unwrap_err().nearest().unwrap();
        assert_eq!(nearest("FR_knee"), "FR_calf");
        assert_eq!(nearest("FL_Thigh"), "FL_thigh");
        assert_eq!(nearest("RRcalf"), "RR_calf");
        assert_eq!(nearest("RL_abad"), "RL_hip");
    }
}

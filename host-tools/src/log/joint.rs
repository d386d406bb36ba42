//! The joints of a Go2, in the order of the SDK and of the motor bus.

use crate::nearest::nearest;
use std::fmt;
use std::str::FromStr;

use proprio_core::go2::{JOINT_NAMES, JOINTS, JOINTS_PER_LEG, Leg};

/// The leg called `name`.
///
/// # Errors
/// [`UnknownName`], with the four names there are.
pub fn leg_named(name: &str) -> Result<Leg, UnknownName> {
    let found = Leg::ALL.into_iter().find(|leg| leg.name() == name);
    found.ok_or_else(|| UnknownName::new(name, Leg::ALL.map(Leg::name)))
}

/// A joint of a Go2: its index in SDK order, 0 (`FR_hip`) to 11 (`RL_calf`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointId(usize);

impl JointId {
    /// Index in SDK order, 0 to 11.
    pub const fn index(self) -> usize {
        self.0
    }

    /// `FR_hip` … `RL_calf`.
    pub const fn name(self) -> &'static str {
        JOINT_NAMES[self.0]
    }

    /// The leg this joint belongs to.
    pub const fn leg(self) -> Leg {
        Leg::ALL[self.0 / JOINTS_PER_LEG]
    }

    /// Place within the leg: 0 hip, 1 thigh, 2 calf.
    pub const fn place(self) -> usize {
        self.0 % JOINTS_PER_LEG
    }

    /// Hip, thigh and calf of a leg.
    pub fn of(leg: Leg) -> [Self; JOINTS_PER_LEG] {
        std::array::from_fn(|place| Self(JOINTS_PER_LEG * leg.index() + place))
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
        let found = JOINT_NAMES.iter().position(|&n| n == name).map(Self);
        found.ok_or_else(|| UnknownName::new(name, JOINT_NAMES))
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
        Self {
            name: name.to_owned(),
            known: known.into_iter().collect(),
        }
    }

    /// The known name nearest in spelling.
    pub fn nearest(&self) -> Option<&'static str> {
        nearest(&self.name, self.known.iter().copied())
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
            assert_eq!(JointId::of(joint.leg())[joint.place()], joint);
            assert!(joint.name().starts_with(joint.leg().name()));
        }
    }

    #[test]
    fn a_wrong_name_suggests_the_nearest() {
        let nearest = |name: &str| name.parse::<JointId>().unwrap_err().nearest().unwrap();
        assert_eq!(nearest("FR_knee"), "FR_calf");
        assert_eq!(nearest("FL_Thigh"), "FL_thigh");
        assert_eq!(nearest("RRcalf"), "RR_calf");
        assert_eq!(nearest("fr_hip"), "FR_hip");
        assert_eq!(nearest("RL_abad"), "RL_hip");
    }
}

//! What can be wrong with a robot's kinematics: one list of facts that the search, the design and the words ask.
//!
//! Priors are what manufacture leaves, one standard deviation; the search scales those of geometry to the robot by held-out error.

use super::chain::Chain;
use crate::model::{JointQuantity as Q, LINK_ELASTICITY};

/// A cause of error at a joint, or at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fact {
    /// Its name, as in JSON.
    pub(super) name: &'static str,
    /// The numbers that it has at a joint.
    pub(super) quantities: &'static [Q],
    /// What it is, in words.
    pub(super) words: &'static str,
    /// The motion that separates it from its look-alikes.
    pub(super) separated_by: &'static str,
    /// What its numbers move the joint or link by in manufacture: one standard deviation, in rad (of a shift in m).
    pub(super) size: f64,
    /// What the size is divided by to give the number's own unit.
    pub(super) per: Per,
    /// Whether it needs to be known from which side the joint came.
    pub(super) needs_sides: bool,
}

/// What one unit of a number moves the joint by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Per {
    /// One rad or m.
    One,
    /// The joint's greatest distance from zero among the poses.
    Travel,
    /// The same of the joint that carries it.
    CarrierTravel,
    /// The greatest load among the poses.
    Load,
}

/// Frames off by some tenths of a mm and mrad: machining and assembly of links of 0.1–1 m leave that by ISO 2768-m (±0.1 mm to ±0.8 mm),
/// and uncalibrated industrial robots miss by 1–10 mm at 2 m (Mooring, Roth & Driels 1991, ch. 1). The search scales it.
pub(super) const LINK_GEOMETRY: Fact = Fact {
    name: crate::model::LINK_GEOMETRY,
    quantities: &[
        Q::Shift(0),
        Q::Shift(1),
        Q::Shift(2),
        Q::Turn(0),
        Q::Turn(1),
        Q::Turn(2),
    ],
    words: "joint frames stand elsewhere than the description has them",
    separated_by: "poses that turn every joint through its range",
    size: 1e-3,
    per: Per::One,
    needs_sides: false,
};

/// The zero of a joint's encoder, set by marks or by hand: 10 mrad.
pub(super) const OFFSETS: Fact = Fact {
    name: "joint_offset",
    quantities: &[],
    words: "zeros of the joints",
    separated_by: "poses that turn every joint through its range",
    size: 10e-3,
    per: Per::One,
    needs_sides: false,
};

/// All effects beyond geometry, in the order in which equals are named.
pub(super) const EFFECTS: [Fact; 6] = [
    // Gears of industrial robots yield by some mrad at full load (Zimmermann & Moberg; Khalil & Besnard 2002).
    Fact {
        name: "elasticity",
        quantities: &[Q::Elasticity],
        words: "joints yield to gravity",
        separated_by: "poses with the arm stretched out and drawn in, and a payload",
        size: 5e-3,
        per: Per::Load,
        needs_sides: false,
    },
    Fact {
        name: LINK_ELASTICITY,
        quantities: &[Q::BendFirst, Q::BendSecond],
        words: "links and bearings bend across the joint's axis",
        separated_by: "poses that turn the load about the link",
        size: 2e-3,
        per: Per::Load,
        needs_sides: false,
    },
    // Once per joint turn: an encoder's disc of 50 mm that is 25 µm off its axis makes 1 mrad.
    Fact {
        name: "gear_eccentricity",
        quantities: &[Q::Sine, Q::Cosine],
        words: "an encoder or gear off its axis, once per turn of the joint",
        separated_by: "poses spread over the whole turn of the joint",
        size: 1e-3,
        per: Per::One,
        needs_sides: false,
    },
    Fact {
        name: "gear_ratio",
        quantities: &[Q::Ratio],
        words: "a gear ratio that is stated wrong",
        separated_by: "poses at both ends of the joint's range",
        size: 5e-3,
        per: Per::Travel,
        needs_sides: false,
    },
    Fact {
        name: "joint_coupling",
        quantities: &[Q::Coupling],
        words: "a joint that moves with the one that carries it",
        separated_by: "poses that move the two independently",
        size: 5e-3,
        per: Per::CarrierTravel,
        needs_sides: false,
    },
    Fact {
        name: "backlash",
        quantities: &[Q::Backlash],
        words: "play, by the side from which the joint came",
        separated_by: "each pose approached from both sides",
        size: 2e-3,
        per: Per::One,
        needs_sides: true,
    },
];

impl Fact {
    /// Whether a joint can have it.
    pub(super) fn can_be_at(&self, chain: &Chain, joint: usize) -> bool {
        let turns = !chain.slides(joint);
        self.quantities.iter().all(|quantity| match quantity {
            Q::Coupling => chain.parent(joint).is_some() && turns,
            Q::BendFirst | Q::BendSecond | Q::Sine | Q::Cosine => turns,
            _ => true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_have_names_of_their_own_and_every_quantity_belongs_to_one() {
        let all = || EFFECTS.iter().chain([&LINK_GEOMETRY]);
        let mut names: Vec<&str> = all().map(|fact| fact.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 7);
        for quantity in Q::ALL {
            let owners = all().filter(|fact| fact.quantities.contains(&quantity));
            assert_eq!(owners.count(), 1, "{}", quantity.key());
        }
        assert!(all().all(|fact| fact.size > 0.0 && !fact.words.is_empty()));
    }
}

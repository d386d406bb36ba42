//! Which column is what: of a joint's factor, of the solver's, and of θ.

use crate::factor::packed_len;
use crate::inertia::INERTIAL;

/// The columns of a limb: `B` bodies at most, each with its joint, and a number of effect columns per joint.
///
/// A joint's factor has its own effects, then the ten parameters of each body that it moves. θ has the inertial blocks of
/// all bodies, then the effects of all joints (`design.md` §1). The solver has the effects first: no two joints share one,
/// so that eliminating them first fills nothing in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout<const B: usize> {
    bodies: usize,
    subtree_end: [usize; B],
    effects: [usize; B],
}

impl<const B: usize> Layout<B> {
    /// No bodies.
    pub(crate) const NONE: Self = Self {
        bodies: 0,
        subtree_end: [0; B],
        effects: [0; B],
    };

    /// A limb of `B` bodies, each carried by the one before, with `effects` columns at every joint.
    pub const fn chain(effects: usize) -> Self {
        Self {
            bodies: B,
            subtree_end: [B; B],
            effects: [effects; B],
        }
    }

    /// A limb of `bodies` ≤ `B` bodies; body b carries those up to `subtree_end[b]`, and its joint has `effects[b]` columns.
    ///
    /// `None` if a subtree is empty or ends beyond the limb.
    pub fn new(bodies: usize, subtree_end: [usize; B], effects: [usize; B]) -> Option<Self> {
        let fits = |b: usize| subtree_end[b] > b && subtree_end[b] <= bodies;
        (bodies <= B && (0..bodies).all(fits)).then_some(Self {
            bodies,
            subtree_end,
            effects,
        })
    }

    /// Number of bodies, and of joints.
    pub const fn bodies(&self) -> usize {
        self.bodies
    }

    /// The bodies that a joint moves.
    pub const fn subtree(&self, joint: usize) -> core::ops::Range<usize> {
        joint..at(&self.subtree_end, joint)
    }

    /// Effect columns of a joint.
    pub const fn effects(&self, joint: usize) -> usize {
        at(&self.effects, joint)
    }

    /// Inertial parameters of the limb.
    pub const fn inertial(&self) -> usize {
        INERTIAL * self.bodies
    }

    /// All parameters of the limb: the length of θ.
    pub const fn parameters(&self) -> usize {
        self.inertial() + self.effects_before(self.bodies)
    }

    /// Columns of a joint's factor.
    pub const fn columns(&self, joint: usize) -> usize {
        self.effects(joint) + INERTIAL * at(&self.subtree_end, joint).saturating_sub(joint)
    }

    /// Where the packed triangle of a joint's factor lies among those of all joints.
    pub const fn packed(&self, joint: usize) -> core::ops::Range<usize> {
        let mut start = 0;
        let mut before = 0;
        while before < joint {
            start += packed_len(self.columns(before));
            before += 1;
        }
        start..start + packed_len(self.columns(joint))
    }

    /// Numbers that the factors of all joints keep.
    pub const fn packed_len(&self) -> usize {
        if self.bodies == 0 {
            0
        } else {
            self.packed(self.bodies - 1).end
        }
    }

    /// Where effect `effect` of a joint stands in θ.
    pub const fn effect_index(&self, joint: usize, effect: usize) -> usize {
        self.inertial() + self.effects_before(joint) + effect
    }

    /// Where column `column` of a joint's factor stands in θ.
    pub const fn parameter_index(&self, joint: usize, column: usize) -> usize {
        match column.checked_sub(self.effects(joint)) {
            None => self.effect_index(joint, column),
            Some(inertial) => INERTIAL * joint + inertial,
        }
    }

    /// Where parameter `parameter` of θ stands among the solver's columns.
    pub const fn solver_column(&self, parameter: usize) -> usize {
        match parameter.checked_sub(self.inertial()) {
            None => parameter + self.parameters() - self.inertial(),
            Some(effect) => effect,
        }
    }

    const fn effects_before(&self, joint: usize) -> usize {
        let mut count = 0;
        let mut before = 0;
        while before < joint {
            count += self.effects(before);
            before += 1;
        }
        count
    }
}

/// Entry n, zero beyond the end.
const fn at<const B: usize>(entries: &[usize; B], n: usize) -> usize {
    if n < B { entries[n] } else { 0 }
}

//! The columns of a robot that walks, and what is known of their parameters before any data.
//!
//! Of 130 inertial parameters 94 combinations tell on a moving base. A revolute joint's body is felt as its parent is in three ways: by a
//! mass at the joint's origin, by a first moment along its axis, and by a rod's inertia about it; with the parent's columns kept, those of
//! m, of h along the axis and of Izz say nothing more. From the calf on each body hands them to its parent (Gautier 1991), the hips to the
//! trunk: of a leg's body seven columns are left, of the trunk ten. The trunk's mass with what the legs have handed to it is the whole
//! robot's.

use super::leg::{INERTIA, KEPT};
use crate::estimator::{CAD_UNCERTAINTY, floor};
use crate::factor::{Block, Factor, FactorError, ROWS, packed_len};
use crate::go2::{JOINTS_PER_LEG, LEGS};
use crate::inertia::{INERTIAL, InertialParameters};
use crate::spatial::Transform;
use crate::tree::Tree;
use crate::{Real, scalar::real};
use nalgebra::SVector;

/// Effects of a joint.
pub const EFFECTS: usize = 4;
/// Columns of a leg: its bodies' from the hip on, then its joints' effects.
pub const OWN: usize = INERTIA + EFFECTS * JOINTS_PER_LEG;
/// Columns of the accelerometer's bias: of the rest those that a leg's rows touch.
pub const BIAS: usize = 3;
/// Columns of the trunk and of the accelerometer.
pub const REST: usize = INERTIAL + BIAS;
/// All columns.
pub const COLUMNS: usize = LEGS * OWN + REST;
/// The first of the trunk's columns: the whole robot's mass.
pub const TRUNK: usize = LEGS * OWN;
/// The first of the accelerometer's.
pub const ACC: usize = TRUNK + INERTIAL;

/// What a body hands to its parent: mass, first moment along the axis, Izz.
const HANDED: usize = 3;
/// Relative standard deviation of the CAD's trunk: a trunk carries what its owner put on it.
const LOADED_TRUNK: f64 = 0.3;

/// A joint's axis: x, or else y.
#[derive(Clone, Copy)]
struct Axis {
    is_x: bool,
}

impl Axis {
    /// Of a leg's joint.
    const fn of(joint: usize) -> Self {
        Self { is_x: joint == 0 }
    }

    /// The parameters that are kept, in their order.
    const fn kept(self) -> [usize; KEPT] {
        match self.is_x {
            true => [2, 3, 4, 5, 6, 7, 8],
            false => [1, 3, 4, 5, 6, 7, 8],
        }
    }

    /// Those that are handed on.
    const fn handed(self) -> [usize; HANDED] {
        [0, if self.is_x { 1 } else { 2 }, 9]
    }

    /// Of the kept ones the place of that which loses Izz: Iyy of a body that turns about x, Ixx of one that turns about y.
    const fn loses(self) -> usize {
        if self.is_x { 5 } else { 2 }
    }

    /// What a unit of each handed parameter is to the parent, in which the body is at `placement`.
    fn to_parent<T: Real>(self, placement: &Transform<T>) -> [SVector<T, INERTIAL>; HANDED] {
        let unit = |of: &[usize]| {
            let numbers =
                SVector::from_fn(|n, _| if of.contains(&n) { T::one() } else { T::zero() });
            InertialParameters(numbers).in_parent(placement).0
        };
        let [mass, moment, izz] = self.handed();
        let other = if self.is_x { 7 } else { 4 };
        [unit(&[mass]), unit(&[moment]), unit(&[izz, other])]
    }
}

/// What all bodies of the legs hand on.
const HANDED_ALL: usize = HANDED * JOINTS_PER_LEG * LEGS;
/// What those before the hips hand on.
const INNER: usize = HANDED_ALL - HANDED * LEGS;
/// Columns of the prior: what the hips hand on to the trunk, the legs' inertial columns, the trunk's.
const PRIOR: usize = HANDED * LEGS + INERTIA * LEGS + INERTIAL;
/// Numbers that [`WalkPrior::make`] works in.
pub(super) const PRIOR_WORK: usize = packed_len(INNER + PRIOR);
/// Rows of a prior on the columns, the misfit's included.
pub(super) const PRIOR_ROWS: usize = PRIOR + 1 - HANDED * LEGS;

/// What the CAD says of the columns' parameters: the marginal of what it says of all bodies.
#[derive(Clone, Copy, Debug)]
pub struct WalkPrior<T> {
    /// A triangle over what the hips hand to the trunk, the legs' inertial columns leg by leg, the trunk's.
    storage: [T; packed_len(PRIOR)],
    /// What a unit of each is to the trunk.
    hips: [[[T; INERTIAL]; HANDED]; LEGS],
}

impl<T: Real> WalkPrior<T> {
    /// Nothing; all zeros, a constant for statics.
    pub const fn empty() -> Self {
        Self {
            storage: [T::ZERO; packed_len(PRIOR)],
            hips: [[[T::ZERO; INERTIAL]; HANDED]; LEGS],
        }
    }

    /// Becomes that of the robot; `work` holds as many numbers as a triangle of 130 columns. For the start: it takes some millions of instructions.
    ///
    /// # Errors
    /// [`FactorError::Length`] if it does not; [`FactorError::Singular`] names a body that is not physical.
    #[inline(never)]
    pub fn make(&mut self, robot: &Tree<T, 13, 18>, work: &mut [T]) -> Result<(), FactorError> {
        const ALL: usize = INNER + PRIOR;
        let mut whole = Factor::in_storage(ALL, work)?;
        whole.clear();
        whole.set_floor(floor());
        let mut row = [T::zero(); ALL + 1];
        for (b, body) in robot.bodies().iter().enumerate() {
            let relative = if b == 0 {
                LOADED_TRUNK
            } else {
                CAD_UNCERTAINTY
            };
            let own = body.inertia.prior(real(relative));
            let own = own.ok_or(FactorError::Singular(b))?;
            for k in 0..=INERTIAL {
                let at = |n: usize| n.checked_sub(k).and_then(|n| own.row(k).get(n).copied());
                let over: [T; INERTIAL] = core::array::from_fn(|n| at(n).unwrap_or(T::zero()));
                write_row(robot, b, &over, &mut row);
                row[ALL] = at(INERTIAL).unwrap_or(T::zero());
                whole.update(&mut row)?;
            }
        }
        let mut kept = Factor::in_storage(PRIOR, self.storage.as_mut_slice())?;
        for k in 0..=PRIOR {
            kept.set_row(k, whole.row(INNER + k))?;
        }
        for (leg, hip) in self.hips.iter_mut().enumerate() {
            if let Some(body) = robot.bodies().get(1 + JOINTS_PER_LEG * leg) {
                *hip = Axis::of(0).to_parent(&body.placement).map(|x| x.into());
            }
        }
        Ok(())
    }

    fn factor(&self) -> Factor<T, &[T]> {
        Factor::in_storage(PRIOR, self.storage.as_slice()).unwrap_or(Factor::nothing())
    }

    /// Up to [`ROWS`] rows over all columns from row `first` on, each times `noise`, into `block`. The first column that they touch.
    pub(super) fn write_rows(&self, first: usize, noise: T, block: &mut Block<T>) -> usize {
        block.as_flattened_mut().fill(T::zero());
        let factor = self.factor();
        let before = HANDED * LEGS;
        for n in 0..ROWS {
            for (c, x) in factor.row(before + first + n).iter().enumerate() {
                let column = column_of(first + n + c);
                if let Some(to) = block.get_mut(column).and_then(|rows| rows.get_mut(n)) {
                    *to = *x * noise;
                }
            }
        }
        column_of(first)
    }

    /// The trunk's own parameters, the most probable ones beside these of all columns: without what the legs hand to it.
    pub(super) fn trunk(&self, theta: &[T; COLUMNS]) -> [T; INERTIAL] {
        let factor = self.factor();
        let mut handed = [T::zero(); HANDED * LEGS];
        for k in (0..HANDED * LEGS).rev() {
            let Some((z, row)) = factor.row(k).split_last() else {
                continue;
            };
            let (own, others) = row.split_at(row.len().min(HANDED * LEGS - k));
            let columns = (0..INERTIA * LEGS + INERTIAL)
                .map(column_of)
                .filter_map(|c| theta.get(c));
            let known = others.iter().zip(columns);
            let left = known.fold(*z, |left, (r, x)| left - *r * *x);
            let after = own.iter().skip(1).zip(handed.iter().skip(k + 1));
            let left = after.fold(left, |left, (r, x)| left - *r * *x);
            if let (Some(to), Some(pivot)) = (handed.get_mut(k), own.first()) {
                *to = left / *pivot;
            }
        }
        let hips = self.hips.as_flattened().iter().zip(&handed);
        let mut trunk =
            core::array::from_fn(|n| theta.get(TRUNK + n).copied().unwrap_or(T::zero()));
        for (unit, amount) in hips {
            for (to, x) in trunk.iter_mut().zip(unit) {
                *to -= *x * *amount;
            }
        }
        trunk
    }
}

/// What the inertial columns' parameters are of a robot with these bodies; zero of effects and of the accelerometer.
pub fn inertial_parameters<T: Real>(robot: &Tree<T, 13, 18>) -> [T; COLUMNS] {
    let mut all = [T::zero(); COLUMNS];
    let mut bodies = robot.bodies().map(|body| body.inertia.0);
    for (b, body) in robot.bodies().iter().enumerate().skip(1).rev() {
        let (leg, joint) = ((b - 1) / JOINTS_PER_LEG, (b - 1) % JOINTS_PER_LEG);
        let axis = Axis::of(joint);
        let own = bodies.get(b).copied().unwrap_or_else(SVector::zeros);
        for (n, kept) in axis.kept().into_iter().enumerate() {
            let loses = if n == axis.loses() { own[9] } else { T::zero() };
            if let Some(to) = all.get_mut(OWN * leg + KEPT * joint + n) {
                *to = own[kept] - loses;
            }
        }
        let units = axis.to_parent(&body.placement);
        let parent = body.parent.and_then(|parent| bodies.get_mut(parent));
        if let Some(parent) = parent {
            for (unit, handed) in units.iter().zip(axis.handed()) {
                *parent += unit * own[handed];
            }
        }
    }
    let trunk = bodies.first().copied().unwrap_or_else(SVector::zeros);
    for (to, x) in all.iter_mut().skip(TRUNK).zip(trunk.iter()) {
        *to = *x;
    }
    all
}

/// Of the prior's columns after what is handed on, which one among all; the right-hand side's is the right-hand side's.
const fn column_of(n: usize) -> usize {
    if n < INERTIA * LEGS {
        OWN * (n / INERTIA) + n % INERTIA
    } else if n < INERTIA * LEGS + INERTIAL {
        TRUNK + n - INERTIA * LEGS
    } else {
        COLUMNS
    }
}

/// A row over body `b`'s ten parameters as one over what is handed on (by calves, thighs and hips), the kept parameters, the trunk's; without
/// the right-hand side.
///
/// A body's own parameters are those of it and of what it is handed, less that; and its kept ones are the column's less what they lose.
fn write_row<T: Real>(robot: &Tree<T, 13, 18>, b: usize, over: &[T; INERTIAL], row: &mut [T]) {
    row.fill(T::zero());
    let mut add = |column: usize, x: T| {
        if let Some(to) = row.get_mut(column) {
            *to += x;
        }
    };
    let handed = |b: usize| {
        let (leg, joint) = ((b - 1) / JOINTS_PER_LEG, (b - 1) % JOINTS_PER_LEG);
        HANDED * (LEGS * (JOINTS_PER_LEG - 1 - joint) + leg)
    };
    let at = |n: usize| over.get(n).copied().unwrap_or(T::zero());
    for (child, body) in robot.bodies().iter().enumerate().skip(1) {
        if body.parent == Some(b) {
            let units = Axis::of((child - 1) % JOINTS_PER_LEG).to_parent(&body.placement);
            for (h, unit) in units.iter().enumerate() {
                let share = unit.iter().zip(over);
                let share = share.fold(T::zero(), |sum, (x, r)| sum + *x * *r);
                add(handed(child) + h, -share);
            }
        }
    }
    let first = HANDED_ALL
        + if b == 0 {
            INERTIA * LEGS
        } else {
            KEPT * (b - 1)
        };
    if b == 0 {
        (0..INERTIAL).for_each(|n| add(first + n, at(n)));
        return;
    }
    let axis = Axis::of((b - 1) % JOINTS_PER_LEG);
    for (n, parameter) in axis.kept().into_iter().enumerate() {
        add(first + n, at(parameter));
    }
    for (h, parameter) in axis.handed().into_iter().enumerate() {
        add(handed(b) + h, at(parameter));
    }
    // Of the axis' rod the column is felt as the other inertia, which is kept: Izz = rod − that.
    let loses = axis.kept().get(axis.loses()).copied().unwrap_or(0);
    add(handed(b) + HANDED - 1, at(loses));
}

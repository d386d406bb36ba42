//! An effect from outside the catalogue: its facts and its torque as data, so that a program can bring its own.
//!
//! It is a torque at its own joint ([`Form::Columns`](super::Form::Columns)), or at that and others of its limb
//! ([`Form::Coupled`](super::Form::Coupled)), linear in all its parameters but its shapes; a device, whose columns are fixed, has none.

use core::cmp::Ordering;
use core::fmt;
use core::hash::{Hash, Hasher};

use super::{Description, JointState, MAX_COLUMNS, Prior, Shapes, Term};
use crate::{Real, scalar::real};

/// The window terms of an effect's columns at one instant, by the states of its limb's joints, which of them it acts at, and the values of
/// its shapes.
pub type Terms = dyn Fn(&[JointState<f64>], usize, Shapes) -> [Term<f64>; MAX_COLUMNS] + Sync;

/// The same of an effect at several joints: by the states of its limb's joints, which of them it is at, at which its torque is asked for, and the values
/// of its shapes.
pub type CoupledTerms =
    dyn Fn(&[JointState<f64>], usize, usize, Shapes) -> [Term<f64>; MAX_COLUMNS] + Sync;

/// An effect from outside the catalogue. It is the same as itself alone: one of another place in memory is another one, whatever its name.
#[derive(Clone, Copy)]
pub struct OwnEffect {
    /// Its facts.
    pub description: Description,
    /// Prior of each parameter, in the order of the description, at a joint of any drive.
    pub priors: &'static [Prior],
    /// The other joints of the limb that it sees, by how many places after its own they are.
    pub others: &'static [isize],
    /// Its torque at its own joint.
    pub terms: &'static Terms,
    /// Its torque at any joint of its limb, of one that couples its joint with the others that it sees.
    pub coupled: Option<&'static CoupledTerms>,
}

impl OwnEffect {
    /// Prior of a parameter; of one that has none, nothing is known.
    pub fn prior(&self, parameter: usize) -> Prior {
        let unknown = Prior {
            mean: 0.0,
            std: f64::INFINITY,
        };
        self.priors.get(parameter).copied().unwrap_or(unknown)
    }

    /// The terms in the scalar of the caller, who knows its own joint and one shape alone.
    pub(super) fn terms<T: Real>(&self, state: &JointState<T>, shape: T) -> [Term<T>; MAX_COLUMNS] {
        let double = |x: T| -> f64 { nalgebra::try_convert(x).unwrap_or(f64::NAN) };
        let state = JointState {
            q: double(state.q),
            dq: double(state.dq),
            tau: double(state.tau),
            speed: double(state.speed),
            speed_noise: double(state.speed_noise),
            load: double(state.load),
            give: state.give.map(double),
            play: state.play.map(double),
            presliding: double(state.presliding),
            recoil: state.recoil.map(double),
            temperature: double(state.temperature),
            time: double(state.time),
        };
        (self.terms)(&[state], 0, [double(shape), 1.0]).map(|term| Term {
            boundary: real(term.boundary),
            rate: real(term.rate),
        })
    }
}

impl PartialEq for OwnEffect {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self, other)
    }
}

impl Eq for OwnEffect {}

impl PartialOrd for OwnEffect {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OwnEffect {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |own: &Self| core::ptr::from_ref(own) as usize;
        let names = self.description.name.cmp(other.description.name);
        names.then_with(|| place(self).cmp(&place(other)))
    }
}

impl Hash for OwnEffect {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.description.name.hash(state);
    }
}

impl fmt::Debug for OwnEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("OwnEffect")
            .field(&self.description.name)
            .finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for OwnEffect {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=str}", self.description.name);
    }
}

//! Bodies that are not the CAD's: masses, centres of mass and moments of inertia that the logs put beyond what was known of them.

use std::collections::HashMap;
use std::fmt;

use proprio_core::inertia::INERTIAL;
use proprio_solve::far::FARTHEST;
use serde::Serialize;

use super::Fitted;
use crate::estimate::ParameterEstimate;
use crate::estimate::fit::LimbFit;
use crate::model::{Model, significant};
use crate::parameter::{INERTIAL_NAMES, name_at};

/// A body is another one if it is so many standard deviations, of prior and fit together, from what the CAD says: of 30 numbers of three
/// bodies one in ten of complete robots would show two, one in a hundred three.
const FAR: f64 = 3.0;
/// What the logs say must be surer than the prior, or than the difference is wide: the fit's standard deviation is at most this share of the
/// prior's, or of what makes the difference [`FAR`].
const SURE: f64 = 0.7;

/// What of a body is not the CAD's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyQuantity {
    /// Mass, kg.
    Mass,
    /// Centre of mass along x, y or z of the joint frame, m.
    CentreOfMass(usize),
    /// Moment of inertia about x, y or z of the joint frame, kg m².
    Inertia(usize),
    /// All ten numbers together: how many times as far from the model's as bodies of the stated uncertainty are, 1 of a hundred farther.
    Together,
}

/// A body that is not the CAD's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherBody {
    /// Its link.
    pub link: String,
    /// What differs most.
    pub quantity: BodyQuantity,
    /// By the logs, and its standard deviation.
    pub value: [f64; 2],
    /// By the model, and its standard deviation.
    pub stated: [f64; 2],
    /// The difference in units of both standard deviations.
    pub z: f64,
}

impl fmt::Display for OtherBody {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |n: usize| ["x", "y", "z"][n];
        let (what, unit) = match self.quantity {
            BodyQuantity::Mass => ("mass".to_owned(), "kg"),
            BodyQuantity::CentreOfMass(n) => (format!("centre of mass along {}", axis(n)), "m"),
            BodyQuantity::Inertia(n) => (format!("moment of inertia about {}", axis(n)), "kg m²"),
            BodyQuantity::Together => {
                let (link, times) = (&self.link, significant(self.value[0], 2));
                return write!(
                    f,
                    "{link}: its inertial parameters together differ {times} times as much from the URDF's as its uncertainty allows: a load, or a wrong URDF"
                );
            }
        };
        let with_std = |[value, std]: [f64; 2]| {
            format!("{} ± {} {unit}", significant(value, 3), significant(std, 2))
        };
        write!(
            f,
            "{}: {what} {}, the URDF says {}: a load, or a wrong URDF",
            self.link,
            with_std(self.value),
            with_std(self.stated)
        )
    }
}

impl Fitted {
    /// The bodies that these logs put beyond what was known of them, each with what differs most; the farthest first.
    pub fn other_bodies(&self, model: &Model) -> Vec<OtherBody> {
        let parameters = self.parameters.iter().map(|own| &own.estimate);
        other_bodies(parameters, &self.released, model)
    }
}

/// A body that fits have released from the CAD's, by its number in the robot, and how many times as far from it it is as bodies are.
pub(crate) type Released = (usize, f64);

/// The bodies that fits have released.
pub(crate) fn released<'f, 'd: 'f>(
    fits: impl IntoIterator<Item = &'f LimbFit<'d>>,
) -> Vec<Released> {
    let of = |fit: &LimbFit| {
        let less_certain = fit.less_certain().into_iter().enumerate();
        let released = less_certain.filter(|(_, times)| *times > 1.0);
        let first = fit.data.limb.bodies.start;
        let far = |(b, times): (usize, f64)| {
            let distance = times * times * fit.problem.distance(&fit.solution, b);
            (first + b, (distance / FARTHEST).sqrt())
        };
        released.map(far).collect::<Vec<_>>()
    };
    fits.into_iter().flat_map(of).collect()
}

/// The bodies that a fit's parameters put beyond what was known of them, the farthest first; the trunk is `base`. Of one that was `released` and no number
/// alone is sure, all together.
pub(crate) fn other_bodies<'a>(
    parameters: impl Iterator<Item = &'a ParameterEstimate>,
    released: &[Released],
    model: &Model,
) -> Vec<OtherBody> {
    let known: HashMap<&str, &ParameterEstimate> =
        parameters.map(|own| (own.name.as_str(), own)).collect();
    let bodies = model.robot().bodies().iter();
    let bodies = bodies.map(|body| (body.name.as_str(), body.link_name.as_str()));
    let mut found: Vec<OtherBody> = std::iter::once(("base", "base"))
        .chain(bodies)
        .filter_map(|(name, link)| other_body(&known, name, link))
        .collect();
    for &(body, times) in released.iter().filter(|(_, times)| *times > 1.0) {
        let link = &model.robot().bodies()[body].link_name;
        if found.iter().all(|known| known.link != *link) {
            found.push(OtherBody {
                link: link.clone(),
                quantity: BodyQuantity::Together,
                value: [times, 0.0],
                stated: [1.0, 0.0],
                z: times,
            });
        }
    }
    found.sort_by(|a, b| b.z.total_cmp(&a.z));
    found
}

/// What of a body is not the CAD's, if anything is; none of a body of which not all is known.
fn other_body(
    known: &HashMap<&str, &ParameterEstimate>,
    name: &str,
    link: &str,
) -> Option<OtherBody> {
    let mut fitted = [[0.0; 2]; INERTIAL];
    let mut stated = [[0.0; 2]; INERTIAL];
    for (n, (what, _)) in INERTIAL_NAMES.iter().enumerate() {
        let own = known.get(name_at(what, name).as_str())?;
        fitted[n] = [own.value, own.std];
        stated[n] = [own.prior, own.prior_std];
    }
    // A mass below nothing is that of no body: it stands for a torque that the model lacks.
    if fitted[0][0] <= 0.0 {
        return None;
    }
    let other = |quantity: BodyQuantity| {
        let (value, stated) = (quantity.of(&fitted)?, quantity.of(&stated)?);
        let apart = (value[0] - stated[0]).abs();
        let z = apart / value[1].hypot(stated[1]);
        let sure = value[1] < SURE * stated[1].max(apart / FAR);
        (sure && z > FAR).then(|| OtherBody {
            link: link.to_owned(),
            quantity,
            value,
            stated,
            z,
        })
    };
    // A mass that is another one moves the others too.
    let mass = other(BodyQuantity::Mass);
    let rest = (0..3)
        .flat_map(|n| [BodyQuantity::CentreOfMass(n), BodyQuantity::Inertia(n)])
        .filter_map(other);
    mass.or_else(|| rest.max_by(|a, b| a.z.total_cmp(&b.z)))
}

impl BodyQuantity {
    /// Value and standard deviation by those of a body's ten parameters.
    fn of(self, phi: &[[f64; 2]; INERTIAL]) -> Option<[f64; 2]> {
        let [mass, std] = phi[0];
        match self {
            Self::Mass => Some(phi[0]),
            Self::CentreOfMass(n) => {
                let [h, h_std] = phi[1 + n];
                (mass > 0.0).then(|| [h / mass, h_std.hypot(h / mass * std) / mass])
            }
            // Ixx, Iyy and Izz among Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
            Self::Inertia(n) => Some(phi[4 + [0, 3, 5][n]]),
            Self::Together => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::Status;

    /// FR_thigh of 1.24 ± 0.12 kg by the CAD, as a fit has it.
    fn found(mass: f64, std: f64) -> Vec<OtherBody> {
        let stated = [1.24, 0.0, 0.0, -0.05, 0.01, 0.0, 0.0, 0.01, 0.0, 0.002];
        let all: Vec<ParameterEstimate> = (INERTIAL_NAMES.iter().zip(stated).enumerate())
            .map(|(n, ((what, unit), prior))| ParameterEstimate {
                name: name_at(what, "FR_thigh"),
                unit,
                value: if n == 0 { mass } else { prior },
                std: if n == 0 { std } else { 0.01 },
                prior,
                prior_std: if n == 0 { 0.12 } else { 0.01 },
                status: Status::Identified,
                at_bound: false,
            })
            .collect();
        other_bodies(all.iter(), &[], &Model::default())
    }

    #[test]
    fn a_body_is_another_one_beyond_both_errors_and_never_below_nothing() {
        for (mass, std, is_other) in [
            (1.30, 0.02, false),
            (1.74, 0.05, true),
            (0.60, 0.05, true),
            // As far as the one above, and sure of nothing.
            (1.74, 0.30, false),
            (-2.05, 0.56, false),
        ] {
            let found = found(mass, std);
            assert_eq!(found.len(), usize::from(is_other), "{mass} ± {std}");
            assert!(found.iter().all(|body| body.quantity == BodyQuantity::Mass));
        }
    }
}

//! Forward selection with a backward pass at its end: what takes most of the error away first, as long as anything is there beyond
//! chance.

use proprio_core::inertia::INERTIAL;

use super::candidate::{Candidate, Screen, combination};
use crate::free_base::data::Data;
use crate::free_base::fit::{Fit, HeldOut, rms};
use crate::free_base::structure::{ModelStructure, effect_column};
use crate::select::criteria::{
    LEAST_SHARE, LEAST_VALUE, PART, SAME, Squared, least_z, sum_and_error,
};

/// Candidates of each kind (a joint, like joints, a load) that are fitted, the most promising ones.
const TRIED: usize = 3;
/// Most steps of a search.
const MOST_STEPS: usize = 24;

/// A value and its standard deviation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Value {
    pub(super) value: f64,
    pub(super) std: f64,
}

/// A model with a candidate, fitted.
pub(super) struct Tried {
    pub(super) candidate: Candidate,
    /// Of an effect its value at each joint; of a load its mass (kg) and its place from the body's origin (x, y, z, m).
    pub(super) values: Vec<Value>,
    /// Size in units of its standard deviation: as unlikely as a normal variable so far from zero.
    pub(super) z: f64,
    /// Whether its values can be.
    pub(super) in_bounds: bool,
    /// How much smaller the squares become on time that the fit has not seen, and the error of that, as shares of all squares.
    pub(super) gain: f64,
    pub(super) gain_error: f64,
    /// Held-out error with it, N m.
    pub(super) rms: f64,
    pub(super) significant: bool,
    structure: ModelStructure,
    held_out: Vec<HeldOut>,
}

/// One step of the search.
pub(super) struct Step {
    pub(super) candidate: Candidate,
    pub(super) removed: bool,
    /// Held-out error after it, N m.
    pub(super) rms: f64,
}

/// What a search found.
pub(super) struct Found {
    /// Held-out error of the model as it was given, N m.
    pub(super) start_rms: f64,
    /// What was tried on the model as it was given, best first.
    pub(super) first: Vec<Tried>,
    pub(super) path: Vec<Step>,
    /// The model at the end.
    pub(super) structure: ModelStructure,
    pub(super) fit: Fit,
}

/// Searches from `structure`; none if the walks are too short, or numbers overflow.
pub(super) fn search(data: &Data, structure: &ModelStructure) -> Option<Found> {
    let mut structure = structure.clone();
    let mut held_out = data.held_out(&structure)?;
    let start_rms = rms(&held_out);
    let (mut first, mut path): (Option<Vec<Tried>>, Vec<Step>) = (None, Vec::new());
    while path.len() < MOST_STEPS {
        let mut tried = tried(data, &structure, &held_out)?;
        tried.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let best = chosen(&tried);
        if let Some(n) = best {
            path.push(Step {
                candidate: tried[n].candidate.clone(),
                removed: false,
                rms: tried[n].rms,
            });
        }
        let next = best.map(|n| {
            (
                tried[n].structure.clone(),
                std::mem::take(&mut tried[n].held_out),
            )
        });
        first.get_or_insert(tried);
        match next {
            Some(next) => (structure, held_out) = next,
            None => break,
        }
    }
    backward(data, &mut structure, &mut path, rms(&held_out))?;
    let fit = data.fit(&structure)?;
    Some(Found {
        start_rms,
        first: first.unwrap_or_default(),
        path,
        structure,
        fit,
    })
}

/// Which to take: what gains most; a part of it that gains nearly as much is simpler.
fn chosen(tried: &[Tried]) -> Option<usize> {
    let best = tried.iter().position(|t| t.significant)?;
    let simpler = |t: &Tried| {
        t.significant
            && t.candidate.freedom() < tried[best].candidate.freedom()
            && t.candidate.is_part_of(&tried[best].candidate)
            && t.gain >= PART * tried[best].gain
    };
    tried.iter().position(simpler).or(Some(best))
}

/// Takes out again what does not raise the held-out error when it is missing.
fn backward(
    data: &Data,
    structure: &mut ModelStructure,
    path: &mut Vec<Step>,
    mut now: f64,
) -> Option<()> {
    let added: Vec<Candidate> = path.iter().map(|step| step.candidate.clone()).collect();
    // The last one was just found to be there.
    for candidate in added.iter().rev().skip(1) {
        let without = candidate.taken_from(structure);
        let after = rms(&data.held_out(&without)?);
        if after <= SAME * now {
            *structure = without;
            now = after;
            path.push(Step {
                candidate: candidate.clone(),
                removed: true,
                rms: after,
            });
        }
    }
    Some(())
}

/// The most promising candidates of each kind, fitted.
fn tried(data: &Data, structure: &ModelStructure, held_out: &[HeldOut]) -> Option<Vec<Tried>> {
    let now = data.fit(structure)?;
    let screen = Screen::of(data, structure, &now)?;
    let all = Candidate::all(structure);
    let count = all.len();
    let mut gains: Vec<(Candidate, f64)> = all
        .into_iter()
        .map(|candidate| {
            let gain = screen.gain(&candidate);
            (candidate, gain)
        })
        .collect();
    gains.sort_by(|a, b| b.1.total_cmp(&a.1));
    let promising = |wanted: &dyn Fn(&Candidate) -> bool| -> Vec<Candidate> {
        let own = gains.iter().filter(|(candidate, gain)| {
            wanted(candidate) && *gain > candidate.freedom() + LEAST_VALUE.powi(2)
        });
        own.map(|(candidate, _)| candidate.clone())
            .take(TRIED)
            .collect()
    };
    let is_load = |c: &Candidate| matches!(c, Candidate::Load { .. });
    let mut candidates = promising(&|c| c.is_family());
    candidates.extend(promising(&|c| !c.is_family() && !is_load(c)));
    candidates.extend(promising(&is_load));
    let trial = Trial {
        data,
        structure,
        now: &now,
        held_out,
        count,
    };
    candidates.into_iter().map(|c| trial.of(c)).collect()
}

/// What candidates are tried on.
struct Trial<'a> {
    data: &'a Data,
    structure: &'a ModelStructure,
    now: &'a Fit,
    held_out: &'a [HeldOut],
    /// How many there are.
    count: usize,
}

impl Trial<'_> {
    fn of(&self, candidate: Candidate) -> Option<Tried> {
        let structure = candidate.added_to(self.structure);
        let fit = self.data.fit_from(&structure, self.now)?;
        let held_out = self.data.held_out_from(&structure, self.held_out)?;
        let before: f64 = self.held_out.iter().map(|part| part.squares).sum();
        let parts = self.held_out.iter().zip(&held_out);
        let parts: Vec<f64> = parts.map(|(a, b)| a.squares - b.squares).collect();
        let (gain, error) = sum_and_error(&parts);
        let told = match &candidate {
            Candidate::Effect { effect, joints } => self.effect(*effect, joints, &fit),
            Candidate::Load { body } => self.load(*body, &structure, &fit)?,
        };
        let significant = told.in_bounds
            && told.is_told
            && told.z >= least_z(self.count)
            && gain > error
            && gain >= LEAST_SHARE * before;
        Some(Tried {
            candidate,
            values: told.values,
            z: told.z,
            in_bounds: told.in_bounds,
            gain: gain / before,
            gain_error: error / before,
            rms: rms(&held_out),
            significant,
            structure,
            held_out,
        })
    }

    fn effect(&self, effect: usize, joints: &[usize], fit: &Fit) -> Told {
        let deviations = self.data.deviations(fit);
        let columns = joints.iter().map(|j| effect_column(*j, effect));
        let columns: Vec<usize> = columns.collect();
        let values: Vec<Value> = columns
            .iter()
            .map(|&k| Value {
                value: fit.theta()[k],
                std: deviations.of_parameter(k).into_iter().fold(0.0, f64::max),
            })
            .collect();
        let squares = values.iter().map(|v| (v.value / v.std).powi(2)).sum();
        let size = Squared {
            size: squares,
            freedom: joints.len() as f64,
            tried: 1.0,
        };
        Told {
            values,
            z: size.z(),
            // At its bound an effect does nothing.
            in_bounds: columns.iter().any(|k| !fit.solution.held[*k]),
            is_told: true,
        }
    }

    /// A load is what a body has beyond what the model's uncertainty leaves open: judged by how much the cost falls once that no longer
    /// binds.
    fn load(&self, body: usize, structure: &ModelStructure, fit: &Fit) -> Option<Told> {
        let free = |structure: &ModelStructure| {
            let mut structure = structure.clone();
            structure.hold_bodies = false;
            self.data.fit_from(&structure, fit)
        };
        let (without, with) = (free(self.structure)?, free(structure)?);
        let fallen = without.cost(self.data, without.noise) - with.cost(self.data, without.noise);
        let size = Squared {
            size: fallen,
            freedom: Candidate::Load { body }.freedom(),
            tried: 1.0,
        };
        let values = self.load_values(body, fit);
        let mass = values[0];
        Some(Told {
            in_bounds: mass.value > 0.0,
            // A body whose mass is elsewhere carries no load.
            is_told: mass.value > LEAST_VALUE * mass.std,
            z: size.z(),
            values,
        })
    }

    /// Mass and place: what the body is more than the model's, and where.
    fn load_values(&self, body: usize, fit: &Fit) -> Vec<Value> {
        let deviations = self.data.deviations(fit);
        let model = &self.structure.bodies[body];
        let theta = fit.theta();
        let first = INERTIAL * body;
        let more = |k: usize| theta[first + k] - model.inertia.0[k];
        // The model's body is not known better than it says.
        let problem = self.data.problem(self.structure, fit.noise);
        let prior = problem.prior_root(&problem.start());
        let std = |entries: &[(usize, f64)]| {
            let entries: Vec<(usize, f64)> = entries.iter().map(|(k, x)| (first + k, *x)).collect();
            let combination = combination(&entries);
            deviations
                .of_combination(&combination)
                .hypot(prior.tr_mul(&combination).norm())
        };
        let mass = more(0);
        let place = (1..4).map(|axis| {
            let at = more(axis) / mass;
            Value {
                value: at,
                std: std(&[(0, -at / mass), (axis, 1.0 / mass)]),
            }
        });
        let mass = Value {
            value: mass,
            std: std(&[(0, 1.0)]),
        };
        std::iter::once(mass).chain(place).collect()
    }
}

struct Told {
    values: Vec<Value>,
    z: f64,
    in_bounds: bool,
    /// Whether the value is beyond its error.
    is_told: bool,
}

//! Values of a model file that the logs contradict: what has changed since the file was written, or what it has wrong.
//!
//! A diagnosis fits all values anew before it looks for effects, so that a value that has moved leaves no error behind. It is a finding all the
//! same: often it is the whole answer. Judged at the end of the search, where an effect that the file lacks no longer pulls at the others.

use std::collections::HashMap;

use serde::Serialize;

use crate::estimate::ParameterEstimate;
use crate::model::{BASE, Model};
use crate::parameter::{INERTIAL_NAMES, name_at, of_effect, told};
use crate::select::criteria::least_z;

/// The data leave at most this share of the prior's standard deviation of a value that they contradict: beyond it the prior speaks, not the log.
const LEARNED: f64 = 0.5;

/// A value of the model file that the logs contradict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangedValue {
    /// `coulomb:FR_calf`, `m:FR_thigh`; of a body's parameters the one that has moved furthest.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// What the file says.
    pub was: f64,
    /// Its standard deviation there; none if the file does not say.
    pub was_std: Option<f64>,
    /// What these logs say.
    #[serde(rename = "now")]
    pub is: f64,
    /// Its standard deviation.
    pub std: f64,
    /// How far that is, in standard deviations of both together.
    pub z: f64,
}

impl ChangedValue {
    /// `coulomb:RR_thigh is 0.620 ±0.010 N m, the file says 0.124 ±0.011`
    pub fn words(&self) -> String {
        let [is, unit] = told(self.is, self.std, self.unit);
        let was = match self.was_std {
            Some(std) => told(self.was, std, self.unit)[0].clone(),
            None => {
                let [was, _] = told(self.was, 0.0, self.unit);
                was.split(" ±").next().unwrap_or_default().to_owned()
            }
        };
        format!(
            "{} is {is} {unit}, the file says {was} ({:.0} σ)",
            self.name, self.z
        )
    }
}

/// A value that a model gives, and its standard deviation.
type Given = (f64, Option<f64>);

/// The values that `model` gives and `fitted` contradicts beyond chance, the surest first; of logs that the model's values are not of
/// ([`Model::is_of`]).
pub(super) fn changed(model: &Model, fitted: &[ParameterEstimate]) -> Vec<ChangedValue> {
    let given = given(model);
    let compared: Vec<ChangedValue> = (fitted.iter())
        .filter(|now| !now.at_bound && now.std > 0.0 && now.std <= LEARNED * now.prior_std)
        .filter_map(|now| {
            let &(was, was_std) = given.get(&now.name)?;
            Some(ChangedValue {
                name: now.name.clone(),
                unit: now.unit,
                was,
                was_std,
                is: now.value,
                std: now.std,
                z: (now.value - was).abs() / now.std.hypot(was_std.unwrap_or(0.0)),
            })
        })
        .collect();
    let least = least_z(compared.len());
    let mut changed: Vec<ChangedValue> = (compared.into_iter())
        .filter(|value| value.z >= least)
        .collect();
    changed.sort_by(|a, b| b.z.total_cmp(&a.z));
    // The parameters of one body go together: one of them tells.
    let mut bodies: Vec<String> = Vec::new();
    changed.retain(|value| {
        let Some(body) = body_of(&value.name) else {
            return true;
        };
        let first = !bodies.iter().any(|known| known == body);
        bodies.extend(first.then(|| body.to_owned()));
        first
    });
    changed
}

/// The body that a parameter is of.
fn body_of(name: &str) -> Option<&str> {
    let (what, body) = name.split_once(':')?;
    let inertial = INERTIAL_NAMES.iter().any(|(name, _)| *name == what);
    inertial.then_some(body)
}

/// All values that a model gives, by name.
fn given(model: &Model) -> HashMap<String, Given> {
    let mut given = HashMap::new();
    // Where a parameter is searched, the others are of another curve whenever it is: no value of the one file is another of the other.
    let comparable = (model.effects().iter()).filter(|e| !e.effect.description().has_shape());
    for e in comparable {
        let joint = model.joint_name(e.joint);
        let known = e.estimates.iter().enumerate();
        given.extend(known.filter_map(|(n, known)| {
            let known = known.as_ref()?;
            Some((of_effect(e.effect, n, joint), (known.value, known.std)))
        }));
    }
    let bodies = std::iter::once(BASE).chain(0..model.robot().bodies().len());
    for body in bodies.filter(|body| model.is_identified(*body)) {
        let (values, std) = (model.inertia(body), model.inertia_std(body));
        for (n, (what, _)) in INERTIAL_NAMES.iter().enumerate() {
            let name = name_at(what, model.joint_name(body));
            given.insert(name, (values.0[n], std.map(|std| std[n])));
        }
    }
    given
}

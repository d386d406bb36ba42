//! What a motion can tell and what it cannot, in words.
//!
//! - *Base parameters* are the combinations of standard parameters that some motion can tell, with what these data say of
//!   them: from the torque's rows in random states (`structural`).
//! - *Null directions* are what cannot be told. Structural ones are the parameters that base parameters take in with others.
//!   Beyond them, what these data do not tell: with every base parameter measured in units of its prior's standard
//!   deviation, a rank-revealing factorisation of the data's triangle (QR with column pivoting: Golub & Van Loan §5.4)
//!   leaves columns that are, within the noise, combinations of others.
//!
//! Files beside:
//!
//! - `reduction`: which columns are combinations of which

mod reduction;
mod structural;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::estimate::Status;
use crate::estimate::bounded::inverse;
use crate::estimate::fit::LimbFit;
use reduction::{Reduction, pivoted};

/// A combination changes the data by less than this many standard deviations of the noise when it changes by one of its prior:
/// the data do not tell it.
const UNSEEN: f64 = 1.0;
/// Smallest share, in units of the prior's standard deviations, of a parameter that a null direction names.
const LEAST_NAMED: f64 = 0.2;
/// Most parameters that a null direction names.
const MOST_NAMED: usize = 5;

/// A multiple of a standard parameter.
#[derive(Debug, Clone, Serialize)]
pub struct Term {
    /// `Ixx:FR_hip`.
    pub parameter: String,
    /// How much of it.
    pub coefficient: f64,
}

/// A combination of parameters that motion can tell.
#[derive(Debug, Clone, Serialize)]
pub struct BaseParameter {
    /// Its limb.
    pub limb: String,
    /// The combination, the parameter that it is named after first.
    pub terms: Vec<Term>,
    /// Unit of the first.
    pub unit: &'static str,
    /// Estimate.
    pub value: f64,
    /// Standard deviation of the estimate, the larger of the two ways.
    pub std: f64,
    /// The same if residuals were independent.
    pub std_independent: f64,
    /// The same by the data alone, without any prior; none if they leave it open.
    pub data_std: Option<f64>,
    /// Standard deviation before any data.
    pub prior_std: f64,
    /// Whether the data tell it.
    pub status: Status,
}

/// A combination of parameters that these data do not tell.
#[derive(Debug, Clone, Serialize)]
pub struct NullDirection {
    /// Its limb.
    pub limb: String,
    /// What can change together and leave the torque as it is. Where structural, in SI; else each base parameter, named by its
    /// first, in units of its prior's standard deviation.
    pub terms: Vec<Term>,
    /// Whether no motion at all would tell it.
    pub structural: bool,
    /// The same in words.
    pub words: String,
}

/// What a limb's data tell.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Identifiability {
    /// What some motion can tell.
    pub base_parameters: Vec<BaseParameter>,
    /// What these data do not.
    pub null_directions: Vec<NullDirection>,
}

impl Identifiability {
    pub(crate) fn of(fit: &LimbFit) -> Self {
        let structure = structural::of(fit);
        let base_parameters = base_parameters(fit, &structure);
        let mut null_directions = structural_directions(fit, &structure);
        null_directions.extend(unseen_directions(fit, &structure, &base_parameters));
        Self {
            base_parameters,
            null_directions,
        }
    }

    /// Takes in another limb's.
    pub(crate) fn extend(&mut self, other: Self) {
        self.base_parameters.extend(other.base_parameters);
        self.null_directions.extend(other.null_directions);
    }
}

fn name(fit: &LimbFit, entry: usize) -> String {
    fit.data.name(&fit.columns.entries[entry])
}

fn prior_std(fit: &LimbFit) -> Vec<f64> {
    let n = fit.solution.theta.len();
    fit.problem
        .without_data()
        .solve()
        .map_or_else(|| vec![1.0; n], |prior| prior.std().as_slice().to_vec())
}

fn base_parameters(fit: &LimbFit, structure: &Reduction) -> Vec<BaseParameter> {
    let deviations = fit.deviations();
    let spread = fit.spread();
    let prior = fit
        .problem
        .without_data()
        .solve()
        .map(|prior| inverse(&prior.factor));
    let there = fit.problem.prior_root(&fit.solution.theta);
    let data_std = data_std(fit, structure);
    let parameter = |(r, combination): (usize, &Vec<f64>)| {
        let first = structure.independent[r];
        let p = DVector::from_column_slice(combination);
        let [std_independent, blocks] = deviations.of_combination(&p);
        let std = (std_independent.max(blocks)).hypot(spread.of_combination(&p));
        let prior_std = prior
            .as_ref()
            .map_or(f64::INFINITY, |prior| prior.tr_mul(&p).norm());
        let terms = combination
            .iter()
            .enumerate()
            .filter(|(_, c)| c.abs() > 1e-6);
        let mut terms: Vec<(usize, f64)> = terms.map(|(k, c)| (k, *c)).collect();
        terms.sort_by_key(|(k, _)| (*k != first, *k));
        let entry = &fit.columns.entries[first];
        BaseParameter {
            limb: fit.data.limb.name.clone(),
            unit: entry
                .effect
                .map_or(proprio_core::inertia::UNITS[entry.parameter], |effect| {
                    let joint = fit.data.body_of(entry.joint);
                    fit.data.model.unit(effect, joint, entry.parameter)
                }),
            value: p.dot(&fit.solution.theta),
            std,
            std_independent,
            data_std: data_std[r],
            prior_std,
            status: Status::there(std, prior_std, std_independent, there.tr_mul(&p).norm()),
            terms: terms
                .into_iter()
                .map(|(k, coefficient)| Term {
                    parameter: name(fit, k),
                    coefficient,
                })
                .collect(),
        }
    };
    structure
        .combinations
        .iter()
        .enumerate()
        .map(parameter)
        .collect()
}

/// Standard deviations of the base parameters by the data alone: their columns and those of all else that is not analysed.
fn data_std(fit: &LimbFit, structure: &Reduction) -> Vec<Option<f64>> {
    let n = fit.solution.theta.len();
    let rest = (0..n).filter(|k| !structure.analysed.contains(k));
    let kept: Vec<usize> = rest.chain(structure.independent.iter().copied()).collect();
    let mut columns = DMatrix::zeros(fit.problem.data.nrows(), kept.len());
    for (c, &k) in kept.iter().enumerate() {
        columns.set_column(c, &fit.problem.data.column(k));
    }
    let triangle = crate::estimate::bounded::triangle(columns);
    let first = kept.len() - structure.independent.len();
    let told = (0..kept.len()).all(|k| triangle[(k, k)].abs() > 1e-12 * triangle.amax());
    let inverse = inverse(&triangle);
    (first..kept.len())
        .map(|k| Some(inverse.row(k).norm()).filter(|std| told && std.is_finite()))
        .collect()
}

/// What no motion tells: each dependent parameter with its share in the base parameters.
fn structural_directions(fit: &LimbFit, structure: &Reduction) -> Vec<NullDirection> {
    let dependent = structure
        .analysed
        .iter()
        .filter(|k| !structure.independent.contains(k));
    dependent
        .map(|&d| {
            let others = structure.independent.iter().zip(&structure.combinations);
            let others = others
                .map(|(&k, combination)| (k, -combination[d]))
                .filter(|(_, c)| c.abs() > 1e-6);
            direction(fit, [(d, 1.0)].into_iter().chain(others).collect(), true)
        })
        .collect()
}

/// What these data do not tell of what motion can tell: base parameters, and what is not analysed.
fn unseen_directions(
    fit: &LimbFit,
    structure: &Reduction,
    base: &[BaseParameter],
) -> Vec<NullDirection> {
    let (n, own) = (fit.solution.theta.len(), prior_std(fit));
    let scale = |k: usize| {
        let base = structure
            .independent
            .iter()
            .position(|i| *i == k)
            .map(|r| base[r].prior_std);
        base.unwrap_or(own[k])
    };
    let kept: Vec<usize> = (0..n)
        .filter(|k| structure.independent.contains(k) || !structure.analysed.contains(k))
        .collect();
    let mut data = DMatrix::zeros(fit.problem.data.nrows(), kept.len());
    for (c, &k) in kept.iter().enumerate() {
        data.set_column(c, &(fit.problem.data.column(k) * scale(k)));
    }
    pivoted(&data, UNSEEN)
        .into_iter()
        .map(|shares| {
            let mut terms: Vec<(usize, f64)> = kept
                .iter()
                .copied()
                .zip(shares)
                .filter(|(_, c)| c.abs() >= LEAST_NAMED)
                .collect();
            terms.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            direction(fit, terms, false)
        })
        .collect()
}

fn direction(fit: &LimbFit, terms: Vec<(usize, f64)>, structural: bool) -> NullDirection {
    let names: Vec<String> = terms.iter().map(|(k, _)| spoken(&name(fit, *k))).collect();
    let term = |(k, coefficient)| Term {
        parameter: name(fit, k),
        coefficient,
    };
    NullDirection {
        limb: fit.data.limb.name.clone(),
        structural,
        words: words(&names),
        terms: terms.into_iter().map(term).collect(),
    }
}

/// `Ixx:FR_hip` as `FR_hip Ixx`.
fn spoken(name: &str) -> String {
    name.split_once(':').map_or_else(
        || name.to_owned(),
        |(what, joint)| format!("{joint} {what}"),
    )
}

fn words(names: &[String]) -> String {
    match names {
        [] => "nothing".to_owned(),
        [one] => format!("{one} does not show"),
        [one, other] => format!("{one} and {other} cannot be separated"),
        [one, others @ ..] => {
            let named = others[..others.len().min(MOST_NAMED)].join(", ");
            let more = if others.len() > MOST_NAMED {
                " and others"
            } else {
                ""
            };
            format!("{one} cannot be separated from {named}{more} together")
        }
    }
}

impl BaseParameter {
    /// The combination as text, `Ixx:FR_hip + 0.213 hz:FR_thigh`.
    pub fn expression(&self) -> String {
        let mut text = String::new();
        for (n, term) in self.terms.iter().enumerate() {
            let size = term.coefficient.abs();
            text += match (n, term.coefficient < 0.0) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            if (size - 1.0).abs() > 1e-6 {
                text += &format!("{} ", (size * 1e4).round() / 1e4);
            }
            text += &term.parameter;
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_null_direction_is_told_in_words() {
        let names = |n: usize| -> Vec<String> { (0..n).map(|k| format!("p{k}")).collect() };
        assert_eq!(words(&names(1)), "p0 does not show");
        assert_eq!(words(&names(2)), "p0 and p1 cannot be separated");
        assert_eq!(
            words(&names(3)),
            "p0 cannot be separated from p1, p2 together"
        );
        assert_eq!(spoken("armature:FR_hip"), "FR_hip armature");
    }

    #[test]
    fn a_combination_reads_as_a_sum() {
        let term = |parameter: &str, coefficient| Term {
            parameter: parameter.to_owned(),
            coefficient,
        };
        let base = BaseParameter {
            limb: "FR".to_owned(),
            terms: vec![
                term("hx:A", 1.0),
                term("m:B", -0.2130000001),
                term("m:C", 2.0),
            ],
            unit: "kg m",
            value: 0.0,
            std: 1.0,
            std_independent: 1.0,
            data_std: None,
            prior_std: 1.0,
            status: Status::Prior,
        };
        assert_eq!(base.expression(), "hx:A - 0.213 m:B + 2 m:C");
    }
}

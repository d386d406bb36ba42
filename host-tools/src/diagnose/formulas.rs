//! Torques outside the catalogue, as formulas: where the catalogue leaves structure, each joint's residual is held against a grammar of physical
//! terms, and what stands as every other step does is taken.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Diagnosed;
use crate::catalogue;
use crate::detect::regime::{Edge, Regime, RegimeOf};
use crate::equation::values::Place;
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::LimbData;
use crate::formula::Kind;
use crate::formula::grammar::Border;
use crate::identify::model_fit::parameters;
use crate::model::{JointKind, Robot};
use crate::select::candidate::Member;
use crate::select::criteria::statistics::FALSE_ALARM;
use crate::select::criteria::{LEAST_Z, STRUCTURE};
use crate::select::fitted::Fitted;
use crate::select::formula_screen::{KnownFactors, Pick, pick};
use crate::select::formulas::Asked;
use crate::table::with_std;

/// Terms of one joint: what three do not tell is no formula but a shape.
pub(super) const MOST_TERMS: usize = 3;

/// A formula that a log's residual has asked for, and that stands.
#[derive(Debug, Clone, Serialize)]
pub struct FoundFormula {
    /// Its name in the model file.
    pub effect: &'static str,
    /// Where.
    pub joint: String,
    /// The torque.
    pub torque: String,
    /// Its values.
    pub parameters: Vec<super::ParameterReport>,
    /// Share of the squared error of its joint that it explains, of what the catalogue leaves.
    pub share: f64,
    /// Where of the joint's motion, or from when on, it acts, if not everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub regime: Option<Regime>,
    /// How often noise alone makes some term of the grammar explain as much.
    pub chance: f64,
    /// Other terms that do as well on this log.
    pub rivals: Vec<String>,
}

impl FoundFormula {
    /// At a joint of the robot, with the values that a fit has `found` for parameters of these names.
    pub(super) fn of(
        robot: &Robot,
        (effect, joint): Place,
        pick: &Pick,
        found: impl Fn(&str) -> Option<(f64, f64)>,
    ) -> Self {
        let body = &robot.bodies()[joint];
        let text = catalogue::formula_of(effect).map_or_else(
            || pick.text.clone(),
            |formula| robot.formula_text(formula, joint),
        );
        let described = effect.description().parameters.iter().enumerate();
        let of = |(n, p): (usize, &proprio_core::effect::Parameter)| {
            let own = found(&crate::parameter::of_effect(effect, n, &body.name));
            let (value, std) = own.unwrap_or((f64::NAN, f64::NAN));
            super::ParameterReport {
                symbol: p.symbol,
                unit: p.unit,
                value,
                std,
            }
        };
        let parameters: Vec<super::ParameterReport> = described.map(of).collect();
        // The parameter that is searched comes last.
        let edge = parameters.last().map(|p| Edge {
            value: p.value,
            std: p.std,
        });
        let slides = body.kind == JointKind::Prismatic;
        let regime = pick.border.map(|border| {
            let (variable, edges) = match border {
                Border::Beyond => (RegimeOf::Position, [edge, None]),
                Border::Below => (RegimeOf::Position, [None, edge]),
                Border::After => (RegimeOf::Time, [edge, None]),
            };
            Regime::new(&body.name, (variable, slides), (edges, false))
        });
        Self {
            effect: effect.name(),
            torque: text,
            parameters,
            regime,
            share: pick.share,
            chance: pick.chance,
            rivals: pick.rivals.clone(),
            joint: body.name.clone(),
        }
    }

    /// The words for `add`: `'q_sign_dq = FR_calf: c*q*sign(dq)'`.
    pub fn to_add(&self) -> String {
        format!("'{} = {}: {}'", self.effect, self.joint, self.torque)
    }

    /// A sentence.
    pub(super) fn words(&self) -> String {
        let values = self.parameters.iter().map(|p| {
            let value = with_std(p.value, p.std);
            format!("{} = {value} {}", p.symbol, p.unit)
        });
        let values: Vec<String> = values.collect();
        let rivals = match self.rivals.as_slice() {
            [] => String::new(),
            rivals => format!("; as good on these data: {}", rivals.join(", ")),
        };
        let regime = match &self.regime {
            None => String::new(),
            Some(regime) => format!("; it acts {}", regime.words_with_conditions()),
        };
        format!(
            "{}: {} with {} explains {:.0} % of the square error that the catalogue leaves there{regime}{rivals}",
            self.joint,
            self.torque,
            values.join(", "),
            100.0 * self.share
        )
    }
}

/// Finds formulas at the joints where the catalogue leaves structure, and puts them into the model at the end of the search.
pub(super) fn find<'a>(
    d: &mut Diagnosed<'a>,
    data: &'a [LimbData<'a>],
    joints: &[(usize, usize)],
) -> Vec<FoundFormula> {
    let alarm = FALSE_ALARM / joints.len().max(1) as f64;
    let mut found: Vec<(Member, Pick)> = Vec::new();
    for &(limb, joint) in joints {
        let (own, known) = (&data[limb], KnownFactors::default());
        let screen = |fit: &LimbFit| -> Option<(Asked, Pick)> {
            let pick = pick(fit, joint, (alarm, STRUCTURE), &known)?;
            let stands = pick.share >= STRUCTURE;
            let asked = stands.then(|| asked(own, (limb, joint), &pick)).flatten();
            asked.map(|asked| (asked, pick))
        };
        let exchanged = std::cell::RefCell::new(None);
        let instead = d.found.exchange(data, (limb, joint), &|fit| {
            let (asked, pick) = screen(fit)?;
            exchanged.replace(Some(pick));
            Some(asked)
        });
        found.extend(instead.zip(exchanged.into_inner()));
        d.found.complete_drive(limb, joint);
        for _ in 0..MOST_TERMS {
            let Some((asked, pick)) = screen(&d.found.end.fits[limb]) else {
                break;
            };
            let before = d.found.clone_end();
            if d.found.end.has(&asked.0) || !d.found.take(data, &asked) {
                break;
            }
            // As it is reported, with what its shape leaves open.
            let told = told(d, data, asked.0, &pick);
            let linear = told.parameters.len() - pick.shapes.len();
            let mut sizes = told.parameters[..linear].iter();
            let is_told = sizes.any(|p| (p.value / p.std).abs() >= LEAST_Z);
            if !is_told || !is_within_torque(&d.found.end.fits[limb], asked.0.1) {
                d.found.undo(before);
                break;
            }
            d.found.take_out_beside(data, asked.0);
            found.push((asked.0, pick));
        }
    }
    found.retain(|(member, _)| d.found.end.has(member));
    if !found.is_empty() {
        d.found.look_again();
    }
    let of = |((limb, place), pick): &(Member, Pick)| told(d, data, (*limb, *place), pick);
    found.iter().map(of).collect()
}

/// Whether a term's torque is nowhere larger than what was measured at its joint: a larger one stands against another that takes it away again.
fn is_within_torque(fit: &LimbFit, place: Place) -> bool {
    let (data, n) = (fit.data, fit.data.joints());
    let mut without = fit.values.clone();
    without.remove(place);
    let [with, without] = [&fit.values, &without].map(|own| data.predicted(own, &|_| true));
    let most = |of: &dyn Fn(usize) -> f64| {
        let windows = (0..data.motion.windows.len()).filter(|&w| data.counts(w, place.1));
        let sizes = windows.map(|w| of(w * n + place.1).abs());
        sizes.fold(0.0, f64::max)
    };
    most(&|at| with[at] - without[at]) <= most(&|at| data.torque[at])
}

/// A term as an effect at its joint, with the values that its screen gives it.
fn asked(own: &LimbData, (limb, joint): (usize, usize), pick: &Pick) -> Option<Asked> {
    let stated = BTreeMap::new();
    let robot = own.model.robot();
    let of = (Kind::Free, &stated);
    let effect = robot.formula(&pick.name, &pick.text, of, own.body_of(joint));
    let numbers = (pick.values.iter().chain(&pick.shapes)).copied();
    Some(((limb, (effect.ok()?, joint)), numbers.enumerate().collect()))
}

/// What is said of one that stands.
fn told(
    d: &Diagnosed,
    data: &[LimbData],
    (limb, place): (usize, Place),
    pick: &Pick,
) -> FoundFormula {
    let own = &data[limb];
    let fitted = parameters(&d.found.end.fits[limb]);
    let place = (place.0, own.body_of(place.1));
    FoundFormula::of(own.model.robot(), place, pick, |name| {
        let found = fitted.iter().find(|own| own.estimate.name == name)?;
        Some((found.estimate.value, found.estimate.std))
    })
}

//! Torques outside the catalogue on walks: a joint's equations, contact forces projected out, are held against the same grammar of physical terms as
//! those of a robot that hangs, and what stands as every other step does is taken.

use std::collections::BTreeMap;

use super::model::WalkModel;
use super::search::WalkSource;
use crate::diagnose::formulas::{FoundFormula, MOST_TERMS};
use crate::equation::values::Place;
use crate::estimate::{ParameterEstimate, find};
use crate::formula::{Kind, Names};
use crate::free_base::Walks;
use crate::free_base::shapes::range;
use crate::model::Model;
use crate::select::candidate::Member;
use crate::select::criteria::STRUCTURE;
use crate::select::criteria::statistics::FALSE_ALARM;
use crate::select::criteria::step::{is_held, is_worth_a_step};
use crate::select::fitted::Fitted;
use crate::select::formula_screen::{
    Gates, KnownFactors, MOST_WINDOWS, Pick, ScreenRow, ScreenWindow, pick_of,
};
use crate::select::search::Found;
use crate::select::source::Source;

/// Of an equation that gets a smaller share of a joint's torque than this nothing is asked: it tells a ten-thousandth of what the joint's own does.
const LEAST_WEIGHT: f64 = 0.01;

/// Effects beyond a drive's at one joint that a single torque may be: where one is right, a search stops at it.
const SEVERAL: usize = 2;

/// Finds formulas at these joints, and at those where several effects may stand for one, and puts them into the model at the end of the search.
pub(super) fn find_formulas(
    (walks, model): (&Walks, &Model),
    found: &mut Found<WalkSource<'_>>,
    outside: &[usize],
) -> Vec<(Place, Pick)> {
    let stands_for = |joint: &usize| found.added_at(0, *joint).len() >= SEVERAL;
    let joints = 0..walks.robot.joints();
    let joints = joints.filter(|joint| outside.contains(joint) || stands_for(joint));
    let joints: Vec<usize> = joints.collect();
    let gates = (FALSE_ALARM / joints.len().max(1) as f64, STRUCTURE);
    // What a model asks for at a joint, and the model with it.
    type Asked = (Member, Pick, WalkModel);
    let asked = |now: &WalkModel, joint: usize, known: &KnownFactors| -> Option<Asked> {
        let pick = pick((walks, known), now, joint, gates)?;
        let of = (Kind::Free, &BTreeMap::new());
        let effect = model.robot().formula(&pick.name, &pick.text, of, joint);
        let member = (0, (effect.ok()?, joint));
        if pick.share < STRUCTURE || now.has(&member) {
            return None;
        }
        let after = now.with_formula((walks, model), member.1, &pick.shapes)?;
        let [told, before] = [&after, now].map(|of| of.held_out(now));
        let stands = is_worth_a_step(&told, &before) && is_held(after.size(&member));
        stands.then_some((member, pick, after))
    };
    let source = found.source.anew();
    let mut all: Vec<(Member, Pick)> = Vec::new();
    for joint in joints {
        let without = |end: &WalkModel, several: &[Member]| {
            several.iter().try_fold(end.clone(), |model, member| {
                source.without(&model, &[*member])
            })
        };
        let (mut picked, known) = (None, KnownFactors::default());
        let instead = found.exchange_by((0, joint), without, |without| {
            let (member, pick, after) = asked(without, joint, &known)?;
            picked = Some(pick);
            Some((member, after))
        });
        all.extend(instead.zip(picked));
        for _ in 0..MOST_TERMS {
            let Some((member, pick, after)) = asked(&found.end, joint, &known) else {
                break;
            };
            found.put(member, after, false);
            found.take_out_resembling(member, |end, other| source.without(end, &[other]));
            all.push((member, pick));
        }
    }
    all.retain(|(member, _)| found.end.has(member));
    let of = |(member, pick): (Member, Pick)| (member.1, pick);
    all.into_iter().map(of).collect()
}

/// The term that the equations of a joint ask for.
fn pick(
    (walks, known): (&Walks, &KnownFactors),
    now: &WalkModel,
    joint: usize,
    gates: Gates,
) -> Option<Pick> {
    let (data, fit, robot) = (&now.data, &now.fit, &walks.robot);
    let used = usize::try_from(data.windows.used).unwrap_or(usize::MAX);
    let every = used.div_ceil(MOST_WINDOWS).max(1);
    let left = data.left_with(walks, fit.theta(), (&fit.active, every));
    let own = |j: &usize| robot.limb_of(*j) == robot.limb_of(joint);
    let first = (0..robot.joints()).find(own)?;
    let limb = first..first + (0..robot.joints()).filter(own).count();
    let joints: Vec<&str> = robot.names[limb.clone()]
        .iter()
        .map(String::as_str)
        .collect();
    let mut windows = Vec::new();
    for (n, (walk, _)) in walks.walks.iter().enumerate() {
        let corrected = data.corrected(walk);
        let states = data.joint_states(walks, n, &corrected, |_| false);
        let all = data.windows_of(n);
        for left in &left[n] {
            let at = all.binary_search_by_key(&left.start_us, |window| window.start_us);
            let Ok(at) = at else { continue };
            let projection = data.projection(walks, n, &states, &all[at]);
            let row = |c: usize| {
                let weights = projection.weights(joint, c);
                let size: f64 = weights.iter().map(|weight| weight.abs()).sum();
                (left.left[c].is_finite() && size >= LEAST_WEIGHT).then(|| ScreenRow {
                    equation: c,
                    weights,
                    left: left.left[c],
                    columns: left.columns[c].clone(),
                })
            };
            let rows: Vec<ScreenRow> = (0..robot.coordinates()).filter_map(row).collect();
            if !rows.is_empty() {
                let samples = projection.seen(&limb);
                windows.push(ScreenWindow { samples, rows });
            }
        }
    }
    let names = Names {
        joints: &joints,
        own: joint - first,
    };
    let range = range(walks, joint, 0.0);
    pick_of((names, known), &range, windows.into_iter(), gates)
}

/// What is said of those that stand, with these values.
pub(super) fn told(
    model: &Model,
    found: &[(Place, Pick)],
    values: &[ParameterEstimate],
) -> Vec<FoundFormula> {
    let of = |(place, pick): &(Place, Pick)| {
        FoundFormula::of(model.robot(), *place, pick, |name| {
            find(values, name).map(|own| (own.value, own.std))
        })
    };
    found.iter().map(of).collect()
}

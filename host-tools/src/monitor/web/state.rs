//! All that a page shows.

use proprio_core::go2::{JointId, Leg};
use proprio_core::wire::Counters;
use serde::Serialize;

use crate::estimate::ParameterEstimate;
use crate::monitor::residual::Residual;
use crate::monitor::view::{Ranked, View};
use crate::table::with_std;

/// A view in the words and numbers of the terminal's screen.
#[derive(Debug, Clone, Serialize)]
pub struct State {
    source: String,
    /// Board, firmware and scalar, once the device has said hello.
    device: Option<String>,
    /// Device time, s.
    seconds: f64,
    paused: bool,
    ended: bool,
    /// Legs of which there are data.
    legs: Vec<LegState>,
    ranking: Vec<RankedState>,
    /// The newest first.
    events: Vec<EventState>,
    buses: Vec<BusState>,
    link: LinkState,
    counters: Option<Counters>,
}

#[derive(Debug, Clone, Serialize)]
struct LegState {
    leg: &'static str,
    joints: Vec<JointState>,
    parameters: Vec<ParameterState>,
}

#[derive(Debug, Clone, Serialize)]
struct JointState {
    name: &'static str,
    /// Of the newest windows, N m, and as it went.
    residual: Option<f64>,
    residuals: Vec<f64>,
    band: Option<[f64; 2]>,
    above: bool,
}

#[derive(Debug, Clone, Serialize)]
struct ParameterState {
    #[serde(flatten)]
    estimate: ParameterEstimate,
    text: String,
    prior_text: String,
}

#[derive(Debug, Clone, Serialize)]
struct RankedState {
    effect: &'static str,
    joint: &'static str,
    /// Leg, joint and effect as the device numbers them.
    at: [u8; 3],
    active: bool,
    missing: bool,
    gain: f32,
    gain_error: f32,
    /// In percent.
    gain_text: String,
    text: String,
    unit: &'static str,
}

#[derive(Debug, Clone, Serialize)]
struct EventState {
    seconds: f64,
    text: String,
}

#[derive(Debug, Clone, Serialize)]
struct BusState {
    leg: &'static str,
    rate: f64,
    windows: u32,
    solution: &'static str,
    /// All its joints' zeros are known.
    placed: bool,
    lost: u32,
}

#[derive(Debug, Clone, Serialize)]
struct LinkState {
    messages: u64,
    missed: u32,
    bad: u32,
    load: Option<LoadState>,
}

#[derive(Debug, Clone, Serialize)]
struct LoadState {
    unit: String,
    mean: u64,
    worst: u32,
    over_budget: u32,
}

impl State {
    /// What is known by now of what comes from `source`.
    pub fn of(view: &View, source: &str, paused: bool, ended: bool) -> Self {
        let device = view.hello.as_ref().map(|hello| {
            let bits = hello.capacities.scalar_bits;
            format!("{} {} {bits}-bit", hello.board, hello.firmware)
        });
        let events = view.events.iter().rev().map(|event| EventState {
            seconds: event.time_us as f64 * 1e-6,
            text: event.text.clone(),
        });
        Self {
            source: source.to_owned(),
            device,
            seconds: view.counters.map_or(0.0, |c| c.time_us as f64 * 1e-6),
            paused,
            ended,
            legs: legs(view),
            ranking: view.ranking().iter().map(ranked).collect(),
            events: events.collect(),
            buses: buses(view),
            link: link(view),
            counters: view.counters,
        }
    }
}

fn legs(view: &View) -> Vec<LegState> {
    let known = Leg::ALL.into_iter().zip(&view.legs);
    let known = known.filter(|(_, known)| known.windows > 0);
    let legs = known.map(|(leg, known)| LegState {
        leg: leg.name(),
        joints: JointId::of(leg)
            .iter()
            .zip(&known.residuals)
            .map(|(id, residual)| joint(id.name(), residual))
            .collect(),
        parameters: known.parameters.iter().map(parameter).collect(),
    });
    legs.collect()
}

fn joint(name: &'static str, residual: &Residual) -> JointState {
    JointState {
        name,
        residual: residual.newest(),
        residuals: residual.recent().collect(),
        band: residual.band().map(|band| [band.lower, band.upper]),
        above: residual.is_above(),
    }
}

fn parameter(estimate: &ParameterEstimate) -> ParameterState {
    ParameterState {
        text: with_std(estimate.value, estimate.std),
        prior_text: with_std(estimate.prior, estimate.prior_std),
        estimate: estimate.clone(),
    }
}

fn ranked(ranked: &Ranked) -> RankedState {
    let [gain, gain_error] = [ranked.gain, ranked.gain_error].map(|x| 100.0 * f64::from(x));
    RankedState {
        effect: ranked.effect,
        joint: ranked.joint.name(),
        at: [ranked.at.leg, ranked.at.joint, ranked.at.effect],
        active: ranked.active,
        missing: ranked.is_missing(),
        gain: ranked.gain,
        gain_error: ranked.gain_error,
        gain_text: with_std(gain, gain_error),
        text: with_std(f64::from(ranked.value), f64::from(ranked.std)),
        unit: ranked.unit,
    }
}

fn buses(view: &View) -> Vec<BusState> {
    let legs = Leg::ALL.into_iter().zip(&view.legs).enumerate();
    let (unplaced, withheld) = (view.unplaced(), view.withheld());
    let buses = legs.map(|(n, (leg, known))| BusState {
        leg: leg.name(),
        rate: known.rate,
        windows: known.windows,
        solution: match (withheld.iter().any(|(of, _)| *of == leg), known.consistent) {
            (true, _) => "wiring",
            (false, true) => "consistent",
            (false, false) => "free",
        },
        placed: !unplaced.contains(&leg),
        lost: view.lost(n),
    });
    buses.collect()
}

fn link(view: &View) -> LinkState {
    let load = view.counters.map(|counters| counters.load);
    let load = load.filter(|load| load.ticks > 0).zip(view.hello.as_ref());
    LinkState {
        messages: view.messages,
        missed: view.losses.1,
        bad: view.losses.0,
        load: load.map(|(load, hello)| LoadState {
            unit: hello.load_unit.to_string(),
            mean: load.total / u64::from(load.ticks),
            worst: load.worst,
            over_budget: load.over_budget,
        }),
    }
}

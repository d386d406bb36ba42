//! Which feet carry a force, or may, and why that is believed.

use plotly::Scatter;
use plotly::common::Mode;

use super::figure::{Figure, axis, colour, layout, line, plotted};
use super::section::{Key, Mark, Section};
use crate::free_base::{FootEpisode, Reason};

/// What is told apart: why, in words, and in which colour.
const REASONS: [(Reason, &str, &str); 4] = [
    (
        Reason::Torque,
        "force, by the leg's torques",
        colour::MODELS[0],
    ),
    (
        Reason::Count,
        "force, by the foot's sensor",
        colour::MODELS[1],
    ),
    (
        Reason::Height,
        "as low as feet that carry one",
        colour::MODELS[2],
    ),
    (
        Reason::Guard,
        "close in time to one of these",
        colour::MODELS[3],
    ),
];
/// Width of a bar, px.
const WIDTH: f64 = 14.0;

/// A line of time for each foot; where it is empty the foot is in the air.
pub fn section(feet: &[FootEpisode], names: &[String]) -> Section {
    let legend = REASONS
        .iter()
        .enumerate()
        .map(|(n, (_, words, colour))| Key {
            label: (*words).to_owned(),
            colour,
            mark: Mark::Area,
            trace: Some(n),
        });
    Section {
        id: "stance",
        title: "Feet on the ground",
        text: "The contact force of a foot that may be in stance is eliminated, whatever its size: that costs three equations of \
               a window. A foot counts as in swing only where no measurement contradicts it."
            .to_owned(),
        legend: legend.collect(),
        figures: if feet.is_empty() {
            Vec::new()
        } else {
            vec![figure(feet, names)]
        },
        columns: 1,
        ..Section::default()
    }
}

fn figure(feet: &[FootEpisode], names: &[String]) -> Figure {
    let trace = |(reason, words, colour): &(Reason, &'static str, &'static str)| {
        let own = || feet.iter().filter(|episode| episode.reason == *reason);
        let t = own().flat_map(|episode| [episode.time[0], episode.time[1], f64::NAN]);
        let leg = own().flat_map(|episode| [episode.leg as f64, episode.leg as f64, f64::NAN]);
        let trace: Box<dyn plotly::Trace> = Scatter::new(plotted(t), plotted(leg))
            .mode(Mode::Lines)
            .name(*words)
            .line(line(*colour, WIDTH));
        trace
    };
    let legs: Vec<f64> = (0..names.len()).map(|n| n as f64).collect();
    let feet_axis = axis("foot")
        .tick_values(legs)
        .tick_text(names.to_vec())
        .range(vec![names.len() as f64 - 0.5, -0.5]);
    Figure {
        title: "Feet over time".to_owned(),
        traces: REASONS.iter().map(trace).collect(),
        layout: layout(axis("time (s)"), feet_axis),
        group: Some("time"),
        height: 220,
    }
}

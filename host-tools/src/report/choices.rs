//! Tick boxes: every model that leaves effects out, or has more of the simple ones, fitted anew in the page.

use plotly::common::{Marker, Mode};
use plotly::{Scatter, Trace};
use serde_json::{Value, json};

use super::escape;
use super::figure::{Figure, axis, colour, layout};
use super::library::pack;
use super::section::{Key, Mark, Section};
use crate::compare::{Choice, Choices};

/// The solver, made by `solve/build`.
const SOLVER: &[u8] = include_bytes!("solve.wasm");

/// What the page is told beside the factors.
pub(super) struct Told {
    /// Effects, `EFFECT:JOINT`, of the model before.
    pub(super) before: Vec<String>,
    /// Of each joint the noise, N m, where it is known.
    pub(super) floors: Vec<(String, Option<f64>)>,
    /// That of all joints.
    pub(super) floor: Option<f64>,
    /// Commands that make the model file, if it is not there, and the one that compares it.
    pub(super) first: Vec<String>,
    pub(super) compare: String,
    /// The error that `compare` tells of the model, N m.
    pub(super) rms: f64,
}

/// Tick boxes, each joint's error, and a joint's residual before and now.
///
/// # Errors
/// None that memory can give.
pub(super) fn section(choices: &Choices, told: &Told) -> std::io::Result<Section> {
    let numbers: Vec<u8> = choices
        .numbers
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let drawn: Vec<u8> = choices.drawn.iter().flat_map(|x| x.to_le_bytes()).collect();
    let meta = escape::json(&meta(choices, told).to_string()).into_owned();
    let html = format!(
        "{MARKUP}<script type=\"application/json\" id=\"choices\">{meta}</script>\n\
         <script type=\"text/plain\" id=\"solver\">{}</script>\n\
         <script type=\"text/plain\" id=\"factors\">{}</script>\n\
         <script type=\"text/plain\" id=\"drawn\">{}</script>\n",
        pack(SOLVER)?,
        pack(&numbers)?,
        pack(&drawn)?,
    );
    let key = |label: &str, colour, mark, trace| Key {
        label: label.to_owned(),
        colour,
        mark,
        trace: Some(trace),
    };
    Ok(Section {
        id: "try",
        title: "Tick what the model has",
        text: "Each tick fits the bodies and all ticked effects anew, here in the page, to all blocks of time but one, and \
               predicts that one; so for each block. The command below finds the weights of the data anew as well: what it prints differs \
               by up to a hundredth."
            .to_owned(),
        legend: vec![
            key("before", colour::POINT, Mark::Point, 0),
            key("now", colour::MODELS[0], Mark::Point, 1),
            key("mean before", colour::MEASURED, Mark::Solid, 2),
            key("mean now ± 2 standard errors", colour::STATISTIC, Mark::Solid, 3),
        ],
        figures: vec![
            figure("velocity", "velocity (rad/s)"),
            figure("position", "position (rad)"),
            figure("load", "torque of the bodies alone (N m)"),
        ],
        columns: 3,
        html,
        ..Section::default()
    })
}

const MARKUP: &str = "<div class=\"try\">\n<div>\n<p class=\"score\"><output id=\"rms\">…</output> N m <span id=\"beside\"></span></p>\n\
    <div class=\"buttons\"><button type=\"button\" id=\"as-found\">As found</button> <button type=\"button\" id=\"as-before\">As before</button></div>\n\
    <fieldset id=\"ticks\"><legend>Effects</legend></fieldset>\n<p class=\"how\" id=\"fixed\"></p>\n</div>\n\
    <div>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"error of each joint\"><table id=\"errors\"><thead><tr><th scope=\"col\">joint</th>\
    <th scope=\"col\" class=\"number\">before</th><th scope=\"col\" class=\"number\">now</th><th scope=\"col\" class=\"number\">noise</th>\
    <th scope=\"col\">N m</th></tr></thead><tbody></tbody></table></div>\n\
    <div class=\"next\"><code id=\"command\"></code> <button type=\"button\" data-copy=\"command\">Copy</button></div>\n</div>\n</div>\n\
    <p><label>Residual of <select id=\"joint\"></select></label></p>\n";

fn figure(name: &str, x: &str) -> Figure {
    let points = |name: &str, colour: &'static str, mode: Mode, size: usize| -> Box<dyn Trace> {
        let none: Vec<f64> = Vec::new();
        let marker = Marker::new().color(colour).size(size);
        let trace = Scatter::new(none.clone(), none)
            .name(name)
            .mode(mode)
            .marker(marker);
        trace.line(super::figure::line(colour, 2.0))
    };
    Figure {
        title: format!("Residual against {name}"),
        traces: vec![
            points("before", colour::POINT, Mode::Markers, 3),
            points("now", colour::MODELS[0], Mode::Markers, 3),
            points("mean before", colour::MEASURED, Mode::Lines, 3),
            points("mean now", colour::STATISTIC, Mode::LinesMarkers, 6),
        ],
        layout: layout(axis(x), axis("residual (N m)")),
        group: None,
        height: 280,
    }
}

fn name(choice: &Choice) -> String {
    format!("{}:{}", choice.effect, choice.joint)
}

fn meta(choices: &Choices, told: &Told) -> Value {
    let effect = |choice: &Choice| {
        json!({"effect": choice.effect, "joint": choice.joint, "found": choice.there,
               "before": choice.there && told.before.contains(&name(choice))})
    };
    let limbs = choices.limbs.iter().map(|limb| {
        let place = |place: &Option<usize>| place.map_or(-1, |place| place as i64);
        let places = |of: &Vec<Option<usize>>| of.iter().map(place).collect::<Vec<_>>();
        let floor = |joint: &String| {
            let known = told.floors.iter().find(|(name, _)| name == joint);
            known.and_then(|(_, floor)| *floor)
        };
        json!({
            "joints": limb.joints,
            "windows": limb.windows,
            "drawn": limb.drawn,
            "folds": limb.folds,
            "places": limb.places.iter().map(places).collect::<Vec<_>>(),
            "floor": limb.joints.iter().map(floor).collect::<Vec<_>>(),
            "effects": limb.effects.iter().map(effect).collect::<Vec<_>>(),
            "fixed": limb.fixed.iter().map(name).collect::<Vec<_>>(),
            "searched": limb.searched,
        })
    });
    json!({
        "limbs": limbs.collect::<Vec<_>>(),
        "floor": told.floor,
        "first": told.first,
        "compare": told.compare,
        "rms": told.rms,
    })
}

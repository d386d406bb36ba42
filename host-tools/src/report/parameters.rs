//! The parameters and what is known of them.

use super::data_table::{Cell, Column, DataTable};
use super::section::Section;
use crate::advise::figure;
use crate::table::with_std;

/// A parameter.
#[derive(Debug, Clone)]
pub struct ParameterRow {
    /// Its name, such as `coulomb:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Value taken to be true before the data.
    pub prior: f64,
    /// Standard deviation of that.
    pub prior_std: f64,
    /// In one word: `identified`, `prior`, `unexcited`.
    pub status: String,
}

/// What a motion makes of a parameter's standard deviation.
#[derive(Debug, Clone)]
pub struct ExpectedRow {
    /// Its name, such as `coulomb:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Standard deviation before the motion.
    pub prior_std: f64,
    /// The same after it.
    pub std: f64,
}

/// A table of what a motion makes of standard deviations.
pub fn expected(parameters: &[ExpectedRow]) -> Section {
    let column = Column::new;
    let row = |p: &ExpectedRow| {
        vec![
            Cell::text(&p.name),
            Cell::number(figure(p.prior_std), p.prior_std),
            Cell::number(figure(p.std), p.std),
            Cell::text(unit(&p.unit)),
        ]
    };
    Section {
        id: "expected",
        title: "Expected standard deviations",
        text: "What <code>identify</code> would print as ±1σ after the motion, recorded once, with noise of 0.5 % of the motors’ greatest torque. \
               Parameters that only occur in combination keep their prior’s."
            .to_owned(),
        table: Some(DataTable {
            columns: vec![
                column("name", false),
                column("± before", true),
                column("± after", true),
                column("unit", false),
            ],
            rows: parameters.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}

/// The spaces do not break: a unit in two lines reads as two.
fn unit(unit: &str) -> String {
    unit.replace("^2", "²").replace(' ', "\u{a0}")
}

/// A table of all of them.
pub fn section(parameters: &[ParameterRow]) -> Section {
    let column = Column::new;
    let row = |p: &ParameterRow| {
        vec![
            Cell::text(&p.name),
            Cell::number(told(p.value, p.std), p.value),
            Cell::text(unit(&p.unit)),
            Cell::number(told(p.prior, p.prior_std), p.prior),
            Cell::text(&p.status),
        ]
    };
    Section {
        id: "parameters",
        title: "Parameters",
        text: "Every parameter with one standard deviation. <b>identified</b>: the data determine it; <b>prior</b>: mostly what \
               was assumed before; <b>unexcited</b>: the motion does not show it at all, the value is the assumption. <span class=\"screen\">Click a \
               heading to sort.</span>"
            .to_owned(),
        legend: Vec::new(),
        figures: Vec::new(),
        table: Some(DataTable {
            columns: vec![
                column("name", false),
                column("value", true),
                column("unit", false),
                column("before the data", true),
                column("status", false),
            ],
            rows: parameters.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}

fn told(value: f64, std: f64) -> String {
    match (value.is_finite(), std.is_finite()) {
        (true, true) => with_std(value, std),
        (true, false) => format!("{value:.4}"),
        (false, _) => "–".to_owned(),
    }
}

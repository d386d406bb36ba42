//! Errors of several models, joint by joint.

use plotly::Bar;
use plotly::common::Marker;
use plotly::layout::BarMode;

use super::data_table::{Cell, Column, DataTable};
use super::escape;
use super::figure::{Figure, axis, colour, layout, plotted};
use super::section::{Key, Mark, Section};

/// A model's error at a joint, or over all.
#[derive(Debug, Clone)]
pub struct Row {
    /// The model's file.
    pub model: String,
    /// The joint, or all of them.
    pub joint: String,
    /// Root mean square of measured − predicted torque, N m.
    pub rms: f64,
    /// 100 (1 − |error| / |torque − its mean|).
    pub fit_percent: f64,
    /// The noise floor, N m, where it is known.
    pub floor: Option<f64>,
}

/// Bars of each joint, model beside model, and a table that can be sorted; `models` in their order.
pub fn section(rows: &[Row], models: &[String]) -> Section {
    let column = Column::new;
    let bars = |(n, model): (usize, &String)| {
        let own = || rows.iter().filter(|row| row.model == *model);
        let joints: Vec<String> = own()
            .map(|row| escape::plot(&row.joint).into_owned())
            .collect();
        Bar::new(joints, plotted(own().map(|row| row.rms)))
            .name(escape::plot(model))
            .marker(Marker::new().color(colour::MODELS[n % colour::MODELS.len()]))
            as Box<dyn plotly::Trace>
    };
    let key = |(n, model): (usize, &String)| {
        Key::new(
            model,
            colour::MODELS[n % colour::MODELS.len()],
            Mark::Area,
            Some(n),
        )
    };
    let row = |row: &Row| {
        let floor = row.floor.map_or(Cell::text(""), |floor| {
            Cell::number(format!("{floor:.4}"), floor)
        });
        vec![
            Cell::text(row.model.clone()),
            Cell::text(row.joint.clone()),
            Cell::number(format!("{:.4}", row.rms), row.rms),
            Cell::number(format!("{:.1}", row.fit_percent), row.fit_percent),
            floor,
        ]
    };
    Section {
        id: "models",
        title: "Error of each model",
        text: "Root mean square of measured less predicted torque, over the windows in which every model is judged; the fit is 100 % of a model \
               without error and 0 % of the torque’s own mean."
            .to_owned(),
        legend: models.iter().enumerate().map(key).collect(),
        figures: vec![Figure {
            title: "Error of each joint".to_owned(),
            traces: models.iter().enumerate().map(bars).collect(),
            layout: layout(axis(""), axis("error (N m rms)")).bar_mode(BarMode::Group),
            group: None,
            height: 320,
        }],
        columns: 1,
        table: Some(DataTable {
            columns: vec![
                column("model", false),
                column("joint", false),
                column("error, N m rms", true),
                column("fit, %", true),
                column("noise floor, N m", true),
            ],
            rows: rows.iter().map(row).collect(),
        }),
        ..Section::default()
    }
}

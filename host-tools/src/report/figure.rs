//! A plot: Plotly traces and a layout, and its place in the page.

use std::fmt::Write;

use plotly::color::Color;
use plotly::common::{DashType, Line, Title};
use plotly::layout::{Axis, Margin};
use plotly::{Layout, Trace};

use super::escape;

/// Colours by what they mean. The page's script puts in the theme's own, of the style sheet's variable of that name.
pub(super) mod colour {
    /// What was measured.
    pub(in super::super) const MEASURED: &str = "@measured";
    /// What models say, in the order they are given.
    pub(in super::super) const MODELS: [&str; 4] = ["@model-1", "@model-2", "@model-3", "@model-4"];
    /// What a model leaves.
    pub(in super::super) const RESIDUAL: &str = "@residual";
    /// One sample of many.
    pub(in super::super) const POINT: &str = "@point";
    /// A statistic of them.
    pub(in super::super) const STATISTIC: &str = "@model-2";
    /// A quantity in a bar.
    pub(in super::super) const BAR: &str = "@bar";
    /// What is taken away from it.
    pub(in super::super) const REMOVED: &str = "@removed";
    /// A limit: the noise floor.
    pub(in super::super) const LIMIT: &str = "@limit";
    /// What chance gives.
    pub(in super::super) const BAND: &str = "@band";
    /// Error bars.
    pub(in super::super) const ERROR: &str = "@measured";
}

/// Digits of a plotted value: finer than a pixel.
const DIGITS: usize = 5;

/// A plot in the page.
pub(super) struct Figure {
    /// Stands above it, plain text.
    pub(super) title: String,
    /// What is drawn.
    pub(super) traces: Vec<Box<dyn Trace>>,
    /// Axes and shapes.
    pub(super) layout: Layout,
    /// Plots of one group share their x range when zoomed.
    pub(super) group: Option<&'static str>,
    /// Height, px.
    pub(super) height: usize,
}

impl Figure {
    /// Writes the element; its data lie beside it as JSON.
    pub(super) fn render(&self, to: &mut String) {
        let traces: Vec<String> = self.traces.iter().map(|trace| trace.to_json()).collect();
        let json = format!(
            "{{\"data\":[{}],\"layout\":{}}}",
            traces.join(","),
            self.layout.to_json()
        );
        let title = escape::html(&self.title);
        let group = self
            .group
            .map_or(String::new(), |group| format!(" data-group=\"{group}\""));
        let _ = writeln!(
            to,
            "<figure><figcaption>{title}</figcaption>\
             <div class=\"plot\" role=\"img\" aria-label=\"{}\" style=\"height:{}px\"{group}></div>\
             <script type=\"application/json\">{}</script></figure>",
            escape::html(&self.description()),
            self.height,
            escape::json(&json),
        );
    }
}

impl Figure {
    /// What a reader who does not see it is told: what is drawn, against what, and between which values.
    fn description(&self) -> String {
        let json =
            |text: String| serde_json::from_str::<serde_json::Value>(&text).unwrap_or_default();
        let layout = json(self.layout.to_json());
        let axis = |name: &str| {
            layout[name]["title"]["text"]
                .as_str()
                .unwrap_or_default()
                .to_owned()
        };
        let (x, y) = (axis("xaxis"), axis("yaxis"));
        let mut text = self.title.clone();
        match (x.is_empty(), y.is_empty()) {
            (false, false) => text += &format!(": {y} against {x}"),
            (false, true) => text += &format!(": {x}"),
            _ => (),
        }
        for trace in &self.traces {
            let trace = json(trace.to_json());
            let values = if trace["orientation"] == "h" {
                &trace["x"]
            } else {
                &trace["y"]
            };
            let numbers = values
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(serde_json::Value::as_f64);
            let (least, most) =
                numbers.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
            if let (Some(name), true) = (trace["name"].as_str(), least <= most) {
                text += &format!("; {name} from {least} to {most}");
            }
        }
        text
    }
}

/// Values as they are plotted.
pub(super) fn plotted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    values
        .into_iter()
        .map(|value| escape::rounded(value, DIGITS))
        .collect()
}

/// A line of a plot.
pub(super) fn line(colour: impl Color, width: f64) -> Line {
    Line::new().color(colour).width(width)
}

/// The dash of the model's line at `index`: colour alone does not tell lines apart for everyone, nor on every printer.
pub(super) fn dash(index: usize) -> DashType {
    match index % 3 {
        0 => DashType::Solid,
        1 => DashType::Dash,
        _ => DashType::Dot,
    }
}

/// An axis with `title`, of the program's own words.
pub(super) fn axis(title: &str) -> Axis {
    Axis::new().title(Title::with_text(title)).auto_margin(true)
}

/// A layout without a title or legend of its own: both stand in HTML around it.
pub(super) fn layout(x: Axis, y: Axis) -> Layout {
    Layout::new()
        .x_axis(x)
        .y_axis(y)
        .show_legend(false)
        .margin(Margin::new().left(48).right(10).top(6).bottom(40))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotly::Scatter;
    use serde_json::Value;

    fn json_of(figure: &Figure) -> Value {
        let mut html = String::new();
        figure.render(&mut html);
        let (_, json) = html
            .split_once("<script type=\"application/json\">")
            .unwrap();
        let (json, rest) = json.split_once("</script>").unwrap();
        assert_eq!(rest, "</figure>\n");
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn what_is_not_finite_is_null_and_names_cannot_leave_the_script() {
        let name = "</script><script>alert(1)</script>";
        let y = plotted([1.234_567_8, f64::NAN, f64::INFINITY]);
        let figure = Figure {
            title: name.to_owned(),
            traces: vec![Scatter::new(vec![0.0, 1.0, 2.0], y).name(escape::plot(name))],
            layout: layout(axis("t (s)"), axis("τ (N m)")),
            group: None,
            height: 100,
        };
        let json = json_of(&figure);
        let trace = &json["data"][0];
        assert_eq!(trace["y"], serde_json::json!([1.2346, null, null]));
        assert_eq!(trace["name"], escape::plot(name).as_ref());
    }
}

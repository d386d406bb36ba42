//! A leg's parameters, each with its error bar against the CAD or the catalogue.

use proprio_core::go2::Leg;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{Screen, bold, dim};
use crate::device::names::words_of_wiring;
use crate::estimate::{ParameterEstimate, Status};
use crate::monitor::view::View;
use crate::table::with_std;

const NAME: usize = 24;
const VALUE: usize = 20;
/// From this width on the CAD's numbers are there too, not the picture alone.
const WIDE: usize = 100;
/// Widths of the bar, which is shown from the smaller on.
const BAR: std::ops::RangeInclusive<usize> = 15..=41;
/// Half of the bar in standard deviations of the CAD.
const REACH: f64 = 3.0;

pub(super) fn draw(frame: &mut Frame, area: Rect, view: &View, screen: &Screen, leg: Leg) {
    let parameters = &view.legs[leg.index()].parameters;
    let width = usize::from(area.width);
    let numbers = if width >= WIDE { 2 * VALUE } else { VALUE };
    let room = width.saturating_sub(NAME + numbers + 2);
    let bar = match room {
        room if room < *BAR.start() => 0,
        // Odd, so that the CAD has a column of its own.
        room => (room.min(*BAR.end()) - 1) | 1,
    };
    let cad = if width >= WIDE { "CAD" } else { "" };
    let cad_width = numbers - VALUE;
    // What is a constrained solution says so, where its numbers stand.
    let estimate = match view.legs[leg.index()].consistent {
        true => "consistent",
        false => "estimate",
    };
    let first = format!("{:<NAME$}{estimate:>VALUE$}{cad:>cad_width$}", "parameter");
    let mut lines = vec![Line::from(vec![
        Span::styled(first, bold()),
        Span::styled(format!("  {}", scale(bar)), dim()),
    ])];
    let height = usize::from(area.height).saturating_sub(1);
    let last = parameters.len().saturating_sub(height);
    let shown = parameters.iter().skip(screen.scroll.min(last)).take(height);
    // Without data a device tells its prior.
    let untold = (view.counters.as_ref()).is_some_and(|c| c.legs[leg.index()].windows == 0);
    if parameters.is_empty() || untold {
        let withheld = view.withheld().into_iter().find(|(of, _)| *of == leg);
        let text = match (view.unplaced().contains(&leg), withheld) {
            (true, _) => {
                "zero unknown: set its joints' angles, proprio zero PORT --help".to_owned()
            }
            (false, Some((leg, wiring))) => words_of_wiring(leg, wiring),
            (false, None) => "no data of this leg yet".to_owned(),
        };
        lines.push(Line::styled(text, dim()));
    } else {
        lines.extend(shown.map(|parameter| line(parameter, cad_width, bar)));
    }
    frame.render_widget(Paragraph::new(lines), area);
}

fn line(p: &ParameterEstimate, cad_width: usize, bar: usize) -> Line<'static> {
    let mut name = format!("{} {}", p.name, p.unit);
    if name.chars().count() > NAME {
        name.clone_from(&p.name);
    }
    let value = with_std(p.value, p.std);
    let cad = match cad_width {
        0 => String::new(),
        _ => with_std(p.prior, p.prior_std),
    };
    let text = format!("{name:<NAME$}{value:>VALUE$}{cad:>cad_width$}  ");
    let style = match p.status {
        Status::Identified => Style::new(),
        Status::Prior | Status::Unexcited => dim(),
    };
    Line::from(vec![Span::styled(text, style), Span::raw(picture(p, bar))])
}

/// What the ends and the middle of the bars mean.
fn scale(width: usize) -> String {
    if width == 0 {
        return String::new();
    }
    let half = width / 2;
    let end = format!("{REACH:.0} std");
    let left = half.saturating_sub(end.len() + 2);
    format!("−{end}{}CAD{}+{end}", " ".repeat(left), " ".repeat(left))
}

/// The estimate ● and one standard deviation ├┤ to either side, on a scale of the CAD's own: its value is │.
fn picture(p: &ParameterEstimate, width: usize) -> String {
    if width == 0 || p.prior_std.is_nan() || p.prior_std <= 0.0 {
        return String::new();
    }
    let half = width as f64 / 2.0;
    let column = |value: f64| half + (value - p.prior) / p.prior_std / REACH * half;
    let (from, at, to) = (
        column(p.value - p.std),
        column(p.value),
        column(p.value + p.std),
    );
    let cell = |n: usize| {
        let here = |x: f64| x >= n as f64 && x < (n + 1) as f64;
        match n {
            _ if here(at) => '●',
            0 if at < 0.0 => '◂',
            _ if n + 1 == width && at >= width as f64 => '▸',
            _ if here(from) => '├',
            _ if here(to) => '┤',
            _ if (n as f64) > from && ((n + 1) as f64) <= to => '─',
            _ if n == width / 2 => '│',
            _ => '·',
        }
    };
    (0..width).map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, std: f64) -> ParameterEstimate {
        ParameterEstimate {
            name: "m:FR_calf".to_owned(),
            unit: "kg",
            value,
            std,
            prior: 1.0,
            prior_std: 0.5,
            status: Status::Identified,
            at_bound: false,
        }
    }

    #[test]
    fn an_error_bar_lies_where_the_number_is() {
        for (value, std, drawn) in [
            (1.0, 0.0, "·······●·······"),
            (1.5, 0.25, "·······│├─●┤···"),
            (0.0, 0.5, "├─●──┤·│·······"),
            (9.0, 0.1, "·······│······▸"),
            (-9.0, 0.1, "◂······│·······"),
            (f64::NAN, f64::NAN, "·······│·······"),
        ] {
            assert_eq!(picture(&estimate(value, std), 15), drawn, "{value} ±{std}");
        }
    }
}

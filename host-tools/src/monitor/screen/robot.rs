//! All joints with their friction and residual, what the model lacks, what happened.

use proprio_core::effect::EffectKind;
use proprio_core::go2::{JOINTS_PER_LEG, JointId, Leg};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};

use super::{Screen, bold, dim, titled, wrong};
use crate::estimate::{Status, find};
use crate::monitor::view::{Ranked, View};
use crate::parameter;
use crate::table::with_std;

/// Widths of the joint's name, of an effect and of the residual.
const JOINT: usize = 8;
const EFFECT: usize = 14;
const RESIDUAL: usize = 16;
/// Below this the events stand under the ranking.
const SIDE_BY_SIDE: u16 = 76;

const EFFECTS: [EffectKind; 4] = [
    EffectKind::Coulomb,
    EffectKind::Viscous,
    EffectKind::Armature,
    EffectKind::Bias,
];

pub(super) fn draw(frame: &mut Frame, area: Rect, view: &View, screen: &Screen) {
    let legs = view.legs.iter().filter(|leg| leg.windows > 0).count();
    let joints = (JOINTS_PER_LEG * legs.max(1) + 2) as u16;
    let rows = Layout::vertical([Constraint::Length(joints), Constraint::Min(3)]);
    let [joints, rest] = rows.areas(area);
    frame.render_widget(Paragraph::new(lines(view, joints.width)), joints);
    let split = match rest.width >= SIDE_BY_SIDE {
        true => Layout::horizontal([Constraint::Min(48), Constraint::Percentage(38)]).spacing(1),
        false => Layout::vertical([Constraint::Min(3), Constraint::Percentage(40)]),
    };
    let [missing, events] = split.areas(rest);
    let ranking = ranking_lines(view, screen, missing);
    frame.render_widget(
        Paragraph::new(ranking).block(titled("what the model lacks")),
        missing,
    );
    let happened = event_lines(view, events);
    let happened = Paragraph::new(happened).wrap(Wrap { trim: false });
    frame.render_widget(happened.block(titled("events")), events);
}

/// A value and its standard deviation in no more columns than needed: one digit of the deviation, four decimals at most.
fn compact(value: f64, std: f64) -> String {
    let decimals = match std > 0.0 {
        true => (-std.log10().floor()).clamp(0.0, 4.0) as usize,
        false => 4,
    };
    // Never rounded to nothing.
    let least = 0.1_f64.powi(decimals as i32);
    format!("{value:.decimals$}±{:.decimals$}", std.max(least))
}

/// Cells set right, so that numbers stand under each other; ± is one column wide.
fn cell(text: &str, width: usize) -> String {
    format!("{text:>width$}")
}

fn lines(view: &View, width: u16) -> Vec<Line<'static>> {
    let room = usize::from(width).saturating_sub(JOINT + RESIDUAL);
    let shown = &EFFECTS[..(room / EFFECT).min(EFFECTS.len())];
    let heading = |first: &str, cells: &dyn Fn(EffectKind) -> String, last: &str| {
        let cells: String = shown
            .iter()
            .map(|effect| cell(&cells(*effect), EFFECT))
            .collect();
        Line::styled(format!("{first:JOINT$}{cells}{last:>RESIDUAL$}"), bold())
    };
    let mut lines = vec![
        heading(
            "joint",
            &|effect| effect.name().to_owned(),
            "residual, band",
        ),
        heading("", &|effect| parameter::unit(effect).to_owned(), "N m"),
    ];
    for (n, leg) in Leg::ALL.into_iter().enumerate() {
        let known = &view.legs[n];
        if known.windows == 0 {
            continue;
        }
        for (j, joint) in JointId::of(leg).into_iter().enumerate() {
            let mut spans = vec![Span::raw(format!("{:JOINT$}", joint.name()))];
            for effect in shown {
                let name = parameter::name(effect.name(), joint);
                spans.push(match find(&known.parameters, &name) {
                    Some(p) => {
                        let style = match p.status {
                            Status::Identified => Style::new(),
                            Status::Prior | Status::Unexcited => dim(),
                        };
                        Span::styled(cell(&compact(p.value, p.std), EFFECT), style)
                    }
                    None => Span::styled(cell("–", EFFECT), dim()),
                });
            }
            spans.push(residual(view, n, j));
            lines.push(Line::from(spans));
        }
    }
    if lines.len() == 2 {
        let text = match view.unplaced().is_empty() {
            true => "no data yet: a window needs 20 ms of all three motors of a leg",
            false => "zero unknown: set the joints' angles, proprio zero PORT --help",
        };
        lines.push(Line::styled(text, dim()));
    }
    lines
}

/// The newest residual, and the band in which it should lie; the mark before it parts it from the effects.
fn residual(view: &View, leg: usize, joint: usize) -> Span<'static> {
    let leg = &view.legs[leg];
    let residual = &leg.residuals[joint];
    let newest = residual.newest().unwrap_or(leg.noise[joint]);
    match residual.band() {
        Some(band) => {
            let mark = if residual.is_above() { "▲" } else { " " };
            let text = format!("{mark}{newest:.3} {:.2}–{:.2}", band.lower, band.upper);
            let style = if residual.is_above() {
                wrong()
            } else {
                Style::new()
            };
            Span::styled(cell(&text, RESIDUAL), style)
        }
        None => Span::styled(cell(&format!("{newest:.3}          "), RESIDUAL), dim()),
    }
}

fn ranking_lines(view: &View, screen: &Screen, area: Rect) -> Vec<Line<'static>> {
    let ranking = view.ranking();
    if ranking.is_empty() {
        let text = "the device judges on data held out: some seconds yet";
        return vec![Line::styled(text, dim())];
    }
    let height = usize::from(area.height.saturating_sub(1)).max(1);
    let selected = screen.selected.min(ranking.len() - 1);
    let first = (selected + 1).saturating_sub(height);
    let shown = ranking.iter().enumerate().skip(first).take(height);
    shown
        .map(|(n, ranked)| ranked_line(ranked, n == selected))
        .collect()
}

fn ranked_line(ranked: &Ranked, selected: bool) -> Line<'static> {
    let mark = if selected { "▸" } else { " " };
    let kind = match (ranked.active, ranked.is_missing()) {
        (true, _) => "has    ",
        (false, true) => "MISSING",
        (false, false) => "       ",
    };
    let gain = with_std(
        100.0 * f64::from(ranked.gain),
        100.0 * f64::from(ranked.gain_error),
    );
    let value = with_std(f64::from(ranked.value), f64::from(ranked.std));
    let name = format!("{}:{}", ranked.effect, ranked.joint.name());
    let text = format!(
        "{mark}{kind} {name:<25} {gain:>12} %  {value} {}",
        ranked.unit
    );
    let style = match (selected, ranked.is_missing()) {
        (true, _) => Style::new().add_modifier(Modifier::REVERSED),
        (false, true) => Style::new().fg(Color::Yellow),
        (false, false) => dim(),
    };
    Line::styled(text, style)
}

fn event_lines(view: &View, area: Rect) -> Vec<Line<'static>> {
    let height = usize::from(area.height.saturating_sub(1));
    let newest = view.events.iter().rev().take(height);
    newest
        .map(|event| {
            let seconds = event.time_us / 1_000_000;
            let time = format!("{}:{:02} ", seconds / 60, seconds % 60);
            Line::from(vec![
                Span::styled(time, dim()),
                Span::raw(event.text.clone()),
            ])
        })
        .collect()
}

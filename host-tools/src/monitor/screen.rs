//! A view as a terminal's screen: of the whole robot, or of one leg's parameters against the CAD.

mod leg;
mod robot;
#[cfg(test)]
mod tests;

use proprio_core::go2::Leg;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use super::view::View;

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Page {
    /// All joints, missing effects, events.
    #[default]
    Robot,
    /// One leg's parameters.
    Leg(Leg),
}

impl Page {
    /// All pages in their order.
    pub const ALL: [Self; 5] = [
        Self::Robot,
        Self::Leg(Leg::FR),
        Self::Leg(Leg::FL),
        Self::Leg(Leg::RR),
        Self::Leg(Leg::RL),
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::Leg(leg) => leg.name(),
        }
    }

    /// The page after this one.
    pub fn next(self) -> Self {
        let place = Self::ALL.iter().position(|page| *page == self);
        Self::ALL[place.map_or(0, |n| (n + 1) % Self::ALL.len())]
    }
}

/// What the user has chosen.
#[derive(Debug, Clone, Default)]
pub struct Screen {
    /// What the messages come from: `qemu`, `sim`, a port, a file.
    pub source: String,
    /// What is looked at.
    pub page: Page,
    /// Which line of the ranking is chosen.
    pub selected: usize,
    /// The first line of a leg's parameters that is shown.
    pub scroll: usize,
    /// Whether the screen or the simulated robot stands still.
    pub paused: bool,
    /// The user has asked for a reset once.
    pub sure: bool,
    /// A recording has ended, or the device is gone.
    pub ended: bool,
}

/// Draws the screen.
pub fn draw(frame: &mut Frame, view: &View, screen: &Screen) {
    let rows = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(1),
        Constraint::Length(1),
        Constraint::Length(1),
        Constraint::Length(1),
    ]);
    let [title, body, bus, link, keys] = rows.areas(frame.area());
    frame.render_widget(Paragraph::new(title_line(view, screen)), title);
    match screen.page {
        Page::Robot => robot::draw(frame, body, view, screen),
        Page::Leg(leg) => leg::draw(frame, body, view, screen, leg),
    }
    frame.render_widget(Paragraph::new(bus_line(view)), bus);
    frame.render_widget(Paragraph::new(link_line(view)), link);
    frame.render_widget(Paragraph::new(keys_line(screen, keys)), keys);
}

fn bold() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

fn dim() -> Style {
    Style::new().add_modifier(Modifier::DIM)
}

fn wrong() -> Style {
    Style::new().fg(Color::Red)
}

/// A part of the screen with its title on a rule.
fn titled(title: &str) -> Block<'_> {
    Block::new().borders(Borders::TOP).title(title)
}

fn title_line<'a>(view: &'a View, screen: &'a Screen) -> Line<'a> {
    let time_us = view.counters.map_or(0, |counters| counters.time_us);
    let seconds = time_us / 1_000_000;
    let mut spans = vec![
        Span::styled("proprio ", bold()),
        Span::raw(format!("{} ", screen.source)),
    ];
    spans.push(match &view.hello {
        Some(hello) => Span::raw(format!(
            "{} {} {}-bit ",
            hello.board, hello.firmware, hello.capacities.scalar_bits
        )),
        None => Span::styled("waiting for the device ", dim()),
    });
    spans.push(Span::raw(format!("{}:{:02} ", seconds / 60, seconds % 60)));
    let unplaced = view.unplaced();
    if unplaced.len() == Leg::ALL.len() {
        spans.push(Span::styled("zero unknown ", wrong()));
    } else if !unplaced.is_empty() {
        let names: Vec<&str> = unplaced.iter().map(|leg| leg.name()).collect();
        let text = format!("zero unknown: {} ", names.join(" "));
        spans.push(Span::styled(text, wrong()));
    }
    let withheld = view.withheld();
    if !withheld.is_empty() {
        let names: Vec<&str> = withheld.iter().map(|(leg, _)| leg.name()).collect();
        let text = format!("wiring: {} ", names.join(" "));
        spans.push(Span::styled(text, wrong()));
    }
    for page in Page::ALL {
        let style = if page == screen.page {
            bold().add_modifier(Modifier::REVERSED)
        } else {
            dim()
        };
        spans.push(Span::styled(page.name(), style));
        spans.push(Span::raw(" "));
    }
    if screen.ended {
        spans.push(Span::styled("ENDED", bold()));
    } else if screen.paused {
        spans.push(Span::styled("PAUSED", bold()));
    }
    Line::from(spans)
}

fn bus_line(view: &View) -> Line<'_> {
    let mut spans = vec![Span::styled("bus  ", bold())];
    for (n, leg) in Leg::ALL.into_iter().enumerate() {
        let (rate, lost) = (view.legs[n].rate, view.lost(n));
        let text = format!("{} {rate:.0}/s", leg.name());
        spans.push(match rate > 1.0 {
            true => Span::raw(text),
            false => Span::styled(text, dim()),
        });
        let text = format!(" {lost} lost  ");
        spans.push(match lost {
            0 => Span::styled(text, dim()),
            _ => Span::styled(text, wrong()),
        });
    }
    Line::from(spans)
}

fn link_line(view: &View) -> Line<'_> {
    let (bad, missed) = view.losses;
    let mut spans = vec![Span::styled("link ", bold())];
    let text = format!("{} messages, {missed} missed, {bad} bad", view.messages);
    spans.push(match bad + missed {
        0 => Span::raw(text),
        _ => Span::styled(text, wrong()),
    });
    if let (Some(counters), Some(hello)) = (&view.counters, &view.hello) {
        let load = counters.load;
        if load.ticks > 0 {
            let mean = load.total / u64::from(load.ticks);
            let text = format!(
                " · {} a step: {mean}, worst {}",
                hello.load_unit, load.worst
            );
            spans.push(Span::raw(text));
        }
        if load.over_budget > 0 {
            let text = format!(", {} over budget", load.over_budget);
            spans.push(Span::styled(text, wrong()));
        }
    }
    Line::from(spans)
}

fn keys_line(screen: &Screen, area: Rect) -> Line<'static> {
    if screen.sure {
        let text = "r again: forget all data · any other key: no";
        return Line::styled(text, bold());
    }
    let keys = [
        "q quit",
        "tab page",
        "↑↓ choose",
        "a add",
        "d drop",
        "p pause",
        "r reset",
        "s save",
        "f factors",
        "w keep",
    ];
    let mut text = String::new();
    for key in keys {
        let more = if text.is_empty() { "" } else { " · " };
        if text.chars().count() + more.chars().count() + key.chars().count()
            > usize::from(area.width)
        {
            break;
        }
        text += more;
        text += key;
    }
    Line::styled(text, dim())
}

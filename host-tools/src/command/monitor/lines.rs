//! Lines for pipes and files, and the JSON object.

use std::io::{ErrorKind, Write, stdout};

use crate::device::names::words_of_wiring;
use crate::estimate::ParameterEstimate;
use crate::monitor::View;
use crate::output::{asked_to_finish, finish_on_interrupt};
use crate::table::with_std;
use proprio_core::go2::Leg;
use proprio_core::wire::{Counters, Walk, Wiring};
use serde::Serialize;

use super::session::Session;
use crate::command::Error;

/// Time between two lines of a leg, µs of the device.
const LINE_US: u64 = 1_000_000;
/// Events that the view keeps are printed once.
struct Printed {
    events: u64,
    line_at: u64,
}

/// Prints until nothing more comes, or the user has seen enough.
pub(super) fn watch(session: &mut Session, silent: bool) -> Result<(), Error> {
    finish_on_interrupt();
    let mut printed = Printed {
        events: 0,
        line_at: 0,
    };
    // A live source ends at Ctrl-C, and the device then estimates all that came of it.
    while !session.ended && (session.is_live || !asked_to_finish()) {
        let mut text = String::new();
        session.look(&mut |view| {
            if !silent {
                printed.news(view, &mut text);
            }
        })?;
        match stdout().write_all(text.as_bytes()) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::BrokenPipe => break,
            Err(error) => return Err(Error::Terminal(error)),
        }
    }
    Ok(())
}

impl Printed {
    /// What is new since the last time.
    fn news(&mut self, view: &View, text: &mut String) {
        let new = view.happened_so_far() - self.events;
        self.events += new;
        let kept = view.events.len();
        for event in view.events.iter().skip(kept - kept.min(new as usize)) {
            let seconds = event.time_us as f64 * 1e-6;
            *text += &format!("{seconds:9.2} s  {}\n", event.text);
        }
        let now_us = view.counters.map_or(0, |counters| counters.time_us);
        if now_us < self.line_at {
            return;
        }
        self.line_at = now_us - now_us % LINE_US + LINE_US;
        for (leg, known) in Leg::ALL.into_iter().zip(&view.legs) {
            if view.unplaced().contains(&leg) && known.rate > 1.0 {
                let (seconds, rate) = (now_us as f64 * 1e-6, known.rate);
                *text += &format!(
                    "{seconds:9.2} s  {} zero unknown, {rate:.0} samples/s\n",
                    leg.name()
                );
                continue;
            }
            let withheld = view.withheld().into_iter().find(|(of, _)| *of == leg);
            if let Some((leg, wiring)) = withheld {
                let (seconds, words) = (now_us as f64 * 1e-6, words_of_wiring(leg, wiring));
                *text += &format!("{seconds:9.2} s  {} {words}\n", leg.name());
                continue;
            }
            if known.windows == 0 {
                continue;
            }
            let noise = known.noise.map(|noise| format!("{noise:.3}")).join(" ");
            let seconds = now_us as f64 * 1e-6;
            *text += &format!(
                "{seconds:9.2} s  {} {} windows, {:.0} samples/s, noise {noise} N m",
                leg.name(),
                known.windows,
                known.rate
            );
            let best = view
                .ranking()
                .into_iter()
                .find(|ranked| ranked.joint.leg() == leg && ranked.is_missing());
            if let Some(best) = best {
                let value = with_std(f64::from(best.value), f64::from(best.std));
                let percent = 100.0 * best.gain;
                let (effect, joint, unit) = (best.effect, best.joint.name(), best.unit);
                *text += &format!(", lacks {effect}:{joint} {value} {unit} ({percent:.1} %)");
            }
            text.push('\n');
        }
    }
}

/// What is known at the end.
#[derive(Serialize)]
pub(super) struct Report {
    board: Option<String>,
    firmware: Option<String>,
    parameters: Vec<ParameterEstimate>,
    legs: Vec<LegReport>,
    /// Legs of which a joint's zero is unknown.
    zero_unknown: Vec<&'static str>,
    /// What is known of the wiring of each leg that is not identified for it.
    wiring: Vec<WiringReport>,
    ranking: Vec<RankedReport>,
    events: Vec<EventReport>,
    /// The last estimate of a robot that walks.
    #[serde(skip_serializing_if = "Option::is_none")]
    walk: Option<Walk>,
    counters: Option<Counters>,
    messages: u64,
    messages_missed: u32,
    frames_bad: u32,
}

/// What a device knows of a leg's wiring.
#[derive(Serialize)]
struct WiringReport {
    leg: &'static str,
    /// "on_trial", "unclear", "unexplained" or "fault".
    state: &'static str,
    text: String,
}

impl WiringReport {
    fn new((leg, wiring): (Leg, Wiring)) -> Self {
        Self {
            leg: leg.name(),
            state: match wiring {
                Wiring::Untested => "untested",
                Wiring::Right => "right",
                Wiring::OnTrial => "on_trial",
                Wiring::Unclear(_) => "unclear",
                Wiring::Unexplained => "unexplained",
                Wiring::Fault(_) => "fault",
            },
            text: words_of_wiring(leg, wiring),
        }
    }
}

#[derive(Serialize)]
struct LegReport {
    leg: &'static str,
    windows: u32,
    /// Each joint's noise, N m.
    noise: [f64; 3],
    /// The same of the last second.
    residual: [Option<f64>; 3],
}

#[derive(Serialize)]
struct RankedReport {
    effect: &'static str,
    joint: &'static str,
    active: bool,
    missing: bool,
    held_out_gain: f32,
    held_out_gain_error: f32,
    value: f32,
    std: f32,
    unit: &'static str,
}

#[derive(Serialize)]
struct EventReport {
    seconds: f64,
    text: String,
}

impl Report {
    pub(super) fn new(view: &View) -> Self {
        let legs = Leg::ALL.into_iter().zip(&view.legs);
        let legs = legs.filter(|(_, known)| known.windows > 0);
        Self {
            board: view.hello.as_ref().map(|hello| hello.board.to_string()),
            firmware: view.hello.as_ref().map(|hello| hello.firmware.to_string()),
            parameters: view
                .legs
                .iter()
                .flat_map(|leg| leg.parameters.clone())
                .collect(),
            legs: legs
                .map(|(leg, known)| LegReport {
                    leg: leg.name(),
                    windows: known.windows,
                    noise: known.noise,
                    residual: known.residuals.each_ref().map(|r| r.newest()),
                })
                .collect(),
            zero_unknown: view.unplaced().iter().map(|leg| leg.name()).collect(),
            wiring: view.withheld().into_iter().map(WiringReport::new).collect(),
            ranking: view
                .ranking()
                .iter()
                .map(|ranked| RankedReport {
                    effect: ranked.effect,
                    joint: ranked.joint.name(),
                    active: ranked.active,
                    missing: ranked.is_missing(),
                    held_out_gain: ranked.gain,
                    held_out_gain_error: ranked.gain_error,
                    value: ranked.value,
                    std: ranked.std,
                    unit: ranked.unit,
                })
                .collect(),
            events: view
                .events
                .iter()
                .map(|event| EventReport {
                    seconds: event.time_us as f64 * 1e-6,
                    text: event.text.clone(),
                })
                .collect(),
            walk: view.walk,
            counters: view.counters,
            messages: view.messages,
            messages_missed: view.losses.1,
            frames_bad: view.losses.0,
        }
    }
}

//! Windows of which more is left than of the others: a push, a foot that strikes and was not seen to, a force that is none of the robot's.
//!
//! One such window weighs as much as hundreds of good ones, and its force would be taken for mass. What is left of a good window has the
//! sensors' noise, and with six equations or more its root mean square is hardly ever twice the usual. An effect that the model lacks is in
//! many windows, or in none of those that are left out here: the fit that they are judged by has every effect that may be missing, and has not seen
//! the part of the time that a window is of. A window that alone tells of some body (one foot for once in the air, of a robot that sways) would else
//! be explained by that body, whatever is wrong with it: of one sway it made the mass 1.4 % too small.

use nalgebra::DVector;

use super::rows::{Linearised, each_row};
use super::stance::Stance;
use super::walk::Walk;
use crate::robust;

/// So many times the usual is outside, root mean square.
pub(super) const LIMIT: f64 = 4.0;
/// A larger share of windows outside is told: a log with two blows in a hundred is as usual.
pub(super) const MANY: f64 = 0.02;

/// What is left of a window.
#[derive(Clone, Copy)]
pub(super) struct Squares {
    /// When it began.
    pub(super) start_us: u64,
    /// Sum of squares over its equations, N² m², and how many these are.
    pub(super) sum: f64,
    pub(super) equations: f64,
}

impl Squares {
    pub(super) fn mean(&self) -> f64 {
        self.sum / self.equations
    }
}

/// When such windows begin, log after log, µs in order; `left` is what is left of each log's windows.
pub(super) fn windows(left: &[Vec<Squares>]) -> Vec<Vec<u64>> {
    let most = usual(left.iter().flatten()).map_or(f64::INFINITY, |usual| LIMIT * LIMIT * usual);
    left.iter()
        .map(|own| {
            let outside = own.iter().filter(|window| window.mean() > most);
            outside.map(|window| window.start_us).collect()
        })
        .collect()
}

/// What parameters leave of each window of a walk; `theta` has those for a window that begins then, s, and nothing for effects' columns that are not
/// `asked` for.
pub(super) fn squares<'a>(
    walk: &Walk,
    stance: &Stance,
    at: Linearised<'_>,
    asked: impl Fn(usize) -> bool,
    theta: impl Fn(f64) -> &'a DVector<f64>,
) -> Vec<Squares> {
    let mut windows: Vec<Squares> = Vec::new();
    each_row(walk, stance, at, &[], asked, |row| {
        let terms = theta(row.start)
            .iter()
            .zip(&*row.numbers)
            .map(|(x, a)| x * a);
        let left = row.numbers[row.numbers.len() - 1] - terms.sum::<f64>();
        if row.rank > 0 {
            windows.push(Squares {
                start_us: (row.start * 1e6).round() as u64,
                sum: 0.0,
                equations: row.rank as f64,
            });
        }
        if let Some(own) = windows.last_mut() {
            own.sum += left * left;
        }
    });
    windows
}

/// What is usually left of a window's equation, N² m²; none of no window.
pub(super) fn usual<'a>(windows: impl Iterator<Item = &'a Squares>) -> Option<f64> {
    robust::median(windows.map(Squares::mean))
}

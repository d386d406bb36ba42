//! Windows of which more is left than of the others: a push, a foot that strikes and was not seen to, a force that is none of the robot's.
//!
//! One such window weighs as much as hundreds of good ones, and its force would be taken for mass. What is left of a good window has the
//! sensors' noise, and with six equations or more its root mean square is hardly ever twice the usual. An effect that the model lacks is in
//! many windows, or in none of those that are left out here: the fit that they are judged by has every effect that may be missing.

use nalgebra::DVector;

use super::Walks;
use super::data::Data;
use super::rows::{COLUMNS, each_row};

/// So many times the usual is outside, root mean square.
pub(super) const LIMIT: f64 = 4.0;

/// When such windows begin, log after log, µs in order.
pub(super) fn windows(walks: &Walks, data: &Data, theta: &DVector<f64>) -> Vec<Vec<u64>> {
    let left: Vec<Vec<(u64, f64)>> = walks
        .walks
        .iter()
        .enumerate()
        .map(|(n, (walk, stance))| {
            let mut windows: Vec<(u64, f64, f64)> = Vec::new();
            each_row(walk, stance, data.linearised(n), &[], |row| {
                let terms = theta.iter().zip(&*row.numbers).map(|(x, a)| x * a);
                let left = row.numbers[COLUMNS] - terms.sum::<f64>();
                if row.rank > 0 {
                    windows.push(((row.start * 1e6).round() as u64, 0.0, row.rank as f64));
                }
                if let Some((_, squares, _)) = windows.last_mut() {
                    *squares += left * left;
                }
            });
            let windows = windows.into_iter();
            windows
                .map(|(start, squares, rank)| (start, squares / rank))
                .collect()
        })
        .collect();
    let mut all: Vec<f64> = left.iter().flatten().map(|(_, square)| *square).collect();
    all.sort_unstable_by(f64::total_cmp);
    let Some(usual) = all.get(all.len() / 2) else {
        return left.iter().map(|_| Vec::new()).collect();
    };
    let most = LIMIT * LIMIT * usual;
    left.iter()
        .map(|own| {
            let outside = own.iter().filter(|(_, square)| *square > most);
            outside.map(|(start, _)| *start).collect()
        })
        .collect()
}

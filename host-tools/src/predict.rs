//! Reported torque as a function of a model and the motion alone.
//!
//! ŷ(t) = `predict(model, motion)`: what a drive would report, in its own scale and as late as it does, from positions, velocities,
//! temperatures and times. The input has no torque, by type. Every score, floor, baseline, ladder and plot is of these numbers,
//! and a fit is the least-squares solution over their derivatives ([`crate::equation::rows`]).

use crate::equation::body::LimbBody;
use crate::equation::column::{Columns, Entry, columns_of};
use crate::equation::dot::dot;
use crate::equation::motion::{Motion, is_derivative};
use crate::equation::rows::Rows;
use crate::equation::values::Values;

/// Mean reported torque of each chosen window and joint (N m), window by window; zero for windows that are not chosen.
pub(crate) fn predict(
    body: &LimbBody,
    motion: &Motion,
    values: &Values,
    subtree_end: &[usize],
    chosen: &dyn Fn(usize) -> bool,
) -> Vec<f64> {
    let columns = Columns::new(subtree_end.to_vec(), entries(values));
    let rows = Rows::of(motion, body, values, &columns, chosen);
    let numbers = columns.numbers(values);
    let n = motion.joints;
    let mut torque = vec![0.0; n * motion.windows.len()];
    for w in (0..motion.windows.len()).filter(|&w| chosen(w)) {
        for j in 0..n {
            torque[w * n + j] = dot(&numbers[j], rows.row(w, j));
        }
    }
    torque
}

/// The parameters that are multiples of columns: of what is a derivative, the motion has it already.
fn entries(values: &Values) -> Vec<Entry> {
    let linear = values
        .places()
        .filter(|(effect, _)| !is_derivative(*effect));
    let of = |place: crate::equation::values::Place| {
        let columns = columns_of(place, values.shape(place)).into_iter();
        columns.map(move |(parameter, column)| Entry {
            effect: Some(place.0),
            joint: place.1,
            parameter,
            mean: 0.0,
            std: f64::INFINITY,
            column,
        })
    };
    linear.flat_map(of).collect()
}

//! Numbers to so many significant digits, as files and messages have them.

/// `value` to twelve significant digits: what a file predicts is then what was fitted, to 1e-10 of a torque.
pub(super) fn rounded(value: f64) -> f64 {
    significant(value, 12)
}

/// `value` to so many significant digits.
pub(crate) fn significant(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.parse().unwrap_or(value)
}

//! Measured and predicted torque against time.

use plotly::Scatter;
use plotly::common::Mode;

use super::figure::{Figure, axis, colour, dash, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::{escape, thin};

/// Points of a line: several for every pixel of a wide screen, so that there is something to zoom into.
const POINTS: usize = 6000;

/// Share of a plot's height that the residual has.
const RESIDUAL_SHARE: f64 = 0.28;

/// Length of the stretch that a long log opens on, s: waves can be told apart.
const STRETCH: usize = 4;

/// A joint's torque over time. The vectors have one length; what is not finite leaves a hole in the line.
#[derive(Debug, Clone)]
pub struct TorqueSeries {
    /// Name of the joint.
    pub joint: String,
    /// Time, s.
    pub t: Vec<f64>,
    /// Measured torque, N m.
    pub measured: Vec<f64>,
    /// What models say, N m, by the models' names; the same models in the same order for every joint, the later drawn over
    /// the earlier.
    pub predicted: Vec<(String, Vec<f64>)>,
}

/// A plot for each joint; zooming one zooms all. A long log opens on the stretch where the last model fails most.
pub fn section(series: &[TorqueSeries]) -> Section {
    let opening = worst_stretch(series);
    let opens = match opening {
        Some(_) => format!(
            "The plots open on the {STRETCH} s in which “{}” is wrong the most.",
            series
                .first()
                .and_then(|series| series.predicted.last())
                .map_or(String::new(), |(model, _)| escape::html(model).into_owned())
        ),
        None => String::new(),
    };
    Section {
        id: "torque",
        title: "Torque against time",
        text: format!(
            "Each plot is a joint: its measured torque and what each model predicts for the same motion; below, on a scale of its \
             own, the residual of the last model, measured less predicted. Where the lines part, the model lacks something. One \
             cursor marks the same time in all plots. {opens} <span class=\"screen\">Drag over a stretch of time to \
             zoom into it in every plot, double-click to see all of it; on a phone, use the buttons above a plot.</span> Long logs are thinned so that every \
             peak stays."
        ),
        legend: series.first().map_or_else(Vec::new, legend),
        figures: series
            .iter()
            .map(|series| figure(series, opening, "torque (N m)"))
            .collect(),
        table: None,
        columns: 3,
        ..Section::default()
    }
}

/// The [`STRETCH`] of time, s, with the greatest sum of squared errors of the last model over all joints; none if the log
/// is not much longer, or no error is finite.
pub(super) fn worst_stretch(series: &[TorqueSeries]) -> Option<[f64; 2]> {
    let times = series.iter().flat_map(|series| &series.t);
    let (start, end) = times
        .filter(|t| t.is_finite())
        .fold((f64::MAX, f64::MIN), |(a, b), &t| (a.min(t), b.max(t)));
    // A bin for each second.
    let bins = (end - start).floor() + 1.0;
    if !(2.0 * STRETCH as f64..=1e7).contains(&bins) {
        return None;
    }
    let mut squares = vec![0.0; bins as usize];
    for series in series {
        let (_, predicted) = series.predicted.last()?;
        let errors = series.measured.iter().zip(predicted).map(|(m, p)| m - p);
        for (t, error) in series.t.iter().zip(errors) {
            if t.is_finite() && error.is_finite() {
                squares[(t - start) as usize] += error * error;
            }
        }
    }
    let sum = |stretch: usize| squares[stretch..stretch + STRETCH].iter().sum::<f64>();
    // The last bin may be a short one.
    let stretches = 0..squares.len() - STRETCH;
    let worst = stretches.max_by(|&a, &b| sum(a).total_cmp(&sum(b)))?;
    let from = start + worst as f64;
    (sum(worst) > 0.0).then_some([from, from + STRETCH as f64])
}

pub(super) fn legend(series: &TorqueSeries) -> Vec<Key> {
    let models = series
        .predicted
        .iter()
        .enumerate()
        .map(|(n, (model, _))| Key {
            label: model.clone(),
            colour: model_colour(n),
            mark: [Mark::Solid, Mark::Dashed, Mark::Dotted][n % 3],
            trace: Some(n + 1),
        });
    let measured = Key {
        label: "measured".to_owned(),
        colour: colour::MEASURED,
        mark: Mark::Solid,
        trace: Some(0),
    };
    let residual = series.predicted.last().map(|(model, _)| Key {
        label: format!("residual of {model}"),
        colour: colour::RESIDUAL,
        mark: Mark::Solid,
        trace: Some(series.predicted.len() + 1),
    });
    std::iter::once(measured)
        .chain(models)
        .chain(residual)
        .collect()
}

/// A plot of a joint; `quantity` stands at its axis.
pub(super) fn figure(series: &TorqueSeries, opening: Option<[f64; 2]>, quantity: &str) -> Figure {
    let trace = |name: &str, values: &[f64]| {
        let kept = thin::extremes(values, POINTS);
        let t = kept.iter().filter_map(|&k| series.t.get(k));
        let t = t.map(|&t| time_digits(t)).collect();
        Scatter::new(t, plotted(kept.iter().map(|&k| values[k])))
            .name(escape::plot(name))
            .mode(Mode::Lines)
    };
    let measured = trace("measured", &series.measured).line(line(colour::MEASURED, 2.5));
    let models = series
        .predicted
        .iter()
        .enumerate()
        .map(|(n, (model, values))| {
            trace(model, values).line(line(model_colour(n), 1.25).dash(dash(n))) as _
        });
    let residual = series.predicted.last().map(|(_, values)| {
        let errors: Vec<f64> = (series.measured.iter().zip(values))
            .map(|(m, p)| m - p)
            .collect();
        trace("residual", &errors)
            .line(line(colour::RESIDUAL, 1.0))
            .y_axis("y2") as _
    });
    let mut time = axis("time (s)");
    if let Some(stretch) = opening {
        time = time.range(stretch.map(time_digits).to_vec());
    }
    let mut upper = axis(quantity);
    if residual.is_some() {
        time = time.anchor("y2");
        upper = upper.domain(&[RESIDUAL_SHARE + 0.08, 1.0]);
    }
    let mut layout = layout(time, upper);
    if residual.is_some() {
        let below = axis("residual").domain(&[0.0, RESIDUAL_SHARE]).n_ticks(4);
        layout = layout.y_axis2(below);
    }
    Figure {
        title: series.joint.clone(),
        traces: std::iter::once(measured as _)
            .chain(models)
            .chain(residual)
            .collect(),
        layout,
        group: Some("time"),
        height: 300,
    }
}

fn model_colour(index: usize) -> &'static str {
    colour::MODELS[index % colour::MODELS.len()]
}

/// A time to 0.1 ms: a sampling instant needs more digits than a plotted value.
fn time_digits(t: f64) -> f64 {
    (t * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(seconds: usize, wrong_from: f64) -> TorqueSeries {
        let t: Vec<f64> = (0..100 * seconds).map(|k| 5.0 + 0.01 * k as f64).collect();
        let wrong = |t: &f64| f64::from(u8::from((wrong_from..wrong_from + 3.0).contains(t)));
        TorqueSeries {
            joint: "FR_hip".to_owned(),
            measured: vec![0.0; t.len()],
            predicted: vec![("model".to_owned(), t.iter().map(wrong).collect())],
            t,
        }
    }

    #[test]
    fn it_opens_where_the_model_is_wrong() {
        for wrong_from in [5.0, 11.3, 21.5] {
            let mut series = series(20, wrong_from);
            series.measured[7] = f64::NAN;
            let [from, to] = worst_stretch(&[series]).unwrap();
            assert!(
                from <= wrong_from && to >= wrong_from + 3.0 - 0.6,
                "{from} {to}"
            );
            assert_eq!(to - from, STRETCH as f64);
        }
    }

    #[test]
    fn a_short_log_and_a_perfect_model_open_whole() {
        assert_eq!(worst_stretch(&[]), None);
        assert_eq!(worst_stretch(&[series(3, 5.0)]), None);
        assert_eq!(worst_stretch(&[series(20, 99.0)]), None);
    }
}

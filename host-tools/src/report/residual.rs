//! What a model leaves unexplained, against where the joint is and how fast it moves.

use plotly::Scatter;
use plotly::common::{ErrorData, ErrorType, Marker, Mode};

use super::figure::{Figure, axis, colour, layout, plotted};
use super::section::{Key, Mark, Section};
use super::{escape, thin};

/// Samples drawn: each is an element of the page.
const POINTS: usize = 500;
/// Bins over the range of the variable.
const BINS: usize = 24;
/// A bin with fewer samples says nothing.
const LEAST_SAMPLES: usize = 5;

/// A joint's residual along its motion: samples in the order of time, vectors of one length. A sample with a value that
/// is not finite is left out.
#[derive(Debug, Clone)]
pub struct ResidualSeries {
    /// Name of the joint.
    pub joint: String,
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Measured less predicted torque, N m.
    pub residual: Vec<f64>,
}

/// Two plots for each joint, against position and against velocity, of the residual that the model of the name `model`
/// leaves.
pub fn section(series: &[ResidualSeries], model: &str) -> Section {
    let figures = series.iter().flat_map(|series| {
        [
            figure(series, "position", "q (rad)", &series.q),
            figure(series, "velocity", "q̇ (rad/s)", &series.dq),
        ]
    });
    let key = |label: &str, colour, trace| Key {
        label: label.to_owned(),
        colour,
        mark: Mark::Point,
        trace: Some(trace),
    };
    Section {
        id: "residual",
        title: "Residual against position and velocity",
        text: format!(
            "The residual is the measured torque less what the model “{}” predicts. Each large dot is its mean where the \
             joint was at that position or velocity, with the mean's standard error; the error counts each visit of the \
             joint to a bin once, since samples of one visit are not independent. A complete model leaves the dots on zero: a step at zero \
             velocity is Coulomb friction, a slope over velocity is viscous friction, a wave over position is gravity, a \
             spring or cogging. At most {POINTS} samples are drawn, all are counted.",
            escape::html(model),
        ),
        legend: vec![
            key("samples", colour::POINT, 0),
            key("mean ± standard error", colour::STATISTIC, 1),
        ],
        figures: figures.collect(),
        table: None,
        columns: 4,
        ..Section::default()
    }
}

fn figure(series: &ResidualSeries, variable: &str, title: &str, x: &[f64]) -> Figure {
    let samples: Vec<(f64, f64)> = x
        .iter()
        .copied()
        .zip(series.residual.iter().copied())
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect();
    let shown = || thin::spread(samples.len(), POINTS).map(|k| samples[k]);
    let points = Scatter::new(plotted(shown().map(|s| s.0)), plotted(shown().map(|s| s.1)))
        .name("sample")
        .mode(Mode::Markers)
        .marker(Marker::new().color(colour::POINT).size(3));
    let bins = bins(&samples);
    let errors = ErrorData::new(ErrorType::Data)
        .array(plotted(bins.iter().map(|bin| bin.error)))
        .color(colour::STATISTIC)
        .thickness(1.5)
        .width(0);
    let centres = plotted(bins.iter().map(|bin| bin.centre));
    let means = Scatter::new(centres, plotted(bins.iter().map(|bin| bin.mean)))
        .name("mean")
        .mode(Mode::Markers)
        .marker(Marker::new().color(colour::STATISTIC).size(7))
        .error_y(errors);
    Figure {
        title: format!("{}, {variable}", series.joint),
        traces: vec![points, means],
        layout: layout(axis(title), axis("residual (N m)")),
        group: None,
        height: 230,
    }
}

/// The samples with one range of the variable.
struct Bin {
    /// Middle of the range.
    centre: f64,
    /// Mean of the residual.
    mean: f64,
    /// Its standard error.
    error: f64,
}

/// Means over equal ranges of the variable, with cluster-robust standard errors (Liang & Zeger, Biometrika 73, 1986,
/// section 3, for a mean): a cluster is a visit, the samples that follow one another within a bin. A bin that was visited
/// only once has no error that could be told, and is left out.
fn bins(samples: &[(f64, f64)]) -> Vec<Bin> {
    let range = samples
        .iter()
        .fold((f64::MAX, f64::MIN), |(least, greatest), s| {
            (least.min(s.0), greatest.max(s.0))
        });
    let width = (range.1 - range.0) / BINS as f64;
    if !(width > 0.0 && width.is_finite()) {
        return Vec::new();
    }
    let bin_of = |x: f64| (((x - range.0) / width) as usize).min(BINS - 1);
    // Visits to each bin: count and sum.
    let mut visits: Vec<Vec<(usize, f64)>> = vec![Vec::new(); BINS];
    let mut previous = None;
    for &(x, y) in samples {
        let bin = bin_of(x);
        if previous != Some(bin) {
            visits[bin].push((0, 0.0));
        }
        if let Some(visit) = visits[bin].last_mut() {
            *visit = (visit.0 + 1, visit.1 + y);
        }
        previous = Some(bin);
    }
    let statistic = |(bin, visits): (usize, &Vec<(usize, f64)>)| {
        let count: usize = visits.iter().map(|visit| visit.0).sum();
        if count < LEAST_SAMPLES || visits.len() < 2 {
            return None;
        }
        let (n, clusters) = (count as f64, visits.len() as f64);
        let mean = visits.iter().map(|visit| visit.1).sum::<f64>() / n;
        let deviation = |visit: &(usize, f64)| visit.1 - visit.0 as f64 * mean;
        let squares: f64 = visits.iter().map(|visit| deviation(visit).powi(2)).sum();
        Some(Bin {
            centre: range.0 + (bin as f64 + 0.5) * width,
            mean,
            error: (clusters / (clusters - 1.0) * squares).sqrt() / n,
        })
    };
    visits.iter().enumerate().filter_map(statistic).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_step_is_found_where_it_is() {
        // Up and down over a range whose middle is an edge between two bins.
        let up = (0..BINS).map(|k| k as f64 - 11.5);
        let sweep = up.clone().chain(up.rev());
        let samples: Vec<(f64, f64)> = std::iter::repeat_n(sweep, 50)
            .flatten()
            .map(|x| (x, x.signum()))
            .collect();
        let bins = bins(&samples);
        assert_eq!(bins.len(), BINS);
        for bin in bins {
            assert_eq!(bin.mean, bin.centre.signum());
            assert_eq!(bin.error, 0.0);
        }
    }

    /// Residuals that stay the same during a visit: the error must be that of the visits, not of the samples.
    #[test]
    fn the_error_is_that_of_independent_visits() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut covered = 0;
        let mut total = 0;
        for _ in 0..60 {
            let samples: Vec<(f64, f64)> = (0..40)
                .flat_map(|_| {
                    let offset = rng.random_range(-1.0..1.0);
                    (0..240).map(move |k| (k as f64, offset))
                })
                .collect();
            for bin in bins(&samples).iter().take(1) {
                total += 1;
                covered += usize::from(bin.mean.abs() < 2.0 * bin.error);
            }
        }
        assert_eq!(total, 60);
        // 95 % of 60 is 57; the binomial's three deviations are 5.
        assert!(covered >= 52, "{covered} of {total}");
    }

    #[test]
    fn no_range_gives_no_bins() {
        assert!(bins(&[]).is_empty());
        assert!(bins(&[(1.0, 2.0); 50]).is_empty());
    }
}

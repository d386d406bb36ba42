//! Errors that come in bursts: what is there at some moments only is no noise.
//!
//! A median does not hear of what few windows say. Where the residual's mean square is well above that of noise with the same
//! median size (Huber & Ronchetti 2009, §5.1), something acts at some moments only: at reversals (a friction with a state),
//! at a position (a cable that catches), at impacts (play). What a fit knows to be in doubt, friction that may hold a joint while it
//! turns round, is taken as that much noise more.

use super::series::JointSeries;
use crate::robust::{self, median};

/// Share of the squared error above noise with the same median from which a joint has bursts.
const BURST_SHARE: f64 = 0.3;
/// Residuals larger than this are part of a burst, standard deviations.
const LARGE: f64 = 3.0;
/// Fewer windows of bursts are no law.
const LEAST_WINDOWS: usize = 10;
/// What acts is there for longer than a window: of so many pairs of neighbours for each window, the signs are the same. A reading that jumps is large in
/// one window, and in two where it is the last sample of the one and the first of the other, which at most every fourth is.
const LASTING: f64 = 0.5;
/// Signs that follow something do so by so many standard deviations of drawn ones.
const SURE: f64 = 3.0;
/// Bursts lie at a speed or a position if it is this much less than the joint's usual one, or scattered that much less.
const NARROW: f64 = 0.35;

/// Residuals far larger than the usual ones.
struct Bursts {
    /// Share of the residuals' sum of squares above noise with the same median size.
    share: f64,
    /// Which residuals belong to bursts.
    large: Vec<usize>,
    /// Of the sum of squares, the share that these carry.
    carried: f64,
}

impl Bursts {
    /// The bursts of residuals, each with its window; `None` if there is nothing to judge.
    fn of(residuals: &[(usize, f64)]) -> Option<Self> {
        let usual = robust::scale(residuals.iter().map(|(_, r)| *r))?;
        let squares: f64 = residuals.iter().map(|(_, r)| r * r).sum();
        let large = residuals.iter().filter(|(_, r)| r.abs() > LARGE * usual);
        let carried: f64 = large.clone().map(|(_, r)| r * r).sum();
        (squares > 0.0).then(|| Self {
            share: 1.0 - usual * usual * residuals.len() as f64 / squares,
            carried: carried / squares,
            large: large.map(|(w, _)| *w).collect(),
        })
    }
}

/// What comes at some moments only.
pub(crate) struct Moments {
    /// Its windows.
    pub(crate) windows: Vec<usize>,
    /// Whether something acts: in many windows, at a place or for more than one. Else readings jump, or something knocks.
    pub(crate) lasts: bool,
    /// In words.
    pub(crate) words: String,
}

/// What is said of a joint whose error comes in bursts; `None` for one without. Each window is in `doubt` by so many times its noise more.
pub(crate) fn bursts(series: &JointSeries, doubt: &[f64]) -> Option<Moments> {
    let against_noise = (series.residual.iter().zip(doubt))
        .map(|(r, doubt)| r / doubt.hypot(1.0))
        .enumerate();
    let mut bursts = Bursts::of(&against_noise.clone().collect::<Vec<_>>())?;
    if bursts.share < BURST_SHARE {
        return None;
    }
    // Over a lost message means are rough: what is large there is no law.
    let whole = against_noise.filter(|(w, _)| series.whole[*w]);
    let acting = Bursts::of(&whole.collect::<Vec<_>>()).and_then(|bursts| {
        let place = place(series, &bursts.large);
        let is_law = bursts.share >= BURST_SHARE
            && bursts.large.len() >= LEAST_WINDOWS
            && (place.is_some() && follows(series, &bursts.large)
                || lasting(&series.residual, &bursts.large) >= LASTING);
        is_law.then(|| (bursts, place.unwrap_or_default()))
    });
    let lasts = acting.is_some();
    let words = |bursts: &Bursts| {
        format!(
            "{:.1} % of the windows carry {:.0} % of its square",
            100.0 * bursts.large.len() as f64 / series.residual.len() as f64,
            100.0 * bursts.carried,
        )
    };
    let words = match acting {
        Some((acting, place)) => {
            bursts = acting;
            let carry = words(&bursts);
            format!(
                "the error comes in bursts{place}: {carry}; the catalogue has nothing that acts so"
            )
        }
        None => words(&bursts),
    };
    Some(Moments {
        windows: bursts.large,
        lasts,
        words,
    })
}

/// The share of large residuals with a neighbour of their sign, less that with one of the other.
fn lasting(residual: &[f64], large: &[usize]) -> f64 {
    let pairs = large.windows(2).filter(|two| two[1] == two[0] + 1);
    let alike = pairs.map(|two| (residual[two[0]] * residual[two[1]]).signum());
    2.0 * alike.sum::<f64>() / large.len().max(1) as f64
}

/// Whether the signs of large residuals are one, or follow the direction of motion or of the acceleration: those of noise that is larger at some places
/// are drawn.
fn follows(series: &JointSeries, large: &[usize]) -> bool {
    let change = |w: usize| {
        let next = (w + 1).min(series.dq.len() - 1);
        series.dq[next] - series.dq[w.saturating_sub(1)]
    };
    let of: [&dyn Fn(usize) -> f64; 3] = [&|_| 1.0, &|w| series.dq[w], &change];
    of.iter().any(|x| {
        let signs = large.iter().map(|&w| (series.residual[w] * x(w)).signum());
        signs.sum::<f64>().abs() >= SURE * (large.len() as f64).sqrt()
    })
}

/// Where the windows of bursts are, if they are anywhere.
fn place(series: &JointSeries, large: &[usize]) -> Option<String> {
    let speeds = |all: &mut dyn Iterator<Item = usize>| median(all.map(|w| series.dq[w].abs()));
    let [slow, usual] = [
        speeds(&mut large.iter().copied())?,
        speeds(&mut (0..series.dq.len()))?,
    ];
    if slow < NARROW * usual {
        return Some(", mostly at reversals".to_owned());
    }
    let middle = median(large.iter().map(|&w| series.q[w]))?;
    let scatter =
        |all: &mut dyn Iterator<Item = usize>| median(all.map(|w| (series.q[w] - middle).abs()));
    let [near, usual] = [
        scatter(&mut large.iter().copied())?,
        scatter(&mut (0..series.q.len()))?,
    ];
    (near < NARROW * usual).then(|| format!(", mostly near {middle:.2} rad"))
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    /// A joint that swings to and fro, with noise and, where `catches` says so, something more.
    fn joint(catches: impl Fn(f64, f64) -> f64) -> JointSeries {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut uniform = || f64::from(rng.next_u32()) / f64::from(u32::MAX) - 0.5;
        let mut series = JointSeries {
            joint: "FR_calf".to_owned(),
            ..JointSeries::default()
        };
        for k in 0..2000 {
            let t = 0.02 * f64::from(k);
            let (q, dq) = ((2.3 * t).sin(), 2.3 * (2.3 * t).cos());
            let noise: f64 = (0..12).map(|_| uniform()).sum();
            series.t.push(t);
            series.q.push(q);
            series.dq.push(dq);
            series.whole.push(true);
            series.residual.push(0.03 * noise + catches(q, dq));
        }
        series
    }

    /// The bursts of a joint of which nothing is in doubt.
    fn found(series: &JointSeries) -> Option<String> {
        let moments = bursts(series, &vec![0.0; series.residual.len()])?;
        moments.lasts.then_some(moments.words)
    }

    #[test]
    fn noise_has_no_bursts() {
        assert_eq!(found(&joint(|_, _| 0.0)), None);
    }

    #[test]
    fn what_is_in_doubt_is_no_burst() {
        let series = joint(|_, dq| if dq.abs() < 0.2 { 0.2 } else { 0.0 });
        // The noise is 0.03 N m, what is in doubt 0.2.
        let turns = series
            .dq
            .iter()
            .map(|dq| if dq.abs() < 0.2 { 6.7 } else { 0.0 });
        assert!(bursts(&series, &turns.collect::<Vec<_>>()).is_none());
    }

    #[test]
    fn readings_that_jump_are_alone_and_what_lasts_is_not() {
        let mut series = joint(|_, _| 0.0);
        let at = |k: usize| 37 * k + (k * k) % 11;
        for k in 0..50 {
            series.residual[at(k)] = if k % 2 == 0 { 0.5 } else { -0.5 };
        }
        let doubt = vec![0.0; series.residual.len()];
        let alone = bursts(&series, &doubt).unwrap();
        assert!(!alone.lasts && (0..50).all(|k| alone.windows.contains(&at(k))));
        for k in 0..50 {
            series.residual[at(k) + 1] = series.residual[at(k)];
        }
        assert!(found(&series).is_some());
    }

    #[test]
    fn bursts_are_found_where_they_are() {
        let reversals = found(&joint(|_, dq| if dq.abs() < 0.2 { 0.2 } else { 0.0 }));
        assert!(reversals.unwrap().contains("mostly at reversals"));
        let cable = found(&joint(
            |q, _| if (q - 0.4).abs() < 0.05 { 0.2 } else { 0.0 },
        ));
        assert!(cable.unwrap().contains("mostly near 0.4"));
    }
}

//! What a residual says of the model: where it fails, when, whether anything but noise is left, and how far it is
//! from the noise.
//!
//! All of it works on one joint's mean torque over windows ([`Series`]), and none of it takes neighbouring windows for
//! independent: on real logs they are not, and tests that believe so find patterns everywhere. [`criticise`] judges all
//! joints of a model at once, since the number of patterns looked for counts.
//!
//! Files beside:
//!
//! - `bins`: the residual binned by a variable
//! - `cluster`: regression whose errors survive autocorrelation
//! - `correlation`: is what is left noise? Autocorrelation of the residual, and its correlation with what drives the robot
//! - `episode`: when a model fails worst
//! - `explain`: real patterns, told apart and put into words
//! - `pattern`: which patterns of the residual are real
//! - `persistence`: what of a residual lasts: correlated over longer than noise remembers
//! - `scores`: how good a prediction is, in the numbers users know
//! - `series`: what is judged: one joint's windows in time
//! - `shape`: the patterns that have a name: what a residual looks like against one variable
//! - `text`: patterns in words: what they look like, never more

mod bins;
mod cluster;
mod correlation;
mod episode;
mod explain;
mod noise;
mod pattern;
mod persistence;
mod scores;
mod series;
mod shape;
#[cfg(test)]
mod tests;
mod text;

use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::Serialize;

pub use bins::Bin;
pub use correlation::{Correlation, DECIMATION, Independence, Input, LEVEL, Whiteness};
pub use episode::Episode;
pub use explain::Pattern;
pub use noise::{NoiseFloor, NoiseMethod};
pub use pattern::{FALSE_DISCOVERY, Where};
pub use persistence::Persistence;
pub use scores::Scores;
pub use series::Series;
pub use shape::{Changing, Shape, Variable};

use series::{Held, Runs};
use shape::Variables;

/// The noise floor is that of noise without a memory: a first-order one of 20 ms, a window's length, leaves up to 0.45 of its square above it.
const MEMORY_ABOVE: f64 = 2.0 / 3.0;

/// The noise of a residual of which a model explains all that is not noise; none for fewer than 100 windows.
pub(crate) fn noise_floor(series: &Series) -> Option<NoiseFloor> {
    noise::floor(series, &Runs::of(series.t))
}

/// What a joint's residual says of the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Criticism {
    /// Which joint.
    pub joint: String,
    /// How well its torque is predicted.
    pub scores: Scores,
    /// The error that no model can take away; none for fewer than 100 windows.
    pub noise: Option<NoiseFloor>,
    /// Share of the mean square of the residual that is judged above the noise floor, %. `compare` judges it without what smoothing lost of the motion; the
    /// share of the whole error is in `JointComparison`, and alone in JSON.
    #[serde(skip)]
    pub above_noise_percent: Option<f64>,
    /// Where the model fails: against each variable that the series has.
    pub everywhere: Vec<Where>,
    /// What is real in it, told apart and in words, strongest first.
    pub patterns: Vec<Pattern>,
    /// When it fails worst, worst first.
    pub episodes: Vec<Episode>,
    /// Whether what is left is white; none for too short a series.
    pub whiteness: Option<Whiteness>,
    /// What of it lasts longer than noise; none for too short a series.
    pub persistence: Option<Persistence>,
    /// Whether what is left is independent of what drives the joint.
    pub independence: Vec<Independence>,
}

impl Criticism {
    /// Share of the mean square that is no noise: what patterns explain, what follows what drives the joint, or what
    /// neighbours still have in common when noise has forgotten, whichever is most; where one of these is real, all that is above the
    /// noise floor, if that is more than a noise with a memory leaves above it. Zero if tests find nothing.
    pub fn structure(&self) -> f64 {
        let patterns: f64 = self.patterns.iter().map(|p| p.share).sum();
        let following = (self.independence.iter())
            .filter(|input| !input.independent)
            .map(Independence::share);
        let lasting = self.persistence.filter(|p| p.is_real()).map(|p| p.share);
        let told = following.chain(lasting).fold(patterns, f64::max).min(1.0);
        let above = self
            .above_noise_percent
            .map_or(0.0, |percent| 0.01 * percent);
        if told > 0.0 && above > MEMORY_ABOVE {
            above
        } else {
            told
        }
    }

    /// Its scores alone: where too little is left of the data to say more.
    pub(crate) fn scores_only(&self) -> Self {
        Self {
            joint: self.joint.clone(),
            scores: self.scores,
            noise: None,
            above_noise_percent: None,
            everywhere: Vec::new(),
            patterns: Vec::new(),
            episodes: Vec::new(),
            whiteness: None,
            persistence: None,
            independence: Vec::new(),
        }
    }

    /// Says where its patterns are, and no more what they look like.
    pub(crate) fn withhold_causes(&mut self) {
        for pattern in &mut self.patterns {
            pattern.sentence.clone_from(&pattern.observation);
        }
    }
}

/// Judges the residuals of all joints of a model.
///
/// # Panics
/// If the slices of a series differ in length.
pub fn criticise(joints: &[Series]) -> Vec<Criticism> {
    let thinned = in_parallel(joints, Held::thinned);
    let prepared: Vec<(&Series, Held)> = joints.iter().zip(thinned).collect();
    let prepared = in_parallel(&prepared, |(series, held)| {
        series.check();
        let series = held.series(series.joint);
        let runs = Runs::of(series.t);
        let variables = Variables::of(&series, &runs);
        let everywhere = pattern::everywhere(series.residual, &runs, &variables);
        (series, runs, variables, everywhere)
    });
    let mut everywhere: Vec<Vec<Where>> = prepared.iter().map(|(.., of)| of.clone()).collect();
    pattern::control(&mut everywhere);
    let numbers: Vec<usize> = (0..joints.len()).collect();
    in_parallel(&numbers, |&k| {
        let (series, runs, variables, _) = &prepared[k];
        let mut everywhere = everywhere[k].clone();
        let patterns = explain::explain(
            series.joint,
            series.residual,
            runs,
            variables,
            &mut everywhere,
        );
        judge(&joints[k], everywhere, patterns)
    })
}

/// `f` of each item, in their order, on all processors.
fn in_parallel<'a, T: Sync, R: Send>(items: &'a [T], f: impl Fn(&'a T) -> R + Sync) -> Vec<R> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(k) else {
                return done;
            };
            done.push((k, f(item)));
        }
    };
    let mut done: Vec<(usize, R)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads.min(items.len()))
            .map(|_| scope.spawn(work))
            .collect();
        let join = |thread: std::thread::ScopedJoinHandle<_>| {
            // A panic goes on.
            thread
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads.into_iter().flat_map(join).collect()
    });
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, result)| result).collect()
}

fn judge(series: &Series, everywhere: Vec<Where>, patterns: Vec<Pattern>) -> Criticism {
    let runs = Runs::of(series.t);
    let scores = Scores::of(series);
    let noise = series.noise.or_else(|| noise::floor(series, &runs));
    let above = |noise: NoiseFloor| {
        let share = (noise.rms / scores.rms.max(f64::MIN_POSITIVE)).powi(2);
        100.0 * (1.0 - share).max(0.0)
    };
    Criticism {
        joint: series.joint.to_owned(),
        scores,
        noise,
        above_noise_percent: noise.map(above),
        everywhere,
        patterns,
        episodes: episode::worst(series),
        whiteness: correlation::whiteness(series, &runs),
        persistence: persistence::persistence(series, &runs),
        independence: correlation::independence(series, &runs),
    }
}

/// Scores, noise floor, sentences, worst episodes and tests; the joint's name first.
impl fmt::Display for Criticism {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Scores { rms, bias, max, .. } = self.scores;
        write!(
            f,
            "{}: rms {rms:.4} N m, bias {bias:+.4}, max {max:.3}",
            self.joint
        )?;
        if let Some(fit) = self.scores.fit_percent {
            write!(f, ", fit {fit:.1} %")?;
        }
        if let (Some(noise), Some(above)) = (self.noise, self.above_noise_percent) {
            write!(f, "; {noise}; {above:.0} % of the square error is above it")?;
        }
        writeln!(f)?;
        for pattern in &self.patterns {
            writeln!(f, "  {}", pattern.sentence)?;
        }
        for episode in &self.episodes {
            writeln!(f, "  {episode}")?;
        }
        let dependent: Vec<String> = self
            .independence
            .iter()
            .filter(|i| !i.independent)
            .map(|i| format!("{:?}", i.input).to_lowercase())
            .collect();
        match &self.whiteness {
            Some(whiteness) if whiteness.white => write!(f, "  The residual is white")?,
            Some(_) => write!(f, "  The residual is not white")?,
            None => write!(f, "  Too short to test whether the residual is white")?,
        }
        if dependent.is_empty() {
            writeln!(f, ", and independent of the motion.")
        } else {
            writeln!(f, ", and depends on {}.", dependent.join(", "))
        }
    }
}

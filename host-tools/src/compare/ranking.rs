//! What matters most over all joints: where the error is, and when it is worst.

use std::path::PathBuf;

use serde::Serialize;

use crate::detect::residual::{Criticism, Episode};

/// A pattern of the error, by its share of all of it.
#[derive(Debug, Clone, Serialize)]
pub struct RankedPattern {
    /// Which joint.
    pub joint: String,
    /// Its share of the sum of squared errors over all joints, %.
    pub share_percent: f64,
    /// What it looks like, in words.
    pub sentence: String,
}

/// A moment at which the error is large.
#[derive(Debug, Clone, Serialize)]
pub struct RankedEpisode {
    /// Which joint.
    pub joint: String,
    /// In which log.
    pub log: PathBuf,
    /// When since that log's start, s.
    pub since_start: f64,
    /// What happened; its `t` is the recording's.
    #[serde(flatten)]
    pub episode: Episode,
}

/// All patterns, the largest share of the whole square error first.
pub(super) fn patterns(criticism: &[Criticism]) -> Vec<RankedPattern> {
    let square = |c: &Criticism| c.scores.rms.powi(2) * c.scores.n as f64;
    let all: f64 = criticism.iter().map(square).sum();
    let mut ranked: Vec<RankedPattern> = criticism
        .iter()
        .flat_map(|c| c.patterns.iter().map(move |pattern| (c, pattern)))
        .map(|(c, pattern)| RankedPattern {
            joint: c.joint.clone(),
            share_percent: 100.0 * pattern.share * square(c) / all.max(f64::MIN_POSITIVE),
            sentence: pattern.sentence.clone(),
        })
        .collect();
    ranked.sort_by(|a, b| b.share_percent.total_cmp(&a.share_percent));
    ranked
}

/// All episodes, the least usual for its joint first; `moment` tells of a time in which log it is, and when since that log's start.
pub(super) fn episodes<'a>(
    criticism: &[Criticism],
    moment: impl Fn(f64) -> (&'a PathBuf, f64),
) -> Vec<RankedEpisode> {
    let mut ranked: Vec<RankedEpisode> = criticism
        .iter()
        .flat_map(|c| c.episodes.iter().map(move |episode| (c, episode)))
        .map(|(c, episode)| {
            let (log, since_start) = moment(episode.t);
            RankedEpisode {
                joint: c.joint.clone(),
                log: log.clone(),
                since_start,
                episode: *episode,
            }
        })
        .collect();
    ranked.sort_by(|a, b| b.episode.size.total_cmp(&a.episode.size));
    ranked
}

//! A comparison for humans.

use std::fmt::{self, Write};

use super::{Comparison, JointComparison, RankedEpisode, black_box};
use crate::detect::residual::Criticism;
use crate::parameter::told;
use crate::robust;
use crate::select::criteria::STRUCTURE;
use crate::summary::torque;
use crate::table::Table;

/// Patterns and episodes told unless all are asked for.
const TOLD: usize = 5;
/// Of a residual in which no test finds anything.
pub(super) const NO_STRUCTURE: &str = "The residual has no structure above the noise: it follows no position, velocity, acceleration, load, temperature or time";
/// Share of the square error above the noise from which on a model is worth a diagnosis, %.
pub(super) const WORTH_A_DIAGNOSIS: f64 = 100.0 * STRUCTURE;
/// A joint of whose squared error patterns explain less is not explained.
const EXPLAINED: f64 = 0.5;
/// A joint with so much of all joints' squared error is worth a sentence though no pattern explains it, %.
const OUTSTANDING_PERCENT: f64 = 20.0;
/// So many times the median joint's error stands out where a log is too short for the tests: normal noise of twelve joints alike is within 1.5 of their
/// median, and motors of one robot differ by less in size.
const STANDS_OUT: f64 = 4.0;

impl Comparison {
    /// The comparison in words: the data first, then how well, where and when. `all` tells every pattern and episode.
    pub fn text(&self, all: bool) -> String {
        let mut text = crate::recording::gate_words(&self.data);
        // Writing to a string never fails.
        let _ = self.write_contact(&mut text);
        let _ = self.write_scores(&mut text);
        let _ = self.write_black_box(&mut text);
        let _ = self.write_where(&mut text, all);
        let _ = self.write_when(&mut text, all);
        text
    }

    /// One line: how large the error is, and how large it was.
    pub fn headline(&self) -> String {
        let mut text = match self.before_rms {
            Some(before) => format!(
                "{}: rms {before:.4} → {:.4} N m ({:+.0} %)",
                self.changed(),
                self.rms,
                100.0 * (self.rms / before - 1.0)
            ),
            None => format!("rms {:.4} N m", self.rms),
        };
        let _ = write!(
            text,
            "; {:.4} with the CAD alone, {:.4} with nothing",
            self.yardsticks.cad_rms, self.yardsticks.zero_rms
        );
        let _ = write!(text, "; {}", self.yardsticks.floor_words(self.rms));
        if let Some(above) = self.above_noise_percent {
            let _ = write!(text, ": {above:.0} % of the square error is above it");
        }
        text
    }

    /// What was added and left out.
    fn changed(&self) -> String {
        let part = |places: &[String], word: &str| {
            (!places.is_empty()).then(|| format!("{} {word}", grouped(places)))
        };
        let parts = [part(&self.added, "added"), part(&self.left_out, "left out")];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        parts.join(", ")
    }

    /// What was left out, foot by foot, and what that means for the rest.
    fn write_contact(&self, to: &mut String) -> fmt::Result {
        for sentence in self.contact_sentences() {
            writeln!(to, "{sentence}")?;
        }
        if self.contact.is_empty() {
            return Ok(());
        }
        writeln!(to)
    }

    /// The forces at feet, a sentence each, and why no cause is told of what is left.
    pub fn contact_sentences(&self) -> Vec<String> {
        let mut sentences: Vec<String> = (self.contact.iter())
            .map(|foot| format!("Contact: {foot}."))
            .collect();
        if sentences.len() > 1 {
            sentences.push(
                "Contact: more than one leg carries a force, so the base moves, and other feet may carry an undetected one; \
                 the residual is reported by place, not by cause."
                    .to_owned(),
            );
        }
        sentences
    }

    /// `spring:FR_thigh = 4.02 ±0.01 N m/rad`, of the effects that were added last.
    fn write_added(&self, to: &mut String) -> fmt::Result {
        if self.added.len() > TOLD {
            return Ok(());
        }
        let is_added = |name: &str| {
            self.added
                .iter()
                .any(|added| name.ends_with(added.as_str()))
        };
        for effect in self.effects.iter().filter(|effect| is_added(&effect.name)) {
            let Some(value) = effect.value else { continue };
            let [value, unit] = match effect.std {
                Some(std) => told(value, std, effect.unit),
                None => [format!("{value:.4}"), effect.unit.to_owned()],
            };
            writeln!(to, "  {} = {value} {unit}", effect.name)?;
        }
        Ok(())
    }

    fn write_scores(&self, to: &mut String) -> fmt::Result {
        let mut table = Table::default();
        let before = self.before_rms.is_some();
        let heads = [
            "joint", "rms", "fit %", "VAF %", "bias", "max", "floor", "above %", "zero", "CAD",
        ];
        let heads = heads.into_iter().chain(before.then_some("before"));
        table.row(heads.chain(["residual"]).map(str::to_owned));
        for joint in &self.joints {
            table.row(cells(joint, before));
        }
        table.row(self.last_row(before));
        write!(to, "{table}")?;
        let values = if self.fitted {
            "Parameters are fitted within their priors to every stretch of time but the one predicted"
        } else {
            "Parameters are the model file's"
        };
        writeln!(
            to,
            "N m, mean torque over windows of 20 ms in which the joint moves; floor: the noise; above %: the share of the \
             square error above it.\n{values}.\n\n{}.",
            self.headline()
        )?;
        self.write_added(to)
    }

    /// How far a black box would come, and what that says of what is missing.
    fn write_black_box(&self, to: &mut String) -> fmt::Result {
        let Some(boxes) = self.black_box.as_ref().filter(|boxes| boxes.is_known()) else {
            return Ok(());
        };
        let noise = self.yardsticks.floor_beside(boxes.lowest());
        let noise = noise.map(|x| floor(x, self.yardsticks.noise_floor_is_upper_bound));
        let table = black_box::table(boxes, noise);
        write!(to, "\n{table}{}.\n", black_box::sentence(boxes))
    }

    fn last_row(&self, before: bool) -> Vec<String> {
        let blank = || String::new();
        let mut cells = vec!["all".to_owned(), rms(self.rms)];
        cells.extend([blank(), blank(), blank(), blank()]);
        let upper_bound = self.yardsticks.noise_floor_is_upper_bound;
        cells.push(
            self.yardsticks
                .floor_beside(self.rms)
                .map_or_else(blank, |x| floor(x, upper_bound)),
        );
        cells.push(self.above_noise_percent.map_or_else(blank, whole));
        cells.extend([rms(self.yardsticks.zero_rms), rms(self.yardsticks.cad_rms)]);
        if before {
            cells.push(self.before_rms.map_or_else(blank, rms));
        }
        cells
    }

    /// Joints with much of the error that no pattern explains, a sentence each: those whose residual is structured, well above the joint's noise floor, or
    /// far larger than other joints'. Each with its share of all joints' squared error, %.
    pub(super) fn unexplained(&self) -> Vec<(f64, String)> {
        let square = |c: &Criticism| c.scores.rms.powi(2) * c.scores.n as f64;
        let all: f64 = self.criticism.iter().map(square).sum();
        // Why one is told, by the residual without what smoothing lost, as everything that tells where a model fails. Noise may have a memory: that a
        // residual is not white counts only where no noise floor is known.
        let why = |c: &Criticism| {
            let others = self.criticism.iter().filter(|o| o.joint != c.joint);
            let usual = robust::median(others.map(|o| o.scores.rms)).unwrap_or(f64::INFINITY);
            let white = c.whiteness.as_ref().is_none_or(|w| w.white);
            match (c.structure(), c.above_noise_percent) {
                (structure, _) if structure > EXPLAINED => {
                    Some(format!("{:.0} % of it is structure", 100.0 * structure))
                }
                (_, Some(above)) if above > WORTH_A_DIAGNOSIS => {
                    Some(format!("{above:.0} % of it is above the noise floor"))
                }
                (_, None) if !white => Some("its residual is not white".to_owned()),
                _ => (c.scores.rms > STANDS_OUT * usual)
                    .then(|| "far more than the other joints leave".to_owned()),
            }
        };
        let told = |c: &Criticism| {
            let explained: f64 = c.patterns.iter().map(|pattern| pattern.share).sum();
            let outstanding = 100.0 * square(c) >= OUTSTANDING_PERCENT * all;
            let why = why(c).filter(|_| explained < EXPLAINED && outstanding)?;
            let share = 100.0 * square(c) / all.max(f64::MIN_POSITIVE);
            let words = format!(
                "{share:.0} % of the square error: {}, {} N m rms: {why}, and no simple pattern explains it",
                c.joint,
                torque(c.scores.rms)
            );
            Some((share, words))
        };
        self.criticism.iter().filter_map(told).collect()
    }

    fn write_where(&self, to: &mut String, all: bool) -> fmt::Result {
        let unexplained = self.unexplained();
        if self.patterns.is_empty() && unexplained.is_empty() {
            return writeln!(to, "\nWhere: {NO_STRUCTURE}.");
        }
        writeln!(to, "\nWhere, by its share of all the square error:")?;
        for (_, sentence) in unexplained {
            writeln!(to, "  {sentence}")?;
        }
        let told = if all { self.patterns.len() } else { TOLD };
        for pattern in self.patterns.iter().take(told) {
            writeln!(to, "{:>5.1} %  {}", pattern.share_percent, pattern.sentence)?;
        }
        more(to, self.patterns.len(), told)?;
        for regime in &self.regimes {
            writeln!(to, "  {}: {}", regime.joint, regime.words_with_conditions())?;
        }
        Ok(())
    }

    fn write_when(&self, to: &mut String, all: bool) -> fmt::Result {
        if self.episodes.is_empty() {
            return Ok(());
        }
        writeln!(to, "\nWhen, by its size against the joint's typical error:")?;
        let told = if all { self.episodes.len() } else { TOLD };
        for episode in self.episodes.iter().take(told) {
            let log = if self.data.len() > 1 {
                format!("{} ", episode.log.display())
            } else {
                String::new()
            };
            writeln!(to, "{:>4.1} ×  {log}{episode}", episode.episode.size)?;
        }
        more(to, self.episodes.len(), told)
    }
}

/// Places by effect: `spring:FR_thigh`, but `viscous (12 joints)`.
pub(super) fn grouped(places: &[String]) -> String {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for place in places {
        let (effect, joint) = place.split_once(':').unwrap_or((place, ""));
        match groups.iter_mut().find(|(known, _)| *known == effect) {
            Some((_, joints)) => joints.push(joint),
            None => groups.push((effect, vec![joint])),
        }
    }
    let words = groups
        .into_iter()
        .map(|(effect, joints)| match joints.as_slice() {
            [_] | [_, _] | [_, _, _] => format!("{effect}:{}", joints.join(",")),
            more => format!("{effect} ({} joints)", more.len()),
        });
    words.collect::<Vec<_>>().join(", ")
}

/// Effects, a few of them: `spring:FR_thigh`, `viscous, coulomb, armature and 2 more effects`.
pub(super) fn named(places: &[String]) -> String {
    const NAMED: usize = 4;
    if places.len() <= NAMED {
        return grouped(places);
    }
    let mut effects: Vec<&str> = Vec::new();
    for place in places {
        let effect = place.split(':').next().unwrap_or(place);
        if !effects.contains(&effect) {
            effects.push(effect);
        }
    }
    let first = effects.iter().take(NAMED).copied().collect::<Vec<_>>();
    match effects.len().saturating_sub(NAMED) {
        0 => first.join(", "),
        1 => format!("{} and one more effect", first.join(", ")),
        n => format!("{} and {n} more effects", first.join(", ")),
    }
}

/// What is not told.
fn more(to: &mut String, count: usize, told: usize) -> fmt::Result {
    match count.saturating_sub(told) {
        0 => Ok(()),
        rest => writeln!(to, "         and {rest} more (--all)"),
    }
}

fn rms(x: f64) -> String {
    format!("{x:.3}")
}

fn floor(x: f64, upper_bound: bool) -> String {
    let sign = if upper_bound { "≤" } else { "" };
    format!("{sign}{x:.3}")
}

fn whole(x: f64) -> String {
    format!("{x:.0}")
}

fn cells(joint: &JointComparison, before: bool) -> Vec<String> {
    let percent = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.1}"));
    let mut cells = vec![
        joint.joint.clone(),
        rms(joint.scores.rms),
        percent(joint.scores.fit_percent),
        percent(joint.scores.vaf_percent),
        format!("{:+.3}", joint.scores.bias),
        rms(joint.scores.max),
        joint
            .yardsticks
            .floor_beside(joint.scores.rms)
            .map_or("-".to_owned(), |x| {
                floor(x, joint.yardsticks.noise_floor_is_upper_bound)
            }),
        joint.above_noise_percent.map_or("-".to_owned(), whole),
        rms(joint.yardsticks.zero_rms),
        rms(joint.yardsticks.cad_rms),
    ];
    if before {
        cells.push(joint.before_rms.map_or("-".to_owned(), rms));
    }
    cells.push(left(joint));
    cells
}

/// `white`, or what the residual still depends on.
fn left(joint: &JointComparison) -> String {
    let depends: Vec<&str> = joint
        .depends_on
        .iter()
        .map(|input| input.symbol())
        .collect();
    let depends = depends.join(" ");
    match (joint.white, depends.is_empty()) {
        (None, true) => "too short to tell".to_owned(),
        (Some(true), true) => "noise".to_owned(),
        (Some(false), true) => "not white".to_owned(),
        (Some(false), false) => format!("not white; {depends}"),
        (_, false) => depends,
    }
}

impl fmt::Display for RankedEpisode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let e = &self.episode;
        write!(
            f,
            "t = {:.2} s: {} {:+.3} N m (q = {:.2} rad, q̇ = {:.2} rad/s, τ = {:.2} N m)",
            self.since_start, self.joint, e.residual, e.q, e.dq, e.tau
        )
    }
}

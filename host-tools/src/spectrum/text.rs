//! The first screen of `frf`, and all values.

use std::path::Path;

use super::result::{Estimated, Frf, FrfValue, LinkCheck, Mode};
use crate::model::{JointQuantity, LINK_ELASTICITY};
use crate::robust::median;
use crate::summary::{Summary, ValueLine, short, typed, value_lines};

/// A value ± its standard deviation, whose first two digits say how many the value has.
fn with_std(of: Estimated) -> String {
    if of.std <= 0.0 || !of.std.is_finite() {
        return short(of.value);
    }
    let digits = 1 - of.std.log10().floor() as i32;
    if (-4..=6).contains(&digits) && of.value.abs() < 1e7 {
        let digits = digits.max(0) as usize;
        format!("{:.digits$} ± {:.digits$}", of.value, of.std)
    } else {
        format!("{:.3e} ± {:.1e}", of.value, of.std)
    }
}

impl Frf {
    /// What matters most; `done`: the model file has the values, or the files of responses and page are written.
    pub fn summary(&self, model: Option<&Path>, done: bool) -> Summary {
        let error = self.error();
        let headline = match (error.before, error.after) {
            (Some(before), Some(after)) => {
                let steps = match self.springs_alone.filter(|_| self.has_bends()) {
                    Some(springs) => format!("{before:.3} → {springs:.3} → {after:.3}"),
                    None => format!("{before:.3} → {after:.3}"),
                };
                let what = match self.has_bends() {
                    true => "Springs, bending links",
                    false => "Springs",
                };
                format!(
                    "{what}: held-out error {steps} log magnitude (floor {:.3})",
                    error.floor.unwrap_or(f64::NAN)
                )
            }
            _ => format!(
                "Frequency responses of {} at {}",
                self.joints.join(", "),
                counted_points(self.points.len())
            ),
        };
        let mut points = Vec::new();
        if self.joints.len() == 1 {
            points.extend(self.modes.iter().map(mode_in_words));
        } else if !self.modes.is_empty() {
            let springs = self
                .parameters
                .iter()
                .filter(|value| value.name.starts_with("1/k"));
            points.push(
                springs
                    .map(|k| self.spring_in_words(k))
                    .collect::<Vec<_>>()
                    .join("; "),
            );
        }
        points.extend(self.bends_in_words());
        points.push(self.measurement_in_words());
        points.extend(self.links.iter().map(link_in_words));
        points.truncate(3);
        let logs = typed(&self.logs, model);
        let next = if done {
            model.map(|_| format!("proprio compare {logs}"))
        } else if model.is_some() && self.error().after.is_some() {
            let few = self
                .few
                .map_or_else(String::new, |n| format!(" --experiments {n}"));
            Some(format!("proprio frf {logs}{few} --apply"))
        } else if model.is_none() && self.joints.len() > 1 {
            // Springs of several joints need the links' masses.
            Some(format!("proprio frf {logs} -m MODEL"))
        } else {
            let stem = self
                .logs
                .first()
                .map_or_else(|| "frf".into(), |log| super::result::file_name(log));
            let stem = stem.split('.').next().unwrap_or("frf").to_owned();
            Some(format!(
                "proprio frf {logs} --html {stem}.html -o {stem}_frf.csv"
            ))
        };
        Summary {
            headline,
            points,
            next: next.into_iter().collect(),
            ..Summary::default()
        }
    }

    fn spring_in_words(&self, compliance: &FrfValue) -> String {
        let joint = compliance.name.rsplit(':').next().unwrap_or_default();
        let damping = format!("d:elasticity:{joint}");
        format!("{joint} {}", self.stiffness_in_words(compliance, &damping))
    }

    /// `k 4012 ± 15, d 3.91 ± 0.04` of a compliance and the value that damps it.
    fn stiffness_in_words(&self, compliance: &FrfValue, damping: &str) -> String {
        let d = self.parameters.iter().find(|value| value.name == damping);
        let k = 1.0 / compliance.value;
        let k = Estimated {
            value: k,
            std: compliance.std * k * k,
        };
        let d = d.map_or_else(String::new, |d| {
            let d = Estimated {
                value: d.value,
                std: d.std,
            };
            format!(", d {}", with_std(d))
        });
        format!("k {}{d}", with_std(k))
    }

    /// The fit's bends: at which joint, about which axis, how stiff.
    fn bends_in_words(&self) -> Option<String> {
        let of = |value: &FrfValue| {
            let (axis, place) = value.name.split_once(':')?;
            let joint = place.strip_prefix(LINK_ELASTICITY)?.strip_prefix(':')?;
            let is_stiffness = JointQuantity::ALL.iter().any(|q| q.key() == axis);
            let damping = format!("{axis}_d:{place}");
            let stiffness = || self.stiffness_in_words(value, &damping);
            is_stiffness.then(|| format!("{joint} {axis} {}", stiffness()))
        };
        let all: Vec<String> = self.parameters.iter().filter_map(of).collect();
        (!all.is_empty()).then(|| format!("Links bend: {}", all.join("; ")))
    }

    fn measurement_in_words(&self) -> String {
        let noise = median(self.points.iter().map(|p| p.noise)).unwrap_or_default();
        let scatter: Vec<f64> = self.points.iter().filter_map(|p| p.scatter).collect();
        let distortion = if scatter.is_empty() {
            String::new()
        } else {
            format!(
                ", noise and distortion {:.2} %",
                100.0 * median(scatter).unwrap_or_default()
            )
        };
        format!(
            "{} lines, {:.1}–{:.1} Hz, {}; noise {:.2} %{distortion} of a response",
            self.lines,
            self.band[0],
            self.band[1],
            counted_points(self.points.len()),
            100.0 * noise
        )
    }

    /// Every value and point.
    pub fn details(&self) -> String {
        let values = self.parameters.iter().map(|value| ValueLine {
            name: &value.name,
            value: value.value,
            std: value.std,
            status: value.status,
            unit: &value.unit,
        });
        let mut out = value_lines(values, &self.witnesses);
        if !self.candidates.is_empty() {
            out += "\nbend judged           held-out error      z\n";
        }
        for own in &self.candidates {
            let place = format!("{} {}", own.joint, own.axis);
            let taken = if own.taken { "  taken" } else { "" };
            out += &format!("{place:<20} {:>15.4} {:>6.1}{taken}\n", own.error, own.z);
        }
        out += "\npoint  blocks  periods  noise %  scatter %  even %   odd %  mean position\n";
        let percent =
            |x: Option<f64>| x.map_or_else(|| "–".to_owned(), |x| format!("{:.2}", 100.0 * x));
        for (n, point) in self.points.iter().enumerate() {
            let q: Vec<String> = point.q.iter().map(|q| format!("{q:.3}")).collect();
            out += &format!(
                "{:>5} {:>7} {:>8} {:>8.2} {:>10} {:>7} {:>7}  {}\n",
                n + 1,
                point.blocks,
                point.periods,
                100.0 * point.noise,
                percent(point.scatter),
                percent(point.even_distortion),
                percent(point.odd_distortion),
                q.join(" ")
            );
        }
        out
    }
}

fn counted_points(count: usize) -> String {
    if count == 1 {
        "1 point".to_owned()
    } else {
        format!("{count} points")
    }
}

fn mode_in_words(mode: &Mode) -> String {
    format!(
        "{}: antiresonance {} Hz, resonance {} Hz, link's over motor's inertia {}",
        mode.joint,
        with_std(mode.antiresonance),
        with_std(mode.resonance),
        with_std(mode.inertia_ratio)
    )
}

fn link_in_words(check: &LinkCheck) -> String {
    format!(
        "{}: the link's encoder, which the fit has not used, moves {:.3} times as predicted; rms {:.3} log magnitude at {} lines{}",
        check.joint,
        check.gain,
        check.rms,
        check.lines,
        if check.reversed {
            "; it counts the other way"
        } else {
            ""
        }
    )
}

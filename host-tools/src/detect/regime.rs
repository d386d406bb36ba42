//! Where an error lives: beyond an angle, above a speed, from a moment on.
//!
//! Windows are cut in two by a range of a variable, and what the model's own columns at the joint can take is fitted to each part alone: bodies and friction
//! outside are unbiased by what happens inside. The range is that under which the residuals of both parts are likeliest, each normal with its part's energy;
//! values that are others inside, and edges, have their price (a change of structure: Andrews 1993, *Econometrica* 61:821; of the energy: Inclán & Tiao 1994,
//! *J. Am. Stat. Assoc.* 89:913). It counts if the fit of the outside fails inside, and if no law that is smooth in the variable does as well. An edge's standard
//! deviation is how far it may move before that likelihood has fallen by that of one; neighbours in time that say the same count once.
//!
//! - `search`: the range of a variable that parts a residual into one that is noise and one that is not

mod search;

use serde::Serialize;

use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::estimate::shapes::orthonormal;
use crate::table::with_std;
use search::Residual;

/// Windows that are looked at, spread over the log.
const MOST_WINDOWS: usize = 1000;
/// How far to each side of a moment the motion is looked at that a change at that moment may stand for, s: a sweep's frequency is its time.
const ENVELOPE: f64 = 1.0;

/// What a range is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RegimeOf {
    /// The joint's position, rad; m where it slides.
    Position,
    /// The magnitude of its velocity, rad/s.
    Speed,
    /// The sign of its velocity.
    Direction,
    /// The magnitude of the torque that the model predicts, N m.
    Load,
    /// The motor's temperature, °C.
    Temperature,
    /// Time since the log's start, s.
    Time,
}

/// An edge of a range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Edge {
    /// Where.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// A range of a variable in which a joint's error lives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Regime {
    /// Which joint.
    pub joint: String,
    /// Which variable.
    pub variable: RegimeOf,
    /// Its unit.
    pub unit: &'static str,
    /// From where on; none from the least value on.
    pub from: Option<Edge>,
    /// Up to where; none up to the greatest.
    pub to: Option<Edge>,
    /// Whether the model fits on both sides, with other values: then these data do not show which side is at fault.
    pub change: bool,
    /// Conditions for `--only` under which that part is judged alone; none for what no condition asks.
    pub only: Vec<String>,
}

impl Regime {
    /// Of a joint.
    pub(crate) fn new(
        joint: &str,
        (variable, slides): (RegimeOf, bool),
        ([from, to], change): ([Option<Edge>; 2], bool),
    ) -> Self {
        let unit = match (variable, slides) {
            (RegimeOf::Position, false) => "rad",
            (RegimeOf::Position, true) => "m",
            (RegimeOf::Speed | RegimeOf::Direction, false) => "rad/s",
            (RegimeOf::Speed | RegimeOf::Direction, true) => "m/s",
            (RegimeOf::Load, false) => "N m",
            (RegimeOf::Load, true) => "N",
            (RegimeOf::Temperature, _) => "°C",
            (RegimeOf::Time, _) => "s",
        };
        // Without blanks: on a screen no line ends within.
        let asked = match variable {
            RegimeOf::Position => Some(format!("{joint}:q")),
            RegimeOf::Speed => Some(format!("{joint}:abs(dq)")),
            RegimeOf::Direction => Some(format!("{joint}:dq")),
            RegimeOf::Temperature => Some(format!("{joint}:temp")),
            RegimeOf::Time => Some("t".to_owned()),
            // A condition is of what is known before any model is fitted.
            RegimeOf::Load => None,
        };
        let side = |sign: &'static str, edge: Option<Edge>| {
            let (asked, edge) = asked.as_ref().zip(edge)?;
            Some(format!("{asked}{sign}{}", rounded(edge)))
        };
        Self {
            joint: joint.to_owned(),
            variable,
            unit,
            change,
            only: [side(">", from), side("<", to)]
                .into_iter()
                .flatten()
                .collect(),
            from,
            to,
        }
    }

    /// `only beyond 1.204 ±0.011 rad`.
    pub fn words(&self) -> String {
        let unit = self.unit;
        let number = |edge: Edge| with_std(edge.value, edge.std);
        let of = match self.variable {
            RegimeOf::Speed => " of speed",
            RegimeOf::Load => " of load",
            _ => "",
        };
        let only = if self.change { "another" } else { "only" };
        match (self.variable, self.from, self.to) {
            (RegimeOf::Direction, Some(_), _) => format!("{only} in the positive direction"),
            (RegimeOf::Direction, ..) => format!("{only} in the negative direction"),
            (RegimeOf::Time, Some(from), None) => format!("from {} {unit} on", number(from)),
            (RegimeOf::Time, None, Some(to)) => format!("until {} {unit}", number(to)),
            (RegimeOf::Position, Some(from), None) => {
                format!("{only} beyond {} {unit}", number(from))
            }
            (_, Some(from), None) => format!("{only} above {} {unit}{of}", number(from)),
            (_, None, Some(to)) => format!("{only} below {} {unit}{of}", number(to)),
            (_, Some(from), Some(to)) => {
                format!(
                    "{only} between {} and {} {unit}{of}",
                    number(from),
                    number(to)
                )
            }
            (_, None, None) => String::new(),
        }
    }

    /// The same with the conditions that judge that part: ``(`--only 'FR_calf:q>1.20'`)``.
    pub fn words_with_conditions(&self) -> String {
        let conditions: Vec<String> = (self.only.iter())
            .map(|text| format!("--only '{text}'"))
            .collect();
        match conditions.as_slice() {
            [] => self.words(),
            all => format!("{} (`{}`)", self.words(), all.join(" ")),
        }
    }
}

/// An edge in as many digits as it is sure of.
fn rounded(edge: Edge) -> String {
    let text = with_std(edge.value, edge.std);
    let value = text.split(' ').next().unwrap_or_default();
    // Not "-0".
    match value.parse::<f64>() {
        Ok(0.0) => "0".to_owned(),
        _ => value.to_owned(),
    }
}

/// Where a joint's error lives of what a model with these values leaves of it; `noise` is the joint's noise floor, N m, where it is known. None where that is
/// everywhere, or where several variables explain it alike.
pub(crate) fn of(
    data: &LimbData,
    values: &Values,
    predicted: &[f64],
    (joint, noise): (usize, Option<f64>),
) -> Option<Regime> {
    let n = data.joints();
    let counting: Vec<usize> = (0..data.motion.windows.len())
        .filter(|&w| data.counts(w, joint))
        .collect();
    let stride = counting.len().div_ceil(MOST_WINDOWS).max(1);
    let windows: Vec<usize> = counting.into_iter().step_by(stride).collect();
    let places: Vec<_> = values.places().collect();
    let columns = data.columns(values, &places, &[]);
    let rows = data.rows(values, &columns);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in 0..columns.of_joint[joint].len() {
        let column = windows.iter().map(|&w| rows.row(w, joint)[column]);
        basis.extend(orthonormal(column.collect(), &basis));
    }
    let at = |w: usize| w * n + joint;
    let left = (windows.iter()).map(|&w| data.torque[at(w)] - predicted[at(w)]);
    let mean = |w: usize, k: usize| {
        let state = &data.motion.joint[joint].state;
        data.motion
            .mean(&data.motion.windows[w], |sample| state[sample][k])
    };
    let each = |of: &dyn Fn(usize) -> f64| windows.iter().map(|&w| of(w)).collect::<Vec<f64>>();
    let temperature = |w: usize| {
        (data.motion).mean(&data.motion.windows[w], |k| {
            data.motion.temperature[k * n + joint]
        })
    };
    let (t, dq) = (each(&|w| data.motion.windows[w].t), each(&|w| mean(w, 1)));
    let fast = |w: usize| {
        let [first, last] = data.motion.windows[w].samples;
        let state = &data.motion.joint[joint].state;
        (state[last][1] - state[first][1]) / data.motion.windows[w].length
    };
    let mut variables = vec![
        (Some(RegimeOf::Position), each(&|w| mean(w, 0))),
        (
            Some(RegimeOf::Speed),
            dq.iter().map(|dq| dq.abs()).collect(),
        ),
        (Some(RegimeOf::Load), each(&|w| predicted[at(w)].abs())),
        (Some(RegimeOf::Temperature), each(&temperature)),
        (None, envelope(&t, &dq)),
        (None, envelope(&t, &each(&fast))),
        (Some(RegimeOf::Direction), dq),
    ];
    // Of several logs each has its own time.
    if data.recording.log_starts.len() <= 1 {
        variables.push((Some(RegimeOf::Time), t));
    }
    let residual = Residual::new(left.collect(), &basis, data.motion.joint[joint].rest);
    let found = residual.find(&variables, noise.map(|noise| noise * noise))?;
    let name = data.joint_names().swap_remove(joint);
    let of = (found.variable, data.slides(joint));
    Some(Regime::new(&name, of, (found.edges, found.change)))
}

/// Mean square of `x` about each of the ascending times.
fn envelope(t: &[f64], x: &[f64]) -> Vec<f64> {
    let (mut from, mut to, mut sum) = (0, 0, 0.0);
    let at = |&now: &f64| {
        while to < t.len() && t[to] <= now + ENVELOPE {
            sum += x[to] * x[to];
            to += 1;
        }
        while t[from] < now - ENVELOPE {
            sum -= x[from] * x[from];
            from += 1;
        }
        sum / (to - from) as f64
    };
    t.iter().map(at).collect()
}

#[cfg(test)]
mod tests;

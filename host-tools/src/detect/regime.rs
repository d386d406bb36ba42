//! Where an error lives: beyond an angle, above a speed, from a moment on.
//!
//! Windows are cut in two by a range of a variable, and what the model's own columns at the joint can take is fitted to each part alone: bodies and friction
//! outside are unbiased by what happens inside. The range is that under which the residuals of both parts are likeliest, each normal with its part's energy;
//! values that are others inside, and edges, have their price (a change of structure: Andrews 1993, *Econometrica* 61:821; of the energy: Inclán & Tiao 1994,
//! *J. Am. Stat. Assoc.* 89:913). It counts if the fit of the outside fails inside, and if no law that is smooth in the variable does as well. An edge's standard
//! deviation is how far it may move before that likelihood has fallen by that of one; neighbours in time that say the same count once.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::equation::dot::dot;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::estimate::shapes::orthonormal;
use crate::robust;
use crate::select::criteria::statistics::autocorrelation_time;
use crate::table::with_std;

/// Windows that are looked at, spread over the log.
const MOST_WINDOWS: usize = 1000;
/// Fewer tell no range.
const LEAST_WINDOWS: usize = 200;
/// Parts of equally many windows whose borders are tried first; then each window between the neighbours of the best ones.
const PARTS: usize = 16;
/// Rounds in which both edges are moved, one beside the other.
const ROUNDS: usize = 3;
/// What a window of the other part counts in the fit of one: enough that columns which only such windows tell stay finite.
const BESIDE: f64 = 1e-6;
/// The windows outside are at least this share of all: of fewer the model's columns explain anything.
const LEAST_OUTSIDE: f64 = 0.2;
/// A range has at least this share of the windows: of fewer, a few knocks are one.
const LEAST_INSIDE: f64 = 0.02;
/// The mean square inside, by the fit of the outside, is so many times that outside: noise differs by less between slow and fast motion.
const LOUDER: f64 = 2.0;
/// Inside is at least this share of the squared error: what lives elsewhere too has no range.
const LEAST_SHARE: f64 = 0.5;
/// Outside, the usual square is at most so many times that of the joint's noise floor, which is known to 10 % and is of noise without a memory: more is an
/// error that lives there too.
const AT_FLOOR: f64 = 2.0;
/// This share of the windows beside an edge is neither inside nor out: the joint travels on while a window lasts, and an edge is cut in two.
const EDGE: f64 = 0.05;
/// Price of an edge: its place among n windows and the energy beside it, each ½ ln n of the log-likelihood (Rissanen 1978, Automatica 14:465), twice that
/// for the deviance used here.
const PRICE_OF_EDGE: f64 = 2.0;
/// By so much of the deviance, prices paid, a range has to be better than none, than a smooth law, and than the next variable's: 8 · 10⁻⁶ of a normal
/// variable's draws are as large, and of some thousand ranges the largest one of 10⁻².
const SURE: f64 = 20.0;
/// Degree of the smooth law that a range has to beat: a polynomial of the variable, with the direction and without, beside columns whose values go with the
/// variable. What that explains begins and ends nowhere.
const DEGREE: i32 = 3;
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

/// A range that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Found {
    variable: RegimeOf,
    edges: [Option<Edge>; 2],
    /// As [`Regime::change`].
    change: bool,
}

/// A joint's residual in time, beside orthonormal directions of what the model's columns can take.
struct Residual<'a> {
    left: Vec<f64>,
    basis: &'a [Vec<f64>],
    /// The directions' entries, window by window.
    rows: Vec<DVector<f64>>,
    /// Slower than this, rad/s, friction may hold the joint, and its direction is not sure.
    unsure: f64,
}

/// Sums over some windows.
#[derive(Clone)]
struct Moments {
    squares: DMatrix<f64>,
    with_left: DVector<f64>,
    left: f64,
    count: usize,
}

impl Moments {
    fn none(size: usize) -> Self {
        Self {
            squares: DMatrix::zeros(size, size),
            with_left: DVector::zeros(size),
            left: 0.0,
            count: 0,
        }
    }

    fn add(&mut self, row: &DVector<f64>, left: f64) {
        self.squares.ger(1.0, row, row, 1.0);
        self.with_left.axpy(left, row, 1.0);
        self.left += left * left;
        self.count += 1;
    }

    /// These and, so many times, others.
    fn plus(&self, times: f64, other: &Self) -> Self {
        Self {
            squares: &self.squares + times * &other.squares,
            with_left: &self.with_left + times * &other.with_left,
            left: self.left + times * other.left,
            count: match times > 0.0 {
                true => self.count + other.count,
                false => self.count - other.count,
            },
        }
    }

    /// Sum of squares that these values of the directions leave.
    fn energy(&self, values: &DVector<f64>) -> f64 {
        let taken = 2.0 * values.dot(&self.with_left) - values.dot(&(&self.squares * values));
        (self.left - taken).max(f64::MIN_POSITIVE)
    }
}

/// A range, as places in the order of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    from: usize,
    to: usize,
}

/// What a range makes of the residual: the deviance, and by the fit of the outside the mean squares outside and inside.
#[derive(Debug, Clone, Copy)]
struct Split {
    deviance: f64,
    mean: [f64; 2],
}

/// A residual in the order of a variable.
struct Ordered<'a> {
    residual: &'a Residual<'a>,
    x: Vec<f64>,
    order: Vec<usize>,
    /// Places at which the order is cut, 0 and all among them, with the sums up to each.
    cuts: Vec<(usize, Moments)>,
}

impl<'a> Residual<'a> {
    fn new(left: Vec<f64>, basis: &'a [Vec<f64>], unsure: f64) -> Self {
        let row = |w: usize| DVector::from_iterator(basis.len(), basis.iter().map(|b| b[w]));
        Self {
            rows: (0..left.len()).map(row).collect(),
            left,
            basis,
            unsure: unsure.max(f64::MIN_POSITIVE),
        }
    }

    /// The deviance of all windows beside a law that is smooth in `x`.
    fn smooth(&self, x: &[f64], dq: &[f64]) -> f64 {
        let (least, most) = (x.iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(*x), b.max(*x))
        });
        let unit = |x: f64| 2.0 * (x - least) / (most - least) - 1.0;
        let mut own: Vec<Vec<f64>> = Vec::new();
        for degree in 0..=DEGREE {
            for is_signed in [false, true] {
                let column = x.iter().zip(dq).map(|(x, dq)| {
                    let by = if is_signed {
                        (dq / self.unsure).clamp(-1.0, 1.0)
                    } else {
                        1.0
                    };
                    by * unit(*x).powi(degree)
                });
                let column = orthonormal(column.collect(), self.basis);
                own.extend(column.and_then(|column| orthonormal(column, &own)));
            }
        }
        for column in self.basis {
            let column = column.iter().zip(x).map(|(b, x)| b * unit(*x));
            let column = orthonormal(column.collect(), self.basis);
            own.extend(column.and_then(|column| orthonormal(column, &own)));
        }
        let mut left = self.left.clone();
        for along in self.basis.iter().chain(&own) {
            let share = dot(along, &left);
            left.iter_mut()
                .zip(along)
                .for_each(|(x, b)| *x -= share * b);
        }
        let n = left.len() as f64;
        n * (dot(&left, &left) / n).ln()
    }

    fn size(&self) -> usize {
        self.rows.first().map_or(0, DVector::len)
    }

    /// The range in which the error lives; of what is no variable of a range, none. `noise`: the mean square of noise.
    fn find(
        &self,
        variables: &[(Option<RegimeOf>, Vec<f64>)],
        noise: Option<f64>,
    ) -> Option<Found> {
        if self.left.len() < LEAST_WINDOWS.max(8 * self.size()) {
            return None;
        }
        let each = variables.iter().filter_map(|(variable, x)| {
            let ordered = Ordered::of(self, x, *variable)?;
            let (gain, range) = ordered.best()?;
            Some((gain, *variable, x, ordered, range))
        });
        let mut found: Vec<_> = each.collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (gain, variable, x, ordered, range) = found.first()?;
        let variable = (*variable)?;
        let memory = ordered.memory(*range);
        let next = found.get(1).map_or(0.0, |next| next.0);
        if gain - next.max(0.0) < SURE * memory {
            return None;
        }
        let range = match variable {
            RegimeOf::Direction => *range,
            _ => ordered.refined(*range),
        };
        let (range, change) = ordered.at_fault(range, variable)?;
        // One way, any law of the position is a spring's: a change from one direction to the other is in every friction that the model lacks.
        if change && variable == RegimeOf::Direction {
            return None;
        }
        let split = ordered.split(range)?;
        let mut others = variables.iter();
        let dq = &others.find(|(own, _)| *own == Some(RegimeOf::Direction))?.1;
        let price = ordered.price(range);
        if self.smooth(x, dq) - split.deviance - price < SURE * memory {
            return None;
        }
        let [outside, inside] = split.mean;
        let count = (range.to - range.from) as f64;
        let (own, rest) = (count * inside, (self.left.len() as f64 - count) * outside);
        let stands = own >= LEAST_SHARE * (own + rest)
            && match noise {
                Some(noise) => ordered.usual_outside(range)? <= AT_FLOOR * noise,
                None => true,
            };
        stands.then(|| Found {
            variable,
            edges: ordered.edges(variable, range, memory),
            change,
        })
    }
}

impl<'a> Ordered<'a> {
    /// `None` where the variable is not known or does not change.
    fn of(residual: &'a Residual, x: &[f64], variable: Option<RegimeOf>) -> Option<Self> {
        if !x.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut order: Vec<usize> = (0..x.len()).collect();
        order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
        let x: Vec<f64> = order.iter().map(|&w| x[w]).collect();
        let mut places: Vec<usize> = match variable {
            Some(RegimeOf::Direction) => vec![0, x.partition_point(|x| *x < 0.0), x.len()],
            // Equal values are on one side.
            _ => (0..=PARTS)
                .map(|part| part * x.len() / PARTS)
                .map(|place| {
                    x.get(place)
                        .map_or(place, |own| x.partition_point(|x| x < own))
                })
                .collect(),
        };
        places.dedup();
        let mut sums = Moments::none(residual.size());
        let mut cuts = Vec::with_capacity(places.len());
        let mut next = 0;
        for place in places {
            for &w in &order[next..place] {
                sums.add(&residual.rows[w], residual.left[w]);
            }
            next = place;
            cuts.push((place, sums.clone()));
        }
        (cuts.len() > 2).then_some(Self {
            residual,
            x,
            order,
            cuts,
        })
    }

    /// Sums of all windows before a place.
    fn before(&self, place: usize) -> Moments {
        let at = self.cuts.partition_point(|(cut, _)| *cut <= place);
        let (from, sums) = &self.cuts[at.saturating_sub(1)];
        let mut sums = sums.clone();
        for &w in &self.order[*from..place] {
            sums.add(&self.residual.rows[w], self.residual.left[w]);
        }
        sums
    }

    /// What a range makes of the residual, by the sums before its ends: inside, values of its own or a larger energy. None where one part is too small, or
    /// where the fit of the outside does not fail inside.
    fn split_by(&self, before: [&Moments; 2]) -> Option<Split> {
        let all = &self.cuts[self.cuts.len() - 1].1;
        let inside = before[1].plus(-1.0, before[0]);
        let outside = all.plus(-1.0, &inside);
        let n = all.count as f64;
        let [own, rest] = [inside.count, outside.count].map(|count| count as f64);
        if own < LEAST_INSIDE * n || rest < LEAST_OUTSIDE * n {
            return None;
        }
        let size = self.residual.size() as f64;
        // Of fewer windows the columns explain anything.
        if rest <= 2.0 * size {
            return None;
        }
        let values = fitted(&outside, &inside)?;
        let mean = [
            outside.energy(&values) / (rest - size),
            inside.energy(&values) / own,
        ];
        if mean[1] < LOUDER * mean[0] {
            return None;
        }
        let by_values = fitted(&inside, &outside).filter(|_| own > 2.0 * size);
        let by_values = by_values.map_or(f64::INFINITY, |values| {
            own * (inside.energy(&values) / (own - size)).ln() + size * n.ln()
        });
        Some(Split {
            deviance: rest * mean[0].ln() + by_values.min(own * mean[1].ln()),
            mean,
        })
    }

    fn split(&self, range: Range) -> Option<Split> {
        self.split_by([&self.before(range.from), &self.before(range.to)])
    }

    /// The mean square outside a range by the fit of the outside, as normal residuals of this median size have it, without the windows beside an edge
    /// ([`EDGE`]).
    fn usual_outside(&self, range: Range) -> Option<f64> {
        let n = self.x.len();
        let margin = (EDGE * n as f64) as usize;
        let from = range.from.saturating_sub(margin);
        let to = (range.to + margin).min(n);
        let inside = self.before(to).plus(-1.0, &self.before(from));
        let outside = self.cuts[self.cuts.len() - 1].1.plus(-1.0, &inside);
        let values = fitted(&outside, &inside)?;
        if outside.count <= 2 * self.residual.size() {
            return None;
        }
        let [before, after] = [&self.order[..from], &self.order[to..]];
        let left = |&w: &usize| self.residual.left[w] - self.residual.rows[w].dot(&values);
        let free = outside.count as f64 / (outside.count - self.residual.size()) as f64;
        Some(free * robust::scale(before.iter().chain(after).map(left))?.powi(2))
    }

    /// The price of a range's edges.
    fn price(&self, range: Range) -> f64 {
        let n = self.x.len();
        let edges = u8::from(range.from > 0) + u8::from(range.to < n);
        PRICE_OF_EDGE * (n as f64).ln() * f64::from(edges)
    }

    /// What a range is worth, beyond its edges' price.
    fn gain(&self, split: &Split, range: Range) -> f64 {
        let all = &self.cuts[self.cuts.len() - 1].1;
        let n = all.count as f64;
        n * (all.left / n).ln() - split.deviance - self.price(range)
    }

    /// The best range between two cuts, and what it is worth.
    fn best(&self) -> Option<(f64, Range)> {
        let mut best: Option<(f64, Range)> = None;
        for (n, (from, first)) in self.cuts.iter().enumerate() {
            for (to, last) in &self.cuts[n + 1..] {
                let range = Range {
                    from: *from,
                    to: *to,
                };
                let Some(split) = self.split_by([first, last]) else {
                    continue;
                };
                let gain = self.gain(&split, range);
                if best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, range));
                }
            }
        }
        best
    }

    /// The range with each edge at the best window between the neighbouring cuts.
    fn refined(&self, mut range: Range) -> Range {
        let mut least = self
            .split(range)
            .map_or(f64::INFINITY, |split| split.deviance);
        for _ in 0..ROUNDS {
            let before = range;
            for is_upper in [false, true] {
                for (own, split) in self.moved(range, is_upper) {
                    if split.deviance < least {
                        (least, range) = (split.deviance, own);
                    }
                }
            }
            if range == before {
                break;
            }
        }
        range
    }

    /// Of a range with one edge, the side that is at fault, the one beside which less is left, and whether the model fits on both: of time that is then what is
    /// later.
    fn at_fault(&self, range: Range, variable: RegimeOf) -> Option<(Range, bool)> {
        let (n, split) = (self.x.len(), self.split(range)?);
        let rest = match (range.from, range.to) {
            (0, to) if to < n => Range { from: to, to: n },
            (from, to) if from > 0 && to == n => Range { from: 0, to: from },
            _ => return Some((range, false)),
        };
        let Some(other) = self.split(rest) else {
            return Some((range, false));
        };
        let [own, other] = [split.mean[0], other.mean[0]];
        let change = own.max(other) <= LOUDER * own.min(other);
        let is_rest = match (change, variable) {
            (true, RegimeOf::Time) => range.from == 0,
            _ => other < own,
        };
        Some((if is_rest { rest } else { range }, change))
    }

    /// The range with an edge at each window between the neighbouring cuts.
    fn moved(&self, range: Range, is_upper: bool) -> Vec<(Range, Split)> {
        let edge = if is_upper { range.to } else { range.from };
        if edge == 0 || edge == self.x.len() {
            return Vec::new();
        }
        let last = self.cuts.len() - 1;
        let at = self.cuts.partition_point(|(cut, _)| *cut < edge);
        let (low, high) = (at.saturating_sub(1), (at + 1).min(last));
        let fixed = self.before(if is_upper { range.from } else { range.to });
        let mut sums = self.cuts[low].1.clone();
        let mut all = Vec::new();
        for place in self.cuts[low].0 + 1..self.cuts[high].0 {
            let w = self.order[place - 1];
            sums.add(&self.residual.rows[w], self.residual.left[w]);
            let own = match is_upper {
                true => Range { to: place, ..range },
                false => Range {
                    from: place,
                    ..range
                },
            };
            if own.from >= own.to {
                continue;
            }
            let split = match is_upper {
                true => self.split_by([&fixed, &sums]),
                false => self.split_by([&sums, &fixed]),
            };
            all.extend(split.map(|split| (own, split)));
        }
        all
    }

    /// How many neighbours in time say the same outside a range.
    fn memory(&self, range: Range) -> f64 {
        let all = &self.cuts[self.cuts.len() - 1].1;
        let inside = self.before(range.to).plus(-1.0, &self.before(range.from));
        let Some(values) = fitted(&all.plus(-1.0, &inside), &inside) else {
            return 1.0;
        };
        let mut windows: Vec<usize> = (self.order[..range.from].iter())
            .chain(&self.order[range.to..])
            .copied()
            .collect();
        windows.sort_unstable();
        let left = |&w: &usize| {
            let taken = dot(self.residual.rows[w].as_slice(), values.as_slice());
            self.residual.left[w] - taken
        };
        autocorrelation_time(&windows.iter().map(left).collect::<Vec<_>>())
    }

    /// A range's edges with their standard deviations.
    fn edges(&self, variable: RegimeOf, range: Range, memory: f64) -> [Option<Edge>; 2] {
        let n = self.x.len();
        let edge = |place: usize, is_upper: bool| {
            if place == 0 || place == n {
                return None;
            }
            if variable == RegimeOf::Direction {
                return Some(Edge {
                    value: 0.0,
                    std: 0.0,
                });
            }
            let between = |place: usize| 0.5 * (self.x[place - 1] + self.x[place]);
            let all = self.moved(range, is_upper);
            let here = self
                .split(range)
                .map_or(f64::INFINITY, |split| split.deviance);
            // As likely as the best, to one standard deviation.
            let as_likely = all
                .iter()
                .filter(|(_, split)| split.deviance - here <= memory);
            let places = as_likely.map(|(own, _)| if is_upper { own.to } else { own.from });
            let (least, most) = places.fold((place, place), |(a, b), own| (a.min(own), b.max(own)));
            // Between two windows it may be anywhere.
            let [from, to] = [self.x[least - 1], self.x[most]];
            Some(Edge {
                value: between(place),
                std: (0.5 * (to - from)).max(f64::MIN_POSITIVE),
            })
        };
        [edge(range.from, false), edge(range.to, true)]
    }
}

/// What the windows of one part say of the directions; those of the other hardly count.
fn fitted(own: &Moments, other: &Moments) -> Option<DVector<f64>> {
    let both = own.plus(BESIDE, other);
    Some(both.squares.cholesky()?.solve(&both.with_left))
}

#[cfg(test)]
mod tests;

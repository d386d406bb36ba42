//! The range of a variable that parts a residual into one that is noise and one that is not.

use nalgebra::{DMatrix, DVector};

use super::{Edge, RegimeOf};
use crate::equation::dot::dot;
use crate::estimate::shapes::orthonormal;
use crate::robust;
use crate::select::criteria::statistics::autocorrelation_time;

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
/// Price of an edge: its place among n windows and the energy beside it, each ½ ln n of the log-likelihood (Rissanen 1978, Automatica 14:465), twice that
/// for the deviance used here.
const PRICE_OF_EDGE: f64 = 2.0;
/// By so much of the deviance, prices paid, a range has to be better than none, than a smooth law, and than the next variable's: 8 · 10⁻⁶ of a normal
/// variable's draws are as large, and of some thousand ranges the largest one of 10⁻².
const SURE: f64 = 20.0;
/// Degree of the smooth law that a range has to beat: a polynomial of the variable, with the direction and without, beside columns whose values go with the
/// variable. What that explains begins and ends nowhere.
const DEGREE: i32 = 3;

/// A range that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) variable: RegimeOf,
    pub(super) edges: [Option<Edge>; 2],
    /// As [`Regime::change`](super::Regime::change).
    pub(super) change: bool,
}

/// A joint's residual in time, beside orthonormal directions of what the model's columns can take.
pub(super) struct Residual<'a> {
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
    pub(super) fn new(left: Vec<f64>, basis: &'a [Vec<f64>], unsure: f64) -> Self {
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
    pub(super) fn find(
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

    /// The mean square outside a range by the fit of the outside, as normal residuals of this median size have it. Windows that are nearer to an edge than
    /// the variable usually moves from one window to the next are neither inside nor out: an edge cuts through them.
    fn usual_outside(&self, range: Range) -> Option<f64> {
        let mut in_time = vec![0.0; self.x.len()];
        (self.x.iter().zip(&self.order)).for_each(|(x, &w)| in_time[w] = *x);
        let travel = robust::median(in_time.windows(2).map(|x| (x[1] - x[0]).abs()))?;
        let from = match range.from {
            0 => 0,
            from => self.x.partition_point(|x| *x < self.x[from] - travel),
        };
        let last = self.x[range.to - 1];
        let to = self.x.partition_point(|x| *x <= last + travel);
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

//! Which torque outside the catalogue a joint's residual asks for: every term of a grammar, beside all that the model has.
//!
//! What the model's own columns at the joint can take is projected out of the residual and of each term, so that no term stands for a body
//! or a friction. The best term explains most of what is left; of those that do as well within the error of the difference, the simplest is
//! taken, and the others are told as rivals. A parameter has its price, for it explains something of any noise.
//!
//! How often noise alone explains as much is told by the noise: where a term has no part in a residual, the residual's sign in a segment of
//! time is as likely the other one. So all segments' signs are drawn anew, time and again, and the best of *all* terms is found each time
//! (Freedman & Lane 1983, *J. Business & Economic Statistics* 1:292; Westfall & Young 1993, max-T): the share of draws that explain as much
//! is the probability of a false alarm over the whole grammar, whatever the residual's memory within a segment.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use proprio_core::effect::{EffectKind, Form, Input, JointState};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::criteria::statistics::autocorrelation_time;
use super::criteria::sum_and_error;
use crate::equation::dot::dot;
use crate::equation::joint_states::States;
use crate::estimate::fit::LimbFit;
use crate::estimate::grid::{MotionRange, values};
use crate::estimate::shapes::orthonormal;
use crate::formula::Names;
use crate::formula::grammar::{Border, CARRIERS, Factor, Term, terms};
use crate::parallel::{by_number, side_by_side};

/// Windows that are looked at, spread over the log.
pub(crate) const MOST_WINDOWS: usize = 1000;
/// Segments of time whose signs are drawn: each is longer than noise remembers (0.1 s) in logs of more than four seconds, and of so many
/// a sign pattern is one of 10¹².
const SEGMENTS: usize = 40;
/// Fewer windows in each are no segment.
const LEAST_IN_SEGMENT: usize = 5;
/// Draws for each chance of a false alarm: half of it can be told apart from none.
const DRAWS: f64 = 2.0;
/// Draws that are made before it is asked whether more are of use.
const TOGETHER: usize = 64;
/// Rounds of a shape's refinement, each so much narrower: to a hundredth of the grid's spacing.
const ROUNDS: usize = 8;
const NARROWER: f64 = 0.6;
/// The first step of a width's refinement, a factor: half way, in its logarithm, to the next of the grammar's.
const WIDER: f64 = 1.19;
/// Terms that are refined before they are held against each other.
const MOST_REFINED: usize = 12;
/// Rivals that are told.
const MOST_RIVALS: usize = 4;
/// One that explains less than this share of what the best does is no rival: where that much is within the error, chance explains the best.
const LEAST_OF_RIVAL: f64 = 0.5;
/// What of a column the model's own leave, as a share of its square: below this its length is worked out by what is left and not as a
/// difference of squares, which rounding leaves ten digits of.
const NEARLY_NOTHING: f64 = 1e-6;

/// A term that a residual asks for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pick {
    /// Its torque, and a name of its letters.
    pub(crate) text: String,
    pub(crate) name: String,
    /// Its parameters in which it is not linear.
    pub(crate) shapes: Vec<f64>,
    /// Its coefficients.
    pub(crate) values: Vec<f64>,
    /// Where it begins or ends at its parameter.
    pub(crate) border: Option<Border>,
    /// How much of the residual's square it explains.
    pub(crate) share: f64,
    /// How often noise explains as much.
    pub(crate) chance: f64,
    /// Texts of terms that do as well.
    pub(crate) rivals: Vec<String>,
}

/// A term with one value of its parameter, beside the model.
struct Tried {
    term: usize,
    shape: Option<f64>,
    /// Of each of its orthonormal columns, segment by segment, how it goes with the residual.
    along: Vec<Vec<f64>>,
    /// How much of the square it explains.
    fall: f64,
}

impl Tried {
    fn of(term: usize, shape: Option<f64>, along: Vec<Vec<f64>>) -> Self {
        let value = |along: &Vec<f64>| along.iter().sum::<f64>().powi(2);
        Self {
            term,
            shape,
            fall: along.iter().map(value).sum(),
            along,
        }
    }
}

/// A term with the values of its parameters, between those of its grids, with which it explains most.
struct Refined {
    term: Term,
    shape: Option<f64>,
    /// How much of the square it explains, and with the best of its grids.
    fall: f64,
    of_grid: f64,
}

/// A window of a limb, as a screen looks at it.
pub(crate) struct ScreenWindow {
    /// When its samples are, s, and what the limb's joints do then.
    pub(crate) samples: Vec<(f64, Vec<JointState<f64>>)>,
    pub(crate) rows: Vec<ScreenRow>,
}

/// An equation of a window that has the torque of the joint in it.
pub(crate) struct ScreenRow {
    /// Which of the window's equations: what its neighbours say of the same one may be the same noise.
    pub(crate) equation: usize,
    /// What a torque of the joint at each of the window's samples gives it.
    pub(crate) weights: Vec<f64>,
    /// What the model leaves of it, and the model's columns.
    pub(crate) left: f64,
    pub(crate) columns: Vec<f64>,
}

/// How often noise may ask for as much, and the least share of the residual's square that a term explains.
pub(crate) type Gates = (f64, f64);

/// The term that a joint's residual asks for most; what is `known` of factors there is not worked out again.
pub(crate) fn pick(
    fit: &LimbFit,
    joint: usize,
    gates: Gates,
    known: &KnownFactors,
) -> Option<Pick> {
    let (data, n) = (fit.data, fit.data.joints());
    let counting: Vec<usize> = (0..data.motion.windows.len())
        .filter(|&w| data.counts(w, joint))
        .collect();
    let stride = counting.len().div_ceil(MOST_WINDOWS).max(1);
    let rows = data.rows(&fit.at, &fit.columns);
    let count = fit.columns.of_joint[joint].len();
    let predicted = fit.predicted();
    let (seen, time) = (seen(fit), &data.motion.time);
    let window = |w: usize| {
        let [first, last] = data.motion.windows[w].samples;
        let length = time[last] - time[first];
        let weight = |k: usize| {
            let before = time[k.saturating_sub(1).max(first)];
            0.5 * (time[(k + 1).min(last)] - before) / length
        };
        let joints = |k: usize| {
            let mut joints = Vec::with_capacity(n);
            seen.all(k, &mut joints);
            (time[k], joints)
        };
        let at = w * n + joint;
        ScreenWindow {
            samples: (first..=last).map(joints).collect(),
            rows: vec![ScreenRow {
                equation: 0,
                weights: (first..=last).map(weight).collect(),
                left: data.torque[at] - predicted[at],
                columns: rows.row(w, joint)[..count].to_vec(),
            }],
        }
    };
    let limb = data.joint_names();
    let joints: Vec<&str> = limb.iter().map(String::as_str).collect();
    let names = Names {
        joints: &joints,
        own: joint,
    };
    let range = MotionRange::of(data, joint, 0.0);
    let windows = counting.into_iter().step_by(stride).map(window);
    pick_of((names, known), &range, windows, gates)
}

/// The term that a joint's residual asks for most, whatever the source of the rows. `None` where nothing can be told, no term explains the `least`
/// share of the residual's square, or noise asks as much more often than a false `alarm` may be.
pub(crate) fn pick_of(
    (names, known): (Names, &KnownFactors),
    range: &MotionRange,
    windows: impl Iterator<Item = ScreenWindow>,
    (alarm, least): Gates,
) -> Option<Pick> {
    let residual = Residual::of(names, windows)?;
    let [from, to] = range.positions;
    let all = terms(names, to - from);
    let factors = residual.factors(&all, names, range, known);
    let tried: Vec<Tried> = by_number(0..all.len(), |n| {
        residual.tried(n, &all[n], &factors, range)
    })
    .into_iter()
    .flatten()
    .collect();
    let most = tried.iter().max_by(|a, b| a.fall.total_cmp(&b.fall))?;
    if most.fall < least * residual.square {
        return None;
    }
    // A grid may pass by the best of a narrow term: those that explain much are held against each other where each explains most.
    let mut each: Vec<&Tried> = Vec::new();
    let text = |tried: &Tried| all[tried.term].text();
    for own in tried
        .iter()
        .filter(|own| own.fall >= LEAST_OF_RIVAL * most.fall)
    {
        match each.iter_mut().find(|known| text(known) == text(own)) {
            Some(known) if known.fall < own.fall => *known = own,
            Some(_) => {}
            None => each.push(own),
        }
    }
    each.sort_by(|a, b| b.fall.total_cmp(&a.fall));
    each.truncate(MOST_REFINED);
    let refined: Vec<Refined> = side_by_side(&each, |own| {
        residual.refined(&all[own.term], own, &factors, range)
    });
    let most = refined.iter().max_by(|a, b| a.fall.total_cmp(&b.fall))?;
    // A number more explains something of any noise: each is worth as much of it as its description is long (Rissanen 1978, Automatica 14:465).
    let noise = residual.noise(most, &factors)?;
    let price = noise * (residual.left.len() as f64).ln();
    let worth = |own: &Refined| own.fall - price * own.term.numbers() as f64;
    let best = refined
        .iter()
        .max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    // Terms that do as well as the best, within the error of the difference.
    let of_best = residual.gains(best, &factors)?;
    let as_good = |own: &&Refined| {
        let Some(gains) = residual.gains(own, &factors) else {
            return false;
        };
        let gains: Vec<f64> = of_best
            .iter()
            .zip(gains)
            .map(|(best, own)| best - own)
            .collect();
        let (less, error) = sum_and_error(&gains);
        let more = own.term.numbers() as f64 - best.term.numbers() as f64;
        own.fall >= LEAST_OF_RIVAL * best.fall && less + price * more <= error
    };
    let mut rivals: Vec<&Refined> = refined.iter().filter(as_good).collect();
    rivals.sort_by(|a, b| {
        let by_size = |own: &Refined| own.term.complexity();
        by_size(a).cmp(&by_size(b)).then(b.fall.total_cmp(&a.fall))
    });
    let chosen = rivals.first()?;
    // Draws have no finer grids than that: neither has what they are held against.
    let chance = chance(&tried, chosen.of_grid, alarm)?;
    let rest = rivals.iter().skip(1).take(MOST_RIVALS);
    Some(Pick {
        text: chosen.term.text(),
        name: chosen.term.name(),
        shapes: chosen
            .shape
            .into_iter()
            .chain(chosen.term.width())
            .collect(),
        values: residual.coefficients(chosen, &factors)?,
        border: chosen.term.border,
        share: chosen.fall / residual.square,
        chance,
        rivals: rest.map(|own| own.term.text()).collect(),
    })
}

/// How often the best of all terms explains as much where the segments' signs are drawn; `None` as soon as that is more often than `alarm`.
fn chance(tried: &[Tried], fall: f64, alarm: f64) -> Option<f64> {
    let draws = (DRAWS / alarm).ceil() as usize;
    // What all segments together would not explain, no signs of theirs do.
    let most = |along: &Vec<f64>| along.iter().map(|x| x.abs()).sum::<f64>().powi(2);
    let may = |tried: &&Tried| tried.along.iter().map(most).sum::<f64>() >= fall;
    let mut tried: Vec<&Tried> = tried.iter().filter(may).collect();
    // Those that explain much do so under many signs: the first that does is enough.
    tried.sort_by(|a, b| b.fall.total_cmp(&a.fall));
    let as_much = |draw: usize| {
        let mut random = ChaCha8Rng::seed_from_u64(draw as u64);
        let signs: [f64; SEGMENTS] =
            std::array::from_fn(|_| if random.random::<bool>() { 1.0 } else { -1.0 });
        let of = |tried: &&Tried| -> f64 {
            let sums = tried.along.iter().map(|along| dot(along, &signs).powi(2));
            sums.sum()
        };
        tried.iter().any(|tried| of(tried) >= fall)
    };
    let mut count = 0;
    for begin in (0..draws).step_by(TOGETHER) {
        let end = (begin + TOGETHER).min(draws);
        count += by_number(begin..end, as_much)
            .into_iter()
            .filter(|as_much| *as_much)
            .count();
        if (count + 1) as f64 > alarm * (draws + 1) as f64 {
            return None;
        }
    }
    Some((count + 1) as f64 / (draws + 1) as f64)
}

/// What a model leaves of a joint, beside all that its own columns can take.
struct Residual {
    joint: usize,
    left: Vec<f64>,
    square: f64,
    /// Orthonormal directions of the model's columns, and segment by segment how each goes with the residual.
    basis: Vec<Vec<f64>>,
    along_basis: Vec<Vec<f64>>,
    /// What effects see in the middle of each third of each window.
    states: Vec<Vec<JointState<f64>>>,
    /// Of each carrier its integral over each third of each row's window, over the window's length: what friction does where it turns round is not
    /// told by a few samples. The first is of no carrier.
    carriers: Vec<(Option<&'static str>, Vec<f64>)>,
    /// The window of each row, and its segment.
    window: Vec<usize>,
    segment: Vec<usize>,
}

/// Parts of a window in which what multiplies a carrier is taken to be what it is in the middle.
const PARTS: usize = 3;

/// By texts and shapes.
type Values = HashMap<(String, u64), Arc<Vec<f64>>>;

/// Values of factors at the parts' middles.
struct Factors<'a> {
    names: Names<'a>,
    known: Values,
}

/// Factors of a joint that were worked out: between two screens of it the model changes, which moves the transmitted torque alone, and no factor has that.
#[derive(Default)]
pub(crate) struct KnownFactors(RefCell<(Vec<[u64; 5]>, Values)>);

/// What factors see of a joint, bit by bit: a temperature may be no number.
fn seen_by_factors(state: &JointState<f64>) -> [u64; 5] {
    let motion = [state.q, state.speed, state.speed_noise];
    let [q, speed, noise] = motion.map(f64::to_bits);
    [
        q,
        speed,
        noise,
        state.temperature.to_bits(),
        state.time.to_bits(),
    ]
}

/// What a shape is known by; of none, one.
fn key(shape: Option<f64>) -> u64 {
    shape.unwrap_or(1.0).to_bits()
}

impl Residual {
    fn of(names: Names, windows: impl Iterator<Item = ScreenWindow>) -> Option<Self> {
        struct Row {
            equation: usize,
            window: usize,
            left: f64,
            columns: Vec<f64>,
            carriers: Vec<[f64; PARTS]>,
        }
        let mut carriers: Vec<(Option<&'static str>, Vec<f64>)> = vec![(None, Vec::new())];
        carriers.extend(CARRIERS.iter().map(|text| (Some(*text), Vec::new())));
        let read = |(text, _): &(Option<&'static str>, Vec<f64>)| {
            text.map(|text| Factor::read(text, names)).transpose().ok()
        };
        let read: Vec<Option<Factor>> = carriers.iter().map(read).collect::<Option<_>>()?;
        let (mut states, mut rows, mut count) = (Vec::new(), Vec::new(), 0);
        for (n, window) in windows.enumerate() {
            let samples = &window.samples;
            let (Some((begin, _)), Some((end, _))) = (samples.first(), samples.last()) else {
                return None;
            };
            let part =
                |t: f64| ((PARTS as f64 * (t - begin) / (end - begin)) as usize).min(PARTS - 1);
            let values = |(t, seen): &(f64, Vec<JointState<f64>>)| -> (usize, Vec<f64>) {
                let of = |read: &Option<Factor>| {
                    read.as_ref().map_or(1.0, |f| f.at(seen, names.own, 1.0))
                };
                (part(*t), read.iter().map(of).collect())
            };
            let values: Vec<(usize, Vec<f64>)> = samples.iter().map(values).collect();
            for row in window.rows {
                let mut sums = vec![[0.0; PARTS]; carriers.len()];
                for (weight, (part, values)) in row.weights.iter().zip(&values) {
                    for (sums, value) in sums.iter_mut().zip(values) {
                        sums[*part] += weight * value;
                    }
                }
                rows.push(Row {
                    equation: row.equation,
                    window: n,
                    left: row.left,
                    columns: row.columns,
                    carriers: sums,
                });
            }
            for part in 0..PARTS {
                let middle = (part as f64 + 0.5) / PARTS as f64;
                let at = (middle * (samples.len() - 1) as f64).round() as usize;
                states.push(samples[at].1.clone());
            }
            count = n + 1;
        }
        if count < SEGMENTS * LEAST_IN_SEGMENT {
            return None;
        }
        // What neighbours have in common is told of one equation at a time.
        rows.sort_by_key(|row| row.equation);
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for column in 0..rows.first()?.columns.len() {
            let column = rows.iter().map(|row| row.columns[column]);
            basis.extend(orthonormal(column.collect(), &basis));
        }
        let mut left: Vec<f64> = rows.iter().map(|row| row.left).collect();
        for along in &basis {
            let share = dot(along, &left);
            left.iter_mut()
                .zip(along)
                .for_each(|(x, b)| *x -= share * b);
        }
        for (n, (_, carrier)) in carriers.iter_mut().enumerate() {
            carrier.extend(rows.iter().flat_map(|row| row.carriers[n]));
        }
        let window: Vec<usize> = rows.iter().map(|row| row.window).collect();
        let mut residual = Self {
            joint: names.own,
            square: dot(&left, &left),
            left,
            basis,
            along_basis: Vec::new(),
            states,
            carriers,
            segment: window.iter().map(|w| w * SEGMENTS / count).collect(),
            window,
        };
        let along = |column: &Vec<f64>| residual.by_segment(column);
        residual.along_basis = residual.basis.iter().map(along).collect();
        Some(residual)
    }

    /// A factor at the parts' middles.
    fn factor(&self, text: &str, names: Names, p: f64) -> Option<Vec<f64>> {
        let factor = Factor::read(text, names).ok()?;
        let values = factor.at_all(&self.states, self.joint, p);
        values.iter().all(|x| x.is_finite()).then_some(values)
    }

    /// The factors of all terms with all their shapes, each once: carriers share them.
    fn factors<'n>(
        &self,
        all: &[Term],
        names: Names<'n>,
        range: &MotionRange,
        KnownFactors(known): &KnownFactors,
    ) -> Factors<'n> {
        let motion: Vec<_> = self.states.iter().flatten().map(seen_by_factors).collect();
        let mut known = known.borrow_mut();
        if known.0 != motion {
            *known = (motion, Values::new());
        }
        let mut asked: BTreeMap<(String, u64), f64> = BTreeMap::new();
        for term in all {
            for shape in shapes(term, range) {
                for text in &term.factors {
                    let key = (text.clone(), key(shape));
                    if !known.1.contains_key(&key) {
                        asked.insert(key, shape.unwrap_or(1.0));
                    }
                }
            }
        }
        let asked: Vec<_> = asked.into_iter().collect();
        let of = |(key, p): &((String, u64), f64)| {
            let values = self.factor(&key.0, names, *p)?;
            Some((key.clone(), Arc::new(values)))
        };
        let made = side_by_side(&asked, of);
        known.1.extend(made.into_iter().flatten());
        Factors {
            names,
            known: known.1.clone(),
        }
    }

    /// A term's columns over the rows; `None` where they are not finite.
    fn columns(&self, term: &Term, shape: Option<f64>, factors: &Factors) -> Option<Vec<Vec<f64>>> {
        let carrier = &self
            .carriers
            .iter()
            .find(|(known, _)| *known == term.carrier)?
            .1;
        let of = |text: &String| -> Option<Vec<f64>> {
            let made;
            let values = match factors.known.get(&(text.clone(), key(shape))) {
                Some(values) => &**values,
                None => {
                    made = self.factor(text, factors.names, shape.unwrap_or(1.0))?;
                    &made
                }
            };
            // Three products each time: a scalar product of any length takes as long as ten.
            let (parts, _) = values.as_chunks::<PARTS>();
            let (carrier, _) = carrier.as_chunks::<PARTS>();
            let of = |(w, [a, b, c]): (&usize, &[f64; PARTS])| {
                let [x, y, z] = parts[*w];
                x * a + y * b + z * c
            };
            let column: Vec<f64> = self.window.iter().zip(carrier).map(of).collect();
            column.iter().all(|x| x.is_finite()).then_some(column)
        };
        term.factors.iter().map(of).collect()
    }

    /// A term with each value of its parameter.
    fn tried(&self, n: usize, term: &Term, factors: &Factors, range: &MotionRange) -> Vec<Tried> {
        let of = |shape: Option<f64>| self.beside(n, term, shape, factors);
        shapes(term, range).into_iter().filter_map(of).collect()
    }

    /// A term of this shape beside the model.
    ///
    /// What the model's columns take is not taken out of the term's but out of its products: of orthonormal directions B and a residual
    /// that has none of them, a column c leaves the square |c|² − |Bᵀc|², and goes with the residual as it does itself less B's part.
    fn beside(
        &self,
        n: usize,
        term: &Term,
        shape: Option<f64>,
        factors: &Factors,
    ) -> Option<Tried> {
        struct Own<'c> {
            column: &'c [f64],
            shares: Vec<f64>,
            length: f64,
        }
        let columns = self.columns(term, shape, factors)?;
        let (mut own, mut along): (Vec<Own>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for column in &columns {
            let shares: Vec<f64> = self.basis.iter().map(|b| dot(b, column)).collect();
            let square = dot(column, column);
            let mut left = square - dot(&shares, &shares);
            let mut with = self.by_segment(column);
            let mut take = |share: f64, of: &[f64]| {
                with.iter_mut().zip(of).for_each(|(x, of)| *x -= share * of);
            };
            for (share, of) in shares.iter().zip(&self.along_basis) {
                take(*share, of);
            }
            for (other, of) in own.iter().zip(&along) {
                let common = dot(other.column, column) - dot(&other.shares, &shares);
                let share = common / other.length;
                left -= share * share;
                take(share, of);
            }
            if left.is_nan() || left <= NEARLY_NOTHING * square {
                return self.nearly_nothing(n, term, shape, factors);
            }
            let length = left.sqrt();
            with.iter_mut().for_each(|x| *x /= length);
            own.push(Own {
                column,
                shares,
                length,
            });
            along.push(with);
        }
        Some(Tried::of(n, shape, along))
    }

    /// The same of a term that the model's columns, or its own among each other, leave next to nothing of.
    fn nearly_nothing(
        &self,
        n: usize,
        term: &Term,
        shape: Option<f64>,
        factors: &Factors,
    ) -> Option<Tried> {
        let own = self.own(term, shape, factors)?;
        let along = own.iter().map(|column| self.by_segment(column)).collect();
        Some(Tried::of(n, shape, along))
    }

    /// Orthonormal directions of a term beside the model's.
    fn own(&self, term: &Term, shape: Option<f64>, factors: &Factors) -> Option<Vec<Vec<f64>>> {
        let mut own: Vec<Vec<f64>> = Vec::new();
        for column in self.columns(term, shape, factors)? {
            own.extend(
                orthonormal(column, &self.basis).and_then(|column| orthonormal(column, &own)),
            );
        }
        Some(own)
    }

    /// How much of the square a term explains in each segment.
    fn gains(&self, own: &Refined, factors: &Factors) -> Option<Vec<f64>> {
        let after = self.without(own, factors)?;
        let mut gains = vec![0.0; SEGMENTS];
        for ((segment, left), after) in self.segment.iter().zip(&self.left).zip(&after) {
            gains[*segment] += left * left - after * after;
        }
        Some(gains)
    }

    /// What a term leaves of the residual.
    fn without(&self, own: &Refined, factors: &Factors) -> Option<Vec<f64>> {
        let mut left = self.left.clone();
        for along in &self.own(&own.term, own.shape, factors)? {
            let share = dot(along, &left);
            left.iter_mut()
                .zip(along)
                .for_each(|(x, c)| *x -= share * c);
        }
        Some(left)
    }

    /// What one direction explains of the noise that a term leaves: the mean square of a window, as many times more as neighbours say the same.
    fn noise(&self, own: &Refined, factors: &Factors) -> Option<f64> {
        let left = self.without(own, factors)?;
        let square = dot(&left, &left) / left.len() as f64;
        Some(square * autocorrelation_time(&left))
    }

    /// The shape between the neighbours of the best of a grid that explains most, and the width between the grammar's, where the term has one.
    fn refined(
        &self,
        term: &Term,
        best: &Tried,
        factors: &Factors,
        range: &MotionRange,
    ) -> Refined {
        let of = |term: Term, shape: Option<f64>, fall: f64| Refined {
            term,
            shape,
            fall,
            of_grid: best.fall,
        };
        let as_it_is = || of(term.clone(), best.shape, best.fall);
        let grid = term.grid.and_then(|grid| values(grid, range));
        let (Some(mut shape), Some(grid)) = (best.shape, grid) else {
            return as_it_is();
        };
        let at = grid.iter().position(|value| *value == shape);
        let near = at.and_then(|at| grid.get(at + 1).or_else(|| grid.get(at.checked_sub(1)?)));
        let Some(near) = near else {
            return as_it_is();
        };
        let (mut term, mut most) = (term.clone(), best.fall);
        let mut step = 0.5 * (near - shape).abs();
        let mut wider = WIDER;
        for _ in 0..ROUNDS {
            for other in [shape - step, shape + step] {
                let tried = self.beside(best.term, &term, Some(other), factors);
                if let Some(tried) = tried.filter(|tried| tried.fall > most) {
                    (shape, most) = (other, tried.fall);
                }
            }
            for by in [wider.recip(), wider] {
                let Some(width) = term.width() else { break };
                let other = term.clone().with_width(width * by);
                let tried = self.beside(best.term, &other, Some(shape), factors);
                if let Some(tried) = tried.filter(|tried| tried.fall > most) {
                    (term, most) = (other, tried.fall);
                }
            }
            step *= NARROWER;
            wider = wider.powf(NARROWER);
        }
        of(term, Some(shape), most)
    }

    fn by_segment(&self, column: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; SEGMENTS];
        for ((segment, left), x) in self.segment.iter().zip(&self.left).zip(column) {
            sums[*segment] += left * x;
        }
        sums
    }

    /// A term's coefficients: least squares beside the model.
    fn coefficients(&self, own: &Refined, factors: &Factors) -> Option<Vec<f64>> {
        let columns = self.columns(&own.term, own.shape, factors)?;
        let beside = |mut column: Vec<f64>| {
            for along in &self.basis {
                let share = dot(along, &column);
                column
                    .iter_mut()
                    .zip(along)
                    .for_each(|(x, b)| *x -= share * b);
            }
            column
        };
        let own: Vec<Vec<f64>> = columns.into_iter().map(beside).collect();
        let products =
            nalgebra::DMatrix::from_fn(own.len(), own.len(), |a, b| dot(&own[a], &own[b]));
        let moments = nalgebra::DVector::from_fn(own.len(), |a, _| dot(&own[a], &self.left));
        let found = products.cholesky()?.solve(&moments);
        Some(found.iter().copied().collect())
    }
}

/// The values of a term's parameter that are tried.
fn shapes(term: &Term, range: &MotionRange) -> Vec<Option<f64>> {
    match term.grid {
        None => vec![None],
        Some(grid) => (values(grid, range).unwrap_or_default().into_iter())
            .map(Some)
            .collect(),
    }
}

/// What effects see under the model, the transmitted torque among it.
fn seen(fit: &LimbFit) -> States {
    let data = fit.data;
    let asks = |effect: &&EffectKind| {
        let facts = effect.description();
        facts.form == Form::Columns && facts.input == Input::TransmittedTorque
    };
    let loaded = EffectKind::ALL.iter().find(asks);
    let candidates: Vec<_> = loaded.map(|effect| (*effect, 0)).into_iter().collect();
    let candidates: Vec<_> = (candidates.into_iter())
        .filter(|place| !fit.places.contains(place))
        .collect();
    let columns = data.columns(&fit.values, &fit.places, &candidates);
    data.motion.seen(&data.body, &fit.values, &columns)
}

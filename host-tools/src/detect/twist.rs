//! What a second encoder, at the link, shows of a gear: how far link and motor turn against each other under the torque between them.
//!
//! The link's own encoder gives its motion, so that the rigid body needs no spring to follow it; and the twist x = q_motor − q_link, with
//! the torque L that the bodies need at that motion, tells the gear directly, better than any motor's torque:
//!
//! ```text
//! L = k (x − x₀) + d ẋ                a spring that damps
//! L = k (x − x₀) + d ẋ + f z(x; w)    and friction inside it (`equation::hysteresis`)
//! x = x₀ + gap/2 sgn L + L/k          or a play, and a spring on either side of it
//! ```
//!
//! A spring is regressed on x and not x on L: the encoders' noise is next to nothing, what the bodies have wrong is not. In a play there is no
//! torque, and where x comes to rest only its sign matters; on its way it says nothing, so that of a play only the half of the time is
//! judged in which the torque is larger. The richer gear is believed where it leaves less of folds of time that its fit has
//! not seen, beyond the spread over them.

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::EffectKind;

use crate::equation::hysteresis::hysteresis;
use crate::equation::values::{Place, Values};
use crate::estimate::limb_data::LimbData;

/// A gear whose twist tells less than this share of the torque has none that is its own: an encoder's runout is as large.
const LEAST_TOLD: f64 = 0.5;
/// A stiffness must be so many standard deviations.
const LEAST_Z: f64 = 5.0;
/// A richer gear must leave less by so many standard errors, and by this share of what the plainer one leaves.
const SURE: f64 = 2.0;
const LEAST_GAIN: f64 = 0.05;
/// Ways over which friction builds up: the shortest as a share of the twist's range, each so many times the one before, and how many.
const SHORTEST: f64 = 0.01;
const LONGER: f64 = 1.2;
const WAYS: i32 = 30;

/// A gear as its two encoders show it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Twist {
    /// The joint, counted from the limb's first.
    pub(crate) joint: usize,
    /// How far link and motor turn against each other, root mean square, rad.
    pub(crate) rms: f64,
    /// Share of the variance of the torque (of a play: of the twist) that the gear tells, on folds that its fit has not seen, and its standard error.
    pub(crate) told: [f64; 2],
    /// Stiffness, N m/rad, and its standard deviation.
    pub(crate) stiffness: [f64; 2],
    /// What it has beside a spring.
    pub(crate) beside: Option<Beside>,
}

/// What a gear has beside a spring: values and standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beside {
    /// Friction f (N m) and the way w (rad) over which it builds up.
    Hysteresis { friction: [f64; 2], way: [f64; 2] },
    /// A gap, rad.
    Play { gap: [f64; 2] },
}

impl Twist {
    /// What a joint's gear is like under a model; `None` without a second encoder, or if its twist does not follow the torque.
    pub(crate) fn of(data: &LimbData, values: &Values, joint: usize) -> Option<Self> {
        let windows = Windows::of(data, values, joint)?;
        let play = windows.judge(Gear::Play)?;
        let straight = windows.judge(Gear::Straight)?;
        if play.is_better_than(&straight) {
            return windows.told(&play, &windows.twist, joint);
        }
        let spring = windows.judge(Gear::Spring)?;
        let hysteresis = windows.judge(Gear::Hysteresis)?;
        let best = match hysteresis.is_better_than(&spring) {
            true => hysteresis,
            false => spring,
        };
        let mut told = windows.told(&best, &windows.torque, joint)?;
        // The torque is the bodies': what they have wrong is wrong in all of it.
        let share = bodies_known(data, joint);
        let and = |[value, std]: &mut [f64; 2]| *std = std.hypot(share * *value);
        and(&mut told.stiffness);
        if let Some(Beside::Hysteresis { friction, .. }) = &mut told.beside {
            and(friction);
        }
        Some(told)
    }

    /// The effects of the catalogue that it is: each parameter's value and standard deviation.
    pub(crate) fn effects(&self) -> Vec<(Place, Vec<[f64; 2]>)> {
        let [k, std] = self.stiffness;
        let gives = k.is_finite() && k > LEAST_Z * std;
        let spring = gives.then(|| (EffectKind::Elasticity, vec![[1.0 / k, std / (k * k)]]));
        let beside = self.beside.map(|beside| match beside {
            Beside::Hysteresis { friction, way } => {
                (EffectKind::ElasticHysteresis, vec![friction, way])
            }
            Beside::Play { gap } => (EffectKind::Backlash, vec![gap]),
        });
        let all = spring.into_iter().chain(beside);
        all.map(|(effect, values)| ((effect, self.joint), values))
            .collect()
    }
}

/// How well the bodies are known that a joint moves: the relative deviation of the first one's mass.
fn bodies_known(data: &LimbData, joint: usize) -> f64 {
    let body = data.body_of(joint);
    let mass = data.model.inertia(body).mass();
    let identified = data.model.inertia_std(body).map(|std| std[0] / mass);
    identified.unwrap_or_else(|| data.model.cad_uncertainty(body))
}

/// What is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Gear {
    /// The torque, by the twist.
    Spring,
    /// The torque, by the twist and the state of friction.
    Hysteresis,
    /// The twist, by the torque.
    Straight,
    /// The twist, by the torque and its sign.
    Play,
}

/// A gear fitted.
struct Judged {
    gear: Gear,
    /// Of the first column, of the second, and the way: value and standard deviation.
    numbers: [[f64; 2]; 3],
    /// What is left of each fold under the fit to the others.
    by_fold: Vec<f64>,
}

impl Judged {
    fn left(&self) -> f64 {
        self.by_fold.iter().sum()
    }

    fn is_better_than(&self, plain: &Self) -> bool {
        let falls: Vec<f64> = (plain.by_fold.iter().zip(&self.by_fold))
            .map(|(plain, own)| plain - own)
            .collect();
        let (mean, error) = mean(&falls);
        mean > SURE * error
            && falls.iter().sum::<f64>() > LEAST_GAIN * plain.left()
            && self
                .numbers
                .iter()
                .all(|[value, std]| *value >= -SURE * std)
            && self.numbers[1][0] > LEAST_Z * self.numbers[1][1]
    }
}

/// The mean and its standard error.
fn mean(x: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let spread: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, (spread / (n * (n - 1.0))).sqrt())
}

/// Means over windows.
struct Windows {
    /// Twist (rad) and torque between link and motor (N m).
    twist: Vec<f64>,
    torque: Vec<f64>,
    /// Mean velocity of the twist, rad/s.
    rate: Vec<f64>,
    /// Half the torque's sign.
    side: Vec<f64>,
    /// Whether the torque is larger than it is half of the time.
    pressed: Vec<bool>,
    fold: Vec<usize>,
    /// Ways that are tried (rad), with the state of friction.
    ways: Vec<(f64, Vec<f64>)>,
}

impl Windows {
    fn of(data: &LimbData, values: &Values, joint: usize) -> Option<Self> {
        let motion = &data.motion;
        let link = motion.link(joint)?;
        let twist: Vec<f64> = (motion.joint[joint].state.iter().zip(&link.state))
            .map(|(motor, link)| motor[0] - link[0])
            .collect();
        let load = motion.load(&data.body, values, (false, 0.0));
        let torque = |k: usize| load.smooth(k, joint, data.joints());
        let chosen: Vec<usize> = (0..motion.windows.len())
            .filter(|w| !data.left_out[*w])
            .collect();
        let mean = |x: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let of = |w: &usize| motion.mean(&motion.windows[*w], x);
            chosen.iter().map(of).collect()
        };
        let own = mean(&|k| twist[k]);
        let range = range(&own)?;
        let way = |n: i32| {
            let way = SHORTEST * LONGER.powi(n) * range;
            let of = |stretch: &std::ops::Range<usize>| {
                hysteresis(twist[stretch.clone()].iter().copied(), way)
            };
            let states: Vec<f64> = motion.stretches.iter().flat_map(of).collect();
            (way, mean(&|k| states[k]))
        };
        let rate = chosen.iter().map(|w| {
            let window = &motion.windows[*w];
            let [first, last] = window.samples;
            (twist[last] - twist[first]) / window.length
        });
        let pull = mean(&torque);
        let middle = median(pull.iter().map(|x| x.abs()).collect());
        let windows = Self {
            ways: (0..WAYS).map(way).collect(),
            rate: rate.collect(),
            pressed: pull.iter().map(|x| x.abs() > middle).collect(),
            torque: pull,
            side: mean(&|k| 0.5 * torque(k).signum()),
            fold: chosen.iter().map(|w| data.fold(*w)).collect(),
            twist: own,
        };
        let folds = windows.by_fold(&windows.torque, &|w| windows.pressed[w]);
        (folds.len() > 1 && folds.iter().all(|square| *square > 0.0)).then_some(windows)
    }

    /// What a gear says, if it tells enough of `what` it is to tell.
    fn told(&self, best: &Judged, what: &[f64], joint: usize) -> Option<Twist> {
        let in_play = matches!(best.gear, Gear::Straight | Gear::Play);
        let all = self.by_fold(what, &|w| !in_play || self.pressed[w]);
        let each: Vec<f64> = (best.by_fold.iter().zip(&all))
            .map(|(left, all)| 1.0 - left / all)
            .collect();
        let told = 1.0 - best.left() / all.iter().sum::<f64>();
        let [first, second, way] = best.numbers;
        let (stiffness, beside) = match best.gear {
            Gear::Spring => (first, None),
            Gear::Hysteresis => {
                let friction = second;
                (first, Some(Beside::Hysteresis { friction, way }))
            }
            Gear::Straight | Gear::Play => {
                let [compliance, std] = first;
                let stiffness = [1.0 / compliance, std / (compliance * compliance)];
                let gap = self.gap();
                (stiffness, Some(Beside::Play { gap }))
            }
        };
        let sure = stiffness[0] > LEAST_Z * stiffness[1] || best.gear == Gear::Play;
        (told > LEAST_TOLD && sure).then(|| Twist {
            joint,
            rms: (self.by_fold(&self.twist, &|_| true).iter().sum::<f64>()
                / self.twist.len() as f64)
                .sqrt(),
            told: [told, mean(&each).1],
            stiffness,
            beside,
        })
    }

    /// How far apart the twist is on either side of a play, by medians, which a link on its way does not move; rad.
    fn gap(&self) -> [f64; 2] {
        let middle = |side: f64, chosen: &dyn Fn(usize) -> bool| {
            let there =
                |w: &usize| chosen(self.fold[*w]) && self.pressed[*w] && self.side[*w] == side;
            let own = (0..self.fold.len()).filter(there);
            median(own.map(|w| self.twist[w]).collect())
        };
        let between = |chosen: &dyn Fn(usize) -> bool| middle(0.5, chosen) - middle(-0.5, chosen);
        let all = between(&|_| true);
        let folds = self.fold.iter().max().map_or(0, |most| most + 1);
        let others = (0..folds).map(|fold| (between(&|own| own != fold) - all).powi(2));
        let share = (folds as f64 - 1.0) / folds as f64;
        [all, (share * others.sum::<f64>()).sqrt()]
    }

    /// Sums of squares of the chosen windows about their mean, fold by fold.
    fn by_fold(&self, x: &[f64], chosen: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let own: Vec<usize> = (0..x.len()).filter(|w| chosen(*w)).collect();
        let mean = own.iter().map(|w| x[*w]).sum::<f64>() / own.len() as f64;
        let mut squares = vec![0.0; self.fold.iter().max().map_or(0, |most| most + 1)];
        for w in own {
            squares[self.fold[w]] += (x[w] - mean).powi(2);
        }
        squares
    }

    /// A gear fitted to all windows, and to all but each fold's.
    fn judge(&self, gear: Gear) -> Option<Judged> {
        let folds = self.fold.iter().max()? + 1;
        let (_, all) = self.best(gear, &|_| true)?;
        let (mut by_fold, mut spread) = (Vec::new(), [0.0; 3]);
        for fold in 0..folds {
            let (form, own) = self.best(gear, &|other| other != fold)?;
            by_fold.push(self.left(&form, &own, &|other| other == fold));
            for (spread, (one, all)) in spread.iter_mut().zip(own.told().iter().zip(all.told())) {
                *spread += (one - all).powi(2);
            }
        }
        // The jackknife's deviation (Efron & Stein 1981).
        let share = (folds as f64 - 1.0) / folds as f64;
        let told = all.told();
        Some(Judged {
            gear,
            numbers: std::array::from_fn(|n| [told[n], (share * spread[n]).sqrt()]),
            by_fold,
        })
    }

    /// The form of a gear that leaves least of the chosen folds, and its numbers.
    fn best(&self, gear: Gear, chosen: &dyn Fn(usize) -> bool) -> Option<(Form<'_>, Numbers)> {
        let solved = self.forms(gear).into_iter().filter_map(|form| {
            let numbers = form.solve(&self.windows(&form, chosen))?;
            Some((self.left(&form, &numbers, chosen), form, numbers))
        });
        let best = solved.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((best.1, best.2))
    }

    fn forms<'a>(&'a self, gear: Gear) -> Vec<Form<'a>> {
        let spring = Form {
            told: &self.torque,
            columns: vec![&self.twist, &self.rate],
            second: 2,
            way: 0.0,
            in_play: false,
        };
        let straight = Form {
            told: &self.twist,
            columns: vec![&self.torque],
            second: 1,
            way: 0.0,
            in_play: true,
        };
        let and = |form: &Form<'a>, column: &'a [f64], way: f64| {
            let mut columns = form.columns.clone();
            columns.push(column);
            Form {
                columns,
                way,
                ..*form
            }
        };
        match gear {
            Gear::Spring => vec![spring],
            Gear::Hysteresis => (self.ways.iter())
                .map(|(way, state)| and(&spring, state, *way))
                .collect(),
            Gear::Straight => vec![straight],
            Gear::Play => vec![and(&straight, &self.side, 0.0)],
        }
    }

    /// The windows of the chosen folds that a form is judged in.
    fn windows(&self, form: &Form, chosen: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let judged = |w: &usize| chosen(self.fold[*w]) && (!form.in_play || self.pressed[*w]);
        (0..self.fold.len()).filter(judged).collect()
    }

    fn left(&self, form: &Form, numbers: &Numbers, chosen: &dyn Fn(usize) -> bool) -> f64 {
        let windows = self.windows(form, chosen).into_iter();
        windows
            .map(|w| (form.told[w] - form.predicted(numbers, w)).powi(2))
            .sum()
    }
}

/// What is told by which columns.
struct Form<'a> {
    told: &'a [f64],
    columns: Vec<&'a [f64]>,
    /// The place of the column that makes it rich.
    second: usize,
    /// Of the state of friction, rad.
    way: f64,
    /// Whether only windows with a large torque count.
    in_play: bool,
}

/// What goes with an offset and the columns.
struct Numbers {
    numbers: Vec<f64>,
    second: usize,
    way: f64,
}

impl Numbers {
    /// Of the first column, of the one that makes it rich, and the way.
    fn told(&self) -> [f64; 3] {
        let second = self.numbers.get(1 + self.second);
        [self.numbers[1], second.copied().unwrap_or(0.0), self.way]
    }
}

impl Form<'_> {
    fn predicted(&self, numbers: &Numbers, w: usize) -> f64 {
        let columns = self.columns.iter().zip(&numbers.numbers[1..]);
        numbers.numbers[0] + columns.map(|(x, number)| x[w] * number).sum::<f64>()
    }

    /// Least squares; columns in units of their size, since torques and twists are of different orders.
    fn solve(&self, windows: &[usize]) -> Option<Numbers> {
        let count = 1 + self.columns.len();
        let at = |w: usize, n: usize| if n == 0 { 1.0 } else { self.columns[n - 1][w] };
        let size = |n: usize| {
            let square: f64 = windows.iter().map(|w| at(*w, n).powi(2)).sum();
            square.sqrt().max(f64::MIN_POSITIVE)
        };
        let sizes: Vec<f64> = (0..count).map(size).collect();
        let rows = DMatrix::from_fn(windows.len(), count, |r, c| at(windows[r], c) / sizes[c]);
        let told = DVector::from_fn(windows.len(), |r, _| self.told[windows[r]]);
        let solved = rows.tr_mul(&rows).cholesky()?.solve(&rows.tr_mul(&told));
        Some(Numbers {
            numbers: (0..count).map(|n| solved[n] / sizes[n]).collect(),
            second: self.second,
            way: self.way,
        })
    }
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_unstable_by(f64::total_cmp);
    x.get(x.len() / 2).copied().unwrap_or(0.0)
}

/// From the least to the greatest, but for the outermost hundredths; `None` if nothing moves.
fn range(x: &[f64]) -> Option<f64> {
    let mut sorted = x.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let out = sorted.len() / 100;
    let range = sorted.get(sorted.len().checked_sub(1 + out)?)? - sorted.get(out)?;
    (range > 0.0).then_some(range)
}

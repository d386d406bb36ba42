//! Models of a gear, fitted to the twist and the torque of a limb's windows by least squares.
//!
//! A spring is regressed on x and not x on L: the encoders' noise is next to nothing, what the bodies have wrong is not. Of a play it is x
//! on L, since in the gap there is a twist and no torque.

use nalgebra::{DMatrix, DVector};

use super::LEAST_TOLD;
use super::windows::{LONGER, Windows, jackknife, mean};

/// What is believed must be so many standard deviations.
pub(super) const LEAST_Z: f64 = 5.0;
/// A richer gear must leave less by so many standard errors, and by this share of what the plainer one leaves.
const SURE: f64 = 2.0;
const LEAST_GAIN: f64 = 0.05;

/// What a gear may be like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum GearModel {
    /// The torque, by the twist and its rate.
    Spring,
    /// The same, and by the state of friction.
    Hysteresis,
    /// The twist, by the torque.
    Straight,
    /// The same, and by the torque's sign.
    Backlash,
}

/// A model fitted.
pub(super) struct Fitted {
    pub(super) model: GearModel,
    /// What goes with the first column and with the one that makes it rich, and the displacement: values and standard deviations.
    pub(super) numbers: [[f64; 2]; 3],
    /// What is left of each fold under the fit to the others, a sum of squares.
    pub(super) left: Vec<f64>,
}

impl Fitted {
    pub(super) fn is_better_than(&self, plain: &Self) -> bool {
        let falls: Vec<f64> = (plain.left.iter().zip(&self.left))
            .map(|(plain, own)| plain - own)
            .collect();
        let (fall, error) = mean(&falls);
        let [value, std] = self.numbers[1];
        let can_be = |[value, std]: &[f64; 2]| *value >= -SURE * std;
        fall > SURE * error
            && falls.iter().sum::<f64>() > LEAST_GAIN * plain.left.iter().sum::<f64>()
            && self.numbers.iter().all(can_be)
            && value > LEAST_Z * std
    }
}

impl Windows {
    /// A model fitted to all windows, and to all but each fold's.
    pub(super) fn fit(&self, model: GearModel) -> Option<Fitted> {
        let (_, all) = self.best(model, &|_| true)?;
        let (mut left, mut without) = (Vec::new(), Vec::new());
        for fold in 0..self.folds() {
            let (form, own) = self.best(model, &|other| other != fold)?;
            left.push(self.left(&form, &own, &|other| other == fold));
            without.push(own.told());
        }
        let told = all.told();
        // The displacement is one of a grid: it is anywhere between two of them.
        let grid = [0.0, 0.0, LONGER.ln() / 12f64.sqrt() * told[2]];
        let number = |n: usize| {
            let spread = jackknife(told[n], without.iter().map(|own| own[n]));
            [told[n], spread.hypot(grid[n])]
        };
        Some(Fitted {
            model,
            numbers: std::array::from_fn(number),
            left,
        })
    }

    /// The share of the variance of `what` in the chosen windows that a gear tells, and its standard error; `None` if it is too little.
    pub(super) fn told(
        &self,
        fitted: &Fitted,
        what: &[f64],
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<[f64; 2]> {
        let all = self.by_fold(what, chosen);
        let each: Vec<f64> = (fitted.left.iter().zip(&all))
            .map(|(left, all)| 1.0 - left / all)
            .collect();
        let told = 1.0 - fitted.left.iter().sum::<f64>() / all.iter().sum::<f64>();
        (told > LEAST_TOLD).then(|| [told, mean(&each).1])
    }

    /// The form of a model that leaves least of the chosen folds, and its numbers.
    fn best(
        &self,
        model: GearModel,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<(Form<'_>, Numbers)> {
        let solved = self.forms(model).into_iter().filter_map(|form| {
            let numbers = form.solve(&self.judged(&form, chosen))?;
            Some((self.left(&form, &numbers, chosen), form, numbers))
        });
        let best = solved.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((best.1, best.2))
    }

    fn forms<'a>(&'a self, model: GearModel) -> Vec<Form<'a>> {
        let spring = Form {
            told: &self.torque,
            columns: vec![&self.twist, &self.rate],
            rich: 2,
            displacement: 0.0,
            pressed_only: false,
        };
        let straight = Form {
            told: &self.twist,
            columns: vec![&self.torque],
            rich: 1,
            displacement: 0.0,
            pressed_only: true,
        };
        let and = |form: &Form<'a>, column: &'a [f64], displacement: f64| {
            let mut columns = form.columns.clone();
            columns.push(column);
            Form {
                columns,
                displacement,
                ..*form
            }
        };
        match model {
            GearModel::Spring => vec![spring],
            GearModel::Hysteresis => (self.friction.iter())
                .map(|(displacement, state)| and(&spring, state, *displacement))
                .collect(),
            GearModel::Straight => vec![straight],
            GearModel::Backlash => vec![and(&straight, &self.side, 0.0)],
        }
    }

    /// The windows of the chosen folds that a form is judged in.
    fn judged(&self, form: &Form, chosen: &dyn Fn(usize) -> bool) -> Vec<usize> {
        let judged =
            |w: &usize| chosen(self.fold[*w]) && (!form.pressed_only || self.is_pressed(*w));
        (0..self.fold.len()).filter(judged).collect()
    }

    fn left(&self, form: &Form, numbers: &Numbers, chosen: &dyn Fn(usize) -> bool) -> f64 {
        let windows = self.judged(form, chosen).into_iter();
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
    rich: usize,
    /// Over which friction builds up, rad.
    displacement: f64,
    /// Whether only windows with a large torque count.
    pressed_only: bool,
}

/// What goes with an offset and the columns.
struct Numbers {
    numbers: Vec<f64>,
    rich: usize,
    displacement: f64,
}

impl Numbers {
    /// Of the first column, of the one that makes it rich, and the displacement.
    fn told(&self) -> [f64; 3] {
        let rich = self.numbers.get(1 + self.rich).copied();
        [self.numbers[1], rich.unwrap_or(0.0), self.displacement]
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
            rich: self.rich,
            displacement: self.displacement,
        })
    }
}

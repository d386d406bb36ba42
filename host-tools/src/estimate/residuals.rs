//! What a fit predicts, and what it leaves: of the data that it was made of, and of those that it has not seen.

use nalgebra::DVector;
use proprio_core::effect::{EffectKind, Form};
use proprio_core::inertia::INERTIAL;

use super::bounded::Problem;
use super::deviation::BlockScore;
use super::fit::LimbFit;
use super::groups::{Group, stacked};
use super::limb_data::LimbData;
use super::method::Method;
use crate::equation::column::depends_on_values;
use crate::equation::dot::dot;
use crate::equation::reversal::DryFriction;
use crate::equation::values::{Place, Values};
use crate::parallel::side_by_side;

/// Whether an effect is a scale of the reported torque.
fn is_scale(effect: EffectKind) -> bool {
    effect.description().form == Form::Scale
}

impl LimbFit<'_> {
    /// What the estimate predicts, N m.
    pub(crate) fn predicted(&self) -> Vec<f64> {
        if self.is_linear() {
            return self.predicted_by_columns(std::slice::from_ref(&self.solution.theta), &|_| 0);
        }
        self.data.predicted(&self.values, &|_| true)
    }

    /// The same of models fitted to the data of all folds but one, each of the windows of that one; `None` where one cannot be solved
    /// for.
    pub(crate) fn predicted_held_out(&self) -> Option<Vec<f64>> {
        if self.is_linear() {
            let theta = self.held_out_theta()?;
            return Some(self.predicted_by_columns(&theta, &|w| self.data.fold(w)));
        }
        Some(self.data.predicted_by_fold(&self.held_out()?))
    }

    /// Whether the predictor is linear in all that is fitted but the torques' scales: it is then the sum of the columns, window for
    /// window.
    fn is_linear(&self) -> bool {
        let is_fixed =
            |place: &Place| self.places.contains(place) || place.0.description().is_derivative();
        let mut effects = self.columns.entries.iter().filter_map(|e| e.effect);
        effects.all(|effect| is_scale(effect) || !depends_on_values(effect))
            && self.at.places().all(|place| is_fixed(&place))
            && !(self.at.places()).any(|place| place.0.description().transmission().is_some())
    }

    /// What the joints' columns are times under θ: those of scales nothing, and the others as much more as the scale is less.
    fn scaled(&self, theta: &DVector<f64>) -> Vec<Vec<f64>> {
        let mut plain = theta.clone();
        let mut scales = vec![1.0; self.data.joints()];
        for (k, entry) in self.columns.entries.iter().enumerate() {
            if entry.effect.is_some_and(is_scale) {
                let gain = (self.data).value(&self.at, &self.columns, k, theta.as_slice());
                let at = self.at.torque_gain(entry.joint);
                scales[entry.joint] = at / gain;
                plain[k] = 0.0;
            }
        }
        let mut own = self.columns.combined(plain.as_slice());
        for (own, scale) in own.iter_mut().zip(scales) {
            own.iter_mut().for_each(|x| *x *= scale);
        }
        own
    }

    /// What θ over the columns predicts, each window by the one that `of` tells.
    fn predicted_by_columns(
        &self,
        theta: &[DVector<f64>],
        of: &dyn Fn(usize) -> usize,
    ) -> Vec<f64> {
        let (data, n) = (self.data, self.data.joints());
        let rows = data.rows(&self.at, &self.columns);
        let own: Vec<_> = theta.iter().map(|theta| self.scaled(theta)).collect();
        let mut torque = vec![0.0; data.torque.len()];
        for w in (0..data.motion.windows.len()).filter(|&w| !data.left_out[w]) {
            for (j, torque) in torque[w * n..(w + 1) * n].iter_mut().enumerate() {
                *torque = dot(&own[of(w)][j], rows.row(w, j));
            }
        }
        torque
    }

    /// Models fitted to the data of all folds but one, in the order of the folds.
    pub(crate) fn held_out(&self) -> Option<Vec<Values>> {
        let moved =
            |theta: &DVector<f64>| self.data.moved(&self.at, &self.columns, theta.as_slice());
        Some(self.held_out_theta()?.iter().map(moved).collect())
    }

    /// θ fitted to the data of all folds but one, in the order of the folds.
    fn held_out_theta(&self) -> Option<Vec<DVector<f64>>> {
        let blocks = &self.data.blocks;
        let trains = self.groups.without_each(blocks.folds, |b| blocks.fold(b));
        let solved = |train: &Vec<Group>| {
            let problem = Problem {
                data: stacked(train, &self.noise),
                ..self.problem.clone()
            };
            problem.theta_from(&self.solution.theta)
        };
        side_by_side(&trains, solved).into_iter().collect()
    }

    /// The data without the windows in which a joint reports more, at any moment, than the limit that the model gives its drive: what is
    /// asked for there is anything.
    pub(crate) fn below_limits(&self) -> LimbData<'_> {
        let (data, n) = (self.data, self.data.joints());
        let limited = self
            .values
            .places()
            .filter(|place| place.0.description().is_limit());
        let limits: Vec<(usize, f64)> = limited
            .map(|place| (place.1, self.values.get(place, 0)))
            .collect();
        let is_out = |w: usize| {
            let [first, last] = data.motion.windows[w].samples;
            let most = |j: usize| {
                let reported = (first..=last).map(|k| data.recording.tau[k * n + j].abs());
                reported.fold(0.0, f64::max)
            };
            let mut limits = limits.iter();
            data.left_out[w] || limits.any(|&(j, limit)| most(j) > limit)
        };
        let left_out: Vec<bool> = (0..data.left_out.len()).map(is_out).collect();
        data.clone().leaving_out(&left_out)
    }

    /// By how many times its noise more a joint's residual may be large in each of the windows of `data` that count, in their order: for friction that may
    /// hold the joint, and for motion that its channels do not tell.
    pub(crate) fn doubt(&self, data: &LimbData, joint: usize) -> Vec<f64> {
        let unfollowed = data.motion.unfollowed(&data.body, &self.values, joint);
        let windows = unfollowed.iter().enumerate();
        let counting = windows.filter(|(w, _)| data.counts(*w, joint));
        let own = self.weights.doubt(data, joint).into_iter();
        own.zip(counting)
            .map(|(doubt, (_, unfollowed))| doubt.hypot(unfollowed / self.noise[joint]))
            .collect()
    }

    /// Sums of squares of what sampling leaves, joint by joint, with samples T apart in windows of length L: where a joint turns round
    /// at a moment that is known to a sample and no better, dry friction F makes 2 F T / (√12 L); and the trapezoidal rule is wrong by
    /// T²/12 of the torque's slopes at the window's ends, one less the other, over L (Euler and Maclaurin).
    pub(crate) fn left_by_sampling(&self) -> Vec<f64> {
        let (data, n, period) = (self.data, self.data.joints(), self.data.recording.period());
        let own = self.columns.combined(self.solution.theta.as_slice());
        let friction = DryFriction {
            motion: &data.motion,
            columns: &self.columns,
            numbers: &own,
        };
        let mut squares = vec![0.0; n];
        for (w, window) in data.motion.windows.iter().enumerate() {
            let [first, last] = window.samples;
            for j in (0..n).filter(|&j| data.counts(w, j)) {
                let rise =
                    |k: usize| data.recording.tau[(k + 1) * n + j] - data.recording.tau[k * n + j];
                let turn = 2.0 * friction.jump(window, j) / 12f64.sqrt();
                let curve = (rise(last - 1) - rise(first)) / 12.0;
                squares[j] += (turn * turn + curve * curve) * (period / window.length).powi(2);
            }
        }
        squares
    }

    /// Sums of squares of what the estimate predicts, by the predictor; each group's by another equation.
    pub(crate) fn squares(&self) -> Vec<f64> {
        match self.method {
            Method::Momentum => self.data.squares(&self.predicted()).by_joint(),
            _ => self.group_squares(&self.solution.theta, |_| true),
        }
    }

    /// The same of time that the fit has not seen; `None` where nothing can be held out.
    pub(crate) fn held_out_squares(&self) -> Option<Vec<f64>> {
        if self.data.blocks.folds < 2 {
            return None;
        }
        if self.method == Method::Momentum {
            return Some(self.data.squares(&self.predicted_held_out()?).by_joint());
        }
        let mut squares = vec![0.0; self.all.len()];
        for (fold, theta) in self.held_out_theta()?.iter().enumerate() {
            let own = self.group_squares(theta, |b| self.data.blocks.fold(b) == fold);
            squares
                .iter_mut()
                .zip(own)
                .for_each(|(sum, own)| *sum += own);
        }
        Some(squares)
    }

    /// Sums of squares under θ, group by group.
    pub(crate) fn group_squares(
        &self,
        theta: &DVector<f64>,
        chosen: impl Fn(usize) -> bool,
    ) -> Vec<f64> {
        let rows = self.groups.sum(chosen);
        rows.iter().map(|rows| rows.sum_of_squares(theta)).collect()
    }

    /// Sums of squares of the CAD's rigid body without any effect, by another equation than momentum's.
    pub(crate) fn cad_squares(&self) -> Vec<f64> {
        let mut cad = self.problem.start();
        cad.rows_mut(
            INERTIAL * self.problem.bodies.len(),
            self.problem.others.len(),
        )
        .fill(0.0);
        self.group_squares(&cad, |_| true)
    }

    /// What each block of time that has rows says at the solution, beside its number.
    pub(crate) fn block_scores(&self) -> impl Iterator<Item = (usize, BlockScore)> + '_ {
        let blocks = self.groups.blocks.iter().enumerate();
        let told = blocks.filter(|(_, block)| block.iter().any(|rows| rows.count() > 0.0));
        told.map(|(n, block)| {
            let rows = stacked(block, &self.noise);
            (n, BlockScore::of(rows, &self.solution.theta))
        })
    }
}

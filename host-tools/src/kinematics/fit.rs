//! A fit of chosen parameters to poses: linearised again until it stands, with the noise that its residuals show.

use nalgebra::{DMatrix, DVector};

use super::chain::{Chain, State};
use super::columns::{self, Column, Noise, Rows, Unknown};
use super::held_out::{self, HeldOut, Solved};
use super::poses::{Pose, Poses};
use super::start;

/// Most linearisations of one fit.
const ITERATIONS: usize = 8;
/// A fit stands when no parameter moves by more than this share of its prior (mount and targets: 1 µm, 1 µrad), …
const SETTLED: f64 = 1e-3;
/// … and the noise by no more than this share.
const NOISE_SETTLED: f64 = 0.03;
/// No measurement is better, m and rad: what is computed without error has this noise.
const LEAST_NOISE: Noise = Noise {
    place: 1e-8,
    turn: 1e-8,
};

/// What does not change from fit to fit.
pub(super) struct Problem<'a> {
    pub(super) chain: &'a Chain,
    pub(super) poses: &'a Poses,
    /// Poses that are used, by their places.
    pub(super) used: Vec<usize>,
}

/// A fit.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) columns: Vec<Column>,
    pub(super) state: State,
    pub(super) noise: Noise,
    pub(super) rows: Rows,
    pub(super) solved: Solved,
    pub(super) held_out: HeldOut,
}

impl Problem<'_> {
    /// The used poses.
    pub(super) fn used(&self) -> Vec<(usize, &Pose)> {
        self.used
            .iter()
            .map(|&n| (n, &self.poses.poses[n]))
            .collect()
    }

    /// Fits these columns, beginning at a state with this noise.
    pub(super) fn fit(&self, columns: Vec<Column>, state: &State, noise: Noise) -> Fit {
        let used = self.used();
        let (mut state, mut noise) = (state.clone(), noise);
        let mut last = None;
        for _ in 0..ITERATIONS {
            let rows = columns::rows(self.chain, &state, &used, &columns, noise);
            let prior = columns
                .iter()
                .map(|c| (c.mean - state.value(self.chain, c.unknown)) / c.prior);
            let solved = held_out::solve(&rows, &DVector::from_iterator(columns.len(), prior));
            let shown = shown_noise(&rows, &solved, noise);
            let same = |a: f64, b: f64| (a / b - 1.0).abs() < NOISE_SETTLED;
            let is_settled =
                columns
                    .iter()
                    .zip(solved.step.iter())
                    .all(|(c, step)| match c.unknown {
                        Unknown::Mount(_) | Unknown::Target(..) => (c.prior * step).abs() < 1e-6,
                        _ => step.abs() < SETTLED,
                    });
            let steps = columns.iter().zip(solved.step.iter());
            let steps: Vec<(Unknown, f64)> = steps.map(|(c, s)| (c.unknown, c.prior * s)).collect();
            state = state.stepped(self.chain, &steps);
            let done = is_settled && same(shown.place, noise.place) && same(shown.turn, noise.turn);
            last = Some((rows, solved, noise));
            if done {
                break;
            }
            noise = shown;
        }
        // There is one: the loop runs at least once.
        let (rows, solved, noise) = last.unwrap_or_else(|| {
            let rows = columns::rows(self.chain, &state, &used, &columns, noise);
            let solved = held_out::solve(&rows, &DVector::zeros(columns.len()));
            (rows, solved, noise)
        });
        let held_out = solved.held_out(&rows);
        Fit {
            columns,
            state,
            noise,
            rows,
            solved,
            held_out,
        }
    }

    /// Mount and targets alone.
    pub(super) fn fit_fixtures(&self, state: &State) -> Fit {
        let columns = start::columns(state, &self.used());
        self.fit(columns, state, start::UNKNOWN_NOISE)
    }
}

/// The noise by what the rows leave, each row counted less what the parameters take of it.
fn shown_noise(rows: &Rows, solved: &Solved, noise: Noise) -> Noise {
    let mut sums = [[0.0; 2]; 2];
    for (k, left) in solved.left.iter().enumerate() {
        let sum = &mut sums[usize::from(!rows.is_place[k])];
        sum[0] += left * left;
        sum[1] += 1.0 - solved.q.row(k).norm_squared();
    }
    let of = |[squares, freedom]: [f64; 2], was: f64, least: f64| {
        if freedom > 0.5 && squares > 0.0 {
            (was * (squares / freedom).sqrt()).max(least)
        } else {
            was
        }
    };
    Noise {
        place: of(sums[0], noise.place, LEAST_NOISE.place),
        turn: of(sums[1], noise.turn, LEAST_NOISE.turn),
    }
}

impl Fit {
    /// Held-out squared errors by pose, in units of a noise: two fits are compared in the units of one.
    pub(super) fn by_pose(&self, noise: Noise) -> Vec<f64> {
        let scaled = HeldOut::from_fn(self.held_out.len(), |k, _| {
            let ratio = if self.rows.is_place[k] {
                self.noise.place / noise.place
            } else {
                self.noise.turn / noise.turn
            };
            self.held_out[k] * ratio
        });
        held_out::by_pose(&self.rows, &scaled)
    }

    /// Held-out error, root mean square distance, mm.
    pub(super) fn error_mm(&self) -> f64 {
        1e3 * held_out::place_rms(&self.rows, &self.held_out)
    }

    /// Held-out error of orientations, mrad; none where none is measured.
    pub(super) fn turn_mrad(&self) -> Option<f64> {
        let turns = (0..self.held_out.len()).filter(|&k| !self.rows.is_place[k]);
        let squares: f64 = turns
            .clone()
            .map(|k| (self.held_out[k] * self.rows.unit[k]).powi(2))
            .sum();
        let count = turns.count();
        (count > 0).then(|| 1e3 * (3.0 * squares / count as f64).sqrt())
    }

    /// Values and standard deviations of all columns.
    pub(super) fn values(&self, chain: &Chain) -> Vec<(Column, f64, f64)> {
        let std = self.solved.std_by_scatter(&self.rows, &self.held_out);
        let columns = self.columns.iter().zip(std.iter());
        columns
            .map(|(column, std)| {
                let value = self.state.value(chain, column.unknown);
                (*column, value, std * column.prior)
            })
            .collect()
    }

    /// Columns of further unknowns, scaled, at where the fit stands.
    pub(super) fn more(&self, problem: &Problem, columns: &[Column]) -> DMatrix<f64> {
        columns::rows(
            problem.chain,
            &self.state,
            &problem.used(),
            columns,
            self.noise,
        )
        .w
    }
}

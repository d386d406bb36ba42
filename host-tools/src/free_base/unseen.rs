//! Feet that carry a force while they are taken to be in the air: a wrong stance.
//!
//! Such a window is left out with all others that no model explains (`outside`), so that no fit has seen it. It is made once more with each foot
//! that was in the air projected out. Where what is left is then as in a good window, the force was at that foot: a push on the trunk or a
//! blow on another leg leaves as much as before. A force that does not make a window stand out is not seen here. Slip is none of this: whatever
//! force a foot that slips carries, it is projected out like that of one that does not.

use serde::Serialize;

use super::moved_readings::MovedReadings;
use super::outside::{self, MANY, Squares};
use super::row_setup::RowSetup;
use super::rows::Linearised;
use super::stance::Stance;
use super::walk::Walk;
use super::walks::Walks;

/// A window of which no more than so many times the usual is left is a good one, root mean square (`outside`).
const GOOD: f64 = 2.0;

/// A foot that carries a force in windows in which it is taken to be in the air.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnseenFoot {
    /// Whose foot.
    pub leg: String,
    /// In how many windows.
    pub windows: u64,
    /// As a share of those in which it is taken to be in the air.
    pub share: f64,
    /// Root mean square of what the fit, which has not seen these windows, leaves of their equations, N m: as they are, and with the foot projected
    /// out.
    pub rms: [f64; 2],
}

impl UnseenFoot {
    /// For a user.
    pub(super) fn words(&self) -> String {
        let Self {
            leg,
            windows,
            share,
            rms: [before, after],
        } = self;
        format!(
            "the foot of {leg} carries a force in {windows} windows ({:.0} % of those) in which it is taken to be in the air: {before:.3} → {after:.3} \
             N m on these, unseen, once it is projected out; they are left out",
            100.0 * share
        )
    }
}

/// The feet that carry a force unseen, by a fit at whose parameters `setup` is; `outside` is when windows begin that are left out, log after log, µs in
/// order.
pub(super) fn feet(walks: &Walks, setup: &RowSetup, outside: &[Vec<u64>]) -> Vec<UnseenFoot> {
    let theta = &setup.theta;
    let asked = |k: usize| theta[k] != 0.0;
    // At the fit's own sensors nothing is moved.
    let at = Linearised {
        setup,
        moved: &MovedReadings::default(),
    };
    let names = walks.robot.feet.iter().map(|foot| &foot.name);
    let count = names.len();
    let mut feet = vec![Tally::default(); count];
    for ((walk, stance), outside) in walks.walks.iter().zip(outside) {
        let as_it_is = outside::squares(walk, stance, at, asked, |_| theta);
        let Some(usual) = outside::usual(as_it_is.iter()) else {
            continue;
        };
        let of = |leg: usize| match loaded_in(walk, stance, leg, outside) {
            Some(stance) => outside::squares(walk, &stance, at, asked, |_| theta),
            None => Vec::new(),
        };
        let again: Vec<Vec<Squares>> = (0..count).map(of).collect();
        for own in &as_it_is {
            let first = walk.time_us.partition_point(|t| *t < own.start_us);
            let is_in_air = |leg: &usize| !stance.loaded[first][*leg];
            (0..count)
                .filter(is_in_air)
                .for_each(|leg| feet[leg].air += 1);
            if outside.binary_search(&own.start_us).is_err() {
                continue;
            }
            let with = |leg: usize| {
                let found = again[leg].binary_search_by_key(&own.start_us, |s| s.start_us);
                Some((leg, again[leg][found.ok()?]))
            };
            let best = (0..count).filter(is_in_air).filter_map(with);
            let best = best.min_by(|a, b| a.1.mean().total_cmp(&b.1.mean()));
            if let Some((leg, after)) = best.filter(|(_, s)| s.mean() <= GOOD * GOOD * usual) {
                feet[leg].add(own, &after);
            }
        }
    }
    let told = feet.iter().zip(names).map(|(own, name)| own.told(name));
    told.flatten().collect()
}

/// A foot's windows.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// In which it is taken to be in the air.
    air: u64,
    /// … and carries a force.
    windows: u64,
    squares: [f64; 2],
    equations: [f64; 2],
}

impl Tally {
    fn add(&mut self, before: &Squares, after: &Squares) {
        self.windows += 1;
        for (k, own) in [before, after].into_iter().enumerate() {
            self.squares[k] += own.sum;
            self.equations[k] += own.equations;
        }
    }

    /// None where it is in so few windows as blows are.
    fn told(&self, name: &str) -> Option<UnseenFoot> {
        let share = self.windows as f64 / self.air.max(1) as f64;
        (share > MANY).then(|| UnseenFoot {
            leg: name.to_owned(),
            windows: self.windows,
            share,
            rms: [0, 1].map(|k| (self.squares[k] / self.equations[k].max(1.0)).sqrt()),
        })
    }
}

/// The stance with this foot loaded all through the windows that begin then; none if it is so already.
fn loaded_in(walk: &Walk, stance: &Stance, leg: usize, starts_us: &[u64]) -> Option<Stance> {
    let (mut changed, mut loaded) = (false, stance.loaded.clone());
    for start_us in starts_us {
        let first = walk.time_us.partition_point(|t| t < start_us);
        let feet = stance.loaded[first].clone();
        let inside = (first..walk.len()).take_while(|n| {
            stance.loaded[*n] == feet && walk.time_us[*n] - start_us <= stance.window_us
        });
        for n in inside.filter(|_| !feet[leg]) {
            loaded[n][leg] = true;
            changed = true;
        }
    }
    changed.then(|| Stance {
        loaded,
        ..stance.clone()
    })
}

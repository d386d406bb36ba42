//! Many starts over the processors; the best motion that is proved to be within the limits.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use serde::Serialize;

use super::cost::Cost;
use super::fourier::Motion;
use super::optimise::{self, Effort, Point, Watch};
use super::problem::Problem;
use super::proof::{self, Violation};

/// What share of the limits a search first keeps to: the rest is for what lies between the samples.
pub(super) const SHARE: f64 = 0.975;
/// By how much the share is drawn in where a proof finds a limit exceeded, and how often.
const DRAWN_IN: f64 = 0.02;
const TRIES: usize = 5;
/// Steps by which a motion is made a little smaller first, how often, and the cost that this may take.
const NUDGE: f64 = 0.996;
const NUDGED: usize = 8;
const NUDGE_COST: f64 = 0.03;
/// Steps by which a motion is made smaller at last, and how often.
const SMALLER: f64 = 0.97;
const SHRUNK: usize = 60;
/// Steps by which a first guess that led nowhere is made smaller, and how often: to a ten-thousandth.
const CALMER: f64 = 0.8;
const CALMED: usize = 41;
/// Speeds of a first guess, as a share of what keeps its series within the velocity limits.
const GUESS: f64 = 0.5;

/// The best cost so far at a moment of a search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Progress {
    /// Since the search began, s.
    pub seconds: f64,
    /// The cost: of the condition number its logarithm.
    pub cost: f64,
}

/// What a search is asked by its caller on its way.
pub trait Supervisor: Sync {
    /// Whether to end now with the best so far.
    fn stop(&self) -> bool;
    /// So many of so many starts are done, with this best cost.
    fn progress(&self, done: usize, of: usize, best: Option<f64>);
}

/// The best motion of a search.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) point: Point,
    pub(super) motion: Motion,
    pub(super) violations: Vec<Violation>,
    pub(super) history: Vec<Progress>,
}

struct Shared {
    /// What each start led to.
    found: Vec<(usize, Point)>,
    history: Vec<Progress>,
    done: usize,
}

struct Search<'a> {
    begun: Instant,
    shared: Mutex<Shared>,
    /// How many searches there will be.
    searches: usize,
    supervisor: &'a dyn Supervisor,
}

impl Search<'_> {
    fn lock(&self) -> std::sync::MutexGuard<'_, Shared> {
        self.shared
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// What was found, best first; of equals the earlier start, so that the result does not hang on which thread was first.
    fn ranked(&self) -> Vec<(usize, Point)> {
        let mut found = self.lock().found.clone();
        found.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost).then(a.0.cmp(&b.0)));
        found
    }

    /// Searches from many points on all processors, and keeps for each start the better of what it had and has.
    fn each(&self, problem: &Problem, goal: &Cost, from: &[(usize, Vec<f64>)], effort: Effort) {
        let next = AtomicUsize::new(0);
        let work = || {
            while let Some((start, x)) = from.get(next.fetch_add(1, Ordering::Relaxed)) {
                if self.stop() {
                    return;
                }
                let point = optimise::from(problem, goal, x, SHARE, effort, self)
                    .or_else(|| calmed(problem, goal, x));
                let mut shared = self.lock();
                if let Some(point) = point {
                    match shared.found.iter_mut().find(|(known, _)| known == start) {
                        Some((_, known)) if known.cost <= point.cost => {}
                        Some((_, known)) => *known = point,
                        None => shared.found.push((*start, point)),
                    }
                }
                shared.done += 1;
                let best = shared
                    .found
                    .iter()
                    .map(|(_, p)| p.cost)
                    .min_by(f64::total_cmp);
                self.supervisor.progress(shared.done, self.searches, best);
            }
        };
        let processors = thread::available_parallelism().map_or(1, std::num::NonZero::get);
        thread::scope(|scope| {
            for _ in 0..processors.min(from.len()) {
                scope.spawn(work);
            }
        });
    }
}

impl Watch for Search<'_> {
    /// Asked to end, a search still goes on to its first motion within the limits: without one there is nothing to keep.
    fn stop(&self) -> bool {
        self.supervisor.stop() && !self.lock().history.is_empty()
    }

    fn better(&self, point: &Point) {
        let seconds = self.begun.elapsed().as_secs_f64();
        let mut shared = self.lock();
        if shared
            .history
            .last()
            .is_none_or(|last| point.cost < last.cost)
        {
            shared.history.push(Progress {
                seconds,
                cost: point.cost,
            });
        }
    }
}

/// Searches from `starts` random motions, all drawn from `seed`; `None` if none of them leads within the limits.
pub(super) fn search(
    problem: &Problem,
    goal: &Cost,
    repeats: u32,
    seed: u64,
    starts: usize,
    supervisor: &dyn Supervisor,
) -> Option<Found> {
    // A quarter of the starts is worth a closer look, and the best of all another.
    let closer = starts.div_ceil(4);
    let search = Search {
        begun: Instant::now(),
        shared: Mutex::new(Shared {
            found: Vec::new(),
            history: Vec::new(),
            done: 0,
        }),
        searches: starts + closer + 1,
        supervisor,
    };
    let first: Vec<_> = (0..starts)
        .map(|start| (start, guess(problem, seed, start as u64)))
        .collect();
    search.each(problem, goal, &first, Effort::FIRST);
    for best in [closer, 1] {
        let points: Vec<_> = search
            .ranked()
            .into_iter()
            .take(best)
            .map(|(n, p)| (n, p.x))
            .collect();
        search.each(problem, goal, &points, Effort::AGAIN);
    }
    let ranked = search.ranked();
    let mut best: Option<(Point, Motion)> = None;
    // One that cannot be proved gives way to the next: made so small that it can, it would tell much less.
    for (_, point) in ranked.iter().take(closer) {
        let found = best.as_ref().map_or(f64::INFINITY, |(best, _)| best.cost);
        if found <= point.cost || (best.is_some() && search.stop()) {
            break;
        }
        let next = proved(problem, goal, point.clone(), repeats, &search);
        best = next.filter(|(next, _)| next.cost < found).or(best);
    }
    let (point, motion, violations) = match best {
        Some((point, motion)) => (point, motion, Vec::new()),
        None => shrunk(problem, goal, ranked.into_iter().next()?.1, repeats)?,
    };
    let history = search.lock().history.clone();
    Some(Found {
        point,
        motion,
        violations,
        history,
    })
}

/// A motion that is proved to be within the limits: this one, or the same a little smaller if that costs little, or the next best within
/// limits drawn in further; none if a proof fails even then.
fn proved(
    problem: &Problem,
    goal: &Cost,
    mut point: Point,
    repeats: u32,
    watch: &Search<'_>,
) -> Option<(Point, Motion)> {
    for tries in 0..=TRIES {
        let motion = problem.motion(&point.x, repeats);
        if proof::violations(problem, &motion).is_empty() {
            return Some((point, motion));
        }
        if tries == 0
            && let Some(nudged) = nudged(problem, goal, &point)
        {
            point = nudged;
            continue;
        }
        let share = SHARE - DRAWN_IN * (tries + 1) as f64;
        let again = (!watch.stop())
            .then(|| optimise::from(problem, goal, &point.x, share, Effort::AGAIN, watch))
            .flatten();
        point = again.or_else(|| smaller(problem, goal, &point, SMALLER))?;
    }
    None
}

/// The same motion, so much smaller that it is proved, and what a proof still finds: towards rest in a pose that is within the limits,
/// every motion is.
fn shrunk(
    problem: &Problem,
    goal: &Cost,
    mut point: Point,
    repeats: u32,
) -> Option<(Point, Motion, Vec<Violation>)> {
    for _ in 0..SHRUNK {
        point = smaller(problem, goal, &point, SMALLER)?;
        let motion = problem.motion(&point.x, repeats);
        if proof::violations(problem, &motion).is_empty() {
            return Some((point, motion, Vec::new()));
        }
    }
    let motion = problem.motion(&point.x, repeats);
    let violations = proof::violations(problem, &motion);
    Some((point, motion, violations))
}

/// The same motion, so much smaller that it is within the limits; `None` if no motion is.
fn calmed(problem: &Problem, goal: &Cost, x: &[f64]) -> Option<Point> {
    let mut x = x.to_vec();
    for _ in 0..CALMED {
        x.iter_mut().for_each(|x| *x *= CALMER);
        let of = problem.evaluate(&x, SHARE);
        let worst = of
            .constraints
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        if worst <= 0.0 {
            let cost = problem.cost(&of, goal)?.cost;
            return Some(Point { x, cost, worst });
        }
    }
    None
}

/// The same motion, so little smaller that it costs little and yet is proved; none if there is none.
fn nudged(problem: &Problem, goal: &Cost, point: &Point) -> Option<Point> {
    let mut next = point.clone();
    for _ in 0..NUDGED {
        next = smaller(problem, goal, &next, NUDGE)?;
        if next.cost > point.cost + NUDGE_COST {
            return None;
        }
        if proof::violations(problem, &problem.motion(&next.x, 1)).is_empty() {
            return Some(next);
        }
    }
    None
}

/// The same motion, smaller by a factor.
fn smaller(problem: &Problem, goal: &Cost, point: &Point, by: f64) -> Option<Point> {
    let x: Vec<f64> = point.x.iter().map(|x| x * by).collect();
    let of = problem.evaluate(&x, 1.0);
    let cost = problem.cost(&of, goal)?.cost;
    let worst = of
        .constraints
        .iter()
        .fold(f64::NEG_INFINITY, |most, c| most.max(*c));
    Some(Point { x, cost, worst })
}

/// A random motion: every wave at about the same speed, smaller with the limits.
pub(super) fn guess(problem: &Problem, seed: u64, start: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(start);
    let modes = problem.basis.modes();
    let mut x = Vec::with_capacity(problem.unknowns());
    for limit in &problem.limits.joints {
        // No faster than what stays within the range at the slower half of the frequencies.
        let range = (limit.position[1] - limit.position[0]).min(std::f64::consts::TAU) / 2.0;
        let frequency =
            std::f64::consts::TAU * problem.basis.harmonics() as f64 / 2.0 / problem.basis.period;
        let speed = limit.velocity.min(range * frequency);
        // Some starts are calm, some wild.
        let size: f64 = random.random_range(0.2..1.0);
        for _ in 0..modes {
            let draw: f64 = random.sample(StandardNormal);
            x.push(GUESS * size * speed * draw / (modes as f64).sqrt());
        }
    }
    x
}

//! Who is polled when: ids, order and period of a leg's motors, learnt from the times of their replies.
//!
//! Nothing of this is documented for the Go2's bus, so a listener begins with what is likely ([`Schedule::LIKELY`]) and
//! replaces it by what the replies say:
//!
//! - *ids*: a motor that was thought to be there and is silent while another id answers [`ID_REPLIES`] times is that other;
//! - *period*: the mean time between two replies of one motor, of intervals in which none was lost: those below 1.5 times
//!   the shortest;
//! - *order*: the motor from which the others follow soonest is polled first. So a cycle begins after the longest pause of
//!   the bus, whatever the ids; where the motors are polled at even intervals, any of them may be called the first.
//!
//! Period and order are taken over when two passes over the replies agree, and looked at again every couple of thousand
//! replies.

use super::MOTORS;

/// Replies of an unknown id that make it a motor, if one of those known is silent meanwhile.
const ID_REPLIES: u8 = 4;
/// Replies after which the count of unknown ids begins anew.
const ID_WINDOW: u16 = 256;

/// Replies whose shortest interval is sought, replies over which times are averaged, and replies that rest then: few while
/// nothing is known, many once something is. Of each motor.
const FIRST_PASS: [u16; 2] = [5, 8];
const LATER_PASS: [u16; 2] = [16, 48];
const REST: u16 = 600;

/// Longest time between two replies of a motor that is measured, µs.
const LONGEST_US: u32 = 1_000_000;

/// When the motors of a leg are polled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule<const M: usize = MOTORS> {
    /// Ids of the motors, ascending.
    pub ids: [u8; M],
    /// How long after the first motor's reply each motor's comes, µs.
    pub offsets_us: [u32; M],
    /// Time from one cycle to the next, µs.
    pub period_us: u32,
    /// The replies have said so; else it is what is likely.
    pub learnt: bool,
}

impl<const M: usize> Schedule<M> {
    /// Ids from 0 on, polled in one go, a thousand times a second at most.
    pub const LIKELY: Self = Self {
        ids: first_ids(),
        offsets_us: [0; M],
        period_us: 1000,
        learnt: false,
    };

    /// Motors, by their place among the ids, in the order in which they are polled.
    pub fn order(&self) -> [usize; M] {
        let mut order = core::array::from_fn(|motor| motor);
        order.sort_unstable_by_key(|&motor| self.offsets_us.get(motor).copied());
        order
    }

    /// Whether `other` says the same, up to an eighth of the period.
    fn agrees(&self, other: &Self) -> bool {
        let tolerance = self.period_us / 8;
        let close = |a: u32, b: u32| a.abs_diff(b) <= tolerance;
        let mut offsets = self.offsets_us.iter().zip(&other.offsets_us);
        self.ids == other.ids
            && close(self.period_us, other.period_us)
            && offsets.all(|(a, b)| close(*a, *b))
    }
}

/// 0, 1, 2 …
const fn first_ids<const M: usize>() -> [u8; M] {
    let mut ids = [0; M];
    let mut motor = 0;
    while motor < M {
        ids[motor] = motor as u8;
        motor += 1;
    }
    ids
}

/// Finds the schedule.
#[derive(Clone, Copy, Debug)]
pub(super) struct Learner<const M: usize> {
    schedule: Schedule<M>,
    /// Which of the schedule's ids answered, and how often each other id, since the count began.
    heard: [bool; M],
    strangers: [u8; 16],
    counted: u16,
    stage: Stage,
    /// Replies left of the stage.
    left: u16,
    last_us: [u64; M],
    shortest_us: u32,
    sums: Sums<M>,
    proposed: Option<Schedule<M>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Shortest,
    Average,
    Rest,
}

/// Sums over one pass.
#[derive(Clone, Copy, Debug)]
struct Sums<const M: usize> {
    period: Mean,
    /// `after[i][j]`: from motor i's reply to the next of motor j.
    after: [[Mean; M]; M],
}

#[derive(Clone, Copy, Debug)]
struct Mean {
    sum: u32,
    count: u32,
}

impl Mean {
    const NONE: Self = Self { sum: 0, count: 0 };

    fn add(&mut self, value: u32) {
        self.sum = self.sum.saturating_add(value);
        self.count += 1;
    }

    /// The mean of at least `least` values.
    fn of(&self, least: u32) -> Option<u32> {
        (self.count >= least)
            .then(|| self.sum.checked_div(self.count))
            .flatten()
    }
}

impl<const M: usize> Sums<M> {
    const NONE: Self = Self {
        period: Mean::NONE,
        after: [[Mean::NONE; M]; M],
    };

    /// What a pass of so many replies says; `None` where too many were lost.
    fn schedule(&self, ids: [u8; M], replies: u16) -> Option<Schedule<M>> {
        let least = u32::from(replies) / (4 * M as u32);
        let period_us = self.period.of(least)?;
        let mut soonest: Option<[u32; M]> = None;
        for (first, after) in self.after.iter().enumerate() {
            let mut offsets = [0; M];
            let mut complete = true;
            for (motor, (offset, mean)) in offsets.iter_mut().zip(after).enumerate() {
                if motor != first {
                    complete &= mean.of(least).map(|mean| *offset = mean).is_some();
                }
            }
            let span = |offsets: &[u32; M]| offsets.iter().copied().max();
            if complete && soonest.is_none_or(|soonest| span(&offsets) < span(&soonest)) {
                soonest = Some(offsets);
            }
        }
        Some(Schedule {
            ids,
            offsets_us: soonest?,
            period_us,
            learnt: true,
        })
    }
}

impl<const M: usize> Learner<M> {
    /// Nothing heard yet.
    pub(super) const fn new() -> Self {
        Self {
            schedule: Schedule::LIKELY,
            heard: [false; M],
            strangers: [0; 16],
            counted: 0,
            stage: Stage::Shortest,
            left: FIRST_PASS[0] * M as u16,
            last_us: [0; M],
            shortest_us: LONGEST_US,
            sums: Sums::NONE,
            proposed: None,
        }
    }

    /// What is known by now.
    pub(super) fn schedule(&self) -> &Schedule<M> {
        &self.schedule
    }

    /// Takes note of motor `id`'s reply at `time_us`; its place among the motors, if it is one of them.
    pub(super) fn hear(&mut self, id: u8, time_us: u64) -> Option<usize> {
        self.counted += 1;
        if self.counted >= ID_WINDOW {
            self.count_anew();
        }
        let motor = self.schedule.ids.iter().position(|&known| known == id);
        let Some(motor) = motor else {
            self.meet(id);
            return None;
        };
        if let Some(heard) = self.heard.get_mut(motor) {
            *heard = true;
        }
        if self.stage != Stage::Rest {
            self.measure(motor, time_us);
        }
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            self.end_stage();
        }
        Some(motor)
    }

    #[cold]
    fn count_anew(&mut self) {
        self.counted = 0;
        self.heard = [false; M];
        self.strangers = [0; 16];
    }

    /// Counts a reply of an id that is not known as a motor's, and makes it one where a known one is silent.
    #[cold]
    fn meet(&mut self, id: u8) {
        let Some(replies) = self.strangers.get_mut(usize::from(id)) else {
            return;
        };
        *replies = replies.saturating_add(1);
        let silent = self.heard.iter().position(|heard| !heard);
        let (true, Some(silent)) = (*replies >= ID_REPLIES, silent) else {
            return;
        };
        // Which of the silent motors goes does not matter while none of them answers, except that ids stay together.
        let farthest = |motor: &usize| self.schedule.ids.get(*motor).map(|n| n.abs_diff(id));
        let silent = (silent..M)
            .filter(|&motor| self.heard.get(motor) == Some(&false))
            .max_by_key(farthest)
            .unwrap_or(silent);
        if let (Some(place), Some(heard)) = (
            self.schedule.ids.get_mut(silent),
            self.heard.get_mut(silent),
        ) {
            (*place, *heard) = (id, true);
        }
        self.sort();
        self.schedule = Schedule {
            ids: self.schedule.ids,
            ..Schedule::LIKELY
        };
        self.proposed = None;
        self.begin(Stage::Shortest);
    }

    /// Puts the ids into ascending order, with what is known of each.
    fn sort(&mut self) {
        let mut pairs: [(u8, bool); M] = core::array::from_fn(|motor| {
            let id = self.schedule.ids.get(motor).copied().unwrap_or_default();
            (id, self.heard.get(motor).copied().unwrap_or_default())
        });
        pairs.sort_unstable();
        self.schedule.ids = pairs.map(|(id, _)| id);
        self.heard = pairs.map(|(_, heard)| heard);
    }

    /// Replies of a pass: of its first stage, and of its second.
    fn pass(&self) -> [u16; 2] {
        let of_each = match self.schedule.learnt {
            true => LATER_PASS,
            false => FIRST_PASS,
        };
        of_each.map(|replies| replies * M as u16)
    }

    fn begin(&mut self, stage: Stage) {
        let [shortest, average] = self.pass();
        self.stage = stage;
        self.left = match stage {
            Stage::Shortest => shortest,
            Stage::Average => average,
            Stage::Rest => REST * M as u16,
        };
        self.last_us = [0; M];
        self.sums = Sums::NONE;
        if stage == Stage::Shortest {
            self.shortest_us = LONGEST_US;
        }
    }

    /// The times from the last replies of all motors to this one.
    #[inline(never)]
    fn measure(&mut self, motor: usize, time_us: u64) {
        for (from, &last_us) in self.last_us.iter().enumerate() {
            // A motor that has not answered in this stage, or whose clock is not this one's, is out of range.
            let elapsed = time_us.wrapping_sub(last_us).min(u64::from(LONGEST_US)) as u32;
            if last_us == 0 || elapsed == LONGEST_US {
                continue;
            }
            match (self.stage, from == motor) {
                (Stage::Shortest, true) if elapsed > 0 => {
                    self.shortest_us = self.shortest_us.min(elapsed);
                }
                (Stage::Average, true) if elapsed < self.shortest_us.saturating_mul(3) / 2 => {
                    self.sums.period.add(elapsed);
                }
                (Stage::Average, false) if elapsed < self.shortest_us => {
                    let after = self.sums.after.get_mut(from);
                    if let Some(mean) = after.and_then(|after| after.get_mut(motor)) {
                        mean.add(elapsed);
                    }
                }
                _ => {}
            }
        }
        if let Some(last_us) = self.last_us.get_mut(motor) {
            *last_us = time_us;
        }
    }

    #[cold]
    fn end_stage(&mut self) {
        match self.stage {
            Stage::Shortest => self.begin(Stage::Average),
            Stage::Rest => self.begin(Stage::Shortest),
            Stage::Average => {
                let found = self.sums.schedule(self.schedule.ids, self.pass()[1]);
                let says = |known: &Schedule<M>| found.is_some_and(|found| known.agrees(&found));
                let known = self.schedule.learnt && says(&self.schedule);
                let confirmed = known || self.proposed.as_ref().is_some_and(says);
                if let (Some(found), true) = (found, confirmed) {
                    self.schedule = found;
                    self.proposed = None;
                    // What was learnt from few replies is looked at again at once.
                    self.begin(if known { Stage::Rest } else { Stage::Shortest });
                } else {
                    self.proposed = found;
                    self.begin(Stage::Shortest);
                }
            }
        }
    }
}

//! How links move against their motors under the torque that a model expects the gears to transmit: on a spring, and within a play.

use std::borrow::Cow;
use std::ops::Range;

use nalgebra::DMatrix;
use proprio_core::effect::Transmission;

use super::backlash::play;
use super::body::LimbBody;
use super::coupled_springs::{Spring, coupled};
use super::joint_states::{Needs, States};
use super::local_line::{around, local_line};
use super::motion::Motion;
use super::spring::{Course, Gear, spring};
use super::transmitted_torque_cache::Load;
use super::values::{Place, Values};
use crate::trajectory::{Before, Trajectory};

/// A play that is looked for where none is known yet, rad.
const TYPICAL_PLAY: f64 = 0.01;
/// How much more and less compliance tells how a link's motion changes with it, as a share.
const NEAR: f64 = 0.01;

/// Position and velocity of a link against its motor, by times, torques and inertias.
type Follows<'a> = dyn Fn(&[f64], Course, &[f64]) -> Vec<[f64; 2]> + 'a;

impl Motion {
    /// Each joint's load, and how it moves the links: how far they are from their motors (rad) and how fast they move against them
    /// (rad/s).
    pub(super) fn fill_load(
        &self,
        body: &LimbBody,
        (load, values): (&Load, &Values),
        needs: &Needs,
        states: &mut States,
    ) {
        let n = self.joints;
        let from = states.first * n;
        let all = states.q.len();
        if needs.smooth {
            states.load = self.smooth(load)[from..from + all].to_vec();
        }
        if !needs.play.is_empty() {
            states.play = vec![[0.0; 2]; all];
        }
        if !needs.spring.is_empty() {
            states.give = vec![[0.0; 2]; all];
        }
        let range = states.first..states.first + all / n.max(1);
        let springs = coupled_springs(values, &needs.spring);
        for stretch in self.stretches_within(&range) {
            for &j in &needs.play {
                let gap = values.transmission(Transmission::Backlash, j, 0);
                let tried = if gap > 0.0 { gap } else { TYPICAL_PLAY };
                for (at, moved) in self.in_play(load, &stretch, j, tried) {
                    states.play[at - from] = moved;
                    states.move_link(at - from, gap, moved);
                }
            }
            self.on_springs(body, (load, values), &springs, &stretch, states);
            for &j in &needs.spring {
                let compliance = values.transmission(Transmission::Spring, j, 0);
                let gear = gear(values, j, compliance);
                // A spring that gives way against the load is none, but a fit may pass by it.
                if compliance <= 0.0 {
                    let filtered = &self.filtered(load, j)[stretch.clone()];
                    let time = &self.time[stretch.clone()];
                    for (i, k) in stretch.clone().enumerate() {
                        let at = k * n + j;
                        let give = local_line(time, filtered, i, around(time, i)).map(|x| -x);
                        states.give[at - from] = give;
                        states.move_link(at - from, compliance, give);
                    }
                    continue;
                }
                if springs.iter().all(|spring| spring.joint != j) {
                    for (at, moved) in self.on_spring(load, &stretch, j, gear) {
                        states.move_link(at - from, 1.0, moved);
                    }
                }
                if needs.give.contains(&j) {
                    let [more, less] = [1.0 + NEAR, 1.0 - NEAR].map(|share| {
                        let compliance = share * compliance;
                        self.on_spring(load, &stretch, j, Gear { compliance, ..gear })
                    });
                    for ((at, more), (_, less)) in more.into_iter().zip(less) {
                        let change = along(more, -1.0, less);
                        let give = change.map(|x| x / (2.0 * NEAR * compliance));
                        states.give[at - from] = give;
                    }
                }
            }
        }
    }

    /// The trajectory of a joint's link, where a second encoder tells it.
    pub(crate) fn link(&self, joint: usize) -> Option<&Trajectory> {
        self.links[joint].as_ref()
    }

    /// What moves the bodies: links where second encoders tell them, else the motors, which are as they were so much (s) before.
    pub(super) fn links_of<'a>(
        &'a self,
        (motors, delay): (&'a [Trajectory], f64),
    ) -> Vec<Cow<'a, Trajectory>> {
        let of = |(motor, link): (&'a Trajectory, &'a Option<Trajectory>)| match link {
            None => Cow::Borrowed(motor),
            Some(link) if delay == 0.0 => Cow::Borrowed(link),
            Some(link) => {
                let before = Before::of(&self.time, &self.stretches, delay);
                Cow::Owned(link.delayed(&before))
            }
        };
        motors.iter().zip(&self.links).map(of).collect()
    }

    /// What second encoders say of links takes the place of what a model says.
    pub(super) fn measure_links(&self, motors: (&[Trajectory], f64), states: &mut States) {
        let (n, first) = (self.joints, states.first);
        if self.links.iter().all(Option::is_none) {
            return;
        }
        let links = self.links_of(motors);
        for (j, link) in links.iter().enumerate() {
            if self.links[j].is_none() {
                continue;
            }
            for k in first..first + states.q.len() / n {
                let at = (k - first) * n + j;
                let [q, dq, ..] = link.state[k];
                [states.q[at], states.dq[at]] = states.encoders[j].motion([q, dq]);
            }
        }
    }

    /// The parts of stretches that lie within a range of samples.
    pub(super) fn stretches_within(&self, range: &Range<usize>) -> Vec<Range<usize>> {
        let within = |s: &Range<usize>| s.start.max(range.start)..s.end.min(range.end);
        let all = self.stretches.iter().map(within);
        all.filter(|s| !s.is_empty()).collect()
    }

    /// How a joint's link moves in a gap, per radian of it; on a spring of some compliance. Where in the list of all samples and joints,
    /// and how far it is from its motor and how fast it moves against it.
    fn in_play(
        &self,
        load: &Load,
        stretch: &Range<usize>,
        joint: usize,
        gap: f64,
    ) -> Vec<(usize, [f64; 2])> {
        self.moved(load, stretch, joint, &|t, torque, inertia| {
            play(t, torque.at, inertia, gap)
        })
    }

    fn on_spring(
        &self,
        load: &Load,
        stretch: &Range<usize>,
        joint: usize,
        gear: Gear,
    ) -> Vec<(usize, [f64; 2])> {
        self.moved(load, stretch, joint, &|t, torque, inertia| {
            spring(t, torque, inertia, gear)
        })
    }

    /// Moves the links of several springs together, from where they are: under their loads and what they pass on to each other.
    fn on_springs(
        &self,
        body: &LimbBody,
        (load, values): (&Load, &Values),
        springs: &[Spring],
        stretch: &Range<usize>,
        states: &mut States,
    ) {
        if springs.is_empty() {
            return;
        }
        let (n, first) = (self.joints, states.first);
        let (rigid, base) = (body.loaded(values), body.base(values));
        let of = |all: &[f64], spring: &Spring| -> Vec<f64> {
            stretch.clone().map(|k| all[k * n + spring.joint]).collect()
        };
        let parts = springs.iter();
        let parts: Vec<[Vec<f64>; 2]> = parts
            .map(|spring| {
                let filtered = &self.filtered(load, spring.joint)[stretch.clone()];
                [filtered.to_vec(), of(&load.beyond, spring)]
            })
            .collect();
        let loads: Vec<Course> = (parts.iter())
            .map(|[at, beyond]| Course { at, beyond })
            .collect();
        let q = &states.q;
        let inertia = |i: usize| {
            let at = (stretch.start + i - first) * n;
            let mut all = vec![0.0; n * n];
            rigid.inertia_matrix(&base, &q[at..at + n], &mut all);
            DMatrix::from_fn(springs.len(), springs.len(), |a, b| {
                all[springs[a].joint * n + springs[b].joint]
            })
        };
        let moved = coupled(&self.time[stretch.clone()], springs, &loads, inertia);
        for (spring, moved) in springs.iter().zip(moved) {
            for (k, moved) in stretch.clone().zip(moved) {
                states.move_link((k - first) * n + spring.joint, 1.0, moved);
            }
        }
    }

    /// Moves a joint's link as far as a gap (rad) or a compliance (rad/(N m)) lets the load move it.
    pub(crate) fn loosen(
        &self,
        load: &Load,
        values: &Values,
        ((effect, joint), size): (Place, f64),
        states: &mut States,
    ) {
        let range = states.first..states.first + states.q.len() / self.joints;
        let from = states.first * self.joints;
        if size <= 0.0 {
            return;
        }
        for stretch in self.stretches_within(&range) {
            let is_gap = effect.description().transmission() == Some(Transmission::Backlash);
            let (share, moved) = if is_gap {
                (size, self.in_play(load, &stretch, joint, size))
            } else {
                let gear = gear(values, joint, size);
                (1.0, self.on_spring(load, &stretch, joint, gear))
            };
            for (at, moved) in moved {
                states.move_link(at - from, share, moved);
            }
        }
    }

    /// How a joint's link moves in a stretch by its load and its inertia, as `by` says of it.
    fn moved(
        &self,
        load: &Load,
        stretch: &Range<usize>,
        joint: usize,
        by: &Follows,
    ) -> Vec<(usize, [f64; 2])> {
        let at = || stretch.clone().map(|k| k * self.joints + joint);
        let of = |all: &[f64]| at().map(|at| all[at]).collect::<Vec<f64>>();
        let [beyond, inertia] = [&load.beyond, &load.inertia].map(|x| of(x));
        let torque = Course {
            at: &self.filtered(load, joint)[stretch.clone()],
            beyond: &beyond,
        };
        at().zip(by(&self.time[stretch.clone()], torque, &inertia))
            .collect()
    }
}

/// Springs that are known with their dampers and have no friction inside: those of several joints move together.
fn coupled_springs(values: &Values, joints: &[usize]) -> Vec<Spring> {
    let of = |&joint: &usize| {
        let compliance = values.transmission(Transmission::Spring, joint, 0);
        let inside = values.transmission(Transmission::SpringFriction, joint, 0);
        (compliance > 0.0 && inside <= 0.0).then_some(())?;
        Some(Spring {
            joint,
            stiffness: 1.0 / compliance,
            damping: values.damper(joint)?,
        })
    };
    joints.iter().filter_map(of).collect()
}

/// What a model has between a joint's motor and its link, with this compliance, rad/(N m).
fn gear(values: &Values, joint: usize, compliance: f64) -> Gear {
    let inside = |n: usize| values.transmission(Transmission::SpringFriction, joint, n);
    Gear {
        compliance,
        friction: inside(0),
        displacement: inside(1),
    }
}

/// a + share · b.
fn along(a: [f64; 2], share: f64, b: [f64; 2]) -> [f64; 2] {
    [a[0] + share * b[0], a[1] + share * b[1]]
}

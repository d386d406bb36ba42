//! How links move against their motors under the torque that a model expects the gears to transmit: on a spring, and within a play.

use std::ops::Range;

use proprio_core::effect::{EffectKind, JointState};

use super::hysteresis::hysteresis;
use super::motion::{Load, Motion, Needs, Trajectories};
use super::play::play;
use super::spring::spring;
use super::values::Values;

/// A play that is looked for where none is known yet, rad.
const TYPICAL_PLAY: f64 = 0.01;
/// How much more and less compliance tells how a link's motion changes with it, as a share.
const NEAR: f64 = 0.01;

/// Position and velocity of a link against its motor, by times, torques and inertias.
type Follows<'a> = dyn Fn(&[f64], &[f64], &[f64]) -> Vec<[f64; 2]> + 'a;

impl Motion {
    /// Each joint's load and how it would move the links; sample by sample, joint by joint, how far they are from their motors (rad) and
    /// how fast they move against them (rad/s).
    pub(super) fn fill_load(
        &self,
        load: &Load,
        values: &Values,
        needs: &Needs,
        states: &mut [JointState<f64>],
    ) -> Vec<[f64; 2]> {
        let n = self.joints;
        for (state, line) in states.iter_mut().zip(&load.line) {
            state.load = line[0];
        }
        let mut links = vec![[0.0; 2]; states.len()];
        for stretch in &self.stretches {
            for &j in &needs.play {
                let gap = values.get((EffectKind::Backlash, j), 0);
                let tried = if gap > 0.0 { gap } else { TYPICAL_PLAY };
                let moved = self.moved(load, stretch, j, &|t, torque, inertia| {
                    play(t, torque, inertia, tried)
                });
                for (at, moved) in moved {
                    states[at].play = moved;
                    links[at] = along(links[at], gap, moved);
                }
            }
            for &j in &needs.spring {
                let compliance = values.get((EffectKind::Elasticity, j), 0);
                let [friction, width] =
                    [0, 1].map(|n| values.get((EffectKind::ElasticHysteresis, j), n));
                let on = |compliance: f64| {
                    self.moved(load, stretch, j, &|t, torque, inertia| {
                        let free = spring(t, torque, inertia, compliance);
                        if friction <= 0.0 || width <= 0.0 {
                            return free;
                        }
                        // The way that the link goes without it tells well enough in which state it is.
                        let state = hysteresis(free.iter().map(|x| x[0]), width);
                        let held: Vec<f64> = (torque.iter().zip(state))
                            .map(|(torque, z)| torque + friction * z)
                            .collect();
                        spring(t, &held, inertia, compliance)
                    })
                };
                // A spring that gives way against the load is none, but a fit may pass by it.
                if compliance <= 0.0 {
                    for k in stretch.clone() {
                        let at = k * n + j;
                        states[at].give = load.line[at].map(|x| -x);
                        links[at] = along(links[at], compliance, states[at].give);
                    }
                    continue;
                }
                for (at, moved) in on(compliance) {
                    links[at] = along(links[at], 1.0, moved);
                }
                if needs.give.contains(&j) {
                    let [more, less] = [1.0 + NEAR, 1.0 - NEAR].map(|share| on(share * compliance));
                    for ((at, more), (_, less)) in more.into_iter().zip(less) {
                        let change = along(more, -1.0, less);
                        states[at].give = change.map(|x| x / (2.0 * NEAR * compliance));
                    }
                }
            }
        }
        links
    }

    /// What second encoders say of links against their motors takes the place of what a model says.
    pub(super) fn measure_links(&self, of: &Trajectories, links: &mut Vec<[f64; 2]>) {
        let n = self.joints;
        for (j, (motor, link)) in of.motors.iter().zip(of.links).enumerate() {
            let Some(link) = link else { continue };
            links.resize(n * self.time.len(), [0.0; 2]);
            for (k, (link, motor)) in link.state.iter().zip(&motor.state).enumerate() {
                links[k * n + j] = [link[0] - motor[0], link[1] - motor[1]];
            }
        }
    }

    /// How a joint's link moves in a stretch by its load and its inertia: where in the list of all samples and joints, and what `by`
    /// says of it.
    fn moved(
        &self,
        load: &Load,
        stretch: &Range<usize>,
        joint: usize,
        by: &Follows,
    ) -> Vec<(usize, [f64; 2])> {
        let at = || stretch.clone().map(|k| k * self.joints + joint);
        let torque: Vec<f64> = at().map(|at| load.torque[at]).collect();
        let inertia: Vec<f64> = at().map(|at| load.inertia[at]).collect();
        at().zip(by(&self.time[stretch.clone()], &torque, &inertia))
            .collect()
    }
}

/// a + share · b.
fn along(a: [f64; 2], share: f64, b: [f64; 2]) -> [f64; 2] {
    [a[0] + share * b[0], a[1] + share * b[1]]
}

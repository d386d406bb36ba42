//! What a joint's torque jumps by where dry friction changes its direction within a window: of the moment, a log knows a sample and no
//! more, and of what a held joint's friction is meanwhile nothing but its two limits.

use super::column::{Column, Columns};
use super::motion::{MOST_REST, Motion, Window};

/// What turns with two joints: with the sum of their speeds or with the difference, in the order of a coupled effect's parameters.
const WAYS: [f64; 2] = [1.0, -1.0];

/// A limb's dry friction: its columns, and of each joint what they are multiplied by.
pub(crate) struct DryFriction<'a> {
    pub(crate) motion: &'a Motion,
    pub(crate) columns: &'a Columns,
    pub(crate) numbers: &'a [Vec<f64>],
}

impl DryFriction<'_> {
    /// Half of what a joint's torque jumps by in a window, N m, whichever effects make it: zero where nothing turns round.
    pub(crate) fn jump(&self, window: &Window, joint: usize) -> f64 {
        let numbers = self.columns.of_joint[joint]
            .iter()
            .zip(&self.numbers[joint]);
        let coupled = numbers.filter_map(|(column, value)| match *column {
            Column::Coupled {
                joint: at,
                effect,
                n,
                ..
            } if *value != 0.0 && effect.couples_with_parent() => {
                let other = self.columns.coupled(at, joint)?;
                Some(value * self.coupled_jump(window, [joint, other], (column, n)))
            }
            _ => None,
        });
        coupled.fold(self.own_jump(window, joint), f64::hypot)
    }

    /// Of what turns with the joint alone.
    fn own_jump(&self, window: &Window, joint: usize) -> f64 {
        let trajectory = &self.motion.joint[joint];
        let speed = |k: usize| trajectory.speed[k];
        let [first, last] = self.motion.about(window);
        let slow = (first..=last).find(|&k| speed(k).abs() < trajectory.rest);
        let turn = || (first..last).find(|&k| speed(k) * speed(k + 1) <= 0.0);
        let Some(at) = slow.or_else(turn) else {
            return 0.0;
        };
        let towards = |sign: f64| {
            let mut states: Vec<_> = (0..self.motion.joints)
                .map(|j| self.motion.state(at, j))
                .collect();
            states[joint].speed = sign * trajectory.speed_noise;
            let rate = |(column, value): (&Column, &f64)| match *column {
                Column::Own {
                    effect, shapes, n, ..
                } => value * effect.terms_among(&states, joint, shapes)[n].rate,
                _ => 0.0,
            };
            let columns = self.columns.of_joint[joint].iter();
            columns.zip(&self.numbers[joint]).map(rate).sum::<f64>()
        };
        (0.5 * (towards(1.0) - towards(-1.0))).abs()
    }

    /// Of what turns with a joint and another one, per unit; as many times more as it may be held for longer than a joint that is judged.
    fn coupled_jump(
        &self,
        window: &Window,
        joints: [usize; 2],
        (column, n): (&Column, usize),
    ) -> f64 {
        let [own, other] = joints.map(|j| &self.motion.joint[j]);
        let way = WAYS[n];
        let speed = |k: usize| own.speed[k] + way * other.speed[k];
        let [first, last] = window.samples;
        let slow = |k: &usize| speed(*k).abs() < own.rest + other.rest;
        let turns = |k: &usize| speed(*k) * speed(k + 1) <= 0.0;
        let Some(at) = (first..=last)
            .find(slow)
            .or_else(|| (first..last).find(turns))
        else {
            return 0.0;
        };
        let held = (first + 1..=last).filter(slow).count() as f64 / (last - first) as f64;
        let noise = own.speed_noise + other.speed_noise;
        let towards = |sign: f64| {
            let mut states: Vec<_> = (0..self.motion.joints)
                .map(|j| self.motion.state(at, j))
                .collect();
            states[joints[0]].speed = sign * noise - way * other.speed[at];
            let term = self.columns.term(column, joints[0], &states);
            term.map_or(0.0, |term| term.rate)
        };
        let jump = 0.5 * (towards(1.0) - towards(-1.0));
        jump.abs() * f64::max(1.0, held / MOST_REST)
    }
}

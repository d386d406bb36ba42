//! A robot's bodies on a free base, however many: what `proprio_core::tree` is for a number of bodies that the compiler knows.
//!
//! Coordinates are the base's six, angular before linear, in its own axes, and then one of each joint; bodies are numbered depth first, the base
//! first. Everything is written in the base's axes about its origin, where a velocity is a sum along the way from the base and a momentum a
//! sum over a subtree: H q̇ of coordinate c is S_c · F, with F the momentum of all that c moves, and −Cᵀq̇ is S_c · (V ×* F).

use std::ops::Range;

use nalgebra::{Rotation3, Unit, Vector3};
use proprio_core::inertia::{INERTIAL, InertialParameters, momentum_row};
use proprio_core::spatial::{Force, Motion, Transform};
use proprio_core::tree::{Body, Joint};

use crate::model::{self, JointKind};

/// Coordinates of the base.
pub(crate) const OF_BASE: usize = 6;

/// Ten numbers that multiply a body's parameters.
pub(crate) type Run = [f64; INERTIAL];

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FreeTree {
    bodies: Vec<Body<f64>>,
    ends: Vec<usize>,
    /// Of each body the coordinates that move it, in order.
    movers: Vec<Vec<usize>>,
    /// Where each body's runs begin among all runs; at the end their number.
    first_run: Vec<usize>,
}

/// Where bodies are, in the base.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pose {
    pub(crate) in_base: Vec<Transform<f64>>,
    /// What each body's joint lets it do, about the base's origin; nothing of the base itself.
    pub(crate) along: Vec<Motion<f64>>,
}

/// How bodies move, in the base's axes about its origin.
#[derive(Debug, Clone, Default)]
pub(crate) struct Moving {
    pub(crate) pose: Pose,
    pub(crate) velocity: Vec<Motion<f64>>,
    /// Momenta of subtrees.
    momentum: Vec<Force<f64>>,
}

impl FreeTree {
    /// A base and a robot's bodies, which are numbered depth first.
    pub(crate) fn new(base: InertialParameters<f64>, bodies: &[model::Body]) -> Self {
        let own = bodies.iter().map(|body| Body {
            parent: Some(body.parent.map_or(0, |parent| parent + 1)),
            placement: body.placement,
            joint: match body.kind {
                JointKind::Revolute | JointKind::Continuous => Joint::Revolute(body.axis),
                JointKind::Prismatic => Joint::Prismatic(body.axis),
            },
            inertia: body.inertia,
        });
        let base = Body {
            parent: None,
            placement: Transform::identity(),
            joint: Joint::Free,
            inertia: base,
        };
        let bodies: Vec<Body<f64>> = std::iter::once(base).chain(own).collect();
        let mut ends: Vec<usize> = (1..=bodies.len()).collect();
        let mut movers: Vec<Vec<usize>> = vec![(0..OF_BASE).collect()];
        for (b, body) in bodies.iter().enumerate().skip(1) {
            let above = body.parent.unwrap_or(0);
            let mut own = movers[above].clone();
            own.push(OF_BASE + b - 1);
            movers.push(own);
        }
        for b in (1..bodies.len()).rev() {
            let above = bodies[b].parent.unwrap_or(0);
            ends[above] = ends[above].max(ends[b]);
        }
        let mut first_run = vec![0];
        for own in &movers {
            first_run.push(first_run[first_run.len() - 1] + own.len());
        }
        Self {
            bodies,
            ends,
            movers,
            first_run,
        }
    }

    /// The bodies, the base first.
    pub(crate) fn bodies(&self) -> &[Body<f64>] {
        &self.bodies
    }

    /// How many velocity coordinates there are.
    pub(crate) fn coordinates(&self) -> usize {
        OF_BASE + self.joints()
    }

    pub(crate) fn joints(&self) -> usize {
        self.bodies.len() - 1
    }

    /// The bodies that a body's joint moves: itself and all it carries.
    pub(crate) fn subtree(&self, body: usize) -> Range<usize> {
        body..self.ends[body]
    }

    /// Kilograms in all.
    pub(crate) fn mass(&self) -> f64 {
        self.bodies.iter().map(|body| body.inertia.mass()).sum()
    }

    /// The same tree with other inertial parameters.
    pub(crate) fn with_inertia(
        &self,
        inertia: impl Iterator<Item = InertialParameters<f64>>,
    ) -> Self {
        let mut all = self.clone();
        for (body, phi) in all.bodies.iter_mut().zip(inertia) {
            body.inertia = phi;
        }
        all
    }

    /// The coordinates that move a body, in order.
    pub(crate) fn movers(&self, body: usize) -> &[usize] {
        &self.movers[body]
    }

    /// How many pairs of a body and a coordinate that moves it there are.
    pub(crate) fn runs(&self) -> usize {
        self.first_run[self.bodies.len()]
    }

    /// The runs of a body among those of all, one of each of its movers.
    pub(crate) fn runs_of(&self, body: usize) -> Range<usize> {
        self.first_run[body]..self.first_run[body + 1]
    }

    /// Where bodies are with joints at `q`, rad or m.
    pub(crate) fn place(&self, q: &[f64], pose: &mut Pose) {
        pose.in_base.clear();
        pose.along.clear();
        for (b, body) in self.bodies.iter().enumerate() {
            let Some(parent) = body.parent else {
                pose.in_base.push(Transform::identity());
                pose.along.push(Motion::zero());
                continue;
            };
            let mut own = pose.in_base[parent].compose(&body.placement);
            let along = match body.joint {
                Joint::Revolute(axis) => {
                    let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), q[b - 1]);
                    own.rotation *= turn.matrix();
                    let axis = own.rotation * axis;
                    Motion::new(axis, own.translation.cross(&axis))
                }
                Joint::Prismatic(axis) => {
                    let axis = own.rotation * axis;
                    own.translation += axis * q[b - 1];
                    Motion::new(Vector3::zeros(), axis)
                }
                Joint::Free => Motion::zero(),
            };
            pose.in_base.push(own);
            pose.along.push(along);
        }
    }

    /// The same with velocities: the base's twist, and the joints', rad/s or m/s.
    pub(crate) fn update(&self, q: &[f64], base: Motion<f64>, dq: &[f64], moving: &mut Moving) {
        self.place(q, &mut moving.pose);
        moving.velocity.clear();
        moving.velocity.push(base);
        for (b, body) in self.bodies.iter().enumerate().skip(1) {
            let above = moving.velocity[body.parent.unwrap_or(0)];
            let own = above + moving.pose.along[b].scale(dq[b - 1]);
            moving.velocity.push(own);
        }
    }

    /// H q̇ and −Cᵀ q̇, without gravity.
    pub(crate) fn momentum_and_rate(
        &self,
        moving: &mut Moving,
        momentum: &mut [f64],
        rate: &mut [f64],
    ) {
        moving.momentum.clear();
        for (b, body) in self.bodies.iter().enumerate() {
            let placed = &moving.pose.in_base[b];
            let own = placed.act_inverse(&moving.velocity[b]);
            let carried = placed.act_force(&body.inertia.momentum(&own));
            moving.momentum.push(carried);
        }
        self.sum_up(&mut moving.momentum);
        for b in (0..self.bodies.len()).rev() {
            let force = moving.momentum[b];
            let turned = moving.velocity[b].cross_force(&force);
            match b {
                0 => {
                    for n in 0..3 {
                        (momentum[n], momentum[3 + n]) = (force.angular[n], force.linear[n]);
                        (rate[n], rate[3 + n]) = (turned.angular[n], turned.linear[n]);
                    }
                }
                _ => {
                    let along = &moving.pose.along[b];
                    let c = OF_BASE + b - 1;
                    (momentum[c], rate[c]) = (along.dot(&force), along.dot(&turned));
                }
            }
        }
    }

    /// Makes each body's force that of its subtree.
    fn sum_up(&self, forces: &mut [Force<f64>]) {
        for b in (1..self.bodies.len()).rev() {
            let above = self.bodies[b].parent.unwrap_or(0);
            forces[above] = forces[above] + forces[b];
        }
    }

    /// All bodies as one, in the base.
    pub(super) fn whole(&self, pose: &Pose) -> InertialParameters<f64> {
        let placed = self.bodies.iter().zip(&pose.in_base);
        placed.fold(InertialParameters::zero(), |all, (body, placed)| {
            all + body.inertia.in_parent(placed)
        })
    }

    /// Runs that multiply the bodies' parameters, of each body one for each of its movers: those of H q̇ and those of Cᵀ q̇.
    pub(crate) fn regressors(&self, moving: &Moving, momentum: &mut [Run], coriolis: &mut [Run]) {
        let base = moving.velocity[0];
        let along: Vec<(Motion<f64>, Motion<f64>)> = (0..self.coordinates())
            .map(|c| match c.checked_sub(OF_BASE) {
                None => {
                    let unit = Motion::unit(c);
                    (unit, base.cross(&unit))
                }
                Some(joint) => {
                    let own = moving.pose.along[joint + 1];
                    (own, moving.velocity[joint + 1].cross(&own))
                }
            })
            .collect();
        for (b, placed) in moving.pose.in_base.iter().enumerate() {
            let own = placed.act_inverse(&moving.velocity[b]);
            let runs = self.runs_of(b);
            let (momentum, coriolis) = (&mut momentum[runs.clone()], &mut coriolis[runs]);
            for ((&c, momentum), coriolis) in self.movers[b].iter().zip(momentum).zip(coriolis) {
                let (s, rate) = &along[c];
                *momentum = momentum_row(&placed.act_inverse(s), &own).into();
                *coriolis = momentum_row(&placed.act_inverse(rate), &own).into();
            }
        }
    }

    /// The columns of the inertia matrix that the base's translation has: what each coordinate needs of force for an acceleration of all bodies
    /// alike, per m/s² along the base's axes.
    pub(crate) fn carried(&self, pose: &Pose, columns: &mut [Vector3<f64>]) {
        // Mass and first moment of each subtree.
        let mut all: Vec<(f64, Vector3<f64>)> = (self.bodies.iter().zip(&pose.in_base))
            .map(|(body, placed)| {
                let (m, h) = (body.inertia.mass(), body.inertia.first_moment());
                (m, placed.rotation * h + placed.translation * m)
            })
            .collect();
        for b in (1..self.bodies.len()).rev() {
            let above = self.bodies[b].parent.unwrap_or(0);
            let (m, h) = all[b];
            all[above].0 += m;
            all[above].1 += h;
        }
        let felt = |b: usize, along: &Motion<f64>| {
            let (m, h) = all[b];
            along.linear * m + along.angular.cross(&h)
        };
        for (c, column) in columns.iter_mut().enumerate() {
            *column = match c.checked_sub(OF_BASE) {
                None => felt(0, &Motion::unit(c)),
                Some(joint) => felt(joint + 1, &pose.along[joint + 1]),
            };
        }
    }

    /// What the coordinates need of force: H a + C v, where the base's acceleration is that without gravity, as an accelerometer at its origin reads
    /// it.
    pub(crate) fn inverse_dynamics(
        &self,
        moving: &Moving,
        base: Motion<f64>,
        ddq: &[f64],
        dq: &[f64],
    ) -> Vec<f64> {
        let mut acceleration: Vec<Motion<f64>> = vec![base];
        for (b, body) in self.bodies.iter().enumerate().skip(1) {
            let along = &moving.pose.along[b];
            let turning = moving.velocity[b].cross(&along.scale(dq[b - 1]));
            let above = acceleration[body.parent.unwrap_or(0)];
            acceleration.push(above + along.scale(ddq[b - 1]) + turning);
        }
        let mut forces: Vec<Force<f64>> = (0..self.bodies.len())
            .map(|b| {
                let (placed, inertia) = (&moving.pose.in_base[b], &self.bodies[b].inertia);
                let [v, a] =
                    [&moving.velocity[b], &acceleration[b]].map(|own| placed.act_inverse(own));
                let own = inertia.momentum(&a) + v.cross_force(&inertia.momentum(&v));
                placed.act_force(&own)
            })
            .collect();
        self.sum_up(&mut forces);
        let base = forces[0];
        let base = base.angular.iter().chain(base.linear.iter()).copied();
        let joints = (1..self.bodies.len()).map(|b| moving.pose.along[b].dot(&forces[b]));
        base.chain(joints).collect()
    }

    /// How fast a point that is fixed to a body, given in the base, moves per unit of each coordinate that moves the body, m/s.
    pub(crate) fn point_velocities<'a>(
        &'a self,
        pose: &'a Pose,
        body: usize,
        point: Vector3<f64>,
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> + 'a {
        self.movers[body].iter().map(move |&c| {
            let along = match c.checked_sub(OF_BASE) {
                None => Motion::unit(c),
                Some(joint) => pose.along[joint + 1],
            };
            (c, along.linear + along.angular.cross(&point))
        })
    }
}

//! What the equations of windows leave at known parameters, from the bodies' momentum itself: what the rows of
//! [`proprio_core::window::FreeBaseWindow`] times these parameters leave, without the rows.
//!
//! A row has a column for each of 130 inertial parameters; where the parameters are known, H q̇ and Cᵀ q̇ of the bodies are all that is needed. What
//! sensors get wrong is found by differences of these, a dozen or two for each window.

use nalgebra::Vector3;
use proprio_core::spatial::{Motion, Transform};

use super::projection::{JointStates, Span};
use super::projector::Projector;
use super::row_setup::RowSetup;
use super::sensors::Sensors;
use super::stance::Stance;
use super::walk::Walk;
use super::windows::WindowSamples;
use crate::equation::column::Column;
use crate::equation::free_tree::{Moving, OF_BASE};

/// What effects give in a window, N m s: joint by joint at each of its samples.
pub(super) type Impulses = Vec<Vec<f64>>;

/// What the effects of `setup` that have a value give in each window of a walk as these sensors read it.
pub(super) fn impulses(
    walk: &Walk,
    stance: &Stance,
    setup: &RowSetup,
    sensors: &Sensors,
    windows: &[WindowSamples],
) -> Vec<Impulses> {
    let walk = sensors.corrected(walk);
    let valued: Vec<(usize, usize, &Column)> = (setup.columns.effects())
        .filter(|(k, ..)| setup.theta[*k] != 0.0)
        .map(|(k, site, linear)| (k, site, &linear.column))
        .collect();
    let is_valued = |site: usize| valued.iter().any(|(_, own, _)| *own == site);
    let states = JointStates::of((&walk, stance), &setup.columns, is_valued);
    let joints = walk.tau.width();
    let of = |window: &WindowSamples| {
        let span = Span::of(&walk, &window.samples);
        let mut all = vec![vec![0.0; joints]; span.samples.len()];
        for (k, site, column) in &valued {
            states.each_torque(*site, column, |joint, term| {
                let own = span.impulses(|n| term(span.samples[n]));
                for (all, impulse) in all.iter_mut().zip(own) {
                    all[joint] += setup.theta[*k] * impulse;
                }
            });
        }
        all
    };
    windows.iter().map(of).collect()
}

/// What windows leave at the parameters of `setup`, N m (N of forces), as rows are scaled: of a walk as these sensors read it, with the `impulses` of
/// effects.
pub(super) fn residuals(
    walk: &Walk,
    stance: &Stance,
    setup: &RowSetup,
    sensors: &Sensors,
    (windows, impulses): (&[WindowSamples], &[Impulses]),
) -> Vec<Vec<f64>> {
    let walk = sensors.corrected(walk);
    let at = Instants {
        walk: &walk,
        stance,
        setup,
        sensors,
        imu: sensors.imu(&setup.columns.robot),
    };
    let both = windows.iter().zip(impulses);
    both.map(|(window, impulses)| at.residual(window, impulses))
        .collect()
}

/// A walk, and the parameters that its instants are looked at with.
struct Instants<'a> {
    walk: &'a Walk,
    stance: &'a Stance,
    setup: &'a RowSetup,
    sensors: &'a Sensors,
    /// In the base.
    imu: Transform<f64>,
}

impl Instants<'_> {
    fn residual(&self, window: &WindowSamples, effects: &Impulses) -> Vec<f64> {
        let span = Span::of(self.walk, &window.samples);
        let robot = &*self.setup.columns.robot;
        let scale = robot.scale_beside(&window.resting);
        let width = scale.len();
        let mut moving = Moving::default();
        let mut projector = Projector::default();
        let velocities = self.velocities(&span.samples);
        let mut left = vec![0.0; width];
        let mut project = |projector: &Projector, force: &mut [f64]| {
            force.iter_mut().zip(&scale).for_each(|(x, s)| *x *= s);
            projector.apply(force);
            left.iter_mut().zip(force).for_each(|(sum, x)| *sum += *x);
        };
        let [mut momentum, mut rate, mut force] = [0; 3].map(|_| vec![0.0; width]);
        let [mut last_momentum, mut last_force] = [0; 2].map(|_| vec![0.0; width]);
        for (k, &n) in span.samples.iter().enumerate() {
            self.momentum(n, &velocities[k], &mut moving, (&mut momentum, &mut rate));
            let [before, after] = span.halves[k];
            for (force, rate) in force.iter_mut().zip(&rate) {
                *force = rate * (before + after);
            }
            let torques = effects[k].iter().zip(&self.walk.tau[n]);
            for (force, (effect, tau)) in force[OF_BASE..].iter_mut().zip(torques) {
                *force += effect - tau * (before + after);
            }
            // The projector of a sample is multiplied with half of what the momentum changes by to both sides.
            if k > 0 {
                for c in 0..width {
                    let half = (momentum[c] - last_momentum[c]) * 0.5;
                    force[c] += half;
                    last_force[c] += half;
                }
                project(&projector, &mut last_force);
            }
            std::mem::swap(&mut momentum, &mut last_momentum);
            std::mem::swap(&mut force, &mut last_force);
            let down = self.imu.rotation * self.walk.down[n];
            let points = self.sensors.points(robot, &self.stance.loaded[n]);
            let (tree, pose) = (&self.setup.tree, &moving.pose);
            projector.update(tree, pose, points.iter(), &down, &scale);
        }
        if !span.samples.is_empty() {
            project(&projector, &mut last_force);
        }
        left.iter_mut().for_each(|x| *x /= span.seconds);
        left
    }

    /// The IMU's velocity at each sample in the frame that falls freely from the window's first on, m/s, in its axes, by Heun's method.
    fn velocities(&self, samples: &[usize]) -> Vec<Vector3<f64>> {
        let bias = self.sensors.acc_bias();
        let rate =
            |n: usize, v: &Vector3<f64>| self.walk.acc[n] - bias - self.walk.gyro[n].cross(v);
        let mut all = vec![Vector3::zeros()];
        for pair in samples.windows(2) {
            let step = self.walk.seconds(pair[1]) - self.walk.seconds(pair[0]);
            let v = all[all.len() - 1];
            let first = rate(pair[0], &v);
            let second = rate(pair[1], &(v + first * step));
            all.push(v + (first + second) * (step * 0.5));
        }
        all
    }

    /// H q̇ and −Cᵀ q̇ at a sample, in the freely falling frame; where bodies are then is left behind.
    fn momentum(
        &self,
        n: usize,
        velocity: &Vector3<f64>,
        moving: &mut Moving,
        (momentum, rate): (&mut [f64], &mut [f64]),
    ) {
        let base = self.imu.act(&Motion::new(self.walk.gyro[n], *velocity));
        let tree = &self.setup.tree;
        tree.update(&self.walk.q[n], base, &self.walk.dq[n], moving);
        tree.momentum_and_rate(moving, momentum, rate);
    }
}

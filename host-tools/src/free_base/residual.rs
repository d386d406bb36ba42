//! What the equations of windows leave at known parameters, from the bodies' momentum itself: what the rows of
//! [`proprio_core::window::FreeBaseWindow`] times these parameters leave, without the rows.
//!
//! A row has a column for each of 130 inertial parameters; where the parameters are known, H q̇ and Cᵀ q̇ of the bodies are all that is needed. What
//! sensors get wrong is found by differences of these, a dozen or two for each window.

use nalgebra::{SVector, Vector3};
use proprio_core::contact::Projector;
use proprio_core::go2::{JOINTS, LEGS};
use proprio_core::spatial::{Motion, Transform};
use proprio_core::tree::Kinematics;

use super::coordinates::{BODIES, COORDINATES, Equations, FIRST_JOINT, scale};
use super::imu::imu;
use super::projection::{JointStates, Span};
use super::row_setup::RowSetup;
use super::sensors::Sensors;
use super::stance::Stance;
use super::walk::Walk;
use super::windows::WindowSamples;

type Coordinates = SVector<f64, COORDINATES>;

/// What windows leave at the parameters of `setup`, N m (N of forces), as rows are scaled: of a walk as these sensors read it.
pub(super) fn residuals(
    walk: &Walk,
    stance: &Stance,
    setup: &RowSetup,
    sensors: &Sensors,
    windows: &[WindowSamples],
) -> Vec<Equations> {
    let walk = sensors.corrected(walk);
    let valued = |site: usize| {
        let mut own = setup.columns.effects();
        own.any(|(k, n, _)| n == site && setup.theta[k] != 0.0)
    };
    let states = JointStates::of(&walk, &setup.columns, valued);
    let at = Instants {
        walk: &walk,
        stance,
        setup,
        sensors,
    };
    let of = |window: &WindowSamples| at.residual(window, &states);
    windows.iter().map(of).collect()
}

/// A walk, and the parameters that its instants are looked at with.
struct Instants<'a> {
    walk: &'a Walk,
    stance: &'a Stance,
    setup: &'a RowSetup,
    sensors: &'a Sensors,
}

impl Instants<'_> {
    fn residual(&self, window: &WindowSamples, states: &JointStates<'_>) -> Equations {
        let span = Span::of(self.walk, &window.samples);
        let effects = self.effects(&span, states);
        let scale = scale(&window.resting);
        let mut kinematics = Kinematics::new();
        let mut projector = Projector::<f64, COORDINATES, { 3 * LEGS }>::new();
        let (feet, imu) = (self.sensors.feet(), imu());
        let velocities = self.velocities(&span.samples);
        let mut left = Coordinates::zeros();
        let mut last: Option<(Coordinates, Coordinates)> = None;
        let mut project = |projector: &Projector<_, _, _>, force: &Coordinates| {
            left += projector.apply(&Coordinates::from_fn(|c, _| scale[c] * force[c]));
        };
        for (k, &n) in span.samples.iter().enumerate() {
            let (momentum, rate) = self.momentum(n, &velocities[k], &mut kinematics);
            let [before, after] = span.halves[k];
            let mut force = rate * (before + after);
            for j in 0..JOINTS {
                force[FIRST_JOINT + j] += effects[k][j] - self.walk.tau[n][j] * (before + after);
            }
            // The projector of a sample is multiplied with half of what the momentum changes by to both sides.
            if let Some((last_momentum, last_force)) = last {
                let half = (momentum - last_momentum) * 0.5;
                force += half;
                project(&projector, &(last_force + half));
            }
            last = Some((momentum, force));
            let down = imu.rotation * self.walk.down[n];
            let (tree, loaded) = (&self.setup.tree, self.stance.loaded[n]);
            projector.update(tree, &kinematics.placements, &feet, loaded, &down, &scale);
        }
        if let Some((_, force)) = last {
            project(&projector, &force);
        }
        (left / span.seconds).into()
    }

    /// The impulses of the effects that have a value, sample by sample and joint by joint, N m s.
    fn effects(&self, span: &Span, states: &JointStates<'_>) -> Vec<[f64; JOINTS]> {
        let mut all = vec![[0.0; JOINTS]; span.samples.len()];
        let (columns, theta) = (&self.setup.columns, &self.setup.theta);
        for (k, site, linear) in columns.effects().filter(|(k, ..)| theta[*k] != 0.0) {
            states.each_torque(site, &linear.column, |joint, term| {
                for (all, impulse) in all.iter_mut().zip(span.impulses(term)) {
                    all[joint] += theta[k] * impulse;
                }
            });
        }
        all
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

    /// H q̇ and −Cᵀ q̇ at a sample; its kinematics are left behind.
    fn momentum(
        &self,
        n: usize,
        velocity: &Vector3<f64>,
        kinematics: &mut Kinematics<f64, BODIES, COORDINATES>,
    ) -> (Coordinates, Coordinates) {
        let base = imu().act(&Motion::new(self.walk.gyro[n], *velocity));
        let (mut q, mut v) = (Coordinates::zeros(), Coordinates::zeros());
        v.fixed_rows_mut::<3>(0).copy_from(&base.angular);
        v.fixed_rows_mut::<3>(3).copy_from(&base.linear);
        for j in 0..JOINTS {
            q[FIRST_JOINT + j] = self.walk.q[n][j];
            v[FIRST_JOINT + j] = self.walk.dq[n][j];
        }
        let tree = &self.setup.tree;
        tree.update_kinematics(kinematics, &Transform::identity(), &q, &v);
        // The frame falls freely.
        kinematics.gravity.fill(Vector3::zeros());
        tree.momentum_and_rate(kinematics)
    }
}

//! A simulated robot whose truth is known: one to four pinned legs that follow a reference, and the log they make.
//!
//! The rigid body is the core's Go2. What is added to it are the effects of the core's catalogue: an effect states its
//! torque's integral as \[boundary\] + ∫ rate dt, so its torque is rate + d(boundary)/dt, and every entry of the catalogue
//! can be simulated without a line of code here. The motor's torque is that of a PD controller on the reference; the
//! sensors add noise, the quanta of the motor bus, jitter and repeated messages. A seed gives the same log everywhere.

mod leg;
mod motion;
mod sensors;

use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::parameter::JointEffect;
use leg::SimulatedLeg;
pub use motion::Motion;
pub use sensors::Sensors;

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Which legs, each with its base pinned.
    pub legs: Vec<Leg>,
    /// What the joints are asked to do.
    pub motion: Motion,
    /// Length, s.
    pub duration: f64,
    /// Samples per second.
    pub rate: f64,
    /// What is added to the rigid body; several entries for one effect and joint add up.
    pub effects: Vec<JointEffect>,
    /// What lies between the motion and the log.
    pub sensors: Sensors,
    /// Chooses the reference and all that is random.
    pub seed: u64,
}

/// One sample of a simulated log, its joints leg by leg.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSample {
    /// Time, s.
    pub t: f64,
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Motor torque, N m.
    pub tau: Vec<f64>,
}

/// A simulation that left the real numbers: an effect too strong for the integration step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the simulation of leg {} diverged after {t:.3} s", .leg.name())]
pub struct Diverged {
    /// The leg that did.
    pub leg: Leg,
    /// When, s.
    pub t: f64,
}

impl Simulation {
    /// `legs` follow the default reference for 20 s at 500 Hz, rigid bodies with real sensors.
    pub fn new(legs: &[Leg]) -> Self {
        Self {
            legs: legs.to_vec(),
            motion: Motion::Multisine,
            duration: 20.0,
            rate: 500.0,
            effects: Vec::new(),
            sensors: Sensors::default(),
            seed: 1,
        }
    }

    /// The samples, one after the other.
    ///
    /// # Errors
    /// An item is [`Diverged`], and the last, if the motion is no longer finite.
    pub fn samples(&self) -> impl Iterator<Item = Result<SimulatedSample, Diverged>> + '_ {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut legs: Vec<SimulatedLeg> = self
            .legs
            .iter()
            .map(|&leg| SimulatedLeg::new(leg, self, &mut rng))
            .collect();
        let count = (self.duration * self.rate).round() as u64;
        let mut previous = None;
        let mut failed = false;
        (0..=count).map_while(move |k| {
            if failed {
                return None;
            }
            let t = self.sensors.sampling_time(k, self.rate, &mut rng);
            let sample = sample(&mut legs, t).map(|truth| {
                let measured = self.sensors.measure(truth, previous.as_ref(), &mut rng);
                previous = Some(measured.clone());
                measured
            });
            failed = sample.is_err();
            Some(sample)
        })
    }
}

/// All legs at time `t`, s.
fn sample(legs: &mut [SimulatedLeg], t: f64) -> Result<SimulatedSample, Diverged> {
    let joints = JOINTS_PER_LEG * legs.len();
    let empty = || Vec::with_capacity(joints);
    let mut sample = SimulatedSample {
        t,
        q: empty(),
        dq: empty(),
        tau: empty(),
    };
    for leg in legs {
        leg.advance_to(t)?;
        sample.q.extend(leg.q().iter());
        sample.dq.extend(leg.dq().iter());
        sample.tau.extend(leg.torque().iter());
    }
    Ok(sample)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::typical_effects;
    use proprio_core::go2;

    fn short(sensors: Sensors) -> Simulation {
        let legs = [Leg::FL, Leg::RR];
        Simulation {
            duration: 2.0,
            effects: typical_effects(&legs),
            sensors,
            ..Simulation::new(&legs)
        }
    }

    #[test]
    fn a_seed_gives_one_log_and_another_seed_another() {
        let log = |seed| -> Vec<_> {
            let simulation = Simulation {
                seed,
                ..short(Sensors::default())
            };
            simulation.samples().collect::<Result<_, _>>().unwrap()
        };
        assert_eq!(log(1), log(1));
        assert_ne!(log(1), log(2));
        assert_eq!(log(1).len(), 1001);
    }

    #[test]
    fn the_motion_stays_within_the_joint_limits() {
        for motion in [Motion::Multisine, Motion::Chirp] {
            let simulation = Simulation {
                duration: 20.0,
                motion,
                effects: typical_effects(&Leg::ALL),
                sensors: Sensors::ideal(),
                ..Simulation::new(&Leg::ALL)
            };
            for sample in simulation.samples() {
                let sample = sample.unwrap();
                for (n, &q) in sample.q.iter().enumerate() {
                    let [lower, upper] = go2::position_limits(Leg::ALL[n / 3])[n % 3];
                    assert!(q > lower && q < upper, "{motion:?}: joint {n} at {q} rad");
                }
            }
        }
    }

    /// The work of the motors is the change of energy plus the heat of viscous friction: the integration, the effects
    /// and the core's energy must agree.
    #[test]
    fn work_is_energy_plus_heat() {
        let viscous: Vec<_> = typical_effects(&[Leg::FL])
            .into_iter()
            .filter(|e| e.effect == proprio_core::effect::EffectKind::Viscous)
            .collect();
        let simulation = Simulation {
            duration: 2.0,
            effects: viscous.clone(),
            sensors: Sensors::ideal(),
            ..Simulation::new(&[Leg::FL])
        };
        let samples: Vec<_> = simulation.samples().collect::<Result<_, _>>().unwrap();
        let tree = go2::leg::<f64>(Leg::FL);
        let base = proprio_core::spatial::Transform::identity();
        let energy = |s: &SimulatedSample| {
            let vector = |v: &[f64]| nalgebra::Vector3::from_column_slice(v);
            let k = tree.kinematics(&base, &vector(&s.q), &vector(&s.dq));
            let (kinetic, potential) = tree.energy(&k, &base);
            kinetic + potential
        };
        let power = |s: &SimulatedSample| -> f64 {
            (0..3)
                .map(|j| (s.tau[j] - viscous[j].value * s.dq[j]) * s.dq[j])
                .sum()
        };
        // Simpson's rule over pairs of samples.
        let work: f64 = samples
            .windows(3)
            .step_by(2)
            .map(|w| (w[2].t - w[0].t) / 6.0 * (power(&w[0]) + 4.0 * power(&w[1]) + power(&w[2])))
            .sum();
        let change = energy(&samples[samples.len() - 1]) - energy(&samples[0]);
        assert!(
            (work - change).abs() < 1e-5,
            "work {work} J, energy {change} J"
        );
    }
}

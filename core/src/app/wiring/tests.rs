//! Each fault is named, a leg as it should be is cleared, and two faults are never one.

use std::{boxed::Box, println, vec, vec::Vec};

use super::*;
use crate::app::Identity;
use crate::app::leg::SETTINGS;
use crate::app::tests::{DESKTOP, Whole, bytes};
use crate::bus::{Mode, Reply};
use crate::estimator::{DEFAULT_ACTIVE, DevicePrior, DeviceWindow, LEG_INERTIAL, LegBase};
use crate::go2::{ACTUATORS, Leg};
use crate::spatial::Transform;
use crate::tree::Tree;
use crate::wire::{self, DeviceMessage, HostMessage};
use nalgebra::SVector;

/// A leg as the device knows it.
struct Judge {
    which: Leg,
    window: Box<DeviceWindow<f64>>,
    base: Box<LegBase<f64>>,
    work: Vec<f64>,
    trial: Box<Trial>,
    notes: Box<Notes>,
    said: Said,
}

impl Judge {
    fn new(which: Leg, said: Said) -> Self {
        let (mut base, mut work) = (Box::new(LegBase::empty()), vec![0.0; 1100]);
        let prior = DevicePrior::of(which, &DEFAULT_ACTIVE);
        base.analyse(which, &prior, &mut work).unwrap();
        let mut trial = Box::new(Trial::new());
        trial.begin(false);
        Self {
            which,
            window: Box::new(DeviceWindow::new(which, &Transform::identity(), SETTINGS)),
            base,
            work,
            trial,
            notes: Box::new(Notes::new()),
            said,
        }
    }

    /// What is found of these samples, and after how long, s.
    fn judge(&mut self, samples: &[Sample<f64, 3>]) -> (Wiring, f64) {
        let start = samples[0].time_us;
        for sample in samples {
            let pushed = self.window.push(sample);
            self.trial
                .see(pushed, sample, self.window.rows(), &mut self.notes);
            while self.trial.is_ready() {
                let model = Model {
                    frame: self.window.frame(),
                    base: &self.base,
                    said: self.said,
                    stops: crate::go2::position_limits(self.which),
                };
                self.trial
                    .advance(&model, false, &mut self.notes, &mut self.work);
            }
            if !matches!(self.trial.known(), Wiring::OnTrial) {
                return (self.trial.known(), (sample.time_us - start) as f64 * 1e-6);
            }
        }
        (self.trial.known(), f64::INFINITY)
    }
}

fn spoil(fault: Fault, said: &Said, s: &mut Sample<f64, 3>) {
    match fault {
        Fault::TorqueSign { joint } => s.tau[joint as usize] *= -1.0,
        Fault::Reversed { joint } => {
            let j = joint as usize;
            s.q[j] = 2.0 * f64::from(said.angles[j]) - s.q[j];
            s.dq[j] *= -1.0;
            s.tau[j] *= -1.0;
        }
        Fault::Exchanged { joints } => {
            let [a, b] = joints.map(usize::from);
            let ratio = ACTUATORS[a].gear / ACTUATORS[b].gear;
            let before = *s;
            let at = said.angles.map(f64::from);
            s.q[a] = at[a] + (before.q[b] - at[b]) / ratio;
            s.q[b] = at[b] + (before.q[a] - at[a]) * ratio;
            (s.dq[a], s.dq[b]) = (before.dq[b] / ratio, before.dq[a] * ratio);
            (s.tau[a], s.tau[b]) = (before.tau[b] * ratio, before.tau[a] / ratio);
        }
        Fault::Turns { joint, turns } => {
            let j = joint as usize;
            s.q[j] += f64::from(turns) * core::f64::consts::TAU / ACTUATORS[j].gear;
        }
        Fault::Velocity { joint, per_mille } => {
            s.dq[joint as usize] *= 1.0 + f64::from(per_mille) * 1e-3;
        }
        _ => {}
    }
}

/// Numbers that look like chance, the same each time.
struct Dice(u64);

impl Dice {
    /// From 0 to 1.
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, [from, to]: [f64; 2]) -> f64 {
        from + (to - from) * self.roll()
    }

    /// About 0 ± 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.roll()).sum::<f64>() - 6.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.roll() * n as f64) as usize
    }
}

/// What a leg is and how it moves.
struct RealLeg {
    tree: Tree<f64, 3, 3>,
    friction: [[f64; 4]; 3],
    middle: [f64; 3],
    waves: [[[f64; 3]; 2]; 3],
    /// Force of the ground at the foot, N.
    ground: f64,
    /// White noise of the velocities of hip, thigh and calf: a standing Go2's, rad/s.
    noise: [f64; 3],
    dice: Dice,
}

impl RealLeg {
    fn new(which: Leg, seed: u64) -> Self {
        let mut dice = Dice(seed);
        let mut bodies = *crate::go2::leg::<f64>(which).bodies();
        for body in &mut bodies {
            let [mass, moment, inertia] = core::array::from_fn(|_| 1.0 + 0.05 * dice.normal());
            for n in 0..10 {
                body.inertia.0[n] *= match n {
                    0 => mass,
                    1..=3 => moment,
                    _ => inertia,
                };
            }
        }
        let friction = core::array::from_fn(|j| {
            let most = if j == 2 { [0.2, 1.0] } else { [0.1, 0.4] };
            [
                dice.between([0.02, 0.2]),
                dice.between(most),
                ACTUATORS[j].armature() * dice.between([0.8, 1.2]),
                dice.between([-0.15, 0.15]),
            ]
        });
        let middle = core::array::from_fn(|j| [0.0, 0.8, -1.7][j] + dice.between([-0.2, 0.2]));
        let waves = core::array::from_fn(|_| {
            core::array::from_fn(|_| {
                [
                    dice.between([0.15, 0.3]),
                    dice.between([2.0, 9.0]),
                    dice.between([0.0, 6.3]),
                ]
            })
        });
        Self {
            tree: Tree::new(bodies).unwrap(),
            friction,
            middle,
            waves,
            ground: 0.0,
            noise: [0.035, 0.035, 0.022],
            dice,
        }
    }

    /// Position, velocity and torque at a time, s; at rest before 0.
    fn at(&mut self, t: f64) -> [[f64; 3]; 3] {
        let (mut q, mut v, mut a) = (SVector::zeros(), SVector::zeros(), SVector::zeros());
        let still = t < 0.0;
        let t = t.max(0.0);
        for j in 0..3 {
            q[j] = self.middle[j];
            for [amplitude, rate, phase] in self.waves[j] {
                let (sin, cos) = (rate * t + phase).sin_cos();
                q[j] += amplitude * sin;
                if !still {
                    v[j] += amplitude * rate * cos;
                    a[j] -= amplitude * rate * rate * sin;
                }
            }
        }
        let k = self.tree.kinematics(&Transform::identity(), &q, &v);
        let bodies = self.tree.inverse_dynamics(&k, &v, &a);
        // How high the foot comes with each joint, m/rad.
        let side = self.tree.bodies()[1].placement.translation.y;
        let ([s0, c0], [s1, c1]) = ([q[0].sin(), q[0].cos()], [q[1].sin(), q[1].cos()]);
        let (s12, c12) = (q[1] + q[2]).sin_cos();
        let lifts = [
            side * c0 + s0 * 0.213 * (c1 + c12),
            c0 * 0.213 * (s1 + s12),
            c0 * 0.213 * s12,
        ];
        let mut out = [[0.0; 3]; 3];
        for j in 0..3 {
            let [viscous, coulomb, armature, bias] = self.friction[j];
            out[0][j] = q[j];
            out[1][j] = if still {
                0.0
            } else {
                v[j] + self.noise[j] * self.dice.normal()
            };
            out[2][j] =
                bodies[j] + viscous * v[j] + coulomb * (v[j] / 0.05).tanh() + armature * a[j]
                    - self.ground * lifts[j]
                    + bias
                    + 0.05 * self.dice.normal();
        }
        out
    }
}

fn simulated(which: Leg, seed: u64) -> Vec<Sample<f64, 3>> {
    let mut real = RealLeg::new(which, seed);
    (0..5000)
        .map(|n| {
            let t = n as f64 * 2e-3;
            let [q, dq, tau] = real.at(t);
            Sample {
                time_us: 1_000_000 + n * 2000,
                q,
                dq,
                tau,
            }
        })
        .collect()
}

/// What is found of a fault, as it should be, or open, or wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    Right,
    Open,
    Wrong,
}

fn compare(truth: Option<Fault>, found: Wiring) -> Found {
    let named = match (truth, found) {
        (_, Wiring::Untested | Wiring::OnTrial | Wiring::Unclear(_) | Wiring::Unexplained) => {
            return Found::Open;
        }
        (None, Wiring::Right) => true,
        (
            Some(Fault::Velocity { joint, per_mille }),
            Wiring::Fault(Fault::Velocity {
                joint: other,
                per_mille: told,
            }),
        ) => joint == other && (told - per_mille).abs() < 10,
        (
            Some(Fault::OtherSide | Fault::Reversed { joint: 0 }),
            Wiring::Fault(Fault::OtherSideOrReversed),
        ) => true,
        (Some(fault), Wiring::Fault(other)) => fault == other,
        _ => false,
    };
    if named { Found::Right } else { Found::Wrong }
}

/// All that is tried, and a velocity.
fn truths(seed: u64) -> impl Iterator<Item = Option<Fault>> {
    let joint = (seed % 3) as u8;
    HYPOTHESES.into_iter().chain([Some(Fault::Velocity {
        joint,
        per_mille: 80,
    })])
}

/// What a leg's samples with these faults come to.
fn judged(which: Leg, seed: u64, faults: &[Fault]) -> (Wiring, f64) {
    let mirrored = faults.contains(&Fault::OtherSide);
    let true_leg = if mirrored { other_side(which) } else { which };
    let mut samples = simulated(true_leg, seed);
    let said = Said {
        angles: samples[0].q.map(|q| q as f32),
        reversed: 0,
    };
    for fault in faults {
        samples
            .iter_mut()
            .for_each(|sample| spoil(*fault, &said, sample));
    }
    Judge::new(which, said).judge(&samples)
}

fn other_side(leg: Leg) -> Leg {
    Leg::ALL[leg.index() ^ 1]
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn each_fault_of_a_simulated_leg_is_named_and_none_other() {
    let mut open = Vec::new();
    let mut all = 0;
    for seed in 0..12 {
        let which = Leg::ALL[seed as usize % 4];
        for truth in truths(seed) {
            let (found, after) = judged(which, seed, truth.as_slice());
            all += 1;
            match compare(truth, found) {
                Found::Right => assert!(after < 10.0, "{truth:?} {after}"),
                Found::Open => open.push((which, seed, truth, found)),
                Found::Wrong => panic!("{which:?} {seed} {truth:?}: {found:?}"),
            }
        }
    }
    assert!(open.len() * 50 < all, "{} of {all}: {open:?}", open.len());
}

/// Two faults are hardly ever taken for one that is neither of them, or for a leg that is right.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn two_faults_are_not_another_one() {
    let mut dice = Dice(5);
    let (mut all, mut wrong, mut one) = (0, Vec::new(), 0);
    for seed in 100..200 {
        let which = Leg::ALL[seed as usize % 4];
        let faults: [Fault; 2] = core::array::from_fn(|_| HYPOTHESES[1 + dice.below(16)].unwrap());
        // Turns there and back, or a hip that turns two ways: as good as one or none.
        let joints = faults.map(|fault| match fault {
            Fault::OtherSide => Some(0),
            Fault::Reversed { joint } | Fault::Turns { joint, .. } => Some(joint),
            _ => None,
        });
        if faults[0] == faults[1] || (joints[0].is_some() && joints[0] == joints[1]) {
            continue;
        }
        all += 1;
        let found = judged(which, seed, &faults).0;
        if !matches!(found, Wiring::Right | Wiring::Fault(_)) {
            continue;
        }
        let is_one = |fault: &Fault| compare(Some(*fault), found) == Found::Right;
        match faults.iter().any(is_one) {
            true => one += 1,
            false => wrong.push((which, seed, faults, found)),
        }
    }
    println!("{all} pairs: {one} of them one of both, wrong {wrong:?}");
    assert!(wrong.len() <= 1, "{wrong:?}");
}

/// A device that hears one leg, whose motors count from elsewhere after a power-up.
struct Device {
    whole: Box<Whole<f64>>,
    which: usize,
    real: RealLeg,
    /// From where each joint's motor counts, and in which direction.
    power_up: [(i32, bool); 3],
    faults: Vec<Fault>,
    step: u64,
    asked: u32,
    messages: Vec<DeviceMessage>,
}

impl Device {
    fn new(which: usize, seed: u64, faults: &[Fault], scrambled: bool) -> Self {
        let leg = Leg::ALL[which];
        let mirrored = faults.contains(&Fault::OtherSide);
        let mut dice = Dice(seed ^ 0xABCD);
        let identity = Identity {
            positions: wire::Positions::FromPowerUp,
            ..DESKTOP
        };
        let power_up = core::array::from_fn(|_| match scrambled {
            true => ((dice.roll() * 4e5) as i32 - 200_000, dice.roll() < 0.5),
            false => (0, false),
        });
        Self {
            whole: Whole::new(identity),
            which,
            real: RealLeg::new(if mirrored { other_side(leg) } else { leg }, seed),
            power_up,
            faults: faults.to_vec(),
            step: 0,
            asked: 0,
            messages: Vec::new(),
        }
    }

    /// A step at a time of the motion, s.
    fn hear(&mut self, t: f64) {
        let [q, mut dq, mut tau] = self.real.at(t);
        let mut ids = [0, 1, 2];
        for fault in &self.faults {
            match *fault {
                Fault::TorqueSign { joint } => tau[usize::from(joint)] *= -1.0,
                Fault::Velocity { joint, per_mille } => {
                    dq[usize::from(joint)] *= 1.0 + f64::from(per_mille) * 1e-3
                }
                Fault::Exchanged { joints: [a, b] } => ids.swap(a.into(), b.into()),
                _ => {}
            }
        }
        let mut replies: [Reply; 3] = core::array::from_fn(|j| {
            let (zero, reversed) = self.power_up[j];
            let reply = Reply::from_joint(
                Mode::foc(ids[j]),
                ACTUATORS[j].gear,
                q[j],
                dq[j],
                tau[j],
                30,
            )
            .unwrap();
            let sign = if reversed { -1 } else { 1 };
            Reply {
                position: sign * reply.position + zero,
                speed: sign as i16 * reply.speed,
                torque: sign as i16 * reply.torque,
                ..reply
            }
        });
        replies.sort_by_key(|reply| reply.mode.id());
        let bytes = bytes(&replies, true);
        let mut buses: [&[u8]; 4] = [&[]; 4];
        buses[self.which] = &bytes;
        self.step += 1;
        let messages = &mut self.messages;
        self.whole.step(1 + self.step * 2000, buses, &mut |m| {
            messages.push(m.clone())
        });
    }

    fn ask(&mut self, action: wire::Action) {
        self.asked += 1;
        let id = self.asked;
        let request = wire::Request { id, action };
        self.whole.handle(&HostMessage::Request(request));
    }

    /// Has the user put the zeros where the joints are; whether the device took them.
    fn place(&mut self) -> bool {
        (0..50).for_each(|_| self.hear(-1.0));
        let [q, ..] = self.real.at(-1.0);
        for joint in 0..3 {
            let (mut angle, mut reversed) = (q[joint], self.power_up[joint].1);
            for fault in &self.faults {
                match *fault {
                    Fault::Turns { joint: of, turns } if usize::from(of) == joint => {
                        angle += f64::from(turns) * core::f64::consts::TAU / ACTUATORS[joint].gear;
                    }
                    Fault::Reversed { joint: of } if usize::from(of) == joint => {
                        reversed = !reversed
                    }
                    _ => {}
                }
            }
            self.ask(wire::Action::SetZero(wire::SetZero {
                leg: self.which as u8,
                joint: joint as u8,
                angle: angle as f32,
                reversed,
            }));
            (0..3).for_each(|_| self.hear(-1.0));
        }
        let accepted = self.messages.iter().filter(
            |m| matches!(m, DeviceMessage::Answer(a) if a.outcome == wire::Outcome::Accepted),
        );
        accepted.count() == 3
    }

    /// Moves until something is told, for so long at most, s; when.
    fn run(&mut self, seconds: f64) -> (Wiring, f64) {
        let steps = (seconds * 500.0) as u64;
        for n in 0..steps {
            self.hear(n as f64 * 2e-3);
            let told = self.told();
            if !matches!(told, Wiring::OnTrial) {
                return (told, n as f64 * 2e-3);
            }
        }
        (self.told(), seconds)
    }

    fn told(&self) -> Wiring {
        let mut hellos = self
            .messages
            .iter()
            .rev()
            .filter_map(|message| match message {
                DeviceMessage::Hello(hello) => Some(hello.wiring[self.which]),
                _ => None,
            });
        hellos.next().unwrap()
    }

    fn estimates(&self) -> usize {
        let told = self.messages.iter();
        told.filter(|m| {
            matches!(
                m,
                DeviceMessage::Estimate(_) | DeviceMessage::Diagnosis(_) | DeviceMessage::Change(_)
            )
        })
        .count()
    }
}

/// Bytes of the bus in, hellos out: each fault at three legs and two robots, within 10 s.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_device_names_each_fault_within_ten_seconds() {
    for (n, truth) in truths(1).enumerate() {
        for leg in [0, 1, 2] {
            for seed in [3, 4] {
                let mut device = Device::new(leg, seed + 10 * n as u64, truth.as_slice(), false);
                if !device.place() {
                    // A turn would have the joint beyond its stops: refused at once.
                    assert!(matches!(truth, Some(Fault::Turns { .. })), "{truth:?}");
                    continue;
                }
                let (found, after) = device.run(10.0);
                println!("{truth:?} {leg} {seed}: {found:?} {after:.1} s");
                assert_eq!(
                    compare(truth, found),
                    Found::Right,
                    "{truth:?} {leg} {seed}: {found:?}"
                );
                assert_eq!(device.estimates(), 0);
                (0..1500).for_each(|n| device.hear(after + n as f64 * 2e-3));
                assert_eq!(device.estimates() > 0, truth.is_none());
            }
        }
    }
}

/// Motors that count from anywhere in any direction, half of them with a fault.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn of_a_hundred_power_ups_none_is_taken_for_another() {
    let mut dice = Dice(17);
    let (mut right, mut open, mut refused) = (0, Vec::new(), 0);
    for n in 0..100 {
        let truth = match dice.roll() < 0.5 {
            true => None,
            false => HYPOTHESES[1 + dice.below(16)],
        };
        let mut device = Device::new(dice.below(4), 1000 + n, truth.as_slice(), true);
        if !device.place() {
            refused += 1;
            continue;
        }
        let (found, _) = device.run(10.0);
        match compare(truth, found) {
            Found::Right => right += 1,
            Found::Open => open.push((n, truth, found)),
            Found::Wrong => panic!("{n} {truth:?}: {found:?}"),
        }
        assert!(truth.is_none() || device.estimates() == 0);
    }
    println!("right {right}, refused {refused}, open {open:?}");
    assert!(right >= 90, "{right} {open:?}");
}

/// The friction, armature and offset of each joint that a device tells after ten seconds of a right leg, with their errors.
fn told_effects(mut device: Device, after: f64) -> Vec<[f64; 2]> {
    (0..5000).for_each(|n| device.hear(after + n as f64 * 2e-3));
    let mut messages = device.messages.iter().rev();
    let told = messages.find_map(|message| match message {
        DeviceMessage::Estimate(estimate) => Some(estimate),
        _ => None,
    });
    let told = told.unwrap();
    // The default effects, in the order of the simulated leg's numbers.
    assert_eq!(told.effects, DEFAULT_ACTIVE.0);
    let effects = told.values.iter().zip(&told.std).skip(LEG_INERTIAL);
    let effects = effects.map(|(value, std)| [value, std].map(|x| f64::from(*x)));
    effects.collect()
}

/// Motors that count from anywhere: once a leg is found to be right, armature and offset are the simulated ones within their errors. Velocities have
/// no noise here: theirs biases an armature.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_told_of_a_right_leg_is_true() {
    let (mut all, mut off) = (0, Vec::new());
    for n in 0..24 {
        let mut device = Device::new(n % 4, 3000 + n as u64, &[], true);
        device.real.noise = [0.0; 3];
        assert!(device.place());
        let (found, after) = device.run(20.0);
        assert_eq!(found, Wiring::Right, "{n}");
        let friction = device.real.friction;
        let told = told_effects(device, after);
        // Viscous and Coulomb friction depend on the simulated law, which turns over more smoothly.
        let numbers = friction.as_flattened().iter().zip(told).enumerate();
        for (_, (truth, [value, std])) in numbers.filter(|(k, _)| k % 4 >= 2) {
            all += 1;
            if (value - truth).abs() > 3.0 * std {
                off.push((n, *truth, value, std));
            }
        }
    }
    println!("{} of {all} beyond three standard deviations", off.len());
    assert!(100 * off.len() <= all, "{off:?}");
}

/// Zeros that are set give the estimates of angles that are right from the start: within the errors, for the trial has taken windows.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn after_a_trial_estimates_are_those_of_a_clean_run() {
    for n in 0..8 {
        let mut device = Device::new(n % 4, 4000 + n as u64, &[], true);
        assert!(device.place());
        let (found, after) = device.run(20.0);
        assert_eq!(found, Wiring::Right, "{n}");
        let mut clean = Device::new(n % 4, 4000 + n as u64, &[], false);
        clean.whole = Whole::new(DESKTOP);
        let told = told_effects(device, after);
        for ([a, std], [b, other]) in told.into_iter().zip(told_effects(clean, after)) {
            let error = std.hypot(other);
            assert!((a - b).abs() < 3.0 * error, "{n}: {a} {b} {error}");
        }
    }
}

/// A quarter of the robot's weight at a foot that sways over the ground: no hypothesis has such torques.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_leg_on_the_ground_has_no_fault() {
    let mut right = 0;
    for seed in 0..12 {
        let leg = seed as usize % 4;
        let mut device = Device::new(leg, 300 + seed, &[], false);
        device.real.ground = 37.0;
        assert!(device.place());
        let step = |device: &mut Device, n: u64| device.hear(n as f64 * 2e-3);
        for n in 0..6000 {
            step(&mut device, n);
            let open = [Wiring::OnTrial, Wiring::Unexplained];
            assert!(open.contains(&device.told()), "{seed} {:?}", device.told());
        }
        assert_eq!(device.estimates(), 0);
        // It is hung up.
        device.real.ground = 0.0;
        (6000..16_000).for_each(|n| step(&mut device, n));
        match device.told() {
            Wiring::Right => right += 1,
            told => assert!(matches!(told, Wiring::Unclear(_)), "{seed} {told:?}"),
        }
    }
    assert!(right >= 10, "{right} of 12");
}

/// Whether a change of its physics was told.
fn changes(device: &Device) -> Vec<wire::Change> {
    let told = device.messages.iter();
    told.filter_map(|message| match message {
        DeviceMessage::Change(change) => Some(*change),
        _ => None,
    })
    .collect()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_change_is_one_of_the_wiring_before_it_is_one_of_physics() {
    for flips in [true, false] {
        let mut device = Device::new(1, 77, &[], false);
        assert!(device.place());
        for n in 0..20_000 {
            device.hear(n as f64 * 2e-3);
        }
        assert_eq!(
            (device.told(), changes(&device)),
            (Wiring::Right, Vec::new())
        );
        let fault = Fault::TorqueSign { joint: 1 };
        match flips {
            true => device.faults.push(fault),
            false => device.real.friction[1][1] += 0.8,
        }
        let before = device.messages.len();
        for n in 20_000..26_000 {
            device.hear(n as f64 * 2e-3);
        }
        let trial = device.messages[before..].iter().position(|message| {
            matches!(message, DeviceMessage::Hello(hello) if hello.wiring[1] == Wiring::OnTrial)
        });
        let from = before + trial.expect("it is on trial");
        if flips {
            assert_eq!(device.told(), Wiring::Fault(fault));
            assert_eq!(changes(&device), Vec::new());
            let later = &device.messages[from..];
            assert!(
                !later
                    .iter()
                    .any(|m| matches!(m, DeviceMessage::Estimate(_)))
            );
        } else {
            assert_eq!(device.told(), Wiring::Right);
            let told = changes(&device);
            assert_eq!(told.len(), 1, "{told:?}");
            assert_eq!(
                (told[0].joint, told[0].kind),
                (1, wire::ChangeKind::Friction)
            );
        }
    }
}

/// A host that trusts the wiring of a leg that has changed hears of the change at once.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_change_is_told_when_the_host_trusts_the_wiring() {
    let mut device = Device::new(1, 77, &[], false);
    assert!(device.place());
    (0..20_000).for_each(|n| device.hear(f64::from(n) * 2e-3));
    device.real.friction[1][1] += 0.8;
    let mut later = 20_000..26_000;
    while device.told() != Wiring::OnTrial {
        device.hear(f64::from(later.next().expect("it is on trial")) * 2e-3);
    }
    assert_eq!(changes(&device), Vec::new());
    device.ask(wire::Action::TrustWiring);
    // A message a step: the answer, the hello, the change.
    (later.take(10)).for_each(|n| device.hear(f64::from(n) * 2e-3));
    let told = changes(&device);
    assert_eq!((device.told(), told.len()), (Wiring::Right, 1), "{told:?}");
    assert_eq!(told[0].kind, wire::ChangeKind::Friction);
}

//! The simulation as a whole: repeatability, limits, what is reported; [`mechanics`] compares it with mechanics.

mod mechanics;

use super::leg::SimulatedLeg;
use super::*;

fn short(sensors: Sensors) -> Simulation {
    let legs = [Leg::FL, Leg::RR];
    Simulation {
        duration: 2.0,
        effects: hidden::typical(&legs),
        inertia_error: 0.06,
        sensors,
        ..Simulation::new(&legs)
    }
}

fn log(simulation: &Simulation) -> Vec<SimulatedSample> {
    simulation.samples().collect::<Result<_, _>>().unwrap()
}

fn effect(text: &str) -> Vec<HiddenEffect> {
    text.parse::<Hide>().unwrap().on(&[Leg::FR]).unwrap()
}

fn ideal(effects: &[&str]) -> Simulation {
    Simulation {
        duration: 2.0,
        effects: effects.iter().flat_map(|text| effect(text)).collect(),
        sensors: Sensors::ideal(),
        ..Simulation::new(&[Leg::FR])
    }
}

/// What is of the base anyway may say so; a joint's effect is of no base.
#[test]
fn an_effect_of_the_base_may_name_it() {
    let on = |text: &str| text.parse::<Hide>().unwrap().on(&[Leg::FR]).unwrap();
    assert_eq!(on("base_tilt:base=0.05"), on("base_tilt=0.05"));
    assert!("coulomb:base=0.1".parse::<Hide>().is_err());
}

#[test]
fn a_seed_gives_one_log_and_another_seed_another() {
    let seeded = |seed| {
        log(&Simulation {
            seed,
            ..short(Sensors::default())
        })
    };
    assert_eq!(seeded(1), seeded(1));
    assert_ne!(seeded(1), seeded(2));
    assert_eq!(seeded(1).len(), 1001);
}

#[test]
fn the_motion_stays_within_the_joint_limits() {
    let legs = [Leg::FR, Leg::RL];
    for motion in [Motion::Multisine, Motion::Chirp, Motion::Moves] {
        let simulation = Simulation {
            duration: 10.0,
            motion,
            effects: hidden::typical(&legs),
            sensors: Sensors::ideal(),
            ..Simulation::new(&legs)
        };
        for sample in simulation.samples() {
            let sample = sample.unwrap();
            for (n, &q) in sample.q.iter().enumerate() {
                let [lower, upper] = go2::position_limits(legs[n / 3])[n % 3];
                assert!(q > lower && q < upper, "{motion:?}: joint {n} at {q} rad");
            }
        }
    }
}

/// Every size can be; every effect in its largest moves a leg for a while at each of its joints.
#[test]
fn every_effect_can_be_simulated_and_changes_the_log() {
    let without = log(&ideal(&[]));
    for &kind in HiddenKind::ALL {
        for joint in JointId::of(Leg::FR) {
            for size in 0..3 {
                let hidden = Sizes::of(kind).at(size, joint).unwrap();
                assert_eq!(hidden.kind(), kind);
                // The smaller ones are easier, and take their time.
                if size < 2 {
                    continue;
                }
                let simulation = Simulation {
                    duration: 0.4,
                    effects: vec![hidden],
                    ..ideal(&[])
                };
                let with = log(&simulation);
                let last = with.last().unwrap();
                assert!(
                    last.q.iter().all(|q| q.abs() < 3.0),
                    "{kind:?} {joint} {size}"
                );
                let late = [HiddenKind::Contact, HiddenKind::Saturation];
                if !late.contains(&kind) {
                    let differ = with.iter().zip(&without).any(|(a, b)| a.tau != b.tau);
                    assert!(differ, "{kind:?} {joint} {size}");
                }
            }
        }
    }
}

/// What an effect changes in the sensors or the statics, not in a joint's torque.
#[test]
fn reported_values_differ_from_the_true_ones_as_they_should() {
    let leg_at = |texts: &[&str]| {
        let simulation = ideal(texts);
        let mut leg = SimulatedLeg::new(Leg::FR, &simulation, &mut simulation.random(0));
        leg.advance_to(1.3).unwrap();
        leg
    };
    let leg = leg_at(&["velocity_gain:FR_thigh=1.09", "encoder_offset:FR_calf=0.05"]);
    let (report, state) = (leg.report(), leg.state());
    assert_eq!(report.dq[1], 1.09 * state.dq[1]);
    assert_eq!(report.q[2], state.q[2] + 0.05);
    for (text, given) in [
        ("torque_gain:FR_thigh=0.8", &|tau: f64| 0.8 * tau),
        ("saturation:FR_thigh=0.4", &|tau: f64| tau.clamp(-0.4, 0.4)),
    ] as [(&str, &dyn Fn(f64) -> f64); 2]
    {
        let leg = leg_at(&[text]);
        assert!(
            (leg.given()[1] - given(leg.report().tau[1])).abs() < 1e-12,
            "{text}"
        );
        assert_eq!(leg.given()[0], leg.report().tau[0]);
    }
}

#[test]
fn a_late_torque_is_the_torque_of_before() {
    let late = 0.0037;
    let samples = |texts: &[&str], rate| {
        log(&Simulation {
            rate,
            ..ideal(texts)
        })
    };
    // At ten times the rate the truth of 3.7 ms ago is a sample.
    let truth = samples(&[], 10_000.0);
    let reported = samples(&[&format!("delay:FR_calf={late}")], 500.0);
    for sample in &reported[10..] {
        let then = ((sample.t - late) * 10_000.0).round() as usize;
        let around = truth[then - 2..=then + 2].iter().map(|s| s.tau[2]);
        let (low, high) = around.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        assert!(
            (low - 1e-9..=high + 1e-9).contains(&sample.tau[2]),
            "{}",
            sample.t
        );
    }
    let motion = samples(&[], 500.0);
    assert!(
        motion
            .iter()
            .zip(&reported)
            .all(|(a, b)| a.q == b.q && a.dq == b.dq)
    );
}

#[test]
fn motors_warm_with_torque_and_temperatures_come_in_degrees() {
    let mut simulation = ideal(&["thermal_viscous:FR_thigh=0.005"]);
    simulation.duration = 20.0;
    simulation.sensors.quantised = true;
    let samples = log(&simulation);
    let temperatures = |s: &SimulatedSample| s.temp.clone().unwrap();
    let (first, last) = (temperatures(&samples[0]), temperatures(&samples[10_000]));
    assert!(
        samples
            .iter()
            .flat_map(temperatures)
            .all(|t| t == t.round())
    );
    assert!(last[1] > first[1] + 3.0, "{first:?} to {last:?}");
    assert!(log(&ideal(&[]))[0].temp.is_none());
}

#[test]
fn hidden_effects_change_neither_reference_nor_bodies() {
    let a = Simulation {
        effects: Vec::new(),
        ..short(Sensors::ideal())
    };
    let b = short(Sensors::ideal());
    assert_eq!(a.bodies(Leg::RR), b.bodies(Leg::RR));
    assert_ne!(a.bodies(Leg::RR), a.bodies(Leg::RL));
    let difference = log(&a).iter().zip(&log(&b)).fold(0.0f64, |m, (a, b)| {
        a.q.iter()
            .zip(&b.q)
            .fold(m, |m, (a, b)| m.max((a - b).abs()))
    });
    assert!(difference < 0.1, "{difference} rad");
    let truth = b.truth();
    let named = |name: &str| truth.iter().find(|p| p.name == name).unwrap().value;
    assert_eq!(named("coulomb:FL_calf"), 0.6);
    assert_eq!(named("m:RR_hip"), b.bodies(Leg::RR)[0].mass());
}

#[test]
fn every_effect_has_sizes_and_a_name_the_catalogue_knows() {
    use proprio_core::effect::EffectKind;
    for &kind in HiddenKind::ALL {
        assert_eq!(
            SIZES.iter().filter(|s| s.kind == kind).count(),
            1,
            "{kind:?}"
        );
        let description = kind.description();
        let known = EffectKind::from_name(description.name).is_some();
        assert_eq!(known, description.in_catalogue, "{kind:?}");
        assert_eq!(HiddenKind::from_name(description.name), Some(kind));
    }
    for effect in EffectKind::ALL {
        // Friction inside a spring is simulated with it: `elasticity`'s f and w.
        let name = effect.name().replace("elastic_hysteresis", "elasticity");
        assert!(HiddenKind::from_name(&name).is_some(), "{effect:?}");
    }
    assert_eq!(hidden::typical(&Leg::ALL).len(), 48);
}

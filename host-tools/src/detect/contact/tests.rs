//! Contact found where it is, and nowhere else.

use std::fs::File;

use proprio_core::go2::Leg;

use super::*;
use crate::equation::values::places;
use crate::estimate::fit::How;
use crate::estimate::limb_data::LimbData;
use crate::log::LogWriter;
use crate::model::{Model, Robot};
use crate::recording::Recording;
use proprio_simulator::{Hide, Simulation, hidden};

/// A front right leg of typical friction whose bodies are off the CAD, with what is hidden in it besides.
fn simulation(seed: u64, duration: f64, hide: &str) -> Simulation {
    let legs = [Leg::FR];
    let mut effects = hidden::typical(&legs);
    if !hide.is_empty() {
        effects.extend(hide.parse::<Hide>().unwrap().on(&legs).unwrap());
    }
    Simulation {
        duration,
        effects,
        inertia_error: 0.1,
        seed,
        ..Simulation::new(&legs)
    }
}

/// What the detector says of a simulated leg.
fn of(simulation: &Simulation) -> Option<Contact> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut log = LogWriter::new(File::create(&path).unwrap(), &simulation.legs).unwrap();
    for sample in simulation.samples() {
        let sample = sample.unwrap();
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
            .unwrap();
    }
    log.finish().unwrap();
    let model = Model::new(Robot::go2());
    let recording = Recording::read(&[path], &model, |_, _| ()).unwrap();
    let (limb, data) = &recording.limbs[0];
    let data = LimbData::of(&model, limb, data).unwrap();
    let own: Vec<_> = places(&model, limb).map(|(place, _)| place).collect();
    let fit = LimbFit::of(&data, &own, &How::default()).unwrap();
    Contact::of(&fit)
}

/// Its mean over an episode, its ends with it, in which it grows and fades: of short episodes they are a good part.
#[test]
fn a_force_at_the_foot_is_found_and_its_size_told() {
    for (seed, force, slant, length, period) in [
        (1, 30.0, 0.0, 0.6, 3.0),
        (2, 30.0, 10.0, 0.6, 3.0),
        (3, 10.0, 2.0, 0.6, 3.0),
        (4, 15.0, 0.0, 0.2, 0.8),
    ] {
        let hide = format!("contact:FR_calf={force},x={slant},length={length},period={period}");
        let contact = of(&simulation(seed, 20.0, &hide)).unwrap();
        println!(
            "{hide}: {} ± {} N, {}",
            contact.force, contact.std, contact.share
        );
        assert!(contact.is_significant(), "{hide}: {contact:?}");
        let off = (contact.force - force * length / (length + 0.02)).abs();
        assert!(off < 2.5 * contact.std, "{hide}: {contact:?}");
        assert!(
            (contact.share - length / period).abs() < 0.05,
            "{hide}: {contact:?}"
        );
    }
}

#[test]
fn no_leg_in_the_air_is_said_to_be_in_contact() {
    for seed in 0..20 {
        let hide = ["", "payload:FR_calf=0.3", "spring:FR_thigh=5"][seed as usize % 3];
        let contact = of(&simulation(seed, 8.0, hide));
        let found = contact.filter(Contact::is_significant);
        assert!(found.is_none(), "seed {seed}, {hide}: {found:?}");
    }
}

/// What comes and goes at one joint is no force at the foot: the other joints would feel that.
#[test]
fn a_torque_at_one_joint_alone_is_no_contact() {
    for hide in [
        "cable_snag:FR_calf=3",
        "cable_snag:FR_thigh=3",
        "friction_step:FR_calf=2",
    ] {
        let contact = of(&simulation(9, 12.0, hide));
        let found = contact.filter(Contact::is_significant);
        assert!(found.is_none(), "{hide}: {found:?}");
    }
}

#[test]
fn a_t_of_few_degrees_of_freedom_is_worth_less() {
    assert!((judge::normal_score(2.0, 1e6) - 2.0).abs() < 1e-3);
    // P(|t| > 12.706) = 5 % with one degree of freedom.
    assert!((judge::normal_score(12.706, 1.0) - 1.96).abs() < 1e-3);
    assert!((judge::normal_score(-12.706, 1.0) + 1.96).abs() < 1e-3);
}

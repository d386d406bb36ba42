//! The catalogue: names, bounds, and that window terms are the torques that they stand for.

use super::*;
use crate::go2::ACTUATORS;

#[test]
fn names_are_snake_case_unique_and_found() {
    for (n, effect) in EffectKind::ALL.iter().enumerate() {
        let name = effect.name();
        assert!(
            name.chars().all(|c| c.is_ascii_lowercase() || c == '_'),
            "{name}"
        );
        assert_eq!(EffectKind::from_name(name), Some(EffectKind::ALL[n]));
    }
    assert_eq!(EffectKind::from_name("friction"), None);
}

#[test]
fn priors_lie_within_bounds() {
    for effect in EffectKind::ALL {
        for actuator in &ACTUATORS {
            for (n, parameter) in effect.description().parameters.iter().enumerate() {
                let prior = effect.prior_of(actuator, n);
                assert!(prior.std > 0.0);
                assert!((parameter.lower..=parameter.upper).contains(&prior.mean));
            }
        }
    }
}

/// Two columns of one torque are told of by a fact, and only they: else a joint with both has two values for one thing.
#[test]
fn a_column_that_is_another_effects_says_so() {
    const SHAPE: f64 = 0.7;
    let states = [0.3, 1.1, 2.9, 4.4].map(|t: f64| JointState {
        temperature: 50.0 + t,
        presliding: (2.0 * t).sin(),
        recoil: [(5.0 * t).sin(), (7.0 * t).cos()],
        ..JointState::reported(t.sin(), t.cos(), (3.0 * t).sin())
    });
    let columns = |effect: EffectKind| effect.description().form == Form::Columns;
    let all = EffectKind::ALL.iter().copied();
    let columns = all.filter(|effect| columns(*effect));
    for effect in columns.clone() {
        let linear = effect.description().linear().enumerate();
        for (column, n) in linear {
            let is_same = |other: &EffectKind| {
                let same =
                    |state| effect.terms(state, SHAPE)[column] == other.terms(state, SHAPE)[0];
                *other != effect
                    && other.description().parameters.len() == 1
                    && states.iter().all(same)
            };
            let said = effect.description().parameters[n].same_as;
            assert_eq!(columns.clone().find(is_same), said, "{} {n}", effect.name());
        }
    }
}

/// Terms integrate to the impulse of the torque they stand for: checked on q = sin t against the closed form.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn terms_integrate_to_the_impulse_of_the_torque() {
    const SHAPE: f64 = 0.7;
    let state = |t: f64| JointState {
        temperature: 50.0,
        presliding: (2.0 * t).sin(),
        recoil: [(5.0 * t).sin(), (7.0 * t).cos()],
        ..JointState::reported(t.sin(), t.cos(), (3.0 * t).sin())
    };
    // The last column of each, which is the only one of most.
    let torque = |effect: EffectKind, t: f64| {
        let (q, dq, tau) = (t.sin(), t.cos(), (3.0 * t).sin());
        let sign = (dq / 0.035).clamp(-1.0, 1.0);
        match effect {
            EffectKind::Viscous => dq,
            EffectKind::Coulomb => sign,
            EffectKind::Armature => -q,
            EffectKind::Bias | EffectKind::Spring => 1.0,
            EffectKind::AsymmetricCoulomb => 0.5 * (sign - 1.0),
            EffectKind::AsymmetricViscous => sign * dq,
            EffectKind::Stribeck => sign * (-(dq / SHAPE).powi(2)).exp(),
            EffectKind::Presliding => 2.0 * (2.0 * t).cos(),
            EffectKind::BaseRecoil => 5.0 * (5.0 * t).cos() + (7.0 * t).cos(),
            EffectKind::LoadFriction => sign * tau.abs(),
            EffectKind::QuadraticDrag => dq * dq.abs(),
            EffectKind::SaturatingViscous => sign * (1.0 - (-dq.abs() / SHAPE).exp()),
            EffectKind::ThermalViscous => 10.0 * dq,
            EffectKind::Cogging => (SHAPE * q).cos(),
            EffectKind::Delay => -3.0 * (3.0 * t).cos(),
            EffectKind::CurrentLag => 3.0 * (3.0 * t).cos(),
            EffectKind::DeadBand => (tau / SHAPE).clamp(-1.0, 1.0),
            EffectKind::Saturation => {
                ((tau.abs() - 0.95 * SHAPE) / (0.05 * SHAPE)).clamp(0.0, 1.0) * tau.signum()
            }
            EffectKind::CoupledArmature
            | EffectKind::CoupledViscous
            | EffectKind::CoupledCoulomb
            | EffectKind::TorqueGain
            | EffectKind::VelocityGain
            | EffectKind::EncoderOffset
            | EffectKind::Eccentricity
            | EffectKind::BaseTilt
            | EffectKind::Payload
            | EffectKind::Contact
            | EffectKind::Elasticity
            | EffectKind::ElasticHysteresis
            | EffectKind::Backlash
            | EffectKind::Own(_) => unreachable!("no columns of the catalogue's own"),
        }
    };
    let (start, end, steps) = (0.2, 2.2, 100_000);
    let dt = (end - start) / f64::from(steps);
    for &effect in EffectKind::ALL {
        let Some(last) = effect.columns().checked_sub(1) else {
            continue;
        };
        let term = |t: f64| effect.terms(&state(t), SHAPE)[last];
        let mut column = term(end).boundary - term(start).boundary;
        let mut impulse = 0.0;
        for n in 0..steps {
            let middle = start + (f64::from(n) + 0.5) * dt;
            column += term(middle).rate * dt;
            impulse += torque(effect, middle) * dt;
        }
        assert!(
            (column - impulse).abs() < 1e-8,
            "{}: {column} {impulse}",
            effect.name()
        );
    }
}

/// Only coupled effects look at another joint, and Coulomb friction between two acts on one as it does on the other.
#[test]
fn couplings_act_on_both() {
    let (a, b) = (
        JointState::reported(0.3, 0.7, 0.1),
        JointState::reported(-0.2, 0.4, 0.2),
    );
    for effect in EffectKind::ALL {
        let coupled = effect.coupled(&a, &b) != [Term::zero(); MAX_COLUMNS];
        assert_eq!(coupled, effect.description().form == Form::Coupled);
    }
    let [both, _] = EffectKind::CoupledArmature.coupled(&a, &b);
    assert_eq!(both, Term::boundary(0.4));
    let [here, there] =
        [(a, b), (b, a)].map(|(own, other)| EffectKind::CoupledCoulomb.coupled(&own, &other));
    assert_eq!(here[0], there[0]);
    assert_eq!(here[1].rate, -there[1].rate);
}

#[test]
fn look_alikes_are_effects_and_never_the_effect_itself() {
    for effect in EffectKind::ALL {
        for other in effect.description().look_alikes {
            assert_ne!(*other, effect.name());
            assert!(EffectKind::from_name(other).is_some(), "{other}");
        }
    }
}

#[test]
fn a_motion_or_a_column_or_neither() {
    let state = JointState::reported(0.3, 0.7, 0.1);
    for effect in EffectKind::ALL {
        let moves = effect.motion(&state, 0) != [0.0; 2];
        // Hysteresis moves the link by f/k: of elasticity's k an effect does not know.
        let description = effect.description();
        let own = description.transmission() != Some(Transmission::SpringFriction);
        assert_eq!(moves, own && matches!(description.form, Form::Motion(_)));
        let is_torque = matches!(description.form, Form::Columns | Form::Clock);
        assert_eq!(effect.columns() > 0, is_torque);
    }
}

//! Values as serde has them: names in JSON, numbers to the last bit.

use proprio_core::effect::EffectKind;
use proprio_core::estimator::EffectPrior;
use proprio_core::go2::{ACTUATORS, Leg, leg};
use serde::{Serialize, de::DeserializeOwned};

/// Asserts that a value comes back to the last bit.
fn comes_back<X: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: &X) {
    let mut buffer = [0; 256];
    let bytes = postcard::to_slice(value, &mut buffer).unwrap();
    assert_eq!(postcard::from_bytes::<X>(bytes).unwrap(), *value);
}

#[test]
fn an_effect_is_its_name() {
    for effect in EffectKind::ALL {
        let text = serde_json::to_string(effect).unwrap();
        assert_eq!(text, format!("\"{}\"", effect.name()));
        assert_eq!(serde_json::from_str::<EffectKind>(&text).unwrap(), *effect);
    }
}

#[test]
fn bodies_actuators_and_priors_come_back_as_they_were() {
    leg::<f64>(Leg::RL).bodies().iter().for_each(comes_back);
    leg::<f32>(Leg::RL).bodies().iter().for_each(comes_back);
    ACTUATORS.iter().for_each(comes_back);
    comes_back(&EffectPrior::of(EffectKind::Bias, &ACTUATORS[2]));
}

#[test]
fn a_frame_comes_back_as_it_was() {
    comes_back(&proprio_core::bus::Reply {
        position: -12_345,
        ..Default::default()
    });
}

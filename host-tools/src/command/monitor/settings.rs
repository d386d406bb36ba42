//! What a device is asked at the beginning: priors, the legs that it listens to, what its board is set up for.

use std::str::FromStr;

use crate::device::names;
use clap::Args;
use proprio_core::effect::EffectKind;
use proprio_core::go2::{JointId, Leg};
use proprio_core::wire::{Action, Belief, BodyPrior, EffectAt, Hello, Setup};

use crate::command::Error;

/// What is known of an effect's parameter, at a joint or at every one.
#[derive(Debug, Clone)]
pub(super) struct Known {
    effect: EffectKind,
    joint: Option<JointId>,
    belief: Belief,
}

/// How well a body is known.
#[derive(Debug, Clone)]
pub(super) struct KnownBody {
    joint: JointId,
    uncertainty: f32,
}

fn joint_named(name: &str) -> Result<JointId, String> {
    let unknown = || format!("no joint is called {name}; joints are FR_hip to RL_calf");
    JointId::from_name(name).ok_or_else(unknown)
}

fn number(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok().filter(|x: &f32| x.is_finite());
    number.ok_or_else(|| format!("{text} is no number"))
}

impl FromStr for Known {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || "write it as viscous:FR_hip=0.04,0.01".to_owned();
        let (place, numbers) = text.split_once('=').ok_or_else(form)?;
        let (mean, std) = numbers.split_once(',').ok_or_else(form)?;
        let (effect, joint) = match place.split_once(':') {
            Some((effect, joint)) => (effect, Some(joint_named(joint)?)),
            None => (place, None),
        };
        let unknown = || format!("no effect is called {effect}: `proprio effects` lists them");
        Ok(Self {
            effect: EffectKind::from_name(effect).ok_or_else(unknown)?,
            joint,
            belief: Belief {
                mean: number(mean)?,
                std: number(std)?,
            },
        })
    }
}

impl FromStr for KnownBody {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || "write it as FR_calf=0.5".to_owned();
        let (joint, uncertainty) = text.split_once('=').ok_or_else(form)?;
        Ok(Self {
            joint: joint_named(joint)?,
            uncertainty: number(uncertainty)?,
        })
    }
}

impl Known {
    /// As the device is asked, once for each joint.
    pub(super) fn actions(&self, hello: &Hello) -> Result<Vec<Action>, Error> {
        let effect = names::kept(self.effect, hello).map_err(|kept| Error::NotOnDevice {
            effect: self.effect.name(),
            kept,
        })?;
        let all = || Leg::ALL.into_iter().flat_map(JointId::of).collect();
        let joints = self.joint.map_or_else(all, |joint| vec![joint]);
        let at = |joint: &JointId| EffectAt {
            leg: joint.leg().index() as u8,
            joint: joint.place() as u8,
            effect,
        };
        let actions = joints
            .iter()
            .map(|joint| Action::SetEffectPrior(at(joint), self.belief));
        Ok(actions.collect())
    }
}

impl KnownBody {
    /// As the device is asked.
    pub(super) fn action(&self) -> Action {
        Action::SetBodyPrior(BodyPrior {
            leg: self.joint.leg().index() as u8,
            body: self.joint.place() as u8,
            uncertainty: self.uncertainty,
        })
    }
}

/// Three numbers, as whole ten thousandths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TenThousandths([i16; 3]);

impl FromStr for TenThousandths {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|text| number(text).map(f64::from))
            .collect::<Result<_, _>>()?;
        let numbers: [f64; 3] = numbers
            .try_into()
            .map_err(|_| "write it as three numbers, 0,0,0.07".to_owned())?;
        // What is beyond its range is beyond what a board can be set up for.
        Ok(Self(numbers.map(|x| (1e4 * x).round() as i16)))
    }
}

/// What a board is to be set up for.
#[derive(Debug, Args)]
pub(super) struct SetupArguments {
    /// Have a board of a robot that walks take its IMU to be there from its next start on: the trunk's frame, m
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    imu_at: Option<TenThousandths>,
    /// And its axes to be turned so against the trunk's: about x, then y, then z, rad
    #[arg(long, value_name = "ROLL,PITCH,YAW", allow_hyphen_values = true)]
    imu_turned: Option<TenThousandths>,
    /// Have a board listen to its motor buses at so many bits per second from its next start on: 100000 to 10000000
    #[arg(long, value_name = "BAUD")]
    bus_baud: Option<u32>,
}

impl SetupArguments {
    /// Whether anything is to be other than it is.
    pub(super) fn is_asked(&self) -> bool {
        self.imu_at.is_some() || self.imu_turned.is_some() || self.bus_baud.is_some()
    }

    /// As the device is asked: what was not said stays as it is.
    pub(super) fn action(&self, hello: &Hello) -> Action {
        let is = hello.setup;
        Action::SetUp(Setup {
            imu_at: self.imu_at.map_or(is.imu_at, |at| at.0),
            imu_turned: self.imu_turned.map_or(is.imu_turned, |turned| turned.0),
            bus_baud: self.bus_baud.unwrap_or(is.bus_baud),
        })
    }
}

/// The legs as bits; none where nothing was said.
pub(super) fn mask(legs: &[Leg]) -> Option<u8> {
    let bits = legs.iter().map(|leg| 1 << leg.index());
    bits.reduce(|mask: u8, bit| mask | bit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Device;

    #[test]
    fn what_is_said_of_effects_bodies_and_legs_is_read() {
        let known: Known = "viscous:FL_calf=0.04,0.01".parse().unwrap();
        assert_eq!(known.effect, EffectKind::Viscous);
        assert_eq!(known.joint.map(JointId::name), Some("FL_calf"));
        assert_eq!((known.belief.mean, known.belief.std), (0.04, 0.01));
        let body: KnownBody = "RL_hip=0.5".parse().unwrap();
        let prior = BodyPrior {
            leg: 3,
            body: 0,
            uncertainty: 0.5,
        };
        assert_eq!(body.action(), Action::SetBodyPrior(prior));
        assert_eq!(mask(&[Leg::FL, Leg::RL]), Some(0b1010));
        assert_eq!(mask(&[]), None);
    }

    #[test]
    fn what_is_not_said_of_a_set_up_stays() {
        let mut hello = crate::device::Desktop::<f64>::new().hello().clone();
        hello.setup.bus_baud = 2_000_000;
        let asked = SetupArguments {
            imu_at: Some("-0.0257, 0,0.07".parse().unwrap()),
            imu_turned: None,
            bus_baud: None,
        };
        assert!(asked.is_asked());
        let setup = Setup {
            imu_at: [-257, 0, 700],
            ..hello.setup
        };
        assert_eq!(asked.action(&hello), Action::SetUp(setup));
        for text in ["1,2", "1,2,3,4", "1,2,up", ""] {
            assert!(text.parse::<TenThousandths>().is_err(), "{text}");
        }
    }

    #[test]
    fn what_is_neither_is_said() {
        for (text, word) in [
            ("viscous", "write it as"),
            ("viscous=1", "write it as"),
            ("viscous=1,NaN", "no number"),
            ("honey=1,1", "no effect"),
            ("viscous:tail=1,1", "no joint"),
        ] {
            let error = text.parse::<Known>().unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
        assert!("tail=1".parse::<KnownBody>().is_err());
    }
}

//! What is known of a bus that is not on it.

use std::fmt;
use std::str::FromStr;

use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, Leg};

/// What is known of a bus: which leg's it is, and where the leg's joints were.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facts {
    /// The leg.
    pub leg: Option<Leg>,
    /// The joints' angles.
    pub told: Told,
}

/// What positions on the bus mean.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Told {
    /// Counts from nobody knows where.
    #[default]
    Nothing,
    /// The joints' angles: a simulator's.
    Angles,
    /// Counts from where hip, thigh and calf were at these angles, rad, as the capture began; and whether each motor turns against its joint.
    At([(f64, bool); JOINTS_PER_LEG]),
}

impl fmt::Display for Facts {
    /// As the first line of a capture has them, each with a space before it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(leg) = self.leg {
            write!(f, " leg={}", leg.name())?;
        }
        match self.told {
            Told::Nothing => Ok(()),
            Told::Angles => f.write_str(" positions=angles"),
            Told::At(angles) => {
                let angles = angles.map(|(angle, reversed)| {
                    let mark = if reversed { "r" } else { "" };
                    format!("{angle}{mark}")
                });
                write!(f, " at={}", angles.join(","))
            }
        }
    }
}

/// A fact that is none.
#[derive(Debug, PartialEq, Eq)]
pub struct NoFact;

impl FromStr for Facts {
    type Err = NoFact;

    fn from_str(text: &str) -> Result<Self, NoFact> {
        let mut facts = Self::default();
        for field in text.split_whitespace() {
            match field.split_once('=').ok_or(NoFact)? {
                ("leg", name) => facts.leg = Some(Leg::from_name(name).ok_or(NoFact)?),
                ("positions", "angles") => facts.told = Told::Angles,
                ("at", angles) => facts.told = Told::At(parse_angles(angles).ok_or(NoFact)?),
                _ => return Err(NoFact),
            }
        }
        Ok(facts)
    }
}

fn parse_angles(text: &str) -> Option<[(f64, bool); JOINTS_PER_LEG]> {
    let mut numbers = text.split(',');
    let mut angles = [(0.0, false); JOINTS_PER_LEG];
    for (place, actuator) in angles.iter_mut().zip(&ACTUATORS) {
        let number = numbers.next()?;
        let bare = number.strip_suffix('r');
        let angle: f64 = bare.unwrap_or(number).parse().ok()?;
        proprio_core::bus::position_counts(actuator.gear, angle).ok()?;
        *place = (angle, bare.is_some());
    }
    numbers.next().is_none().then_some(angles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_are_read_as_they_are_written_and_nothing_else_is() {
        let at = Told::At([(0.1, false), (0.8, true), (-1.5, false)]);
        for facts in [
            Facts::default(),
            Facts {
                leg: Some(Leg::RL),
                told: Told::Angles,
            },
            Facts {
                leg: Some(Leg::FR),
                told: at,
            },
        ] {
            assert_eq!(facts.to_string().parse(), Ok(facts));
        }
        for text in [
            "leg=XX",
            "leg",
            "at=1,2",
            "at=1,2,3,4",
            "at=1,2,NaN",
            "at=1,2,1e30",
            "colour=red",
        ] {
            assert_eq!(text.parse::<Facts>(), Err(NoFact), "{text}");
        }
    }
}

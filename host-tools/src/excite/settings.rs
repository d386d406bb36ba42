//! What is asked of a design.

use proprio_core::effect::EffectKind;

use super::ExciteError;
use super::fourier::Ends;
use super::shapes::Shapes;

/// Length of a period unless the goal asks for another, s: ten waves of it go from 0.3 to 3 Hz.
const USUAL_PERIOD: f64 = 10.0 / 3.0;

/// What a motion is to be good for.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// The condition number of the identifiable inertial columns.
    Condition,
    /// The same of columns per kg, kg m and kg m²: for comparison with the literature.
    ConditionSi,
    /// What is told of all parameters beyond the prior: D-optimality.
    Determinant,
    /// The variance of these parameters, by name (`m:FR_calf`, `coulomb:FR_hip`): A-optimality.
    Variance(Vec<String>),
    /// Which of two effects a joint has (all joints of the limbs if none is named): T-optimality.
    Separation {
        /// The two.
        effects: [EffectKind; 2],
        /// The joint.
        joint: Option<String>,
    },
}

impl Goal {
    /// Length of the period that serves the goal best, s: a third of the duration, so that there are periods to compare, and of a
    /// longer one as many as make periods of 3.3 s.
    ///
    /// A load is told from rotor inertia by its weight, in a motion that is as slow as the duration allows. Where it sits on its body is
    /// known to first order only before it is in the model, and so is how much inertia it adds: in a fast motion what is left of that
    /// looks like an encoder that is off. From a spring it is told by that inertia, and needs the fast motion.
    pub fn usual_period(&self, duration: f64) -> f64 {
        match self {
            Self::Separation { effects, .. } if is_load_or_rotor(effects) => duration,
            _ => duration / (duration / USUAL_PERIOD).round().max(3.0),
        }
    }
}

fn is_load_or_rotor(effects: &[EffectKind; 2]) -> bool {
    effects.contains(&EffectKind::Payload) && effects.contains(&EffectKind::Armature)
}

/// What is kept back from the robot's limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margins {
    /// From each stop, rad (m).
    pub position: f64,
    /// Share of the greatest speed that is used.
    pub velocity: f64,
    /// Greatest acceleration, rad/s² (m/s²).
    pub acceleration: f64,
    /// Share of the greatest torque.
    pub torque: f64,
    /// Share of the greatest power: that of a motor whose torque falls in a straight line from its greatest at rest to nothing at
    /// its greatest speed, a quarter of their product.
    pub power: f64,
    /// By how much each parameter may be off, as a share of it.
    pub uncertainty: f64,
    /// Distance that shapes keep from each other, m.
    pub distance: f64,
    /// Height of the base above the ground, m, if it hangs above one.
    pub ground: Option<f64>,
}

impl Default for Margins {
    /// What an owner need not think twice about: 0.05 rad from the stops, four fifths of speed, torque and power, parameters
    /// off by 10 %, shapes 1 cm apart, and accelerations that a 3 Hz swing of ±0.55 rad has: a position loop follows them.
    fn default() -> Self {
        Self {
            position: 0.05,
            velocity: 0.8,
            acceleration: 200.0,
            torque: 0.8,
            power: 0.8,
            uncertainty: 0.1,
            distance: 0.01,
            ground: None,
        }
    }
}

/// A design's settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// What for.
    pub goal: Goal,
    /// Length, s.
    pub duration: f64,
    /// Length of the period that is repeated, s; about: a whole number of them make the duration. What a joint does again under
    /// the same reference and what differs is noise.
    pub period: f64,
    /// Waves of a series.
    pub harmonics: usize,
    /// What a series may do at its ends.
    pub ends: Ends,
    /// Where to begin and end, by joint, rad; the middle of their range, or a Go2's bent leg, for the others.
    pub pose: Vec<(String, f64)>,
    /// What is kept back from the limits.
    pub margins: Margins,
    /// Draws the starts.
    pub seed: u64,
    /// How many starts per limb.
    pub starts: usize,
    /// What stands around the robot, or is fixed to it, beyond what a Go2 is known to have.
    pub shapes: Option<Shapes>,
    /// What earlier logs already know: one triangle per limb, in the order of the limb's inertias and default effects.
    pub earlier: Vec<Earlier>,
}

/// What logs know of a limb: the triangle R of a factor over ten inertial parameters per body, then each joint's effects of
/// [`proprio_core::estimator::EFFECTS`], in rows of unit noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Earlier {
    /// The limb's name.
    pub limb: String,
    /// R.
    pub triangle: nalgebra::DMatrix<f64>,
    /// The triangle of the inertial columns alone, all joints' rows in N m s: of its scaled part is the condition number.
    pub inertial: nalgebra::DMatrix<f64>,
}

impl Default for Settings {
    /// 10 s as three periods of ten waves, from 0.3 to 3 Hz.
    fn default() -> Self {
        Self {
            goal: Goal::Condition,
            duration: 10.0,
            period: USUAL_PERIOD,
            harmonics: 10,
            ends: Ends::Rest,
            pose: Vec::new(),
            margins: Margins::default(),
            seed: 1,
            starts: 16,
            shapes: None,
            earlier: Vec::new(),
        }
    }
}

impl Settings {
    /// How often the period is repeated.
    pub fn repeats(&self) -> u32 {
        (self.duration / self.period).round().max(1.0) as u32
    }

    pub(super) fn check(&self) -> Result<(), ExciteError> {
        let m = &self.margins;
        let positive = [
            ("the duration", self.duration),
            ("the period", self.period),
            ("the share of the speed", m.velocity),
            ("the greatest acceleration", m.acceleration),
            ("the share of the torque", m.torque),
            ("the share of the power", m.power),
        ];
        let setting = |what: &str, must, value| ExciteError::Setting {
            what: what.to_owned(),
            must,
            value,
        };
        for (what, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(setting(what, "a positive number", value));
            }
        }
        let zero_or_more = [
            ("the distance from the stops", m.position),
            ("the uncertainty of the parameters", m.uncertainty),
            ("the distance of shapes", m.distance),
            ("the height above the ground", m.ground.unwrap_or(0.0)),
        ];
        for (what, value) in zero_or_more {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(setting(what, "zero or a positive number", value));
            }
        }
        for (joint, value) in &self.pose {
            if !value.is_finite() {
                return Err(setting(&format!("the pose of {joint}"), "a number", *value));
            }
        }
        if self.harmonics < 2 {
            return Err(setting(
                "the number of waves",
                "2 or more",
                self.harmonics as f64,
            ));
        }
        if self.starts == 0 {
            return Err(setting("the number of starts", "1 or more", 0.0));
        }
        Ok(())
    }
}

//! What an effect is, in words, bounds and form.

use super::EffectKind;

/// What an effect acts on, and with that what the equation has of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Form {
    /// A torque at its own joint: window columns.
    Columns,
    /// A torque at the joint and at the one that carries it, by what both do: window columns of both.
    Coupled,
    /// The scale in which the joint's torque is reported: all that it is made of, times a factor.
    Scale,
    /// The time at which torque is reported against motion.
    Clock,
    /// The link's motion against what the joint's sensors report; all joints of the limb depend on it.
    Motion(Moved),
    /// The direction of gravity; all joints of the robot depend on it.
    Gravity,
    /// The inertia of the joint's body; the joints that move it depend on it.
    Inertia,
    /// A force at the foot, unknown at every instant.
    Force,
}

/// What of a link's motion differs from what the joint's sensors report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Moved {
    /// The position, by a constant: the encoder's zero.
    Zero,
    /// The position, by a sine and a cosine of it: an encoder's disc off its axis.
    OncePerTurn,
    /// The velocity, by a factor.
    Velocity,
    /// The link moves against the motor.
    Link(Transmission),
}

/// What lies between a motor and its link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Transmission {
    /// A spring: its parameter is a compliance, rad/(N m).
    Spring,
    /// Friction inside that spring (N m), and the displacement over which it builds up (rad).
    SpringFriction,
    /// A gap, rad.
    Backlash,
}

/// How an effect enters an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Enters {
    /// Columns that its parameters are multiples of.
    Column,
    /// The derivative of the prediction at the present value.
    Derivative,
    /// The whole prediction at each of a grid of values: it is too far from linear for its derivative to refine the best of them.
    Trial,
    /// A limit of the torque, found from the windows below it: beyond it the motion shows nothing.
    Limit,
    /// The positions alone determine it; it has no column.
    Positions,
    /// The direction of what it adds to all joints determines it; it has no column.
    Direction,
}

/// What of a joint's state a torque is a function of, beside the joint's own motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Input {
    /// The motion at the same instant alone.
    Motion,
    /// The motion since the last gap in the data: the bristles' deflection. The nonlinear parameter is their displacement, rad.
    Bristles,
    /// The torque that the gear transmits under the model.
    TransmittedTorque,
    /// The motor's torque under the model.
    MotorTorque,
    /// The motor's temperature.
    Temperature,
    /// The motion of other joints of the limb at the same instant.
    Limb,
    /// The motion of the base, by that of all limbs and the model's bodies.
    Base,
}

/// At which joints one cause acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reach {
    /// One joint: what happens to one sensor or one worn gear is no property of a kind of drive.
    Joint,
    /// One joint, or all like joints as a family, each with its own value: a property of a kind of drive.
    Family,
    /// One joint, or one value of all joints: joints that share it share its cause.
    JointOrRobot,
    /// One value of all joints.
    Robot,
    /// One body.
    Body,
}

/// How the torque of an effect varies along a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Varies {
    /// With the velocity, the acceleration or the reversals.
    Fast,
    /// With the pose, seldom or not at all: a small share of the error is systematic.
    Slowly,
    /// As the weight of the bodies does.
    LikeWeight,
}

/// Where a parameter is searched in which the torque is far from linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grid {
    /// Speeds from the noise of the joint's velocity on, rad/s.
    SpeedsAboveNoise,
    /// Shares of the joint's greatest speed, rad/s.
    SpeedsOfMotion,
    /// Displacements from what samples resolve to a share of the joint's travel, rad.
    Displacements,
    /// Multiples of the gear ratio, 1/rad: narrow, so that the best of them is always refined.
    Harmonics,
    /// Shares of the joint's greatest torque, N m.
    Torques,
    /// The same, small ones.
    SmallTorques,
    /// Gaps between motor and link, rad.
    Gaps,
    /// Compliances, rad/(N m), by the resonances that they give the link.
    Resonances,
    /// Positions within the joint's travel, evenly, rad.
    Positions,
    /// Times within the log, evenly, s.
    Times,
    /// Spatial frequencies by the joint's travel, 1/rad: narrow, as harmonics are.
    Frequencies,
    /// So many values from the least to the most, evenly; the parameter's unit.
    Evenly {
        /// The first.
        least: f64,
        /// The last.
        most: f64,
        /// How many, two at least.
        count: usize,
    },
    /// So many values from the least to the most, each as many times the one before; the parameter's unit.
    Values {
        /// The first.
        least: f64,
        /// The last.
        most: f64,
        /// How many, two at least.
        count: usize,
    },
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The field's symbol, such as `Fv`.
    pub symbol: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Least value that is physical.
    pub lower: f64,
    /// Greatest value that is physical.
    pub upper: f64,
    /// The value at which the effect is absent.
    pub neutral: f64,
    /// Whether the torque is not linear in it, so that it has no column: it is scanned, then refined.
    pub shape: bool,
    /// Where it is searched; a shape always is.
    pub grid: Option<Grid>,
    /// The effect whose torque it multiplies too: beside that one it has no value of its own.
    pub same_as: Option<EffectKind>,
}

impl Parameter {
    /// A linear parameter that is zero where the effect is absent.
    pub const fn new(symbol: &'static str, unit: &'static str, lower: f64, upper: f64) -> Self {
        Self {
            symbol,
            unit,
            lower,
            upper,
            neutral: 0.0,
            shape: false,
            grid: None,
            same_as: None,
        }
    }

    /// The same as a multiple of the torque that `effect` has as well.
    pub const fn same_as(self, effect: EffectKind) -> Self {
        Self {
            same_as: Some(effect),
            ..self
        }
    }

    /// The same, absent at `neutral`.
    pub const fn neutral(self, neutral: f64) -> Self {
        Self { neutral, ..self }
    }

    /// The same as a shape that is scanned over a grid.
    pub const fn shape(self, grid: Grid) -> Self {
        Self {
            shape: true,
            ..self.searched(grid)
        }
    }

    /// The same with a column near the present value, which is searched over a grid first.
    pub const fn searched(self, grid: Grid) -> Self {
        Self {
            grid: Some(grid),
            ..self
        }
    }
}

/// What a parameter is taken to be before any data: mean and standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Prior {
    /// Expected value.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

/// What an effect is: its facts, in words and bounds. Whoever decides anything by an effect asks these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// The effect's name everywhere.
    pub name: &'static str,
    /// Its torque as a formula.
    pub torque: &'static str,
    /// What it acts on.
    pub form: Form,
    /// How it enters an estimate.
    pub enters: Enters,
    /// What its torque is a function of.
    pub input: Input,
    /// At which joints one cause acts.
    pub reach: Reach,
    /// How its torque varies along a motion.
    pub varies: Varies,
    /// Its parameters: those that are no shape in column order.
    pub parameters: &'static [Parameter],
    /// Whether every geared drive has it.
    pub plain: bool,
    /// Whether it may change along a log: with temperature, wear or the supply.
    pub drifts: bool,
    /// The simpler effect that it contains, which often does as well.
    pub simpler: Option<EffectKind>,
    /// What it is where its shape is at the least value.
    pub without_shape: Option<EffectKind>,
    /// Effects that together are the same as it: beside one of them it is the others, with a parameter more.
    pub sum_of: &'static [EffectKind],
    /// Effects that a joint has to have before it is sought there: without them it stands in for them.
    pub beside: &'static [EffectKind],
    /// What it is, in a sentence for the user.
    pub words: &'static str,
    /// Names of effects that look alike on poor data.
    pub look_alikes: &'static [&'static str],
    /// The motion that tells it from them.
    pub separated_by: &'static str,
    /// Attribute of URDF's `<dynamics>`, if it has one.
    pub urdf: Option<&'static str>,
    /// How MJCF says it, if it can.
    pub mjcf: Option<Mjcf>,
}

/// How MJCF says an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mjcf {
    /// An attribute of `<joint>`, with the value of the first parameter.
    Joint(&'static str),
    /// Two attributes of `<joint>`: of a torque k q + c its slope k, and where it is zero, −c/k.
    Slope {
        /// k.
        slope: &'static str,
        /// −c/k.
        zero: &'static str,
    },
    /// An attribute of `<joint>` that is a range of torque: ± the first parameter.
    Range(&'static str),
    /// An attribute of a fixed tendon over the joint and the one before, whose square form is the first parameter between the two and takes its share of
    /// the same attribute of each.
    Tendon(&'static str),
    /// An attribute of two fixed tendons over the joint and the one before: of their sum with the first parameter, of their difference with the
    /// second.
    SumAndDifference(&'static str),
}

impl Mjcf {
    /// The attributes, for a reader.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Joint(attribute) | Self::Range(attribute) => attribute,
            Self::Slope { slope, .. } => slope,
            Self::Tendon(_) | Self::SumAndDifference(_) => "a fixed tendon",
        }
    }
}

const fn is_seconds(unit: &str) -> bool {
    matches!(unit.as_bytes(), b"s")
}

impl Description {
    /// The facts of most effects, for entries to begin with: a torque by the motion of its own joint, a property of a kind of drive.
    pub const TORQUE: Self = Self {
        name: "",
        torque: "",
        form: Form::Columns,
        enters: Enters::Column,
        input: Input::Motion,
        reach: Reach::Family,
        varies: Varies::Fast,
        parameters: &[],
        plain: false,
        drifts: false,
        simpler: None,
        without_shape: None,
        sum_of: &[],
        beside: &[],
        words: "",
        look_alikes: &[],
        separated_by: "",
        urdf: None,
        mjcf: None,
    };

    /// The places among the parameters of those that are scanned.
    pub fn shapes(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        let parameters = self.parameters;
        (0..parameters.len()).filter(|n| parameters.get(*n).is_some_and(|p| p.shape))
    }

    /// Whether it has a parameter that is scanned.
    pub fn has_shape(&self) -> bool {
        self.parameters.iter().any(|p| p.shape)
    }

    /// The places among the parameters of those that are no shape, in column order.
    pub fn linear(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        let parameters = self.parameters;
        (0..parameters.len()).filter(|n| parameters.get(*n).is_some_and(|p| !p.shape))
    }

    /// The places among the parameters of those that are searched over a grid, each with the grid: shapes, a gap or a compliance.
    pub fn all_searched(&self) -> impl Iterator<Item = (usize, Grid)> + Clone + use<> {
        let parameters = self.parameters.iter().enumerate();
        parameters.filter_map(|(n, p)| Some((n, p.grid?)))
    }

    /// The first of them.
    pub fn searched(&self) -> Option<(usize, Grid)> {
        self.all_searched().next()
    }

    /// Whether every geared drive has it.
    pub const fn is_plain(&self) -> bool {
        self.plain
    }

    /// Whether the base moves by it.
    pub const fn is_of_base(&self) -> bool {
        matches!(self.input, Input::Base)
    }

    /// Whether its value is in the motion, the time, gravity or the scale of the prediction, and what is fitted is how far it is from there.
    pub const fn is_derivative(&self) -> bool {
        matches!(
            self.enters,
            Enters::Derivative | Enters::Trial | Enters::Positions
        )
    }

    /// Which way its first parameter, a time, moves the reported torque, if it does: +1 later, −1 earlier than the true one.
    pub const fn shifts(&self) -> Option<f64> {
        match (self.form, self.input, self.parameters) {
            (Form::Clock, ..) => Some(1.0),
            // The motor's torque follows what is reported.
            (Form::Columns, Input::MotorTorque, [time]) if is_seconds(time.unit) => Some(-1.0),
            _ => None,
        }
    }

    /// Whether it is a limit of the torque.
    pub const fn is_limit(&self) -> bool {
        matches!(self.enters, Enters::Limit)
    }

    /// Whether its torque is a function of what the model itself says: of a torque, or of where other joints are.
    pub const fn depends_on_model(&self) -> bool {
        matches!(
            self.input,
            Input::TransmittedTorque | Input::MotorTorque | Input::Limb
        )
    }

    /// What it has between motor and link, if it lets the link move against the motor or rubs there.
    pub const fn transmission(&self) -> Option<Transmission> {
        match self.form {
            Form::Motion(Moved::Link(transmission)) => Some(transmission),
            _ => None,
        }
    }

    /// Whether it lets the link move against the motor.
    pub const fn is_compliant(&self) -> bool {
        matches!(
            self.transmission(),
            Some(Transmission::Spring | Transmission::Backlash)
        )
    }

    /// Whether all joints may share one value of it.
    pub const fn may_be_shared(&self) -> bool {
        matches!(self.reach, Reach::Robot | Reach::JointOrRobot)
    }
}

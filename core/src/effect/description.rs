//! What an effect is, in words, bounds and form.

/// How an effect enters the equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Form {
    /// Window columns of the effect's own joint.
    Columns,
    /// Window columns of the joint and of the one that carries it, by what both do.
    Coupled,
    /// All that the joint's torque is made of, times a factor.
    Scale,
    /// The motion of the link differs from what the joint's sensors report; felt by all joints of the limb.
    Motion,
    /// The direction of gravity; felt by all joints of the robot.
    Gravity,
    /// The inertia of the joint's body; felt by the joints that move it.
    Inertia,
    /// A force at the foot, unknown at every instant: found by its direction, not by a column.
    Force,
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
    /// Whether the torque is not linear in it: it is scanned, then refined.
    pub shape: bool,
}

impl Parameter {
    /// A linear parameter that is zero where the effect is absent.
    pub(super) const fn new(
        symbol: &'static str,
        unit: &'static str,
        lower: f64,
        upper: f64,
    ) -> Self {
        Self {
            symbol,
            unit,
            lower,
            upper,
            neutral: 0.0,
            shape: false,
        }
    }

    /// The same, absent at `neutral`.
    pub(super) const fn neutral(self, neutral: f64) -> Self {
        Self { neutral, ..self }
    }

    /// The same as a shape.
    pub(super) const fn shape(self) -> Self {
        Self {
            shape: true,
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

/// What an effect is, in words and bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// The effect's name everywhere.
    pub name: &'static str,
    /// Its torque as a formula.
    pub torque: &'static str,
    /// How it enters the equation.
    pub form: Form,
    /// Its parameters: those that are no shape in column order.
    pub parameters: &'static [Parameter],
    /// What it is, in a sentence for the user.
    pub words: &'static str,
    /// Names of effects that look alike on poor data.
    pub look_alikes: &'static [&'static str],
    /// The motion that tells it from them.
    pub separated_by: &'static str,
    /// Attribute of URDF's `<dynamics>`, if it has one.
    pub urdf: Option<&'static str>,
    /// Attribute of MJCF's `<joint>`, if it has one.
    pub mjcf: Option<&'static str>,
}

impl Description {
    /// The place among the parameters of the one that is scanned, if the effect has one.
    pub fn shape(&self) -> Option<usize> {
        self.parameters.iter().position(|p| p.shape)
    }
}

//! What can be asked of a design.

use crate::catalogue;
use crate::command::simulate::within;
use crate::excite::Margins;
use crate::excite::trunk::Ground;
use crate::model::UnknownName;
use clap::{Args, ValueEnum};
use proprio_core::effect::EffectKind;

/// What is kept back from the robot's limits.
#[derive(Debug, Args)]
pub(super) struct LimitArguments {
    /// Distance from the stops, rad
    #[arg(long, value_name = "RAD", default_value_t = Margins::default().position)]
    position_margin: f64,
    /// Share of the greatest speed
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().velocity, value_parser = within(0.0, 1.0))]
    velocity_share: f64,
    /// Greatest acceleration, rad/s²
    #[arg(long, value_name = "RAD/S2", default_value_t = Margins::default().acceleration)]
    acceleration: f64,
    /// Share of the greatest torque
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().torque, value_parser = within(0.0, 1.0))]
    torque_share: f64,
    /// Share of the greatest power, a quarter of torque times speed
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().power)]
    power_share: f64,
    /// By how much each parameter may be off while the torque limits still hold, as a share
    #[arg(long, value_name = "SHARE", default_value_t = Margins::default().uncertainty)]
    uncertainty: f64,
    /// Distance of shapes, m
    #[arg(long, value_name = "M", default_value_t = Margins::default().distance)]
    distance: f64,
    /// Height of the base above a floor that feet and knees must stay clear of, m
    #[arg(long, value_name = "M")]
    ground: Option<f64>,
}

impl LimitArguments {
    pub(super) fn margins(&self) -> Margins {
        Margins {
            position: self.position_margin,
            velocity: self.velocity_share,
            acceleration: self.acceleration,
            torque: self.torque_share,
            power: self.power_share,
            uncertainty: self.uncertainty,
            distance: self.distance,
            ground: self.ground,
        }
    }
}

/// A motion of the trunk.
#[derive(Debug, Args)]
pub(super) struct TrunkArguments {
    /// Sway, heave, roll, pitch and yaw of the trunk over four planted feet, to identify the trunk's mass, centre of mass and
    /// inertia
    #[arg(long, conflicts_with_all = ["legs", "cost", "parameters", "separate", "from", "pose", "shapes", "html", "ground"])]
    pub(super) standing: bool,
    /// With --standing: greatest tangential over normal force of a foot
    #[arg(long, value_name = "MU", default_value_t = Ground::default().friction, requires = "standing")]
    friction: f64,
    /// With --standing: least normal force of each foot, N
    #[arg(long, value_name = "N", default_value_t = Ground::default().least_load, requires = "standing")]
    least_load: f64,
    /// With --standing: height of the base above the floor in the middle of the motion, m
    #[arg(long, value_name = "M", default_value_t = Ground::default().height, requires = "standing")]
    height: f64,
}

impl TrunkArguments {
    pub(super) fn ground(&self) -> Ground {
        Ground {
            friction: self.friction,
            least_load: self.least_load,
            height: self.height,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Cost {
    /// Condition number of the identifiable inertias: every combination about equally well
    Condition,
    /// The same of columns per kg, kg m and kg m², as in most of the literature
    ConditionSi,
    /// Information on inertias, friction, armature and offsets beyond the prior (D-optimal)
    Determinant,
}

#[derive(Debug, Clone)]
pub(super) struct Separation {
    pub(super) effects: [EffectKind; 2],
    pub(super) joint: Option<String>,
}

pub(super) fn parse_separation(text: &str) -> Result<Separation, String> {
    let (effects, joint) = match text.split_once(':') {
        Some((effects, joint)) => (effects, Some(joint.to_owned())),
        None => (text, None),
    };
    let (a, b) = effects
        .split_once(',')
        .ok_or("expected A,B[:JOINT], such as stribeck,viscous:FR_hip")?;
    let effect = |name: &str| {
        catalogue::effect_named(name).ok_or_else(|| {
            let unknown = UnknownName::new("effect", name, catalogue::names());
            match unknown.nearest() {
                Some(nearest) => format!("no effect `{name}`; did you mean `{nearest}`?"),
                None => unknown.to_string(),
            }
        })
    };
    let effects = [effect(a.trim())?, effect(b.trim())?];
    if effects[0] == effects[1] {
        return Err("the two effects are the same".to_owned());
    }
    Ok(Separation { effects, joint })
}

pub(super) fn parse_pose(text: &str) -> Result<(String, f64), String> {
    let (joint, value) = text.split_once('=').ok_or("expected JOINT=RAD")?;
    let value = value
        .parse()
        .map_err(|_| format!("`{value}` is not a number"))?;
    Ok((joint.to_owned(), value))
}

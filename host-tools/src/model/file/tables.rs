//! The tables of a model file as serde reads them; keys that are none of these are refused.

use std::collections::BTreeMap;
use std::path::PathBuf;

use proprio_core::inertia::INERTIAL;
use serde::Deserialize;
use toml::Spanned;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(rename = "format")]
    _format: i64,
    pub(super) robot: Spanned<RobotTable>,
    #[serde(default)]
    pub(super) base: Option<Spanned<BaseTable>>,
    /// Positions of joints that do not move, rad or m.
    #[serde(default)]
    pub(super) held: BTreeMap<Spanned<String>, f64>,
    #[serde(default)]
    pub(super) log: LogSpeech,
    #[serde(default)]
    pub(super) prior: PriorTable,
    #[serde(default)]
    pub(super) motor: BTreeMap<Spanned<String>, MotorTable>,
    #[serde(default)]
    pub(super) foot: Vec<Spanned<FootTable>>,
    #[serde(default)]
    pub(super) imu: Option<Spanned<ImuTable>>,
    #[serde(default)]
    pub(super) mount: Vec<Spanned<FixtureTable>>,
    #[serde(default)]
    pub(super) tool: Vec<Spanned<ToolTable>>,
    /// Corrections by joint and quantity.
    #[serde(default)]
    pub(super) kinematics: BTreeMap<Spanned<String>, BTreeMap<Spanned<String>, CorrectionEntry>>,
    #[serde(default)]
    pub(super) effect: Vec<Spanned<EffectTable>>,
    #[serde(default)]
    pub(super) body: BTreeMap<Spanned<String>, BodyTable>,
    #[serde(default)]
    pub(super) total: Option<Spanned<TotalTable>>,
    #[serde(default)]
    pub(super) provenance: Option<ProvenanceTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotTable {
    pub(super) builtin: Option<String>,
    pub(super) urdf: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BaseTable {
    pub(super) mount: Mount,
    pub(super) rpy: Option<[f64; 3]>,
    pub(super) quaternion: Option<[f64; 4]>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Mount {
    #[serde(alias = "pinned")]
    Fixed,
    /// It recoils from its limbs.
    Suspended,
}

/// What messages leave open.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LogSpeech {
    pub(super) motors: Option<Vec<Spanned<String>>>,
    #[serde(default)]
    pub(super) at_motor: Vec<Signal>,
    #[serde(default)]
    pub(super) transmission: BTreeMap<Spanned<String>, BTreeMap<Spanned<String>, f64>>,
}

/// A signal of a motor, in the order of [`crate::model::LogConventions::at_motor`].
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Signal {
    Q,
    Dq,
    Tau,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorTable {
    pub(super) cad_uncertainty: Option<Spanned<f64>>,
    #[serde(default)]
    pub(super) body: BTreeMap<Spanned<String>, Spanned<f64>>,
    #[serde(default)]
    pub(super) effect: BTreeMap<Spanned<String>, PriorEntry>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorEntry {
    pub(super) mean: f64,
    pub(super) std: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotorTable {
    pub(super) gear: f64,
    pub(super) rotor_inertia: f64,
}

/// What touches the ground of a link; what is not stated is the link's own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FootTable {
    pub(super) name: Option<String>,
    pub(super) link: String,
    pub(super) place: Option<[f64; 3]>,
    pub(super) points: Option<Vec<[f64; 3]>>,
    pub(super) radius: Option<f64>,
    pub(super) radius_std: Option<f64>,
    pub(super) sensor: Option<bool>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImuTable {
    pub(super) link: Option<String>,
    pub(super) place: Option<[f64; 3]>,
    pub(super) rpy: Option<[f64; 3]>,
    pub(super) place_std: Option<f64>,
    pub(super) turn_std: Option<f64>,
}

/// The base in the measuring system's frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FixtureTable {
    pub(super) xyz: [f64; 3],
    #[serde(default)]
    pub(super) rpy: [f64; 3],
    pub(super) xyz_std: Option<[f64; 3]>,
    pub(super) rpy_std: Option<[f64; 3]>,
}

/// A measured target.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToolTable {
    pub(super) name: String,
    pub(super) link: String,
    pub(super) xyz: [f64; 3],
    #[serde(default)]
    pub(super) rpy: [f64; 3],
    pub(super) xyz_std: Option<[f64; 3]>,
    pub(super) rpy_std: Option<[f64; 3]>,
}

#[derive(Debug, Deserialize)]
pub(super) struct EffectTable {
    /// Empty where it is missing: an unknown key is told first.
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) joint: String,
    pub(super) value: Option<f64>,
    pub(super) std: Option<f64>,
    /// All but the first, by their symbols.
    #[serde(default)]
    pub(super) parameters: BTreeMap<String, ParameterEntry>,
    pub(super) prior: Option<PriorEntry>,
    /// What each witness measured of the first parameter.
    #[serde(default)]
    pub(super) measured_by: BTreeMap<String, ParameterEntry>,
    #[serde(default)]
    pub(super) just_added: bool,
    /// A formula, of which the other keys are parameters.
    pub(super) torque: Option<String>,
    pub(super) kind: Option<String>,
    /// All other keys: a formula's parameters; of an effect of the catalogue none is right.
    #[serde(flatten)]
    pub(super) symbols: BTreeMap<String, toml::Value>,
}

/// A formula's parameter.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SymbolTable {
    pub(super) unit: Option<String>,
    pub(super) prior: Option<[f64; 2]>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) value: Option<f64>,
    pub(super) std: Option<f64>,
    #[serde(default)]
    pub(super) held: bool,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ParameterEntry {
    pub(super) value: f64,
    pub(super) std: Option<f64>,
}

/// A number of a joint that is no effect.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CorrectionEntry {
    pub(super) value: f64,
    pub(super) std: Option<f64>,
    /// What each witness measured of it.
    #[serde(default)]
    pub(super) measured_by: BTreeMap<String, ParameterEntry>,
}

/// Ten numbers by the names of [`NAMES`].
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub(super) struct Ten {
    pub(super) m: f64,
    pub(super) hx: f64,
    pub(super) hy: f64,
    pub(super) hz: f64,
    pub(super) Ixx: f64,
    pub(super) Ixy: f64,
    pub(super) Ixz: f64,
    pub(super) Iyy: f64,
    pub(super) Iyz: f64,
    pub(super) Izz: f64,
}

impl Ten {
    pub(super) fn array(self) -> [f64; INERTIAL] {
        let Self {
            m,
            hx,
            hy,
            hz,
            Ixx,
            Ixy,
            Ixz,
            Iyy,
            Iyz,
            Izz,
        } = self;
        [m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]
    }
}

/// As [`Ten`], with standard deviations.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub(super) struct BodyTable {
    pub(super) m: f64,
    pub(super) hx: f64,
    pub(super) hy: f64,
    pub(super) hz: f64,
    pub(super) Ixx: f64,
    pub(super) Ixy: f64,
    pub(super) Ixz: f64,
    pub(super) Iyy: f64,
    pub(super) Iyz: f64,
    pub(super) Izz: f64,
    pub(super) std: Option<Ten>,
}

impl BodyTable {
    pub(super) fn array(&self) -> [f64; INERTIAL] {
        let Self {
            m,
            hx,
            hy,
            hz,
            Ixx,
            Ixy,
            Ixz,
            Iyy,
            Iyz,
            Izz,
            ..
        } = *self;
        [m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz]
    }
}

/// All bodies together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TotalTable {
    pub(super) std: TotalStd,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TotalStd {
    pub(super) m: f64,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProvenanceTable {
    pub(super) version: String,
    pub(super) command: String,
    #[serde(default)]
    pub(super) only: Vec<String>,
    #[serde(default)]
    pub(super) log: Vec<LogTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LogTable {
    pub(super) path: String,
    pub(super) sha256: String,
}

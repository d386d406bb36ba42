//! What the numbers of a limb's factors belong to: columns in their order, units, window, CAD. Two factors add up only if all of it is the same.

use proprio_core::effect::{EffectKind, Enters, Form, Input};
use proprio_solve::factor::numbers_of;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::model::{Limb, Model, Robot};
use crate::parameter::{INERTIAL_NAMES, of_effect};

/// A column of a limb's factors: one parameter. As JSON a list in the order of the fields: a table has hundreds of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Packed", into = "Packed")]
pub struct KeptColumn {
    /// The parameter: `m:FR_hip`, `coulomb:FR_hip`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Expected value before any data, in that unit.
    pub mean: f64,
    /// Its standard deviation.
    pub std: f64,
    /// The limb's joints whose rows have this column, counted from the first.
    pub joints: Vec<usize>,
}

type Packed = (String, String, f64, f64, Vec<usize>);

impl From<Packed> for KeptColumn {
    fn from((name, unit, mean, std, joints): Packed) -> Self {
        Self {
            name,
            unit,
            mean,
            std,
            joints,
        }
    }
}

impl From<KeptColumn> for Packed {
    fn from(column: KeptColumn) -> Self {
        let KeptColumn {
            name,
            unit,
            mean,
            std,
            joints,
        } = column;
        (name, unit, mean, std, joints)
    }
}

impl KeptColumn {
    /// What it is, without the joint: `m`, `coulomb`, `spring`.
    pub fn kind(&self) -> &str {
        split(&self.name).0
    }

    /// The joint or body that it belongs to.
    pub fn joint(&self) -> &str {
        split(&self.name).1
    }

    /// The effect whose parameter it is; `None` for one of a body's, and for a name that this program does not know.
    pub fn effect(&self) -> Option<EffectKind> {
        effect_of(self.kind()).map(|(effect, _)| effect)
    }

    /// Whether this program knows what it is.
    pub fn is_known(&self) -> bool {
        self.is_inertial() || self.effect().is_some_and(is_kept)
    }

    /// Whether it is one of a body's ten parameters.
    pub fn is_inertial(&self) -> bool {
        let kind = self.kind();
        INERTIAL_NAMES.iter().any(|(name, _)| *name == kind)
    }
}

/// A parameter's name as what it is and where: `spring.q0:FR_calf` → (`spring.q0`, `FR_calf`).
fn split(name: &str) -> (&str, &str) {
    name.split_once(':').unwrap_or((name, ""))
}

/// The effect and the symbol of one of its parameters, "" for the first: `spring.q0` → (spring, `q0`).
fn effect_of(kind: &str) -> Option<(EffectKind, &str)> {
    let (name, symbol) = kind.split_once('.').unwrap_or((kind, ""));
    let mut all = EffectKind::ALL.iter();
    Some((*all.find(|effect| effect.name() == name)?, symbol))
}

/// Where in a model of `robot` the parameter of an effect is that has this name: the effect, its joint, which of the effect's parameters, each
/// counted from the first. `None` for a body's parameter, and for what this robot or this program does not have.
pub fn place_in_model(name: &str, robot: &Robot) -> Option<(EffectKind, usize, usize)> {
    let (kind, joint) = split(name);
    let (effect, symbol) = effect_of(kind)?;
    let mut bodies = robot.bodies().iter();
    let joint = bodies.position(|body| body.name == joint)?;
    let mut parameters = effect.description().parameters.iter();
    let parameter = match symbol {
        "" => 0,
        symbol => parameters.position(|parameter| parameter.symbol == symbol)?,
    };
    Some((effect, joint, parameter))
}

/// Columns of a limb.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BlockColumns {
    /// The limb.
    pub limb: String,
    /// Its joints.
    pub joints: Vec<String>,
    /// Length of a window, µs: a row is a mean over it.
    pub window_us: u64,
    /// SHA-256 of the limb's CAD: frames, axes, bodies, how the base stands.
    pub cad: String,
    /// In the order in which they stand in a factor.
    pub columns: Vec<KeptColumn>,
}

impl BlockColumns {
    /// As text: compact JSON, which the table's metadata holds.
    pub fn text(&self) -> String {
        // Plain data with string keys.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// SHA-256 of [`text`](Self::text), in hexadecimal.
    pub fn hash(&self) -> String {
        sha256(self.text().as_bytes())
    }

    /// The columns that a joint's rows have, by their place in [`columns`](Self::columns).
    pub fn of_joint(&self, joint: usize) -> Vec<usize> {
        let columns = self.columns.iter().enumerate();
        let own = columns.filter(|(_, column)| column.joints.contains(&joint));
        own.map(|(k, _)| k).collect()
    }

    /// How many numbers a joint's factor has.
    pub fn numbers(&self, joint: usize) -> usize {
        numbers_of(self.of_joint(joint).len())
    }

    /// The place of a joint's name.
    pub fn place(&self, joint: &str) -> Option<usize> {
        self.joints.iter().position(|known| known == joint)
    }
}

/// Whether factors keep the columns of an effect: it is a torque that enters as columns of the motion alone, and no nonlinear parameter
/// is to be searched before there is a column. What depends on temperature is left to the row's own temperature; what is the sum of kept
/// columns needs none of its own.
pub fn is_kept(effect: EffectKind) -> bool {
    let description = effect.description();
    matches!(description.form, Form::Columns | Form::Coupled)
        && description.enters == Enters::Column
        && description.input == Input::Motion
        && description.searched().is_none()
        && description.sum_of.is_empty()
}

/// Whether a parameter of a kept effect has a column of its own: not one that is another kept effect's.
pub(super) fn has_column(effect: EffectKind, parameter: usize) -> bool {
    let same = effect.description().parameters[parameter].same_as;
    !same.is_some_and(is_kept)
}

/// The name of a kept effect's parameter.
pub(super) fn name_of(effect: EffectKind, parameter: usize, joint: &str) -> String {
    of_effect(effect, parameter, joint)
}

/// SHA-256 of what of a limb's CAD enters its rows.
pub(super) fn cad_hash(model: &Model, limb: &Limb) -> String {
    let base = model.base();
    let mut text = format!("{:?} {:?}\n", base.rotation, base.translation);
    for b in limb.bodies.clone() {
        let body = &model.robot().bodies()[b];
        let inertia: Vec<f64> = body.inertia.0.iter().copied().collect();
        let place = (&body.placement.rotation, &body.placement.translation);
        text += &format!(
            "{} {:?} {:?} {:?} {place:?} {inertia:?} {:?}\n",
            body.name,
            body.parent
                .map(|parent| parent - limb.bodies.start.min(parent)),
            body.kind,
            body.axis,
            model.cad_uncertainty(b),
        );
    }
    sha256(text.as_bytes())
}

/// SHA-256 in hexadecimal.
fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_are_the_effects_that_enter_as_columns_of_the_motion() {
        let kept = EffectKind::ALL.iter().filter(|effect| is_kept(**effect));
        let names: Vec<&str> = kept.map(|effect| effect.name()).collect();
        assert_eq!(
            names,
            [
                "viscous",
                "coulomb",
                "armature",
                "bias",
                "asymmetric_viscous",
                "quadratic_drag",
                "coupled_armature",
                "coupled_viscous",
                "coupled_coulomb",
                "spring",
            ]
        );
        // A spring's offset is a torque offset.
        assert!(has_column(EffectKind::Spring, 0) && !has_column(EffectKind::Spring, 1));
    }

    #[test]
    fn a_hash_knows_the_order_the_units_the_window_and_the_cad() {
        let column = |name: &str| KeptColumn {
            name: name.to_owned(),
            unit: "N m".to_owned(),
            mean: 0.0,
            std: 1.0,
            joints: vec![0],
        };
        let columns = BlockColumns {
            limb: "FR".to_owned(),
            joints: vec!["FR_hip".to_owned()],
            window_us: 20_000,
            cad: "0".to_owned(),
            columns: vec![column("bias:FR_hip"), column("coulomb:FR_hip")],
        };
        let mut others = vec![columns.clone(); 5];
        others[0].columns.swap(0, 1);
        others[1].columns[0].unit = "N".to_owned();
        others[2].window_us = 10_000;
        others[3].cad = "1".to_owned();
        others[4].columns[0].name = "bias:FR_thigh".to_owned();
        for other in others {
            assert_ne!(other.hash(), columns.hash());
        }
        let read: BlockColumns = serde_json::from_str(&columns.text()).unwrap();
        assert_eq!(read, columns);
        assert_eq!(columns.numbers(0), 6);
    }
}

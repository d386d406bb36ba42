//! Effects as users ask for them: `EFFECT[:JOINT]`, or a formula of their own, `[NAME =] JOINT[,JOINT…]: FORMULA`.

use std::collections::BTreeMap;

use proprio_core::effect::{EffectKind, Form};

use super::{JointKind, Model, Robot, UnknownName};
use crate::catalogue::{self, RegisterError};
use crate::formula::{self, FormulaError, Kind, Names, Site, Stated};

/// Why no effect is what was asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AskedError {
    /// An effect or a joint that does not exist.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// A payload of the base, which is no effect: a body states its own inertia.
    #[error(
        "what the base carries is part of its inertia, `[body.base]` in the model file, and no effect"
    )]
    OfBase,
    /// A formula that cannot be.
    #[error("the formula is refused: {0}")]
    Formula(#[from] FormulaError),
    /// A name that cannot be.
    #[error(transparent)]
    Register(#[from] RegisterError),
}

/// Signs that a formula has and a joint's name has not.
const OF_FORMULAS: [char; 7] = ['*', '+', '/', '^', '(', ')', ' '];

/// The parts of a text that is a formula at joints: its name, the joints, the formula.
struct Parts<'a> {
    name: Option<&'a str>,
    joints: Vec<&'a str>,
    formula: &'a str,
}

/// `None` where it is `EFFECT[:JOINT]`.
fn parts<'a>(robot: &Robot, text: &'a str) -> Option<Parts<'a>> {
    let (left, formula) = text.split_once(':')?;
    let (name, joints) = match left.split_once('=') {
        Some((name, joints)) => (Some(name.trim()), joints),
        None => (None, left),
    };
    let joints: Vec<&str> = joints.split(',').map(str::trim).collect();
    let formula = formula.trim();
    let is_joint = |name: &str| name == "base" || robot.joint(name).is_ok();
    let is_formula = name.is_some()
        || formula.contains(OF_FORMULAS)
        || !is_joint(formula) && joints.iter().all(|joint| is_joint(joint));
    is_formula.then_some(Parts {
        name,
        joints,
        formula,
    })
}

/// The texts of a list with commas: those within a formula are its own, and joints after an effect's joint are that effect's.
pub fn asked_texts(robot: &Robot, list: &str) -> Vec<String> {
    if parts(robot, list).is_some() {
        return vec![list.to_owned()];
    }
    let mut texts: Vec<String> = Vec::new();
    for text in list.split(',') {
        match texts.last_mut() {
            Some(last) if last.contains(':') && robot.joint(text).is_ok() => {
                *last += ",";
                *last += text;
            }
            _ => texts.push(text.to_owned()),
        }
    }
    texts
}

impl Model {
    /// The effects and joints that a text asks for; a formula is made known to the program as an effect, under a name that the model does not
    /// use for another one.
    ///
    /// # Errors
    /// [`AskedError`].
    pub fn asked(&self, text: &str) -> Result<Vec<(EffectKind, usize)>, AskedError> {
        let robot = self.robot();
        let Some(parts) = parts(robot, text) else {
            if let Some((effect, "base")) = text.split_once(':') {
                let kind = catalogue::effect_named(effect).map(|kind| kind.description().form);
                if kind == Some(Form::Inertia) {
                    return Err(AskedError::OfBase);
                }
            }
            let (effect, joints) = robot.places(text)?;
            return Ok(joints.into_iter().map(|joint| (effect, joint)).collect());
        };
        let joints = (parts.joints.iter()).map(|name| robot.joint(name));
        let joints = joints.collect::<Result<Vec<usize>, _>>()?;
        // A list of joints has one at least.
        let first = joints.first().copied().unwrap_or_default();
        let name = match parts.name {
            Some(name) => name.to_owned(),
            None => self.free_name(first, parts.formula),
        };
        let stated = BTreeMap::new();
        let effect = robot.formula(&name, parts.formula, (Kind::Free, &stated), first)?;
        let named = joints.iter().zip(&parts.joints);
        named
            .map(|(_, name)| Ok((effect, robot.place(effect, Some(name))?[0])))
            .collect()
    }

    /// The formulas among its effects, each once.
    pub(crate) fn formulas(&self) -> Vec<EffectKind> {
        let mut own: Vec<EffectKind> = Vec::new();
        for effect in self.effects().iter().map(|e| e.effect) {
            if catalogue::formula_of(effect).is_some() && !own.contains(&effect) {
                own.push(effect);
            }
        }
        own
    }

    /// A name for a formula: that of the same formula, if the model has it, or the first of `formula`, `formula_2`, … that it does not use.
    fn free_name(&self, joint: usize, text: &str) -> String {
        let mut own = self.effects().iter().map(|e| e.effect);
        let same = own.find(|effect| {
            let robot = self.robot();
            catalogue::formula_of(*effect).is_some_and(|f| robot.formula_text(f, joint) == text)
        });
        if let Some(same) = same {
            return same.name().to_owned();
        }
        let is_free = |name: &String| self.effects().iter().all(|e| e.effect.name() != name);
        let numbered = (2..).map(|n| format!("formula_{n}"));
        let mut names = std::iter::once("formula".to_owned()).chain(numbered);
        names.find(is_free).unwrap_or_default()
    }
}

impl Robot {
    /// Makes a formula at a joint known as an effect.
    ///
    /// # Errors
    /// [`AskedError`].
    pub(crate) fn formula(
        &self,
        name: &str,
        text: &str,
        (kind, stated): (Kind, &BTreeMap<String, Stated>),
        joint: usize,
    ) -> Result<EffectKind, AskedError> {
        let limb = self.limb_of(joint);
        let names: Vec<&str> = (limb.clone())
            .map(|b| self.bodies()[b].name.as_str())
            .collect();
        let body = &self.bodies()[joint];
        let site = Site {
            names: Names {
                joints: &names,
                own: joint - limb.start,
            },
            slides: body.kind == JointKind::Prismatic,
            limits: body.limits,
            effort: body.effort,
            velocity: body.velocity,
        };
        let (effect, formula) = formula::define(name, text, kind, stated, &site)?;
        Ok(catalogue::define(effect, formula)?)
    }

    /// A formula's text with the names of a joint's own neighbours.
    pub fn formula_text(&self, formula: &formula::Formula, joint: usize) -> String {
        formula.text_at(|after| {
            let other = joint
                .checked_add_signed(after)
                .and_then(|n| self.bodies().get(n));
            let name = other.map_or("?", |body| &body.name);
            let is_plain = name.chars().all(|c| c.is_alphanumeric() || c == '_');
            if is_plain {
                name.to_owned()
            } else {
                format!("\"{name}\"")
            }
        })
    }

    /// The joints of the limb that a joint is of.
    pub(super) fn limb_of(&self, joint: usize) -> std::ops::Range<usize> {
        let bodies = self.bodies();
        let root = std::iter::successors(Some(joint), |&b| bodies[b].parent).last();
        self.subtree(root.unwrap_or(joint))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_of_effects_of_joints_or_one_formula() {
        let model = Model::default();
        for (list, texts) in [
            ("viscous,bias:FR_hip", vec!["viscous", "bias:FR_hip"]),
            (
                "bias:FR_hip,FR_calf,viscous",
                vec!["bias:FR_hip,FR_calf", "viscous"],
            ),
            ("viscous,FR_hip", vec!["viscous", "FR_hip"]),
            (
                "FR_hip,FR_calf: c*max(q, 0)",
                vec!["FR_hip,FR_calf: c*max(q, 0)"],
            ),
        ] {
            assert_eq!(asked_texts(model.robot(), list), texts, "{list}");
        }
        assert_eq!(model.asked("bias:FR_hip,FR_calf").unwrap().len(), 2);
        assert!(model.asked("bias:FR_hip,FR_knee").is_err());
        assert_eq!(model.asked("payload:base"), Err(AskedError::OfBase));
    }
}

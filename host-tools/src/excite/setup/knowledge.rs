//! What a model knows of a limb before any data: priors, names, and the effects that it states.

use nalgebra::DMatrix;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::EFFECTS;
use proprio_core::inertia::{InertialParameters, NAMES};

use super::Design;
use crate::excite::ExciteError;
use crate::excite::columns::{Column, is_known};
use crate::excite::cost;
use crate::excite::limb::Limb;
use crate::excite::problem::Known;
use crate::excite::settings::Settings;
use crate::excite::space::whole_prior;
use crate::model::{self, Model, UnknownName};

/// Noise of a torque's mean over a window of 20 ms, as a share of the motor's greatest torque: what is left on a real Go2 when
/// every effect is in the model, 0.2 N m beside motors of 24 and 45 N m.
const NOISE: f64 = 0.005;
/// That window, s.
const WINDOW: f64 = 0.02;

impl Design<'_> {
    /// The effects that a design is to tell: those that are identified by default, joint by joint.
    pub(super) fn effect_columns(&self) -> Vec<Column> {
        let joints = 0..self.limb.bodies.len();
        joints
            .flat_map(|j| EFFECTS.map(|effect| column(effect, j, 0, 1.0)))
            .collect()
    }

    fn effect_std(&self, column: &Column) -> f64 {
        let joint = self.limb.bodies.start + column.joint;
        self.model.effect_prior(column.effect, joint).prior.std
    }

    pub(super) fn prior(&self, effects: &[Column]) -> Result<DMatrix<f64>, ExciteError> {
        let bodies: Vec<(InertialParameters<f64>, f64)> = self
            .limb
            .bodies
            .clone()
            .map(|b| {
                (
                    self.model.robot().bodies()[b].inertia,
                    self.model.cad_uncertainty(b),
                )
            })
            .collect();
        let stds: Vec<f64> = effects
            .iter()
            .map(|column| self.effect_std(column))
            .collect();
        whole_prior(&bodies, &stds).ok_or_else(|| ExciteError::Unphysical(self.limb.name.clone()))
    }

    /// The effects that the model has a value of, and where it has none of friction or rotor inertia what is expected of them.
    pub(super) fn known(&self) -> Vec<Known> {
        let mut known = stated(self.model, self.limb);
        for (j, joint) in self.limb.bodies.clone().enumerate() {
            if self.model.robot().bodies()[joint].motor.is_none() {
                continue;
            }
            for effect in EffectKind::PLAIN
                .into_iter()
                .filter(|effect| self.model.effect(*effect, joint).is_none())
            {
                let mean = self.model.effect_prior(effect, joint).prior.mean;
                known.push((column(effect, j, 0, 1.0), mean));
            }
        }
        known
    }

    /// One over the noise of a row that stands for `step` seconds.
    pub(super) fn weights(&self, step: f64) -> Vec<f64> {
        let windows = window_weights(self.model, self.limb).into_iter();
        windows
            .map(|weight| weight * (step / WINDOW).sqrt())
            .collect()
    }

    pub(super) fn earlier(&self, scale: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let own = self
            .settings
            .earlier
            .iter()
            .filter(|e| e.limb == self.limb.name);
        own.map(|earlier| (&earlier.triangle * scale).qr().unpack_r())
            .reduce(|sum, next| cost::triangle(&next, Some(&sum)))
    }

    /// Names of all parameters.
    pub(super) fn names(&self, effects: &[Column]) -> Vec<String> {
        let bodies = self.limb.bodies.clone();
        let joint = |j: usize| self.model.joint_name(self.limb.bodies.start + j);
        let inertial =
            bodies.flat_map(|b| NAMES.map(|k| format!("{k}:{}", self.model.joint_name(b))));
        let effects = effects
            .iter()
            .map(|e| format!("{}:{}", e.effect.name(), joint(e.joint)));
        inertial.chain(effects).collect()
    }

    /// Rows that pick named parameters, each in units of its prior's standard deviation, out of the scaled ones.
    pub(super) fn named(
        &self,
        names: &[String],
        effects: &[Column],
        scale: &DMatrix<f64>,
        root: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, ExciteError> {
        let all = self.names(effects);
        let mut rows = Vec::new();
        for name in names {
            let at = all.iter().position(|known| known == name);
            let at = at.ok_or_else(|| {
                UnknownName::new("parameter", name, all.iter().map(String::as_str))
            })?;
            rows.push(scale.row(at) / root.row(at).norm());
        }
        Ok(DMatrix::from_rows(&rows))
    }
}

/// The effects that a model has a value of, with it.
pub(in crate::excite) fn stated(model: &Model, limb: &model::Limb) -> Vec<Known> {
    let mut stated = Vec::new();
    for (j, joint) in limb.bodies.clone().enumerate() {
        for own in model
            .effects_of(joint)
            .into_iter()
            .filter(|own| is_known(own.effect))
        {
            let described = own.effect.description();
            let at = (described.shapes().next())
                .and_then(|n| own.estimates[n])
                .map_or(1.0, |estimate| estimate.value);
            let values = own
                .estimates
                .iter()
                .enumerate()
                .filter(|(n, _)| !described.parameters[*n].shape);
            for (part, (_, estimate)) in values.take(own.effect.columns().max(1)).enumerate() {
                if let Some(estimate) = estimate {
                    stated.push((column(own.effect, j, part, at), estimate.value));
                }
            }
        }
    }
    stated
}

/// A limb's parameters and what is known of them before any data.
pub(in crate::excite) struct Information {
    pub(in crate::excite) body: Box<dyn Limb>,
    pub(in crate::excite) theta: Vec<f64>,
    pub(in crate::excite) columns: Vec<Column>,
    /// A square root of the prior's covariance.
    pub(in crate::excite) root: DMatrix<f64>,
    pub(in crate::excite) names: Vec<String>,
}

impl Information {
    pub(in crate::excite) fn of(model: &Model, limb: &model::Limb) -> Result<Self, ExciteError> {
        let settings = Settings::default();
        let of = Design {
            model,
            limb,
            settings: &settings,
        };
        let columns = of.effect_columns();
        Ok(Self {
            body: of.dynamics()?,
            theta: of.theta(),
            root: of.prior(&columns)?,
            names: of.names(&columns),
            columns,
        })
    }
}

/// One over the noise of each joint's torque over a window.
pub(in crate::excite) fn window_weights(model: &Model, limb: &model::Limb) -> Vec<f64> {
    let noise = |b: usize| {
        let effort = model.robot().bodies()[b].effort;
        if effort.is_finite() {
            NOISE * effort
        } else {
            1.0
        }
    };
    limb.bodies.clone().map(|b| 1.0 / noise(b)).collect()
}

pub(super) fn column(effect: EffectKind, joint: usize, part: usize, shape: f64) -> Column {
    Column {
        joint,
        effect,
        part,
        shape,
    }
}

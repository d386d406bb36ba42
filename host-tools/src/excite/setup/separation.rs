//! Two effects as columns that a motion is to tell apart.

use nalgebra::DMatrix;
use proprio_core::effect::{EffectKind, Form};
use proprio_core::inertia::INERTIAL;

use super::Design;
use super::knowledge::column;
use crate::excite::ExciteError;
use crate::excite::columns::{Column, is_known};
use crate::excite::cost::Cost;
use crate::excite::limb::Limb;
use crate::excite::space::Space;
use crate::model::BASE;

/// How much wider than its prior the size of a wrong effect may be.
const WRONG_SIZE: f64 = 3.0;
/// Shapes at which a wrong effect is tried, as multiples of the shape that the prior expects.
const WRONG_SHAPES: [f64; 3] = [0.5, 1.0, 2.0];

/// Entries of a combination of parameters.
type Direction = Vec<(usize, f64)>;

impl Design<'_> {
    /// Columns, scale and cost of a design that tells two effects apart.
    pub(super) fn separation(
        &self,
        pair: [EffectKind; 2],
        joint: Option<&str>,
        body: &dyn Limb,
        theta: &[f64],
    ) -> Result<(Vec<Column>, DMatrix<f64>, Cost), ExciteError> {
        for effect in pair {
            if !is_known(effect) && effect.description().form != Form::Inertia {
                return Err(ExciteError::NotDesignable(effect.name()));
            }
        }
        let joints: Vec<usize> = match joint {
            Some(name) => vec![self.model.robot().joint(name)?],
            None => self.limb.bodies.clone().collect(),
        };
        let joints: Vec<usize> = joints
            .into_iter()
            .filter(|joint| *joint != BASE && self.limb.bodies.contains(joint))
            .map(|joint| joint - self.limb.bodies.start)
            .collect();
        let mut columns = self.effect_columns();
        columns.retain(|c| !(joints.contains(&c.joint) && pair.contains(&c.effect)));
        let root = self.prior(&columns)?;
        let nuisance = Space::new(body, theta, &columns, &root);
        // Each effect of each pair as one true version and the wrong ones that are to be told from it.
        let mut added: Vec<Direction> = Vec::new();
        let mut pairs = Vec::new();
        for &j in &joints {
            let own: [(usize, Vec<usize>); 2] = pair.map(|effect| {
                let first = nuisance.rank() + added.len();
                let directions = self.directions(effect, j, &mut columns, theta);
                let wrong = (first + 1..first + directions.len()).collect();
                added.extend(directions);
                (first, wrong)
            });
            pairs.push((own[0].0, own[1].1.clone()));
            pairs.push((own[1].0, own[0].1.clone()));
        }
        let (p, r) = (INERTIAL * body.joints(), nuisance.rank());
        let mut scale = DMatrix::zeros(p + columns.len(), r + added.len());
        scale
            .view_mut((0, 0), (nuisance.scale.nrows(), r))
            .copy_from(&nuisance.scale);
        for (n, direction) in added.iter().enumerate() {
            for &(entry, value) in direction {
                scale[(entry, r + n)] = value;
            }
        }
        Ok((columns, scale, Cost::Separation { nuisance: r, pairs }))
    }

    /// Combinations of parameters, the true version first.
    fn directions(
        &self,
        effect: EffectKind,
        j: usize,
        columns: &mut Vec<Column>,
        theta: &[f64],
    ) -> Vec<Direction> {
        let joint = self.limb.bodies.start + j;
        let p = INERTIAL * self.limb.bodies.len();
        let prior = self.model.effect_prior(effect, joint).prior;
        if effect.description().form == Form::Inertia {
            return payload(j, theta, prior.std);
        }
        let shape = effect.description().shapes().next();
        let usual = shape.map_or(1.0, |n| {
            self.model.robot().parameter_prior(effect, joint, n).mean
        });
        let shapes: &[f64] = if shape.is_some() {
            &WRONG_SHAPES
        } else {
            &[1.0]
        };
        let parts = effect.columns().max(1);
        let mut directions = Vec::new();
        let mut add = |column: Column, size: f64| {
            columns.push(column);
            directions.push(vec![(p + columns.len() - 1, size)]);
        };
        add(column(effect, j, 0, usual), prior.std);
        for part in 0..parts {
            for shape in shapes {
                add(
                    column(effect, j, part, usual * shape),
                    WRONG_SIZE * prior.std,
                );
            }
        }
        directions
    }
}

/// A load of `mass` at the body's centre of mass; and as a wrong version any mass and first moment, the inertia being small.
fn payload(j: usize, theta: &[f64], mass: f64) -> Vec<Direction> {
    let own = &theta[INERTIAL * j..INERTIAL * (j + 1)];
    let c = [1, 2, 3].map(|k| own[k] / own[0].max(1e-9));
    let square = c.iter().map(|x| x * x).sum::<f64>();
    let at = |k: usize| INERTIAL * j + k;
    let mut load = vec![(at(0), mass)];
    load.extend((0..3).map(|k| (at(1 + k), mass * c[k])));
    let diagonal = [4, 7, 9];
    load.extend((0..3).map(|k| (at(diagonal[k]), mass * (square - c[k] * c[k]))));
    load.extend([
        (at(5), -mass * c[0] * c[1]),
        (at(6), -mass * c[0] * c[2]),
        (at(8), -mass * c[1] * c[2]),
    ]);
    let far = square.sqrt().max(0.05);
    let mut all = vec![load, vec![(at(0), WRONG_SIZE * mass)]];
    all.extend((0..3).map(|k| vec![(at(1 + k), WRONG_SIZE * mass * far)]));
    all.extend(diagonal.map(|k| vec![(at(k), WRONG_SIZE * mass * far * far)]));
    all
}

//! What a model of a walking robot may lack: an effect at a joint or at like joints, a load on a body.

use nalgebra::{DMatrix, DVector};
use proprio_core::go2::{JOINT_NAMES, JOINTS, JOINTS_PER_LEG};
use proprio_core::inertia::INERTIAL;

use crate::estimate::bounded::triangle;
use crate::free_base::data::Data;
use crate::free_base::fit::{Fit, stack};
use crate::free_base::rows::{BODIES, COLUMNS, EFFECTS};
use crate::free_base::structure::{ModelStructure, effect_column};

/// What a load has: a mass, its place, and one more for its size.
const LOAD_FREEDOM: f64 = 5.0;

/// A change of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Candidate {
    /// One of [`EFFECTS`] at these joints.
    Effect { effect: usize, joints: Vec<usize> },
    /// A load on this body, counted from the base.
    Load { body: usize },
}

impl Candidate {
    /// All that a model does not have: each effect at each joint, at like joints and at all; a load on each body.
    pub(super) fn all(structure: &ModelStructure) -> Vec<Self> {
        let mut all = Vec::new();
        for effect in 0..EFFECTS.len() {
            let lacks = |j: &usize| !structure.effects[*j][effect];
            let lacking: Vec<usize> = (0..JOINTS).filter(lacks).collect();
            let kinds = (0..JOINTS_PER_LEG).map(|kind| {
                let like = lacking.iter().filter(|j| *j % JOINTS_PER_LEG == kind);
                like.copied().collect::<Vec<usize>>()
            });
            let mut families: Vec<_> = kinds.filter(|like| like.len() > 1).collect();
            if families.len() > 1 {
                families.push(lacking.clone());
            }
            let singles = lacking.iter().map(|j| vec![*j]);
            let joints = families.into_iter().chain(singles);
            all.extend(joints.map(|joints| Self::Effect { effect, joints }));
        }
        let unloaded = (0..BODIES).filter(|b| !structure.bodies[*b].loaded);
        all.extend(unloaded.map(|body| Self::Load { body }));
        all
    }

    /// The model with it.
    pub(super) fn added_to(&self, structure: &ModelStructure) -> ModelStructure {
        match self {
            Self::Effect { effect, joints } => structure.clone().with_effect(*effect, joints, true),
            Self::Load { body } => structure.clone().with_load(*body, true),
        }
    }

    /// The model without it.
    pub(super) fn taken_from(&self, structure: &ModelStructure) -> ModelStructure {
        match self {
            Self::Effect { effect, joints } => {
                structure.clone().with_effect(*effect, joints, false)
            }
            Self::Load { body } => structure.clone().with_load(*body, false),
        }
    }

    /// As the catalogue calls it.
    pub(super) fn effect(&self) -> &'static str {
        match self {
            Self::Effect { effect, .. } => EFFECTS[*effect].name(),
            Self::Load { .. } => proprio_core::effect::EffectKind::Payload.name(),
        }
    }

    /// Where: joints, or the body that a joint moves; `base` is the trunk.
    pub(super) fn places(&self) -> Vec<String> {
        match self {
            Self::Effect { joints, .. } => {
                joints.iter().map(|j| JOINT_NAMES[*j].to_owned()).collect()
            }
            Self::Load { body: 0 } => vec!["base".to_owned()],
            Self::Load { body } => vec![JOINT_NAMES[body - 1].to_owned()],
        }
    }

    /// Its degrees of freedom.
    pub(super) fn freedom(&self) -> f64 {
        match self {
            Self::Effect { joints, .. } => joints.len() as f64,
            Self::Load { .. } => LOAD_FREEDOM,
        }
    }

    /// Whether it is at several joints.
    pub(super) fn is_family(&self) -> bool {
        matches!(self, Self::Effect { joints, .. } if joints.len() > 1)
    }

    /// Whether it is another's effect, at some of its joints.
    pub(super) fn is_part_of(&self, other: &Self) -> bool {
        match (self, other) {
            (
                Self::Effect { effect, joints },
                Self::Effect {
                    effect: of,
                    joints: more,
                },
            ) => effect == of && joints.iter().all(|j| more.contains(j)),
            _ => self == other,
        }
    }

    /// Its columns among those of [`Screen`].
    fn columns(&self) -> Vec<usize> {
        match self {
            Self::Effect { effect, joints } => {
                joints.iter().map(|j| effect_column(*j, *effect)).collect()
            }
            Self::Load { body } => (0..INERTIAL)
                .map(|k| COLUMNS + INERTIAL * body + k)
                .collect(),
        }
    }
}

/// What each candidate would take away of a fit's cost, to first order, without fitting any of them: the columns of all candidates
/// after those of the fit in one triangle.
pub(super) struct Screen {
    /// What is left of the candidates' columns and of the residual, beyond what the fit's own columns explain.
    left: DMatrix<f64>,
    /// Where a column is in `left`.
    place: Vec<Option<usize>>,
    /// Priors of the candidates' columns.
    prior: DMatrix<f64>,
}

impl Screen {
    /// Of a fit of `structure`; none if numbers overflow.
    pub(super) fn of(data: &Data, structure: &ModelStructure, fit: &Fit) -> Option<Self> {
        let theta = fit.theta();
        let (prior, target) = fit.problem.without_data().expanded(theta)?;
        let rows = &fit.problem.data;
        let residual = rows.column(COLUMNS) - rows.columns(0, COLUMNS) * theta;
        let has = |k: usize| {
            let effect = k
                .checked_sub(effect_column(0, 0))
                .filter(|k| *k < EFFECTS.len() * JOINTS);
            let there =
                effect.is_none_or(|k| structure.effects[k / EFFECTS.len()][k % EFFECTS.len()]);
            there && !fit.solution.held[k]
        };
        let own: Vec<usize> = (0..COLUMNS).filter(|k| has(*k)).collect();
        let lacking = (effect_column(0, 0)..effect_column(JOINTS, 0)).filter(|k| {
            let k = k - effect_column(0, 0);
            !structure.effects[k / EFFECTS.len()][k % EFFECTS.len()]
        });
        let loads = COLUMNS..COLUMNS + INERTIAL * BODIES;
        let candidates: Vec<usize> = lacking.chain(loads).collect();
        let column = |k: usize| if k < COLUMNS { k } else { k - COLUMNS };
        let width = own.len() + candidates.len() + 1;
        let mut all = DMatrix::zeros(rows.nrows() + prior.nrows(), width);
        for (to, k) in own.iter().enumerate() {
            all.view_mut((0, to), (rows.nrows(), 1))
                .copy_from(&rows.column(*k));
            all.view_mut((rows.nrows(), to), (prior.nrows(), 1))
                .copy_from(&prior.column(*k));
        }
        for (n, k) in candidates.iter().enumerate() {
            let to = own.len() + n;
            all.view_mut((0, to), (rows.nrows(), 1))
                .copy_from(&rows.column(column(*k)));
        }
        let mut right = all.column_mut(width - 1);
        right.rows_mut(0, rows.nrows()).copy_from(&residual);
        right
            .rows_mut(rows.nrows(), prior.nrows())
            .copy_from(&(target - &prior * theta));
        let triangle = triangle(all);
        let size = width - own.len();
        let mut place = vec![None; COLUMNS + INERTIAL * BODIES];
        candidates
            .iter()
            .enumerate()
            .for_each(|(n, k)| place[*k] = Some(n));
        Some(Self {
            left: triangle
                .view((own.len(), own.len()), (size, size))
                .into_owned(),
            place,
            prior: prior_of(data, structure, fit),
        })
    }

    /// What a candidate takes away, in units of the noise.
    pub(super) fn gain(&self, candidate: &Candidate) -> f64 {
        let columns = candidate.columns();
        let Some(places) = columns
            .iter()
            .map(|k| self.place[*k])
            .collect::<Option<Vec<_>>>()
        else {
            return 0.0;
        };
        let n = places.len();
        let mut rows = DMatrix::zeros(self.left.nrows(), n + 1);
        for (to, at) in places.iter().enumerate() {
            rows.set_column(to, &self.left.column(*at));
        }
        rows.set_column(n, &self.left.column(self.left.ncols() - 1));
        let mut prior = DMatrix::zeros(self.prior.nrows(), n + 1);
        for (to, k) in columns.iter().enumerate() {
            prior.set_column(to, &self.prior.column(*k));
        }
        let solved = triangle(stack(&rows, &prior));
        solved.column(n).rows(0, n).norm_squared()
    }
}

/// Priors of all columns that a candidate may add: effects' as the catalogue says, loads' as wide as a body with a load is known.
fn prior_of(data: &Data, structure: &ModelStructure, fit: &Fit) -> DMatrix<f64> {
    let mut whole = structure.clone();
    whole.effects = [[true; EFFECTS.len()]; JOINTS];
    whole.bodies.iter_mut().for_each(|body| body.loaded = true);
    let wide = data
        .problem(&whole, fit.noise)
        .prior_information(&fit.problem.start());
    let mut prior = DMatrix::zeros(COLUMNS, COLUMNS + INERTIAL * BODIES);
    prior.columns_mut(0, COLUMNS).copy_from(&wide);
    let bodies = wide.columns(0, INERTIAL * BODIES);
    prior
        .columns_mut(COLUMNS, INERTIAL * BODIES)
        .copy_from(&bodies);
    prior.columns_mut(0, INERTIAL * BODIES).fill(0.0);
    prior
}

/// A combination of a fit's parameters.
pub(super) fn combination(entries: &[(usize, f64)]) -> DVector<f64> {
    let mut combination = DVector::zeros(COLUMNS);
    entries.iter().for_each(|(k, x)| combination[*k] = *x);
    combination
}

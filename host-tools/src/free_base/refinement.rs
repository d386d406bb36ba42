//! Rows that are made near the fit, and without the windows that no model explains.

use std::sync::Arc;

use nalgebra::DVector;

use super::columns::EffectSite;
use super::data::{Data, Readings, Sum, windows_of_all};
use super::doubtful;
use super::error::FreeBaseError;
use super::outside::{self, Squares};
use super::row_setup::RowSetup;
use super::stance::Stance;
use super::structure::ModelStructure;
use super::unseen;
use super::walk::Walk;
use super::walks::Walks;

/// Fits at most that tell which windows are outside: the first is spoilt by these.
const ROUNDS: usize = 3;

impl Data {
    /// The rows, and the structure with as much of its prior as they do not refute (`doubtful`).
    pub(crate) fn believed(
        walks: &Walks,
        structure: ModelStructure,
        candidates: &[EffectSite],
    ) -> Result<(Self, ModelStructure), FreeBaseError> {
        let data = Self::of(walks, &structure, candidates)?;
        match doubtful::refuted(&structure, data.columns(), data.made_at()) {
            None => Ok((data, structure)),
            // From where the first fit ends: a turn of 90° is no small one, and each fit takes it by its derivative where the rows were made.
            Some(open) => Ok((Self::begun_at(walks, &open, candidates, Some(&data))?, open)),
        }
    }

    /// Makes the rows twice: the sensors' columns are derivatives, at first at the model's masses, then at the fit of
    /// `structure`, or of that with all `candidates` beside it that are torques of joints. Again where that fit leaves far more of some windows than of
    /// others: these spoilt it, and are left out. The rows have columns of all candidates: what sensors get wrong is a derivative at these, so that
    /// commands that name a model's error need the same candidates.
    pub(crate) fn of(
        walks: &Walks,
        structure: &ModelStructure,
        candidates: &[EffectSite],
    ) -> Result<Self, FreeBaseError> {
        Self::begun_at(walks, structure, candidates, None)
    }

    /// The same, begun at the parameters that other rows of these walks are made at.
    fn begun_at(
        walks: &Walks,
        structure: &ModelStructure,
        candidates: &[EffectSite],
        others: Option<&Self>,
    ) -> Result<Self, FreeBaseError> {
        let torques = candidates.iter().filter(|site| site.is_torque()).cloned();
        let sites = structure.effects.iter().cloned().chain(torques).collect();
        let judged = Arc::new(structure.columns_of(sites));
        let mut setup = match others {
            Some(others) => others.setup_with(&judged),
            None => RowSetup::cad(judged.clone()),
        };
        // Which samples are a window's no parameter tells.
        let windows = windows_of_all(walks, &setup);
        let mut outside = vec![Vec::new(); walks.walks.len()];
        let mut parts = None;
        for _ in 0..ROUNDS {
            let readings = Readings::of(walks, windows.clone(), &setup);
            let data = Self::made(walks, setup, outside.clone(), readings)?;
            let (theta, thetas) = match candidates {
                [] => {
                    let fit = data.fit(structure).ok_or(FreeBaseError::Unsolvable)?;
                    // Rows that were made at another fit are much the same.
                    parts = data.held_out_from(structure, parts.as_deref().unwrap_or_default());
                    let thetas = parts.iter().flatten().map(|part| part.theta.clone());
                    (fit.theta().clone(), thetas.collect())
                }
                _ => {
                    let others = data.parts.iter().map(|part| &part.others);
                    let sums: Vec<&Sum> = std::iter::once(&data.all).chain(others).collect();
                    let thetas = data.with_all(structure, &sums);
                    let mut thetas = thetas.ok_or(FreeBaseError::Unsolvable)?;
                    (thetas.remove(0), thetas)
                }
            };
            let thetas: Vec<&DVector<f64>> = match &thetas[..] {
                [] => vec![&theta],
                parts => parts.iter().collect(),
            };
            let before = std::mem::replace(&mut outside, data.windows_outside(walks, &thetas));
            setup = RowSetup::at(judged.clone(), theta);
            if outside == before {
                break;
            }
        }
        if !candidates.is_empty() {
            let sites = structure.effects.iter().chain(candidates).cloned();
            setup = setup.with_columns(structure.columns_of(sites.collect()));
        }
        let readings = Readings::of(walks, windows, &setup);
        let mut data = Self::made(walks, setup, outside, readings)?;
        if data.windows.outside > 0 {
            let fit = data.fit(structure).ok_or(FreeBaseError::Unsolvable)?;
            let setup = data.setup_at(fit.theta().clone());
            data.unseen = unseen::feet(walks, &setup, &data.outside);
        }
        Ok(data)
    }

    /// When the windows begin that are outside by a fit for each part of the time, to all but this part, or by one for all: log after log, µs in order.
    fn windows_outside(&self, walks: &Walks, thetas: &[&DVector<f64>]) -> Vec<Vec<u64>> {
        let of = |(n, (walk, stance)): (usize, &(Walk, Stance))| {
            let theta = |start: f64| self.of_the_part((n, start), walk, thetas);
            let asked = |k: usize| thetas.iter().any(|theta| theta[k] != 0.0);
            outside::squares(walk, stance, self.linearised(n), asked, theta)
        };
        let left: Vec<Vec<Squares>> = walks.walks.iter().enumerate().map(of).collect();
        outside::windows(&left)
    }
}

//! From logs to blocks, for any robot on a fixed base: a log of any length in the memory of a part of it.
//!
//! Each part of a log is fitted with the four effects of a plain drive first, for its weights alone: how its noise is correlated from window to window,
//! and which windows are in doubt where a joint turns round ([`crate::estimate`]). The rows of all kept columns are then folded with them.

use std::path::Path;
use std::sync::Arc;

use proprio_core::effect::EffectKind;

use super::block::Block;
use super::columns::{BlockColumns, KeptColumn, cad_hash, has_column, is_kept, name_of};
use crate::equation::column::{Column, Columns};
use crate::equation::motion::WINDOW;
use crate::equation::values::{Place, Values};
use crate::estimate::factor::HeapFactor;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::log::{LogError, sha256};
use crate::model::{Limb, Model};
use crate::parallel::side_by_side;
use crate::parameter::INERTIAL_NAMES;
use crate::recording::{LimbRecording, Recording, RecordingError, SHORTEST_SLAB, Slab};

/// Length of a block unless another is asked for, s.
pub const BLOCK: f64 = 600.0;

/// Whose log it is, and when.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Origin {
    /// The robot.
    pub robot: String,
    /// Where it stands.
    pub site: Option<String>,
    /// Its firmware.
    pub firmware: Option<String>,
    /// Unix time of the log's first row, s; by the log's own clock if `None`.
    pub begin: Option<f64>,
    /// Unix time now, s.
    pub received: f64,
}

/// What a log gave.
#[derive(Debug, Clone, Default)]
pub struct Made {
    /// Its blocks, in order of time, limb and joint.
    pub blocks: Vec<Block>,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// A joint's block while it grows.
struct Growing {
    block: u64,
    limb: Limb,
    joint: usize,
    columns: Arc<BlockColumns>,
    factor: HeapFactor,
    /// Ends, µs since the log's start.
    ends: [u64; 2],
    /// Sum of temperatures and their number.
    temperature: (f64, f64),
}

/// The blocks of `block` seconds of a log of the robot of `model`. `progress` receives the bytes read and how many there are in all.
///
/// # Errors
/// [`RecordingError`] if the log is bad, or too short for a part of two seconds, or no joint moves.
pub fn blocks_of_log(
    log: &Path,
    model: &Model,
    (origin, block): (&Origin, f64),
    progress: impl FnMut(u64, u64),
) -> Result<Made, RecordingError> {
    let hash = sha256(log).map_err(|source| LogError::reading(log, source))?;
    let mut growing: Vec<Growing> = Vec::new();
    let mut each = |slab: Slab| grow(&mut growing, model, slab);
    let logs = [log.to_owned()];
    let (firsts, recording) = Recording::in_slabs(&logs, model, block, &mut each, progress)?;
    if growing.is_empty() {
        return Err(RecordingError::too_short(&recording, SHORTEST_SLAB));
    }
    let begin = origin.begin.or(firsts.first().copied()).unwrap_or(0.0);
    let hashes = growing.iter().map(|own| own.columns.hash());
    let hashes: Vec<Arc<str>> = hashes.map(Arc::from).collect();
    let told = growing.iter().zip(hashes);
    let told = told.filter(|(own, _)| own.factor.rows() > own.factor.columns() as f64);
    let blocks = told.map(|(own, columns_hash)| {
        let p = own.factor.columns();
        let windows = own.factor.rows();
        let (sum, count) = own.temperature;
        Block {
            robot: origin.robot.clone(),
            site: origin.site.clone(),
            firmware: origin.firmware.clone(),
            log: hash.clone(),
            t0: begin + 1e-6 * own.ends[0] as f64,
            t1: begin + 1e-6 * own.ends[1] as f64,
            received: origin.received,
            limb: own.limb.name.clone(),
            joint: own.columns.joints[own.joint].clone(),
            fold: 0,
            columns: own.columns.clone(),
            hash: columns_hash,
            windows,
            rms: own.factor.row(p)[0].abs() / windows.sqrt(),
            temperature: (count > 0.0).then(|| sum / count),
            factor: own.factor.numbers().iter().map(|x| *x as f32).collect(),
            crc32c: 0,
            program: concat!("proprio ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
        .sealed()
    });
    let blocks: Vec<Block> = blocks.collect();
    match blocks.is_empty() {
        true => Err(RecordingError::at_rest(&recording)),
        false => Ok(Made {
            blocks,
            warnings: recording.warnings,
        }),
    }
}

/// Folds a part of a log into the blocks that it belongs to.
fn grow(growing: &mut Vec<Growing>, model: &Model, slab: Slab) {
    // One block of time has one beginning, whichever samples a limb lacks.
    let all = slab.limbs.iter().map(|(_, samples)| ends(samples));
    let ends = all.fold([u64::MAX, 0], |[a, b], [c, d]| [a.min(c), b.max(d)]);
    let of = |(limb, samples): &(Limb, LimbRecording)| {
        Some((
            limb.clone(),
            temperatures(samples),
            factors(model, limb, samples)?,
        ))
    };
    let made: Vec<_> = side_by_side(&slab.limbs, of);
    for (limb, temperature, (columns, factors)) in made.into_iter().flatten() {
        for (joint, factor) in factors.into_iter().enumerate() {
            let known = growing
                .iter_mut()
                .rev()
                .find(|own| own.block == slab.block && own.limb == limb && own.joint == joint);
            match known {
                Some(own) => {
                    own.factor.merge(&factor);
                    own.ends[1] = ends[1];
                    own.temperature.0 += temperature[joint].0;
                    own.temperature.1 += temperature[joint].1;
                }
                None => growing.push(Growing {
                    block: slab.block,
                    limb: limb.clone(),
                    joint,
                    columns: columns.clone(),
                    factor,
                    ends,
                    temperature: temperature[joint],
                }),
            }
        }
    }
}

fn ends(samples: &LimbRecording) -> [u64; 2] {
    let ends = [samples.time_us.first(), samples.time_us.last()];
    ends.map(|end| end.copied().unwrap_or(0))
}

/// Of each joint the sum of its motor's temperatures, °C, and how many there are.
fn temperatures(samples: &LimbRecording) -> Vec<(f64, f64)> {
    let of = |j: usize| {
        let own = samples
            .temperature
            .iter()
            .skip(j)
            .step_by(samples.joints.max(1));
        let told = own.filter(|t| t.is_finite());
        told.fold((0.0, 0.0), |(sum, count), t| (sum + t, count + 1.0))
    };
    (0..samples.joints).map(of).collect()
}

/// A limb's kept columns and, of each joint, the factor of its rows; `None` if there is nothing to fit.
pub(crate) fn factors(
    model: &Model,
    limb: &Limb,
    samples: &LimbRecording,
) -> Option<(Arc<BlockColumns>, Vec<HeapFactor>)> {
    let data = LimbData::of(model, limb, samples)?;
    let joints = data.joints();
    let at = |kept: &dyn Fn(EffectKind) -> bool| -> Vec<Place> {
        let effects = EffectKind::ALL
            .iter()
            .copied()
            .filter(|effect| kept(*effect));
        effects
            .flat_map(|effect| (0..joints).map(move |j| (effect, j)))
            .collect()
    };
    let plain = at(&|effect| effect.description().is_plain());
    let fit = LimbFit::of(&data, &plain, &How::default())?;
    let values = Values::cad(model, limb);
    let own = kept_only(&data.columns(&values, &at(&is_kept), &[]));
    let rows = data.rows(&values, &own);
    let factors = fit.weights.together(&data, &own, &rows);
    Some((Arc::new(described(&data, &own, &fit)), factors))
}

/// Without the columns that are another kept effect's, and without those of an effect that no joint of the limb can have.
fn kept_only(columns: &Columns) -> Columns {
    let root = |joint: usize| (0..joint).all(|b| columns.subtree_end[b] <= joint);
    let is_own = |entry: &&crate::equation::column::Entry| match (entry.effect, entry.column) {
        (Some(_), Column::Coupled { joint, .. }) => !root(joint),
        (Some(effect), _) => has_column(effect, entry.parameter),
        (None, _) => false,
    };
    let entries = columns.entries.iter().filter(is_own).copied().collect();
    Columns::new(columns.subtree_end.clone(), entries)
}

/// What the columns are, with their priors.
fn described(data: &LimbData, columns: &Columns, fit: &LimbFit) -> BlockColumns {
    let (model, limb) = (data.model, data.limb);
    let joints = data.joint_names();
    // The bodies' prior is one of physical bodies; a column's part of it, as it looks from the CAD.
    let mut stated = fit.problem.without_data();
    stated.bodies = data.bodies_before();
    let prior = stated.solve();
    let std = prior.map(|prior| prior.std());
    let described = columns.entries.iter().enumerate().map(|(k, entry)| {
        let joint = &joints[entry.joint];
        let (name, unit, mean, std) = match entry.effect {
            None => {
                let body = &data.bodies_before()[entry.joint].0;
                let (name, unit) = INERTIAL_NAMES[entry.parameter];
                let std = std.as_ref().map_or(1.0, |std| std[k]);
                (
                    format!("{name}:{joint}"),
                    unit,
                    body.0[entry.parameter],
                    std,
                )
            }
            Some(effect) => {
                let (mean, std) = data.prior((effect, entry.joint), entry.parameter);
                let parameter = &effect.description().parameters[entry.parameter];
                // What a plain drive does not have is as likely on either side of nothing.
                let (mean, std) = match effect.description().is_plain() {
                    true => (mean, std),
                    false => (0.0, std.max(mean.abs())),
                };
                (
                    name_of(effect, entry.parameter, joint),
                    parameter.unit,
                    mean,
                    std,
                )
            }
        };
        let felt = (0..joints.len()).filter(|&j| columns.place(j, k).is_some());
        KeptColumn {
            name,
            unit: unit.to_owned(),
            mean: rounded(mean),
            std: rounded(std),
            joints: felt.collect(),
        }
    });
    BlockColumns {
        limb: limb.name.clone(),
        window_us: (1e6 * WINDOW).round() as u64,
        cad: cad_hash(model, limb),
        columns: described.collect(),
        joints,
    }
}

/// To six digits: the hash must not depend on a processor's last bits.
fn rounded(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

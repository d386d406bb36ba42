//! What a device told, and how it is printed.

use std::fmt;

use crate::device::names::{parameters_of, words_of};
use crate::estimate::{LEGEND, ParameterEstimate, effect_table, find};
use crate::factors::FactorsError;
use crate::table::{Table, with_std};
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::JointId;
use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::{
    self, Counters, DeviceMessage, Diagnosis, Estimate, Hello, LegCounters, Solution,
};
use serde::Serialize;

use super::effects::{self, Answer, Found};
use crate::command::Error;
use crate::device::Played;

/// What came back.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    board: String,
    firmware: String,
    scalar_bits: u8,
    load_unit: String,
    parameters: Vec<ParameterEstimate>,
    legs: Vec<LegReport>,
    /// What became of `--add` and `--drop`.
    changes: Vec<Answer>,
    /// What the device found of each effect at each joint, each joint's best first.
    diagnoses: Vec<Found>,
    counters: Counters,
    pub(super) warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct LegReport {
    leg: &'static str,
    /// Samples played.
    played: u32,
    /// Rows of the log that repeat the one before: not played, since a bus never says what it measured twice.
    repeated: u32,
    windows: u32,
    /// Least squares has a body that cannot exist or friction below zero: the parameters are the likeliest that can be.
    consistent: bool,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    noise: [f32; 3],
}

/// The last that the device told.
#[derive(Default)]
pub(super) struct Told {
    estimates: [Option<Estimate>; LEGS],
    diagnoses: Vec<Diagnosis>,
    pub(super) answers: Vec<wire::Answer>,
    /// What has changed on the way, in words.
    found: Vec<String>,
    counters: Counters,
}

impl Told {
    pub(super) fn hear(&mut self, message: DeviceMessage) {
        match message {
            DeviceMessage::Estimate(estimate) => {
                if let Some(slot) = self.estimates.get_mut(usize::from(estimate.leg)) {
                    *slot = Some(estimate);
                }
            }
            DeviceMessage::Counters(counters) => self.counters = counters,
            DeviceMessage::Diagnosis(diagnosis) => self.diagnoses.push(diagnosis),
            DeviceMessage::Answer(answer) => self.answers.push(answer),
            DeviceMessage::Change(change) => self.found.extend(words_of(&change)),
            // A log is replayed into a device of a robot that hangs.
            DeviceMessage::Hello(_)
            | DeviceMessage::Advanced(_)
            | DeviceMessage::FactorPart(_)
            | DeviceMessage::Walk(_) => {}
        }
    }
}

impl Report {
    pub(super) fn new(
        hello: &Hello,
        told: Told,
        legs: &[Leg],
        played: &[Played; LEGS],
        changes: Vec<Answer>,
        mut warnings: Vec<String>,
    ) -> Result<Self, Error> {
        let mut parameters = Vec::new();
        let mut reports = Vec::new();
        let found = told.found.iter();
        warnings.extend(found.map(|change| {
            format!("the leg changed on the way, and what it was before is forgotten: {change}")
        }));
        for &leg in legs {
            let counters = &told.counters.legs[leg.index()];
            let name = leg.name();
            let Played { samples, repeated } = played[leg.index()];
            let played = samples;
            let Some(estimate) = &told.estimates[leg.index()] else {
                return Err(Error::NoEstimate {
                    leg: name,
                    played,
                    samples: counters.samples,
                    windows: counters.windows,
                });
            };
            if counters.samples != played {
                let arrived = counters.samples;
                warnings.push(format!("leg {name}: {arrived} of {played} samples arrived"));
            }
            if counters.carried > 0 {
                let carried = counters.carried;
                warnings.push(format!(
                    "leg {name}: {carried} windows left out, in which the feet carried the robot"
                ));
            }
            let consistent = estimate.solution == Solution::Consistent;
            if consistent {
                warnings.push(format!(
                    "leg {name}: least squares alone gives an unphysical body or negative friction; these values are the physical solution"
                ));
            }
            let estimates = parameters_of(estimate, hello);
            parameters.extend(estimates.map_err(|source| FactorsError::Solve { leg, source })?);
            let (windows, noise) = (estimate.windows, estimate.noise);
            reports.push(LegReport {
                leg: name,
                played,
                repeated,
                windows,
                consistent,
                noise,
            });
        }
        Ok(Self {
            board: hello.board.to_string(),
            firmware: hello.firmware.to_string(),
            scalar_bits: hello.capacities.scalar_bits,
            load_unit: hello.load_unit.to_string(),
            parameters,
            legs: reports,
            changes,
            diagnoses: effects::found(&told.diagnoses, hello),
            counters: told.counters,
            warnings,
        })
    }
}

/// What one leg's counters are called and how to read them.
type Count = (&'static str, fn(&LegCounters) -> u32);
const COUNTS: [Count; 13] = [
    ("replies", |c| c.replies),
    ("bad CRC", |c| c.bad_crc),
    ("short", |c| c.short),
    ("unused", |c| c.unused_replies),
    ("incomplete", |c| c.incomplete),
    ("faults", |c| c.motor_faults + c.overheated),
    ("stuck", |c| c.stuck),
    ("surplus", |c| c.surplus),
    ("samples", |c| c.samples),
    ("late", |c| c.late),
    ("rejected", |c| c.rejected),
    ("gaps", |c| c.gaps),
    ("windows", |c| c.windows),
];

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            board,
            firmware,
            scalar_bits,
            ..
        } = self;
        writeln!(f, "{board}, firmware {firmware}, {scalar_bits}-bit:\n")?;
        let legs = || {
            self.legs
                .iter()
                .filter_map(|leg| Leg::from_name(leg.leg).map(|l| (l, leg)))
        };
        let rows = legs().flat_map(|(leg, report)| {
            let noise = report.noise.map(|noise| [format!("{noise:.4}")]);
            JointId::of(leg)
                .map(|joint| joint.name().to_owned())
                .into_iter()
                .zip(noise)
        });
        let rows: Vec<_> = rows.collect();
        writeln!(
            f,
            "{}{LEGEND}\n",
            effect_table(
                |name| find(&self.parameters, name),
                [["noise", "N m"]],
                &rows
            )
        )?;

        self.effects(f)?;
        let mut table = Table::default();
        let names = COUNTS.map(|(name, _)| name.to_owned());
        table.row(
            ["leg", "played", "repeated"]
                .map(String::from)
                .into_iter()
                .chain(names),
        );
        for (leg, report) in legs() {
            let counters = &self.counters.legs[leg.index()];
            let counts = COUNTS.map(|(_, count)| count(counters).to_string());
            let first = [
                report.leg.to_owned(),
                report.played.to_string(),
                report.repeated.to_string(),
            ];
            table.row(first.into_iter().chain(counts));
        }
        write!(f, "{table}")?;
        let load = &self.counters.load;
        if load.ticks > 0 {
            let (unit, mean) = (&self.load_unit, load.total / u64::from(load.ticks));
            let (worst, over) = (load.worst, load.over_budget);
            writeln!(
                f,
                "\n{unit} per tick: {mean} mean, {worst} worst; {over} of {} over budget",
                load.ticks
            )?;
        }
        Ok(())
    }
}

impl Report {
    /// What the device was asked, the effects it has beside the usual ones, and what it finds of all of them.
    fn effects(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.changes
            .iter()
            .try_for_each(|answer| write!(f, "{answer}"))?;
        let usual = |name: &str| EFFECTS.iter().any(|effect| name.starts_with(effect.name()));
        let added = self
            .parameters
            .iter()
            .filter(|p| !p.is_inertial() && !usual(&p.name));
        let mut table = Table::default();
        for parameter in added {
            let value = with_std(parameter.value, parameter.std);
            table.row([parameter.name.clone(), value, parameter.unit.to_owned()]);
        }
        write!(f, "{table}")?;
        if self.diagnoses.is_empty() {
            return Ok(());
        }
        let table = effects::table(&self.diagnoses);
        writeln!(
            f,
            "\nThe device finds, on data held out from the fit:\n\n{table}"
        )
    }
}

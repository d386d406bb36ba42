//! A moving robot's parameters on one screen.

use std::path::Path;

use super::{FreeBaseIdentification, Quantity, is_sensors};
use crate::catalogue;
use crate::estimate::{ParameterEstimate, Status};
use crate::identify::screen;
use crate::parameter;
use crate::summary::{Summary, torque, typed};
use crate::table::{RangeValue, Table, with_std};

impl FreeBaseIdentification {
    /// The first screen: the robot's mass, the error, the trunk, what every drive has. `file`: the model that was fitted; `written`: the file
    /// that has the values.
    pub fn summary(&self, file: Option<&Path>, written: Option<&Path>) -> Summary {
        let all: Vec<&ParameterEstimate> = self.parameters.iter().collect();
        let next = match written {
            Some(written) => screen::next_of_written(&all, written),
            None => format!("proprio diagnose --free-base {}", typed(&self.logs, file)),
        };
        let check = screen::check(written);
        let mut rows = self.quantity_rows();
        rows.extend(screen::drive_rows(&self.joints, |name| {
            self.parameter(name).map(RangeValue::from)
        }));
        let open = screen::not_identified(&all, &self.joints).unwrap_or_default();
        let points = vec![
            format!("{} {open}{check}", screen::bodies(&all)),
            self.sensors_in_words(),
            self.windows_in_words(),
        ];
        Summary {
            headline: self.first_line(),
            rows,
            points: points.into_iter().chain(self.formulas()).collect(),
            next: vec![next],
        }
    }

    /// The values of formulas, joint by joint.
    fn formulas(&self) -> Vec<String> {
        let own = self.effects.iter().map(|site| site.place);
        let own = own.filter(|(effect, _)| catalogue::formula_of(*effect).is_some());
        own.filter_map(|(effect, joint)| {
            let joint = self.joints.get(joint)?;
            let described = effect.description().parameters.iter().enumerate();
            let values = described.filter_map(|(n, described)| {
                let own = self.parameter(&parameter::of_effect(effect, n, joint))?;
                let value = with_std(own.value, own.std);
                Some(format!("{} = {value} {}", described.symbol, own.unit))
            });
            let values: Vec<String> = values.collect();
            Some(format!("{joint}, {}: {}", effect.name(), values.join(", ")))
        })
        .collect()
    }

    fn first_line(&self) -> String {
        let fitted = torque(self.rms);
        let error = match self.held_out_rms {
            Some(held_out) => format!(
                "Held-out error {} N m (fitted data {fitted}, ",
                torque(held_out)
            ),
            None => format!("Error {fitted} N m (fitted data, "),
        };
        let mass = self.quantities.iter().find(|q| q.name == "total_mass");
        let mass = mass.map_or_else(String::new, |mass| {
            format!(
                "Total mass {} kg (CAD {:.3}). ",
                with_std(mass.value, mass.std),
                mass.prior
            )
        });
        format!("{mass}{error}CAD {})", torque(self.yardsticks.cad_rms))
    }

    /// The trunk's mass and centre of mass (x, y, z), and the robot's, with the CAD's.
    fn quantity_rows(&self) -> Vec<String> {
        let mut table = Table::default();
        for (label, names, scale, unit) in [
            ("trunk mass", &["trunk_mass"][..], 1.0, "kg"),
            (
                "trunk CoM",
                &["trunk_com_x", "trunk_com_y", "trunk_com_z"],
                1e3,
                "mm",
            ),
            (
                "robot CoM",
                &["robot_com_x", "robot_com_y", "robot_com_z"],
                1e3,
                "mm",
            ),
        ] {
            let of = |name: &&str| self.quantities.iter().find(|q| q.name == *name);
            let found: Vec<&Quantity> = names.iter().filter_map(of).collect();
            let value = |q: &&Quantity| with_std(scale * q.value, scale * q.std);
            // A body's CAD is known to a gram and a millimetre, no better; adding 0 makes no number of -0.
            let decimals = if unit == "kg" { 3 } else { 0 };
            let cad = |q: &&Quantity| {
                let rounded = if unit == "kg" {
                    q.prior
                } else {
                    (scale * q.prior).round() + 0.0
                };
                format!("{rounded:.decimals$}")
            };
            let values: Vec<String> = found.iter().map(value).collect();
            let cads: Vec<String> = found.iter().map(cad).collect();
            table.row([
                label.to_owned(),
                format!("{} {unit}", values.join(", ")),
                format!("(CAD {})", cads.join(", ")),
            ]);
        }
        let text = table.to_string();
        text.lines().map(|line| format!("  {line}")).collect()
    }

    /// What the IMU gets wrong and the logs identify.
    fn sensors_in_words(&self) -> String {
        let sensors: Vec<&ParameterEstimate> =
            self.parameters.iter().filter(|p| is_sensors(p)).collect();
        let found = sensors.iter().filter(|p| p.status == Status::Identified);
        let found: Vec<String> = found
            .map(|p| format!("{} {} {}", p.name, with_std(p.value, p.std), p.unit))
            .collect();
        let rest = sensors.len() - found.len();
        match found.is_empty() {
            true => format!("Sensors: all {rest} parameters are prior-dominated or absent."),
            false => format!(
                "Sensors: {}; {rest} others are prior-dominated or absent.",
                found.join(", ")
            ),
        }
    }

    fn windows_in_words(&self) -> String {
        let w = &self.windows;
        let excluded = [
            (w.cut, "at touch-down or lift-off"),
            (w.impact, "at impacts"),
            (w.gap, "at gaps"),
            (w.still, "at rest"),
            (w.outside, "that no model explains"),
        ];
        let excluded = excluded.iter().filter(|(n, _)| *n > 0);
        let excluded: Vec<String> = excluded.map(|(n, what)| format!("{n} {what}")).collect();
        match excluded.is_empty() {
            true => format!("{} windows used.", w.used),
            false => format!(
                "{} windows used; excluded: {}.",
                w.used,
                excluded.join(", ")
            ),
        }
    }
}

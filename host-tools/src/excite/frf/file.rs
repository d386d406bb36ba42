//! A plan as rows to play, and read again.

use std::io::{self, Write};
use std::path::Path;

use super::FrfDesign;
use crate::excite::Command;
use crate::excite::output::CHANNELS;
use crate::log::{Need, read_numbers};
use crate::model::Model;
use crate::spectrum::{FrfError, even};

/// The excitation, a column per joint beside those of any motion.
const REFERENCE: &str = "ref";

/// Writes `t`, the columns of a motion, and `ref/` of each joint: what the torque holds beyond the feed-forward.
///
/// # Errors
/// Those of `out`.
pub fn write_frf_csv(out: &mut impl Write, design: &FrfDesign) -> io::Result<()> {
    write!(out, "t")?;
    for channel in CHANNELS.iter().chain([&REFERENCE]) {
        for joint in &design.names {
            write!(out, ",{channel}/{joint}")?;
        }
    }
    writeln!(out)?;
    let gains: String = [0, 1]
        .iter()
        .flat_map(|&of| design.gains.iter().map(move |gain| gain[of]))
        .map(|gain| format!(",{gain:.4}"))
        .collect();
    for (k, (command, reference)) in design.commands().enumerate() {
        write!(out, "{:.6}", k as f64 / design.rate)?;
        let Command { q, dq, ddq, tau } = &command;
        for value in [q, dq, ddq, tau].into_iter().flatten() {
            write!(out, ",{value:.7}")?;
        }
        write!(out, "{gains}")?;
        for value in &reference {
            write!(out, ",{value:.7}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A plan as it is played.
pub struct FrfPlan {
    /// Samples per second.
    pub rate: f64,
    /// Gains of each joint, N m/rad and N m s/rad.
    pub gains: Vec<[f64; 2]>,
    /// What to command, and the excitation.
    pub commands: Vec<(Command, Vec<f64>)>,
}

impl FrfPlan {
    /// Reads a plan of all joints of a model, in the model's order.
    ///
    /// # Errors
    /// [`FrfError::Columns`] if a joint has no columns or its gains change; [`FrfError::Uneven`].
    pub fn read(path: &Path, model: &Model) -> Result<Self, FrfError> {
        let wrong = |what: String| FrfError::Columns {
            path: path.to_owned(),
            what,
        };
        let bodies = model.robot().bodies();
        let n = bodies.len();
        let table = read_numbers(path, |names| -> Result<_, FrfError> {
            let mut wanted = vec!["t".to_owned()];
            for channel in CHANNELS.iter().chain([&REFERENCE]) {
                wanted.extend(bodies.iter().map(|body| format!("{channel}/{}", body.name)));
            }
            let place = |name: &String| {
                let found = names.iter().position(|own| own == name);
                let found = found.ok_or_else(|| {
                    wrong(format!(
                        "no column `{name}`: not a plan of `excite --frf` for this robot"
                    ))
                });
                Ok((found?, Need::Always))
            };
            wanted.iter().map(place).collect()
        })?;
        let dt = even(path, &table)?;
        let channel = |row: &[f64], c: usize| row[1 + c * n..1 + (c + 1) * n].to_vec();
        let gains_of = |row: &[f64]| -> Vec<[f64; 2]> {
            let (p, d) = (channel(row, 4), channel(row, 5));
            p.into_iter().zip(d).map(|(p, d)| [p, d]).collect()
        };
        let gains = table.rows().next().map(|row| gains_of(&row));
        let gains = gains.ok_or_else(|| wrong("no rows".to_owned()))?;
        if table.rows().any(|row| gains_of(&row) != gains) {
            return Err(wrong(
                "the gains `kp/`, `kd/` change along the plan".to_owned(),
            ));
        }
        let command = |row: Vec<f64>| {
            let command = Command {
                q: channel(&row, 0),
                dq: channel(&row, 1),
                ddq: channel(&row, 2),
                tau: channel(&row, 3),
            };
            (command, channel(&row, 6))
        };
        Ok(Self {
            rate: 1.0 / dt,
            gains,
            commands: table.rows().map(command).collect(),
        })
    }
}

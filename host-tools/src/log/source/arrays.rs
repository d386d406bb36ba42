//! Named arrays as a log: those of a NumPy archive, and those that a program holds in memory.

use std::path::Path;

use super::table::Table;
use super::{Fault, Source, Unit};
use crate::log::error::{LogError, Problem};

/// What arrays of a column per joint may be called, and what they hold.
const QUANTITIES: [(&str, &[&str]); 9] = [
    (
        "q",
        &[
            "q",
            "qpos",
            "position",
            "positions",
            "pos",
            "joint_positions",
        ],
    ),
    (
        "dq",
        &[
            "dq",
            "qd",
            "qvel",
            "velocity",
            "velocities",
            "vel",
            "joint_velocities",
        ],
    ),
    (
        "tau",
        &[
            "tau",
            "torque",
            "torques",
            "effort",
            "efforts",
            "joint_torques",
            "joint_efforts",
        ],
    ),
    ("temp", &["temp", "temperature", "temperatures"]),
    ("q_des", &["q_des", "q_cmd", "position_command"]),
    ("dq_des", &["dq_des", "dq_cmd", "velocity_command"]),
    ("tau_des", &["tau_des", "tau_cmd", "torque_command"]),
    ("kp", &["kp"]),
    ("kd", &["kd"]),
];

/// What the array of the joints' names may be called.
const NAMES: [&str; 4] = ["joint_names", "joints", "names", "joint_name"];

/// An array: how many numbers in each direction, and what it holds, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) holds: Holds,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Holds {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

/// The arrays as rows; `path` is what errors call them.
pub(super) fn open(path: &Path, arrays: Vec<(String, Array)>) -> Result<Box<dyn Source>, LogError> {
    match table(arrays) {
        Ok(table) => Ok(Box::new(table)),
        Err((name, problem)) => {
            let fault = Fault::at(1, 0, problem);
            let mut error = fault.error(path, Unit::Row, &[name]);
            error.place = None;
            Err(error)
        }
    }
}

/// The columns of the arrays, each called as a column of CSV is.
fn table(arrays: Vec<(String, Array)>) -> Result<Table, (String, Problem)> {
    let names = arrays.iter().find_map(|(name, array)| match &array.holds {
        Holds::Texts(names) if NAMES.contains(&&**name) => Some(names.clone()),
        _ => None,
    });
    let mut table = Table {
        names: Vec::new(),
        columns: Vec::new(),
        row: 0,
    };
    for (name, array) in arrays {
        let Holds::Numbers(numbers) = array.holds else {
            continue;
        };
        let (rows, columns) = match *array.shape {
            [rows] => (rows, 1),
            [rows, columns] | [rows, columns, 1] => (rows, columns),
            _ => continue,
        };
        match quantity(&name) {
            None if columns == 1 => {
                table.names.push(name);
                table.columns.push(numbers);
            }
            None => {}
            Some(quantity) => {
                let known = names.as_ref().filter(|names| names.len() == columns);
                let Some(joints) = known else {
                    let named = names.as_ref().map(Vec::len);
                    let problem = Problem::NoJointNames { columns, named };
                    return Err((name, problem));
                };
                for (n, joint) in joints.iter().enumerate() {
                    table.names.push(format!("{quantity}/{joint}"));
                    table
                        .columns
                        .push((0..rows).map(|row| numbers[row * columns + n]).collect());
                }
            }
        }
    }
    let rows = table.columns.first().map_or(0, Vec::len);
    match table.columns.iter().position(|column| column.len() != rows) {
        Some(n) => {
            let found = table.columns[n].len();
            let name = table.names[n].clone();
            let other = table.names[0].clone();
            Err((name, Problem::OtherLength { found, rows, other }))
        }
        None => Ok(table),
    }
}

fn quantity(array: &str) -> Option<&'static str> {
    let found = QUANTITIES.iter().find(|(_, names)| names.contains(&array));
    found.map(|(quantity, _)| *quantity)
}

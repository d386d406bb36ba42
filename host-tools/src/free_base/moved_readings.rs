//! Columns of what moves the readings: what an equation leaves if the readings are moved a little, less what it leaves as they are.
//! So rows are made at parameters near the fit's (`refinement`).

use super::columns::SENSORS;
use super::residual::{impulses, residuals};
use super::row_setup::RowSetup;
use super::sensors::{MOVED, Sensors, offsets};
use super::stance::Stance;
use super::walk::Walk;
use super::windows::WindowSamples;
use crate::parallel::side_by_side;

/// How far readings are moved for a column: far beyond rounding, and too little to be felt.
const STEP: [f64; SENSORS - MOVED] = [
    1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4,
];

/// The same of an encoder, rad.
const OFFSET_STEP: f64 = 1e-4;

/// What each equation leaves if the readings are moved: of each column that is a difference, window by window.
#[derive(Default)]
pub(super) struct MovedReadings {
    /// When the windows begin, µs in order.
    starts: Vec<u64>,
    /// The columns' numbers, and what they have in each of the windows.
    columns: Vec<(usize, Vec<Vec<f64>>)>,
}

impl MovedReadings {
    /// Of these windows, at the parameters that rows are made at.
    pub(super) fn of(
        walk: &Walk,
        stance: &Stance,
        setup: &RowSetup,
        windows: &[WindowSamples],
    ) -> Self {
        let at = &setup.sensors;
        let acc = setup.columns.acc();
        let sensors = (MOVED..SENSORS).map(|k| {
            let mut moved = at.clone();
            moved.values[k] += STEP[k - MOVED];
            (acc + k, STEP[k - MOVED], moved)
        });
        let encoders = offsets(&setup.columns).map(|(k, joint)| {
            let mut moved = at.clone();
            moved.offsets[joint] += OFFSET_STEP;
            (k, OFFSET_STEP, moved)
        });
        let all: Vec<(usize, f64, Sensors)> = sensors.chain(encoders).collect();
        let of_effects = |sensors: &Sensors| impulses(walk, stance, setup, sensors, windows);
        let effects = of_effects(at);
        let left = |sensors: &Sensors| {
            // What effects see changes with the joints' readings alone.
            let own = sensors.moves_joints(at).then(|| of_effects(sensors));
            let effects = own.as_ref().unwrap_or(&effects);
            residuals(walk, stance, setup, sensors, (windows, effects))
        };
        let as_read = left(at);
        let column = |(column, step, sensors): &(usize, f64, Sensors)| {
            let moved = left(sensors).into_iter().zip(&as_read);
            let slope = |(there, here): (Vec<f64>, &Vec<f64>)| {
                let both = there.iter().zip(here);
                both.map(|(there, here)| (there - here) / step).collect()
            };
            (*column, moved.map(slope).collect())
        };
        Self {
            starts: windows.iter().map(|window| window.start_us).collect(),
            columns: side_by_side(&all, column),
        }
    }

    /// The columns of the equations of a window that began then, each with its number; nothing without any readings moved.
    pub(super) fn columns(&self, start_us: u64) -> impl Iterator<Item = (usize, &Vec<f64>)> {
        let at = self.starts.binary_search(&start_us);
        let all = self.columns.iter();
        all.filter_map(move |(column, windows)| Some((*column, &windows[at.ok()?])))
    }
}

//! What the rows of a walk are made at: their columns, and parameters of the bodies and of the sensors.

use std::sync::Arc;

use nalgebra::DVector;
use proprio_core::inertia::INERTIAL;

use super::columns::WalkColumns;
use super::sensors::Sensors;
use crate::equation::free_tree::FreeTree;
use crate::estimate::bounded::body;

/// What the rows are made at: columns of what sensors get wrong are derivatives at these parameters.
#[derive(Clone)]
pub(super) struct RowSetup {
    pub(super) columns: Arc<WalkColumns>,
    pub(super) tree: FreeTree,
    pub(super) sensors: Sensors,
    /// All parameters.
    pub(super) theta: DVector<f64>,
}

impl RowSetup {
    /// At the CAD's bodies, without any effect, with sensors that are right.
    pub(super) fn cad(columns: Arc<WalkColumns>) -> Self {
        let mut theta = DVector::zeros(columns.len());
        for (b, body) in columns.robot.tree.bodies().iter().enumerate() {
            theta
                .rows_mut(INERTIAL * b, INERTIAL)
                .copy_from(&body.inertia.0);
        }
        Self::at(columns, theta)
    }

    /// At these parameters.
    pub(super) fn at(columns: Arc<WalkColumns>, theta: DVector<f64>) -> Self {
        let bodies = (0..columns.robot.bodies()).map(|b| body(&theta, b));
        Self {
            tree: columns.robot.tree.with_inertia(bodies),
            sensors: Sensors::of(&theta, &columns),
            columns,
            theta,
        }
    }

    /// The same with other columns of effects, none of which has a value beyond those that are known.
    pub(super) fn with_columns(&self, columns: WalkColumns) -> Self {
        let mut theta = DVector::zeros(columns.len());
        let fixed = columns.fixed();
        theta
            .rows_mut(0, fixed)
            .copy_from(&self.theta.rows(0, fixed));
        for (k, n, linear) in columns.effects() {
            let known = self.columns.effects().find(|(_, own, known)| {
                self.columns.sites[*own].place == columns.sites[n].place
                    && known.parameter == linear.parameter
            });
            theta[k] = known.map_or(0.0, |(k, ..)| self.theta[k]);
        }
        Self::at(Arc::new(columns), theta)
    }
}

//! Reads the reference dynamics that Pinocchio computed (`tests/oracle`).
//!
//! `tests/oracle/README.md` says which systems, fields, units and conventions there are. A [`State`] hands out its
//! fields by name, as slices or as matrices whose shape is checked against the manifest.
//!
//! ```
//! use proprio_tests::oracle::Oracle;
//!
//! let leg = Oracle::load("leg").unwrap();
//! for state in leg.states() {
//!     let w = state.matrix::<3, 30>("W_torque");
//!     assert!((w * leg.theta_vector::<30>() - state.vector::<3>("tau")).amax() < 1e-12);
//! }
//! ```

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{SMatrix, SVector};
use serde::Deserialize;

/// All reference states of one system.
#[derive(Debug)]
pub struct Oracle {
    name: String,
    system: System,
    tables: Vec<Vec<f64>>,
}

/// What the manifest says of one system.
#[derive(Debug, Deserialize)]
struct System {
    bodies: Vec<String>,
    velocities: usize,
    theta: Vec<f64>,
    states: usize,
    tables: Vec<Table>,
}

/// A file of equal records; record i belongs to state i.
#[derive(Debug, Deserialize)]
struct Table {
    file: PathBuf,
    records: usize,
    fields: Vec<Field>,
}

#[derive(Debug, Deserialize)]
struct Field {
    name: String,
    shape: Vec<usize>,
}

impl Table {
    fn stride(&self) -> usize {
        self.fields.iter().map(Field::len).sum()
    }
}

impl Field {
    fn len(&self) -> usize {
        self.shape.iter().product()
    }
}

/// The reference data is absent or does not fit its manifest.
#[derive(Debug)]
pub struct LoadError {
    path: PathBuf,
    problem: String,
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, problem } = self;
        write!(
            f,
            "{}: {problem} (tests/oracle/README.md says how to make it)",
            path.display()
        )
    }
}

impl std::error::Error for LoadError {}

impl Oracle {
    /// Loads the system called `leg`, `pinned` or `free`.
    pub fn load(name: &str) -> Result<Self, LoadError> {
        Self::load_from(&Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle"), name)
    }

    fn load_from(folder: &Path, name: &str) -> Result<Self, LoadError> {
        #[derive(Deserialize)]
        struct Manifest {
            systems: std::collections::BTreeMap<String, System>,
        }

        let path = folder.join("manifest.json");
        let manifest: Manifest =
            serde_json::from_slice(&read(&path)?).map_err(|error| LoadError {
                path: path.clone(),
                problem: error.to_string(),
            })?;
        let known: Vec<_> = manifest.systems.keys().cloned().collect();
        let system = { manifest.systems }.remove(name).ok_or_else(|| LoadError {
            path,
            problem: format!("no system {name} in {known:?}"),
        })?;
        let tables = system
            .tables
            .iter()
            .map(|table| read_table(folder, table))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            name: name.into(),
            system,
            tables,
        })
    }

    /// Names of the bodies, in the order of their parameter blocks.
    pub fn bodies(&self) -> &[String] {
        &self.system.bodies
    }

    /// The number of generalized velocities, n.
    pub fn velocities(&self) -> usize {
        self.system.velocities
    }

    /// The nominal inertial parameters, ten per body.
    pub fn theta(&self) -> &[f64] {
        &self.system.theta
    }

    /// [`Self::theta`] as a vector. Panics if its length is not `P`.
    pub fn theta_vector<const P: usize>(&self) -> SVector<f64, P> {
        assert_eq!(self.theta().len(), P, "θ of {}", self.name);
        SVector::from_column_slice(self.theta())
    }

    /// All states, in order.
    pub fn states(&self) -> impl ExactSizeIterator<Item = State<'_>> {
        (0..self.system.states).map(|index| State {
            oracle: self,
            index,
        })
    }
}

fn read(path: &Path) -> Result<Vec<u8>, LoadError> {
    fs::read(path).map_err(|error| LoadError {
        path: path.into(),
        problem: error.to_string(),
    })
}

fn read_table(folder: &Path, table: &Table) -> Result<Vec<f64>, LoadError> {
    let path = folder.join(&table.file);
    let bytes = read(&path)?;
    let expected = 8 * table.records * table.stride();
    if bytes.len() != expected {
        let problem = format!("{} bytes, the manifest says {expected}", bytes.len());
        return Err(LoadError { path, problem });
    }
    let (values, _) = bytes.as_chunks::<8>();
    Ok(values
        .iter()
        .map(|&value| f64::from_le_bytes(value))
        .collect())
}

/// One state: a random motion and what Pinocchio computed for it.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    oracle: &'a Oracle,
    index: usize,
}

impl<'a> State<'a> {
    /// The state's number, from 0.
    pub fn index(&self) -> usize {
        self.index
    }

    /// The values and the shape of a field, or `None` where this state does not hold it (whole regressors of the
    /// large systems are kept for the first states only). Matrices are row-major.
    pub fn get(&self, name: &str) -> Option<(&'a [f64], &'a [usize])> {
        let Oracle { system, tables, .. } = self.oracle;
        for (table, values) in system.tables.iter().zip(tables) {
            let mut start = self.index * table.stride();
            for field in &table.fields {
                if field.name == name {
                    let values = values.get(start..start + field.len())?;
                    return Some((values, &field.shape));
                }
                start += field.len();
            }
        }
        None
    }

    /// The values of a field. Panics where this state does not hold it.
    pub fn field(&self, name: &str) -> &'a [f64] {
        self.expect(name).0
    }

    /// A field of shape `[N]`. Panics if the state does not hold it or its shape differs.
    pub fn vector<const N: usize>(&self, name: &str) -> SVector<f64, N> {
        SVector::from_column_slice(self.shaped(name, &[N]))
    }

    /// A field of shape `[R, C]`. Panics if the state does not hold it or its shape differs.
    pub fn matrix<const R: usize, const C: usize>(&self, name: &str) -> SMatrix<f64, R, C> {
        SMatrix::from_row_slice(self.shaped(name, &[R, C]))
    }

    /// A symmetric matrix stored as its lower triangle (`H_lower`). Panics like [`Self::vector`].
    pub fn symmetric<const N: usize>(&self, name: &str) -> SMatrix<f64, N, N> {
        let packed = self.shaped(name, &[N * (N + 1) / 2]);
        SMatrix::from_fn(|i, j| {
            let (row, column) = (i.max(j), i.min(j));
            packed[row * (row + 1) / 2 + column]
        })
    }

    fn shaped(&self, name: &str, shape: &[usize]) -> &'a [f64] {
        let (values, stored) = self.expect(name);
        assert_eq!(stored, shape, "shape of {name} in {}", self.oracle.name);
        values
    }

    fn expect(&self, name: &str) -> (&'a [f64], &'a [usize]) {
        self.get(name).unwrap_or_else(|| {
            panic!(
                "state {} of {} has no field {name}",
                self.index, self.oracle.name
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGRESSORS: [(&str, &str); 3] =
        [("torque", "tau"), ("coriolis", "Ctv"), ("gravity", "g")];

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    fn assert_close(actual: &[f64], expected: &[f64], what: &str) {
        assert_eq!(actual.len(), expected.len(), "{what}");
        let scale = expected
            .iter()
            .fold(1e-3, |scale: f64, value| scale.max(value.abs()));
        for (actual, expected) in actual.iter().zip(expected) {
            assert!(
                (actual - expected).abs() < 1e-11 * scale,
                "{what}: {actual} {expected}"
            );
        }
    }

    /// Checks that fields were cut out at the right places: they satisfy the equations that tie them together.
    fn check<const N: usize>(name: &str, bodies: usize, whole: usize) {
        let oracle = Oracle::load(name).unwrap();
        let theta = oracle.theta();
        assert_eq!(oracle.velocities(), N);
        assert_eq!(oracle.bodies().len(), bodies);
        assert_eq!(theta.len(), 10 * bodies);
        assert!(oracle.states().len() >= 200);
        let times = |w: &[f64]| {
            w.chunks(theta.len())
                .map(|row| dot(row, theta))
                .collect::<Vec<_>>()
        };

        for state in oracle.states() {
            let h = state.symmetric::<N>("H_lower");
            assert!(
                h.cholesky().is_some(),
                "H of state {} is positive definite",
                state.index()
            );
            let (v, a) = (state.vector::<N>("v"), state.vector::<N>("a"));
            let momentum = h * v;
            let tau = h * a + state.vector::<N>("Cv") + state.vector::<N>("g");
            assert_close(tau.as_slice(), state.field("tau"), "H a + C v + g");
            assert_close(
                &[v.dot(&momentum) / 2.0],
                state.field("kinetic"),
                "kinetic energy",
            );
            let energy = [state.field("kinetic")[0], state.field("potential")[0]];

            assert_eq!(state.get("W_torque").is_some(), state.index() < whole);
            if state.index() < whole {
                for (regressor, field) in REGRESSORS {
                    let w = state.field(&format!("W_{regressor}"));
                    assert_close(&times(w), state.field(field), regressor);
                }
                assert_close(
                    &times(state.field("W_momentum")),
                    momentum.as_slice(),
                    "momentum",
                );
                assert_close(&times(state.field("W_energy")), &energy, "energy");
            }
            let Some((u, _)) = state.get("u") else {
                continue;
            };
            for (regressor, field) in REGRESSORS {
                let uw = state.field(&format!("uW_{regressor}"));
                assert_close(&times(uw), &[dot(u, state.field(field))], regressor);
            }
            let uw = state.field("uW_momentum");
            assert_close(&times(uw), &[dot(u, momentum.as_slice())], "momentum");
            let expected = dot(state.field("u_energy"), &energy);
            assert_close(&times(state.field("uW_energy")), &[expected], "energy");
        }
    }

    #[test]
    fn leg_fits_together() {
        check::<3>("leg", 3, 200);
    }

    #[test]
    fn pinned_robot_fits_together() {
        check::<12>("pinned", 12, 5);
    }

    #[test]
    fn free_robot_fits_together() {
        check::<18>("free", 13, 5);
    }

    #[test]
    fn missing_data_is_named() {
        let error = Oracle::load_from(Path::new("/nowhere"), "leg")
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("/nowhere/manifest.json: No such file"),
            "{error}"
        );
        let error = Oracle::load("tail").unwrap_err().to_string();
        assert!(
            error.contains("no system tail in [\"free\", \"leg\", \"pinned\"]"),
            "{error}"
        );
    }

    #[test]
    #[should_panic(expected = "shape of tau in leg")]
    fn wrong_shape_is_refused() {
        Oracle::load("leg")
            .unwrap()
            .states()
            .next()
            .unwrap()
            .vector::<12>("tau");
    }

    #[test]
    #[should_panic(expected = "state 199 of free has no field W_torque")]
    fn absent_field_is_named() {
        Oracle::load("free")
            .unwrap()
            .states()
            .last()
            .unwrap()
            .field("W_torque");
    }
}

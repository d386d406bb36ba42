//! What devices keep of their data, in files: triangles that stack in any order, from logs and from boards alike.
//!
//! A file is a line of text, `proprio factors 2`, and [`Factors`] in postcard with a CRC-32 behind it. It holds all that the data
//! say of any model whose effects the device keeps columns for, and no data. Files that begin with `proprio factors 1` name no robot.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

use proprio_core::estimator::{
    COLUMNS, DEFAULT_ACTIVE, DeviceFolds, DevicePrior, DeviceSolver, FOLDS, Gather, LegBase,
};
use proprio_core::factor::{Factor, FactorError, packed_len};
use proprio_core::go2::{JOINTS_PER_LEG, JointId, LEGS, Leg};
use proprio_core::wire::Hello;
use serde::{Deserialize, Serialize};

use crate::estimate::{self, Constraint, ParameterEstimate};
use crate::output::{AtomicFile, WriteError};

const FIRST_LINE: &[u8] = b"proprio factors 2\n";
const NAMELESS: &[u8] = b"proprio factors 1\n";
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);

/// A joint's factor in one fold, packed by rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RFactor {
    /// Windows in it.
    pub windows: f64,
    /// Its numbers.
    pub numbers: Vec<f64>,
}

/// The factors of a robot's legs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Factors {
    /// Effects that have columns, by name.
    effects: Vec<String>,
    /// Length of a window, µs.
    window_us: u32,
    /// Each leg's triangles, joint by joint of each fold; empty where a leg has none.
    legs: [Vec<RFactor>; LEGS],
    /// Whose data they are, where that is known.
    robot: Option<String>,
}

/// What files hold that name no robot.
#[derive(Deserialize)]
struct Nameless {
    effects: Vec<String>,
    window_us: u32,
    legs: [Vec<RFactor>; LEGS],
}

/// Why a factor file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FactorsError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// Its name.
        path: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// The file is none of factors.
    #[error("{0}: no factors of proprio")]
    NotFactors(String),
    /// The file is damaged.
    #[error("{0}: the file is cut or damaged")]
    Damaged(String),
    /// Factors of other columns, or of windows of another length.
    #[error("{0}: factors of other effects or of another window than this program's")]
    Other(String),
    /// Data that another of the files holds too.
    #[error("{path}: the data of leg {} are in {known} already: they would count twice", .leg.name())]
    Twice {
        /// The file.
        path: String,
        /// The other file.
        known: String,
        /// Which leg.
        leg: Leg,
    },
    /// Data of another robot.
    #[error("{path}: factors of robot {robot}; {other} is of {known}")]
    AnotherRobot {
        /// The file.
        path: String,
        /// Its robot.
        robot: String,
        /// The other file.
        other: String,
        /// The other file's robot.
        known: String,
    },
    /// The numbers allow no solution.
    #[error("leg {}: {source}", .leg.name())]
    Solve {
        /// Which leg.
        leg: Leg,
        /// Why not.
        source: FactorError,
    },
}

impl Factors {
    /// None yet, of a device that said `hello`.
    pub fn of_device(hello: &Hello) -> Self {
        Self {
            effects: hello.effects.iter().map(|name| name.to_string()).collect(),
            window_us: hello.capacities.window_us,
            legs: Default::default(),
            robot: None,
        }
    }

    /// The same as data of a robot by its name.
    pub fn of_robot(self, robot: Option<String>) -> Self {
        Self { robot, ..self }
    }

    /// Whether it may be merged with `other`, each with its file's name: data of the same robot as far as that is known, and none twice.
    ///
    /// # Errors
    /// [`FactorsError::Twice`], [`FactorsError::AnotherRobot`].
    pub fn belongs_to(
        &self,
        path: &Path,
        (other, known): (&Path, &Self),
    ) -> Result<(), FactorsError> {
        let [path, other] = [path, other].map(|path| path.display().to_string());
        if let (Some(robot), Some(known)) = (&self.robot, &known.robot)
            && robot != known
        {
            return Err(FactorsError::AnotherRobot {
                path,
                other,
                robot: robot.clone(),
                known: known.clone(),
            });
        }
        // No two motions give the same numbers.
        let has_data = |leg: &Leg| self.legs[leg.index()].iter().any(|own| own.windows > 0.0);
        let same = |leg: &Leg| self.legs[leg.index()] == known.legs[leg.index()];
        match self.legs().find(|leg| has_data(leg) && same(leg)) {
            Some(leg) => Err(FactorsError::Twice {
                path,
                known: other,
                leg,
            }),
            None => Ok(()),
        }
    }

    /// Adds the next triangle of a leg: joint by joint of each fold.
    ///
    /// # Errors
    /// [`FactorError::Length`] if it is not the next one, or has another shape.
    pub(crate) fn add(
        &mut self,
        leg: Leg,
        fold: usize,
        joint: usize,
        triangle: RFactor,
    ) -> Result<(), FactorError> {
        let error = FactorError::Length(triangle.numbers.len());
        let mut folds = empty();
        view(&triangle).and_then(|factor| folds.merge_joint(fold, joint, &factor))?;
        let triangles = &mut self.legs[leg.index()];
        if triangles.len() != fold * JOINTS_PER_LEG + joint {
            return Err(error);
        }
        triangles.push(triangle);
        Ok(())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`FactorsError`].
    pub fn read(path: &Path) -> Result<Self, FactorsError> {
        let name = path.display().to_string();
        let bytes = fs::read(path).map_err(|source| FactorsError::Read {
            path: name.clone(),
            source,
        })?;
        let damaged = |_| FactorsError::Damaged(name.clone());
        let factors = match (bytes.strip_prefix(FIRST_LINE), bytes.strip_prefix(NAMELESS)) {
            (Some(content), _) => {
                postcard::from_bytes_crc32(content, CRC.digest()).map_err(damaged)?
            }
            (_, Some(content)) => {
                let read = postcard::from_bytes_crc32(content, CRC.digest());
                let Nameless {
                    effects,
                    window_us,
                    legs,
                } = read.map_err(damaged)?;
                Self {
                    effects,
                    window_us,
                    legs,
                    robot: None,
                }
            }
            _ => return Err(FactorsError::NotFactors(name)),
        };
        match factors.fits() {
            true => Ok(factors),
            false => Err(FactorsError::Other(name)),
        }
    }

    /// Whether this program can solve them.
    fn fits(&self) -> bool {
        let columns = COLUMNS.iter().map(|effect| effect.name());
        let window_us = proprio_core::window::Settings::DEFAULT.window_us;
        columns.eq(self.effects.iter().map(String::as_str))
            && u64::from(self.window_us) == window_us
            && (0..LEGS).all(|leg| self.folds(leg).is_ok())
    }

    /// Writes a file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        // Plain data, and a vector that grows.
        let content = postcard::to_allocvec_crc32(self, CRC.digest()).unwrap_or_default();
        let mut file = AtomicFile::create(path)?;
        let written = file
            .write_all(FIRST_LINE)
            .and_then(|()| file.write_all(&content));
        written.map_err(|source| WriteError {
            path: path.to_owned(),
            source,
        })?;
        file.commit()
    }

    /// The legs that there are factors of.
    pub fn legs(&self) -> impl Iterator<Item = Leg> + '_ {
        Leg::ALL
            .into_iter()
            .filter(|leg| !self.legs[leg.index()].is_empty())
    }

    /// Adds the data of `other`, in any order.
    ///
    /// # Errors
    /// [`FactorsError::Solve`] if the numbers are not finite.
    pub fn merge(&mut self, other: &Self) -> Result<(), FactorsError> {
        for leg in other.legs() {
            let n = leg.index();
            if self.legs[n].is_empty() {
                self.legs[n].clone_from(&other.legs[n]);
                continue;
            }
            let mut folds = self
                .folds(n)
                .map_err(|source| FactorsError::Solve { leg, source })?;
            merge_leg(&mut folds, &other.legs[n])
                .map_err(|source| FactorsError::Solve { leg, source })?;
            for (place, triangle) in self.legs[n].iter_mut().enumerate() {
                let factor = folds.joint(place / JOINTS_PER_LEG, place % JOINTS_PER_LEG);
                triangle.windows = factor.rows();
                triangle.numbers.copy_from_slice(factor.packed());
            }
        }
        Ok(())
    }

    fn folds(&self, leg: usize) -> Result<Box<DeviceFolds<f64>>, FactorError> {
        let mut folds = empty();
        merge_leg(&mut folds, &self.legs[leg])?;
        Ok(folds)
    }

    /// The solution for a leg, with the effects that a device has at first: what a device that had heard all the data would tell.
    ///
    /// # Errors
    /// [`FactorsError::Solve`].
    pub fn solve(&self, leg: Leg) -> Result<LegSolution, FactorsError> {
        self.solve_leg(leg)
            .map_err(|source| FactorsError::Solve { leg, source })
    }

    fn solve_leg(&self, leg: Leg) -> Result<LegSolution, FactorError> {
        let folds = self.folds(leg.index())?;
        let prior = DevicePrior::<f64>::of(leg, &DEFAULT_ACTIVE);
        let mut base = LegBase::empty();
        base.analyse(leg, &prior, &mut vec![0.0; 2_000])?;
        let mut solver = Box::new(DeviceSolver::<f64>::empty());
        let mut gather = Gather::new();
        gather.start(&DEFAULT_ACTIVE, &folds, &mut solver);
        while !gather.advance(usize::MAX, &folds, &base, &mut solver)? {}
        solver.restart(&prior);
        while !solver.advance()? {}
        let joints = JointId::of(leg);
        let effects: Vec<_> = DEFAULT_ACTIVE
            .effects()
            .map(|(joint, n)| (joints[joint], COLUMNS[n]))
            .collect();
        Ok(LegSolution {
            leg,
            windows: solver.windows(),
            noise: *solver.noise(),
            parameters: estimate::of_device(
                leg,
                &effects,
                solver.values(),
                solver.std(),
                Constraint::Free,
            )?,
        })
    }
}

/// What the data say of one leg.
#[derive(Debug, Clone)]
pub struct LegSolution {
    /// Which leg.
    pub leg: Leg,
    /// Windows of data.
    pub windows: f64,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    pub noise: [f64; JOINTS_PER_LEG],
    /// θ.
    pub parameters: Vec<ParameterEstimate>,
}

/// Folds of no data and no floor: that comes with what is merged.
fn empty() -> Box<DeviceFolds<f64>> {
    Box::new(DeviceFolds::empty())
}

fn view(triangle: &RFactor) -> Result<Factor<f64, &[f64]>, FactorError> {
    let length = triangle.numbers.len();
    let columns = (1..length).find(|&columns| packed_len(columns) >= length);
    let columns = columns.ok_or(FactorError::Length(length))?;
    Factor::from_packed(columns, triangle.windows, &triangle.numbers)
}

fn merge_leg(folds: &mut DeviceFolds<f64>, triangles: &[RFactor]) -> Result<(), FactorError> {
    if triangles.len() > FOLDS * JOINTS_PER_LEG {
        return Err(FactorError::Length(triangles.len()));
    }
    for (place, triangle) in triangles.iter().enumerate() {
        let (fold, joint) = (place / JOINTS_PER_LEG, place % JOINTS_PER_LEG);
        folds.merge_joint(fold, joint, &view(triangle)?)?;
    }
    Ok(())
}

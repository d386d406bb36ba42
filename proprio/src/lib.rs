//! What your robot's body really is, and what the model of it is still missing.
//!
//! The loop of a robot's owner: [`read`] a log, look at what is wrong with its samples ([`Recording::findings`]), [`diagnose`] which
//! physical effect the model lacks, [`add`] it, [`identify`] the values, and [`compare`] the model with a log that it has not seen;
//! [`predict`] gives the torque at the log's own rate, [`report`] a page, [`excite`] the next motion to record, [`Dynamics`] the rigid body's
//! regressors. A log is a file, or arrays ([`MemoryLog`]). These are what the commands of the same names do, and they give
//! the same numbers.
//!
//! ```
//! # let folder = tempfile::tempdir()?;
//! # let simulate = |name: &str, seed| -> Result<_, Box<dyn std::error::Error>> {
//! #     use proprio_core::go2::Leg;
//! #     use proprio_simulator::{Simulation, hidden::typical};
//! #     let legs = [Leg::FR];
//! #     let simulation = Simulation { effects: typical(&legs), duration: 10.0, seed, ..Simulation::new(&legs) };
//! #     let mut log = proprio_host::log::LogWriter::new(Vec::new(), &simulation.legs)?;
//! #     for sample in simulation.samples() {
//! #         let sample = sample?;
//! #         log.row(sample.t, &sample.q, &sample.dq, &sample.tau)?;
//! #     }
//! #     let path = folder.path().join(name);
//! #     std::fs::write(&path, log.finish()?)?;
//! #     Ok(path)
//! # };
//! # let (chirp, other) = (simulate("chirp.csv", 1)?, simulate("other.csv", 2)?);
//! # let (file, page) = (folder.path().join("go2.toml"), folder.path().join("report.html"));
//! use proprio::Model;
//!
//! // One leg of a Go2: its URDF's bodies, and no effect.
//! let mut model = Model::go2();
//! let recording = proprio::read(&[chirp], &model)?;
//! for finding in recording.findings() {
//!     eprintln!("{finding}");
//! }
//! // What is missing, and each such effect into the model.
//! let diagnosis = proprio::diagnose(&recording, &model)?;
//! assert!(diagnosis.after < 0.5 * diagnosis.before, "{diagnosis}");
//! for effect in &diagnosis.missing {
//!     model = proprio::add(&model, effect)?;
//! }
//! // Their values, each with a standard deviation.
//! let fitted = proprio::identify(&recording, &model)?;
//! let friction = fitted.parameter("coulomb:FR_hip").expect("every joint has it");
//! println!("{} ± {} {}", friction.value, friction.std, friction.unit);
//! fitted.model.save(&file)?;
//! // How well that predicts another log, in the mean over windows of 20 ms and sample by sample.
//! let other = proprio::read(&[other], &fitted.model)?;
//! let comparison = proprio::compare(&other, &fitted.model)?;
//! assert!(comparison.rms < 0.5 * comparison.cad_rms, "{comparison}");
//! for joint in proprio::predict(&other, &fitted.model) {
//!     assert_eq!(joint.t.len(), joint.predicted.len());
//! }
//! proprio::report(&comparison, &other, &fitted.model, &page)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! All numbers are SI, on the joint side: s, rad, rad/s, N m, kg, °C (m, m/s, N at a sliding joint). Joints, effects and parameters go by
//! their names everywhere: `FR_hip`, `coulomb:FR_hip`, `stribeck.v:FR_hip`. Results are plain values whose fields may become more; each
//! prints as its command does.

mod dynamics;
mod error;
mod excite;
mod model;
mod recording;
mod results;

pub use dynamics::Dynamics;
pub use error::Error;
pub use excite::{Cost, Excitation, Motion, excite};
pub use model::{Model, add, plain};
pub use recording::{MemoryLog, Recording, read};
pub use results::{
    Comparison, Diagnosis, Fitted, JointSeries, Parameter, compare, diagnose, identify, predict,
    report,
};

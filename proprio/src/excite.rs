//! The next motion to record.

use std::io::Write;
use std::path::Path;

use proprio_host::excite as room;
use proprio_host::output::{AtomicFile, WriteError};

use crate::error::{self, Error};
use crate::model::Model;

/// What a motion is to be good for.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Cost {
    /// The condition number of the identifiable inertias, each kind scaled by the prior.
    #[default]
    Condition,
    /// The same with columns per kg, kg m and kg m²: for comparison with the literature.
    ConditionSi,
    /// The information of all parameters beyond the prior: D-optimality.
    Determinant,
    /// The variance of these parameters (`m:FR_calf`, `coulomb:FR_hip`): A-optimality.
    Variance(Vec<String>),
}

/// What is asked of a motion. Defaults are the command's.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Excitation {
    /// Limbs by name (`FR`); all of them if none is named.
    pub limbs: Vec<String>,
    /// Length, s.
    pub duration: f64,
    /// What for.
    pub cost: Cost,
    /// Seed of the search: the same gives the same motion.
    pub seed: u64,
    /// Starts of the search per limb.
    pub starts: usize,
}

impl Default for Excitation {
    fn default() -> Self {
        let usual = room::Settings::default();
        Self {
            limbs: Vec::new(),
            duration: usual.duration,
            cost: Cost::default(),
            seed: usual.seed,
            starts: usual.starts,
        }
    }
}

/// A motion within the robot's limits: samples at 500 Hz, and how informative it is.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Motion {
    /// The joints that move.
    pub joints: Vec<String>,
    /// Time, s.
    pub t: Vec<f64>,
    /// Of each joint: position, rad.
    pub q: Vec<Vec<f64>>,
    /// Of each joint: velocity, rad/s.
    pub dq: Vec<Vec<f64>>,
    /// Of each joint: acceleration, rad/s².
    pub ddq: Vec<Vec<f64>>,
    /// Of each joint: feed-forward torque, N m.
    pub tau: Vec<Vec<f64>>,
    /// σ₁ / σ_r of the identifiable inertial columns, each kind scaled by the prior: the largest of the limbs.
    pub condition_number: f64,
    /// How many combinations of inertial parameters are identifiable, over all limbs.
    pub rank: usize,
    /// log det(1 + RᵀR) of all parameters scaled by the prior, over all limbs, nats.
    pub log_det: f64,
    model: Model,
    designs: Vec<room::LimbDesign>,
}

impl Motion {
    /// Writes the motion as CSV, whole or not at all, with these feedback gains (N m/rad, N m s/rad): the file that `proprio excite` writes.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn save(&self, path: impl AsRef<Path>, kp: f64, kd: f64) -> Result<(), Error> {
        let path = path.as_ref();
        let unwritable = |source| {
            error::write(WriteError {
                path: path.to_owned(),
                source,
            })
        };
        let mut file = AtomicFile::create(path).map_err(error::write)?;
        let gains = room::output::Gains { p: kp, d: kd };
        room::output::write_csv(&mut file, &self.model.0, &self.designs, gains)
            .map_err(unwritable)?;
        file.flush().map_err(unwritable)?;
        file.commit().map_err(error::write)
    }
}

/// Ends a search early, with the best motion so far.
struct Stop<'a>(&'a (dyn Fn() -> bool + Sync));

impl room::Supervisor for Stop<'_> {
    fn stop(&self) -> bool {
        (self.0)()
    }

    fn progress(&self, _done: usize, _of: usize, _best: Option<f64>) {}
}

/// Designs a motion that excites what can be identified: each joint a Fourier series that begins and ends at rest, within the limits of
/// position, velocity, acceleration, torque and power at every instant. It searches on all processors until `stop` says so or it has found one.
///
/// # Errors
/// [`Error::UnknownName`]; [`Error::Motion`] if the limits leave no motion, or none is proved to be within them.
pub fn excite(
    model: &Model,
    asked: &Excitation,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Motion, Error> {
    let limbs = model.0.robot().limbs_named(&asked.limbs);
    let goal = match &asked.cost {
        Cost::Condition => room::Goal::Condition,
        Cost::ConditionSi => room::Goal::ConditionSi,
        Cost::Determinant => room::Goal::Determinant,
        Cost::Variance(parameters) => room::Goal::Variance(parameters.clone()),
    };
    let settings = room::Settings {
        period: goal.usual_period(asked.duration),
        goal,
        duration: asked.duration,
        seed: asked.seed,
        starts: asked.starts,
        ..room::Settings::default()
    };
    let limbs = limbs.map_err(error::name)?;
    let designs = room::design(&model.0, &limbs, &settings, &Stop(stop)).map_err(error::motion)?;
    let beyond = designs.iter().map(|d| d.violation_sentences(&model.0));
    if let Some(first) = beyond.collect::<Vec<_>>().concat().first() {
        let reason = format!("no motion could be proved to be within the limits: {first}");
        return Err(Error::Motion(reason.into()));
    }
    Ok(sampled(model, designs))
}

/// Where a channel goes, and where a command has it.
type Channel<'a> = (&'a mut Vec<Vec<f64>>, fn(&room::Command) -> &Vec<f64>);

fn sampled(model: &Model, designs: Vec<room::LimbDesign>) -> Motion {
    let joints = designs.iter().flat_map(|design| &design.joints);
    let joints: Vec<_> = joints.map(|&j| model.0.joint_name(j).to_owned()).collect();
    let none = || vec![Vec::new(); joints.len()];
    let (mut t, [mut q, mut dq, mut ddq, mut tau]) = (Vec::new(), [(); 4].map(|()| none()));
    for (time, commands) in room::output::samples(&designs) {
        t.push(time);
        let of: [Channel<'_>; 4] = [
            (&mut q, |c| &c.q),
            (&mut dq, |c| &c.dq),
            (&mut ddq, |c| &c.ddq),
            (&mut tau, |c| &c.tau),
        ];
        for (channel, read) in of {
            let values = commands.iter().flat_map(read);
            channel
                .iter_mut()
                .zip(values)
                .for_each(|(to, x)| to.push(*x));
        }
    }
    let measures = || designs.iter().map(|design| design.measures);
    let worst = measures().map(|m| m.condition_number);
    Motion {
        condition_number: worst.fold(f64::NEG_INFINITY, f64::max),
        rank: measures().map(|m| m.rank).sum(),
        log_det: measures().map(|m| m.log_det).sum(),
        model: model.clone(),
        joints,
        t,
        q,
        dq,
        ddq,
        tau,
        designs,
    }
}

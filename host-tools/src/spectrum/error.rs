//! Why a log gives no frequency response: what is wrong, where, the cause that was tested, and what to do.

use std::path::PathBuf;

use crate::dynamics::DynamicsError;
use crate::log::{LogError, Place};
use crate::model::{Impossible, UnknownName};

/// A log that cannot be used for frequency responses.
#[derive(Debug, thiserror::Error)]
pub enum FrfError {
    /// The file cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A joint that the model does not have.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// A value that the model file cannot hold.
    #[error("the result cannot be written: {0}")]
    Value(#[from] Impossible),
    /// The model's dynamics cannot be computed.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// Columns are missing.
    #[error("{}: {what}", .path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// What is missing.
        what: String,
    },
    /// Samples are not at equal distances.
    #[error("{}, {place}: {gap:.3e} s after the sample before, where the others are {dt:.3e} s apart", .path.display())]
    Uneven {
        /// The file.
        path: PathBuf,
        /// The sample.
        place: Place,
        /// The distance in time, s.
        gap: f64,
        /// The median of all, s.
        dt: f64,
    },
    /// No controller of a robot samples at such a rate: time is in another unit.
    #[error("{}: by `t` there are {hertz:.3e} samples a second, where 20 to 5e4 are usual{unit}", .path.display())]
    TimeUnit {
        /// The file.
        path: PathBuf,
        /// The rate that `t` says, Hz.
        hertz: f64,
        /// The unit that explains it: a clause, or nothing.
        unit: String,
    },
    /// A torque that does not change.
    #[error("{}: `{column}` is {value:.4} in all rows", .path.display())]
    Constant {
        /// The file.
        path: PathBuf,
        /// Its column.
        column: String,
        /// Its value, in its unit.
        value: f64,
    },
    /// A value that no robot has, or that is many times any other of its column.
    #[error("{}, {place}: `{column}` is {value:.3e}; all other rows have {others:.3e} at most", .path.display())]
    Impossible {
        /// The file.
        path: PathBuf,
        /// The sample.
        place: Place,
        /// Its column.
        column: String,
        /// The value, in its unit.
        value: f64,
        /// The greatest size but for the rows beside.
        others: f64,
    },
    /// A position that leaps.
    #[error("{}, {place}: `q/{joint}` leaps by {by:.3e}; 99 % of the steps from sample to sample are below {usual:.3e}", .path.display())]
    Leaps {
        /// The file.
        path: PathBuf,
        /// The sample.
        place: Place,
        /// The joint.
        joint: String,
        /// How far, rad or m.
        by: f64,
        /// What most steps are below, rad or m.
        usual: f64,
    },
    /// Torque and position count against each other: tested by a fit with the sign turned.
    #[error(
        "torque and position have opposite signs: with one of them turned the held-out error falls from {before:.2} to {after:.2} (log magnitude)"
    )]
    Sign {
        /// Held-out error of the springs as the logs are.
        before: f64,
        /// With the sign turned.
        after: f64,
    },
    /// Positions or velocities are in degrees: tested by the velocity, or by a fit in rad.
    #[error("{columns} in degrees, not rad: {cause}")]
    Degrees {
        /// Which columns: `` `q/` is `` and such.
        columns: String,
        /// What says so.
        cause: String,
    },
    /// Position and torque are not of the same instant: tested by a fit with the position moved in time.
    #[error(
        "the position is {late_ms:.1} ms later than the torque: with that taken out the held-out error falls from {before:.2} to {after:.2} (log magnitude)"
    )]
    Late {
        /// By how much, ms; negative: earlier.
        late_ms: f64,
        /// Held-out error of the springs as the logs are.
        before: f64,
        /// With it taken out.
        after: f64,
    },
    /// The fit leaves more than springs explain.
    #[error(
        "no elastic model fits the responses: the held-out error is {error:.2} with springs, where the scatter explains {floor:.3} (log magnitude)"
    )]
    Misfit {
        /// Held-out error.
        error: f64,
        /// What the scatter explains of it.
        floor: f64,
    },
    /// A cell that holds no finite number.
    #[error("{}, {place}: a value is not finite", .path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The sample.
        place: Place,
    },
    /// A joint whose links the model's dynamics does not have.
    #[error("joint {joint} has no dynamics in the model")]
    NoDynamics {
        /// The joint.
        joint: String,
    },
    /// Nothing repeats itself.
    #[error("{}: no period: {signal} resembles itself shifted in time by {correlation:.2} at most, and 0.50 is needed", .path.display())]
    NoPeriod {
        /// The file.
        path: PathBuf,
        /// What was tried.
        signal: &'static str,
        /// The greatest autocorrelation at any shift.
        correlation: f64,
    },
    /// The motion repeats itself too seldom.
    #[error("{}: {periods} periods of {seconds} s; 3 in a row are needed, the first of which is transient", .path.display())]
    FewPeriods {
        /// The file.
        path: PathBuf,
        /// The longest run.
        periods: usize,
        /// The period, s.
        seconds: f64,
    },
    /// Too few lines are excited to fit a response.
    #[error("{}: {lines} excited lines; {needed} are needed", .path.display())]
    FewLines {
        /// The file.
        path: PathBuf,
        /// Found.
        lines: usize,
        /// Needed.
        needed: usize,
    },
    /// Lines where sampling leaves nothing to identify.
    #[error("{}: lines up to {highest:.1} Hz are excited, beyond 0.8 of the Nyquist frequency, {limit:.1} Hz", .path.display())]
    BeyondNyquist {
        /// The file.
        path: PathBuf,
        /// The highest excited line, Hz.
        highest: f64,
        /// 0.8 of half the sampling rate, Hz.
        limit: f64,
    },
    /// Lines that are aliases of higher ones.
    #[error("{}: lines are aliases: at {f:.1} Hz the position of {joint} has the velocity of {velocity:.0} Hz", .path.display())]
    Aliased {
        /// The file.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// The line in the middle of the band, Hz.
        f: f64,
        /// What its velocity says, Hz.
        velocity: f64,
    },
    /// Experiments that do not move the joints independently.
    #[error(
        "point {point}, block {block}: the {joints} experiments are not independent: condition number {condition:.1e} at {f:.1} Hz, at most 1e3 is allowed"
    )]
    NotIndependent {
        /// Which point, counted from 1.
        point: usize,
        /// Which block there, counted from 1.
        block: usize,
        /// How many joints.
        joints: usize,
        /// Of the matrix of torques.
        condition: f64,
        /// The worst line, Hz.
        f: f64,
    },
    /// A point with fewer experiments than joints.
    #[error(
        "point {point}: {experiments} experiments of {joints} joints; each block needs {needed}"
    )]
    FewExperiments {
        /// Which point, counted from 1.
        point: usize,
        /// Found there.
        experiments: usize,
        /// Of the robot.
        joints: usize,
        /// Needed for each block.
        needed: usize,
    },
    /// Logs that do not belong together.
    #[error("{}: {what}", .path.display())]
    Differs {
        /// The file.
        path: PathBuf,
        /// In what it differs from the first.
        what: String,
    },
    /// The mean position drifts while a point is measured.
    #[error(
        "{}: the point moves: {joint} drifts by {drift:.4} rad during an experiment that swings by {swing:.4} rad", .path.display()
    )]
    PointMoves {
        /// The file.
        path: PathBuf,
        /// The joint.
        joint: String,
        /// Between the first and the last period's mean, rad or m.
        drift: f64,
        /// The motion within a period, peak to peak, rad or m.
        swing: f64,
    },
    /// A joint that friction holds: nothing is learnt of what is behind it.
    #[error(
        "joint {joint} sticks: it is at rest for {share:.0} % of the time, so that its torque is friction's"
    )]
    Sticks {
        /// The joint.
        joint: String,
        /// Of the time, per cent.
        share: f64,
    },
    /// A joint whose response is below the noise.
    #[error(
        "joint {joint} does not answer its excitation: at {share:.0} % of the lines the response is below twice its noise"
    )]
    Silent {
        /// The joint.
        joint: String,
        /// Of the excited lines, per cent.
        share: f64,
    },
    /// No model without springs or with them fits.
    #[error(
        "no elastic model fits: the held-out error is {after:.2} with springs and {before:.2} without (log magnitude)"
    )]
    NoFit {
        /// Held-out error of the rigid model.
        before: f64,
        /// With springs.
        after: f64,
    },
}

impl FrfError {
    /// What the user can do.
    pub fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Log(_) | Self::Name(_) | Self::Value(_) | Self::Dynamics(_) => return None,
            Self::Columns { .. } => {
                "a log for frequency responses has `t`, `q/<joint>`, and `tau/<joint>` (N m) or `current/<joint>` (A); `ref/<joint>`, the excitation, helps"
            }
            Self::Uneven { .. } => {
                "record without losing samples: a period is transformed as a whole"
            }
            Self::TimeUnit { .. } => "give `t` in s",
            Self::Constant { .. } => {
                "record the measured torque or current; a drive that is off has no response"
            }
            Self::Impossible { .. } | Self::Leaps { .. } => {
                "a period is transformed as a whole: delete the rows from here on if three periods remain, or record again"
            }
            Self::Sign { .. } => "turn the sign of `tau/` or `current/`, or of `q/` and `dq/`",
            Self::Degrees { .. } => "multiply by π/180 = 0.0174533",
            Self::Late { .. } => {
                "record both of one control cycle, or move the columns against each other by so many samples"
            }
            Self::Misfit { .. } => {
                "the sign of the torque, degrees and a delay were tried; check which columns hold torque and position, then the model's masses; links that bend about several axes at once look alike"
            }
            Self::NotFinite { .. } => {
                "record without losing samples: a period is transformed as a whole"
            }
            Self::NoDynamics { .. } => "give a model whose limbs have this joint",
            Self::NoPeriod { .. } => {
                "excite with a periodic signal, and record `ref/<joint>`; `proprio simulate --frf -m MODEL` shows one"
            }
            Self::FewPeriods { .. } => "record more periods of the same excitation",
            Self::FewLines { .. } => "excite more lines: 12 or more around the resonances",
            Self::BeyondNyquist { .. } => "sample faster, or excite lower lines",
            Self::Aliased { .. } => {
                "record every sample of the drive, or low-pass before samples are left out; a velocity of other units than the position looks the same"
            }
            Self::NotIndependent { .. } => {
                "give the joints another sign pattern in each experiment, such as the rows of an orthogonal matrix"
            }
            Self::FewExperiments { .. } => {
                "at each point, make as many experiments as joints in one run of the log, without another point in between; of a plan with fewer in each block, give their number: --experiments N"
            }
            Self::Differs { .. } => "give logs of the same joints, rate and excitation together",
            Self::PointMoves { .. } => {
                "let the position controller hold the mean, and wait until the arm has settled; excite harder if friction lets the joint creep alone"
            }
            Self::Sticks { .. } => {
                "excite harder, or add a slow motion that keeps the joint from resting (`proprio simulate --frf` does)"
            }
            Self::Silent { .. } => {
                "excite harder: friction holds the joint, or its encoder is too coarse for these amplitudes"
            }
            Self::NoFit { .. } => {
                "check the model's masses and the torque's unit; excite lines below and above the resonances"
            }
        };
        Some(hint.to_owned())
    }
}

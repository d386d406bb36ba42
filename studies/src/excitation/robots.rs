//! Simulated robots, what they follow, and the logs that they make.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{JOINTS_PER_LEG, JointId, Leg};
use proprio_host::excite::output::{Gains, write_csv};
use proprio_host::excite::{Feedforward, Goal, LimbDesign, Settings};
use proprio_host::identify::{FitOptions, Fitted, fit_model};
use proprio_host::log::LogWriter;
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::hidden::typical;
use proprio_simulator::{Followed, Simulation};

use super::Failure;

/// The leg of the studies.
pub const LEG: Leg = Leg::FR;
/// Length of every motion, s.
pub const DURATION: f64 = 10.0;
/// How far a simulated robot's bodies are off the CAD.
pub const INERTIA_ERROR: f64 = 0.06;
/// What every geared motor has.
pub const PLAIN: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
    EffectKind::Bias,
];
/// Gains of a Go2's low-level interface, N m/rad and N m s/rad.
const GAINS: Gains = Gains { p: 40.0, d: 1.5 };

/// How a motion for simulated robots is designed: with a quarter of the usual starts, to which what it tells hardly owes.
pub fn settings(goal: Goal) -> Settings {
    Settings {
        period: goal.usual_period(DURATION),
        goal,
        starts: Settings::default().starts / 4,
        ..Settings::default()
    }
}

/// A robot with a Go2's typical friction, rotors and offsets, and bodies of its own.
pub fn robot(seed: u64) -> Simulation {
    Simulation {
        effects: typical(&[LEG]),
        inertia_error: INERTIA_ERROR,
        duration: DURATION,
        seed,
        ..Simulation::new(&[LEG])
    }
}

/// The Go2's model with `effects` at every joint of the leg, their values to be found.
pub fn model_with(effects: &[EffectKind]) -> Model {
    let mut model = Model::default();
    let limb = model.robot().limbs()[LEG.index()].clone();
    for joint in limb.bodies {
        for &effect in effects {
            model.add_effect(effect, joint);
        }
    }
    model
}

/// A design as the file that a robot plays.
///
/// # Errors
/// A file that cannot be written or is no motion.
pub fn played(model: &Model, designs: &[LimbDesign]) -> Result<Arc<Followed>, Failure> {
    let file = tempfile::NamedTempFile::new()?;
    let mut out = BufWriter::new(file.as_file());
    write_csv(&mut out, model, designs, GAINS)?;
    out.flush()?;
    drop(out);
    Ok(Arc::new(Followed::read(file.path())?))
}

/// Frequency of a chirp at its start, Hz, and its excursion, rad: those of the recorded chirps, swept within [`DURATION`].
const CHIRP: (f64, [f64; JOINTS_PER_LEG]) = (0.1, [0.12, 0.2, 0.25]);
/// Frequency at its end, Hz: of the fastest recorded chirps.
pub const FAST: f64 = 9.0;
/// The same of a cautious one.
pub const SLOW: f64 = 0.5;
/// Where the leg is bent, rad.
const BENT: [f64; JOINTS_PER_LEG] = [-0.1, 0.9, -1.7];
/// The chirp grows to its full size over this time, s.
const RAMP: f64 = 1.0;

/// A chirp up to `last` Hz that all joints follow in phase, with the CAD's torque as feed-forward.
///
/// # Errors
/// A file that cannot be written.
pub fn chirp(last: f64) -> Result<Arc<Followed>, Failure> {
    let mut file = tempfile::NamedTempFile::new()?;
    let joints = JointId::of(LEG);
    let columns = ["q", "dq", "ddq", "tau"].map(|c| joints.map(|j| format!("{c}/{j}")).join(","));
    writeln!(file, "t,{}", columns.join(","))?;
    let model = Model::default();
    let limb = &model.robot().limbs()[LEG.index()];
    let foresight = Feedforward::new(&model, limb).ok_or("a leg has three joints")?;
    for k in 0..=(500.0 * DURATION) as u32 {
        let t = f64::from(k) / 500.0;
        let [q, dq, ddq] = chirp_at(t, last);
        let tau = foresight.torque(&q, &dq, &ddq);
        let numbers = q.iter().chain(&dq).chain(&ddq).chain(&tau);
        let numbers: Vec<String> = numbers.map(|x| format!("{x:.7}")).collect();
        writeln!(file, "{t:.3},{}", numbers.join(","))?;
    }
    file.flush()?;
    Ok(Arc::new(Followed::read(file.path())?))
}

/// Positions, velocities, accelerations of the chirp.
fn chirp_at(t: f64, last: f64) -> [[f64; JOINTS_PER_LEG]; 3] {
    let (first, reach) = CHIRP;
    let rate = std::f64::consts::TAU * (last - first) / DURATION;
    let speed = std::f64::consts::TAU * first + rate * t;
    let phase = std::f64::consts::TAU * first * t + 0.5 * rate * t * t;
    let (sin, cos) = phase.sin_cos();
    // A smooth step and its derivatives.
    let s = (t / RAMP).min(1.0);
    let size = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    let slope = 30.0 * s * s * (1.0 - s) * (1.0 - s) / RAMP;
    let bend = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (RAMP * RAMP);
    let at = |joint: usize| {
        let r = reach[joint];
        [
            BENT[joint] + r * size * sin,
            r * (slope * sin + size * speed * cos),
            r * (bend * sin
                + 2.0 * slope * speed * cos
                + size * (rate * cos - speed * speed * sin)),
        ]
    };
    let all: [[f64; 3]; JOINTS_PER_LEG] = std::array::from_fn(at);
    std::array::from_fn(|d| std::array::from_fn(|joint| all[joint][d]))
}

/// The log of a robot that follows a motion, as a file in `folder`.
///
/// # Errors
/// A simulation that diverges, a file that cannot be written.
pub fn log_of(
    robot: &Simulation,
    motion: &Arc<Followed>,
    folder: &Path,
) -> Result<PathBuf, Failure> {
    let robot = Simulation {
        follow: Some(motion.clone()),
        duration: motion.duration(),
        ..robot.clone()
    };
    let path = folder.join("log.csv");
    let mut log = LogWriter::new(BufWriter::new(File::create(&path)?), &robot.legs)?;
    for sample in robot.samples() {
        let sample = sample?;
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)?;
    }
    log.finish()?;
    Ok(path)
}

/// What `model` makes of a robot that follows a motion.
///
/// # Errors
/// As [`log_of`]'s, and a log that tells nothing.
pub fn fitted(
    robot: &Simulation,
    motion: &Arc<Followed>,
    model: &Model,
    options: FitOptions,
) -> Result<Fitted, Failure> {
    let folder = tempfile::tempdir()?;
    let log = log_of(robot, motion, folder.path())?;
    let recording = Recording::read(&[log], model, |_, _| {})?;
    Ok(fit_model(&recording, model, options)?)
}

//! The feedback torque that models leave: on simulated robots, and on the recorded chirps.

use std::fmt::Write;

use proprio_host::excite::Settings;
use proprio_host::identify::{FitOptions, fit_model};
use proprio_host::model::{Model, Provenance};
use proprio_host::recording::Recording;
use proprio_host::validate::{Feedback, candidates, recorded, tracked};

use super::condition::{chirp_logs, designed};
use super::robots::{FAST, LEG, PLAIN, chirp, log_of, model_with, played, robot};
use super::{Failure, Stopwatch, each};
use proprio_tests::command::recorded_logs;

/// Seeds of the motion that identifies and of the one that is tracked afterwards.
const SEEDS: [u64; 2] = [1, 7];

/// Simulated robots: identified on one motion, judged on another.
///
/// # Errors
/// No motion, a simulation that diverges.
pub fn simulated(robots: usize) -> Result<String, Failure> {
    let cad = Model::default();
    let motion = |seed| -> Result<_, Failure> {
        let settings = Settings {
            seed,
            ..Settings::default()
        };
        played(&cad, &designed(&[LEG.index()], &settings)?.0)
    };
    let [exciting, other] = [motion(SEEDS[0])?, motion(SEEDS[1])?];
    let model = model_with(&PLAIN);
    let judged = each("validation", robots, |n| {
        let robot = robot(100 + n as u64);
        let folder = tempfile::tempdir()?;
        let log = log_of(&robot, &exciting, folder.path())?;
        let recording = Recording::read(std::slice::from_ref(&log), &model, |_, _| {})?;
        let fitted = |options| -> Result<Model, Failure> {
            let fit = fit_model(&recording, &model, options)?;
            Ok(fit.to_model(&model, provenance()?)?)
        };
        let mut models = vec![("consistent".to_owned(), fitted(FitOptions::PHYSICAL)?)];
        // A free fit may be unphysical, and then is no model.
        if let Ok(free) = fitted(FitOptions::default()) {
            models.push(("identified".to_owned(), free));
        }
        Ok(tracked(
            &robot,
            &other,
            &candidates(&cad, models),
            |_, _| {},
        )?)
    })?;
    let mut text = format!(
        "{robots} simulated legs with bodies off the CAD and typical friction, identified on one designed motion (10 s), judged on \
         another: the motors' torque less the model's feed-forward, N m.\n\n\
         | feed-forward | robots | feedback, mean of rms | share of the torque's square, % | below the URDF's |\n|---|---|---|---|---|\n"
    );
    for name in [
        "URDF",
        "consistent, friction only",
        "identified",
        "consistent",
    ] {
        let own = judged.iter().filter_map(|all| {
            let of = |name: &str| all.iter().find(|f| f.model == name);
            Some((of(name)?, of("URDF")?))
        });
        let own: Vec<(&Feedback, &Feedback)> = own.collect();
        let count = own.len().max(1) as f64;
        let mean = |of: fn(&Feedback) -> f64| own.iter().map(|(f, _)| of(f)).sum::<f64>() / count;
        let below = own.iter().filter(|(f, urdf)| f.rms < urdf.rms).count();
        writeln!(
            text,
            "| {name} | {} | {:.3} | {:.2} | {} |",
            own.len(),
            mean(|f| f.rms),
            mean(|f| f.share_percent),
            if name == "URDF" {
                String::new()
            } else {
                format!("{:.0} %", 100.0 * below as f64 / count)
            }
        )?;
    }
    Ok(text)
}

/// How often a motion is followed to see how long it takes.
const FOLLOWED: usize = 30;

/// How long the simulator takes to follow a motion.
///
/// # Errors
/// A simulation that diverges.
pub fn speed() -> Result<String, Failure> {
    let motion = chirp(FAST)?;
    let clock = Stopwatch::start();
    let mut simulated = 0.0;
    for n in 0..FOLLOWED {
        let folder = tempfile::tempdir()?;
        log_of(&robot(n as u64), &motion, folder.path())?;
        simulated += motion.duration();
    }
    let seconds = clock.processor();
    Ok(format!(
        "One leg with typical friction follows a chirp up to {FAST:.0} Hz by feed-forward and feedback, each motion with its log written: \
         {simulated:.0} s in {seconds:.2} s of processor time, {:.0} × real time (bar: 50 ×).",
        simulated / seconds
    ))
}

fn provenance() -> Result<Provenance, Failure> {
    Provenance::of(&[] as &[&str]).map_err(|(path, error)| format!("{path}: {error}").into())
}

/// The recorded chirps: each judged with what the other four say.
///
/// # Errors
/// A log that cannot be read.
pub fn chirps() -> Result<String, Failure> {
    let Some(folder) = recorded_logs() else {
        return Ok("No recorded logs.".to_owned());
    };
    let logs = chirp_logs(&folder)?;
    let mut model = Model::default();
    for joint in 0..model.robot().bodies().len() {
        for effect in PLAIN {
            model.add_effect(effect, joint);
        }
    }
    let judged = each("recorded chirps", logs.len(), |n| {
        let others: Vec<_> = logs
            .iter()
            .filter(|log| **log != logs[n])
            .cloned()
            .collect();
        let recording = Recording::read(&others, &model, |_, _| {})?;
        let fit = fit_model(&recording, &model, FitOptions::PHYSICAL)?;
        let models = vec![("full".to_owned(), fit.to_model(&model, provenance()?)?)];
        let urdf = Model::default();
        Ok(recorded(
            &urdf,
            &logs[n],
            &candidates(&urdf, models),
            |_, _| {},
        )?)
    })?;
    let mut text = String::from(
        "Recorded chirps of a Go2 hung in the air, all twelve joints, each judged with what the other four say (viscous, Coulomb, \
         armature, bias; bodies physical): feedback torque in N m rms, and its share of the torque's square.\n\n\
         | log | URDF | friction only | full |\n|---|---|---|---|\n",
    );
    for (log, all) in logs.iter().zip(&judged) {
        let cell = |name: &str| {
            let own = all.0.iter().find(|f| f.model == name);
            own.map_or_else(String::new, |f| {
                format!("{:.3} ({:.1} %)", f.rms, f.share_percent)
            })
        };
        writeln!(
            text,
            "| {} | {} | {} | {} |",
            log.file_stem().unwrap_or_default().to_string_lossy(),
            cell("URDF"),
            cell("full, friction only"),
            cell("full")
        )?;
    }
    Ok(text)
}

//! The loop from Rust on logs of which all is known: what the crate's own example does not show.

use std::path::{Path, PathBuf};

use proprio::{Error, Model};
use proprio_core::go2::Leg;
use proprio_host::log::LogWriter;
use proprio_simulator::Simulation;
use proprio_simulator::hidden::typical;
use tempfile::TempDir;

/// A leg with typical friction, as a log; what is measured passes through `change` (time, then positions, velocities, torques).
fn log(
    folder: &TempDir,
    duration: f64,
    change: impl Fn(f64, [Vec<f64>; 3]) -> [Vec<f64>; 3],
) -> PathBuf {
    let simulation = Simulation {
        effects: typical(&[Leg::FR]),
        duration,
        ..Simulation::new(&[Leg::FR])
    };
    let mut log = LogWriter::new(Vec::new(), &simulation.legs).unwrap();
    for sample in simulation.samples() {
        let sample = sample.unwrap();
        let [q, dq, tau] = change(sample.t, [sample.q, sample.dq, sample.tau]);
        log.row(sample.t, &q, &dq, &tau).unwrap();
    }
    let path = folder.path().join("log.csv");
    std::fs::write(&path, log.finish().unwrap()).unwrap();
    path
}

/// As it is measured.
fn plain(folder: &TempDir, duration: f64) -> PathBuf {
    log(folder, duration, |_, measured| measured)
}

/// A Go2 with the friction of every drive.
fn with_friction() -> Model {
    let effects = ["viscous", "coulomb", "armature", "bias"];
    effects.iter().fold(Model::go2(), |model, effect| {
        proprio::add(&model, effect).unwrap()
    })
}

#[test]
fn torque_at_the_logs_own_rate_has_the_impulse_of_each_window() {
    let folder = tempfile::tempdir().unwrap();
    let model = with_friction();
    let recording = proprio::read(&[plain(&folder, 10.0)], &model).unwrap();
    let model = proprio::identify(&recording, &model).unwrap().model;
    let windows = proprio::compare(&recording, &model).unwrap();
    assert!(!windows.fitted, "the model has its own values");
    let samples = proprio::predict(&recording, &model);
    assert_eq!(windows.joints.len(), samples.len());
    let mut compared = 0;
    for (windows, samples) in windows.joints.iter().zip(&samples) {
        assert_eq!(windows.joint, samples.joint);
        // Every sample but the first and last: 10 s at 500 Hz.
        assert!(
            samples
                .t
                .windows(2)
                .all(|t| (t[1] - t[0] - 0.002).abs() < 1e-9)
        );
        let index = |t: f64| (t / 0.002).round() as usize - 1;
        for (w, &middle) in windows.t.iter().enumerate() {
            // A window of ten periods is five of two, whose torques are its mean: nothing else is in it.
            let own = [-0.008, -0.004, 0.0, 0.004, 0.008].map(|off| index(middle + off));
            for (k, off) in own.iter().zip([-0.008, -0.004, 0.0, 0.004, 0.008]) {
                assert!((samples.t[*k] - middle - off).abs() < 1e-9);
            }
            let mean = |x: &[f64]| own.iter().map(|&k| x[k]).sum::<f64>() / 5.0;
            assert!((mean(&samples.predicted) - windows.predicted[w]).abs() < 1e-9);
            assert!((mean(&samples.tau) - windows.tau[w]).abs() < 1e-9);
            compared += 1;
        }
    }
    assert!(compared > 900, "{compared} windows");
}

#[test]
fn steps_give_new_values_and_leave_the_old() {
    let folder = tempfile::tempdir().unwrap();
    let bare = Model::go2();
    let model = proprio::add(&bare, "coulomb:FR_hip").unwrap();
    assert_eq!(bare.effects().count(), 0);
    assert_eq!(model.effects().collect::<Vec<_>>(), ["coulomb:FR_hip"]);
    assert_eq!(proprio::add(&model, "coulomb:FR_hip").unwrap(), model);
    assert_eq!(bare.joints().count(), 12);
    let recording = proprio::read(&[plain(&folder, 10.0)], &model).unwrap();
    let fitted = proprio::identify(&recording, &model).unwrap();
    assert_ne!(fitted.model, model);
    let file = folder.path().join("go2.toml");
    fitted.model.save(&file).unwrap();
    let again = Model::load(&file).unwrap();
    let [given, read] =
        [&fitted.model, &again].map(|model| proprio::compare(&recording, model).unwrap().rms);
    assert!((given - read).abs() < 1e-9, "{given} and {read} N m");
}

#[test]
fn a_page_is_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let model = with_friction();
    let recording = proprio::read(&[plain(&folder, 10.0)], &model).unwrap();
    let comparison = proprio::compare(&recording, &model).unwrap();
    assert!(comparison.fitted, "the model's effects have no value yet");
    let page = folder.path().join("page.html");
    proprio::report(&comparison, &recording, &model, &page).unwrap();
    // A number and its unit stay on one line there.
    let page = std::fs::read_to_string(page)
        .unwrap()
        .replace('\u{a0}', " ");
    let said = format!("{comparison}");
    let headline = said.lines().next().unwrap();
    assert!(page.contains(headline), "{headline}");
}

#[test]
fn errors_say_what_a_program_asks_for() {
    let folder = tempfile::tempdir().unwrap();
    let model = Model::go2();
    let Err(Error::UnknownName { what, nearest, .. }) = proprio::add(&model, "coulomb:FR_knee")
    else {
        panic!("there is no such joint");
    };
    assert_eq!((what, nearest.as_deref()), ("joint", Some("FR_calf")));
    let missing = proprio::read(&[Path::new("no such log.csv")], &model);
    assert!(matches!(missing, Err(Error::Log(_))), "{missing:?}");
    assert!(matches!(
        Model::load("no such file.toml"),
        Err(Error::Model(_))
    ));
    let recording = proprio::read(&[plain(&folder, 1.0)], &model).unwrap();
    let short = proprio::diagnose(&recording, &model);
    assert!(matches!(short, Err(Error::TooShort { .. })), "{short:?}");
    let nowhere = model.save("no such folder/model.toml");
    assert!(matches!(nowhere, Err(Error::Write { .. })), "{nowhere:?}");
}

#[test]
fn a_log_that_is_not_of_the_model_is_not_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let model = Model::go2();
    let turned = log(&folder, 10.0, |_, [q, dq, tau]| {
        [q, dq, tau.into_iter().map(|tau| -tau).collect()]
    });
    let recording = proprio::read(&[turned], &model).unwrap();
    let diagnosis = proprio::diagnose(&recording, &model);
    let Err(Error::Mismatch(told)) = diagnosis else {
        panic!("{diagnosis:?}");
    };
    assert!(told[0].contains("sign"), "{told:?}");
}

#[test]
fn a_joint_that_rests_tells_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let model = with_friction();
    let resting = log(&folder, 10.0, |_, [_, dq, tau]| {
        [vec![0.0, 0.8, -1.5], vec![0.0; dq.len()], tau]
    });
    let recording = proprio::read(&[resting], &model).unwrap();
    let fitted = proprio::identify(&recording, &model);
    assert!(matches!(fitted, Err(Error::AtRest)), "{fitted:?}");
}

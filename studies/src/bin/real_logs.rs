//! Models against recorded logs that their fit has not seen: `cargo run --release -p proprio-studies --bin real_logs`.
//!
//! Prints `studies/real_logs.md`. R² = 1 − RSS/TSS of the mean torque over 20 ms windows in which the joint moves, averaged over
//! the twelve joints. Without the recorded logs it says so and ends.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use proprio_core::Real;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::{EFFECTS, LegPrior, LegSolver};
use proprio_core::go2::Leg;
use proprio_host::compare::ValuesFrom;
use proprio_host::compare::compare;
use proprio_host::diagnose::diagnose;
use proprio_host::identify::{FitOptions, Fitted, fit_model};
use proprio_host::model::{Model, Provenance};
use proprio_host::recording::Recording;
use proprio_studies::ladder::ladder;
use proprio_tests::command::recorded_logs;
use proprio_tests::device_fit::{ConsistentFit, Failure, STARTS, factors};
use proprio_tests::prior_reach::{distance, inertias};

const TRAIN: &str = "9.0hz_p25d1.2";
const PREDICT: [&str; 3] = ["9.0hz_p25d5.0", "7.0hz_p25d5.0", "2.0hz_p25d3.0"];
const ALL: [&str; 5] = [
    "9.0hz_p25d1.2",
    "9.0hz_p25d2.0",
    "9.0hz_p25d5.0",
    "7.0hz_p25d5.0",
    "2.0hz_p25d3.0",
];
/// Mean R² of the plain prototype, some of whose values are unphysical.
const PROTOTYPE: [f64; 3] = [0.915, 0.906, 0.798];

/// What the table of consistent fits is of.
const CONSISTENT: &str = "\
The device's, leg by leg, also of a walking robot, whose base is not pinned as the model has it: then the free fit is absurd.
Smallest: eigenvalue of P₀⁻¹P over the bodies, P₀ the CAD's pseudo-inertia; below zero no body is like this. Misfit: sum of
squared residuals over the free fit's. Cost: with the prior, over that at the free fit; – where the free fit is unphysical,
and no physical one is near it. The free fit's prior is a parabola about the CAD; this one's rises without limit towards
bodies that cannot be, and pulls at light ones before. So there are two costs: the one that this fit minimises, which is at most
one, and the free fit's own, which is at least one and says what being physical costs. Steps: from the CAD, and the most
from STARTS random starts up to ten times as heavy or light. Apart: the farthest answer, σ.
";

/// What is added to the four effects that every joint has, step by step.
const STEPS: [(&str, &[&str]); 6] = [
    ("viscous, coulomb, armature, bias", &[]),
    (
        "+ velocity_gain of FR_hip, FR_thigh",
        &["velocity_gain:FR_hip", "velocity_gain:FR_thigh"],
    ),
    ("+ elasticity", &["elasticity"]),
    ("+ delay", &["delay"]),
    ("+ stribeck", &["stribeck"]),
    ("+ spring", &["spring"]),
];

fn main() -> ExitCode {
    let Some(folder) = recorded_logs() else {
        return ExitCode::SUCCESS;
    };
    let told = report(&folder).and_then(|()| together(&folder));
    match told.and_then(|()| steps(&folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("real_logs: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The ladder of all logs, each held out in turn.
fn together(folder: &Path) -> Result<(), Failure> {
    let all: Vec<PathBuf> = ALL.into_iter().map(|name| log(folder, name)).collect();
    let model = Model::default();
    let diagnosis = diagnose(&Recording::read(&all, &model, |_, _| {})?, &model)?;
    println!(
        "\nWhat `proprio diagnose` adds to the URDF on all five logs, each predicted by the others; rms N m over all joints:\n"
    );
    println!("| step | all | {} |", ALL.join(" | "));
    println!("|---|---|{}", "---|".repeat(ALL.len()));
    let row = |step: &str, rms: f64, logs: &[f64]| {
        let logs: Vec<String> = logs.iter().map(|rms| format!("{rms:.4}")).collect();
        println!("| {step} | {rms:.4} | {} |", logs.join(" | "));
    };
    row("the URDF alone", diagnosis.held_out_rms, &diagnosis.log_rms);
    for step in &diagnosis.path {
        row(&step.to_string(), step.held_out_rms, &step.log_rms);
    }
    Ok(())
}

/// The ladder of one log on the others.
fn steps(folder: &Path) -> Result<(), Failure> {
    let names: Vec<&str> = ALL.into_iter().filter(|name| *name != TRAIN).collect();
    println!(
        "\nWhat `proprio diagnose` adds to the URDF on `{TRAIN}`, its values fitted there, physical; error in the other logs, rms"
    );
    println!("N m over all joints:\n\n| step | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(names.len()));
    let read = |name: &str| Recording::read(&[log(folder, name)], &Model::default(), |_, _| {});
    let others = names
        .iter()
        .map(|name| read(name))
        .collect::<Result<Vec<_>, _>>()?;
    for rung in ladder(&read(TRAIN)?, &others)? {
        let errors: Vec<String> = rung.elsewhere.iter().map(|e| format!("{e:.4}")).collect();
        println!("| {} | {} |", rung.step, errors.join(" | "));
    }
    Ok(())
}

fn log(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("go2_air_chirp_{name}.csv"))
}

fn report(folder: &Path) -> Result<(), Failure> {
    println!("# Real logs, held out across files\n");
    println!(
        "Made by `cargo run --release -p proprio-studies --bin real_logs`. Fitted to `{TRAIN}` alone, every value physical;"
    );
    println!(
        "mean R² over the twelve joints of mean torques over 20 ms windows in which the joint moves, but for a sample at most."
    );
    println!("Velocities are local parabolas over 17 ms.\n");
    println!(
        "The effects were chosen among some twenty sets by these very columns, so that the last rows flatter a little."
    );
    println!("The prototype's figures are over all windows.\n");
    println!(
        "| model | held out in the same log, rms N m | {} | physical |",
        PREDICT.join(" | ")
    );
    println!("|---|---|---|---|---|---|");
    let prototype = PROTOTYPE.map(|r2| format!("{r2:.3}"));
    println!(
        "| plain prototype (issue 3) | – | {} | no |",
        prototype.join(" | ")
    );
    let model = Model::default();
    let train = Recording::read(&[log(folder, TRAIN)], &model, |_, _| {})?;
    let others: Vec<Recording> = PREDICT
        .iter()
        .map(|name| Recording::read(&[log(folder, name)], &model, |_, _| {}))
        .collect::<Result<_, _>>()?;
    let (mut model, mut last) = (model, None);
    for effect in EFFECTS {
        add(&mut model, effect.name())?;
    }
    for (words, effects) in STEPS {
        for effect in effects {
            add(&mut model, effect)?;
        }
        let options = FitOptions::PHYSICAL;
        let fitted = fit_model(&train, &model, options)?;
        let filled = fitted.to_model(
            &model,
            Provenance::of(&train.logs).map_err(|(log, e)| format!("{log}: {e}"))?,
        )?;
        let all: Vec<Vec<f64>> = others
            .iter()
            .map(|other| r2(other, &filled))
            .collect::<Result<_, _>>()?;
        let means: Vec<String> = all.iter().map(|r2| format!("{:.3}", mean(r2))).collect();
        let held_out = fitted.held_out_rms.unwrap_or(f64::NAN);
        println!(
            "| {words} | {held_out:.4} | {} | {} |",
            means.join(" | "),
            if is_physical(&filled, &fitted) {
                "yes"
            } else {
                "NO"
            }
        );
        last = Some((fitted, all));
    }
    if let Some((fitted, all)) = last {
        println!("\nR² of the last model joint by joint, and its parameters:\n");
        println!("| joint | {} |", PREDICT.join(" | "));
        println!("|---|---|---|---|");
        for (j, joint) in fitted.joints.iter().enumerate() {
            let cells: Vec<String> = all.iter().map(|r2| format!("{:.3}", r2[j])).collect();
            println!("| {} | {} |", joint.joint, cells.join(" | "));
        }
        println!("\n| parameter | value | std | prior | status |\n|---|---|---|---|---|");
        for p in fitted
            .parameters
            .iter()
            .map(|p| &p.estimate)
            .filter(|p| !p.is_inertial())
        {
            let status = format!("{:?}", p.status).to_lowercase();
            let bound = if p.at_bound { ", at its bound" } else { "" };
            println!(
                "| {} ({}) | {:.4} | {:.4} | {:.4} ± {:.4} | {status}{bound} |",
                p.name, p.unit, p.value, p.std, p.prior, p.prior_std
            );
        }
    }
    reach(folder)?;
    consistent(folder)?;
    precision(folder)
}

fn add(model: &mut Model, text: &str) -> Result<(), Failure> {
    let (name, joint) = text
        .split_once(':')
        .map_or((text, None), |(name, joint)| (name, Some(joint)));
    let effect = EffectKind::from_name(name).ok_or("no such effect")?;
    for joint in model.robot().place(effect, joint)? {
        model.add_effect(effect, joint);
    }
    Ok(())
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// R² of each joint's torque.
fn r2(recording: &Recording, model: &Model) -> Result<Vec<f64>, Failure> {
    let comparison = compare(recording, model, ValuesFrom::Given)?;
    let of = |fit: Option<f64>| fit.map_or(f64::NAN, |fit| 1.0 - (1.0 - fit / 100.0).powi(2));
    Ok(comparison
        .joints
        .iter()
        .map(|joint| of(joint.scores.fit_percent))
        .collect())
}

/// Whether every body could exist and every effect is within its bounds.
fn is_physical(model: &Model, fitted: &Fitted) -> bool {
    let bodies = (0..model.robot().bodies().len()).all(|b| model.inertia(b).is_physical());
    let effects = model.effects().iter().all(|e| {
        let parameters = e.effect.description().parameters.iter().zip(&e.estimates);
        parameters
            .flat_map(|(p, estimate)| estimate.map(|e| (p.lower..=p.upper).contains(&e.value)))
            .all(|within| within)
    });
    bodies
        && effects
        && fitted
            .parameters
            .iter()
            .all(|p| p.estimate.value.is_finite())
}

/// Differences between `f32` and `f64` in units of the standard deviation: the device's estimator on each log.
fn precision(folder: &Path) -> Result<(), Failure> {
    println!("\n## f32 against f64\n");
    println!(
        "The device's estimator (four legs of 42 parameters, free) on each log: differences in standard deviations.\n"
    );
    println!("| log | largest | its parameter | root mean square |\n|---|---|---|---|");
    for name in ALL {
        let (mut worst, mut which, mut squares, mut count) = (0.0f64, String::new(), 0.0, 0);
        for leg in Leg::ALL {
            let (double, std) = solve::<f64>(&log(folder, name), leg, |x| x, |x| x)?;
            let (single, _) = solve::<f32>(&log(folder, name), leg, |x| x as f32, f64::from)?;
            let names = proprio_host::parameter::names_of_leg(leg);
            for (k, (parameter, _)) in names.iter().enumerate() {
                let off = (single[k] - double[k]).abs() / std[k];
                (squares, count) = (squares + off * off, count + 1);
                if off > worst {
                    (worst, which) = (off, parameter.clone());
                }
            }
        }
        println!(
            "| {name} | {worst:.1e} | {which} | {:.1e} |",
            (squares / f64::from(count)).sqrt()
        );
    }
    Ok(())
}

/// A leg's θ and standard deviations.
fn solve<T: Real>(
    log: &Path,
    leg: Leg,
    to: impl Fn(f64) -> T,
    from: impl Fn(T) -> f64,
) -> Result<(Vec<f64>, Vec<f64>), Failure> {
    let factors = factors(log, leg, to)?;
    let mut solver = LegSolver::<T>::default();
    solver.start(&LegPrior::of(leg), &factors);
    while !solver.advance().map_err(|e| e.to_string())? {}
    let all = |x: &[T]| x.iter().map(|x| from(*x)).collect();
    Ok((all(solver.values()), all(solver.std())))
}

/// Hip and calf inertias on each log.
fn reach(folder: &Path) -> Result<(), Failure> {
    println!("\n## Hip and calf inertias\n");
    println!(
        "About the joints, 10⁻³ kg m²; viscous, coulomb, armature, bias at every joint, every value physical. A study of such a leg"
    );
    println!(
        "found 146 for a hip whose CAD says 0.48. *unexcited*: the motion does not show it, the CAD stands; *prior*: mostly the CAD."
    );
    println!(
        "Beyond three of the CAD's standard deviations the model lacks something: a calf's inertia and its rotor's, whose sum is well"
    );
    println!("known, are told apart by what the thigh feels.\n");
    println!(
        "| log | inertia | CAD | estimate | std | from the CAD, its std | status |\n|---|---|---|---|---|---|---|"
    );
    for name in ALL {
        for p in inertias(&log(folder, name), &EFFECTS)? {
            println!(
                "| {name} | {} | {:.3} ± {:.3} | {:.3} | {:.3} | {:+.2} | {} |",
                p.name,
                1e3 * p.prior,
                1e3 * p.prior_std,
                1e3 * p.value,
                1e3 * p.std,
                distance(&p),
                format!("{:?}", p.status).to_lowercase()
            );
        }
    }
    Ok(())
}

/// The consistent fit of each leg of every log, the walking ones included.
fn consistent(folder: &Path) -> Result<(), Failure> {
    println!("\n## The physically consistent fit\n");
    println!("{}", CONSISTENT.replace("STARTS", &STARTS.to_string()));
    println!(
        "| log | leg | free fit: impossible bodies, negative effects, smallest | smallest | misfit | cost, own and free | steps | \
         apart |\n|---|---|---|---|---|---|---|---|"
    );
    let mut logs: Vec<PathBuf> = std::fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, std::io::Error>>()?;
    logs.retain(|path| path.extension().is_some_and(|e| e == "csv"));
    logs.sort();
    for log in &logs {
        let stem = log.file_stem().map(|s| s.to_string_lossy().into_owned());
        let name = stem.unwrap_or_default();
        for leg in Leg::ALL {
            let fit = ConsistentFit::of(leg, &factors(log, leg, |x| x)?)?;
            let cost = fit.cost;
            let cost = cost.map_or("–".to_owned(), |[own, free]| {
                format!("{own:.4}, {free:.4}")
            });
            let [free, smallest] = fit.smallest;
            let [cad, random] = fit.iterations;
            println!(
                "| {name} | {} | {}, {}, {free:.1e} | {smallest:.1e} | {:.4} | {cost} | {cad}, {random} | {:.0e} |",
                leg.name(),
                fit.impossible,
                fit.negative,
                fit.misfit,
                fit.apart
            );
        }
    }
    Ok(())
}

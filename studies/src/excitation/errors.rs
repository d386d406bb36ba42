//! Errors of the base parameters after a designed motion, a chirp and a random motion of the same length.

use std::fmt::Write;
use std::sync::Arc;

use proprio_host::excite::{Goal, RandomMotions, Settings};
use proprio_host::identifiability::BaseParameter;
use proprio_host::identify::FitOptions;
use proprio_host::model::Model;
use proprio_simulator::{Followed, Simulation};

use super::condition::designed;
use super::robots::{
    FAST, INERTIA_ERROR, LEG, PLAIN, chirp, fitted, model_with, played, robot, settings,
};
use super::{Failure, each};

/// With this relative deviation of the CAD's bodies a prior says nothing.
const NO_PRIOR: f64 = 30.0;

/// What is followed.
enum Reference {
    Same(Arc<Followed>),
    Random(Box<RandomMotions>),
}

/// A base parameter of one robot: its error and its prior's standard deviation.
struct Error {
    name: String,
    error: f64,
    prior_std: f64,
}

/// The study over so many robots.
///
/// # Errors
/// No motion, a simulation that diverges.
pub fn study(robots: usize) -> Result<String, Failure> {
    let cad = Model::default();
    let limb = &cad.robot().limbs()[LEG.index()];
    let design = |goal| -> Result<Reference, Failure> {
        let (designs, ..) = designed(&[LEG.index()], &settings(goal))?;
        Ok(Reference::Same(played(&cad, &designs)?))
    };
    let references = [
        ("designed, condition number", design(Goal::Condition)?),
        ("designed, determinant", design(Goal::Determinant)?),
        (
            "random Fourier, another for each robot",
            Reference::Random(Box::new(RandomMotions::new(
                &cad,
                limb,
                &Settings::default(),
            )?)),
        ),
        ("chirp, 0.1 to 9 Hz in phase", Reference::Same(chirp(FAST)?)),
    ];
    let mut weak = model_with(&PLAIN);
    weak.set_cad_uncertainty(None, NO_PRIOR)?;
    let with_cad = model_with(&PLAIN);
    let mut tables = Vec::new();
    for (name, reference) in &references {
        let all = each(name, robots, |n| {
            let robot = robot(n as u64 + 1);
            let motion = match reference {
                Reference::Same(motion) => motion.clone(),
                Reference::Random(motions) => {
                    let motion = motions.motion(n as u64).ok_or("no random motion")?;
                    played(&cad, &[motion])?
                }
            };
            let own = |model| of_robot(&robot, &motion, model);
            Ok([own(&weak)?, own(&with_cad)?])
        })?;
        tables.push((*name, all));
    }
    report(robots, &tables)
}

/// The errors of one robot's base parameters.
fn of_robot(
    robot: &Simulation,
    motion: &Arc<Followed>,
    model: &Model,
) -> Result<Vec<Error>, Failure> {
    let fitted = fitted(robot, motion, model, FitOptions::default())?;
    let truth = robot.truth();
    let true_value = |parameter: &BaseParameter| -> f64 {
        let term = |name: &str| {
            truth
                .iter()
                .find(|t| t.name == name)
                .map_or(0.0, |t| t.value)
        };
        let terms = parameter.terms.iter();
        terms.map(|t| t.coefficient * term(&t.parameter)).sum()
    };
    Ok(fitted
        .base_parameters
        .iter()
        .map(|parameter| Error {
            name: parameter.terms[0].parameter.clone(),
            error: parameter.value - true_value(parameter),
            prior_std: parameter.prior_std,
        })
        .collect())
}

/// Root mean square error of each base parameter over the robots, by name.
fn rms(all: &[[Vec<Error>; 2]], which: usize) -> Vec<(String, f64)> {
    let Some(first) = all.first() else {
        return Vec::new();
    };
    let of = |name: &str| {
        let own = all.iter().flat_map(|robot| &robot[which]);
        let squares = own.filter(|e| e.name == name).map(|e| e.error * e.error);
        (squares.sum::<f64>() / all.len() as f64).sqrt()
    };
    let names = first[which].iter().map(|e| e.name.clone());
    names.map(|name| (name.clone(), of(&name))).collect()
}

type Table = Vec<[Vec<Error>; 2]>;

fn report(robots: usize, tables: &[(&str, Table)]) -> Result<String, Failure> {
    let mut text = format!(
        "{robots} simulated legs, bodies off the CAD by {:.0} %, typical friction, rotors and offsets, a Go2's sensors; each follows \
         each motion for 10 s and is identified with viscous, Coulomb, armature and bias. Error: root mean square over the robots of \
         each base parameter, in units of what the CAD leaves open of it, averaged over all of them; ratios to the chirp and to random \
         motions are averages over base parameters too.\n",
        100.0 * INERTIA_ERROR
    );
    let reference = tables.first().map(|(_, all)| all);
    let Some(units) = reference.and_then(|all| all.first()).map(|robot| &robot[1]) else {
        return Err("no robots".into());
    };
    for (which, words) in [(0, "By the data alone"), (1, "With the CAD as prior")] {
        let of: Vec<Vec<(String, f64)>> = tables.iter().map(|(_, all)| rms(all, which)).collect();
        let unit = |name: &str| units.iter().find(|e| e.name == name).map(|e| e.prior_std);
        writeln!(
            text,
            "\n{words}:\n\n| motion | error | of the chirp's | of random motions' |\n|---|---|---|---|"
        )?;
        for ((name, _), own) in tables.iter().zip(&of) {
            let scaled = own.iter().filter_map(|(n, e)| Some(e / unit(n)?));
            let scaled: Vec<f64> = scaled.collect();
            let ratio = |other: &[(String, f64)]| {
                let pairs = own.iter().filter_map(|(n, e)| {
                    let (_, o) = other.iter().find(|(name, _)| name == n)?;
                    Some(e / o)
                });
                let all: Vec<f64> = pairs.collect();
                all.iter().sum::<f64>() / all.len().max(1) as f64
            };
            writeln!(
                text,
                "| {name} | {:.3} | {:.2} | {:.2} |",
                scaled.iter().sum::<f64>() / scaled.len().max(1) as f64,
                ratio(&of[3]),
                ratio(&of[2]),
            )?;
        }
    }
    Ok(text)
}

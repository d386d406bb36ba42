//! The model file: TOML in, TOML out.
//!
//! It is written by hand so that keys stay where they are and a change of a value is a change of one line; numbers are the
//! shortest that read back the same.
//!
//! Files beside: `tables`, as serde reads them; `formulas`, effects that are a formula; `kinematics`, what calibration knows; `write`, the text.

mod formulas;
mod kinematics;
mod tables;
mod write;

use std::collections::BTreeMap;
use std::path::Path;

use crate::catalogue;
use nalgebra::SVector;
use proprio_core::effect::{EffectKind, Prior};
use proprio_core::inertia::InertialParameters;
use tables::{
    BaseTable, EffectTable, File, FootTable, ImuTable, LogSpeech, Mount, ParameterEntry,
    PriorEntry, PriorTable, RobotTable, Ten, TotalStd,
};
use toml::Spanned;
pub(super) use write::text;

use super::{
    BASE, Estimate, Foot, Impossible, ImuMount, LogConventions, LogRecord, Model, ModelError,
    ModelProblem, Motor, Mounting, Provenance, Robot, UnknownName, Witness,
    possible::{deviation, finite, in_bounds},
};

/// The newest format that this version reads, and the one it writes.
const FORMAT: i64 = 1;

/// How far a quaternion's length may be from 1: files round their numbers.
const QUATERNION_ROUNDING: f64 = 1e-6;

/// The keys of an effect; a formula has one more for each of its parameters.
const EFFECT_KEYS: [&str; 10] = [
    "name",
    "joint",
    "value",
    "std",
    "parameters",
    "prior",
    "measured_by",
    "just_added",
    "torque",
    "kind",
];

/// Byte offset in the file, if the fault has a place, and the fault.
type Fault = (Option<usize>, ModelProblem);

/// Reads a model file.
pub(super) fn load(path: &Path) -> Result<Model, ModelError> {
    let text = std::fs::read_to_string(path);
    let text = text.map_err(|e| error(path, None, ModelProblem::Read(e)))?;
    read(&text, path)
}

/// The model of the text of the file at `path`.
pub(super) fn read(text: &str, path: &Path) -> Result<Model, ModelError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(text, folder).map_err(|(offset, problem)| {
        let line = offset.map(|at| text.bytes().take(at).filter(|b| *b == b'\n').count() + 1);
        error(path, line, problem)
    })
}

fn error(path: &Path, line: Option<usize>, problem: ModelProblem) -> ModelError {
    ModelError {
        path: path.to_owned(),
        line,
        problem: Box::new(problem),
    }
}

/// The model of a file's text; paths in it are relative to `folder`.
fn parse(text: &str, folder: &Path) -> Result<Model, Fault> {
    let syntax = |e: &toml::de::Error| (e.span().map(|span| span.start), problem_of(e));
    // First alone: a newer file need not make sense otherwise.
    let table: toml::Table = text.parse().map_err(|e| syntax(&e))?;
    match table.get("format").and_then(toml::Value::as_integer) {
        None => return Err((None, ModelProblem::NoFormat)),
        Some(found) if found > FORMAT => {
            return Err((
                None,
                ModelProblem::Newer {
                    found,
                    newest: FORMAT,
                },
            ));
        }
        Some(_) => {}
    }
    let file: File = toml::from_str(text).map_err(|e| syntax(&e))?;
    let held: Vec<(String, f64)> = file
        .held
        .iter()
        .map(|(name, position)| (name.get_ref().clone(), *position))
        .collect();
    let mut model = Model::new(robot(&file.robot, folder, &held)?);
    if let Some(base) = &file.base {
        model.mounting = mounting(base)?;
    }
    read_motors(&mut model, &file)?;
    let conventions = read_conventions(&model, &file.log)?;
    model.robot.set_conventions(conventions);
    read_priors(&mut model, &file.prior)?;
    read_bodies(&mut model, &file)?;
    (file.foot.iter()).try_for_each(|foot| read_foot(&mut model, foot))?;
    if let Some(imu) = &file.imu {
        let imu = read_imu(&model, imu)?;
        model.set_imu(imu);
    }
    kinematics::read(&mut model, &file)?;
    file.effect
        .iter()
        .try_for_each(|effect| read_effect(&mut model, effect, text))?;
    let mount = file.base.as_ref().map(|base| &base.get_ref().mount);
    if matches!(mount, Some(Mount::Suspended)) {
        // What such a base does is an effect; one that has a value stands in the file already.
        for effect in EffectKind::OF_BASE {
            model.add_effect(effect, BASE);
        }
    }
    model.provenance = file.provenance.map(|table| Provenance {
        version: table.version,
        command: table.command,
        only: table.only,
        logs: table
            .log
            .into_iter()
            .map(|log| LogRecord {
                path: log.path,
                sha256: log.sha256,
            })
            .collect(),
    });
    Ok(model)
}

/// An unknown key is told from other faults, and its siblings found, by serde's message: there is no other way to them.
fn problem_of(error: &toml::de::Error) -> ModelProblem {
    let message = error.message();
    let mut quoted = message.split('`').skip(1).step_by(2);
    match (message.starts_with("unknown field"), quoted.next()) {
        (true, Some(name)) => ModelProblem::UnknownKey(UnknownName::new("key", name, quoted)),
        _ => ModelProblem::Syntax(message.to_owned()),
    }
}

fn robot(
    table: &Spanned<RobotTable>,
    folder: &Path,
    held: &[(String, f64)],
) -> Result<Robot, Fault> {
    let at = Some(table.span().start);
    match table.get_ref() {
        RobotTable {
            builtin: Some(_),
            urdf: None,
        } if !held.is_empty() => Err((at, ModelProblem::HeldWithoutUrdf)),
        RobotTable {
            builtin: Some(name),
            urdf: None,
        } if name == "go2" => Ok(Robot::go2()),
        RobotTable {
            builtin: Some(name),
            urdf: None,
        } => Err((
            at,
            ModelProblem::UnknownName(UnknownName::new("built-in robot", name, ["go2"])),
        )),
        RobotTable {
            builtin: None,
            urdf: Some(path),
        } => Robot::from_urdf_held(&folder.join(path), held)
            .map_err(|e| (at, ModelProblem::Robot(e))),
        _ => Err((at, ModelProblem::WhichRobot)),
    }
}

fn mounting(table: &Spanned<BaseTable>) -> Result<Mounting, Fault> {
    let BaseTable {
        rpy, quaternion, ..
    } = table.get_ref();
    let unit = |q: &[f64; 4]| {
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        (length - 1.0).abs() <= QUATERNION_ROUNDING
    };
    match (*rpy, *quaternion) {
        (None, None) => Ok(Mounting::Rpy([0.0; 3])),
        (Some(rpy), None) if rpy.iter().all(|x| x.is_finite()) => Ok(Mounting::Rpy(rpy)),
        (None, Some(q)) if unit(&q) => Ok(Mounting::Quaternion(q)),
        _ => Err((Some(table.span().start), ModelProblem::Orientation)),
    }
}

/// The index of a joint, or the fault at the place of its name.
fn joint(model: &Model, name: &str, at: usize) -> Result<usize, Fault> {
    let is_held = model.robot.held().iter().any(|(held, _)| held == name);
    let unknown = |unknown| match is_held {
        true => ModelProblem::IsHeld {
            joint: name.to_owned(),
        },
        false => ModelProblem::UnknownName(unknown),
    };
    let joint = model.robot.joint(name);
    joint.map_err(|e| (Some(at), unknown(e)))
}

fn effect_named(name: &str, at: usize) -> Result<EffectKind, Fault> {
    catalogue::effect_named(name).ok_or_else(|| {
        (
            Some(at),
            ModelProblem::UnknownName(UnknownName::new("effect", name, catalogue::names())),
        )
    })
}

fn impossible(at: usize, what: impl Into<String>) -> impl FnOnce(Impossible) -> Fault {
    move |fault| {
        (
            Some(at),
            ModelProblem::Impossible {
                what: what.into(),
                fault,
            },
        )
    }
}

fn read_motors(model: &mut Model, file: &File) -> Result<(), Fault> {
    for (name, table) in &file.motor {
        let at = name.span().start;
        let joint = joint(model, name.get_ref(), at)?;
        let what = format!("the motor of {}", name.get_ref());
        let bad = |value: f64| !(value.is_finite() && value > 0.0);
        let entries = [("gear", table.gear), ("rotor_inertia", table.rotor_inertia)];
        if let Some(&(symbol, value)) = entries.iter().find(|(_, value)| bad(*value)) {
            let fault = Impossible::Bounds {
                symbol,
                value,
                lower: 0.0,
                upper: f64::INFINITY,
            };
            return Err(impossible(at, what)(fault));
        }
        model.set_motor(
            joint,
            Motor {
                gear: table.gear,
                rotor_inertia: table.rotor_inertia,
            },
        );
    }
    Ok(())
}

fn read_conventions(model: &Model, table: &LogSpeech) -> Result<LogConventions, Fault> {
    let named = |name: &Spanned<String>| joint(model, name.get_ref(), name.span().start);
    let motors = table.motors.as_ref();
    let motors = motors.map(|names| names.iter().map(named).collect::<Result<Vec<_>, _>>());
    let mut at_motor = [false; 3];
    for signal in &table.at_motor {
        at_motor[*signal as usize] = true;
    }
    let mut transmission = Vec::new();
    for (motor, ratios) in &table.transmission {
        let of = |(name, ratio): (&Spanned<String>, &f64)| {
            let joint = named(name)?;
            if ratio.is_finite() && *ratio != 0.0 {
                return Ok((joint, *ratio));
            }
            let what = format!("the transmission of {}", motor.get_ref());
            let fault = Impossible::Bounds {
                symbol: "ratio",
                value: *ratio,
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
            };
            Err(impossible(name.span().start, what)(fault))
        };
        let ratios = ratios.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        transmission.push((named(motor)?, ratios));
    }
    Ok(LogConventions {
        motors: motors.transpose()?,
        at_motor,
        transmission,
    })
}

fn read_priors(model: &mut Model, table: &PriorTable) -> Result<(), Fault> {
    if let Some(relative) = &table.cad_uncertainty {
        let what = "cad_uncertainty";
        model
            .set_cad_uncertainty(None, *relative.get_ref())
            .map_err(impossible(relative.span().start, what))?;
    }
    for (name, relative) in &table.body {
        let at = relative.span().start;
        let body = joint(model, name.get_ref(), name.span().start)?;
        let what = format!("the prior of body {}", name.get_ref());
        model
            .set_cad_uncertainty(Some(body), *relative.get_ref())
            .map_err(impossible(at, what))?;
    }
    for (name, prior) in &table.effect {
        let at = name.span().start;
        let effect = effect_named(name.get_ref(), at)?;
        let what = format!("the prior of {}", name.get_ref());
        model
            .set_general_prior(
                effect,
                Prior {
                    mean: prior.mean,
                    std: prior.std,
                },
            )
            .map_err(impossible(at, what))?;
    }
    Ok(())
}

fn read_bodies(model: &mut Model, file: &File) -> Result<(), Fault> {
    for (name, table) in &file.body {
        let at = name.span().start;
        let body = match name.get_ref().as_str() {
            // A joint may be called so as well.
            "base" if model.robot.bodies().iter().all(|body| body.name != "base") => BASE,
            name => joint(model, name, at)?,
        };
        let phi = InertialParameters(SVector::from(table.array()));
        let std = table.std.map(Ten::array);
        let what = format!("body {}", name.get_ref());
        model
            .place_body(body, phi, std)
            .map_err(impossible(at, what))?;
    }
    if let Some(table) = &file.total {
        let TotalStd { m, x, y, z } = table.get_ref().std;
        model
            .set_total_std([m, x, y, z])
            .map_err(impossible(table.span().start, "the total"))?;
    }
    Ok(())
}

fn read_foot(model: &mut Model, entry: &Spanned<FootTable>) -> Result<(), Fault> {
    let (at, table) = (entry.span().start, entry.get_ref());
    let frame = model.robot.frame(&table.link);
    let frame = frame.map_err(|e| (Some(at), ModelProblem::UnknownName(e)))?;
    let limb = |body: usize| {
        let limbs = model.robot.limbs();
        let own = limbs.into_iter().find(|limb| limb.bodies.contains(&body));
        own.map(|limb| limb.name)
    };
    let own = frame.body.and_then(limb);
    let name = table.name.clone().or(own);
    let mut foot = Foot::on(&name.unwrap_or_else(|| table.link.clone()), &table.link);
    match (&table.points, table.place, frame.sphere) {
        (Some(points), ..) => foot.points.clone_from(points),
        (None, Some(place), _) => foot.points = vec![place],
        (None, None, Some((centre, radius))) => {
            foot.points = vec![centre.into()];
            foot.radius = radius;
        }
        (None, None, None) => {}
    }
    foot.radius = table.radius.unwrap_or(foot.radius);
    foot.radius_std = table.radius_std.unwrap_or(foot.radius_std);
    foot.sensor = table.sensor.unwrap_or(foot.sensor);
    let what = format!("the foot {}", foot.name);
    model.add_foot(foot).map_err(impossible(at, what))
}

fn read_imu(model: &Model, entry: &Spanned<ImuTable>) -> Result<ImuMount, Fault> {
    let (at, table) = (entry.span().start, entry.get_ref());
    let own = model.robot.base_link().to_owned();
    let link = table.link.clone().unwrap_or(own);
    let frame = model.robot.frame(&link);
    let frame = frame.map_err(|e| (Some(at), ModelProblem::UnknownName(e)))?;
    if frame.body.is_some() {
        let base = model.robot.frames().iter();
        let base = base.filter(|frame| frame.body.is_none());
        let fixed = UnknownName::new("link of the base", &link, base.map(|f| f.link.as_str()));
        return Err((Some(at), ModelProblem::UnknownName(fixed)));
    }
    let mut imu = ImuMount::on(&link);
    imu.place = table.place.unwrap_or(imu.place);
    imu.rpy = table.rpy.unwrap_or(imu.rpy);
    imu.place_std = table.place_std.unwrap_or(imu.place_std);
    imu.turn_std = table.turn_std.unwrap_or(imu.turn_std);
    let numbers = imu.place.iter().chain(&imu.rpy);
    let deviations = [imu.place_std, imu.turn_std];
    let positive = |x: &f64| x.is_finite() && *x > 0.0;
    let wrong = numbers.copied().find(|x| !x.is_finite());
    match wrong.or(deviations.into_iter().find(|x| !positive(x))) {
        None => Ok(imu),
        Some(value) => {
            let fault = Impossible::Bounds {
                symbol: "imu",
                value,
                lower: 0.0,
                upper: f64::INFINITY,
            };
            Err(impossible(at, "the IMU")(fault))
        }
    }
}

/// The place of an effect: a joint, or the base.
fn effect_joint(model: &Model, effect: EffectKind, name: &str, at: usize) -> Result<usize, Fault> {
    match model.robot.place(effect, Some(name)) {
        Ok(places) => Ok(places[0]),
        Err(e) => Err((Some(at), ModelProblem::UnknownName(e))),
    }
}

/// All parameters but the first.
fn read_more_parameters(
    model: &mut Model,
    (effect, joint): (EffectKind, usize),
    table: &EffectTable,
    at: usize,
) -> Result<(), Fault> {
    let known = || effect.description().parameters.iter().map(|p| p.symbol);
    for (symbol, entry) in &table.parameters {
        let Some(parameter) = known().skip(1).position(|known| known == symbol) else {
            let unknown = UnknownName::new("parameter", symbol, known().skip(1));
            return Err((Some(at), ModelProblem::UnknownName(unknown)));
        };
        let what = format!("{symbol} of {}:{}", effect.name(), table.joint);
        model
            .place_parameter(effect, joint, parameter + 1, entry.value, entry.std)
            .map_err(impossible(at, what))?;
    }
    Ok(())
}

/// What each witness measured of a number `what` that a check lets in.
fn read_witnesses(
    measured_by: &BTreeMap<String, ParameterEntry>,
    what: &str,
    at: usize,
    check: impl Fn(f64) -> Result<f64, Impossible>,
) -> Result<[Option<Estimate>; 3], Fault> {
    let mut slots = [None; 3];
    for (name, &ParameterEntry { value, std }) in measured_by {
        let all = Witness::ALL.iter();
        let Some(slot) = all.clone().position(|witness| witness.key() == name) else {
            let unknown = UnknownName::new("witness", name, all.map(|witness| witness.key()));
            return Err((Some(at), ModelProblem::UnknownName(unknown)));
        };
        let own = || format!("{name} of {what}");
        check(value).map_err(impossible(at, own()))?;
        let std = std.map(deviation).transpose();
        let std = std.map_err(impossible(at, own()))?;
        slots[slot] = Some(Estimate { value, std });
    }
    Ok(slots)
}

fn read_effect(model: &mut Model, entry: &Spanned<EffectTable>, text: &str) -> Result<(), Fault> {
    let (at, table) = (entry.span().start, entry.get_ref());
    // The keys that are no parameter of a formula, which serde gives together with those that are.
    let is_stray =
        |(_, value): &(&String, &toml::Value)| table.torque.is_none() || !value.is_table();
    if let Some((unknown, _)) = table.symbols.iter().find(is_stray) {
        let own = text.get(at..).unwrap_or_default();
        let place = own.find(&format!("\n{unknown}")).map_or(at, |n| at + n + 1);
        let unknown = UnknownName::new("key", unknown, EFFECT_KEYS);
        return Err((Some(place), ModelProblem::UnknownKey(unknown)));
    }
    for (key, value) in [("name", &table.name), ("joint", &table.joint)] {
        if value.is_empty() {
            let problem = ModelProblem::Syntax(format!("missing field `{key}`"));
            return Err((Some(at), problem));
        }
    }
    if table.torque.is_some() {
        return formulas::read(model, at, table);
    }
    let effect = effect_named(&table.name, at)?;
    let joint = effect_joint(model, effect, &table.joint, at)?;
    let (name, of) = (effect.name(), table.joint.clone());
    if !model.add_effect(effect, joint) {
        return Err((
            Some(at),
            ModelProblem::Twice {
                effect: name,
                joint: of,
            },
        ));
    }
    model.entry(effect, joint).just_added = table.just_added;
    let what = format!("{name}:{of}");
    match (table.value, table.std) {
        (Some(value), std) => {
            model
                .place_parameter(effect, joint, 0, value, std)
                .map_err(impossible(at, what))?;
            read_more_parameters(model, (effect, joint), table, at)?;
            let what = format!("{}:{}", effect.name(), table.joint);
            let check = |value| in_bounds(effect, 0, value);
            let own = read_witnesses(&table.measured_by, &what, at, check)?;
            model.entry(effect, joint).witnesses = own;
        }
        (None, Some(_)) => {
            return Err((
                Some(at),
                ModelProblem::StdAlone {
                    effect: name,
                    joint: of,
                },
            ));
        }
        (None, None) => {}
    }
    if let Some(PriorEntry { mean, std }) = table.prior {
        let what = format!("the prior of {name}:{of}");
        model
            .set_effect_prior(effect, joint, Prior { mean, std })
            .map_err(impossible(at, what))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;

//! A model as the text of its file.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use proprio_core::effect::{EffectKind, Prior};
use proprio_core::inertia::{INERTIAL, NAMES};

use super::FORMAT;
use crate::catalogue;
use crate::formula::{Formula, Kind, Stated};
use crate::model::{
    BASE, Estimate, LogConventions, LogRecord, Model, ModelEffect, Motor, Mounting, Provenance,
    Source, Witness,
};

/// The file's text; `path` is where it goes, from which a URDF's path is told.
pub(in crate::model) fn text(model: &Model, path: &Path) -> String {
    let mut text = "# A robot as proprio knows it: SI units, joint side of the gear.\n".to_owned();
    // Writing to a String cannot fail.
    let _ = write(&mut text, model, path);
    text
}

fn write(out: &mut String, model: &Model, path: &Path) -> std::fmt::Result {
    writeln!(out, "format = {FORMAT}\n\n[robot]")?;
    match model.robot.source() {
        Source::Go2 => writeln!(out, "builtin = \"go2\"")?,
        Source::Urdf(urdf) => {
            writeln!(
                out,
                "urdf = {}",
                string(&relative(urdf, path).display().to_string())
            )?;
        }
    }
    let is_fixed = EffectKind::OF_BASE
        .iter()
        .all(|e| model.effect(*e, BASE).is_none());
    let mount = if is_fixed { "fixed" } else { "suspended" };
    writeln!(out, "\n[base]\nmount = \"{mount}\"")?;
    match &model.mounting {
        Mounting::Rpy(rpy) => writeln!(out, "rpy = {rpy:?}")?,
        Mounting::Quaternion(q) => writeln!(out, "quaternion = {q:?}")?,
    }
    write_held(out, model)?;
    write_conventions(out, model)?;
    write_priors(out, model)?;
    let named = || model.robot.bodies().iter().enumerate();
    for (joint, body) in named() {
        if let Some(Motor {
            gear,
            rotor_inertia,
        }) = model.motors[joint]
        {
            writeln!(
                out,
                "\n[motor.{}]\ngear = {gear:?}\nrotor_inertia = {rotor_inertia:?}",
                key(&body.name)
            )?;
        }
    }
    write_feet_and_imu(out, model)?;
    super::kinematics::write(out, model)?;
    for e in &model.effects {
        let joint = string(model.joint_name(e.joint));
        writeln!(
            out,
            "\n[[effect]]\nname = \"{}\"\njoint = {joint}",
            e.effect.name()
        )?;
        if let Some(formula) = catalogue::formula_of(e.effect) {
            write_formula(out, model, e, formula)?;
            continue;
        }
        if let Some(estimate) = e.estimate() {
            writeln!(out, "value = {:?}", estimate.value)?;
            if let Some(std) = estimate.std {
                writeln!(out, "std = {std:?}")?;
            }
        }
        write_more_parameters(out, e)?;
        if let Some(witnesses) = witnesses(&e.witnesses) {
            writeln!(out, "{witnesses}")?;
        }
        if let Some(Prior { mean, std }) = e.prior {
            writeln!(out, "prior = {{ mean = {mean:?}, std = {std:?} }}")?;
        }
        if e.just_added {
            writeln!(out, "just_added = true")?;
        }
    }
    let base = std::iter::once((BASE, "base"));
    for (b, name) in base.chain(named().map(|(b, body)| (b, body.name.as_str()))) {
        if let Some((phi, std)) = &model.body(b).inertia {
            writeln!(out, "\n[body.{}]", key(name))?;
            let entries = |x: &[f64; INERTIAL]| {
                NAMES
                    .iter()
                    .zip(*x)
                    .map(|(n, x)| format!("{n} = {x:?}"))
                    .collect::<Vec<_>>()
            };
            writeln!(out, "{}", entries(&phi.0.into()).join("\n"))?;
            if let Some(std) = std {
                writeln!(out, "std = {{ {} }}", entries(std).join(", "))?;
            }
        }
    }
    if let Some([m, x, y, z]) = model.total_std {
        writeln!(
            out,
            "\n[total]\nstd = {{ m = {m:?}, x = {x:?}, y = {y:?}, z = {z:?} }}"
        )?;
    }
    if let Some(provenance) = &model.provenance {
        let Provenance {
            version,
            command,
            logs,
            only,
        } = provenance;
        writeln!(
            out,
            "\n[provenance]\nversion = {}\ncommand = {}",
            string(version),
            string(command)
        )?;
        if !only.is_empty() {
            let only: Vec<String> = only.iter().map(|condition| string(condition)).collect();
            writeln!(out, "only = [{}]", only.join(", "))?;
        }
        for LogRecord { path, sha256 } in logs {
            writeln!(
                out,
                "\n[[provenance.log]]\npath = {}\nsha256 = {}",
                string(path),
                string(sha256)
            )?;
        }
    }
    Ok(())
}

/// An effect that is a formula, from its text on.
fn write_formula(
    out: &mut String,
    model: &Model,
    e: &ModelEffect,
    formula: &Formula,
) -> std::fmt::Result {
    let text = model.robot.formula_text(formula, e.joint);
    writeln!(out, "torque = {}", string(&text))?;
    if formula.kind != Kind::default() {
        writeln!(out, "kind = \"{}\"", formula.kind.name())?;
    }
    let parameters = e.effect.description().parameters;
    let fitted = parameters.iter().zip(&e.estimates);
    let fitted = fitted.map(|(p, estimate)| (p.symbol, Some(p.unit), *estimate));
    let is_free = |name: &&String| parameters.iter().all(|p| p.symbol != **name);
    let held = (formula.stated.keys().filter(is_free)).map(|name| (name.as_str(), None, None));
    for (symbol, unit, estimate) in fitted.chain(held) {
        let Stated {
            unit: stated,
            prior,
            min,
            max,
            held,
        } = formula.stated.get(symbol).cloned().unwrap_or_default();
        let mut entries = Vec::new();
        if let Some(unit) = stated.as_deref().or(unit) {
            entries.push(format!("unit = {}", string(unit)));
        }
        entries.extend(prior.map(|prior| format!("prior = {prior:?}")));
        entries.extend(min.map(|min| format!("min = {min:?}")));
        entries.extend(max.map(|max| format!("max = {max:?}")));
        if let Some(Estimate { value, std }) = estimate {
            entries.push(format!("value = {value:?}"));
            entries.extend(std.map(|std| format!("std = {std:?}")));
        }
        entries.extend(held.map(|value| format!("value = {value:?}, held = true")));
        writeln!(out, "{} = {{ {} }}", key(symbol), entries.join(", "))?;
    }
    if e.just_added {
        writeln!(out, "just_added = true")?;
    }
    Ok(())
}

/// All parameters but the first.
fn write_more_parameters(out: &mut String, e: &ModelEffect) -> std::fmt::Result {
    let symbols = e.effect.description().parameters.iter();
    let more = symbols.zip(&e.estimates).skip(1);
    let entries: Vec<String> = more
        .filter_map(|(parameter, estimate)| {
            let Estimate { value, std } = (*estimate)?;
            let std = std.map_or(String::new(), |std| format!(", std = {std:?}"));
            let symbol = key(parameter.symbol);
            Some(format!("{symbol} = {{ value = {value:?}{std} }}"))
        })
        .collect();
    if entries.is_empty() {
        return Ok(());
    }
    writeln!(out, "parameters = {{ {} }}", entries.join(", "))
}

/// What each witness measured of a number, as a key and its table; none where the number alone says all.
pub(super) fn witnesses(of: &[Option<Estimate>; 3]) -> Option<String> {
    let all = Witness::ALL.iter().zip(of);
    let entries: Vec<String> = all
        .filter_map(|(by, own)| {
            let Estimate { value, std } = (*own)?;
            let std = std.map_or(String::new(), |std| format!(", std = {std:?}"));
            Some(format!("{} = {{ value = {value:?}{std} }}", by.key()))
        })
        .collect();
    (!entries.is_empty()).then(|| format!("measured_by = {{ {} }}", entries.join(", ")))
}

fn write_feet_and_imu(out: &mut String, model: &Model) -> std::fmt::Result {
    for foot in model.stated_feet() {
        let place = match foot.points.as_slice() {
            [one] => format!("place = {one:?}"),
            points => format!("points = {points:?}"),
        };
        let [name, link] = [&foot.name, &foot.link].map(|name| string(name));
        writeln!(
            out,
            "\n[[foot]]\nname = {name}\nlink = {link}\n{place}\nradius = {:?}\nradius_std = {:?}\nsensor = {}",
            foot.radius, foot.radius_std, foot.sensor
        )?;
    }
    if let Some(imu) = model.stated_imu() {
        writeln!(
            out,
            "\n[imu]\nlink = {}\nplace = {:?}\nrpy = {:?}\nplace_std = {:?}\nturn_std = {:?}",
            string(&imu.link),
            imu.place,
            imu.rpy,
            imu.place_std,
            imu.turn_std
        )?;
    }
    Ok(())
}

fn write_held(out: &mut String, model: &Model) -> std::fmt::Result {
    let held = model.robot.stated();
    if held.is_empty() {
        return Ok(());
    }
    writeln!(out, "\n[held]")?;
    for (joint, position) in held {
        writeln!(out, "{} = {position:?}", key(joint))?;
    }
    Ok(())
}

fn write_conventions(out: &mut String, model: &Model) -> std::fmt::Result {
    let conventions = model.robot.conventions();
    if *conventions == LogConventions::default() {
        return Ok(());
    }
    let name = |joint: usize| model.joint_name(joint);
    writeln!(out, "\n[log]")?;
    if let Some(motors) = &conventions.motors {
        let motors: Vec<String> = motors.iter().map(|j| string(name(*j))).collect();
        writeln!(out, "motors = [{}]", motors.join(", "))?;
    }
    let signals = ["q", "dq", "tau"].into_iter().zip(conventions.at_motor);
    let at_motor = signals.filter(|(_, at_motor)| *at_motor);
    let at_motor: Vec<String> = at_motor.map(|(signal, _)| string(signal)).collect();
    if !at_motor.is_empty() {
        writeln!(out, "at_motor = [{}]", at_motor.join(", "))?;
    }
    if !conventions.transmission.is_empty() {
        writeln!(out, "\n[log.transmission]")?;
    }
    for (motor, ratios) in &conventions.transmission {
        let ratios = ratios
            .iter()
            .map(|(j, ratio)| format!("{} = {ratio:?}", key(name(*j))));
        let ratios = ratios.collect::<Vec<_>>().join(", ");
        writeln!(out, "{} = {{ {ratios} }}", key(name(*motor)))?;
    }
    Ok(())
}

fn write_priors(out: &mut String, model: &Model) -> std::fmt::Result {
    writeln!(
        out,
        "\n[prior]\ncad_uncertainty = {:?}",
        model.cad_uncertainty
    )?;
    let bodies = model.robot.bodies().iter().zip(&model.bodies);
    let own: Vec<String> = bodies
        .filter_map(|(body, known)| {
            Some(format!(
                "{} = {:?}",
                key(&body.name),
                known.cad_uncertainty?
            ))
        })
        .collect();
    if !own.is_empty() {
        writeln!(out, "body = {{ {} }}", own.join(", "))?;
    }
    for (effect, Prior { mean, std }) in &model.effect_priors {
        writeln!(
            out,
            "\n[prior.effect.{}]\nmean = {mean:?}\nstd = {std:?}",
            effect.name()
        )?;
    }
    Ok(())
}

/// A TOML basic string: escaped as JSON's, but for the one control character that JSON leaves alone.
pub(super) fn string(text: &str) -> String {
    serde_json::Value::from(text)
        .to_string()
        .replace('\u{7f}', "\\u007f")
}

/// A TOML key: bare where it can be.
pub(super) fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) {
        name.to_owned()
    } else {
        string(name)
    }
}

/// The way to `file` from the folder of `from`; as it is if there is none.
fn relative(file: &Path, from: &Path) -> PathBuf {
    let folder = match from.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let (Ok(file), Ok(folder)) = (file.canonicalize(), folder.canonicalize()) else {
        return file.to_owned();
    };
    let (file_parts, folder_parts): (Vec<Component>, Vec<Component>) =
        (file.components().collect(), folder.components().collect());
    let common = file_parts
        .iter()
        .zip(&folder_parts)
        .take_while(|(a, b)| a == b)
        .count();
    let up = folder_parts[common..].iter().map(|_| Component::ParentDir);
    up.chain(file_parts[common..].iter().copied()).collect()
}

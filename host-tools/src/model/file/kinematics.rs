//! What calibration knows, as tables of a model file: read and written.

use std::fmt::Write;

use super::tables::{File, FixtureTable, ToolTable};
use super::write::{key, string, witnesses};
use super::{
    Fault, Impossible, Model, ModelProblem, UnknownName, finite, impossible, joint, read_witnesses,
};
use crate::model::{Estimate, Fixture, JointQuantity, Tool};

/// Reads `[[mount]]`, `[[tool]]` and `[kinematics.JOINT]`.
pub(super) fn read(model: &mut Model, file: &File) -> Result<(), Fault> {
    if let Some(second) = file.mount.get(1) {
        let text = "a second [[mount]]: all poses are of one measuring system".to_owned();
        return Err((Some(second.span().start), ModelProblem::Syntax(text)));
    }
    let mut mount = None;
    for entry in &file.mount {
        let FixtureTable {
            xyz,
            rpy,
            xyz_std,
            rpy_std,
        } = *entry.get_ref();
        let fixture = Fixture {
            xyz,
            rpy,
            xyz_std,
            rpy_std,
        };
        mount = Some(checked(fixture, entry.span().start, "the mount")?);
    }
    let mut tools: Vec<Tool> = Vec::new();
    for entry in &file.tool {
        let (at, table) = (entry.span().start, entry.get_ref());
        let tool = read_tool(model, table, at)?;
        if tools.iter().any(|other| other.name == tool.name) {
            let text = format!("a second [[tool]] `{}`", tool.name);
            return Err((Some(at), ModelProblem::Syntax(text)));
        }
        tools.push(tool);
    }
    model.set_fixtures(mount, tools);
    for (name, quantities) in &file.kinematics {
        let joint = joint(model, name.get_ref(), name.span().start)?;
        for (symbol, entry) in quantities {
            let (at, key) = (symbol.span().start, symbol.get_ref().as_str());
            let what = format!("{key} of {}", name.get_ref());
            let estimate = Estimate {
                value: entry.value,
                std: entry.std,
            };
            let spring = (JointQuantity::ALL.into_iter()).find(|q| q.damping_key() == Some(key));
            if let Some(spring) = spring {
                model
                    .place_spring_damping(joint, spring, estimate)
                    .map_err(impossible(at, what))?;
                continue;
            }
            let quantity = quantity(key, at)?;
            let check = |value| finite(quantity.key(), value);
            let witnesses = read_witnesses(&entry.measured_by, &what, at, check)?;
            model
                .place_joint_quantity(joint, quantity, estimate, witnesses)
                .map_err(impossible(at, what))?;
        }
    }
    Ok(())
}

/// The quantity of a key; elasticity and backlash are effects and have tables of their own.
fn quantity(name: &str, at: usize) -> Result<JointQuantity, Fault> {
    let effects = [JointQuantity::Elasticity, JointQuantity::Backlash];
    let all = || JointQuantity::ALL.into_iter();
    let own = || all().filter(|q| !effects.contains(q));
    own().find(|q| q.key() == name).ok_or_else(|| {
        let dampers = all().filter_map(JointQuantity::damping_key);
        let known = own().map(JointQuantity::key).chain(dampers);
        let unknown = UnknownName::new("correction", name, known);
        (Some(at), ModelProblem::UnknownName(unknown))
    })
}

fn read_tool(model: &Model, table: &ToolTable, at: usize) -> Result<Tool, Fault> {
    let frame = model.robot.frame(&table.link);
    frame.map_err(|e| (Some(at), ModelProblem::UnknownName(e)))?;
    let fixture = Fixture {
        xyz: table.xyz,
        rpy: table.rpy,
        xyz_std: table.xyz_std,
        rpy_std: table.rpy_std,
    };
    Ok(Tool {
        name: table.name.clone(),
        link: table.link.clone(),
        fixture: checked(fixture, at, &format!("the tool {}", table.name))?,
    })
}

fn checked(fixture: Fixture, at: usize, what: &str) -> Result<Fixture, Fault> {
    if fixture.is_possible() {
        return Ok(fixture);
    }
    let fault = Impossible::Bounds {
        symbol: "a number",
        value: f64::NAN,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
    };
    Err(impossible(at, what)(fault))
}

/// Writes the same tables.
pub(super) fn write(out: &mut String, model: &Model) -> std::fmt::Result {
    let known = &model.kinematics;
    if let Some(mount) = &known.mount {
        writeln!(out, "\n[[mount]]")?;
        write_fixture(out, mount, true)?;
    }
    for Tool {
        name,
        link,
        fixture,
    } in &known.tools
    {
        let [name, link] = [name, link].map(|name| string(name));
        writeln!(out, "\n[[tool]]\nname = {name}\nlink = {link}")?;
        write_fixture(
            out,
            fixture,
            fixture.rpy != [0.0; 3] || fixture.rpy_std.is_some(),
        )?;
    }
    let number = |Estimate { value, std }: Estimate| {
        let std = std.map_or(String::new(), |std| format!(", std = {std:?}"));
        format!("value = {value:?}{std}")
    };
    let corrections = known.corrections.iter().map(|own| {
        let witnesses = witnesses(&own.witnesses).map_or(String::new(), |text| format!(", {text}"));
        let text = number(own.estimate) + &witnesses;
        (own.joint, own.quantity.key(), text)
    });
    let dampers = known
        .dampers
        .iter()
        .filter_map(|&(joint, spring, estimate)| {
            Some((joint, spring.damping_key()?, number(estimate)))
        });
    let mut all: Vec<(usize, &str, String)> = corrections.chain(dampers).collect();
    // The sort is stable: a joint's corrections stay before its dampers.
    all.sort_by_key(|(joint, ..)| *joint);
    let mut last = None;
    for (joint, symbol, text) in &all {
        if last.replace(joint) != Some(joint) {
            writeln!(out, "\n[kinematics.{}]", key(model.joint_name(*joint)))?;
        }
        writeln!(out, "{symbol} = {{ {text} }}")?;
    }
    Ok(())
}

fn write_fixture(out: &mut String, fixture: &Fixture, turned: bool) -> std::fmt::Result {
    writeln!(out, "xyz = {:?}", fixture.xyz)?;
    if turned {
        writeln!(out, "rpy = {:?}", fixture.rpy)?;
    }
    if let Some(std) = fixture.xyz_std {
        writeln!(out, "xyz_std = {std:?}")?;
    }
    if let Some(std) = fixture.rpy_std {
        writeln!(out, "rpy_std = {std:?}")?;
    }
    Ok(())
}

//! MJCF: inertials of bodies; armature, damping and frictionloss of joints.

use std::path::Path;

use roxmltree::{Document, Node};

use super::edit::Edits;
use super::mjcf_input::Input;
use super::whole::mjcf_inertial;
use super::{
    ExportError, ExportProblem, Exported, Inertial, attributes, base_note, error, identified,
    names, number, numbers, whole, without,
};
use crate::model::Model;

/// Notations of an orientation other than `quat`, which MuJoCo refuses beside `fullinertia`.
const ORIENTATIONS: [&str; 4] = ["axisangle", "xyaxes", "zaxis", "euler"];

/// A model as MJCF: written into the file `input`, or a whole file.
///
/// # Errors
/// [`ExportError`] if the file is not of this robot, or cannot hold the model.
pub fn mjcf(model: &Model, input: Option<&Path>) -> Result<Exported, ExportError> {
    let (effects, written, mut notes) = attributes(model, "MJCF", |effect| effect.mjcf);
    let Some(path) = input else {
        let bodies: Vec<usize> = (0..model.robot().bodies().len()).collect();
        return Ok(Exported {
            text: whole::mjcf(model, &effects),
            bodies: names(model, &bodies),
            effects: written,
            notes,
        });
    };
    let text = std::fs::read_to_string(path).map_err(|e| error(path, ExportProblem::Read(e)))?;
    let document = Document::parse(&text).map_err(|e| ExportError {
        path: path.to_owned(),
        line: Some(e.pos().row),
        problem: Box::new(ExportProblem::Syntax(e.to_string())),
    })?;
    let at = |(node, problem): (Node, ExportProblem)| ExportError {
        path: path.to_owned(),
        line: Some(document.text_pos_at(node.range().start).row),
        problem: Box::new(problem),
    };
    let input = Input::new(&document).map_err(at)?;
    let bodies = identified(model);
    notes.extend(base_note(model));
    let mut edits = Edits::new(&text);
    for b in 0..model.robot().bodies().len() {
        let of_joint: Vec<_> = effects.iter().filter(|e| e.joint == b).collect();
        if !model.is_identified(b) && of_joint.is_empty() {
            continue;
        }
        let joint = input.joint(model, b).map_err(at)?;
        for effect in of_joint {
            edits.set(joint, effect.attribute, &number(effect.value));
        }
        if model.is_identified(b) {
            input.check_place(model, b, joint).map_err(at)?;
            write_inertial(&mut edits, &input, model, b, joint).map_err(at)?;
        }
    }
    Ok(Exported {
        text: edits.apply(),
        bodies: names(model, &bodies),
        effects: written,
        notes,
    })
}

fn write_inertial<'d>(
    edits: &mut Edits,
    input: &Input<'d>,
    model: &Model,
    b: usize,
    joint: Node<'d, 'd>,
) -> Result<(), (Node<'d, 'd>, ExportProblem)> {
    let body = input.body_of(joint)?;
    let whole = model.inertia(b).in_parent(&input.joint_frame(joint)?);
    let own = without(&whole, &input.carried(body)?).map_err(|fault| {
        let link = body.attribute("name").unwrap_or_default().to_owned();
        (body, ExportProblem::Carried { link, fault })
    })?;
    let inertial = Inertial::of(&own);
    let Some(element) = body.children().find(|n| n.has_tag_name("inertial")) else {
        edits.prepend(body, &mjcf_inertial(&inertial));
        return Ok(());
    };
    edits.set(element, "pos", &numbers(inertial.com.iter().copied()));
    edits.set(element, "mass", &number(inertial.mass));
    edits.remove(element, "quat");
    ORIENTATIONS
        .iter()
        .for_each(|name| edits.remove(element, name));
    let full = numbers(inertial.full());
    if element.has_attribute("diaginertia") && !element.has_attribute("fullinertia") {
        edits.replace(element, "diaginertia", "fullinertia", &full);
    } else {
        edits.remove(element, "diaginertia");
        edits.set(element, "fullinertia", &full);
    }
    Ok(())
}

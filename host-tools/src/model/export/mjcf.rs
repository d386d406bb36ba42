//! MJCF: inertials of bodies; armature, damping, frictionloss, springs and limits of joints; tendons that couple them.

use std::path::Path;

use proprio_core::inertia::InertialParameters;
use roxmltree::{Document, Node};

use super::edit::Edits;
use super::effects::{JointAttribute, Stated, Tendon};
use super::mjcf_input::Input;
use super::whole::mjcf_inertial;
use super::{
    ExportError, ExportProblem, Exported, Inertial, bodies, effects, error, number, numbers, whole,
    with_mass, without,
};
use crate::model::{BASE, Model};

/// Notations of an orientation other than `quat`, which MuJoCo refuses beside `fullinertia`.
const ORIENTATIONS: [&str; 4] = ["axisangle", "xyaxes", "zaxis", "euler"];

/// A model as MJCF: written into the file `input`, or a whole file.
///
/// # Errors
/// [`ExportError`] if the file is not of this robot, or cannot hold the model.
pub fn mjcf(model: &Model, input: Option<&Path>) -> Result<Exported, ExportError> {
    let stated = effects::mjcf(model);
    let Some(path) = input else {
        return Ok(Exported {
            text: whole::mjcf(model, &stated),
            bodies: with_mass(model),
            origins: model.corrected_joints(),
            effects: stated.written,
            notes: stated.notes,
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
    let Stated {
        attributes,
        tendons,
        written,
        mut notes,
    } = stated;
    let mut edits = Edits::new(&text);
    for b in 0..model.robot().bodies().len() {
        let of_joint: Vec<_> = attributes.iter().filter(|e| e.joint == b).collect();
        if !model.is_identified(b) && of_joint.is_empty() {
            continue;
        }
        let joint = input.joint(model, b).map_err(at)?;
        for effect in of_joint {
            let unit = match effect.is_position && turns(joint) {
                true => input.radian(),
                false => 1.0,
            };
            let values = effect.values.iter().map(|value| value * unit);
            edits.set(joint, effect.attribute, &numbers(values));
        }
        if model.is_identified(b) {
            input.check_place(model, b, joint).map_err(at)?;
            let body = input.body_of(joint).map_err(at)?;
            let whole = model
                .inertia(b)
                .in_parent(&input.joint_frame(joint).map_err(at)?);
            write_inertial(&mut edits, &input, body, &whole).map_err(at)?;
        }
    }
    let mut in_base = false;
    if model.is_identified(BASE) {
        // What hangs on the world has no body for the base.
        match input.base(model).map_err(at)? {
            Some(body) => {
                write_inertial(&mut edits, &input, body, model.inertia(BASE)).map_err(at)?;
                in_base = true;
            }
            None => notes
                .push("base is left out: the file has no body that carries all limbs".to_owned()),
        }
    }
    let moved = model.corrected_joints();
    if !moved.is_empty() {
        notes.push(format!(
            "calibrated joint frames are left out, an MJCF without a file gets them: {}",
            moved.join(", ")
        ));
    }
    let rubs = |e: &JointAttribute| e.attribute == "frictionloss" && e.values[0] > 0.0;
    if attributes.iter().any(rubs) && !text.contains("solreffriction") {
        notes.push(format!(
            "MuJoCo's dry friction builds up over 20 ms by default; for stiff friction add {}",
            whole::STIFF_FRICTION
        ));
    }
    write_tendons(&mut edits, &input, model, &tendons, &mut notes).map_err(at)?;
    Ok(Exported {
        text: edits.apply(),
        bodies: bodies(model, |b| model.is_identified(b) && (b != BASE || in_base)),
        origins: Vec::new(),
        effects: written,
        notes,
    })
}

/// Whether a joint's position is an angle.
fn turns(joint: Node) -> bool {
    joint.attribute("type").is_none_or(|kind| kind == "hinge")
}

/// Adds tendons to the file; one that it has by that name stays, and so does what couples the joints there.
fn write_tendons<'d>(
    edits: &mut Edits,
    input: &Input<'d>,
    model: &Model,
    tendons: &[Tendon],
    notes: &mut Vec<String>,
) -> Result<(), (Node<'d, 'd>, ExportProblem)> {
    let mut elements = String::new();
    for tendon in tendons {
        if input.has_tendon(&tendon.name) {
            notes.push(format!(
                "tendon {} is left as the file has it: delete it there to have it written anew",
                tendon.name
            ));
            continue;
        }
        let mut called = Vec::new();
        for (joint, _) in tendon.joints {
            let name = input.joint(model, joint)?.attribute("name");
            called.push((joint, name.unwrap_or_default()));
        }
        let name = |joint| {
            let found = called.iter().find(|(own, _)| *own == joint);
            found.map_or("", |(_, name)| *name)
        };
        elements += &whole::fixed_tendon(tendon, name);
    }
    if !elements.is_empty() {
        edits.append(input.root(), &format!("<tendon>{elements}</tendon>"));
    }
    Ok(())
}

/// The inertia of a moving body of the file: `whole`, about the origin of the body's frame, less what is fixed to it.
fn write_inertial<'d>(
    edits: &mut Edits,
    input: &Input<'d>,
    body: Node<'d, 'd>,
    whole: &InertialParameters<f64>,
) -> Result<(), (Node<'d, 'd>, ExportProblem)> {
    let own = without(whole, &input.carried(body)?).map_err(|fault| {
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

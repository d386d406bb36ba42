//! URDF: inertials of links, origins that calibration corrected, damping, friction and limits of effort of joints.

use std::path::Path;

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use roxmltree::{Document, Node};

use super::edit::Edits;
use super::effects::{JointAttribute, LIMIT, Stated};
use super::whole::{self, INERTIA, dynamics_element, inertial_element, origin_element};
use super::{
    ExportError, ExportProblem, Exported, Inertial, bodies, effects, error, number, numbers,
    same_axis, same_place, with_mass, without,
};
use crate::model::urdf::Description;
use crate::model::{BASE, Body, Model, RobotProblem, Source};

/// A model as URDF: written into the file `input`, else into the URDF that the model is of, else a whole file.
///
/// # Errors
/// [`ExportError`] if the file is not of this robot, or cannot hold the model.
pub fn urdf(model: &Model, input: Option<&Path>) -> Result<Exported, ExportError> {
    let own = match model.robot().source() {
        Source::Urdf(path) => Some(path.as_path()),
        Source::Go2 => None,
    };
    let Some(path) = input.or(own) else {
        let stated = effects::urdf(model, |joint| {
            model.robot().bodies()[joint].velocity.is_finite()
        });
        return Ok(Exported {
            text: whole::urdf(model, &stated.attributes),
            bodies: with_mass(model),
            origins: model.corrected_joints(),
            effects: stated.written,
            notes: stated.notes,
        });
    };
    let file = Description::read(path, model.robot().held()).map_err(|e| ExportError {
        path: e.path,
        line: e.line,
        problem: Box::new(match *e.problem {
            RobotProblem::Read(cause) => ExportProblem::Read(cause),
            problem => ExportProblem::Robot(problem),
        }),
    })?;
    let document = Document::parse(&file.text)
        .map_err(|e| error(path, ExportProblem::Syntax(e.to_string())))?;
    let target = Target {
        path,
        file: &file,
        document: &document,
    };
    target.check(model)?;
    let is_limited = |joint: usize| {
        let body = target.body(model, joint).ok();
        let element = body.and_then(|(_, body)| target.element("joint", &body.joint_name));
        element.is_some_and(|joint| child(joint, LIMIT).is_some())
    };
    let Stated {
        attributes: effects,
        written,
        notes,
        ..
    } = effects::urdf(model, is_limited);
    let mut edits = Edits::new(&file.text);
    target.write_base(&mut edits, model)?;
    for joint in 0..model.robot().bodies().len() {
        target.write_body(&mut edits, model, joint)?;
        target.write_origin(&mut edits, model, joint)?;
        let of_joint: Vec<_> = effects.iter().filter(|e| e.joint == joint).collect();
        if !of_joint.is_empty() {
            let name = &target.body(model, joint)?.1.joint_name;
            if let Some(element) = target.element("joint", name) {
                write_effects(&mut edits, element, &of_joint);
            }
        }
    }
    Ok(Exported {
        text: edits.apply(),
        bodies: bodies(model, |b| model.is_identified(b)),
        origins: model.corrected_joints(),
        effects: written,
        notes,
    })
}

/// The file that is written into.
struct Target<'a> {
    path: &'a Path,
    file: &'a Description,
    document: &'a Document<'a>,
}

impl Target<'_> {
    /// The file's body of a joint of the model, and its index.
    fn body(&self, model: &Model, joint: usize) -> Result<(usize, &Body), ExportError> {
        let name = &model.robot().bodies()[joint].name;
        let theirs = &self.file.robot;
        let index = theirs
            .joint(name)
            .map_err(|unknown| error(self.path, ExportProblem::Missing(unknown)))?;
        Ok((index, &theirs.bodies()[index]))
    }

    /// Every joint that both have stands in the same place, so that φ is about the same frame.
    fn check(&self, model: &Model) -> Result<(), ExportError> {
        for ours in model.robot().bodies() {
            let Ok(index) = self.file.robot.joint(&ours.name) else {
                continue;
            };
            let theirs = &self.file.robot.bodies()[index];
            same_place(&ours.name, &theirs.placement, &ours.placement)
                .and_then(|()| same_axis(&ours.name, &theirs.axis, &ours.axis))
                .map_err(|problem| self.error_at("joint", &theirs.joint_name, problem))?;
        }
        Ok(())
    }

    fn write_body(&self, edits: &mut Edits, model: &Model, b: usize) -> Result<(), ExportError> {
        if !model.is_identified(b) {
            return Ok(());
        }
        let (index, body) = self.body(model, b)?;
        self.write_inertial(
            edits,
            &body.link_name,
            model.inertia(b),
            &self.file.carried[index],
        )
    }

    /// The base's inertia, about the origin of the base's frame, goes into the heaviest of its links.
    fn write_base(&self, edits: &mut Edits, model: &Model) -> Result<(), ExportError> {
        let links = &self.file.base_links;
        let heaviest = (links.iter()).max_by(|a, b| a.inertia.mass().total_cmp(&b.inertia.mass()));
        let Some(link) = heaviest.filter(|_| model.is_identified(BASE)) else {
            return Ok(());
        };
        let whole = self.file.robot.base_inertia();
        let others = InertialParameters(whole.0 - link.inertia.0);
        let back = link.placement.rotation.transpose();
        let into = Transform {
            rotation: back,
            translation: -back * link.placement.translation,
        };
        let [own, others] = [*model.inertia(BASE), others].map(|phi| phi.in_parent(&into));
        self.write_inertial(edits, &link.name, &own, &others)
    }

    /// A link's inertia: that of the body, less what other links carry of it.
    fn write_inertial(
        &self,
        edits: &mut Edits,
        link_name: &str,
        whole: &InertialParameters<f64>,
        carried: &InertialParameters<f64>,
    ) -> Result<(), ExportError> {
        let own = without(whole, carried).map_err(|fault| {
            let link = link_name.to_owned();
            self.error_at("link", link_name, ExportProblem::Carried { link, fault })
        })?;
        let inertial = Inertial::of(&own);
        let Some(link) = self.element("link", link_name) else {
            return Ok(());
        };
        let child = |parent: Node<'_, '_>, tag| {
            parent
                .children()
                .find(|n| n.has_tag_name(tag))
                .map(|n| n.id())
        };
        let Some(element) = child(link, "inertial").and_then(|id| self.document.get_node(id))
        else {
            edits.prepend(link, &inertial_element(&inertial));
            return Ok(());
        };
        let part = |tag| child(element, tag).and_then(|id| self.document.get_node(id));
        match part("origin") {
            Some(origin) => {
                edits.set(origin, "xyz", &numbers(inertial.com.iter().copied()));
                // The inertia is written in the axes of the link.
                if origin.has_attribute("rpy") {
                    edits.set(origin, "rpy", "0 0 0");
                }
                edits.remove(origin, "quat_xyzw");
            }
            None => edits.prepend(element, &origin_element(&inertial)),
        }
        if let Some(mass) = part("mass") {
            edits.set(mass, "value", &number(inertial.mass));
        }
        if let Some(inertia) = part("inertia") {
            for (name, value) in INERTIA.iter().zip(inertial.six()) {
                edits.set(inertia, name, &number(value));
            }
        }
        Ok(())
    }

    /// A joint's origin as calibration corrects it. The file's origin is in the parent link's own frame, whatever that is fixed to: the
    /// correction, in the joint's frame, comes after it.
    fn write_origin(
        &self,
        edits: &mut Edits,
        model: &Model,
        joint: usize,
    ) -> Result<(), ExportError> {
        let Some(correction) = model.frame_correction(joint) else {
            return Ok(());
        };
        let name = &self.body(model, joint)?.1.joint_name;
        let Some(element) = self.element("joint", name) else {
            return Ok(());
        };
        let origin = element.children().find(|n| n.has_tag_name("origin"));
        let three = |attribute| -> Vector3<f64> {
            let text = origin.and_then(|o| o.attribute(attribute)).unwrap_or("");
            let mut numbers = text.split_whitespace().map(|x| x.parse().unwrap_or(0.0));
            Vector3::from_fn(|_, _| numbers.next().unwrap_or(0.0))
        };
        let rpy = three("rpy");
        let rotation = match origin.and_then(|o| o.attribute("quat_xyzw")) {
            Some(text) => {
                let q: Vec<f64> = text.split_whitespace().flat_map(str::parse).collect();
                match q.as_slice() {
                    &[x, y, z, w] => UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
                        .to_rotation_matrix(),
                    _ => Rotation3::identity(),
                }
            }
            None => Rotation3::from_euler_angles(rpy.x, rpy.y, rpy.z),
        };
        let place = Transform {
            rotation: *rotation.matrix(),
            translation: three("xyz"),
        };
        let corrected = place.compose(&correction);
        let turned = Rotation3::from_matrix_unchecked(corrected.rotation);
        let (r, p, y) = turned.euler_angles();
        let (xyz, rpy) = (
            numbers(corrected.translation.iter().copied()),
            numbers([r, p, y]),
        );
        match origin {
            Some(origin) => {
                edits.set(origin, "xyz", &xyz);
                edits.set(origin, "rpy", &rpy);
                edits.remove(origin, "quat_xyzw");
            }
            None => edits.prepend(element, &format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")),
        }
        Ok(())
    }

    /// A link or joint by its name.
    fn element(&self, tag: &str, name: &str) -> Option<Node<'_, '_>> {
        let mut elements = self.document.root_element().children();
        elements.find(|e| e.has_tag_name(tag) && e.attribute("name") == Some(name))
    }

    fn error_at(&self, tag: &str, name: &str, problem: ExportProblem) -> ExportError {
        let line = self
            .element(tag, name)
            .map(|e| self.document.text_pos_at(e.range().start).row);
        ExportError {
            path: self.path.to_owned(),
            line,
            problem: Box::new(problem),
        }
    }
}

fn child<'a, 'd>(of: Node<'a, 'd>, tag: &str) -> Option<Node<'a, 'd>> {
    of.children().find(|n| n.has_tag_name(tag))
}

/// Effects in the joint's children that have their attributes; dynamics are added where there are none.
fn write_effects(edits: &mut Edits, joint: Node, effects: &[&JointAttribute]) {
    let (limits, dynamics): (Vec<_>, Vec<_>) =
        effects.iter().copied().partition(|e| e.element == LIMIT);
    for (tag, own) in [(LIMIT, limits), ("dynamics", dynamics)] {
        match child(joint, tag) {
            Some(element) => own.iter().for_each(|effect| {
                let values = numbers(effect.values.iter().copied());
                edits.set(element, effect.attribute, &values);
            }),
            None if own.is_empty() => {}
            None => edits.append(joint, &dynamics_element(&own)),
        }
    }
}

//! Effects as attributes of joints and tendons, and what a format cannot say.

use proprio_core::effect::{Description, Mjcf};

use crate::model::{Estimate, Model, ModelEffect};

/// An effect as an attribute of a joint.
pub(super) struct JointAttribute {
    pub(super) joint: usize,
    /// The element that has it: the joint's own, or one of its children.
    pub(super) element: &'static str,
    pub(super) attribute: &'static str,
    /// A number, or the two of a range.
    pub(super) values: Vec<f64>,
    /// Whether it is an angle of the joint, in the file's unit of angles.
    pub(super) is_position: bool,
}

impl JointAttribute {
    /// Of the joint's own element.
    fn new(joint: usize, attribute: &'static str, values: impl Into<Vec<f64>>) -> Self {
        Self {
            joint,
            element: "joint",
            attribute,
            values: values.into(),
            is_position: false,
        }
    }
}

/// A fixed tendon over two joints: its length is the sum of their positions, each times its coefficient.
pub(super) struct Tendon {
    pub(super) name: String,
    pub(super) joints: [(usize, f64); 2],
    pub(super) attribute: &'static str,
    pub(super) value: f64,
}

/// What of a model's effects a file gets.
#[derive(Default)]
pub(super) struct Stated {
    pub(super) attributes: Vec<JointAttribute>,
    pub(super) tendons: Vec<Tendon>,
    /// Effects that are stated: `coulomb:FR_hip`.
    pub(super) written: Vec<String>,
    /// Those that are not, and why.
    pub(super) notes: Vec<String>,
}

/// The element of a joint that limits it in URDF.
pub(super) const LIMIT: &str = "limit";

/// How URDF states an effect: a child of `<joint>` and its attribute, with the value of the first parameter.
pub fn urdf_attribute(of: &Description) -> Option<[&'static str; 2]> {
    let dynamics = of.urdf.map(|attribute| ["dynamics", attribute]);
    // What MJCF states as a range of a joint's torque is URDF's limit of effort, which knows no sign.
    let limit = || matches!(of.mjcf, Some(Mjcf::Range(_))).then_some([LIMIT, "effort"]);
    dynamics.or_else(limit)
}

/// The effects as URDF states them, in a file that limits these joints.
pub(super) fn urdf(model: &Model, is_limited: impl Fn(usize) -> bool) -> Stated {
    stated(model, "URDF", |stated, e| {
        let [element, attribute] = urdf_attribute(e.effect.description()).ok_or(NO_WORD)?;
        if element == LIMIT && !is_limited(e.joint) {
            return Err("the joint has no <limit>, which needs a velocity too");
        }
        stated.attributes.push(JointAttribute {
            element,
            ..JointAttribute::new(e.joint, attribute, [value(e, 0)])
        });
        Ok(())
    })
}

/// The effects as MJCF states them.
pub(super) fn mjcf(model: &Model) -> Stated {
    let mut all = stated(model, "MJCF", |stated, e| {
        match e.effect.description().mjcf.ok_or(NO_WORD)? {
            Mjcf::Joint(attribute) => {
                let own = JointAttribute::new(e.joint, attribute, [value(e, 0)]);
                stated.attributes.push(own);
            }
            Mjcf::Range(attribute) => {
                let limit = value(e, 0);
                let own = JointAttribute::new(e.joint, attribute, [-limit, limit]);
                stated.attributes.push(own);
            }
            Mjcf::Slope { slope, zero } => {
                let (k, c) = (value(e, 0), value(e, 1));
                if k <= 0.0 {
                    return Err("a constant torque alone has no word in MJCF");
                }
                (stated.attributes).push(JointAttribute::new(e.joint, slope, [k]));
                stated.attributes.push(JointAttribute {
                    is_position: true,
                    ..JointAttribute::new(e.joint, zero, [-c / k])
                });
            }
            // After the joints' own: a share of those goes to the tendon.
            Mjcf::Tendon(_) => {}
            Mjcf::SumAndDifference(attribute) => {
                let before = before(model, e)?;
                for (n, (name, sign)) in
                    [("sum", 1.0), ("difference", -1.0)].into_iter().enumerate()
                {
                    if value(e, n) > 0.0 {
                        stated.tendons.push(Tendon {
                            name: format!(
                                "{}_{}_{name}",
                                e.effect.name(),
                                model.joint_name(e.joint)
                            ),
                            joints: [(before, sign), (e.joint, 1.0)],
                            attribute,
                            value: value(e, n),
                        });
                    }
                }
            }
        }
        Ok(())
    });
    couple(model, &mut all);
    all
}

/// Why an effect is left out.
const NO_WORD: &str = "has no word for it";

fn value(e: &ModelEffect, parameter: usize) -> f64 {
    let estimate = e.estimates.get(parameter).copied().flatten();
    estimate.map_or(0.0, |estimate| estimate.value)
}

/// The joint that carries an effect's.
fn before(model: &Model, e: &ModelEffect) -> Result<usize, &'static str> {
    model.robot().bodies()[e.joint]
        .parent
        .ok_or("couples no two joints")
}

/// Couplings of two joints as tendons. On both joints Fc acts by the other's motion: the matrix of each joint's own F and of Fc between them. A tendon of
/// unit value with coefficients a and b has a², b² and a b there; a b = Fc, and of all such the one that takes the same share of both joints' own.
fn couple(model: &Model, all: &mut Stated) {
    for e in model.effects() {
        let Some(Mjcf::Tendon(attribute)) = e.effect.description().mjcf else {
            continue;
        };
        let Some(Estimate {
            value: coupling, ..
        }) = e.estimate()
        else {
            continue;
        };
        let name = format!("{}:{}", e.effect.name(), model.joint_name(e.joint));
        let Some(place) = all.written.iter().position(|written| *written == name) else {
            continue;
        };
        let own = |joint: usize| {
            let mut found = all.attributes.iter();
            found.position(|a| a.joint == joint && a.attribute == attribute)
        };
        let both = before(model, e)
            .ok()
            .and_then(|b| Some((b, own(b)?, own(e.joint)?)));
        let taken = both.and_then(|(before, i, j)| {
            let (first, second) = (all.attributes[i].values[0], all.attributes[j].values[0]);
            let share = coupling.abs() / (first * second).sqrt();
            (share <= 1.0).then_some((before, [i, j], [share * first, share * second]))
        });
        let Some((before, places, squares)) = taken else {
            all.written.remove(place);
            all.notes.push(format!(
                "{name} is left out: MJCF couples joints by a tendon, which takes at most the {attribute} that both have of their own"
            ));
            continue;
        };
        for (place, square) in places.into_iter().zip(squares) {
            all.attributes[place].values[0] -= square;
        }
        all.tendons.push(Tendon {
            name: name.replace(':', "_"),
            joints: [
                (before, squares[0].sqrt()),
                (e.joint, coupling.signum() * squares[1].sqrt()),
            ],
            attribute,
            value: 1.0,
        });
    }
}

/// What `state` can say of the effects that have a value, in the order of the model; else why it cannot.
fn stated(
    model: &Model,
    format: &str,
    mut state: impl FnMut(&mut Stated, &ModelEffect) -> Result<(), &'static str>,
) -> Stated {
    let mut all = Stated::default();
    for e in model.effects() {
        let name = format!("{}:{}", e.effect.name(), model.joint_name(e.joint));
        if e.estimate().is_none() {
            (all.notes).push(format!(
                "{name} is left out: no value yet, identify the model first"
            ));
            continue;
        }
        if is_unfound(e) && has_word(format, e) {
            (all.notes).push(format!("{name} is left out: the fit found none"));
            continue;
        }
        match state(&mut all, e) {
            Ok(()) => all.written.push(name),
            Err(NO_WORD) => (all.notes).push(format!("{name} is left out: {format} {NO_WORD}")),
            Err(why) => all.notes.push(format!("{name} is left out: {why}")),
        }
    }
    all
}

fn has_word(format: &str, e: &ModelEffect) -> bool {
    let description = e.effect.description();
    match format {
        "URDF" => urdf_attribute(description).is_some(),
        _ => description.mjcf.is_some(),
    }
}

/// Whether a value is none that was found: a fit ended where the effect is absent. Without a standard deviation somebody stated it.
fn is_unfound(e: &ModelEffect) -> bool {
    let neutral = e.effect.description().parameters[0].neutral;
    let absent = |estimate: Estimate| estimate.std.is_some() && estimate.value == neutral;
    e.estimate().is_some_and(absent)
}

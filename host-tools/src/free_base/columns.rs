//! Which column of a walk's rows is what: the bodies' parameters, the base's first; what the sensors get wrong; then effects of the joints.

use std::sync::Arc;

use proprio_core::effect::{EffectKind, Enters, Form, Grid, Input, MAX_COLUMNS, Moved, Shapes};
use proprio_core::inertia::INERTIAL;

use super::legged::Legged;
use crate::catalogue;
use crate::equation::column::{Column, columns_of};
use crate::equation::values::{NO_SHAPES, Place, load};
use crate::estimate::Constraint;
use crate::estimate::bounded::Bounded;
use crate::model::{BASE, Model};

/// Columns of the accelerometer's bias, m/s²; of the IMU's rotation from where it should be, rad; of delays, s, the last
/// the accelerometer's beyond the gyro's; of the feet's radius beyond the CAD's, m; of the gyro's bias, rad/s; of both sensors' scales beyond 1; of the IMU's place beyond the CAD's, m, in the
/// base's axes.
pub(crate) const SENSORS: usize = 18;

/// Of a nonlinear parameter's derivative: half the difference between the two values that it is taken of, as a share of its size, which is this at least
/// (rad, rad/s, s). Smooth torques bend less over it than a part in a thousand; where one begins at the parameter, samples lie between the two.
const STEP: f64 = 0.01;
const LEAST_SIZE: f64 = 0.1;

/// Whether a walk's rows can have columns of an effect.
///
/// What lies between motor and link, and what a motor makes of what it is asked for, follow the torque to a part in a hundred, and a stance leaves that
/// open; what a motor does not give beyond its limit is made of the torque that it explains; positions determine a velocity's gain; gravity's direction and forces at feet are measured and projected out. A
/// walk's motors have no temperature here.
pub(crate) fn is_judged(effect: EffectKind) -> bool {
    let facts = effect.description();
    match facts.form {
        Form::Columns => {
            facts.enters == Enters::Column
                && !matches!(
                    facts.input,
                    Input::Temperature | Input::MotorTorque | Input::Base
                )
                && (catalogue::formula_of(effect).is_some() || !is_periodic(effect))
        }
        Form::Coupled | Form::Scale | Form::Clock | Form::Inertia => true,
        Form::Motion(moved) => moved == Moved::Zero,
        Form::Gravity | Form::Force => false,
    }
}

/// Whether an effect is periodic in the position. A gait repeats its path, so that all it leaves is, too: of MuJoCo's trots of 4.5 s harmonics of
/// the gear took away 4 % of the squares where there is none. Such an effect is never proposed; a formula that a model has was stated by its owner.
fn is_periodic(effect: EffectKind) -> bool {
    let searched = effect.description().searched();
    matches!(searched, Some((_, Grid::Harmonics | Grid::Frequencies)))
}

/// All that a model of a walking robot might have: the catalogue, and its own formulas at other joints.
pub(crate) fn all_places(model: &Model, robot: &Legged) -> Vec<Place> {
    let effects = catalogue::effects().chain(model.formulas());
    let effects = effects.filter(|effect| is_judged(*effect) && !is_periodic(*effect));
    let places = effects.flat_map(|effect| {
        let form = effect.description().form;
        let sees = move |joint: usize, after: isize| {
            let other = joint.checked_add_signed(after);
            let other = other.filter(|other| *other < robot.joints());
            other.is_some_and(|other| robot.limb_of(other) == robot.limb_of(joint))
        };
        let joints = (0..robot.joints()).filter(move |&joint| {
            (!effect.couples_with_parent() || robot.parents[joint].is_some())
                && effect.others().iter().all(|after| sees(joint, *after))
        });
        let base = (form == Form::Inertia).then_some(BASE);
        joints.chain(base).map(move |joint| (effect, joint))
    });
    places.collect()
}

/// An effect at a joint, or a load on a body, as rows have it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EffectSite {
    /// The joint by its index in the robot; [`BASE`] for a load on the trunk.
    pub(crate) place: Place,
    /// The nonlinear parameters that its columns are made at.
    pub(crate) shapes: Shapes,
    /// Its other parameters.
    pub(crate) linear: Vec<Linear>,
}

/// A parameter that the torque is linear in, less its value where the effect is absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Linear {
    /// Which, as the catalogue counts.
    pub(crate) parameter: usize,
    /// The value where the effect is absent.
    pub(crate) neutral: f64,
    pub(crate) column: Column,
    pub(crate) prior: Bounded,
}

impl EffectSite {
    /// At the nonlinear parameters that a model gives, or else at those that are expected.
    pub(crate) fn of(
        (model, robot): (&Model, &Legged),
        place: Place,
        constraint: Constraint,
    ) -> Self {
        let description = place.0.description();
        let mut shapes = NO_SHAPES;
        for (shape, n) in shapes.iter_mut().zip(description.shapes()) {
            let given = model.effect(place.0, place.1).and_then(|e| e.estimates[n]);
            *shape = given.map_or_else(|| prior((model, robot), place, n).0, |given| given.value);
        }
        let mut site = Self {
            place,
            shapes,
            linear: Vec::new(),
        };
        site.linear = columns_of(place, shapes)
            .into_iter()
            .map(|(parameter, column)| {
                let described = &description.parameters[parameter];
                let (mean, std) = prior((model, robot), place, parameter);
                let [lower, upper] = match constraint {
                    Constraint::Free => [f64::NEG_INFINITY, f64::INFINITY],
                    Constraint::Physical => [described.lower, described.upper],
                };
                let neutral = described.neutral;
                Linear {
                    parameter,
                    neutral,
                    column,
                    prior: Bounded {
                        mean: mean - neutral,
                        std,
                        lower: lower - neutral,
                        upper: upper - neutral,
                    },
                }
            })
            .collect();
        site
    }

    /// Whether it is a torque at joints. With gains at all joints beside such ones the equations of a robot of no mass whose torques are nothing would be
    /// met.
    pub(super) fn is_torque(&self) -> bool {
        let form = self.place.0.description().form;
        matches!(form, Form::Columns | Form::Coupled | Form::Clock)
    }

    /// The same with other nonlinear parameters.
    pub(crate) fn with_shapes(mut self, shapes: Shapes) -> Self {
        self.shapes = shapes;
        let columns = columns_of(self.place, shapes);
        for (own, (_, column)) in self.linear.iter_mut().zip(columns) {
            own.column = column;
        }
        self
    }

    /// Gives it a column of the derivative in each nonlinear parameter where the others have these `values`; none where it has none or is found by the
    /// motion before.
    pub(super) fn add_derivatives(&mut self, (model, robot): (&Model, &Legged), values: &[f64]) {
        let (effect, joint) = self.place;
        let description = effect.description();
        if description.form != Form::Columns || description.input == Input::Bristles {
            return;
        }
        let mut own = [0.0; MAX_COLUMNS];
        own.iter_mut().zip(values).for_each(|(own, x)| *own = *x);
        for (at, parameter) in description.shapes().enumerate() {
            let (described, shape) = (&description.parameters[parameter], self.shapes[at]);
            let step = STEP * shape.abs().max(LEAST_SIZE);
            let around = [-step, step].map(|by| {
                let mut shapes = self.shapes;
                shapes[at] += by;
                shapes
            });
            let (mean, std) = prior((model, robot), self.place, parameter);
            self.linear.push(Linear {
                parameter,
                neutral: shape,
                column: Column::Shape {
                    joint,
                    effect,
                    around,
                    apart: 2.0 * step,
                    values: own,
                },
                prior: Bounded {
                    mean: mean - shape,
                    std,
                    lower: described.lower - shape,
                    upper: described.upper - shape,
                },
            });
        }
    }

    /// The value of a nonlinear parameter, as the catalogue counts; one of another.
    pub(crate) fn shape(&self, parameter: usize) -> f64 {
        let mut shapes = self.place.0.description().shapes().zip(self.shapes);
        shapes
            .find(|(n, _)| *n == parameter)
            .map_or(1.0, |(_, shape)| shape)
    }

    /// As something that a model might lack: as likely on either side of nothing.
    pub(crate) fn into_candidate(mut self) -> Self {
        for own in &mut self.linear {
            own.prior.std = own.prior.std.max(own.prior.mean.abs());
            own.prior.mean = 0.0;
        }
        self
    }
}

/// Mean and standard deviation of an effect's parameter before any data.
pub(crate) fn prior(
    (model, robot): (&Model, &Legged),
    (effect, joint): Place,
    parameter: usize,
) -> (f64, f64) {
    if joint == BASE {
        return (0.0, robot.load_on_trunk[parameter]);
    }
    let prior = match parameter {
        0 => model.effect_prior(effect, joint).prior,
        n => model.robot().parameter_prior(effect, joint, n),
    };
    (prior.mean, prior.std)
}

/// The columns of a walk's rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WalkColumns {
    pub(crate) robot: Arc<Legged>,
    pub(crate) sites: Vec<EffectSite>,
}

impl WalkColumns {
    /// Where the sensors' columns begin, the accelerometer's first.
    pub(crate) fn acc(&self) -> usize {
        INERTIAL * self.robot.bodies()
    }

    /// Columns that rows have whatever the model: where those of effects begin.
    pub(crate) fn fixed(&self) -> usize {
        self.acc() + SENSORS
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        let effects = self.sites.iter().map(|site| site.linear.len());
        self.fixed() + effects.sum::<usize>()
    }

    /// The columns of effects in their order: each one's number among all, that of its effect, and which parameter it is of.
    pub(crate) fn effects(&self) -> impl Iterator<Item = (usize, usize, &Linear)> {
        let all = self.sites.iter().enumerate();
        let all = all.flat_map(|(n, site)| site.linear.iter().map(move |linear| (n, linear)));
        (self.fixed()..)
            .zip(all)
            .map(|(k, (n, linear))| (k, n, linear))
    }

    /// The columns of an effect at a joint, in the order of its parameters; none where rows do not have it.
    pub(crate) fn of(&self, place: Place) -> Vec<usize> {
        let own = self
            .effects()
            .filter(|(_, n, _)| self.sites[*n].place == place);
        own.map(|(k, ..)| k).collect()
    }

    /// An effect at a joint.
    pub(crate) fn site(&self, place: Place) -> Option<&EffectSite> {
        self.sites.iter().find(|site| site.place == place)
    }

    /// The columns of loads: each one's number, its body counted from the base, and how much of the body's own columns it is.
    pub(super) fn loads(&self) -> Vec<(usize, usize, [f64; INERTIAL])> {
        let cad = &self.robot.tree;
        let of = |(k, _, linear): (usize, usize, &Linear)| match linear.column {
            Column::Load { body, n } => {
                let b = body_of(body);
                let inertia = &cad.bodies()[b].inertia;
                let com = inertia.first_moment() / inertia.mass();
                Some((k, b, load(&com, n)))
            }
            _ => None,
        };
        self.effects().filter_map(of).collect()
    }
}

/// A joint's body among a walk's, the base first.
pub(crate) fn body_of(joint: usize) -> usize {
    match joint {
        BASE => 0,
        joint => 1 + joint,
    }
}

//! The numbers of a limb's model: what a predictor is given beside the motion, and what a fit moves.

use nalgebra::Vector3;
use proprio_core::effect::{
    EffectKind, Form, MAX_PARAMETERS, MAX_SHAPES, Moved, Shapes, Transmission,
};
use proprio_core::inertia::{INERTIAL, InertialParameters};

use super::encoder::Encoder;
use crate::model::{BASE, JointQuantity, Limb, Model};

/// An effect at a joint of a limb, counted from the limb's first; [`BASE`] for what all joints share.
pub(crate) type Place = (EffectKind, usize);

/// Whether an effect is one of all joints at `joint`.
pub(crate) fn is_shared(joint: usize) -> bool {
    joint == BASE
}

/// Of an effect without shapes.
pub(crate) const NO_SHAPES: Shapes = [1.0; MAX_SHAPES];

/// A load lighter than this is nowhere in particular, kg.
pub(crate) const LEAST_LOAD: f64 = 0.01;

/// All numbers of a limb's model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Values {
    /// Ten inertial parameters of each body, loads apart.
    pub(crate) bodies: Vec<[f64; INERTIAL]>,
    /// The effects that the model has, in the order in which they came, with their parameters as the catalogue counts them.
    effects: Vec<(Place, [f64; MAX_PARAMETERS])>,
    /// What damps each joint's spring, N m s/rad; zero where the model does not say.
    dampers: Vec<f64>,
}

impl Values {
    /// The CAD's bodies, or those that the model has identified, and no effect.
    pub(crate) fn bodies_of(model: &Model, limb: &Limb) -> Self {
        let body = |b: usize| -> [f64; INERTIAL] { std::array::from_fn(|n| model.inertia(b).0[n]) };
        Self {
            bodies: limb.bodies.clone().map(body).collect(),
            effects: Vec::new(),
            dampers: vec![0.0; limb.bodies.len()],
        }
    }

    /// The CAD's bodies and no effect.
    pub(crate) fn cad(model: &Model, limb: &Limb) -> Self {
        let cad = |b: usize| -> [f64; INERTIAL] {
            std::array::from_fn(|n| model.robot().bodies()[b].inertia.0[n])
        };
        Self {
            bodies: limb.bodies.clone().map(cad).collect(),
            effects: Vec::new(),
            dampers: vec![0.0; limb.bodies.len()],
        }
    }

    /// What a model file gives: an effect without a value does nothing.
    pub(crate) fn given(model: &Model, limb: &Limb) -> Self {
        let mut values = Self::bodies_of(model, limb);
        for (damper, body) in values.dampers.iter_mut().zip(limb.bodies.clone()) {
            let known = model.spring_damping(body, JointQuantity::Elasticity);
            *damper = known.map_or(0.0, |known| known.value);
        }
        for (place, e) in places(model, limb) {
            if e.estimates.iter().any(Option::is_some) {
                values.insert(place);
                for (n, estimate) in e.estimates.iter().enumerate() {
                    if let Some(estimate) = estimate {
                        values.set(place, n, estimate.value);
                    }
                }
            }
        }
        values
    }

    /// The effects.
    pub(crate) fn places(&self) -> impl Iterator<Item = Place> + '_ {
        self.effects.iter().map(|(place, _)| *place)
    }

    /// Whether the model has an effect.
    pub(crate) fn has(&self, place: Place) -> bool {
        self.effects.iter().any(|(known, _)| *known == place)
    }

    /// Adds an effect that does nothing yet.
    pub(crate) fn insert(&mut self, place: Place) {
        if !self.has(place) {
            self.effects.push((place, neutral(place.0)));
        }
    }

    /// Takes an effect away.
    pub(crate) fn remove(&mut self, place: Place) {
        self.effects.retain(|(known, _)| *known != place);
    }

    /// A parameter; its neutral value where the model does not have the effect.
    pub(crate) fn get(&self, place: Place, parameter: usize) -> f64 {
        let found = self.effects.iter().find(|(known, _)| *known == place);
        found.map_or_else(|| neutral(place.0), |(_, numbers)| *numbers)[parameter]
    }

    /// Sets a parameter of an effect that the model has.
    pub(crate) fn set(&mut self, place: Place, parameter: usize, value: f64) {
        if let Some((_, numbers)) = self.effects.iter_mut().find(|(known, _)| *known == place) {
            numbers[parameter] = value;
        }
    }

    /// The values of an effect's shapes.
    pub(crate) fn shapes(&self, place: Place) -> Shapes {
        let mut shapes = NO_SHAPES;
        for (shape, n) in shapes.iter_mut().zip(place.0.description().shapes()) {
            *shape = self.get(place, n);
        }
        shapes
    }

    /// Sets the parameters of an effect of the model that are searched.
    pub(crate) fn set_searched(&mut self, place: Place, searched: Shapes) {
        for (value, (n, _)) in searched
            .into_iter()
            .zip(place.0.description().all_searched())
        {
            self.set(place, n, value);
        }
    }

    /// The effects at a joint that act on this, with their parameters.
    fn acting(&self, form: Form, joint: usize) -> impl Iterator<Item = &[f64; MAX_PARAMETERS]> {
        let own = move |place: &Place| place.1 == joint && place.0.description().form == form;
        let effects = self.effects.iter().filter(move |(place, _)| own(place));
        effects.map(|(_, numbers)| numbers)
    }

    /// The sum of a parameter of those: zero where the model has none.
    fn sum(&self, form: Form, joint: usize, parameter: usize) -> f64 {
        let numbers = self.acting(form, joint);
        numbers.fold(0.0, |sum, numbers| sum + numbers[parameter])
    }

    /// How late a joint's torque is reported, s: its own delay and that of all joints.
    pub(crate) fn delay(&self, joint: usize) -> f64 {
        self.sum(Form::Clock, joint, 0) + self.sum(Form::Clock, BASE, 0)
    }

    /// Reported over true torque of a joint's drive, inverted: what the model's torque is divided by.
    pub(crate) fn torque_gain(&self, joint: usize) -> f64 {
        let gains = self.acting(Form::Scale, joint);
        gains.fold(1.0, |product, numbers| product * numbers[0])
    }

    /// What a joint's encoder gets wrong.
    pub(crate) fn encoder(&self, joint: usize) -> Encoder {
        let once = |n: usize| self.sum(Form::Motion(Moved::OncePerTurn), joint, n);
        Encoder {
            offset: self.sum(Form::Motion(Moved::Zero), joint, 0),
            sine: once(0),
            cosine: once(1),
        }
    }

    /// What each encoder gets wrong.
    pub(crate) fn encoders(&self) -> impl Iterator<Item = Encoder> + '_ {
        (0..self.bodies.len()).map(|j| self.encoder(j))
    }

    /// A parameter of what a joint has between motor and link, SI; zero where the model has nothing of the kind.
    pub(crate) fn transmission(&self, of: Transmission, joint: usize, parameter: usize) -> f64 {
        self.sum(Form::Motion(Moved::Link(of)), joint, parameter)
    }

    /// What damps a joint's spring, N m s/rad, where the model says so.
    pub(crate) fn damper(&self, joint: usize) -> Option<f64> {
        self.dampers.get(joint).copied().filter(|d| *d > 0.0)
    }

    /// Roll and pitch of gravity against the model's base, rad.
    pub(crate) fn tilt(&self) -> [f64; 2] {
        [0, 1].map(|n| self.sum(Form::Gravity, BASE, n))
    }

    /// Where the load on a body is, m in the joint frame: at the body's centre of mass `com` until it has a mass.
    pub(crate) fn load_at(&self, body: usize, com: &Vector3<f64>) -> Vector3<f64> {
        let number = |n: usize| self.sum(Form::Inertia, body, n);
        let mass = number(0);
        if mass < LEAST_LOAD {
            return *com;
        }
        com + Vector3::new(number(1), number(2), number(3)) / mass
    }

    /// What multiplies the columns of a load that is where [`load_at`](Self::load_at) says.
    pub(crate) fn load_numbers(&self, body: usize) -> [f64; 5] {
        let mut numbers: [f64; 5] = std::array::from_fn(|n| self.sum(Form::Inertia, body, n));
        if numbers[0] >= LEAST_LOAD {
            numbers[1..4].fill(0.0);
        }
        numbers
    }

    /// The bodies with their loads.
    pub(crate) fn loaded(&self, coms: &[Vector3<f64>]) -> Vec<InertialParameters<f64>> {
        let body = |(b, numbers): (usize, &[f64; INERTIAL])| {
            let mut phi = *numbers;
            if self.acting(Form::Inertia, b).next().is_some() {
                let at = self.load_at(b, &coms[b]);
                for (n, value) in self.load_numbers(b).into_iter().enumerate() {
                    let column = load(&at, n);
                    phi.iter_mut()
                        .zip(column)
                        .for_each(|(x, by)| *x += value * by);
                }
            }
            InertialParameters(phi.into())
        };
        self.bodies.iter().enumerate().map(body).collect()
    }
}

/// The effects of a model at a limb and those that all joints share, as the limb counts its joints.
pub(crate) fn places<'a>(
    model: &'a Model,
    limb: &'a Limb,
) -> impl Iterator<Item = (Place, &'a crate::model::ModelEffect)> + 'a {
    let first = limb.bodies.start;
    model.effects().iter().filter_map(move |e| match e.joint {
        BASE => Some(((e.effect, BASE), e)),
        joint if limb.bodies.contains(&joint) => Some(((e.effect, joint - first), e)),
        _ => None,
    })
}

/// The parameters with which an effect does nothing; a shape that is not known yet is one.
fn neutral(effect: EffectKind) -> [f64; MAX_PARAMETERS] {
    let mut numbers = [0.0; MAX_PARAMETERS];
    for (number, parameter) in numbers.iter_mut().zip(effect.description().parameters) {
        *number = if parameter.shape {
            1.0
        } else {
            parameter.neutral
        };
    }
    numbers
}

/// The inertial parameters of a point mass of 1 kg at `com` (n = 0), or how they change with its first moment (1 kg m) along
/// x, y or z (n = 1 to 3), or the same inertia about all axes (n = 4).
pub(crate) fn load(com: &Vector3<f64>, n: usize) -> [f64; INERTIAL] {
    if n == 4 {
        return [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    }
    let (mass, away) = match n {
        0 => (1.0, *com),
        n => (0.0, Vector3::ith(n - 1, 1.0)),
    };
    // The inertia |c|² 1 − c cᵀ, or its derivative along `away`.
    let share = if n == 0 { 0.5 } else { 1.0 };
    let spread = com * away.transpose() + away * com.transpose();
    let inertia = (nalgebra::Matrix3::identity() * spread.trace() - spread) * share;
    let i = |r: usize, c: usize| inertia[(r, c)];
    [
        mass,
        away.x,
        away.y,
        away.z,
        i(0, 0),
        i(0, 1),
        i(0, 2),
        i(1, 1),
        i(1, 2),
        i(2, 2),
    ]
}

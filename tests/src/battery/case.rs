//! What is hidden where, and what the model knows.

use std::fmt;
use std::str::FromStr;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{ACTUATORS, JointId, Leg};
use proprio_host::model::Model;
use proprio_simulator::hidden::typical;
use proprio_simulator::{HiddenEffect, HiddenKind, SIZES, Scope, Sensors, Simulation, Sizes};

/// How far the true bodies are off the CAD: relative standard deviation of a mass.
const INERTIA_ERROR: f64 = 0.06;
/// Shift of sampling instants as a share of the period, and share of repeated samples.
const JITTER: f64 = 0.05;
const REPEATS: f64 = 0.01;
/// Seeds of each hidden effect, place and size; of each effect outside the catalogue; of complete models.
const SEEDS: u64 = 2;
const OUTSIDE_SEEDS: u64 = 1;
const COMPLETE_SEEDS: u64 = 100;

/// The effects that every joint has and the model knows of.
pub const TYPICAL: [HiddenKind; 4] = [
    HiddenKind::Viscous,
    HiddenKind::Coulomb,
    HiddenKind::Armature,
    HiddenKind::Bias,
];

/// What a case asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Is the hidden effect named?
    One,
    /// Is a complete model called complete?
    Complete,
    /// Are two hidden effects both found?
    Two,
    /// Is what the catalogue does not have called so?
    Outside,
}

impl Group {
    /// In tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "one",
            Self::Complete => "complete",
            Self::Two => "two",
            Self::Outside => "outside",
        }
    }
}

/// One log of one leg.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Whose log it is.
    pub leg: Leg,
    /// What the model does not know of.
    pub hidden: Vec<HiddenEffect>,
    /// 0 small, 1 medium, 2 large.
    pub size: usize,
    /// Of reference, bodies and noise.
    pub seed: u64,
}

impl Case {
    /// A single hidden effect.
    fn one(kind: HiddenKind, joint: JointId, size: usize, seed: u64) -> Self {
        let hidden = Sizes::of(kind).at(size, joint);
        Self {
            leg: joint.leg(),
            hidden: vec![hidden.expect("the sizes are possible")],
            size,
            seed,
        }
    }

    /// What it asks.
    pub fn group(&self) -> Group {
        match &self.hidden[..] {
            [] => Group::Complete,
            [one] if !one.kind().description().in_catalogue => Group::Outside,
            [_] => Group::One,
            _ => Group::Two,
        }
    }

    /// The robot: what is hidden, and the typical effects that it does not stand for.
    pub fn simulation(&self) -> Simulation {
        let mut simulation = self.without(&self.hidden);
        simulation.effects.extend(self.hidden.iter().cloned());
        simulation
    }

    /// The robot with what the model knows of and, of what is hidden, nothing.
    pub fn known(&self) -> Simulation {
        self.without(&self.hidden)
    }

    fn without(&self, hidden: &[HiddenEffect]) -> Simulation {
        let mut effects = typical(&[self.leg]);
        effects.retain(|e| !hidden.iter().any(|h| stands_for(h, e)));
        Simulation {
            effects,
            inertia_error: INERTIA_ERROR,
            temperature: true,
            sensors: Sensors {
                jitter: JITTER,
                repeats: REPEATS,
                ..Sensors::default()
            },
            seed: self.seed,
            ..Simulation::new(&[self.leg])
        }
    }

    /// The model to be criticised: the CAD and the typical effects without values, but for what is hidden.
    pub fn model(&self) -> Model {
        let mut model = Model::default();
        for effect in self.known().effects {
            add(&mut model, &effect);
        }
        model
    }

    /// The model that has exactly the effects that are true, their values to be fitted, their shapes given; `None` if the
    /// catalogue lacks one or has no columns for it.
    pub fn true_model(&self) -> Option<Model> {
        let mut model = self.model();
        let known = |e: &HiddenEffect| {
            e.kind().description().in_catalogue && e.kind() != HiddenKind::Contact
        };
        if !self.hidden.iter().all(known) {
            return None;
        }
        for effect in &self.hidden {
            let (kind, joint) = add(&mut model, effect)?;
            for (n, parameter) in kind.description().parameters.iter().enumerate() {
                if let (true, Some(value)) = (parameter.shape, shape(effect)) {
                    model.set_parameter(kind, joint, n, value, None).ok()?;
                }
            }
        }
        Some(model)
    }
}

/// Whether a hidden effect takes the place of one of the typical ones: itself, or what it says more generally.
fn stands_for(hidden: &HiddenEffect, typical: &HiddenEffect) -> bool {
    // Direction-dependent friction is friction plus a constant torque: a model that has both lacks nothing.
    let general = hidden.kind() == HiddenKind::AsymmetricCoulomb
        && [HiddenKind::Coulomb, HiddenKind::Bias].contains(&typical.kind());
    hidden.joint() == typical.joint() && (hidden.kind() == typical.kind() || general)
}

/// The shape of an effect that has one, as the catalogue means it.
fn shape(effect: &HiddenEffect) -> Option<f64> {
    match effect.kind() {
        HiddenKind::Stribeck | HiddenKind::Presliding | HiddenKind::SaturatingViscous => {
            effect.values().get(1).copied()
        }
        HiddenKind::Cogging => Some(effect.values()[2] * ACTUATORS[effect.joint()?.place()].gear),
        HiddenKind::Saturation => Some(effect.values()[0]),
        _ => None,
    }
}

fn add(model: &mut Model, effect: &HiddenEffect) -> Option<(EffectKind, usize)> {
    let kind = EffectKind::from_name(effect.kind().name())?;
    let joint = effect.joint().map(JointId::name);
    let place = model.robot().place(kind, joint).ok()?;
    model.add_effect(kind, place[0]);
    Some((kind, place[0]))
}

/// Every case of the battery, in the order of the table.
pub fn all() -> Vec<Case> {
    let mut cases = Vec::new();
    for (n, sizes) in SIZES.iter().enumerate() {
        let seeds = if sizes.kind.description().in_catalogue {
            SEEDS
        } else {
            OUTSIDE_SEEDS
        };
        for place in places(sizes.kind) {
            for size in 0..3 {
                for seed in 1..=seeds {
                    let leg = Leg::ALL[(n + place + seed as usize) % Leg::ALL.len()];
                    cases.push(Case::one(sizes.kind, JointId::of(leg)[place], size, seed));
                }
            }
        }
    }
    cases.extend(pairs());
    cases.extend((1..=COMPLETE_SEEDS).map(|seed| Case {
        leg: Leg::ALL[seed as usize % Leg::ALL.len()],
        hidden: Vec::new(),
        size: 0,
        seed,
    }));
    cases
}

/// The places in a leg that differ.
fn places(kind: HiddenKind) -> std::ops::Range<usize> {
    match kind.description().scope {
        Scope::Joint => 0..3,
        Scope::Pair => 1..3,
        // All legs tell it, and these cases are of one.
        Scope::Base if kind == HiddenKind::BaseRecoil => 0..0,
        Scope::Foot | Scope::Base => 2..3,
    }
}

/// Two effects at once: of different nature, at one joint or at two.
fn pairs() -> Vec<Case> {
    use HiddenKind as K;
    let pairs = [
        ((K::Coulomb, 2), (K::Armature, 0)),
        ((K::Coulomb, 1), (K::Viscous, 1)),
        ((K::Spring, 1), (K::Coulomb, 0)),
        ((K::Cogging, 2), (K::Armature, 2)),
        ((K::Stribeck, 1), (K::Spring, 2)),
        ((K::LoadFriction, 2), (K::Bias, 0)),
        ((K::VelocityGain, 0), (K::Coulomb, 2)),
        ((K::Delay, 1), (K::Viscous, 2)),
        ((K::TorqueGain, 2), (K::Coulomb, 1)),
        ((K::EncoderOffset, 1), (K::Armature, 2)),
        ((K::Payload, 2), (K::Coulomb, 2)),
        ((K::BaseTilt, 2), (K::Spring, 1)),
        ((K::QuadraticDrag, 0), (K::Cogging, 1)),
        ((K::Backlash, 2), (K::Viscous, 0)),
        ((K::ThermalViscous, 2), (K::Spring, 0)),
        ((K::Saturation, 1), (K::Armature, 1)),
    ];
    let mut cases = Vec::new();
    for (n, (a, b)) in pairs.into_iter().enumerate() {
        for size in 1..3 {
            let seed = size as u64;
            let leg = Leg::ALL[(n + size) % Leg::ALL.len()];
            let mut case = Case::one(a.0, JointId::of(leg)[a.1], size, seed);
            let second = Case::one(b.0, JointId::of(leg)[b.1], size, seed);
            case.hidden.extend(second.hidden);
            cases.push(case);
        }
    }
    cases
}

/// `coulomb:FR_calf:2:1`; two effects are joined by `+`, a complete model is `complete:FR:1`.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.hidden.is_empty() {
            return write!(f, "complete:{}:{}", self.leg.name(), self.seed);
        }
        let of = |e: &HiddenEffect| match e.joint() {
            Some(joint) => format!("{}:{}", e.kind().name(), joint.name()),
            None => format!("{}:{}", e.kind().name(), JointId::of(self.leg)[2].name()),
        };
        let places: Vec<String> = self.hidden.iter().map(of).collect();
        write!(f, "{}:{}:{}", places.join("+"), self.size, self.seed)
    }
}

impl FromStr for Case {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("`{text}`: expected EFFECT:JOINT:SIZE:SEED or complete:LEG:SEED");
        if let Some(rest) = text.strip_prefix("complete:") {
            let (leg, seed) = rest.split_once(':').ok_or_else(form)?;
            return Ok(Self {
                leg: Leg::from_name(leg).ok_or_else(|| format!("no leg `{leg}`"))?,
                hidden: Vec::new(),
                size: 0,
                seed: seed.parse().map_err(|_| form())?,
            });
        }
        let mut parts = text.rsplitn(3, ':');
        let seed = parts.next().and_then(|s| s.parse().ok()).ok_or_else(form)?;
        let size: usize = parts.next().and_then(|s| s.parse().ok()).ok_or_else(form)?;
        let mut found: Option<Self> = None;
        for place in parts.next().ok_or_else(form)?.split('+') {
            let (kind, joint) = place.split_once(':').ok_or_else(form)?;
            let kind = HiddenKind::from_name(kind).ok_or_else(form)?;
            let joint = JointId::from_name(joint).ok_or_else(form)?;
            let case = Self::one(kind, joint, size, seed);
            match &mut found {
                None => found = Some(case),
                Some(first) => first.hidden.extend(case.hidden),
            }
        }
        found.ok_or_else(form)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_name_of_its_own_that_leads_back_to_it() {
        let cases = all();
        let mut names: Vec<String> = cases.iter().map(Case::to_string).collect();
        for (case, name) in cases.iter().zip(&names) {
            assert_eq!(name.parse::<Case>().as_ref(), Ok(case));
        }
        names.sort();
        names.dedup();
        assert_eq!(names.len(), cases.len());
    }

    #[test]
    fn the_model_lacks_what_is_hidden_and_nothing_else() {
        for case in all() {
            let model = case.model();
            let known = model.effects().len();
            let replaced = match case.hidden.first().map(HiddenEffect::kind) {
                Some(HiddenKind::AsymmetricCoulomb) => 2,
                _ => (case.hidden.iter())
                    .filter(|e| TYPICAL.contains(&e.kind()))
                    .count(),
            };
            assert_eq!(known + replaced, 3 * TYPICAL.len(), "{case}");
            if let Some(truth) = case.true_model() {
                assert_eq!(truth.effects().len(), known + case.hidden.len(), "{case}");
            }
        }
    }
}

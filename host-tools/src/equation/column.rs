//! Which column is what: the parameters of a limb's model and of all that it might lack.

use proprio_core::effect::{
    EffectKind, Enters, Form, JointState, MAX_COLUMNS, Moved, Shapes, Term,
};
use proprio_core::inertia::INERTIAL;

use super::values::{Place, Values, is_shared};

/// One parameter of a limb: an entry of θ.
///
/// θ is the parameter itself or, where the torque is not linear in it, how far it is from where the columns were made; of a load
/// that has been placed, its first moment about that place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Entry {
    /// The effect; `None` for an inertial parameter of a body.
    pub(crate) effect: Option<EffectKind>,
    /// The joint in the limb whose effect or body it is; [`BASE`](crate::model::BASE) for an effect that all joints share.
    pub(crate) joint: usize,
    /// Which parameter of the effect, as the catalogue counts, or of the body.
    pub(crate) parameter: usize,
    /// Expected value before any data.
    pub(crate) mean: f64,
    /// Its standard deviation.
    pub(crate) std: f64,
    /// Its column.
    pub(crate) column: Column,
}

/// A column of window rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Column {
    /// Parameter n of body b.
    Inertial(usize, usize),
    /// Column `n` of an effect with those shapes at a joint.
    Own {
        joint: usize,
        effect: EffectKind,
        shapes: Shapes,
        n: usize,
    },
    /// The derivative of an effect's torque in one of its nonlinear parameters, by a difference between two values of that, at these values of the others.
    Shape {
        joint: usize,
        effect: EffectKind,
        around: [Shapes; 2],
        /// How far apart they are.
        apart: f64,
        values: [f64; MAX_COLUMNS],
    },
    /// Column `n` of an effect with those shapes that couples a joint with the one that carries it, or with the others that it sees.
    Coupled {
        joint: usize,
        effect: EffectKind,
        shapes: Shapes,
        n: usize,
    },
    /// Motion of a joint's link by parameter `n` of this effect.
    Motion {
        joint: usize,
        effect: EffectKind,
        n: usize,
    },
    /// A point mass at a body's centre of mass (0), its first moment along x, y, z (1–3), or the
    /// same inertia about all axes (4).
    Load { body: usize, n: usize },
    /// All that a joint's torque is made of.
    Scale(usize),
    /// Turning of gravity about the base's axis.
    Gravity(usize),
    /// One delay of all joints.
    Delay,
    /// What a sensor of a moving base gets wrong, by its number among them.
    Sensor(usize),
}

/// Whose states a column's numbers at an instant are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Sees {
    /// No joint's: the links' motion alone, or nothing.
    None,
    /// Its joint's.
    Own,
    /// Any joint's.
    All,
}

/// Whether an effect's window terms at a joint are made of the other joints' states too: of the catalogue's with terms of their own none is.
pub(crate) fn sees_other_joints(effect: EffectKind) -> bool {
    !effect.others().is_empty()
}

impl Column {
    /// Whose states its numbers at an instant are made of.
    pub(super) fn sees(&self) -> Sees {
        match self {
            Self::Inertial(..) | Self::Gravity(_) => Sees::None,
            Self::Load { .. } | Self::Scale(_) | Self::Sensor(_) => Sees::None,
            Self::Own { effect, .. } | Self::Shape { effect, .. } if sees_other_joints(*effect) => {
                Sees::All
            }
            Self::Own { .. } | Self::Shape { .. } => Sees::Own,
            Self::Coupled { .. } | Self::Motion { .. } | Self::Delay => Sees::All,
        }
    }

    /// Whether it is one of a load.
    pub(super) fn is_load(&self) -> bool {
        matches!(self, Self::Load { .. })
    }
}

/// The columns of a limb.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Columns {
    /// The limb's subtrees: body b carries those up to `subtree_end[b]`.
    pub(crate) subtree_end: Vec<usize>,
    /// θ: the inertial parameters of all bodies, then the effects'.
    pub(crate) entries: Vec<Entry>,
    /// The columns of each joint's rows, in the order of the entries.
    pub(crate) of_joint: Vec<Vec<Column>>,
    /// Where each entry stands in each joint's rows.
    places: Vec<Vec<Option<usize>>>,
}

impl Columns {
    /// The columns of a limb with these entries beyond the inertial ones, which come first with their prior to be set
    /// apart: inertial priors are matrices.
    pub(crate) fn new(subtree_end: Vec<usize>, effects: Vec<Entry>) -> Self {
        let joints = subtree_end.len();
        let inertial = (0..joints).flat_map(|b| {
            (0..INERTIAL).map(move |n| Entry {
                effect: None,
                joint: b,
                parameter: n,
                mean: 0.0,
                std: f64::INFINITY,
                column: Column::Inertial(b, n),
            })
        });
        Self::of_entries(subtree_end, inertial.chain(effects).collect())
    }

    /// Those of effects alone, without bodies.
    pub(crate) fn of_effects(subtree_end: Vec<usize>, effects: Vec<Entry>) -> Self {
        Self::of_entries(subtree_end, effects)
    }

    fn of_entries(subtree_end: Vec<usize>, entries: Vec<Entry>) -> Self {
        let joints = subtree_end.len();
        let felt = |joint: usize, column: &Column| match *column {
            Column::Own { joint: own, .. }
            | Column::Shape { joint: own, .. }
            | Column::Scale(own) => own == joint || is_shared(own),
            Column::Inertial(b, _) | Column::Load { body: b, .. } => {
                (joint..subtree_end[joint]).contains(&b)
            }
            Column::Coupled {
                joint: own, effect, ..
            } => couples(effect, [own, joint], parent(&subtree_end, own)),
            Column::Motion { .. } | Column::Gravity(_) | Column::Delay | Column::Sensor(_) => true,
        };
        let (mut of_joint, mut places) = (Vec::new(), Vec::new());
        for joint in 0..joints {
            let mut columns: Vec<Column> = Vec::new();
            for entry in &entries {
                if felt(joint, &entry.column) && !columns.contains(&entry.column) {
                    columns.push(entry.column);
                }
            }
            let place = |e: &Entry| columns.iter().position(|c| *c == e.column);
            places.push(entries.iter().map(place).collect());
            of_joint.push(columns);
        }
        Self {
            subtree_end,
            entries,
            of_joint,
            places,
        }
    }

    /// The columns of rows of one kind, which have them all; `places` tell where each entry stands in a row.
    pub(crate) fn of_all(entries: Vec<Entry>, places: &[usize]) -> Self {
        let mut of_row: Vec<Column> = entries.iter().map(|entry| entry.column).collect();
        for (entry, place) in entries.iter().zip(places) {
            of_row[*place] = entry.column;
        }
        Self {
            subtree_end: vec![1],
            entries,
            of_joint: vec![of_row],
            places: vec![places.iter().copied().map(Some).collect()],
        }
    }

    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        self.subtree_end.len()
    }

    /// The torque at joint `at` that a column of an effect stands for, per unit of its parameter, where the limb's joints are in these
    /// `states`; `None` for what is no torque of an effect's own, or none that the joint feels.
    pub(crate) fn term(
        &self,
        column: &Column,
        at: usize,
        states: &[JointState<f64>],
    ) -> Option<Term<f64>> {
        match *column {
            Column::Own {
                joint,
                effect,
                shapes,
                n,
            } => {
                (joint == at || is_shared(joint)).then(|| effect.terms_among(states, at, shapes)[n])
            }
            Column::Coupled {
                joint,
                effect,
                shapes,
                n,
            } => {
                let parent = parent(&self.subtree_end, joint);
                Some(coupled_terms(effect, ([joint, at], parent), states, shapes)?[n])
            }
            _ => None,
        }
    }

    /// The other one of the two joints that an effect at `joint` couples, as seen from the one `at`; `None` if it is neither.
    pub(crate) fn coupled(&self, joint: usize, at: usize) -> Option<usize> {
        let parent = parent(&self.subtree_end, joint)?;
        match at {
            _ if at == joint => Some(parent),
            _ if at == parent => Some(joint),
            _ => None,
        }
    }

    /// Where an entry stands in a joint's rows; `None` where the joint does not feel it.
    pub(crate) fn place(&self, joint: usize, entry: usize) -> Option<usize> {
        self.places[joint][entry]
    }

    /// Of each joint, θ as multiples of its columns.
    pub(crate) fn combined(&self, theta: &[f64]) -> Vec<Vec<f64>> {
        let of = |joint: usize| {
            let mut own = vec![0.0; self.of_joint[joint].len()];
            for (entry, value) in theta.iter().enumerate() {
                if let Some(place) = self.place(joint, entry) {
                    own[place] += value;
                }
            }
            own
        };
        (0..self.joints()).map(of).collect()
    }

    /// Of each joint, what its columns are times in the prediction of a model: nothing for derivatives, whose effects are in the
    /// motion already.
    pub(crate) fn numbers(&self, values: &Values) -> Vec<Vec<f64>> {
        self.combined(&self.theta(values))
    }

    /// θ of a model where the columns are made at its values.
    pub(crate) fn theta(&self, values: &Values) -> Vec<f64> {
        let of = |entry: &Entry| match entry.effect {
            None => values.bodies[entry.joint][entry.parameter],
            Some(effect)
                if !values.has((effect, entry.joint)) || effect.description().is_derivative() =>
            {
                0.0
            }
            Some(effect) if effect.description().form == Form::Inertia => {
                values.load_numbers(entry.joint)[entry.parameter]
            }
            Some(effect) => values.get((effect, entry.joint), entry.parameter),
        };
        self.entries.iter().map(of).collect()
    }

    /// Whether they are other ones at other values.
    pub(crate) fn depend_on_values(&self) -> bool {
        let mut effects = self.entries.iter().filter_map(|e| e.effect);
        effects.any(depends_on_values)
    }

    /// The entries of an effect at a joint, in the order of its parameters.
    pub(crate) fn of_effect(&self, effect: EffectKind, joint: usize) -> Vec<usize> {
        let is = |e: &Entry| e.effect == Some(effect) && e.joint == joint;
        (0..self.entries.len())
            .filter(|&k| is(&self.entries[k]))
            .collect()
    }
}

/// Whether an effect at a joint that is carried by the `parent` is a torque at another one too: `joints` are both.
pub(crate) fn couples(effect: EffectKind, [own, at]: [usize; 2], parent: Option<usize>) -> bool {
    let sees = |after: &isize| own.checked_add_signed(*after) == Some(at);
    own == at
        || match effect.couples_with_parent() {
            true => parent == Some(at),
            false => effect.others().iter().any(sees),
        }
}

/// The window terms at a joint of an effect that couples its own with others: `joints` are its own, which the `parent` carries, and the one asked of.
pub(crate) fn coupled_terms(
    effect: EffectKind,
    ([own, at], parent): ([usize; 2], Option<usize>),
    states: &[JointState<f64>],
    shapes: Shapes,
) -> Option<[Term<f64>; MAX_COLUMNS]> {
    if let EffectKind::Own(known) = effect {
        return Some((known.coupled?)(states, own, at, shapes));
    }
    let parent = parent?;
    let other = if at == own { parent } else { own };
    couples(effect, [own, at], Some(parent)).then(|| effect.coupled(&states[at], &states[other]))
}

/// Whether an effect's columns are other ones at other values.
pub(crate) fn depends_on_values(effect: EffectKind) -> bool {
    let description = effect.description();
    description.is_derivative()
        || description.depends_on_model()
        || description.form == Form::Inertia
}

/// The joint that carries another one of a limb; `None` for the first.
pub(crate) fn parent(subtree_end: &[usize], joint: usize) -> Option<usize> {
    (0..joint).rev().find(|&i| subtree_end[i] > joint)
}

/// The columns that an effect at a joint of a limb has, each with the parameter it belongs to.
pub(crate) fn columns_of((effect, joint): Place, shapes: Shapes) -> Vec<(usize, Column)> {
    let description = effect.description();
    match description.form {
        Form::Clock if is_shared(joint) => vec![(0, Column::Delay)],
        Form::Columns | Form::Clock => {
            let linear = description.linear().enumerate();
            linear
                .map(|(n, parameter)| {
                    (
                        parameter,
                        Column::Own {
                            joint,
                            effect,
                            shapes,
                            n,
                        },
                    )
                })
                .collect()
        }
        Form::Coupled => (description.linear().enumerate())
            .map(|(n, parameter)| {
                (
                    parameter,
                    Column::Coupled {
                        joint,
                        effect,
                        shapes,
                        n,
                    },
                )
            })
            .collect(),
        Form::Motion(_) if description.enters == Enters::Positions => Vec::new(),
        // Friction inside a spring is told by its second encoder; what else lies between motor and link has one number that moves it.
        Form::Motion(Moved::OncePerTurn) => (0..description.parameters.len())
            .map(|n| (n, Column::Motion { joint, effect, n }))
            .collect(),
        Form::Motion(_) => vec![(
            0,
            Column::Motion {
                joint,
                effect,
                n: 0,
            },
        )],
        Form::Gravity => vec![(0, Column::Gravity(0)), (1, Column::Gravity(1))],
        Form::Inertia => (0..description.parameters.len())
            .map(|n| (n, Column::Load { body: joint, n }))
            .collect(),
        Form::Scale => vec![(0, Column::Scale(joint))],
        Form::Force => Vec::new(),
    }
}

//! Columns of torques at joints, in the equations that contact forces leave: what [`proprio_core::window::FreeBaseWindow`] makes of effects that it
//! knows, for any effect of the catalogue.
//!
//! A torque e(t) at joint j enters P D times the equations, P the projector at each sample and D the equations' scale, as P D S_j e. With
//! e = d(boundary)/dt + rate the window's column is Σ P D S_j (half the differences of the boundary to both sides + rate × the time that the sample stands
//! for), the same sum as the core's.

use std::ops::Range;

use proprio_core::effect::{Input, JointState, MAX_COLUMNS, Shapes, Term};

use super::channels::Channels;
use super::columns::{EffectSite, WalkColumns};
use super::projector::Projector;
use super::row_setup::RowSetup;
use super::sensors::Sensors;
use super::stance::Stance;
use super::walk::Walk;
use crate::equation::column::{Column, coupled_terms, couples};
use crate::equation::free_tree::{OF_BASE, Pose};
use crate::equation::presliding::Way;
use crate::equation::values::Place;
use crate::log::BRIDGED;

/// What the rows are made at, what the sensors read, and which feet may carry a force.
pub(super) type Contact<'a> = (&'a RowSetup, &'a Sensors, &'a Stance);

/// What a window's samples make of a joint's torque in each equation.
pub(crate) struct Projection<'a> {
    states: &'a JointStates<'a>,
    span: Span,
    /// How many equations there are.
    width: usize,
    /// P D S_j, sample by sample: joint by joint, of each equation.
    passes: Vec<Vec<f64>>,
}

/// The samples of a window.
pub(super) struct Span {
    pub(super) samples: Vec<usize>,
    /// Half the time from the sample before, and to the one after, s, within the window.
    pub(super) halves: Vec<[f64; 2]>,
    pub(super) seconds: f64,
}

impl Span {
    pub(super) fn of(walk: &Walk, samples: &[usize]) -> Self {
        let times: Vec<f64> = samples.iter().map(|&n| walk.seconds(n)).collect();
        let half = |k: usize| 0.5 * (times[k + 1] - times[k]);
        let last = times.len() - 1;
        let halves = (0..=last).map(|k| {
            let before = if k > 0 { half(k - 1) } else { 0.0 };
            [before, if k < last { half(k) } else { 0.0 }]
        });
        Self {
            halves: halves.collect(),
            seconds: times[last] - times[0],
            samples: samples.to_vec(),
        }
    }

    /// What a torque gives at each sample, N m s: the halves of what its boundary term changes by to both sides, and its rate over the time that the
    /// sample stands for; `term` tells it at the samples counted from the first.
    pub(super) fn impulses(&self, term: impl Fn(usize) -> Term<f64>) -> Vec<f64> {
        let mut last: Option<f64> = None;
        let mut half_before = 0.0;
        let mut all = vec![0.0; self.samples.len()];
        for k in 0..self.samples.len() {
            let Term { boundary, rate } = term(k);
            if let Some(last) = last {
                half_before = 0.5 * (boundary - last);
                all[k - 1] += half_before;
            }
            let [before, after] = self.halves[k];
            all[k] += half_before + rate * (before + after);
            last = Some(boundary);
        }
        all
    }
}

impl<'a> Projection<'a> {
    /// Of the window of these samples; equations of joints that are `resting` are left out. `contact` is what feet may carry a force, and where.
    pub(super) fn of(
        states: &'a JointStates<'a>,
        (setup, sensors, stance): Contact<'_>,
        samples: &[usize],
        resting: &[bool],
    ) -> Self {
        let (walk, robot) = (states.walk, &*setup.columns.robot);
        let scale = robot.scale_beside(resting);
        let (width, joints) = (scale.len(), robot.joints());
        let mut projector = Projector::default();
        let mut pose = Pose::default();
        let passes = samples.iter().map(|&n| {
            setup.tree.place(&walk.q[n], &mut pose);
            let down = robot.imu.rotation * walk.down[n];
            let points = sensors.points(robot, &stance.loaded[n]);
            projector.update(&setup.tree, &pose, points.iter(), &down, &scale);
            let mut all = vec![0.0; joints * width];
            for (j, own) in all.chunks_exact_mut(width).enumerate() {
                own[OF_BASE + j] = scale[OF_BASE + j];
                projector.apply(own);
            }
            all
        });
        let passes = passes.collect();
        Self {
            span: Span::of(walk, samples),
            width,
            passes,
            states,
        }
    }

    /// Adds the mean of a torque at a joint over the window to its equations; `term` tells it at each of the window's samples, counted from its first.
    pub(crate) fn add(&self, joint: usize, term: impl Fn(usize) -> Term<f64>, to: &mut [f64]) {
        for (impulse, passes) in self.span.impulses(term).into_iter().zip(&self.passes) {
            let mean = impulse / self.span.seconds;
            let own = &passes[self.width * joint..][..self.width];
            for (to, pass) in to.iter_mut().zip(own) {
                *to += mean * pass;
            }
        }
    }

    /// The window's samples.
    pub(crate) fn samples(&self) -> &[usize] {
        &self.span.samples
    }

    /// What a torque at a joint at each of them gives an equation: its mean over the window.
    pub(crate) fn weights(&self, joint: usize, coordinate: usize) -> Vec<f64> {
        let halves = self.span.halves.iter().zip(&self.passes);
        let of = |([before, after], passes): (&[f64; 2], &Vec<f64>)| {
            passes[self.width * joint + coordinate] * (before + after) / self.span.seconds
        };
        halves.map(of).collect()
    }

    /// When each of them is, s, and what effects see of these joints then; no bristles.
    pub(crate) fn seen(&self, joints: &Range<usize>) -> Vec<(f64, Vec<JointState<f64>>)> {
        let samples = self.span.samples.iter().map(|&n| {
            let all = joints.clone();
            let all = all.map(|j| self.states.joint(n, j, usize::MAX));
            (self.states.walk.seconds(n), all.collect())
        });
        samples.collect()
    }

    /// The window terms of an effect's columns at each of them; without bristles.
    pub(crate) fn terms(&self, place: Place, shapes: Shapes) -> Vec<[Term<f64>; MAX_COLUMNS]> {
        let samples = self.span.samples.iter();
        samples
            .map(|&n| self.states.terms(n, place, shapes, usize::MAX))
            .collect()
    }

    /// A column of an effect, per unit of its parameter; nothing for what is no torque at a joint.
    pub(crate) fn column(&self, site: usize, column: &Column) -> Vec<f64> {
        let mut all = vec![0.0; self.width];
        self.states.each_torque(site, column, |joint, term| {
            self.add(joint, |k| term(self.span.samples[k]), &mut all);
        });
        all
    }
}

/// What effects see of a walk's joints.
pub(crate) struct JointStates<'a> {
    pub(super) walk: &'a Walk,
    /// The joint that carries each.
    parents: &'a [Option<usize>],
    /// Of each effect with bristles their impulse, sample by sample.
    bristles: Vec<Option<Vec<f64>>>,
    /// The torque that the gears transmit, N m.
    load: &'a Channels,
}

impl<'a> JointStates<'a> {
    /// As the effects of columns that are `wanted`, by their numbers, see them.
    pub(super) fn of(
        (walk, stance): (&'a Walk, &'a Stance),
        columns: &'a WalkColumns,
        wanted: impl Fn(usize) -> bool,
    ) -> Self {
        let asks =
            |n: usize, input| wanted(n) && columns.sites[n].place.0.description().input == input;
        let bristles = |(n, site): (usize, &EffectSite)| {
            asks(n, Input::Bristles)
                .then(|| bristles(walk, site.place.1, &[site.shapes[0]]).remove(0))
        };
        Self {
            bristles: columns.sites.iter().enumerate().map(bristles).collect(),
            load: &stance.transmitted,
            parents: &columns.robot.parents,
            walk,
        }
    }

    /// Tells the joints at which a column of an effect is a torque, and that torque per unit of its parameter sample by sample; nothing for what is
    /// none.
    pub(super) fn each_torque(
        &self,
        site: usize,
        column: &Column,
        mut tell: impl FnMut(usize, &dyn Fn(usize) -> Term<f64>),
    ) {
        match *column {
            Column::Own {
                joint,
                effect,
                shapes,
                n,
            } => tell(joint, &|k| self.terms(k, (effect, joint), shapes, site)[n]),
            Column::Shape {
                joint,
                effect,
                around,
                apart,
                values,
            } => tell(joint, &|k| {
                let [less, more] =
                    around.map(|shapes| self.terms(k, (effect, joint), shapes, site));
                let slope = |of: &dyn Fn(&Term<f64>) -> f64| {
                    let columns = values.iter().zip(less.iter().zip(&more));
                    let change = columns.map(|(x, (less, more))| x * (of(more) - of(less)));
                    change.sum::<f64>() / apart
                };
                Term {
                    boundary: slope(&|term| term.boundary),
                    rate: slope(&|term| term.rate),
                }
            }),
            Column::Coupled {
                joint,
                effect,
                shapes,
                n,
            } => {
                let (all, parent) = (self.walk.q.width(), self.parents[joint]);
                for at in (0..all).filter(|at| couples(effect, [joint, *at], parent)) {
                    let other = if at == joint { parent } else { Some(joint) };
                    let state = |k: usize, j: usize| self.joint(k, j, site);
                    tell(at, &|k| {
                        // Of the catalogue's, which are many, no more states are made than two.
                        if let (true, Some(other)) = (effect.couples_with_parent(), other) {
                            return effect.coupled(&state(k, at), &state(k, other))[n];
                        }
                        let states: Vec<_> = (0..all).map(|j| state(k, j)).collect();
                        let terms = coupled_terms(effect, ([joint, at], parent), &states, shapes);
                        terms.map_or_else(Term::zero, |terms| terms[n])
                    });
                }
            }
            // The equations are of true torques: g times what is reported.
            Column::Scale(joint) => tell(joint, &|k| Term {
                boundary: 0.0,
                rate: -self.walk.tau[k][joint],
            }),
            _ => {}
        }
    }

    /// The window terms of an effect's columns at sample n, as it sees its limb by its number among those of the columns.
    fn terms(
        &self,
        n: usize,
        (effect, joint): Place,
        shapes: Shapes,
        site: usize,
    ) -> [Term<f64>; MAX_COLUMNS] {
        if effect.others().is_empty() {
            return effect.terms_among(&[self.joint(n, joint, site)], 0, shapes);
        }
        // Its others are counted from its own joint, so that all joints stand for the limb's.
        let joints = 0..self.walk.q.width();
        let joints: Vec<_> = joints.map(|j| self.joint(n, j, site)).collect();
        effect.terms_among(&joints, joint, shapes)
    }

    /// Of joint j at sample n, as an effect sees it by its number among those of the columns.
    fn joint(&self, n: usize, j: usize, site: usize) -> JointState<f64> {
        let walk = self.walk;
        let mut state = JointState {
            load: self.load[n][j],
            speed_noise: walk.rest.speed_noise[j],
            time: walk.seconds(n),
            ..JointState::reported(walk.q[n][j], walk.dq[n][j], walk.tau[n][j])
        };
        if let Some(Some(impulse)) = self.bristles.get(site) {
            state.presliding = impulse[n];
        }
        state
    }
}

/// What the bristles of a joint have transmitted at each sample since the gap before, per N m, s, for each of some displacements (rad). They are
/// followed over lost messages ([`BRIDGED`]), as those of a robot on a fixed base.
pub(crate) fn bristles(walk: &Walk, joint: usize, displacements: &[f64]) -> Vec<Vec<f64>> {
    let mut impulses = vec![Vec::with_capacity(walk.len()); displacements.len()];
    let mut first = 0;
    while first < walk.len() {
        let follows = |n: &usize| walk.seconds(*n) - walk.seconds(n - 1) <= BRIDGED;
        let end = (first + 1..walk.len()).take_while(follows).last();
        let stretch = first..end.unwrap_or(first) + 1;
        first = stretch.end;
        let t: Vec<f64> = stretch.clone().map(|n| walk.seconds(n)).collect();
        let state = stretch.map(|n| [walk.q[n][joint], walk.dq[n][joint], 0.0, 0.0]);
        let way = Way::of(&t, &state.collect::<Vec<_>>());
        let both = impulses.iter_mut().zip(displacements);
        both.for_each(|(impulse, displacement)| impulse.extend(way.impulse(*displacement)));
    }
    impulses
}

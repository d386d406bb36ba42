//! The limbs of a base that is held, as a search asks them.

use super::accept::Context;
use super::candidate::{Candidate, Member};
use super::compliance_scan;
use super::criteria::step::{is_far_from_noise, is_stand_in};
use super::drift::{Drift, drifts};
use super::limits::{Sought, with_limit};
use super::look::Screens;
use super::refused::Refused;
use super::source::{Source, Tried};
use super::state::{State, how_kept};
use super::trial_factors::ScoreTest;
use crate::equation::values::Place;
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::limit::Limit;

/// The limbs' data, and what was seen of them.
pub(crate) struct Limbs<'a> {
    data: &'a [LimbData<'a>],
    /// Each limb's effects as they were given.
    given: Vec<Vec<Place>>,
    /// Each joint's noise, held-out squares, (N m)²; none where it is not known.
    noise: Vec<Vec<Option<f64>>>,
    screens: Screens<'a>,
    limits: Sought<'a>,
}

impl<'a> Limbs<'a> {
    /// Of limbs' data, with each limb's effects as given and each of its joints' `noise` as held-out squares, (N m)², where it is known.
    pub(crate) fn new(
        data: &'a [LimbData<'a>],
        given: &[Vec<Place>],
        noise: &[Vec<Option<f64>>],
    ) -> Self {
        Self {
            data,
            given: given.to_vec(),
            noise: noise.to_vec(),
            screens: Screens::default(),
            limits: Sought::default(),
        }
    }

    /// What a limb's parameters do from fold to fold.
    pub(crate) fn drifts(&self, limb: usize) -> Vec<Drift> {
        drifts(&self.screens.of_limbs[limb])
    }

    /// What steps work from, after a look.
    fn context<'s>(&'s self, model: &'s State<'a>) -> Context<'s, 'a> {
        Context {
            data: self.data,
            model,
            screens: &self.screens.of_limbs,
        }
    }
}

impl<'a> Source for Limbs<'a> {
    type Model = State<'a>;

    fn start(&self) -> Option<State<'a>> {
        State::of(self.data, &self.given)
    }

    fn anew(&self) -> Self {
        Self::new(self.data, &self.given, &self.noise)
    }

    fn limbs(&self) -> usize {
        self.data.len()
    }

    fn joints(&self, limb: usize) -> usize {
        self.data[limb].joints()
    }

    fn period(&self) -> f64 {
        let periods = self.data.iter().map(|data| data.recording.period());
        periods.fold(0.0, f64::max)
    }

    fn look(&mut self, model: &mut State<'a>) -> Vec<Candidate> {
        self.screens.look(model, &self.given)
    }

    fn windows(&self) -> f64 {
        self.screens.windows()
    }

    fn beside(&self, candidate: &Candidate, other: &Candidate) -> Option<Candidate> {
        candidate.beside(other, &|limb, places, others| {
            self.screens.of_limbs[limb].trial_beside(places, others)
        })
    }

    fn error(&self) -> f64 {
        self.screens.of_limbs.iter().map(ScoreTest::error).sum()
    }

    fn begun(&self, model: &State<'a>, members: &[Member]) -> Option<State<'a>> {
        State::of(self.data, &model.places_with(members))
    }

    fn with(&self, model: &State<'a>, candidate: &Candidate) -> Option<State<'a>> {
        self.context(model).with(candidate)
    }

    fn without(&self, model: &State<'a>, members: &[Member]) -> Option<State<'a>> {
        let mut places = model.places();
        for (limb, member) in members {
            places[*limb].retain(|place| place != member);
        }
        model.with_worthwhile(self.data, &places, &model.values(), &how_kept(), &|_| true)
    }

    fn try_best<'c>(
        &self,
        model: &State<'a>,
        refused: &Refused<State<'a>>,
        best: &'c Candidate,
        all: &'c [Candidate],
        is_first: bool,
    ) -> (Tried<'c, State<'a>>, Vec<&'c Candidate>) {
        compliance_scan::best_by_trying(&self.context(model), refused, best, all, is_first)
    }

    fn accepted(
        &self,
        model: &State<'a>,
        candidate: &Candidate,
        after: State<'a>,
    ) -> Option<State<'a>> {
        self.context(model).accepted(candidate, after)
    }

    fn unseen<'c>(
        &self,
        model: &State<'a>,
        refused: &Refused<State<'a>>,
        all: &'c [Candidate],
    ) -> Option<(&'c Candidate, State<'a>, bool)> {
        compliance_scan::most_promising_transmission(&self.context(model), refused, all)
    }

    fn leaves_much(&self, model: &State<'a>, limb: usize) -> bool {
        let left = model.squares[limb].by_joint().into_iter();
        let joints = left.zip(&self.noise[limb]);
        let mut known = joints.filter_map(|(left, noise)| Some((left, (*noise)?)));
        known.any(|(left, noise)| is_far_from_noise(left, noise))
    }

    fn is_stand_in(&self, model: &State<'a>, without: &State<'a>) -> bool {
        let by_joint = |model: &State| -> Vec<f64> {
            model.squares.iter().flat_map(Squares::by_joint).collect()
        };
        let joints = by_joint(without).into_iter().zip(by_joint(model));
        let known = joints.zip(self.noise.iter().flatten());
        let known = known.filter_map(|((without, with), noise)| Some((without, with, (*noise)?)));
        is_stand_in(&known.collect::<Vec<_>>())
    }

    fn settled(&self, model: State<'a>, steady: f64) -> State<'a> {
        model.settled(self.data, steady)
    }

    fn limits(&mut self, model: &State<'a>) -> Vec<(Member, Limit)> {
        self.limits.limits(model)
    }

    fn with_limit(
        &self,
        model: &State<'a>,
        (member, limit): &(Member, Limit),
    ) -> Option<State<'a>> {
        with_limit(self.data, model, *member, limit)
    }

    fn with_members(&self, model: &State<'a>, members: &[Member]) -> Option<State<'a>> {
        let new: Vec<Place> = members.iter().map(|(_, place)| *place).collect();
        let places = model.places_with(members);
        model.with(self.data, &places, &model.values(), &new)
    }

    fn torque(&self) -> f64 {
        let limbs = self.data.iter();
        limbs
            .map(|data| data.squares(&vec![0.0; data.torque.len()]).total())
            .sum()
    }
}

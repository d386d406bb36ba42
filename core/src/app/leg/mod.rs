//! One leg's line, in the order in which data flow: bus bytes, frames, samples and windows (`listening`); factors, and what is forgotten of
//! them (`folding`); a solution (`solving`), on top of what is believed of the leg before any data (`model`). Where the joints' zeros are:
//! `placing`; which leg it is: `trying`.

mod folding;
mod listening;
mod model;
mod placing;
mod solving;
mod trying;

use super::counts::heard;
use super::diagnosis::Evidence;
use super::identity::Identity;
use super::support::Support;
use super::wiring::{Notes, Trial};
use super::zeros::{LegAlignment, Zeros};
use crate::Real;
use crate::bus::{Listener, Queue};
use crate::consistent::Held;
use crate::estimator::{
    Active, Beliefs, BlockTest, Change, DEFAULT_ACTIVE, DeviceFolds, DevicePrior, DeviceWindow,
    LegBase, NOISE_GUESS,
};
use crate::factor::Factor;
use crate::go2::{JOINTS_PER_LEG, Leg};
use crate::inertia::InertialParameters;
use crate::scalar::real;
use crate::slot::Slot;
use crate::spatial::Transform;
use crate::wire::{self, LegCounters};
pub(super) use listening::{FOLDING_EFFORT, SETTINGS, STEP_EFFORT};
pub(super) use placing::ZERO_NUMBERS;

/// One leg's data: what is all zeros at first, and so needs no copy in a microcontroller's flash.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegData<T> {
    folds: DeviceFolds<T>,
    base: LegBase<T>,
    test: BlockTest<T>,
    /// What the bus has brought and no step has taken yet.
    queue: Queue,
    /// What a trial of its wiring has noted; and where it is of a leg that has changed, what is told and touched once the wiring is found not to be why.
    notes: Notes,
    withheld: Slot<(wire::Change, Change<T>)>,
}

impl<T: Real> LegData<T> {
    /// No data.
    pub(super) const fn new() -> Self {
        Self {
            folds: DeviceFolds::empty(),
            base: LegBase::empty(),
            test: BlockTest::empty(),
            queue: Queue::new(),
            notes: Notes::new(),
            withheld: Slot::Empty,
        }
    }

    /// What is folded in.
    pub(super) fn folds(&self) -> &DeviceFolds<T> {
        &self.folds
    }

    /// What is folded in, to be what it was.
    pub(super) fn folds_mut(&mut self) -> &mut DeviceFolds<T> {
        &mut self.folds
    }

    /// Which columns the joints' factors have.
    pub(super) fn independent(&self) -> impl Iterator<Item = u8> + '_ {
        self.base.independent.iter().flatten().copied()
    }

    /// A joint's factor in one fold.
    pub(super) fn factor(&self, fold: usize, joint: usize) -> Factor<T, &[T]> {
        self.folds.joint(fold, joint)
    }
}

/// One leg, from its bus to its factors.
pub(super) struct LegLine<T: Real> {
    listener: Slot<Listener>,
    alignment: LegAlignment<T>,
    /// Whether positions can be told as angles; and whether that has ended since it was told.
    zeros: Zeros,
    voided: bool,
    /// Cycles left out because more came than steps have time for.
    surplus: u32,
    /// Empty until the first [`Self::reset`], like the prior: neither can be a constant.
    window: Slot<DeviceWindow<T>>,
    active: Active,
    prior: Slot<DevicePrior<T>>,
    beliefs: Beliefs,
    /// The joints' noise by the last solution, N m.
    noise: [T; JOINTS_PER_LEG],
    /// The bodies of the last consistent solution; none, and so not physical, at first.
    bodies: [InertialParameters<T>; JOINTS_PER_LEG],
    /// The effects that it had at a bound, and of which model.
    held: (Held, Active),
    /// Data of so many seconds ago weigh 1/e; 0: as much as new ones.
    memory_s: u32,
    /// A change that is being forgotten, and how many of its directions are.
    forgetting: Slot<(Change<T>, usize)>,
    /// Data that were gathered are no longer what the factors hold.
    stale: bool,
    /// What the calf says of a force at the foot; whether the feet carry the robot; and whether what came shortly before is still to be left
    /// out.
    support: Support<T>,
    carried: bool,
    spoilt: bool,
    /// A change to be told.
    changed: Slot<wire::Change>,
    /// Which leg it is.
    trial: Trial,
    counters: LegCounters,
}

impl<T: Real> LegLine<T> {
    /// A line that listens to nothing yet: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            listener: Slot::Empty,
            alignment: LegAlignment::new(),
            zeros: Zeros::new(),
            voided: false,
            surplus: 0,
            window: Slot::Empty,
            active: Active::NONE,
            prior: Slot::Empty,
            beliefs: Beliefs::NONE,
            noise: [T::ZERO; JOINTS_PER_LEG],
            bodies: [InertialParameters::NONE; JOINTS_PER_LEG],
            held: (Held::NONE, Active::NONE),
            memory_s: 0,
            forgetting: Slot::Empty,
            stale: false,
            support: Support::new(),
            carried: false,
            spoilt: false,
            changed: Slot::Empty,
            trial: Trial::new(),
            counters: LegCounters::ZERO,
        }
    }

    /// Begins as a device of this identity does, before the first [`Self::reset`].
    pub(super) fn begin(&mut self, identity: &Identity) {
        self.alignment = LegAlignment::new();
        self.zeros.begin(identity, &mut self.alignment);
    }

    /// Begins anew, in place, but for where its zeros are: a line is larger than a microcontroller's stack. `work` is space for the analysis of the leg.
    pub(super) fn reset(&mut self, which: Leg, data: &mut LegData<T>, work: &mut [T]) {
        self.listener = Slot::Full(Listener::new());
        self.surplus = 0;
        data.queue.clear();
        self.open(which);
        data.folds.clear();
        data.test.clear();
        self.memory_s = 0;
        self.forgetting = Slot::Empty;
        self.stale = false;
        self.changed = Slot::Empty;
        self.try_anew();
        self.active = DEFAULT_ACTIVE;
        self.beliefs = Beliefs::NONE;
        self.noise = [real(NOISE_GUESS); JOINTS_PER_LEG];
        self.bodies = [InertialParameters::zero(); JOINTS_PER_LEG];
        self.held = (Held::NONE, Active::NONE);
        self.set_prior(which);
        if let Slot::Full(prior) = &self.prior {
            // The work space is as large as it says; without the analysis, every fold would count as unfolded.
            let _ = data.base.analyse(which, prior, work);
            self.support.begin(prior, &data.base);
        }
        (self.carried, self.spoilt) = (false, false);
        self.counters = LegCounters::ZERO;
    }

    /// The prior of the effects active at first. Not inlined, like [`Self::open`].
    #[inline(never)]
    fn set_prior(&mut self, which: Leg) {
        self.prior = Slot::Full(DevicePrior::of(which, &self.active));
    }

    /// An empty window. Not inlined, so that what it takes of the stack is given back before the prior takes its own.
    #[inline(never)]
    fn open(&mut self, which: Leg) {
        self.window = Slot::Full(DeviceWindow::new(which, &Transform::identity(), SETTINGS));
    }

    pub(super) fn counters(&self, data: &LegData<T>) -> LegCounters {
        LegCounters {
            lost_bytes: data.queue.lost(),
            ..self.counted()
        }
    }

    /// The counters but for the queue's, which is among the data.
    pub(super) fn counted(&self) -> LegCounters {
        let own = LegCounters {
            surplus: self.surplus,
            ..self.counters
        };
        heard(&self.listener, own)
    }

    /// What a diagnosis looks at.
    pub(super) fn evidence<'a>(&'a self, data: &'a LegData<T>) -> Evidence<'a, T> {
        Evidence {
            folds: &data.folds,
            base: &data.base,
            active: &self.active,
            beliefs: &self.beliefs,
            noise: &self.noise,
        }
    }
}

fn increment(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

//! A leg's window of the columns that a fold keeps, and of no others.

#[cfg(doc)]
use super::COLUMNS;
use super::{BOUNDARY, DEVICE_COLUMNS, DeviceColumns, FRONT, RATED, ROWS_LEN, rank};
use crate::Real;
use crate::effect::JointState;
use crate::estimator::plausible;
use crate::regressor::leg::{
    self as leg_columns, BASE_COLUMNS, JOINTS_PER_LEG, LegFrame, MOMENTA, RATES,
};
use crate::robot::Robot;
use crate::spatial::Transform;
use crate::window::sequence::{Link, Sequence};
use crate::window::{EffectList, Push, Sample, Settings, joint_state, microseconds};

/// Effects that are integrals of a rate.
const RATED_COLUMNS: usize = RATED.len();
/// Effects that are differences between a window's ends.
const BOUNDARY_COLUMNS: usize = BOUNDARY.len();

// Each effect is either.
const _: () = assert!(RATED_COLUMNS + BOUNDARY_COLUMNS == DEVICE_COLUMNS);

/// The rows of one closed window: mean torques over the window, N m per unit of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceRows<T> {
    /// Start and end of the window, µs.
    pub span_us: [u64; 2],
    /// Joint after joint, as a fold has them: the first four effects of [`COLUMNS`], the base columns, the other effects, the mean
    /// torque.
    pub(super) numbers: [T; ROWS_LEN],
}

impl<T> DeviceRows<T> {
    /// A joint's row: the first four effects of [`COLUMNS`], the base columns, the other effects, the mean torque (N m).
    pub fn joint(&self, joint: usize) -> &[T] {
        self.numbers.get(super::entries(joint)).unwrap_or(&[])
    }
}

/// What is integrated over a window, or its integrand at one instant.
#[derive(Clone, Copy, Debug)]
struct Integrand<T> {
    inertial: [T; RATES],
    effects: [[T; RATED_COLUMNS]; JOINTS_PER_LEG],
    torque: [T; JOINTS_PER_LEG],
}

impl<T: Real> Integrand<T> {
    const ZERO: Self = Self {
        inertial: [T::ZERO; RATES],
        effects: [[T::ZERO; RATED_COLUMNS]; JOINTS_PER_LEG],
        torque: [T::ZERO; JOINTS_PER_LEG],
    };

    /// Adds `other` times `duration`.
    #[inline(always)]
    fn add(&mut self, other: &Self, duration: T) {
        add(&mut self.inertial, &other.inertial, duration);
        let effects = other.effects.as_flattened();
        add(self.effects.as_flattened_mut(), effects, duration);
        add(&mut self.torque, &other.torque, duration);
    }
}

#[inline(always)]
fn add<T: Real>(to: &mut [T], from: &[T], times: T) {
    to.iter_mut()
        .zip(from)
        .for_each(|(to, from)| *to += *from * times);
}

/// The quantities that enter as differences between a window's ends.
#[derive(Clone, Copy, Debug)]
struct Edge<T> {
    time_us: u64,
    momenta: [T; MOMENTA],
    effects: [[T; BOUNDARY_COLUMNS]; JOINTS_PER_LEG],
}

impl<T: Real> Edge<T> {
    const ZERO: Self = Self {
        time_us: 0,
        momenta: [T::ZERO; MOMENTA],
        effects: [[T::ZERO; BOUNDARY_COLUMNS]; JOINTS_PER_LEG],
    };
}

/// The window being filled of a leg of hip, thigh and calf: [`Window`](crate::window::Window) of [`COLUMNS`] and the base columns alone, in
/// a third of its instructions.
#[derive(Clone, Debug)]
pub struct DeviceWindow<T: Real> {
    frame: LegFrame<T>,
    sequence: Sequence<T, JOINTS_PER_LEG>,
    /// The integrand at the last sample, and half the time between it and the one before in this window (s).
    integrand: Integrand<T>,
    half_step: T,
    integral: Integrand<T>,
    /// The edges of the window, and whether its end is the first of them: the end of one window is the next one's start.
    edges: [Edge<T>; 2],
    ends_first: bool,
    rows: DeviceRows<T>,
}

impl<T: Real> DeviceWindow<T> {
    /// An empty window for a leg whose base is mounted at `base` in the world (only its rotation matters).
    ///
    /// The leg's hip turns about x, thigh and calf about y: that its joints have as many base columns is checked when compiled.
    pub fn new<R: Robot<JOINTS_PER_LEG>>(
        which: R,
        base: &Transform<T>,
        settings: Settings,
    ) -> Self {
        const {
            let [hip, thigh, calf] = R::BASE_COLUMNS;
            let [ours, of_thigh, of_calf] = BASE_COLUMNS;
            assert!(hip == ours && thigh == of_thigh && calf == of_calf);
        }
        Self {
            frame: LegFrame::new(&which.tree(), base),
            sequence: Sequence::new(plausible(which), settings),
            integrand: Integrand::ZERO,
            half_step: T::zero(),
            integral: Integrand::ZERO,
            edges: [Edge::ZERO; 2],
            ends_first: true,
            rows: DeviceRows {
                span_us: [0; 2],
                numbers: [T::zero(); ROWS_LEN],
            },
        }
    }

    /// Forgets the open window and the last sample.
    pub fn clear(&mut self) {
        self.sequence.clear();
    }

    /// The rows of the window closed last; of use after [`Push::Closed`].
    pub fn rows(&self) -> &DeviceRows<T> {
        &self.rows
    }

    /// What the leg's motion is made of.
    pub(crate) fn frame(&self) -> &LegFrame<T> {
        &self.frame
    }

    /// Takes the next sample, as [`Window::push`](crate::window::Window::push) does.
    pub fn push(&mut self, sample: &Sample<T, JOINTS_PER_LEG>) -> Push {
        let link = match self.sequence.admit(sample) {
            Ok(link) => link,
            Err(skipped) => return skipped,
        };
        if let Link::Bridged { half_step, .. } = link {
            let duration = self.half_step + half_step;
            self.integral.add(&self.integrand, duration);
            self.half_step = half_step;
        }
        let motion = self.frame.motion(&sample.q, &sample.dq);
        self.integrand.inertial = motion.rates();
        self.integrand.torque = sample.tau;
        for (j, effects) in self.integrand.effects.iter_mut().enumerate() {
            let terms = DeviceColumns.terms(&state(sample, j));
            *effects = RATED.map(|n| terms[n].rate);
        }
        if let Link::Bridged { closes: false, .. } = link {
            return Push::Used;
        }
        let [first, second] = &mut self.edges;
        let end = if self.ends_first { first } else { second };
        end.time_us = sample.time_us;
        end.momenta = motion.momenta();
        for (j, effects) in end.effects.iter_mut().enumerate() {
            let terms = DeviceColumns.terms(&state(sample, j));
            *effects = BOUNDARY.map(|n| terms[n].boundary);
        }
        let push = match link {
            Link::Bridged { .. } => {
                self.integral.add(&self.integrand, self.half_step);
                self.close();
                Push::Closed
            }
            Link::Broken(push) => push,
        };
        self.ends_first = !self.ends_first;
        self.integral = Integrand::ZERO;
        self.half_step = T::zero();
        push
    }

    /// Writes the rows of the window between the two edges.
    fn close(&mut self) {
        let (start, end) = match (self.ends_first, &self.edges) {
            (true, [end, start]) | (false, [start, end]) => (start, end),
        };
        let sum = &self.integral;
        self.rows.span_us = [start.time_us, end.time_us];
        let per_second = T::one() / microseconds(end.time_us - start.time_us);
        let momenta: [T; MOMENTA] =
            core::array::from_fn(|n| (end.momenta[n] - start.momenta[n]) * per_second);
        let rates = sum.inertial.map(|x| x * per_second);
        let (mut columns, mut numbers) = (&leg_columns::COLUMNS[..], &mut self.rows.numbers[..]);
        for j in 0..JOINTS_PER_LEG {
            let mut effects = [T::zero(); DEVICE_COLUMNS];
            for (n, rate) in RATED.iter().zip(&sum.effects[j]) {
                if let Some(effect) = effects.get_mut(*n) {
                    *effect = *rate * per_second;
                }
            }
            let boundaries = end.effects[j].iter().zip(&start.effects[j]);
            for (n, (end, start)) in BOUNDARY.iter().zip(boundaries) {
                if let Some(effect) = effects.get_mut(*n) {
                    *effect = (*end - *start) * per_second;
                }
            }
            // Slices of known lengths: a chain of iterators would ask at each number which of them it is in.
            let own = columns.split_off(..rank(j)).unwrap_or_default();
            let mut next = |count| numbers.split_off_mut(..count).unwrap_or_default();
            let (front, base) = (next(FRONT), next(rank(j)));
            let (back, torque) = (next(DEVICE_COLUMNS - FRONT), next(1));
            let (front_effects, back_effects) = effects.split_at(FRONT);
            for (to, from) in front.iter_mut().zip(front_effects) {
                *to = *from;
            }
            for (to, column) in base.iter_mut().zip(own) {
                *to = column.of(&momenta, &rates);
            }
            for (to, from) in back.iter_mut().zip(back_effects) {
                *to = *from;
            }
            torque.fill(sum.torque[j] * per_second);
        }
    }
}

/// What an effect sees of a joint.
#[inline(always)]
fn state<T: Real>(sample: &Sample<T, JOINTS_PER_LEG>, joint: usize) -> JointState<T> {
    joint_state(sample, joint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base_parameters::BaseParameters;
    use crate::estimator::device::{BASE_RANK, LegBase};
    use crate::estimator::{DEFAULT_ACTIVE, DevicePrior, LEG_INERTIAL};
    use crate::go2::{Leg, leg};
    use crate::inertia::INERTIAL;
    use crate::regressor::leg::COLUMNS as LEG_COLUMNS;
    use crate::spatial::tests::transform;
    use crate::window::Window;
    use proptest::prelude::*;
    use std::prelude::rust_2024::*;
    use std::vec;

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn the_base_columns_are_those_of_the_analysis() {
        fn check<T: Real>() {
            for which in Leg::ALL {
                let (mut base, mut work) = (LegBase::<T>::empty(), vec![T::ZERO; 1100]);
                let prior = DevicePrior::of(which, &DEFAULT_ACTIVE);
                base.analyse(which, &prior, &mut work).unwrap();
                let mut columns = LEG_COLUMNS.iter();
                for joint in 0..JOINTS_PER_LEG {
                    let found: BaseParameters<T, &[T]> = base.joint(joint).unwrap();
                    let found = found.independent_columns();
                    let found: Vec<_> = found
                        .map(|c| (joint + c / INERTIAL, c % INERTIAL))
                        .collect();
                    let ours = columns.by_ref().take(BASE_RANK[joint]).map(|c| c.of);
                    assert_eq!(ours.collect::<Vec<_>>(), found, "{which:?} {joint}");
                }
                assert!(columns.next().is_none());
            }
        }
        check::<f64>();
        check::<f32>();
    }

    #[test]
    fn an_effect_is_an_integral_or_a_difference_as_is_said_of_it() {
        for n in 0..200 {
            let x = f64::from(n);
            let state = JointState::reported((1.1 * x).sin(), (2.3 * x).cos(), (0.7 * x).sin());
            let terms = DeviceColumns.terms(&state);
            assert!(RATED.iter().all(|n| terms[*n].boundary == 0.0));
            assert!(BOUNDARY.iter().all(|n| terms[*n].rate == 0.0));
        }
    }

    type General = Window<f64, JOINTS_PER_LEG, LEG_INERTIAL, DEVICE_COLUMNS, DeviceColumns>;

    /// The row as a fold has it of the general window's.
    fn expected(window: &General, joint: usize) -> Vec<f64> {
        let rows = window.rows();
        let first: usize = BASE_RANK[..joint].iter().sum();
        let base = LEG_COLUMNS[first..first + BASE_RANK[joint]].iter();
        let base = base.map(|column| rows.inertial[(joint, INERTIAL * column.of.0 + column.of.1)]);
        let (front, back) = rows.effects[joint].split_at(FRONT);
        let row = front.iter().copied().chain(base);
        row.chain(back.iter().copied())
            .chain([rows.torque[joint]])
            .collect()
    }

    proptest! {
        /// The same pushes and rows as of the window of all columns, whatever samples come.
        #[test]
        #[cfg_attr(miri, ignore = "too long to interpret")]
        fn rows_are_those_of_the_window_of_all_columns(
            which in 0..4usize,
            base in transform(),
            samples in prop::collection::vec((0..24u64, prop::array::uniform9(-1.0..1.0f64)), 80),
        ) {
            let which = Leg::ALL[which];
            let settings = Settings::default();
            let mut all: General =
                Window::new(leg(which), base, DeviceColumns, plausible(which), settings);
            let mut ours = DeviceWindow::new(which, &base, settings);
            let mut time_us = 0;
            for (step, x) in samples {
                // Mostly 1.5 to 3.5 ms; now and then a gap, a late or an implausible sample.
                time_us = match step {
                    0 => time_us + 12_000,
                    1 => time_us - time_us.min(100),
                    _ => time_us + 1_500 + 100 * (step - 2),
                };
                let wild = if step == 2 { 100.0 } else { 1.0 };
                let sample = Sample {
                    time_us,
                    q: [0.8 * x[0], 0.8 + x[1], -1.7 + 0.8 * x[2]],
                    dq: [wild * 20.0 * x[3], 20.0 * x[4], 10.0 * x[5]],
                    tau: [20.0 * x[6], 20.0 * x[7], 40.0 * x[8]],
                };
                let pushed = ours.push(&sample);
                prop_assert_eq!(pushed, all.push(&sample));
                if pushed != Push::Closed {
                    continue;
                }
                prop_assert_eq!(ours.rows().span_us, all.rows().span_us);
                for joint in 0..JOINTS_PER_LEG {
                    let (ours, expected) = (ours.rows().joint(joint), expected(&all, joint));
                    prop_assert_eq!(ours.len(), expected.len());
                    for (a, b) in ours.iter().zip(&expected) {
                        prop_assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{a} {b}");
                    }
                }
            }
        }
    }
}

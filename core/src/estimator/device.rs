//! What a microcontroller keeps of a leg: base columns, candidate effects beside the active ones, two folds.
//!
//! A joint's factor has the independent columns of its bodies' parameters only ([`crate::base_parameters`]): 15 for a Go2's
//! hip instead of 30, and as many numbers as its columns squared are rotated for each row. Before them stand the effects that
//! are active at first, behind them the candidates: the model of the first ones is then the triangle's front, at no cost. Nothing is lost: the rows of all columns are those of the independent ones times P.
//!
//! Windows go to the fold of their block of time, in turn. All data are the two folds together; each fold alone judges what
//! was fitted to the other ([`crate::criticism`]). There is no guard between blocks: it would cost the estimate its data or
//! the board a third set of factors, and windows that remember the block before are few (residuals are forgotten within
//! 0.1 s of 2 s).
//!
//! [`Gather`] turns the folds into the factors of the active effects and all standard parameters, those that the desktop
//! folds directly; from there on the solution is the same code.

use super::joints::floor;
use super::{
    CAD_UNCERTAINTY, EffectPrior, JointFactors, LEG_INERTIAL, Layout, LimbPrior, Solver, solver_len,
};
use crate::base_parameters::BaseParameters;
use crate::effect::{EffectKind, JointState, Prior, Term};
use crate::factor::{Factor, FactorError, packed_len};
use crate::go2::{ACTUATORS, JOINTS_PER_LEG, Leg, leg};
use crate::inertia::INERTIAL;
use crate::window::{EffectList, Rows, Window};
use crate::{Real, scalar::real};
use heapless::Vec;

macro_rules! columns {
    ($($name:ident),* $(,)?) => {
        /// The effects whose columns a device keeps for every joint, the first of each: those that are active at first, then
        /// the candidates.
        ///
        /// Beside `bias` a spring needs its first column alone: the second is the bias's. Beside `coulomb` the first column
        /// of `asymmetric_coulomb` is what the positive direction has more. A shape is the mean of its prior.
        pub const COLUMNS: [EffectKind; DEVICE_COLUMNS] = [$(EffectKind::$name),*];

        /// Effect columns of a joint.
        pub(crate) const DEVICE_COLUMNS: usize = [$(EffectKind::$name),*].len();

        impl EffectList<DEVICE_COLUMNS> for DeviceColumns {
            // Written out, so that each call is compiled for its effect.
            #[inline(always)]
            fn terms<T: Real>(&self, state: &JointState<T>) -> [Term<T>; DEVICE_COLUMNS] {
                [$({
                    const SHAPE: f64 = shape(EffectKind::$name);
                    let [first, _] = EffectKind::$name.terms(state, real(SHAPE));
                    first
                }),*]
            }
        }
    };
}

columns! {
    Viscous, Coulomb, Armature, Bias,
    AsymmetricCoulomb, Stribeck, LoadFriction, QuadraticDrag, Spring, TorqueGain, Delay,
}

/// [`COLUMNS`] as a type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceColumns;

/// The shape at which an effect's column is kept: of the shaped effects only `stribeck` has one, vs in rad/s.
const fn shape(effect: EffectKind) -> f64 {
    match effect {
        EffectKind::Stribeck => 0.1,
        _ => 1.0,
    }
}

/// Base parameters of a leg's joints; a test compares them with the analysis.
pub(crate) const BASE_RANK: [usize; JOINTS_PER_LEG] = [15, 14, 7];

/// Folds of the data.
pub(crate) const FOLDS: usize = 2;

/// Length of a block of time of one fold, µs.
const BLOCK_US: u64 = 2_000_000;

/// Effects in front of a fold's base columns: those that are active at first. The others stand behind.
pub(crate) const FRONT: usize = 4;

/// Most effect parameters of a leg.
pub(crate) const MAX_EFFECTS: usize = DEVICE_COLUMNS * JOINTS_PER_LEG;

/// The columns of a leg with every effect active: what the storage has to hold.
const LARGEST: Layout<JOINTS_PER_LEG> = Layout::chain(DEVICE_COLUMNS);

/// Columns of a joint's fold.
const fn columns(joint: usize) -> usize {
    DEVICE_COLUMNS + BASE_RANK[joint]
}

/// Standard parameters that a joint's torque may depend on.
const fn standard(joint: usize) -> usize {
    INERTIAL * (JOINTS_PER_LEG - joint)
}

/// Where joint `joint`'s triangle lies if those of `len(0)`, `len(1)`, … columns lie one after the other.
macro_rules! range {
    ($len:ident, $joint:expr) => {{
        let (mut start, mut before) = (0, 0);
        while before < $joint {
            start += packed_len($len(before));
            before += 1;
        }
        start..start + packed_len($len($joint))
    }};
}

const fn rank(joint: usize) -> usize {
    BASE_RANK[joint]
}

const FOLD_LEN: usize = range!(columns, JOINTS_PER_LEG - 1).end;
const BASE_LEN: usize = range!(standard, JOINTS_PER_LEG - 1).end;
const MARGINAL_LEN: usize = range!(rank, JOINTS_PER_LEG - 1).end;

/// The window of a leg with all columns of the device.
pub type DeviceWindow<T> = Window<T, JOINTS_PER_LEG, LEG_INERTIAL, DEVICE_COLUMNS, DeviceColumns>;
/// The rows of that window.
pub type DeviceRows<T> = Rows<T, JOINTS_PER_LEG, LEG_INERTIAL, DEVICE_COLUMNS>;
/// The solver of a leg with any of the effects active.
pub type DeviceSolver<T> = Solver<
    T,
    [T; LARGEST.packed_len()],
    [T; solver_len(LEG_INERTIAL + MAX_EFFECTS)],
    JOINTS_PER_LEG,
>;
/// The prior of a leg with any of the effects active.
pub type DevicePrior<T> = LimbPrior<T, Vec<EffectPrior, MAX_EFFECTS>, JOINTS_PER_LEG>;

/// Which effects of [`COLUMNS`] the model of each joint of a leg has, bit n for the n-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Active(pub [u32; JOINTS_PER_LEG]);

/// Viscous, coulomb, armature, bias at every joint.
pub const DEFAULT_ACTIVE: Active = Active([0b1111; JOINTS_PER_LEG]);

impl Active {
    /// Whether the model of a joint has effect n.
    pub fn has(&self, joint: usize, n: usize) -> bool {
        self.0.get(joint).is_some_and(|mask| mask >> n & 1 == 1)
    }

    /// Adds effect n to a joint's model, or drops it.
    pub fn set(&mut self, joint: usize, n: usize, active: bool) {
        if let (Some(mask), true) = (self.0.get_mut(joint), n < DEVICE_COLUMNS) {
            *mask = if active {
                *mask | 1 << n
            } else {
                *mask & !(1 << n)
            };
        }
    }

    /// The columns of a leg with these effects.
    pub fn layout(&self) -> Layout<JOINTS_PER_LEG> {
        let effects = self.0.map(|mask| mask.count_ones() as usize);
        Layout::new(JOINTS_PER_LEG, [JOINTS_PER_LEG; JOINTS_PER_LEG], effects).unwrap_or(LARGEST)
    }

    /// The active effects' priors in the order of θ, and each one's place in [`COLUMNS`].
    pub fn effects(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..JOINTS_PER_LEG)
            .flat_map(|joint| (0..DEVICE_COLUMNS).map(move |n| (joint, n)))
            .filter(|&(joint, n)| self.has(joint, n))
    }
}

/// What is known before any data of effect n at a joint, and its bounds; of the parameter beyond its neutral value.
pub(crate) fn effect_prior(joint: usize, n: usize) -> EffectPrior {
    let effect = COLUMNS[n % DEVICE_COLUMNS];
    let parameter = &effect.description().parameters[0];
    let prior = effect.prior(&ACTUATORS[joint % JOINTS_PER_LEG]);
    EffectPrior {
        prior: Prior {
            mean: prior.mean - parameter.neutral,
            std: prior.std,
        },
        lower: parameter.lower - parameter.neutral,
        upper: parameter.upper - parameter.neutral,
    }
}

impl<T: Real> DevicePrior<T> {
    /// The CAD's inertias within [`CAD_UNCERTAINTY`], each active effect as its catalogue entry says.
    pub fn of(which: Leg, active: &Active) -> Self {
        let cad = leg::<T>(which).bodies().map(|body| body.inertia);
        let mut prior = Self::new(cad, [real(CAD_UNCERTAINTY); JOINTS_PER_LEG], Vec::new());
        prior.activate(active);
        prior
    }

    /// Becomes the prior of a model with other effects.
    pub fn activate(&mut self, active: &Active) {
        let priors = active.effects().map(|(joint, n)| effect_prior(joint, n));
        self.set_effects(priors.collect());
    }
}

impl<T: Real> DeviceSolver<T> {
    /// A solver that has solved nothing yet.
    pub const fn empty() -> Self {
        let data = JointFactors::unset(LARGEST, [T::ZERO; LARGEST.packed_len()]);
        Self::new(data, [T::ZERO; solver_len(LEG_INERTIAL + MAX_EFFECTS)])
    }
}

/// The base parameters of a leg's joints, and the CAD prior on them.
#[derive(Clone, Copy, Debug)]
pub struct LegBase<T> {
    reduced: [T; BASE_LEN],
    marginal: [T; MARGINAL_LEN],
    /// Each joint's independent columns; found once, for they are read for every window.
    independent: [[u8; BASE_RANK[0]]; JOINTS_PER_LEG],
    known: bool,
}

impl<T: Real> LegBase<T> {
    /// Not analysed yet.
    pub const fn empty() -> Self {
        Self {
            reduced: [T::ZERO; BASE_LEN],
            marginal: [T::ZERO; MARGINAL_LEN],
            independent: [[0; BASE_RANK[0]]; JOINTS_PER_LEG],
            known: false,
        }
    }

    /// Analyses the leg, once. `work` is any 1100 numbers.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the work space is too small.
    pub fn analyse(
        &mut self,
        which: Leg,
        prior: &DevicePrior<T>,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        if self.known {
            return Ok(());
        }
        for joint in 0..JOINTS_PER_LEG {
            self.analyse_joint(which, joint, work)?;
            self.write_marginal(joint, prior, work)?;
        }
        self.known = true;
        Ok(())
    }

    #[inline(never)]
    fn analyse_joint(
        &mut self,
        which: Leg,
        joint: usize,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        let error = FactorError::Length(work.len());
        let row = work.get_mut(..=standard(joint)).ok_or(error)?;
        let storage = self.reduced.get_mut(range!(standard, joint)).ok_or(error)?;
        let tree = leg(which);
        let base = BaseParameters::of_joint::<JOINTS_PER_LEG, JOINTS_PER_LEG, LEG_INERTIAL>(
            &tree, joint, storage, row,
        )?;
        let columns = base.independent_columns();
        for (to, from) in self.independent[joint].iter_mut().zip(columns) {
            *to = from as u8;
        }
        Ok(())
    }

    #[inline(never)]
    fn write_marginal(
        &mut self,
        joint: usize,
        prior: &DevicePrior<T>,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        let columns = standard(joint);
        let error = FactorError::Length(work.len());
        let (row, rest) = work.split_at_mut_checked(columns + 1).ok_or(error)?;
        let (bodies, rest) = rest
            .split_at_mut_checked(packed_len(columns))
            .ok_or(error)?;
        let rest = rest.get_mut(..packed_len(columns)).ok_or(error)?;
        let mut bodies = Factor::in_storage(columns, bodies)?;
        bodies.clear();
        for b in joint..JOINTS_PER_LEG {
            if let Some(body) = prior.body(b) {
                bodies.place(INERTIAL * (b - joint), body)?;
            }
        }
        let packed = self.reduced.get(range!(standard, joint)).ok_or(error)?;
        let base = BaseParameters::from_packed(columns, rank(joint), packed)?;
        let marginal = self.marginal.get_mut(range!(rank, joint)).ok_or(error)?;
        let mut marginal = Factor::in_storage(rank(joint), marginal)?;
        base.marginal(&bodies, &mut marginal, rest, row)
    }

    /// The base parameters of a joint; of no columns before the analysis.
    pub fn joint(&self, joint: usize) -> Option<BaseParameters<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.reduced.get(range!(standard, joint)))??;
        BaseParameters::from_packed(standard(joint), rank(joint), packed).ok()
    }

    /// The CAD prior on a joint's base parameters, as a factor.
    pub(crate) fn marginal(&self, joint: usize) -> Option<Factor<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.marginal.get(range!(rank, joint)))??;
        Factor::in_storage(rank(joint), packed).ok()
    }
}

/// A leg's data in two folds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFolds<T> {
    storage: [[T; FOLD_LEN]; FOLDS],
    windows: [[T; JOINTS_PER_LEG]; FOLDS],
}

impl<T: Real> DeviceFolds<T> {
    /// A constant for statics, to be [`clear`](Self::clear)ed before it is used.
    pub const fn empty() -> Self {
        Self {
            storage: [[T::ZERO; FOLD_LEN]; FOLDS],
            windows: [[T::ZERO; JOINTS_PER_LEG]; FOLDS],
        }
    }

    /// Forgets all data.
    pub fn clear(&mut self) {
        self.windows = [[T::zero(); JOINTS_PER_LEG]; FOLDS];
        for storage in &mut self.storage {
            for joint in 0..JOINTS_PER_LEG {
                let triangle = storage.get_mut(range!(columns, joint)).unwrap_or(&mut []);
                if let Ok(mut factor) = Factor::in_storage(columns(joint), triangle) {
                    factor.clear();
                    factor.set_floor(floor());
                }
            }
        }
    }

    /// Windows of all folds.
    pub fn windows(&self) -> T {
        self.windows
            .iter()
            .fold(T::zero(), |sum, fold| sum + fold[0])
    }

    /// A joint's factor in one fold: the first four effects of [`COLUMNS`], the base columns, the other effects.
    pub fn joint(&self, fold: usize, joint: usize) -> Factor<T, &[T]> {
        let found = match (self.storage.get(fold), self.windows.get(fold)) {
            (Some(storage), Some(windows)) if joint < JOINTS_PER_LEG => {
                storage.get(range!(columns, joint)).and_then(|packed| {
                    Factor::from_packed(columns(joint), windows[joint], packed).ok()
                })
            }
            _ => None,
        };
        found.unwrap_or(Factor::nothing())
    }

    /// Folds in the rows of one window, into the fold of its block of time.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then nothing of the joint that holds such a number is folded in.
    pub fn fold_window(
        &mut self,
        rows: &DeviceRows<T>,
        base: &LegBase<T>,
    ) -> Result<(), FactorError> {
        let fold = (rows.span_us[0] / BLOCK_US) as usize % FOLDS;
        let mut buffer = [T::zero(); columns(0) + 1];
        for joint in 0..JOINTS_PER_LEG {
            let independent = base.independent[joint].get(..rank(joint)).unwrap_or(&[]);
            let row = buffer.get_mut(..=columns(joint)).unwrap_or(&mut []);
            rows.write_base_row(joint, independent, row);
            let triangle = self.storage[fold]
                .get_mut(range!(columns, joint))
                .unwrap_or(&mut []);
            let windows = &mut self.windows[fold][joint];
            let mut factor = Factor::from_packed(columns(joint), *windows, triangle)?;
            factor.update(row)?;
            *windows = factor.rows();
        }
        Ok(())
    }
}

impl<T: Real> DeviceRows<T> {
    /// Joint b's row as a fold takes it: effects, base columns, other effects, torque.
    fn write_base_row(&self, joint: usize, independent: &[u8], row: &mut [T]) {
        let first = INERTIAL * joint;
        let inertial = independent
            .iter()
            .map(|&c| self.inertial[(joint, (first + usize::from(c)) % LEG_INERTIAL)]);
        let (front, back) = self.effects[joint].split_at(FRONT);
        let entries = front
            .iter()
            .copied()
            .chain(inertial)
            .chain(back.iter().copied());
        for (to, from) in row.iter_mut().zip(entries.chain([self.torque[joint]])) {
            *to = from;
        }
    }
}

/// Turns a leg's folds into its solver's data, in steps of bounded cost.
#[derive(Clone, Copy, Debug)]
pub struct Gather<T> {
    work: [T; packed_len(columns(0))],
    active: Active,
    joint: usize,
    fold: usize,
    row: usize,
}

impl<T: Real> Gather<T> {
    /// Nothing to gather.
    pub const fn new() -> Self {
        Self {
            work: [T::ZERO; packed_len(columns(0))],
            active: DEFAULT_ACTIVE,
            joint: JOINTS_PER_LEG,
            fold: 0,
            row: 0,
        }
    }

    /// Begins with the data of `folds`, for a model with the effects of `active`.
    pub fn start(&mut self, active: &Active, folds: &DeviceFolds<T>, solver: &mut DeviceSolver<T>) {
        self.active = *active;
        (self.joint, self.fold, self.row) = (0, 0, 0);
        self.work.fill(T::zero());
        solver.data_mut().reset_to(active.layout(), folds.windows());
    }

    /// The effects of the model that is gathered.
    pub fn active(&self) -> &Active {
        &self.active
    }

    /// Goes on until `budget` numbers are rotated; true when the solver has all data.
    ///
    /// # Errors
    /// [`FactorError`] if the data are not finite.
    pub fn advance(
        &mut self,
        budget: usize,
        folds: &DeviceFolds<T>,
        base: &LegBase<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<bool, FactorError> {
        let mut cost = 0;
        while cost < budget && self.joint < JOINTS_PER_LEG {
            let joint = self.joint;
            let kept = self.active.0[joint].count_ones() as usize + rank(joint);
            if self.fold < FOLDS {
                cost += self.fold_row(joint, kept, &folds.joint(self.fold, joint))?;
                self.row += 1;
                if self.row > columns(joint) {
                    self.row = 0;
                    self.fold += 1;
                }
                continue;
            }
            // A product of rows costs a quarter of a rotation per number.
            let expansion = kept * rank(joint) * standard(joint) / 8;
            if cost > 0 && cost + expansion > budget {
                break;
            }
            self.expand(joint, kept, base, solver)?;
            cost += expansion;
            self.fold = 0;
            self.joint += 1;
            self.work.fill(T::zero());
        }
        Ok(self.joint == JOINTS_PER_LEG)
    }

    /// Folds the kept columns of one row; returns the cost.
    fn fold_row(
        &mut self,
        joint: usize,
        kept: usize,
        from: &Factor<T, &[T]>,
    ) -> Result<usize, FactorError> {
        let (k, rank) = (self.row, rank(joint));
        let mut row = [T::zero(); columns(0) + 1];
        let mut start = kept;
        for (n, x) in from.row(k).iter().enumerate() {
            let place = match k + n {
                c if c < FRONT => self.place(joint, c),
                c if c < FRONT + rank => Some(kept - rank + c - FRONT),
                c if c < DEVICE_COLUMNS + rank => self.place(joint, c - rank),
                _ => Some(kept),
            };
            if let Some(to) = place.and_then(|place| row.get_mut(place)) {
                *to = *x;
                start = start.min(place.unwrap_or(kept));
            }
        }
        let storage = self.work.get_mut(..packed_len(kept)).unwrap_or(&mut []);
        let mut work = Factor::in_storage(kept, storage)?;
        let row = row.get_mut(start..=kept).unwrap_or(&mut []);
        let len = row.len();
        if self.fold == 0 && k < kept && self.active.0[joint] == DEFAULT_ACTIVE.0[joint] {
            // The front of the first fold's triangle is this model's already.
            work.write_row(k, row.iter().copied())?;
            return Ok(len);
        }
        work.fold_from(start, row)?;
        Ok(len * (len + 1) / 2)
    }

    /// Where effect n stands among a joint's active ones.
    fn place(&self, joint: usize, n: usize) -> Option<usize> {
        let before = self.active.0[joint] & ((1 << n) - 1);
        self.active
            .has(joint, n)
            .then_some(before.count_ones() as usize)
    }

    /// Writes R P, the rows over all standard columns, into the solver's data.
    fn expand(
        &self,
        joint: usize,
        kept: usize,
        base: &LegBase<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<(), FactorError> {
        let base = base.joint(joint).ok_or(FactorError::Length(0))?;
        let effects = kept - rank(joint);
        let storage = self.work.get(..packed_len(kept)).unwrap_or(&[]);
        let gathered = Factor::in_storage(kept, storage)?;
        let all = effects + standard(joint);
        solver.data_mut().with_joint(joint, |factor| {
            for k in 0..=kept {
                let Some((z, r)) = gathered.row(k).split_last() else {
                    continue;
                };
                let (first, r) = match k.checked_sub(effects) {
                    None => (0, r.get(effects - k..).unwrap_or(&[])),
                    Some(first) => (first, r),
                };
                let mut row = [T::zero(); LEG_INERTIAL];
                let inertial = row.get_mut(..standard(joint)).unwrap_or(&mut []);
                base.expand(first, r, inertial);
                let place = match k.checked_sub(effects) {
                    None => k,
                    Some(first) if first < base.rank() => {
                        effects + base.independent(first).unwrap_or(0)
                    }
                    Some(_) => all,
                };
                let own = gathered
                    .row(k)
                    .get(..effects.saturating_sub(k))
                    .unwrap_or(&[]);
                let skipped = place.saturating_sub(effects);
                let inertial = inertial.get(skipped..).unwrap_or(&[]);
                let entries = own.iter().chain(inertial).chain([z]);
                factor.write_row(place, entries.copied())?;
            }
            Ok(())
        })
    }
}

impl<T: Real> Default for Gather<T> {
    fn default() -> Self {
        Self::new()
    }
}

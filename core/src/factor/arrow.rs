//! The factor of a robot with limbs: a limb's own rows touch that limb's columns and a few common ones, rows of the base touch all.
//!
//! Columns stand limb after limb, `OWN` of each, then `REST` of the base, the last `COMMON` of which limbs' rows touch as well. Were there
//! limbs' rows alone, the triangle would be an arrow: one block for each limb and a border of the common columns. Rows of the base fill
//! it: one of them links the columns of all limbs, and no order of columns keeps the limbs' blocks of R apart (of WᵀW the block
//! between two limbs is a sum over rows of the base, which is not zero). So the two kinds are kept apart instead:
//!
//! - a triangle for each limb, of its `OWN` and the common columns, for the limb's own rows;
//! - one triangle of all columns for those of the base.
//!
//! Together they say what one triangle of all columns would. They are rotated into one when somebody asks
//! ([`write_limb_rows`](ArrowFactor::write_limb_rows)), not for every window. Of p columns, 6 rows change p (p + 1) / 2 numbers in one triangle of
//! all; of a quadruped that walks (145 columns, 36 of a limb's triangle) 10 585 numbers for the base's six rows of a window and 666 for six
//! rows of a limb.
//!
//! Columns of the base last: what is known of them, whatever the limbs are like, is then the triangle's end, and needs no
//! substitution through the limbs.

use super::block::{Block, ROWS, check};
use super::{Factor, FactorError, packed_len};
use crate::Real;

/// Factors of `LIMBS` limbs of `OWN` columns each and a base of `REST` columns, the last `COMMON` of which the limbs' rows touch.
///
/// `N` is [`packed_len`]`(OWN + COMMON)` and `M` [`packed_len`]`(LIMBS * OWN + REST)`, checked when compiled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrowFactor<
    T,
    const LIMBS: usize,
    const OWN: usize,
    const REST: usize,
    const COMMON: usize,
    const N: usize,
    const M: usize,
> {
    limbs: [[T; N]; LIMBS],
    whole: [T; M],
}

impl<
    T: Real,
    const LIMBS: usize,
    const OWN: usize,
    const REST: usize,
    const COMMON: usize,
    const N: usize,
    const M: usize,
> ArrowFactor<T, LIMBS, OWN, REST, COMMON, N, M>
{
    /// Columns of all.
    pub const COLUMNS: usize = LIMBS * OWN + REST;
    /// Columns of a limb's triangle.
    pub const LIMB: usize = OWN + COMMON;

    /// No data; all zeros, a constant for statics.
    pub const fn empty() -> Self {
        const {
            assert!(COMMON <= REST);
            assert!(N == packed_len(OWN + COMMON) && M == packed_len(LIMBS * OWN + REST));
        }
        Self {
            limbs: [[T::ZERO; N]; LIMBS],
            whole: [T::ZERO; M],
        }
    }

    /// Forgets all data, in place.
    pub fn clear(&mut self) {
        self.limbs.as_flattened_mut().fill(T::zero());
        self.whole.fill(T::zero());
    }

    /// Writes `floor` on the diagonals of empty triangles: each parameter is zero ± 1/`floor`, by each triangle that has it. Pivots that are zero but for
    /// rounding would turn rounding into rotations.
    pub(crate) fn set_floor(&mut self, floor: T) {
        for packed in &mut self.limbs {
            if let Ok(mut factor) = Factor::in_storage(Self::LIMB, packed.as_mut_slice()) {
                factor.set_floor(floor);
            }
        }
        if let Ok(mut factor) = Factor::in_storage(Self::COLUMNS, self.whole.as_mut_slice()) {
            factor.set_floor(floor);
        }
    }

    /// A limb's triangle: its own columns, then the common ones. Without columns for a limb that is not there.
    pub fn limb(&self, limb: usize) -> Factor<T, &[T]> {
        let found = self
            .limbs
            .get(limb)
            .and_then(|packed| Factor::in_storage(Self::LIMB, packed.as_slice()).ok());
        found.unwrap_or(Factor::nothing())
    }

    /// The triangle of the base's rows, over all columns.
    pub fn base(&self) -> Factor<T, &[T]> {
        Factor::in_storage(Self::COLUMNS, self.whole.as_slice()).unwrap_or(Factor::nothing())
    }

    /// Folds [`ROWS`] rows of one limb into its triangle; `block` has for each of its columns what the rows hold, the right-hand side last, and
    /// is used up. Rows of zeros do no harm.
    ///
    /// # Errors
    /// [`FactorError::Length`], or [`FactorError::NotFinite`] with the factor unchanged.
    pub fn fold_limb(&mut self, limb: usize, block: &mut Block<T>) -> Result<(), FactorError> {
        let packed = self.limbs.get_mut(limb).ok_or(FactorError::Length(limb))?;
        Factor::in_storage(Self::LIMB, packed.as_mut_slice())?.fold_block(0, block)
    }

    /// Goes on folding [`ROWS`] rows of the base: columns from `fold` on, until about `most` numbers of the triangle have changed.
    ///
    /// # Errors
    /// As [`fold_limb`](Self::fold_limb); numbers are looked at before the first column.
    pub fn fold_base(
        &mut self,
        fold: &mut Folding,
        most: usize,
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        let whole = Factor::in_storage(Self::COLUMNS, self.whole.as_mut_slice())?;
        fold.advance(whole, most, block)
    }

    /// Six rows of a limb's triangle from row `k` on as rows of all columns, into `block` of so many and the right-hand side: to be
    /// folded into a triangle of all from column [`limb_column`](Self::limb_column)`(limb) + k` on.
    ///
    /// `triangle` may be the limb's own one or one with more rows folded in, such as a prior's.
    pub fn write_limb_rows(
        triangle: &Factor<T, &[T]>,
        limb: usize,
        k: usize,
        block: &mut Block<T>,
    ) {
        block.as_flattened_mut().fill(T::zero());
        for n in 0..ROWS {
            for (c, x) in triangle.row(k + n).iter().enumerate() {
                let own = k + n + c;
                let column = if own < OWN {
                    Self::limb_column(limb) + own
                } else {
                    Self::COLUMNS + own - Self::LIMB
                };
                if let Some(to) = block.get_mut(column).and_then(|rows| rows.get_mut(n)) {
                    *to = *x;
                }
            }
        }
    }

    /// The first of a limb's columns among all.
    pub const fn limb_column(limb: usize) -> usize {
        OWN * limb
    }
}

/// How far a block of rows is folded in: for callers that spread the work over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Folding {
    next: usize,
    checked: bool,
}

impl Folding {
    /// Begins with column `first`: the rows are zero before it.
    pub const fn from(first: usize) -> Self {
        Self {
            next: first,
            checked: false,
        }
    }

    /// Whether all of a triangle's columns are done, that of the right-hand side included.
    pub const fn is_done(&self, columns: usize) -> bool {
        self.next > columns
    }

    /// Folds the rows into `target` column by column, until about `most` of its numbers have changed. `block` has all columns.
    ///
    /// # Errors
    /// As [`ArrowFactor::fold_limb`].
    pub fn advance<S: AsRef<[T]> + AsMut<[T]>, T: Real>(
        &mut self,
        mut target: Factor<T, S>,
        most: usize,
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        if !self.checked {
            check(block)?;
            self.checked = true;
        }
        let mut left = most;
        while left > 0 && !self.is_done(target.columns()) {
            let length = target.columns() + 1 - self.next;
            let rest = block.get_mut(self.next..).unwrap_or(&mut []);
            target.reflect_first(self.next, rest)?;
            left = left.saturating_sub(length);
            self.next += 1;
        }
        Ok(())
    }
}

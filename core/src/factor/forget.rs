//! Forgetting: everything by a share, or all that is said of one direction of the parameters and nothing else.

use super::{Factor, FactorError, row_start};
use crate::Real;
use crate::scalar::sqrt;

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>> Factor<T, S> {
    /// Weighs everything folded in so far down to `retention` (0 to 1): exponential forgetting.
    pub fn forget(&mut self, retention: T) {
        let scale = sqrt(retention.max(T::zero()).min(T::one()));
        self.storage.as_mut().iter_mut().for_each(|x| *x *= scale);
        self.rows *= retention;
    }

    /// Weighs everything folded in so far by `scale` squared, more or less than before: as if its rows had been multiplied by `scale`.
    pub(crate) fn scale(&mut self, scale: T) {
        self.storage.as_mut().iter_mut().for_each(|x| *x *= scale);
        self.rows *= scale * scale;
    }

    /// Raises the diagonal to `floor` where forgetting has taken it below: no parameter is known worse than ± 1/`floor`.
    pub(crate) fn keep_floor(&mut self, floor: T) {
        for k in 0..self.columns {
            if let Some(pivot) = self.storage.as_mut().get_mut(row_start(self.columns, k)) {
                *pivot = pivot.max(floor);
            }
        }
    }

    /// Forgets all that is said of the parameters along `direction` (p numbers); what is said of all others stays: their
    /// marginal, as if θ + w `direction` took the place of θ, with nothing known of w.
    ///
    /// That is the time update of a square-root information filter with process noise without bound (Bierman,
    /// *Factorization Methods for Discrete Sequential Estimation*, ch. VI): rotations gather R `direction` in one row, which
    /// alone then knows w, and that row is dropped; [`set_floor`](Self::set_floor)'s takes its place. Of a direction of which
    /// nothing is said but rounding nothing is dropped. ρ and [`rows`](Self::rows) stay.
    ///
    /// `scratch` holds 2 p + 1 numbers.
    ///
    /// # Errors
    /// [`FactorError::Length`].
    pub(crate) fn forget_direction(
        &mut self,
        direction: &[T],
        floor: T,
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        let p = self.columns;
        let error = FactorError::Length(scratch.len());
        let (told, gathered) = scratch.split_at_mut_checked(p).ok_or(error)?;
        let gathered = gathered.get_mut(..=p).ok_or(error)?;
        let Some(last) = direction.iter().rposition(|d| *d != T::zero()) else {
            return Ok(());
        };
        let (mut length, mut terms) = (T::zero(), T::zero());
        for (k, told) in told.iter_mut().enumerate() {
            *told = T::zero();
            for (r, d) in self.row(k).iter().zip(direction.get(k..).unwrap_or(&[])) {
                *told += *r * *d;
                terms += (*r * *d) * (*r * *d);
            }
            length += *told * *told;
        }
        if length <= terms * T::default_epsilon() {
            return Ok(());
        }
        gathered.fill(T::zero());
        let own = gathered.get_mut(last..).unwrap_or(&mut []);
        own.iter_mut()
            .zip(self.row(last))
            .for_each(|(to, from)| *to = *from);
        let mut known = told.get(last).copied().unwrap_or(T::zero());
        for k in (0..last).rev() {
            let said = told.get(k).copied().unwrap_or(T::zero());
            known = self.gather_row(k, said, known, gathered);
        }
        self.write_row(
            last,
            (last..=p).map(|c| if c == last { floor } else { T::zero() }),
        )
    }

    /// Rotates row k, which says `said` of a direction, with the gathered one, which says `known`, so that the row says nothing
    /// of it; what the gathered one says then.
    fn gather_row(&mut self, k: usize, said: T, known: T, gathered: &mut [T]) -> T {
        let square = said * said + known * known;
        let inverse = square.inverse_sqrt();
        let (none, one) = (T::zero(), T::one());
        // The row's diagonal must stay positive: the sign goes to the sine.
        let sign = if known < none { -one } else { one };
        let idle = if square > none { none } else { one };
        let (cos, sin) = (known.abs() * inverse + idle, said * sign * inverse);
        let start = row_start(self.columns, k);
        let row = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
        let rest = gathered.get_mut(k..).unwrap_or(&mut []);
        for (r, g) in row.iter_mut().zip(rest) {
            let (a, b) = (*r, *g);
            *r = cos * a - sin * b;
            *g = sin * a + cos * b;
        }
        sin * said + cos * known
    }
}

//! An IMU's last readings, and what it read at a time between them.
//!
//! An IMU measures by a clock of its own, the joints are polled by another. What counts for a sample of the joints is the mean of the
//! readings around it, weighed by a triangle: of readings that come evenly it has no delay, whatever their times, and of vibration
//! beyond the samples' rate it lets less through than the nearest reading would.

use crate::wire::Imu;

/// How far the triangle reaches to both sides, µs: over two readings of the board's IMU, less than from a sample of 500 Hz to the next.
const REACH_US: u64 = 1_200;
/// Where none is so near, the nearest counts, if it is as near as this, µs.
const AGE_US: u64 = 4_000;
/// Readings that are kept: 4.8 ms of those of the board's IMU, and so all from a sample to the step in which it is used.
const RING: usize = 8;

/// A reading and its time, µs.
type Timed = (u64, Imu);

/// The last readings; all zeros at first.
pub(super) struct Readings {
    ring: [Timed; RING],
    next: usize,
    filled: usize,
}

impl Readings {
    /// None yet.
    pub(super) const fn new() -> Self {
        let nothing = Imu {
            gyro: [0.0; 3],
            acc: [0.0; 3],
        };
        Self {
            ring: [(0, nothing); RING],
            next: 0,
            filled: 0,
        }
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.filled = 0;
    }

    /// Takes a reading of `time_us`. If that is before the last one's, the clock was set back, and what was before is forgotten.
    pub(super) fn push(&mut self, time_us: u64, imu: &Imu) {
        if self.known().any(|(time, _)| *time >= time_us) {
            self.clear();
        }
        if let Some(place) = self.ring.get_mut(self.next) {
            *place = (time_us, *imu);
        }
        self.next = if self.next + 1 >= RING {
            0
        } else {
            self.next + 1
        };
        self.filled = (self.filled + 1).min(RING);
    }

    fn known(&self) -> impl Iterator<Item = &Timed> {
        let ages = (0..RING).map(|n| (self.next + RING - 1 - n) % RING);
        ages.take(self.filled).filter_map(|n| self.ring.get(n))
    }

    /// What the IMU read at a time; nothing if it was not heard about then.
    pub(super) fn at(&self, time_us: u64) -> Option<Imu> {
        let (mut gyro, mut acc, mut weights) = ([0.0; 3], [0.0; 3], 0.0);
        for (time, imu) in self.known() {
            let left = REACH_US.saturating_sub(time.abs_diff(time_us));
            let weight = left as f32 / REACH_US as f32;
            add(&mut gyro, weight, &imu.gyro);
            add(&mut acc, weight, &imu.acc);
            weights += weight;
        }
        if weights > 0.0 {
            return Some(Imu {
                gyro: gyro.map(|x| x / weights),
                acc: acc.map(|x| x / weights),
            });
        }
        let nearest = self.known().min_by_key(|(time, _)| time.abs_diff(time_us));
        let near = nearest.filter(|(time, _)| time.abs_diff(time_us) <= AGE_US);
        near.map(|(_, imu)| *imu)
    }
}

fn add(sum: &mut [f32; 3], weight: f32, x: &[f32; 3]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += weight * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion that a line and a slow wave make.
    fn imu(time_us: f64) -> Imu {
        let t = time_us * 1e-6;
        let wave = (2.0 * core::f64::consts::PI * 20.0 * t).sin();
        Imu {
            gyro: [t, wave, -2.0 * t].map(|x| x as f32),
            acc: [wave, 1.0 - t, 0.0].map(|x| x as f32),
        }
    }

    /// The largest error of samples every 2 ms, each taken in the step after it, of an IMU whose readings are `period` apart.
    fn worst(period: f64) -> f32 {
        let mut readings = Readings::new();
        let (mut n, mut worst) = (0.0, 0.0_f32);
        for step in 5..500_u64 {
            let (sample, now) = (2_000 * step - 2_150, 2_000 * step);
            while period * n < now as f64 {
                readings.push((period * n) as u64, &imu(period * n));
                n += 1.0;
            }
            let (is, should) = (readings.at(sample).unwrap(), imu(sample as f64));
            for axis in 0..3 {
                worst = worst.max((is.gyro[axis] - should.gyro[axis]).abs());
                worst = worst.max((is.acc[axis] - should.acc[axis]).abs());
            }
        }
        worst
    }

    /// The wave turns by up to 126 a second: what is 0.6 ms late would be off by 0.075.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn readings_around_a_sample_have_no_delay() {
        // 1666 Hz and what the data sheet lets it be off by.
        for period in [600.2, 560.0, 640.0] {
            assert!(worst(period) < 0.006, "{period} {}", worst(period));
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn a_reading_of_the_same_time_counts_alone() {
        let mut readings = Readings::new();
        for n in 0..20 {
            readings.push(2_000 * n, &imu(2_000.0 * n as f64));
        }
        assert_eq!(readings.at(36_000), Some(imu(36_000.0)));
        assert_eq!(readings.at(38_000 + AGE_US), Some(imu(38_000.0)));
        assert_eq!(readings.at(38_001 + AGE_US), None);
        // What is older than the ring.
        assert_eq!(readings.at(1_000), None);
        // The clock is set back.
        readings.push(5, &imu(0.0));
        assert_eq!(readings.at(36_000), None);
        assert_eq!(readings.at(5), Some(imu(0.0)));
    }
}

//! The chip's self-test: it pushes its own masses with a known force, and what it reads must change by so much (DS12140, table 2; AN5192,
//! section 9). It says that masses, electronics and SPI work, and nothing of scale or mounting.

use crate::lsm6dso::{Fault, Lsm6dso, numbers};
use crate::registers::*;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::delay::DelayNs;

/// As AN5192 has it: these ranges, this rate or more, this long until the masses are where they are pushed to, so many readings.
const TEST: Settings = Settings {
    rate: Rate::Hz208,
    acc: AccRange::G4,
    gyro: GyroRange::Dps2000,
};
const SETTLE_MS: u32 = 100;
const READINGS: usize = 5;
/// Time between two looks for a reading, and how many; a reading takes 5 ms.
const LOOK_US: u32 = 500;
const LOOKS: usize = 40;

/// Changes that are right, in counts of those ranges: 50 to 1700 mg of 0.122, 150 to 700 degrees a second of 0.07.
const ACC_CHANGE: core::ops::RangeInclusive<f32> = 50.0 / 0.122..=1700.0 / 0.122;
const GYRO_CHANGE: core::ops::RangeInclusive<f32> = 150.0 / 0.07..=700.0 / 0.07;

/// Readings of a chip that rests differ by less than this between their least and greatest: ten degrees a second and 20 mg, less
/// than half of the least change; its own noise is 0.04 degrees a second and 1 mg.
const RESTS: [f32; 2] = [10.0 / 0.07, 20.0 / 0.122];

/// What the self-test says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelfTest {
    /// Each axis moves as it should.
    Passed,
    /// The first axis that does not: 0 to 2 are the gyroscope's, 3 to 5 the accelerometer's.
    Failed(u8),
    /// The robot moves: nothing can be said.
    Moves,
}

/// The mean counts of gyroscope and accelerometer, and whether they rested.
struct Mean {
    counts: [[f32; 3]; 2],
    rests: bool,
}

impl<S: SpiDevice> Lsm6dso<S> {
    /// Tests the chip, in 0.3 s, after which it measures as before. For the start, while the robot rests.
    ///
    /// # Errors
    /// If it cannot be read.
    pub async fn self_test(
        &mut self,
        delay: &mut impl DelayNs,
    ) -> Result<SelfTest, Fault<S::Error>> {
        self.measure(TEST)?;
        let before = self.mean(delay).await?;
        self.set(CTRL5_C, ST_XL_POSITIVE | ST_G_POSITIVE)?;
        let pushed = self.mean(delay).await?;
        self.set(CTRL5_C, 0)?;
        self.measure(self.settings())?;
        delay.delay_ms(SETTLE_MS).await;
        if !(before.rests && pushed.rests) {
            return Ok(SelfTest::Moves);
        }
        let (before, after) = (before.counts.as_flattened(), pushed.counts.as_flattened());
        let changes = before.iter().zip(after).map(|(a, b)| (b - a).abs());
        for (axis, change) in (0..).zip(changes) {
            let right = if axis < 3 { GYRO_CHANGE } else { ACC_CHANGE };
            if !right.contains(&change) {
                return Ok(SelfTest::Failed(axis));
            }
        }
        Ok(SelfTest::Passed)
    }

    /// The mean of some readings, once the masses are where they are pushed to; the first one is of before.
    async fn mean(&mut self, delay: &mut impl DelayNs) -> Result<Mean, Fault<S::Error>> {
        delay.delay_ms(SETTLE_MS).await;
        self.next(delay).await?;
        let first = self.next(delay).await?;
        let (mut sum, mut least, mut most) = (first, first, first);
        for _ in 1..READINGS {
            let counts = self.next(delay).await?;
            for sensor in 0..2 {
                for axis in 0..3 {
                    let count = counts[sensor][axis];
                    sum[sensor][axis] += count;
                    least[sensor][axis] = count.min(least[sensor][axis]);
                    most[sensor][axis] = count.max(most[sensor][axis]);
                }
            }
        }
        let rests = |sensor: usize| {
            let mut span = most[sensor].iter().zip(&least[sensor]);
            span.all(|(most, least)| most - least < RESTS[sensor])
        };
        Ok(Mean {
            counts: sum.map(|axes| axes.map(|x| x / READINGS as f32)),
            rests: rests(0) && rests(1),
        })
    }

    /// The counts of the next measurement.
    async fn next(&mut self, delay: &mut impl DelayNs) -> Result<[[f32; 3]; 2], Fault<S::Error>> {
        for _ in 0..LOOKS {
            match self.raw() {
                Ok(bytes) => return Ok(numbers(&bytes).map(|axes| axes.map(f32::from))),
                Err(Fault::NotReady) => delay.delay_us(LOOK_US).await,
                Err(fault) => return Err(fault),
            }
        }
        Err(Fault::NotReady)
    }
}

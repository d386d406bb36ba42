//! Recorders that fall behind, and logs that only look so.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Two joints that swing, at uneven speeds.
fn motion(t: f64) -> [[f64; 2]; 2] {
    [(0.7, 0.5), (1.9, 0.3)].map(|(hertz, size)| {
        let w = std::f64::consts::TAU * hertz;
        [size * (w * t).sin(), size * w * (w * t).cos()]
    })
}

/// Rows of a time, and position and velocity of two joints.
fn rows(measured: &[f64], stamps: &[f64], noise: f64, seed: u64) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |size: f64| size * noise * (random.random::<f64>() - 0.5);
    let row = |(t, stamp): (&f64, &f64)| {
        let [a, b] = motion(*t);
        let mut row = vec![*stamp];
        row.extend([a[0] + noise(1e-4), a[1] + noise(2e-2)]);
        row.extend([b[0] + noise(1e-4), b[1] + noise(2e-2)]);
        row
    };
    measured.iter().zip(stamps).map(row).collect()
}

/// The times of rows after the reading ahead, and how many were mended.
fn read(rows: &[Vec<f64>]) -> (Vec<f64>, u64) {
    let mut stamps = Stamps::of(Unit::Line, vec![[1, 2], [3, 4]]);
    let (mut given, mut next) = (Vec::new(), 0);
    let mut values = Vec::new();
    loop {
        while stamps.wants_more() {
            match rows.get(next) {
                Some(row) => stamps.push(next as u64, row),
                None => stamps.end(),
            }
            next += 1;
        }
        match stamps.next(&mut values) {
            Some(line) => {
                assert_eq!(line as usize, given.len(), "each row once, in its order");
                given.push(values[0]);
            }
            None => break,
        }
    }
    assert!(given.is_sorted());
    (given, stamps.mended)
}

/// Lateness of a recorder that stalls now and then for up to `stall` s, and then catches up by `speed` periods a row.
fn falls_behind(count: usize, period: f64, stall: f64, speed: f64, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut late = 0.0_f64;
    let each = |_| {
        if random.random::<f64>() < period / 0.3 {
            late = stall * random.random_range(0.5..1.0);
        }
        let now = late;
        late = (late - speed * period).max(0.0);
        now
    };
    (0..count).map(each).collect()
}

#[test]
fn late_rows_get_the_times_at_which_they_were_measured() {
    for rate in [125.0, 250.0, 500.0, 1_000.0, 5_000.0] {
        for (stall, speed) in [(8e-3, 0.9), (8e-3, 0.3), (20e-3, 0.6)] {
            for seed in 0..4 {
                let period = 1.0 / rate;
                let measured: Vec<f64> = (0..6_000).map(|n| n as f64 * period).collect();
                let late = falls_behind(measured.len(), period, stall, speed, seed);
                let stamps: Vec<f64> = measured.iter().zip(&late).map(|(t, d)| t + d).collect();
                let stamps = rows(&measured, &stamps, 1.0, seed);
                let (times, _) = read(&stamps);
                let square = |t: &dyn Fn(usize) -> f64| -> f64 {
                    (0..times.len()).map(|n| (t(n) - measured[n]).powi(2)).sum()
                };
                let [before, after] = [square(&|n| stamps[n][0]), square(&|n| times[n])];
                assert!(
                    after < 0.02 * before,
                    "{rate} Hz, {stall} s, {speed}: {:.3} of the square error is left",
                    after / before
                );
            }
        }
    }
}

#[test]
fn what_was_stamped_in_time_keeps_its_stamp() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let even: Vec<f64> = (0..4_000).map(|n| n as f64 * 2e-3).collect();
    let mut walk = 0.0;
    let mut uneven = || {
        walk += 2e-3 * random.random_range(0.5..1.5);
        walk
    };
    let uneven: Vec<f64> = (0..4_000).map(|_| uneven()).collect();
    let lossy: Vec<f64> = (even.iter().enumerate())
        .filter(|(n, _)| n % 7 != 3 && n % 500 > 20)
        .map(|(_, t)| *t)
        .collect();
    // Episodes of a data set, a second apart.
    let short: Vec<f64> = (0..240)
        .map(|n| n as f64 * 2e-3 + (n / 60) as f64)
        .collect();
    for measured in [&even, &uneven, &lossy, &short] {
        let (times, mended) = read(&rows(measured, measured, 1.0, 5));
        assert_eq!((mended, &times), (0, measured));
    }
}

#[test]
fn a_joint_at_rest_does_not_tell() {
    let measured: Vec<f64> = (0..4_000).map(|n| n as f64 * 2e-3).collect();
    let late = falls_behind(measured.len(), 2e-3, 8e-3, 0.9, 1);
    let mut at_rest = rows(&vec![0.1; 4_000], &measured, 1.0, 2);
    for (row, late) in at_rest.iter_mut().zip(late) {
        row[0] += late;
        row[2] -= motion(0.1)[0][1];
        row[4] -= motion(0.1)[1][1];
    }
    assert_eq!(read(&at_rest).1, 0);
}

#[test]
fn a_message_in_two_rows_is_not_late() {
    let measured: Vec<f64> = (0..4_000).map(|n| (n / 2) as f64 * 2e-3).collect();
    assert_eq!(read(&rows(&measured, &measured, 0.0, 2)).1, 0);
}

#[test]
fn garbage_and_few_rows_are_read_as_they_are() {
    for count in [0, 1, 2, 70, 600] {
        let odd = |n: usize| [f64::NAN, 1e300, -4.0, n as f64][n % 4];
        let rows: Vec<Vec<f64>> = (0..count)
            .map(|n| vec![n as f64, odd(n), odd(n + 1), odd(n + 2), odd(n + 3)])
            .collect();
        assert_eq!(read(&rows).0.len(), count);
    }
}

#[test]
fn a_live_row_waits_for_none() {
    let mut stamps = Stamps {
        lookahead: 0,
        ..Stamps::of(Unit::Line, vec![[1, 2], [3, 4]])
    };
    let mut values = Vec::new();
    for row in rows(&[0.0, 0.002, 0.004], &[0.0, 0.002, 0.009], 0.0, 1) {
        assert!(stamps.wants_more());
        stamps.push(1, &row);
        assert!(!stamps.wants_more());
        assert!(stamps.next(&mut values).is_some() && values == row);
    }
}

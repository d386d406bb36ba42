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
            late = late.max(stall * random.random_range(0.5..1.0));
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
        for (stall, speed) in [
            (8e-3, 0.9),
            (8e-3, 0.3),
            (20e-3, 0.6),
            (30e-3, 0.2),
            (8e-3, 0.1),
        ] {
            // Half a second is too few rows of a slow log to tell its period while half of them are late.
            if rate < 250.0 && stall > 20e-3 {
                continue;
            }
            for seed in 0..4 {
                let period = 1.0 / rate;
                let count = f64::max(4.0 * rate, 6_000.0) as usize;
                let measured: Vec<f64> = (0..count).map(|n| n as f64 * period).collect();
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
        live: true,
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

/// Of a log of three joints at their noise, what the reading leaves of the square of the windows' error, 20 ms long: by how much they last
/// longer or shorter than they did.
fn left(measured: &[f64], stamps: &[f64], seed: u64) -> [f64; 2] {
    let (times, _) = read(&rows(measured, stamps, 1.0, seed));
    let of = |times: &[f64]| {
        let mut sum = 0.0;
        for n in 0..measured.len() {
            let to = measured.partition_point(|t| *t < measured[n] + 0.02);
            let lasts = measured.get(to).map_or(1.0, |t| t - measured[n]);
            // Over a pause there is no window.
            if lasts < 0.03 {
                sum += (times[to] - times[n] - lasts).powi(2);
            }
        }
        sum
    };
    [of(stamps), of(&times)]
}

/// What recorders and networks do: how much of the squared error of 20 ms windows is left at most, over rates and seeds.
#[test]
fn what_is_left_of_each_kind_of_lateness() {
    type Make = fn(&mut ChaCha8Rng, f64, &mut Vec<f64>, &mut Vec<f64>);
    let kinds: [(&str, f64, Make); 7] = [
        ("even", 1e-3, |_, _, _, _| {}),
        (
            "a clock that jitters by a tenth",
            0.1,
            |random, period, measured, stamps| {
                for (t, stamp) in measured.iter_mut().zip(stamps) {
                    let off = period * random.random_range(-0.1..0.1);
                    (*t, *stamp) = (*t + off, *stamp + off);
                }
            },
        ),
        ("stamps of 1 ms", 0.1, |_, _, _, stamps| {
            stamps
                .iter_mut()
                .for_each(|t| *t = (*t * 1e3).round() / 1e3);
        }),
        ("read every 20 ms", 0.05, |_, _, measured, stamps| {
            for (t, stamp) in measured.iter().zip(stamps) {
                *stamp = (*t / 0.02).ceil() * 0.02;
            }
        }),
        (
            "pauses of 0.1 to 3 s",
            0.2,
            |random, period, measured, stamps| {
                let mut behind = 0.0;
                for n in 1..stamps.len() {
                    if stamps[n] == measured[n] && random.random::<f64>() < period / 2.0 {
                        behind += random.random_range(0.1..3.0);
                    }
                    (measured[n], stamps[n]) = (measured[n] + behind, stamps[n] + behind);
                }
            },
        ),
        (
            "one in two hundred is lost",
            0.3,
            |random, _, measured, stamps| {
                let kept: Vec<_> = (measured.iter().copied().zip(stamps.iter().copied()))
                    .filter(|_| random.random::<f64>() > 5e-3)
                    .collect();
                (*measured, *stamps) = kept.into_iter().unzip();
            },
        ),
        ("the log ends behind", 1e-2, |_, _, measured, stamps| {
            let latest = (1..stamps.len())
                .rev()
                .find(|&n| stamps[n] - stamps[n - 1] > 5e-3);
            let end = latest.unwrap() + 2;
            measured.truncate(end);
            stamps.truncate(end);
        }),
    ];
    let mut told = String::new();
    let mut is_right = true;
    for (kind, most, make) in kinds {
        let mut worst = 0.0_f64;
        for rate in [250.0, 400.0, 1_000.0, 2_000.0, 5_000.0] {
            for (seed, (stall, speed)) in [(8e-3, 0.9), (30e-3, 0.2)].into_iter().enumerate() {
                let period = 1.0 / rate;
                let mut measured: Vec<f64> = (0..(6.0 * rate) as usize)
                    .map(|n| n as f64 * period)
                    .collect();
                let late = falls_behind(measured.len(), period, stall, speed, seed as u64);
                let mut stamps: Vec<f64> = measured.iter().zip(&late).map(|(t, d)| t + d).collect();
                let mut random = ChaCha8Rng::seed_from_u64(seed as u64 + 10);
                make(&mut random, period, &mut measured, &mut stamps);
                for n in 1..stamps.len() {
                    stamps[n] = stamps[n].max(stamps[n - 1]);
                }
                let [before, after] = left(&measured, &stamps, seed as u64);
                worst = worst.max(after / before);
            }
        }
        told += &format!("{kind}: {worst:.5} of at most {most}\n");
        is_right &= worst < most;
    }
    assert!(is_right, "{told}");
}

/// Rows after a pause are not late, however long it lasts and however fast joints move: no one catches up.
#[test]
fn what_follows_a_pause_keeps_its_stamps() {
    for pause in [0.05, 0.3, 5.0, 14_400.0] {
        for after in [50, 400, 1_500] {
            let measured: Vec<f64> = (0..1_000 + after)
                .map(|n| n as f64 * 2e-3 + if n < 1_000 { 0.0 } else { pause })
                .collect();
            let (times, mended) = read(&rows(&measured, &measured, 1.0, 4));
            assert_eq!((mended, times), (0, measured), "{pause} s, {after} rows");
        }
    }
}

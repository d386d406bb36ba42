//! How a link moves within the play between motor and link.
//!
//! While the gear transmits a torque the link rests on that side of the gap. When the torque changes its sign the link is free
//! and falls behind the motor, whose motion is measured: the torque L that it would take to follow is missing,
//!
//! ```text
//! ẍ = −L(t)/M    until |x| = gap/2
//! ```
//!
//! with M the inertia that the joint turns (Nordin & Gutman 2002, *Automatica* 38:1633, §2, the dead zone's dynamics). There
//! it stops: how it bounces is not known, and within a window of 20 ms bounces have no mean.

/// A step of the free link, s.
const STEP: f64 = 2.5e-4;

/// Position and velocity of the link against the motor at the times `t`, per radian of `gap`, under the torques `load` (N m)
/// that it takes to follow the motor; `inertia` in kg m² at each of them.
pub(crate) fn play(t: &[f64], load: &[f64], inertia: &[f64], gap: f64) -> Vec<[f64; 2]> {
    let half = 0.5 * gap;
    let (mut x, mut v) = (load.first().map_or(0.0, |l| -half * l.signum()), 0.0);
    let mut all = Vec::with_capacity(t.len());
    for k in 0..t.len() {
        // Most of the time it rests where it is and is pressed there from one sample to the next: no step would move it.
        let pressed = |torque: f64| torque * x < 0.0;
        let rests =
            k > 0 && v == 0.0 && x.abs() == half && pressed(load[k - 1]) && pressed(load[k]);
        if k > 0 && !rests {
            let time = t[k] - t[k - 1];
            let steps = (time / STEP).ceil().max(1.0);
            let step = time / steps;
            let rise = (load[k] - load[k - 1]) / steps;
            let mobility = step / inertia[k];
            for n in 0..steps as usize {
                let torque = load[k - 1] + (n as f64 + 0.5) * rise;
                v -= mobility * torque;
                x += step * v;
                if x.abs() >= half {
                    x = x.clamp(-half, half);
                    v = 0.0;
                }
            }
        }
        all.push([x / gap, v / gap]);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Under a constant torque from one side to the other: gap = ½ (L/M) t².
    #[test]
    fn the_link_falls_through_the_gap_in_the_time_of_a_free_body() {
        let t: Vec<f64> = (0..100).map(|k| 0.001 * f64::from(k)).collect();
        let load: Vec<f64> = (0..100).map(|k| if k < 20 { 1.0 } else { -1.0 }).collect();
        let (inertia, gap) = (0.05, 0.004);
        let moved = play(&t, &load, &vec![inertia; t.len()], gap);
        let crossing = f64::sqrt(2.0 * gap * inertia);
        let arrival = t[19] + 0.0005 + crossing;
        for (t, [x, v]) in t.iter().zip(&moved) {
            if *t <= t_of(19) {
                assert_eq!([*x, *v], [-0.5, 0.0]);
            } else if *t > arrival + 0.001 {
                assert_eq!([*x, *v], [0.5, 0.0]);
            }
        }
        let middle = moved[29];
        let free = 0.5 / inertia * (t[29] - t[19] - 0.0005).powi(2) / gap - 0.5;
        assert!((middle[0] - free).abs() < 0.02, "{} {free}", middle[0]);
    }

    /// Pressed to one side it stays, and lets go with the first step in which it is not pressed all the time.
    #[test]
    fn a_link_that_is_pressed_rests() {
        let t: Vec<f64> = (0..40).map(|k| 0.002 * f64::from(k)).collect();
        let load: Vec<f64> = t.iter().map(|t| (80.0 * t).cos()).collect();
        let turn = load.iter().position(|l| *l < 0.0).unwrap();
        let moved = play(&t, &load, &vec![0.05; t.len()], 0.004);
        assert!(moved[..turn].iter().all(|x| *x == [-0.5, 0.0]));
        assert!(moved[turn][0] > -0.5 && moved[turn][1] > 0.0);
    }

    fn t_of(k: u32) -> f64 {
        0.001 * f64::from(k)
    }
}

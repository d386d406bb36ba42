//! How a link moves on a spring between motor and link.
//!
//! The motor's motion is measured; the link falls behind it by x, under the torque L that it would take to follow and its own
//! acceleration against the motor:
//!
//! ```text
//! M ẍ + 2 ζ √(M/c) ẋ + x/c = −L(t)
//! ```
//!
//! with M the inertia that the joint turns and c = 1/k the compliance (Spong 1987, *ASME J. Dyn. Syst. Meas. Control* 109:310, eq. 5,
//! with the motor's motion given). Slow motion leaves x = −c L; near the resonance 1/√(M c) the link goes much farther. L runs
//! straight between samples, so that the step from one to the next is exact however stiff the spring.

/// Damping ratio ζ of gears and shafts, which lose 0.02 to 0.15. Of springs simulated with 0.01 to 0.06 this one finds the stiffness
/// of soft and stiff ones alike: a link that is taken to swing longer than it does carries errors of its motion on.
const DAMPING: f64 = 0.08;

/// Position and velocity of the link against the motor (rad, rad/s) at the times `t`, under the torques `load` (N m) that it takes to
/// follow the motor; `inertia` in kg m² at each of them, `compliance` in rad/(N m), positive.
pub(crate) fn spring(t: &[f64], load: &[f64], inertia: &[f64], compliance: f64) -> Vec<[f64; 2]> {
    let mut all = Vec::with_capacity(t.len());
    let (mut now, mut momentum) = ([0.0; 2], 0.0);
    for k in 0..t.len() {
        // The step from the sample before; of the first one, which has none, the one that follows, backwards.
        let (a, b) = if k == 0 {
            (0, 1.min(t.len() - 1))
        } else {
            (k - 1, k)
        };
        let step = t[b] - t[a];
        let rate = if step > 0.0 {
            (load[b] - load[a]) / step
        } else {
            0.0
        };
        let mass = 0.5 * (inertia[a] + inertia[b]);
        let natural = (mass * compliance).sqrt().recip();
        let (decay, damped) = (
            DAMPING * natural,
            natural * (1.0 - DAMPING * DAMPING).sqrt(),
        );
        // Behind a load that runs straight the link runs straight: x = start + slope τ.
        let slope = -compliance * rate;
        let start = -compliance * load[a] - 2.0 * DAMPING / natural * slope;
        if k == 0 {
            now = [start, slope];
        } else {
            // What is left of it swings freely. As other joints move the inertia changes, and the momentum stays.
            let cosine = now[0] - start;
            let sine = (momentum / mass - slope + decay * cosine) / damped;
            let (sin, cos) = (damped * step).sin_cos();
            let left = (-decay * step).exp();
            let swing = left * (cosine * cos + sine * sin);
            let across = left * (sine * cos - cosine * sin);
            now = [
                start + slope * step + swing,
                slope - decay * swing + damped * across,
            ];
        }
        momentum = mass * now[1];
        all.push(now);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Under a slow load it is the load's lag, near the resonance the amplitude of a driven oscillator.
    #[test]
    fn a_sine_moves_the_link_as_the_transfer_function_says() {
        let (inertia, compliance) = (0.05f64, 1.0 / 300.0);
        let natural = (inertia * compliance).sqrt().recip();
        for ratio in [0.05, 0.5, 0.8, 1.5] {
            let omega = ratio * natural;
            let t: Vec<f64> = (0..20_000).map(|k| 5e-4 * f64::from(k)).collect();
            let load: Vec<f64> = t.iter().map(|t| (omega * t).sin()).collect();
            let moved = spring(&t, &load, &vec![inertia; t.len()], compliance);
            let steady = &moved[15_000..];
            let most = steady.iter().fold(0.0f64, |most, [x, _]| most.max(x.abs()));
            let [real, imaginary] = [1.0 - ratio * ratio, 2.0 * DAMPING * ratio];
            let gain = compliance / real.hypot(imaginary);
            assert!((most / gain - 1.0).abs() < 0.01, "{ratio}: {most} {gain}");
        }
    }

    #[test]
    fn velocity_is_the_slope_of_position() {
        let t: Vec<f64> = (0..4000).map(|k| 1e-4 * f64::from(k)).collect();
        let load: Vec<f64> = t.iter().map(|t| (40.0 * t).sin() + 0.3).collect();
        let moved = spring(&t, &load, &vec![0.02; t.len()], 0.004);
        for k in 1..t.len() - 1 {
            let slope = (moved[k + 1][0] - moved[k - 1][0]) / (t[k + 1] - t[k - 1]);
            assert!((slope - moved[k][1]).abs() < 1e-3 * (1.0 + slope.abs()));
        }
    }
}

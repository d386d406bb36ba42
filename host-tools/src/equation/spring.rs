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
//! straight between samples, so that the step from one to the next is exact however stiff the spring. Where friction stops a motor between two samples,
//! and lets it go, its acceleration jumps: then L has in the mean what the change of its velocity says.
//!
//! Friction inside the spring (`elastic_hysteresis`) adds f z(x), dz/dx = (1 − z sgn ẋ)/w: along a step a straight line in x, which stiffens
//! the spring by f dz/dx.

/// Damping ratio ζ of gears and shafts, which lose 0.02 to 0.15. Of springs simulated with 0.01 to 0.06 this one finds the stiffness
/// of soft and stiff ones alike: a link that is taken to swing longer than it does carries errors of its motion on.
const DAMPING: f64 = 0.08;

/// What lies between motor and link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gear {
    /// rad/(N m), positive.
    pub(crate) compliance: f64,
    /// Friction inside it, N m, and the displacement (rad) over which that builds up; none where either is not positive.
    pub(crate) friction: f64,
    pub(crate) displacement: f64,
}

/// A torque over time, N m: straight from sample to sample, and a constant beyond that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Course<'a> {
    /// At the samples.
    pub(crate) at: &'a [f64],
    /// From the sample before each to it.
    pub(crate) beyond: &'a [f64],
}

/// Position and velocity of the link against the motor (rad, rad/s) at the times `t`, under the `torque` that it takes to follow the motor; `inertia`
/// in kg m² at each of them.
pub(crate) fn spring(t: &[f64], torque: Course, inertia: &[f64], gear: Gear) -> Vec<[f64; 2]> {
    let load = torque.at;
    let mut all: Vec<[f64; 2]> = Vec::with_capacity(t.len());
    let (mut now, mut momentum) = ([0.0f64; 2], 0.0);
    let has_friction = gear.friction > 0.0 && gear.displacement > 0.0;
    // The state of friction inside, from −1 to 1.
    let mut state = 0.0f64;
    for k in 0..t.len() {
        let (a, b) = (k.saturating_sub(1), k);
        let step = t[b] - t[a];
        let [load, rate] = if k == 0 {
            before(t, load, inertia[0] * gear.compliance)
        } else if step > 0.0 {
            [load[a] + torque.beyond[b], (load[b] - load[a]) / step]
        } else {
            [load[a], 0.0]
        };
        let mass = 0.5 * (inertia[a] + inertia[b]);
        let (mut compliance, mut held) = (gear.compliance, 0.0);
        if has_friction && k > 0 {
            let stiffer = gear.friction * (1.0 - state * now[1].signum()) / gear.displacement;
            held = gear.friction * state - stiffer * now[0];
            compliance = (compliance.recip() + stiffer).recip();
        }
        let natural = (mass * compliance).sqrt().recip();
        let (decay, damped) = (
            DAMPING * natural,
            natural * (1.0 - DAMPING * DAMPING).sqrt(),
        );
        // Behind a load that runs straight the link runs straight: x = start + slope τ.
        let slope = -compliance * rate;
        let start = -compliance * (load + held) - 2.0 * DAMPING / natural * slope;
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
        if let Some(&[before, _]) = all.last().filter(|_| has_friction) {
            let gone: f64 = now[0] - before;
            let left = (-gone.abs() / gear.displacement).exp();
            state = gone.signum() - (gone.signum() - state) * left;
        }
        momentum = mass * now[1];
        all.push(now);
    }
    all
}

/// Value and slope at the first sample of the load that a spring of this mass times compliance (s²) has followed until there, N m and N m/s.
///
/// What was before is not known, so the link is taken to have followed without swinging. One difference of samples is noise, which the
/// spring would swing with for long: the straight line is of the load over one radian of the spring's own swing.
fn before(t: &[f64], load: &[f64], mass_by_compliance: f64) -> [f64; 2] {
    let end = t[0] + mass_by_compliance.sqrt();
    let count = t.partition_point(|t| *t <= end).max(2).min(t.len());
    let n = count as f64;
    let [mean_t, mean] = [t, load].map(|x| x[..count].iter().sum::<f64>() / n);
    let (mut product, mut square) = (0.0, 0.0);
    for (t, load) in t[..count].iter().zip(load) {
        product += (t - mean_t) * (load - mean);
        square += (t - mean_t).powi(2);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    [mean + slope * (t[0] - mean_t), slope]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the link goes under a load that runs straight between samples.
    fn spring(t: &[f64], load: &[f64], inertia: &[f64], gear: Gear) -> Vec<[f64; 2]> {
        let torque = Course {
            at: load,
            beyond: &vec![0.0; load.len()],
        };
        super::spring(t, torque, inertia, gear)
    }

    /// A spring without friction.
    fn frictionless(compliance: f64) -> Gear {
        Gear {
            compliance,
            friction: 0.0,
            displacement: 0.0,
        }
    }

    /// Under a slow load it is the load's lag, near the resonance the amplitude of a driven oscillator.
    #[test]
    fn a_sine_moves_the_link_as_the_transfer_function_says() {
        let (inertia, compliance) = (0.05f64, 1.0 / 300.0);
        let natural = (inertia * compliance).sqrt().recip();
        for ratio in [0.05, 0.5, 0.8, 1.5] {
            let omega = ratio * natural;
            let t: Vec<f64> = (0..20_000).map(|k| 5e-4 * f64::from(k)).collect();
            let load: Vec<f64> = t.iter().map(|t| (omega * t).sin()).collect();
            let moved = spring(&t, &load, &vec![inertia; t.len()], frictionless(compliance));
            let steady = &moved[15_000..];
            let most = steady.iter().fold(0.0f64, |most, [x, _]| most.max(x.abs()));
            let [real, imaginary] = [1.0 - ratio * ratio, 2.0 * DAMPING * ratio];
            let gain = compliance / real.hypot(imaginary);
            assert!((most / gain - 1.0).abs() < 0.01, "{ratio}: {most} {gain}");
        }
    }

    /// Under a slow load that comes and goes the spring follows L = −(k x + f z), and comes back another way than it went.
    #[test]
    fn friction_inside_holds_what_comes_back() {
        let gear = Gear {
            compliance: 1.0 / 200.0,
            friction: 0.5,
            displacement: 0.002,
        };
        let t: Vec<f64> = (0..40_000).map(|k| 1e-3 * f64::from(k)).collect();
        let load: Vec<f64> = t.iter().map(|t| 2.0 * (0.5 * t).sin()).collect();
        let moved = spring(&t, &load, &vec![0.03; t.len()], gear);
        let x = || moved.iter().map(|moved| moved[0]);
        let state = super::super::hysteresis::hysteresis(x(), gear.displacement);
        for k in 5_000..t.len() {
            let torque = -(200.0 * moved[k][0] + gear.friction * state[k]);
            assert!(
                (torque - load[k]).abs() < 0.02,
                "{} {torque} {}",
                t[k],
                load[k]
            );
        }
        let at_no_load: Vec<f64> = (1..load.len())
            .filter(|k| load[*k] * load[k - 1] < 0.0)
            .map(|k| moved[k][0].abs())
            .collect();
        assert!(
            at_no_load.iter().skip(2).all(|x| *x > 5e-4),
            "{at_no_load:?}"
        );
    }

    /// A link that has followed a slow load goes on so, however noisy the load's first samples are.
    #[test]
    fn noise_of_the_first_samples_is_no_swing() {
        let t: Vec<f64> = (0..4000).map(|k| 2e-3 * f64::from(k)).collect();
        let noise = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let load: Vec<f64> = (0..t.len())
            .map(|k| 20.0 * (t[k] + 0.5).sin() + noise(k))
            .collect();
        let compliance = 1.0 / 1500.0;
        let moved = spring(&t, &load, &vec![4.0; t.len()], frictionless(compliance));
        let slow = |k: usize| -compliance * 20.0 * (t[k] + 0.5).sin();
        let most = (0..500)
            .map(|k| (moved[k][0] - slow(k)).abs())
            .fold(0.0, f64::max);
        assert!(most < 0.05 * compliance * 20.0, "{most}");
    }

    #[test]
    fn velocity_is_the_slope_of_position() {
        let t: Vec<f64> = (0..4000).map(|k| 1e-4 * f64::from(k)).collect();
        let load: Vec<f64> = t.iter().map(|t| (40.0 * t).sin() + 0.3).collect();
        let moved = spring(&t, &load, &vec![0.02; t.len()], frictionless(0.004));
        for k in 1..t.len() - 1 {
            let slope = (moved[k + 1][0] - moved[k - 1][0]) / (t[k + 1] - t[k - 1]);
            assert!((slope - moved[k][1]).abs() < 1e-3 * (1.0 + slope.abs()));
        }
    }
}

//! A joint's smooth trajectory from what its encoder and its velocity channel report; torque does not enter.
//!
//! Both channels are fused by a smoother (Rauch, Tung & Striebel 1965) whose motion has white noise for its snap: the smoothing
//! spline of seventh degree, which passes frequencies as H = 1/(1 + (f/f_c)⁸). What it leaves of the channels is smoothed again and
//! added (Tukey's twicing, 1977, *Exploratory Data Analysis*, §16), H (2 − H) in all, so that what a joint does below f_c stays as it
//! is: at f_c/1.5 all but 1.4 ‰ of it.
//!
//! What multiplies a parameter is made from it, and above f_c what the channels report is noise: in closed loop the controller has put
//! it into the torque, and a model that took it for motion would explain noise by noise. Where f_c lies, and how far to believe
//! either channel, is told by the two channels themselves ([`channels`]): their noises are independent, so what they agree on
//! is motion. A velocity that a drive makes of its positions has their noise, and is not looked at.
//!
//! Dry friction kinks the velocity where a joint turns round, and where it lets one go that it has held: there the acceleration may
//! jump, by as much as it does where the joint turns round (an empirical Bayes prior; Efron & Morris 1973): one that may jump by more takes noise
//! for jumps. About each jump, as at a stretch's ends, a fast motion is followed less well.
//!
//! Files beside:
//!
//! - `before`: a trajectory as it was some time before: where torque is reported late, it belongs to an earlier motion
//! - `channels`: how far the encoder and the velocity channel can be believed, and up to which frequency
//! - `kinks`: the moments at which dry friction may let the acceleration jump
//! - `smoother`: the smoother of one joint
//! - `speed`: when a joint changes its direction, to a fraction of a sample: there dry friction jumps

mod before;
mod channels;
mod kinks;
mod smoother;
mod speed;

pub(crate) use before::Before;
use channels::Channels;
use kinks::{Kink, kinks_about, turns};
use smoother::Smoother;

/// A speed below so many standard deviations of an encoder's slope at the cutoff may be noise.
const SURE: f64 = 1.0;
/// The same as a share of the joint's greatest speeds: a hundredth of a Go2's quantum-limited slope at 5 rad/s.
const SLOW: f64 = 0.002;
/// A joint that is slower than this share of its greatest speeds may be held by friction.
const RESTING: f64 = 0.004;
/// About a turn friction may stop a joint, and let it go again, at any moment at which it is slower than this share of its greatest
/// speeds: as a trajectory without kinks has it, and one that has them.
// MuJoCo's legs with dry friction are followed alike from 0.05 to 0.1 and from 0.005 to 0.02; one kink, at the crossing alone, left two
// to five times the error where the motion is slow.
const FIRST_SLOW: f64 = 0.05;
const SLOW_ABOUT: f64 = 0.01;
/// How often the size of an acceleration's jumps is found anew, at most: where nothing jumps, what is found is noise, and less each time.
const MOST_ROUNDS: usize = 5;
/// Units of the smoother's time, 1/ω_c, from a stretch's ends within which a fast motion is not followed: samples to one side alone tell it. Of a leg's
/// motion of 8 Hz the first velocity is off by 0.2 rad/s of 3.5, one 3 units from there by as little as any.
const ENDS: f64 = 3.0;
/// Share of a stretch, at either end, that is left out for that at most: of a short one what is said by all of it.
const MOST_OF_ENDS: f64 = 0.05;

/// A joint's trajectory over a recording.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trajectory {
    /// Position, velocity, acceleration and jerk at each sample: rad (or m), rad/s …
    pub(crate) state: Vec<[f64; 4]>,
    /// What smoothing what was left of the channels gave the velocity back at each sample, rad/s: as far off as the velocity may still be where the joint
    /// moves faster than its channels' noise lets one follow.
    pub(crate) regained: Vec<f64>,
    /// Standard deviations of white noise of the channels: of the position, rad, and the velocity, rad/s; zero where they are not known, and
    /// infinite for a velocity that is made of the positions.
    pub(crate) noise: [f64; 2],
    /// Frequency at which smoothing passes a half, Hz.
    pub(crate) cutoff: f64,
    /// The velocity near standstill: about a reversal it stands for the *sign* (see [`speed`]), rad/s.
    pub(crate) speed: Vec<f64>,
    /// Speed below which the sign may be noise, rad/s.
    pub(crate) speed_noise: f64,
    /// Speed below which friction may hold the joint, rad/s.
    pub(crate) rest: f64,
}

/// One channel pair of a stretch without gaps.
#[derive(Clone, Copy)]
pub(crate) struct Stretch<'a> {
    /// s.
    pub(crate) t: &'a [f64],
    /// Reported position, rad.
    pub(crate) q: &'a [f64],
    /// Velocity, rad/s: as reported, its known scale taken out.
    pub(crate) dq: &'a [f64],
}

/// Share of the acceleration by which the trapezoid rule may be wrong before that is put right (`equation/quadrature.rs`), and before a kink has its
/// moment between two samples: a thousandth of the inertial torque is never told, and the correction takes three instants where there was one.
const MOST_WRONG: f64 = 2e-3;

/// A motion is smoothed without kinks where what is left of the channels is so many times as much with them: of a fast one smoothing leaves out a part
/// about each place at which it may jump, and takes that for jumps. A Go2's leg without kinks has up to 20 times as much at 250 Hz, real Go2s less with
/// them than without; noise of 0.2 mrad and 0.03 rad/s makes it more than 1.25 times as much where there are kinks.
const MUCH_MORE: f64 = 2.0;

/// Sums of squares of a joint's velocity and acceleration.
#[derive(Default)]
struct Squares([f64; 2]);

impl Squares {
    fn add(&mut self, states: &[[f64; 4]]) {
        let square = |n: usize| states.iter().map(|state| state[n].powi(2)).sum::<f64>();
        self.0[0] += square(1);
        self.0[1] += square(2);
    }

    fn are_coarse(&self, period: f64) -> bool {
        let [velocity, acceleration] = self.0;
        period.powi(2) / 12.0 * acceleration > MOST_WRONG * velocity
    }
}

impl Trajectory {
    /// Density of the position's noise after smoothing, rad²/Hz at a frequency, Hz: of both channels fused, each by how sure it is, and smoothed twice. Of
    /// samples a period (s) apart; zero where the channels' noises are not known.
    pub(crate) fn noise_density(&self, frequency: f64, period: f64) -> f64 {
        let [position, velocity] = self.noise.map(|noise| 2.0 * period * noise * noise);
        let omega = std::f64::consts::TAU * frequency;
        if position <= 0.0 || velocity <= 0.0 {
            return 0.0;
        }
        let smooth = 1.0 / (1.0 + (frequency / self.cutoff).powi(8));
        (smooth * (2.0 - smooth)).powi(2) / (1.0 / position + omega * omega / velocity)
    }

    /// Whether samples, a period (s) apart, are too far apart for the joint's acceleration: the trapezoid rule is wrong by (ω h)²/12 of it,
    /// with ω the acceleration's root mean square over the velocity's.
    pub(crate) fn is_coarse(&self, period: f64) -> bool {
        let mut squares = Squares::default();
        squares.add(&self.state);
        squares.are_coarse(period)
    }

    /// How far from the ends of a stretch of this length (s) the motion is followed, s.
    pub(crate) fn ends(&self, length: f64) -> f64 {
        (ENDS / (std::f64::consts::TAU * self.cutoff)).min(MOST_OF_ENDS * length)
    }

    /// The trajectory of a joint over stretches of samples, one after the other.
    pub(crate) fn of(stretches: &[Stretch], period: f64) -> Self {
        let fast = fastest(stretches, period);
        let channels = Channels::of(stretches, period, fast);
        let first = SLOW * fast;
        let (mut state, mut regained, mut speed) = (Vec::new(), Vec::new(), Vec::new());
        let mut smoother = Smoother::new(channels, fast);
        let (mut kinks, mut jumps, mut squares) = (Vec::new(), Vec::new(), Squares::default());
        // How far the channels are from each stretch without kinks, and as it is.
        let mut misfits: Vec<[f64; 2]> = Vec::new();
        for stretch in stretches {
            // Where the joint turns is told better once it is smooth.
            let smooth = smoother.once(stretch, &[]);
            let without = smoother.misfit(stretch, &smooth);
            let about = kinks_about(&smooth, &turns(&smooth, first), FIRST_SLOW * fast);
            // Without a turn it is smooth as it is.
            let smooth = match about.is_empty() {
                true => smooth,
                false => smoother.once(stretch, &about),
            };
            let about = kinks_about(&smooth, &turns(&smooth, first), SLOW_ABOUT * fast);
            let jump = |kink: &Kink| kink.jump(stretch.t, &smooth);
            jumps.extend(about.iter().filter_map(jump));
            squares.add(&smooth);
            misfits.push([without, smoother.misfit(stretch, &smooth)]);
            kinks.push(about);
        }
        // Between samples that are close friction makes little of a velocity, and a velocity that a jump between them may move takes more noise.
        let coarse = squares.are_coarse(period);
        if coarse {
            smoother.jumps_between_samples();
        }
        for _ in 0..MOST_ROUNDS {
            if !smoother.jumps_shrink(&jumps) {
                break;
            }
            jumps.clear();
            let turning = stretches.iter().zip(&kinks).zip(&mut misfits);
            for ((stretch, kinks), misfit) in turning.filter(|((_, kinks), _)| !kinks.is_empty()) {
                let smooth = smoother.once(stretch, kinks);
                misfit[1] = smoother.misfit(stretch, &smooth);
                let jump = |kink: &Kink| kink.jump(stretch.t, &smooth);
                jumps.extend(kinks.iter().filter_map(jump));
            }
        }
        // A motion that the channels know better without kinks has none.
        let [without, with] = [0, 1].map(|n| misfits.iter().map(|misfit| misfit[n]).sum::<f64>());
        if with > MUCH_MORE * without {
            smoother.jumps_nowhere();
        }
        for (stretch, kinks) in stretches.iter().zip(&kinks) {
            let (smooth, more) = smoother.twice(stretch, kinks);
            state.extend(smooth);
            regained.extend(more);
        }
        // Near standstill the encoder tells the velocity, whatever the times of samples jitter.
        let slope_noise = channels.standing * std::f64::consts::TAU * channels.cutoff;
        let speed_noise = (SURE * slope_noise).max(first).max(f64::MIN_POSITIVE);
        let mut begin = 0;
        for stretch in stretches {
            let own = &state[begin..begin + stretch.t.len()];
            speed.extend(speed::near_standstill(stretch.t, own, speed_noise, coarse));
            begin += stretch.t.len();
        }
        Self {
            state,
            regained,
            speed,
            speed_noise,
            rest: (2.0 * speed_noise).max(RESTING * fast),
            noise: channels.noise(),
            cutoff: channels.cutoff,
        }
    }
}

/// The speed that a joint exceeds in a twentieth of the time, rad/s, by its positions a period and a half or more apart: the times of
/// samples jitter.
fn fastest(stretches: &[Stretch], period: f64) -> f64 {
    let mut speeds: Vec<f64> = Vec::new();
    for s in stretches {
        let mut first = 0;
        for k in 1..s.t.len() {
            while s.t[k] - s.t[first + 1] >= 1.5 * period {
                first += 1;
            }
            let time = s.t[k] - s.t[first];
            if time >= 1.5 * period {
                speeds.push(((s.q[k] - s.q[first]) / time).abs());
            }
        }
    }
    if speeds.is_empty() {
        return 0.0;
    }
    let at = speeds.len() - 1 - speeds.len() / 20;
    *speeds.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    pub(super) fn sine(t: f64) -> [f64; 3] {
        let w = 8.0;
        [(w * t).sin(), w * (w * t).cos(), -w * w * (w * t).sin()]
    }

    /// A sine keeps its value and derivatives, whichever channel is the better one.
    #[test]
    fn either_channel_tells_the_motion() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let t: Vec<f64> = (0..2000).map(|k| 0.002 * f64::from(k)).collect();
        for (position, velocity, gain) in [(1e-5, 0.05, 1.0), (1e-3, 1e-3, 1.0), (1e-5, 0.0, 1.09)]
        {
            let q: Vec<f64> = t
                .iter()
                .map(|&t| sine(t)[0] + position * normal())
                .collect();
            let dq: Vec<f64> = (t.iter())
                .map(|&t| gain * sine(t)[1] + velocity * normal())
                .collect();
            let stretch = Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            };
            let found = Trajectory::of(&[stretch], 0.002);
            let error = |n: usize| -> f64 {
                let sum: f64 = (50..1950)
                    .map(|k| (found.state[k][n] - sine(t[k])[n]).powi(2))
                    .sum();
                (sum / 1900.0).sqrt()
            };
            let (speed, acceleration) = (error(1), error(2));
            assert!(
                speed < 0.02 && acceleration < 1.0,
                "{speed} {acceleration}: {position} {velocity} {gain}"
            );
        }
    }

    /// A leg's fast motion without dry friction, whose turns may follow one another within 30 ms: its velocity is known to 0.02 rad/s of 2.
    #[test]
    fn a_fast_turn_is_no_kink() {
        const TONES: [f64; 6] = [0.1, 0.4, 1.3, 2.8, 4.9, 7.6];
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let phases: Vec<f64> = TONES.iter().map(|_| 3.0 * normal()).collect();
        let truth = |t: f64| {
            let tone = |(f, phase): (&f64, &f64)| {
                let w = std::f64::consts::TAU * f;
                let (size, angle) = (0.7 * w.powf(-0.8), w * t + phase);
                [size * angle.sin(), size * w * angle.cos()]
            };
            let tones = TONES.iter().zip(&phases).map(tone);
            tones.fold([0.0; 2], |sum, own| [0, 1].map(|n| sum[n] + own[n]))
        };
        for rate in [250.0, 333.0, 500.0] {
            let t: Vec<f64> = (0..20 * rate as usize).map(|k| k as f64 / rate).collect();
            let mut measured = |n: usize, noise: f64| -> Vec<f64> {
                t.iter().map(|&t| truth(t)[n] + noise * normal()).collect()
            };
            let (q, dq) = (measured(0, 2e-5), measured(1, 0.003));
            let stretch = Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            };
            let found = Trajectory::of(&[stretch], 1.0 / rate);
            let ends = found.ends(20.0);
            let off = (0..t.len())
                .filter(|&k| t[k] >= ends && t[k] <= 20.0 - ends)
                .map(|k| (found.state[k][1] - truth(t[k])[1]).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < 0.02, "{off} rad/s at {rate} Hz");
        }
    }

    /// A velocity that is made of noisy positions over six rows is not looked at, and one with a noise of its own is; noise about a turn is no jump of
    /// the acceleration, whose greatest is 64 rad/s².
    #[test]
    fn a_velocity_made_of_the_positions_says_nothing_of_its_own() {
        const OVER: usize = 3;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let t: Vec<f64> = (0..10_000).map(|k| 0.002 * f64::from(k)).collect();
        let q: Vec<f64> = (t.iter()).map(|&t| sine(t)[0] + 1e-4 * normal()).collect();
        let of_positions: Vec<f64> = (0..t.len())
            .map(|k| {
                let (before, after) = (k.saturating_sub(OVER), (k + OVER).min(t.len() - 1));
                (q[after] - q[before]) / (t[after] - t[before])
            })
            .collect();
        let own: Vec<f64> = t.iter().map(|&t| sine(t)[1] + 0.02 * normal()).collect();
        for (dq, alone) in [(&of_positions, true), (&own, false)] {
            let stretch = Stretch { t: &t, q: &q, dq };
            let found = Trajectory::of(&[stretch], 0.002);
            assert_eq!(found.noise[1].is_infinite(), alone);
            let off = (100..9900).map(|k| (found.state[k][2] - sine(t[k])[2]).powi(2));
            let off = (off.sum::<f64>() / 9800.0).sqrt();
            assert!(off < 0.3, "{off} rad/s²: {alone}");
        }
    }

    /// A motion of 12 Hz that lies 24 dB above the position's noise there is followed at any sampling rate, with as much noise in a band of 1 Hz: at
    /// kilohertz that noise makes more of a slope at frequencies which nothing moves at.
    #[test]
    fn a_high_sampling_rate_hides_no_motion() {
        const SIZE: f64 = 5e-5;
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (slow, fast) = (std::f64::consts::TAU, std::f64::consts::TAU * 12.0);
        let truth = |t: f64| {
            let ([a, b], [c, d]) = ((slow * t).sin_cos().into(), (fast * t).sin_cos().into());
            [
                0.5 * a + SIZE * c,
                0.5 * slow * b + SIZE * fast * d,
                -0.5 * slow * slow * a - SIZE * fast * fast * c,
            ]
        };
        for rate in [250.0, 500.0, 1000.0, 2000.0, 5000.0] {
            let noise = f64::sqrt(rate / 250.0);
            let t: Vec<f64> = (0..20 * rate as usize).map(|k| k as f64 / rate).collect();
            let mut measured = |n: usize, noise: f64| -> Vec<f64> {
                t.iter().map(|&t| truth(t)[n] + noise * normal()).collect()
            };
            let (q, dq) = (measured(0, 2e-5 * noise), measured(1, 0.1 * noise));
            let stretch = Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            };
            let found = Trajectory::of(&[stretch], 1.0 / rate);
            let inner = t.len() / 10..t.len() * 9 / 10;
            let squares: f64 = (inner.clone())
                .map(|k| (found.state[k][2] - truth(t[k])[2]).powi(2))
                .sum();
            // The acceleration of 12 Hz is 0.2 rad/s² rms.
            let off = (squares / inner.len() as f64).sqrt();
            assert!(off < 0.15, "{off} rad/s² at {rate} Hz");
        }
    }

    /// A drive of 9 Hz against dry friction, eleven samples a period: the velocity's kinks lie anywhere between two samples. A jump at a sample
    /// instead leaves 0.14 rad/s, and a turn that a straight line tells leaves more than half a sample of each sample's direction; as it is, 0.02 rad/s
    /// and a tenth.
    #[test]
    fn a_kink_between_two_samples_is_there() {
        const FRICTION: f64 = 25.0;
        const PERIOD: f64 = 0.01;
        const PARTS: usize = 1000;
        const INNER: std::ops::Range<usize> = 50..550;
        let w = std::f64::consts::TAU * 9.0;
        let h = PERIOD / PARTS as f64;
        let (mut q, mut v, mut direction) = (0.0, 0.0f64, 0.0);
        let (mut t, mut truth, mut directions) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..600 * PARTS {
            let now = k as f64 * h;
            if k % PARTS == 0 {
                t.push(now);
                truth.push([q, v]);
            }
            // What belongs to a sample ends half a period after it.
            if k % PARTS == PARTS / 2 {
                directions.push(direction);
            }
            let free = v + h * 600.0 * (w * now).cos();
            let slowed = (free.abs() - h * FRICTION).max(0.0);
            let next = slowed * free.signum();
            q += 0.5 * h * (v + next);
            direction += h * next.signum();
            v = next;
        }
        let [positions, velocities] =
            [0, 1].map(|n| truth.iter().map(|x: &[f64; 2]| x[n]).collect::<Vec<_>>());
        let stretch = Stretch {
            t: &t,
            q: &positions,
            dq: &velocities,
        };
        let found = Trajectory::of(&[stretch], PERIOD);
        let rms = |off: &dyn Fn(usize) -> f64| {
            let squares: f64 = INNER.map(|k| off(k).powi(2)).sum();
            (squares / INNER.len() as f64).sqrt()
        };
        let velocity = rms(&|k| found.state[k][1] - truth[k][1]);
        let way = |k: usize| (found.speed[k] / found.speed_noise).clamp(-1.0, 1.0);
        let direction = rms(&|k| PERIOD * way(k) - (directions[k] - directions[k - 1]));
        assert!(velocity < 0.05, "{velocity} rad/s");
        assert!(direction < 0.2 * PERIOD, "{direction} s");
    }

    /// By the motion, not by the rate: 9 Hz at 100 and 250 Hz, 1 Hz at 100 Hz.
    #[test]
    fn samples_are_far_apart_for_a_fast_motion() {
        for (frequency, rate, coarse) in [
            (9.0, 100.0, true),
            (9.0, 250.0, true),
            (9.0, 500.0, false),
            (1.0, 100.0, false),
        ] {
            let w = std::f64::consts::TAU * frequency;
            let state = |k: u32| {
                let angle = w * f64::from(k) / rate;
                [angle.sin(), w * angle.cos(), -w * w * angle.sin(), 0.0]
            };
            let mut squares = Squares::default();
            squares.add(&(0..1000).map(state).collect::<Vec<_>>());
            assert_eq!(
                squares.are_coarse(1.0 / rate),
                coarse,
                "{frequency} Hz at {rate} Hz"
            );
        }
    }

    /// A joint that friction holds for half of the time reports one number meanwhile, and rounded ones when it is let go: they are no
    /// surer for that.
    #[test]
    fn a_joint_that_is_held_and_let_go_does_not_leap() {
        const STEP: f64 = 3e-5;
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (held, swing, size) = (0.5, 0.5, 0.3);
        let w = std::f64::consts::TAU / swing;
        // To and fro: held, then a swing that begins and ends at rest.
        let motion = |t: f64| {
            let (turn, since) = ((t / (held + swing)).floor(), t.rem_euclid(held + swing));
            let (way, s) = (1.0 - 2.0 * turn.rem_euclid(2.0), (since - held).max(0.0));
            let from = if way > 0.0 { 0.0 } else { size };
            let moved = size * (s / swing - (w * s).sin() / (w * swing));
            let speed = size / swing * (1.0 - (w * s).cos());
            [from + way * moved, way * speed]
        };
        let t: Vec<f64> = (0..10_000).map(|k| 0.001 * f64::from(k)).collect();
        let q: Vec<f64> = t
            .iter()
            .map(|&t| (motion(t)[0] / STEP).round() * STEP)
            .collect();
        let dq: Vec<f64> = t.iter().map(|&t| motion(t)[1] + 0.04 * normal()).collect();
        let found = Trajectory::of(
            &[Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            }],
            0.001,
        );
        // Momentum is made of the speed. The motion's greatest is 1.2 rad/s.
        let off = (50..9950).map(|k| (found.state[k][1] - motion(t[k])[1]).abs());
        let speed = off.fold(0.0, f64::max);
        assert!(speed < 0.06, "{speed} rad/s");
    }
}

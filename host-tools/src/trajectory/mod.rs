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
//! is motion.
//!
//! Dry friction kinks the velocity where a joint turns round, and where it lets one go that it has held: there the acceleration may
//! jump.
//!
//! Files beside:
//!
//! - `before`: a trajectory as it was some time before: where torque is reported late, it belongs to an earlier motion
//! - `speed`: when a joint changes its direction, to a fraction of a sample: there dry friction jumps

mod before;
mod channels;
mod speed;

pub(crate) use before::Before;
use before::moved;
use channels::Channels;

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

/// A joint's trajectory over a recording.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trajectory {
    /// Position, velocity, acceleration and jerk at each sample: rad (or m), rad/s …
    pub(crate) state: Vec<[f64; 4]>,
    /// What smoothing what was left of the channels gave the velocity back at each sample, rad/s: as far off as the velocity may still be where the joint
    /// moves faster than its channels' noise lets one follow.
    pub(crate) regained: Vec<f64>,
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

/// Share of the acceleration by which the trapezoid rule may be wrong before that is put right (`equation/quadrature.rs`): a thousandth of the
/// inertial torque is never told, and the correction takes three instants where there was one.
const MOST_WRONG: f64 = 2e-3;

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
    /// Whether samples, a period (s) apart, are too far apart for the joint's acceleration: the trapezoid rule is wrong by (ω h)²/12 of it,
    /// with ω the acceleration's root mean square over the velocity's.
    pub(crate) fn is_coarse(&self, period: f64) -> bool {
        let mut squares = Squares::default();
        squares.add(&self.state);
        squares.are_coarse(period)
    }

    /// The trajectory of a joint over stretches of samples, one after the other.
    pub(crate) fn of(stretches: &[Stretch], period: f64) -> Self {
        let fast = fastest(stretches, period);
        let channels = Channels::of(stretches, period, fast);
        let first = SLOW * fast;
        let (mut state, mut regained, mut speed) = (Vec::new(), Vec::new(), Vec::new());
        let mut smoother = Smoother::new(channels, fast);
        let (mut kinks, mut jumps, mut squares) = (Vec::new(), Vec::new(), Squares::default());
        for stretch in stretches {
            // Where the joint turns is told better once it is smooth.
            let smooth = smoother.once(stretch, &[]);
            let about = kinks_about(&smooth, &turns(&smooth, first), FIRST_SLOW * fast);
            let smooth = smoother.once(stretch, &about);
            let about = kinks_about(&smooth, &turns(&smooth, first), SLOW_ABOUT * fast);
            let jump = |kink: &Kink| kink.jump(stretch.t, &smooth);
            jumps.extend(about.iter().filter_map(jump));
            squares.add(&smooth);
            kinks.push(about);
        }
        // Between samples that are close friction makes little of a velocity, and a velocity that it may jump by takes more noise.
        // At 500 Hz: simulated legs with dry friction are left with a fifth less, real chirps with 1 % and an arm with an elastic gear with a
        // quarter more.
        let coarse = squares.are_coarse(period);
        if coarse {
            smoother.jumps_between_samples(&jumps);
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

/// The samples after which a joint turns round: its velocity changes sign, and was surely of one before and of the other after.
fn turns(smooth: &[[f64; 4]], sure: f64) -> Vec<usize> {
    let mut turns = Vec::new();
    let (mut direction, mut crossing) = (0.0, 0);
    for (k, state) in smooth.iter().enumerate() {
        let v = state[1];
        if k > 0 && v * smooth[k - 1][1] <= 0.0 {
            crossing = k - 1;
        }
        if v.abs() > sure {
            if v.signum() * direction < 0.0 {
                turns.push(crossing);
            }
            direction = v.signum();
        }
    }
    turns
}

/// A moment at which a joint's acceleration may jump.
struct Kink {
    /// The sample before it.
    after: usize,
    /// Of the time to the next sample how much is left then.
    left: f64,
    /// Whether the joint turns round there.
    turns: bool,
}

impl Kink {
    /// By how much the acceleration jumps where the joint turns round, rad/s²: as the motion after it came, less as the motion before goes on.
    fn jump(&self, t: &[f64], smooth: &[[f64; 4]]) -> Option<f64> {
        let next = self.after + 1;
        let until = self.left * (t.get(next)? - t[self.after]);
        let since = t[next] - t[self.after] - until;
        let [_, _, before, slope_before] = smooth[self.after];
        let [_, _, after, slope_after] = smooth[next];
        let jump = (after - slope_after * until) - (before + slope_before * since);
        self.turns.then_some(jump)
    }
}

/// The moments about turns at which a joint is no faster than `slow`: friction may stop it at any of them. Where it turns round its velocity
/// says when that is; at the others nothing does, and the middle between two samples is off by the least.
fn kinks_about(smooth: &[[f64; 4]], turns: &[usize], slow: f64) -> Vec<Kink> {
    let is_slow = |state: &&[f64; 4]| state[1].abs() <= slow;
    let kink = |after: usize| {
        let [from, to] = [after, after + 1].map(|k| smooth.get(k).map_or(0.0, |state| state[1]));
        let turns = from * to < 0.0;
        let left = if turns { to / (to - from) } else { 0.5 };
        Kink { after, left, turns }
    };
    let mut all: Vec<Kink> = Vec::new();
    for &turn in turns {
        let before = smooth[..turn].iter().rev().take_while(is_slow).count();
        let after = smooth[turn + 1..].iter().take_while(is_slow).count();
        let known = all.last().map_or(0, |last| last.after + 1);
        all.extend(((turn - before).max(known)..=turn + after).map(kink));
    }
    all
}

/// The smoother of one joint. Its clock runs in units of 1/ω_c, so that all its numbers are of the order of one.
struct Smoother {
    channels: Channels,
    /// Length of a unit of time, s.
    unit: f64,
    /// Variance of a velocity, (rad per unit)².
    velocity_noise: f64,
    /// Intensity of the snap's white noise.
    intensity: f64,
    /// Variance of the acceleration, and of the velocity, before the first sample: what they are at the joint's greatest speeds.
    start: f64,
    /// Variance that a kink adds to the acceleration.
    jump: f64,
    /// Whether it does so between two samples, else at the later one.
    between: bool,
    /// The samples of the stretch, filtered: room for one stretch after the other.
    passed: Vec<Filtered>,
}

/// Position, velocity, acceleration and jerk, or what is dual to them.
type State = [f64; 4];

/// A filtered sample, as the way back needs it.
struct Filtered {
    state: State,
    covariance: Covariance,
    /// Of its position and of its velocity: the gain, the innovation's variance, and the innovation over that.
    channels: [Innovation; 2],
}

#[derive(Clone, Copy, Default)]
struct Innovation {
    gain: State,
    variance: f64,
    scaled: f64,
}

impl Smoother {
    fn new(channels: Channels, fast: f64) -> Self {
        let omega = std::f64::consts::TAU * channels.cutoff;
        let unit = 1.0 / omega;
        let velocity_noise = (channels.velocity * unit).powi(2);
        // White noise of both channels together per unit of time at ω_c, where a velocity is as large as its position; the
        // motion's density is as large there.
        let density = channels.period / unit / (channels.position.powi(-2) + 1.0 / velocity_noise);
        Self {
            start: (fast * unit).powi(2).max(velocity_noise),
            // It may jump by as much as it is at the joint's greatest speeds.
            jump: (fast * unit).powi(2),
            between: false,
            intensity: density,
            channels,
            unit,
            velocity_noise,
            passed: Vec::new(),
        }
    }

    /// Lets the acceleration jump where a kink is between two samples instead of at the later one, and by as much as it does where the joint turns
    /// round, rad/s²: by more the velocity would take noise for a jump.
    fn jumps_between_samples(&mut self, jumps: &[f64]) {
        self.between = true;
        if !jumps.is_empty() {
            let squares: f64 = jumps.iter().map(|jump| jump * jump).sum();
            self.jump = squares / jumps.len() as f64 * self.unit.powi(4);
        }
    }

    /// Position, velocity, acceleration and jerk at each sample of a stretch; the acceleration may jump at the `kinks`.
    fn once(&mut self, s: &Stretch, kinks: &[Kink]) -> Vec<[f64; 4]> {
        self.run(s, kinks);
        self.back(s)
    }

    /// The same with what is left of the channels smoothed again, by the same gains: they are of the times, of the kinks and of how
    /// surely positions are known. And what that adds to the velocity, rad/s.
    fn twice(&mut self, s: &Stretch, kinks: &[Kink]) -> (Vec<[f64; 4]>, Vec<f64>) {
        self.run(s, kinks);
        let mut smooth = self.back(s);
        let left = |x: &[f64], n: usize| -> Vec<f64> {
            (x.iter().zip(&smooth))
                .map(|(x, smooth)| x - smooth[n])
                .collect()
        };
        let (q, dq) = (left(s.q, 0), left(s.dq, 1));
        let rest = Stretch {
            t: s.t,
            q: &q,
            dq: &dq,
        };
        let mut state = self.first(&rest);
        for k in 0..self.passed.len() {
            if k > 0 {
                state = moved(&state, self.step(&rest, k));
                state = self.corrected(&rest, k, state);
            }
            self.passed[k].state = state;
        }
        let more = self.back(&rest);
        for (state, more) in smooth.iter_mut().zip(&more) {
            state.iter_mut().zip(more).for_each(|(x, more)| *x += more);
        }
        (smooth, more.iter().map(|more| more[1]).collect())
    }

    /// The way forth: each sample by all that came before it; the acceleration may jump at the `kinks`.
    fn run(&mut self, s: &Stretch, kinks: &[Kink]) {
        let mut covariance = Covariance::diagonal(self.start);
        let mut state = self.first(s);
        let mut kinks = kinks.iter().peekable();
        self.passed.clear();
        self.passed.reserve(s.t.len());
        for k in 0..s.t.len() {
            let mut channels = [Innovation::default(); 2];
            if k > 0 {
                // The noisy velocity tells well enough how fast the joint is.
                let speed = state[1] / self.unit;
                let position =
                    self.channels.standing.powi(2) + (self.channels.timing * speed).powi(2);
                let step = self.step(s, k);
                state = moved(&state, step);
                covariance = covariance.moved_on(step, self.intensity);
                if let Some(kink) = kinks.next_if(|kink| kink.after < k) {
                    let left = if self.between { kink.left } else { 0.0 };
                    covariance.jump(self.jump, left * step);
                }
                for (n, noise) in [position, self.velocity_noise].into_iter().enumerate() {
                    (channels[n].gain, channels[n].variance) = covariance.observed(n, noise);
                }
            }
            self.passed.push(Filtered {
                state,
                covariance,
                channels,
            });
            if k > 0 {
                state = self.corrected(s, k, state);
                self.passed[k].state = state;
            }
        }
    }

    /// Time since the sample before, in units.
    fn step(&self, s: &Stretch, k: usize) -> f64 {
        (s.t[k] - s.t[k - 1]) / self.unit
    }

    /// The first sample: positions count from it.
    fn first(&self, s: &Stretch) -> State {
        [0.0, s.dq[0] * self.unit, 0.0, 0.0]
    }

    /// The state that was predicted for sample k with what its own channels say.
    fn corrected(&mut self, s: &Stretch, k: usize, mut state: State) -> State {
        let measured = [s.q[k] - s.q[0], s.dq[k] * self.unit];
        for (n, (own, measured)) in (self.passed[k].channels.iter_mut().zip(measured)).enumerate() {
            let innovation = measured - state[n];
            own.scaled = innovation / own.variance;
            (0..4).for_each(|i| state[i] += own.gain[i] * innovation);
        }
        state
    }

    /// The way back: each sample by all that came after it, by the recursion of the adjoint (Bierman 1973, *Automatica* 9, "Fixed interval
    /// smoothing with discrete measurements", after Bryson and Frazier), which inverts no covariance.
    fn back(&self, s: &Stretch) -> Vec<[f64; 4]> {
        let mut smooth = vec![[0.0; 4]; self.passed.len()];
        let rate = 1.0 / self.unit;
        let scale = [1.0, rate, rate * rate, rate * rate * rate];
        let mut adjoint = [0.0; 4];
        for (k, own) in self.passed.iter().enumerate().rev() {
            let known = own.covariance.times(&adjoint);
            smooth[k] = std::array::from_fn(|n| (own.state[n] - known[n]) * scale[n]);
            smooth[k][0] += s.q[0];
            if k == 0 {
                break;
            }
            for (n, channel) in own.channels.iter().enumerate().rev() {
                let through: f64 = (channel.gain.iter().zip(&adjoint))
                    .map(|(g, a)| g * a)
                    .sum();
                adjoint[n] -= through + channel.scaled;
            }
            // The transpose of what moves the state on.
            adjoint.reverse();
            adjoint = moved(&adjoint, self.step(s, k));
            adjoint.reverse();
        }
        smooth
    }
}

/// The covariance of a state: symmetric, so that the entries on and above the diagonal are all that is kept up.
#[derive(Clone, Copy)]
struct Covariance([State; 4]);

impl Covariance {
    fn diagonal(variance: f64) -> Self {
        let entry = |i, j| if i == j { variance } else { 0.0 };
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| entry(i, j))
        }))
    }

    /// After a time h without a measurement: F P Fᵀ + Q with F the motion of constant jerk and Q what white snap of this intensity adds,
    /// ∫ g gᵀ dt with g the motion after a unit of jerk.
    fn moved_on(&self, h: f64, intensity: f64) -> Self {
        let columns: [State; 4] = std::array::from_fn(|j| moved(&self.column(j), h));
        let row = |i: usize| moved(&columns.map(|column| column[i]), h);
        let mut next: [State; 4] = std::array::from_fn(row);
        let (q, h2) = (intensity * h, h * h);
        let (h3, h4) = (h * h2, h2 * h2);
        let noise = [
            [h2 * h4 / 252.0, h * h4 / 72.0, h4 / 30.0, h3 / 24.0],
            [0.0, h4 / 20.0, h3 / 8.0, h2 / 6.0],
            [0.0, 0.0, h2 / 3.0, h / 2.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        for (row, noise) in next.iter_mut().zip(noise) {
            row.iter_mut().zip(noise).for_each(|(x, n)| *x += q * n);
        }
        Self(next)
    }

    /// After the acceleration has jumped, with this variance, a time h ago.
    fn jump(&mut self, variance: f64, h: f64) {
        let moved = [0.5 * h * h, h, 1.0];
        for i in 0..3 {
            for j in i..3 {
                self.0[i][j] += variance * moved[i] * moved[j];
            }
        }
    }

    /// Takes in a measurement of entry n with this noise; its gain, and the variance of its innovation.
    fn observed(&mut self, n: usize, noise: f64) -> (State, f64) {
        let column = self.column(n);
        let variance = column[n] + noise;
        let gain = column.map(|c| c / variance);
        for i in 0..4 {
            for j in i..4 {
                self.0[i][j] -= gain[i] * column[j];
            }
        }
        (gain, variance)
    }

    fn times(&self, x: &State) -> State {
        std::array::from_fn(|i| self.column(i).iter().zip(x).map(|(p, x)| p * x).sum())
    }

    /// A column, or a row.
    fn column(&self, n: usize) -> State {
        std::array::from_fn(|i| self.0[i.min(n)][i.max(n)])
    }
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

    /// A drive of 9 Hz against dry friction, eleven samples a period: the velocity's kinks lie anywhere between two samples. A jump at a sample
    /// instead would be off by what friction makes of the velocity in the time between, 0.25 rad/s on average.
    #[test]
    fn a_kink_between_two_samples_is_there() {
        const FRICTION: f64 = 25.0;
        const PERIOD: f64 = 0.01;
        const PARTS: usize = 1000;
        let w = std::f64::consts::TAU * 9.0;
        let (mut q, mut v) = (0.0, 0.0);
        let (mut t, mut truth): (Vec<f64>, Vec<[f64; 2]>) = (Vec::new(), Vec::new());
        for k in 0..600 * PARTS {
            let now = k as f64 * PERIOD / PARTS as f64;
            if k % PARTS == 0 {
                t.push(now);
                truth.push([q, v]);
            }
            let h = PERIOD / PARTS as f64;
            let free = v + h * 600.0 * (w * now).cos();
            let slowed = free.abs() - h * FRICTION;
            let next = if slowed > 0.0 {
                slowed * free.signum()
            } else {
                0.0
            };
            q += 0.5 * h * (v + next);
            v = next;
        }
        let [positions, velocities] =
            [0, 1].map(|n| truth.iter().map(|x| x[n]).collect::<Vec<_>>());
        let stretch = Stretch {
            t: &t,
            q: &positions,
            dq: &velocities,
        };
        let found = Trajectory::of(&[stretch], PERIOD);
        let off = (50..550).map(|k| (found.state[k][1] - truth[k][1]).powi(2));
        let off = (off.sum::<f64>() / 500.0).sqrt();
        assert!(off < 0.05, "{off} rad/s");
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

//! The smoother of one joint: forth through the samples, and back.

use super::Stretch;
use super::before::moved;
use super::channels::Channels;
use super::kinks::Kink;

/// The smoother of one joint. Its clock runs in units of 1/ω_c, so that all its numbers are of the order of one.
pub(super) struct Smoother {
    channels: Channels,
    /// Length of a unit of time, s, and one over that.
    unit: f64,
    rate: f64,
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

/// Less than this share of a variance is clearly less: a size that has shrunk by less than a third is as good as found.
const CLEARLY: f64 = 0.5;

/// Position, velocity, acceleration and jerk, or what is dual to them.
type State = [f64; 4];

/// A filtered sample, as the way back needs it.
struct Filtered {
    state: State,
    covariance: Covariance,
    /// Of its position and of its velocity: the gain, how sure the innovation is, and the innovation over its variance.
    channels: [Innovation; 2],
}

#[derive(Clone, Copy, Default)]
struct Innovation {
    gain: State,
    /// One over the innovation's variance.
    certainty: f64,
    scaled: f64,
}

impl Smoother {
    pub(super) fn new(channels: Channels, fast: f64) -> Self {
        let omega = std::f64::consts::TAU * channels.cutoff;
        let unit = 1.0 / omega;
        let velocity_noise = if channels.positions_alone {
            f64::INFINITY
        } else {
            (channels.velocity * unit).powi(2)
        };
        // White noise of both channels together per unit of time at ω_c, where a velocity is as large as its position; the
        // motion's density is as large there.
        let density = channels.period / unit / (channels.position.powi(-2) + 1.0 / velocity_noise);
        Self {
            start: (fast * unit)
                .powi(2)
                .max((channels.velocity * unit).powi(2)),
            // It may jump by as much as it is at the joint's greatest speeds.
            jump: (fast * unit).powi(2),
            between: false,
            intensity: density,
            channels,
            unit,
            rate: omega,
            velocity_noise,
            passed: Vec::new(),
        }
    }

    /// Lets the acceleration jump where a kink is between two samples instead of at the later one.
    pub(super) fn jumps_between_samples(&mut self) {
        self.between = true;
    }

    /// Lets the acceleration jump by as much as it is found to where the joint turns round, rad/s²; whether that is clearly less than it might before.
    pub(super) fn jumps_shrink(&mut self, jumps: &[f64]) -> bool {
        if jumps.is_empty() {
            return false;
        }
        let squares: f64 = jumps.iter().map(|jump| jump * jump).sum();
        let found = squares / jumps.len() as f64 * self.unit.powi(4);
        let shrinks = found < CLEARLY * self.jump;
        self.jump = found;
        shrinks
    }

    /// Lets the acceleration jump nowhere.
    pub(super) fn jumps_nowhere(&mut self) {
        self.jump = 0.0;
    }

    /// How far the channels of a stretch are from a `smooth` motion: the sum of squares of what is left, in units of each channel's noise.
    pub(super) fn misfit(&self, s: &Stretch, smooth: &[[f64; 4]]) -> f64 {
        let at = |(k, [q, dq, ..]): (usize, &[f64; 4])| {
            let velocity = (s.dq[k] - dq) * self.unit;
            (s.q[k] - q).powi(2) / self.position_noise(*dq) + velocity.powi(2) / self.velocity_noise
        };
        smooth.iter().enumerate().map(at).sum()
    }

    /// Variance of a position at this speed, rad/s.
    fn position_noise(&self, speed: f64) -> f64 {
        self.channels.standing.powi(2) + (self.channels.timing * speed).powi(2)
    }

    /// Position, velocity, acceleration and jerk at each sample of a stretch; the acceleration may jump at the `kinks`.
    pub(super) fn once(&mut self, s: &Stretch, kinks: &[Kink]) -> Vec<[f64; 4]> {
        self.run(s, kinks);
        self.back(s)
    }

    /// The same with what is left of the channels smoothed again, by the same gains: they are of the times, of the kinks and of how
    /// surely positions are known. And what that adds to the velocity, rad/s.
    pub(super) fn twice(&mut self, s: &Stretch, kinks: &[Kink]) -> (Vec<[f64; 4]>, Vec<f64>) {
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
        let mut passed = std::mem::take(&mut self.passed);
        for (k, own) in passed.iter_mut().enumerate() {
            if k > 0 {
                state = moved(&state, self.step(&rest, k));
            }
            state = self.corrected(&rest, k, state, &mut own.channels);
            own.state = state;
        }
        self.passed = passed;
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
            // The noisy velocity tells well enough how fast the joint is.
            let position = self.position_noise(state[1] * self.rate);
            if k > 0 {
                let step = self.step(s, k);
                state = moved(&state, step);
                covariance = covariance.moved_on(step, self.intensity);
                if let Some(kink) = kinks.next_if(|kink| kink.after < k) {
                    let left = if self.between { kink.left } else { 0.0 };
                    covariance.jump(self.jump, left * step);
                }
            }
            for (n, noise) in [position, self.velocity_noise].into_iter().enumerate() {
                let (gain, certainty) = covariance.observed(n == 0, noise);
                channels[n] = Innovation {
                    gain,
                    certainty,
                    scaled: 0.0,
                };
            }
            state = self.corrected(s, k, state, &mut channels);
            self.passed.push(Filtered {
                state,
                covariance,
                channels,
            });
        }
    }

    /// Time since the sample before, in units.
    #[inline]
    fn step(&self, s: &Stretch, k: usize) -> f64 {
        (s.t[k] - s.t[k - 1]) * self.rate
    }

    /// The first sample: positions count from it.
    fn first(&self, s: &Stretch) -> State {
        [0.0, s.dq[0] * self.unit, 0.0, 0.0]
    }

    /// The state that was predicted for sample k with what its own channels say.
    #[inline]
    fn corrected(
        &self,
        s: &Stretch,
        k: usize,
        mut state: State,
        channels: &mut [Innovation; 2],
    ) -> State {
        let measured = [s.q[k] - s.q[0], s.dq[k] * self.unit];
        for (n, (own, measured)) in (channels.iter_mut().zip(measured)).enumerate() {
            let innovation = measured - state[n];
            own.scaled = innovation * own.certainty;
            (0..4).for_each(|i| state[i] += own.gain[i] * innovation);
        }
        state
    }

    /// The way back: each sample by all that came after it, by the recursion of the adjoint (Bierman 1973, *Automatica* 9, "Fixed interval
    /// smoothing with discrete measurements", after Bryson and Frazier), which inverts no covariance.
    fn back(&self, s: &Stretch) -> Vec<[f64; 4]> {
        let mut smooth = vec![[0.0; 4]; self.passed.len()];
        let rate = self.rate;
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

/// The covariance of a state, position p, velocity v, acceleration a and jerk j: symmetric, so that the entries on and above the diagonal are all
/// that is kept up.
// Written out, and with divisions by constants only: a long log passes here several times for each sample of each joint.
#[derive(Clone, Copy)]
struct Covariance {
    pp: f64,
    pv: f64,
    pa: f64,
    pj: f64,
    vv: f64,
    va: f64,
    vj: f64,
    aa: f64,
    aj: f64,
    jj: f64,
}

impl Covariance {
    fn diagonal(variance: f64) -> Self {
        Self {
            pp: variance,
            pv: 0.0,
            pa: 0.0,
            pj: 0.0,
            vv: variance,
            va: 0.0,
            vj: 0.0,
            aa: variance,
            aj: 0.0,
            jj: variance,
        }
    }

    /// After a time h without a measurement: F P Fᵀ + Q with F the motion of constant jerk and Q what white snap of this intensity adds,
    /// ∫ g gᵀ dt with g the motion after a unit of jerk.
    #[inline]
    fn moved_on(&self, h: f64, intensity: f64) -> Self {
        let (f1, f2) = (h, h * h * (1.0 / 2.0));
        let f3 = f2 * h * (1.0 / 3.0);
        // F P on and above the diagonal.
        let jj = self.jj;
        let aj = self.aj + f1 * jj;
        let aa = self.aa + f1 * self.aj;
        let vj = self.vj + f1 * self.aj + f2 * jj;
        let va = self.va + f1 * self.aa + f2 * self.aj;
        let vv = self.vv + f1 * self.va + f2 * self.vj;
        let pj = self.pj + f1 * self.vj + f2 * self.aj + f3 * jj;
        let pa = self.pa + f1 * self.va + f2 * self.aa + f3 * self.aj;
        let pv = self.pv + f1 * self.vv + f2 * self.va + f3 * self.vj;
        let pp = self.pp + f1 * self.pv + f2 * self.pa + f3 * self.pj;
        let q = intensity * h;
        let (q1, q2) = (q * h, q * (h * h));
        let (q3, q4) = (q1 * (h * h), q2 * (h * h));
        let (q5, q6) = (q3 * (h * h), q4 * (h * h));
        Self {
            pp: pp + f1 * pv + f2 * pa + f3 * pj + q6 * (1.0 / 252.0),
            pv: pv + f1 * pa + f2 * pj + q5 * (1.0 / 72.0),
            pa: pa + f1 * pj + q4 * (1.0 / 30.0),
            pj: pj + q3 * (1.0 / 24.0),
            vv: vv + f1 * va + f2 * vj + q4 * (1.0 / 20.0),
            va: va + f1 * vj + q3 * (1.0 / 8.0),
            vj: vj + q2 * (1.0 / 6.0),
            aa: aa + f1 * aj + q2 * (1.0 / 3.0),
            aj: aj + q1 * (1.0 / 2.0),
            jj: jj + q,
        }
    }

    /// After the acceleration has jumped, with this variance, a time h ago.
    fn jump(&mut self, variance: f64, h: f64) {
        let p = 0.5 * h * h;
        self.pp += variance * p * p;
        self.pv += variance * p * h;
        self.pa += variance * p;
        self.vv += variance * h * h;
        self.va += variance * h;
        self.aa += variance;
    }

    /// Takes in a measurement of the position, or else of the velocity, with this noise; its gain, and one over the variance of its innovation.
    #[inline]
    fn observed(&mut self, is_position: bool, noise: f64) -> (State, f64) {
        let column = match is_position {
            true => [self.pp, self.pv, self.pa, self.pj],
            false => [self.pv, self.vv, self.va, self.vj],
        };
        let variance = if is_position { self.pp } else { self.vv } + noise;
        let certainty = 1.0 / variance;
        let gain = column.map(|c| c * certainty);
        self.pp -= gain[0] * column[0];
        self.pv -= gain[0] * column[1];
        self.pa -= gain[0] * column[2];
        self.pj -= gain[0] * column[3];
        self.vv -= gain[1] * column[1];
        self.va -= gain[1] * column[2];
        self.vj -= gain[1] * column[3];
        self.aa -= gain[2] * column[2];
        self.aj -= gain[2] * column[3];
        self.jj -= gain[3] * column[3];
        (gain, certainty)
    }

    #[inline]
    fn times(&self, &[p, v, a, j]: &State) -> State {
        [
            self.pp * p + self.pv * v + self.pa * a + self.pj * j,
            self.pv * p + self.vv * v + self.va * a + self.vj * j,
            self.pa * p + self.va * v + self.aa * a + self.aj * j,
            self.pj * p + self.vj * v + self.aj * a + self.jj * j,
        ]
    }
}

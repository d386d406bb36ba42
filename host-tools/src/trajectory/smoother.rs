//! The smoother of one joint: forth through the samples, and back.

use super::Stretch;
use super::before::moved;
use super::channels::Channels;
use super::kinks::Kink;

/// The smoother of one joint. Its clock runs in units of 1/ω_c, so that all its numbers are of the order of one.
pub(super) struct Smoother {
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

/// Less than this share of a variance is clearly less: a size that has shrunk by less than a third is as good as found.
const CLEARLY: f64 = 0.5;

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

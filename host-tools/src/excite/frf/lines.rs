//! Which lines are excited, and multisines of them.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// The carrier, Hz, about: slow beside the resonances, and fast enough for its speed to exceed the excitation's.
const CARRIER: f64 = 1.25;
/// Below this line, Hz, amplitudes fall in proportion, so that the velocity of low lines does not exceed the carrier's.
const CORNER: f64 = 10.0;

/// The carrier's cycles in a period of so many seconds: odd.
pub(super) fn carrier_cycles(period: f64) -> usize {
    2 * ((0.5 * (CARRIER * period - 1.0)).round().max(0.0) as usize) + 1
}

/// The excited lines of a band, Hz, faster than the carrier. Odd ones: even distortion does not fall on them. No multiples of the carrier, where its
/// friction's harmonics are. And no two that are 2 c apart: the carrier, of c cycles a period, c being odd, changes the robot's inertia with c and 2 c cycles,
/// and what it moves of an odd line by 2 c falls on an odd line that is silent, where it shows as distortion and disturbs nothing.
pub(super) fn chosen_lines(band: [f64; 2], period: f64) -> Vec<usize> {
    let cycles = carrier_cycles(period);
    // Of lines that are 2 c apart every second one, beginning with the first or the second in turn, so that the distances are about equal: 6 and 2 of
    // 5 cycles. Of 1 and 3 cycles every other odd line.
    let residues: Vec<usize> = (1..2 * cycles)
        .step_by(2)
        .filter(|r| cycles == 1 || *r != cycles)
        .collect();
    let is_chosen = |line: &usize| {
        let class = residues.iter().position(|r| *r == line % (2 * cycles));
        let begins = |class: usize| if cycles > 3 { class % 2 } else { 0 };
        class.is_some_and(|class| line / (2 * cycles) % 2 == begins(class))
    };
    let in_band = |line: &usize| *line as f64 / period >= band[0] && *line > cycles;
    (1..)
        .step_by(2)
        .take_while(|line| *line as f64 / period <= band[1])
        .filter(|line| in_band(line) && is_chosen(line))
        .collect()
}

/// Multisines of some joints: lines and amplitudes.
pub(super) struct Signals {
    lines: Vec<usize>,
    length: usize,
    /// By joint and line, N m.
    amplitudes: Vec<Vec<f64>>,
    rms: Vec<f64>,
}

impl Signals {
    /// Of joints with these rms, N m, and a period of `length` samples and `period` seconds.
    pub(super) fn new(lines: &[usize], length: usize, period: f64, rms: &[f64]) -> Self {
        let shape = |line: &usize| (*line as f64 / (CORNER * period)).min(1.0);
        let power: f64 = lines.iter().map(|line| shape(line).powi(2)).sum();
        let of = |rms: &f64| {
            let amplitude = rms * (2.0 / power.max(1e-12)).sqrt();
            lines.iter().map(|line| amplitude * shape(line)).collect()
        };
        Self {
            lines: lines.to_vec(),
            length,
            amplitudes: rms.iter().map(of).collect(),
            rms: rms.to_vec(),
        }
    }

    pub(super) fn joints(&self) -> usize {
        self.amplitudes.len()
    }

    pub(super) fn lines(&self) -> &[usize] {
        &self.lines
    }

    /// Samples of a period.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    pub(super) fn rms(&self, joint: usize) -> f64 {
        self.rms[joint]
    }

    /// Amplitude at the n-th line, N m.
    pub(super) fn amplitude(&self, joint: usize, line: usize) -> f64 {
        self.amplitudes[joint][line]
    }

    /// Complex amplitude of a joint at the n-th line in an experiment: phases of the block, turned by the Fourier matrix.
    pub(super) fn coefficient(
        &self,
        phases: &[Vec<f64>],
        joint: usize,
        experiment: usize,
        line: usize,
    ) -> Complex64 {
        let n = self.joints();
        let turned = std::f64::consts::TAU * (joint * experiment % n) as f64 / n as f64;
        Complex64::from_polar(self.amplitudes[joint][line], phases[joint][line] + turned)
    }

    /// One period of each joint's excitation in an experiment, N m.
    pub(super) fn of(&self, phases: &[Vec<f64>], experiment: usize) -> Vec<Vec<f64>> {
        let joint = |j: usize| {
            let own = (0..self.lines.len()).map(|l| self.coefficient(phases, j, experiment, l));
            self.wave(&own.collect::<Vec<_>>())
        };
        (0..self.joints()).map(joint).collect()
    }

    /// One period of the wave with these complex amplitudes.
    pub(super) fn wave(&self, amplitudes: &[Complex64]) -> Vec<f64> {
        let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(self.length);
        let mut spectrum = plan.make_input_vec();
        for (line, amplitude) in self.lines.iter().zip(amplitudes) {
            spectrum[*line] = amplitude * 0.5;
        }
        let mut out = plan.make_output_vec();
        // Fails for lengths that differ from the plan's alone.
        let _ = plan.process(&mut spectrum, &mut out);
        out
    }

    /// By how much a wave of these lines may exceed its samples: 1/cos(π f/f_s) of the highest (Ehlich & Zeller 1964, Schwankung von Polynomen
    /// zwischen Gitterpunkten).
    pub(super) fn between_samples(&self) -> f64 {
        let highest = self.lines.last().copied().unwrap_or(0) as f64 / self.length as f64;
        1.0 / (std::f64::consts::PI * highest).cos().max(1e-3)
    }
}

//! What the sensors said, put right as far as the model knows what is wrong with them.
//!
//! Velocity gains, encoder offsets and delays of the torque are taken out; where the model has elasticity or backlash, the
//! link's motion is told from the motor's. Logs lie whole in memory, so later samples help: polynomials through the samples
//! around each, at their own times (Savitzky & Golay 1964), give the velocity (a parabola) and the smooth torque with its
//! slope (a line).
//!
//! The velocity's noise is not only scatter of the rows but stands in their columns, and noise there pulls what multiplies
//! it towards zero: without the parabola, a simulated Go2's inertias come out 0.3 to 0.6 % small, two standard deviations
//! of a minute's log. A wider one rounds off the kinks of the velocity where dry friction reverses.

use proprio_core::effect::{EffectKind, JointState};

use super::play::play;
use super::recording::LimbRecording;
use super::speed;

/// How far the local polynomials of velocity and torque reach to each side, s: four samples of a Go2.
const REACH: f64 = 8.5e-3;
/// Speed below which the slope of the position may be noise, rad/s: ten times that of the Go2's position quantum.
const SPEED_NOISE: f64 = 0.01;

/// What is wrong with a limb's sensors and drives, joint by joint; the default is nothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Corrections {
    /// Reported velocity over true.
    pub(crate) velocity_gain: Vec<f64>,
    /// Reported position less true, rad.
    pub(crate) encoder_offset: Vec<f64>,
    /// How late torque is reported, s.
    pub(crate) delay: Vec<f64>,
    /// Link's lag per torque, rad/(N m).
    pub(crate) compliance: Vec<f64>,
    /// Play between motor and link, rad.
    pub(crate) gap: Vec<f64>,
    /// Reported torque over true: 1/g of `torque_gain`.
    pub(crate) torque_scale: Vec<f64>,
    /// Gravity's roll and pitch, rad.
    pub(crate) tilt: [f64; 2],
}

impl Corrections {
    /// Nothing is wrong with `joints` joints.
    pub(crate) fn none(joints: usize) -> Self {
        Self {
            velocity_gain: vec![1.0; joints],
            encoder_offset: vec![0.0; joints],
            delay: vec![0.0; joints],
            compliance: vec![0.0; joints],
            gap: vec![0.0; joints],
            torque_scale: vec![1.0; joints],
            tilt: [0.0; 2],
        }
    }

    /// The number that an effect's parameter stands for, if it is a correction and not a column.
    pub(crate) fn get_mut(
        &mut self,
        effect: EffectKind,
        joint: usize,
        parameter: usize,
    ) -> Option<&mut f64> {
        match effect {
            EffectKind::VelocityGain => self.velocity_gain.get_mut(joint),
            EffectKind::EncoderOffset => self.encoder_offset.get_mut(joint),
            EffectKind::Delay => self.delay.get_mut(joint),
            EffectKind::Elasticity => self.compliance.get_mut(joint),
            EffectKind::Backlash => self.gap.get_mut(joint),
            EffectKind::TorqueGain => self.torque_scale.get_mut(joint),
            EffectKind::BaseTilt => self.tilt.get_mut(parameter),
            _ => None,
        }
    }

    /// [`get_mut`](Self::get_mut), read; zero for what is no correction.
    pub(crate) fn get(&self, effect: EffectKind, joint: usize, parameter: usize) -> f64 {
        self.clone()
            .get_mut(effect, joint, parameter)
            .map_or(0.0, |value| *value)
    }
}

/// A limb's motion, sample by sample, joint by joint.
#[derive(Default)]
pub(crate) struct Motion {
    /// What effects see of each joint; the motor's side.
    pub(crate) states: Vec<JointState<f64>>,
    /// The link's position, rad.
    pub(crate) q: Vec<f64>,
    /// The link's velocity, rad/s.
    pub(crate) dq: Vec<f64>,
}

/// What of a joint's torque the motor itself takes up, before the gear hands the rest to the link.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MotorSide {
    /// Rotor inertia at the joint, kg m².
    pub(crate) armature: f64,
    /// N m s/rad.
    pub(crate) viscous: f64,
    /// N m.
    pub(crate) coulomb: f64,
    /// N m.
    pub(crate) bias: f64,
    /// What the gear turns, in a middle pose, kg m².
    pub(crate) link: f64,
}

/// A play that is looked for where none is known yet, rad.
const TYPICAL_PLAY: f64 = 0.01;

impl Motion {
    /// The motion of a limb whose motors take up as much of the torque as `motors` say. `follow` is the torque that links with
    /// play take to follow their motors; where it is empty, no link has any, and what a gear transmits stands for it.
    pub(crate) fn new(
        recording: &LimbRecording,
        corrections: &Corrections,
        motors: &[MotorSide],
        follow: &[f64],
    ) -> Self {
        let (n, samples) = (recording.joints, recording.len());
        let mut motion = Self {
            states: vec![JointState::reported(0.0, 0.0, 0.0); n * samples],
            q: vec![0.0; n * samples],
            dq: vec![0.0; n * samples],
        };
        for (joint, motor) in motors.iter().enumerate() {
            motion.fill_joint(recording, corrections, *motor, follow, joint);
        }
        motion
    }

    /// The motion of one joint anew: where its corrections alone have changed.
    pub(crate) fn fill_joint(
        &mut self,
        recording: &LimbRecording,
        corrections: &Corrections,
        motor: MotorSide,
        follow: &[f64],
        joint: usize,
    ) {
        for stretch in recording.stretches() {
            self.fill(recording, corrections, motor, follow, stretch, joint);
        }
    }

    fn fill(
        &mut self,
        recording: &LimbRecording,
        corrections: &Corrections,
        motor: MotorSide,
        follow: &[f64],
        stretch: std::ops::Range<usize>,
        joint: usize,
    ) {
        let n = recording.joints;
        let times: Vec<f64> = recording.time_us[stretch.clone()]
            .iter()
            .map(|&t| t as f64 * 1e-6)
            .collect();
        let channel =
            |x: &[f64]| -> Vec<f64> { stretch.clone().map(|k| x[k * n + joint]).collect() };
        let (q, dq) = (channel(&recording.q), channel(&recording.dq));
        let speeds = speed::near_standstill(&times, &q, SPEED_NOISE);
        let dq: Vec<f64> = (0..dq.len())
            .map(|k| local_parabola(&times, &dq, k, same_direction(&times, &speeds, k)))
            .collect();
        let tau = delayed(&times, &channel(&recording.tau), corrections.delay[joint]);
        let load = transmitted(&times, &tau, &q, &speeds, motor);
        let gap = corrections.gap[joint];
        let tried = if gap > 0.0 { gap } else { TYPICAL_PLAY };
        let smooth: Vec<[f64; 2]> = (0..times.len())
            .map(|k| local_line(&times, &load, k, around(&times, k)))
            .collect();
        let load: Vec<f64> = smooth.iter().map(|[load, _]| *load).collect();
        let play = match follow {
            [] => play(&times, &load, motor.link, tried),
            follow => play(&times, &channel(follow), motor.link, tried),
        };
        let compliance = corrections.compliance[joint];
        for (k, sample) in stretch.clone().enumerate() {
            let speed = speeds[k];
            let [load, load_rate] = smooth[k];
            let at = sample * n + joint;
            let state = JointState {
                q: q[k] - corrections.encoder_offset[joint],
                dq: dq[k] / corrections.velocity_gain[joint],
                tau: tau[k],
                speed,
                speed_noise: SPEED_NOISE,
                load,
                load_rate,
                play: play[k],
                temperature: recording.temperature[at],
            };
            let [mut q, mut dq] = [state.q, state.dq];
            for (effect, value) in [
                (EffectKind::Elasticity, compliance),
                (EffectKind::Backlash, gap),
            ] {
                if value != 0.0 {
                    let [by_q, by_dq] = effect.motion(&state);
                    q += value * by_q;
                    dq += value * by_dq;
                }
            }
            (self.states[at], self.q[at], self.dq[at]) = (state, q, dq);
        }
    }
}

/// The torque that the gear hands to the link: what is reported less what turns the rotor and rubs before the gear, N m.
fn transmitted(t: &[f64], tau: &[f64], q: &[f64], speed: &[f64], motor: MotorSide) -> Vec<f64> {
    let slopes = slopes(t, q);
    let of = |k: usize| {
        let [velocity, acceleration] = slopes[k];
        let sign = (speed[k] / SPEED_NOISE).clamp(-1.0, 1.0);
        let taken = motor.armature * acceleration + motor.viscous * velocity;
        tau[k] - taken - motor.coulomb * sign - motor.bias
    };
    (0..t.len()).map(of).collect()
}

/// First and second derivative of positions at each sample, rad/s and rad/s².
///
/// Velocities are slopes of the positions `q`: the reported ones have their noise in the momentum as well, and a column that
/// shares it finds a compliance where there is none.
pub(crate) fn slopes(t: &[f64], q: &[f64]) -> Vec<[f64; 2]> {
    let velocity: Vec<f64> = (0..t.len()).map(|k| local_line(t, q, k, 1)[1]).collect();
    let line = |k: usize| local_line(t, &velocity, k, around(t, k));
    (0..t.len()).map(line).collect()
}

/// How many samples lie within [`REACH`] on either side of sample k: the same number on both.
fn around(t: &[f64], k: usize) -> usize {
    let most = k.min(t.len() - 1 - k);
    let near = |half: &usize| t[k] - t[k - half] <= REACH && t[k + half] - t[k] <= REACH;
    (1..=most).take_while(near).count()
}

/// The samples within [`REACH`] of sample k in which the joint moves in the same direction: friction kinks the velocity where
/// the direction changes.
fn same_direction(t: &[f64], speed: &[f64], k: usize) -> std::ops::RangeInclusive<usize> {
    let is_alike =
        |i: &usize| (t[*i] - t[k]).abs() <= REACH && speed[*i].signum() == speed[k].signum();
    let before = (0..k).rev().take_while(is_alike).count();
    let after = (k + 1..t.len()).take_while(is_alike).count();
    k - before..=k + after
}

/// Value at sample k of the parabola through the samples around it.
fn local_parabola(t: &[f64], x: &[f64], k: usize, around: std::ops::RangeInclusive<usize>) -> f64 {
    if around.clone().count() < 5 {
        return x[k];
    }
    // Normal equations for a + b d + c d²; d of the order of one keeps them well-conditioned.
    let (mut s, mut r) = ([0.0; 5], [0.0; 3]);
    for i in around {
        let d = (t[i] - t[k]) / REACH;
        let powers = [1.0, d, d * d, d * d * d, d * d * d * d];
        s.iter_mut().zip(powers).for_each(|(s, p)| *s += p);
        r.iter_mut().zip(powers).for_each(|(r, p)| *r += p * x[i]);
    }
    // Cofactors of the first column: Cramer's rule for a.
    let cofactors = [
        s[2] * s[4] - s[3] * s[3],
        s[2] * s[3] - s[1] * s[4],
        s[1] * s[3] - s[2] * s[2],
    ];
    let dot = |x: &[f64]| x.iter().zip(cofactors).map(|(x, c)| x * c).sum::<f64>();
    dot(&r) / dot(&s[..3])
}

/// Value and slope at sample k of the straight line through the samples around it.
pub(crate) fn local_line(t: &[f64], x: &[f64], k: usize, width: usize) -> [f64; 2] {
    // The same number on both sides: then a curvature does not tilt the line.
    let half = width.min(k).min(t.len() - 1 - k);
    if half == 0 {
        let (a, b) = if k == 0 {
            (0, 1.min(t.len() - 1))
        } else {
            (k - 1, k)
        };
        let step = t[b] - t[a];
        return [
            x[k],
            if step > 0.0 {
                (x[b] - x[a]) / step
            } else {
                0.0
            },
        ];
    }
    let (mut s_t, mut s_x, mut s_tt, mut s_tx) = (0.0, 0.0, 0.0, 0.0);
    for i in k - half..=k + half {
        let (dt, dx) = (t[i] - t[k], x[i] - x[k]);
        s_t += dt;
        s_x += dx;
        s_tt += dt * dt;
        s_tx += dt * dx;
    }
    let n = (2 * half + 1) as f64;
    let slope = (s_tx - s_t * s_x / n) / (s_tt - s_t * s_t / n);
    [x[k] + (s_x - slope * s_t) / n, slope]
}

/// `x` as it will be reported `delay` seconds later; straight between samples, constant beyond the ends.
fn delayed(t: &[f64], x: &[f64], delay: f64) -> Vec<f64> {
    if delay == 0.0 {
        return x.to_vec();
    }
    let mut right = 0;
    t.iter()
        .map(|&now| {
            let wanted = now + delay;
            while right < t.len() && t[right] <= wanted {
                right += 1;
            }
            match right {
                0 => x[0],
                r if r == t.len() => x[r - 1],
                r => x[r - 1] + (x[r] - x[r - 1]) * (wanted - t[r - 1]) / (t[r] - t[r - 1]),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_value_and_slope_inside() {
        let t: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t + 50.0 * t * t).collect();
        let [_, slope] = local_line(&t, &x, 10, 4);
        assert!((slope - (3.0 + 100.0 * t[10])).abs() < 1e-9);
    }

    /// The parabola's value of a joint that moves in one direction.
    fn value(t: &[f64], x: &[f64], k: usize) -> f64 {
        local_parabola(t, x, k, same_direction(t, &vec![1.0; t.len()], k))
    }

    /// A velocity that friction kinks at its reversal is not rounded off there.
    #[test]
    fn a_kink_at_a_reversal_stays() {
        let t: Vec<f64> = (0..40).map(|k| 0.002 * f64::from(k)).collect();
        let speed: Vec<f64> = t
            .iter()
            .map(|t| (if *t < 0.0401 { 80.0 } else { 20.0 }) * (0.0401 - t))
            .collect();
        for k in 0..40 {
            let smooth = local_parabola(&t, &speed, k, same_direction(&t, &speed, k));
            assert!((smooth - speed[k]).abs() < 1e-12, "{k}");
        }
    }

    /// At uneven times too; noise falls to what nine even samples leave of it, √(59/231) (Savitzky & Golay 1964, table I).
    #[test]
    fn a_parabola_keeps_its_value_and_noise_falls_by_half() {
        let uneven: Vec<f64> = (0..20)
            .map(|k| 0.002 * f64::from(k) + 0.0004 * f64::from(k % 3))
            .collect();
        let x: Vec<f64> = uneven
            .iter()
            .map(|t| 1.0 + 3.0 * t + 50.0 * t * t)
            .collect();
        for k in 0..20 {
            assert!((value(&uneven, &x, k) - x[k]).abs() < 1e-12);
        }
        let even: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let square: f64 = (0..20)
            .map(|n| {
                let one: Vec<f64> = (0..20).map(|k| f64::from(u8::from(k == n))).collect();
                value(&even, &one, 10).powi(2)
            })
            .sum();
        assert!((square - 59.0 / 231.0).abs() < 1e-9, "{square}");
    }

    /// A slow recorder's neighbours are too far away to tell this sample's velocity.
    #[test]
    fn samples_farther_away_do_not_count() {
        let t: Vec<f64> = (0..20).map(|k| 0.01 * f64::from(k)).collect();
        let x: Vec<f64> = (0..20).map(|k| f64::from(k % 2)).collect();
        assert_eq!(value(&t, &x, 10), x[10]);
    }

    #[test]
    fn a_delay_moves_a_ramp() {
        let t: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let moved = delayed(&t, &t, 0.0031);
        assert!((moved[5] - (t[5] + 0.0031)).abs() < 1e-12);
        let moved = delayed(&t, &t, -0.0031);
        assert!((moved[5] - (t[5] - 0.0031)).abs() < 1e-12);
    }
}

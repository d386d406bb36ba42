//! The torque that a limb's gears transmit under a model's bodies: the rigid body's own at the motors' motion, or at the links' where second
//! encoders tell it, whatever its effects.
//!
//! It is dear and asked for again and again, for links that are let go by various amounts and for columns beside each other: what was
//! asked for last is kept.

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::body::LimbBody;
use super::motion::Motion;
use super::values::Values;
use crate::trajectory::{Before, Trajectory};

/// How far the straight line reaches that smooths the transmitted torque, s.
pub(super) const REACH: f64 = 8.5e-3;
/// No link has less, kg m²: a division by it stays finite.
const LEAST_INERTIA: f64 = 1e-4;
/// Samples that are worked out one after the other; parts are side by side.
const PART: usize = 1024;
/// Most numbers that are kept of a limb's loads, and of its late motion: 8 MB each.
const MOST: usize = 1_000_000;
/// The same of what bristles have transmitted: 2 MB.
const MOST_OF_BRISTLES: usize = 250_000;

/// What the gears transmit.
pub(crate) struct Load {
    /// Sample by sample, joint by joint, N m.
    pub(super) torque: Vec<f64>,
    /// Its value and slope by the straight line that smooths it, N m and N m/s.
    pub(super) line: Vec<[f64; 2]>,
    /// The inertia that each joint turns, kg m²; sample by sample, joint by joint. Nothing where no link may move.
    pub(super) inertia: Vec<f64>,
}

/// Of what a load is: bits of the bodies' numbers, of the base's tilt, of the encoders' offsets and of the delay.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Key(Vec<u64>);

impl Key {
    fn of(body: &LimbBody, values: &Values, delay: f64) -> Self {
        let bodies = values.loaded(&body.coms);
        let numbers = bodies.iter().flat_map(|body| body.0.iter().copied());
        let all = numbers.chain(values.tilt()).chain(values.offsets());
        Self(all.chain([delay]).map(f64::to_bits).collect())
    }
}

/// Loads of a limb and its motion as it was some time before, what was asked for last at the end.
#[derive(Default)]
pub(crate) struct Loads {
    loads: Mutex<Vec<(Key, Arc<Load>)>>,
    late: Mutex<Option<(f64, Arc<Vec<Trajectory>>)>>,
    bristles: Mutex<Vec<(Bristles, Arc<Vec<f64>>)>>,
}

/// Which bristles' impulse is kept: bits of the delay and of their displacement, and the joint.
type Bristles = (u64, u64, usize);

impl Loads {
    fn get(&self, key: &Key, loose: bool) -> Option<Arc<Load>> {
        let mut all = self.loads.lock().unwrap_or_else(PoisonError::into_inner);
        let n = all.iter().position(|(known, load)| {
            known == key && (!loose || load.inertia.len() == load.torque.len())
        })?;
        all[n..].rotate_left(1);
        all.last().map(|(_, load)| load.clone())
    }

    fn put(&self, key: Key, load: &Arc<Load>) {
        let size = |load: &Load| 3 * load.torque.len() + load.inertia.len();
        if size(load) > MOST {
            return;
        }
        let mut all = self.loads.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|(known, _)| *known != key);
        all.push((key, load.clone()));
        let mut total: usize = all.iter().map(|(_, load)| size(load)).sum();
        while total > MOST {
            total -= size(&all.remove(0).1);
        }
    }
}

impl Motion {
    /// What the bristles of a joint have transmitted ([`presliding`](Self::presliding)) by its motion `delay` seconds before, which is
    /// asked for again by every prediction of a model that has them: those that were asked for last are kept.
    pub(super) fn kept_presliding(
        &self,
        (motors, delay): (&[Trajectory], f64),
        joint: usize,
        displacement: f64,
    ) -> Arc<Vec<f64>> {
        let key = (delay.to_bits(), displacement.to_bits(), joint);
        let kept = || {
            let all = self.loads.bristles.lock();
            all.unwrap_or_else(PoisonError::into_inner)
        };
        {
            let mut all = kept();
            if let Some(n) = all.iter().position(|(known, _)| *known == key) {
                all[n..].rotate_left(1);
                return all[all.len() - 1].1.clone();
            }
        }
        let impulse = Arc::new(self.presliding(&motors[joint], displacement));
        let mut all = kept();
        all.push((key, impulse.clone()));
        while all.len() > 1 && all.len() * impulse.len() > MOST_OF_BRISTLES {
            all.remove(0);
        }
        impulse
    }
}

impl Load {
    /// What a joint's gear transmits at a sample by the straight line that smooths it, N m; of so many joints.
    pub(crate) fn smooth(&self, sample: usize, joint: usize, joints: usize) -> f64 {
        self.line[sample * joints + joint][0]
    }
}

impl Motion {
    /// The joints' motion `delay` seconds before each sample.
    pub(super) fn late(&self, delay: f64) -> Arc<Vec<Trajectory>> {
        if delay == 0.0 {
            return self.joint.clone();
        }
        let kept = || {
            self.loads
                .late
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
        if let Some((known, joints)) = &*kept()
            && *known == delay
        {
            return joints.clone();
        }
        let before = Before::of(&self.time, &self.stretches, delay);
        let joints = self.joint.iter().map(|joint| joint.delayed(&before));
        let joints: Arc<Vec<Trajectory>> = Arc::new(joints.collect());
        // A state is four numbers and a speed.
        if 5 * self.joints * self.time.len() <= MOST {
            *kept() = Some((delay, joints.clone()));
        }
        joints
    }

    /// What the gears transmit at all samples `delay` seconds before, and where links may move the inertia that each joint turns.
    pub(crate) fn load(
        &self,
        body: &LimbBody,
        values: &Values,
        (loose, delay): (bool, f64),
    ) -> Arc<Load> {
        let key = Key::of(body, values, delay);
        self.loads.get(&key, loose).unwrap_or_else(|| {
            let all = vec![true; self.time.len()];
            let motors = self.late(delay);
            let load = Arc::new(self.load_of(body, (&motors, delay), values, (loose, &all)));
            self.loads.put(key, &load);
            load
        })
    }

    /// The inertia that a joint turns, the mean over all poses, kg m².
    pub(crate) fn mean_inertia(&self, body: &LimbBody, values: &Values, joint: usize) -> f64 {
        let load = self.load(body, values, (true, 0.0));
        let own = load.inertia.iter().skip(joint).step_by(self.joints);
        own.sum::<f64>() / self.time.len().max(1) as f64
    }

    /// What [`load`](Self::load) has, of the samples that are `asked` for alone.
    pub(super) fn load_of(
        &self,
        body: &LimbBody,
        motors: (&[Trajectory], f64),
        values: &Values,
        (loose, asked): (bool, &[bool]),
    ) -> Load {
        let n = self.joints;
        let rigid = body.loaded(values);
        let base = body.base(values);
        let offsets: Vec<f64> = values.offsets().collect();
        let links = self.links_of(motors);
        let mut torque = vec![0.0; n * self.time.len()];
        let mut inertia = vec![0.0; torque.len()];
        let parts = (torque.par_chunks_mut(n * PART)).zip(inertia.par_chunks_mut(n * PART));
        parts.enumerate().for_each(|(part, (torque, inertia))| {
            let mut motion = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let samples = torque.chunks_exact_mut(n).zip(inertia.chunks_exact_mut(n));
            let samples = (PART * part..).zip(samples).filter(|(k, _)| asked[*k]);
            for (k, (own, turned)) in samples {
                for j in 0..n {
                    let [q, dq, ddq, _] = links[j].state[k];
                    motion[0][j] = q - offsets[j];
                    (motion[1][j], motion[2][j]) = (dq, ddq);
                }
                let [q, dq, ddq] = &motion;
                if !loose {
                    rigid.inverse_dynamics(&base, [q, dq, ddq], own);
                    continue;
                }
                rigid.torque_and_inertia(&base, [q, dq, ddq], own, turned);
                turned.iter_mut().for_each(|x| *x = x.max(LEAST_INERTIA));
            }
        });
        if !loose {
            inertia = Vec::new();
        }
        Load {
            inertia,
            line: self.lines(&torque, asked),
            torque,
        }
    }

    /// Value and slope of a torque at the samples that are asked for, by straight lines.
    fn lines(&self, torque: &[f64], asked: &[bool]) -> Vec<[f64; 2]> {
        let n = self.joints;
        let mut line = vec![[0.0; 2]; torque.len()];
        let parts = line.par_chunks_mut(n * PART).enumerate();
        parts.for_each(|(part, line)| {
            let samples = (PART * part..).zip(line.chunks_exact_mut(n));
            for (k, own) in samples.filter(|(k, _)| asked[*k]) {
                let at = self.stretches.partition_point(|s| s.end <= k);
                let Some(stretch) = self.stretches.get(at).filter(|s| s.contains(&k)) else {
                    continue;
                };
                let (t, i) = (&self.time[stretch.clone()], k - stretch.start);
                let through = Line::about(t, i, around(t, i));
                let torque = &torque[stretch.start * n..stretch.end * n];
                for (j, own) in own.iter_mut().enumerate() {
                    *own = through.fitted(torque, (j, n));
                }
            }
        });
        line
    }
}

/// How many samples lie within [`REACH`] on either side of sample k: the same number on both.
pub(super) fn around(t: &[f64], k: usize) -> usize {
    let most = k.min(t.len() - 1 - k);
    let near = |half: &usize| t[k] - t[k - half] <= REACH && t[k + half] - t[k] <= REACH;
    (1..=most).take_while(near).count().max(most.min(1))
}

/// Value and slope at sample k of the straight line through as many samples on either side.
pub(crate) fn local_line(t: &[f64], x: &[f64], k: usize, half: usize) -> [f64; 2] {
    Line::about(t, k, half).fitted(x, (0, 1))
}

/// A straight line through neighbouring samples: what of it the times make.
struct Line<'a> {
    t: &'a [f64],
    k: usize,
    half: usize,
    sum: f64,
    squares: f64,
}

impl<'a> Line<'a> {
    fn about(t: &'a [f64], k: usize, half: usize) -> Self {
        let half = half.min(k).min(t.len() - 1 - k);
        let (mut sum, mut squares) = (0.0, 0.0);
        for time in &t[k - half..=k + half] {
            let dt = time - t[k];
            sum += dt;
            squares += dt * dt;
        }
        Self {
            t,
            k,
            half,
            sum,
            squares,
        }
    }

    /// Its value and slope at sample k, where x lies from `first` on at every `step` of a list.
    fn fitted(&self, list: &[f64], (first, step): (usize, usize)) -> [f64; 2] {
        let (t, k) = (self.t, self.k);
        let x = |k: usize| list[k * step + first];
        let here = x(k);
        if self.half == 0 {
            let (a, b) = if k == 0 {
                (0, 1.min(t.len() - 1))
            } else {
                (k - 1, k)
            };
            let step = t[b] - t[a];
            let slope = if step > 0.0 {
                (x(b) - x(a)) / step
            } else {
                0.0
            };
            return [here, slope];
        }
        let (mut sum, mut product) = (0.0, 0.0);
        let samples = k - self.half..=k + self.half;
        let near = list[samples.start() * step + first..].iter().step_by(step);
        let now = t[k];
        for (t, x) in t[samples].iter().zip(near) {
            let dx = x - here;
            sum += dx;
            product += (t - now) * dx;
        }
        let n = (2 * self.half + 1) as f64;
        let slope = (product - self.sum * sum / n) / (self.squares - self.sum * self.sum / n);
        [here + (sum - slope * self.sum) / n, slope]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_slope_inside() {
        let t: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t + 50.0 * t * t).collect();
        let [_, slope] = local_line(&t, &x, 10, 4);
        assert!((slope - (3.0 + 100.0 * t[10])).abs() < 1e-9);
    }
}

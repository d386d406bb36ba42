//! The torque that a limb's gears transmit under a model's bodies: the rigid body's own at the motors' motion, or at the links' where second
//! encoders tell it, whatever its effects.
//!
//! It is dear and asked for again and again, for links that are let go by various amounts and for columns beside each other: what was
//! asked for last is kept.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock, PoisonError};

use nalgebra::{DMatrix, DVector};

use super::body::LimbBody;
use super::local_line::{Line, around};
use super::motion::Motion;
use super::recoil::Recoil;
use super::transmitted_torque_cache::{Key, Load, MOST, MOST_OF_BRISTLES};
use super::values::Values;
use crate::once::made_once;
use crate::parallel::each_part;
use crate::trajectory::{Before, Trajectory};

/// No link has less, kg m²: a division by it stays finite.
const LEAST_INERTIA: f64 = 1e-4;
/// Samples that are worked out one after the other; parts are side by side.
const PART: usize = 1024;

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

    /// What the joints feel of a base that all limbs move, `delay` seconds before each sample.
    pub(super) fn late_recoil(&self, delay: f64) -> Option<Arc<Recoil>> {
        let recoil = self.recoil.clone()?;
        if delay == 0.0 {
            return Some(recoil);
        }
        let before = Before::of(&self.time, &self.stretches, delay);
        Some(Arc::new(before.of_joints(&recoil, self.joints)))
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
        (motors, delay): (&Arc<Vec<Trajectory>>, f64),
        values: &Values,
        (loose, asked): (bool, &[bool]),
    ) -> Load {
        let n = self.joints;
        let rigid = body.loaded(values);
        let base = body.base(values);
        let encoders: Vec<_> = values.encoders().collect();
        let links = self.links_of((motors.as_slice(), delay));
        let mut torque = vec![0.0; n * self.time.len()];
        let mut inertia = vec![0.0; torque.len()];
        let parts = (torque.chunks_mut(n * PART)).zip(inertia.chunks_mut(n * PART));
        each_part(parts, |part, (torque, inertia)| {
            let mut motion = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let samples = torque.chunks_exact_mut(n).zip(inertia.chunks_exact_mut(n));
            let samples = (PART * part..).zip(samples).filter(|(k, _)| asked[*k]);
            for (k, (own, turned)) in samples {
                for j in 0..n {
                    let [q, dq, ddq, _] = links[j].state[k];
                    [motion[0][j], motion[1][j], motion[2][j]] = encoders[j].state([q, dq, ddq]);
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
        let (usual, beyond) = match loose {
            true => {
                let usual = self.usual_inertia(body, values);
                let beyond = self.beyond_samples(&usual, &links);
                (usual, beyond)
            }
            false => {
                inertia = Vec::new();
                (DMatrix::zeros(0, 0), Vec::new())
            }
        };
        Load {
            filtered: (0..n).map(|_| OnceLock::new()).collect(),
            smooth: OnceLock::new(),
            asked: asked.to_vec(),
            motors: motors.clone(),
            usual,
            inertia,
            beyond,
            torque,
        }
    }

    /// What of a joint's load is motion, and no noise of it, N m, sample by sample; of a load of links that may move.
    pub(super) fn filtered<'l>(&self, load: &'l Load, joint: usize) -> &'l Vec<f64> {
        made_once(&load.filtered[joint], || {
            self.filtered_torque(&load.usual, &load.motors, (&load.torque, joint))
        })
    }

    /// The loads by the straight line that smooths them, N m, at the samples that were asked for; sample by sample, joint by joint.
    pub(crate) fn smooth<'l>(&self, load: &'l Load) -> &'l Vec<f64> {
        made_once(&load.smooth, || self.lines(&load.torque, &load.asked))
    }

    /// What joints' torques are in the mean between two samples beyond the mean at both, N m: of the samples at which each step ends, joint by joint. Where
    /// friction stops a motor between them its acceleration jumps, and the velocity has changed by another mean than theirs.
    fn beyond_samples(&self, inertia: &DMatrix<f64>, links: &[Cow<Trajectory>]) -> Vec<f64> {
        let n = self.joints;
        let mut beyond = vec![0.0; n * self.time.len()];
        for k in self.stretches.iter().flat_map(|s| s.clone().skip(1)) {
            let step = self.time[k] - self.time[k - 1];
            if step <= 0.0 {
                continue;
            }
            let lacks = links.iter().map(|link| {
                let [[_, v0, a0, _], [_, v1, a1, _]] = [link.state[k - 1], link.state[k]];
                (v1 - v0) / step - 0.5 * (a0 + a1)
            });
            let lacks = DVector::from_iterator(n, lacks);
            let own = inertia * lacks;
            beyond[k * n..][..n].copy_from_slice(own.as_slice());
        }
        beyond
    }

    /// Torques at the samples that are asked for, by straight lines.
    fn lines(&self, torque: &[f64], asked: &[bool]) -> Vec<f64> {
        let n = self.joints;
        let mut line = vec![0.0; torque.len()];
        each_part(line.chunks_mut(n * PART), |part, line| {
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
                    [*own, _] = through.fitted(torque, (j, n));
                }
            }
        });
        line
    }
}

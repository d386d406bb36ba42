//! Rigid-body dynamics of a model's robot on its fixed base, over many samples at once: τ = H q̈ + C q̇ + g.
//!
//! Bodies are as the model has them, with its payloads, on its base as it is mounted and tilted. What drives do (friction, armature, springs)
//! is no part of it: that is [`predict`](crate::compare::own_rate).

use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use crate::equation::body::LimbBody;
use crate::equation::rigid_body::RigidBody;
use crate::equation::values::Values;
use crate::model::{Model, UnknownName};
use crate::parameter::{INERTIAL_NAMES, name_at};
use crate::recording::MAX_JOINTS;

/// A limb of a robot, or all of them: joints in the model's order.
pub struct Dynamics {
    joints: Vec<String>,
    limbs: Vec<Part>,
}

/// A limb, which no other one feels.
struct Part {
    /// Its first joint among those of the whole.
    first: usize,
    joints: usize,
    rigid: Box<dyn RigidBody>,
    base: Transform<f64>,
}

/// Why a robot's dynamics cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum DynamicsError {
    /// There is no such limb.
    #[error(transparent)]
    Limb(#[from] UnknownName),
    /// A limb of more joints than trees are compiled for.
    #[error("limb {limb} has {joints} joints, and at most {MAX_JOINTS} can be computed")]
    TooLarge {
        /// Its name.
        limb: String,
        /// Its joints.
        joints: usize,
    },
    /// Samples that are not whole: so many numbers, where rows have so many.
    #[error("{what} has {found} numbers, {wanted} are needed")]
    Size {
        /// Which argument.
        what: &'static str,
        /// Its numbers.
        found: usize,
        /// What is needed.
        wanted: usize,
    },
    /// A joint without inertia to move.
    #[error("sample {sample}: a joint has no inertia to move")]
    NoInertia {
        /// Which sample, counted from 0.
        sample: usize,
    },
}

/// A motion, sample by sample, n numbers each: positions (rad), velocities (rad/s), and accelerations (rad/s²) or torques (N m).
pub type Motion<'a> = [&'a [f64]; 3];

impl Dynamics {
    /// Of all limbs of a model's robot, or of that of this name.
    ///
    /// # Errors
    /// [`DynamicsError::Limb`], [`DynamicsError::TooLarge`].
    pub fn new(model: &Model, limb: Option<&str>) -> Result<Self, DynamicsError> {
        let named: Vec<String> = limb.into_iter().map(str::to_owned).collect();
        let chosen = model.robot().limbs_named(&named)?;
        let mut own = Self {
            joints: Vec::new(),
            limbs: Vec::new(),
        };
        for limb in &chosen {
            let too_large = || DynamicsError::TooLarge {
                limb: limb.name.clone(),
                joints: limb.bodies.len(),
            };
            let body = LimbBody::of(model, limb).ok_or_else(too_large)?;
            let values = Values::given(model, limb);
            own.limbs.push(Part {
                first: own.joints.len(),
                joints: limb.bodies.len(),
                rigid: body.loaded(&values),
                base: body.base(&values),
            });
            let names = limb.bodies.clone().map(|b| model.joint_name(b).to_owned());
            own.joints.extend(names);
        }
        Ok(own)
    }

    /// The joints' names: n of them.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// What the columns of a regressor multiply, ten parameters of each body about its joint frame's origin: `m:FR_hip` (kg), first moments (kg m),
    /// inertia (kg m²).
    pub fn parameters(&self) -> Vec<String> {
        let of_body = |joint: &String| INERTIAL_NAMES.map(|(quantity, _)| name_at(quantity, joint));
        self.joints.iter().flat_map(of_body).collect()
    }

    /// W of each sample into `rows` (samples × n × 10 n): W θ = H q̈ + C q̇ + g, N m per unit of each parameter.
    ///
    /// # Errors
    /// [`DynamicsError::Size`].
    pub fn torque_regressor(
        &self,
        motion: Motion<'_>,
        rows: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n = self.joints.len();
        let samples = self.samples(motion)?;
        let width = n * INERTIAL;
        check("the result", rows.len(), samples * n * width)?;
        // One limb's rows are whole; of several each has its own columns, and no limb feels another.
        if let [only] = &self.limbs[..] {
            for (k, out) in rows.chunks_exact_mut((n * width).max(1)).enumerate() {
                only.rigid
                    .torque_regressor(&only.base, only.of(motion, k, n), out);
            }
            return Ok(());
        }
        rows.fill(0.0);
        let mut own = Vec::new();
        for (k, out) in rows.chunks_exact_mut((n * width).max(1)).enumerate() {
            for part in &self.limbs {
                let wide = part.joints * INERTIAL;
                own.resize(part.joints * wide, 0.0);
                part.rigid
                    .torque_regressor(&part.base, part.of(motion, k, n), &mut own);
                for (j, row) in own.chunks_exact(wide).enumerate() {
                    let at = (part.first + j) * width + part.first * INERTIAL;
                    out[at..at + wide].copy_from_slice(row);
                }
            }
        }
        Ok(())
    }

    /// τ = H q̈ + C q̇ + g (N m) of each sample into `torque` (samples × n).
    ///
    /// # Errors
    /// [`DynamicsError::Size`].
    pub fn inverse_dynamics(
        &self,
        motion: Motion<'_>,
        torque: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n = self.joints.len();
        check("the result", torque.len(), self.samples(motion)? * n)?;
        for (k, out) in torque.chunks_exact_mut(n.max(1)).enumerate() {
            for part in &self.limbs {
                let own = &mut out[part.first..part.first + part.joints];
                part.rigid
                    .inverse_dynamics(&part.base, part.of(motion, k, n), own);
            }
        }
        Ok(())
    }

    /// H (kg m²) at each position into `inertia` (samples × n × n).
    ///
    /// # Errors
    /// [`DynamicsError::Size`].
    pub fn mass_matrix(&self, q: &[f64], inertia: &mut [f64]) -> Result<(), DynamicsError> {
        let n = self.joints.len();
        let samples = self.samples([q, q, q])?;
        check("the result", inertia.len(), samples * n * n)?;
        inertia.fill(0.0);
        let mut own = Vec::new();
        for (k, out) in inertia.chunks_exact_mut((n * n).max(1)).enumerate() {
            for part in &self.limbs {
                own.resize(part.joints * part.joints, 0.0);
                let [q, ..] = part.of([q, q, q], k, n);
                part.rigid.inertia_matrix(&part.base, q, &mut own);
                for (j, row) in own.chunks_exact(part.joints).enumerate() {
                    let at = (part.first + j) * n + part.first;
                    out[at..at + part.joints].copy_from_slice(row);
                }
            }
        }
        Ok(())
    }

    /// q̈ (rad/s²) of (H + diag(`armature`)) q̈ = τ − C q̇ − g into `acceleration` (samples × n); `motion` is position, velocity and torque,
    /// `armature` n numbers, kg m².
    ///
    /// # Errors
    /// [`DynamicsError::Size`], [`DynamicsError::NoInertia`].
    pub fn forward_dynamics(
        &self,
        motion: Motion<'_>,
        armature: &[f64],
        acceleration: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let n = self.joints.len();
        check("the result", acceleration.len(), self.samples(motion)? * n)?;
        check("the armature", armature.len(), n)?;
        for (sample, out) in acceleration.chunks_exact_mut(n.max(1)).enumerate() {
            for part in &self.limbs {
                let own = part.first..part.first + part.joints;
                let (base, motion) = (&part.base, part.of(motion, sample, n));
                let (armature, out) = (&armature[own.clone()], &mut out[own]);
                if !part.rigid.forward_dynamics(base, motion, armature, out) {
                    return Err(DynamicsError::NoInertia { sample });
                }
            }
        }
        Ok(())
    }

    /// How many samples a motion has.
    fn samples(&self, [q, dq, third]: Motion<'_>) -> Result<usize, DynamicsError> {
        let n = self.joints.len().max(1);
        check("the position", q.len(), q.len() / n * n)?;
        check("the velocity", dq.len(), q.len())?;
        check("the acceleration or torque", third.len(), q.len())?;
        Ok(q.len() / n)
    }
}

impl Part {
    /// What this limb's joints do in sample k of a motion of n joints.
    fn of<'a>(&self, motion: Motion<'a>, k: usize, n: usize) -> Motion<'a> {
        let first = k * n + self.first;
        motion.map(|of| &of[first..first + self.joints])
    }
}

fn check(what: &'static str, found: usize, wanted: usize) -> Result<(), DynamicsError> {
    match found == wanted {
        true => Ok(()),
        false => Err(DynamicsError::Size {
            what,
            found,
            wanted,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(samples: usize, n: usize, times: f64) -> Vec<f64> {
        let x = |k: usize| (times * (k as f64 + 1.0)).sin();
        (0..samples * n).map(x).collect()
    }

    /// The torque is the regressor times the parameters, the mass matrix its slope by acceleration, forward dynamics its inverse: of the whole
    /// robot, and of a limb the same numbers.
    #[test]
    fn all_are_one_dynamics() {
        let model = Model::default();
        let whole = Dynamics::new(&model, None).unwrap();
        let leg = Dynamics::new(&model, Some("RL")).unwrap();
        let first = whole
            .joints()
            .iter()
            .position(|j| *j == leg.joints()[0])
            .unwrap();
        let n = whole.joints().len();
        let (q, dq, ddq) = (wave(5, n, 0.7), wave(5, n, 1.3), wave(5, n, 2.9));
        let mut torque = vec![0.0; 5 * n];
        whole
            .inverse_dynamics([&q, &dq, &ddq], &mut torque)
            .unwrap();
        let mut rows = vec![0.0; 5 * n * n * INERTIAL];
        whole.torque_regressor([&q, &dq, &ddq], &mut rows).unwrap();
        let bodies = (0..n).map(|b| model.inertia(b).0.as_slice());
        let theta = bodies.collect::<Vec<_>>().concat();
        for (row, torque) in rows.chunks(n * INERTIAL).zip(&torque) {
            let product: f64 = row.iter().zip(&theta).map(|(w, x)| w * x).sum();
            assert!((product - torque).abs() < 1e-9);
        }
        let mut again = vec![0.0; 5 * n];
        whole
            .forward_dynamics([&q, &dq, &torque], &vec![0.0; n], &mut again)
            .unwrap();
        assert!(again.iter().zip(&ddq).all(|(a, b)| (a - b).abs() < 1e-8));
        let mut inertia = vec![0.0; 5 * n * n];
        whole.mass_matrix(&q, &mut inertia).unwrap();
        let mut without = vec![0.0; 5 * n];
        whole
            .inverse_dynamics([&q, &dq, &vec![0.0; 5 * n]], &mut without)
            .unwrap();
        for (k, row) in inertia.chunks(n).enumerate() {
            let sample = k / n * n;
            let moved: f64 = row.iter().zip(&ddq[sample..]).map(|(h, a)| h * a).sum();
            assert!((without[k] + moved - torque[k]).abs() < 1e-9);
        }
        let own = |x: &[f64]| -> Vec<f64> {
            x.chunks(n)
                .flat_map(|row| row[first..first + 3].to_vec())
                .collect()
        };
        let mut of_leg = vec![0.0; 15];
        leg.inverse_dynamics([&own(&q), &own(&dq), &own(&ddq)], &mut of_leg)
            .unwrap();
        assert_eq!(of_leg, own(&torque));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let model = Model::default();
        assert!(Dynamics::new(&model, Some("FX")).is_err());
        let leg = Dynamics::new(&model, Some("FL")).unwrap();
        let x = [0.0; 6];
        assert!(
            leg.inverse_dynamics([&x, &x, &x[..3]], &mut [0.0; 6])
                .is_err()
        );
        assert!(leg.inverse_dynamics([&x, &x, &x], &mut [0.0; 3]).is_err());
        assert!(leg.mass_matrix(&x[..4], &mut [0.0; 9]).is_err());
        assert_eq!(leg.parameters().len(), 30);
    }
}

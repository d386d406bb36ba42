//! Bodies that are not quite the CAD's.

use nalgebra::SVector;
use proprio_core::inertia::InertialParameters;
use proprio_core::inertia::log_cholesky::LogCholesky;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A body near `cad`, physical whatever the draw; `relative` is the standard deviation of its mass over the mass.
///
/// In the coordinates in which P = L Lᵀ of the CAD is the identity, log-Cholesky coordinates (Rucker & Wensing 2022) are
/// drawn about zero: P' = L U Uᵀ Lᵀ. That is the same in every frame and every unit. The centre of mass moves by
/// `relative`/√2 of the radius of gyration, and shears are as large: the deviations of the identification's CAD prior.
pub(super) fn perturbed(
    cad: &InertialParameters<f64>,
    relative: f64,
    rng: &mut ChaCha8Rng,
) -> InertialParameters<f64> {
    let eta = SVector::from_fn(|n, _| {
        // A diagonal entry of U counts twice in P.
        let share = if n < 4 { 0.5 } else { 0.5f64.sqrt() };
        relative * share * rng.sample::<f64, _>(StandardNormal)
    });
    // With L upper triangular, alpha's factor is common to all: take it out of d so that each diagonal has its own.
    let mut eta: SVector<f64, 10> = eta;
    for n in 1..4 {
        eta[n] -= eta[0];
    }
    match LogCholesky::from_parameters(cad) {
        Ok(of_cad) => {
            let factor = of_cad.factor() * LogCholesky(eta).factor();
            InertialParameters::from_pseudo_inertia(&(factor * factor.transpose()))
        }
        Err(_) => *cad,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::go2::{self, Leg};
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn bodies_stay_physical_and_differ_by_what_was_asked() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let tree = go2::leg::<f64>(Leg::RL);
        for body in tree.bodies() {
            let cad = body.inertia;
            let count = 2000;
            let (mut square, mut shift) = (0.0, 0.0);
            for _ in 0..count {
                let other = perturbed(&cad, 0.06, &mut rng);
                assert!(other.is_physical());
                square += (other.mass() / cad.mass() - 1.0).powi(2);
                shift += cad.prior(0.06).unwrap().sum_of_squares(other.0.as_slice());
            }
            let deviation = (square / f64::from(count)).sqrt();
            assert!((deviation / 0.06 - 1.0).abs() < 0.06, "{deviation}");
            // By the identification's CAD prior ten numbers, each of standard deviation one.
            let mean = shift / f64::from(count);
            assert!((mean / 10.0 - 1.0).abs() < 0.08, "{mean}");
        }
        assert!(perturbed(&tree.bodies()[0].inertia, 3.0, &mut rng).is_physical());
    }
}

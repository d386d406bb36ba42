//! Plans of an arm: lines, orthogonality, carrier, limits, and what is refused.

use std::path::Path;

use super::*;

/// A plan of a minute.
fn small() -> FrfSettings {
    FrfSettings {
        points: 2,
        blocks: 1,
        experiments: None,
        periods: 3,
        period: 2.0,
        band: None,
        excitation: 1.0,
        rate: 500.0,
        seed: 1,
        margins: Margins::default(),
        shapes: None,
    }
}

/// Three joints that turn; the fourth, that slides, is held.
fn arm() -> Model {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/robots/arm.urdf");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.toml");
    let text = format!("format = 1\n[robot]\nurdf = {urdf:?}\n[held]\nslide = 0.0\n");
    std::fs::write(&path, text).unwrap();
    Model::load(&path).unwrap()
}

fn planned(settings: &FrfSettings) -> Result<FrfDesign, ExciteError> {
    let model = arm();
    design(&model, &model.robot().limbs()[..1], settings)
}

#[test]
fn lines_are_odd_and_off_what_the_carrier_makes_of_each_other() {
    for period in [1.0, 2.0, 2.5, 4.0, 10.0] {
        let lines = chosen_lines([1.0, 55.0], period);
        let cycles = lines::carrier_cycles(period);
        assert!(lines.len() >= 12, "{period} s: {} lines", lines.len());
        assert_eq!(cycles % 2, 1);
        for line in &lines {
            assert_eq!(line % 2, 1);
            // Friction's harmonics on the carrier; and lines moved by inertia and gravity that change along it.
            assert!(cycles == 1 || line % cycles != 0, "{line} of {cycles}");
            assert!(!lines.contains(&(line + cycles)) && !lines.contains(&(line + 2 * cycles)));
        }
    }
}

#[test]
fn the_excitations_of_a_block_are_orthogonal() {
    let own = planned(&small()).unwrap();
    let n = own.experiments;
    assert_eq!(n, 3);
    for line in 0..own.lines.len() {
        for point in 0..2 {
            let u = own.torques([point, 0, line]);
            let squares = &u * u.adjoint();
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let amplitude = own.signals.amplitude(i, line);
                let exact = if i == j {
                    n as f64 * amplitude * amplitude
                } else {
                    0.0
                };
                let size = amplitude * own.signals.amplitude(j, line);
                assert!((squares[(i, j)].re - exact).abs() < 1e-9 * size);
                assert!(squares[(i, j)].im.abs() < 1e-9 * size);
            }
        }
    }
}

/// What is played is what was planned: lines of the references, rms, a carrier slower than any line, no jump anywhere.
#[test]
fn a_plan_moves_slowly_and_repeats_its_excitation() {
    let own = planned(&small()).unwrap();
    let all: Vec<(Command, Vec<f64>)> = own.commands().collect();
    assert_eq!(all.len(), (own.duration() * own.rate).round() as usize);
    let length = own.signals.length();
    let first = own.ways[0].samples;
    for k in 0..2 * length {
        let [now, then] = [first + k, first + k + length];
        assert_eq!(all[now].1, all[then].1);
        assert_eq!(all[now].0, all[then].0);
    }
    for j in 0..3 {
        let square = |k: usize| all[first + k].1[j].powi(2);
        let rms = ((0..length).map(square).sum::<f64>() / length as f64).sqrt();
        assert!((rms / own.rms[j] - 1.0).abs() < 1e-9);
        // The carrier alone: q̈ = −ω² (q − point).
        let omega = std::f64::consts::TAU * own.carrier;
        for (command, _) in &all[first..first + length] {
            let swung = command.q[j] - own.points[0][j];
            assert!((command.ddq[j] + omega * omega * swung).abs() < 1e-9);
        }
        assert!(own.carrier < own.band()[0]);
        for two in all.windows(2) {
            let [a, b] = [&two[0].0, &two[1].0];
            let mean = 0.5 * (a.dq[j] + b.dq[j]) / own.rate;
            // Trapezoids are off by h³/12 of the jerk.
            assert!((b.q[j] - a.q[j] - mean).abs() < 1e-6);
        }
        // From rest to rest.
        for (command, _) in [&all[0], &all[all.len() - 1]] {
            assert!(command.dq[j].abs() < 0.01);
        }
    }
}

/// Limits hold at every sample of what is commanded, with the swing by the model's own response; and a plan that leaves none of them proves nothing.
#[test]
fn a_plan_is_within_the_limits() {
    let settings = small();
    let own = planned(&settings).unwrap();
    assert!(own.violations.is_empty(), "{:?}", own.violations);
    let model = arm();
    for (command, reference) in own.commands() {
        for (j, &joint) in own.joints.iter().enumerate() {
            let body = &model.robot().bodies()[joint];
            let [low, high] = body.limits;
            let q = command.q[j];
            assert!(low + 0.05 < q && q < high - 0.05, "{} {q}", body.name);
            assert!(command.dq[j].abs() < 0.8 * body.velocity);
            assert!(command.tau[j].abs() < 0.8 * body.effort);
            assert!(reference[j].abs() < 0.5 * body.effort);
        }
    }
    for spring in &own.expected {
        assert!(spring.stiffness_std > 0.0 && spring.stiffness_std < 0.1);
        assert!(spring.stiffness_model > 0.0 && spring.damping_std > spring.stiffness_std);
    }
}

/// Points are chosen so that the ways between them keep the limits: the farthest ones alone take 20 to 27 % too much power of the shoulder.
#[test]
fn ways_between_points_are_within_the_limits() {
    for (excitation, seed) in [(0.7, 1), (0.5, 1), (0.5, 2)] {
        let settings = FrfSettings {
            points: 6,
            excitation,
            seed,
            margins: Margins {
                power: 0.2,
                ..Margins::default()
            },
            ..small()
        };
        let own = planned(&settings).unwrap();
        assert!(own.violations.is_empty(), "{:?}", own.violations);
        assert_eq!(own.points.len(), 6);
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |settings: &FrfSettings| planned(settings).err().unwrap();
    let error = refused(&FrfSettings {
        excitation: 0.02,
        ..small()
    });
    assert!(
        matches!(error, ExciteError::BelowFriction { .. }),
        "{error}"
    );
    let error = refused(&FrfSettings {
        band: Some([1.0, 230.0]),
        ..small()
    });
    assert!(
        matches!(error, ExciteError::BeyondNyquist { .. }),
        "{error}"
    );
    let error = refused(&FrfSettings {
        band: Some([10.0, 20.0]),
        ..small()
    });
    assert!(matches!(error, ExciteError::FewLines { .. }), "{error}");
    let error = refused(&FrfSettings {
        margins: Margins {
            torque: 0.1,
            ..Margins::default()
        },
        ..small()
    });
    assert!(matches!(error, ExciteError::NoPoints { .. }), "{error}");
    let error = refused(&FrfSettings {
        periods: 2,
        ..small()
    });
    assert!(matches!(error, ExciteError::Setting { .. }), "{error}");
}

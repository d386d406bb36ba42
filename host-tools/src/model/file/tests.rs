//! The file round trip, and every way a file can be bad.

use super::super::*;
use super::*;
use nalgebra::{Matrix4, Vector3};
use proptest::prelude::*;

fn physical() -> impl Strategy<Value = InertialParameters<f64>> {
    (
        prop::array::uniform4(0.05..2.0f64),
        prop::array::uniform6(-1.0..1.0f64),
    )
        .prop_map(|(d, x)| {
            #[rustfmt::skip]
        let l = Matrix4::new(
            d[0], 0.0,  0.0,  0.0,
            x[0], d[1], 0.0,  0.0,
            x[1], x[2], d[2], 0.0,
            x[3], x[4], x[5], d[3],
        );
            InertialParameters::from_pseudo_inertia(&(l * l.transpose() * 0.01))
        })
}

fn number() -> impl Strategy<Value = f64> {
    (any::<f64>(), -8..3i32).prop_filter_map("finite", |(x, e)| {
        x.is_finite().then(|| (x % 1.0) * 10f64.powi(e))
    })
}

fn model() -> impl Strategy<Value = Model> {
    let effects =
        prop::collection::vec((0..4usize, 0..12usize, number(), any::<[bool; 2]>()), 0..20);
    let bodies = prop::collection::vec((0..12usize, physical(), any::<bool>()), 0..6);
    let priors = (1e-3..1.0f64, 0..12usize, number(), any::<bool>());
    let text = "[ -~äß\n\t\u{7f}]{0,20}";
    (
        effects,
        bodies,
        priors,
        prop::array::uniform3(number()),
        text,
    )
        .prop_map(|(effects, bodies, priors, rpy, text)| {
            let mut model = Model::default();
            let (relative, at, mean, motor) = priors;
            model.set_mounting(Mounting::Rpy(rpy));
            model.set_cad_uncertainty(None, relative).unwrap();
            model.set_cad_uncertainty(Some(at), relative / 2.0).unwrap();
            model
                .set_general_prior(
                    EffectKind::Bias,
                    Prior {
                        mean,
                        std: relative,
                    },
                )
                .unwrap();
            if motor {
                model.set_motor(
                    at,
                    Motor {
                        gear: relative,
                        rotor_inertia: 1e-4,
                    },
                );
            }
            for (effect, joint, value, [valued, prior]) in effects {
                let effect = EffectKind::ALL[effect];
                model.add_effect(effect, joint);
                if valued {
                    model
                        .place_parameter(effect, joint, 0, value.abs(), Some(value.abs() / 10.0))
                        .unwrap();
                }
                if prior {
                    model
                        .set_effect_prior(
                            effect,
                            joint,
                            Prior {
                                mean: value.abs(),
                                std: 0.3,
                            },
                        )
                        .unwrap();
                }
            }
            for (body, phi, std) in bodies {
                model
                    .place_body(body, phi, std.then(|| phi.0.map(f64::abs).into()))
                    .unwrap();
            }
            if motor {
                model.set_total_std([relative; 4]).unwrap();
            }
            model.set_provenance(Provenance {
                version: "0.1.0".to_owned(),
                command: text.clone(),
                only: vec![text.clone()],
                logs: vec![LogRecord {
                    path: text,
                    sha256: "ab".repeat(32),
                }],
            });
            model
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_reads_back_to_the_last_bit(model in model()) {
        let text = file_text(&model);
        let back = parse(&text, Path::new("")).map_err(|(_, problem)| problem.to_string());
        prop_assert_eq!(back.as_ref(), Ok(&model), "{}", text);
        prop_assert_eq!(file_text(&back.unwrap()), text);
    }

    #[test]
    fn no_text_makes_it_panic(text in any::<String>(), cut in 0..2000usize) {
        let _ = parse(&text, Path::new(""));
        let whole = file_text(&Model::default());
        let _ = parse(whole.get(..cut).unwrap_or_default(), Path::new(""));
    }
}

fn file_text(model: &Model) -> String {
    text(model, Path::new("model.toml"))
}

/// The message for a file that begins as the default model's and goes on with `rest`.
fn refused(rest: &str) -> String {
    let text = file_text(&Model::default()) + rest;
    parse(&text, Path::new("")).unwrap_err().1.to_string()
}

#[test]
fn the_default_file_is_short() {
    let expected = "\
# A robot as proprio knows it: SI units, joint side of the gear.
format = 1

[robot]
builtin = \"go2\"

[base]
mount = \"fixed\"
rpy = [0.0, 0.0, 0.0]

[prior]
cad_uncertainty = 0.1
";
    assert_eq!(file_text(&Model::default()), expected);
}

#[test]
fn a_changed_value_is_a_changed_line() {
    let mut model = Model::default();
    for joint in 0..12 {
        model
            .set_effect(EffectKind::Coulomb, joint, 0.1 + joint as f64, Some(0.01))
            .unwrap();
        model
            .set_body(joint, &model.inertia(joint).clone(), None)
            .unwrap();
    }
    let before = file_text(&model);
    model
        .set_effect(EffectKind::Coulomb, 5, 0.123_456_789_012_345, Some(0.01))
        .unwrap();
    let after = file_text(&model);
    let changed: Vec<_> = before
        .lines()
        .zip(after.lines())
        .filter(|(a, b)| a != b)
        .collect();
    assert_eq!(changed, [("value = 5.1", "value = 0.123456789012")]);
}

/// What is known of all bodies together is not known of others.
#[test]
fn another_body_is_another_total() {
    let mut model = Model::default();
    model.set_total_std([0.01, 1e-4, 2e-4, 3e-4]).unwrap();
    assert_eq!(model.total_std(), Some(&[0.01, 1e-4, 2e-4, 3e-4]));
    model
        .set_body(3, &model.inertia(3).clone(), Some(&[0.01; 10]))
        .unwrap();
    assert_eq!(model.total_std(), None);
}

#[test]
fn what_is_wrong_is_named() {
    let effect = "\n[[effect]]\nname = \"coulomb\"\njoint = \"FR_hip\"\n";
    let body = "\n[body.FR_hip]\nm = 0.5\nhx = 0\nhy = 0\nhz = 0\nIxx = 1e-3\nIxy = 0\nIxz = 0\nIyy = 1e-3\nIyz = 0\n";
    let cases = [
        ("\n[mottor]\n", "there is no key `mottor`"),
        (
            "\n[total]\nstd = { m = -0.1, x = 0, y = 0, z = 0 }\n",
            "the total: a standard deviation of -0.1 is not positive",
        ),
        (&format!("{effect}vaule = 1"), "there is no key `vaule`"),
        (
            &format!("{effect}value = -1"),
            "coulomb:FR_hip: Fc = -1 is not between 0 and inf",
        ),
        (
            &format!("{effect}value = nan"),
            "coulomb:FR_hip: Fc = NaN is not between",
        ),
        (
            &format!("{effect}std = 1"),
            "coulomb:FR_hip has a standard deviation but no value",
        ),
        (
            &format!("{effect}value = 1\nstd = -1"),
            "a standard deviation of -1 is not positive",
        ),
        (
            &format!("{effect}{effect}"),
            "coulomb:FR_hip is listed twice",
        ),
        (
            &effect.replace("hip", "knee"),
            "there is no joint `FR_knee`",
        ),
        (
            &effect.replace("coulomb", "coulom"),
            "there is no effect `coulom`",
        ),
        (
            &format!("{effect}prior = {{ mean = 0, std = 0 }}"),
            "the prior of coulomb:FR_hip: a standard deviation of 0",
        ),
        (
            &format!("{effect}prior = {{ mean = -1, std = 1 }}"),
            "the prior of coulomb:FR_hip: Fc = -1",
        ),
        (
            "body = { FR_hip = 0 }",
            "the prior of body FR_hip: a standard deviation of 0",
        ),
        (
            "\n[prior.effect.viscous]\nmean = 0\nstd = inf",
            "the prior of viscous: a standard deviation of inf",
        ),
        (
            &format!("{body}Izz = 3e-3"),
            "body FR_hip: the principal moments of inertia",
        ),
        (
            &format!("{}Izz = 1e-3", body.replace("0.5", "-0.5")),
            "body FR_hip: the mass is -0.5 kg",
        ),
        (body, "missing field `Izz`"),
        (
            "\n[motor.FR_hip]\ngear = 0\nrotor_inertia = 1e-4",
            "the motor of FR_hip: gear = 0",
        ),
        ("\n[provenance]\nversion = 3", "invalid type: integer `3`"),
    ];
    for (rest, message) in cases {
        let found = refused(rest);
        assert!(found.contains(message), "{rest}\n{found}");
    }
}

#[test]
fn the_robot_and_its_base_are_checked() {
    let refused = |from: &str, to: &str| {
        let text = file_text(&Model::default());
        assert!(text.contains(from));
        parse(&text.replace(from, to), Path::new(""))
            .unwrap_err()
            .1
            .to_string()
    };
    let robot = "builtin = \"go2\"";
    assert!(refused("format = 1", "format = 2").contains("reads up to format 1"));
    assert!(refused("format = 1", "").contains("not a model file"));
    assert!(refused(robot, "builtin = \"go1\"").contains("no built-in robot `go1`; there is go2"));
    assert!(refused(robot, "").contains("either `builtin` or `urdf`"));
    assert!(refused(robot, "urdf = \"absent.urdf\"").contains("absent.urdf: cannot read"));
    assert!(refused("\"fixed\"", "\"floating\"").contains("unknown variant `floating`"));
    assert!(refused("rpy = [0.0, 0.0, 0.0]", "quaternion = [1, 0, 0, 1]").contains("of length 1"));
}

#[test]
fn the_mounting_turns_the_base() {
    let mut model = Model::default();
    model.set_mounting(Mounting::Rpy([0.0, 0.0, std::f64::consts::FRAC_PI_2]));
    let turned = model.base().rotation * Vector3::x();
    assert!((turned - Vector3::y()).norm() < 1e-15);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    model.set_mounting(Mounting::Quaternion([half, 0.0, 0.0, half]));
    assert!((model.base().rotation * Vector3::x() - turned).norm() < 1e-15);
}

#[test]
fn the_priors_override_each_other() {
    let mut model = Model::default();
    let (effect, prior) = (EffectKind::Coulomb, |mean| Prior { mean, std: 0.1 });
    assert_eq!(
        model.effect_prior(effect, 3).prior,
        model.robot().effect_prior(effect, 3)
    );
    model.set_general_prior(effect, prior(0.2)).unwrap();
    model.set_effect_prior(effect, 3, prior(0.4)).unwrap();
    assert_eq!(model.effect_prior(effect, 3).prior, prior(0.4));
    assert_eq!(model.effect_prior(effect, 4).prior, prior(0.2));
    assert_eq!(model.effect_prior(effect, 4).lower, 0.0);
    model.set_cad_uncertainty(Some(3), 0.5).unwrap();
    assert_eq!(
        [model.cad_uncertainty(3), model.cad_uncertainty(4)],
        [0.5, CAD_UNCERTAINTY]
    );
}

#[test]
fn a_leg_of_the_go2_is_the_cores() {
    use proprio_core::estimator::{EFFECTS, LEG, LEG_PARAMETERS, LegPrior};
    use proprio_core::go2::Leg;
    let mut model = Model::default();
    model.set_effect(EFFECTS[1], 5, 0.7, None).unwrap();
    let limb = &model.robot().limbs()[1];
    let effects = limb.with(&EFFECTS);
    assert_eq!(model.layout(limb, &effects), Some(LEG));
    let (ours, core) = (
        model.prior::<3>(limb, &effects).unwrap(),
        LegPrior::<f64>::of(Leg::FL),
    );
    assert_eq!(ours.cad(), core.cad());
    assert_eq!(ours.effects(), core.effects());

    let parameters = model.parameters(limb, &effects);
    assert_eq!(parameters.len(), LEG_PARAMETERS);
    assert_eq!(parameters[LEG.effect_index(2, 1)].name, "coulomb:FL_calf");
    assert_eq!(parameters[LEG.effect_index(2, 1)].value, 0.7);
    let tree = model.limb_tree::<3>(limb).unwrap();
    for (k, value) in tree.parameters::<30>().iter().enumerate() {
        assert_eq!(parameters[k].value, *value);
    }
    assert_eq!(parameters[10].name, "m:FL_thigh");
}

#[test]
fn a_limb_has_the_effects_of_the_model() {
    use proprio_core::estimator::Layout;
    let mut model = Model::default();
    model.add_effect(EffectKind::Armature, 5);
    model.add_effect(EffectKind::Viscous, 5);
    model.add_effect(EffectKind::Bias, 3);
    model.add_effect(EffectKind::Bias, 0);
    let limb = &model.robot().limbs()[1];
    let effects = model.limb_effects(limb);
    let expected = [
        (3, EffectKind::Bias),
        (5, EffectKind::Viscous),
        (5, EffectKind::Armature),
    ];
    assert_eq!(effects, expected);
    let layout = Layout::new(3, [3, 3, 3], [1, 0, 2]);
    assert_eq!(model.layout::<3>(limb, &effects), layout);
    assert_eq!(model.layout::<4>(limb, &effects), None);
    assert_eq!(model.prior::<3>(limb, &effects).unwrap().effects().len(), 3);
    assert_eq!(
        model.parameters(limb, &effects)[32].name,
        "armature:FL_calf"
    );
}

/// What is stated of feet and IMU is kept; what is not comes from the link.
#[test]
fn feet_and_an_imu_are_read_and_written() {
    let text = r#"format = 1
[robot]
builtin = "go2"
[[foot]]
link = "FR_foot"
[[foot]]
name = "left"
link = "FL_calf"
points = [[0.1, 0.0, -0.2], [-0.1, 0.0, -0.2]]
radius_std = 0.004
sensor = false
[imu]
link = "imu"
rpy = [0.0, 0.0, 1.5]
"#;
    let model = read(text, Path::new("go2.toml")).unwrap();
    let [right, left] = model.stated_feet() else {
        panic!("{:?}", model.stated_feet())
    };
    assert_eq!((&*right.name, right.radius), ("FR", 0.022));
    assert!((right.points[0][0] + 0.002).abs() < 1e-12 && right.sensor);
    assert_eq!(
        (left.points.len(), left.radius, left.sensor),
        (2, 0.0, false)
    );
    let imu = model.imu();
    assert_eq!(
        (imu.rpy[2], imu.place, imu.place_std),
        (1.5, [0.0; 3], 0.01)
    );
    let again = read(
        &super::text(&model, Path::new("go2.toml")),
        Path::new("go2.toml"),
    );
    assert_eq!(again.unwrap(), model);
    // The built-in robot's own.
    let own = Model::default();
    assert_eq!(own.imu().place_std, 5e-4);
    let names: Vec<String> = own.feet().into_iter().map(|foot| foot.name).collect();
    assert_eq!(names, ["FR", "FL", "RR", "RL"]);
}

/// A foot or an IMU on a link that is none, an IMU that a joint moves, numbers that cannot be.
#[test]
fn feet_and_imus_that_cannot_be_are_refused() {
    for (table, told) in [
        ("[[foot]]\nlink = \"FR_fot\"", "FR_fot"),
        ("[[foot]]\nlink = \"FR_foot\"\nradius = -0.01", "radius"),
        ("[[foot]]\nlink = \"FR_foot\"\npoints = []", "points"),
        ("[[foot]]\nlink = \"FR_foot\"\nsize = 1.0", "size"),
        ("[imu]\nlink = \"FR_calf\"", "FR_calf"),
        ("[imu]\nplace_std = 0.0", "imu"),
    ] {
        let text = format!("format = 1\n[robot]\nbuiltin = \"go2\"\n{table}\n");
        let error = read(&text, Path::new("go2.toml")).unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
    }
}

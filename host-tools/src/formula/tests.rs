//! Formulas: what they mean, what of them has a column, and what is refused, where.

use proprio_core::effect::{EffectKind, JointState, MAX_COLUMNS, MAX_SHAPES};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::expression::{Dual, Function, Scalar, Scope, Variable};
use super::*;
use crate::parallel::by_number;

const JOINTS: [&str; 3] = ["hip", "thigh", "calf"];

fn site() -> Site<'static> {
    Site {
        names: Names {
            joints: &JOINTS,
            own: 2,
        },
        slides: false,
        limits: [-2.7, -0.8],
        effort: 35.0,
        velocity: 20.0,
    }
}

fn defined(text: &str) -> OwnEffect {
    define("f", text, Kind::Free, &BTreeMap::new(), &site())
        .unwrap()
        .0
}

fn refused(text: &str) -> FormulaError {
    let result = define("f", text, Kind::Free, &BTreeMap::new(), &site());
    result.map(|_| ()).unwrap_err()
}

fn states() -> Vec<Vec<JointState<f64>>> {
    let state = |n: usize, j: usize| {
        let x = (7 * n + 3 * j) as f64;
        let (q, dq) = (-1.7 + 0.8 * x.sin(), 6.0 * (1.3 * x).cos());
        JointState {
            speed: dq + 0.01,
            speed_noise: 0.05,
            load: 12.0 * (0.7 * x).sin(),
            temperature: 40.0 + 10.0 * (0.1 * x).sin(),
            time: n as f64 * 0.1,
            ..JointState::reported(q, dq, f64::NAN)
        }
    };
    (0..40)
        .map(|n| (0..3).map(|j| state(n, j)).collect())
        .collect()
}

/// Every effect of the catalogue whose torque is a plain function of the joint's state is the same as a formula, column by column.
#[test]
fn formulas_are_what_the_catalogue_has() {
    let pairs: [(EffectKind, &str, f64); 14] = [
        (EffectKind::Viscous, "Fv*dq", 1.0),
        (EffectKind::Coulomb, "Fc*sign(dq)", 1.0),
        (EffectKind::Armature, "Ia*ddq", 1.0),
        (EffectKind::Bias, "b", 1.0),
        (
            EffectKind::AsymmetricCoulomb,
            "F_plus*step(dq) - F_minus*step(-dq)",
            1.0,
        ),
        (EffectKind::AsymmetricViscous, "d*dq*sign(dq)", 1.0),
        (EffectKind::Stribeck, "Fs*exp(-(dq/vs)^2)*sign(dq)", 0.3),
        (EffectKind::LoadFriction, "mu*abs(tau_rigid)*sign(dq)", 1.0),
        (EffectKind::QuadraticDrag, "c*dq*abs(dq)", 1.0),
        (
            EffectKind::SaturatingViscous,
            "F*(1 - exp(-abs(dq)/vs))*sign(dq)",
            2.0,
        ),
        (EffectKind::ThermalViscous, "kT*(temp - 40)*dq", 1.0),
        (EffectKind::Spring, "k*q + c", 1.0),
        (EffectKind::Cogging, "As*sin(N*q) + Ac*cos(N*q)", 17.0),
        (EffectKind::CoupledArmature, "Ia*ddq.thigh", 1.0),
    ];
    for (effect, text, shape) in pairs {
        let own = defined(text);
        for joints in states() {
            let mine = (own.terms)(&joints, 2, [shape, 1.0]);
            let theirs = match effect {
                EffectKind::CoupledArmature => effect.coupled(&joints[2], &joints[1]),
                _ => effect.terms(&joints[2], shape),
            };
            for n in 0..effect.columns().clamp(1, MAX_COLUMNS) {
                for (a, b) in [
                    (mine[n].boundary, theirs[n].boundary),
                    (mine[n].rate, theirs[n].rate),
                ] {
                    assert!(
                        (a - b).abs() <= 1e-12 * b.abs().max(1.0),
                        "{text} {n}: {a} {b}"
                    );
                }
            }
        }
    }
}

#[test]
fn parameters_have_the_units_that_the_formula_needs() {
    let units = |text: &str| -> Vec<(&str, &str)> {
        let own = defined(text);
        (own.description.parameters.iter())
            .map(|p| (p.symbol, p.unit))
            .collect()
    };
    assert_eq!(units("Fv*dq"), [("Fv", "N m s/rad")]);
    assert_eq!(units("Ia*ddq"), [("Ia", "kg m^2")]);
    assert_eq!(
        units("c*(q - q0)*abs(q - q0)"),
        [("c", "N m/rad^2"), ("q0", "rad")]
    );
    assert_eq!(units("F*tanh(dq/v)"), [("F", "N m"), ("v", "rad/s")]);
    assert_eq!(units("mu*abs(tau_rigid)*sign(dq)"), [("mu", "1")]);
    assert_eq!(units("c*step(t - t1)"), [("c", "N m"), ("t1", "s")]);
    assert_eq!(units("kT*(temp - 40)*dq"), [("kT", "N m s/(rad °C)")]);
    assert_eq!(units("a*sign(dq)*exp(-t/T)"), [("a", "N m"), ("T", "s")]);
    assert_eq!(
        units("D*min(max(tau_rigid/d, -1), 1)"),
        [("D", "N m"), ("d", "N m")]
    );
}

#[test]
fn what_is_not_linear_has_a_grid_by_its_unit() {
    let grid = |text: &str| defined(text).description.searched().map(|(_, grid)| grid);
    assert_eq!(grid("c*(q - q0)"), Some(Grid::Positions));
    assert_eq!(grid("k*max(q - q0, 0)"), Some(Grid::Positions));
    assert_eq!(grid("c*step(t - t1)*sign(dq)"), Some(Grid::Times));
    assert_eq!(
        grid("a*sin(k*q)*sign(dq) + b*cos(k*q)*sign(dq)"),
        Some(Grid::Frequencies)
    );
    assert_eq!(grid("F*tanh(dq/v)"), Some(Grid::SpeedsOfMotion));
    assert_eq!(grid("c*q*sign(dq)"), None);
}

/// A momentum whose inertia changes with the pose: the same as the difference quotient of f q̇ less ḟ q̇ over a fine motion.
#[test]
fn accelerations_are_momenta() {
    let own = defined("m*cos(q)^2*ddq");
    let q = |t: f64| -1.7 + 0.6 * (2.0 * t).sin();
    let dq = |t: f64| 1.2 * (2.0 * t).cos();
    let ddq = |t: f64| -2.4 * (2.0 * t).sin();
    let term = |t: f64| (own.terms)(&[JointState::reported(q(t), dq(t), 0.0); 3], 2, [1.0; 2])[0];
    let (from, to, steps) = (0.1, 0.9, 4000);
    let h = (to - from) / f64::from(steps);
    let mid = |f: &dyn Fn(f64) -> f64| {
        (0..steps)
            .map(|k| h * f(from + (f64::from(k) + 0.5) * h))
            .sum::<f64>()
    };
    let window = term(to).boundary - term(from).boundary + mid(&|t| term(t).rate);
    let torque = mid(&|t| q(t).cos().powi(2) * ddq(t));
    assert!((window - torque).abs() < 1e-6, "{window} {torque}");
}

#[test]
fn formulas_that_cannot_be_are_refused_with_their_place() {
    use FormulaProblem as P;
    let place = |text: &str| {
        let error = refused(text);
        (error.text[error.at.clone()].to_owned(), error.problem)
    };
    assert_eq!(place("c*tau").0, "tau");
    assert_eq!(place("c*tau").1, P::MeasuredTorque);
    assert_eq!(place("c*sine(q)").0, "sine");
    assert!(matches!(place("c*sine(q)").1, P::UnknownFunction { .. }));
    assert_eq!(place("c*(q + dq)").0, "q + dq");
    assert!(matches!(place("c*(q + dq)").1, P::Units { .. }));
    assert_eq!(place("c*exp(dq)").0, "dq");
    assert!(matches!(place("c*exp(dq)").1, P::NotPlain { .. }));
    assert!(matches!(place("c/(q + 1.2)").1, P::NotFinite(_)));
    assert!(matches!(place("c*log(q + 1.2)").1, P::NotFinite(_)));
    assert!(matches!(place("c*sqrt(q)").1, P::NotFinite(_)));
    assert!(matches!(place("3*sign(dq)").1, P::NoFactor));
    assert!(matches!(place("c*q + sin(q)").1, P::NoFactor));
    assert!(matches!(
        place("a*q + b*dq + c").1,
        P::TooMany { limit: 2, .. }
    ));
    assert!(matches!(
        place("c*exp(-((q - q0)/w)^2)*tanh(dq/v)").1,
        P::TooMany { limit: 2, .. }
    ));
    assert!(matches!(place("c*ddq^2").1, P::Acceleration));
    assert!(matches!(place("c*ddq*dq").1, P::Acceleration));
    assert!(matches!(place("c*q.knee").1, P::UnknownJoint { .. }));
    assert!(matches!(place("c*temp.thigh").1, P::OwnSignal(_)));
    assert!(matches!(place("c*tau_rigid*temp").1, P::Inputs));
    assert_eq!(place("c*(q - 1").1, P::Missing { needed: "`)`" });
    assert_eq!(place("c*q q").0, "q");
    assert!(matches!(place("").1, P::Missing { .. }));
    assert!(matches!(place("c*q $ 2").1, P::Character('$')));
    assert!(matches!(place(&"c*q + ".repeat(2000)).1, P::TooLong { .. }));
    assert!(matches!(
        place(&format!("c*{}q{}", "(".repeat(200), ")".repeat(200))).1,
        P::TooLong { .. }
    ));
    assert!(matches!(place("min(q)").1, P::Arguments { .. }));
    let shown = refused("c*sign(dq) + k*sine(3*q)").to_string();
    assert!(
        shown.ends_with("c*sign(dq) + k*sine(3*q)\n                   ^^^^"),
        "{shown}"
    );
}

/// A torque that is zero whatever the motion and the parameters has nothing to identify; one that acts in a small part of the range has.
#[test]
fn a_formula_that_is_always_zero_is_refused_with_its_place() {
    for (text, part) in [
        ("c*(q - q)", "q - q"),
        ("c*sin(0)", "sin(0)"),
        ("c*0*dq", "0"),
        ("c*dq + k*(q.thigh - q.thigh)*sign(dq)", "q.thigh - q.thigh"),
        ("c*(sin(q)^2 + cos(q)^2 - 1)", "sin(q)^2 + cos(q)^2 - 1"),
        ("c*(ddq - ddq)", "ddq - ddq"),
        ("c*step(q + 1)*step(-1.2 - q)", "step(q + 1)*step(-1.2 - q)"),
    ] {
        let error = refused(text);
        assert_eq!(error.problem, FormulaProblem::Zero, "{text}");
        assert_eq!(&error.text[error.at.clone()], part, "{text}");
    }
    for text in [
        "c*step(t - 60)*step(62 - t)",
        "c*step(temp - 130)*dq",
        "c*max(0.001 - abs(q + 1.2345), 0)*sign(dq)",
        "c*1e-9*q",
        // Beyond its stops at -2.7 and -0.8 rad.
        "c*max(q + 0.8, 0)",
    ] {
        defined(text);
    }
}

#[test]
fn what_is_held_is_a_number() {
    let held = Stated {
        held: Some(0.2),
        ..Stated::default()
    };
    let stated = BTreeMap::from([("w".to_owned(), held)]);
    let (own, formula) =
        define("f", "c*exp(-((q - q0)/w)^2)", Kind::Free, &stated, &site()).unwrap();
    let names: Vec<&str> = own
        .description
        .parameters
        .iter()
        .map(|p| p.symbol)
        .collect();
    assert_eq!(names, ["c", "q0"]);
    assert_eq!(formula.held, [("w".to_owned(), 0.2)]);
    let at = |q: f64| (own.terms)(&[JointState::reported(q, 0.0, 0.0); 3], 2, [-1.5, 1.0])[0].rate;
    assert!((at(-1.5) - 1.0).abs() < 1e-15);
    assert!((at(-1.3) - (-1.0f64).exp()).abs() < 1e-15);
}

/// Two in which it is not linear are shapes, of which that comes first that all values are tried of.
#[test]
fn a_formula_has_two_shapes() {
    let text = "c*exp(-((q - q0)/w)^2)*sign(dq)";
    let (own, _) = define("f", text, Kind::Free, &BTreeMap::new(), &site()).unwrap();
    let names = own.description.parameters.iter().map(|p| p.symbol);
    assert!(names.eq(["c", "q0", "w"]));
    assert!(own.description.shapes().eq([1, 2]));
    for (q, shapes) in [(-1.0, [-1.2, 0.3]), (0.4, [0.1, 0.7])] {
        let term = (own.terms)(&[JointState::reported(q, 2.0, 0.0); 3], 2, shapes)[0];
        let expected = (-((q - shapes[0]) / shapes[1]).powi(2)).exp();
        assert!((term.rate - expected).abs() < 1e-15);
    }
    let (own, _) = define(
        "f",
        "c*exp(-abs(dq)/v)*sin(k*q)",
        Kind::Free,
        &BTreeMap::new(),
        &site(),
    )
    .unwrap();
    let names = own.description.parameters.iter().map(|p| p.symbol);
    assert!(names.eq(["c", "k", "v"]));
}

#[test]
fn kinds_are_checked_over_the_whole_range() {
    let of = |text: &str, kind| define("f", text, kind, &BTreeMap::new(), &site());
    let friction = of("c*(3 + q)*sign(dq)", Kind::Dissipative).unwrap().0;
    assert_eq!(friction.description.parameters[0].lower, 0.0);
    // It gives energy below −1.5 rad.
    let error = of("c*(q + 1.5)*sign(dq)", Kind::Dissipative)
        .map(|_| ())
        .unwrap_err();
    assert!(matches!(error.problem, FormulaProblem::Kind { .. }));
    assert!(of("k*sin(q)", Kind::Conservative).is_ok());
    assert!(of("k*sin(q)*dq", Kind::Conservative).is_err());
    assert!(of("k*q.thigh", Kind::Conservative).is_err());
}

#[test]
fn a_text_names_the_neighbours_of_the_joint_that_it_is_at() {
    let (own, formula) = define(
        "f",
        "c*(q - q.thigh)",
        Kind::Free,
        &BTreeMap::new(),
        &site(),
    )
    .unwrap();
    assert_eq!(own.others, [-1]);
    assert_eq!(
        formula.text_at(|after| format!("j{after}")),
        "c*(q - q.j-1)"
    );
    // Where there is no such joint, nothing acts.
    let alone = (own.terms)(&[JointState::reported(1.0, 0.0, 0.0)], 0, [1.0; 2])[0];
    assert_eq!((alone.boundary, alone.rate), (0.0, 0.0));
}

/// Texts to be tried.
const FUZZED: u64 = 100_000;

/// What formulas are made of, and what they are not.
const TOKENS: [&str; 44] = [
    "q",
    "dq",
    "ddq",
    "t",
    "temp",
    "tau_rigid",
    "tau",
    "q.thigh",
    "dq.hip",
    "ddq.thigh",
    "q.knee",
    "c",
    "k",
    "q0",
    "w",
    "d",
    "sin(",
    "cos(",
    "abs(",
    "sign(",
    "step(",
    "exp(",
    "log(",
    "sqrt(",
    "tanh(",
    "min(",
    "max(",
    "(",
    ")",
    ",",
    "+",
    "-",
    "*",
    "/",
    "^",
    "0",
    "1",
    "2",
    "0.5",
    "1e308",
    "1e-308",
    ".",
    "²",
    " ",
];

/// A text: of tokens in any order, of a tree that could be a formula, or a good formula that was spoilt.
fn fuzzed(seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let token = |random: &mut ChaCha8Rng| TOKENS[random.random_range(0..TOKENS.len())];
    match seed % 4 {
        0 => (0..random.random_range(0..24))
            .map(|_| token(&mut random))
            .collect(),
        1 => {
            let mut text: Vec<char> = GOOD[random.random_range(0..GOOD.len())].chars().collect();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(0..text.len());
                match random.random_range(0..3) {
                    0 => drop(text.remove(at)),
                    1 => text
                        .splice(at..at, token(&mut random).chars())
                        .for_each(drop),
                    _ => text.swap(0, at),
                }
                if text.is_empty() {
                    break;
                }
            }
            text.into_iter().collect()
        }
        _ => format!("c*{}", tree(&mut random, 4)),
    }
}

const GOOD: [&str; 6] = [
    "c*(q - q0)*abs(q - q0)",
    "a*sin(k*q)*sign(dq) + b*cos(k*q)*sign(dq)",
    "c*exp(-t/T)*sign(dq)",
    "c*min(abs(tau_rigid)/d, 1)*sign(dq)",
    "m*cos(q)^2*ddq",
    "c*(temp - 40)*dq.thigh",
];

fn tree(random: &mut ChaCha8Rng, depth: usize) -> String {
    const LEAVES: [&str; 9] = ["q", "dq", "t", "q.thigh", "k", "q0", "2", "0.5", "temp"];
    if depth == 0 || random.random_range(0..5) == 0 {
        return LEAVES[random.random_range(0..LEAVES.len())].to_owned();
    }
    let of = |random: &mut ChaCha8Rng| tree(random, depth - 1);
    let (left, right) = (of(random), of(random));
    match random.random_range(0..9) {
        0 => format!("({left} + {right})"),
        1 => format!("({left} - {right})"),
        2 => format!("{left}*{right}"),
        3 => format!("{left}/{right}"),
        4 => format!("({left})^2"),
        5 => format!("min({left}, {right})"),
        6 => format!("-{left}"),
        n => {
            let name = Function::ALL[(2 * n + random.random_range(0..9)) % 9].0;
            format!("{name}({left})")
        }
    }
}

/// No text panics or hangs; what is refused is refused at a place in it, what is accepted is finite over the joint's range, and its slope is that of its value.
#[test]
fn a_hundred_thousand_texts_are_taken_or_refused() {
    let states = states();
    let of = |seed: usize| {
        let text = fuzzed(seed as u64);
        let site = site();
        match define("f", &text, Kind::Free, &BTreeMap::new(), &site) {
            Err(error) => {
                assert!(error.text.get(error.at.clone()).is_some(), "{text}");
                assert!(error.to_string().lines().count() >= 3, "{text}: {error}");
                (0, 0)
            }
            Ok((own, _)) => {
                let mut shapes = [1.0; MAX_SHAPES];
                for (shape, n) in shapes.iter_mut().zip(own.description.shapes()) {
                    *shape = own.priors[n].mean;
                }
                for joints in &states {
                    for term in (own.terms)(joints, 2, shapes) {
                        assert!(term.rate.is_finite() && term.boundary.is_finite(), "{text}");
                    }
                }
                let parsed = parse(&text, site.names).unwrap();
                let compared = (states.iter())
                    .filter(|joints| slope_is_right(&parsed.expression, joints, &text));
                (1, compared.count())
            }
        }
    };
    let found = by_number(0..FUZZED as usize, of);
    let accepted: usize = found.iter().map(|(accepted, _)| accepted).sum();
    let slopes: usize = found.iter().map(|(_, slopes)| slopes).sum();
    assert!(
        accepted > 1000 && accepted < FUZZED as usize / 2,
        "{accepted}"
    );
    assert!(slopes > 10_000, "{slopes}");
}

/// Whether an expression is smooth enough about an instant to be compared: then its slope along the joint's position is that of its value.
fn slope_is_right(e: &Expression, joints: &[JointState<f64>], text: &str) -> bool {
    let at = |off: f64| {
        let mut moved = joints.to_vec();
        moved[2].q += off;
        columns::value(e, &moved, 2, &[0.7; MOST_NAMES])
    };
    let difference = |h: f64| (at(h) - at(-h)) / (2.0 * h);
    let (coarse, fine) = (difference(2e-4), difference(1e-4));
    let dual = e.value(&Scope {
        variable: &|v: Variable| Dual {
            value: columns::signal(v.signal, &joints[2usize.saturating_add_signed(v.joint)]),
            slope: f64::from(u8::from((v.signal, v.joint) == (Signal::Position, 0))),
        },
        direction: &|joint| Dual::constant(joints[2usize.saturating_add_signed(joint)].sign()),
        parameters: &[0.7; MOST_NAMES],
    });
    let size = at(0.0).abs().max(fine.abs());
    // Where steps of two sizes differ it jumps, bends or rounds.
    if !size.is_finite() || size > 1e6 || (coarse - fine).abs() > 1e-6 * size.max(1e-3) {
        return false;
    }
    assert!(
        (dual.slope - fine).abs() <= 1e-4 * size.max(1e-3),
        "{text}: {} {fine}",
        dual.slope
    );
    true
}

/// A derivative is the slope of the dual numbers, at every node that an expression may have.
#[test]
fn derivatives_are_the_slopes_of_dual_numbers() {
    for text in [
        "c*q^3 - 2*q*q.thigh + q.thigh^2",
        "c*sin(3*q)*cos(q.thigh) + exp(-((q + 1)/0.3)^2)",
        "c*max(q + 1.5, 0)^2 + min(q, q.thigh)*q + tanh(q/0.2)",
        "c*abs(q + 1.4)*q + log(4 + q) + sqrt(5 + q*q.thigh) + 1/(4 + q)",
        "c*2^q + sign(q + 1.3)*q + step(q + 1.3)*q^2 - (-q.thigh)",
    ] {
        let e = parse(text, site().names).unwrap().expression;
        for joint in [0, -1] {
            let by = Variable {
                signal: Signal::Position,
                joint,
            };
            let slope = derivative::derivative(&e, by).unwrap();
            for joints in states() {
                let dual = e.value(&Scope {
                    variable: &|v: Variable| Dual {
                        value: joints[2usize.checked_add_signed(v.joint).unwrap()].q,
                        slope: if v == by { 1.0 } else { 0.0 },
                    },
                    direction: &|_| Dual {
                        value: f64::NAN,
                        slope: f64::NAN,
                    },
                    parameters: &[0.7],
                });
                let own = columns::value(&slope, &joints, 2, &[0.7]);
                let error = (own - dual.slope).abs();
                assert!(
                    error <= 1e-12 * own.abs().max(1.0),
                    "{text}: {own} {dual:?}"
                );
            }
        }
    }
}

/// One value at both joints, and no energy made: the torques of a potential are its slopes, those of a dissipation function take power.
#[test]
fn torques_of_several_joints_come_from_one_function() {
    let cable = defined("potential(0.5*k*(q - r*q.thigh - 0.3)^2)");
    let symbols = |own: &OwnEffect| -> Vec<(&str, &str)> {
        let parameters = own.description.parameters.iter();
        parameters.map(|p| (p.symbol, p.unit)).collect()
    };
    assert_eq!(symbols(&cable), [("k", "N m/rad"), ("r", "1")]);
    assert_eq!(
        (cable.description.form, cable.others),
        (Form::Coupled, &[-1][..])
    );
    let energy = |joints: &[JointState<f64>]| 0.5 * (joints[2].q - 0.4 * joints[1].q - 0.3).powi(2);
    for joints in states() {
        for at in 0..3 {
            let [own, _] = (cable.coupled.unwrap())(&joints, 2, at, [0.4, 1.0]);
            let moved = |by: f64| {
                let mut joints = joints.clone();
                joints[at].q += by;
                energy(&joints)
            };
            let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((own.rate - slope).abs() < 1e-8, "{at}: {own:?} {slope}");
        }
        let [own, _] = (cable.terms)(&joints, 2, [0.4, 1.0]);
        let [same, _] = (cable.coupled.unwrap())(&joints, 2, 2, [0.4, 1.0]);
        assert_eq!(own, same);
    }
    let damper = defined("dissipation(0.5*d*(dq - dq.thigh)^2)");
    assert_eq!(symbols(&damper), [("d", "N m s/rad")]);
    assert_eq!(damper.description.parameters[0].lower, 0.0);
    for joints in states() {
        let speed = |j: usize| joints[j].speed;
        for (at, sign) in [(2, 1.0), (1, -1.0)] {
            let [own, _] = (damper.coupled.unwrap())(&joints, 2, at, [1.0; 2]);
            let torque = sign * (speed(2) - speed(1));
            assert!((own.rate - torque).abs() < 1e-12, "{own:?} {torque}");
        }
    }
    for (text, said) in [
        ("potential(c*q*dq)", "of positions alone"),
        (
            "dissipation(c*tau_rigid*dq)",
            "velocities and positions alone",
        ),
        ("potential(c*q.thigh^2)", "depend on the joint"),
        ("c*potential(q^2)", "is a whole formula"),
        ("dissipation(c*dq*dq.thigh)", "gives energy"),
        ("potential(c*q*sqrt(q.thigh - 1))", "not finite"),
    ] {
        let error = refused(text).to_string();
        assert!(error.contains(said), "{text}: {error}");
    }
}

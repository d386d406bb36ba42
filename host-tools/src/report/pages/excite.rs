//! The page of `excite`.

use proprio_core::effect::EffectKind;

use crate::advise::{figure, unit_of};
use crate::excite::{Expected, LimbDesign};
use crate::model::{Model, Provenance};
use crate::report::motion::{self, JointCurve, Quantity};
use crate::report::parameters::{self, ExpectedRow};
use crate::report::stick::{self, FRAMES, Skeleton};
use crate::report::{Finding, Header, Page};

/// What to do with the motion.
const PLAY: &str = "Play the motion on the robot, suspended or clamped, record it, then run proprio identify on the log.";
/// Points of a curve per second.
const RATE: f64 = 100.0;

/// A designed motion: the limbs as they move, each joint's reference and torque with the limits, how the search went.
pub fn motion(model: &Model, designs: &[LimbDesign]) -> Page {
    let no_logs: [std::path::PathBuf; 0] = [];
    let command = Provenance::of(&no_logs)
        .map(|p| p.command)
        .unwrap_or_default();
    let finding = |design: &LimbDesign| {
        let m = &design.measures;
        format!(
            "{}: condition number {:.2} ({:.2} in SI units) over {} identifiable combinations of inertial parameters; log det {:.1}.",
            design.limb, m.condition_number, m.condition_number_si, m.rank, m.log_det
        )
    };
    let mut findings = vec![
        PLAY.to_owned(),
        identified(designs),
        "All limits hold at every instant, for parameters off by the stated uncertainty."
            .to_owned(),
    ];
    findings.extend(designs.iter().map(finding));
    let curves = |quantity| -> Vec<JointCurve> {
        designs
            .iter()
            .flat_map(|d| curves(model, d, quantity))
            .collect()
    };
    let skeletons: Vec<Skeleton> = designs.iter().map(|d| skeleton(model, d)).collect();
    let history = designs.iter().map(|d| {
        let points = d.history.iter().map(|p| [p.seconds, p.cost]);
        (d.limb.clone(), points.collect())
    });
    let rows = designs.iter().flat_map(|d| &d.expected);
    let rows = rows.map(|e| ExpectedRow {
        name: e.parameter.clone(),
        unit: unit_of(&e.parameter).to_owned(),
        prior_std: e.prior_std,
        std: e.std,
    });
    let rows: Vec<ExpectedRow> = rows.collect();
    Page {
        header: Header {
            title: "An informative motion".to_owned(),
            headline: headline(model, designs),
            findings: findings.into_iter().map(Finding::from).collect(),
            command,
            ..Header::default()
        },
        sections: vec![
            stick::figure_of(&skeletons),
            motion::section(Quantity::Position, &curves(Quantity::Position)),
            motion::section(Quantity::Velocity, &curves(Quantity::Velocity)),
            motion::section(Quantity::Acceleration, &curves(Quantity::Acceleration)),
            motion::section(Quantity::Torque, &curves(Quantity::Torque)),
            motion::search(&history.collect::<Vec<_>>()),
            parameters::expected(&rows),
        ],
    }
    .folded()
}

/// How long it takes, and what the standard deviations become at the joint where each is largest.
fn headline(model: &Model, designs: &[LimbDesign]) -> String {
    let limbs: Vec<&str> = designs.iter().map(|d| d.limb.as_str()).collect();
    // A robot of one limb, such as an arm, calls it by its first joint, which is not what moves alone.
    let of = match model.robot().limbs().len() {
        1 => String::new(),
        _ => format!(" of {}", limbs.join(", ")),
    };
    let seconds = designs.iter().map(|d| d.motion.duration());
    let seconds = seconds.fold(0.0, f64::max);
    let worst = |effect: &EffectKind| {
        let all = designs.iter().flat_map(|d| &d.expected);
        let own = all.filter(|e| e.parameter.split(':').next() == Some(effect.name()));
        let worst = own.max_by(|a, b| a.std.total_cmp(&b.std))?;
        Some(format!(
            "{} from ±{} to ±{} {}",
            effect.name(),
            figure(worst.prior_std),
            figure(worst.std),
            unit_of(&worst.parameter).replace("^2", "²")
        ))
    };
    let after: Vec<String> = EffectKind::PLAIN.iter().filter_map(worst).collect();
    format!(
        "{seconds:.0} s of motion{of} bring, at the worst joint, {}",
        after.join(", ")
    )
}

/// How many parameters the motion identifies, and of which body's it shows most.
fn identified(designs: &[LimbDesign]) -> String {
    let all = || designs.iter().flat_map(|d| &d.expected);
    let left = |e: &Expected| e.std / e.prior_std;
    let known = all().filter(|e| left(e) <= 0.5).count();
    let of_drive = |name: Option<&str>| EffectKind::PLAIN.iter().any(|e| Some(e.name()) == name);
    let is_body = |e: &&Expected| !of_drive(e.parameter.split(':').next());
    let best = all()
        .filter(is_body)
        .min_by(|a, b| left(a).total_cmp(&left(b)));
    let best = best.map_or_else(String::new, |e| {
        format!(
            " Of the bodies' parameters {} improves most: ±{} → ±{} {}.",
            e.parameter,
            figure(e.prior_std),
            figure(e.std),
            unit_of(&e.parameter).replace("^2", "²")
        )
    });
    format!(
        "{known} of {} parameters get half their prior's standard deviation or less. The others are identifiable only in combination, or stay \
         prior-dominated.{best}",
        all().count()
    )
}

fn curves(model: &Model, design: &LimbDesign, quantity: Quantity) -> Vec<JointCurve> {
    let count = (design.motion.duration() * RATE) as usize;
    let t: Vec<f64> = (0..=count).map(|k| k as f64 / RATE).collect();
    let commands: Vec<_> = t.iter().map(|&t| design.command(t)).collect();
    let curve = |(j, &joint): (usize, &usize)| {
        let limit = &design.limits()[j];
        let (values, limits) = match quantity {
            Quantity::Position => (commands.iter().map(|c| c.q[j]).collect(), limit.position),
            Quantity::Velocity => (
                commands.iter().map(|c| c.dq[j]).collect(),
                [-limit.velocity, limit.velocity],
            ),
            Quantity::Acceleration => (
                commands.iter().map(|c| c.ddq[j]).collect(),
                [-limit.acceleration, limit.acceleration],
            ),
            Quantity::Torque => (
                commands.iter().map(|c| c.tau[j]).collect(),
                [-limit.torque, limit.torque],
            ),
        };
        JointCurve {
            joint: model.joint_name(joint).to_owned(),
            t: t.clone(),
            values,
            limits,
        }
    };
    design.joints.iter().enumerate().map(curve).collect()
}

fn skeleton(model: &Model, design: &LimbDesign) -> Skeleton {
    let foot = design
        .joints
        .last()
        .and_then(|&b| model.robot().bodies()[b].foot);
    let count = (design.motion.period * FRAMES) as usize;
    Skeleton {
        limb: design.limb.clone(),
        has_feet: !model.feet().is_empty(),
        frames: (0..count)
            .map(|k| design.points(k as f64 / FRAMES, foot.as_ref()))
            .collect(),
    }
}

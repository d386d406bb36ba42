//! The page of `excite`.

use crate::excite::LimbDesign;
use crate::model::{Model, Provenance};
use crate::report::motion::{self, JointCurve, Quantity};
use crate::report::stick::{self, FRAMES, Skeleton};
use crate::report::{Finding, Header, Page};

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
    let mut findings: Vec<String> = designs.iter().map(finding).collect();
    findings.push("All limits hold at every instant.".to_owned());
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
    Page {
        header: Header {
            title: "An informative motion".to_owned(),
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
        ],
    }
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

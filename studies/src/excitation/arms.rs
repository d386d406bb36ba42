//! Arms of seven joints, as others design motions for them.
//!
//! RAPTOR's Kinova Gen3 case (Zhang et al. 2024; `KinovaRegressorExample`): 10 s, three waves, from rest in a given pose, log σ1 −
//! log σ43 of columns per kg, kg m, kg m², with six boxes around the arm or without. FloBaRoID's KUKA LWR stands for the 7-joint
//! arms of robot_payload_id, whose 116.7 is of WᵀW: cond(W) = 10.8.

use std::fmt::Write;
use std::path::Path;

use proprio_host::excite::shapes::Shapes;
use proprio_host::excite::{self, Ends, Goal, Margins, Settings};
use proprio_host::model::{Model, Robot};

use super::condition::DENSE;
use super::{Failure, Stopwatch, Watched};
use proprio_tests::command::recorded_logs;

/// Seconds of processor time for a design.
const SECONDS: f64 = 10.0;
/// Starts: as many as there is time for, with the Gen3's boxes and with five waves and no boxes.
const STARTS: usize = 2;
const STARTS_OF_FIVE_WAVES: usize = 4;
const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];

/// Of the Gen3: reach of the joints that have stops, degrees; speed, degrees per second; torque, N m; and what is kept back of
/// each, in rad, rad/s and N m, as the example does.
const STOPS: [Option<f64>; 7] = [
    None,
    Some(128.9),
    None,
    Some(147.8),
    None,
    Some(120.3),
    None,
];
const SPEED: [f64; 7] = [100.0, 100.0, 100.0, 100.0, 180.0, 180.0, 180.0];
const TORQUE: [f64; 7] = [90.0, 90.0, 90.0, 90.0, 45.0, 45.0, 45.0];
const KEPT_BACK: [f64; 3] = [0.02, 0.05, 0.5];
/// Greatest acceleration, rad/s²: that of the slower joints, 297.94 °/s², for all.
const ACCELERATION: f64 = 5.2;
/// Where it starts, rad.
const START: [f64; 7] = [
    1.001_089_9,
    0.091_402_7,
    -1.648_806_4,
    2.381_092_2,
    1.822_374_8,
    0.146_660_9,
    0.931_531_6,
];

/// The example's boxes and the arm's capsules.
const BOXES: &str = include_str!("kinova_boxes.toml");

/// All cases.
///
/// # Errors
/// A URDF that cannot be read, no motion within the limits.
pub fn study() -> Result<String, Failure> {
    let Some(folder) = recorded_logs() else {
        return Ok("No arms at hand.".to_owned());
    };
    let mut text = format!(
        "cond(W) of all inertial columns per kg, kg m and kg m² (its r nonzero singular values), {SECONDS:.0} s of processor time for \
         each design, 10 s of motion. Proved within the limits at every instant, for bodies off by 10 %.\n\n\
         | case | seed | rank | cond(W) | violations | highest at 10 kHz | processor s |\n|---|---|---|---|---|---|---|\n"
    );
    let gen3 = gen3(&folder.join("arms/gen3.urdf"))?;
    let boxes = Shapes::parse(BOXES)?;
    let cases = [
        (
            "Kinova Gen3, no boxes, from rest",
            kinova(None, Ends::RestAtStart, 3),
        ),
        (
            "… with the boxes",
            kinova(Some(boxes), Ends::RestAtStart, 3),
        ),
        (
            "… no boxes, from rest to rest, ten waves",
            kinova(None, Ends::Rest, 10),
        ),
    ];
    for (name, settings) in &cases {
        row(&mut text, name, &gen3, settings)?;
    }
    let lwr = lwr(&folder.join("arms/lwr.urdf"))?;
    let five = Settings {
        goal: Goal::ConditionSi,
        harmonics: 5,
        period: 10.0,
        ends: Ends::RestAtStart,
        starts: STARTS_OF_FIVE_WAVES,
        ..Settings::default()
    };
    row(&mut text, "KUKA LWR, five waves, from rest", &lwr, &five)?;
    Ok(text)
}

fn row(text: &mut String, name: &str, model: &Model, of: &Settings) -> Result<(), Failure> {
    for seed in SEEDS {
        let settings = Settings { seed, ..of.clone() };
        let limbs = model.robot().limbs();
        let (clock, watched) = (Stopwatch::start(), Watched::for_at_most(SECONDS));
        let designs = excite::design(model, &limbs[..1], &settings, &watched)?;
        let (design, seconds) = (&designs[0], clock.processor());
        eprintln!(
            "{name}, seed {seed}: {:.2}",
            design.measures.condition_number_si
        );
        writeln!(
            text,
            "| {name} | {seed} | {} | **{:.2}** | {} | {:.4} | {seconds:.1} |",
            design.measures.rank,
            design.measures.condition_number_si,
            design.violations.len(),
            design.dense_check(DENSE),
        )?;
    }
    Ok(())
}

fn kinova(shapes: Option<Shapes>, ends: Ends, harmonics: usize) -> Settings {
    Settings {
        goal: Goal::ConditionSi,
        duration: 10.0,
        period: 10.0,
        harmonics,
        ends,
        pose: (0..7)
            .map(|n| (format!("joint_{}", n + 1), START[n]))
            .collect(),
        margins: Margins {
            position: KEPT_BACK[0],
            velocity: 1.0,
            acceleration: ACCELERATION,
            torque: 1.0,
            // Power is not limited there: torque times speed at most.
            power: 4.0,
            distance: 0.0,
            ..Margins::default()
        },
        shapes,
        starts: STARTS,
        ..Settings::default()
    }
}

/// The Gen3 with the example's limits in its URDF.
fn gen3(path: &Path) -> Result<Model, Failure> {
    let mut text = std::fs::read_to_string(path)?;
    for (n, stop) in STOPS.iter().enumerate() {
        let joint = text
            .find(&format!("<joint name=\"joint_{}\" type=", n + 1))
            .ok_or("no such joint")?;
        let start = joint + text[joint..].find("<limit").ok_or("no limit")?;
        let end = start + text[start..].find("/>").ok_or("no end")? + 2;
        let stops = stop.map_or_else(String::new, |degrees| {
            let reach = degrees.to_radians();
            format!("lower=\"{}\" upper=\"{reach}\" ", -reach)
        });
        let speed = SPEED[n].to_radians() - KEPT_BACK[1];
        let torque = TORQUE[n] - KEPT_BACK[2];
        let limit = format!("<limit {stops}effort=\"{torque}\" velocity=\"{speed}\"/>");
        text.replace_range(start..end, &limit);
    }
    read(&text)
}

/// The LWR; its base stands on a box by a joint with two origins, of which the first counts.
fn lwr(path: &Path) -> Result<Model, Failure> {
    let mut text = std::fs::read_to_string(path)?;
    let joint = text
        .find("<joint name=\"box_lwr_base_joint\"")
        .ok_or("no such joint")?;
    let mut origins = text[joint..].match_indices("<origin");
    let second = origins.nth(1).ok_or("no origin")?.0 + joint;
    let end = second + text[second..].find("/>").ok_or("no end")? + 2;
    text.replace_range(second..end, "");
    read(&text)
}

/// The robot of a URDF's text.
fn read(text: &str) -> Result<Model, Failure> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("arm.urdf");
    std::fs::write(&file, text)?;
    Ok(Model::new(Robot::from_urdf(&file)?))
}

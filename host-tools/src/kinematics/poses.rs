//! Files of poses: joint positions, and where targets were measured at each of them.
//!
//! Columns are found by name: `q/<joint>` (or the joint's name alone), of each target `x/<name>`, `y/<name>`, `z/<name>` (m), and of one whose
//! orientation is measured `qw|qx|qy|qz/<name>`; `std/<name>` (m), `payload` (kg, at the first target), `side/<joint>` (from which side the
//! joint came: 1 moving up, −1 moving down) and `t` (s), by which, where there is no `side/`, poses follow one another. FIGAROH's spelling is
//! read too: `x1`, `y1`, `z1`, `phix1`, `phiy1`, `phiz1` (roll, pitch, yaw, rad).

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use proprio_core::spatial::Transform;

use super::error::CalibrateError;
use crate::log::{Need, Place, file_columns, read_numbers};
use crate::model::{BASE, Model, Robot, UnknownName};

/// How far a quaternion's length may be from 1.
const QUATERNION_ROUNDING: f64 = 0.02;
/// A joint that moved less since the pose before, rad or m, came from no side.
const STILL: f64 = 1e-4;

/// One pose.
#[derive(Debug, Clone)]
pub(super) struct Pose {
    /// Which file, and where in it.
    pub(super) file: usize,
    /// Where it stands there.
    pub(super) place: Option<Place>,
    /// Positions of all the robot's joints, rad or m; of one that is not recorded 0.
    pub(super) q: Vec<f64>,
    /// From which side each came: 1, −1, or 0 where that is not known.
    pub(super) side: Vec<f64>,
    /// Mass at the first target, kg.
    pub(super) payload: f64,
    /// What was measured of each target.
    pub(super) measured: Vec<Option<Measured>>,
}

/// What was measured of a target.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    /// Place in the measuring system's frame, m.
    pub(super) place: Vector3<f64>,
    /// Orientation there.
    pub(super) orientation: Option<Matrix3<f64>>,
    /// Standard deviation of the place as stated, m.
    pub(super) std: Option<f64>,
}

impl Pose {
    /// All its numbers, bit by bit; the side is no measurement, of a copied line it says that the robot stood still.
    fn bits(&self) -> Vec<u64> {
        let mut bits: Vec<u64> = (self.q.iter().chain([&self.payload]))
            .map(|x| x.to_bits())
            .collect();
        for (target, own) in self.measured.iter().enumerate() {
            let Some(own) = own else { continue };
            // Its number keeps the numbers of two targets apart.
            bits.push(target as u64);
            let turned = own.orientation.iter().flat_map(|turn| turn.iter());
            let numbers = own.place.iter().chain(turned).chain(&own.std);
            bits.extend(numbers.map(|x| x.to_bits()));
        }
        bits
    }
}

/// Poses of one robot.
#[derive(Debug, Clone)]
pub struct Poses {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Names of the targets.
    pub targets: Vec<String>,
    /// The recorded joints.
    pub(super) joints: Vec<usize>,
    /// Whether it is known from which side joints came.
    pub(super) has_sides: bool,
    pub(super) poses: Vec<Pose>,
}

/// Which columns hold a target.
#[derive(Debug, Clone, Default, PartialEq)]
struct TargetColumns {
    name: String,
    place: [Option<usize>; 3],
    quaternion: [Option<usize>; 4],
    rpy: [Option<usize>; 3],
    std: Option<usize>,
}

/// Which columns hold what.
#[derive(Debug, Clone, Default)]
struct PoseColumns {
    joints: Vec<(usize, usize)>,
    sides: Vec<(usize, usize)>,
    targets: Vec<TargetColumns>,
    payload: Option<usize>,
    t: Option<usize>,
}

/// Whether a file is one of poses rather than a log: it places a target and has no velocity. Streams are logs: what was read of them is gone.
pub fn is_pose_file(path: &Path) -> bool {
    // What cannot be read is reported as of a log.
    let names = file_columns(path);
    let places = |name: &String| target_part(name).is_some_and(|(part, _)| part == Part::Place(0));
    names.iter().any(places) && !names.iter().any(|name| name.starts_with("dq/"))
}

/// Positions of all joints at each row of a file, as `excite --poses` writes it; of a joint without a column 0.
///
/// # Errors
/// If it cannot be read or has no joint's column.
pub fn joint_positions(path: &Path, model: &Model) -> Result<Vec<Vec<f64>>, CalibrateError> {
    let robot = model.robot();
    let mut joints = Vec::new();
    let table = read_numbers(path, |names| -> Result<_, CalibrateError> {
        for (cell, name) in names.iter().enumerate() {
            if let Some(joint) = name.strip_prefix("q/") {
                joints.push((robot.joint(joint)?, cell));
            }
        }
        if joints.is_empty() {
            return Err(CalibrateError::Columns {
                path: path.to_owned(),
                what: "no joint position `q/<joint>`".to_owned(),
            });
        }
        Ok(joints
            .iter()
            .map(|(_, cell)| (*cell, Need::Always))
            .collect())
    })?;
    let row = |row: Vec<f64>| {
        let mut q = vec![0.0; robot.bodies().len()];
        for (&(joint, _), value) in joints.iter().zip(row) {
            q[joint] = value;
        }
        q
    };
    Ok(table.rows().map(row).collect())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Place(usize),
    Quaternion(usize),
    Rpy(usize),
    Std,
}

/// What a column says of which target.
fn target_part(name: &str) -> Option<(Part, &str)> {
    const SLASHED: [(&str, Part); 8] = [
        ("x", Part::Place(0)),
        ("y", Part::Place(1)),
        ("z", Part::Place(2)),
        ("qw", Part::Quaternion(0)),
        ("qx", Part::Quaternion(1)),
        ("qy", Part::Quaternion(2)),
        ("qz", Part::Quaternion(3)),
        ("std", Part::Std),
    ];
    if let Some((part, target)) = name.split_once('/') {
        let found = SLASHED.iter().find(|(key, _)| *key == part);
        return found.map(|(_, part)| (*part, target));
    }
    // FIGAROH: a letter and the number of the marker.
    const NUMBERED: [(&str, Part); 6] = [
        ("phix", Part::Rpy(0)),
        ("phiy", Part::Rpy(1)),
        ("phiz", Part::Rpy(2)),
        ("x", Part::Place(0)),
        ("y", Part::Place(1)),
        ("z", Part::Place(2)),
    ];
    NUMBERED.iter().find_map(|(key, part)| {
        let number = name.strip_prefix(key)?;
        let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
        is_number.then_some((*part, number))
    })
}

impl PoseColumns {
    /// Finds them among a file's names.
    fn find(path: &Path, names: &[String], robot: &Robot) -> Result<Self, CalibrateError> {
        let mut columns = Self::default();
        let bare = |name: &str| {
            robot
                .bodies()
                .iter()
                .position(|body| body.name == name || body.joint_name == name)
        };
        for (cell, name) in names.iter().enumerate() {
            if let Some(joint) = name.strip_prefix("q/") {
                let joint = bare(joint).map_or_else(|| robot.joint(joint), Ok)?;
                columns.joints.push((joint, cell));
            } else if let Some(joint) = name.strip_prefix("side/") {
                let joint = bare(joint).map_or_else(|| robot.joint(joint), Ok)?;
                columns.sides.push((joint, cell));
            } else if let Some((part, target)) = target_part(name) {
                let place = columns.target(target);
                let slot = match part {
                    Part::Place(n) => &mut place.place[n],
                    Part::Quaternion(n) => &mut place.quaternion[n],
                    Part::Rpy(n) => &mut place.rpy[n],
                    Part::Std => &mut place.std,
                };
                *slot = Some(cell);
            } else if name == "payload" {
                columns.payload = Some(cell);
            } else if name == "t" {
                columns.t = Some(cell);
            } else if let Some(joint) = bare(name) {
                columns.joints.push((joint, cell));
            }
        }
        columns.targets.retain(|target| target.place != [None; 3]);
        let missing = |what: String| CalibrateError::Columns {
            path: path.to_owned(),
            what,
        };
        if columns.joints.is_empty() {
            let joints: Vec<&str> = robot.bodies().iter().map(|b| b.name.as_str()).collect();
            return Err(missing(format!(
                "no joint position `q/<joint>`; joints are {}",
                joints.join(", ")
            )));
        }
        if columns.targets.is_empty() {
            return Err(missing(
                "no measured target `x/<name>`, `y/<name>`, `z/<name>`".to_owned(),
            ));
        }
        for target in &columns.targets {
            for (axis, cell) in ["x", "y", "z"].iter().zip(target.place) {
                if cell.is_none() {
                    return Err(missing(format!("no `{axis}/{}`", target.name)));
                }
            }
            let counts = [
                target.quaternion.iter().flatten().count(),
                target.rpy.iter().flatten().count(),
            ];
            if ![0, 4].contains(&counts[0]) || ![0, 3].contains(&counts[1]) {
                return Err(missing(format!(
                    "part of the orientation of target {}",
                    target.name
                )));
            }
        }
        let mut seen = Vec::new();
        for &(joint, cell) in &columns.joints {
            if seen.contains(&joint) {
                return Err(missing(format!(
                    "two columns of joint {}, the second `{}`",
                    robot.bodies()[joint].name,
                    names[cell]
                )));
            }
            seen.push(joint);
        }
        Ok(columns)
    }

    fn target(&mut self, name: &str) -> &mut TargetColumns {
        let found = self.targets.iter().position(|target| target.name == name);
        let index = found.unwrap_or_else(|| {
            self.targets.push(TargetColumns {
                name: name.to_owned(),
                ..TargetColumns::default()
            });
            self.targets.len() - 1
        });
        &mut self.targets[index]
    }

    /// The cells to read, and whether each may be empty: all of a target's may, where it was not seen.
    fn cells(&self) -> Vec<(usize, Need)> {
        let always = (self.joints.iter()).map(|(_, cell)| (*cell, Need::Always));
        let sides = (self.sides.iter()).map(|(_, cell)| (*cell, Need::Optional));
        let targets = self.targets.iter().flat_map(|target| {
            let all = target.place.iter().chain(&target.quaternion);
            let all = all.chain(&target.rpy).chain(std::iter::once(&target.std));
            all.flatten()
                .map(|cell| (*cell, Need::Optional))
                .collect::<Vec<_>>()
        });
        let more = self
            .payload
            .iter()
            .chain(&self.t)
            .map(|cell| (*cell, Need::Optional));
        always.chain(sides).chain(targets).chain(more).collect()
    }
}

impl Poses {
    /// Reads files of poses; all must measure the same targets at the same joints.
    ///
    /// # Errors
    /// [`CalibrateError`] with file, line and column.
    pub fn read(files: &[PathBuf], model: &Model) -> Result<Self, CalibrateError> {
        let mut all: Option<Self> = None;
        for (n, path) in files.iter().enumerate() {
            let one = Self::read_one(path, n, model)?;
            match &mut all {
                None => all = Some(one),
                Some(all) if all.targets == one.targets && all.joints == one.joints => {
                    all.has_sides &= one.has_sides;
                    all.poses.extend(one.poses);
                }
                Some(all) => {
                    return Err(CalibrateError::Columns {
                        path: path.clone(),
                        what: format!("other targets or joints than {}", all.files[0].display()),
                    });
                }
            }
        }
        let mut all = all.ok_or_else(|| CalibrateError::Columns {
            path: PathBuf::new(),
            what: "no file".to_owned(),
        })?;
        all.files = files.to_vec();
        Ok(all)
    }

    fn read_one(path: &Path, file: usize, model: &Model) -> Result<Self, CalibrateError> {
        let robot = model.robot();
        let mut found = PoseColumns::default();
        let table = read_numbers(path, |names| -> Result<_, CalibrateError> {
            found = PoseColumns::find(path, names, robot)?;
            Ok(found.cells())
        })?;
        let cells: Vec<usize> = found.cells().iter().map(|(cell, _)| *cell).collect();
        let bodies = (0..robot.bodies().len()).chain([BASE]);
        let own_mass: f64 = bodies.map(|body| model.inertia(body).0[0]).sum();
        let mut poses: Vec<Pose> = Vec::with_capacity(table.count());
        for (n, row) in table.rows().enumerate() {
            let value = |cell: usize| {
                let slot = cells.iter().position(|c| *c == cell);
                slot.map_or(f64::NAN, |slot| row[slot])
            };
            let joints = robot.bodies().len();
            let mut pose = Pose {
                file,
                place: table.place(n),
                q: vec![0.0; joints],
                side: vec![0.0; joints],
                payload: 0.0,
                measured: Vec::with_capacity(found.targets.len()),
            };
            let place = pose.place;
            let wrong = |what: String| CalibrateError::Row {
                path: path.to_owned(),
                place,
                what,
            };
            if let Some(cell) = found.payload {
                pose.payload = payload(value(cell), own_mass).map_err(wrong)?;
            }
            for &(joint, cell) in &found.joints {
                pose.q[joint] = value(cell);
            }
            for &(joint, cell) in &found.sides {
                let name = &robot.bodies()[joint].name;
                pose.side[joint] = side(value(cell), name).map_err(wrong)?;
            }
            if let (true, Some(_), Some(before)) = (found.sides.is_empty(), found.t, poses.last()) {
                for &(joint, _) in &found.joints {
                    let moved = pose.q[joint] - before.q[joint];
                    pose.side[joint] = if moved.abs() > STILL {
                        moved.signum()
                    } else {
                        0.0
                    };
                }
            }
            for target in &found.targets {
                let measured = measured(target, value).map_err(wrong)?;
                pose.measured.push(measured);
            }
            poses.push(pose);
        }
        Ok(Self {
            files: vec![path.to_owned()],
            targets: found
                .targets
                .iter()
                .map(|target| target.name.clone())
                .collect(),
            joints: found.joints.iter().map(|(joint, _)| *joint).collect(),
            has_sides: !found.sides.is_empty() || found.t.is_some(),
            poses,
        })
    }

    /// The poses without those that repeat all numbers of an earlier one, and how many these are: a line copied is no second measurement,
    /// which would differ by its noise.
    pub(super) fn once(&self) -> (Self, usize) {
        let mut seen = std::collections::HashSet::new();
        let mut once = self.clone();
        once.poses.retain(|pose| seen.insert(pose.bits()));
        let repeated = self.count() - once.count();
        (once, repeated)
    }

    /// How many poses there are.
    pub fn count(&self) -> usize {
        self.poses.len()
    }

    /// Of each target, whether its orientation is measured.
    pub(super) fn oriented(&self) -> Vec<bool> {
        let has = |target: usize| {
            let mut seen = self
                .poses
                .iter()
                .filter_map(|pose| pose.measured[target].as_ref());
            seen.any(|measured| measured.orientation.is_some())
        };
        (0..self.targets.len()).map(has).collect()
    }

    /// How a pose is called: its line, and its file where there are several.
    pub fn called(&self, pose: usize) -> String {
        let Some(pose) = self.poses.get(pose) else {
            return String::new();
        };
        let place = pose
            .place
            .map_or_else(String::new, |place| place.to_string());
        match self.files.len() {
            0 | 1 => place,
            _ => format!("{}, {place}", self.files[pose.file].display()),
        }
    }

    /// What carries a target: the link that the model states, by default that of the recorded joint farthest from the base.
    pub(super) fn carrier(&self, model: &Model, target: usize) -> Result<Carrier, UnknownName> {
        let name = &self.targets[target];
        let tools = &model.kinematics().tools;
        if let Some(tool) = tools.iter().find(|tool| tool.name == *name) {
            let frame = model.robot().frame(&tool.link)?;
            return Ok(Carrier {
                body: frame.body,
                link: tool.link.clone(),
                placement: frame.placement,
            });
        }
        let bodies = model.robot().bodies();
        let depth =
            |joint: &usize| std::iter::successors(Some(*joint), |&j| bodies[j].parent).count();
        let body = self.joints.iter().copied().max_by_key(depth);
        Ok(Carrier {
            body,
            link: body.map_or_else(String::new, |b| bodies[b].link_name.clone()),
            placement: Transform::identity(),
        })
    }
}

/// What carries a target.
#[derive(Debug, Clone)]
pub(super) struct Carrier {
    /// The body; none is the base.
    pub(super) body: Option<usize>,
    /// Its link, or one that is fixed to it.
    pub(super) link: String,
    /// The link's frame in the body's joint frame.
    pub(super) placement: Transform<f64>,
}

/// A payload, kg; an empty cell is none. More than the robot itself weighs no arm holds at its flange: the unit is g, or the column another.
fn payload(value: f64, own_mass: f64) -> Result<f64, String> {
    if value.is_nan() {
        return Ok(0.0);
    }
    if value < 0.0 || value.is_infinite() {
        return Err(format!("a payload of {value} kg"));
    }
    // A description without masses says nothing of what the robot holds.
    if own_mass > 0.0 && value > own_mass {
        return Err(format!(
            "a payload of {value:.3e} kg; the robot itself has {own_mass:.1} kg"
        ));
    }
    Ok(value)
}

/// From which side a joint came; an empty cell does not say.
fn side(value: f64, joint: &str) -> Result<f64, String> {
    if value.is_nan() {
        Ok(0.0)
    } else if [-1.0, 0.0, 1.0].contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "`side/{joint}` is {value:.3e}; it is 1 (moving up), -1 (moving down) or 0"
        ))
    }
}

/// What a row says of a target; none where it was not seen.
fn measured(
    target: &TargetColumns,
    value: impl Fn(usize) -> f64,
) -> Result<Option<Measured>, String> {
    let read = |cell: &Option<usize>| cell.map_or(f64::NAN, &value);
    let place = Vector3::from(target.place.each_ref().map(read));
    if place.iter().all(|x| x.is_nan()) {
        return Ok(None);
    }
    if place.iter().any(|x| !x.is_finite()) {
        return Err(format!("target {} has a place in part", target.name));
    }
    let orientation = if target.quaternion[0].is_some() {
        let [w, x, y, z] = target.quaternion.each_ref().map(read);
        let quaternion = Quaternion::new(w, x, y, z);
        let length = quaternion.norm();
        if !length.is_finite() || (length - 1.0).abs() > QUATERNION_ROUNDING {
            return Err(format!(
                "the quaternion of target {} has the length {length:.3}, not 1",
                target.name
            ));
        }
        Some(
            *UnitQuaternion::from_quaternion(quaternion)
                .to_rotation_matrix()
                .matrix(),
        )
    } else if target.rpy[0].is_some() {
        let [r, p, y] = target.rpy.each_ref().map(read);
        if ![r, p, y].iter().all(|x| x.is_finite()) {
            return Err(format!("target {} has an orientation in part", target.name));
        }
        Some(*Rotation3::from_euler_angles(r, p, y).matrix())
    } else {
        None
    };
    // An empty cell states none.
    let std = target.std.map(&value).filter(|std| !std.is_nan());
    if let Some(std) = std.filter(|std| *std <= 0.0 || std.is_infinite()) {
        return Err(format!(
            "the standard deviation of target {} is {std:.3e} m; it is above 0",
            target.name
        ));
    }
    Ok(Some(Measured {
        place,
        orientation,
        std,
    }))
}

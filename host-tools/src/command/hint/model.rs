//! Hints for model files, robots and what is written for simulators.

use std::io::ErrorKind;

use crate::model::export::{ExportError, ExportProblem};
use crate::model::{
    AskedError, Impossible, ModelError, ModelProblem, RobotError, RobotProblem, UnknownName,
    Unphysical,
};

/// The hint for an unknown name: the nearest known one, and where all effects are listed.
pub fn of_name(unknown: &UnknownName) -> Option<String> {
    let all = match unknown.what {
        "effect" => " `proprio effects` lists them all",
        _ => "",
    };
    unknown
        .nearest()
        .map(|name| format!("did you mean `{name}`?{all}"))
}

/// The hint for effects that cannot be asked for.
pub fn of_asked(error: &AskedError) -> Option<String> {
    match error {
        AskedError::Name(unknown) => of_name(unknown),
        AskedError::OfBase => Some(
            "`proprio diagnose --free-base LOG -m MODEL --apply` finds it on a walk and adds it there"
                .to_owned(),
        ),
        AskedError::Formula(_) => Some("each name but q, dq, ddq, tau_rigid, temp and t is a parameter; docs/effects.md has ten formulas to begin with".to_owned()),
        AskedError::Register(_) => {
            Some("give it a name of its own: `NAME = JOINT: FORMULA`".to_owned())
        }
    }
}

/// The hint for a model file that is refused.
pub fn of_model(error: &ModelError) -> Option<String> {
    Some(match &*error.problem {
        ModelProblem::Read(cause) if cause.kind() == ErrorKind::NotFound => {
            "check the path; `proprio add EFFECT -m MODEL` makes a model file".to_owned()
        }
        ModelProblem::Read(cause) => return of_reading(cause),
        ModelProblem::Syntax(_) => {
            "compare with a new file: `proprio add viscous -m new.toml`".to_owned()
        }
        ModelProblem::UnknownKey(unknown) | ModelProblem::UnknownName(unknown) => {
            return of_name(unknown);
        }
        ModelProblem::Asked(error) => return of_asked(error),
        ModelProblem::NoFormat => "a model file begins with `format = 1`".to_owned(),
        ModelProblem::Newer { .. } => "update proprio".to_owned(),
        ModelProblem::Robot(error) => return of_robot(error),
        ModelProblem::WhichRobot => {
            "write `builtin = \"go2\"`, or `urdf = \"robot.urdf\"`".to_owned()
        }
        ModelProblem::HeldWithoutUrdf => {
            "write `urdf = \"robot.urdf\"` instead of `builtin`; `proprio export --urdf` writes the built-in one".to_owned()
        }
        ModelProblem::IsHeld { joint } => {
            format!("delete the entries of {joint}, or its line in [held]")
        }
        ModelProblem::Orientation => "for a level base write `rpy = [0.0, 0.0, 0.0]`".to_owned(),
        ModelProblem::Twice { .. } => "delete one of the two".to_owned(),
        ModelProblem::StdAlone { .. } => "delete `std`, or add `value`".to_owned(),
        ModelProblem::Impossible { fault, .. } => of_impossible(fault),
    })
}

fn of_impossible(fault: &Impossible) -> String {
    match fault {
        Impossible::Bounds { .. } => "correct the value, or delete the entry".to_owned(),
        Impossible::Deviation(_) => "give a standard deviation greater than 0".to_owned(),
        Impossible::Body(_) => {
            "delete the body's entry to return to the CAD's, or identify it again; inertias are about the joint \
             frame's origin, h is m times the centre of mass"
                .to_owned()
        }
    }
}

/// The hint for a robot that cannot be read.
pub fn of_robot(error: &RobotError) -> Option<String> {
    of_robot_problem(&error.problem)
}

fn of_robot_problem(problem: &RobotProblem) -> Option<String> {
    Some(match problem {
        RobotProblem::Read(cause) => return of_reading(cause),
        RobotProblem::Syntax(_) => {
            "`check_urdf FILE` tells more; expand a .xacro first: `xacro FILE > robot.urdf`".to_owned()
        }
        RobotProblem::UnknownType { unknown, .. }
        | RobotProblem::UnknownLink { unknown, .. }
        | RobotProblem::UnknownHeld(unknown) => return of_name(unknown),
        RobotProblem::UnsupportedType { kind: "floating", .. } => {
            "the base is fixed: delete the floating joint and the link above it, or make it `fixed`".to_owned()
        }
        RobotProblem::UnsupportedType { .. } => {
            "make it `fixed`, or write it as several revolute and prismatic joints".to_owned()
        }
        RobotProblem::Loop { .. } | RobotProblem::NoBase => {
            "a URDF is a tree: cut the loop by deleting the joint that closes it".to_owned()
        }
        RobotProblem::NoLinks => "the file is what a failed xacro leaves: `xacro FILE > robot.urdf` shows why".to_owned(),
        RobotProblem::TwoBases { .. } => "connect them by a fixed joint, or delete one".to_owned(),
        RobotProblem::Duplicate { .. } => "rename one of them".to_owned(),
        RobotProblem::Missing { .. } => "an <inertial> states the mass and all six numbers of the inertia, a joint its parent and its child".to_owned(),
        RobotProblem::Numbers { .. } => "write decimals with a point, numbers apart by spaces".to_owned(),
        RobotProblem::Axis { .. } => "write a unit vector, such as `0 1 0`".to_owned(),
        RobotProblem::NoMass { .. } => {
            "give it an <inertial> with the mass from the CAD, or make the joint `fixed`".to_owned()
        }
        RobotProblem::Unphysical { fault, .. } => of_unphysical(fault),
        RobotProblem::Xacro { .. } => "run xacro first: `xacro FILE > robot.urdf`, and name robot.urdf".to_owned(),
        RobotProblem::NoMasses => {
            "take the URDF of the maker's `_description` package that has <inertial> elements, or export it again from the CAD with masses".to_owned()
        }
        RobotProblem::NothingMoves => "at least one joint must be revolute, continuous or prismatic".to_owned(),
    })
}

fn of_unphysical(fault: &Unphysical) -> String {
    match fault {
        Unphysical::NotFinite => "correct the number".to_owned(),
        Unphysical::Mass(_) => "state the mass in kg".to_owned(),
        Unphysical::Moments(_) => {
            "state inertias in kg m^2 about the centre of mass (not the link's origin), products of inertia with the \
             signs of the matrix"
                .to_owned()
        }
    }
}

pub(super) fn of_export(error: &ExportError) -> Option<String> {
    Some(match &*error.problem {
        ExportProblem::Read(cause) => return of_reading(cause),
        ExportProblem::Syntax(_) => {
            "name the file that holds the robot itself: URDF for --urdf, MJCF for --mjcf".to_owned()
        }
        ExportProblem::Robot(problem) => return of_robot_problem(problem),
        ExportProblem::Missing(unknown) => {
            let nearest = unknown.nearest().map(|name| format!("is it called `{name}`? "));
            format!(
                "{}joints go by their names; give the file that defines them, not one that includes it",
                nearest.unwrap_or_default()
            )
        }
        ExportProblem::Elsewhere { .. } => {
            "the file must have the joints of the model's robot: inertias are about their frames".to_owned()
        }
        ExportProblem::Carried { .. } => {
            "lighten the links fixed to it in the file, or merge them into it: what was identified is their sum".to_owned()
        }
        ExportProblem::FromShapes(_) => {
            "give that body an <inertial>, so that its share is known (mass 0 shapes carry none)".to_owned()
        }
        ExportProblem::Compiler(option) => format!("delete `{option}` from <compiler>"),
        ExportProblem::Orientation(_) => "write it as `quat`; MuJoCo's `compile` tool does".to_owned(),
        ExportProblem::SeveralJoints(_) => "put each joint into a body of its own".to_owned(),
    })
}

fn of_reading(cause: &std::io::Error) -> Option<String> {
    match cause.kind() {
        ErrorKind::NotFound => Some("check the path".to_owned()),
        ErrorKind::PermissionDenied => Some("make the file readable: `chmod +r FILE`".to_owned()),
        ErrorKind::IsADirectory => Some("name a file, not a directory".to_owned()),
        ErrorKind::InvalidData => Some("the file is not text (UTF-8)".to_owned()),
        _ => None,
    }
}

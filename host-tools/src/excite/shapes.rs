//! A file of shapes that a robot must stay clear of: its own, and what stands around it.
//!
//! ```toml
//! [[capsule]]                      # all points within `radius` of a segment
//! name = "forearm"
//! body = "joint_4"                 # the joint that moves it; none: it stands still
//! ends = [[0, 0, 0], [0, -0.2, 0]] # in that joint's frame (in the base's), m
//! radius = 0.05                    # m
//!
//! [[plane]]                        # all that moves stays where normal · p ≥ offset, in the base's frame
//! name = "table"
//! normal = [0, 0, 1]
//! offset = -0.1                    # m
//! ```
//!
//! Every capsule on a body stays clear of every one that stands still and of every plane; bodies stay clear of each other
//! where `apart = [["forearm", "upper arm"]]` says so. A Go2's legs have capsules of their own already.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Deserialize;

use super::ExciteError;
use super::clearance::{Capsule, Clearance, Plane};
use crate::model::{BASE, Limb, Model, UnknownName};

/// A file's shapes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shapes {
    #[serde(default)]
    apart: Vec<[String; 2]>,
    #[serde(default)]
    capsule: Vec<StatedCapsule>,
    #[serde(default)]
    plane: Vec<StatedPlane>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct StatedCapsule {
    name: String,
    body: Option<String>,
    ends: [[f64; 3]; 2],
    radius: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct StatedPlane {
    name: String,
    normal: [f64; 3],
    offset: f64,
}

/// A file that holds no shapes.
#[derive(Debug, thiserror::Error)]
pub enum ShapesError {
    /// It cannot be read.
    #[error("{path}: {source}", path = .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It is not what a file of shapes is; the message names the line.
    #[error("{path}: {source}", path = .path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: Box<toml::de::Error>,
    },
}

impl Shapes {
    /// Reads a file.
    ///
    /// # Errors
    /// [`ShapesError`].
    pub fn read(path: &Path) -> Result<Self, ShapesError> {
        let text = std::fs::read_to_string(path).map_err(|source| ShapesError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text).map_err(|source| ShapesError::Parse {
            path: path.to_owned(),
            source: Box::new(source),
        })
    }

    /// Those of a text in the form of such a file.
    ///
    /// # Errors
    /// What is wrong with it, with its line.
    pub fn parse(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }

    /// What `limb` must stay clear of.
    pub(super) fn of_limb(&self, model: &Model, limb: &Limb) -> Result<Clearance, ExciteError> {
        let mut capsules = Vec::new();
        for stated in &self.capsule {
            let body = match &stated.body {
                None => None,
                Some(name) => Some(model.robot().joint(name)?).filter(|joint| *joint != BASE),
            };
            // A capsule on another limb is that limb's to keep clear of.
            if body.is_none_or(|body| limb.bodies.contains(&body)) {
                capsules.push(stated.capsule(body.map(|body| body - limb.bodies.start))?);
            }
        }
        let moving = |c: &usize| capsules[*c].body.is_some();
        let all: Vec<usize> = (0..capsules.len()).collect();
        let (own, still): (Vec<usize>, Vec<usize>) = all.into_iter().partition(moving);
        let across = own.iter().flat_map(|&a| still.iter().map(move |&b| [b, a]));
        let mut pairs: Vec<[usize; 2]> = across.collect();
        for pair in &self.apart {
            if let [Some(a), Some(b)] = [
                self.place(&pair[0], &capsules)?,
                self.place(&pair[1], &capsules)?,
            ] {
                pairs.push([a, b]);
            }
        }
        let planes = self
            .plane
            .iter()
            .map(|plane| Ok((plane.plane()?, own.clone())));
        let planes = planes.collect::<Result<_, ExciteError>>()?;
        Ok(Clearance {
            capsules,
            pairs,
            planes,
        })
    }

    /// Where a capsule of the file is among a limb's; `None` if it is another limb's.
    fn place(&self, name: &str, capsules: &[Capsule]) -> Result<Option<usize>, ExciteError> {
        if !self.capsule.iter().any(|stated| stated.name == name) {
            let names = self.capsule.iter().map(|stated| stated.name.as_str());
            return Err(UnknownName::new("capsule", name, names).into());
        }
        Ok(capsules.iter().position(|capsule| capsule.name == name))
    }
}

impl StatedCapsule {
    fn capsule(&self, body: Option<usize>) -> Result<Capsule, ExciteError> {
        let wrong = |problem| ExciteError::Shape {
            name: self.name.clone(),
            problem,
        };
        if !self.ends.iter().flatten().all(|x| x.is_finite()) {
            return Err(wrong("its ends must be finite numbers"));
        }
        if !(self.radius > 0.0 && self.radius.is_finite()) {
            return Err(wrong("its radius must be a positive number"));
        }
        Ok(Capsule {
            name: self.name.clone(),
            body,
            ends: self.ends.map(Vector3::from),
            radius: self.radius,
        })
    }
}

impl StatedPlane {
    fn plane(&self) -> Result<Plane, ExciteError> {
        let normal = Vector3::from(self.normal);
        let length = normal.norm();
        if !(length > 1e-9 && length.is_finite() && self.offset.is_finite()) {
            return Err(ExciteError::Shape {
                name: self.name.clone(),
                problem: "its normal must have a length and its offset be a finite number",
            });
        }
        Ok(Plane {
            name: self.name.clone(),
            normal: normal / length,
            offset: self.offset / length,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legs_own_shapes_stay_clear_of_what_stands_around_it() {
        let model = Model::default();
        let limb = &model.robot().limbs()[0];
        let own = super::super::go2::clearance(proprio_core::go2::Leg::FR, true, None);
        let (capsules, pairs) = (own.capsules.len(), own.pairs.len());
        let moving = own.capsules.iter().filter(|c| c.body.is_some()).count();
        let text = "[[capsule]]\nname = \"pillar\"\nends = [[1, 0, 0], [1, 0, -1]]\nradius = 0.1\n\
                    [[plane]]\nname = \"wall\"\nnormal = [-1, 0, 0]\noffset = -2";
        let stated = Shapes::parse(text).unwrap();
        let all = own.and(stated.of_limb(&model, limb).unwrap());
        assert_eq!(all.capsules.len(), capsules + 1);
        assert_eq!(all.pairs.len(), pairs + moving);
        assert!(
            all.pairs[pairs..]
                .iter()
                .all(|[pillar, _]| *pillar == capsules)
        );
        assert_eq!(all.planes.last().unwrap().1.len(), moving);
    }

    #[test]
    fn capsules_stay_clear_of_what_stands_still_and_of_each_other_where_stated() {
        let text = r#"
            apart = [["calf", "hip"]]
            [[capsule]]
            name = "pillar"
            ends = [[0.3, 0, 0], [0.3, 0, -1]]
            radius = 0.1
            [[capsule]]
            name = "hip"
            body = "FR_hip"
            ends = [[0, 0, 0], [0, 0.1, 0]]
            radius = 0.04
            [[capsule]]
            name = "calf"
            body = "FR_calf"
            ends = [[0, 0, 0], [0, 0, -0.2]]
            radius = 0.02
            [[capsule]]
            name = "other"
            body = "FL_calf"
            ends = [[0, 0, 0], [0, 0, -0.2]]
            radius = 0.02
            [[plane]]
            name = "floor"
            normal = [0, 0, 2]
            offset = -1
        "#;
        let model = Model::default();
        let limb = &model.robot().limbs()[0];
        let clearance = Shapes::parse(text).unwrap().of_limb(&model, limb).unwrap();
        assert_eq!(clearance.pairs, [[0, 1], [0, 2], [2, 1]]);
        let (plane, own) = &clearance.planes[0];
        assert_eq!((plane.offset, own), (-0.5, &vec![1, 2]));
        let error = |text: &str| {
            let shapes = Shapes::parse(text).unwrap();
            shapes.of_limb(&model, limb).unwrap_err().to_string()
        };
        let capsule = "[[capsule]]\nname = \"a\"\nends = [[0, 0, 0], [0, 0, 1]]\n";
        assert!(error(&format!("{capsule}radius = -1")).contains("radius"));
        assert!(error(&format!("{capsule}radius = nan")).contains("radius"));
        assert!(error(&format!("{capsule}radius = 1\nbody = \"FR_knee\"")).contains("FR_knee"));
        assert!(error("apart = [[\"a\", \"b\"]]").contains("capsule"));
        assert!(
            error("[[plane]]\nname = \"a\"\nnormal = [0, 0, 0]\noffset = 0").contains("normal")
        );
        assert!(Shapes::parse("[[cylinder]]").is_err());
    }
}

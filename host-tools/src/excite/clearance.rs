//! What a limb must stay clear of: capsules on its bodies and on the base, and planes.
//!
//! The distance of two capsules is that of their segments less their radii. Its slope by a joint is that of the two nearest
//! points along the line between them, each moving with its body: where the nearest points are unique the distance is smooth
//! in them (Danskin), elsewhere it has a kink that a search may meet and a proof need not mind.

use nalgebra::Vector3;
use proprio_core::spatial::Transform;

use super::limb::Limb;

/// All points within `radius` of a segment, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Capsule {
    /// What it stands for, in words.
    pub name: String,
    /// The limb's body that it is part of; `None` for the base.
    pub body: Option<usize>,
    /// The segment's ends in that body's joint frame (in the base's), m.
    pub ends: [Vector3<f64>; 2],
    /// m.
    pub radius: f64,
}

/// A half-space in the base's frame that a capsule must stay in: n·p ≥ offset for every point of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// What it stands for, in words.
    pub name: String,
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// m.
    pub offset: f64,
}

/// What must stay apart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clearance {
    /// The shapes.
    pub capsules: Vec<Capsule>,
    /// Pairs of them that must not touch.
    pub pairs: Vec<[usize; 2]>,
    /// Planes and the capsules that must stay on their side.
    pub planes: Vec<(Plane, Vec<usize>)>,
}

/// One distance at a position, m.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Distance {
    pub(super) value: f64,
    /// The direction in which it grows.
    along: Vector3<f64>,
    /// The points between which it is, each with its body: the first one's motion along that direction makes it grow.
    between: [(Option<usize>, Vector3<f64>); 2],
}

/// All distances at a position.
#[derive(Debug, Clone, Default)]
pub(super) struct Distances {
    pub(super) all: Vec<Distance>,
    pose: Pose,
}

impl Distances {
    /// Adds the slopes of `push` times the n-th distance by the joints' positions.
    pub(super) fn push(&self, n: usize, push: f64, by_q: &mut [f64]) {
        let Distance { along, between, .. } = &self.all[n];
        for ((body, point), push) in between.iter().zip([push, -push]) {
            let mut next = *body;
            while let Some(j) = next {
                by_q[j] += push * along.dot(&self.pose.velocity(j, point));
                next = self.pose.parents[j];
            }
        }
    }
}

impl Clearance {
    /// These shapes and `others`: what moves of either stays clear of what stands still, and of the planes, of `others`.
    pub(super) fn and(mut self, others: Self) -> Self {
        let first = self.capsules.len();
        let own: Vec<usize> = (0..first)
            .filter(|&c| self.capsules[c].body.is_some())
            .collect();
        let still = (0..others.capsules.len()).filter(|&c| others.capsules[c].body.is_none());
        let across = still.flat_map(|c| own.iter().map(move |&m| [first + c, m]));
        let pairs = others.pairs.iter().map(|pair| pair.map(|c| first + c));
        self.pairs.extend(pairs.chain(across));
        for (plane, moving) in others.planes {
            let moving = moving.into_iter().map(|c| first + c);
            self.planes
                .push((plane, own.iter().copied().chain(moving).collect()));
        }
        self.capsules.extend(others.capsules);
        self
    }

    /// How many distances there are.
    pub(super) fn count(&self) -> usize {
        let of_planes: usize = self
            .planes
            .iter()
            .map(|(_, capsules)| 2 * capsules.len())
            .sum();
        self.pairs.len() + of_planes
    }

    /// What the n-th distance is between.
    pub(super) fn name(&self, n: usize) -> String {
        let capsule = |c: usize| &self.capsules[c].name;
        if let Some([a, b]) = self.pairs.get(n) {
            return format!("{} to {}", capsule(*a), capsule(*b));
        }
        let mut rest = n - self.pairs.len();
        for (plane, capsules) in &self.planes {
            if rest < 2 * capsules.len() {
                return format!("{} to {}", capsule(capsules[rest / 2]), plane.name);
            }
            rest -= 2 * capsules.len();
        }
        String::new()
    }

    /// All distances at a position.
    pub(super) fn distances(&self, limb: &dyn Limb, q: &[f64]) -> Distances {
        if self.capsules.is_empty() {
            return Distances::default();
        }
        let pose = Pose::new(limb, q);
        let ends: Vec<[Vector3<f64>; 2]> = self.capsules.iter().map(|c| pose.ends(c)).collect();
        let mut all = Vec::with_capacity(self.count());
        for &[a, b] in &self.pairs {
            let [p, r] = nearest(&ends[a], &ends[b]);
            let apart = p - r;
            let length = apart.norm().max(1e-9);
            let (a, b) = (&self.capsules[a], &self.capsules[b]);
            all.push(Distance {
                value: length - a.radius - b.radius,
                along: apart / length,
                between: [(a.body, p), (b.body, r)],
            });
        }
        for (plane, capsules) in &self.planes {
            for &c in capsules {
                let capsule = &self.capsules[c];
                all.extend(ends[c].iter().map(|end| Distance {
                    value: plane.normal.dot(end) - plane.offset - capsule.radius,
                    along: plane.normal,
                    between: [(capsule.body, *end), (None, *end)],
                }));
            }
        }
        Distances { all, pose }
    }

    /// For each joint the most that any distance can change per rad (m per m of a sliding joint), wherever the joints are: how
    /// far from its axis what it moves can reach.
    pub(super) fn reach(&self, limb: &dyn Limb) -> Vec<f64> {
        let (parents, frames, axes) = (limb.parents(), limb.frames(), limb.axes());
        let from = |joint: usize, capsule: &Capsule| {
            // Along the chain from the joint to the capsule, if it moves it at all.
            let Some(mut body) = capsule.body else {
                return 0.0;
            };
            let [a, b] = &capsule.ends;
            let mut length = a.norm().max(b.norm());
            while body != joint {
                // A joint that slides may be anywhere within its stops: its own length is not known here.
                length += frames[body].translation.norm();
                match parents[body] {
                    Some(parent) => body = parent,
                    None => return 0.0,
                }
            }
            length
        };
        let most = |joint: usize| {
            if !axes[joint].1 {
                return 1.0;
            }
            let reaches = self.capsules.iter().map(|c| from(joint, c));
            reaches.fold(0.0, f64::max)
        };
        (0..limb.joints()).map(most).collect()
    }
}

/// Where everything is.
#[derive(Debug, Clone, Default)]
struct Pose {
    placements: Vec<Transform<f64>>,
    /// Axes in the base's frame, and whether the joint turns.
    axes: Vec<(Vector3<f64>, bool)>,
    /// The body that carries each body.
    parents: Vec<Option<usize>>,
}

impl Pose {
    fn new(limb: &dyn Limb, q: &[f64]) -> Self {
        let placements = limb.placements(q);
        let own = limb.axes().into_iter().zip(&placements);
        let axes = own
            .map(|((axis, turns), at)| (at.rotation * axis, turns))
            .collect();
        Self {
            placements,
            axes,
            parents: limb.parents(),
        }
    }

    fn ends(&self, capsule: &Capsule) -> [Vector3<f64>; 2] {
        match capsule.body {
            None => capsule.ends,
            Some(b) => capsule
                .ends
                .map(|end| self.placements[b].rotation * end + self.placements[b].translation),
        }
    }

    /// Velocity of the point `p` of a body that joint j moves, when it moves at unit rate.
    fn velocity(&self, j: usize, p: &Vector3<f64>) -> Vector3<f64> {
        let (axis, turns) = &self.axes[j];
        if *turns {
            axis.cross(&(p - self.placements[j].translation))
        } else {
            *axis
        }
    }
}

/// The nearest points of two segments (Ericson, *Real-Time Collision Detection*, §5.1.9).
fn nearest(a: &[Vector3<f64>; 2], b: &[Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let small = 1e-12;
    let (s, t) = if uu < small && vv < small {
        (0.0, 0.0)
    } else if uu < small {
        (0.0, (vw / vv).clamp(0.0, 1.0))
    } else if vv < small {
        ((-uw / uu).clamp(0.0, 1.0), 0.0)
    } else {
        let square = uu * vv - uv * uv;
        let s = if square > small * uu * vv {
            ((uv * vw - uw * vv) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let t = (uv * s + vw) / vv;
        if t < 0.0 {
            ((-uw / uu).clamp(0.0, 1.0), 0.0)
        } else if t > 1.0 {
            (((uv - uw) / uu).clamp(0.0, 1.0), 1.0)
        } else {
            (s, t)
        }
    };
    [a[0] + u * s, b[0] + v * t]
}

//! Rigid bodies on a base that nothing holds, of any robot: the core's trees, which are compiled for a few sizes.
//!
//! A robot of fewer joints than its tree has joints at the tree's end that move nothing: massless bodies on the base, whose coordinates nobody
//! reads.

use nalgebra::Vector3;
use nalgebra::{DMatrix, DVector, SVector};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::{Motion, Transform};
use proprio_core::tree::{Body, Joint, Kinematics, Tree};

/// The trunk's coordinates, before those of the joints.
pub(super) const TRUNK: usize = 6;

/// Where the bodies are and what their motion takes, at one instant.
pub(super) struct Instant {
    /// In the world.
    pub(super) frames: Vec<Transform<f64>>,
    /// Twist of each body in its own axes.
    pub(super) velocity: Vec<Motion<f64>>,
    /// Forces that no acceleration takes, N m and N.
    pub(super) bias: DVector<f64>,
    pub(super) inertia: DMatrix<f64>,
}

/// The bodies' mechanics, whatever their number.
pub(super) trait Mechanics: Send {
    /// With the trunk at `base`, the joints at `q` (rad, m) and the velocities `v`, the trunk's twist in its own axes first.
    fn at(&self, base: &Transform<f64>, q: &DVector<f64>, v: &DVector<f64>) -> Instant;

    /// The bodies under a level trunk at the origin, and what holds them there, N m and N.
    fn held(&self, q: &DVector<f64>) -> (Vec<Transform<f64>>, DVector<f64>);

    /// m/s², in the world.
    fn gravity(&self) -> Vector3<f64>;

    /// Kinetic and potential, J.
    #[cfg(test)]
    fn energy(&self, base: &Transform<f64>, q: &DVector<f64>, v: &DVector<f64>) -> (f64, f64);
}

/// A tree, and how many of its bodies are the robot's.
struct Compiled<const B: usize, const V: usize> {
    tree: Tree<f64, B, V>,
    bodies: usize,
}

macro_rules! sizes {
    ($($joints:literal),*) => {
        /// Most joints that a robot can have.
        pub(super) const MOST_JOINTS: usize = {
            let sizes = [$($joints),*];
            sizes[sizes.len() - 1]
        };

        /// The mechanics of a trunk and the bodies it carries; none of more than there are trees for, or of such as make no tree.
        pub(super) fn mechanics(bodies: &[Body<f64>]) -> Option<Box<dyn Mechanics>> {
            $(if bodies.len() <= $joints + 1 {
                return Some(Box::new(Compiled::<{ $joints + 1 }, { $joints + TRUNK }>::new(bodies)?));
            })*
            None
        }
    };
}

// A quadruped; one with an arm, or a robot of six legs; more joints than these.
sizes!(12, 20, 32, 48);

impl<const B: usize, const V: usize> Compiled<B, V> {
    fn new(bodies: &[Body<f64>]) -> Option<Self> {
        let mut all = bodies.to_vec();
        all.resize(
            B,
            Body {
                parent: Some(0),
                placement: Transform::identity(),
                joint: Joint::Revolute(Vector3::z()),
                inertia: InertialParameters::zero(),
            },
        );
        Some(Self {
            tree: Tree::new(all.try_into().ok()?).ok()?,
            bodies: bodies.len(),
        })
    }

    fn coordinates(&self) -> usize {
        TRUNK + self.bodies - 1
    }

    /// The tree does not read the trunk's positions.
    fn kinematics(
        &self,
        base: &Transform<f64>,
        q: &DVector<f64>,
        v: &DVector<f64>,
    ) -> (Kinematics<f64, B, V>, SVector<f64, V>) {
        let [mut positions, mut rates] = [SVector::<f64, V>::zeros(); 2];
        positions.rows_mut(TRUNK, q.len()).copy_from(q);
        rates.rows_mut(0, v.len()).copy_from(v);
        (self.tree.kinematics(base, &positions, &rates), rates)
    }

    fn frames(&self, k: &Kinematics<f64, B, V>) -> Vec<Transform<f64>> {
        let mut frames: Vec<Transform<f64>> = Vec::with_capacity(self.bodies);
        let own = self.tree.bodies().iter().zip(&k.placements.from_parent);
        for (body, placed) in own.take(self.bodies) {
            let frame = body
                .parent
                .map_or(*placed, |parent| frames[parent].compose(placed));
            frames.push(frame);
        }
        frames
    }
}

impl<const B: usize, const V: usize> Mechanics for Compiled<B, V> {
    fn at(&self, base: &Transform<f64>, q: &DVector<f64>, v: &DVector<f64>) -> Instant {
        let (k, rates) = self.kinematics(base, q, v);
        let n = self.coordinates();
        let bias = self.tree.inverse_dynamics(&k, &rates, &SVector::zeros());
        Instant {
            frames: self.frames(&k),
            velocity: k.velocity[..self.bodies].to_vec(),
            bias: bias.rows(0, n).into_owned(),
            inertia: self
                .tree
                .inertia_matrix(&k)
                .view((0, 0), (n, n))
                .into_owned(),
        }
    }

    fn held(&self, q: &DVector<f64>) -> (Vec<Transform<f64>>, DVector<f64>) {
        let (k, _) = self.kinematics(&Transform::identity(), q, &DVector::zeros(0));
        let torque = self.tree.gravity_torque(&k);
        let own = torque.rows(0, self.coordinates()).into_owned();
        (self.frames(&k), own)
    }

    fn gravity(&self) -> Vector3<f64> {
        self.tree.gravity()
    }

    #[cfg(test)]
    fn energy(&self, base: &Transform<f64>, q: &DVector<f64>, v: &DVector<f64>) -> (f64, f64) {
        self.tree.energy(&self.kinematics(base, q, v).0, base)
    }
}

//! Vectors carried through one joint, at the cost that the joint asks for.
//!
//! Most joints of most robots turn about a coordinate axis of a frame that is parallel to the parent's: four
//! multiplications carry a vector, not nine, and the axis itself costs none. The algorithms are written once, for a
//! [`JointFrame`], and compiled for each kind of joint; [`by_joint`] picks the kind, which depends on the tree alone.

use super::{Body, Joint};
use crate::Real;
use crate::spatial::Transform;
use nalgebra::{Matrix3, Vector3};

/// Which [`JointFrame`] a body's joint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointKind {
    /// [`Joint::Free`].
    Free,
    /// Turns about the parent's and its own x axis.
    AboutX,
    /// Turns about the parent's and its own y axis.
    AboutY,
    /// Turns about the parent's and its own z axis.
    AboutZ,
    /// Turns about any axis.
    Turning,
    /// Slides along any axis.
    Sliding,
}

impl JointKind {
    pub(crate) fn of<T: Real>(body: &Body<T>) -> Self {
        let parallel = body.placement.rotation == Matrix3::identity();
        match body.joint {
            Joint::Free => Self::Free,
            Joint::Prismatic(_) => Self::Sliding,
            Joint::Revolute(axis) if parallel && axis == Vector3::x() => Self::AboutX,
            Joint::Revolute(axis) if parallel && axis == Vector3::y() => Self::AboutY,
            Joint::Revolute(axis) if parallel && axis == Vector3::z() => Self::AboutZ,
            Joint::Revolute(_) => Self::Turning,
        }
    }
}

/// Calls `$self.$step::<J>($args)` with the [`JointFrame`] J of body `$b`; `$free` where the joint is free.
macro_rules! by_joint {
    ($self:ident.$step:ident($b:expr $(, $args:expr)*), free: $free:expr) => {{
        use $crate::tree::joint_frame::{AboutAxis, AnyAxis, JointKind};
        match $self.kind($b) {
            JointKind::Free => $free,
            JointKind::AboutX => $self.$step::<AboutAxis<T, 0>>($b $(, $args)*),
            JointKind::AboutY => $self.$step::<AboutAxis<T, 1>>($b $(, $args)*),
            JointKind::AboutZ => $self.$step::<AboutAxis<T, 2>>($b $(, $args)*),
            JointKind::Turning => $self.$step::<AnyAxis<T, false>>($b $(, $args)*),
            JointKind::Sliding => $self.$step::<AnyAxis<T, true>>($b $(, $args)*),
        }
    }};
}
pub(crate) use by_joint;

/// A joint of one degree of freedom at one position: carries vectors between the child's axes and the parent's.
pub(crate) trait JointFrame<T: Real>: Copy {
    /// Whether the joint slides along its axis s; otherwise it turns about it.
    const SLIDES: bool;

    /// The joint of a body that is placed so in its parent.
    fn new(placement: &Transform<T>, joint: &Joint<T>) -> Self;

    /// A vector in the parent's axes, given in the child's: R v.
    fn to_parent(&self, v: &Vector3<T>) -> Vector3<T>;

    /// A vector in the child's axes, given in the parent's: Rᵀ v.
    fn to_child(&self, v: &Vector3<T>) -> Vector3<T>;

    /// `m` R.
    fn after(&self, m: &Matrix3<T>) -> Matrix3<T>;

    /// The joint's axis s, in the child's axes; in the parent's it is the same for a joint about a coordinate axis.
    fn axis(&self) -> Vector3<T>;

    /// s · v.
    fn along(&self, v: &Vector3<T>) -> T;

    /// v + s x.
    fn plus_along(&self, v: &Vector3<T>, x: T) -> Vector3<T>;

    /// v × s.
    fn cross_axis(&self, v: &Vector3<T>) -> Vector3<T>;

    /// Σ s_i `rows`_i: the combination of three rows along the axis.
    fn combine<const N: usize>(&self, rows: &[[T; N]; 3]) -> [T; N];

    /// R I Rᵀ of a symmetric matrix (xx, xy, xz, yy, yz, zz).
    #[inline(always)]
    fn symmetric_to_parent(&self, i: &[T; 6]) -> [T; 6] {
        let whole = Matrix3::new(i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5]);
        let m = self.matrix_to_parent(&whole);
        [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33]
    }

    /// R M Rᵀ.
    #[inline(always)]
    fn matrix_to_parent(&self, m: &Matrix3<T>) -> Matrix3<T> {
        // Rᵀ is applied from the right by carrying the rows.
        let carried = Matrix3::from_columns(&[
            self.to_parent(&m.column(0).into_owned()),
            self.to_parent(&m.column(1).into_owned()),
            self.to_parent(&m.column(2).into_owned()),
        ]);
        let row = |n: usize| self.to_parent(&carried.row(n).transpose()).transpose();
        Matrix3::from_rows(&[row(0), row(1), row(2)])
    }
}

/// Where entry (i, j) of a symmetric matrix lies among its six numbers.
const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// A joint that turns about coordinate axis `AXIS` (0 x, 1 y, 2 z) of a frame parallel to its parent's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AboutAxis<T, const AXIS: usize> {
    sin: T,
    cos: T,
}

impl<T: Real, const AXIS: usize> AboutAxis<T, AXIS> {
    /// The axes that the joint turns, in cyclic order after its own.
    const J: usize = (AXIS + 1) % 3;
    const K: usize = (AXIS + 2) % 3;

    /// Writes the rotation by an angle into a rotation of the same joint, or the identity.
    pub(crate) fn write(rotation: &mut Matrix3<T>, (sin, cos): (T, T)) {
        rotation[(Self::J, Self::J)] = cos;
        rotation[(Self::K, Self::K)] = cos;
        rotation[(Self::K, Self::J)] = sin;
        rotation[(Self::J, Self::K)] = -sin;
    }
}

impl<T: Real, const AXIS: usize> JointFrame<T> for AboutAxis<T, AXIS> {
    const SLIDES: bool = false;

    #[inline(always)]
    fn new(placement: &Transform<T>, _: &Joint<T>) -> Self {
        let rotation = &placement.rotation;
        Self {
            sin: rotation[(Self::K, Self::J)],
            cos: rotation[(Self::J, Self::J)],
        }
    }

    #[inline(always)]
    fn to_parent(&self, v: &Vector3<T>) -> Vector3<T> {
        let mut carried = *v;
        carried[Self::J] = self.cos * v[Self::J] - self.sin * v[Self::K];
        carried[Self::K] = self.sin * v[Self::J] + self.cos * v[Self::K];
        carried
    }

    #[inline(always)]
    fn to_child(&self, v: &Vector3<T>) -> Vector3<T> {
        let mut carried = *v;
        carried[Self::J] = self.cos * v[Self::J] + self.sin * v[Self::K];
        carried[Self::K] = self.cos * v[Self::K] - self.sin * v[Self::J];
        carried
    }

    #[inline(always)]
    fn after(&self, m: &Matrix3<T>) -> Matrix3<T> {
        let mut product = *m;
        for row in 0..3 {
            let (j, k) = (m[(row, Self::J)], m[(row, Self::K)]);
            product[(row, Self::J)] = j * self.cos + k * self.sin;
            product[(row, Self::K)] = k * self.cos - j * self.sin;
        }
        product
    }

    #[inline(always)]
    fn axis(&self) -> Vector3<T> {
        Vector3::ith(AXIS, T::one())
    }

    #[inline(always)]
    fn along(&self, v: &Vector3<T>) -> T {
        v[AXIS]
    }

    #[inline(always)]
    fn plus_along(&self, v: &Vector3<T>, x: T) -> Vector3<T> {
        let mut sum = *v;
        sum[AXIS] += x;
        sum
    }

    #[inline(always)]
    fn cross_axis(&self, v: &Vector3<T>) -> Vector3<T> {
        let mut product = Vector3::zeros();
        product[Self::J] = v[Self::K];
        product[Self::K] = -v[Self::J];
        product
    }

    #[inline(always)]
    fn combine<const N: usize>(&self, rows: &[[T; N]; 3]) -> [T; N] {
        rows[AXIS]
    }

    #[inline(always)]
    fn symmetric_to_parent(&self, i: &[T; 6]) -> [T; 6] {
        let (ij, ik) = (PLACE[AXIS][Self::J], PLACE[AXIS][Self::K]);
        let (jj, jk, kk) = (
            PLACE[Self::J][Self::J],
            PLACE[Self::J][Self::K],
            PLACE[Self::K][Self::K],
        );
        let (sin, cos) = (self.sin, self.cos);
        let mut carried = *i;
        carried[ij] = cos * i[ij] - sin * i[ik];
        carried[ik] = sin * i[ij] + cos * i[ik];
        // R of the block's columns, then of its rows; what turns out of one diagonal entry turns into the other.
        let (a, b) = (cos * i[jj] - sin * i[jk], cos * i[jk] - sin * i[kk]);
        carried[jj] = cos * a - sin * b;
        carried[jk] = sin * a + cos * b;
        carried[kk] = i[jj] + i[kk] - carried[jj];
        carried
    }
}

/// A joint that turns about any axis or slides along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnyAxis<T, const SLIDES: bool> {
    rotation: Matrix3<T>,
    axis: Vector3<T>,
}

impl<T: Real, const SLIDES: bool> JointFrame<T> for AnyAxis<T, SLIDES> {
    const SLIDES: bool = SLIDES;

    #[inline(always)]
    fn new(placement: &Transform<T>, joint: &Joint<T>) -> Self {
        let axis = match joint {
            Joint::Revolute(axis) | Joint::Prismatic(axis) => *axis,
            Joint::Free => Vector3::zeros(),
        };
        Self {
            rotation: placement.rotation,
            axis,
        }
    }

    #[inline(always)]
    fn to_parent(&self, v: &Vector3<T>) -> Vector3<T> {
        self.rotation * v
    }

    #[inline(always)]
    fn to_child(&self, v: &Vector3<T>) -> Vector3<T> {
        self.rotation.tr_mul(v)
    }

    #[inline(always)]
    fn after(&self, m: &Matrix3<T>) -> Matrix3<T> {
        m * self.rotation
    }

    #[inline(always)]
    fn axis(&self) -> Vector3<T> {
        self.axis
    }

    #[inline(always)]
    fn along(&self, v: &Vector3<T>) -> T {
        self.axis.dot(v)
    }

    #[inline(always)]
    fn plus_along(&self, v: &Vector3<T>, x: T) -> Vector3<T> {
        v + self.axis * x
    }

    #[inline(always)]
    fn cross_axis(&self, v: &Vector3<T>) -> Vector3<T> {
        v.cross(&self.axis)
    }

    #[inline(always)]
    fn combine<const N: usize>(&self, rows: &[[T; N]; 3]) -> [T; N] {
        let s = &self.axis;
        core::array::from_fn(|n| rows[0][n] * s.x + rows[1][n] * s.y + rows[2][n] * s.z)
    }
}

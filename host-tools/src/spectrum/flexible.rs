//! The flexible joint model, linearised: torque to motor position of a robot with a spring and a damper at each joint.
//!
//! With s = jω, H the links' inertia matrix, K_g the stiffness of gravity, S = diag(k + s d), motors of inertia J and viscous friction F_v,
//! and links with viscous friction F_l:
//!
//! A = s² H + K_g + s diag(F_l) + S,   Z = s² diag(J) + s diag(F_v) + S − S A⁻¹ S,   P = Z⁻¹   (Wernholt & Moberg 2011).
//!
//! Motors are eliminated first, for they meet only their own spring: with M = s² J + s F_v, Z₀ = M + S and w = S/Z₀, all diagonal,
//! the links answer torque by X = B⁻¹ w, B = s² H + K_g + s F_l + M w, and the motors by P = Z₀⁻¹ + w X. One matrix is inverted, and stiff springs do not
//! cancel.
//!
//! A drive that holds its torque for T and samples at the same instants sees the aliases of P times the hold's response:
//! G(ω) = e^{−jωδ} Σ_a P(s_a) (1 − e^{−jωT})/(s_a T), s_a = j(ω + 2πa/T). P falls as 1/s², so that three terms suffice at low lines and
//! seven everywhere; no matrix exponential is needed, and derivatives are those of P.
//!
//! Links and bearings that bend are further coordinates of the links, without a motor: B has their rows too, with k_e + s d_e on its diagonal, and X has
//! their motion (Moberg & Hanssen 2007, the extended flexible joint model).
//!
//! A derivative of P is −v vᵀ times a factor: to k and d of joint i v is what the spring is stretched by, (P − X)ᵀ e_i = Z₀⁻¹ (1 − M X)ᵀ e_i, to those of a
//! bend its motion. Bodies enter by H alone: derivatives to its elements are made, and a factor over these becomes one over bodies ([`Plant::over_bodies`]).

use std::ops::Range;

use nalgebra::{DMatrix, DVectorView};
use realfft::num_complex::Complex64;

use super::layout::{Layout, Unknown};
use super::linear::fold;
use crate::estimate::factor::HeapFactor;

/// Aliases to each side below [`FEW_BELOW`] of the sampling rate, and above: what is left out is (f/f_s)³, 1e-4 and 3e-3 of the response.
const FEW_ALIASES: i32 = 1;
const ALL_ALIASES: i32 = 3;
const FEW_BELOW: f64 = 0.12;

/// What a point's responses are computed with.
#[derive(Debug, Clone)]
pub(super) struct Plant {
    /// How many joints have motors: the first coordinates. The others are bends.
    pub(super) motors: usize,
    /// H at the point, kg m².
    pub(super) inertia: DMatrix<f64>,
    /// ∂g/∂q, N m/rad.
    pub(super) gravity: DMatrix<f64>,
    /// Derivatives of H to each rigid unknown.
    pub(super) rigid: Vec<DMatrix<f64>>,
}

impl Plant {
    /// What the unknowns of [`Derived`] are made of: a row for each, and one for a right-hand side, over those of a layout with bodies.
    fn bodies(&self, layout: &Layout) -> DMatrix<f64> {
        let count = layout.unknowns.len();
        let plain = layout.unknowns.iter().filter(|u| !u.is_body()).count();
        let elements: Vec<(usize, usize)> = upper(self.inertia.nrows()).collect();
        let rows = plain + elements.len();
        let mut map = DMatrix::zeros(rows + 1, count + 1);
        map[(rows, count)] = 1.0;
        let mut next = 0..plain;
        for (index, unknown) in layout.unknowns.iter().enumerate() {
            if let Unknown::Rigid(m) = *unknown {
                for (row, &element) in (plain..).zip(&elements) {
                    map[(row, index)] = self.rigid[m][element];
                }
            } else if let Some(row) = next.next() {
                map[(row, index)] = 1.0;
            }
        }
        map
    }

    /// A factor over a layout's unknowns from one over those of [`Derived`]: what H's elements ask of the bodies.
    pub(super) fn over_bodies(&self, layout: &Layout, own: HeapFactor) -> HeapFactor {
        if !layout.unknowns.iter().any(|u| u.is_body()) {
            return own;
        }
        // Its columns are the rows of the triangle, one after the other.
        let mut rows = self.bodies(layout).tr_mul(&own.dense().transpose());
        let mut all = HeapFactor::new(layout.unknowns.len());
        fold(&mut all, rows.as_mut_slice());
        all
    }
}

/// The elements of a symmetric matrix on and above its diagonal, row by row.
fn upper(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (i..n).map(move |j| (i, j)))
}

/// The place of an element of a symmetric matrix among those of [`upper`].
fn place(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (2 * n - i + 1) / 2 + j - i
}

/// A response and its derivatives: to the unknowns of a layout that are not bodies, in their order, then, if it has bodies, to the elements of H on and
/// above its diagonal.
pub(super) struct Derived {
    pub(super) response: DMatrix<Complex64>,
    /// Of each element of the response on and above its diagonal, which is symmetric, the derivatives side by side.
    slopes: Vec<Complex64>,
    unknowns: usize,
}

impl Derived {
    /// Derivatives of an element.
    pub(super) fn slopes(&self, i: usize, j: usize) -> &[Complex64] {
        let first = place(self.response.nrows(), i, j) * self.unknowns;
        &self.slopes[first..first + self.unknowns]
    }

    /// Derivatives of what joint i does under some torques.
    pub(super) fn slopes_of_output(
        &self,
        i: usize,
        torque: DVectorView<'_, Complex64>,
    ) -> Vec<Complex64> {
        let mut sum = vec![Complex64::default(); self.unknowns];
        for (j, by) in torque.iter().enumerate() {
            let slopes = self.slopes(i, j);
            sum.iter_mut()
                .zip(slopes)
                .for_each(|(sum, slope)| *sum += slope * by);
        }
        sum
    }

    /// How many unknowns there are.
    pub(super) fn unknowns(&self) -> usize {
        self.unknowns
    }
}

/// What an unknown moves: the vector v of its derivative −v vᵀ of P.
#[derive(Clone, Copy)]
enum Moves {
    /// What a joint's spring is stretched by.
    Spring(usize),
    /// A motor.
    Motor(usize),
    /// A link or bend.
    Link(usize),
    /// Nothing: a delay.
    Nothing,
}

/// An unknown's derivative: what it moves, the power of s in its factor, and the derivative of its SI value to its entry.
type Slope = (Moves, i32, f64);

/// A point's plant at an entry of a fit: what all lines and aliases have in common.
#[derive(Clone)]
pub(super) struct At<'a> {
    plant: &'a Plant,
    /// Of each unknown that is no body.
    own: Vec<Slope>,
    has_bodies: bool,
    /// H with what the rigid unknowns make of it.
    inertia: DMatrix<f64>,
    gravity: DMatrix<f64>,
    /// Of each joint: k, d, F_v, J, F_l.
    joints: Vec<[f64; 5]>,
    /// Of each bend: k, d.
    bends: Vec<[f64; 2]>,
    delay: f64,
}

/// What moves at one s under unit torques: written over from one s to the next.
struct Motion {
    /// How many links and bends there are.
    links: usize,
    /// B, row by row, then B⁻¹.
    inverse: Vec<Complex64>,
    /// Rows that were exchanged on the way.
    exchanged: Vec<usize>,
    /// Z₀⁻¹, w and M of each joint.
    motors: Vec<[Complex64; 3]>,
    /// X: of each torque, one after the other, the links and bends.
    x: Vec<Complex64>,
    /// P, row by row.
    p: Vec<Complex64>,
}

impl Motion {
    fn new(motors: usize, links: usize) -> Self {
        let zeros = |n: usize| vec![Complex64::default(); n];
        Self {
            links,
            inverse: zeros(links * links),
            exchanged: vec![0; links],
            motors: vec![[Complex64::default(); 3]; motors],
            x: zeros(motors * links),
            p: zeros(motors * motors),
        }
    }

    /// What the links and bends do under the torque of a motor.
    fn links(&self, motor: usize) -> &[Complex64] {
        &self.x[motor * self.links..(motor + 1) * self.links]
    }

    /// B becomes its inverse in place: Gauss–Jordan with exchanged rows (Golub & Van Loan 2013, §3.4). None where it is singular.
    fn invert(&mut self) -> Option<()> {
        let n = self.links;
        let a = &mut self.inverse[..];
        for c in 0..n {
            let size = |r: &usize| a[r * n + c].norm_sqr();
            let pivot = (c..n).max_by(|r, s| size(r).total_cmp(&size(s)))?;
            self.exchanged[c] = pivot;
            if pivot != c {
                (0..n).for_each(|j| a.swap(c * n + j, pivot * n + j));
            }
            let by = a[c * n + c].inv();
            if !by.is_finite() {
                return None;
            }
            a[c * n + c] = Complex64::from(1.0);
            a[c * n..(c + 1) * n].iter_mut().for_each(|x| *x *= by);
            let (above, rest) = a.split_at_mut(c * n);
            let (row, below) = rest.split_at_mut(n);
            for other in above.chunks_exact_mut(n).chain(below.chunks_exact_mut(n)) {
                let by = std::mem::take(&mut other[c]);
                for (x, row) in other.iter_mut().zip(&*row) {
                    *x -= by * row;
                }
            }
        }
        for c in (0..n).rev() {
            let other = self.exchanged[c];
            if other != c {
                (0..n).for_each(|i| a.swap(i * n + c, i * n + other));
            }
        }
        Some(())
    }
}

/// An alias of ω, as s and the hold's factor.
fn term(omega: f64, dt: f64, alias: i32) -> (Complex64, Complex64) {
    let held = Complex64::from(1.0) - Complex64::new(0.0, -omega * dt).exp();
    let s = Complex64::new(0.0, omega + f64::from(alias) * std::f64::consts::TAU / dt);
    (s, held / (s * dt))
}

/// Which aliases count at ω.
fn terms(omega: f64, dt: f64) -> impl Iterator<Item = (Complex64, Complex64)> {
    let rate = std::f64::consts::TAU / dt;
    let aliases = if omega < FEW_BELOW * rate {
        FEW_ALIASES
    } else {
        ALL_ALIASES
    };
    (-aliases..=aliases).map(move |alias| term(omega, dt, alias))
}

fn zeros(n: usize) -> DMatrix<Complex64> {
    DMatrix::zeros(n, n)
}

impl<'a> At<'a> {
    /// The plant with these entries of a layout.
    pub(super) fn new(plant: &'a Plant, layout: &Layout, x: &[f64]) -> Self {
        let n = plant.motors;
        let value = |of: Unknown| layout.value(x, of);
        let mut inertia = plant.inertia.clone();
        for (m, slope) in plant.rigid.iter().enumerate() {
            let by = value(Unknown::Rigid(m));
            inertia.zip_apply(slope, |own, slope| *own += by * slope);
        }
        if n == 1 && layout.has(Unknown::LinkInertia) {
            inertia[(0, 0)] = value(Unknown::LinkInertia);
        }
        let joint = |i: usize| {
            [
                Unknown::Stiffness(i),
                Unknown::Damping(i),
                Unknown::Viscous(i),
                Unknown::Armature(i),
                Unknown::LinkViscous(i),
            ]
            .map(value)
        };
        let slope = |(index, unknown): (usize, &Unknown)| {
            let (moves, power) = match *unknown {
                Unknown::Stiffness(i) => (Moves::Spring(i), 0),
                Unknown::Damping(i) => (Moves::Spring(i), 1),
                Unknown::Viscous(i) => (Moves::Motor(i), 1),
                Unknown::Armature(i) => (Moves::Motor(i), 2),
                Unknown::LinkViscous(i) => (Moves::Link(i), 1),
                Unknown::LinkInertia => (Moves::Link(0), 2),
                Unknown::BendStiffness(e) => (Moves::Link(n + e), 0),
                Unknown::BendDamping(e) => (Moves::Link(n + e), 1),
                Unknown::Delay => (Moves::Nothing, 1),
                Unknown::Rigid(_) => return None,
            };
            Some((moves, power, layout.scale(x, index)))
        };
        Self {
            plant,
            own: (layout.unknowns.iter().enumerate())
                .filter_map(slope)
                .collect(),
            has_bodies: layout.unknowns.iter().any(|u| u.is_body()),
            inertia,
            gravity: plant.gravity.clone(),
            joints: (0..n).map(joint).collect(),
            bends: (0..plant.inertia.nrows() - n)
                .map(|e| [Unknown::BendStiffness(e), Unknown::BendDamping(e)].map(value))
                .collect(),
            delay: value(Unknown::Delay),
        }
    }

    fn room(&self) -> Motion {
        Motion::new(self.joints.len(), self.inertia.nrows())
    }

    /// What moves at s; none where a matrix is singular.
    fn motion(&self, s: Complex64, own: &mut Motion) -> Option<()> {
        let (n, links) = (self.joints.len(), own.links);
        let square = s * s;
        // Both are symmetric, so that their columns are their rows.
        let links_alone = self.inertia.iter().zip(&self.gravity);
        for (b, (inertia, gravity)) in own.inverse.iter_mut().zip(links_alone) {
            *b = square * inertia + gravity;
        }
        for (i, &[k, d, viscous, armature, link_viscous]) in self.joints.iter().enumerate() {
            let (spring, alone) = (s * d + k, s * s * armature + s * viscous);
            let inverse = (spring + alone).inv();
            let share = spring * inverse;
            own.motors[i] = [inverse, share, alone];
            own.inverse[i * links + i] += s * link_viscous + alone * share;
        }
        for (e, [k, d]) in self.bends.iter().enumerate() {
            own.inverse[(n + e) * links + n + e] += s * d + k;
        }
        own.invert()?;
        for (i, [_, share, _]) in own.motors.iter().enumerate() {
            for l in 0..links {
                own.x[i * links + l] = own.inverse[l * links + i] * share;
            }
        }
        for (i, [inverse, share, _]) in own.motors.iter().enumerate() {
            for j in 0..n {
                own.p[i * n + j] = share * own.x[j * links + i];
            }
            own.p[i * n + i] += inverse;
        }
        Some(())
    }

    /// Goes through the aliases that count at ω with a drive that holds its torque for `dt` and a delay: what moves at each s, s, and the factor of what
    /// it gives. None where the model is singular.
    fn each_alias(
        &self,
        (omega, dt): (f64, f64),
        mut add: impl FnMut(&Motion, Complex64, Complex64),
    ) -> Option<()> {
        let delay = Complex64::new(0.0, -omega * self.delay).exp();
        let mut own = self.room();
        for (s, hold) in terms(omega, dt) {
            self.motion(s, &mut own)?;
            add(&own, s, hold * delay);
        }
        Some(())
    }

    /// The same robot at another place, with these inertias and this stiffness of gravity in its plant.
    fn moved(&self, [inertia, gravity]: &[DMatrix<f64>; 2]) -> Self {
        Self {
            inertia: &self.inertia - &self.plant.inertia + inertia,
            gravity: gravity.clone(),
            ..self.clone()
        }
    }

    /// Adds a share of torque to motor position at ω without aliases, which hardly depend on where the links are: motors move alone there. None where the
    /// model is singular.
    fn add_without_aliases(
        &self,
        (omega, dt): (f64, f64),
        share: f64,
        (own, to): (&mut Motion, &mut DMatrix<Complex64>),
    ) -> Option<()> {
        let (s, hold) = term(omega, dt, 0);
        let delay = Complex64::new(0.0, -omega * self.delay).exp();
        self.motion(s, own)?;
        add_response(to, own, hold * delay * share);
        Some(())
    }

    /// The same robot at instants of a slow motion.
    pub(super) fn along(&self, instants: &[[DMatrix<f64>; 2]]) -> Vec<Self> {
        // Half of those that a record has are more than the fourth harmonic of the motion needs.
        let used = instants.iter().step_by(2);
        used.map(|own| self.moved(own)).collect()
    }

    /// By how much the mean of the responses of a robot at some instants differs from the response of the mean: a slow motion changes the inertia that a
    /// joint turns, by a quarter at the first joint of an arm whose elbow bends. It is far slower than any line, so that the robot is taken to stand still
    /// at each instant.
    pub(super) fn mean_along(
        &self,
        instants: &[Self],
        omega: f64,
        dt: f64,
    ) -> Option<DMatrix<Complex64>> {
        let share = 1.0 / instants.len().max(1) as f64;
        let (mut own, mut sum) = (self.room(), zeros(self.joints.len()));
        self.add_without_aliases((omega, dt), -1.0, (&mut own, &mut sum))?;
        for at in instants {
            at.add_without_aliases((omega, dt), share, (&mut own, &mut sum))?;
        }
        Some(sum)
    }

    /// Torque to motor position at ω; none where the model is singular.
    pub(super) fn response(&self, omega: f64, dt: f64) -> Option<DMatrix<Complex64>> {
        let mut response = zeros(self.joints.len());
        self.each_alias((omega, dt), |own, _, by| {
            add_response(&mut response, own, by);
        })?;
        Some(response)
    }

    /// The same with its derivatives; none where the model is singular.
    pub(super) fn derived(&self, omega: f64, dt: f64) -> Option<Derived> {
        let n = self.joints.len();
        let links = self.inertia.nrows();
        let mut response = zeros(n);
        let bodies = usize::from(self.has_bodies) * links * (links + 1) / 2;
        let unknowns = self.own.len() + bodies;
        let mut slopes = vec![Complex64::default(); n * (n + 1) / 2 * unknowns];
        let mut moved = vec![Complex64::default(); n * self.own.len()];
        let mut factors = vec![Complex64::default(); self.own.len()];
        self.each_alias((omega, dt), |own, s, by| {
            add_response(&mut response, own, by);
            self.moved_by_each(own, &mut moved);
            for (factor, (_, power, scale)) in factors.iter_mut().zip(&self.own) {
                *factor = -by * s.powi(*power) * scale;
            }
            // Aliases hardly depend on the links: motors move alone there.
            let feels_links = 0.0 < s.im && s.im < 0.5 * std::f64::consts::TAU / dt;
            let bodies = (self.has_bodies && feels_links).then_some(-by * s * s);
            self.add_slopes(&mut slopes, (&moved, &factors), bodies, own);
        })?;
        if let Some(delay) = (self.own.iter()).position(|own| matches!(own.0, Moves::Nothing)) {
            let by = Complex64::new(0.0, -omega) * self.own[delay].2;
            for (own, element) in slopes.chunks_exact_mut(unknowns).zip(upper(n)) {
                own[delay] = response[element] * by;
            }
        }
        Some(Derived {
            response,
            slopes,
            unknowns,
        })
    }

    /// What each unknown moves: of each motor's torque, one after the other, all unknowns'.
    fn moved_by_each(&self, own: &Motion, moved: &mut [Complex64]) {
        let n = self.joints.len();
        for (j, moved) in moved.chunks_exact_mut(self.own.len().max(1)).enumerate() {
            for (to, (moves, ..)) in moved.iter_mut().zip(&self.own) {
                *to = match *moves {
                    Moves::Spring(i) => {
                        let [inverse, _, alone] = own.motors[i];
                        let torque = if i == j { 1.0 } else { 0.0 };
                        (Complex64::from(torque) - alone * own.links(j)[i]) * inverse
                    }
                    Moves::Motor(i) => own.p[i * n + j],
                    Moves::Link(l) => own.links(j)[l],
                    Moves::Nothing => Complex64::default(),
                };
            }
        }
    }

    /// Adds one term to the derivatives: those of what is no body, by what each moves and its factor, and with this factor those to H.
    fn add_slopes(
        &self,
        slopes: &mut [Complex64],
        (moved, factors): (&[Complex64], &[Complex64]),
        bodies: Option<Complex64>,
        own: &Motion,
    ) {
        let plain = factors.len();
        let of = |i: usize| -> Range<usize> { i * plain..(i + 1) * plain };
        let n = self.joints.len();
        let unknowns = slopes.len() / (n * (n + 1) / 2).max(1);
        for (slopes, (i, j)) in slopes.chunks_exact_mut(unknowns.max(1)).zip(upper(n)) {
            let (slopes, of_bodies) = slopes.split_at_mut(plain);
            let moved = moved[of(i)].iter().zip(&moved[of(j)]).zip(factors);
            for (slope, ((a, b), factor)) in slopes.iter_mut().zip(moved) {
                *slope += factor * a * b;
            }
            let Some(by) = bodies else { continue };
            let (a, b) = (own.links(i), own.links(j));
            for (slope, (l, m)) in of_bodies.iter_mut().zip(upper(own.links)) {
                // Both elements of H that are the same one.
                let both = if l == m {
                    a[l] * b[l]
                } else {
                    a[l] * b[m] + a[m] * b[l]
                };
                *slope += by * both;
            }
        }
    }

    /// Torque to the links' position at ω.
    pub(super) fn link_response(&self, omega: f64, dt: f64) -> Option<DMatrix<Complex64>> {
        let mut response = zeros(self.joints.len());
        self.each_alias((omega, dt), |own, _, by| {
            for (j, mut column) in response.column_iter_mut().enumerate() {
                let links = own.links(j).iter();
                column
                    .iter_mut()
                    .zip(links)
                    .for_each(|(to, x)| *to += by * x);
            }
        })?;
        Some(response)
    }
}

/// Adds a multiple of P.
fn add_response(to: &mut DMatrix<Complex64>, own: &Motion, by: Complex64) {
    // P is symmetric, so that its rows are its columns.
    to.iter_mut().zip(&own.p).for_each(|(to, p)| *to += by * p);
}

#[cfg(test)]
mod tests {
    use super::super::layout::tests::two_joints;
    use super::*;

    fn plant() -> Plant {
        let m = |v: &[f64]| DMatrix::from_row_slice(3, 3, v);
        Plant {
            motors: 2,
            inertia: m(&[2.0, 0.5, 0.4, 0.5, 0.7, -0.3, 0.4, -0.3, 1.1]),
            gravity: m(&[3.0, 1.0, 0.5, 1.0, 2.0, 0.2, 0.5, 0.2, 4.0]),
            rigid: vec![m(&[0.3, 0.1, 0.2, 0.1, 0.0, 0.05, 0.2, 0.05, 0.1])],
        }
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let (layout, x) = two_joints();
        let plant = plant();
        // Rows of derivatives become rows over the layout as a factor's do.
        let map = plant.bodies(&layout).map(Complex64::from);
        let slope = |n: usize, own: &[Complex64]| -> Complex64 {
            own.iter().zip(&map.column(n)).map(|(a, b)| a * b).sum()
        };
        for omega in [20.0, 90.0, 400.0] {
            let at = |x: &[f64]| At::new(&plant, &layout, x).derived(omega, 0.002).unwrap();
            let own = at(&x);
            for n in 0..x.len() {
                let step = 1e-6;
                let (mut up, mut down) = (x.clone(), x.clone());
                up[n] += step;
                down[n] -= step;
                let difference =
                    (at(&up).response - at(&down).response) / Complex64::from(2.0 * step);
                let slope = DMatrix::from_fn(2, 2, |i, j| slope(n, own.slopes(i, j)));
                let wrong = (&difference - slope).norm();
                // A difference over 1e-6 is rounded to 2e-10 of the response.
                let bound = 1e-5 * difference.norm() + 1e-9 * own.response.norm();
                assert!(
                    wrong < bound,
                    "{:?} at {omega}: {wrong:.2e}, at most {bound:.2e}",
                    layout.unknowns[n]
                );
            }
        }
    }

    /// A robot that has moved responds as one whose plant is of that place, bodies that are off included; without aliases it responds nearly so.
    #[test]
    fn a_moved_robot_is_one_of_another_plant() {
        let (layout, x) = two_joints();
        let plant = plant();
        let there = [&plant.inertia * 1.3, &plant.gravity * 0.6];
        let other = Plant {
            inertia: there[0].clone(),
            gravity: there[1].clone(),
            ..plant.clone()
        };
        for omega in [20.0, 90.0] {
            let moved = At::new(&plant, &layout, &x).moved(&there);
            let exact = At::new(&other, &layout, &x).response(omega, 0.002).unwrap();
            let own = moved.response(omega, 0.002).unwrap();
            assert!((&own - &exact).norm() < 1e-12 * exact.norm(), "{omega}");
            let mut alone = zeros(2);
            let to = (&mut moved.room(), &mut alone);
            moved.add_without_aliases((omega, 0.002), 1.0, to).unwrap();
            assert!((alone - &exact).norm() < 0.02 * exact.norm(), "{omega}");
        }
    }

    /// A bend that a joint's spring stands on in a row with it, and turns with nothing of its own, is that spring: 1/k + 1/k_e, as the same spring is
    /// at another place.
    #[test]
    fn a_bend_along_a_joint_is_a_spring_in_series() {
        let m = |n: usize, v: &[f64]| DMatrix::from_row_slice(n, n, v);
        let plant = |n: usize, inertia: &[f64]| Plant {
            motors: 1,
            inertia: m(n, inertia),
            gravity: DMatrix::zeros(n, n),
            rigid: Vec::new(),
        };
        let values = |k: f64, bend: f64| {
            let mut layout = Layout::default();
            let all = [
                (Unknown::Stiffness(0), k),
                (Unknown::Armature(0), 0.4),
                (Unknown::BendStiffness(0), bend),
            ];
            let x = all.map(|(unknown, value)| {
                layout.push(unknown, None);
                Layout::entry(unknown, value)
            });
            (layout, x)
        };
        // Both turn all of the link's inertia.
        let (two, x) = values(900.0, 450.0);
        let bent = plant(2, &[2.0, 2.0, 2.0, 2.0]);
        let (one, y) = values(300.0, 0.0);
        let stiff = plant(1, &[2.0]);
        for omega in [5.0, 13.0, 60.0] {
            let [a, b] = [
                At::new(&bent, &two, &x).response(omega, 0.002),
                At::new(&stiff, &one, &y).response(omega, 0.002),
            ]
            .map(|g| g.unwrap()[(0, 0)]);
            assert!((a / b - 1.0).norm() < 1e-9, "{omega}: {a} {b}");
        }
    }

    /// A mass alone, held and sampled: the discrete double integrator T²(z + 1)/(2 J (z − 1)²).
    #[test]
    fn a_stiff_joint_is_the_sampled_double_integrator() {
        let (layout, mut x) = two_joints();
        let plant = Plant {
            motors: 2,
            inertia: DMatrix::identity(3, 3),
            gravity: DMatrix::zeros(3, 3),
            rigid: vec![DMatrix::zeros(3, 3)],
        };
        for (n, unknown) in layout.unknowns.iter().enumerate() {
            x[n] = match unknown {
                Unknown::Stiffness(_) | Unknown::BendStiffness(_) => 1e9_f64.ln(),
                Unknown::Armature(_) => 0.5_f64.ln(),
                Unknown::Delay | Unknown::Rigid(_) => 0.0,
                _ => -40.0,
            };
        }
        let dt = 0.002;
        for f in [5.0, 30.0, 55.0, 200.0] {
            let omega = std::f64::consts::TAU * f;
            let z = Complex64::new(0.0, omega * dt).exp();
            let exact = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * dt * dt / (2.0 * 1.5);
            let own = At::new(&plant, &layout, &x);
            let own = own.derived(omega, dt).unwrap().response[(0, 0)];
            let wrong = (own / exact - 1.0).norm();
            assert!(wrong < 3e-3, "{f} Hz: {wrong:.1e}");
        }
    }
}

//! The flexible joint model, linearised: torque to motor position of a robot with a spring and a damper at each joint.
//!
//! With s = jω, H the links' inertia matrix, K_g the stiffness of gravity, S = diag(k + s d), motors of inertia J and viscous friction F_v,
//! and links with viscous friction F_l:
//!
//! A = s² H + K_g + s diag(F_l) + S,   Z = s² diag(J) + s diag(F_v) + S − S A⁻¹ S,   P = Z⁻¹   (Wernholt & Moberg 2011).
//!
//! A drive that holds its torque for T and samples at the same instants sees the aliases of P times the hold's response:
//! G(ω) = e^{−jωδ} Σ_a P(s_a) (1 − e^{−jωT})/(s_a T), s_a = j(ω + 2πa/T). P falls as 1/s², so that three terms suffice at low lines and
//! seven everywhere; no matrix exponential is needed, and derivatives are those of P.
//!
//! Links and bearings that bend are further coordinates of the links, without a motor: A has their rows too, with k_e + s d_e on its diagonal, and the
//! A⁻¹ between the springs is that of A's joints (Moberg & Hanssen 2007, the extended flexible joint model).
//!
//! Derivatives of Z to k and d of joint i have rank one: w wᵀ and s w wᵀ with w = (1 − S A⁻¹) e_i; to those of a bend w = S A⁻¹ e_b.

use nalgebra::{DMatrix, DVectorView};
use realfft::num_complex::Complex64;

use super::layout::{Layout, Unknown};

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

/// A response and its derivatives to all unknowns of a layout.
pub(super) struct Derived {
    pub(super) response: DMatrix<Complex64>,
    /// A row for each unknown, a column for each element of the response.
    slopes: DMatrix<Complex64>,
}

impl Derived {
    /// Derivatives of an element to all unknowns.
    pub(super) fn slopes(&self, i: usize, j: usize) -> &[Complex64] {
        let count = self.slopes.nrows();
        let first = (i + self.response.nrows() * j) * count;
        &self.slopes.as_slice()[first..first + count]
    }

    /// Derivatives of what joint i does under some torques.
    pub(super) fn slopes_of_output(
        &self,
        i: usize,
        torque: DVectorView<'_, Complex64>,
    ) -> Vec<Complex64> {
        let mut sum = vec![Complex64::default(); self.unknowns()];
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
        self.slopes.nrows()
    }
}

/// A point's plant at an entry of a fit: what all lines and aliases have in common.
#[derive(Clone)]
pub(super) struct At<'a> {
    plant: &'a Plant,
    layout: &'a Layout,
    /// Of each unknown, the derivative of its SI value to its entry.
    scales: Vec<f64>,
    /// H with what the rigid unknowns make of it.
    inertia: DMatrix<f64>,
    gravity: DMatrix<f64>,
    /// Of each joint: k, d, F_v, J, F_l.
    joints: Vec<[f64; 5]>,
    /// Of each bend: k, d.
    bends: Vec<[f64; 2]>,
    delay: f64,
}

/// The matrices at one s.
struct Blocks {
    /// A⁻¹, of which the joints' columns are used.
    inverse: DMatrix<Complex64>,
    /// P.
    p: DMatrix<Complex64>,
    /// diag(S).
    spring: Vec<Complex64>,
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

/// Adds a multiple of another matrix.
fn add(to: &mut DMatrix<Complex64>, by: Complex64, other: &DMatrix<Complex64>) {
    to.zip_apply(other, |to, other| *to += by * other);
}

/// Subtracts a multiple of a bᵀ from an unknown's derivatives.
fn outer(
    slopes: &mut DMatrix<Complex64>,
    unknown: usize,
    by: Complex64,
    a: &[Complex64],
    b: &[Complex64],
) {
    let columns = b.iter().map(|b| by * b);
    let elements = columns.flat_map(|b| a.iter().map(move |a| a * b));
    for (slope, element) in slopes.column_mut(unknown).iter_mut().zip(elements) {
        *slope -= element;
    }
}

impl<'a> At<'a> {
    /// The plant with these entries of a layout.
    pub(super) fn new(plant: &'a Plant, layout: &'a Layout, x: &'a [f64]) -> Self {
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
        Self {
            plant,
            layout,
            scales: (0..x.len()).map(|index| layout.scale(x, index)).collect(),
            inertia,
            gravity: plant.gravity.clone(),
            joints: (0..n).map(joint).collect(),
            bends: (0..plant.inertia.nrows() - n)
                .map(|e| [Unknown::BendStiffness(e), Unknown::BendDamping(e)].map(value))
                .collect(),
            delay: value(Unknown::Delay),
        }
    }

    /// The matrices at s, or none where one is singular.
    fn blocks(&self, s: Complex64) -> Option<Blocks> {
        let n = self.joints.len();
        let springs = self.joints.iter();
        let spring: Vec<Complex64> = springs.map(|&[k, d, ..]| s * d + k).collect();
        let mut a = self
            .inertia
            .zip_map(&self.gravity, |inertia, gravity| s * s * inertia + gravity);
        for (i, [.., link_viscous]) in self.joints.iter().enumerate() {
            a[(i, i)] += spring[i] + s * link_viscous;
        }
        for (e, [k, d]) in self.bends.iter().enumerate() {
            a[(n + e, n + e)] += s * d + k;
        }
        let inverse = a.try_inverse()?;
        let mut z = DMatrix::from_fn(n, n, |i, j| -spring[i] * inverse[(i, j)] * spring[j]);
        for (i, &[_, _, viscous, armature, _]) in self.joints.iter().enumerate() {
            z[(i, i)] += s * s * armature + s * viscous + spring[i];
        }
        Some(Blocks {
            inverse,
            p: z.try_inverse()?,
            spring,
        })
    }

    /// Goes through the aliases that count at ω with a drive that holds its torque for `dt` and a delay: the matrices at each s, s, and the factor of what
    /// they give. None where the model is singular.
    fn each_alias(
        &self,
        (omega, dt): (f64, f64),
        mut add: impl FnMut(&Blocks, Complex64, Complex64),
    ) -> Option<()> {
        let delay = Complex64::new(0.0, -omega * self.delay).exp();
        for (s, hold) in terms(omega, dt) {
            add(&self.blocks(s)?, s, hold * delay);
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

    /// Torque to motor position at ω without aliases, which hardly depend on where the links are: motors move alone there. None where the model is
    /// singular.
    fn without_aliases(&self, omega: f64, dt: f64) -> Option<DMatrix<Complex64>> {
        let (s, hold) = term(omega, dt, 0);
        let delay = Complex64::new(0.0, -omega * self.delay).exp();
        Some(self.blocks(s)?.p * (hold * delay))
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
        let share = Complex64::from(1.0 / instants.len().max(1) as f64);
        let own = self.without_aliases(omega, dt)?;
        instants.iter().try_fold(-own, |sum, at| {
            Some(sum + at.without_aliases(omega, dt)? * share)
        })
    }

    /// Torque to motor position at ω; none where the model is singular.
    pub(super) fn response(&self, omega: f64, dt: f64) -> Option<DMatrix<Complex64>> {
        let mut response = zeros(self.joints.len());
        self.each_alias((omega, dt), |own, _, by| add(&mut response, by, &own.p))?;
        Some(response)
    }

    /// The same with its derivatives; none where the model is singular.
    pub(super) fn derived(&self, omega: f64, dt: f64) -> Option<Derived> {
        let n = self.joints.len();
        let mut response = zeros(n);
        // A column for each unknown while they are summed: what is written lies side by side.
        let mut slopes = DMatrix::zeros(n * n, self.scales.len());
        self.each_alias((omega, dt), |own, s, by| {
            add(&mut response, by, &own.p);
            self.add_slopes(&mut slopes, (s, by), own, dt);
        })?;
        if let Some(index) = self.layout.index(Unknown::Delay) {
            let by = Complex64::new(0.0, -omega) * self.scales[index];
            for (slope, response) in slopes.column_mut(index).iter_mut().zip(&response) {
                *slope = response * by;
            }
        }
        let slopes = slopes.transpose();
        Some(Derived { response, slopes })
    }

    /// Adds ∂P = −P ∂Z P of one term to the derivatives.
    fn add_slopes(
        &self,
        slopes: &mut DMatrix<Complex64>,
        (s, by): (Complex64, Complex64),
        own: &Blocks,
        dt: f64,
    ) {
        let rate = std::f64::consts::TAU / dt;
        let n = self.joints.len();
        let (p, a, spring) = (&own.p, &own.inverse, &own.spring);
        // t = (A⁻¹ S P)ᵀ: a torque's effect on the links.
        let sp = DMatrix::from_fn(n, n, |i, j| spring[i] * p[(i, j)]);
        let t = (a.columns(0, n) * sp).transpose();
        // P is symmetric, so that P (1 − S A⁻¹) e_i is the row i of P − A⁻¹ S P.
        let bent = p - t.columns(0, n);
        let links = t.ncols();
        let mut moved = vec![Complex64::default(); n];
        for (index, unknown) in self.layout.unknowns.iter().enumerate() {
            let factor = by * self.scales[index];
            let (v, factor) = match *unknown {
                Unknown::Stiffness(i) => (bent.column(i), factor),
                Unknown::Damping(i) => (bent.column(i), factor * s),
                Unknown::Viscous(i) => (p.column(i), factor * s),
                Unknown::Armature(i) => (p.column(i), factor * s * s),
                Unknown::LinkViscous(i) => (t.column(i), factor * s),
                Unknown::BendStiffness(e) => (t.column(n + e), factor),
                Unknown::BendDamping(e) => (t.column(n + e), factor * s),
                Unknown::LinkInertia => (t.column(0), factor * s * s),
                Unknown::Delay => continue,
                // Aliases hardly depend on the links: motors move alone there.
                Unknown::Rigid(_) if s.im > 0.5 * rate || s.im < 0.0 => continue,
                Unknown::Rigid(m) => {
                    for l in 0..links {
                        let row = self.plant.rigid[m].column(l);
                        // A body's inertia is felt by the joints before it alone: the others have zeros.
                        if row.iter().all(|x| *x == 0.0) {
                            continue;
                        }
                        moved.fill(Complex64::default());
                        for (x, t) in row.iter().zip(t.column_iter()) {
                            moved.iter_mut().zip(&t).for_each(|(to, t)| *to += t * *x);
                        }
                        let v = t.column(l);
                        outer(slopes, index, factor * s * s, v.as_slice(), &moved);
                    }
                    continue;
                }
            };
            // −v vᵀ with v = P w: the derivative of P where that of Z is w wᵀ.
            outer(slopes, index, factor, v.as_slice(), v.as_slice());
        }
    }

    /// Torque to the links' position at ω.
    pub(super) fn link_response(&self, omega: f64, dt: f64) -> Option<DMatrix<Complex64>> {
        let n = self.joints.len();
        let mut response = zeros(n);
        self.each_alias((omega, dt), |own, _, by| {
            let sp = DMatrix::from_fn(n, n, |i, j| own.spring[i] * own.p[(i, j)]);
            add(&mut response, by, &(own.inverse.view((0, 0), (n, n)) * sp));
        })?;
        Some(response)
    }
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
                let slope = DMatrix::from_fn(2, 2, |i, j| own.slopes(i, j)[n]);
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
            let alone = moved.without_aliases(omega, 0.002).unwrap();
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

//! From windows that follow one another to a reading: where the leg was and how fast it moved at two edges of windows, and the mean torques between.
//!
//! Velocities are the slopes of the quartic through the positions of five edges, not those that were read: a velocity's noise at a window's
//! ends, times the inertia, is most of what a window leaves, and a gain of the velocities would be taken for inertia. Up to 30 rad/s the
//! quartic is right to 1 %.

use super::hypothesis::Reading;
use crate::go2::JOINTS_PER_LEG;

/// Edges of windows that a reading is made of.
const EDGES: usize = 5;

/// The last edges of windows, and what was between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    edges: [Edge; EDGES],
    /// How many of them follow one another, the last ones.
    count: usize,
}

/// An edge, and the window that it ends.
#[derive(Clone, Copy, Debug)]
struct Edge {
    time_us: u64,
    q: [f32; JOINTS_PER_LEG],
    /// Mean torque, N m, and sign of the velocity since the edge before.
    tau: [f32; JOINTS_PER_LEG],
    sign: [f32; JOINTS_PER_LEG],
}

impl Span {
    /// No edges.
    pub(super) const EMPTY: Self = Self {
        edges: [Edge {
            time_us: 0,
            q: [0.0; JOINTS_PER_LEG],
            tau: [0.0; JOINTS_PER_LEG],
            sign: [0.0; JOINTS_PER_LEG],
        }; EDGES],
        count: 0,
    };

    /// The last edge's time, µs, and positions, rad.
    pub(super) fn last(&self) -> (u64, &[f32; JOINTS_PER_LEG]) {
        let [.., edge] = &self.edges;
        (edge.time_us, &edge.q)
    }

    /// Begins with an edge that ends no whole window.
    pub(super) fn begin(&mut self, time_us: u64, q: [f32; JOINTS_PER_LEG]) {
        let nothing = [0.0; JOINTS_PER_LEG];
        self.push(time_us, q, nothing, nothing);
        self.count = 1;
    }

    /// Takes the next edge, and what was since the last.
    pub(super) fn push(
        &mut self,
        time_us: u64,
        q: [f32; JOINTS_PER_LEG],
        tau: [f32; JOINTS_PER_LEG],
        sign: [f32; JOINTS_PER_LEG],
    ) {
        self.edges.rotate_left(1);
        let [.., edge] = &mut self.edges;
        *edge = Edge {
            time_us,
            q,
            tau,
            sign,
        };
        self.count = (self.count + 1).min(EDGES);
    }

    /// The reading of the two windows in the middle, if all edges follow one another.
    pub(super) fn reading(&self) -> Option<Reading> {
        if self.count < EDGES {
            return None;
        }
        let [first, from, middle, to, _] = &self.edges;
        let since =
            |us: u64, before: u64| us.wrapping_sub(before).min(1_000_000) as u32 as f32 * 1e-6;
        let times = self.edges.map(|edge| since(edge.time_us, first.time_us));
        let seconds = since(to.time_us, from.time_us);
        let share = since(middle.time_us, from.time_us) / seconds;
        let mean = |of: fn(&Edge) -> &[f32; JOINTS_PER_LEG]| {
            let pairs = of(middle).iter().zip(of(to));
            let mut means = [0.0; JOINTS_PER_LEG];
            means
                .iter_mut()
                .zip(pairs)
                .for_each(|(mean, (one, other))| *mean = other + (one - other) * share);
            means
        };
        Some(Reading {
            seconds,
            q: [from.q, to.q],
            dq: [self.slopes(&times, 1), self.slopes(&times, 3)],
            tau: mean(|edge| &edge.tau),
            sign: mean(|edge| &edge.sign),
        })
    }

    /// The joints' velocities at the n-th edge, rad/s: slopes of Lagrange's polynomial through all.
    fn slopes(&self, times: &[f32; EDGES], n: usize) -> [f32; JOINTS_PER_LEG] {
        let mut slopes = [0.0; JOINTS_PER_LEG];
        let (Some(here), Some(now)) = (self.edges.get(n), times.get(n)) else {
            return slopes;
        };
        let product = |of: usize, but: usize| {
            let time = times.get(of).copied().unwrap_or_default();
            let others = times.iter().enumerate();
            let others = others.filter(|(m, _)| *m != of && *m != but);
            others.fold(1.0, |product, (_, other)| product * (time - other))
        };
        for (m, (edge, time)) in self.edges.iter().zip(times).enumerate() {
            if m == n {
                continue;
            }
            // The derivative at `now` of the polynomial that is 1 at `time` and 0 at all others.
            let weight = product(n, m) / (product(m, n) * (time - now));
            let pairs = edge.q.iter().zip(&here.q);
            let sums = slopes.iter_mut().zip(pairs);
            sums.for_each(|(slope, (there, here))| *slope += weight * (there - here));
        }
        slopes
    }
}

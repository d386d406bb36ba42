//! Counts the instructions of a walking robot's operations on the emulated board, over data as different as they can be: as
//! `operation_counts` does, one line `name fewest most` each.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;
// A crash logs.
use defmt_semihosting as _;
use nalgebra::Vector3;
use proprio_core::go2::{IMU, LEGS};
use proprio_core::spatial::Transform;
use proprio_core::walk::{WalkMemory, WalkSample, Walker};
use proprio_core::window::Sample;
use proprio_firmware::board::mps2_an500::{InstructionCounter, Mps2An500};
use proprio_firmware::{Scalar, crash};
use static_cell::ConstStaticCell;

/// Data sets: robots that rest, that fly, that jump about.
const SETS: usize = 8;
/// Samples of each.
const SAMPLES: u64 = 700;
/// At least as many steps as one window's folding takes, and a solution.
const FOLDS: usize = 16;
const SOLVES: usize = 300;

static WALKER: ConstStaticCell<Walker<Scalar>> = ConstStaticCell::new(Walker::unset());
static MEMORY: ConstStaticCell<WalkMemory<Scalar>> = ConstStaticCell::new(WalkMemory::new());
static SOLVE_COUNTS: ConstStaticCell<[Count; SOLVES]> =
    ConstStaticCell::new([Count(u32::MAX, 0); SOLVES]);

/// Fewest and most instructions of one operation.
#[derive(Clone, Copy)]
struct Count(u32, u32);

impl Count {
    const NONE: Self = Self(u32::MAX, 0);

    fn add(&mut self, instructions: u32) {
        self.0 = self.0.min(instructions);
        self.1 = self.1.max(instructions);
    }

    fn print(&self, name: &str) {
        if self.1 > 0 {
            hprintln!("{} {} {}", name, self.0, self.1);
        }
    }
}

/// A generator of numbers in −1 to 1; only variety matters.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> Scalar {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 as i32 >> 8) as Scalar / (1 << 23) as Scalar
    }
}

/// A robot whose legs are in the air and on the ground in turn, 0.12 s each.
fn sample(set: usize, n: u64, noise: &mut Noise) -> WalkSample<Scalar> {
    let size = if set == 0 {
        1e-9
    } else {
        set as Scalar / SETS as Scalar
    };
    let phase = (n / 60) as usize;
    let middle = [0.0, 0.8, -1.7];
    let mut draw = |most: Scalar| size * most * noise.next();
    let on_ground = |leg: usize| set > 0 && (phase + leg + set).is_multiple_of(3);
    WalkSample {
        joints: Sample {
            time_us: 1 + n * 2_000,
            q: core::array::from_fn(|j| middle[j % 3] + draw(0.1)),
            dq: core::array::from_fn(|_| draw(3.0)),
            tau: core::array::from_fn(|j| {
                let weight: Scalar = if on_ground(j / 3) { 8.0 } else { 0.0 };
                weight + draw(0.01)
            }),
        },
        gyro: Vector3::new(draw(0.01), draw(0.01), draw(0.01)),
        acc: Vector3::new(draw(0.05), draw(0.05), draw(0.05)),
        count: core::array::from_fn(|leg| if on_ground(leg) { 90.0 } else { 20.0 }),
    }
}

/// What a set is counted into.
struct Counts {
    push: Count,
    closing: Count,
    cutting: Count,
    folds: [Count; FOLDS],
    idle: Count,
}

impl Counts {
    /// The cost of a sample, by what it did.
    fn push(
        &mut self,
        counter: &mut InstructionCounter,
        walker: &mut Walker<Scalar>,
        sample: &WalkSample<Scalar>,
        feet: &mut [bool; LEGS],
    ) -> bool {
        let (before, open) = (*walker.counts(), walker.has_window());
        let (_, cost) = counter.count(|| walker.push(sample));
        let after = *walker.counts();
        let closed = after.windows > before.windows;
        let now = core::array::from_fn(|leg| after.air[leg] > before.air[leg]);
        let changed = now != *feet;
        *feet = now;
        let lost = |get: fn(&proprio_core::walk::WalkCounts) -> u32| get(&after) > get(&before);
        if lost(|c| c.rejected) || lost(|c| c.late) || lost(|c| c.gaps) || lost(|c| c.unfolded) {
            hprintln!("a sample was not used: {:?}", after);
            exit(EXIT_FAILURE);
        }
        match (closed, changed) {
            (true, false) => self.closing.add(cost),
            (true, true) => self.cutting.add(cost),
            // What opens a window, or comes while none is, costs less.
            (false, false) if open && walker.has_window() => self.push.add(cost),
            (false, _) => {}
        }
        closed
    }
}

#[entry]
fn main() -> ! {
    let crash = crash::take();
    if !crash.is_empty() {
        hprintln!("{}", crash);
        exit(EXIT_FAILURE);
    }
    let Some(Mps2An500 { mut counter, .. }) = Mps2An500::take() else {
        panic!("the board is taken once")
    };
    let (walker, memory) = (WALKER.take(), MEMORY.take());
    let solves = SOLVE_COUNTS.take();
    let mut counts = Counts {
        push: Count::NONE,
        closing: Count::NONE,
        cutting: Count::NONE,
        folds: [Count::NONE; FOLDS],
        idle: Count::NONE,
    };
    let imu = Transform::from_translation(Vector3::from(IMU.map(|x| x as Scalar)));
    let mut noise = Noise(1);
    for set in 0..SETS {
        if walker.begin(memory, &imu).is_err() {
            hprintln!("no prior");
            exit(EXIT_FAILURE);
        }
        let mut feet = [false; LEGS];
        let mut since = FOLDS;
        for n in 0..SAMPLES {
            let closed = counts.push(&mut counter, walker, &sample(set, n, &mut noise), &mut feet);
            since = if closed { 0 } else { since + 1 };
            // The legs' triangles are folded after every second window.
            let legs = usize::from(walker.counts().windows % 2 == 0);
            let (_, cost) = counter.count(|| walker.step(memory));
            match counts.folds.get_mut(since) {
                Some(fold) if since < 5 || legs > 0 => fold.add(cost),
                _ => counts.idle.add(cost),
            }
        }
        // What still waits to be folded in is no part of the solution.
        for _ in 0..FOLDS {
            walker.step(memory);
        }
        walker.solve();
        for solve in solves.iter_mut() {
            let (done, cost) = counter.count(|| walker.step(memory));
            solve.add(cost);
            if done {
                break;
            }
        }
    }
    counts.push.print("walk_push");
    counts.closing.print("walk_push_closing");
    counts.cutting.print("walk_push_cutting");
    counts
        .folds
        .iter()
        .for_each(|fold| fold.print("walk_fold_part"));
    solves
        .iter()
        .for_each(|solve| solve.print("walk_solve_part"));
    exit(EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}

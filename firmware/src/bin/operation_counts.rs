//! Counts the instructions of the core's operations on the emulated board, over data as different as they can be, and says
//! the fewest and the most of each: one line `name fewest most` on semihosting's standard output.
//!
//! Of the consistent solution: what a Newton step costs, with all parts before the next one, the dearest part, and how many steps there are
//! (`consistent_newton_steps` is no number of instructions).
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;
// A crash logs.
use defmt_semihosting as _;
use proprio_core::bus::{Command, Decoder, Mode, Reply, crc::SEED_GO2};
use proprio_core::consistent::LegConsistentSolver;
use proprio_core::estimator::{
    BlockTest, DEFAULT_ACTIVE, DeviceFolds, DevicePrior, DeviceSolver, DeviceWindow, EFFECTS,
    Gather, LEG_INERTIAL, LEG_PARAMETERS, LegBase, LegFactors, LegPrior, LegSolver, LegWindow,
    plausible,
};
use proprio_core::factor::packed_len;
use proprio_core::go2::{JOINTS_PER_LEG, Leg, leg};
use proprio_core::spatial::Transform;
use proprio_core::window::{Push, Sample, Settings, Window};
use proprio_firmware::board::mps2_an500::{InstructionCounter, Mps2An500};
use proprio_firmware::{Scalar, crash};
use static_cell::{ConstStaticCell, StaticCell};

/// Data sets: legs that rest, that swing at the limit of what is plausible, and others between.
const SETS: usize = 12;
/// Samples of each.
const SAMPLES: u64 = 65;

/// At least as many steps as a solution takes.
const SOLVER_STEPS: usize = 40;

/// Numbers that a step of gathering rotates at most, but for its last row.
const GATHER_COST: usize = 1600;

// Larger than the stack.
static FOLDS: ConstStaticCell<DeviceFolds<Scalar>> = ConstStaticCell::new(DeviceFolds::empty());
static TEST: ConstStaticCell<BlockTest<Scalar>> = ConstStaticCell::new(BlockTest::empty());
static BASE: ConstStaticCell<LegBase<Scalar>> = ConstStaticCell::new(LegBase::empty());
static SOLVER: ConstStaticCell<DeviceSolver<Scalar>> = ConstStaticCell::new(DeviceSolver::empty());
static GATHER: ConstStaticCell<Gather<Scalar>> = ConstStaticCell::new(Gather::new());
static WORK: ConstStaticCell<[Scalar; 1100]> = ConstStaticCell::new([0.0; 1100]);
static FACTORS: ConstStaticCell<LegFactors<Scalar>> = ConstStaticCell::new(LegFactors::empty());
static CONSISTENT: StaticCell<LegConsistentSolver<Scalar>> = StaticCell::new();

/// Fewest and most instructions of one operation.
struct Count(&'static str, u32, u32);

impl Count {
    const fn new(name: &'static str) -> Self {
        Self(name, u32::MAX, 0)
    }

    fn add(&mut self, instructions: u32) {
        self.1 = self.1.min(instructions);
        self.2 = self.2.max(instructions);
    }

    fn print(&self) {
        hprintln!("{} {} {}", self.0, self.1, self.2);
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

/// What the consistent solution takes.
struct ConsistentCounts {
    /// Of one Newton step: the solution, the search along it, the priors' expansion for the next.
    step: Count,
    /// Of the dearest part that one call does.
    part: Count,
    /// Newton steps.
    steps: Count,
}

impl ConsistentCounts {
    const fn new() -> Self {
        Self {
            step: Count::new("consistent_newton_step"),
            part: Count::new("consistent_part"),
            steps: Count::new("consistent_newton_steps"),
        }
    }

    /// Solves for `factors`, from the CAD; false if there is no solution.
    fn solve(
        &mut self,
        counter: &mut InstructionCounter,
        solver: &mut LegConsistentSolver<Scalar>,
        factors: &LegFactors<Scalar>,
    ) -> bool {
        let (_, mut step) = counter.count(|| solver.start(factors));
        let mut dearest = 0;
        loop {
            let before = solver.iterations();
            let (done, cost) = counter.count(|| solver.advance());
            step += cost;
            dearest = dearest.max(cost);
            if solver.iterations() > before {
                self.step.add(step);
                step = 0;
            }
            match done {
                Ok(false) => {}
                Ok(true) => break,
                Err(_) => return false,
            }
        }
        self.part.add(dearest);
        self.steps.add(solver.iterations() as u32);
        true
    }
}

fn sample(set: usize, n: u64, noise: &mut Noise) -> Sample<Scalar, JOINTS_PER_LEG> {
    // The first set is at rest but for what tells one sample from the next.
    let scale = if set == 0 {
        1e-9
    } else {
        set as Scalar / SETS as Scalar
    };
    let middle = [0.0, 0.8, -1.7];
    let mut draw = |size: Scalar| scale * size * noise.next();
    Sample {
        time_us: 1 + n * 2000,
        q: core::array::from_fn(|j| middle[j] + draw(1.0)),
        dq: core::array::from_fn(|_| draw(25.0)),
        tau: core::array::from_fn(|_| draw(40.0)),
    }
}

#[entry]
fn main() -> ! {
    // A panic resets the board; the second run says so.
    let crash = crash::take();
    if !crash.is_empty() {
        hprintln!("{}", crash);
        exit(EXIT_FAILURE);
    }
    let Some(Mps2An500 { mut counter, .. }) = Mps2An500::take() else {
        panic!("the board is taken once")
    };
    let [mut decode, mut push, mut close] =
        ["decode_cycle", "push", "push_closing"].map(Count::new);
    let [mut take, mut look, mut fold] = ["take", "look", "fold"].map(Count::new);
    let [mut judge, mut forget] = ["judge_block", "forget_block"].map(Count::new);
    let [mut analysis, mut start, mut restart] =
        ["base_analysis", "gather_start", "solver_start"].map(Count::new);
    let mut gathers = [const { Count::new("gather_step") }; SOLVER_STEPS];
    let mut steps = [const { Count::new("solver_step") }; SOLVER_STEPS];
    let prior = DevicePrior::<Scalar>::of(Leg::FR, &DEFAULT_ACTIVE);
    let (folds, base, solver) = (FOLDS.take(), BASE.take(), SOLVER.take());
    let test = TEST.take();
    let (gather, work) = (GATHER.take(), WORK.take());
    let factors = FACTORS.take();
    let mut consistent = ConsistentCounts::new();
    let consistent_solver = CONSISTENT.init_with(|| {
        LegConsistentSolver::new(
            &LegPrior::of(Leg::FR),
            LegSolver::empty(),
            [0.0; LEG_PARAMETERS],
            [0.0; packed_len(LEG_INERTIAL)],
        )
    });
    let (analysed, cost) = counter.count(|| base.analyse(Leg::FR, &prior, work));
    analysis.add(cost);
    if analysed.is_err() {
        hprintln!("the analysis failed");
        exit(EXIT_FAILURE);
    }
    let mut noise = Noise(1);
    for set in 0..SETS {
        let upright = Transform::identity();
        let mut window = DeviceWindow::<Scalar>::new(Leg::FR, &upright, Settings::default());
        let mut leg_window: LegWindow<Scalar> = Window::new(
            leg(Leg::FR),
            upright,
            EFFECTS,
            plausible(Leg::FR),
            Settings::default(),
        );
        folds.clear();
        test.clear();
        factors.clear();
        let mut decoder = Decoder::new();
        for n in 0..SAMPLES {
            let sample = sample(set, n, &mut noise);
            let mut bytes = [0; 99];
            for (j, bytes) in bytes.chunks_exact_mut(33).enumerate() {
                let mode = Mode::foc(j as u8);
                let counts = |x: Scalar| x as i16;
                let (torque, speed) = (counts(sample.tau[j] * 20.0), counts(sample.dq[j] * 200.0));
                let reply = Reply {
                    mode,
                    torque,
                    speed,
                    position: i32::from(speed) * 99,
                    ..Reply::default()
                };
                bytes[..17].copy_from_slice(
                    &Command {
                        mode,
                        ..Command::default()
                    }
                    .encode(SEED_GO2),
                );
                bytes[17..].copy_from_slice(&reply.encode(0));
            }
            let (_, cost) = counter.count(|| {
                let mut bytes = bytes.as_slice();
                let mut effort = bytes.len();
                core::iter::from_fn(|| decoder.next(&mut bytes, &mut effort)).count()
            });
            // The first frames also find the seed.
            if n > 0 {
                decode.add(cost);
            }
            if leg_window.push(&sample) == Push::Closed
                && factors.fold_window(leg_window.rows()).is_err()
            {
                hprintln!("a fold failed");
                exit(EXIT_FAILURE);
            }
            let (pushed, cost) = counter.count(|| window.push(&sample));
            match pushed {
                Push::Closed => {
                    close.add(cost);
                    let (taken, cost) = counter.count(|| folds.take(window.rows()));
                    take.add(cost);
                    if taken.is_err() {
                        hprintln!("a window was not taken");
                        exit(EXIT_FAILURE);
                    }
                    if folds.is_full() {
                        look.add(counter.count(|| test.look(folds, base)).1);
                        let (folded, cost) = counter.count(|| test.fold(folds, base));
                        fold.add(cost);
                        if folded.is_err() {
                            hprintln!("a fold failed");
                            exit(EXIT_FAILURE);
                        }
                    }
                }
                Push::Used if n > 0 => push.add(cost),
                Push::Used => {}
                other => {
                    hprintln!("a sample was {:?}", other);
                    exit(EXIT_FAILURE);
                }
            }
        }
        judge.add(counter.count(|| core::hint::black_box(test.judge(folds))).1);
        // What a block's begin costs where the host has the device forget.
        forget.add(counter.count(|| folds.begin_block(0.99)).1);
        start.add(
            counter
                .count(|| gather.start(&DEFAULT_ACTIVE, folds, solver))
                .1,
        );
        for step in &mut gathers {
            let (done, cost) = counter.count(|| gather.advance(GATHER_COST, folds, base, solver));
            step.add(cost);
            if done != Ok(false) {
                break;
            }
        }
        restart.add(counter.count(|| solver.restart(&prior)).1);
        for step in &mut steps {
            let (done, cost) = counter.count(|| solver.advance());
            step.add(cost);
            if done != Ok(false) {
                break;
            }
        }
        if !consistent.solve(&mut counter, consistent_solver, factors) {
            hprintln!("a consistent solution failed");
            exit(EXIT_FAILURE);
        }
    }
    [consistent.step, consistent.part, consistent.steps]
        .iter()
        .for_each(Count::print);
    [
        decode, push, close, take, look, fold, judge, forget, analysis, start, restart,
    ]
    .iter()
    .for_each(Count::print);
    gathers
        .iter()
        .chain(&steps)
        .filter(|step| step.2 > 0)
        .for_each(Count::print);
    exit(EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}

//! proprio-core beside Pinocchio in C++, same robots, same states, by turns: `studies/duel/run` builds the other side and runs this.
//!
//! Both say their numbers first and must agree. Then each is timed over all states, one after the other, many times; the table
//! gives the medians. Every call starts from q and ends with its result written: kinematics are included on both sides.
//! Ends with status 1 if the numbers differ or a ratio is below what `docs/code.md`, "Budgets" asks for.

use std::hint::black_box;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitCode, Stdio};
use std::time::Instant;

use nalgebra::{Matrix3, Quaternion, SMatrix, SVector, UnitQuaternion};
use proprio_core::go2::{self, Leg};
use proprio_core::regressor::RegressorRows;
use proprio_core::spatial::Transform;
use proprio_core::tree::{Joint, Placements, Tree};
use proprio_tests::oracle::Oracle;

type Failure = Box<dyn std::error::Error>;

/// Turns that each side has.
const TURNS: usize = 301;
/// How long a turn lasts at most, if one round is not longer, ns: a scheduler lets most turns of this length through, so that
/// the median is of turns that nobody interrupted, also on a busy machine.
const TURN_NS: f64 = 3e5;
/// Greatest difference, as a share of a result's largest number. Forward dynamics solve with H, whose condition number is 1e5.
const TOLERANCE: f64 = 1e-9;

/// What is computed, and how many times Pinocchio's speed is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Work {
    Regressor,
    Inverse,
    Inertia,
    Forward,
}

impl Work {
    const ALL: [Self; 4] = [Self::Regressor, Self::Inverse, Self::Inertia, Self::Forward];

    /// As the other side calls it, and as the table does.
    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Regressor => ["regressor", "torque regressor"],
            Self::Inverse => ["inverse", "inverse dynamics"],
            Self::Inertia => ["inertia", "mass matrix"],
            Self::Forward => ["forward", "forward dynamics"],
        }
    }

    fn least_ratio(self) -> f64 {
        match self {
            Self::Regressor => 2.0,
            Self::Inverse | Self::Inertia | Self::Forward => 1.2,
        }
    }
}

/// A state of a tree.
struct State<const V: usize> {
    base: Transform<f64>,
    quaternion: Option<[f64; 4]>,
    q: SVector<f64, V>,
    v: SVector<f64, V>,
    a: SVector<f64, V>,
    torque: SVector<f64, V>,
}

/// The other side: a process that answers line by line.
struct Pinocchio {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Pinocchio {
    fn start(program: &str) -> Result<Self, Failure> {
        let mut child = Command::new(program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{program}: {error}; studies/duel/run builds it"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (Some(input), Some(output)) = (input, output) else {
            return Err("the other side has no pipes".into());
        };
        Ok(Self {
            child,
            input,
            output: BufReader::new(output),
        })
    }

    fn tell(&mut self, words: &str) -> Result<(), Failure> {
        Ok(writeln!(self.input, "{words}")?)
    }

    fn ask(&mut self, words: &str) -> Result<Vec<f64>, Failure> {
        self.tell(words)?;
        self.input.flush()?;
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        match numbers {
            Ok(numbers) if !numbers.is_empty() => Ok(numbers),
            _ => Err(format!("no answer to `{words}` but `{}`", line.trim()).into()),
        }
    }

    fn meet<const B: usize, const V: usize>(
        &mut self,
        tree: &Tree<f64, B, V>,
        states: &[State<V>],
    ) -> Result<(), Failure> {
        self.tell(&format!("robot {B}"))?;
        for body in tree.bodies() {
            let parent = body.parent.map_or(-1, |parent| parent as i64);
            let kind = match body.joint {
                Joint::Free => "free",
                Joint::Revolute(axis) => ["x", "y", "z"][axis.imax()],
                Joint::Prismatic(_) => return Err("the Go2 has no sliding joint".into()),
            };
            let place = text(body.placement.translation.iter());
            self.tell(&format!(
                "{parent} {kind} {place} {}",
                text(body.inertia.0.iter())
            ))?;
        }
        self.tell(&format!("states {}", states.len()))?;
        for state in states {
            let mut line = String::new();
            let mut skip = 0;
            if let Some(quaternion) = &state.quaternion {
                line += &text(state.base.translation.iter().chain(quaternion));
                skip = 6;
            }
            let numbers = state.q.iter().skip(skip).chain(&state.v);
            self.tell(&(line + &text(numbers.chain(&state.a).chain(&state.torque))))?;
        }
        Ok(())
    }
}

impl Drop for Pinocchio {
    fn drop(&mut self) {
        // It would end by itself, its input being closed; an error means that it has.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Numbers that come back to the last bit, a space before each.
fn text<'a>(numbers: impl Iterator<Item = &'a f64>) -> String {
    numbers.map(|x| format!(" {x:e}")).collect()
}

/// proprio's side: what it computes into, kept from call to call.
struct Ours<'a, const B: usize, const V: usize> {
    tree: &'a Tree<f64, B, V>,
    placements: Placements<f64, B>,
    rows: Box<RegressorRows<f64, B, V>>,
    numbers: SVector<f64, V>,
    inertia: SMatrix<f64, V, V>,
    armature: SVector<f64, V>,
}

impl<'a, const B: usize, const V: usize> Ours<'a, B, V> {
    fn new(tree: &'a Tree<f64, B, V>) -> Self {
        Self {
            tree,
            placements: Placements::new(),
            rows: Box::new([[[0.0; 10]; B]; V]),
            numbers: SVector::zeros(),
            inertia: SMatrix::zeros(),
            armature: SVector::zeros(),
        }
    }

    fn regressor(&mut self, s: &State<V>) {
        self.tree
            .update_placements(&mut self.placements, &s.base, &s.q);
        self.tree
            .write_inverse_dynamics_regressor(&self.placements, &s.v, &s.a, &mut self.rows);
        black_box(&self.rows);
    }

    fn inverse(&mut self, s: &State<V>) {
        self.tree
            .update_placements(&mut self.placements, &s.base, &s.q);
        self.tree
            .write_inverse_dynamics(&self.placements, &s.v, &s.a, &mut self.numbers);
        black_box(&self.numbers);
    }

    fn inertia(&mut self, s: &State<V>) {
        self.tree
            .update_placements(&mut self.placements, &s.base, &s.q);
        self.tree
            .write_inertia_matrix(&self.placements, &mut self.inertia);
        black_box(&self.inertia);
    }

    fn forward(&mut self, s: &State<V>) {
        self.tree
            .update_placements(&mut self.placements, &s.base, &s.q);
        let (placements, armature) = (&self.placements, &self.armature);
        black_box(self.tree.write_forward_dynamics(
            placements,
            &s.v,
            &s.torque,
            armature,
            &mut self.numbers,
        ));
        black_box(&self.numbers);
    }

    fn values(&mut self, work: Work, state: &State<V>) -> Vec<f64> {
        match work {
            Work::Regressor => {
                self.regressor(state);
                self.rows.as_flattened().as_flattened().to_vec()
            }
            Work::Inverse => {
                self.inverse(state);
                self.numbers.iter().copied().collect()
            }
            Work::Inertia => {
                self.inertia(state);
                // Symmetric: which way round does not matter.
                self.inertia.iter().copied().collect()
            }
            Work::Forward => {
                self.forward(state);
                self.numbers.iter().copied().collect()
            }
        }
    }

    /// ns of a call, the mean over all states so many times.
    fn time(&mut self, work: Work, rounds: usize, states: &[State<V>]) -> f64 {
        let mut go = |call: fn(&mut Self, &State<V>)| {
            let start = Instant::now();
            for _ in 0..rounds {
                for state in states {
                    call(self, black_box(state));
                }
            }
            start.elapsed().as_nanos() as f64 / (rounds * states.len()) as f64
        };
        match work {
            Work::Regressor => go(Self::regressor),
            Work::Inverse => go(Self::inverse),
            Work::Inertia => go(Self::inertia),
            Work::Forward => go(Self::forward),
        }
    }
}

/// The oracle's states of one of its systems.
fn states<const V: usize>(system: &str) -> Result<Vec<State<V>>, Failure> {
    let oracle = Oracle::load(system)?;
    let states = oracle.states().map(|state| {
        let quaternion = state.get("base_quaternion").map(|_| {
            let quaternion: [f64; 4] = state.vector::<4>("base_quaternion").into();
            quaternion
        });
        let mut base = Transform::identity();
        if let Some([w, x, y, z]) = quaternion {
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            let rotation: Matrix3<f64> = *turn.to_rotation_matrix().matrix();
            base = Transform {
                rotation,
                translation: state.vector::<3>("base_position"),
            };
        }
        let joints = state.field("q");
        let skip = V - joints.len();
        State {
            base,
            quaternion,
            q: SVector::from_fn(|r, _| if r < skip { 0.0 } else { joints[r - skip] }),
            v: state.vector("v"),
            a: state.vector("a"),
            torque: state.vector("tau"),
        }
    });
    Ok(states.collect())
}

/// Medians of both sides, ns.
fn duel<const B: usize, const V: usize>(
    system: &str,
    tree: &Tree<f64, B, V>,
    theirs: &mut Pinocchio,
) -> Result<[[f64; 2]; 4], Failure> {
    let states = states::<V>(system)?;
    theirs.meet(tree, &states)?;
    let mut ours = Ours::new(tree);
    let mut medians = [[0.0; 2]; 4];
    for (work, medians) in Work::ALL.into_iter().zip(&mut medians) {
        let name = work.names()[0];
        for (n, state) in states.iter().enumerate() {
            let ours = ours.values(work, state);
            let theirs = theirs.ask(&format!("values {name} {n}"))?;
            let error = difference(&ours, &theirs);
            if error.is_none_or(|error| error > TOLERANCE) {
                return Err(format!("{system}, {name}, state {n}: off by {error:?}").into());
            }
        }
        let mut turns = |rounds: [usize; 2], count: usize| -> Result<[f64; 2], Failure> {
            let mut times = [vec![], vec![]];
            for _ in 0..count {
                times[0].push(ours.time(work, rounds[0], &states));
                times[1].extend(theirs.ask(&format!("time {name} {}", rounds[1]))?);
            }
            Ok(times.map(median))
        };
        // The first turns warm up and say how many rounds a turn has.
        let round = turns([1, 1], TURNS / 10)?.map(|call| call * states.len() as f64);
        *medians = turns(round.map(|ns| (TURN_NS / ns).max(1.0) as usize), TURNS)?;
    }
    Ok(medians)
}

/// Greatest difference as a share of the largest number; `None` where lengths differ or a number is none.
fn difference(ours: &[f64], theirs: &[f64]) -> Option<f64> {
    let size = theirs.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let gaps = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs() / size);
    let most = gaps.fold(0.0_f64, |most, gap| if gap <= most { most } else { gap });
    (ours.len() == theirs.len() && most.is_finite()).then_some(most)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn run() -> Result<bool, Failure> {
    let program = std::env::args().nth(1);
    let program = program.ok_or("studies/duel/run builds the other side and runs this")?;
    let mut theirs = Pinocchio::start(&program)?;
    let systems = [
        duel("leg", &go2::leg(Leg::FR), &mut theirs)?,
        duel("pinned", &go2::pinned(), &mut theirs)?,
        duel("free", &go2::free(), &mut theirs)?,
    ];
    println!("ns per call: Pinocchio / proprio, ratio; leg, four legs pinned, free robot\n");
    println!("| | leg | four legs | free, 18 × 130 |");
    println!("|---|---|---|---|");
    let mut good = true;
    for (n, work) in Work::ALL.into_iter().enumerate() {
        print!("| {} |", work.names()[1]);
        for system in &systems {
            let [ours, theirs] = system[n];
            let ratio = theirs / ours;
            print!(" {theirs:.0} / {ours:.0} = **{ratio:.1}** |");
            good &= ratio >= work.least_ratio();
        }
        println!();
    }
    if !good {
        println!("\na ratio is below 2 (torque regressor) or 1.2 (the others)");
    }
    Ok(good)
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("duel: {error}");
            ExitCode::FAILURE
        }
    }
}

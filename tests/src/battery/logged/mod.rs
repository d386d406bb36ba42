//! Logs with a truth beside them, through the command line: independent of how `diagnose` works inside.
//!
//! 1. [`truth`]: a log, a model that lacks something, and what.
//! 2. [`verdict`]: what `proprio diagnose --json` says.
//! 3. [`judgement`]: the one against the other.
//! 4. [`simulated`]: such logs by the project's own simulator, in every noise.
//! 5. [`nonsense`]: logs in which a torque has nothing to do with the motion.

pub mod judgement;
pub mod nonsense;
pub mod simulated;
pub mod truth;
pub mod verdict;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use judgement::Judgement;
use truth::LoggedCase;

/// Where the cases of `tests/oracle/mujoco_cases.py` are made.
pub fn mujoco_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/mujoco_cases")
}

/// Where the cases of [`simulated`] are made.
pub fn simulated_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/simulated_cases")
}

/// The few of them that are committed.
pub fn mujoco_sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/mujoco_sample")
}

/// Judges cases, in their order, two at a time. `progress` hears how many are done.
pub fn run(
    program: &Path,
    cases: &[LoggedCase],
    progress: impl Fn(usize) + Sync,
) -> Vec<Judgement> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let judged = Mutex::new(vec![None; cases.len()]);
    std::thread::scope(|scope| {
        for _ in 0..super::THREADS {
            scope.spawn(|| {
                while let Some((n, case)) = {
                    let n = next.fetch_add(1, Ordering::Relaxed);
                    cases.get(n).map(|case| (n, case))
                } {
                    let judgement = Judgement::of(program, case);
                    judged.lock().expect("no thread panics")[n] = Some(judgement);
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1);
                }
            });
        }
    });
    let judged = judged.into_inner().expect("no thread panics");
    judged.into_iter().flatten().collect()
}

/// Runs a generator in `tests/oracle` by the interpreter of `$PROPRIO_ORACLE`, or of `target/oracle`, which `tests/run` makes.
///
/// # Errors
/// In words, with what to do.
pub fn generate(script: &str, arguments: &[&std::ffi::OsStr]) -> Result<(), String> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let made = tests.join("../target/oracle/bin/python");
    let python = std::env::var_os("PROPRIO_ORACLE").map_or(made, PathBuf::from);
    let help = "python3 -m venv target/oracle && target/oracle/bin/pip install -r tests/oracle/requirements-export.txt";
    let status = Command::new(&python)
        .arg(script)
        .args(arguments)
        // One case a process; a linear algebra of many threads only gets in the others' way.
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .current_dir(tests.join("oracle"))
        .status()
        .map_err(|e| format!("{}: {e}; {help}", python.display()))?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("{script} failed ({status}); its packages: {help}"))
    }
}

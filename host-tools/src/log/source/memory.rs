//! Logs that a program holds in memory: under a path of their own, so that every question asks them as it asks a file.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::arrays::{Array, Holds};

/// The arrays of a log, by what a NumPy archive calls them.
pub(super) type Arrays = Vec<(String, Array)>;

/// The logs in memory. A question may go over its logs more than once and knows them by path alone, as it does standard input.
static KEPT: Mutex<BTreeMap<PathBuf, Arc<Arrays>>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicU64 = AtomicU64::new(1);

/// A log in memory. Its [`path`](Self::path) is read as a file's is, as long as this lives.
#[derive(Debug)]
pub struct MemoryLog {
    path: PathBuf,
}

impl MemoryLog {
    /// Keeps arrays as a log: each with its name, shape and numbers row by row, as `numpy.savez` has them (`t`, `q`, `dq`, `tau`, a column
    /// per joint of `joints`; or a column of CSV each, `q/FR_hip`). SI units, joint side; a shape that does not fit its numbers
    /// counts as that of one column. What is wrong with them the reader reports.
    pub fn new(
        name: &str,
        arrays: impl IntoIterator<Item = (String, Vec<usize>, Vec<f64>)>,
        joints: &[String],
    ) -> Self {
        let numbers = arrays.into_iter().map(|(name, mut shape, numbers)| {
            if shape.iter().try_fold(1usize, |all, n| all.checked_mul(*n)) != Some(numbers.len()) {
                shape = vec![numbers.len()];
            }
            let holds = Holds::Numbers(numbers);
            (name, Array { shape, holds })
        });
        let names = Array {
            shape: vec![joints.len()],
            holds: Holds::Texts(joints.to_vec()),
        };
        let all: Arrays = numbers.chain([("joint_names".to_owned(), names)]).collect();
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = PathBuf::from(format!("{name} {number} (in memory)"));
        kept().insert(path.clone(), Arc::new(all));
        Self { path }
    }

    /// What to call it wherever a log's path is asked for.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for MemoryLog {
    fn drop(&mut self) {
        kept().remove(&self.path);
    }
}

/// The arrays at `path`, if a log in memory is called so.
pub(super) fn arrays(path: &Path) -> Option<Arc<Arrays>> {
    kept().get(path).cloned()
}

/// All that a log in memory holds, as bytes, if `path` is one's: names, shapes, texts, and numbers as little-endian binary64.
pub(crate) fn write_bytes(path: &Path, to: &mut impl io::Write) -> io::Result<bool> {
    let Some(arrays) = arrays(path) else {
        return Ok(false);
    };
    for (name, array) in &*arrays {
        writeln!(to, "{name} {:?}", array.shape)?;
        match &array.holds {
            Holds::Numbers(numbers) => {
                for number in numbers {
                    to.write_all(&number.to_le_bytes())?;
                }
            }
            Holds::Texts(texts) => writeln!(to, "{texts:?}")?,
        }
    }
    Ok(true)
}

fn kept() -> std::sync::MutexGuard<'static, BTreeMap<PathBuf, Arc<Arrays>>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{LogReader, Selection, sha256};

    /// A leg that swings for a second.
    fn arrays(scale: f64) -> Vec<(String, Vec<usize>, Vec<f64>)> {
        let t: Vec<f64> = (0..500).map(|k| f64::from(k) * 0.002).collect();
        let wave = |phase: f64| -> Vec<f64> {
            let joints = |&t: &f64| [0.0, 1.0, 2.0].map(|j| scale * (9.0 * t + phase + j).sin());
            t.iter().flat_map(joints).collect()
        };
        let matrix = |name: &str, phase| (name.to_owned(), vec![500, 3], wave(phase));
        let columns = [matrix("q", 0.0), matrix("dq", 1.5), matrix("tau", 3.0)];
        [("t".to_owned(), vec![500], t.clone())]
            .into_iter()
            .chain(columns)
            .collect()
    }

    #[test]
    fn arrays_are_read_as_a_file_until_they_are_let_go() {
        let joints = ["FR_hip", "FR_thigh", "FR_calf"].map(str::to_owned);
        let log = MemoryLog::new("chirp", arrays(0.3), &joints);
        let path = log.path().to_owned();
        let mut reader = LogReader::open(&path, Selection::Everything).unwrap();
        let first = reader.next_row().unwrap().unwrap();
        assert_eq!(first.q()[1], 0.3 * 1.0_f64.sin());
        let same = MemoryLog::new("other", arrays(0.3), &joints);
        let other = MemoryLog::new("other", arrays(0.4), &joints);
        assert_eq!(sha256(&path).unwrap(), sha256(same.path()).unwrap());
        assert_ne!(sha256(&path).unwrap(), sha256(other.path()).unwrap());
        drop(log);
        assert!(LogReader::open(&path, Selection::Everything).is_err());
    }
}

//! What a process costs, as Linux counts it.

/// What the kernel counts processor time in (USER_HZ), s.
const TICK: f64 = 0.01;

/// Processor time of this process so far, of all threads, in user and in kernel mode, s; none where `/proc` does not say.
pub fn processor_time() -> Option<f64> {
    // The 14th and the 15th field.
    ticks(14)
}

/// The same of the processes that this one has started and that have ended.
pub fn processor_time_of_children() -> Option<f64> {
    ticks(16)
}

/// The times, s, in field `first` and the one behind it: in user mode and in the kernel.
fn ticks(first: usize) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name, in brackets, may hold blanks; the field behind it is the third.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(first)? + ticks(first + 1)?) * TICK)
}

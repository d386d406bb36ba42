//! What a process costs, as Linux counts it.

/// What the kernel counts processor time in (USER_HZ), s.
const TICK: f64 = 0.01;

/// Processor time of this process so far, of all threads, in user and in kernel mode, s; none where `/proc` does not say.
pub fn processor_time() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name, in brackets, may hold blanks; the times are the 14th and the 15th field.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(14)? + ticks(15)?) * TICK)
}

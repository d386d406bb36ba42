//! The machine's clock.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Time since 1970 by this machine's clock; none where the clock stands before that, as a board's without a battery may.
pub(crate) fn unix_time() -> Duration {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.unwrap_or_default()
}

/// [`unix_time`] in ns, as messages are stamped: 64 bits without a sign last until 2554.
pub(crate) fn now_ns() -> u64 {
    u64::try_from(unix_time().as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_say_the_same_time_which_is_after_this_was_written() {
        let [first, last] = [now_ns(), unix_time().as_nanos() as u64];
        assert!(first <= last && last - first < 1_000_000_000);
        // 2025-01-01.
        assert!(first > 1_735_689_600_000_000_000);
    }
}

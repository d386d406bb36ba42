//! The moments at which dry friction may let a joint's acceleration jump.

/// The samples after which a joint turns round: its velocity changes sign, and was surely of one before and of the other after.
pub(super) fn turns(smooth: &[[f64; 4]], sure: f64) -> Vec<usize> {
    let mut turns = Vec::new();
    let (mut direction, mut crossing) = (0.0, 0);
    for (k, state) in smooth.iter().enumerate() {
        let v = state[1];
        if k > 0 && v * smooth[k - 1][1] <= 0.0 {
            crossing = k - 1;
        }
        if v.abs() > sure {
            if v.signum() * direction < 0.0 {
                turns.push(crossing);
            }
            direction = v.signum();
        }
    }
    turns
}

/// A moment at which a joint's acceleration may jump.
pub(super) struct Kink {
    /// The sample before it.
    pub(super) after: usize,
    /// Of the time to the next sample how much is left then.
    pub(super) left: f64,
    /// Of the jump's variance: it is at one of the moments about a turn, at each as likely.
    pub(super) share: f64,
    /// The first of those about the same turn.
    first: usize,
}

/// By how much the acceleration jumps about each turn, rad/s²: as the motion after it came, less as the motion before goes on, in the middle.
pub(super) fn jumps(kinks: &[Kink], t: &[f64], smooth: &[[f64; 4]]) -> Vec<f64> {
    let jump = |about: &[Kink]| {
        let (first, last) = (about.first()?.after, about.last()?.after + 1);
        let half = 0.5 * (t.get(last)? - t[first]);
        let [_, _, before, slope_before] = smooth[first];
        let [_, _, after, slope_after] = smooth[last];
        Some((after - slope_after * half) - (before + slope_before * half))
    };
    let turns = kinks.chunk_by(|one, other| one.first == other.first);
    turns.filter_map(jump).collect()
}

/// The moments about turns at which a joint is no faster than `slow`: friction may stop it at any of them. Where it turns round its velocity
/// says when that is; at the others nothing does, and the middle between two samples is off by the least.
pub(super) fn kinks_about(smooth: &[[f64; 4]], turns: &[usize], slow: f64) -> Vec<Kink> {
    let is_slow = |state: &&[f64; 4]| state[1].abs() <= slow;
    let mut all: Vec<Kink> = Vec::new();
    // A joint that is slow all the time between two turns has one.
    let mut first = 0;
    for &turn in turns {
        let before = smooth[..turn].iter().rev().take_while(is_slow).count();
        let after = smooth[turn + 1..].iter().take_while(is_slow).count();
        let known = all.last().map_or(0, |last| last.after + 1);
        if turn - before > known {
            first = all.len();
        }
        let about = (turn - before).max(known)..turn + after + 1;
        all.extend(about.map(|after| {
            let [from, to] = [after, after + 1].map(|k| smooth.get(k).map_or(0.0, |s| s[1]));
            let left = if from * to < 0.0 {
                to / (to - from)
            } else {
                0.5
            };
            Kink {
                after,
                left,
                share: 1.0,
                first,
            }
        }));
        let share = 1.0 / (all.len() - first).max(1) as f64;
        all[first..].iter_mut().for_each(|kink| kink.share = share);
    }
    all
}

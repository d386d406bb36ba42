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
    /// Whether the joint turns round there.
    turns: bool,
}

impl Kink {
    /// By how much the acceleration jumps where the joint turns round, rad/s²: as the motion after it came, less as the motion before goes on.
    pub(super) fn jump(&self, t: &[f64], smooth: &[[f64; 4]]) -> Option<f64> {
        let next = self.after + 1;
        let until = self.left * (t.get(next)? - t[self.after]);
        let since = t[next] - t[self.after] - until;
        let [_, _, before, slope_before] = smooth[self.after];
        let [_, _, after, slope_after] = smooth[next];
        let jump = (after - slope_after * until) - (before + slope_before * since);
        self.turns.then_some(jump)
    }
}

/// The moments about turns at which a joint is no faster than `slow`: friction may stop it at any of them. Where it turns round its velocity
/// says when that is; at the others nothing does, and the middle between two samples is off by the least.
pub(super) fn kinks_about(smooth: &[[f64; 4]], turns: &[usize], slow: f64) -> Vec<Kink> {
    let is_slow = |state: &&[f64; 4]| state[1].abs() <= slow;
    let kink = |after: usize| {
        let [from, to] = [after, after + 1].map(|k| smooth.get(k).map_or(0.0, |state| state[1]));
        let turns = from * to < 0.0;
        let left = if turns { to / (to - from) } else { 0.5 };
        Kink { after, left, turns }
    };
    let mut all: Vec<Kink> = Vec::new();
    for &turn in turns {
        let before = smooth[..turn].iter().rev().take_while(is_slow).count();
        let after = smooth[turn + 1..].iter().take_while(is_slow).count();
        let known = all.last().map_or(0, |last| last.after + 1);
        all.extend(((turn - before).max(known)..=turn + after).map(kink));
    }
    all
}

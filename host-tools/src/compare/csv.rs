//! Measured and predicted torque as a table, for those who plot with their own tools.

use std::io::{self, Write};

use crate::detect::JointSeries;

/// What is told of each joint: `tau/FR_calf` is the measured torque.
const COLUMNS: [&str; 5] = ["q", "dq", "tau", "predicted", "residual"];

/// A row per window in which a joint was judged: `t`, the window's middle, s since the first log's start; then of each joint the mean
/// position (rad), velocity (rad/s), measured, predicted and remaining torque (N m), empty where the joint was not judged.
///
/// # Errors
/// If it cannot be written.
pub fn write(to: impl Write, all: &[JointSeries]) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(to);
    let names = all.iter().flat_map(|series| {
        let name = |column: &&str| format!("{column}/{}", series.joint);
        COLUMNS.iter().map(name).collect::<Vec<_>>()
    });
    writer.write_record(["t".to_owned()].into_iter().chain(names))?;
    let mut times: Vec<f64> = all.iter().flat_map(|s| s.t.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let mut next = vec![0; all.len()];
    for t in times {
        writer.write_field(format!("{t:.4}"))?;
        for (series, next) in all.iter().zip(&mut next) {
            let judged = series.t.get(*next) == Some(&t);
            let numbers = [
                &series.q,
                &series.dq,
                &series.tau,
                &series.predicted,
                &series.residual,
            ];
            for of in numbers {
                let cell = of.get(*next).filter(|_| judged);
                writer.write_field(cell.map_or(String::new(), |x| format!("{x:.6}")))?;
            }
            *next += usize::from(judged);
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_judged_is_empty() {
        let series = |joint: &str, t: &[f64]| JointSeries {
            joint: joint.to_owned(),
            t: t.to_vec(),
            q: t.to_vec(),
            dq: t.to_vec(),
            tau: t.to_vec(),
            predicted: t.to_vec(),
            residual: vec![0.0; t.len()],
            ..JointSeries::default()
        };
        let mut written = Vec::new();
        write(
            &mut written,
            &[series("a", &[0.5]), series("b", &[0.25, 0.5])],
        )
        .unwrap();
        let text = String::from_utf8(written).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[0].starts_with("t,q/a,dq/a,tau/a,predicted/a,residual/a,q/b"),
            "{text}"
        );
        assert!(lines[1].starts_with("0.2500,,,,,,0.250000"), "{text}");
        assert!(lines[2].starts_with("0.5000,0.500000"), "{text}");
        assert_eq!(lines.len(), 3);
    }
}

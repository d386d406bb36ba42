//! A comparison for humans.

use std::fmt;

use super::Comparison;
use crate::table::Table;

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        let heads = [
            "joint", "rms", "fit %", "VAF %", "bias", "max", "zero", "CAD", "before",
        ];
        table.row(heads.map(str::to_owned));
        let percent = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.1}"));
        let rms = |x: f64| format!("{x:.3}");
        let before = |x: Option<f64>| x.map_or(String::new(), rms);
        for j in &self.joints {
            table.row([
                j.joint.clone(),
                rms(j.rms),
                percent(j.fit_percent),
                percent(j.vaf_percent),
                format!("{:+.3}", j.bias),
                rms(j.max),
                rms(j.zero_rms),
                rms(j.cad_rms),
                before(j.before_rms),
            ]);
        }
        let blank = String::new;
        table.row([
            "all".to_owned(),
            rms(self.rms),
            blank(),
            blank(),
            blank(),
            blank(),
            rms(self.zero_rms),
            rms(self.cad_rms),
            before(self.before_rms),
        ]);
        write!(f, "{table}")?;
        writeln!(
            f,
            "N m, mean torque over windows of 20 ms, of joints in motion."
        )?;
        for joint in &self.criticism {
            for pattern in &joint.patterns {
                writeln!(f, "{}", pattern.sentence)?;
            }
        }
        Ok(())
    }
}

//! Responses as a table: a row for each point, line, output and input.

use std::fmt::Write;

use super::result::Frf;

impl Frf {
    /// Rows of `point,f,out,in,re,im,var,var_noise,dof` and each joint's mean position `q/<joint>`: Hz, rad (or m) per N m (or N, A), its square;
    /// MATLAB's `idfrd` takes `re + 1i*im` by point.
    pub fn csv(&self) -> String {
        let mut text = "point,f,out,in,re,im,var,var_noise,dof".to_owned();
        for joint in &self.joints {
            let _ = write!(text, ",q/{joint}");
        }
        text.push('\n');
        for (p, point) in self.measured.iter().enumerate() {
            let q: String = point.q.iter().map(|q| format!(",{q:.6}")).collect();
            for (line, f) in self.frequencies.iter().enumerate() {
                for (i, output) in self.joints.iter().enumerate() {
                    for (j, input) in self.joints.iter().enumerate() {
                        let g = point.mean[line][(i, j)];
                        let (variance, noise) =
                            (point.variance[line][(i, j)], point.noise[line][(i, j)]);
                        let _ = writeln!(
                            text,
                            "{},{f:.6},{output},{input},{:.9e},{:.9e},{variance:.4e},{noise:.4e},{}{q}",
                            p + 1,
                            g.re,
                            g.im,
                            point.dof
                        );
                    }
                }
            }
        }
        text
    }
}

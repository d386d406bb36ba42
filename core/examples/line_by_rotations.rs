//! A fit whose data are not stored, and a smaller model from the same triangle: `cargo run -p proprio-core --example
//! line_by_rotations`.

use proprio_core::factor::{Factor, packed_len};

/// Slope, curvature and offset.
const COLUMNS: usize = 3;

fn main() {
    let mut factor: Factor<f64, [f64; packed_len(COLUMNS)]> = Factor::new::<COLUMNS>();
    // y = 2 x + 0.5, with an error that repeats.
    for k in 0..1000 {
        let x = f64::from(k) * 1e-3;
        let error = 0.01 * f64::from(k % 7 - 3);
        let mut row = [x, x * x, 1.0, 2.0 * x + 0.5 + error];
        factor.update(&mut row).expect("the row is finite");
    }
    let mut theta = [0.0; COLUMNS];
    factor.solve(&mut theta).expect("the data tell all three");
    println!(
        "slope {:.3}, curvature {:.3}, offset {:.3}",
        theta[0], theta[1], theta[2]
    );

    // Without the curvature: its column is dropped, no datum is looked at again.
    let mut smaller: Factor<f64, [f64; packed_len(2)]> = Factor::new::<2>();
    let mut scratch = [0.0; 3];
    smaller
        .select_from(&factor, &[0, 2], &mut scratch)
        .expect("the columns are there");
    let mut theta = [0.0; 2];
    smaller.solve(&mut theta).expect("the data tell both");
    println!("slope {:.3}, offset {:.3}", theta[0], theta[1]);
    println!(
        "error {:.5} with curvature, {:.5} without",
        (factor.residual().powi(2) / factor.rows()).sqrt(),
        (smaller.residual().powi(2) / smaller.rows()).sqrt()
    );
}

//! One row folded into a factor, and a factor solved, at the sizes of a joint, a leg and the robot:
//! `cargo bench -p proprio-core --bench factor`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use proprio_core::factor::{Factor, packed_len};

fn bench(c: &mut Criterion, columns: usize) {
    let mut seed = 1_u32;
    let mut next = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed as i32 >> 8) / f64::from(1 << 23)
    };
    let rows: Vec<Vec<f64>> = (0..4 * columns)
        .map(|_| (0..=columns).map(|_| next()).collect())
        .collect();
    let storage = vec![0.0; packed_len(columns)];
    let mut factor = Factor::in_storage(columns, storage).expect("as long as it says");
    let mut group = c.benchmark_group(format!("{columns} columns"));
    let mut turn = rows.iter().cycle();
    let mut row = vec![0.0; columns + 1];
    group.bench_function("update", |bench| {
        bench.iter(|| {
            row.copy_from_slice(turn.next().expect("a cycle has no end"));
            factor.update(black_box(&mut row)).expect("finite rows");
        });
    });
    let mut theta = vec![0.0; columns];
    group.bench_function("solve", |bench| {
        bench.iter(|| factor.solve(black_box(&mut theta)).expect("many rows"));
    });
    group.finish();
}

fn all(c: &mut Criterion) {
    [25, 42, 168]
        .into_iter()
        .for_each(|columns| bench(c, columns));
}

criterion_group!(benches, all);
criterion_main!(benches);

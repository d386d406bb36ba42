use proprio::criticism::*;
fn main() {
    let logs: Vec<std::path::PathBuf> = std::env::args().skip(1).map(Into::into).collect();
    let model = proprio::model::Model::default();
    let t0 = std::time::Instant::now();
    let recording = Recording::read(&logs, &model, |_, _| {}).unwrap();
    println!("read {:?}", t0.elapsed());
    let d = diagnose(&recording, &model).unwrap();
    println!("done {:?}", t0.elapsed());
    println!(
        "{:?} {} {} -> floor {}",
        d.verdict, d.reason, d.held_out_rms, d.noise_floor_rms
    );
    for c in d.candidates.iter().take(8) {
        println!(
            "{} {:?} gain {:.3} ± {:.3} z {:.1} {:.4} ± {:.4} {} {} alt {:?}",
            c.effect,
            c.joints,
            c.held_out_gain,
            c.held_out_gain_error,
            c.z,
            c.value,
            c.std,
            c.in_bounds,
            c.significant,
            c.alternatives
        );
    }
    for p in &d.path {
        println!(
            "  {}{} {:?} {:.4}",
            if p.removed { "-" } else { "+" },
            p.effect,
            p.joints,
            p.held_out_rms
        );
    }
    for j in &d.joints {
        println!(
            "   {} {:.3} -> {:.3} floor {:.3}",
            j.joint, j.before, j.after, j.floor
        );
    }
}

//! Where a model is wrong, and which physical effect it lacks.

mod blocks;
mod column;
mod limb;
mod motion;
mod recording;
mod rigid_body;
mod rows;
mod triangle;

pub use recording::Recording;
mod selection;

#[doc(hidden)]
pub fn try_out(logs: &[std::path::PathBuf]) {
    let model = crate::model::Model::default();
    let t0 = std::time::Instant::now();
    let recording = Recording::read(logs, &model, |_, _| {}).unwrap();
    println!("read {:?}", t0.elapsed());
    for (limb, data) in &recording.limbs {
        let t0 = std::time::Instant::now();
        let mut c = limb::LimbCriticism::new(&model, limb, data).unwrap();
        println!(
            "{} built {:?} blocks {:?} entries {} rows {:?}",
            limb.name,
            t0.elapsed(),
            c.blocks,
            c.columns.entries.len(),
            c.all.iter().map(|f| f.rows()).collect::<Vec<_>>()
        );
        let t0 = std::time::Instant::now();
        let cands = c.candidates(None);
        println!("candidates {:?}", t0.elapsed());
        let n: Vec<f64> = c.all.iter().map(|f| f.rows()).collect();
        let floor: Vec<f64> = c
            .all
            .iter()
            .map(|f| (f.residual() / (f.rows() - f.columns() as f64)).sqrt())
            .collect();
        println!("  saturated {floor:.3?}");
        for k in cands.iter().take(6) {
            println!(
                "   {}:{} gain {:?} value {:?} std {:?} z {:.1} ok {}",
                k.place.0.name(),
                k.place.1 as isize,
                k.gain(),
                k.value,
                k.std,
                k.z,
                c.in_bounds(k)
            );
        }
        let t0 = std::time::Instant::now();
        let path = selection::walk(&mut c);
        println!("walk {:?}", t0.elapsed());
        let rms =
            |rss: &[f64]| -> Vec<f64> { rss.iter().zip(&n).map(|(r, n)| (r / n).sqrt()).collect() };
        println!("  start {:.4?}", rms(&path.start));
        let best = path.first.iter().find(|j| j.significant);
        if let Some(b) = best {
            println!("  alternatives {:?}", b.alternatives);
        }
        for s in &path.steps {
            println!(
                "  {}{}:{} {:.4?}",
                if s.removed { "-" } else { "+" },
                s.place.0.name(),
                s.place.1 as isize,
                rms(&s.rss)
            );
        }
        for k in c.active_entries().into_iter().skip(30) {
            let e = &c.columns.entries[k];
            println!(
                "     {}:{}[{}] = {:.5} ± {:.5}",
                e.effect.unwrap().name(),
                e.joint as isize,
                e.parameter,
                c.value(k, c.fit.theta[k]),
                c.fit.std[k]
            );
        }
        println!(
            "     masses {:.3} {:.3} {:.3}",
            c.fit.theta[0], c.fit.theta[10], c.fit.theta[20]
        );
    }
}

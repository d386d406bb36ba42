//! Contact found where it is, and nowhere else.

use std::path::PathBuf;

use super::*;
use crate::criticism::Recording;

use crate::model::{Model, Robot};

fn show(contact: Option<&Contact>) -> String {
    contact.map_or("none".into(), |c| {
        format!(
            "F {:.2} ± {:.2} z {:.1} gain {:.3} ± {:.3} share {:.2} pushing {:.2} episodes {} sensor {:?} {}",
            c.force, c.std, c.z, c.gain, c.gain_error, c.share, c.pushing, c.episodes, c.sensor,
            if c.is_significant() { "YES" } else { "no" }
        )
    })
}

fn of_log(path: PathBuf, only: usize) -> Vec<Option<Contact>> {
    let model = Model::new(Robot::go2());
    let recording = Recording::read(&[path], &model, |_, _| ()).unwrap();
    let limbs = recording.limbs.iter().take(only);
    limbs
        .map(|(limb, data)| {
            let limb = LimbCriticism::new(&model, limb, data, true).unwrap();
            if std::env::var_os("DEBUG").is_some() {
                debug(&limb);
            }
            Contact::of(&limb)
        })
        .collect()
}

#[test]
fn explore() {
    let Some(list) = std::env::var_os("EXPLORE") else {
        return;
    };
    for path in list.to_str().unwrap().split(',') {
        for contact in of_log(path.into(), 4) {
            println!("{path}: {}", show(contact.as_ref()));
        }
    }
}

fn debug(limb: &LimbCriticism) {
    let mut s = Search::new(limb).unwrap();
    let show = |s: &Search| {
        let text: String = s
            .phases
            .iter()
            .map(|p| match p {
                Phase::Swing => '.',
                Phase::Contact => 'C',
                Phase::Other => 'o',
            })
            .collect();
        println!("noise {:?}\n{text}", s.noise);
    };
    s.predict(&vec![s.limb.given(); s.limb.tests.len()]);
    s.noise = s.friction();
    s.classify();
    show(&s);
    s.phases.fill(Phase::Swing);
    s.run();
    show(&s);
}

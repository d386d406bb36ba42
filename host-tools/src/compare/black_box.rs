//! What black boxes say of a model, in words.

use crate::detect::black_box::{BlackBox, Inputs};
use crate::select::criteria::STRUCTURE;
use crate::summary::torque;
use crate::table::{Table, with_std};

/// What takes this share of all that can be taken away is worth a word.
const WORTH_SAYING: f64 = 0.2;

/// How far each box comes, and the noise (N m) if it is known, as written.
pub(super) fn table(boxes: &BlackBox, noise: Option<String>) -> Table {
    let mut table = Table::default();
    table.row(["a non-parametric bound from, blind to torque", "rms"].map(str::to_owned));
    table.row([
        "nothing: the model, without what smoothing lost".to_owned(),
        torque(boxes.rms),
    ]);
    for rung in &boxes.rungs {
        let sees = match rung.sees {
            Inputs::Joint => "the joint's own motion at that moment",
            Inputs::Limb => "+ that of its limb's other joints",
            Inputs::Past => "+ what came before",
        };
        table.row([sees.to_owned(), with_std(rung.rms, rung.std)]);
    }
    if let Some(noise) = noise {
        table.row(["(noise)".to_owned(), noise]);
    }
    table
}

/// What the boxes say, in a sentence.
pub(super) fn sentence(boxes: &BlackBox) -> String {
    let mut least = boxes.rms;
    let [joint, limb, past] = [0, 1, 2].map(|n| {
        least = least.min(boxes.rungs[n].rms);
        least
    });
    let square = boxes.rms.powi(2);
    let all = square - past.powi(2);
    if all < STRUCTURE * square {
        return format!(
            "A non-parametric bound from the limb's whole motion explains no more than {:.0} % of the squared error: the rest is noise, or does \
             not follow the motion",
            (100.0 * all / square).max(0.0).ceil()
        );
    }
    let parts = [
        (square - joint.powi(2), "is the joint's own, now"),
        (
            joint.powi(2) - limb.powi(2),
            "comes from the other joints of its limb",
        ),
        (limb.powi(2) - past.powi(2), "has memory"),
    ];
    let mut worth: Vec<(f64, &str)> = (parts.into_iter())
        .filter(|(part, _)| *part >= WORTH_SAYING * all)
        .collect();
    worth.sort_by(|a, b| b.0.total_cmp(&a.0));
    let parts: Vec<String> = (worth.into_iter())
        .map(|(part, what)| format!("{:.0} % {what}", 100.0 * part / all))
        .collect();
    format!(
        "A non-parametric bound reaches {} N m instead of {}; of the squared error that it explains {}",
        with_std(past, boxes.rungs[2].std),
        torque(boxes.rms),
        parts.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::black_box::Rung;

    fn boxes(rms: [f64; 4]) -> BlackBox {
        let sees = [Inputs::Joint, Inputs::Limb, Inputs::Past].into_iter();
        BlackBox {
            rms: rms[0],
            rungs: (sees.zip(&rms[1..]))
                .map(|(sees, &rms)| Rung {
                    sees,
                    rms,
                    std: 0.002,
                })
                .collect(),
        }
    }

    #[test]
    fn the_largest_part_is_told_first_and_small_ones_not_at_all() {
        let said = sentence(&boxes([0.289, 0.22, 0.21, 0.161]));
        assert_eq!(
            said,
            "A non-parametric bound reaches 0.1610 ±0.0020 N m instead of 0.289; of the squared error that it explains 61 % is the joint's own, \
             now, 32 % has memory"
        );
    }

    #[test]
    fn of_noise_nothing_is_told() {
        let said = sentence(&boxes([0.1, 0.1, 0.1, 0.099]));
        assert!(said.contains("no more than 2 %"), "{said}");
    }
}

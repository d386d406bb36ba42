//! What contact means for the rest of what is said.

use super::LeftOut;

/// What a user should know of the rest; each limb in contact with the joint that carries its foot.
/// `unjudged`: no leg is judged where more than one carries a force.
pub(crate) fn words(limbs: &[(String, LeftOut)], unjudged: bool) -> Vec<String> {
    let mut words = Vec::new();
    let names = |chosen: &dyn Fn(&LeftOut) -> bool| -> String {
        let names = limbs.iter().filter(|(_, left)| chosen(left));
        names
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let all = names(&|_| true);
    if unjudged {
        return vec![format!(
            "{all}: more than one foot carries a force: the robot stands or walks, its base moves, and no leg counts as hung; nothing else is judged"
        )];
    }
    if !all.is_empty() {
        words.push(format!(
            "{all}: windows in which the foot carries a force are left out; every other effect is judged in swing only"
        ));
    }
    if limbs.len() > 1 {
        words.push(
            "more than one leg carries a force: the robot stands or walks, and its base moves, which this model takes as fixed. \
             Effects found in swing may be the base's motion: with an IMU's data use --free-base, else confirm them with the robot \
             suspended"
                .to_owned(),
        );
    }
    let little = names(&|left| left.too_little_swing);
    if !little.is_empty() {
        words.push(format!(
            "{little}: insufficient for any other effect, too little swing is left"
        ));
    }
    let guessed = names(&|left| !left.contact.described);
    if !guessed.is_empty() {
        words.push(format!(
            "{guessed}: the robot's description has no foot (a link fixed to the last body); the last body's centre of mass stands for it"
        ));
    }
    words
}

//! Joints whose frames are not where the description has them, instead of effects or where the catalogue leaves much.
//!
//! What a wrong axis does to the torque is none of the catalogue's effects, and some of them together resemble it. So where effects beyond
//! those of every drive were found, or more than noise is left, one joint's frame is let move in the model with those of every drive alone: where that
//! predicts as well, the frame is the plainer cause, and the search is made again with the frame where the data have it.

use super::bodies::{here, with_drive};
use crate::detect::bodies::at_floor;
use crate::detect::frame::{self, OtherFrame};
use crate::estimate::limb_data::{LimbData, Squares};
use crate::model::Model;
use crate::select::criteria::step::{explains_most, is_frame};
use crate::select::limbs::Limbs;
use crate::select::search::Found;
use crate::select::state::how;

/// The model with the frames where the data have them, and those frames, each with its limb.
pub(super) struct Moved {
    pub(super) model: Model,
    pub(super) frames: Vec<(usize, OtherFrame)>,
}

/// The frames that do instead of effects, or explain most of what is left where none was found.
pub(super) fn instead(data: &[LimbData], found: &Found<Limbs>, model: &Model) -> Option<Moved> {
    let of = |limb: usize| {
        let effects = here(&[limb], found).count();
        let (own, end) = (&data[limb], &found.end.squares[limb]);
        let noise = at_floor(own);
        if effects == 0 && noise.is_none_or(|noise| end.total() <= noise) {
            return None;
        }
        let weighted = |squares: &Squares| squares.weighted(&found.end.fits[limb].noise);
        // What is to be reached: what the effects leave, or noise of the same shares.
        let goal = match noise.filter(|_| effects == 0) {
            Some(noise) => end.times(noise / end.total()),
            None => end.clone(),
        };
        let (frame, squares) = frame::other(own, &with_drive(own), &how(), &goal)?;
        let explains = |noise| explains_most(end.total(), squares.total(), noise);
        let is_cause = is_frame(weighted(&squares), weighted(end), effects)
            && (effects > 0 || noise.is_some_and(explains));
        is_cause.then_some((limb, frame))
    };
    let frames: Vec<_> = (0..data.len()).filter_map(of).collect();
    let moved = |model: Model, (_, frame): &(usize, OtherFrame)| frame.applied(&model);
    (!frames.is_empty()).then(|| Moved {
        model: frames.iter().fold(model.clone(), moved),
        frames,
    })
}

impl Moved {
    /// The limbs' data under it.
    pub(super) fn data<'a>(&'a self, data: &[LimbData<'a>]) -> Option<Vec<LimbData<'a>>> {
        data.iter()
            .map(|limb| limb.with_geometry(&self.model))
            .collect()
    }
}

//! The page of `validate`.

use crate::model::Provenance;
use crate::report::motion;
use crate::report::{Header, Page};
use crate::validate::Feedback;

/// The feedback torque that each model leaves, over time.
pub fn feedback(models: &[Feedback]) -> Page {
    let no_logs: [std::path::PathBuf; 0] = [];
    let finding = |of: &Feedback| {
        format!(
            "{}: feedback of {:.4} N m rms, {:.2} % of the torque's mean square.",
            of.model, of.rms, of.share_percent
        )
    };
    // Friction alone is a figure among the findings: its line would hide the model's.
    let drawn: Vec<&Feedback> = models.iter().filter(|of| !of.friction_only).collect();
    let best = models.iter().min_by(|a, b| a.rms.total_cmp(&b.rms));
    Page {
        header: Header {
            title: "Feedback torque that remains".to_owned(),
            headline: best.map_or_else(String::new, |best| {
                format!(
                    "{} needs least feedback: {:.3} N m rms",
                    best.model, best.rms
                )
            }),
            findings: models.iter().map(|model| finding(model).into()).collect(),
            command: Provenance::of(&no_logs)
                .map(|p| p.command)
                .unwrap_or_default(),
            ..Header::default()
        },
        sections: vec![motion::feedback(&drawn)],
    }
    .folded()
}

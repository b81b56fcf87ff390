//! Warnings about conductors that touch electrodes.

use capsense::core::occupancy::Contact;
use capsense::{Pipeline, Scene};
use std::collections::BTreeMap;

/// Which objects touched which electrodes so far, and in which frame first.
#[derive(Debug, Default)]
pub(super) struct ContactLog {
    first_frames: BTreeMap<Contact, usize>,
}

impl ContactLog {
    /// Notes the contacts of the frame computed last.
    pub(super) fn note(&mut self, frame: usize, pipeline: &Pipeline) {
        for &contact in pipeline.simulator().contacts() {
            self.first_frames.entry(contact).or_insert(frame);
        }
    }

    /// One warning for each contact.
    pub(super) fn warnings(&self, scene: &Scene) -> Vec<String> {
        let warning = |(contact, frame): (&Contact, &usize)| {
            format!(
                "{}: in frame {frame} object `{}` touches electrode `{}`, a short circuit: \
                 capacitances of what touches mean nothing",
                scene.source.file(),
                scene.objects[contact.object].name,
                scene.electrodes[contact.electrode]
            )
        };
        self.first_frames.iter().map(warning).collect()
    }
}

/// Prints warnings.
pub(super) fn print_warnings(warnings: &[String]) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
}

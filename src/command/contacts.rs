//! Warnings about conductors that touch electrodes, and about objects that the mesh is too coarse for.

use capsense::core::occupancy::Contact;
use capsense::{Pipeline, Scene};
use std::collections::BTreeMap;

/// Frames from one look for unresolved objects to the next: it is not free, and objects that are thin stay thin.
const BETWEEN_LOOKS: usize = 64;

/// Which objects touched which electrodes so far, which were not resolved, and in which frame first.
#[derive(Debug, Default)]
pub(super) struct ContactLog {
    first_frames: BTreeMap<Contact, usize>,
    first_unresolved: BTreeMap<usize, usize>,
    noted: usize,
}

impl ContactLog {
    /// Notes the contacts, and now and then the unresolved objects, of the frame computed last.
    pub(super) fn note(&mut self, frame: usize, pipeline: &mut Pipeline) {
        for &contact in pipeline.simulator().contacts() {
            self.first_frames.entry(contact).or_insert(frame);
        }
        if self.noted.is_multiple_of(BETWEEN_LOOKS) {
            // What cannot be drawn is told by the next frame.
            for object in pipeline.unresolved().unwrap_or_default() {
                self.first_unresolved.entry(object).or_insert(frame);
            }
        }
        self.noted += 1;
    }

    /// One warning for each contact and each unresolved object.
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
        let unresolved = |(&object, frame): (&usize, &usize)| {
            format!(
                "{}: in frame {frame} object `{}` is too thin or too small for the mesh, or for the camera's pixels, or too \
                 close to another conductor: what it does is missing in the capacitances, in part at least, and error bars may \
                 not show it",
                scene.source.file(),
                scene.objects[object].name
            )
        };
        let contacts = self.first_frames.iter().map(warning);
        contacts.chain(self.first_unresolved.iter().map(unresolved)).collect()
    }
}

/// Prints warnings.
pub(super) fn print_warnings(warnings: &[String]) {
    for warning in warnings {
        eprintln!("warning: {warning}");
    }
}

//! The plugins of a pipeline, each with its name and its use.

use tagalong_core::{Detector, Likelihood};

use crate::{DetectorSettings, Role};

/// A plugin under its name.
pub(crate) struct Slot<P: ?Sized> {
    pub(crate) name: String,
    pub(crate) plugin: Box<P>,
}

/// A detector and what it is used for.
pub(crate) struct DetectorSlot {
    pub(crate) settings: DetectorSettings,
    pub(crate) plugin: Box<dyn Detector>,
}

impl DetectorSlot {
    pub(crate) fn has(&self, role: Role) -> bool {
        self.settings.roles.contains(&role)
    }

    pub(crate) fn is_due(&self, frame: u64) -> bool {
        frame % u64::from(self.settings.every.max(1)) == u64::from(self.settings.offset)
    }
}

/// Weighs scenes for the filter, where a detector is used for that.
pub(crate) fn likelihood(detectors: &[DetectorSlot]) -> Option<&dyn Likelihood> {
    detectors.iter().find(|slot| slot.has(Role::Weigh))?.plugin.likelihood()
}

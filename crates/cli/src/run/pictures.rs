use std::sync::mpsc::{SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};

use tagalong_app::outcome::Failure;
use tagalong_render::{Overlay, OverlayData};

/// Pictures that wait to be rendered; each holds its images.
const WAITING: usize = 2;

/// Renderer of pictures, here or in a separate thread.
pub enum Pictures {
    /// No pictures requested.
    None,
    /// One after the other.
    Here(Overlay),
    /// In parallel with the pipeline.
    Aside(SyncSender<OverlayData>, JoinHandle<Result<(), String>>),
}

impl Pictures {
    /// Renders in a separate thread if there are three threads or more, and the system starts one.
    pub fn new(overlay: Option<Overlay>, threads: usize) -> Self {
        let Some(overlay) = overlay else { return Self::None };
        if threads < 3 {
            return Self::Here(overlay);
        }
        // Bounded: slow rendering holds the pipeline back instead of filling the memory.
        let (sender, scenes) = sync_channel::<OverlayData>(WAITING);
        // The renderer stays here until the thread runs: one that cannot start would drop it.
        let (hand_over, overlays) = channel::<Overlay>();
        let drawer = thread::Builder::new().name("pictures".into()).spawn(move || {
            let Ok(mut overlay) = overlays.recv() else { return Ok(()) };
            scenes.iter().try_for_each(|scene| overlay.draw(&scene))
        });
        let Ok(drawer) = drawer else { return Self::Here(overlay) };
        match hand_over.send(overlay) {
            Ok(()) => Self::Aside(sender, drawer),
            Err(unsent) => Self::Here(unsent.0),
        }
    }

    /// Renders the scene that `scene` makes.
    ///
    /// # Errors
    /// If the picture cannot be written. A parallel renderer reports that in [`Pictures::finish`].
    pub fn draw(&mut self, scene: impl FnOnce() -> OverlayData) -> Result<(), Failure> {
        match self {
            Self::None => Ok(()),
            Self::Here(overlay) => overlay.draw(&scene()).map_err(Failure::failed),
            Self::Aside(sender, _) => {
                // A renderer that ended left its error for `finish`.
                let _ = sender.send(scene());
                Ok(())
            }
        }
    }

    /// Waits for the last picture.
    ///
    /// # Errors
    /// If a picture could not be written.
    pub fn finish(self) -> Result<(), Failure> {
        let Self::Aside(sender, drawer) = self else { return Ok(()) };
        drop(sender);
        let drawn = drawer.join().unwrap_or_else(|_| {
            Err("drawing failed; please report this, and run without --overlay".to_owned())
        });
        drawn.map_err(Failure::failed)
    }
}

use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use crate::outcome::Failure;
use crate::overlay::{Overlay, Scene};

/// Pictures that wait to be drawn; each holds its images.
const WAITING: usize = 2;

/// Draws pictures, or none, here or in a thread of its own.
pub enum Pictures {
    /// Nobody asked for pictures.
    None,
    /// One after the other.
    Here(Overlay),
    /// Beside the pipeline.
    Aside(SyncSender<Scene>, JoinHandle<Result<(), String>>),
}

impl Pictures {
    /// Draws aside if there are three threads or more.
    pub fn new(overlay: Option<Overlay>, threads: usize) -> Self {
        let Some(mut overlay) = overlay else { return Self::None };
        if threads < 3 {
            return Self::Here(overlay);
        }
        let (sender, scenes) = sync_channel::<Scene>(WAITING);
        let draw_all = move || scenes.iter().try_for_each(|scene| overlay.draw(&scene));
        Self::Aside(sender, thread::spawn(draw_all))
    }

    /// Draws what `scene` makes.
    ///
    /// # Errors
    /// If the picture cannot be written. Beside the pipeline that is told by
    /// [`Pictures::finish`].
    pub fn draw(&mut self, scene: impl FnOnce() -> Scene) -> Result<(), Failure> {
        match self {
            Self::None => Ok(()),
            Self::Here(overlay) => overlay.draw(&scene()).map_err(Failure::failed),
            Self::Aside(sender, _) => {
                // A drawer that is gone left its reason for `finish`.
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
        let gone = || "drawing failed; please report this, and run without --overlay".to_owned();
        drawer.join().unwrap_or_else(|_| Err(gone())).map_err(Failure::failed)
    }
}

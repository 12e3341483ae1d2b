use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use tagalong_core::{Error, Frame, Input, Result};

/// Failure to process a frame. A pipeline that returned one is stopped, except after
/// [`StepError::Lacks`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The frame lacks an input that a plugin or a stage requires. Nothing was done with it but to
    /// note the robot's motion, and the pipeline takes the next frame.
    #[error("frame {frame}: `{plugin}` needs {input}, which this frame does not have")]
    Lacks {
        /// The plugin or the stage.
        plugin: String,
        /// Index of the frame.
        frame: u64,
        /// The input.
        input: Input,
    },
    /// A plugin refused the frame.
    #[error("frame {frame}: `{plugin}` {error}")]
    Plugin {
        /// The plugin.
        plugin: String,
        /// Index of the frame.
        frame: u64,
        /// The plugin's error.
        error: Error,
    },
    /// A plugin panicked: a defect in its code.
    #[error("frame {frame}: `{plugin}` panicked: {message}; please report this to its author")]
    Panic {
        /// The plugin.
        plugin: String,
        /// Index of the frame.
        frame: u64,
        /// The panic's message.
        message: String,
    },
    /// The pipeline failed on an earlier frame.
    #[error("the pipeline stopped at frame {frame}; build it anew to go on")]
    Stopped {
        /// The frame on which it failed.
        frame: u64,
    },
}

impl StepError {
    /// Creates the error of a stage that is no plugin, by the name of its section in a config.
    pub fn of_stage(section: &str, frame: &Frame, error: Error) -> Self {
        Self::Plugin { plugin: section.to_owned(), frame: frame.index, error }
    }

    /// Distinguishes an image that no plugin declares from one that the log lacks; `frame` is the
    /// original frame, including the images that were withheld.
    pub fn blame_declaration(self, frame: &Frame) -> Self {
        match self {
            Self::Plugin { plugin, frame: index, error: Error::MissingImage { input } }
                if frame.holds(input) =>
            {
                let error = Error::UndeclaredImage { input };
                Self::Plugin { plugin, frame: index, error }
            }
            other => other,
        }
    }

    /// Returns the index of the frame that failed.
    pub fn frame(&self) -> u64 {
        match self {
            Self::Lacks { frame, .. }
            | Self::Plugin { frame, .. }
            | Self::Panic { frame, .. }
            | Self::Stopped { frame } => *frame,
        }
    }
}

/// A plugin with its name. Every call goes through [`Guarded::call`], which contains the plugin's
/// panics, names it in its errors and measures its time: in one place for all kinds.
pub struct Guarded<P: ?Sized> {
    name: String,
    plugin: Box<P>,
    spent: Duration,
}

impl<P: ?Sized> Guarded<P> {
    /// Wraps a plugin.
    pub fn new(name: impl Into<String>, plugin: Box<P>) -> Self {
        Self { name: name.into(), plugin, spent: Duration::ZERO }
    }

    /// Returns the plugin's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the plugin, for calls that cannot fail.
    pub fn plugin(&self) -> &P {
        &self.plugin
    }

    /// Calls into the plugin while it works on the frame with this index.
    ///
    /// # Errors
    /// [`StepError::Plugin`] with the plugin's own error; [`StepError::Panic`] if it panics.
    pub fn call<T>(
        &mut self,
        frame: u64,
        call: impl FnOnce(&mut P) -> Result<T>,
    ) -> std::result::Result<T, StepError> {
        // The assertion is sound because a pipeline stops after a panic: no plugin is called again
        // in a state that a panic left half updated.
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| call(&mut self.plugin)));
        self.spent += start.elapsed();
        match outcome {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(error)) => Err(StepError::Plugin { plugin: self.name.clone(), frame, error }),
            Err(panic) => {
                let message = panic_message(panic.as_ref());
                Err(StepError::Panic { plugin: self.name.clone(), frame, message })
            }
        }
    }

    /// Calls a method that returns no error of its own.
    ///
    /// # Errors
    /// [`StepError::Panic`] if the plugin panics.
    pub fn ask<T>(
        &mut self,
        frame: u64,
        ask: impl FnOnce(&mut P) -> T,
    ) -> std::result::Result<T, StepError> {
        self.call(frame, |plugin| Ok(ask(plugin)))
    }

    /// Returns the time that the plugin worked since the last call of this function, ms.
    pub fn take_ms(&mut self) -> f64 {
        std::mem::take(&mut self.spent).as_secs_f64() * 1e3
    }
}

fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_and_panics_carry_the_name_and_the_frame() {
        let mut guarded: Guarded<u32> = Guarded::new("counter", Box::new(1));
        assert_eq!(guarded.ask(3, |count| *count + 1), Ok(2));
        let refused: Result<u32> = Err(Error::Other("is tired".into()));
        let error = guarded.call(4, |_| refused).unwrap_err();
        assert_eq!(error.to_string(), "frame 4: `counter` is tired");
        let error = guarded.ask(5, |_| panic!("out of {}", "numbers")).unwrap_err();
        let error: StepError = error;
        assert!(error.to_string().starts_with("frame 5: `counter` panicked: out of numbers"));
        assert_eq!(error.frame(), 5);
        assert_eq!((guarded.name(), *guarded.plugin()), ("counter", 1));
    }

    #[test]
    fn time_is_taken_once() {
        let mut guarded: Guarded<u32> = Guarded::new("sleeper", Box::new(1));
        let nap = Duration::from_millis(2);
        guarded.ask(1, |_| std::thread::sleep(nap)).unwrap();
        assert!(guarded.take_ms() >= 2.0);
        assert_eq!(guarded.take_ms(), 0.0);
    }
}

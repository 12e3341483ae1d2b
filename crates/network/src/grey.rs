use tagalong_core::{Derived, Frame, Result, RgbImage};

/// Grey image of a frame, converted to three equal colours.
struct GreyAsColour(RgbImage);

impl Derived for GreyAsColour {
    fn derive(frame: &Frame) -> Result<Self> {
        Ok(Self(frame.grey()?.map(|value| [value; 3])))
    }
}

/// Calls `run` with the colour image of a frame, or with its grey image as three equal colours.
///
/// # Errors
/// [`tagalong_core::Error::MissingImage`] for a frame with neither.
pub fn with_colours<T>(frame: &Frame, run: impl FnOnce(&RgbImage) -> T) -> Result<T> {
    match frame.colour() {
        Ok(colour) => Ok(run(colour)),
        Err(_) => Ok(run(&frame.derived::<GreyAsColour>()?.0)),
    }
}

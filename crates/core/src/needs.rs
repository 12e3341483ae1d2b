/// What a pipeline cannot do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Needs {
    /// Colour or grey images.
    pub colour: bool,
    /// Depth images.
    pub depth: bool,
    /// The right image of a stereo pair.
    pub right: bool,
}

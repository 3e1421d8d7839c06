//! Why the marker was seen in a frame, or was not.

/// What decided about a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// A ball of its colour and size, where the motors allow it.
    Seen,
    /// Not searched: no motor angles at the time of the frame.
    NoMotor,
    /// Not searched: the motors and the registration put the tip out of the camera's view.
    OutOfView,
    /// Nothing of its colour in the region.
    NoColour,
    /// Something of its colour, and nothing with its size and shape: partly hidden, cut off by the image's edge, or another thing.
    NoBall,
    /// In one camera only, and too far from where it was expected.
    Alone,
    /// In both cameras, whose rays do not meet.
    RaysMiss,
    /// In both cameras at one place, where the motors and the sightings before do not allow it.
    Elsewhere,
}

impl Reason {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Seen, Self::NoMotor, Self::OutOfView, Self::NoColour, Self::NoBall, Self::Alone, Self::RaysMiss, Self::Elsewhere];

    /// In a few words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Seen => "seen",
            Self::NoMotor => "not searched: no motor angles",
            Self::OutOfView => "not searched: the tip out of view",
            Self::NoColour => "hidden: nothing of its colour",
            Self::NoBall => "hidden: of its colour, but no whole ball of its size",
            Self::Alone => "rejected: in this camera only, and not where expected",
            Self::RaysMiss => "rejected: the rays of both cameras do not meet",
            Self::Elsewhere => "rejected: where the motors do not allow it",
        }
    }
}

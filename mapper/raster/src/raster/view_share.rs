//! What one of several views has in an image.

/// How the gradient by an image is that by one of the views that it shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewShare<'a> {
    /// Weight of the view in the colour of the image.
    pub colour: ColourShare<'a>,
    /// Whether depth and alpha of the image are those of the view; else they do not depend on it.
    pub geometry: bool,
}

/// Weight of a view in the colour of an image.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ColourShare<'a> {
    /// The same for all rows.
    Same(f32),
    /// One for every row of the image.
    Rows(&'a [f32]),
}

impl ColourShare<'_> {
    /// The weight in a row of the image.
    pub(super) fn of_row(self, row: usize) -> f32 {
        match self {
            Self::Same(weight) => weight,
            Self::Rows(weights) => weights[row],
        }
    }
}

impl ViewShare<'_> {
    /// The image is the view.
    pub(super) const WHOLE: Self = Self { colour: ColourShare::Same(1.0), geometry: true };
}

//! Conventions of Gaussian splatting that its formulas leave open, as the public rasterizers settle them.

/// Variance in pixels squared that is added to both axes of every projected Gaussian: a splat never gets thinner
/// than about a pixel, so none falls between pixel centres.
pub const LOW_PASS: f64 = 0.3;

/// Variance in pixels squared that is added to both axes of a projected Gaussian where the tilt of its depth is found: a
/// splat seen edge-on tilts by some of its own standard deviations, not without bound. It is far below [`LOW_PASS`], which
/// would flatten the tilt of every splat that is as small as a pixel.
pub const TILT_LOW_PASS: f64 = 0.03;

/// Largest opacity of a splat at a pixel. It keeps `1 - alpha` away from zero, which the backward pass divides by.
pub const MAX_ALPHA: f64 = 0.999;

/// A splat that is fainter than this at a pixel, less than a step of an 8-bit image, is skipped there.
pub const MIN_ALPHA: f64 = 1.0 / 255.0;

/// A pixel is finished before the splat that would take its transmittance to this or below.
pub const MIN_TRANSMITTANCE: f64 = 1e-4;

/// Gaussians whose centre has a camera z of this or less, metres, are not drawn.
pub const NEAR_PLANE: f64 = 0.01;

/// How far beyond the image border, as a fraction of half the image, the Jacobian of the projection follows the
/// centre of a Gaussian; farther out the linearisation would stretch it without bound.
pub const JACOBIAN_MARGIN: f64 = 0.3;

/// Gaussians whose centre has a larger camera z than this, metres, are not drawn; nothing that far away is mapped.
pub const FAR_PLANE: f64 = 1e5;

/// Gaussians of which a colour channel is farther from zero than this, linear light, are not drawn: white is 1.
pub const MAX_COLOUR: f64 = 1e4;

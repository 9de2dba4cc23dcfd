//! Values that several commands take.

use std::time::Duration;

use clap::ValueEnum;
use mba_tracker::transfer::MAX_VIRTUAL_VIEWS;
use nalgebra::{UnitVector3, Vector3};

/// Values of `--blur`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BlurMode {
    /// Virtual views along the motion, as many as the blur length asks for
    #[default]
    Auto,
    /// One view per frame
    Off,
}

/// On or off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Yes
    #[default]
    On,
    /// No
    Off,
}

/// A finite number that is not negative.
pub(super) fn non_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a number that is not negative is needed".to_owned()),
    }
}

/// A finite number above zero.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number above zero is needed".to_owned()),
    }
}

/// A number of virtual views that the tracker has room for.
pub(super) fn virtual_views(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(views) if (1..=MAX_VIRTUAL_VIEWS).contains(&views) => Ok(views),
        _ => Err(format!("a number from 1 to {MAX_VIRTUAL_VIEWS} is needed")),
    }
}

/// A direction along an axis.
pub(super) fn direction(text: &str) -> Result<UnitVector3<f64>, String> {
    let (axis, sign) = text.strip_prefix('-').map_or((text, 1.0), |axis| (axis, -1.0));
    let axis = match axis.strip_prefix('+').unwrap_or(axis) {
        "x" => Vector3::x(),
        "y" => Vector3::y(),
        "z" => Vector3::z(),
        _ => return Err("one of x, -x, y, -y, z, -z is needed".to_owned()),
    };
    Ok(UnitVector3::new_unchecked(axis * sign))
}

/// Value of `--distance`: a length between the places of the camera at two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthBetween {
    /// Index of the first frame.
    pub from: usize,
    /// Index of the second.
    pub to: usize,
    /// Length, above zero.
    pub metres: f64,
}

/// Two frames and a length.
pub(super) fn length_between(text: &str) -> Result<LengthBetween, String> {
    let parse = || {
        let (frames, metres) = text.split_once('=')?;
        let (from, to) = frames.split_once(':')?;
        let (from, to) = (from.parse().ok()?, to.parse().ok()?);
        Some(LengthBetween { from, to, metres: positive(metres).ok()? })
    };
    parse().ok_or_else(|| "two frames and a length in metres such as 0:250=1.2 are needed".to_owned())
}

/// Two numbers with an x between them.
pub(super) fn size(text: &str) -> Result<(usize, usize), String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    parsed.ok_or_else(|| "a size such as 640x480 is needed".to_owned())
}

/// A number of seconds, finite and not negative.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

/// A positive, finite number of seconds.
pub(super) fn positive_seconds(text: &str) -> Result<Duration, String> {
    let duration = seconds(text)?;
    if duration.is_zero() { Err("expected more than 0 seconds".to_owned()) } else { Ok(duration) }
}

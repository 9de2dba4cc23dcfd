//! Cameras whose focal length changes a little from frame to frame, as those of telephones do.

use std::path::Path;

use mba_io::dataset::check_camera;
use mba_tracker::geometry::PinholeCamera;

use crate::ImportError;
use crate::destination::Destination;

/// Change of focal length that is not worth a note, pixels.
const STEADY: f64 = 0.5;

/// The one camera of a data set for those of its frames: that with the median focal length. All have one size. `path` is
/// named where they make no sense.
///
/// # Errors
/// [`ImportError`] for no frames and absurd numbers.
pub(super) fn median(
    mut cameras: Vec<PinholeCamera>,
    destination: &mut Destination,
    path: &Path,
) -> Result<PinholeCamera, ImportError> {
    for camera in &cameras {
        check_camera(camera).map_err(|invalid| ImportError::damaged(path, invalid.to_string()))?;
    }
    cameras.sort_by(|a, b| a.fx.total_cmp(&b.fx));
    let (Some(least), Some(most)) = (cameras.first(), cameras.last()) else {
        return Err(ImportError::unusable(path, "it has no frames", "give a folder with a recording"));
    };
    if most.fx - least.fx > STEADY {
        let (least, most) = (least.fx, most.fx);
        destination.note(format!(
            "the focal length changes from {least:.2} to {most:.2} px; the one in the middle is taken for all frames"
        ));
    }
    Ok(cameras[cameras.len() / 2])
}

//! Images with cameras and points, for programs that make a scene of them.

use mba_io::dataset::{Dataset, InvalidValue};
use mba_io::output::ExportFolder;
use mba_io::png::{encode_depth, encode_rgb};
use mba_mesh::{Mesh, format_mesh};
use mba_raster::gaussians::Gaussians;
use rayon::prelude::*;

use super::frame_images::{FrameImages, ImageReader, check_data_set};
use super::points::{add_depth_points, cloud_of_gaussians, depth_step};
use super::{
    BINARY_CAMERAS_FILE, BINARY_IMAGES_FILE, BINARY_POINTS3D_FILE, CAMERAS_FILE, ExportError, IMAGES_FILE,
    POINTS_FILE, POINTS3D_FILE, PosedFrame, PosedFrames, TRANSFORMS_FILE, format_cameras,
    format_cameras_binary, format_images, format_images_binary, format_points3d, format_points3d_binary,
    format_transforms, image_name,
};
use crate::run::{Run, RunCamera};

/// Frames whose images are read and encoded at the same time.
const FRAMES_AT_A_TIME: usize = 16;

/// Whose layout the files have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneLayout {
    /// Images, depth, points and `transforms.json`.
    Nerfstudio,
    /// Images and a model, as text and binary.
    Colmap,
}

/// Which frames are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportedImages {
    /// Keyframes that have a pose.
    Keyframes,
    /// All frames that have a pose.
    All,
}

/// What of a run goes into a folder.
pub struct SceneExport<'a> {
    run: &'a Run,
    camera: RunCamera,
    layout: SceneLayout,
    frames: Vec<PosedFrame>,
    lost: usize,
    /// From the map; empty where there is none.
    cloud: Mesh,
}

impl<'a> SceneExport<'a> {
    /// Chooses frames and, where there is a map of Gaussians, points.
    ///
    /// # Errors
    /// [`ExportError::Rows`], [`ExportError::NoPose`], [`ExportError::NoKeyframe`], [`ExportError::NoCamera`],
    /// [`ExportError::InvalidCamera`].
    pub fn new(
        run: &'a Run,
        layout: SceneLayout,
        images: ExportedImages,
        map: Option<&Gaussians>,
    ) -> Result<Self, ExportError> {
        // Lost frames have no pose of their own; others can be left out.
        let PosedFrames { mut frames, lost } = PosedFrames::of(run)?;
        if images == ExportedImages::Keyframes {
            frames.retain(|frame| frame.is_keyframe);
        }
        if frames.is_empty() {
            return Err(ExportError::NoKeyframe { folder: run.folder.clone() });
        }
        let camera = run.summary.settings.camera.clone();
        let camera = camera.ok_or_else(|| ExportError::NoCamera { folder: run.folder.clone() })?;
        let invalid =
            |reason: InvalidValue| ExportError::InvalidCamera { folder: run.folder.clone(), reason };
        camera.check().map_err(invalid)?;
        let response = camera.inverse_response().map_err(invalid)?;
        let cloud = map.map_or_else(Mesh::default, |map| cloud_of_gaussians(map, &response));
        Ok(Self { run, camera, layout, frames, lost, cloud })
    }

    /// The frames that are written, at least one.
    #[must_use]
    pub fn frames(&self) -> &[PosedFrame] {
        &self.frames
    }

    /// Frames of the run that are left out because they are lost.
    #[must_use]
    pub fn lost(&self) -> usize {
        self.lost
    }

    /// Whether not all of it is in the run.
    #[must_use]
    pub fn needs_data_set(&self) -> bool {
        let reader = self.reader(None);
        self.frames.iter().any(|frame| reader.needs_data_set(frame))
    }

    /// Names of the files, relative to the folder.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let images = |folder: &str| -> Vec<String> {
            self.frames.iter().map(|frame| format!("{folder}/{}", image_name(frame))).collect()
        };
        let mut names = images("images");
        match self.layout {
            SceneLayout::Nerfstudio => {
                names.extend(images("depth"));
                names.extend([POINTS_FILE, TRANSFORMS_FILE].map(str::to_owned));
            }
            SceneLayout::Colmap => {
                // As text, which people read, and in binary, which training programs read first.
                names.extend([POINTS3D_FILE, IMAGES_FILE, CAMERAS_FILE].map(str::to_owned));
                names.extend(
                    [BINARY_POINTS3D_FILE, BINARY_IMAGES_FILE, BINARY_CAMERAS_FILE].map(str::to_owned),
                );
            }
        }
        names
    }

    /// Writes all files into `folder`, which was claimed for [`Self::names`] and still has to be finished; `done` is called
    /// after every frame. Returns the number of points. Without a map, points come from depth: every few columns and rows
    /// of every frame that is written, at most 100 000.
    ///
    /// # Errors
    /// When the data set is not that of the run, or an image cannot be read, encoded or written.
    pub fn write(
        &self,
        dataset: Option<&Dataset>,
        folder: &mut ExportFolder,
        mut done: impl FnMut(),
    ) -> Result<usize, ExportError> {
        if let Some(dataset) = dataset {
            check_data_set(self.run, &self.camera, dataset, &self.frames)?;
        }
        let reader = self.reader(dataset);
        let (pinhole, mut from_depth) = (self.camera.pinhole(), Mesh::default());
        // Columns and rows between two points from depth, so that their number is bounded.
        let step = depth_step(&pinhole, self.frames.len());
        // Images are read and encoded side by side, a few at a time, and written in order.
        for frames in self.frames.chunks(FRAMES_AT_A_TIME) {
            let read = |frame| reader.read(frame).and_then(|images| self.encode(frame, images));
            let encoded: Vec<Result<Encoded, ExportError>> = frames.par_iter().map(read).collect();
            for (frame, encoded) in frames.iter().zip(encoded) {
                let Encoded { images, files } = encoded?;
                for (name, content) in files {
                    folder.write(&name, &content)?;
                }
                if self.cloud.vertices.is_empty() {
                    add_depth_points(&mut from_depth, &images, &pinhole, &frame.world_from_camera, step);
                }
                done();
            }
        }
        let cloud = if self.cloud.vertices.is_empty() { &from_depth } else { &self.cloud };
        self.write_cameras(cloud, folder)?;
        Ok(cloud.vertices.len())
    }

    fn reader(&self, dataset: Option<&'a Dataset>) -> ImageReader<'_> {
        let with_depth = self.layout == SceneLayout::Nerfstudio || self.cloud.vertices.is_empty();
        ImageReader { run: self.run, camera: &self.camera, dataset, with_depth }
    }

    fn encode(&self, frame: &PosedFrame, images: FrameImages) -> Result<Encoded, ExportError> {
        let size = [self.camera.width, self.camera.height];
        let named = |name: String, png: std::io::Result<Vec<u8>>| match png {
            Ok(png) => Ok((name, png)),
            Err(reason) => Err(ExportError::Encode { name, reason }),
        };
        let name = image_name(frame);
        let mut files = vec![named(format!("images/{name}"), encode_rgb(size, &images.rgb))?];
        if self.layout == SceneLayout::Nerfstudio {
            files.push(named(format!("depth/{name}"), encode_depth(size, &images.depth))?);
        }
        Ok(Encoded { images, files })
    }

    fn write_cameras(&self, cloud: &Mesh, folder: &mut ExportFolder) -> Result<(), ExportError> {
        let (camera, frames) = (&self.camera, &self.frames);
        match self.layout {
            SceneLayout::Nerfstudio => {
                folder.write(POINTS_FILE, &format_mesh(cloud))?;
                folder.write(TRANSFORMS_FILE, format_transforms(camera, frames).as_bytes())?;
            }
            SceneLayout::Colmap => {
                folder.write(POINTS3D_FILE, format_points3d(cloud).as_bytes())?;
                folder.write(IMAGES_FILE, format_images(frames).as_bytes())?;
                folder.write(CAMERAS_FILE, format_cameras(camera).as_bytes())?;
                folder.write(BINARY_POINTS3D_FILE, &format_points3d_binary(cloud))?;
                folder.write(BINARY_IMAGES_FILE, &format_images_binary(frames))?;
                folder.write(BINARY_CAMERAS_FILE, &format_cameras_binary(camera))?;
            }
        }
        Ok(())
    }
}

/// The images of a frame, and their files.
struct Encoded {
    images: FrameImages,
    files: Vec<(String, Vec<u8>)>,
}

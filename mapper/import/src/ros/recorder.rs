//! From messages to a data set.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;

use super::cameras::Cameras;
use super::container::{Container, Message};
use super::messages::{
    self, CameraInfo, CompressedImage, Header, Image, Imu, Transform, key_value, metadata, transforms,
};
use super::pixels::{self, Depth};
use super::topics::{Chosen, Role, Stream};
use super::{bag, mcap};
use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading};
use crate::time::Time;

pub(crate) const MCAP: Format = Format {
    name: "ROS 2 and others",
    looked_for: "an .mcap file",
    recognise: |path| starts_with(path, &mcap::MAGIC),
    read: |reading, destination| read(reading, destination, &mcap::CONTAINER),
};

pub(crate) const BAG: Format = Format {
    name: "ROS 1, RealSense Viewer",
    looked_for: "a .bag file",
    recognise: |path| starts_with(path, bag::MAGIC),
    read: |reading, destination| read(reading, destination, &bag::CONTAINER),
};

/// Colour images of which the exposure time may still come.
const WAITING: usize = 64;

/// Exposure times that are believed, seconds.
const EXPOSURES: std::ops::RangeInclusive<f64> = 1e-6..=1.0;

fn starts_with(path: &Path, magic: &[u8]) -> bool {
    let mut start = vec![0; magic.len()];
    path.is_file()
        && File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok())
        && start == magic
}

fn read(
    reading: &Reading<'_>,
    destination: &mut Destination,
    container: &Container,
) -> Result<Facts, ImportError> {
    let path = reading.path;
    let topics = (container.topics)(path)?;
    let chosen = Chosen::among(&topics, reading.options).map_err(|reason| {
        ImportError::unusable(path, reason, "name them with --colour-topic and --depth-topic")
    })?;
    destination.note(format!("colour is from {}, depth from {}", chosen.colour, chosen.depth));
    let mut recorder =
        Recorder { path, destination, cameras: Cameras::default(), colour_times: VecDeque::new(), beyond: 0 };
    let is_wanted = |topic: &_| chosen.is_wanted(topic);
    let mut handle =
        |message: &Message<'_>| chosen.roles(message.topic).try_for_each(|role| recorder.take(message, role));
    (container.read)(path, &is_wanted, &mut handle, reading.progress)?;
    recorder.finish()
}

/// What is known so far.
struct Recorder<'a> {
    path: &'a Path,
    destination: &'a mut Destination,
    cameras: Cameras,
    /// When the latest colour images were recorded, and their own times.
    colour_times: VecDeque<(Time, Time)>,
    /// Pixels of depth that are farther than 16 bits reach.
    beyond: usize,
}

impl Recorder<'_> {
    /// Takes up a message of a topic with that role.
    fn take(&mut self, message: &Message<'_>, role: Role) -> Result<(), ImportError> {
        let understood = match role {
            Role::Colour | Role::CompressedColour => self.colour(message, role)?,
            Role::Depth | Role::CompressedDepth => self.depth(message, role)?,
            Role::ColourCamera | Role::DepthCamera => self.camera(message, role),
            Role::Imu | Role::Gyroscope | Role::Accelerometer => self.inertia(message, role),
            Role::Transforms => self.transforms(message),
            Role::StreamPlace(stream) => self.stream_place(message, stream),
            Role::ColourMetadata | Role::ColourJson => self.exposure(message, role),
            Role::DepthUnits => messages::float(message.data, message.encoding).map(|unit| {
                self.cameras.depth_scale = self.cameras.depth_scale.or(Some(pixels::per_metre(unit)))
            }),
        };
        understood.ok_or_else(|| self.damaged(message, "a message is not as its type says"))
    }

    fn damaged(&self, message: &Message<'_>, reason: &str) -> ImportError {
        let (topic, recorded) = (&message.topic.name, message.recorded);
        ImportError::damaged(self.path, format!("{reason} (on {topic}, recorded at {recorded} s)"))
    }

    fn colour(&mut self, message: &Message<'_>, role: Role) -> Result<Option<()>, ImportError> {
        let (header, picture) = if role == Role::Colour {
            let Some(image) = Image::read(message.data, message.encoding) else { return Ok(None) };
            let picture = pixels::colour(&image).map_err(|reason| self.damaged(message, &reason))?;
            (image.header, picture)
        } else {
            let Some(image) = CompressedImage::read(message.data, message.encoding) else { return Ok(None) };
            let picture = pixels::compressed_colour(&image);
            (image.header, picture)
        };
        let Header { time, frame } = header;
        let time = time.unwrap_or(message.recorded);
        self.add(message, |recorder| recorder.destination.add_colour(time, &picture, recorder.path))?;
        self.cameras.colour_frame.get_or_insert_with(|| frame.to_owned());
        self.colour_times.push_back((message.recorded, time));
        if self.colour_times.len() > WAITING {
            self.colour_times.pop_front();
        }
        Ok(Some(()))
    }

    fn depth(&mut self, message: &Message<'_>, role: Role) -> Result<Option<()>, ImportError> {
        let (depth, Header { time, frame }) = if role == Role::Depth {
            let Some(image) = Image::read(message.data, message.encoding) else { return Ok(None) };
            (pixels::depth(&image), image.header)
        } else {
            let Some(image) = CompressedImage::read(message.data, message.encoding) else { return Ok(None) };
            (pixels::compressed_depth(&image), image.header)
        };
        let Depth { picture, scale, beyond } = depth.map_err(|reason| self.damaged(message, &reason))?;
        let time = time.unwrap_or(message.recorded);
        self.add(message, |recorder| recorder.destination.add_depth(time, &picture, recorder.path))?;
        self.cameras.depth_frame.get_or_insert_with(|| frame.to_owned());
        self.cameras.image_scale.get_or_insert(scale);
        self.beyond += beyond;
        Ok(Some(()))
    }

    /// Adds an image; what is wrong with it is said with its message.
    fn add(
        &mut self,
        message: &Message<'_>,
        add: impl FnOnce(&mut Self) -> Result<String, ImportError>,
    ) -> Result<(), ImportError> {
        match add(self) {
            Err(ImportError::Damaged { reason, .. }) => Err(self.damaged(message, &reason)),
            added => added.map(drop),
        }
    }

    fn camera(&mut self, message: &Message<'_>, role: Role) -> Option<()> {
        let known = match role {
            Role::ColourCamera => &mut self.cameras.colour,
            _ => &mut self.cameras.depth,
        };
        // Cameras of a recording do not change.
        if known.is_none() {
            *known = Some(CameraInfo::read(message.data, message.encoding)?);
        }
        Some(())
    }

    fn inertia(&mut self, message: &Message<'_>, role: Role) -> Option<()> {
        let Imu { header, rate, force } = Imu::read(message.data, message.encoding)?;
        let time = header.time.unwrap_or(message.recorded);
        self.cameras.imu_frame.get_or_insert_with(|| header.frame.to_owned());
        let rate = rate.filter(|_| role != Role::Accelerometer);
        let force = force.filter(|_| role != Role::Gyroscope);
        self.destination.rates.extend(rate.map(|rate| (time, rate)));
        self.destination.forces.extend(force.map(|force| (time, force)));
        Some(())
    }

    fn transforms(&mut self, message: &Message<'_>) -> Option<()> {
        for Transform { parent, child, parent_from_child } in transforms(message.data, message.encoding)? {
            self.cameras.frames.add(parent, child, parent_from_child);
        }
        Some(())
    }

    /// RealSense says what takes points of the reference to the stream, and has no names of frames.
    fn stream_place(&mut self, message: &Message<'_>, stream: Stream) -> Option<()> {
        let stream_from_reference = messages::transform(message.data, message.encoding)?;
        let place = match stream {
            Stream::Colour => &mut self.cameras.colour_from_reference,
            Stream::Depth => &mut self.cameras.depth_from_reference,
            Stream::Imu => &mut self.cameras.imu_from_reference,
        };
        place.get_or_insert(stream_from_reference);
        Some(())
    }

    fn exposure(&mut self, message: &Message<'_>, role: Role) -> Option<()> {
        /// What is read of the metadata of a frame, microseconds.
        #[derive(Deserialize)]
        struct Metadata {
            actual_exposure: Option<f64>,
        }
        let (time, microseconds) = if role == Role::ColourMetadata {
            let (key, value) = key_value(message.data, message.encoding)?;
            let is_exposure = key.eq_ignore_ascii_case("actual exposure");
            let same = self.colour_times.iter().find(|(recorded, _)| *recorded == message.recorded);
            (same.map(|(_, time)| *time), value.parse().ok().filter(|_| is_exposure))
        } else {
            let (time, json) = metadata(message.data, message.encoding)?;
            (time, serde_json::from_str(json).ok().and_then(|metadata: Metadata| metadata.actual_exposure))
        };
        // Division rounds to the number that the decimal is.
        let seconds = microseconds.map(|microseconds: f64| microseconds / 1e6);
        if let (Some(time), Some(seconds)) = (time, seconds.filter(|seconds| EXPOSURES.contains(seconds))) {
            self.destination.exposures.push((time, seconds));
        }
        Some(())
    }

    fn finish(self) -> Result<Facts, ImportError> {
        let Self { path, destination, cameras, beyond, .. } = self;
        if beyond > 0 {
            destination
                .note(format!("{beyond} pixels of depth are farther than 16 bits reach, and are holes"));
        }
        cameras.facts(destination, path)
    }
}

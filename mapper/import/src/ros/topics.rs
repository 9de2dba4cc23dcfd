//! Which topics of a recording are those of colour, depth, cameras and inertia.

use super::container::Topic;
use crate::options::ImportOptions;

const IMAGE: &str = "sensor_msgs/Image";
const COMPRESSED: &str = "sensor_msgs/CompressedImage";
const CAMERA_INFO: &str = "sensor_msgs/CameraInfo";
const IMU: &str = "sensor_msgs/Imu";

/// What messages of a topic are used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Colour,
    CompressedColour,
    Depth,
    CompressedDepth,
    ColourCamera,
    DepthCamera,
    /// Gyroscope and accelerometer.
    Imu,
    Gyroscope,
    Accelerometer,
    Transforms,
    /// Where one stream of a RealSense camera is, and which.
    StreamPlace(Stream),
    /// Pairs of names and values with each colour image.
    ColourMetadata,
    /// JSON with each colour image.
    ColourJson,
    /// Metres of a raw unit.
    DepthUnits,
}

/// A stream of a RealSense camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Colour,
    Depth,
    Imu,
}

/// The topics that are read, and what for.
#[derive(Debug)]
pub(super) struct Chosen {
    roles: Vec<(Topic, Role)>,
    pub(super) colour: String,
    pub(super) depth: String,
}

impl Chosen {
    /// Chooses among all topics of a file.
    ///
    /// # Errors
    /// What is missing.
    pub(super) fn among(topics: &[Topic], options: &ImportOptions) -> Result<Self, String> {
        let colour = find(topics, options.colour_topic.as_deref(), "colour", colour_rank)?;
        let near =
            // A depth topic of the right kind comes first; of two, the one whose name begins as that of colour does.
            |topic: &Topic| depth_rank(topic).map(|rank| 100 * rank + common(&topic.name, &colour.name));
        let depth = find(topics, options.depth_topic.as_deref(), "depth", near)?;
        let is_image = |topic: &Topic| topic.message_type == IMAGE;
        let mut roles = vec![
            (colour.clone(), if is_image(colour) { Role::Colour } else { Role::CompressedColour }),
            (depth.clone(), if is_image(depth) { Role::Depth } else { Role::CompressedDepth }),
        ];
        let mut add =
            |topic: Option<&Topic>, role: Role| roles.extend(topic.cloned().map(|topic| (topic, role)));
        let of_type = |name: &'static str| move |topic: &Topic| topic.message_type == name;
        // Cameras, then what wrappers of cameras say of each image and of depth.
        add(companion(topics, colour, of_type(CAMERA_INFO)), Role::ColourCamera);
        add(companion(topics, depth, of_type(CAMERA_INFO)), Role::DepthCamera);
        let metadata = |topic: &Topic| {
            topic.message_type == "diagnostic_msgs/KeyValue" && topic.name.ends_with("/metadata")
        };
        add(companion(topics, colour, metadata), Role::ColourMetadata);
        add(companion(topics, colour, of_type("realsense2_camera_msgs/Metadata")), Role::ColourJson);
        let units = |topic: &Topic| {
            topic.message_type == "std_msgs/Float32"
                && topic.name.replace('_', " ").ends_with("Depth Units/value")
        };
        add(companion(topics, depth, units), Role::DepthUnits);
        for (topic, role) in inertia(topics, colour) {
            add(place_of(topics, topic), Role::StreamPlace(Stream::Imu));
            add(Some(topic), role);
        }
        // Where streams are relative to each other, as numbers or in the tree of frames.
        add(place_of(topics, colour), Role::StreamPlace(Stream::Colour));
        add(place_of(topics, depth), Role::StreamPlace(Stream::Depth));
        for topic in topics {
            if matches!(topic.message_type.as_str(), "tf2_msgs/TFMessage" | "tf/tfMessage") {
                add(Some(topic), Role::Transforms);
            }
        }
        Ok(Self { colour: colour.name.clone(), depth: depth.name.clone(), roles })
    }

    /// What a topic is used for. One camera may be that of both images.
    pub(super) fn roles(&self, topic: &Topic) -> impl Iterator<Item = Role> {
        self.roles.iter().filter(move |(known, _)| known == topic).map(|(_, role)| *role)
    }

    pub(super) fn is_wanted(&self, topic: &Topic) -> bool {
        self.roles.iter().any(|(known, _)| known == topic)
    }
}

/// The topic that the user named, or the one that ranks highest.
fn find<'a>(
    topics: &'a [Topic],
    named: Option<&str>,
    kind: &str,
    rank: impl Fn(&Topic) -> Option<usize>,
) -> Result<&'a Topic, String> {
    let images = || topics.iter().filter(|topic| is_image(topic));
    let listed = || {
        let names: Vec<&str> = images().map(|topic| topic.name.as_str()).collect();
        if names.is_empty() {
            "it has no topics with images".to_owned()
        } else {
            format!("its images are {}", names.join(", "))
        }
    };
    if let Some(name) = named {
        let known = images().find(|topic| topic.name == name);
        return known.ok_or_else(|| format!("it has no images on the topic {name}; {}", listed()));
    }
    // The first of equals: topics are sorted by name.
    let best = images().filter_map(|topic| Some((rank(topic)?, topic))).rev().max_by_key(|(rank, _)| *rank);
    best.map(|(_, topic)| topic)
        .ok_or_else(|| format!("no topic looks like that of {kind} images; {}", listed()))
}

fn is_image(topic: &Topic) -> bool {
    [IMAGE, COMPRESSED].contains(&topic.message_type.as_str())
}

/// How likely a topic is that of colour images; none for one that is something else.
fn colour_rank(topic: &Topic) -> Option<usize> {
    let name = topic.name.to_lowercase();
    let other = ["depth", "infra", "/ir/", "/ir_", "disparity", "confidence", "fisheye", "theora", "mask"];
    if other.iter().any(|word| name.contains(word)) {
        return None;
    }
    let is_named = ["rgb", "color", "colour"].iter().any(|word| name.contains(word));
    Some(
        4 * usize::from(is_named)
            + 2 * usize::from(topic.message_type == IMAGE)
            + usize::from(name.contains("rect")),
    )
}

/// How likely a topic is that of depth images; registered ones come first.
fn depth_rank(topic: &Topic) -> Option<usize> {
    let name = topic.name.to_lowercase();
    let is_lossy = name.ends_with("/compressed") || name.contains("theora");
    if !name.contains("depth") || name.contains("confidence") || is_lossy {
        return None;
    }
    let is_registered =
        ["aligned_depth", "depth_registered", "depth_to_rgb"].iter().any(|word| name.contains(word));
    Some(4 * usize::from(is_registered) + usize::from(topic.message_type == IMAGE))
}

/// How many parts, from the left, the names of two topics have in common.
fn common(a: &str, b: &str) -> usize {
    a.split('/').zip(b.split('/')).take_while(|(a, b)| a == b).count()
}

/// The topic of that kind which is nearest to another by its name. It has to be of the same device, which is the first part
/// of a name, or the only one.
fn companion<'a>(topics: &'a [Topic], of: &Topic, is_kind: impl Fn(&Topic) -> bool) -> Option<&'a Topic> {
    let of_kind = || topics.iter().filter(|topic| is_kind(topic));
    let near = of_kind().rev().max_by_key(|topic| common(&topic.name, &of.name));
    near.filter(|topic| common(&topic.name, &of.name) > 1 || of_kind().count() == 1)
}

/// Where the stream of a topic of a RealSense camera is: `/device_0/sensor_1/Color_0/tf/0`.
fn place_of<'a>(topics: &'a [Topic], of: &Topic) -> Option<&'a Topic> {
    // Nothing, device, sensor and stream.
    const PARTS: usize = 4;
    topics.iter().find(|topic| {
        topic.message_type == "geometry_msgs/Transform"
            && topic.name.contains("/tf/")
            && common(&topic.name, &of.name) >= PARTS
    })
}

/// The topics of an IMU: one with both sensors, or one of each.
fn inertia<'a>(topics: &'a [Topic], colour: &Topic) -> Vec<(&'a Topic, Role)> {
    let nearest = |is_kind: &dyn Fn(&str) -> bool| {
        let candidates =
            topics.iter().filter(|topic| topic.message_type == IMU && is_kind(&topic.name.to_lowercase()));
        candidates.rev().max_by_key(|topic| common(&topic.name, &colour.name))
    };
    let (is_gyroscope, is_accelerometer) =
        (|name: &str| name.contains("gyro"), |name: &str| name.contains("accel"));
    if let Some(both) = nearest(&|name| !is_gyroscope(name) && !is_accelerometer(name)) {
        return vec![(both, Role::Imu)];
    }
    let single =
        [(nearest(&is_gyroscope), Role::Gyroscope), (nearest(&is_accelerometer), Role::Accelerometer)];
    single.into_iter().filter_map(|(topic, role)| Some((topic?, role))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(names: &[(&str, &str)]) -> Vec<Topic> {
        let topic = |(name, message_type): &(&str, &str)| Topic {
            name: (*name).to_owned(),
            message_type: (*message_type).to_owned(),
        };
        let mut topics: Vec<Topic> = names.iter().map(topic).collect();
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        topics
    }

    #[test]
    fn registered_depth_and_raw_colour_of_one_camera_are_chosen() {
        let topics = topics(&[
            ("/left/color/image_raw", IMAGE),
            ("/left/color/image_raw/compressed", COMPRESSED),
            ("/left/color/camera_info", CAMERA_INFO),
            ("/left/depth/image_rect_raw", IMAGE),
            ("/left/aligned_depth_to_color/image_raw", IMAGE),
            ("/left/aligned_depth_to_color/image_raw/compressedDepth", COMPRESSED),
            ("/left/aligned_depth_to_color/camera_info", CAMERA_INFO),
            ("/left/infra1/image_rect_raw", IMAGE),
            ("/right/color/image_raw", IMAGE),
            ("/right/aligned_depth_to_color/image_raw", IMAGE),
            ("/left/imu", IMU),
            ("/right/imu", IMU),
        ]);
        let chosen = Chosen::among(&topics, &ImportOptions::default()).unwrap();
        assert_eq!(chosen.colour, "/left/color/image_raw");
        assert_eq!(chosen.depth, "/left/aligned_depth_to_color/image_raw");
        let roles = |name: &str| {
            let topic = topics.iter().find(|topic| topic.name == name).unwrap();
            chosen.roles(topic).collect::<Vec<_>>()
        };
        assert_eq!(roles("/left/color/camera_info"), [Role::ColourCamera]);
        assert_eq!(roles("/left/aligned_depth_to_color/camera_info"), [Role::DepthCamera]);
        assert_eq!((roles("/left/imu"), roles("/right/imu")), (vec![Role::Imu], vec![]));
        let right = ImportOptions { colour_topic: Some("/right/color/image_raw".into()), depth_topic: None };
        assert_eq!(Chosen::among(&topics, &right).unwrap().depth, "/right/aligned_depth_to_color/image_raw");
    }

    #[test]
    fn what_is_missing_is_named() {
        let topics = topics(&[("/camera/depth/image", IMAGE), ("/tf", "tf2_msgs/TFMessage")]);
        let missing = |options: &ImportOptions| Chosen::among(&topics, options).unwrap_err();
        assert_eq!(
            missing(&ImportOptions::default()),
            "no topic looks like that of colour images; its images are /camera/depth/image"
        );
        let named = ImportOptions { colour_topic: Some("/rgb".into()), depth_topic: None };
        assert!(missing(&named).starts_with("it has no images on the topic /rgb; its images are"));
    }
}

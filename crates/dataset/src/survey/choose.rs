//! Which topic is the depth, which the colour, which the lens: found by type, asked for where several
//! fit.
//!
//! The RealSense viewer names the stream and the sensor in the topic,
//! `/device_0/sensor_0/Depth_0/image/data`, and writes the depth unit as an option of the sensor.
//!
//! Reference: librealsense, `src/media/readme.md` and `src/media/ros/ros_file_format.h`.

use granulcal_features::Intrinsics;
use nalgebra::Isometry3;

use super::{Content, Survey, Topic};
use crate::DatasetError;
use crate::message::{Lens, Shows};

/// Metres per count of 16-bit depth in ROS (REP 118) and Foxglove.
const MILLIMETRE: f64 = 1e-3;

/// What of a recording is read.
#[derive(Clone, Debug)]
pub struct Choice<'a> {
    /// The depth images.
    pub depth: &'a Topic,
    /// Where the lens comes from.
    pub camera: &'a Topic,
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Metres per count, and who says so.
    pub unit: DepthUnit<'a>,
}

/// Metres per count of a depth image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthUnit<'a> {
    /// The metres.
    pub metres: f64,
    /// Who says so, for people.
    pub source: &'a str,
}

impl Survey {
    /// Depth topic, lens and unit; names choose where several topics fit.
    ///
    /// # Errors
    /// [`DatasetError::Content`] lists the topics where none or several fit.
    pub fn choose(
        &self,
        topic: Option<&str>,
        camera_topic: Option<&str>,
    ) -> Result<Choice<'_>, DatasetError> {
        let depth = self.depth(topic)?;
        let (camera, intrinsics) = self.lens(depth, camera_topic)?;
        Ok(Choice { depth, camera, intrinsics, unit: self.unit(depth)? })
    }

    /// The topic of the depth images.
    pub(crate) fn depth(&self, name: Option<&str>) -> Result<&Topic, DatasetError> {
        let fits = |topic: &&Topic| match (&topic.content, Stream::of(&topic.topic)) {
            (Content::Picture { facts, .. }, stream) => {
                facts.shows == Shows::Depth && stream.is_none_or(Stream::is_depth)
            }
            _ => false,
        };
        let allowed = "a 16UC1, mono16, 32FC1 or 16-bit PNG image";
        self.one(("the depth topic", "topic"), allowed, name, |topic| fits(&topic))
    }

    /// The topic of the colour images.
    pub(crate) fn colour(&self, name: Option<&str>) -> Result<&Topic, DatasetError> {
        let fits = |topic: &Topic| match &topic.content {
            Content::Picture { facts, .. } => facts.shows == Shows::Colour,
            _ => false,
        };
        self.one(("the colour topic", "colour-topic"), "an image of 8-bit colours", name, fits)
    }

    /// The one topic that fits, or the one of this name.
    fn one(
        &self,
        (what, flag): (&str, &str),
        allowed: &str,
        name: Option<&str>,
        fits: impl Fn(&Topic) -> bool,
    ) -> Result<&Topic, DatasetError> {
        let fitting = || self.topics.iter().filter(|topic| fits(topic));
        let error = |found, allowed| Err(self.unfit(what, found, allowed));
        if let Some(name) = name {
            if let Some(topic) = fitting().find(|topic| topic.topic == name) {
                return Ok(topic);
            }
            let known = self.topics.iter().find(|topic| topic.topic == name);
            let found = known.map_or_else(|| format!("no topic {name}"), Topic::to_string);
            return error(found, format!("{allowed}; there are: {}", list(fitting())));
        }
        match fitting().count() {
            1 => Ok(fitting().next().expect("there is one")),
            0 => error(self.other_images(), allowed.to_owned()),
            _ => error(list(fitting()), format!("named by --{flag}, where several fit")),
        }
    }

    /// What was looked for and not found; in a damaged file it may have been there.
    fn unfit(&self, what: &str, found: String, allowed: String) -> DatasetError {
        let found = match self.walk.damage.first() {
            Some(damage) => format!("{found}; the file is damaged, {damage}"),
            None => found,
        };
        DatasetError::content(&self.path, what, found, allowed)
    }

    /// What there is instead of a fitting topic.
    fn other_images(&self) -> String {
        if self.topics.is_empty() {
            return "no message".to_owned();
        }
        let images = self.topics.iter().filter(|topic| match &topic.content {
            Content::Picture { .. } => true,
            _ => topic.schema.contains("Image"),
        });
        let found = list(images);
        match self.topics.iter().find_map(|topic| topic.fault.as_ref()) {
            Some(fault) => format!("{found} ({fault})"),
            None => found,
        }
    }

    /// The lens of a topic of images, and the topic that it comes from.
    pub(crate) fn lens(
        &self,
        depth: &Topic,
        name: Option<&str>,
    ) -> Result<(&Topic, Intrinsics), DatasetError> {
        let (width, height, frame) = match &depth.content {
            Content::Picture { facts, frame_id } => (facts.width, facts.height, frame_id.as_str()),
            _ => (0, 0, ""),
        };
        let size_fits =
            |lens: &Lens| (lens.width as usize, lens.height as usize) == (width, height);
        let lenses = || {
            self.topics.iter().filter_map(|topic| match &topic.content {
                Content::Lens(lens) => Some((topic, lens)),
                _ => None,
            })
        };
        let what = format!("the lens of {}", depth.topic);
        let error = |found, allowed| Err(self.unfit(&what, found, allowed));
        if let Some(name) = name {
            return match lenses().find(|(topic, _)| topic.topic == name) {
                Some((topic, lens)) if size_fits(lens) => {
                    Ok((topic, self.intrinsics(topic, lens, depth)?))
                }
                Some((topic, _)) => error(topic.to_string(), format!("of {width}x{height} pixels")),
                None => {
                    let others = list(lenses().map(|(topic, _)| topic));
                    error(format!("no camera topic {name}"), format!("one of: {others}"))
                }
            };
        }
        // Frames of reference that are given must agree; of what is left the nearest name wins.
        let same_frame =
            |lens: &Lens| frame.is_empty() || lens.frame_id.is_empty() || frame == lens.frame_id;
        let stream = Stream::of(&depth.topic);
        let fits = |&(topic, lens): &(&Topic, &Lens)| {
            let same_stream = stream.is_none_or(|stream| Stream::of(&topic.topic) == Some(stream));
            size_fits(lens) && same_frame(lens) && same_stream
        };
        let nearest = lenses().filter(fits).map(|(t, _)| shared(&t.topic, &depth.topic)).max();
        let mut best =
            lenses().filter(fits).filter(|(t, _)| Some(shared(&t.topic, &depth.topic)) == nearest);
        match (best.next(), best.next()) {
            (Some((topic, lens)), None) => Ok((topic, self.intrinsics(topic, lens, depth)?)),
            (Some(_), Some(_)) => {
                let several = list(lenses().filter(fits).map(|(topic, _)| topic));
                error(several, "named by --camera-topic, where several fit".to_owned())
            }
            _ => {
                let found = list(lenses().map(|(topic, _)| topic));
                let allowed = format!(
                    "a CameraInfo or CameraCalibration of {width}x{height} pixels and the same frame, \
                     or given by --camera"
                );
                error(found, allowed)
            }
        }
    }

    /// The lens as it stands in a message, which must be free of distortion.
    fn intrinsics(
        &self,
        topic: &Topic,
        lens: &Lens,
        depth: &Topic,
    ) -> Result<Intrinsics, DatasetError> {
        let is_rectified = is_rectified(&depth.topic);
        let [fx, _, cx, _, fy, cy, ..] = if is_rectified && lens.p[0] > 0.0 {
            let [fx, a, cx, _, b, fy, cy, ..] = lens.p;
            [fx, a, cx, b, fy, cy, 0.0, 0.0, 1.0]
        } else {
            lens.k
        };
        if !is_rectified && lens.distortion.iter().any(|&coefficient| coefficient != 0.0) {
            let what = format!("the distortion of {}", topic.topic);
            let found = format!("{:?}", lens.distortion);
            let allowed = "zero: record the rectified depth, or give the lens with --camera";
            return Err(DatasetError::content(&self.path, what, found, allowed));
        }
        let (width, height) = (lens.width as usize, lens.height as usize);
        Intrinsics::from_integer_centres(width, height, fx, fy, cx, cy)
            .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }

    /// Metres per count of the depth images.
    pub(crate) fn unit(&self, depth: &Topic) -> Result<DepthUnit<'_>, DatasetError> {
        if depth.image().is_some_and(|(_, _, encoding)| encoding.starts_with("32FC1")) {
            return Ok(DepthUnit { metres: 1.0, source: "32FC1 is metres" });
        }
        let Some(stream) = Stream::of(&depth.topic) else {
            return Ok(DepthUnit { metres: MILLIMETRE, source: "16 bits are millimetres in ROS" });
        };
        let name = format!("{}/option/Depth Units/value", stream.sensor);
        let option = self.topics.iter().find_map(|topic| match topic.content {
            Content::Float(value) if topic.topic == name => Some((topic, value)),
            _ => None,
        });
        match option {
            Some((topic, metres)) if metres > 0.0 && metres.is_finite() => {
                // An f32 of the file: 0.001 is not 0.0010000000474974513.
                let metres = (metres as f32).to_string().parse().unwrap_or(metres);
                Ok(DepthUnit { metres, source: &topic.topic })
            }
            Some((topic, metres)) => {
                let (what, found) = (topic.topic.as_str(), metres.to_string());
                Err(DatasetError::content(&self.path, what, found, "positive and finite"))
            }
            None => {
                let allowed = "in the file, or given as depth_unit by --camera".to_owned();
                Err(self.unfit(&name, "none".to_owned(), allowed))
            }
        }
    }

    /// Where the frame of `to` stands in the frame of `from`, for two streams of a RealSense recording.
    pub(crate) fn extrinsics(&self, from: &Topic, to: &Topic) -> Option<Isometry3<f64>> {
        let pose = |topic: &Topic| {
            let prefix = format!("{}/tf/", Stream::of(&topic.topic)?.prefix);
            self.topics.iter().find_map(|topic| match topic.content {
                Content::Transform(pose) if topic.topic.starts_with(&prefix) => Some(pose),
                _ => None,
            })
        };
        Some(pose(to)? * pose(from)?.inverse())
    }
}

/// The stream that a topic of the RealSense viewer belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Stream<'a> {
    /// `/device_0/sensor_0`.
    sensor: &'a str,
    /// `/device_0/sensor_0/Depth_0`.
    prefix: &'a str,
}

impl<'a> Stream<'a> {
    fn of(topic: &'a str) -> Option<Self> {
        let mut slashes = topic.match_indices('/').map(|(at, _)| at);
        let (_, second) = (slashes.next().filter(|&at| at == 0)?, slashes.next()?);
        let (third, fourth) = (slashes.next()?, slashes.next().unwrap_or(topic.len()));
        let is_sensor = topic.starts_with("/device_") && topic[second..].starts_with("/sensor_");
        is_sensor.then(|| Self { sensor: &topic[..third], prefix: &topic[..fourth] })
    }

    fn is_depth(self) -> bool {
        self.prefix[self.sensor.len()..].starts_with("/Depth_")
    }
}

/// Whether the images of a topic are rectified, by the last part of its name but for that of a transport: `image_rect`,
/// `image_rect_raw/compressedDepth`.
fn is_rectified(topic: &str) -> bool {
    let is_transport = |part: &&str| part.starts_with("compressed");
    let last = topic.rsplit('/').find(|part| !is_transport(part));
    last.is_some_and(|part| part.split('_').any(|word| ["rect", "rectified"].contains(&word)))
}

/// Leading parts that two names share.
fn shared(a: &str, b: &str) -> usize {
    a.split('/').zip(b.split('/')).take_while(|(a, b)| a == b).count()
}

fn list<'a>(topics: impl Iterator<Item = &'a Topic>) -> String {
    let names: Vec<_> = topics.map(Topic::to_string).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectified_images_are_told_by_the_last_part_of_their_topic() {
        for rectified in [
            "/camera/depth/image_rect_raw",
            "/camera/depth/image_rect_raw/compressedDepth",
            "/depth/image_rect",
            "image_rectified",
        ] {
            assert!(is_rectified(rectified), "{rectified}");
        }
        for raw in
            ["/directory/image_raw", "/cam_direct/image_raw", "/image_rect/raw", "/a/rectangle", ""]
        {
            assert!(!is_rectified(raw), "{raw}");
        }
    }

    #[test]
    fn streams_are_told_from_other_topics() {
        let depth = Stream::of("/device_0/sensor_0/Depth_0/image/data").unwrap();
        assert_eq!((depth.sensor, depth.is_depth()), ("/device_0/sensor_0", true));
        assert!(Stream::of("/device_0/sensor_0/Depth_0/info/camera_info").unwrap() == depth);
        assert!(!Stream::of("/device_0/sensor_1/Color_0/image/data").unwrap().is_depth());
        for other in
            ["/camera/depth/image_raw", "/device_0/info", "/depth", "", "device_0/sensor_0/a/b"]
        {
            assert!(Stream::of(other).is_none(), "{other}");
        }
    }
}

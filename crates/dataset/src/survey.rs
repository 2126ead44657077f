//! What is in a file of messages: the first of the two passes that reading one takes.

mod choose;

use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

pub use choose::{Choice, DepthUnit};

use crate::DatasetError;
use crate::fault::Fault;
use crate::input::{Input, ReadSeek};
use crate::message::{self, Kind, Lens, PictureFacts};
use crate::message_file::{Channel, Damage, Message, MessageFormat, Walk, walk};

/// Stamp of what a RealSense's software writes once and for all times, as its lens and depth unit: the least time of
/// ROS 1.
const STATIC_NS: u64 = 1;

/// The topics of a recording, and what is wrong with the file.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The file.
    pub path: PathBuf,
    /// What kind of file it is.
    pub format: MessageFormat,
    /// The topics, by name.
    pub topics: Vec<Topic>,
    /// Time of the first message `[s]`, but for those of no time.
    pub start_s: f64,
    /// Time of the last message `[s]`.
    pub end_s: f64,
    walk: Walk,
}

/// The messages of one type on one topic.
#[derive(Clone, Debug)]
pub struct Topic {
    /// Its name.
    pub topic: String,
    /// Name of the type, empty if it has none.
    pub schema: String,
    /// How messages are serialised.
    pub encoding: String,
    /// Whole messages.
    pub messages: u64,
    /// Messages among them that do not hold what their type says.
    pub unreadable: u64,
    /// Why the first of those cannot be read.
    fault: Option<Fault>,
    content: Content,
    /// When its readable images were recorded, in the order of the file `[ns]`.
    times: Vec<u64>,
}

/// What the first readable message of a topic says.
#[derive(Clone, Debug)]
enum Content {
    Picture { frame_id: String, facts: PictureFacts },
    Lens(Lens),
    Transform(Isometry3<f64>),
    Float(f64),
    Other,
}

/// How many frames of a damaged recording are lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// So many: the index of the file tells.
    Exactly(u64),
    /// So many, by the bytes that are missing at the end.
    About(u64),
    /// So many, and perhaps more behind the end of the file.
    AtLeast(u64),
}

impl Lost {
    /// The number.
    pub fn frames(self) -> u64 {
        match self {
            Self::Exactly(count) | Self::About(count) | Self::AtLeast(count) => count,
        }
    }

    /// How well it is known: exactly, about or at least.
    pub fn how(self) -> &'static str {
        match self {
            Self::Exactly(_) => "exactly",
            Self::About(_) => "about",
            Self::AtLeast(_) => "at least",
        }
    }

    /// As many more.
    #[must_use]
    pub(crate) fn plus(self, more: u64) -> Self {
        match self {
            Self::Exactly(count) => Self::Exactly(count + more),
            Self::About(count) => Self::About(count + more),
            Self::AtLeast(count) => Self::AtLeast(count + more),
        }
    }
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.frames();
        let frames = if count == 1 { "frame" } else { "frames" };
        match self {
            Self::Exactly(_) => write!(f, "{count} {frames} lost"),
            Self::AtLeast(0) => f.write_str("an unknown number of frames lost"),
            other => write!(f, "{} {count} {frames} lost", other.how()),
        }
    }
}

impl Survey {
    /// Looks through a whole .bag or .mcap.
    ///
    /// # Errors
    /// [`DatasetError::Io`], or [`DatasetError::Content`] for a file that is neither.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        Self::take(&mut Input::open(path)?)
    }

    /// As [`Survey::open`], from anything; `path` is its name in messages.
    ///
    /// # Errors
    /// As [`Survey::open`].
    pub fn read(path: &Path, reader: impl ReadSeek) -> Result<Self, DatasetError> {
        Self::take(&mut Input::new(path, reader)?)
    }

    pub(crate) fn take(input: &mut Input<'_>) -> Result<Self, DatasetError> {
        let first = input.read(0, 16)?;
        let Some(format) = MessageFormat::of(&first) else {
            let found = format!("{:?}", String::from_utf8_lossy(&first));
            return Err(DatasetError::content(
                input.path(),
                "the first bytes",
                found,
                "those of a ROS 1 bag (#ROSBAG V2.0) or an MCAP file",
            ));
        };
        let mut topics: BTreeMap<(String, String, String), Topic> = BTreeMap::new();
        let mut span: Option<(u64, u64)> = None;
        let walk = walk(format, input, &mut |message| {
            let now = message.time_ns;
            if now != STATIC_NS {
                let (first, last) = span.unwrap_or((now, now));
                span = Some((first.min(now), last.max(now)));
            }
            let Channel { topic, schema, encoding } = message.channel.clone();
            let topic = topics
                .entry((topic, schema, encoding))
                .or_insert_with(|| Topic::new(message.channel));
            topic.count(message);
            Ok(ControlFlow::Continue(()))
        })?;
        let (first, last) = span.unwrap_or((0, 0));
        Ok(Self {
            path: input.path().to_owned(),
            format,
            topics: topics.into_values().collect(),
            start_s: seconds(first),
            end_s: seconds(last),
            walk,
        })
    }

    /// What is wrong with the file, by place.
    pub fn damage(&self) -> &[Damage] {
        &self.walk.damage
    }

    /// Frames of a topic that are lost; `None` for a file and a topic that are whole.
    pub fn lost(&self, topic: &Topic) -> Option<Lost> {
        let cut = self.walk.cut.get(&topic.topic).copied().unwrap_or(0);
        let seen = topic.unreadable + cut;
        let expected = self.walk.expected.as_ref().and_then(|topics| topics.get(&topic.topic));
        if self.walk.damage.is_empty()
            && seen == 0
            && expected.is_none_or(|&count| count <= topic.messages)
        {
            return None;
        }
        Some(match (expected, self.walk.missing) {
            (Some(count), _) => {
                Lost::Exactly(count.saturating_sub(topic.messages).max(cut) + topic.unreadable)
            }
            (None, Some((0, _))) => Lost::Exactly(seen),
            (None, Some((missing, there))) => {
                let rate = topic.messages as f64 / there.max(1) as f64;
                Lost::About(seen.max((missing as f64 * rate).ceil() as u64))
            }
            (None, None) => Lost::AtLeast(seen),
        })
    }
}

impl Topic {
    fn new(channel: &Channel) -> Self {
        Self {
            topic: channel.topic.clone(),
            schema: channel.schema.clone(),
            encoding: channel.encoding.clone(),
            messages: 0,
            unreadable: 0,
            fault: None,
            content: Content::Other,
            times: Vec::new(),
        }
    }

    fn count(&mut self, message: &Message<'_>) {
        self.messages += 1;
        match Content::of(message) {
            Ok(content) => {
                if matches!(content, Content::Picture { .. }) {
                    self.times.push(message.time_ns);
                }
                if matches!(self.content, Content::Other) {
                    self.content = content;
                }
            }
            Err(fault) => {
                self.unreadable += 1;
                self.fault.get_or_insert(fault);
            }
        }
    }

    /// Messages that can be read.
    pub fn whole(&self) -> u64 {
        self.messages - self.unreadable
    }

    /// Which of its images, in the order of the file, are those of a window in time, and where the last of them ends.
    pub(crate) fn taken_within(&self, window: &Range<u64>) -> (HashSet<u64>, u64) {
        let mut order: Vec<u64> = (0..self.times.len() as u64).collect();
        // Files are in order of time, as a rule, but need not be.
        order.sort_by_key(|&image| self.times[image as usize]);
        let [first, end] = [window.start, window.end].map(|at| order.len().min(at as usize));
        let chosen: HashSet<u64> = order[first..end].iter().copied().collect();
        let end = chosen.iter().max().map_or(0, |last| last + 1);
        (chosen, end)
    }

    /// The frame of reference of its images, empty where none is given.
    pub(crate) fn frame_id(&self) -> &str {
        match &self.content {
            Content::Picture { frame_id, .. } => frame_id,
            _ => "",
        }
    }

    /// Whether a message belongs to this topic.
    pub(crate) fn is_of(&self, channel: &Channel) -> bool {
        self.topic == channel.topic
            && self.schema == channel.schema
            && self.encoding == channel.encoding
    }

    /// Columns and rows `[px]` that its lens has, if it describes a camera.
    pub fn lens_size(&self) -> Option<(u32, u32)> {
        match &self.content {
            Content::Lens(lens) => Some((lens.width, lens.height)),
            _ => None,
        }
    }

    /// Width, height `[px]` and encoding of its images, if it has images.
    pub fn image(&self) -> Option<(usize, usize, &str)> {
        match &self.content {
            Content::Picture { facts, .. } => Some((facts.width, facts.height, &facts.encoding)),
            _ => None,
        }
    }
}

impl Content {
    fn of(message: &Message<'_>) -> Result<Self, Fault> {
        let (channel, data) = (message.channel, message.data);
        Ok(match Kind::of(channel) {
            Kind::Image | Kind::CompressedImage => {
                let picture = message::picture(channel, data)?;
                Self::Picture { facts: picture.facts()?, frame_id: picture.frame_id }
            }
            Kind::Lens => Self::Lens(message::lens(channel, data)?),
            Kind::Transform => Self::Transform(message::transform(channel, data)?),
            Kind::Float => Self::Float(message::float(channel, data)?),
            Kind::Other => Self::Other,
        })
    }
}

/// One line about a topic, for messages.
impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}", self.topic, self.schema)?;
        match &self.content {
            Content::Picture { facts, .. } => {
                write!(f, ", {}x{} {}", facts.width, facts.height, facts.encoding)?;
            }
            Content::Lens(lens) => write!(f, ", {}x{}", lens.width, lens.height)?,
            _ => write!(f, ", {}", self.encoding)?,
        }
        write!(f, ", {} messages)", self.messages)
    }
}

/// Nanoseconds in seconds, without the digits that a factor of 1e-9 adds.
fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_of_times_wherever_the_messages_stand() {
        let [topic, schema, encoding] = ["/depth", "Image", "cdr"].map(str::to_owned);
        let mut depth = Topic::new(&Channel { topic, schema, encoding });
        depth.times = vec![9, 8, 7, 1, 2, 3];
        let taken = |window| {
            let (chosen, end) = depth.taken_within(&window);
            let chosen: std::collections::BTreeSet<_> = chosen.into_iter().collect();
            (chosen.into_iter().collect::<Vec<_>>(), end)
        };
        // The last three in time are the first of the file.
        assert_eq!(taken(3..6), (vec![0, 1, 2], 3));
        assert_eq!(taken(0..2), (vec![3, 4], 5));
        assert_eq!(taken(0..6), (vec![0, 1, 2, 3, 4, 5], 6));
        // Frames of one time stay in the order of the file.
        depth.times = vec![5; 4];
        let (chosen, end) = depth.taken_within(&(2..4));
        assert!(chosen.contains(&2) && chosen.contains(&3) && (chosen.len(), end) == (2, 4));
    }
}

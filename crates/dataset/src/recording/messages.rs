//! A .bag or .mcap: a first pass finds the topics, a second averages the frames.

use std::collections::HashSet;
use std::ops::{ControlFlow, Range};

use granulcal_features::{ColourImage, DepthImage, Intrinsics, register_colour};
use granulcal_numbers::short;

use super::ReadOptions;
use crate::fault::Fault;
use crate::input::Input;
use crate::mean::Mean;
use crate::message::{self, Picture};
use crate::message_file::{Channel, Message, walk};
use crate::survey::{Survey, Topic};
use crate::{CameraFile, DatasetError, Lost};

/// What was read.
pub(super) struct Averaged {
    pub(super) intrinsics: Intrinsics,
    pub(super) image: DepthImage,
    /// Metres per count.
    pub(super) unit: f64,
    pub(super) colour: Option<ColourImage>,
    pub(super) topic: String,
    /// Frames that were averaged, those that were read for it, and those that are whole.
    pub(super) frames: usize,
    pub(super) window: Range<u64>,
    pub(super) whole: u64,
    pub(super) lost: Option<Lost>,
    pub(super) damage: Vec<String>,
    /// That the frames are not of one view, if they do not look so, and what the camera's file contradicts.
    pub(super) unlike: Option<String>,
}

pub(super) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    camera: Option<&CameraFile>,
) -> Result<Averaged, DatasetError> {
    let survey = Survey::take(input)?;
    let depth = survey.depth(options.topic.as_deref())?;
    let intrinsics = match camera.and_then(|file| file.lens) {
        Some(lens) => lens,
        None => survey.lens(depth, options.camera_topic.as_deref())?.1,
    };
    let unit = match camera.and_then(|file| file.depth_unit) {
        Some(unit) => unit,
        None => survey.unit(depth)?.metres,
    };
    let replaced = replaced(&survey, depth, options, camera);
    // An image beside the camera's TOML comes first; see the caller.
    let wants_colour =
        camera.is_some_and(|file| file.segmentation.colour.is_some() && file.colour.is_none());
    let colour = match &options.colour_topic {
        None if !wants_colour => None,
        name => Some(survey.colour(name.as_deref())?),
    };
    let window = options.window(input.path(), depth.whole())?;
    let (chosen, end) = depth.taken_within(&window);
    let mut pass = Pass {
        survey: &survey,
        depth,
        colour,
        size: (intrinsics.width, intrinsics.height),
        limit: input.unpack_limit(),
        unit,
        window,
        chosen,
        end,
        next: 0,
        mean: None,
        undecodable: 0,
        fault: None,
        colour_message: None,
        replaced,
    };
    walk(survey.format, input, &mut |message| pass.take(message))?;
    pass.finish(intrinsics)
}

/// Share by which the numbers of a camera's file may differ from the recording's own.
const SAME: f64 = 0.01;
/// Metres to a number of an image of floating point.
const METRES: f64 = 1.0;

/// What the camera's file says otherwise than the recording of its own lens and unit, in which it is believed.
fn replaced(
    survey: &Survey,
    depth: &Topic,
    options: &ReadOptions,
    camera: Option<&CameraFile>,
) -> Option<String> {
    let (file, path) = (camera?, options.camera.as_deref()?);
    let own = || survey.lens(depth, options.camera_topic.as_deref()).ok().map(|(_, lens)| lens);
    let lens = file.lens.and_then(|lens| Some((lens, own()?)));
    let lens = lens.into_iter().flat_map(|(lens, own)| {
        [
            ("fx", lens.fx, own.fx),
            ("fy", lens.fy, own.fy),
            ("cx", lens.cx, own.cx),
            ("cy", lens.cy, own.cy),
        ]
    });
    // Floating point is in metres, whatever a file says of counts.
    let own = || survey.unit(depth).ok().map(|unit| unit.metres).filter(|&metres| metres != METRES);
    let unit = file.depth_unit.and_then(|unit| Some(("depth_unit", unit, own()?)));
    let differs = |(_, told, own): &(&str, f64, f64)| (told - own).abs() > SAME * own.abs();
    let told = lens.chain(unit).filter(differs);
    let told: Vec<_> =
        told.map(|(key, told, own)| format!("{key} {} for {}", short(told), short(own))).collect();
    let what = "in place of the recording's own: is it of this camera, at this size?";
    (!told.is_empty()).then(|| format!("{} gives {} {what}", path.display(), told.join(", ")))
}

/// The second pass.
struct Pass<'s> {
    survey: &'s Survey,
    depth: &'s Topic,
    colour: Option<&'s Topic>,
    /// Columns and rows that the lens has.
    size: (usize, usize),
    limit: u64,
    /// Metres per count.
    unit: f64,
    /// Frames that are averaged, by their places in time.
    window: Range<u64>,
    /// The same by their places in the file, and where the last of them ends there.
    chosen: HashSet<u64>,
    end: u64,
    /// Place in the file of the next depth frame.
    next: u64,
    mean: Option<Mean>,
    /// Frames of the window whose pixels cannot be unpacked, and why the first cannot.
    undecodable: u64,
    fault: Option<Fault>,
    /// The last colour image before the end of the window, or the first behind it.
    colour_message: Option<(Channel, Vec<u8>)>,
    /// What of the recording's lens and unit the camera's file contradicts.
    replaced: Option<String>,
}

impl Pass<'_> {
    fn take(&mut self, message: &Message<'_>) -> Result<ControlFlow<()>, DatasetError> {
        let is_done = self.next >= self.end;
        if self.depth.is_of(message.channel) && !is_done {
            self.depth_frame(message)?;
        } else if self.colour.is_some_and(|colour| colour.is_of(message.channel))
            && (!is_done || self.colour_message.is_none())
        {
            self.colour_message = Some((message.channel.clone(), message.data.to_vec()));
        }
        let has_colour = self.colour.is_none() || self.colour_message.is_some();
        Ok(if self.next >= self.end && has_colour {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    }

    fn depth_frame(&mut self, message: &Message<'_>) -> Result<(), DatasetError> {
        let readable = |picture: Picture| picture.facts().map(|_| ());
        let picture = message::picture(message.channel, message.data);
        // What the first pass could not read was counted there.
        if picture.clone().and_then(readable).is_err() {
            return Ok(());
        }
        let index = self.next;
        self.next += 1;
        if !self.chosen.contains(&index) {
            return Ok(());
        }
        let place = format!("frame {index} of {}", self.depth.topic);
        let refuse = |fault: Fault| fault.of(&place).in_file(&self.survey.path);
        let frame = match picture.and_then(|picture| picture.depth(self.limit)) {
            Ok(frame) => frame,
            Err(fault) => {
                self.undecodable += 1;
                self.fault.get_or_insert_with(|| fault.of(&place));
                return Ok(());
            }
        };
        if (frame.width, frame.height) != self.size {
            let found = format!("{}x{}", frame.width, frame.height);
            let allowed = format!("{}x{}, as the lens has it", self.size.0, self.size.1);
            return Err(refuse(Fault::new("the size", found, allowed)));
        }
        match &mut self.mean {
            None => self.mean = Some(Mean::new(frame, self.unit)),
            Some(mean) => mean.add(&frame).map_err(refuse)?,
        }
        Ok(())
    }

    fn finish(self, intrinsics: Intrinsics) -> Result<Averaged, DatasetError> {
        let path = &self.survey.path;
        let mut damage: Vec<_> = self
            .survey
            .damage()
            .iter()
            .map(|damage| format!("{}: {damage}", path.display()))
            .collect();
        damage.extend(self.fault.iter().map(|fault| format!("{}: {fault}", path.display())));
        let lost = self.survey.lost(self.depth);
        let lost = match (lost, self.undecodable) {
            (lost, 0) => lost,
            (None, more) => Some(Lost::Exactly(more)),
            (Some(lost), more) => Some(lost.plus(more)),
        };
        let Some(mean) = self.mean else {
            let nothing = || Fault::new("the frames", "none", "whole");
            return Err(self.fault.unwrap_or_else(nothing).in_file(path));
        };
        let frames = mean.frames();
        let unlike: Vec<_> = self.replaced.into_iter().chain(mean.doubt()).collect();
        let unlike = (!unlike.is_empty()).then(|| unlike.join("; "));
        let image = mean.finish().map_err(|fault| fault.in_file(path))?;
        let colour = match (self.colour, &self.colour_message) {
            (Some(topic), Some((channel, data))) => {
                let refuse = |fault: Fault| fault.of(&channel.topic).in_file(path);
                let picture = message::picture(channel, data).map_err(refuse)?;
                let colour = picture.colour(self.limit).map_err(refuse)?;
                Some(registered(self.survey, (self.depth, &image, &intrinsics), topic, colour)?)
            }
            (Some(topic), None) => {
                let what = format!("the images of {}", topic.topic);
                return Err(DatasetError::content(path, what, "none", "whole"));
            }
            (None, _) => None,
        };
        Ok(Averaged {
            intrinsics,
            image,
            unit: self.unit,
            colour,
            topic: self.depth.topic.clone(),
            frames,
            window: self.window,
            whole: self.depth.whole() - self.undecodable,
            lost,
            damage,
            unlike,
        })
    }
}

/// The colours of the depth image's pixels.
fn registered(
    survey: &Survey,
    (depth, image, lens): (&Topic, &DepthImage, &Intrinsics),
    topic: &Topic,
    colour: ColourImage,
) -> Result<ColourImage, DatasetError> {
    if let Some(colour_from_depth) = survey.extrinsics(depth, topic) {
        let colour_lens = survey.lens(topic, None)?.1;
        return register_colour(image, lens, &colour, &colour_lens, &colour_from_depth)
            .map_err(|source| DatasetError::Recording { path: survey.path.clone(), source });
    }
    let has_size = (colour.width, colour.height) == (image.width, image.height);
    if has_size && depth.frame_id() == topic.frame_id() {
        return Ok(colour);
    }
    let what = format!("the colour topic {}", topic.topic);
    let found = format!("{}x{} in frame {:?}", colour.width, colour.height, topic.frame_id());
    let allowed = format!(
        "registered to the depth, {}x{} in frame {:?}, unless the RealSense viewer recorded it",
        image.width,
        image.height,
        depth.frame_id()
    );
    Err(DatasetError::content(&survey.path, what, found, allowed))
}

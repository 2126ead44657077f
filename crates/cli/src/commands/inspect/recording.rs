//! What is in a recording: its topics, or its frames, and what `features` makes of it.

use std::path::{Path, PathBuf};

use granulcal_dataset::{Survey, Topic, png};
use serde_json::{Map, Value, json};

/// Facts of a .bag or .mcap.
pub fn facts(path: &Path, is_whole: &mut bool) -> anyhow::Result<Value> {
    let survey = Survey::open(path)?;
    let topics: Map<_, _> = survey.topics.iter().map(topic_facts).collect();
    let mut facts = json!({
        "kind": "recording over time",
        "format": survey.format.name(),
        "start_s": survey.start_s,
        "end_s": survey.end_s,
        "topics": topics,
    });
    match survey.choose(None, None) {
        Ok(choice) => {
            let lens = choice.intrinsics;
            facts["depth"] = json!({
                "topic": choice.depth.topic,
                "frames": choice.depth.whole(),
                "width": lens.width,
                "height": lens.height,
                "unit_m": choice.unit.metres,
                "unit_from": choice.unit.source,
            });
            facts["lens"] = json!({
                "topic": choice.camera.topic,
                "fx": lens.fx,
                "fy": lens.fy,
                // As files and people give it: the first pixel's centre is (0, 0).
                "cx": lens.cx - 0.5,
                "cy": lens.cy - 0.5,
            });
            if let Some(lost) = survey.lost(choice.depth) {
                facts["lost"] = lost.to_string().into();
                *is_whole = false;
            }
        }
        // Other recordings, or topics to be picked: the message says which.
        Err(error) => facts["depth"] = json!({ "problem": error.to_string() }),
    }
    if !survey.damage().is_empty() {
        facts["damage"] = survey.damage().iter().map(ToString::to_string).collect();
        *is_whole = false;
    }
    Ok(facts)
}

fn topic_facts(topic: &Topic) -> (String, Value) {
    let mut facts = json!({
        "schema": topic.schema,
        "encoding": topic.encoding,
        "messages": topic.messages,
    });
    if topic.unreadable > 0 {
        facts["unreadable"] = topic.unreadable.into();
    }
    if let Some((width, height, pixels)) = topic.image() {
        facts["size"] = format!("{width}x{height}").into();
        facts["pixels"] = pixels.into();
    }
    if let Some((width, height)) = topic.lens_size() {
        facts["size"] = format!("{width}x{height}").into();
    }
    (topic.topic.clone(), facts)
}

/// Facts of a folder of frames: each is unpacked, so a damaged one is found.
pub fn folder_facts(frames: &[PathBuf], is_whole: &mut bool) -> Value {
    let (mut sizes, mut damage) = (std::collections::BTreeMap::new(), Vec::new());
    for frame in frames {
        match png::read_depth(frame, 1.0) {
            Ok(image) => {
                *sizes.entry(format!("{}x{}", image.width, image.height)).or_insert(0) += 1;
            }
            Err(error) => damage.push(format!("{:#}", anyhow::Error::from(error))),
        }
    }
    *is_whole = damage.is_empty();
    let mut facts = json!({
        "kind": "folder of depth frames",
        "frames": frames.len() - damage.len(),
        "sizes": sizes,
        "unit": "counts; the camera's TOML says how many metres",
    });
    if !damage.is_empty() {
        facts["lost"] = format!("{} frames lost", damage.len()).into();
        facts["damage"] = damage.into();
    }
    facts
}

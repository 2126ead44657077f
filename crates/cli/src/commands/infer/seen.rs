//! The recordings of one material: their statistics, and what speaks against them.

use std::collections::HashSet;

use granulcal_dataset::{Limits, Places, ReadOptions, Recording, camera_beside};
use granulcal_scene::CameraSpec;

use crate::args::paths::Reads;
use crate::context::note;
use crate::edge::pixels_at_edge;
use crate::outcome::BadArgument;

/// How recordings are read for a model.
pub struct Reading<'a> {
    pub options: ReadOptions,
    /// Frame to ignore `[px]`, where one is stated.
    pub border: Option<usize>,
    /// The camera of the model's scene, if that is known: pixels are made as wide on the ground as its own.
    pub camera: Option<&'a CameraSpec>,
    /// What is possible in that scene.
    pub limits: Option<&'a Limits>,
    /// Places of the model's statistics among those of a recording.
    pub chosen: &'a [usize],
}

/// What recordings show.
pub struct Seen {
    /// The model's statistics of each; none of one that cannot be of the scene and has none.
    pub observed: Vec<Vec<f64>>,
    /// Why they cannot be of the scene.
    pub impossible: Vec<String>,
    /// What makes them doubtful.
    pub doubts: Vec<String>,
    /// Whether no frame of any is lost.
    pub is_whole: bool,
}

impl Seen {
    /// What the recordings show, each given once.
    pub fn of(recordings: &[Reads], reading: &Reading<'_>) -> anyhow::Result<Self> {
        require_different(recordings)?;
        let (observed, impossible, doubts) = (Vec::new(), Vec::new(), Vec::new());
        let mut seen = Self { observed, impossible, doubts, is_whole: true };
        let mut places = Vec::new();
        tell_cameras(recordings, &reading.options);
        for path in recordings {
            places.push(seen.add(path, reading)?);
        }
        require_no_copies(&seen.observed)?;
        if let Some(limits) = reading.limits {
            let names: Vec<_> = recordings.iter().map(|path| path.display().to_string()).collect();
            seen.doubts.extend(limits.doubts_of_frames(&names, &places));
        }
        Ok(seen)
    }

    /// Adds a recording; returns where its grains lie.
    fn add(&mut self, path: &Reads, reading: &Reading<'_>) -> anyhow::Result<Option<Places>> {
        let recording = Recording::open(path, &reading.options)?;
        for line in &recording.damage {
            note(&format!("warning: {line}"));
        }
        let name = path.display();
        let of_it = |reason| format!("{name}: {reason}");
        if let Some(lost) = &recording.lost {
            note(&format!("warning: {name}: {lost}"));
            self.is_whole = false;
        }
        self.doubts.extend(recording.unlike.clone().map(of_it));
        let own = &recording.segmentation;
        let mut segmentation =
            reading.camera.map_or_else(|| own.clone(), |camera| own.as_seen_by(camera));
        segmentation.border_px = reading.border.unwrap_or(segmentation.border_px);
        let formation = recording.formation_with(&segmentation)?;
        if reading.border.is_none() {
            // Before the limits: these pixels may be why the extent cannot be the scene's.
            self.doubts.extend(pixels_at_edge(&formation).map(of_it));
        }
        if let Some(limits) = reading.limits {
            self.impossible.extend(limits.violations(&formation).into_iter().map(of_it));
            self.doubts.extend(limits.doubts_of(&recording, &formation).into_iter().map(of_it));
        }
        self.observed.push(match recording.statistics_of(&formation) {
            Ok(statistics) => reading.chosen.iter().map(|&at| statistics[at]).collect(),
            // What cannot be of the scene need not be described.
            Err(_) if !self.impossible.is_empty() => Vec::new(),
            Err(error) => {
                // What is doubtful about it may be why: depths in another unit show no grains.
                self.doubts.iter().for_each(|doubt| note(&format!("note: {doubt}")));
                return Err(error.into());
            }
        });
        Ok(reading.limits.and_then(|limits| limits.places_of(&recording)))
    }
}

/// Says which cameras are taken that nobody named.
fn tell_cameras(recordings: &[Reads], options: &ReadOptions) {
    if options.camera.is_some() {
        return;
    }
    let mut told = HashSet::new();
    for path in recordings {
        if let Some(camera) = camera_beside(path)
            && told.insert(camera.clone())
        {
            let (image, camera) = (path.display(), camera.display());
            note(&format!(
                "note: {image} is read by the camera of {camera} (--camera names another)"
            ));
        }
    }
}

/// Refuses a recording that is given twice: it would count as two pours.
fn require_different(recordings: &[Reads]) -> anyhow::Result<()> {
    let mut seen = HashSet::new();
    for path in recordings {
        let there = std::fs::canonicalize(&**path).unwrap_or_else(|_| path.to_path_buf());
        if !seen.insert(there) {
            let refusal =
                format!("each recording must be given once, got {} twice", path.display());
            return Err(BadArgument(refusal).into());
        }
    }
    Ok(())
}

/// Refuses copies of a recording under other names: no two pours agree to the last digit of all statistics.
fn require_no_copies(observed: &[Vec<f64>]) -> anyhow::Result<()> {
    for (second, row) in observed.iter().enumerate().filter(|(_, row)| !row.is_empty()) {
        if let Some(first) = observed[..second].iter().position(|other| other == row) {
            let refusal = format!(
                "recordings {} and {} show one formation, to the last digit of all statistics: each pour counts once",
                first + 1,
                second + 1
            );
            return Err(BadArgument(refusal).into());
        }
    }
    Ok(())
}

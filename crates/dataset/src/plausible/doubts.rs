//! What makes a formation doubtful that may be one of the scene. The bounds are kept by the scene's own pours, poured
//! piles and scattered grains, over the whole of a prior, but for one in some hundred.

use granulcal_features::{Formation, Part, Threshold};
use granulcal_numbers::short;

use super::{HIDDEN, LEAST_VOLUME, LEFT_OVER, Limits};
use crate::{Recording, Source};

/// Share of a formation's volume in its largest patch, above which it is a heap from which grains may have rolled, and
/// not what has rolled away. Of 460 pours of two priors no heap took less room than the grains by themselves.
const HEAP: f64 = 0.5;
/// Pixels of one, at least: grains that fall past the camera take its room, too.
const HEAP_PIXELS: f64 = 30.0;
/// Elongation that heaps may have. Of 460 pours of two priors 3 had more than that and chance; `test_doubts.py` asks
/// for nine of ten heaps stretched by 1.6.
const LONG: f64 = 0.06;
/// It, and the mean direction about the middle of the image, times the root of the number of grains: of scattered ones,
/// chance makes more in one of 8000 (exp(-9)).
const BY_CHANCE: f64 = 3.0;
/// Bow of the ground over the threshold, above which the ground is said to be bent: it takes that much from the height
/// of some pixels and adds it to that of others.
const BENT: f64 = 1.0 / 3.0;
/// The same over the largest that the scene's sensor makes in some images.
const BENT_BY_SENSOR: f64 = 2.0;
/// Share of a formation's volume in its largest patch, from which it matters that the patch is cut off or hidden.
const BODY: f64 = 0.2;
/// Grains come to the edge if one is nearer to it than that, over half the image `[-]`.
const AT_EDGE: f64 = 0.03;
/// Share of the image that carries data, below which that is said: depth cameras lose some in shadows.
const SEEN: f64 = 0.7;
/// Share of the scene's field of view that a recording shows, at least, where grains come to its edge.
pub const LEAST_SHOWN: f64 = 0.95;
/// Factor between the scene's threshold of height and the recording's, above which that is said.
const THRESHOLD: f64 = 1.25;
/// Factor between the width of a recording's pixels on the ground and the scene's, above which that is said. Every n-th
/// pixel of a finer image comes within 4/3.
const COARSE: f64 = 1.5;
/// Factor between the distances of a recording's camera and of the scene's from the ground, above which the unit of the
/// depths is asked for: it is wrong by 4 or 10, and cameras stand at 20 cm to 1 m.
pub const UNIT_FACTOR: f64 = 3.0;
/// Standard deviation of the ground about its plane, over a grain's diameter and in metres, above both of which it is
/// said to be uneven.
const UNEVEN: f64 = 0.5;
const UNEVEN_FLOOR: f64 = 1.5e-3;
/// Sentences of one kind at most.
const MOST_ALIKE: usize = 3;

impl Limits {
    /// What makes a recording doubtful whose formation may be one of the scene, a sentence each.
    pub fn doubts_of(&self, recording: &Recording, formation: &Formation) -> Vec<String> {
        let distance = match recording.source {
            // Its camera is at the origin.
            Source::Depth { .. } => self.doubt_of_distance(formation.plane.plane.offset.abs()),
            Source::Heights(_) => None,
        };
        // What else is told may follow from it.
        distance.into_iter().chain(self.doubts(formation)).collect()
    }

    /// What makes a formation doubtful that may be one of the scene, a sentence each.
    pub fn doubts(&self, formation: &Formation) -> Vec<String> {
        let mut found = self.doubts_of_view(formation);
        found.extend(self.doubt_of_length(formation));
        if !formation.is_by_colour {
            found.extend(self.doubt_of_threshold(formation));
        }
        found.extend(self.doubt_of_pixels(formation));
        found.extend(self.doubt_of_ground(formation));
        let seen = formation.seen_share();
        if seen < SEEN {
            found.push(format!("only {:.0} % of the image carries data", 100.0 * seen));
        }
        found.extend(self.doubts_of_parts(formation));
        found
    }

    /// Whether the ground is `found` `[m]` from the camera, so near or far that depths are in another unit.
    pub(super) fn doubt_of_distance(&self, found: f64) -> Option<String> {
        let (least, most) = self.distance?;
        let stated = found.clamp(least, most);
        (found > UNIT_FACTOR * stated || found < stated / UNIT_FACTOR).then(|| {
            format!(
                "the ground is {} m from the camera, of the scene's images {} m (camera.height): is the unit of the depths \
                 right (depth_unit)?",
                short(found),
                short(stated)
            )
        })
    }

    /// What makes it doubtful that all of the formation is in view.
    fn doubts_of_view(&self, formation: &Formation) -> Vec<String> {
        let mut found = Vec::new();
        let body = formation.body_share();
        let (is_cut_off, hidden) = (body > BODY && formation.is_cut_off(), hidden(formation));
        if is_cut_off {
            found.push(
                "the edge of the image cuts the formation off: its statistics are those of what is left".to_owned(),
            );
        }
        let grains = self.least_volume / LEAST_VOLUME;
        let is_left_over = formation.volume < LEFT_OVER * self.least_volume;
        let is_kept = body > HEAP || self.is_aside(formation);
        if formation.volume < grains && is_kept && !is_left_over {
            let [has, all] = [formation.volume, grains].map(|v| short(1e6 * v));
            found.push(format!(
                "the formation takes {has} ml, the scene's grains by themselves {all}: the others are out of view, or were \
                 never there"
            ));
        }
        if hidden >= HIDDEN && !is_cut_off {
            found.push(format!(
                "at {:.0} % of the formation's outline nothing is seen of what goes on there (no data, a border, or above \
                 max_height): its statistics are those of what is left",
                100.0 * hidden
            ));
        }
        let shown = formation.shown.unwrap_or(1.0);
        if self.is_narrow(formation) {
            found.push(format!(
                "it shows {:.0} % of the {} m x {} m of ground that the scene's images show, and grains come to its edge: \
                 those that have rolled on are missing",
                100.0 * shown / self.shown,
                short(self.field),
                short(self.field)
            ));
        }
        found
    }

    /// Whether it shows less of the ground than the scene's images, and grains come to its edge.
    fn is_narrow(&self, formation: &Formation) -> bool {
        let shown = formation.shown.unwrap_or(1.0);
        shown < LEAST_SHOWN * self.shown && formation.margin() < AT_EDGE
    }

    /// Whether the image's middle is not that of the scene's images, about which grains roll out of view on all sides.
    fn is_aside(&self, formation: &Formation) -> bool {
        let most = BY_CHANCE / self.independent(formation).sqrt();
        self.is_axisymmetric && formation.lopsidedness() > most
    }

    /// How many grains lie in their own directions: those of a heap, else no more than there are pixels, for of
    /// scattered ones coarse pixels miss most, and what they hit takes the room of the others.
    fn independent(&self, formation: &Formation) -> f64 {
        let grains = formation.volume / self.grain;
        let pixels = formation.masked_count as f64;
        let is_heap = formation.body_share() > HEAP && pixels > HEAP_PIXELS;
        if is_heap { grains } else { grains.min(pixels) }
    }

    /// Whether it is longer than wide where nothing makes it so: neither the scene, nor an image that hides a side of
    /// it.
    fn doubt_of_length(&self, formation: &Formation) -> Option<String> {
        let shown = self.shown.min(formation.shown.unwrap_or(1.0));
        // A side that is not seen takes scattered grains from one direction.
        let is_even = shown > LEAST_SHOWN || formation.body_share() > HEAP;
        if !self.is_axisymmetric || !is_even || hidden(formation) >= HIDDEN {
            return None;
        }
        let most = LONG + BY_CHANCE / self.independent(formation).sqrt();
        let elongation = formation.elongation();
        // What is stretched by s has an elongation of (s - 1)/(s + 1).
        let stretch = |elongation: f64| (1.0 + elongation) / (1.0 - elongation);
        (elongation > most).then(|| {
            format!(
                "the formation is {:.2} times as long as wide, by chance at most {:.2} times, and nothing in the scene makes it \
                 so: are fx and fy of the lens right, and was the funnel still?",
                stretch(elongation),
                stretch(most)
            )
        })
    }

    fn doubt_of_pixels(&self, formation: &Formation) -> Option<String> {
        let pixel = (formation.resolution.0 * formation.resolution.1).sqrt();
        (pixel > COARSE * self.resolution).then(|| {
            format!(
                "a pixel is {} mm wide on the ground, in the scene's images {} mm: single grains and tops are missed; bring \
                 the camera nearer, or make the scene's images as coarse (camera.downsample)",
                short(1e3 * pixel),
                short(1e3 * self.resolution)
            )
        })
    }

    /// Whether the ground is no plane.
    fn doubt_of_ground(&self, formation: &Formation) -> Option<String> {
        if formation.ground_sd > (UNEVEN * self.diameter).max(UNEVEN_FLOOR) {
            return Some(format!(
                "the ground deviates from a plane by {} mm (standard deviation), grains are {} mm wide: is it bent, or of \
                 two levels (a tray on a table), or are the depths distances along the rays?",
                short(1e3 * formation.ground_sd),
                short(1e3 * self.diameter)
            ));
        }
        // A crater is a bend of the bed.
        let bow = formation.ground_bow().filter(|_| !self.is_on_bed)?;
        let least = (BENT * formation.threshold).max(formation.ground_sd);
        let most = least.max(BENT_BY_SENSOR * self.bow);
        (bow > most).then(|| {
            format!(
                "the ground is bent: its middle lies {} mm off its edges, and pixels count as grain from {} mm on; lay it \
                 flat, or take the camera's bend out of the depths",
                short(1e3 * rounded(bow)),
                short(1e3 * formation.threshold)
            )
        })
    }

    /// What stands apart from it, or is no grain.
    fn doubts_of_parts(&self, formation: &Formation) -> Vec<String> {
        let mut found = Vec::new();
        let mut tell = |parts: Vec<Part>, what: &str, more: &str| {
            for Part { volume, height } in parts.iter().take(MOST_ALIKE) {
                found.push(format!(
                    "{} ml, {} mm high, {what}",
                    short(1e6 * volume),
                    short(1e3 * height)
                ));
            }
            if let rest @ 1.. = parts.len().saturating_sub(MOST_ALIKE) {
                found.push(format!("{rest} more {more}"));
            }
        };
        // A ring is often in pieces.
        let apart = if self.is_on_bed { Vec::new() } else { formation.other_heaps(self.diameter) };
        tell(
            apart,
            "stand apart from the formation and are taken for grains: if they are none, take them away or out of the image",
            "stand apart from it like these",
        );
        let field = short(self.field);
        tell(
            formation.left_out_heaps(self.diameter),
            &format!(
                "stand beyond the {field} m x {field} m about the formation that the scene's images show, and are left out: \
                 if they are the formation, take the other away or out of the image"
            ),
            "stand beyond it like these",
        );
        tell(
            formation.flat_parts(self.diameter),
            "are taken for grains and flat, as grains are not: if they are a mat, a ruler or a marker, take it away or out \
             of the image; if the grains lie on a tray or a board, give its floor as the region of the segmentation",
            "are flat like these",
        );
        found
    }

    /// What makes the height doubtful from which a pixel counts as grain.
    fn doubt_of_threshold(&self, formation: &Formation) -> Option<String> {
        let Formation { threshold, ground_sd, .. } = *formation;
        let at = |height: f64| short(1e3 * height);
        let least = Threshold::ABOVE_NOISE * ground_sd;
        if threshold < least {
            return Some(format!(
                "pixels count as grain from {} mm on, and the ground scatters by {} mm (standard deviation): some of it is \
                 taken for grains; average more frames, or say height_threshold = {} m here and in the scene",
                at(threshold),
                at(ground_sd),
                rounded_up(least)
            ));
        }
        let of_scene = self.threshold?;
        let is_alike = (1.0 / THRESHOLD..=THRESHOLD).contains(&(threshold / of_scene));
        if is_alike || threshold == of_scene {
            return None;
        }
        let advice = if threshold > of_scene { ", or average more frames" } else { "" };
        Some(format!(
            "pixels count as grain from {} mm on, in the scene's images from {} mm on: the edge of a formation and single \
             layers differ by that; say height_threshold = {} m in both{advice}",
            at(threshold),
            at(of_scene),
            rounded_up(threshold.max(of_scene))
        ))
    }
}

/// Share of the outline of what is more than any two grains that touch beyond which nothing is seen `[-]`.
fn hidden(formation: &Formation) -> f64 {
    if formation.body_share() > BODY { formation.hidden_share() } else { 0.0 }
}

/// A number of two digits, no less: what the next image asks for differs a little.
pub(super) fn rounded_up(value: f64) -> String {
    let digit = 10_f64.powf(value.log10().floor() - 1.0);
    short((value / digit * (1.0 - 1e-9)).ceil() * digit).to_string()
}

/// A number of two digits.
fn rounded(value: f64) -> f64 {
    let digit = 10_f64.powf(value.abs().max(1e-12).log10().floor() - 1.0);
    (value / digit).round() * digit
}

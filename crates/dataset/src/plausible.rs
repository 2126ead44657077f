//! Whether a recording can be of a scene at all, before its statistics are asked anything: a room is no pile.
//!
//! The bounds are wide, so that no formation of the scene is beyond them, whatever its material: grains end no higher
//! than they began and no lower than one lies, take no more room than grains can and, where none is out of view, no less
//! than they are, lie where the camera looks, on a ground that is flat.

use granulcal_dem::Simulation;
use granulcal_features::{Formation, Part, Threshold};
use granulcal_numbers::short;
use granulcal_scene::{Mask, Prior, Scene};

use crate::{DatasetError, Room};

/// Factor on the height in which the grains start.
const HEIGHT_MARGIN: f64 = 1.5;
/// Room that grains take over their own volume: twice in the loosest heap, and twice for what hides under a pixel.
const VOLUME_MARGIN: f64 = 4.0;
/// Room that grains take over their own volume, at least: they take 1.27 to 1.55 times as much in heaps and single layers
/// of 2000, and of 60 grains that lie apart, which a coarse image samples, 0.88 to 1.27.
const LEAST_VOLUME: f64 = 0.7;
/// Height of the highest grain over the diameter of the least, at least.
const LEAST_HEIGHT: f64 = 0.5;
/// A formation that stays so far from the image's edge, over half the image, and holds so much of the grains, has left
/// none out of view: of 60 pours of the default prior each that had came within 0.06 of it, or held less than 0.05.
const WITHIN: f64 = 0.2;
const LEFT_OVER: f64 = 0.2;
/// Grains come to the edge if one is nearer to it than that, over half the image `[-]`.
const AT_EDGE: f64 = 0.03;
/// Share of the image that carries data, below which that is said: depth cameras lose some in shadows.
const SEEN: f64 = 0.7;
/// Share of the formation's outline beyond which nothing is seen, above which that is said. A stereo camera's shadows at
/// its foot stay below.
const HIDDEN: f64 = 0.1;
/// Share of the scene's field of view that a recording shows, at least, where grains come to its edge.
pub const LEAST_SHOWN: f64 = 0.95;
/// Factor between the scene's threshold of height and the recording's, above which that is said.
const THRESHOLD: f64 = 1.25;
/// Factor between the width of a recording's pixels on the ground and the scene's, above which that is said. Every n-th
/// pixel of a finer image comes within 4/3.
const COARSE: f64 = 1.5;
/// Standard deviation of the ground about its plane, over a grain's diameter and in metres, above both of which it is
/// said to be uneven.
const UNEVEN: f64 = 0.5;
const UNEVEN_FLOOR: f64 = 1.5e-3;
/// Sentences of one kind at most.
const MOST_ALIKE: usize = 3;
/// Factor on half the diagonal of the field of view.
const EXTENT_MARGIN: f64 = 1.5;
/// Grain diameters that the ground's residual may have as standard deviation, and metres that are always allowed.
const GROUND_DIAMETERS: f64 = 2.0;
const GROUND_FLOOR: f64 = 5e-3;
/// Shares of the points below which height and distance are taken: single pixels may be faults.
const HEIGHT_SHARE: f64 = 0.995;
const EXTENT_SHARE: f64 = 0.95;

/// What a scene allows, over the whole of a prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Greatest height of a grain above the ground `[m]`.
    pub height: f64,
    /// Least height of the highest grain `[m]`.
    pub least_height: f64,
    /// Greatest volume under the surface `[m³]`.
    pub volume: f64,
    /// Least volume under it where all grains are in view `[m³]`; none where some are a bed.
    pub least_volume: f64,
    /// Diameter of a typical grain `[m]`.
    pub diameter: f64,
    /// Side of the square of ground that its images show `[m]`.
    pub field: f64,
    /// Width of its images' pixels on the ground `[m]`.
    pub resolution: f64,
    /// Height from which its images' pixels count as grain `[m]`; none where a colour decides.
    pub threshold: Option<f64>,
    /// Greatest distance of most points from their middle `[m]`.
    pub extent: f64,
    /// Greatest standard deviation of the ground about its plane `[m]`.
    pub ground_sd: f64,
}

impl Limits {
    /// Those of a scene whose parameters are drawn from `prior`; `None` for one that cannot begin.
    ///
    /// # Errors
    /// [`DatasetError::NoRoom`] for one whose start alone would fill the memory.
    pub fn of(scene: &Scene, prior: &Prior) -> Result<Option<Self>, DatasetError> {
        let ends = [0.0, 0.5, 1.0].map(|share| {
            let draw =
                |p: &granulcal_scene::Parameter| p.distribution.quantile(share_inside(share));
            prior.parameters().iter().map(draw).collect::<Vec<f64>>()
        });
        let drawn = ends.iter().filter_map(|values| prior.apply(scene, values).ok());
        let mut all = Vec::new();
        for scene in drawn.chain([scene.clone()]) {
            Room::of_pour(&scene, None).require(None)?;
            all.extend(Self::of_one(&scene));
        }
        Ok(all.into_iter().reduce(|a, b| Self {
            height: a.height.max(b.height),
            least_height: a.least_height.min(b.least_height),
            volume: a.volume.max(b.volume),
            least_volume: a.least_volume.min(b.least_volume),
            diameter: a.diameter.max(b.diameter),
            field: a.field.max(b.field),
            resolution: a.resolution.max(b.resolution),
            threshold: a.threshold,
            extent: a.extent.max(b.extent),
            ground_sd: a.ground_sd.max(b.ground_sd),
        }))
    }

    fn of_one(scene: &Scene) -> Option<Self> {
        let simulation = Simulation::new(scene, 0).ok()?;
        let (positions, radii) = (simulation.positions(), simulation.radii());
        let tops = positions.iter().zip(&*radii).map(|(at, radius)| at.z + radius);
        let grains: f64 = radii.iter().map(|r| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3)).sum();
        let field = scene.camera.field_width;
        // The grains of a bed are the ground that a formation lies on, and no part of it.
        let all_seen = if scene.bed.is_some() { 0.0 } else { LEAST_VOLUME * grains };
        Some(Self {
            height: HEIGHT_MARGIN * tops.fold(0.0, f64::max),
            least_height: 2.0 * LEAST_HEIGHT * radii.iter().copied().fold(f64::INFINITY, f64::min),
            volume: VOLUME_MARGIN * grains,
            least_volume: all_seen,
            diameter: scene.grains.diameter,
            field,
            resolution: scene.camera.ground_resolution(),
            threshold: (scene.camera.mask == Mask::Height).then_some(scene.camera.height_threshold),
            extent: EXTENT_MARGIN * field * 0.5_f64.sqrt(),
            ground_sd: (GROUND_DIAMETERS * scene.grains.diameter).max(GROUND_FLOOR),
        })
    }

    /// Why a formation cannot be one of the scene, a sentence each; none if it can.
    pub fn violations(&self, formation: &Formation) -> Vec<String> {
        let points = || formation.points.iter();
        let mut found = Vec::new();
        let mut compare = |what: &str, unit: &str, value: f64, limit: f64| {
            if value.is_nan() || value > limit {
                let (value, limit) = (short(value), short(limit));
                found
                    .push(format!("{what} is {value} {unit}, in the scene at most {limit} {unit}"));
            }
        };
        let height = quantile(points().map(|p| p.z).collect(), HEIGHT_SHARE);
        compare("the formation's height", "m", height, self.height);
        let litres = 1e3;
        compare("the formation's volume", "l", litres * formation.volume, litres * self.volume);
        let extent = quantile(points().map(|p| p.x.hypot(p.y)).collect(), EXTENT_SHARE);
        compare("the formation's extent from its middle", "m", extent, self.extent);
        let millimetres = 1e3;
        compare(
            "the ground's deviation from a plane",
            "mm",
            millimetres * formation.ground_sd,
            millimetres * self.ground_sd,
        );
        let mut require = |what: &str, unit: &str, value: f64, limit: f64, hint: &str| {
            if value < limit {
                let (value, limit) = (short(value), short(limit));
                found.push(format!(
                    "{what} is {value} {unit}, in the scene at least {limit} {unit}{hint}"
                ));
            }
        };
        let top = points().map(|p| p.z).fold(0.0, f64::max);
        let hint = ": is the unit of the depths right?";
        require("the height of its highest point", "m", top, self.least_height, hint);
        let is_left_over = formation.volume < LEFT_OVER * self.least_volume;
        let is_whole = formation.margin() > WITHIN && formation.hidden_share() < HIDDEN;
        if is_whole && !is_left_over {
            let (volume, least) = (litres * formation.volume, litres * self.least_volume);
            let hint = ": are there as many grains, as wide as the scene's?";
            require("the formation's volume, all of it in view,", "l", volume, least, hint);
        }
        if formation.volume <= 0.0 {
            found.push(format!(
                "the formation's volume is {} l, in the scene more than 0: is it of the ground's colour?",
                short(litres * formation.volume)
            ));
        }
        found
    }

    /// What makes a formation doubtful that may be one of the scene, a sentence each.
    pub fn doubts(&self, formation: &Formation) -> Vec<String> {
        let mut found = Vec::new();
        if formation.is_cut_off() {
            found.push(
                "the edge of the image cuts the formation off: its statistics are those of what is left".to_owned(),
            );
        }
        if formation.volume < self.least_volume {
            let [has, all] =
                [formation.volume, self.least_volume / LEAST_VOLUME].map(|v| short(1e6 * v));
            found.push(format!(
                "the formation takes {has} ml, the scene's grains by themselves {all}: the others are out of view, or were \
                 never there"
            ));
        }
        let hidden = formation.hidden_share();
        if hidden >= HIDDEN && !formation.is_cut_off() {
            found.push(format!(
                "at {:.0} % of the formation's outline nothing is seen of what goes on there (no data, a border, or above \
                 max_height): its statistics are those of what is left",
                100.0 * hidden
            ));
        }
        let shown = formation.shown.unwrap_or(1.0);
        if shown < LEAST_SHOWN && formation.margin() < AT_EDGE {
            found.push(format!(
                "it shows {:.0} % of the {} m x {} m of ground that the scene's images show, and grains come to its edge: \
                 those that have rolled on are missing",
                100.0 * shown,
                short(self.field),
                short(self.field)
            ));
        }
        if !formation.is_by_colour {
            found.extend(self.doubt_of_threshold(formation));
        }
        let pixel = (formation.resolution.0 * formation.resolution.1).sqrt();
        if pixel > COARSE * self.resolution {
            found.push(format!(
                "a pixel is {} mm wide on the ground, in the scene's images {} mm: single grains and tops are missed; bring \
                 the camera nearer, or make the scene's images as coarse (camera.downsample)",
                short(1e3 * pixel),
                short(1e3 * self.resolution)
            ));
        }
        if formation.ground_sd > (UNEVEN * self.diameter).max(UNEVEN_FLOOR) {
            found.push(format!(
                "the ground deviates from a plane by {} mm (standard deviation), grains are {} mm wide: is it bent, or of \
                 two levels?",
                short(1e3 * formation.ground_sd),
                short(1e3 * self.diameter)
            ));
        }
        let seen = formation.seen_share();
        if seen < SEEN {
            found.push(format!("only {:.0} % of the image carries data", 100.0 * seen));
        }
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
        tell(
            formation.other_heaps(self.diameter),
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
             of the image",
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

/// A number of two digits, no less: what the next image asks for differs a little.
fn rounded_up(value: f64) -> String {
    let digit = 10_f64.powf(value.log10().floor() - 1.0);
    short((value / digit * (1.0 - 1e-9)).ceil() * digit).to_string()
}

/// The ends of a normal are far out: its 2 % and 98 % stand for them.
fn share_inside(share: f64) -> f64 {
    share.clamp(0.02, 0.98)
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use granulcal_features::{HeightMap, Segmentation, segment_height_map};
    use granulcal_scene::{Bed, Projection};

    use super::*;

    /// A cone in the middle of a field of half a metre, 4 mm to a pixel.
    fn cone(height: f64, radius: f64) -> Formation {
        let (side, step) = (120, 4e-3);
        let middle = 0.5 * side as f64;
        let at = |pixel: usize| {
            let (u, v) = ((pixel % side) as f64 - middle, (pixel / side) as f64 - middle);
            (height * (1.0 - step * u.hypot(v) / radius)).max(0.0)
        };
        let z = (0..side * side).map(at).collect();
        let map = HeightMap::new(side, side, step, step, z).unwrap();
        let height_threshold = Threshold::Absolute(2e-4);
        let settings = Segmentation { height_threshold, ..Segmentation::default() };
        segment_height_map(&map, &settings).unwrap()
    }

    #[test]
    fn a_heap_that_lacks_grains_or_is_in_another_unit_cannot_be_of_the_scene() {
        let limits = Limits::of(&Scene::funnel(0.12), &Prior::default()).unwrap().unwrap();
        // 2000 balls of 4 mm are 67 ml.
        assert!((limits.least_volume / 0.7 - 6.7e-5).abs() < 1e-6, "{limits:?}");
        assert_eq!(limits.violations(&cone(0.03, 0.06)), Vec::<String>::new());
        let few = limits.violations(&cone(0.02, 0.04));
        assert!(few.len() == 1 && few[0].contains("as many grains"), "{few:?}");
        let small = limits.violations(&cone(1e-3, 0.06));
        assert!(small.iter().any(|reason| reason.contains("unit of the depths")), "{small:?}");
        // Leftovers of a pour that has rolled out of view are a formation of the scene.
        assert_eq!(limits.violations(&cone(8e-3, 0.015)), Vec::<String>::new());
        let of_threshold = limits.doubts(&cone(0.03, 0.06));
        assert!(of_threshold.len() == 1 && of_threshold[0].contains("height_threshold"));
        assert!(of_threshold[0].contains("height_threshold = 0.001 m in both"), "{of_threshold:?}");
        let by_colour = Formation { is_by_colour: true, ..cone(0.03, 0.06) };
        let hollow = Formation { volume: -1e-6, ..by_colour.clone() };
        assert!(limits.violations(&hollow)[0].contains("of the ground's colour"));
        // Below three standard deviations the ground's noise is taken for grains, whatever the scene says.
        let noisy = Formation { threshold: 1e-3, ground_sd: 5e-4, ..cone(0.03, 0.06) };
        let of_noise = limits.doubts(&noisy);
        assert!(
            of_noise.len() == 1 && of_noise[0].contains("height_threshold = 0.0015 m here"),
            "{of_noise:?}"
        );
        assert_eq!([1.626e-3, 1e-3, 9.91e-3].map(rounded_up), ["0.0017", "0.001", "0.01"]);
        let still = Formation { ground_sd: 3e-4, ..noisy };
        assert_eq!(limits.doubts(&still), Vec::<String>::new());
        let from_nought = Limits { threshold: Some(0.0), ..limits };
        let all = Formation { threshold: 0.0, ground_sd: 0.0, ..still.clone() };
        assert_eq!(from_nought.doubts(&all), Vec::<String>::new());
        let coarse = Formation { resolution: (1e-2, 1e-2), ..still };
        let of_pixels = limits.doubts(&coarse);
        assert!(of_pixels.len() == 1 && of_pixels[0].contains("a pixel is 10 mm wide"));
        assert_eq!(limits.doubts(&by_colour), Vec::<String>::new());
        let limits = Limits { threshold: None, ..limits };
        assert!(limits.doubts(&cone(0.03, 0.06)).is_empty());
        let doubt = |formation: &Formation| limits.doubts(formation).join("; ");
        let seen = cone(0.03, 0.06);
        let mut heights = seen.heights.clone();
        // Of 120 columns those from the middle on are not seen.
        let blind = |pixel: &usize| pixel % 120 >= 60;
        (0..heights.len()).filter(blind).for_each(|pixel| heights[pixel] = None);
        let mask = (0..heights.len()).map(|pixel| seen.mask[pixel] && !blind(&pixel)).collect();
        let half = Formation { mask, heights, ..seen.clone() };
        assert!(doubt(&half).contains("of the formation's outline nothing is seen"));
        let uneven = Formation { ground_sd: 3e-3, ..seen.clone() };
        assert!(doubt(&uneven).contains("of two levels?"), "{}", doubt(&uneven));
        let beyond = vec![Part { volume: 4e-5, height: 0.02 }, Part { volume: 3e-8, height: 4e-3 }];
        let chosen = Formation { left_out: beyond, ..seen.clone() };
        assert!(
            doubt(&chosen).starts_with("40 ml, 20 mm high, stand beyond the 0.58 m"),
            "{}",
            doubt(&chosen)
        );
        // It shows less than the scene's images, which matters where grains come to its edge.
        let mut mask = seen.mask.clone();
        mask[0] = true;
        let small = Formation { shown: Some(0.8), ..seen.clone() };
        let at_edge = Formation { mask, ..small.clone() };
        assert!(doubt(&small).is_empty() && doubt(&at_edge).contains("those that have rolled on"));
        // On a bed of some 10,000 grains it may be as small as it likes.
        let bed = Bed { radius: 0.1, height: 0.03, spacing: 4.5e-3, jitter: 0.0, settle: 0.3 };
        let mut on_bed = Scene { bed: Some(bed), ..Scene::drop(0.1) };
        on_bed.camera.projection = Projection::Orthographic;
        (on_bed.camera.pixels, on_bed.camera.downsample) = (200, 1);
        let limits = Limits::of(&on_bed, &Prior::default()).unwrap().unwrap();
        let limits = Limits { threshold: None, ..limits };
        assert_eq!(limits.violations(&cone(0.02, 0.04)), Vec::<String>::new());
        assert!(limits.doubts(&cone(0.02, 0.04)).is_empty());
    }
}

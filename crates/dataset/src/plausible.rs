//! Whether a recording can be of a scene at all, before its statistics are asked anything: a room is no pile.
//!
//! The bounds are wide, so that no formation of the scene is beyond them, whatever its material: grains end no higher
//! than they began and no lower than one lies, take no more room than grains can and, where none is out of view, no
//! less than they are, lie where the camera looks, on a ground that is flat.

use granulcal_dem::Simulation;
use granulcal_features::Formation;
use granulcal_numbers::short;
use granulcal_scene::{Mask, Prior, Projection, Scene};

mod bare;
mod doubts;
mod frames;
mod relief;
mod size;

use crate::{DatasetError, Room};
use bare::Bare;
pub use doubts::{LEAST_SHOWN, UNIT_FACTOR};
pub use frames::Places;

/// Factor on the height in which the grains start.
const HEIGHT_MARGIN: f64 = 1.5;
/// Room that grains take over their own volume: twice in the loosest heap, and twice for what hides under a pixel.
const VOLUME_MARGIN: f64 = 4.0;
/// Room that grains take over their own volume, at least: they take 1.27 to 1.55 times as much in heaps and single
/// layers of 2000, and of 60 grains that lie apart, which a coarse image samples, 0.88 to 1.27.
const LEAST_VOLUME: f64 = 0.7;
/// Height of the highest grain over the width of the least, at least.
const LEAST_HEIGHT: f64 = 0.5;
/// A formation that stays so far from the image's edge, over half the image, and holds so much of the grains, has left
/// none out of view: of 60 pours of the default prior each that had came within 0.06 of it, or held less than 0.05.
const WITHIN: f64 = 0.2;
const LEFT_OVER: f64 = 0.2;
/// Share of the formation's outline beyond which nothing is seen, above which that is said. A stereo camera's shadows
/// at its foot stay below.
const HIDDEN: f64 = 0.1;
/// Factor beyond what a scene allows, above which a unit is asked for: millimetres are 1000 times as many as metres.
const MUCH: f64 = 30.0;
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
    /// Volume of a typical grain `[m³]`.
    pub grain: f64,
    /// Side of the square of ground that its images show `[m]`.
    pub field: f64,
    /// Width of its images' pixels on the ground `[m]`.
    pub resolution: f64,
    /// Least and greatest distance of its camera from the ground `[m]`; none where it has none, as for a height map.
    pub distance: Option<(f64, f64)>,
    /// Height from which its images' pixels count as grain `[m]`; none where a colour decides.
    pub threshold: Option<f64>,
    /// Greatest distance of most points from their middle `[m]`.
    pub extent: f64,
    /// Greatest standard deviation of the ground about its plane `[m]`.
    pub ground_sd: f64,
    /// Bow that the ground of its images has of their sensor `[m]`.
    pub bow: f64,
    /// Share of the square of ground that its images show `[-]`: a stereo camera's shadow takes a band.
    pub shown: f64,
    /// Whether nothing in it prefers a direction.
    pub is_axisymmetric: bool,
    /// Whether it lies on a bed of grains, which is no plane and of which single heaps may be thrown up.
    pub is_on_bed: bool,
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
        let (mut all, bare) = (Vec::new(), Bare::of(&scene.camera)?);
        for scene in drawn.chain([scene.clone()]) {
            Room::of_pour(&scene, None).require(None)?;
            all.extend(Self::of_one(&scene, bare));
        }
        Ok(all.into_iter().reduce(|a, b| Self {
            height: a.height.max(b.height),
            least_height: a.least_height.min(b.least_height),
            volume: a.volume.max(b.volume),
            least_volume: a.least_volume.min(b.least_volume),
            diameter: a.diameter.max(b.diameter),
            grain: a.grain.max(b.grain),
            field: a.field.max(b.field),
            resolution: a.resolution.max(b.resolution),
            distance: a.distance.zip(b.distance).map(|(a, b)| (a.0.min(b.0), a.1.max(b.1))),
            threshold: a.threshold,
            extent: a.extent.max(b.extent),
            ground_sd: a.ground_sd.max(b.ground_sd),
            bow: a.bow.max(b.bow),
            shown: a.shown.min(b.shown),
            is_axisymmetric: a.is_axisymmetric && b.is_axisymmetric,
            is_on_bed: a.is_on_bed || b.is_on_bed,
        }))
    }

    fn of_one(scene: &Scene, bare: Bare) -> Option<Self> {
        let simulation = Simulation::new(scene, 0).ok()?;
        let (positions, radii) = (simulation.positions(), simulation.radii());
        let tops = positions.iter().zip(&*radii).map(|(at, radius)| at.z + radius);
        let grains = size::volume(scene, &radii);
        let field = scene.camera.field_width;
        // The grains of a bed are the ground that a formation lies on, and no part of it.
        let all_seen = if scene.bed.is_some() { 0.0 } else { LEAST_VOLUME * grains };
        Some(Self {
            height: HEIGHT_MARGIN * tops.fold(0.0, f64::max),
            least_height: LEAST_HEIGHT * size::least_width(scene, &radii),
            volume: VOLUME_MARGIN * grains,
            least_volume: all_seen,
            diameter: scene.grains.diameter,
            grain: size::volume_of_one(scene),
            field,
            resolution: scene.camera.ground_resolution(),
            distance: (scene.camera.projection == Projection::Pinhole)
                .then_some((scene.camera.height, scene.camera.height)),
            threshold: (scene.camera.mask == Mask::Height).then_some(scene.camera.height_threshold),
            extent: EXTENT_MARGIN * field * 0.5_f64.sqrt(),
            ground_sd: (GROUND_DIAMETERS * scene.grains.diameter).max(GROUND_FLOOR),
            bow: bare.bow,
            shown: bare.shown,
            is_axisymmetric: scene.is_axisymmetric(),
            is_on_bed: scene.bed.is_some(),
        })
    }

    /// Why a formation cannot be one of the scene, a sentence each; none if it can.
    pub fn violations(&self, formation: &Formation) -> Vec<String> {
        let points = || formation.points.iter();
        let mut found = Vec::new();
        let mut compare = |what: &str, unit: &str, value: f64, limit: f64| {
            if value.is_nan() || value > limit {
                let hint =
                    if value > MUCH * limit { ": is the unit of the depths right?" } else { "" };
                let (value, limit) = (short(value), short(limit));
                found.push(format!(
                    "{what} is {value} {unit}, in the scene at most {limit} {unit}{hint}"
                ));
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
mod tests;

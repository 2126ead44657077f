//! An image turned so that its ground is z = 0: what depth images and height maps share.

use nalgebra::{Point3, Vector3};

use super::component::{remove_low, remove_small};
use super::part::Part;
use super::settings::Segmentation;
use crate::error::{Cleaned, FeatureError};
use crate::plane::PlaneFit;

/// A camera that looks along the ground sees it under no angle whose cosine is less.
const LEAST_FACING: f64 = 0.05;

/// What a pixel's column of grains measures on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Footprint {
    /// The same rectangle under every pixel, its sides along x and y `[m]`, seen along z.
    Column { x: f64, y: f64 },
    /// A pyramid with its tip at the camera's `centre`, looking along `axis`, the columns of the image `across`; focal
    /// lengths `[px]`.
    Pyramid { fx: f64, fy: f64, centre: Vector3<f64>, axis: Vector3<f64>, across: Vector3<f64> },
}

/// The points of an image and the pixels that they belong to.
pub(super) struct Cloud {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Index of the pixel of each point, rising.
    pub(super) pixels: Vec<usize>,
    pub(super) points: Vec<Vector3<f64>>,
    pub(super) footprint: Footprint,
    /// The factor by which the image was down-sampled.
    pub(super) downsample: usize,
}

/// An image whose ground was found: its heights above the ground, and which pixels are grain.
#[derive(Debug, Clone, PartialEq)]
pub struct Levelled {
    /// Columns `[px]`, after down-sampling.
    pub width: usize,
    /// Rows `[px]`, after down-sampling.
    pub height: usize,
    /// Height above the fitted ground `[m]`, row by row, shape [height · width]; `None` = no data.
    pub heights: Vec<Option<f64>>,
    /// Which pixels are grain, row by row, shape [height · width]; none on a flat bed.
    pub mask: Vec<bool>,
    /// The ground in the frame of the input, normal towards the camera.
    pub plane: PlaneFit,
    /// Robust standard deviation of the ground about its plane `[m]`.
    pub ground_sd: f64,
    /// Height above the ground from which a pixel counts as grain `[m]`; not applied when a colour
    /// decides.
    pub threshold: f64,
    /// Whether a colour decides which pixels are grain.
    pub is_by_colour: bool,
    /// Pixels that carry data, within the border.
    pub valid_count: usize,
    /// Pixels above the greatest height, which carry none.
    pub above_count: usize,
    /// Why pixels above the threshold are no grains, where none is; `None` otherwise.
    pub cleaned: Option<Cleaned>,
    /// Share of the square of ground that was asked for which the image shows `[-]`; none without one.
    pub shown: Option<f64>,
    /// Whether the image shows more, which was cut off.
    pub is_cropped: bool,
    /// Patches of grains beyond it, which were left out.
    pub left_out: Vec<Part>,
    /// The factor by which the image was down-sampled.
    pub downsample: usize,
    /// Width of a pixel on the ground, along x and y `[m/px]`.
    pub resolution: (f64, f64),
    /// Volume between the ground and the surface of each pixel with data `[m³]`.
    pub(super) volumes: Vec<f64>,
    /// Points of the pixels with data, in the frame in which the ground is z = 0 `[m]`.
    pub(super) points: Vec<Vector3<f64>>,
    /// The pixels with data.
    pub(super) pixels: Vec<usize>,
}

impl Cloud {
    /// The points that `point_of` gives for the pixels (u, v).
    pub(super) fn new(
        (width, height): (usize, usize),
        downsample: usize,
        footprint: Footprint,
        point_of: impl Fn(usize, usize) -> Option<Vector3<f64>>,
    ) -> Self {
        let (mut pixels, mut points) = (Vec::new(), Vec::new());
        for v in 0..height {
            for u in 0..width {
                if let Some(point) = point_of(u, v) {
                    pixels.push(v * width + u);
                    points.push(point);
                }
            }
        }
        Self { width, height, pixels, points, footprint, downsample }
    }

    /// Ground, heights, mask. `grains` marks the pixels of the grains if that is known; `up` chooses
    /// the side of the plane on which the grains are.
    pub(super) fn level(
        self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<Levelled, FeatureError> {
        let (plane, ground_sd) = self.ground(settings, grains, up)?;
        let threshold = settings.height_threshold.height(ground_sd);
        let ground_from_input = plane.plane.ground_from_world();
        let max_height = settings.max_height.unwrap_or(f64::INFINITY);
        let mut heights = vec![None; self.width * self.height];
        let mut mask = vec![false; self.width * self.height];
        let (mut pixels, mut points, mut volumes) = (Vec::new(), Vec::new(), Vec::new());
        for (&pixel, seen) in self.pixels.iter().zip(&self.points) {
            let point = (ground_from_input * Point3::from(*seen)).coords;
            if point.z > max_height {
                continue;
            }
            heights[pixel] = Some(point.z);
            mask[pixel] = grains.map_or(point.z > threshold, |grains| grains[pixel]);
            pixels.push(pixel);
            volumes.push(self.volume(&plane, seen, point.z));
            points.push(point);
        }
        let count = |mask: &[bool]| mask.iter().filter(|&&is_grain| is_grain).count();
        let mut cleaned = None;
        if let (Some(peak), None) = (settings.height_threshold.peak(ground_sd), grains) {
            let passed = count(&mask);
            remove_low(&mut mask, self.width, |pixel| heights[pixel].is_some_and(|z| z > peak));
            let is_none = passed > 0 && count(&mask) == 0;
            cleaned = is_none.then_some(Cleaned::Low { pixels: passed, peak });
        }
        let (high, min_px) = (count(&mask), settings.min_component_px);
        remove_small(&mut mask, self.width, min_px);
        if high > 0 && count(&mask) == 0 {
            cleaned = Some(Cleaned::Small { pixels: high, min_px });
        }
        Ok(Levelled {
            width: self.width,
            height: self.height,
            heights,
            mask,
            ground_sd,
            threshold,
            is_by_colour: grains.is_some(),
            valid_count: points.len(),
            above_count: self.points.len() - points.len(),
            cleaned,
            shown: None,
            is_cropped: false,
            left_out: Vec::new(),
            downsample: self.downsample,
            resolution: self.resolution(&plane),
            plane,
            volumes,
            points,
            pixels,
        })
    }

    /// Volume under a pixel `[m³]` whose point was seen at `seen` and lies `height` above the ground.
    fn volume(&self, plane: &PlaneFit, seen: &Vector3<f64>, height: f64) -> f64 {
        match self.footprint {
            // Along z the column is longer than the distance from a tilted plane.
            Footprint::Column { x, y } => x * y * height / plane.plane.normal.z,
            Footprint::Pyramid { fx, fy, centre, axis, .. } => {
                // The pyramid of a pixel cut at depth z holds z³/(3 fx fy); the ray meets the ground
                // at the depth z above/(above - height).
                let above = plane.plane.signed_distance(&centre);
                let depth = (seen - centre).dot(&axis);
                let ground = depth * above / (above - height);
                (ground.powi(3) - depth.powi(3)) / (3.0 * fx * fy)
            }
        }
    }

    /// Width of a pixel on the ground, along the image's rows and columns `[m/px]`; a camera's where it looks straight
    /// ahead, longer along its tilt.
    pub(super) fn resolution(&self, plane: &PlaneFit) -> (f64, f64) {
        match self.footprint {
            Footprint::Column { x, y } => (x, y),
            Footprint::Pyramid { fx, fy, centre, axis, across } => {
                let normal = plane.plane.normal;
                let facing = (-normal.dot(&axis)).max(LEAST_FACING);
                let depth = plane.plane.signed_distance(&centre) / facing;
                let stretch = |side: &Vector3<f64>| 1.0_f64.hypot(normal.dot(side) / facing);
                (depth / fx * stretch(&across), depth / fy * stretch(&axis.cross(&across)))
            }
        }
    }
}

impl Levelled {
    /// (point, whether it is grain, volume `[m³]`) of the pixels with data.
    pub(super) fn samples(&self) -> impl Iterator<Item = (&Vector3<f64>, bool, f64)> {
        self.points
            .iter()
            .zip(&self.pixels)
            .zip(&self.volumes)
            .map(|((point, &pixel), &volume)| (point, self.mask[pixel], volume))
    }
}

/// The fit seen from the other side.
pub(super) fn flipped(fit: PlaneFit) -> PlaneFit {
    let plane = fit.plane.flipped();
    PlaneFit { plane, tilt_rad: plane.tilt_rad(), ..fit }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use crate::raster::render;
    use crate::{Camera, Segmentation, segment_depth};

    #[test]
    fn a_pixel_is_longer_on_the_ground_where_the_camera_looks_aslant() {
        let pile: Vec<Vector3<f64>> = (0..400)
            .map(|i| {
                Vector3::new(2e-3 * (i % 20) as f64 - 0.02, 2e-3 * (i / 20) as f64 - 0.02, 3e-3)
            })
            .collect();
        let camera = Camera::overhead(0.4, 0.5, 400).unwrap();
        let wanted = 5.0 * 1.25e-3;
        let settings = Segmentation { ground_resolution: Some(wanted), ..Default::default() };
        for (tilt_deg, factor) in
            [((0.0_f64, 0.0_f64), 5), ((40.0, 0.0), 3), ((0.0, -40.0), 3), ((20.0, 20.0), 4)]
        {
            let tilted = camera.tilted(tilt_deg.0.to_radians(), tilt_deg.1.to_radians());
            // Where the middle of the image and its neighbours to the right and below meet the ground.
            let met = |u: f64, v: f64| {
                let [near, far] =
                    [1.0, 2.0].map(|depth| tilted.unproject(200.0 + u, 200.0 + v, depth));
                near + (far - near) * (near.z / (near.z - far.z))
            };
            let there: Vec<_> = pile.iter().map(|at| at + met(0.0, 0.0)).collect();
            let image = render(&tilted, &there, &vec![3e-3; 400]).unwrap();
            let fine = segment_depth(&camera, &image, None, &Segmentation::default()).unwrap();
            let widths = [(1.0, 0.0), (0.0, 1.0)].map(|(u, v)| (met(u, v) - met(0.0, 0.0)).norm());
            for (got, width) in [fine.resolution.0, fine.resolution.1].into_iter().zip(widths) {
                assert!((got / width - 1.0).abs() < 5e-3, "{tilt_deg:?}: {got} {width}");
            }
            // The volume of a part is by these widths, that of the formation by the pixels' pyramids.
            let whole: Vec<usize> =
                (0..fine.mask.len()).filter(|&pixel| fine.mask[pixel]).collect();
            let ratio = fine.part(&whole).volume / fine.volume;
            assert!((ratio - 1.0).abs() < 0.15, "{tilt_deg:?}: {ratio}");
            let got = segment_depth(&camera, &image, None, &settings).unwrap();
            assert_eq!(got.downsample, factor, "{tilt_deg:?}");
        }
    }

    #[test]
    fn pixels_of_a_map_that_are_no_squares_are_matched_by_their_area() {
        let map = crate::HeightMap::new(200, 100, 1e-3, 4e-3, cone(200)).unwrap();
        let settings = Segmentation { ground_resolution: Some(6e-3), ..Default::default() };
        assert_eq!(crate::segment_height_map(&map, &settings).unwrap().downsample, 3);
    }

    /// A cone of 200 columns of 1 mm and 100 rows of 4 mm.
    fn cone(columns: usize) -> Vec<f64> {
        let at = |pixel: usize| {
            let (x, y) = ((pixel % columns) as f64 - 100.0, 4.0 * (pixel / columns) as f64 - 200.0);
            (0.02 * (1.0 - x.hypot(y) / 50.0)).max(0.0)
        };
        (0..columns * 100).map(at).collect()
    }
}

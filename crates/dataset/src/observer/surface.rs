//! The free surface of grains that keep moving, from the side: its mean, and frame by frame.

use granulcal_dem::Pour;
use granulcal_features::series::Silhouette;
use granulcal_features::series::silhouette::slope_deg;
use granulcal_scene::{ObserveSurface, Scene};
use nalgebra::Vector3;

use super::observation::{Frame, Observation, ObservedStatistic, Series};

/// Columns from which the slope is taken, over its width.
const SLOPE_COLUMNS: usize = 41;

/// `surface_z[x]` at the stated x, and `surface_slope`.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    spec: ObserveSurface,
    radius: f64,
    slope_x: Vec<f64>,
    /// Pictures of the listed columns and of the slope's, once there was a frame.
    pictures: Option<[Silhouette; 2]>,
    /// Of each frame by itself: the height at each of the listed columns, then the slope.
    series: Vec<Series>,
}

impl Surface {
    pub(super) fn new(spec: &ObserveSurface, scene: &Scene) -> Self {
        let share = |column: usize| 2.0 * column as f64 / (SLOPE_COLUMNS - 1) as f64 - 1.0;
        let slope_x = (0..SLOPE_COLUMNS).map(|c| share(c) * spec.slope_within).collect();
        let heights = spec.x.iter().map(|x| Series::new(height_at(*x), "m"));
        let series = heights.chain([Series::new("surface_slope", "deg")]).collect();
        let radius = scene.grains.radius();
        Self { spec: spec.clone(), radius, slope_x, pictures: None, series }
    }

    /// Empty pictures, as high above and below the centre as twice the widest column is from it.
    fn blank(&self) -> [Silhouette; 2] {
        let widest = self.spec.x.iter().map(|x| x.abs()).fold(self.spec.slope_within, f64::max);
        let reach = 2.0 * widest + 2.0 * self.radius;
        [&self.spec.x, &self.slope_x]
            .map(|x| Silhouette::new(x, (-reach, reach), self.radius).expect("a checked scene"))
    }

    /// The heights of the listed columns, and the slope, in two pictures.
    fn of(&self, [listed, slope]: &[Silhouette; 2]) -> Vec<f64> {
        let slope = slope.surface(self.spec.level);
        let slope = slope_deg(&self.slope_x, &slope, self.spec.slope_within);
        let slope = slope.expect("a height in each column");
        listed.surface(self.spec.level).into_iter().chain([slope]).collect()
    }
}

/// The name of the surface's height at `x` `[m]`.
fn height_at(x: f64) -> String {
    format!("surface_z[{x}]")
}

impl Observation for Surface {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let at = |x: &f64| ObservedStatistic {
            name: height_at(*x),
            unit: "m",
            doc: format!("mean height of the free surface above the centre at x = {x} m"),
        };
        let mut all: Vec<_> = self.spec.x.iter().map(at).collect();
        let within = self.spec.slope_within;
        all.push(ObservedStatistic {
            name: "surface_slope".to_owned(),
            unit: "deg",
            doc: format!(
                "angle by which the mean surface falls towards +x where |x| <= {within} m"
            ),
        });
        all
    }

    fn see(&mut self, frame: &Frame) {
        let [x, z] = self.spec.centre;
        let origin = Vector3::new(x, 0.0, z);
        let centred: Vec<_> = frame.positions.iter().map(|position| position - origin).collect();
        let seen = self.pictures.take();
        let mut pictures = seen.unwrap_or_else(|| self.blank());
        let mut now = self.blank();
        for picture in pictures.iter_mut().chain(&mut now) {
            picture.add(&centred, &frame.radii).expect("a radius for each grain");
        }
        self.pictures = Some(pictures);
        let values = self.of(&now);
        for (series, value) in self.series.iter_mut().zip(values) {
            series.push(frame.time, value);
        }
    }

    fn values(&self, _: &Pour) -> Vec<f64> {
        match &self.pictures {
            Some(pictures) => self.of(pictures),
            None => vec![f64::NAN; self.spec.x.len() + 1],
        }
    }

    fn series(&self) -> &[Series] {
        &self.series
    }
}

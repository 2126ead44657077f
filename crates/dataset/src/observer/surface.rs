//! The mean free surface of grains that keep moving, from the side.

use granulcal_dem::{ObserveSurface, Pour, Scene};
use granulcal_features::series::Silhouette;
use granulcal_features::series::silhouette::slope_deg;
use nalgebra::Vector3;

use super::{Frame, Observation, ObservedStatistic};

/// Columns from which the slope is taken, over its width.
const SLOPE_COLUMNS: usize = 41;

/// `surface_z[x]` at the stated x, and `surface_slope`.
#[derive(Debug)]
pub(super) struct Surface {
    spec: ObserveSurface,
    radius: f64,
    slope_x: Vec<f64>,
    /// Pictures of the listed columns and of the slope's, once there was a frame.
    pictures: Option<[Silhouette; 2]>,
}

impl Surface {
    pub(super) fn new(spec: &ObserveSurface, scene: &Scene) -> Self {
        let share = |column: usize| 2.0 * column as f64 / (SLOPE_COLUMNS - 1) as f64 - 1.0;
        let slope_x = (0..SLOPE_COLUMNS).map(|c| share(c) * spec.slope_within).collect();
        Self { spec: spec.clone(), radius: scene.grains.radius(), slope_x, pictures: None }
    }

    /// Empty pictures, as high above and below the centre as twice the widest column is from it.
    fn blank(&self) -> [Silhouette; 2] {
        let widest = self.spec.x.iter().map(|x| x.abs()).fold(self.spec.slope_within, f64::max);
        let reach = 2.0 * widest + 2.0 * self.radius;
        [&self.spec.x, &self.slope_x]
            .map(|x| Silhouette::new(x, (-reach, reach), self.radius).expect("a checked scene"))
    }
}

impl Observation for Surface {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let at = |x: &f64| ObservedStatistic {
            name: format!("surface_z[{x}]"),
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
        for picture in &mut pictures {
            picture.add(&centred, &frame.radii);
        }
        self.pictures = Some(pictures);
    }

    fn values(&self, _: &Pour) -> Vec<f64> {
        let Some([listed, slope]) = &self.pictures else {
            return vec![f64::NAN; self.spec.x.len() + 1];
        };
        let slope = slope.surface(self.spec.level);
        let slope = slope_deg(&self.slope_x, &slope, self.spec.slope_within);
        listed.surface(self.spec.level).into_iter().chain([slope]).collect()
    }
}

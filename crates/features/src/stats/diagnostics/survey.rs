//! What the diagnostic statistics start from, computed once.

use std::cell::OnceCell;

use nalgebra::{Vector2, Vector3};

use super::bodies::joined::Bodies;
use super::modes::fourier::Modes;
use super::profile::rings::Profile;
use super::settings::DiagnosticSettings;
use crate::error::{FeatureError, require_in};
use crate::stats::iqr::quantile;
use crate::stats::prepared::{centroid, require_points};
use crate::stats::statistic::Statistic;
use crate::stats::sum::extremes;

/// Largest extent of the points, in spacings: the bodies are found in cells of about a spacing, whose
/// numbers must be exact.
const MAX_EXTENT: f64 = 1e12;

/// A statistic of the second family.
pub type Diagnostic = Statistic<Survey>;

/// Points counted from the pour axis.
#[derive(Debug, Clone)]
pub struct Survey {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) z: Vec<f64>,
    /// Distance from the pour axis `[m]`.
    pub(super) r: Vec<f64>,
    /// 95 % and 99 % quantiles of r `[m]`.
    pub(super) r_95: f64,
    pub(super) r_99: f64,
    pub(super) grain_diameter: f64,
    pub(super) spacing: f64,
    profile: OnceCell<Profile>,
    modes: OnceCell<Modes>,
    bodies: OnceCell<Bodies>,
}

impl Survey {
    /// Counts x, y and r from the pour axis.
    ///
    /// # Errors
    /// As [`super::diagnostics`].
    pub fn new(
        points: &[Vector3<f64>],
        settings: &DiagnosticSettings,
    ) -> Result<Self, FeatureError> {
        require_points("diagnostic statistics", points)?;
        settings.require_valid()?;
        let (origin, offset) =
            settings.pour_axis.map_or_else(|| centroid(points), |axis| (axis, Vector2::zeros()));
        let x: Vec<_> = points.iter().map(|p| (p.x - origin.x) - offset.x).collect();
        let y: Vec<_> = points.iter().map(|p| (p.y - origin.y) - offset.y).collect();
        for axis in [&x, &y] {
            let (low, high) = extremes(axis);
            let most = MAX_EXTENT * settings.spacing;
            require_in("extent of the points [m]", high - low, 0.0, most)?;
        }
        let z = points.iter().map(|p| p.z).collect();
        let r: Vec<_> = x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect();
        let mut scratch = r.clone();
        let (r_95, r_99) = (quantile(&mut scratch, 0.95), quantile(&mut scratch, 0.99));
        Ok(Self {
            x,
            y,
            z,
            r,
            r_95,
            r_99,
            grain_diameter: settings.grain_diameter,
            spacing: settings.spacing,
            profile: OnceCell::new(),
            modes: OnceCell::new(),
            bodies: OnceCell::new(),
        })
    }

    /// The radial profile of the height.
    pub(super) fn profile(&self) -> &Profile {
        self.profile.get_or_init(|| Profile::new(&self.r, &self.z, self.r_95, self.spacing))
    }

    /// The azimuthal modes.
    pub(super) fn modes(&self) -> &Modes {
        self.modes.get_or_init(|| Modes::new([&self.x, &self.y, &self.z, &self.r]))
    }

    /// The connected bodies.
    pub(super) fn bodies(&self) -> &Bodies {
        self.bodies.get_or_init(|| Bodies::new(&self.x, &self.y, self.spacing, self.grain_diameter))
    }
}

//! Pours of another simulator: what it left, in the words of ours.

use granulcal_dem::{Health, Pour, Status};
use granulcal_features::stats::{DIAGNOSTIC_COUNT, DiagnosticSettings, diagnostics};
use granulcal_features::{FeatureError, paper16};
use granulcal_scene::Scene;
use nalgebra::{Vector2, Vector3};
use xxhash_rust::xxh3::Xxh3;

use crate::{DatasetError, VERSION};

/// What another simulator left of a pour.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Spheres at rest, at which the scene's camera then looks.
    Grains {
        /// Centres `[m]`, ground at z = 0.
        positions: Vec<Vector3<f64>>,
        /// Radii `[m]`, one each.
        radii: Vec<f64>,
    },
    /// Points of the formation's surface `[m]` as a camera of its own saw them: ground at z = 0, pour axis at
    /// x = y = 0.
    Points(Vec<Vector3<f64>>),
}

/// A simulator that is asked for pours in place of ours.
#[derive(Clone, Copy)]
pub struct Engine<'a> {
    /// What it is called; it stands in the version of the data set, so that two engines' rows are never mixed.
    pub name: &'a str,
    /// A scene with its parameters set and a seed to what is left. Several threads call it at once.
    pub pour: &'a (dyn Fn(&Scene, u64) -> Result<Outcome, DatasetError> + Sync),
}

impl Engine<'_> {
    /// The version that rows of this engine carry.
    pub fn version(&self) -> String {
        format!("{VERSION}, pours by {}", self.name)
    }
}

/// The paper's statistics of a formation and the diagnostic ones.
pub(crate) type Described = ([f64; 16], [f64; DIAGNOSTIC_COUNT]);

/// Statistics of a formation's points: the paper's and the diagnostic ones, `None` where there are too few points.
pub(crate) fn describe(
    scene: &Scene,
    points: &[Vector3<f64>],
) -> Result<Option<Described>, DatasetError> {
    let camera = &scene.camera;
    let settings = DiagnosticSettings {
        pour_axis: Some(Vector2::zeros()),
        grain_diameter: scene.grains.diameter,
        spacing: camera.ground_resolution(),
    };
    let both = paper16(points).and_then(|values| Ok((values, diagnostics(points, &settings)?)));
    match both {
        Ok(values) => Ok(Some(values)),
        Err(FeatureError::TooFewPoints { .. }) => Ok(None),
        Err(error) => Err(DatasetError::Features(error)),
    }
}

/// Spheres that another simulator left, as a pour of `scene` that came to rest.
///
/// It is `jammed` where grains remain in the funnel, and `unhealthy` where a number is not finite. What only our
/// solver knows of itself is NaN or 0 in its health; the deepest overlap is that of the grains at rest.
///
/// # Errors
/// [`DatasetError::Argument`] for radii that are not one for each grain, or not positive.
pub fn foreign_pour(
    scene: &Scene,
    positions: Vec<Vector3<f64>>,
    radii: Vec<f64>,
) -> Result<Pour, DatasetError> {
    let refuse = |what, got: String, allowed| Err(DatasetError::Argument { what, got, allowed });
    if radii.len() != positions.len() {
        let got = format!("{} for {} grains", radii.len(), positions.len());
        return refuse("the radii", got, "one for each grain");
    }
    if let Some(bad) = radii.iter().find(|radius| !(radius.is_finite() && **radius > 0.0)) {
        return refuse("a radius", bad.to_string(), "positive and finite");
    }
    let is_finite = positions.iter().all(|centre| centre.iter().all(|value| value.is_finite()));
    let held = |centre: &&Vector3<f64>| scene.is_in_funnel(centre, scene.end.horizon);
    let grains_in_funnel = positions.iter().filter(held).count();
    let status = match (is_finite, grains_in_funnel) {
        (false, _) => Status::Unhealthy,
        (true, 0) => Status::AtRest,
        (true, _) => Status::Jammed,
    };
    let unknown = Health {
        worst_penetration: f64::NAN,
        mean_residual: f64::NAN,
        worst_residual: f64::NAN,
        energy_created: f64::NAN,
        mean_contacts: f64::NAN,
        ..Health::default()
    };
    let mut hash = Xxh3::new();
    for (centre, radius) in positions.iter().zip(&radii) {
        centre.iter().chain([radius]).for_each(|value| hash.update(&value.to_le_bytes()));
    }
    let still = vec![Vector3::zeros(); positions.len()];
    Ok(Pour {
        velocities: still.clone(),
        angular_velocities: still,
        positions,
        radii,
        radii_out: Vec::new(),
        status,
        health: unknown,
        grains_in_funnel,
        simulated_s: f64::NAN,
        convex: None,
        bed: None,
        state_hash: hash.digest128(),
    })
}

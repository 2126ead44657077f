//! How a recording is segmented, as Python's keywords.

use granulcal_features::{Region, Segmentation, Threshold};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Every keyword, in the order of the page.
const KEYWORDS: &str = "height_threshold, threshold_floor, scene_threshold, border_px, region, downsample, ground_resolution, field_width, \
                        inlier_distance, max_tilt_deg, flying_deg, max_height, min_component_px, plane_seed";

/// A recording's own segmentation with what the keywords change; what is None stays.
///
/// # Errors
/// `TypeError` names a keyword that there is not, and one whose value is of another type; `ValueError` one that is no
/// count.
pub(crate) fn changed(
    own: &Segmentation,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<Segmentation> {
    let mut settings = own.clone();
    let (mut threshold, mut floor, mut of_scene) = (None, None, None);
    let is_given = |keyword: &str| -> PyResult<bool> {
        let value = keywords.map(|all| all.get_item(keyword)).transpose()?.flatten();
        Ok(value.is_some_and(|value| !value.is_none()))
    };
    // What a pixel shall be wide on the ground is no longer what the camera's file makes of it.
    if is_given("ground_resolution")? {
        settings.downsample = None;
    }
    for (keyword, value) in keywords.into_iter().flatten() {
        let keyword: String = keyword.extract()?;
        if value.is_none() {
            refuse_unknown(&keyword)?;
            continue;
        }
        let named = |error: PyErr| {
            let text = format!("{keyword}: {}", error.value(value.py()));
            PyErr::from_type(error.get_type(value.py()), text)
        };
        let real = || value.extract::<f64>().map_err(named);
        let whole = || value.extract::<usize>().map_err(|error| whole_or(error, &value, named));
        match keyword.as_str() {
            "height_threshold" => threshold = Some(real()?),
            "threshold_floor" => floor = Some(real()?),
            "scene_threshold" => of_scene = Some(real()?),
            "border_px" => settings.border_px = whole()?,
            "region" => settings.region = Some(region(&value)?),
            "downsample" => settings.downsample = Some(whole()?),
            "ground_resolution" => settings.ground_resolution = Some(real()?),
            "field_width" => settings.field_width = Some(real()?),
            "inlier_distance" => settings.inlier_distance = Some(real()?),
            "max_tilt_deg" => settings.max_tilt_deg = real()?,
            "flying_deg" => settings.flying_deg = real()?,
            "max_height" => settings.max_height = Some(real()?),
            "min_component_px" => settings.min_component_px = whole()?,
            "plane_seed" => {
                settings.plane_seed =
                    value.extract().map_err(|error| whole_or(error, &value, named))?;
            }
            other => refuse_unknown(other)?,
        }
    }
    settings.height_threshold = match (threshold, floor) {
        (Some(height), _) => Threshold::Absolute(height),
        (None, Some(floor)) => Threshold::Automatic { floor },
        (None, None) => settings.height_threshold,
    };
    if let (None, None, Some(of_scene)) = (threshold, floor, of_scene) {
        settings = settings.with_scene_threshold(of_scene);
    }
    Ok(settings)
}

/// Four whole numbers: first column, first row, columns, rows.
fn region(value: &Bound<'_, PyAny>) -> PyResult<Region> {
    let numbers: Result<[usize; 4], _> = value.extract();
    numbers.map(Region::from).map_err(|_| {
        let text = format!("region: must be whole pixels (x, y, width, height), got {value}");
        PyTypeError::new_err(text)
    })
}

/// What is wrong with a count or a seed: below 0 or too large for one, or else what `named` makes of it.
fn whole_or(error: PyErr, value: &Bound<'_, PyAny>, named: impl Fn(PyErr) -> PyErr) -> PyErr {
    if !error.is_instance_of::<PyOverflowError>(value.py()) {
        return named(error);
    }
    let text = format!("must be a whole number from 0 to 2^64 - 1, got {value}");
    named(PyValueError::new_err(text))
}

fn refuse_unknown(keyword: &str) -> PyResult<()> {
    if KEYWORDS.split(", ").any(|known| known == keyword) {
        return Ok(());
    }
    let text = format!("got an unexpected keyword argument {keyword:?}; allowed are {KEYWORDS}");
    Err(PyTypeError::new_err(text))
}

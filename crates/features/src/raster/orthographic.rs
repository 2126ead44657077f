//! Grains to a height map, without perspective.

use nalgebra::Vector3;

use super::{MAX_COORDINATE, require_spheres};
use crate::error::{FeatureError, require_in};
use crate::height_map::HeightMap;

/// Height of the highest grain over each pixel of a square map, 0 where the ground z = 0 is bare.
///
/// The map is `pixels` wide with `resolution_m` per pixel, centred at the world point `centre`;
/// columns run along +x, rows along +y. The map itself forgets `centre`: its own points are
/// centred at 0, and the statistics centre at the centroid anyway.
///
/// # Errors
/// As [`crate::render`] for the grains, `OutOfRange` for the size, the resolution or the centre.
pub fn height_map(
    positions: &[Vector3<f64>],
    radii: &[f64],
    pixels: usize,
    resolution_m: f64,
    centre: (f64, f64),
) -> Result<HeightMap, FeatureError> {
    require_spheres(positions, radii)?;
    for coordinate in [centre.0, centre.1] {
        require_in("map centre [m]", coordinate, -MAX_COORDINATE, MAX_COORDINATE)?;
    }
    // The size is checked before anything of that size is allocated.
    HeightMap::require_geometry(pixels, pixels, resolution_m, resolution_m)?;
    let mut map =
        HeightMap::new(pixels, pixels, resolution_m, resolution_m, vec![0.0; pixels * pixels])?;
    let half_width = 0.5 * pixels as f64;
    for (position, &radius) in positions.iter().zip(radii) {
        // Grain in pixel units, pixel i having its centre at i.
        let x = (position.x - centre.0) / resolution_m + half_width - 0.5;
        let y = (position.y - centre.1) / resolution_m + half_width - 0.5;
        let reach = radius / resolution_m;
        let (first_row, end_row) = covered(y, reach, pixels);
        let (first, end) = covered(x, reach, pixels);
        for row in first_row..end_row {
            let dy = (row as f64 - y) * resolution_m;
            for column in first..end {
                let dx = (column as f64 - x) * resolution_m;
                let rise = (radius * radius - dx * dx - dy * dy).sqrt();
                // NaN outside of the disc: `max` keeps the other operand.
                let pixel = &mut map.z[row * pixels + column];
                *pixel = pixel.max(position.z + rise);
            }
        }
    }
    Ok(map)
}

/// Half-open range of pixels within `reach` of `middle`.
fn covered(middle: f64, reach: f64, count: usize) -> (usize, usize) {
    let count = count as f64;
    let first = (middle - reach).ceil().clamp(0.0, count);
    let end = ((middle + reach).floor() + 1.0).clamp(0.0, count);
    (first as usize, end as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_grain_is_a_cap() {
        let (radius, resolution) = (0.002, 0.0005);
        let grain = [Vector3::new(0.01, -0.02, radius)];
        // An odd width puts the middle of a pixel on the grain's axis.
        let map = height_map(&grain, &[radius], 21, resolution, (0.01, -0.02)).unwrap();
        assert!((map.at(10, 10) - 2.0 * radius).abs() < 1e-15);
        let off_axis = radius + (radius * radius - resolution * resolution).sqrt();
        assert!((map.at(11, 10) - off_axis).abs() < 1e-15);
        assert_eq!(map.at(15, 10), 0.0);
    }

    #[test]
    fn rows_run_along_y() {
        let map = height_map(&[Vector3::new(0.0, 0.01, 0.002)], &[0.002], 20, 0.002, (0.0, 0.0));
        let map = map.unwrap();
        assert!(map.at(10, 15) > 0.0 && map.at(10, 4) == 0.0 && map.at(15, 10) == 0.0);
    }

    #[test]
    fn grains_outside_the_map_leave_it_bare() {
        let far = [Vector3::new(5.0, 5.0, 0.1), Vector3::new(-900.0, 0.0, 0.1)];
        let map = height_map(&far, &[0.01, 0.01], 8, 0.01, (0.0, 0.0)).unwrap();
        assert!(map.z.iter().all(|&z| z == 0.0));
    }

    #[test]
    fn refuses_bad_input() {
        let grain = [Vector3::new(0.0, 0.0, 0.1)];
        assert!(height_map(&grain, &[], 8, 0.01, (0.0, 0.0)).is_err());
        assert!(height_map(&grain, &[0.1], 0, 0.01, (0.0, 0.0)).is_err());
        assert!(height_map(&grain, &[0.1], usize::MAX, 0.01, (0.0, 0.0)).is_err());
        assert!(height_map(&grain, &[0.1], 8, f64::NAN, (0.0, 0.0)).is_err());
        assert!(height_map(&grain, &[0.1], 8, 0.01, (f64::NAN, 0.0)).is_err());
    }
}

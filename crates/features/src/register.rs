//! The colours of a depth image's pixels, taken from a camera beside it.

use nalgebra::{Isometry3, Point3};

use crate::camera::Intrinsics;
use crate::colour::ColourImage;
use crate::depth::{DepthImage, is_valid};
use crate::error::FeatureError;

/// The colour that a second camera saw at the point of each depth pixel; black where there is none.
///
/// A depth pixel is a point of the depth camera, x = (u - c) / f · z; the point in the frame of the
/// colour camera is projected through its lens, and the pixel that it falls on gives the colour. Both
/// lenses are pinholes. A point that the colour camera cannot see, because something stands in front
/// of it, gets the colour of what stands there: at the rim of a grain of height h seen from z, that is
/// a strip of h · b / z for cameras at the distance b.
///
/// # Errors
/// `SizeMismatch` when an image has not the size of its lens, `LengthMismatch` for images that
/// contradict themselves.
pub fn register_colour(
    depth: &DepthImage,
    depth_lens: &Intrinsics,
    colour: &ColourImage,
    colour_lens: &Intrinsics,
    colour_from_depth: &Isometry3<f64>,
) -> Result<ColourImage, FeatureError> {
    depth.require_valid()?;
    require_size("depth image", (depth.width, depth.height), depth_lens)?;
    require_size("colour image", (colour.width, colour.height), colour_lens)?;
    colour.require_valid()?;
    let (pixels, _) = colour.rgb.as_chunks::<3>();
    let mut rgb = Vec::with_capacity(3 * depth.depth.len());
    for v in 0..depth.height {
        for u in 0..depth.width {
            let z = depth.at(u, v);
            let seen = is_valid(z).then(|| {
                let z = f64::from(z);
                let x = (u as f64 + 0.5 - depth_lens.cx) / depth_lens.fx * z;
                let y = (v as f64 + 0.5 - depth_lens.cy) / depth_lens.fy * z;
                let point = colour_from_depth * Point3::new(x, y, z);
                pixel_of(colour_lens, &point)
            });
            let pixel = seen.flatten().map(|(u, v)| pixels[v * colour.width + u]);
            rgb.extend(pixel.unwrap_or_default());
        }
    }
    ColourImage::new(depth.width, depth.height, rgb)
}

/// The pixel that a point of the camera's frame falls on.
fn pixel_of(lens: &Intrinsics, point: &Point3<f64>) -> Option<(usize, usize)> {
    let u = lens.fx * point.x / point.z + lens.cx;
    let v = lens.fy * point.y / point.z + lens.cy;
    let is_inside = point.z > 0.0
        && (0.0..lens.width as f64).contains(&u)
        && (0.0..lens.height as f64).contains(&v);
    is_inside.then_some((u as usize, v as usize))
}

fn require_size(
    what: &'static str,
    got: (usize, usize),
    lens: &Intrinsics,
) -> Result<(), FeatureError> {
    let expected = (lens.width, lens.height);
    if got == expected { Ok(()) } else { Err(FeatureError::SizeMismatch { what, got, expected }) }
}

#[cfg(test)]
mod tests {
    use nalgebra::Translation3;

    use super::*;

    /// A flat scene at 0.5 m, its depth pixels 1 mm wide; the colour camera has twice the pixels.
    fn scene(shift: f64) -> ColourImage {
        let depth = DepthImage::new(4, 2, vec![0.5; 8]).unwrap();
        let depth_lens = Intrinsics::new(4, 2, 500.0, 500.0, 2.0, 1.0).unwrap();
        let colour_lens = Intrinsics::new(8, 4, 1000.0, 1000.0, 4.0, 2.0).unwrap();
        let rgb = (0..32u8).flat_map(|i| [i % 8, i / 8, 9]).collect();
        let colour = ColourImage::new(8, 4, rgb).unwrap();
        let colour_from_depth = Isometry3::from_parts(
            Translation3::new(shift, 0.0, 0.0),
            nalgebra::UnitQuaternion::identity(),
        );
        register_colour(&depth, &depth_lens, &colour, &colour_lens, &colour_from_depth).unwrap()
    }

    #[test]
    fn each_point_gets_the_colour_that_the_other_camera_sees_there() {
        let column = |colour: &ColourImage, u: usize| colour.rgb[3 * u..3 * u + 3].to_vec();
        let same = scene(0.0);
        // The centre of depth pixel u is the edge of colour pixel 2 u + 1.
        assert_eq!(column(&same, 0), [1, 1, 9]);
        assert_eq!(column(&same, 3), [7, 1, 9]);
        // A camera 2 mm to the left has every point 2 mm to its right: two pixels of depth.
        let shifted = scene(2e-3);
        assert_eq!(column(&shifted, 0), [5, 1, 9]);
        assert_eq!(column(&shifted, 2), [0, 0, 0], "out of the colour camera's view");
    }

    #[test]
    fn pixels_without_depth_are_black_and_sizes_must_agree() {
        let depth = DepthImage::new(1, 1, vec![0.0]).unwrap();
        let lens = Intrinsics::new(1, 1, 1.0, 1.0, 0.5, 0.5).unwrap();
        let white = ColourImage::new(1, 1, vec![255; 3]).unwrap();
        let here = Isometry3::identity();
        assert_eq!(register_colour(&depth, &lens, &white, &lens, &here).unwrap().rgb, [0; 3]);
        let other = Intrinsics::new(2, 1, 1.0, 1.0, 0.5, 0.5).unwrap();
        let error = register_colour(&depth, &lens, &white, &other, &here).unwrap_err();
        assert!(matches!(error, FeatureError::SizeMismatch { what: "colour image", .. }));
        let odd = ColourImage { rgb: vec![255; 4], ..white };
        let error = register_colour(&depth, &lens, &odd, &lens, &here).unwrap_err();
        assert_eq!(error, FeatureError::LengthMismatch { what: "rgb", got: 4, expected: 3 });
    }
}

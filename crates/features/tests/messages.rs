//! No number in a message of this crate is longer than a number need be.

use granulcal_features::{Camera, FeatureError, HeightMap};

/// Letters of a number in a message.
const LONGEST: usize = 25;

fn check(error: &FeatureError) {
    let text = error.to_string();
    let is_of_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    let longest = text.split(|c| !is_of_number(c)).map(str::len).max().unwrap_or(0);
    assert!(longest <= LONGEST, "{text}");
}

#[test]
fn every_kind_of_message_with_a_number_is_short() {
    let (huge, tiny) = (1e300, 1e-300);
    for error in [
        FeatureError::NonFinite { what: "x", index: 1, got: f64::NAN },
        FeatureError::OutOfRange { what: "x", got: -huge, min: tiny, max: huge },
        FeatureError::NotFlat { on_surface: tiny, least: huge, deviation: huge, scale: "distance" },
        FeatureError::Bump {
            frame: 1,
            place: (1, 2),
            size: (9, 9),
            height: huge,
            ratio: 1.0 / 3e-300,
        },
        FeatureError::EmptyMask {
            valid: 1,
            highest: huge,
            threshold: tiny,
            above: 2,
            cleaned: None,
            extent: Some(Box::new((huge, tiny))),
        },
        FeatureError::DegeneratePlane { got: tiny, min: huge },
        FeatureError::TooSteep { got_deg: huge, max_deg: tiny },
    ] {
        check(&error);
        // The structure has further numbers; those of the message are as %g has them.
        assert!(!error.to_string().contains("000000"), "{error}");
    }
}

#[test]
fn what_is_refused_is_refused_in_few_letters() {
    for wild in [1e300, -1e300, 1e-300, f64::NAN, f64::INFINITY, -1.0 / 3.0] {
        for refused in [
            Camera::overhead(wild, 0.3, 40).err(),
            Camera::overhead(0.4, wild, 40).err(),
            HeightMap::new(2, 2, wild, 1.0, vec![0.0; 4]).err(),
            HeightMap::new(2, 2, 1.0, wild, vec![0.0; 4]).err(),
        ]
        .into_iter()
        .flatten()
        {
            check(&refused);
        }
    }
    assert!(Camera::overhead(-1e300, 0.3, 40).is_err());
}

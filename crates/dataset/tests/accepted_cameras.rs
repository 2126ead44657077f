//! A camera that a scene accepts can take its image: what is refused is refused before the pour.

use granulcal_dataset::{Drawn, capture};
use granulcal_scene::{
    CameraSpec, DepthSensor, NoiseField, Projection, Scene, StereoSensor, TimeOfFlightSensor,
};
use nalgebra::Vector3;

/// A camera of few pixels.
fn small(projection: Projection) -> CameraSpec {
    CameraSpec { projection, pixels: 40, downsample: 4, ..CameraSpec::default() }
}

fn is_accepted(camera: &CameraSpec) -> bool {
    Scene { camera: *camera, ..Scene::drop(0.1) }.check().is_ok()
}

#[test]
fn every_accepted_camera_delivers() {
    let noise = NoiseField { white: 1e-4, correlated: 1e-4, ..NoiseField::default() };
    let stereo = |change: fn(&mut StereoSensor)| {
        let mut sensor = StereoSensor { noise, ..StereoSensor::new(10.0, 0.05) };
        change(&mut sensor);
        DepthSensor::Stereo(sensor)
    };
    let sensors = [
        stereo(|_| {}),
        stereo(|s| s.quantisation = 16.0),
        stereo(|s| s.quantisation = 32.0),
        stereo(|s| s.dropout = 1.0),
        stereo(|s| s.edge_margin = 2e3),
        stereo(|s| s.noise.broad_x = 1e4),
        stereo(|s| s.focal_length = 1e9),
        DepthSensor::TimeOfFlight(TimeOfFlightSensor::new(0.01)),
        DepthSensor::TimeOfFlight(TimeOfFlightSensor::new(1e-9)),
        DepthSensor::TimeOfFlight(TimeOfFlightSensor::new(1e3)),
        DepthSensor::TimeOfFlight(TimeOfFlightSensor {
            depth_unit: 2.0,
            ..TimeOfFlightSensor::new(0.01)
        }),
    ];
    let mut accepted = 0;
    for projection in [Projection::Pinhole, Projection::Orthographic] {
        let mut cameras: Vec<_> = sensors
            .iter()
            .map(|&sensor| CameraSpec { sensor: Some(sensor), ..small(projection) })
            .collect();
        for change in [
            (|c| c.height = 1e-7) as fn(&mut CameraSpec),
            |c| c.height = 1e3,
            |c| c.field_width = 1e4,
            |c| c.blur = 1e4,
            |c| c.depth_noise = 1e4,
            |c| c.downsample = 40,
        ] {
            let mut camera = small(projection);
            change(&mut camera);
            cameras.push(camera);
        }
        for camera in cameras {
            let positions = [Vector3::new(0.0, 0.0, 2e-3)];
            let drawn = Drawn { positions: &positions, radii: &[2e-3], convex: None, bed: None };
            let delivered = capture(&camera, &drawn, 3);
            if is_accepted(&camera) {
                assert!(delivered.is_ok(), "{camera:?}: {delivered:?}");
                accepted += 1;
            }
        }
    }
    assert_eq!(accepted, 11);
}

#[test]
fn a_stereo_sensor_on_an_orthographic_camera_is_refused_by_the_scene() {
    let sensor = DepthSensor::Stereo(StereoSensor::new(390.0, 0.05));
    assert!(is_accepted(&CameraSpec { sensor: Some(sensor), ..small(Projection::Pinhole) }));
    assert!(!is_accepted(&CameraSpec { sensor: Some(sensor), ..small(Projection::Orthographic) }));
}

//! Cameras that come without their scene, checked as a scene checks its own.

use granulcal_scene::{CameraSpec, Scene, ViewSpec};

use crate::DatasetError;

/// Refuses a camera that no scene can have.
pub(crate) fn check_camera(camera: &CameraSpec) -> Result<(), DatasetError> {
    check(&Scene { camera: *camera, ..Scene::drop(0.1) })
}

/// Refuses a further camera that no scene can have, whatever it is called.
pub(crate) fn check_view(view: &ViewSpec) -> Result<(), DatasetError> {
    let view = ViewSpec { name: "view".to_owned(), ..view.clone() };
    check(&Scene { views: vec![view], ..Scene::drop(0.1) })
}

fn check(scene: &Scene) -> Result<(), DatasetError> {
    scene.check().map_err(|source| DatasetError::Features(source.into()))
}

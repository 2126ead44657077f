//! The examples are what the documentation says they are.

use std::path::{Path, PathBuf};

use granulcal_dataset::{CameraFile, Prior, load_prior, load_scene};
use granulcal_scene::Scene;

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

#[test]
fn scenes_and_priors_fit() {
    let funnel = load_scene(&example("funnel.toml")).unwrap();
    assert_eq!(funnel, Scene::funnel(0.12));
    load_scene(&example("drop.toml")).unwrap().check().unwrap();
    for name in ["drum.toml", "mesh_funnel.toml"] {
        load_scene(&example(name)).unwrap();
    }
    let prior = load_prior(&example("prior.toml")).unwrap();
    prior.check(&funnel).unwrap();
    assert_eq!(prior.parameters()[..3], *Prior::default().parameters());
}

#[test]
fn the_camera_is_read() {
    let camera = CameraFile::load(&example("camera.toml")).unwrap();
    let lens = camera.lens.expect("the example has a lens");
    assert_eq!((lens.width, lens.height), (640, 480));
    assert_eq!((camera.segmentation.downsample, camera.segmentation.border_px), (None, 8));
}

//! What every effect must keep to, walked over the one list.

use super::*;
use crate::preset::Preset;
use crate::scene::Scene;

/// Numbers at least one of which turns an effect on, by one of its paths.
const TRIED: [f64; 3] = [0.5, 1.2, 2.0];

fn scene() -> Scene {
    Scene::funnel(0.12)
}

/// The scene with one effect on, by the first of its numbers that does it; by which, and at what.
fn with_one(effect: &dyn Effect) -> (Scene, String) {
    let own = format!("{}.", effect.path());
    let paths = Effects::paths().expect("defaults can be written");
    for path in paths.into_iter().filter(|path| path.starts_with(&own)) {
        for value in TRIED {
            let changed = scene().with(&path, value);
            if let Ok(scene) = changed.as_ref()
                && scene.effects.all().iter().any(|one| one.path() == effect.path() && one.is_on())
            {
                return (scene.clone(), path);
            }
        }
    }
    panic!("no number of {} turns it on", effect.path());
}

#[test]
fn every_effect_has_a_table_of_its_own_and_is_off() {
    let effects = Effects::default();
    let mut paths: Vec<_> = effects.all().iter().map(|effect| effect.path()).collect();
    for (effect, path) in effects.all().into_iter().zip(&paths) {
        assert!(!effect.is_on(), "{path}");
        effect.check().unwrap();
        let table = path.strip_prefix("effects.").expect("below effects");
        toml::from_str::<Effects>(&format!("[{table}]\n")).unwrap();
    }
    let count = paths.len();
    paths.sort_unstable();
    paths.dedup();
    assert_eq!(paths.len(), count);
    assert_eq!(effects.of_contacts(), None);
}

#[test]
fn every_number_of_every_effect_is_checked_by_its_path() {
    for path in Effects::paths().unwrap() {
        for bad in [f64::NAN, f64::INFINITY] {
            let error = scene().with(&path, bad).expect_err(&path).to_string();
            assert!(error.contains(&path), "{path}: {error}");
        }
    }
}

#[test]
fn every_effect_is_turned_on_by_a_number_of_its_own_and_no_other_with_it() {
    for effect in Effects::default().all() {
        let (scene, path) = with_one(effect);
        let on: Vec<_> = scene.effects.all().into_iter().filter(|one| one.is_on()).collect();
        let on: Vec<_> = on.into_iter().map(Effect::path).collect();
        assert_eq!(on, [effect.path()], "{path}");
        assert!(!scene.effects.is_plain());
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene, "{path}");
    }
}

#[test]
fn an_effect_that_changes_contacts_is_refused_by_the_methods_that_do_not_know_it() {
    for effect in Effects::default().all() {
        let (mut scene, path) = with_one(effect);
        scene.preset = Preset::Paper;
        let refused = matches!(
            scene.check(),
            Err(SceneError::EffectNeedsMethod { effect: named, got: "newton_pcr" }) if named == effect.path()
        );
        assert_eq!(refused, effect.changes_contacts(), "{path}");
    }
}

//! Numbers of a scene by their path, for example `material.sliding_friction` or `scene.funnel.height`.
//!
//! A scene as TOML is a tree of tables and lists; a path walks it, entries of lists by their number from 0. `scene.` in
//! front may be left out.

use granulcal_numbers::General;
use toml::{Table, Value};

use crate::error::SceneError;
use crate::scene::Scene;
use crate::toml_fault::in_plain_words;

impl Scene {
    /// A copy with the number at `path` set to `value`, checked like any scene.
    ///
    /// # Errors
    /// [`SceneError::Path`] if the path names no number of a scene, or what the changed scene's check says.
    pub fn with(&self, path: &str, value: f64) -> Result<Self, SceneError> {
        let mut scene = self.clone();
        scene.set(&[(path, value)])?;
        Ok(scene)
    }

    /// Sets several numbers by path; the scene stays as it was if any of them is refused.
    ///
    /// # Errors
    /// As [`Scene::with`].
    pub fn set(&mut self, values: &[(&str, f64)]) -> Result<(), SceneError> {
        let mut tree = self.tree()?;
        for &(path, value) in values {
            insert(&mut tree, path, value).map_err(|error| self.with_hint(error, &[path]))?;
        }
        let paths: Vec<_> = values.iter().map(|(path, _)| *path).collect();
        let mut changed: Self = Value::Table(tree).try_into().map_err(|e: toml::de::Error| {
            self.with_hint(not_a_scene(&paths.join(", "), &in_plain_words(e.message())), &paths)
        })?;
        changed.take_meshes(self);
        changed.check()?;
        *self = changed;
        Ok(())
    }

    /// An error with the whole path that the first of `paths` which is none may be the end of.
    fn with_hint(&self, error: SceneError, paths: &[&str]) -> SceneError {
        match (error, paths.iter().find_map(|path| self.path_that_ends_so(path))) {
            (SceneError::Path { path, reason }, Some(whole)) => {
                SceneError::Path { path, reason: format!("{reason}; did you mean \"{whole}\"?") }
            }
            (error, _) => error,
        }
    }

    /// The shortest path of a number of this scene, or of an effect that is off, of which `path` is the end alone.
    fn path_that_ends_so(&self, path: &str) -> Option<String> {
        let mut tree = self.tree().ok()?;
        tree.insert(EFFECTS.to_owned(), self.effects.tables().ok()?.into());
        let mut all = Vec::new();
        number_paths("", &Value::Table(tree), &mut all);
        let path: Vec<_> = keys(path).collect();
        let end = format!(".{}", path.join("."));
        if all.iter().any(|whole| *whole == end[1..]) {
            return None;
        }
        all.retain(|whole| whole.ends_with(&end));
        all.into_iter().min_by_key(|whole| whole.matches('.').count())
    }

    /// The number at `path`.
    ///
    /// # Errors
    /// [`SceneError::Path`] if nothing or no number stands there.
    pub fn get(&self, path: &str) -> Result<f64, SceneError> {
        // Known also where the scene states a volume in its place.
        if keys(path).eq(["grains", "count"]) {
            return Ok(self.grains.count as f64);
        }
        // Known also where the preset states it.
        if keys(path).eq(["substep"]) {
            return Ok(self.settings().dt);
        }
        let mut tree = self.tree()?;
        if keys(path).next() == Some(EFFECTS) {
            // Those that are off are left out of a scene, and their numbers are known all the same.
            tree.insert(EFFECTS.to_owned(), self.effects.tables()?.into());
        }
        let mut found = &Value::Table(tree);
        for key in keys(path) {
            found = match found {
                Value::Table(table) => table.get(key).ok_or_else(|| {
                    let here: Vec<_> = table.keys().map(String::as_str).collect();
                    path_error(path, &format!("no {key:?} here, only {}", here.join(", ")))
                })?,
                Value::Array(entries) => &entries[entry(path, key, entries.len())?],
                other => {
                    return Err(path_error(path, &format!("a {} stands there", other.type_str())));
                }
            };
        }
        match found {
            Value::Float(number) => Ok(*number),
            Value::Integer(number) => Ok(*number as f64),
            other => Err(path_error(path, &format!("a {} stands there", other.type_str()))),
        }
    }

    /// The path of the first thing in which another scene differs, with what stands there in this one and in the
    /// other; `None` if the two are the same scene.
    ///
    /// # Errors
    /// [`SceneError::TomlWrite`] if a number cannot be written.
    pub fn first_difference(
        &self,
        other: &Self,
    ) -> Result<Option<(String, String, String)>, SceneError> {
        let (here, there) = (Value::Table(self.tree()?), Value::Table(other.tree()?));
        Ok(first_difference("", Some(&here), Some(&there)))
    }

    fn tree(&self) -> Result<Table, SceneError> {
        Table::try_from(self).map_err(|e| SceneError::TomlWrite(Box::new(e)))
    }
}

/// Adds the paths of all numbers of a tree that stands at `path`.
fn number_paths(path: &str, tree: &Value, all: &mut Vec<String>) {
    let at = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match tree {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| number_paths(&at(key), value, all));
        }
        Value::Array(entries) => {
            let numbered = entries.iter().enumerate();
            numbered.for_each(|(number, value)| number_paths(&at(&number.to_string()), value, all));
        }
        Value::Float(_) | Value::Integer(_) => all.push(path.to_owned()),
        _ => {}
    }
}

/// The first thing in which two trees differ, which stand at `path`: its own path and both values.
pub fn first_difference(
    path: &str,
    left: Option<&Value>,
    right: Option<&Value>,
) -> Option<(String, String, String)> {
    let at = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (left, right) {
        _ if left == right => None,
        (Some(Value::Table(a)), Some(Value::Table(b))) => {
            // Of a file whose content is known by its hash the place does not count.
            let is_known = a.contains_key("hash") && a.get("hash") == b.get("hash");
            let counts = |key: &&String| !(is_known && *key == "file");
            let mut keys =
                a.keys().chain(b.keys().filter(|key| !a.contains_key(*key))).filter(counts);
            keys.find_map(|key| first_difference(&at(key), a.get(key), b.get(key)))
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) => {
            let mut entries = 0..a.len().max(b.len());
            entries.find_map(|n| first_difference(&at(&n.to_string()), a.get(n), b.get(n)))
        }
        _ => {
            let show = |value: Option<&Value>| value.map_or("absent".to_owned(), shown);
            Some((path.to_owned(), show(left), show(right)))
        }
    }
}

/// A value in a message. Numbers are exact, for what differs may differ in the last digit; `{:?}` has an exponent where
/// that is shorter.
fn shown(value: &Value) -> String {
    match value {
        Value::Float(number) => format!("{number:?}"),
        Value::Array(entries) => {
            format!("[{}]", entries.iter().map(shown).collect::<Vec<_>>().join(", "))
        }
        Value::Table(table) => {
            let entry = |(key, value): (&String, &Value)| format!("{key} = {}", shown(value));
            format!("{{ {} }}", table.iter().map(entry).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// Tables that a scene leaves out where they say nothing.
const MATERIAL: &str = "material";
const GROUND: &str = "ground";
const EFFECTS: &str = "effects";

fn keys(path: &str) -> impl Iterator<Item = &str> {
    path.strip_prefix("scene.").unwrap_or(path).split('.')
}

fn path_error(path: &str, reason: &str) -> SceneError {
    SceneError::Path { path: path.to_owned(), reason: reason.to_owned() }
}

/// What a changed scene's text is refused for: a key that is none, or a value that nothing there can be.
fn not_a_scene(paths: &str, message: &str) -> SceneError {
    let is_of_value = ["invalid value", "invalid type", "volume of grains"];
    if is_of_value.iter().any(|begin| message.starts_with(begin)) {
        SceneError::Value { path: paths.to_owned(), reason: format!("is refused: {message}") }
    } else {
        path_error(paths, message)
    }
}

/// Puts `value` at `path`. A missing number or table of coefficients is created, and whether it may exist
/// is the scene's to say; other missing tables are not: a height must not conjure up a funnel.
fn insert(tree: &mut Table, path: &str, value: f64) -> Result<(), SceneError> {
    let keys: Vec<&str> = keys(path).collect();
    let Some((last, first)) = keys.split_last() else { return Err(path_error(path, "is empty")) };
    // An entry of a list stands where a number of a table does.
    let mut table = tree;
    let mut first = first.iter().copied().peekable();
    let mut is_effect = false;
    while let Some(key) = first.next() {
        let may_be_new = [MATERIAL, GROUND, EFFECTS].contains(&key) || is_effect;
        if !table.contains_key(key) && !may_be_new {
            return Err(path_error(path, &format!("this scene has no {key:?}")));
        }
        is_effect = key == EFFECTS;
        let mut here = table.entry(key.to_owned()).or_insert_with(|| Value::Table(Table::new()));
        while let Value::Array(entries) = here {
            let count = entries.len();
            let Some(number) = first.next() else {
                let number = &mut entries[entry(path, last, count)?];
                return set_number(path, number, value);
            };
            here = &mut entries[entry(path, number, count)?];
        }
        let kind = here.type_str();
        table = here
            .as_table_mut()
            .ok_or_else(|| path_error(path, &format!("{key:?} is a {kind}, not a table")))?;
    }
    // A scene takes a whole number for either kind; which one belongs here its tree does not say.
    let is_whole = value.fract() == 0.0 && value.abs() < LARGEST_WHOLE;
    let new = if is_whole { Value::Integer(value as i64) } else { Value::Float(value) };
    if let Some(there) = table.get_mut(*last) {
        return set_number(path, there, value);
    }
    table.insert((*last).to_owned(), new);
    Ok(())
}

/// From here on not every whole number is a number of double precision.
const LARGEST_WHOLE: f64 = 9_007_199_254_740_992.0;

/// Replaces a number by another; a whole number, of which a scene has none below 0, stays one.
fn set_number(path: &str, place: &mut Value, value: f64) -> Result<(), SceneError> {
    *place = match place {
        Value::Integer(_) if value.fract() == 0.0 && (0.0..LARGEST_WHOLE).contains(&value) => {
            Value::Integer(value as i64)
        }
        Value::Integer(_) if value.fract() == 0.0 => {
            let reason =
                format!("must be a whole number from 0 to below 2^53, got {}", General(value));
            return Err(SceneError::Value { path: path.to_owned(), reason });
        }
        Value::Integer(_) => {
            return Err(SceneError::NotWhole { path: path.to_owned(), got: value });
        }
        Value::Float(_) => Value::Float(value),
        other => {
            let reason = format!("a {} stands there, not a number", other.type_str());
            return Err(path_error(path, &reason));
        }
    };
    Ok(())
}

/// A key as the number of one of `count` entries of a list.
fn entry(path: &str, key: &str, count: usize) -> Result<usize, SceneError> {
    let number = key.parse().ok().filter(|&number| number < count);
    number.ok_or_else(|| {
        path_error(path, &format!("{key:?} must be one of {count} entries, counted from 0"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Motion, Preset, Shape, Wall, WallMaterial};

    #[test]
    fn sets_and_gets_by_path() {
        let scene = Scene::funnel(0.12);
        let changed = scene.with("material.sliding_friction", 0.25).unwrap();
        assert_eq!(changed.material.sliding_friction, 0.25);
        let changed = changed.with("scene.funnel.height", 0.05).unwrap();
        assert_eq!(changed.get("funnel.height").unwrap(), 0.05);
        assert_eq!(changed.with("grains.count", 100.0).unwrap().grains.count, 100);
        let ground = scene.with("scene.ground.material.restitution", 0.1).unwrap();
        assert_eq!(ground.ground.material.restitution, Some(0.1));
    }

    #[test]
    fn the_end_of_a_path_is_told_with_its_begin() {
        let scene = Scene::funnel(0.12);
        for (end, whole) in [
            ("diameter", "grains.diameter"),
            ("polydispersity.cv", "effects.polydispersity.cv"),
            ("sliding_friction", "material.sliding_friction"),
            ("stem_radius", "funnel.stem_radius"),
        ] {
            let said = scene.with(end, 0.004).unwrap_err().to_string();
            assert!(said.contains(&format!("did you mean \"{whole}\"?")), "{said}");
        }
        for none in ["grains.width", "walls.0.material.restitution", "", "grains"] {
            let said = scene.with(none, 0.004).unwrap_err().to_string();
            assert!(!said.contains("did you mean"), "{said}");
        }
        // Of several that are set the one that is none.
        let values = [("grains.diameter", 0.003), ("cv", 0.1)];
        let said = scene.clone().set(&values).unwrap_err().to_string();
        assert!(said.contains("did you mean \"effects.polydispersity.cv\"?"), "{said}");
    }

    #[test]
    fn a_substep_is_finer_than_the_presets() {
        let scene = Scene::funnel(0.12);
        let own = scene.preset.settings();
        assert_eq!(scene.get("substep").unwrap(), own.dt);
        let finer = scene.with("substep", 0.3 * own.dt).unwrap();
        assert_eq!((finer.settings().dt, finer.settings().sweeps), (0.3 * own.dt, own.sweeps));
        assert_eq!(Scene::from_toml(&finer.to_toml().unwrap()).unwrap(), finer);
        for wrong in [0.0, -1e-4, f64::NAN, 1.1 * own.dt] {
            let error = scene.with("substep", wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("substep must be positive and at most the preset's"),
                "{error}"
            );
            for preset in Preset::ALL {
                let steps_a_second = (1.0 / preset.settings().dt).round();
                let said = [
                    format!("1/{steps_a_second} of {preset}"),
                    format!("1/{steps_a_second} s of {preset}"),
                ];
                assert!(said.iter().any(|words| error.contains(words)), "{preset}: {error}");
            }
        }
        // 1 / 3333 s fits `default` and not `accurate`.
        assert!(
            Scene { preset: Preset::Accurate, ..finer.with("substep", 3e-4).unwrap() }
                .check()
                .is_err()
        );
    }

    #[test]
    fn entries_of_lists_have_numbers() {
        let mut scene = Scene::funnel(0.12);
        let shape = Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
        let motion = Motion::Lift { velocity: [0.0, 0.0, 0.1], begin: 0.5, end: 1.0 };
        scene.walls.push(Wall { motion, ..Wall::fixed(shape, WallMaterial::default()) });
        let changed = scene.with("walls.0.motion.velocity.2", 0.3).unwrap();
        assert_eq!(changed.get("scene.walls.0.motion.velocity.2").unwrap(), 0.3);
        assert_eq!(
            changed.with("walls.0.motion.end", 2.0).unwrap().get("walls.0.motion.end").unwrap(),
            2.0
        );
        let tilted = scene.with("gravity.0", 1.0).unwrap();
        assert_eq!(tilted.gravity, [1.0, 0.0, -9.81]);
        let stone = scene.with("walls.0.material.restitution", 0.2).unwrap();
        assert_eq!(stone.walls[0].material.restitution, Some(0.2));
        for path in ["walls.1.motion.end", "gravity.3", "gravity.x", "gravity", "walls.0"] {
            assert!(matches!(scene.with(path, 1.0), Err(SceneError::Path { .. })), "{path}");
            assert!(scene.get(path).is_err(), "{path}");
        }
    }

    #[test]
    fn the_first_difference_has_a_path() {
        let scene = Scene::funnel(0.12);
        let difference = |other: &Scene| scene.first_difference(other).unwrap();
        assert_eq!(difference(&scene), None);
        let changed = scene.with("funnel.height", 0.05).unwrap();
        let expected = ("funnel.height".to_owned(), "0.12".to_owned(), "0.05".to_owned());
        assert_eq!(difference(&changed), Some(expected));
        let mut sideways = scene.clone();
        sideways.gravity[1] = 1.0;
        let expected = ("gravity.1".to_owned(), "0.0".to_owned(), "1.0".to_owned());
        assert_eq!(difference(&sideways), Some(expected));
        let mut rough = scene.clone();
        rough.ground.material.restitution = Some(0.1);
        let (path, here, _) = difference(&rough).unwrap();
        assert_eq!((path.as_str(), here.as_str()), ("ground", "absent"));
    }

    #[test]
    fn refuses_what_is_no_number_of_a_scene() {
        let mut scene = Scene::drop(0.1);
        for path in [
            "material.friction",
            "scene.start.kind",
            "name",
            "nothing.at.all",
            "",
            "preset.x",
            "funnel.height",
        ] {
            let error = scene.with(path, 0.1).unwrap_err();
            assert!(matches!(error, SceneError::Path { .. }), "{path}: {error}");
        }
        for (value, told) in [
            (1.5, "grains.count must be a whole number, got 1.5"),
            (-1.0, "grains.count must be a whole number from 0 to below 2^53, got -1"),
            (f64::NAN, "grains.count must be a whole number, got NaN"),
        ] {
            assert_eq!(scene.with("grains.count", value).unwrap_err().to_string(), told);
        }
        let spheres = scene.set(&[("effects.clump.aspect", 2.5), ("effects.clump.spheres", -1.0)]);
        let told = spheres.unwrap_err().to_string();
        assert!(told.contains("effects.clump.spheres is refused: invalid value"), "{told}");
    }

    #[test]
    fn a_whole_number_of_an_effect_that_is_not_there_yet_is_one() {
        let mut scene = Scene::drop(0.1);
        let aspect = ("effects.clump.aspect", 2.5);
        scene.set(&[aspect, ("effects.clump.spheres", 4.0)]).unwrap();
        assert_eq!(scene.effects.clump.spheres, 4);
        assert_eq!(scene.get("effects.clump.spheres").unwrap(), 4.0);
        assert_eq!(scene.get("effects.tilt.x").unwrap(), 0.0);
        assert!(scene.get("effects.tilt").is_err() && scene.get("effects.tilted.x").is_err());
        assert!(scene.set(&[("effects.clump.spheres", 2.5)]).is_err());
        let mut round = Scene::drop(0.1);
        assert!(round.set(&[aspect, ("effects.clump.spheres", 2.5)]).is_err());
        assert_eq!(round.with("effects.tilt.x", 0.0).unwrap(), round);
        assert!(scene.with("material.restitution", 1.5).is_err());
        assert!(scene.get("material.friction").is_err());
        assert!(scene.get("material").is_err());
    }
}

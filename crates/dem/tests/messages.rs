//! No number in a message is longer than a number need be: every number of a scene is made huge, tiny and not a number.

use std::error::Error;

use granulcal_dem::{DemError, Scene, SceneError};
use toml::Value;

/// Letters of a number in a message: sign, 17 digits that tell it from every other, a dot, an exponent.
const LONGEST: usize = 25;

const WILD: [f64; 9] =
    [1e300, -1e300, 1e-300, -1e-300, 1.0 / 3e9, 1e15 / 7.0, f64::NAN, f64::INFINITY, 0.1 + 0.2];

/// Paths of all numbers below `value`.
fn paths(value: &Value, at: &str, found: &mut Vec<String>) {
    let below = |key: &str| if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") };
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| paths(value, &below(key), found));
        }
        Value::Array(entries) => {
            for (number, entry) in entries.iter().enumerate().take(3) {
                paths(entry, &below(&number.to_string()), found);
            }
        }
        Value::Integer(_) | Value::Float(_) => found.push(at.to_owned()),
        _ => {}
    }
}

fn message(error: &DemError) -> String {
    let mut text = error.to_string();
    let mut cause: &dyn Error = error;
    while let Some(next) = cause.source() {
        text.push_str(": ");
        text.push_str(&next.to_string());
        cause = next;
    }
    text
}

/// The longest run of letters that may be one number.
fn longest_number(text: &str) -> usize {
    let is_of_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    text.split(|c| !is_of_number(c)).map(str::len).max().unwrap_or(0)
}

fn check(text: &str, of: &str) {
    assert!(longest_number(text) <= LONGEST, "{of}: {text}");
}

fn scenes() -> Vec<Scene> {
    let examples = ["column", "hopper", "drum", "bowl", "hopper_round"].map(|name| {
        let path = format!("{}/../../examples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Scene::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap()
    });
    let mut all = vec![Scene::funnel(0.12), Scene::drop(0.1)];
    all.extend(examples);
    all
}

#[test]
fn every_number_of_a_scene_is_refused_in_few_letters() {
    let (mut refused, mut taken) = (0, 0);
    for scene in scenes() {
        let tree: toml::Table = scene.to_toml().unwrap().parse().unwrap();
        let mut all = Vec::new();
        paths(&Value::Table(tree), "", &mut all);
        assert!(all.len() > 15, "{}: {all:?}", scene.name);
        // Numbers that are left out where they say nothing.
        let unstated = ["material.softness", "ground.material.restitution", "effects.tilt.x"];
        all.extend(unstated.map(str::to_owned));
        for path in all {
            for value in WILD {
                let of = format!("{} {path} = {value:e}", scene.name);
                match scene.with(&path, value) {
                    Err(error) => {
                        check(&message(&error.into()), &of);
                        refused += 1;
                    }
                    Ok(changed) => {
                        if let Some((_, here, there)) = scene.first_difference(&changed).unwrap() {
                            check(&format!("{here} {there}"), &of);
                        }
                        taken += 1;
                    }
                }
            }
        }
    }
    assert!(refused > 500 && taken > 100, "{refused} {taken}");
}

#[test]
fn every_kind_of_message_with_a_number_is_short() {
    let value = 1e300;
    for error in [
        SceneError::OutOfRange { name: "x".to_owned(), got: value, allowed: "small" }.into(),
        DemError::StartInWall { wall: "w".to_owned(), grains: 3, depth: value, allowed: 1e-300 },
        DemError::StartBelowOutflow { grains: 3, below: -value },
    ] {
        check(&error.to_string(), "variant");
        assert!(error.to_string().contains("1e300"), "{error}");
    }
}

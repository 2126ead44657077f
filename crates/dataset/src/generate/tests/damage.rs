//! What is damaged or of something else is named, and nothing of it is read.

use std::fs;

use super::*;

#[test]
fn folders_of_something_else_are_refused_and_left_alone() {
    let place = Place::new();
    place.make("a", &options(5));
    let path = place.at("a");
    let run = |scene: &Scene, prior: &Prior, options: &GenerateOptions| {
        generate(scene, prior, options, &path, &mut |_| true).unwrap_err().to_string()
    };
    let before = fs::read(path.join("manifest.toml")).unwrap();
    let other_scene = small().with("material.restitution", 0.25).unwrap();
    assert!(
        run(&other_scene, &Prior::default(), &options(5)).contains("scene.material.restitution")
    );
    let other_prior = Prior::new(Prior::default().parameters()[..1].to_vec()).unwrap();
    assert!(run(&small(), &other_prior, &options(5)).contains("the prior"));
    let other_seed = GenerateOptions { seed: 4, ..options(5) };
    assert!(run(&small(), &Prior::default(), &other_seed).contains("the seed is 3, but 4"));
    let fresh = GenerateOptions { resume: false, ..options(5) };
    assert!(run(&small(), &Prior::default(), &fresh).contains("empty unless resumed"));
    assert_eq!(fs::read(path.join("manifest.toml")).unwrap(), before);

    let wide = Prior::from_toml(
        "[[parameter]]\npath = \"material.restitution\"\ndistribution = \"uniform\"\nlow = 0.5\nhigh = 1.5",
    );
    let absent = place.at("absent");
    let error =
        generate(&small(), &wide.unwrap(), &options(5), &absent, &mut |_| true).unwrap_err();
    assert!(
        error.to_string().contains("material.restitution") && error.to_string().contains("1.5")
    );
    assert!(!absent.exists());
}

#[test]
fn damaged_parts_are_named_and_leftovers_removed() {
    let place = Place::new();
    place.make("a", &options(5));
    let path = place.at("a");
    fs::write(path.join(".part-000009.parquet.123.tmp"), b"half").unwrap();
    let part = path.join("part-000000.parquet");
    let whole = fs::read(&part).unwrap();
    let mut messages = Vec::new();
    for bytes in [&whole[..whole.len() / 2], &whole[..3], b"not a table"] {
        fs::write(&part, bytes).unwrap();
        let error = generate(&small(), &Prior::default(), &options(5), &path, &mut |_| true);
        let error = error.unwrap_err();
        assert!(error.is_bad_input());
        messages.push(error.to_string());
        assert!(Dataset::open(&path).is_err());
    }
    assert!(messages.iter().all(|m| m.contains("part-000000.parquet")), "{messages:?}");
    assert!(!path.join(".part-000009.parquet.123.tmp").exists());

    // A part of another place in the same data set.
    fs::write(&part, fs::read(path.join("part-000001.parquet")).unwrap()).unwrap();
    let error = generate(&small(), &Prior::default(), &options(5), &path, &mut |_| true);
    let DatasetError::Part { source, .. } = error.unwrap_err() else { panic!("of the part") };
    assert!(source.to_string().contains("column row"));
}

#[test]
fn all_that_is_damaged_is_named_at_once() {
    let place = Place::new();
    for (name, text) in [("left", "0/2"), ("right", "1/2")] {
        place.make(name, &GenerateOptions { shard: text.parse().unwrap(), ..options(10) });
    }
    let bad = ["left/part-000000.parquet", "left/part-000002.parquet", "right/part-000001.parquet"];
    for part in bad {
        fs::write(place.at(part), b"not a table").unwrap();
    }
    let names = |error: DatasetError, expected: &[&str]| {
        assert!(error.is_bad_input());
        let text = error.to_string();
        let all = bad.iter().chain(&["nothing", "none"]);
        let named: Vec<_> = all.filter(|name| text.contains(*name)).copied().collect();
        assert_eq!(named, expected, "{text}");
    };
    let merged = |inputs: &[&str]| {
        let inputs: Vec<_> = inputs.iter().map(|name| place.at(name)).collect();
        merge(&inputs, &place.at("all.parquet"), 5).unwrap_err()
    };
    names(merged(&["left", "right"]), &bad);
    names(merged(&["nothing", "right", "none"]), &["nothing", "none"]);
    names(Dataset::open(&place.at("left")).unwrap_err(), &bad[..2]);
    let again = GenerateOptions { shard: "0/2".parse().unwrap(), ..options(10) };
    let (prior, left) = (Prior::default(), place.at("left"));
    let error = generate(&small(), &prior, &again, &left, &mut |_| true).unwrap_err();
    assert_eq!(error.to_string().matches("its rows are made again").count(), 2);
    names(error, &bad[..2]);
    assert!(!place.at("all.parquet").exists());
}

#[test]
fn only_a_part_of_the_right_name_is_one() {
    let place = Place::new();
    place.make("a", &options(8));
    let part = place.at("a/part-000001.parquet");
    for name in ["part-1.parquet", "part-+00001.parquet", "part-0000001.parquet"] {
        fs::copy(&part, place.at("a").join(name)).unwrap();
    }
    let progress = place.make("a", &options(8)).progress;
    assert_eq!((progress.total, progress.resumed, progress.made), (8, 8, 0));
    assert_eq!(Dataset::open(&place.at("a")).unwrap().rows.len(), 8);
}

#[test]
fn one_flipped_bit_is_found_or_changes_nothing() {
    let place = Place::new();
    place.make("whole", &options(4));
    let part = place.at("whole").join("part-000000.parquet");
    let bytes = fs::read(&part).unwrap();
    let rows = table::read(&part).unwrap().rows;
    let mut refused = Vec::new();
    for i in 0..400 {
        let mut flipped = bytes.clone();
        flipped[i * bytes.len() / 400] ^= 1 << (i % 8);
        fs::write(&part, flipped).unwrap();
        match table::read(&part) {
            Err(error) => {
                assert!(error.to_string().contains("part-000000"), "{error}");
                refused.push(i);
            }
            // Padding, statistics that nobody reads, or the name of the hash.
            Ok(read) => {
                assert_eq!(read.rows.len(), rows.len());
                let same =
                    |(a, b): (&Row, &Row)| a.same_as(b) && a.cpu_s.to_bits() == b.cpu_s.to_bits();
                assert!(read.rows.iter().zip(&rows).all(same), "bit {i}");
            }
        }
    }
    assert!(refused.len() > 100, "{} of 400", refused.len());
    // What resumes, merges or loads reads by the same function.
    let mut flipped = bytes.clone();
    let i = refused[0];
    flipped[i * bytes.len() / 400] ^= 1 << (i % 8);
    fs::write(&part, flipped).unwrap();
    let resumed =
        generate(&small(), &Prior::default(), &options(4), &place.at("whole"), &mut |_| true);
    assert!(resumed.is_err() && Dataset::open(&place.at("whole")).is_err());
    let out = place.at("merged.parquet");
    assert!(merge(&[place.at("whole")], &out, 5).is_err() && !out.exists());
}

//! What is said of a model is what NumPy and PyTorch said of it (data/reference.json, see data/make_models.py).

use std::fs;
use std::path::{Path, PathBuf};

use granulcal_bayessim::{Model, Warning};
use serde_json::Value;

/// Agreement asked for [nat].
const TOLERANCE: f64 = 1e-5;

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn reference() -> Value {
    serde_json::from_str(&fs::read_to_string(data().join("reference.json")).unwrap()).unwrap()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

#[test]
fn densities_are_those_of_python() {
    let reference = reference();
    let (theta, x) = (rows(&reference["theta"]), rows(&reference["x"]));
    for method in ["mdrff", "auto", "arithmetic"] {
        let model = Model::load(&data().join(method)).unwrap();
        for (pour, expected) in x.iter().zip(rows(&reference[method]["log_prob"])) {
            let posterior = model.posterior(std::slice::from_ref(pour)).unwrap();
            for (at, expected) in theta.iter().zip(expected) {
                let found = posterior.log_prob(at).unwrap();
                assert!((found - expected).abs() < TOLERANCE, "{method}: {found} {expected}");
            }
        }
    }
}

#[test]
fn draws_have_the_mean_of_python() {
    let reference = reference();
    let x = rows(&reference["x"]);
    for method in ["mdrff", "auto", "arithmetic"] {
        let model = Model::load(&data().join(method)).unwrap();
        for (pour, expected) in x.iter().zip(rows(&reference[method]["mean"])) {
            let posterior = model.posterior(std::slice::from_ref(pour)).unwrap();
            for (marginal, expected) in posterior.marginals(20_000, 1).unwrap().iter().zip(expected)
            {
                let (low, high) = marginal.interval90;
                let close = 0.05 * (high - low);
                let found = marginal.mean;
                assert!((found - expected).abs() < close, "{method}: {found} {expected}");
                assert!(low < marginal.median && marginal.median < high);
            }
        }
    }
}

#[test]
fn several_pours_are_one_posterior() {
    let reference = reference();
    let (theta, x) = (rows(&reference["theta"]), rows(&reference["repeated"]));
    let model = Model::load(&data().join("auto")).unwrap();
    let posterior = model.posterior(&x).unwrap();
    let expected: Vec<f64> =
        serde_json::from_value(reference["repeated_log_prob"].clone()).unwrap();
    let offset = posterior.log_prob(&theta[0]).unwrap() - expected[0];
    // The normaliser of so narrow a density is by random draws on both sides.
    assert!(offset.abs() < 0.1, "{offset}");
    for (at, expected) in theta.iter().zip(expected) {
        assert!((posterior.log_prob(at).unwrap() - expected - offset).abs() < TOLERANCE);
    }
    // A network's posteriors are multiplied over the prior: more is known than from each.
    let network = Model::load(&data().join("mdrff")).unwrap();
    let spread = |x: &[Vec<f64>]| {
        let marginals = network.posterior(x).unwrap().marginals(10_000, 1).unwrap();
        let (low, high) = marginals[0].interval90;
        high - low
    };
    let singles: Vec<f64> = x.iter().map(|row| spread(std::slice::from_ref(row))).collect();
    let widest = singles.iter().copied().fold(0.0, f64::max);
    assert!(spread(&x) < 0.95 * widest, "{} {singles:?}", spread(&x));
}

#[test]
fn draws_stay_inside_the_prior_and_repeat_with_their_seed() {
    let x = rows(&reference()["x"]);
    let model = Model::load(&data().join("auto")).unwrap();
    let posterior = model.posterior(&x[..1]).unwrap();
    let draws = posterior.sample(2000, 7);
    assert_eq!(draws, posterior.sample(2000, 7));
    assert_ne!(draws, posterior.sample(2000, 8));
    let asked = std::cell::Cell::new(0);
    let twice = || {
        asked.set(asked.get() + 1);
        asked.get() < 2
    };
    assert!(posterior.coordinate_sample_while(1_000_000_000, 7, &twice).is_none());
    assert_eq!(asked.get(), 2);
    let inside =
        |d: &Vec<f64>| (-1.0..=3.0).contains(&d[0]) && (0.001..=1.0).contains(&d[1]) && d[2] >= 0.0;
    assert!(draws.iter().all(inside));
}

#[test]
fn a_density_is_zero_outside_the_prior_and_refused_where_nothing_is() {
    let x = rows(&reference()["x"]);
    for method in ["mdrff", "auto", "arithmetic"] {
        let model = Model::load(&data().join(method)).unwrap();
        let posterior = model.posterior(&x[..1]).unwrap();
        let inf = f64::INFINITY;
        // The second is positive: neither 0 nor a negative number has a logarithm.
        for theta in
            [[5.0, 0.1, 1.0], [0.5, 0.0, 1.0], [0.5, -0.1, 1.0], [0.5, 0.1, inf], [-inf, 0.1, 1.0]]
        {
            let found = posterior.log_prob(&theta).unwrap();
            assert_eq!(found, f64::NEG_INFINITY, "{method}: {theta:?}");
        }
        let refuse = |theta: &[f64]| posterior.log_prob(theta).unwrap_err().to_string();
        assert!(refuse(&[0.5, 0.1]).contains("the parameters must be 3 numbers"));
        assert!(refuse(&[0.5, 0.1, 1.0, 1.0]).ends_with("got 4"));
        let nan = refuse(&[0.5, f64::NAN, 1.0]);
        assert!(nan.ends_with(&format!("got {} = NaN", posterior.names()[1])), "{nan}");
        assert!(posterior.coordinate_log_prob(&[0.5, 0.5]).is_err());
        assert!(posterior.coordinate_log_prob(&[0.5, 0.5, f64::NAN]).is_err());
        let many = posterior.coordinate_log_probs(&[vec![0.5; 3], vec![0.5; 2]]);
        assert!(many.unwrap_err().to_string().contains("the coordinates must be 3 numbers"));
        let none = posterior.marginals(0, 1).unwrap_err().to_string();
        assert_eq!(none, "the number of draws must be at least 1, got 0");
        let shown = format!("{posterior:?}");
        assert!(shown.contains("Posterior") && shown.len() < 500, "{shown}");
    }
}

#[test]
fn bad_observations_are_named() {
    let x = rows(&reference()["x"]);
    let model = Model::load(&data().join("auto")).unwrap();
    let refuse = |x: &[Vec<f64>]| match model.posterior(x) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("taken"),
    };
    assert!(refuse(&[vec![1.0; 4]]).contains("5 statistics, got 4"));
    assert!(refuse(&[]).contains("at least one pour"));
    assert!(refuse(&[vec![1.0, f64::NAN, 1.0, 1.0, 1.0]]).contains("statistic_1 = NaN"));
    let far = model.posterior(&x[3..]).unwrap();
    assert!(matches!(&far.warnings[0], Warning::OutOfRange { value, .. } if *value == 99.0));
    assert!(far.warnings[0].to_string().contains("statistic_0"));
}

#[test]
fn damaged_models_are_named() {
    let place = tempfile::tempdir().unwrap();
    let copy = |name: &str| {
        fs::copy(data().join("auto").join(name), place.path().join(name)).unwrap();
    };
    let refuse = || {
        let error = Model::load(place.path()).unwrap_err();
        let cause = std::error::Error::source(&error).map_or_else(String::new, ToString::to_string);
        format!("{error}: {cause}")
    };
    assert!(refuse().contains("model.json"));
    copy("model.json");
    assert!(refuse().contains("weights.safetensors"));
    copy("weights.safetensors");
    Model::load(place.path()).unwrap();

    let weights = place.path().join("weights.safetensors");
    let whole = fs::read(&weights).unwrap();
    fs::write(&weights, &whole[..whole.len() - 9]).unwrap();
    assert!(refuse().contains("truncated"));
    copy("weights.safetensors");

    let document = place.path().join("model.json");
    let text = fs::read_to_string(&document).unwrap();
    for (from, to, expected) in [
        ("\"version\": 4", "\"version\": 9", "must be 3 or 4, got 9"),
        ("\"version\": 4", "\"version\": 9", "update granulcal"),
        ("\"version\": 4", "\"version\": 2", "train the model again"),
        ("granulcal-bayessim", "something", "granulcal-bayessim"),
        ("\"axis_count\": 5", "\"axis_count\": 4", "emulator_leading_root"),
        ("\"axis_count\": 5", "\"axis_count\": 6", "axis_count"),
        ("\"emulator_weight\": 0.7", "\"emulator_weight\": -0.7", "emulator_weight"),
        ("\"network_weight\": 0.4", "\"network_weight\": -0.4", "network_weight"),
        ("\"has_network\": true", "\"has_network\": false", "network_weight"),
        ("\"average\": \"geometric\"", "\"average\": \"harmonic\"", "harmonic"),
        ("\"average\"", "\"mean\"", "missing field `average`"),
        ("\"network_weight\"", "\"weight\"", "missing field `network_weight`"),
        ("log_uniform", "cauchy", "prior"),
        ("\"x_names\"", "\"y_names\"", "x_names"),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(&document, text.replace(from, to)).unwrap();
        let message = refuse();
        assert!(message.contains(expected), "{from} -> {to}: {message}");
    }
    fs::write(&document, &text[..100]).unwrap();
    let message = refuse();
    assert!(message.contains("model.json"), "{message}");
    // The cause is told, and told once.
    assert_eq!(message.matches("EOF while parsing").count(), 1, "{message}");
}

#[test]
fn a_single_flipped_bit_is_found_where_there_are_hashes() {
    let place = tempfile::tempdir().unwrap();
    let read = |name: &str| fs::read(data().join("mdrff").join(name)).unwrap();
    let (document, weights) = (read("model.json"), read("weights.safetensors"));
    // As Python writes them.
    let tensors = safetensors::SafeTensors::deserialize(&weights).unwrap();
    let hash = |bytes: &[u8]| format!("{:032x}", xxhash_rust::xxh3::xxh3_128(bytes));
    let mut hashes = std::collections::HashMap::new();
    hashes.insert("hash.model.json".to_owned(), hash(&document));
    for (name, tensor) in tensors.tensors() {
        let head = format!("{name} {:?} {:?}\n", tensor.dtype(), tensor.shape());
        hashes.insert(format!("hash.{name}"), hash(&[head.as_bytes(), tensor.data()].concat()));
    }
    let whole = safetensors::serialize(tensors.tensors(), Some(hashes)).unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(place.path().join(name), bytes).unwrap();
    write("model.json", &document);
    write("weights.safetensors", &whole);
    assert!(Model::load(place.path()).unwrap().is_verified);
    assert!(!Model::load(&data().join("mdrff")).unwrap().is_verified);
    for (name, bytes) in [("model.json", &document), ("weights.safetensors", &whole)] {
        for i in 0..200 {
            let mut flipped = bytes.clone();
            flipped[i * bytes.len() / 200] ^= 1 << (i % 8);
            write(name, &flipped);
            let error = Model::load(place.path()).unwrap_err().to_string();
            // The hash of the document stands beside the tensors.
            let is_named = error.contains(name) || error.contains("model.json");
            assert!(is_named, "bit {i}: {error}");
        }
        write(name, bytes);
    }
}

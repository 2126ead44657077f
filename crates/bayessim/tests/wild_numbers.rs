//! A model without hashes may hold any numbers: it is refused by name, or what is asked of it comes to an end.

use std::fs;
use std::path::{Path, PathBuf};

use granulcal_bayessim::Model;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/auto")
}

/// The tensors' file of the model with the number at `at` of one tensor replaced, and perhaps the next one.
fn with_number(whole: &[u8], name: &str, at: usize, value: f64) -> Vec<u8> {
    let tensors = SafeTensors::deserialize(whole).unwrap();
    let mut changed = tensors.tensor(name).unwrap().data().to_vec();
    changed[8 * at..8 * at + 8].copy_from_slice(&value.to_le_bytes());
    let all = tensors.tensors().into_iter().map(|(other, tensor)| {
        let bytes = if other == name { changed.clone() } else { tensor.data().to_vec() };
        (other, tensor.dtype(), tensor.shape().to_vec(), bytes)
    });
    let all: Vec<_> = all.collect();
    let views = all.iter().map(|(n, dtype, shape, bytes)| {
        (n, TensorView::new(*dtype, shape.clone(), bytes).unwrap())
    });
    safetensors::serialize(views, None).unwrap()
}

/// Reads a model and asks it everything; the message of what refused it.
fn ask(document: &[u8], tensors: &[u8]) -> Option<String> {
    let model = match Model::read(Path::new("wild"), document, tensors) {
        Ok(model) => model,
        Err(error) => return Some(error.to_string()),
    };
    let x = [vec![1.0; model.x_names.len()]];
    let _ = model.misfit(&x).unwrap();
    let posterior = model.posterior(&x).unwrap();
    assert_eq!(posterior.sample(20, 1).len(), 20);
    assert_eq!(posterior.marginals(20, 1).unwrap().len(), posterior.names().len());
    let _ = (posterior.mode(), posterior.identifiability());
    None
}

#[test]
fn numbers_that_are_none_are_refused_by_name_or_come_to_an_end() {
    let read = |name: &str| fs::read(data().join(name)).unwrap();
    let (document, whole) = (read("model.json"), read("weights.safetensors"));
    assert_eq!(ask(&document, &whole), None);
    let tensors = SafeTensors::deserialize(&whole).unwrap();
    let (mut refused, mut tried) = (0, 0);
    let mut taken = std::collections::BTreeSet::new();
    for (name, tensor) in tensors.tensors() {
        if tensor.dtype() != Dtype::F64 || tensor.data().is_empty() {
            continue;
        }
        let last = tensor.data().len() / 8 - 1;
        for (at, value) in [(0, f64::NAN), (last, f64::INFINITY), (last, -1e308), (0, 1e-320)] {
            tried += 1;
            if let Some(said) = ask(&document, &with_number(&whole, &name, at, value)) {
                assert!(said.contains("wild"), "{name}: {said}");
                refused += 1;
                // What is not a number is named with its tensor.
                assert!(value.is_finite() || said.contains(&name), "{name}: {said}");
            } else if !value.is_finite() {
                taken.insert(name.clone());
            }
        }
    }
    // Python alone reads these.
    assert_eq!(taken.into_iter().collect::<Vec<_>>(), ["axes_relevance", "emulator_relevance"]);
    // Half of the numbers that were tried are none, four of them of those two tensors.
    assert!(tried > 40 && refused + 4 >= tried / 2, "{refused} of {tried}");
}

#[test]
fn a_smallest_value_above_the_largest_is_refused() {
    let read = |name: &str| fs::read(data().join(name)).unwrap();
    let (document, whole) = (read("model.json"), read("weights.safetensors"));
    let said = ask(&document, &with_number(&whole, "x_low", 0, 1e6)).unwrap();
    assert!(said.contains("x_low") && said.contains("wild"), "{said}");
}

#[test]
fn counts_beyond_all_bounds_are_refused() {
    let read = |name: &str| fs::read(data().join(name)).unwrap();
    let (document, whole) = (read("model.json"), read("weights.safetensors"));
    let mut value: serde_json::Value = serde_json::from_slice(&document).unwrap();
    for name in ["components", "ensemble", "features", "emulator_features"] {
        let before = value["config"][name].clone();
        value["config"][name] = 1_000_000_000_000_000_000_u64.into();
        let said = ask(value.to_string().as_bytes(), &whole).unwrap();
        assert!(said.contains(name) && said.contains("between 1 and"), "{said}");
        value["config"][name] = before;
    }
}

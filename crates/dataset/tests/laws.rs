//! Rows of two laws of the solver are never mixed, whatever the version of the package.

use std::fs;
use std::path::{Path, PathBuf};

use granulcal_dataset::{Dataset, DatasetError, GenerateOptions, generate, merge};
use granulcal_dem::LAW;

/// Three rows that were made before laws had numbers.
fn before() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/before_laws")
}

/// Makes the rows of the same scene, prior and seed in a folder.
fn make(out: &Path) -> Result<(), DatasetError> {
    let header = Dataset::open(&before())?.header;
    let options =
        GenerateOptions { rows: 5, seed: header.seed, threads: 1, ..GenerateOptions::default() };
    generate(&header.scene, &header.prior, &options, out, &mut |_| true).map(drop)
}

#[test]
fn rows_of_before_laws_had_numbers_are_read_and_told() {
    let data = Dataset::open(&before()).unwrap();
    assert_eq!((data.rows.len(), data.header.law), (3, None));
    // Their hash is the one that was written then.
    assert!(data.unverified.is_empty());
    assert!(data.header.other_law().unwrap().contains("before laws had numbers"));
}

#[test]
fn rows_of_another_law_are_not_gone_on_with() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("old");
    fs::create_dir(&out).unwrap();
    for name in ["manifest.toml", "part-000000.parquet"] {
        fs::copy(before().join(name), out.join(name)).unwrap();
    }
    let part = fs::read(out.join("part-000000.parquet")).unwrap();
    let error = make(&out).unwrap_err();
    assert!(error.is_bad_input());
    let said = error.to_string();
    let expected = format!(
        "the law of the solver is one of before laws had numbers, but law {LAW} is given; use another folder"
    );
    assert!(said.contains(&expected), "{said}");
    assert_eq!(fs::read(out.join("part-000000.parquet")).unwrap(), part);
}

#[test]
fn rows_of_two_laws_are_not_merged() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("new");
    make(&out).unwrap();
    let new = Dataset::open(&out).unwrap();
    assert_eq!((new.header.law, new.header.other_law()), (Some(LAW), None));
    for both in [[before(), out.clone()], [out.clone(), before()]] {
        let error = merge(&both, &place.path().join("merged.parquet"), 5).unwrap_err();
        assert!(error.to_string().contains("the law of the solver"), "{error}");
    }
    // Parts of one law under the manifest of another.
    let manifest = fs::read_to_string(out.join("manifest.toml")).unwrap();
    let other = manifest.replace(&format!("law = {LAW}"), "law = 1");
    assert_ne!(other, manifest);
    fs::write(out.join("manifest.toml"), other).unwrap();
    let error = Dataset::open(&out).unwrap_err().to_string();
    assert!(error.contains("part-000000.parquet") && error.contains("law 1"), "{error}");
}

#[test]
fn rows_of_two_arithmetics_are_neither_gone_on_with_nor_merged() {
    let place = tempfile::tempdir().unwrap();
    let (one, other) = (place.path().join("one"), place.path().join("other"));
    for out in [&one, &other] {
        make(out).unwrap();
    }
    let manifest = fs::read_to_string(other.join("manifest.toml")).unwrap();
    let changed = manifest.replace("arithmetic = 2", "arithmetic = 99");
    assert_ne!(changed, manifest);
    fs::write(other.join("manifest.toml"), changed).unwrap();
    let said = make(&other).unwrap_err().to_string();
    assert!(said.contains("the arithmetic of the solver is 2, but 99 is given"), "{said}");
    // Its parts say what they are themselves, too.
    assert!(Dataset::open(&other).unwrap_err().to_string().contains("the arithmetic"));
    let out = place.path().join("merged.parquet");
    let error = merge(&[one, other], &out, 5).unwrap_err().to_string();
    assert!(error.contains("the arithmetic") && !out.exists(), "{error}");
}

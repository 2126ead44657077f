//! Whatever happens to a batch, its rows are the same.

mod damage;

use std::fs;
use std::path::PathBuf;

use granulcal_scene::{Outflow, Scene};

use super::*;
use crate::{Dataset, merge};

/// A handful of grains let go just above the ground: milliseconds a pour.
fn small() -> Scene {
    let mut scene = Scene::drop(0.01);
    scene.set(&[("grains.count", 12.0), ("start.solid_fraction", 0.5)]).unwrap();
    scene.end.horizon = 0.25;
    scene.camera.downsample = 8;
    scene
}

fn options(rows: u64) -> GenerateOptions {
    GenerateOptions { rows, seed: 3, threads: 2, chunk: 4, ..GenerateOptions::default() }
}

/// A folder of its own for each batch of a test.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn make(&self, name: &str, options: &GenerateOptions) -> Summary {
        generate(&small(), &Prior::default(), options, &self.at(name), &mut |_| true).unwrap()
    }
}

fn assert_same(a: &Dataset, b: &Dataset) {
    assert_eq!(a.rows.len(), b.rows.len());
    for (a, b) in a.rows.iter().zip(&b.rows) {
        assert!(a.same_as(b), "row {}:\n{a:?}\n{b:?}", a.row);
    }
}

#[test]
fn threads_chunks_shards_and_growth_do_not_change_rows() {
    let place = Place::new();
    let summary = place.make("whole", &options(10));
    assert!(!summary.stopped);
    assert_eq!((summary.progress.total, summary.progress.made), (10, 10));
    let whole = Dataset::open(&place.at("whole")).unwrap();
    assert_eq!(whole.rows.len(), 10);
    assert!(whole.rows.iter().all(|r| r.statistics.iter().all(|s| s.is_finite())), "{whole:?}");
    assert!(whole.rows.iter().enumerate().all(|(i, row)| row.row == i as u64));
    assert_eq!(whole.theta().len(), 30);
    assert_eq!(whole.x().len(), 160);

    place.make("other", &GenerateOptions { threads: 1, chunk: 3, ..options(10) });
    assert_same(&whole, &Dataset::open(&place.at("other")).unwrap());

    place.make("grown", &options(6));
    let summary = place.make("grown", &options(10));
    assert_eq!((summary.progress.resumed, summary.progress.made), (6, 4));
    assert_same(&whole, &Dataset::open(&place.at("grown")).unwrap());
    assert_eq!(place.make("grown", &options(5)).progress.beyond, 3);

    for (name, text) in [("left", "0/2"), ("right", "1/2")] {
        place.make(name, &GenerateOptions { shard: text.parse().unwrap(), ..options(10) });
    }
    let out = place.at("merged.parquet");
    let merged = merge(&[place.at("right"), place.at("left")], &out, 5).unwrap();
    assert_eq!((merged.rows, &merged.gaps[..]), (10, &[][..]));
    // In tests a file of ten rows has three groups.
    let joined = Dataset::open(&out).unwrap();
    assert!(joined.unverified.is_empty());
    assert_same(&whole, &joined);
    // Files among folders, whose rows lie between those of the folders; and what is not there is named.
    whole.write(&place.at("whole.parquet")).unwrap();
    // A row that is the same in all of them is written once, one that is not is refused.
    let again = merge(&[place.at("left"), place.at("whole.parquet")], &out, 5).unwrap();
    let left = Dataset::open(&place.at("left")).unwrap();
    assert_eq!((again.rows, again.repeated), (10, left.rows.len() as u64));
    assert_same(&whole, &Dataset::open(&out).unwrap());
    let mut other = whole.clone();
    other.rows[8].statistics[2] += 1e-12;
    other.write(&place.at("other.parquet")).unwrap();
    let refused = merge(&[place.at("left"), place.at("other.parquet")], &out, 5).unwrap_err();
    assert!(matches!(refused, DatasetError::DuplicateRow { row: 8, .. }), "{refused}");
    assert_same(&whole, &Dataset::open(&out).unwrap());
    let odd = Dataset::open(&place.at("right")).unwrap();
    odd.write(&place.at("odd.parquet")).unwrap();
    merge(&[place.at("odd.parquet"), place.at("left")], &out, 5).unwrap();
    assert_same(&whole, &Dataset::open(&out).unwrap());
    let half = merge(&[place.at("odd.parquet")], &place.at("half.parquet"), 2).unwrap();
    assert_eq!(half.rows, odd.rows.len());
    assert_eq!(half.gaps, odd.gaps(2));
    assert_eq!(half.gaps.len(), 2);
}

#[test]
fn what_a_shard_lacks_is_known_before_a_pour() {
    let place = Place::new();
    let shard: Shard = "1/2".parse().unwrap();
    let own = GenerateOptions { shard, ..options(10) };
    let at = place.at("shard");
    let look = |options: &GenerateOptions| look(&small(), &Prior::default(), options, &at);
    // Ten rows are three parts, of which it has the middle one.
    let before = look(&own).unwrap();
    assert_eq!((before.total, before.resumed, at.exists()), (4, 0, false));
    place.make("shard", &own);
    let after = look(&GenerateOptions { rows: 24, ..own }).unwrap();
    assert_eq!((after.total, after.resumed), (12, 4));
    let other = look(&GenerateOptions { seed: 4, ..own }).unwrap_err();
    assert!(matches!(other, DatasetError::Differs { .. }), "{other}");
    // A part that is damaged: what helps is said.
    let part = at.join("part-000001.parquet");
    fs::write(&part, b"PAR1").unwrap();
    let damaged = generate(&small(), &Prior::default(), &own, &at, &mut |_| true).unwrap_err();
    assert!(damaged.to_string().contains("its rows are made again"), "{damaged}");
    assert!(damaged.is_bad_input());
}

#[test]
fn draws_that_cannot_begin_are_refused_before_the_first_pour() {
    let place = Place::new();
    let mut scene = Scene { outflow: Some(Outflow { below: 8e-3, until: None }), ..small() };
    let parameter = "path = \"start.height\"\ndistribution = \"uniform\"\nlow = 0.004\nhigh = 0.02";
    let prior = Prior::from_toml(&format!("[[parameter]]\n{parameter}\n")).unwrap();
    let make = |scene: &Scene| {
        generate(scene, &prior, &options(200), &place.at("new"), &mut |_| true).unwrap_err()
    };
    let refused = make(&scene);
    // The lowest draw of all, wherever it comes.
    let lowest = (0..200).min_by(|&a, &b| {
        let draw = |row| prior.sample(options(200).seed, row)[0];
        draw(a).total_cmp(&draw(b))
    });
    assert!(matches!(refused, DatasetError::Row { row, .. } if Some(row) == lowest), "{refused}");
    assert!(!place.at("new").exists());
    scene.outflow = None;
    let summary = generate(&scene, &prior, &options(2), &place.at("new"), &mut |_| true);
    assert_eq!(summary.unwrap().progress.made, 2);
}

#[test]
fn parts_that_were_made_elsewhere_are_gathered() {
    let place = Place::new();
    place.make("whole", &options(10));
    let chunk = 4;
    let one = |index| GenerateOptions { chunk, shard: Shard { index, count: 3 }, ..options(10) };
    let part = |index| {
        place.make(&format!("worker-{index}"), &one(index));
        let name = format!("worker-{index}/part-{index:06}.parquet");
        fs::read(place.at(&name)).unwrap()
    };
    let open = |rows| {
        let options = GenerateOptions { chunk, ..options(rows) };
        GatheredBatch::open(&small(), &Prior::default(), &options, &place.at("all"))
    };
    let mut batch = open(10).unwrap();
    assert_eq!((batch.chunks(), batch.missing().collect::<Vec<_>>()), (3, vec![0, 1, 2]));
    assert!(matches!(open(10).unwrap_err(), DatasetError::Locked { .. }));
    // Of another chunk, and damaged: refused, and nothing is written.
    let last = part(2);
    let refused = batch.put(1, &last).unwrap_err();
    assert!(matches!(refused, DatasetError::Content { .. }), "{refused}");
    let mut damaged = last.clone();
    damaged[20] ^= 1;
    assert!(batch.put(2, &damaged).is_err());
    assert_eq!(batch.missing().count(), 3);
    assert!(batch.put(2, &last).unwrap() && !batch.put(2, &last).unwrap());
    drop(batch);
    // Gone on with, and a part that has not all of its rows any more.
    let mut batch = open(10).unwrap();
    assert_eq!((batch.missing().collect::<Vec<_>>(), batch.progress().resumed), (vec![0, 1], 2));
    assert!(batch.put(0, &part(0)).unwrap() && batch.put(1, &part(1)).unwrap());
    assert_eq!((batch.missing().count(), batch.progress().made), (0, 8));
    drop(batch);
    assert_same(
        &Dataset::open(&place.at("whole")).unwrap(),
        &Dataset::open(&place.at("all")).unwrap(),
    );
    let mut grown = open(11).unwrap();
    assert_eq!(grown.missing().collect::<Vec<_>>(), [2]);
    let short = grown.put(2, &last).unwrap_err();
    assert!(matches!(short, DatasetError::Content { .. }), "{short}");
}

#[test]
fn parts_without_units_are_gone_on_with_and_merged() {
    let place = Place::new();
    place.make("whole", &options(8));
    place.make("old", &options(4));
    let tells_units = |path: &Path| {
        let (bytes, key) = (fs::read(path).unwrap(), b"granulcal.units");
        bytes.windows(key.len()).any(|window| window == key)
    };
    let first = place.at("old/part-000000.parquet");
    assert!(tells_units(&first));
    let found = table::read(&first).unwrap();
    table::write_without_units(&first, &found.header, &found.rows);
    assert_eq!(place.make("old", &options(8)).progress.resumed, 4);
    assert!(!tells_units(&first) && tells_units(&place.at("old/part-000001.parquet")));
    let whole = Dataset::open(&place.at("whole")).unwrap();
    assert_same(&Dataset::open(&place.at("old")).unwrap(), &whole);
    let merged = place.at("all.parquet");
    assert_eq!(merge(&[place.at("old"), place.at("whole")], &merged, 5).unwrap().repeated, 8);
    assert_same(&Dataset::open(&merged).unwrap(), &whole);
    assert!(tells_units(&merged));
}

#[test]
fn rows_that_are_there_stay_when_a_part_is_brought() {
    let place = Place::new();
    let chunk = 8;
    let of = |rows| GenerateOptions { chunk, ..options(rows) };
    place.make("whole", &of(8));
    place.make("short", &of(5));
    // As a batch of eight rows that was killed leaves it: some rows in the middle are missing.
    let path = place.at("short/part-000000.parquet");
    let header = Dataset::open(&place.at("whole")).unwrap().header;
    let mut rows = Dataset::open(&place.at("whole")).unwrap().rows;
    rows.retain(|row| ![2, 4, 6].contains(&row.row));
    table::write(&path, &header, &rows).unwrap();
    let five = fs::read({
        place.make("worker", &of(5));
        place.at("worker/part-000000.parquet")
    });
    let mut batch =
        GatheredBatch::open(&small(), &Prior::default(), &of(5), &place.at("short")).unwrap();
    assert_eq!((batch.progress().resumed, batch.progress().beyond), (3, 2));
    assert!(batch.put(0, &five.unwrap()).unwrap());
    assert_eq!((batch.progress().total, batch.progress().made), (5, 2));
    drop(batch);
    let kept: Vec<_> =
        Dataset::open(&place.at("short")).unwrap().rows.iter().map(|row| row.row).collect();
    assert_eq!(kept, [0, 1, 2, 3, 4, 5, 7]);
}

#[test]
fn a_part_that_lacks_rows_in_the_middle_is_not_whole_by_those_at_its_end() {
    let place = Place::new();
    place.make("whole", &GenerateOptions { chunk: 8, ..options(8) });
    let path = place.at("whole/part-000000.parquet");
    let table::Table { header, mut rows, .. } = table::read(&path).unwrap();
    // Five rows, as many as are asked for, and three of those that are.
    rows.retain(|row| ![2, 4, 6].contains(&row.row));
    table::write(&path, &header, &rows).unwrap();
    let five = GenerateOptions { chunk: 8, ..options(5) };
    let mut batch =
        GatheredBatch::open(&small(), &Prior::default(), &five, &place.at("five")).unwrap();
    let refused = batch.put(0, &fs::read(&path).unwrap()).unwrap_err();
    assert!(matches!(refused, DatasetError::Content { .. }), "{refused}");
    assert_eq!(batch.missing().collect::<Vec<_>>(), [0]);
}

#[test]
fn a_row_can_be_made_again_by_itself() {
    let place = Place::new();
    place.make("whole", &options(3));
    let row = Dataset::open(&place.at("whole")).unwrap().rows[2].clone();
    let scene = Prior::default().apply(&small(), &row.parameters).unwrap();
    let pour = Simulation::new(&scene, row.seed).unwrap().run();
    let seen = observe(&scene.camera, &pour, row.seed).unwrap();
    assert_eq!(seen.statistics.unwrap(), row.statistics);
}

#[test]
fn stopping_keeps_what_was_finished() {
    let place = Place::new();
    place.make("whole", &options(9));
    let path = place.at("stopped");
    let mut rounds = 0;
    loop {
        let mut start = None;
        let stop_after_two = &mut |p: &Progress| p.made < *start.get_or_insert(p.made) + 2;
        let summary =
            generate(&small(), &Prior::default(), &options(9), &path, stop_after_two).unwrap();
        rounds += 1;
        if !summary.stopped {
            break;
        }
        assert!(rounds < 9, "{summary:?}");
    }
    assert!(rounds > 1);
    let (whole, stopped) = (place.at("whole"), path);
    assert_same(&Dataset::open(&whole).unwrap(), &Dataset::open(&stopped).unwrap());
}

#[test]
fn rows_without_grains_in_view_are_rows() {
    let place = Place::new();
    let mut scene = small();
    scene.camera.height_threshold = 0.2;
    let summary =
        generate(&scene, &Prior::default(), &options(2), &place.at("a"), &mut |_| true).unwrap();
    assert_eq!((summary.progress.no_grains_in_view, summary.progress.unhealthy), (2, 0));
    let dataset = Dataset::open(&place.at("a")).unwrap();
    assert_eq!(dataset.status_counts().get("no_grains_in_view"), Some(&2));
    assert!(dataset.x().iter().all(|value| value.is_nan()));
}

#[test]
fn one_writer_at_a_time() {
    let place = Place::new();
    let path = place.at("a");
    let mut inner = None;
    generate(&small(), &Prior::default(), &options(1), &path, &mut |_| {
        let again = generate(&small(), &Prior::default(), &options(1), &path, &mut |_| true);
        inner.get_or_insert(again);
        true
    })
    .unwrap();
    assert!(matches!(inner, Some(Err(DatasetError::Locked { .. }))), "{inner:?}");
}

#[cfg(unix)]
#[test]
fn what_is_named_as_the_lock_is_left_alone() {
    let place = Place::new();
    let (path, mine) = (place.at("a"), place.at("mine.txt"));
    fs::create_dir(&path).unwrap();
    fs::write(&mine, "mine").unwrap();
    let run = || generate(&small(), &Prior::default(), &options(1), &path, &mut |_| true);
    std::os::unix::fs::symlink(&mine, path.join(".lock")).unwrap();
    let error = run().unwrap_err();
    assert!(error.is_bad_input() && error.to_string().contains("found a link"), "{error}");
    assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
    fs::remove_file(path.join(".lock")).unwrap();
    fs::create_dir(path.join(".lock")).unwrap();
    assert!(run().unwrap_err().to_string().contains("found a folder"));
    fs::remove_dir(path.join(".lock")).unwrap();
    fs::write(path.join(".lock"), "mine").unwrap();
    run().unwrap();
    assert_eq!(fs::read_to_string(path.join(".lock")).unwrap(), "mine");
}

#[test]
fn rows_asked_for_are_written_down_and_those_missing_after_the_last_are_told() {
    let place = Place::new();
    for (name, text) in [("left", "0/2"), ("right", "1/2")] {
        place.make(name, &GenerateOptions { shard: text.parse().unwrap(), ..options(10) });
    }
    let out = place.at("all.parquet");
    let told = |names: &[&str]| {
        let inputs: Vec<_> = names.iter().map(|name| place.at(name)).collect();
        let merged = merge(&inputs, &out, 5).unwrap();
        (merged.asked, merged.missing, merged.gaps)
    };
    assert_eq!(told(&["right"]), (Some(10), 6, vec![0, 1, 2, 3, 8]));
    // What was merged knows it, too.
    let (dataset, again) = (Dataset::open(&out).unwrap(), place.at("again.parquet"));
    assert_eq!((dataset.asked, dataset.missing(), dataset.gaps(5).len()), (Some(10), 6, 5));
    assert_eq!(merge(std::slice::from_ref(&out), &again, 0).unwrap().missing, 6);
    // And so does what is saved as one file.
    dataset.write(&again).unwrap();
    assert_eq!(Dataset::open(&again).unwrap().missing(), 6);
    assert_eq!(told(&["left", "right"]), (Some(10), 0, vec![]));

    // The most that was ever asked for counts, as soon as it is asked for.
    let asked = |rows, goes_on| {
        let options = options(rows);
        generate(&small(), &Prior::default(), &options, &place.at("a"), &mut |_| goes_on).unwrap();
        let dataset = Dataset::open(&place.at("a")).unwrap();
        (dataset.asked, dataset.missing())
    };
    assert_eq!(asked(2, true), (Some(2), 0));
    assert_eq!(asked(5, false), (Some(5), 3));
    assert_eq!(asked(1, true), (Some(5), 3));
    // A folder of before it was written down.
    let manifest = place.at("a/manifest.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("rows = 5\n", "")).unwrap();
    assert_eq!(told(&["a"]), (None, 0, vec![]));
    assert_eq!(asked(5, true), (Some(5), 0));
}

#[test]
fn shards_are_read_from_text() {
    assert_eq!("1/4".parse::<Shard>().unwrap(), Shard { index: 1, count: 4 });
    for text in ["4/4", "1", "a/2", "0/0", "-1/2", "1/2/3"] {
        assert!(text.parse::<Shard>().unwrap_err().to_string().contains("i/k"), "{text}");
    }
}

#[test]
fn finished_rows_are_on_disk_before_their_part_is_complete() {
    let place = Place::new();
    let options =
        GenerateOptions { chunk: 100, threads: 1, flush_every: Duration::ZERO, ..options(6) };
    let path = place.at("flushed");
    let mut most = 0;
    let watch = &mut |progress: &Progress| {
        if progress.made > 0 {
            let on_disk = table::read(&path.join("part-000000.parquet")).unwrap().rows.len() as u64;
            assert_eq!(on_disk, progress.made);
            most = most.max(on_disk);
        }
        progress.made < 4
    };
    let summary = generate(&small(), &Prior::default(), &options, &path, watch).unwrap();
    assert!(summary.stopped && most >= 4);
    assert_eq!(place.make("flushed", &options).progress.resumed, most);
    place.make("whole", &GenerateOptions { chunk: 4, ..options });
    let opened = |name: &str| Dataset::open(&place.at(name)).unwrap();
    assert_same(&opened("flushed"), &opened("whole"));
}

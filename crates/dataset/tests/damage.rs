//! Recordings that are cut off or damaged: what is whole is read, the rest is counted, and nothing panics.

mod recorded;

use std::fs;
use std::io::Cursor;
use std::path::Path;

use granulcal_dataset::{CameraFile, Lost, ReadOptions, Recording, Survey, png};
use granulcal_features::DepthImage;
use proptest::prelude::*;
use recorded::{Film, assert_close, bytes, depth, files, mean, read};

#[test]
fn a_frame_that_contradicts_itself_is_lost_and_counted() {
    let broken = foxglove::messages::RawImage {
        width: 2,
        height: 2,
        encoding: "16UC1".to_owned(),
        step: 4,
        data: vec![0; 7].into(),
        ..Default::default()
    };
    let film = || {
        Film::new().lens("/lens", "", 1.0, vec![]).depth("/depth", "", 500).send("/depth", &broken)
    };
    let recording = film().depth("/depth", "", 700).read(&ReadOptions::default()).unwrap();
    assert_eq!((recording.frames, recording.whole_frames), (2, 2));
    assert_eq!(recording.lost, Some(Lost::Exactly(1)));
    assert_eq!(depth(&recording).0.depth, [0.6; 4]);
    let only = Film::new().send("/depth", &broken).error(&ReadOptions::default());
    assert!(only.contains("data must be at least 8 bytes, found 7 bytes"), "{only}");
}

/// Whether a recording that was cut off is read as far as it goes.
fn check_cut(name: &str, whole: &[u8], length: usize) {
    match read(name, &whole[..length], &ReadOptions::default()) {
        Ok(recording) => {
            assert!((1..=3).contains(&recording.frames), "{name} {length}");
            let lost = recording.lost.unwrap_or_else(|| panic!("{name} {length}: no loss"));
            assert!(!recording.damage.is_empty());
            // What is averaged are whole frames: those at the front.
            let tolerance = if name.contains("inverse") { 3e-5 } else { 1e-7 };
            assert_close(&recording, &mean(0..recording.frames), tolerance);
            if let Lost::Exactly(lost) = lost {
                assert_eq!(recording.frames as u64 + lost, 3, "{name} {length}");
            }
        }
        Err(error) => assert!(error.to_string().contains(name), "{length}: {error}"),
    }
}

#[test]
fn a_recording_that_is_cut_off_gives_its_whole_frames() {
    for path in files() {
        let name = path.file_name().unwrap().to_str().unwrap();
        let whole = fs::read(&path).unwrap();
        // Every record's edge is within a few bytes of one of these.
        for length in (0..whole.len()).step_by(31) {
            check_cut(name, &whole, length);
        }
    }
}

#[test]
fn the_loss_is_known_as_well_as_the_format_allows() {
    let lost = |name: &str, length: usize| {
        read(name, &bytes(name)[..length], &ReadOptions::default()).unwrap().lost
    };
    // A bag says where its index should begin: without the last bytes of it no frame is missing.
    let bag = bytes("realsense_none.bag");
    assert_eq!(lost("realsense_none.bag", bag.len() - 1), Some(Lost::Exactly(0)));
    // In the last chunk, of the colour, only an estimate is possible.
    let index = u64::from_le_bytes(bag[find(&bag, b"index_pos=") + 10..][..8].try_into().unwrap());
    let Some(Lost::About(1)) = lost("realsense_none.bag", index as usize - 400) else {
        panic!("{:?}", lost("realsense_none.bag", index as usize - 400));
    };
    // An MCAP says nothing before its end.
    let film = bytes("ros2_16uc1_none.mcap");
    let Some(Lost::AtLeast(0)) = lost("ros2_16uc1_none.mcap", film.len() - 1) else {
        panic!("{:?}", lost("ros2_16uc1_none.mcap", film.len() - 1));
    };
    // A message that is cut is one frame at least.
    let third = film.windows(6).rposition(|w| w == b"16UC1\0").unwrap();
    assert_eq!(lost("ros2_16uc1_none.mcap", third + 60), Some(Lost::AtLeast(1)));
}

fn find(bytes: &[u8], needle: &[u8]) -> usize {
    bytes.windows(needle.len()).position(|window| window == needle).unwrap()
}

#[test]
fn a_damaged_chunk_is_left_out_and_its_frames_are_counted() {
    // Behind the header of the second chunk that holds a depth frame, the data are destroyed.
    for (name, mark) in
        [("realsense_lz4.bag", &b"compression=lz4"[..]), ("realsense_bz2.bag", b"compression=bz2")]
    {
        let mut bag = bytes(name);
        let chunks: Vec<_> =
            (0..bag.len() - mark.len()).filter(|&i| bag[i..].starts_with(mark)).collect();
        let mut losses = 0;
        for &chunk in &chunks {
            let before = bag.clone();
            bag[chunk + 70..chunk + 90].fill(0x55);
            match read(name, &bag, &ReadOptions::default()) {
                Ok(recording) => match recording.lost {
                    Some(Lost::Exactly(lost)) => {
                        assert_eq!(recording.whole_frames + lost, 3, "{name} {chunk}");
                        assert!(recording.damage[0].contains("byte"), "{:?}", recording.damage);
                        losses += lost;
                    }
                    other => panic!("{name} {chunk}: {other:?}"),
                },
                // The chunk with the lens, or with the unit.
                Err(error) => assert!(error.to_string().contains(name)),
            }
            bag = before;
        }
        assert!(losses >= 2, "{name}: {losses}");
    }
    // In an MCAP the checksum tells: one flipped bit of a pixel is enough.
    let mut film = bytes("ros2_16uc1_none.mcap");
    let first = find(&film, b"16UC1\0");
    film[first + 40] ^= 1;
    let recording = read("film.mcap", &film, &ReadOptions::default()).unwrap();
    assert!(matches!(recording.lost, Some(Lost::Exactly(1..=2))), "{:?}", recording.lost);
    assert!(recording.damage[0].contains("CRC"), "{:?}", recording.damage);
}

#[test]
fn a_bag_goes_on_behind_a_record_that_cannot_be_read() {
    let mut bag = bytes("realsense_none.bag");
    let needle = b"compression=none";
    let second = (0..bag.len()).filter(|&i| bag[i..].starts_with(needle)).nth(2).unwrap();
    // The length of the header of a chunk becomes absurd.
    bag[second - 8..second - 4].fill(0xff);
    let recording = read("bag.bag", &bag, &ReadOptions::default());
    match recording {
        Ok(recording) => assert!(matches!(recording.lost, Some(Lost::Exactly(_)))),
        Err(error) => assert!(error.to_string().contains("bag.bag"), "{error}"),
    }
}

/// Bytes of a real file changed in a few places.
fn mutated() -> impl Strategy<Value = (String, Vec<u8>)> {
    let file = prop::sample::select(files());
    let change = (any::<prop::sample::Index>(), any::<u8>(), 0u8..4, any::<u32>());
    (file, prop::collection::vec(change, 1..6)).prop_map(|(path, changes)| {
        let mut bytes = fs::read(&path).unwrap();
        for (at, value, how, number) in changes {
            let at = at.index(bytes.len());
            match how {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.iter_mut().skip(at).zip(number.to_le_bytes()).for_each(|(b, n)| *b = n),
                _ => {
                    bytes.drain(at..(at + usize::from(value)).min(bytes.len()));
                    if bytes.is_empty() {
                        bytes.push(0);
                    }
                }
            }
        }
        (path.file_name().unwrap().to_string_lossy().into_owned(), bytes)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Whatever is done to a file, it is read or refused by name, and nothing panics.
    #[test]
    fn damage_is_survived((name, bytes) in mutated()) {
        let surveyed = Survey::read(Path::new(&name), Cursor::new(bytes.clone()));
        match read(&name, &bytes, &ReadOptions::default()) {
            Ok(recording) => {
                prop_assert!(recording.frames >= 1);
                prop_assert!(surveyed.is_ok());
            }
            Err(error) => prop_assert!(error.to_string().contains(&name), "{error}"),
        }
    }
}

/// Frames of a folder, one of them damaged.
#[test]
fn damaged_frames_of_a_folder_are_counted() {
    let place = tempfile::tempdir().unwrap();
    for (index, depth) in [0.5f32, 0.6, 0.7].into_iter().enumerate() {
        let image = DepthImage::new(2, 2, vec![depth; 4]).unwrap();
        png::write_depth(&place.path().join(format!("{index}.png")), &image, 1e-3).unwrap();
    }
    let middle = place.path().join("1.png");
    let whole = fs::read(&middle).unwrap();
    fs::write(&middle, &whole[..whole.len() / 2]).unwrap();
    let toml = place.path().join("camera.toml");
    let camera = granulcal_features::Camera::overhead(0.5, 0.5, 2).unwrap();
    CameraFile::of(&camera, 1e-3).save(&toml).unwrap();
    let options = ReadOptions::with_camera(&toml);
    let recording = Recording::open(place.path(), &options).unwrap();
    assert_eq!((recording.frames, recording.lost), (2, Some(Lost::Exactly(1))));
    assert_eq!(depth(&recording).0.depth, [0.6; 4]);
    assert!(recording.damage[0].contains("1.png"), "{:?}", recording.damage);
    let last = ReadOptions { frames: 1, ..options };
    assert_eq!(depth(&Recording::open(place.path(), &last).unwrap()).0.depth, [0.7; 4]);
}

//! How much memory and disk a run needs, estimated before it begins, and whether there is so much.
//!
//! The estimates are upper bounds of what the structures hold, good to a factor of two: they are to stop a typing error
//! before it takes the machine, not to plan a run.

use std::fs;
use std::path::Path;

use granulcal_numbers::short;
use granulcal_scene::Scene;

use crate::DatasetError;

/// Bytes of a grain with its contacts, its cells and its copies in a solver.
const GRAIN: f64 = 4096.0;
/// Bytes of a pixel of the full image, and of one after down-sampling with its point and its statistics.
const PIXEL: f64 = 16.0;
const SAMPLED_PIXEL: f64 = 256.0;
/// Bytes that a process has before it does anything.
const BASE: f64 = 64e6;
/// Bytes of a row of a data set on disk, and of one in memory.
const ROW: f64 = 1024.0;
/// Bytes of the number of a row.
const NUMBER: f64 = 8.0;
/// Bytes of a grain in a frame in memory: place, velocity, spin and turn.
const FRAME_GRAIN: f64 = 104.0;
/// Bytes of a pixel of an image that is rendered, blurred and handed over.
const IMAGE_PIXEL: f64 = 16.0;
/// Bytes of a draw of a posterior, and of each of its numbers with its copies.
const DRAW: f64 = 48.0;
const DRAW_NUMBER: f64 = 40.0;
/// Bytes of a part of a data set on disk besides its rows: scene, prior and what the format says of its columns.
const PART: f64 = 17e3;
/// Bytes of a grain and of a pixel in one frame of a film.
const FILM_GRAIN: f64 = 16.0;
const FILM_PIXEL: f64 = 4.0;
/// Bytes of a frame besides.
const FILM_FRAME: f64 = 1024.0;
/// The variable that, set to 1, lets everything start.
const UNLIMITED: &str = "GRANULCAL_NO_LIMITS";

/// Bytes that a run needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Most bytes of memory at one time.
    pub memory: f64,
    /// Bytes that are written.
    pub disk: f64,
}

impl Room {
    /// One pour, with a film of so many frames a simulated second.
    pub fn of_pour(scene: &Scene, film_rate: Option<f64>) -> Self {
        let grains = scene.grains.count as f64;
        let camera = &scene.camera;
        let full = (camera.pixels as f64).powi(2);
        let sampled = (camera.pixels as f64 / camera.downsample.max(1) as f64).powi(2);
        let views: f64 =
            scene.views.iter().map(|view| view.pixels[0] as f64 * view.pixels[1] as f64).sum();
        let frames = film_rate.map_or(0.0, |rate| rate * scene.end.horizon + 1.0);
        let frame = FILM_FRAME + FILM_GRAIN * grains + FILM_PIXEL * (sampled + views);
        Self {
            memory: BASE + GRAIN * grains + PIXEL * (full + views) + SAMPLED_PIXEL * sampled,
            disk: frames * frame,
        }
    }

    /// Many pours, so many at once, of which `rows` are still to be made, `chunk` in a part.
    pub fn of_batch(scene: &Scene, rows: u64, threads: usize, chunk: u64) -> Self {
        let pour = Self::of_pour(scene, None);
        let (rows, threads) = (rows as f64, threads as f64);
        // Each pour at once may be of another chunk.
        let in_memory = rows.min(threads * chunk as f64);
        let parts = (rows / chunk as f64).ceil();
        Self {
            memory: BASE + (pour.memory - BASE) * threads + ROW * in_memory,
            disk: ROW * rows + PART * parts,
        }
    }

    /// A pour with frames of so many spheres in memory, one every so many simulated seconds, and a copy of each.
    pub fn of_frames(scene: &Scene, spheres: usize, every: f64) -> Self {
        let frames = scene.end.horizon / every + 2.0;
        let frame = 2.0 * FRAME_GRAIN * spheres as f64;
        Self { memory: Self::of_pour(scene, None).memory + frames * frame, disk: 0.0 }
    }

    /// An image of so many pixels, rendered and disturbed.
    pub fn of_image(pixels: usize) -> Self {
        Self { memory: BASE + IMAGE_PIXEL * pixels as f64, disk: 0.0 }
    }

    /// So many draws of so many numbers each, with what is made of them on the way.
    pub fn of_draws(count: usize, numbers: usize) -> Self {
        let row = DRAW + DRAW_NUMBER * numbers as f64;
        Self { memory: BASE + row * count as f64, disk: 0.0 }
    }

    /// The numbers of so many rows.
    pub(crate) fn of_list(rows: u64) -> Self {
        Self { memory: NUMBER * rows as f64, disk: 0.0 }
    }

    /// Refuses what needs more than there is; `folder` is where is written. The variable `GRANULCAL_NO_LIMITS=1`
    /// lets it start all the same.
    ///
    /// # Errors
    /// [`DatasetError::NoRoom`].
    pub fn require(&self, folder: Option<&Path>) -> Result<(), DatasetError> {
        if std::env::var_os(UNLIMITED).is_some_and(|value| value == "1") {
            return Ok(());
        }
        let refuse = |what, needed: f64, available: f64| {
            let in_words = |bytes: f64| {
                let (size, unit) = if bytes < 1e9 { (1e6, "MB") } else { (1e9, "GB") };
                format!("{} {unit}", short(bytes / size))
            };
            let (needed, available) = (in_words(needed), in_words(available));
            Err(DatasetError::NoRoom { what, needed, available })
        };
        if let Some(available) = free_memory().filter(|&available| self.memory > available) {
            return refuse("memory", self.memory, available);
        }
        let free = folder.filter(|_| self.disk > 0.0).and_then(free_disk);
        match free.filter(|&free| self.disk > free) {
            Some(free) => refuse("disk", self.disk, free),
            None => Ok(()),
        }
    }
}

/// Bytes that the system can give, as far as it tells.
fn free_memory() -> Option<f64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    let of_system = 1024.0 * kibibytes;
    // A container may be given less than the machine has.
    let number = |name: &str| -> Option<f64> {
        fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok()?.trim().parse().ok()
    };
    let used = || {
        let stat = fs::read_to_string("/sys/fs/cgroup/memory.stat").unwrap_or_default();
        number("memory.current").unwrap_or(0.0) - reclaimable(&stat)
    };
    let of_group = number("memory.max").map(|most| most - used());
    Some(of_group.map_or(of_system, |of_group| of_system.min(of_group)))
}

/// Bytes of pages of files among what a group uses, which the system takes back when memory is asked for.
fn reclaimable(stat: &str) -> f64 {
    let of = |name: &str| -> Option<f64> {
        stat.lines().find_map(|line| line.strip_prefix(name))?.trim().parse().ok()
    };
    ["inactive_file ", "active_file "].iter().filter_map(|name| of(name)).sum()
}

/// Free bytes of the file system in which `folder` is, or will be.
#[cfg(unix)]
fn free_disk(folder: &Path) -> Option<f64> {
    let there = folder.ancestors().find(|above| above.exists()).unwrap_or(Path::new("."));
    let there = if there.as_os_str().is_empty() { Path::new(".") } else { there };
    let system = rustix::fs::statvfs(there).ok()?;
    Some(system.f_bavail as f64 * system.f_frsize as f64)
}

#[cfg(not(unix))]
fn free_disk(_: &Path) -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_files_are_taken_back() {
        let stat = "anon 4096\nfile 9000\nactive_file 1000\ninactive_file 500\nshmem 3\n";
        assert_eq!(reclaimable(stat), 1500.0);
        assert_eq!(reclaimable(""), 0.0);
    }

    #[test]
    fn what_cannot_be_is_refused_before_it_is_begun() {
        let scene = Scene::drop(0.1);
        let folder = std::env::temp_dir();
        Room::of_pour(&scene, Some(60.0)).require(Some(&folder)).unwrap();
        Room::of_batch(&scene, 1000, 4, 16).require(Some(&folder)).unwrap();
        let many = Scene {
            grains: granulcal_dem::Grains { count: 100_000_000_000, ..scene.grains.clone() },
            ..scene.clone()
        };
        let error = Room::of_pour(&many, None).require(None).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("memory") && message.contains(UNLIMITED), "{message}");
        assert!(message.contains("about 409600 GB of memory"), "{message}");
        assert!(error.is_bad_input());
        let fast = Room::of_pour(&scene, Some(1e12)).require(Some(&folder)).unwrap_err();
        assert!(fast.to_string().contains("disk"), "{fast}");
        // A file for each row: most of it is what every file says.
        let (alone, together) =
            (Room::of_batch(&scene, 1000, 1, 1), Room::of_batch(&scene, 1000, 1, 100));
        assert!(alone.disk > 17e6 && together.disk < 1.3e6, "{alone:?} {together:?}");
        let long = Room::of_batch(&scene, u64::MAX, 2, 16).require(Some(&folder)).unwrap_err();
        assert!(long.to_string().contains("disk"), "{long}");
    }
}

//! Batches: a scene and a prior to a folder of Parquet parts, stopped and resumed at will.
//!
//! Row i depends on the scene, the prior, the seed and i, and on nothing else: not on the number of threads, of shards,
//! of interruptions. Rows are written in chunks, and every half minute what there is of chunks that are not complete; a
//! part is whole on disk or absent, so a run that was killed loses the rows in flight and those that were finished in
//! the last half minute.

mod chunk;
mod folder;
mod gathered;
mod options;
mod queue;
mod starts;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use granulcal_dem::{Pour, Simulation, Status};
use granulcal_features::stats::DIAGNOSTIC_COUNT;

use crate::engine::{Described, Engine, Outcome, describe, foreign_pour};
use crate::header::{FIRST_ARITHMETIC, FOREIGN_LAW, Header};
use crate::manifest;
use crate::observe::observe;
use crate::observer::Observer;
use crate::random::pour_seed;
use crate::row::{Row, RowStatus};
use crate::{DatasetError, Room, table};
use chunk::OpenChunk;
pub use chunk::Progress;
use folder::{Folder, Remaining};
pub use gathered::GatheredBatch;
use granulcal_scene::Prior;
pub use options::{GenerateOptions, Shard};
use queue::Queue;

/// How long the caller goes unasked at most while pours run.
const PATIENCE: Duration = Duration::from_millis(100);
/// Largest seed: manifests are TOML, whose whole numbers have a sign.
const MAX_SEED: u64 = i64::MAX as u64;

/// What a batch has come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The counts at the end.
    pub progress: Progress,
    /// Whether the caller stopped it before its end; what was made is on disk.
    pub stopped: bool,
}

/// Makes the rows that the folder `out` lacks.
///
/// `watch` is called on this thread at the start, after each row and at least ten times a second;
/// it returns whether to go on. When it says no, pours in flight are dropped and finished rows kept.
///
/// # Errors
/// Whatever is wrong with scene, prior or folder, before anything is simulated; then
/// [`DatasetError::Row`] for a row that cannot be made and [`DatasetError::Io`] for a disk that is
/// full. Finished rows are kept then too.
pub fn generate(
    scene: &granulcal_dem::Scene,
    prior: &Prior,
    options: &GenerateOptions,
    out: &Path,
    watch: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Summary, DatasetError> {
    generate_with(None, scene, prior, options, out, watch)
}

/// As [`generate`], the pours simulated by another engine where one is given; its name stands in the version
/// of the rows.
///
/// # Errors
/// As [`generate`], and what the engine says, as [`DatasetError::Row`].
pub fn generate_with(
    engine: Option<Engine>,
    scene: &granulcal_dem::Scene,
    prior: &Prior,
    options: &GenerateOptions,
    out: &Path,
    watch: &mut dyn FnMut(&Progress) -> bool,
) -> Result<Summary, DatasetError> {
    let header = accepted(engine.as_ref(), scene, prior, options)?;
    let threads = options.threads.min(most_threads());
    let room = |rows, chunk| Room::of_batch(scene, rows, threads, chunk);
    let (folder, remaining) = Folder::begin(out, &header, options, &room)?;
    let Remaining { missing, open, progress } = remaining;
    let queue = Mutex::new(Queue::new(missing, options, folder.chunk));
    let batch = Batch { rows: options.rows, folder: &folder, engine, chunks: open, progress };
    batch.run(options, &queue, threads, watch)
}

/// How far the folder `out` is with a batch of our simulator: what [`generate`] would find in it. Nothing is written.
///
/// # Errors
/// As [`generate`], before anything is simulated.
pub fn look(
    scene: &granulcal_dem::Scene,
    prior: &Prior,
    options: &GenerateOptions,
    out: &Path,
) -> Result<Progress, DatasetError> {
    Folder::look(out, &accepted(None, scene, prior, options)?, options)
}

/// What the rows of a batch are of, once it is known that all of them can be begun: a batch that ends at a draw cannot
/// go on with another prior.
fn accepted(
    engine: Option<&Engine>,
    scene: &granulcal_dem::Scene,
    prior: &Prior,
    options: &GenerateOptions,
) -> Result<Header, DatasetError> {
    check(options)?;
    check_grains(scene)?;
    let mut header = Header::new(scene, prior, options.seed)?;
    prior.check_draws(scene, options.seed, options.rows).map_err(DatasetError::Prior)?;
    if let Some(engine) = engine {
        header.version = engine.version();
        header.law = Some(FOREIGN_LAW);
        // It is not ours to count.
        header.arithmetic = FIRST_ARITHMETIC;
    } else {
        starts::check(scene, prior, options)?;
    }
    Ok(header)
}

/// Refuses a batch whose every row would be empty.
fn check_grains(scene: &granulcal_dem::Scene) -> Result<(), DatasetError> {
    if scene.grains.count > 0 || scene.bed.is_some() || scene.intruder.is_some() {
        return Ok(());
    }
    let allowed = "at least 1, for every row of a batch would be empty";
    Err(DatasetError::Argument { what: "grains.count", got: "0".to_owned(), allowed })
}

/// More pours at once than this gain nothing: the cores, or enough to test many.
fn most_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).max(64)
}

fn check(options: &GenerateOptions) -> Result<(), DatasetError> {
    let refuse = |what, got: u64, allowed| {
        Err(DatasetError::Argument { what, got: got.to_string(), allowed })
    };
    if options.rows == 0 {
        return refuse("the number of rows", 0, "at least 1");
    }
    if options.threads == 0 {
        return refuse("the number of threads", 0, "at least 1");
    }
    if options.chunk == 0 {
        return refuse("the rows in a part", 0, "at least 1");
    }
    if options.rows > MAX_SEED || options.chunk > MAX_SEED {
        return refuse("the number of rows", options.rows.max(options.chunk), "below 2^63");
    }
    if options.seed > MAX_SEED {
        return refuse("the seed", options.seed, "below 2^63");
    }
    if options.shard.index >= options.shard.count {
        return refuse("the index of the shard", options.shard.index, "below the number of shards");
    }
    Ok(())
}

/// The collecting side of a batch.
struct Batch<'a> {
    rows: u64,
    folder: &'a Folder,
    engine: Option<Engine<'a>>,
    chunks: BTreeMap<u64, OpenChunk>,
    progress: Progress,
}

impl Batch<'_> {
    fn run(
        mut self,
        options: &GenerateOptions,
        queue: &Mutex<Queue>,
        threads: usize,
        watch: &mut dyn FnMut(&Progress) -> bool,
    ) -> Result<Summary, DatasetError> {
        let left = self.progress.total.saturating_sub(self.progress.resumed);
        let stop = AtomicBool::new(!watch(&self.progress));
        // Rows are handed over: when the caller stops, at most one finished row of a worker is still to come.
        let (sender, finished) = sync_channel(0);
        let (header, engine) = (&self.folder.header, self.engine);

        let outcome = std::thread::scope(|scope| {
            let mut outcome = Ok(());
            for started in 0..threads.min(usize::try_from(left).unwrap_or(usize::MAX)) {
                let (sender, stop) = (sender.clone(), &stop);
                let work = move || {
                    let keep_going = || !stop.load(Ordering::Relaxed);
                    while keep_going() {
                        // Nobody panics while the queue is locked.
                        let row = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
                        let Some(row) = row else { break };
                        let Some(made) = make_row(header, engine, row, &keep_going).transpose()
                        else {
                            break;
                        };
                        let failed = made.is_err();
                        if sender.send((row, made)).is_err() || failed {
                            break;
                        }
                    }
                };
                if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, work) {
                    // The system has no more: those that were started make all of the rows.
                    if started == 0 {
                        outcome = Err(DatasetError::NoThread(error));
                    }
                    break;
                }
            }
            drop(sender);
            let mut flushed = Instant::now();
            loop {
                let result = match finished.recv_timeout(PATIENCE) {
                    Ok((row, made)) => {
                        let named = made
                            .map_err(|source| DatasetError::Row { row, source: Box::new(source) });
                        named.and_then(|row| self.accept(row))
                    }
                    Err(RecvTimeoutError::Timeout) => Ok(()),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                let is_due = flushed.elapsed() >= options.flush_every;
                let result = if is_due { result.and_then(|()| self.flush()) } else { result };
                if is_due {
                    flushed = Instant::now();
                }
                if let (true, Err(error)) = (outcome.is_ok(), result) {
                    outcome = Err(error);
                }
                if outcome.is_err() || !watch(&self.progress) {
                    let is_first = !stop.swap(true, Ordering::Relaxed);
                    // Before the pours in flight notice: whoever asks twice ends the process.
                    if is_first && outcome.is_ok() {
                        outcome = self.flush();
                    }
                }
            }
            outcome
        });

        let flushed = self.flush();
        outcome.and(flushed)?;
        let Progress { total, resumed, made, .. } = self.progress;
        Ok(Summary { progress: self.progress, stopped: resumed + made < total })
    }

    /// Takes a finished row, and writes its chunk if that was the last one missing.
    fn accept(&mut self, row: Row) -> Result<(), DatasetError> {
        let index = row.row / self.folder.chunk;
        self.progress.made += 1;
        self.progress.count(row.status);
        let first = index * self.folder.chunk;
        let wanted = self.folder.chunk.min(self.rows - first);
        let empty = || OpenChunk { rows: Vec::new(), left: wanted, changed: false };
        let chunk = self.chunks.entry(index).or_insert_with(empty);
        chunk.rows.push(row);
        chunk.left -= 1;
        chunk.changed = true;
        if chunk.left == 0 {
            self.write(index)?;
            self.chunks.remove(&index);
        }
        Ok(())
    }

    /// Writes what was finished of chunks that are not complete.
    fn flush(&mut self) -> Result<(), DatasetError> {
        let changed: Vec<u64> =
            self.chunks.iter().filter(|(_, c)| c.changed).map(|(&index, _)| index).collect();
        changed.into_iter().try_for_each(|index| self.write(index))
    }

    fn write(&mut self, index: u64) -> Result<(), DatasetError> {
        let Some(chunk) = self.chunks.get_mut(&index) else { return Ok(()) };
        chunk.rows.sort_by_key(|row| row.row);
        let path = manifest::part_path(&self.folder.path, index);
        table::write(&path, &self.folder.header, &chunk.rows)?;
        chunk.changed = false;
        Ok(())
    }
}

/// Simulates one row, or gives up when told to.
fn make_row(
    header: &Header,
    engine: Option<Engine>,
    row: u64,
    keep_going: &dyn Fn() -> bool,
) -> Result<Option<Row>, DatasetError> {
    let start = ThreadTime::now();
    let parameters = header.prior.sample(header.seed, row);
    let scene = header.prior.apply(&header.scene, &parameters);
    let scene = scene.map_err(DatasetError::refused)?;
    let seed = pour_seed(header.seed, row);
    let mut observer = Observer::new(&scene);
    let pour = if let Some(engine) = engine {
        match (engine.pour)(&scene, seed)? {
            Outcome::Grains { positions, radii } => foreign_pour(&scene, positions, radii)?,
            Outcome::Points(points) => {
                let seen = describe(&scene, &points)?;
                let pour = foreign_pour(&scene, Vec::new(), Vec::new())?;
                let observed = vec![f64::NAN; header.observed().len()];
                let seen = seen.as_ref();
                return Ok(Some(finish(row, parameters, seed, start, &pour, None, seen, observed)));
            }
        }
    } else {
        let simulation = Simulation::new(&scene, seed).map_err(DatasetError::Simulation)?;
        simulation.check_start().map_err(DatasetError::Simulation)?;
        let Some(pour) = observer.run_while(simulation, keep_going) else { return Ok(None) };
        pour
    };
    let status = observer.status(&pour);
    let observed = observer.observed(&pour).statistics;
    let seen = observe(&scene.camera, &pour, seed).and_then(|seen| {
        let seen = seen.with_grain_diameter(scene.grains.diameter);
        let Ok(values) = seen.statistics else { return Ok(None) };
        Ok(Some((values, seen.diagnostics().map_err(DatasetError::Features)?)))
    });
    let seen = match seen {
        // The grains of an unhealthy pour can be anywhere, NaN included: the status says enough.
        Err(_) if pour.status == Status::Unhealthy => None,
        other => other?,
    };
    // The scene may have other eyes than its camera.
    let says_enough = !status.is_healthy() || status.is_jammed() || !observer.is_idle();
    let status = says_enough.then_some(status);
    let seen = seen.as_ref();
    Ok(Some(finish(row, parameters, seed, start, &pour, status, seen, observed)))
}

/// The row of a pour; without a status of its own it is that of the pour, or tells that no grain is seen.
#[allow(clippy::too_many_arguments)] // What a row is made of.
fn finish(
    row: u64,
    parameters: Vec<f64>,
    seed: u64,
    start: ThreadTime,
    pour: &Pour,
    status: Option<RowStatus>,
    seen: Option<&Described>,
    observed: Vec<f64>,
) -> Row {
    let status = status.unwrap_or(match seen {
        Some(_) => RowStatus::Pour(pour.status),
        None => RowStatus::NoGrainsInView,
    });
    let nothing = ([f64::NAN; 16], [f64::NAN; DIAGNOSTIC_COUNT]);
    let (statistics, diagnostics) = seen.copied().unwrap_or(nothing);
    Row {
        row,
        parameters,
        seed,
        status,
        simulated_s: pour.simulated_s,
        health: pour.health,
        cpu_s: start.elapsed().as_secs_f64(),
        statistics,
        diagnostics,
        observed,
    }
}

#[cfg(test)]
mod tests;

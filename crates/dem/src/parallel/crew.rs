//! Threads that stand by, awake, for short rounds of work.
//!
//! A thread that sleeps takes some 50 microseconds to wake: longer than many a round.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, RwLock};
use std::thread::yield_now;

/// Looks for work before a thread lets others have its core.
const LOOKS: usize = 64;

/// One round after the other about a state.
pub(super) struct Crew<'a, S, T, V, W> {
    pub state: RwLock<S>,
    work: &'a W,
    /// Items that nobody has taken yet, each with its place in the round, and their number.
    items: Mutex<Vec<(usize, T)>>,
    waiting: AtomicUsize,
    /// What has been found, each with the place of its item.
    found: Mutex<Vec<(usize, V)>>,
    /// Items that nothing has been found of yet.
    open: AtomicUsize,
    is_dismissed: AtomicBool,
}

/// Dismisses the crew when it is dropped, in a panic, too.
pub(super) struct Dismissal<'a>(&'a AtomicBool);

impl Drop for Dismissal<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

impl<'a, S, T, V, W: Fn(&S, &T) -> V> Crew<'a, S, T, V, W> {
    pub fn new(state: S, work: &'a W) -> Self {
        Self {
            state: RwLock::new(state),
            work,
            items: Mutex::new(Vec::new()),
            waiting: AtomicUsize::new(0),
            found: Mutex::new(Vec::new()),
            open: AtomicUsize::new(0),
            is_dismissed: AtomicBool::new(false),
        }
    }

    /// Dismisses the crew at the end of the scope.
    pub fn dismissal(&self) -> Dismissal<'_> {
        Dismissal(&self.is_dismissed)
    }

    fn is_dismissed(&self) -> bool {
        self.is_dismissed.load(Ordering::Acquire)
    }

    /// Takes part in rounds until the crew is dismissed.
    pub fn stand_by(&self) {
        // Once a thread has panicked there is nothing to wait for.
        let dismissal = self.dismissal();
        wait_until(|| {
            self.take_part();
            self.is_dismissed()
        });
        std::mem::forget(dismissal);
    }

    /// Lets all work on a round; returns what they have found, in the order of the items; nothing if a thread has
    /// panicked.
    pub fn round(&self, items: Vec<T>) -> Option<Vec<V>> {
        let count = items.len();
        self.open.store(count, Ordering::Release);
        lock(&self.items).extend(items.into_iter().enumerate().rev());
        self.waiting.store(count, Ordering::Release);
        self.take_part();
        wait_until(|| self.open.load(Ordering::Acquire) == 0 || self.is_dismissed());
        if self.is_dismissed() {
            return None;
        }
        let mut found = std::mem::take(&mut *lock(&self.found));
        found.sort_unstable_by_key(|&(place, _)| place);
        Some(found.into_iter().map(|(_, value)| value).collect())
    }

    /// Works on items as long as there are any.
    fn take_part(&self) {
        while self.waiting.load(Ordering::Acquire) > 0 {
            let Some((place, item)) = self.take() else { return };
            let value = (self.work)(&self.state.read().expect("the lead has not panicked"), &item);
            lock(&self.found).push((place, value));
            self.open.fetch_sub(1, Ordering::AcqRel);
        }
    }

    fn take(&self) -> Option<(usize, T)> {
        let mut items = lock(&self.items);
        let item = items.pop();
        self.waiting.store(items.len(), Ordering::Release);
        item
    }
}

fn wait_until(mut is_so: impl FnMut() -> bool) {
    let mut looks = 0;
    while !is_so() {
        looks += 1;
        if looks < LOOKS { spin_loop() } else { yield_now() }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().expect("no thread has panicked")
}

//! Panics of a library over a damaged file, as a value.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static IS_CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// What `work` returns, or none if it panics. The panic is not printed: it is the caller's to say what is wrong with
/// the file.
pub(crate) fn contained<V>(work: impl FnOnce() -> V) -> Option<V> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_CONTAINED.get() {
                before(panic);
            }
        }));
    });
    IS_CONTAINED.set(true);
    let value = catch_unwind(AssertUnwindSafe(work));
    IS_CONTAINED.set(false);
    value.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Run by the test below, in a process of its own: what is printed is the whole process's.
    #[test]
    #[ignore = "a part of another test"]
    fn panics_of_a_library_and_of_ours() {
        assert_eq!(contained(|| 3), Some(3));
        assert_eq!(contained(|| -> usize { panic!("stumbled over the file") }), None);
        assert!(catch_unwind(|| panic!("a fault of ours")).is_err());
    }

    #[test]
    fn what_is_contained_is_not_printed_and_what_is_not_is() {
        let child = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "contained::tests::panics_of_a_library_and_of_ours"])
            .args(["--ignored", "--nocapture"])
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&[child.stdout, child.stderr].concat()).into_owned();
        assert!(child.status.success() && printed.contains("1 passed"), "{printed}");
        assert!(printed.contains("a fault of ours"), "{printed}");
        assert!(!printed.contains("stumbled over the file"), "{printed}");
    }
}

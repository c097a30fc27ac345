//! What signals ask for. One that was ignored when the program began, as SIGHUP is after `nohup`, stays ignored.

use std::ffi::c_int;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering::Relaxed};

use anyhow::Context;
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGUSR1, SIGUSR2, SIGXFSZ};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::low_level;

use super::Failure;

/// Those that ask to stop, and again to stop at once.
const URGENT: [c_int; 2] = [SIGINT, SIGTERM];
/// Those that come beside these, so that they ask to stop once at most: of a terminal that closes, and [`ORPHANED`].
#[cfg(target_os = "linux")]
const BESIDE: [c_int; 2] = [SIGHUP, ORPHANED];
#[cfg(all(unix, not(target_os = "linux")))]
const BESIDE: [c_int; 1] = [SIGHUP];
#[cfg(not(unix))]
const BESIDE: [c_int; 0] = [];
/// What a command gets that this program has begun when this ends. Nothing else sends it or lets it be ignored.
#[cfg(target_os = "linux")]
pub(super) const ORPHANED: c_int = libc::SIGPWR;
/// Those that end no work, and whether they ask for a checkpoint, as job scripts do before the time is up. A file that
/// grows beyond a limit of the system's is an error like a full disk.
#[cfg(unix)]
const SURVIVED: [(c_int, bool); 3] = [(SIGUSR1, true), (SIGUSR2, true), (SIGXFSZ, false)];
#[cfg(not(unix))]
const SURVIVED: [(c_int, bool); 0] = [];

/// The first signal that has asked to stop; 0 before.
static STOP: AtomicI32 = AtomicI32::new(0);
/// Whether there has been one of [`URGENT`].
static IS_URGENT: AtomicBool = AtomicBool::new(false);
static SAVE: AtomicBool = AtomicBool::new(false);

/// Lets no command end by a signal that does not ask for that.
pub(super) fn survive() -> Result<(), Failure> {
    SURVIVED
        .into_iter()
        .try_for_each(|(signal, asks)| on(signal, move || SAVE.fetch_or(asks, Relaxed)))
}

/// Whether there has been a signal that asks for a checkpoint since this was asked last.
pub(super) fn is_checkpoint_wanted() -> bool {
    SAVE.swap(false, Relaxed)
}

/// Lets the work come to a point from which it can be gone on with, and tells which signal has asked to stop. The
/// second of [`URGENT`] ends the program at once.
pub(super) fn stop_on_signal() -> Result<impl Fn() -> Option<c_int> + Sync, Failure> {
    const SAID: &str = "stopping after this iteration, search or proof; again to stop at once\n";
    // Of a command that trains several times a second handler would take the first signal for the second.
    static IS_HANDLED: AtomicBool = AtomicBool::new(false);
    let is_handled = IS_HANDLED.swap(true, Relaxed);
    for signal in URGENT.into_iter().chain(BESIDE).filter(|_| !is_handled) {
        on(signal, move || {
            if STOP.compare_exchange(0, signal, Relaxed, Relaxed).is_ok() {
                // Not by the writer of all else: its lock may be held by the very code that this interrupts.
                // SAFETY: `write` may be called in a handler, and reads so many bytes of a text that stays.
                unsafe { libc::write(2, SAID.as_ptr().cast(), SAID.len() as _) };
            }
            if URGENT.contains(&signal) && IS_URGENT.swap(true, Relaxed) {
                low_level::exit(128 + signal);
            }
        })?;
    }
    Ok(|| Some(STOP.load(Relaxed)).filter(|&signal| signal != 0))
}

/// Lets `act` handle a signal unless it is ignored. It may do only what a handler may: nothing that locks or allocates.
fn on<T>(signal: c_int, act: impl Fn() -> T + Send + Sync + 'static) -> Result<(), Failure> {
    if is_ignored(signal) {
        return Ok(());
    }
    let handle = move || drop(act());
    // SAFETY: all that is passed on above does nothing else.
    let registered = unsafe { low_level::register(signal, handle) };
    registered.with_context(|| format!("cannot handle signal {signal}"))?;
    Ok(())
}

#[cfg(unix)]
fn is_ignored(signal: c_int) -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: without a new action this only writes the present one.
    unsafe {
        libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr()) == 0
            && action.assume_init().sa_sigaction == libc::SIG_IGN
    }
}

#[cfg(not(unix))]
fn is_ignored(_: c_int) -> bool {
    false
}

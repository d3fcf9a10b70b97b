//! Long work: without the interpreter's lock, with progress, and ended by
//! Ctrl-C.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use coaxdesign::pipeline::{Observer, Task};
use pyo3::prelude::*;

use crate::errors;

/// How often Python is asked whether to go on, and told how far the work is.
const TELL: Duration = Duration::from_millis(50);
/// Stack of the working thread: that of a main thread.
const STACK: usize = 8 << 20;

/// How far a piece of work is, and whether it is to end.
#[derive(Debug, Default)]
pub struct Ticker {
    done: AtomicUsize,
    /// Parts of the task at work, and its name.
    task: Mutex<(usize, &'static str)>,
    cancelled: AtomicBool,
}

/// What a cancelled piece of work unwinds with.
struct Cancelled;

impl Ticker {
    /// A task of so many parts begins.
    pub fn start(&self, name: &'static str, parts: usize) {
        *self.task.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = (parts, name);
        self.done.store(0, Ordering::Relaxed);
    }

    /// One more part is done. Ends the work here if it is to end: a callback
    /// of a sweep cannot say so by a value, hence the unwinding, which runs no
    /// panic hook.
    pub fn tick(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
        if self.cancelled() {
            resume_unwind(Box::new(Cancelled));
        }
    }

    fn state(&self) -> (usize, usize, &'static str) {
        let (parts, name) = *self.task.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        (self.done.load(Ordering::Relaxed), parts, name)
    }
}

impl Observer for Ticker {
    fn begin(&self, task: Task, steps: u64) {
        self.start(task.name(), steps as usize);
    }

    fn advance(&self) {
        self.tick();
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Does the work on a thread of its own while this one, which alone can hear
/// Ctrl-C, tells `progress(done, total, task)` and asks for signals. An exception of
/// either ends the work.
///
/// # Errors
/// `KeyboardInterrupt`, what `progress` raises, or a mistake of the library.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Ticker) -> T + Send,
) -> PyResult<T> {
    let ticker = Ticker::default();
    let outcome = py.detach(|| {
        thread::scope(|scope| {
            let (ended, wait) = channel();
            let ticker = &ticker;
            let worker = thread::Builder::new()
                .name("coaxdesign".into())
                .stack_size(STACK)
                .spawn_scoped(scope, move || {
                    let outcome = catch_unwind(AssertUnwindSafe(|| work(ticker)));
                    // The other end waits for this alone.
                    let _ = ended.send(());
                    outcome
                })
                .map_err(|error| errors::internal(&error.to_string()))?;
            let mut fault = None;
            let mut told = (0, 0, "");
            let mut tell = || -> PyResult<()> {
                let state = ticker.state();
                Python::attach(|py| {
                    py.check_signals()?;
                    if let Some(progress) = progress
                        && state != told
                    {
                        told = state;
                        progress.call1(py, state)?;
                    }
                    Ok(())
                })
            };
            while let Err(RecvTimeoutError::Timeout) = wait.recv_timeout(TELL) {
                if fault.is_none()
                    && let Err(error) = tell()
                {
                    ticker.cancelled.store(true, Ordering::Relaxed);
                    fault = Some(error);
                }
            }
            if fault.is_none() {
                fault = tell().err();
            }
            let outcome = worker.join().and_then(|outcome| outcome);
            match (fault, outcome) {
                (Some(error), _) => Err(error),
                (None, Ok(value)) => Ok(value),
                (None, Err(payload)) => Err(errors::internal(&words(payload.as_ref()))),
            }
        })
    })?;
    Ok(outcome)
}

fn words(payload: &(dyn Any + Send)) -> String {
    payload
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| payload.downcast_ref::<&str>().map(|text| (*text).to_owned()))
        .unwrap_or_else(|| "a panic".into())
}

//! Long work beside a Python that stays alive: the work has a thread of its own, this one waits without the lock of the interpreter, hands
//! events on and looks for signals.

use crate::errors::runtime;
use lnn::pipeline::{Event, Watch};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// Time between two looks for signals.
const LOOK: Duration = Duration::from_millis(50);
/// Stack of the work, that of a main thread.
const STACK: usize = 8 << 20;
/// Time that work whose loops are long has after a signal; then it is left to itself.
const PATIENCE: Duration = Duration::from_millis(500);

/// An event as Python receives it: kind, two numbers, a text.
type News = (&'static str, f64, f64, String);

enum Message {
    News(News),
    Done,
}

/// Runs `work` under a watch whose flag a signal raises, and reports to `progress` what happens meanwhile.
///
/// # Errors
/// A second signal, what `progress` raises, and a panic of the work.
pub fn attended<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Watch) -> T + Send,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let flag = Arc::new(AtomicBool::new(false));
    let mut watch = Watch { events: None, interrupt: Arc::clone(&flag) };
    if progress.is_some() {
        let reporter = Reporter { sender: sender.clone(), last: std::sync::Mutex::new(None) };
        watch = Watch { interrupt: Arc::clone(&flag), ..Watch::new(move |event| reporter.report(event)) };
    }
    // The receiver moves into this call, which stays on this thread.
    py.detach(move || {
        std::thread::scope(|scope| {
            let running = Builder::new().stack_size(STACK).spawn_scoped(scope, move || {
                // Sent also when the work panics.
                let _end = End(sender);
                work(watch)
            });
            let running = running.map_err(|error| runtime(format_args!("no thread can be started: {error}")))?;
            let looked = look(&receiver, &flag, progress, Duration::MAX);
            let done = running.join();
            looked?;
            done.map_err(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| text.to_string()));
                runtime(format_args!("a mistake in lnn itself: {}", text.unwrap_or_default()))
            })
        })
    })
}

/// As [`attended`], for work whose part is worth nothing: after a signal its result is lost.
///
/// # Errors
/// `KeyboardInterrupt` after a signal, what `progress` raises, and a panic of the work.
pub fn whole<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Watch) -> T + Send,
) -> PyResult<T> {
    let done = attended(py, progress, |watch| (work(&watch), watch.interrupt.load(Ordering::SeqCst)))?;
    match done {
        (_, true) => Err(PyKeyboardInterrupt::new_err("interrupted")),
        (result, false) => Ok(result),
    }
}

/// As [`whole`], for work that owns what it needs and may not look at its flag for long: soon after a signal it is left to itself.
///
/// # Errors
/// `KeyboardInterrupt` after a signal, and a panic of the work.
pub fn left<T: Send + 'static>(py: Python<'_>, work: impl FnOnce(&Watch) -> T + Send + 'static) -> PyResult<T> {
    let ((sender, receiver), flag) = (channel(), Arc::new(AtomicBool::new(false)));
    let watch = Watch { events: None, interrupt: Arc::clone(&flag) };
    let running = Builder::new().stack_size(STACK).spawn(move || {
        let _end = End(sender);
        work(&watch)
    });
    let running = running.map_err(|error| runtime(format_args!("no thread can be started: {error}")))?;
    py.detach(move || {
        look(&receiver, &flag, None, PATIENCE)?;
        match running.join() {
            _ if flag.load(Ordering::SeqCst) => Err(PyKeyboardInterrupt::new_err("interrupted")),
            Ok(done) => Ok(done),
            Err(_) => Err(runtime("a mistake in lnn itself")),
        }
    })
}

/// Waits for the end of the work, after a signal as long as there is patience.
fn look(
    receiver: &Receiver<Message>,
    flag: &AtomicBool,
    progress: Option<&Py<PyAny>>,
    patience: Duration,
) -> PyResult<()> {
    let (mut failed, mut pressed) = (Ok(()), None);
    loop {
        if pressed.is_some_and(|pressed: Instant| pressed.elapsed() > patience) {
            return Err(PyKeyboardInterrupt::new_err("interrupted"));
        }
        let message = receiver.recv_timeout(LOOK);
        if let Ok(Message::Done) | Err(RecvTimeoutError::Disconnected) = message {
            return failed;
        }
        let attended = Python::attach(|py| {
            if let (Ok(Message::News(news)), Some(progress), true) = (message, progress, failed.is_ok()) {
                progress.call1(py, news)?;
            }
            // The first signal ends the work with what it has, as the program does.
            match py.check_signals() {
                Err(_) if !flag.swap(true, Ordering::SeqCst) => {
                    pressed = Some(Instant::now());
                    Ok(())
                }
                outcome => outcome,
            }
        });
        if let Err(error) = attended {
            flag.store(true, Ordering::SeqCst);
            failed = failed.and(Err(error));
        }
    }
}

struct End(Sender<Message>);

impl Drop for End {
    fn drop(&mut self) {
        let _ = self.0.send(Message::Done);
    }
}

/// Sends events, of steps no more than there is time to look at.
struct Reporter {
    sender: Sender<Message>,
    last: std::sync::Mutex<Option<Instant>>,
}

impl Reporter {
    fn report(&self, event: Event<'_>) {
        let pair = |kind, done: usize, total: usize| (kind, done as f64, total as f64, String::new());
        let news = match event {
            Event::Step { done, total } => {
                let Ok(mut last) = self.last.lock() else { return };
                if done < total && last.is_some_and(|last| last.elapsed() < LOOK) {
                    return;
                }
                *last = Some(Instant::now());
                pair("step", done, total)
            }
            Event::Epoch(epoch) => ("epoch", epoch.epoch as f64, epoch.validation_loss, String::new()),
            Event::Judged { done, total } => pair("judged", done, total),
            Event::Runs { done, total } => pair("runs", done, total),
            Event::Note(text) => ("note", 0.0, 0.0, text.to_string()),
            _ => return,
        };
        let _ = self.sender.send(Message::News(news));
    }
}

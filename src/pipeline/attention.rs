//! Work on a finished model: it shows how far it is, and Ctrl-C ends it.

use crate::cli::CliError;
use crate::cli::progress::Progress;
use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Evaluations between two looks at the bar.
const OFTEN: u64 = 1024;

/// Watch over such work.
pub struct Attention {
    /// Raised by Ctrl-C; none where Ctrl-C ends the program at once.
    stop: Option<Arc<AtomicBool>>,
    bar: Progress,
    done: AtomicU64,
    evaluations: AtomicU64,
}

impl fmt::Debug for Attention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Attention").field("stop", &self.stop).finish_non_exhaustive()
    }
}

impl Attention {
    /// Attention to so many pieces of work. A flag that was raised before does not count: it ended the training, and the next
    /// Ctrl-C ends the program.
    pub fn new(stop: Option<&Arc<AtomicBool>>, pieces: usize) -> Self {
        Self {
            stop: stop.filter(|stop| !stop.load(Ordering::SeqCst)).cloned(),
            bar: Progress::new(pieces as u64, "judged"),
            done: AtomicU64::new(0),
            evaluations: AtomicU64::new(0),
        }
    }

    /// So many pieces more are done.
    pub fn advance(&self, pieces: usize) {
        self.bar.advance(self.done.fetch_add(pieces as u64, Ordering::Relaxed) + pieces as u64);
    }

    /// `true` if Ctrl-C was pressed.
    pub fn is_interrupted(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::SeqCst))
    }

    /// Goes on unless Ctrl-C was pressed.
    ///
    /// # Errors
    /// An interruption that says what is there and what is not.
    pub fn check(&self) -> Result<(), CliError> {
        if self.is_interrupted() {
            let problem = "interrupted while the model was judged: the model is written, tables and report are not";
            return Err(CliError::interrupted(problem));
        }
        Ok(())
    }

    /// The same model; after Ctrl-C it fails everywhere, which ends whatever integrates it.
    pub fn watched<'a>(&'a self, model: &'a dyn EulerLagrange<f64>) -> Watched<'a> {
        Watched { model, attention: self }
    }
}

/// A model under [`Attention`].
pub struct Watched<'a> {
    model: &'a dyn EulerLagrange<f64>,
    attention: &'a Attention,
}

impl EulerLagrange<f64> for Watched<'_> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let Attention { bar, evaluations, .. } = self.attention;
        let before = evaluations.fetch_add(1, Ordering::Relaxed);
        if before % OFTEN == 0 {
            bar.say(&format!("{before} evaluations"));
        }
        if self.attention.is_interrupted() {
            terms.clear();
            return Err(MechanicsError::NotFinite { row: 0, what: "an interrupted model" });
        }
        self.model.terms(q, v, request, terms)
    }

    fn conserves_energy(&self) -> bool {
        self.model.conserves_energy()
    }

    fn prefers_batches(&self) -> bool {
        self.model.prefers_batches()
    }
}

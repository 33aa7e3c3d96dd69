//! Larger and larger libraries until one fits the motion: first without, then with friction that depends on the position and with a drive.

use super::drive::{Line, Residuals};
use super::error::FormulaError;
use super::extent::{Drive, Extent, Friction};
use super::families::Families;
use super::find::{FormulaOptions, WeakForm, held_out};
use super::found::{FoundFormula, Verdict};
use super::library::Library;
use super::obstacles::constrained;
use super::prepared::Prepared;
use super::thresholds::{DRIVEN_LIBRARY_ERROR, LARGER_LIBRARY_ERROR};
use crate::names::rounded;
use crate::recording::Recording;
use std::collections::BTreeSet;

impl FoundFormula {
    /// Finds a formula for the Lagrangian of recorded motion. If no families are given, searches larger and larger libraries until one fits the
    /// held-out motion; if none does, it also searches, as far as the options allow, for friction that depends on the position and for a
    /// periodic drive.
    ///
    /// # Errors
    /// [`FormulaError`] for motion that is too short, cannot be smoothed or does not determine a law, for example because a coordinate stands still;
    /// for a library that is too large, and for an invalid noise, function or term. Motion that the library cannot fit is not an error: the verdict reports
    /// it.
    pub fn of_motion(recording: &Recording, options: &FormulaOptions) -> Result<Self, FormulaError> {
        let expected = recording.n();
        if let Some(found) = options.noise.as_ref().map(Vec::len).filter(|found| *found != expected) {
            return Err(FormulaError::Noise { expected, found });
        }
        let rungs = options.families.map_or_else(|| rungs(&recording.periodic), |families| vec![families]);
        let friction = if options.friction { Friction::Constant } else { Friction::None };
        let first = Extent { families: rungs[0], gyroscopic: options.gyroscopic, friction, drive: None };
        Library::new(&recording.coordinates, &recording.periodic, first, &options.functions)?;
        let stop = &options.cancellation;
        stop.stage("smoothed motion");
        let data = Prepared::new(recording, options)?;
        stop.check()?;
        let held = constrained(recording, options.noise.as_ref(), stop)?;
        stop.check()?;
        let validation = held_out(&data, options.seed);
        let mut ladder = Ladder::new(&data, &validation, options, rungs);
        ladder.climb(friction)?;
        if options.friction && options.friction_of_position && !ladder.is_done() {
            ladder.climb(Friction::OfPosition)?;
        }
        if options.drive && !ladder.is_done() {
            ladder.drive()?;
        }
        let Ladder { searched, best, refused, notes, .. } = ladder;
        let mut found = best.ok_or_else(|| refused.unwrap_or(FormulaError::Singular))?;
        found.tried = searched;
        found.notes.extend(notes);
        found.notes.extend(data.suspicious.iter().cloned());
        if let Some(formula) = held {
            found.notes.push(format!(
            "the only trajectory satisfies {formula} = 0, by a constraint or by chance: terms that vanish with it are not determined, record more trajectories"
        ));
            found.several = true;
        }
        found.rescale(options.scale.as_ref())?;
        found.name_constants();
        stop.check()?;
        Ok(found)
    }
}

/// A search through libraries.
struct Ladder<'a> {
    data: &'a Prepared<'a>,
    held: &'a BTreeSet<usize>,
    options: &'a FormulaOptions,
    rungs: Vec<Families>,
    /// Libraries that were searched, and notes for the user.
    searched: Vec<String>,
    notes: Vec<String>,
    refused: Option<FormulaError>,
    best: Option<FoundFormula>,
    /// Smallest error of accelerations so far.
    least: f64,
    /// Residuals of the libraries without a drive.
    residuals: Vec<(Extent, Vec<Residuals>)>,
}

impl<'a> Ladder<'a> {
    fn new(
        data: &'a Prepared<'a>,
        held: &'a BTreeSet<usize>,
        options: &'a FormulaOptions,
        rungs: Vec<Families>,
    ) -> Self {
        let (searched, notes, residuals) = (Vec::new(), Vec::new(), Vec::new());
        Self { data, held, options, rungs, searched, notes, refused: None, best: None, least: f64::INFINITY, residuals }
    }

    /// `true` if a formula fits the motion.
    fn is_done(&self) -> bool {
        self.best.as_ref().is_some_and(|found| found.verdict != Verdict::NotInLibrary)
    }

    /// The weak form of a library; `None` if it has too many terms or does not apply.
    fn weak_form(&mut self, extent: &Extent) -> Result<Option<WeakForm>, FormulaError> {
        let recording = self.data.recording;
        let functions = &self.options.functions;
        let Ok(library) = Library::new(&recording.coordinates, &recording.periodic, extent.clone(), functions) else {
            self.searched.push(format!("{extent} (too many terms)"));
            return Ok(None);
        };
        self.searched.push(extent.to_string());
        self.options.cancellation.check()?;
        let weak = WeakForm::new(self.data, library, self.held, self.options);
        self.kept(weak)
    }

    /// A result; none after an error that another library may avoid.
    fn kept<T>(&mut self, result: Result<T, FormulaError>) -> Result<Option<T>, FormulaError> {
        self.options.cancellation.check()?;
        Ok(match result {
            Ok(result) => Some(result),
            Err(error) => {
                self.refused.get_or_insert(error);
                None
            }
        })
    }

    /// Searches the libraries in order, with this kind of friction.
    fn climb(&mut self, friction: Friction) -> Result<(), FormulaError> {
        // A long formula of high powers may be the series of a shorter one of other functions.
        let mut long = false;
        for families in self.rungs.clone() {
            if long && families.is_polynomial() {
                continue;
            }
            let extent = Extent { families, gyroscopic: self.options.gyroscopic, friction, drive: None };
            let Some(weak) = self.weak_form(&extent)? else { continue };
            // A library is fitted to the motion only if it fits accelerations better.
            let (error, before) = (weak.least(), self.least);
            self.least = self.least.min(error);
            let most = if long { before / LARGER_LIBRARY_ERROR } else { LARGER_LIBRARY_ERROR * before };
            let followed = match error > most {
                true => None,
                false => self.kept(weak.follow_all(self.data, self.held, self.options))?,
            };
            if self.options.drive && followed.as_ref().is_none_or(|found| found.verdict == Verdict::NotInLibrary) {
                self.residuals.push((extent, Residuals::of(&weak, self.data, self.held)));
            }
            let Some(mut found) = followed else { continue };
            let done = found.verdict != Verdict::NotInLibrary;
            let is_better = match &self.best {
                None => true,
                Some(best) if long => found.verdict == Verdict::Found && found.terms.len() < best.terms.len(),
                Some(best) => done || found.residual < best.residual,
            };
            let is_found = found.verdict == Verdict::Found;
            if is_better {
                found.basis = families.to_string();
                self.best = Some(found);
            }
            if done && !(is_found && families.is_polynomial() && families.polynomial > 2) {
                break;
            }
            long |= is_found;
        }
        Ok(())
    }

    /// Searches the libraries again with a drive, at the frequencies of lines in the residuals of any of them: one library may hide a line
    /// that another one shows.
    fn drive(&mut self) -> Result<(), FormulaError> {
        let Some(name) = drive_name(&self.data.recording.coordinates) else { return Ok(()) };
        let stop = &self.options.cancellation;
        stop.stage("periodic drives");
        let (mut least, mut tried) = (f64::INFINITY, BTreeSet::new());
        let (extents, residuals): (Vec<Extent>, Vec<Vec<Residuals>>) =
            std::mem::take(&mut self.residuals).into_iter().unzip();
        let lines = Residuals::lines(residuals.iter().flatten(), stop);
        for (extent, Line { frequency, .. }) in
            extents.iter().flat_map(|extent| lines.iter().map(move |line| (extent, *line)))
        {
            stop.check()?;
            let families = extent.families;
            let extent = Extent { drive: Some(Drive { name: name.to_string(), frequency }), ..extent.clone() };
            let Some(weak) = self.weak_form(&extent)? else { continue };
            // The remaining error of the frequency hides the differences between libraries.
            if weak.least() > DRIVEN_LIBRARY_ERROR * least {
                continue;
            }
            least = least.min(weak.least());
            tried.insert(rounded(frequency, 4));
            let followed = self.kept(weak.follow_all(self.data, self.held, self.options))?;
            let fits = |found: &FoundFormula| found.verdict != Verdict::NotInLibrary && found.drive.is_some();
            if let Some(mut found) = followed.filter(fits) {
                found.basis = families.to_string();
                self.best = Some(found);
                return Ok(());
            }
        }
        self.notes.push(match tried.is_empty() {
            true => "the residuals of the libraries show no frequency of a periodic drive".to_string(),
            false => {
                let tried = tried.into_iter().collect::<Vec<_>>().join(" or ");
                format!("a drive of {tried} rad/s does not explain the motion either")
            }
        });
        Ok(())
    }
}

/// A name for the frequency of a drive; `None` if a coordinate has the name of the time.
fn drive_name(coordinates: &[String]) -> Option<&'static str> {
    let free = |name: &&str| !coordinates.iter().any(|q| q == name);
    Some("t").filter(free).and_then(|_| ["om", "omega", "nu"].into_iter().find(free))
}

/// Libraries in the order in which they are searched.
fn rungs(periodic: &[bool]) -> Vec<Families> {
    let lines = periodic.iter().filter(|periodic| !**periodic).count();
    let degree = |degree: usize| Families { polynomial: degree, trigonometric: degree, ..Families::default() };
    let mut rungs = vec![degree(2), degree(3), degree(4)];
    if lines > 1 {
        rungs.push(Families { radial: 3, ..degree(2) });
    }
    if lines > 0 {
        rungs.push(Families { reciprocal: 3, ..degree(3) });
    }
    if lines > 1 {
        rungs.push(Families { radial: 3, reciprocal: 3, ..degree(3) });
    }
    rungs
}

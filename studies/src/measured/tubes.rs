//! Tubes around predicted motion: how many of a thousand fresh motions stay inside, for models of three small systems.

use super::Scale;
use super::determination::{CASES, Case, learn};
use lnn::analysis::{Tube, Window, predict_by_motion};
use lnn::data::StateEstimate;
use lnn::recording::{Recording, SmoothOptions, Smoothing};
use lnn::rollout::Between;

/// Systems whose models predict the motion.
const SYSTEMS: [&str; 3] = ["cart-pendulum", "pendulum with a known force", "two pendula"];
/// Seeds of the motions that are learned from, that give the tube, and that test it.
const SEEDS: [u64; 3] = [40, 41, 42];

/// Motions to learn from, to take the tube from and to test it with, and how long they last in s.
#[derive(Clone, Copy)]
pub struct Motions {
    /// Motions of the three kinds.
    pub counts: [usize; 3],
    /// Their length in s.
    pub seconds: f64,
    /// How far ahead they are predicted in s.
    pub ahead: f64,
}

/// The beginning of every motion, from its smoothed state.
fn beginnings(recording: &Recording, ahead: f64) -> Vec<Window> {
    let smoothing = Smoothing::choose(recording, &SmoothOptions::default()).expect("long trajectories");
    let first = |track| {
        let states = smoothing.apply(track).expect("a long trajectory");
        let samples = states.interior().start..states.times.len();
        let estimate = StateEstimate { track, q: &states.q, v: &states.v, between: Between::default() };
        Window::cut(estimate, samples, recording.n(), ahead).into_iter().next()
    };
    recording.tracks.iter().filter_map(first).collect()
}

/// Prints and returns rows `system,share,calibrated,fresh,inside,half_width` of one system; the width is that at the end, over all coordinates.
fn one(case: &Case, motions: Motions, scale: Scale) -> Vec<String> {
    let Motions { counts, seconds, ahead } = motions;
    let recorded = |kind: usize| case.recording(counts[kind], seconds, SEEDS[kind]);
    let (_, model, remark) = learn(&recorded(0), (SEEDS[0], scale.epochs), |config| {
        config.network.hidden = scale.hidden.to_vec();
        config.network.dissipation = (!case.friction.is_empty()).then_some(16);
    });
    println!("{}: {remark}", case.name);
    let [(windows, predictions), (fresh, predicted)] = [1, 2].map(|kind| {
        let windows = beginnings(&recorded(kind), ahead);
        let predictions = predict_by_motion(&model, &windows, super::THREADS);
        (windows, predictions)
    });
    let row = |share: f64| {
        let tube = Tube::new(&windows, &predictions, case.periodic.len(), share).expect("motions that are predicted");
        let inside = fresh.iter().zip(&predicted).filter(|(window, predicted)| tube.holds(window, predicted)).count();
        let width = tube.half_widths(ahead).into_iter().fold(0.0, f64::max);
        let share_inside = 100.0 * inside as f64 / fresh.len() as f64;
        println!(
            "  {share}: {share_inside:.1} % of {} fresh motions, half width at most {width:.4} at the end",
            fresh.len()
        );
        format!("{},{share},{},{},{inside},{width}", case.name, windows.len(), fresh.len())
    };
    [0.5, 0.9].map(row).to_vec()
}

/// All systems.
pub fn compare(motions: Motions, scale: Scale) -> Vec<String> {
    let chosen = CASES.iter().filter(|case| SYSTEMS.contains(&case.name));
    chosen.flat_map(|case| one(case, motions, scale)).collect()
}

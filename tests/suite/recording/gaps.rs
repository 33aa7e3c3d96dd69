//! Recordings with dropped frames and uneven clocks beside the same without.

use lnn::lagrangian::{Request, SystemInstance, Terms};
use lnn::recording::{Columns, LoadedRecording, SmoothOptions, Smoothing};
use lnn::rollout::{RolloutOptions, rollout};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;

const TAKES: usize = 20;
const FRAMES: usize = 500;
const STEP: f64 = 0.01;
const SIGMA: f64 = 1e-3;

/// A take: noisy angles of a double pendulum, and exact velocities and accelerations, `(frames, 2)` each.
fn takes() -> Vec<[Vec<f64>; 3]> {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let model = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
    let mut take = |_| {
        let start: [f64; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let options = RolloutOptions::reference((FRAMES - 1) as f64 * STEP, STEP);
        let motion = rollout(&*model, &start[..2], &start[2..], &options).complete().unwrap();
        let mut terms = Terms::default();
        model.terms(&motion.q, &motion.v, Request::ACCELERATION, &mut terms).unwrap();
        let noisy = |x: &f64| x + SIGMA * Distribution::<f64>::sample(&StandardNormal, &mut rng);
        [motion.q.iter().map(noisy).collect(), motion.v, terms.acceleration]
    };
    (0..TAKES).map(&mut take).collect()
}

/// The frames of every take for which `kept` says so, as a file is read.
fn read(takes: &[[Vec<f64>; 3]], kept: &[Vec<bool>]) -> LoadedRecording {
    let mut text = "run,t,a,b\n".to_string();
    for (run, (take, kept)) in takes.iter().zip(kept).enumerate() {
        for (k, q) in take[0].chunks_exact(2).enumerate().filter(|(k, _)| kept[*k]) {
            writeln!(text, "{run},{:.2},{:.9},{:.9}", k as f64 * STEP, q[0], q[1]).unwrap();
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("takes.csv");
    std::fs::write(&path, text).unwrap();
    let coords = ["a", "b"].map(String::from).to_vec();
    let columns = Columns { periodic: coords.clone(), coords, trajectory: Some("run".into()), ..Columns::default() };
    LoadedRecording::read(&[path], &columns).unwrap()
}

/// Of the samples that are learned from: their share of all frames read, and root mean square errors of velocities and accelerations.
fn judge(reading: &LoadedRecording, takes: &[[Vec<f64>; 3]], options: &SmoothOptions) -> [f64; 3] {
    let smoothing = Smoothing::choose(&reading.recording, options).unwrap();
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for (track, take) in reading.recording.tracks.iter().zip(takes) {
        let found = smoothing.apply(track).unwrap();
        for at in (0..track.len()).filter(|at| found.is_full(*at)) {
            let frame = (track.times[at] / STEP).round() as usize;
            for i in 0..2 {
                squares[0] += 0.5 * (found.v[2 * at + i] - take[1][2 * frame + i]).powi(2);
                squares[1] += 0.5 * (found.a[2 * at + i] - take[2][2 * frame + i]).powi(2);
            }
            count += 1.0;
        }
    }
    let [v, a] = squares.map(|square| (square / count).sqrt());
    [count / reading.recording.samples() as f64, v, a]
}

#[test]
fn dropped_frames_leave_takes_whole() {
    let takes = takes();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let all = vec![vec![true; FRAMES]; TAKES];
    let mut dropped: Vec<Vec<bool>> =
        (0..TAKES).map(|_| (0..FRAMES).map(|_| rng.random_range(0.0..1.0) >= 0.03).collect()).collect();
    dropped.iter_mut().for_each(|kept| kept[0] = true);
    let (even, gaps) = (read(&takes, &all), read(&takes, &dropped));
    let missing = dropped.iter().map(|kept| kept[..=kept.iter().rposition(|kept| *kept).unwrap()].iter());
    let missing: usize = missing.map(|kept| kept.filter(|kept| !**kept).count()).sum();
    assert_eq!((gaps.recording.tracks.len(), gaps.cuts.len(), gaps.dropped.len()), (TAKES, 0, 0));
    assert_eq!((gaps.bridged.rows, even.bridged.gaps), (missing, 0));
    for window in [None, Some(9), Some(19), Some(25), Some(31), Some(41)] {
        let options = SmoothOptions { window, ..SmoothOptions::default() };
        let [whole, found] = [&even, &gaps].map(|reading| judge(reading, &takes, &options));
        println!("{window:?}: share, v, a: {whole:?} without gaps, {found:?} with");
        assert!(found[0] > whole[0] - 0.02, "{} of the samples are used, {} without gaps", found[0], whole[0]);
        assert!(found[1] < 1.2 * whole[1] && found[2] < 1.2 * whole[2], "{found:?} {whole:?}");
    }
}

#[test]
fn uneven_clocks_leave_takes_whole() {
    let takes = takes();
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    // Steps of one to three frames, and of two as often as not.
    for steps in [&[1, 2, 3][..], &[1, 1, 1, 2, 3]] {
        let mut walk = |_| {
            let mut kept = vec![false; FRAMES];
            let mut at = 0;
            while at < FRAMES {
                kept[at] = true;
                at += steps[rng.random_range(0..steps.len())];
            }
            kept
        };
        let uneven: Vec<Vec<bool>> = (0..TAKES).map(&mut walk).collect();
        let mean = steps.iter().sum::<usize>() as f64 / steps.len() as f64;
        let every: Vec<bool> = (0..FRAMES).map(|k| k % 2 == 0).collect();
        let (found, even) = (read(&takes, &uneven), read(&takes, &vec![every; TAKES]));
        assert_eq!((found.recording.tracks.len(), found.cuts.len(), found.bridged.gaps), (TAKES, 0, 0));
        let [whole, found] = [&even, &found].map(|reading| judge(reading, &takes, &SmoothOptions::default()));
        println!("{steps:?}: share, v, a: {whole:?} every second frame, {found:?} uneven");
        assert!(found[0] > whole[0] - 0.05 && found[2] < 1.3 * (mean / 2.0).sqrt() * whole[2], "{found:?} {whole:?}");
    }
}

#[test]
fn angles_turn_on_across_gaps_and_are_cut_where_it_is_a_guess() {
    // 25 rad/s: half a turn is passed in 13 frames of 0.01 s, and a gap of 8 missing frames turns by 2.25 rad.
    let turn = |k: usize| (25.0 * k as f64 * STEP).rem_euclid(std::f64::consts::TAU);
    let fast = |k: usize| (45.0 * k as f64 * STEP).rem_euclid(std::f64::consts::TAU);
    let take = [(0..FRAMES).flat_map(|k| [turn(k), fast(k)]).collect(), vec![], vec![]];
    let kept: Vec<bool> = (0..FRAMES).map(|k| !(k > 100 && (k / 50) % 2 == 1 && k % 50 < 8)).collect();
    let reading = read(&[take], std::slice::from_ref(&kept));
    let [track] = reading.recording.tracks.as_slice() else { panic!("{:?}", reading.cuts) };
    for (at, frame) in kept.iter().enumerate().filter(|(_, kept)| **kept).map(|(frame, _)| frame).enumerate() {
        for (i, pace) in [25.0, 45.0].into_iter().enumerate() {
            let turned = track.q[2 * at + i] - track.q[i];
            assert!((turned - pace * frame as f64 * STEP).abs() < 1e-6, "{i} {frame}: {turned}");
        }
    }
    // A pace that changes by 20 rad/s over a gap of 0.1 s.
    let turn = |k: usize| 5.0 * (k as f64 * STEP) + if k > 250 { 20.0 * (k as f64 - 250.0) * STEP } else { 0.0 };
    let take = [(0..FRAMES).flat_map(|k| [turn(k); 2]).collect(), vec![], vec![]];
    let kept: Vec<bool> = (0..FRAMES).map(|k| !(246..255).contains(&k)).collect();
    let reading = read(&[take], &[kept]);
    assert_eq!((reading.recording.tracks.len(), reading.cuts.len(), reading.takes), (2, 1, vec![0, 0]));
}

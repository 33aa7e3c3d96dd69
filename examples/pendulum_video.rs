//! From the pixels of a filmed double pendulum to its angles.
//!
//! `cargo run --example pendulum_video -- IN.csv OUT.csv --rate 400`: every line of IN is a frame,
//! `x_red,y_red,x_green,y_green,x_blue,y_blue`, pivot, elbow and end in image coordinates (y down), no header. OUT gets
//! `t,theta1,theta2`: s, and rad from the downward vertical, counterclockwise, going on past a full turn.

use std::f64::consts::TAU;

/// Mean length of each arm and its scatter, in pixels; frames over which the pivot was averaged; angles, rad, unwrapped.
pub struct Film {
    pub arms: [(f64, f64); 2],
    pub window: usize,
    pub angles: Vec<[f64; 2]>,
}

/// The six numbers of every line.
pub fn read(text: &str) -> Result<Vec<[f64; 6]>, String> {
    let parse = |(k, line): (usize, &str)| {
        let number = |(column, field): (usize, &str)| match field.trim().parse() {
            Ok(x) if f64::is_finite(x) => Ok(x),
            _ => Err(format!("row {}, column {}: expected a finite number, found {field:?}", k + 1, column + 1)),
        };
        let numbers = line.split(',').enumerate().map(number).collect::<Result<Vec<f64>, _>>()?;
        numbers.try_into().map_err(|x: Vec<f64>| format!("row {}: expected 6 numbers, found {}", k + 1, x.len()))
    };
    text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).map(parse).collect()
}

fn mean_and_scatter(x: &[f64]) -> (f64, f64) {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    (mean, (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt())
}

/// Running mean of the pivot over `2 half + 1` frames, fewer at the ends.
fn pivot(frames: &[[f64; 6]], half: usize) -> Vec<[f64; 2]> {
    let mean = |k: usize| {
        let window = &frames[k.saturating_sub(half)..(k + half + 1).min(frames.len())];
        [0, 1].map(|i| window.iter().map(|f| f[i]).sum::<f64>() / window.len() as f64)
    };
    (0..frames.len()).map(mean).collect()
}

/// Fits the arms; the pivot, moving or noisy, is averaged over as many frames as make the first arm most rigid.
pub fn fit(frames: &[[f64; 6]]) -> Option<Film> {
    let first = |half| -> Vec<f64> {
        frames.iter().zip(pivot(frames, half)).map(|(f, p)| (f[2] - p[0]).hypot(f[3] - p[1])).collect()
    };
    let windows = [0, 1, 2, 3, 5, 7, 10, 15, 22, 32, 64, 128, 256];
    let fits = windows.map(|half| (half, mean_and_scatter(&first(half))));
    let (half, arm) = fits.into_iter().min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let second: Vec<f64> = frames.iter().map(|f| (f[4] - f[2]).hypot(f[5] - f[3])).collect();
    let mut angles: Vec<[f64; 2]> = Vec::with_capacity(frames.len());
    for (f, p) in frames.iter().zip(pivot(frames, half)) {
        let new = [(f[2] - p[0]).atan2(f[3] - p[1]), (f[4] - f[2]).atan2(f[5] - f[3])];
        let last = angles.last().copied().unwrap_or(new);
        angles.push([0, 1].map(|i| new[i] + TAU * ((last[i] - new[i]) / TAU).round()));
    }
    (!frames.is_empty()).then_some(Film { arms: [arm, mean_and_scatter(&second)], window: 2 * half + 1, angles })
}

/// Does what the arguments say, and says what was found.
pub fn convert(arguments: &[String]) -> Result<String, Box<dyn std::error::Error>> {
    let [input, output, flag, rate] = arguments else { return Err("usage: IN.csv OUT.csv --rate HZ".into()) };
    let rate = rate.parse().ok().filter(|r: &f64| flag == "--rate" && r.is_finite() && *r > 0.0);
    let rate = rate.ok_or("--rate: expected a positive number of frames per second")?;
    let frames = std::fs::read_to_string(input).map_err(|e| e.to_string()).and_then(|text| read(&text));
    let film = frames.and_then(|frames| fit(&frames).ok_or("no frames".to_string()));
    let Film { arms: [(l1, s1), (l2, s2)], window, angles } = film.map_err(|problem| format!("{input}: {problem}"))?;
    let rows = angles.iter().zip(0..).map(|([a, b], k)| format!("{},{a:.6},{b:.6}\n", f64::from(k) / rate));
    std::fs::write(output, "t,theta1,theta2\n".to_string() + &rows.collect::<String>())?;
    let arms =
        format!("arms {l1:.2} and {l2:.2} pixels, scatter {s1:.2} and {s2:.2}, pivot averaged over {window} frames");
    Ok(format!("{} frames, {arms}", angles.len()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("{}", convert(&std::env::args().skip(1).collect::<Vec<_>>())?);
    Ok(())
}

//! From the pixels of a filmed double pendulum to its angles.
//!
//! `cargo run --example pendulum_video -- IN.csv OUT.csv --rate 400 --down x`: every line of IN is a frame,
//! `x_red,y_red,x_green,y_green,x_blue,y_blue`, pivot, elbow and end in image coordinates (x to the right, y down the picture), no
//! header. OUT gets `t,theta1,theta2`: s, and rad from the direction in which a resting arm hangs, counterclockwise as the
//! picture shows it, going on past a full turn.
//!
//! `--down` names that direction in the picture: `y`, as a camera held upright sees it (the default), `x`, `-x` or `-y`. The
//! motion itself tells where gravity pulls: the equation of motion of the first arm is fitted to it, the pull is printed, and
//! a direction that it contradicts is refused.

use std::f64::consts::TAU;
use std::io::Write;

/// Mean length of each arm and its scatter, in pixels; frames over which the pivot was averaged; angles, rad, unwrapped.
pub struct Film {
    pub arms: [(f64, f64); 2],
    pub window: usize,
    pub angles: Vec<[f64; 2]>,
}

/// Direction in the picture in which an arm at rest hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Down {
    Right,
    Left,
    Bottom,
    Top,
}

impl Down {
    pub const ALL: [Self; 4] = [Self::Right, Self::Left, Self::Bottom, Self::Top];

    /// As the option and the messages call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "x",
            Self::Left => "-x",
            Self::Bottom => "y",
            Self::Top => "-y",
        }
    }

    /// The unit vector, in image coordinates.
    fn axis(self) -> [f64; 2] {
        match self {
            Self::Right => [1.0, 0.0],
            Self::Left => [-1.0, 0.0],
            Self::Bottom => [0.0, 1.0],
            Self::Top => [0.0, -1.0],
        }
    }

    /// Angle of a vector of the picture from here, counterclockwise as the eye sees it.
    fn angle(self, [x, y]: [f64; 2]) -> f64 {
        let [a, b] = self.axis();
        // A quarter turn counterclockwise, y pointing down the picture, takes (a, b) to (b, -a).
        (x * b - y * a).atan2(x * a + y * b)
    }
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

/// Fits the arms; the pivot, moving or noisy, is averaged over as many frames as make the first arm most rigid. Angles are
/// counted from `down`.
pub fn fit(frames: &[[f64; 6]], down: Down) -> Option<Film> {
    let first = |half| -> Vec<f64> {
        frames.iter().zip(pivot(frames, half)).map(|(f, p)| (f[2] - p[0]).hypot(f[3] - p[1])).collect()
    };
    let windows = [0, 1, 2, 3, 5, 7, 10, 15, 22, 32, 64, 128, 256];
    let fits = windows.map(|half| (half, mean_and_scatter(&first(half))));
    let (half, arm) = fits.into_iter().min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let second: Vec<f64> = frames.iter().map(|f| (f[4] - f[2]).hypot(f[5] - f[3])).collect();
    let mut angles: Vec<[f64; 2]> = Vec::with_capacity(frames.len());
    for (f, p) in frames.iter().zip(pivot(frames, half)) {
        let new = [[f[2] - p[0], f[3] - p[1]], [f[4] - f[2], f[5] - f[3]]].map(|arm| down.angle(arm));
        let last = angles.last().copied().unwrap_or(new);
        angles.push([0, 1].map(|i| new[i] + TAU * ((last[i] - new[i]) / TAU).round()));
    }
    (!frames.is_empty()).then_some(Film { arms: [arm, mean_and_scatter(&second)], window: 2 * half + 1, angles })
}

/// Seconds on either side over which derivatives are fitted.
const REACH: f64 = 0.02;
/// Constants of the equation of the first arm.
const CONSTANTS: usize = 6;

/// Pull of gravity on the first arm along x and y of the picture, per s^2, if the motion tells.
///
/// `theta1'' = a sin(theta2 - theta1) theta2'^2 - a cos(theta2 - theta1) theta2'' - X sin theta1 + Y cos theta1 - friction` holds for a
/// double pendulum with angles from the x axis; `a`, `X`, `Y` and two frictions are fitted to derivatives by local
/// parabolas. None if they explain less than nine tenths of the accelerations, or if the pull is less than ten times its
/// standard error.
pub fn pull(angles: &[[f64; 2]], down: Down, rate: f64) -> Option<[f64; 2]> {
    let half = ((REACH * rate).round() as usize).max(2);
    // Least squares of a parabola over `2 half + 1` frames: sums of the even powers of the offset.
    let power = |p: i32| (1..=half).map(|k| 2.0 * (k as f64).powi(p)).sum::<f64>();
    let (count, second, fourth) = (2.0 * half as f64 + 1.0, power(2), power(4));
    let derivatives = |k: usize, i: usize| {
        let at = |j: usize| angles[k + j - half][i];
        let offset = |j: usize| j as f64 - half as f64;
        let sum = |weight: &dyn Fn(f64) -> f64| (0..=2 * half).map(|j| weight(offset(j)) * at(j)).sum::<f64>();
        let slope = sum(&|x| x) / second;
        let curvature = 2.0 * sum(&|x| count * x * x - second) / (count * fourth - second * second);
        [slope * rate, curvature * rate * rate]
    };
    let (mut normal, mut right, mut squares, mut rows) = ([[0.0; CONSTANTS]; CONSTANTS], [0.0; CONSTANTS], 0.0, 0.0);
    for k in half..angles.len().saturating_sub(half) {
        let ([v1, a1], [v2, a2]) = (derivatives(k, 0), derivatives(k, 1));
        let [first, between] = [angles[k][0], angles[k][1] - angles[k][0]];
        let inertia = between.sin() * v2 * v2 - between.cos() * a2;
        let row = [inertia, -first.sin(), first.cos(), -v1, v2 - v1, 1.0];
        for (i, x) in row.iter().enumerate() {
            right[i] += x * a1;
            row.iter().zip(&mut normal[i]).for_each(|(y, sum)| *sum += x * y);
        }
        squares += a1 * a1;
        rows += 1.0;
    }
    let fitted = solve(normal, right)?;
    let explained: f64 = fitted.iter().zip(right).map(|(x, r)| x * r).sum();
    let [along, across] = [fitted[1], fitted[2]];
    // Neighbours share the frames of their parabolas.
    let independent = rows / count - CONSTANTS as f64;
    let unit = |i: usize| std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
    let spread = solve(normal, unit(1))?[1] + solve(normal, unit(2))?[2];
    let error = ((squares - explained).max(0.0) / rows * count * spread).sqrt();
    let clear = independent > 1.0 && along.hypot(across) > 10.0 * error;
    let [a, b] = down.axis();
    // From down and the direction a quarter turn from it to x and y.
    (clear && explained > 0.9 * squares).then_some([along * a + across * b, along * b - across * a])
}

/// Gauss elimination with pivoting.
fn solve(mut a: [[f64; CONSTANTS]; CONSTANTS], mut b: [f64; CONSTANTS]) -> Option<[f64; CONSTANTS]> {
    for k in 0..CONSTANTS {
        let pivot = (k..CONSTANTS).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        a.swap(k, pivot);
        b.swap(k, pivot);
        if a[k][k].is_nan() || a[k][k] == 0.0 {
            return None;
        }
        let (row, x) = (a[k], b[k]);
        for i in k + 1..CONSTANTS {
            let factor = a[i][k] / row[k];
            row.iter().zip(&mut a[i]).for_each(|(r, x)| *x -= factor * r);
            b[i] -= factor * x;
        }
    }
    for k in (0..CONSTANTS).rev() {
        let known: f64 = (k + 1..CONSTANTS).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    Some(b)
}

/// What the motion says about down, or that it says something else.
fn judged(film: &Film, down: Down, rate: f64) -> Result<String, String> {
    let Some([x, y]) = pull(&film.angles, down, rate) else {
        return Ok(format!("down is {}, of which the motion says nothing", down.name()));
    };
    let along = |axis: [f64; 2]| x * axis[0] + y * axis[1];
    let said = format!("gravity pulls with {x:.1} per s^2 along x and {y:.1} along y");
    let falls = Down::ALL.into_iter().max_by(|a, b| along(a.axis()).total_cmp(&along(b.axis()))).unwrap_or(down);
    if falls == down {
        Ok(format!("{said}: down is {}", down.name()))
    } else {
        Err(format!("--down {}: {said}: give --down {}", down.name(), falls.name()))
    }
}

/// Does what the arguments say, and says what was found.
pub fn convert(arguments: &[String]) -> Result<String, Box<dyn std::error::Error>> {
    let usage = "usage: IN.csv OUT.csv --rate HZ [--down x|-x|y|-y]";
    let (mut files, mut rate, mut down) = (Vec::new(), None, Down::Bottom);
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--rate" => rate = rest.next(),
            "--down" => {
                let name = rest.next().map_or("", String::as_str).trim_start_matches('+');
                let known = Down::ALL.into_iter().find(|down| down.name() == name);
                down = known.ok_or_else(|| format!("--down: expected x, -x, y or -y, found {name:?}"))?;
            }
            _ => files.push(argument),
        }
    }
    let [input, output] = files[..] else { return Err(usage.into()) };
    let rate = rate.and_then(|text| text.parse().ok()).filter(|r: &f64| r.is_finite() && *r > 0.0);
    let rate = rate.ok_or("--rate: expected a positive number of frames per second")?;
    let frames = std::fs::read_to_string(input).map_err(|e| e.to_string()).and_then(|text| read(&text));
    let film = frames.and_then(|frames| fit(&frames, down).ok_or("no frames".to_string()));
    let judged = film.and_then(|film| judged(&film, down, rate).map(|said| (film, said)));
    let (film, said) = judged.map_err(|problem| format!("{input}: {problem}"))?;
    let Film { arms: [(l1, s1), (l2, s2)], window, angles } = film;
    let rows = angles.iter().zip(0..).map(|([a, b], k)| format!("{},{a:.6},{b:.6}\n", f64::from(k) / rate));
    // A file that is there, the film itself perhaps, is not overwritten.
    let mut file = std::fs::File::create_new(output).map_err(|e| format!("{output}: {e}"))?;
    file.write_all(("t,theta1,theta2\n".to_string() + &rows.collect::<String>()).as_bytes())?;
    let arms =
        format!("arms {l1:.2} and {l2:.2} pixels, scatter {s1:.2} and {s2:.2}, pivot averaged over {window} frames");
    Ok(format!("{} frames, {arms}; {said}", angles.len()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("{}", convert(&std::env::args().skip(1).collect::<Vec<_>>())?);
    Ok(())
}

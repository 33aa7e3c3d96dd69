//! Pictures of pixels, and the sky: a checkerboard in latitude and longitude with a colour for every quadrant.

use super::RelativityError;
use super::camera::Camera;
use super::rays::RayOutcome;
use super::shadow::{Shadow, angle};

/// A picture of red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixels, row by row from the upper left corner.
    pub pixels: Vec<[u8; 3]>,
}

impl Image {
    /// Pictures side by side, with white columns between them; pictures lower than the highest are filled with white below.
    pub fn beside(images: &[Self], gap: usize) -> Self {
        let white = [255; 3];
        let height = images.iter().map(|image| image.height).max().unwrap_or(0);
        let mut pixels = Vec::new();
        for row in 0..height {
            for (k, image) in images.iter().enumerate() {
                pixels.extend(std::iter::repeat_n(white, if k > 0 { gap } else { 0 }));
                match image.pixels.chunks_exact(image.width.max(1)).nth(row) {
                    Some(row) => pixels.extend_from_slice(row),
                    None => pixels.extend(std::iter::repeat_n(white, image.width)),
                }
            }
        }
        let width = images.iter().map(|image| image.width).sum::<usize>() + gap * images.len().saturating_sub(1);
        Self { width, height, pixels }
    }
}

/// A celestial sphere of squares, four colours around the point that the camera looks at, and a white disc there: where its light comes all
/// around the centre it becomes Einstein's ring.
///
/// Source: four quadrants and a white spot as in Bohn et al., Class. Quantum Grav. 32, 065002 (2015).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Longitude of the point that the camera looks at, in rad.
    pub longitude: f64,
    /// Side of a square, in rad.
    pub square: f64,
    /// Direction of the white disc and its radius in rad.
    pub disc: ([f64; 3], f64),
}

/// Colours of the quadrants: upper left, upper right, lower left, lower right.
const QUADRANTS: [[u8; 3]; 4] = [[76, 175, 80], [229, 72, 77], [66, 118, 220], [245, 196, 66]];
/// Colours of the quadrants of the second sky, and of the lines over them.
const SECOND: [[u8; 3]; 4] = [[92, 70, 176], [170, 62, 150], [30, 132, 150], [150, 110, 70]];
const SECOND_LINES: [u8; 3] = [244, 236, 208];
/// Distance of two lines in sides of a square, and half of the width of a line over it.
const LINES: f64 = 2.0;
const LINE: f64 = 0.06;
/// Brightness of every other square.
const DARK: f64 = 0.55;
/// Colour of rays that were left unfinished.
const UNFINISHED: [u8; 3] = [255, 0, 255];
/// Colours of differences: equal, far apart, in the shadow of one alone.
const DIFFERENCES: [[u8; 3]; 3] = [[255, 255, 255], [25, 55, 140], [215, 30, 40]];
/// Angles of the first and of the last colour of a difference, in degrees.
const ANGLES: (f64, f64) = (0.01, 10.0);

/// A colour between two.
fn between(a: [u8; 3], b: [u8; 3], part: f64) -> [u8; 3] {
    std::array::from_fn(|i| (f64::from(a[i]) + part * (f64::from(b[i]) - f64::from(a[i]))).round() as u8)
}

impl Sky {
    /// The sky around a camera: squares of 10 degrees, a disc of 3 degrees straight behind the centre.
    pub fn around(camera: &Camera) -> Self {
        let forward = camera.axes()[2];
        let longitude = camera.azimuth + std::f64::consts::PI;
        Self { longitude, square: 10f64.to_radians(), disc: (forward, 3f64.to_radians()) }
    }

    /// Angles of a direction, a unit vector: to the left of the point that the camera looks at, and above the equator; and the index of the
    /// quadrant around that point.
    fn angles(&self, [x, y, z]: [f64; 3]) -> (f64, f64, usize) {
        let (sin, cos) = self.longitude.sin_cos();
        let left = (cos * y - sin * x).atan2(cos * x + sin * y);
        let above = z.clamp(-1.0, 1.0).asin();
        (left, above, usize::from(left < 0.0) + 2 * usize::from(above < 0.0))
    }

    /// Colour of a direction in the second region: a grid of bright lines on quadrants of other colours, a white disc around
    /// the point that the ray of the centre shows.
    fn second_colour(&self, direction: [f64; 3]) -> [u8; 3] {
        let mirrored = direction.map(|x| -x);
        if angle(mirrored, self.disc.0) < self.disc.1 {
            return [255; 3];
        }
        let (left, above, quadrant) = self.angles(mirrored);
        let side = LINES * self.square;
        let from_line = |x: f64| (x / side - (x / side).round()).abs();
        // Meridians are as wide as circles of latitude.
        let is_line = from_line(above) < LINE || from_line(left) * above.cos() < LINE;
        if is_line { SECOND_LINES } else { SECOND[quadrant] }
    }

    /// Colour of a direction, a unit vector.
    pub(crate) fn colour(&self, direction: [f64; 3]) -> [u8; 3] {
        if angle(direction, self.disc.0) < self.disc.1 {
            return [255; 3];
        }
        let (left, above, quadrant) = self.angles(direction);
        let quadrant = QUADRANTS[quadrant];
        let odd = ((left / self.square).floor() + (above / self.square).floor()).rem_euclid(2.0) == 1.0;
        if odd { between([0; 3], quadrant, DARK) } else { quadrant }
    }

    /// The picture of a camera's rays: the shadow is black.
    pub fn image(&self, shadow: &Shadow) -> Image {
        let colour = |fate: RayOutcome| match fate {
            RayOutcome::Captured => [0; 3],
            RayOutcome::Escaped(direction) => self.colour(direction),
            RayOutcome::Crossed(direction) => self.second_colour(direction),
            RayOutcome::Unfinished => UNFINISHED,
        };
        let pixels = shadow.rays.iter().map(|ray| colour(ray.fate)).collect();
        Image { width: shadow.width, height: shadow.height, pixels }
    }
}

/// The difference of two pictures: from white to blue the angle between the points on the sky, 0.01 to 10 degrees, logarithmic; red for the
/// shadow of one alone, black for the shadow of both.
///
/// # Errors
/// [`RelativityError::Sizes`].
pub fn difference_image(first: &Shadow, second: &Shadow) -> Result<Image, RelativityError> {
    let (low, high) = (ANGLES.0.to_radians().ln(), ANGLES.1.to_radians().ln());
    let colour = |pair| match pair {
        (Some((one, a)), Some((other, b))) if one == other => {
            let part = (angle(a, b).max(f64::MIN_POSITIVE).ln() - low) / (high - low);
            between(DIFFERENCES[0], DIFFERENCES[1], part.clamp(0.0, 1.0))
        }
        (None, None) => [0; 3],
        _ => DIFFERENCES[2],
    };
    let pixels = first.pairs(second)?.map(colour).collect();
    Ok(Image { width: first.width, height: first.height, pixels })
}

#[cfg(test)]
mod tests {
    use super::super::rays::Ray;
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let one = Image { width: 1, height: 2, pixels: vec![[1; 3], [2; 3]] };
        let two = Image { width: 2, height: 1, pixels: vec![[3; 3], [4; 3]] };
        let both = Image::beside(&[one, two], 1);
        let (white, numbers) = ([255; 3], |k: u8| [k; 3]);
        assert_eq!((both.width, both.height), (4, 2));
        assert_eq!(both.pixels[..4], [numbers(1), white, numbers(3), numbers(4)]);
        assert_eq!(both.pixels[4..], [numbers(2), white, white, white]);
        assert_eq!(Image::beside(&[], 3), Image { width: 0, height: 0, pixels: Vec::new() });
    }

    #[test]
    fn quadrants_meet_behind_the_centre() {
        let camera = Camera { azimuth: 2.0, ..Camera::new(10.0, 1.2) };
        let sky = Sky::around(&camera);
        let [right, up, forward] = camera.axes();
        let toward = |u: f64, v: f64| {
            let vector: [f64; 3] = std::array::from_fn(|i| forward[i] + u * right[i] + v * up[i]);
            super::super::orbits::scaled(super::super::orbits::norm(vector).recip(), vector)
        };
        assert_eq!(sky.colour(forward), [255; 3]);
        let same = |found: [u8; 3], of: [u8; 3]| found == of || found == between([0; 3], of, DARK);
        // The equator is above, as the camera looks down.
        for (quadrant, (u, v)) in QUADRANTS.into_iter().zip([(-0.1, 0.7), (0.1, 0.7), (-0.1, -0.1), (0.1, -0.1)]) {
            assert!(same(sky.colour(toward(u, v)), quadrant), "{u} {v}");
        }
        // Neighbours differ in brightness.
        let (a, b) = (sky.colour(toward(-0.08, -0.1)), sky.colour(toward(-0.25, -0.1)));
        assert!(same(b, QUADRANTS[2]) && a != b);
    }

    #[test]
    fn differences_have_their_colours() {
        let direction = |angle: f64| RayOutcome::Escaped([angle.sin(), angle.cos(), 0.0]);
        let of = |fates: [RayOutcome; 4]| Shadow {
            width: 4,
            height: 1,
            rays: fates.into_iter().map(|fate| Ray { fate, steps: 2, drift: 1e-9 }).collect(),
        };
        let first = of([direction(0.3), direction(0.0), RayOutcome::Captured, RayOutcome::Captured]);
        let second = of([direction(0.3), direction(0.4), RayOutcome::Captured, direction(1.0)]);
        let image = difference_image(&first, &second).unwrap();
        assert_eq!(image.pixels, [DIFFERENCES[0], DIFFERENCES[1], [0; 3], DIFFERENCES[2]]);
        let difference = first.difference(&second).unwrap();
        assert_eq!(difference.shadow, 0.25);
        assert!(
            (difference.most - 0.4).abs() < 1e-14 && (first.share(), second.unfinished(), first.steps()) == (0.5, 0, 8)
        );
        let small = Shadow { width: 2, height: 2, ..second };
        assert!(matches!(first.difference(&small), Err(RelativityError::Sizes { .. })));
        assert!(difference_image(&first, &small).is_err());
    }

    #[test]
    fn angles_are_right_near_the_ends() {
        for exact in [0.0, 1e-9, 0.3, 2.0, 3.1] {
            let found = angle([0.0, 0.0, 1.0], [f64::sin(exact), 0.0, f64::cos(exact)]);
            assert!((found - exact).abs() < 1e-12 * exact.max(1e-3), "{exact} {found}");
        }
    }
}

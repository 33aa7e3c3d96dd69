//! Colours.

/// Colours that people with any colour vision tell apart (Wong 2011), yellow left out.
pub(super) const LINES: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333"];
/// Colour of what deserves attention: the start of a path, a wrong sign.
pub(super) const MARK: &str = "#D55E00";
/// Colour of places without a value.
pub(super) const GAP: [u8; 3] = [0xbb, 0xbb, 0xbb];

/// Colours at equal distances, linear between them.
pub(super) type Scale = &'static [[u8; 3]];

/// Viridis of matplotlib, from dark to bright.
pub(super) const VIRIDIS: Scale = &[
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3e, 0x49, 0x89],
    [0x31, 0x68, 0x8e],
    [0x26, 0x82, 0x8e],
    [0x1f, 0x9e, 0x89],
    [0x35, 0xb7, 0x79],
    [0x6e, 0xce, 0x58],
    [0xb5, 0xde, 0x2b],
    [0xfd, 0xe7, 0x25],
];

/// Blue, white, red (ColorBrewer).
pub(super) const DIVERGING: Scale = &[
    [0x21, 0x66, 0xac],
    [0x67, 0xa9, 0xcf],
    [0xd1, 0xe5, 0xf0],
    [0xf7, 0xf7, 0xf7],
    [0xfd, 0xdb, 0xc7],
    [0xef, 0x8a, 0x62],
    [0xb2, 0x18, 0x2b],
];

/// The colour at `t` in `[0, 1]`.
pub(super) fn at(scale: Scale, t: f64) -> [u8; 3] {
    let place = t.clamp(0.0, 1.0) * (scale.len() - 1) as f64;
    let below = (place as usize).min(scale.len() - 2);
    let part = place - below as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(scale[below][i]), f64::from(scale[below + 1][i]));
        (a + part * (b - a)).round() as u8
    })
}

/// The same as SVG writes it.
pub(super) fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

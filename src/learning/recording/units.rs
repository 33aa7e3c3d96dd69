//! Units of recorded columns, and their conversion to SI.

use std::f64::consts::PI;

/// Known units with their values in SI (angles in rad).
const UNITS: [(&str, f64); 26] = [
    ("rad", 1.0),
    ("deg", PI / 180.0),
    ("turn", 2.0 * PI),
    ("mrad", 1e-3),
    ("rpm", 2.0 * PI / 60.0),
    ("s", 1.0),
    ("sec", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
    ("h", 3600.0),
    ("m", 1.0),
    ("km", 1e3),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("um", 1e-6),
    ("in", 0.0254),
    ("ft", 0.3048),
    ("g", 9.80665),
    ("N", 1.0),
    ("kN", 1e3),
    ("mN", 1e-3),
    ("Nm", 1.0),
    ("kNm", 1e3),
    ("mNm", 1e-3),
];

/// Spells a unit as in the table: `°` becomes `deg`, `µm` becomes `um`, `N m` and `N·m` become `Nm`, `m/s²` becomes `m/s2`.
fn spelled(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for letter in text.chars().filter(|letter| !letter.is_whitespace() && !['·', '⋅', '*'].contains(letter)) {
        match letter {
            'µ' | 'μ' => plain.push('u'),
            '°' | 'º' => plain.push_str("deg"),
            '²' => plain.push('2'),
            other => plain.push(other),
        }
    }
    plain
}

/// Factor that converts a number in this unit to SI.
///
/// `text` is a unit (`deg`, `ms`, `mm`; `g` is the standard gravity), a unit per second or per second squared (`deg/s`,
/// `mm/s2`), or the factor itself. Signs such as `°`, `µ` and `²` are understood.
///
/// # Errors
/// A description of what was expected.
pub fn factor(text: &str) -> Result<f64, String> {
    let text = text.trim();
    if let Ok(x) = text.parse::<f64>() {
        return if x.is_finite() && x != 0.0 {
            Ok(x)
        } else {
            Err(format!("expected a unit or a finite factor other than 0, found {text:?}"))
        };
    }
    let plain = spelled(text);
    let base = ["/s^2", "/s2", "/s"].iter().find_map(|per| plain.strip_suffix(per)).unwrap_or(&plain);
    UNITS.iter().find(|(name, _)| *name == base).map(|(_, factor)| *factor).ok_or_else(|| {
        let names: Vec<&str> = UNITS.iter().map(|(name, _)| *name).collect();
        format!("unknown unit {text:?}, expected a number or one of {} (also with /s, /s2)", names.join(", "))
    })
}

/// The SI unit of converted numbers; `None` for a bare factor.
pub fn si(text: &str) -> Option<String> {
    let plain = spelled(text);
    let base = ["/s^2", "/s2", "/s"].iter().find_map(|per| plain.strip_suffix(per)).unwrap_or(&plain);
    let rate = plain[base.len()..].replace("s2", "s^2");
    let unit = match base {
        "rad" | "deg" | "turn" | "mrad" => "rad",
        "s" | "sec" | "ms" | "us" | "ns" | "min" | "h" => "s",
        "m" | "km" | "cm" | "mm" | "um" | "in" | "ft" => "m",
        "N" | "kN" | "mN" => "N",
        "Nm" | "kNm" | "mNm" => "N m",
        "rpm" => "rad/s",
        "g" => "m/s^2",
        _ => return None,
    };
    Some(unit.to_string() + &rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_factors() {
        assert_eq!(factor("deg").unwrap() * 180.0, PI);
        assert_eq!((factor("ms"), factor("mm/s2"), factor(" -0.01 ")), (Ok(1e-3), Ok(1e-3), Ok(-0.01)));
        assert_eq!([si("deg"), si("mm/s2"), si("0.01")], [Some("rad".into()), Some("m/s^2".into()), None]);
        assert_eq!([factor("°/s"), factor("µm"), factor("N·m")], ["deg/s", "um", "Nm"].map(factor));
        assert_eq!([si("m/s²"), si("mN m")], [Some("m/s^2".into()), Some("N m".into())]);
        assert!(UNITS.iter().all(|(name, _)| si(name).is_some()));
        for bad in ["nan", "0", "inf", "degree", "", "1e999", "/s"] {
            assert!(factor(bad).is_err(), "{bad}");
        }
    }
}

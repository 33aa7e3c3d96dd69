//! Recognises the usual meaning of column names.

/// A name without the digits, signs and brackets at its end, in lower case: `theta` of `Theta_1`.
pub fn stem(name: &str) -> String {
    let name = name.split(['[', '(']).next().unwrap_or_default().trim().to_lowercase();
    name.trim_end_matches(|c: char| c.is_ascii_digit() || "_-. ".contains(c)).to_string()
}

/// `true` if the stem of a name is in the list.
fn is(name: &str, words: &[&str]) -> bool {
    words.contains(&stem(name).as_str())
}

/// `true` for a usual name of the time.
pub fn is_time(name: &str) -> bool {
    let stem = stem(name);
    ["time", "zeit", "timestamp", "elapsed"].iter().any(|word| stem.starts_with(word) || stem.ends_with(word))
        || is(
            name,
            &["t", "temps", "tiempo", "tempo", "seconds", "second", "sec", "secs", "t_s", "t_ms", "ms", "clock"],
        )
}

/// `true` for a usual name of a column that distinguishes trajectories.
pub fn is_trajectory(name: &str) -> bool {
    let words = [
        "run",
        "trajectory",
        "traj",
        "track",
        "trial",
        "experiment",
        "rep",
        "repetition",
        "take",
        "shot",
        "session",
        "segment",
        "episode",
        "series",
        "versuch",
        "messung",
        "run_id",
        "trajectory_id",
        "track_id",
        "test",
        "body",
    ];
    is(name, &words)
}

/// `true` for a usual name of a row counter.
pub fn is_index(name: &str) -> bool {
    is(name, &["frame", "sample", "index", "idx", "row", "step", "count", "bild", "nr", "no", ""])
        && name.parse::<f64>().is_err()
}

/// `true` for a usual name of a force or a torque.
pub fn is_force(name: &str) -> bool {
    let words =
        ["tau", "torque", "force", "f", "u", "effort", "kraft", "drehmoment", "moment", "fx", "fy", "fz", "input"];
    let stem = stem(name);
    is(name, &words) || ["tau_", "torque_", "force_", "effort_", "f_", "u_"].iter().any(|start| stem.starts_with(start))
}

/// `true` for a usual name of a torque.
pub fn is_torque(name: &str) -> bool {
    let stem = stem(name);
    is(name, &["tau", "torque", "drehmoment"]) || ["tau_", "torque_"].iter().any(|start| stem.starts_with(start))
}

/// `true` for a usual name of an acceleration.
pub fn is_acceleration(name: &str) -> bool {
    let stem = stem(name);
    stem.contains("acc")
        || stem.contains("ddot")
        || is(name, &["a", "ax", "ay", "az", "qdd", "ddq", "ddx", "ddy", "ddz"])
}

/// `true` for a usual name of a velocity.
pub fn is_velocity(name: &str) -> bool {
    let words = [
        "v", "vx", "vy", "vz", "w", "wx", "wy", "wz", "qd", "dq", "dx", "dy", "dz", "dtheta", "dphi", "xd", "yd", "zd",
    ];
    let stem = stem(name);
    let part = ["dot", "vel", "speed", "omega", "rate"].iter().any(|part| stem.contains(part));
    !is_acceleration(name) && (part || is(name, &words) || stem.starts_with("v_") || stem.ends_with("_v"))
}

/// `true` for a name that only positions have.
pub fn is_position(name: &str) -> bool {
    is_angle(name) || is(name, &["x", "y", "z", "q", "r", "s", "rho", "pos", "position", "x_pos", "y_pos", "z_pos"])
}

/// `true` for a usual name of an angle.
pub fn is_angle(name: &str) -> bool {
    let stem = stem(name);
    let part =
        ["theta", "phi", "angle", "winkel", "yaw", "pitch", "roll", "azimuth"].iter().any(|part| stem.contains(part));
    part || is(name, &["psi", "alpha", "beta", "gamma", "ang", "deg", "rot"]) || in_degrees(name)
}

/// `true` if a name contains degrees as its unit.
pub fn in_degrees(name: &str) -> bool {
    let name = name.to_lowercase();
    name.ends_with("deg") || name.contains("_deg") || name.contains("degree")
}

/// The unit of time that a name contains.
pub fn unit_of_time(name: &str) -> Option<&'static str> {
    let name = name.to_lowercase();
    let ends = |unit: &str| name == unit || name.ends_with(&format!("_{unit}"));
    ["ms", "us", "ns", "min"].into_iter().find(|unit| ends(unit)).or(match name.contains("milli") {
        true => Some("ms"),
        false => name.contains("micro").then_some("us"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_mean_what_they_say() {
        for (name, meanings) in [
            ("t", [true, false, false, false, false]),
            ("time_ms", [true, false, false, false, false]),
            ("Zeit", [true, false, false, false, false]),
            ("theta1", [false, false, false, false, true]),
            ("theta1_dot", [false, true, false, false, true]),
            ("vx", [false, true, false, false, false]),
            ("joint_velocity_3", [false, true, false, false, false]),
            ("x_ddot", [false, false, true, false, false]),
            ("acc_y", [false, false, true, false, false]),
            ("tau_2", [false, false, false, true, false]),
            ("F", [false, false, false, true, false]),
            ("x", [false, false, false, false, false]),
            ("frequency", [false, false, false, false, false]),
        ] {
            let found = [is_time(name), is_velocity(name), is_acceleration(name), is_force(name), is_angle(name)];
            assert_eq!(found, meanings, "{name}");
        }
        assert!(is_trajectory("run_id") && is_trajectory("Trial 2") && !is_trajectory("x"));
        assert!(is_index("frame") && is_index("") && !is_index("3"));
        assert_eq!((unit_of_time("t_ms"), unit_of_time("time"), unit_of_time("items")), (Some("ms"), None, None));
    }
}

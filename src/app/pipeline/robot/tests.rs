use super::rigid::Body;
use super::*;
use crate::lagrangian::{InverseDynamics, SystemInstance};
use std::borrow::Cow;

const PICKER: &str = include_str!("../../../../examples/systems/picker.urdf");

fn instance(text: &str) -> SystemInstance<f64> {
    SystemInstance::new(Cow::Owned(parse_robot(text).unwrap().0), &[]).unwrap()
}

fn value(instance: &SystemInstance<f64>, symbol: &str) -> f64 {
    let at = instance.system.parameters.iter().position(|known| known.symbol == symbol);
    instance.parameters[at.unwrap_or_else(|| panic!("{symbol}"))]
}

fn torques(instance: &SystemInstance<f64>, [q, v, a]: [&[f64]; 3]) -> Vec<f64> {
    InverseDynamics::of(&instance.build().unwrap(), q, v, a).unwrap().external
}

fn close(found: &[f64], expected: &[f64], within: f64) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < within), "{found:?} {expected:?}");
    assert_eq!(found.len(), expected.len());
}

/// A link with a mass at a place, and inertia about it.
fn link(name: &str, mass: f64, xyz: &str, inertia: f64) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass}"/>
        <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
    ) + "\n"
}

fn joint(name: &str, kind: &str, [parent, child]: [&str; 2], more: &str) -> String {
    format!(r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>"#)
        + "\n"
}

fn robot(elements: &[String]) -> String {
    format!("<robot name=\"made\">\n<link name=\"base\"/>\n{}</robot>\n", elements.concat())
}

/// Two rods that swing about level axes.
fn arm() -> String {
    robot(&[
        link("upper", 2.0, "0 0 -0.35", 0.03),
        link("lower", 0.5, "0 0 -0.4", 0.02),
        joint("shoulder", "continuous", ["base", "upper"], r#"<axis xyz="0 -1 0"/>"#),
        joint("elbow", "continuous", ["upper", "lower"], r#"<axis xyz="0 -1 0"/><origin xyz="0 0 -0.7"/>"#),
    ])
}

#[test]
fn two_links_are_the_double_arm_of_the_formula() {
    let (formula, _) = (
        r#"
name = "formula"
lagrangian = "(I1 + m2*l^2)*a_dot^2/2 + I2*(a_dot + b_dot)^2/2 + m2*l*c2*cos(b)*a_dot*(a_dot + b_dot) + g*((m1*c1 + m2*l)*cos(a) + m2*c2*cos(a + b))"
[parameters]
m1 = 2
m2 = 0.5
c1 = 0.35
c2 = 0.4
l = 0.7
g = 9.81
I1 = 0.275
I2 = 0.1
[[coordinates]]
name = "a"
periodic = true
velocity_bounds = [-1, 1]
[[coordinates]]
name = "b"
periodic = true
velocity_bounds = [-1, 1]
"#,
        (),
    );
    let formula =
        SystemInstance::<f64>::new(Cow::Owned(toml::from_str::<Description>(formula).unwrap().system().unwrap()), &[])
            .unwrap()
            .build()
            .unwrap();
    let mjcf = r#"<mujoco><worldbody><body name="upper"><joint name="shoulder" axis="0 -1 0"/><inertial pos="0 0 -0.35" mass="2" diaginertia="0.03 0.03 0.03"/>
        <body name="lower" pos="0 0 -0.7"><joint name="elbow" axis="0 -2 0"/><inertial pos="0 0 -0.4" mass="0.5" diaginertia="0.02 0.02 0.02"/></body></body></worldbody></mujoco>"#;
    for text in [arm(), mjcf.to_string()] {
        let built = instance(&text).build().unwrap();
        for (q, v) in [([0.4, -1.1], [0.8, 1.7]), ([2.0, 3.0], [-3.0, 0.4])] {
            close(&built.acceleration(&q, &v).unwrap(), &formula.acceleration(&q, &v).unwrap(), 1e-11);
        }
    }
}

#[test]
fn the_example_is_read_with_its_limits_its_follower_and_notes() {
    let (system, notes) = parse_robot(PICKER).unwrap();
    let names: Vec<String> = system.coordinates(3).iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["turn", "lift", "grip"]);
    assert!(
        notes.iter().any(|note| note.contains("<transmission>")) && !notes.iter().any(|note| note.contains("visual"))
    );
    let bounds = system.validation(3);
    assert_eq!((bounds.positions[1], bounds.velocities[2]), ((-0.5, 1.5), (-0.2, 0.2)));
    assert!(system.parameters.iter().all(|parameter| parameter.learn));
    let picker = instance(PICKER);
    assert_eq!((value(&picker, "m2"), value(&picker, "Fc1"), value(&picker, "Fv3")), (1.7, 0.2, 2.0));
    close(&[value(&picker, "mx2"), value(&picker, "mz2")], &[1.5 * 0.2 + 0.2 * 0.3, 0.2 * 0.05], 1e-15);
    // The fingers move against each other: nothing of them pulls sideways, and both have to be accelerated.
    let still = [0.0; 3];
    let force = torques(&picker, [&[0.0, 0.3, 0.02], &still, &[0.0, 0.0, 2.0]]);
    close(&force, &[0.0, force[1], 2.0 * 0.2], 1e-12);
    let spun = torques(&picker, [&[0.3, 0.0, 0.02], &[1.0, 0.0, 0.0], &still]);
    close(&spun[2..], &[-0.2 * 0.02], 1e-12);
}

#[test]
fn what_is_fixed_is_a_part_of_what_carries_it() {
    let fixed = |more: &str| joint("weld", "fixed", ["upper", "flange"], more);
    let two = arm().replace(
        "</robot>",
        &(link("flange", 0.3, "0.1 0 0", 0.01)
            + &fixed(r#"<origin xyz="0 0.2 0" rpy="0 0 1.5707963267948966"/>"#)
            + "</robot>"),
    );
    let [alone, both] = [arm(), two].map(|text| instance(&text));
    // A turn of a quarter about z puts the mass at (0, 0.3, 0).
    let added = [0.3, 0.0, 0.3 * 0.3, 0.0, 0.01 + 0.3 * 0.09, 0.0, 0.0, 0.01, 0.0, 0.01 + 0.3 * 0.09];
    for (symbol, added) in inertia_symbols(1).iter().zip(added) {
        close(&[value(&both, symbol)], &[value(&alone, symbol) + added], 1e-14);
    }
    let on_base = arm().replace(
        "</robot>",
        &(link("plate", 9.0, "0 0 0", 1.0) + &joint("bolt", "fixed", ["base", "plate"], "") + "</robot>"),
    );
    assert_eq!(parse_robot(&on_base).unwrap().0.parameters.len(), alone.parameters.len());
}

#[test]
fn names_of_joints_that_formulas_cannot_have_are_changed_and_said() {
    for (name, expected) in [
        ("left-knee", "left_knee"),
        ("3", "q3"),
        ("m1", "m1_"),
        ("sin", "sin_"),
        ("t", "t_"),
        ("link1_wx", "link1_wx__"),
        ("a_dot", "a_dot_"),
    ] {
        let (system, notes) = parse_robot(&arm().replace("shoulder", name)).unwrap();
        assert_eq!(system.coordinates(2)[0].name, expected);
        assert!(notes.iter().any(|note| note.contains(expected)), "{notes:?}");
    }
    let same = parse_robot(&arm().replace("shoulder", "el_bow").replace("elbow", "el-bow")).unwrap().0;
    assert_eq!(same.coordinates(2)[1].name, "el_bow_");
    assert!(
        parse_robot(&arm().replace("made", "double-pendulum")).is_ok()
            && parse_robot(&arm().replace("\"made\"", "\"\"")).is_ok()
    );
}

#[test]
fn mistakes_are_placed_and_named() {
    let base = arm();
    let of = |old: &str, new: &str| parse_robot(&base.replacen(old, new, 1)).unwrap_err();
    for (old, new, line, part) in [
        ("mass value=\"2\"", "mass value=\"two\"", 3, "`value`"),
        ("mass value=\"2\"", "mass value=\"-2\"", 3, "at least 0"),
        ("mass value=\"2\"", "mass", 3, "`value`"),
        ("<mass value=\"2\"/>", "", 3, "<mass>"),
        ("xyz=\"0 0 -0.35\"", "xyz=\"0 0\"", 3, "3 numbers"),
        ("xyz=\"0 0 -0.35\"", "xyz=\"0 0 inf\"", 3, "3 numbers"),
        ("<axis xyz=\"0 -1 0\"/>", "<axis xyz=\"0 0 0\"/>", 7, "not zero"),
        ("child link=\"upper\"", "child link=\"uper\"", 7, "upper"),
        ("child link=\"upper\"", "child link=\"lower\"", 8, "child"),
        ("parent link=\"base\"", "parent link=\"lower\"", 1, "tree"),
        ("name=\"lower\"", "name=\"upper\"", 5, "before"),
        ("<robot", "<sdf", 1, "<robot>"),
        ("</robot>", "", 9, "XML"),
        ("type=\"continuous\">", "type=\"continuous\"><mimic joint=\"knee\"/>", 7, "knee"),
        ("type=\"continuous\">", "type=\"continuous\"><mimic joint=\"shoulder\"/>", 7, "circle"),
        ("type=\"continuous\">", "type=\"continuous\"><dynamics damping=\"-1\"/>", 7, "damping"),
        ("type=\"continuous\">", "type=\"continuous\"><limit lower=\"1\" upper=\"0\"/>", 7, "lower"),
    ] {
        let text = base.replacen(old, new, 1);
        assert_ne!(text, base, "{old}");
        if line == 1 && old.starts_with("<robot") {
            assert!(parse_robot(&text.replace("</robot>", "</sdf>")).unwrap_err().1.contains(part));
            continue;
        }
        let found = of(old, new);
        assert!(found.0 == line || part == "XML", "{new}: {found:?}");
        assert!(found.1.contains(part), "{new}: {found:?}");
    }
    assert!(parse_robot("<robot><link name=\"a\"/></robot>").unwrap_err().1.contains("joints that move"));
    let deep = "<a>".repeat(200_000);
    assert!(parse_robot(&deep).is_err());
}

/// Pieces of two texts that differ, from the first to the last byte that does.
fn changed<'a>(before: &'a str, after: &'a str) -> [&'a str; 2] {
    let same = before.bytes().zip(after.bytes()).take_while(|(a, b)| a == b).count();
    let rest = before.bytes().rev().zip(after.bytes().rev()).take_while(|(a, b)| a == b).count();
    let rest = rest.min(before.len() - same).min(after.len() - same);
    [&before[same..before.len() - rest], &after[same..after.len() - rest]]
}

#[test]
fn what_is_not_changed_stays_byte_by_byte() {
    let picker = instance(PICKER);
    let symbols: Vec<String> = picker.system.parameters.iter().map(|p| p.symbol.to_string()).collect();
    let all: Vec<(&str, f64)> = symbols.iter().map(String::as_str).zip(picker.parameters.iter().copied()).collect();
    assert_eq!(rewrite_robot(PICKER, &all).unwrap(), PICKER);
    let marked = format!("\u{feff}{PICKER}");
    assert_eq!(rewrite_robot(&marked, &all).unwrap(), marked);
    let other = rewrite_robot(PICKER, &[("Fc1", 0.25)]).unwrap();
    assert_eq!(changed(PICKER, &other), ["", "5"]);
    // An attribute and an element that were not there.
    let other = rewrite_robot(PICKER, &[("Fc3", 0.5)]).unwrap();
    assert_eq!(changed(PICKER, &other).map(str::trim), ["", "friction=\"0.5\""]);
    let other = rewrite_robot(PICKER, &[("Fv4", 0.5)]).unwrap();
    assert_eq!(other.replacen("\n    <dynamics damping=\"0.5\"/>", "", 1), PICKER);
}

#[test]
fn other_constants_are_written_and_read_again() {
    let picker = instance(PICKER);
    let scaled: Vec<(String, f64)> =
        inertia_symbols(2).into_iter().map(|symbol| (symbol.clone(), 1.2 * value(&picker, &symbol))).collect();
    let given: Vec<(&str, f64)> = scaled.iter().map(|(name, x)| (name.as_str(), *x)).collect();
    let again = instance(&rewrite_robot(PICKER, &given).unwrap());
    for (symbol, x) in &scaled {
        close(&[value(&again, symbol)], &[*x], 1e-12);
    }
    // The camera stays unchanged, the arm takes the rest.
    let written = rewrite_robot(PICKER, &given).unwrap();
    assert!(
        written.contains("<mass value=\"0.2\"/>") && written.contains("rpy=\"0 1.5707963267948966 0\""),
        "{written}"
    );
    // A sum with no room for the camera: both are smaller.
    let light: Vec<(String, f64)> =
        inertia_symbols(2).into_iter().map(|symbol| (symbol.clone(), 0.1 * value(&picker, &symbol))).collect();
    let given: Vec<(&str, f64)> = light.iter().map(|(name, x)| (name.as_str(), *x)).collect();
    let written = rewrite_robot(PICKER, &given).unwrap();
    let again = instance(&written);
    for (symbol, x) in &light {
        close(&[value(&again, symbol)], &[*x], 1e-12);
    }
    assert!(!written.contains("<mass value=\"0.2\"/>"));
    // No body has these constants.
    let (line, problem) = rewrite_robot(PICKER, &[("m1", -1.0)]).unwrap_err();
    assert!(line == 6 && problem.contains("turret"), "{line} {problem}");
    // A link without an inertial.
    let bare = "<robot name=\"r\">\n  <link name=\"b\"/>\n  <link name=\"l\"/>\n  <joint name=\"j\" type=\"continuous\"><parent link=\"b\"/><child link=\"l\"/></joint>\n</robot>";
    let given = [("m1", 2.0), ("mx1", 0.4), ("Ixx1", 0.1), ("Iyy1", 0.2), ("Izz1", 0.2)];
    let again = instance(&rewrite_robot(bare, &given).unwrap());
    given.iter().for_each(|(symbol, x)| close(&[value(&again, symbol)], &[*x], 1e-15));
}

#[test]
fn shapes_have_the_bodies_that_they_are_made_of() {
    let whole = |geom: &str| {
        let text = format!(r#"<mujoco><worldbody><body><joint/><geom {geom}/></body></worldbody></mujoco>"#);
        let body = instance(&text);
        Body(inertia_symbols(1).map(|symbol| value(&body, &symbol)))
    };
    let of = |geom: &str| whole(&format!(r#"{geom} mass="1""#)).0;
    close(&of(r#"type="box" size="1 2 3""#)[4..], &[13.0 / 3.0, 0.0, 0.0, 10.0 / 3.0, 0.0, 5.0 / 3.0], 1e-14);
    close(&of(r#"size="2""#)[4..], &[1.6, 0.0, 0.0, 1.6, 0.0, 1.6], 1e-14);
    // Along x, from slices of the capsule.
    let (radius, half, slices) = (0.3, 0.5, 20_000);
    let (mut sums, step) = ([0.0; 3], 2.0 * (radius + half) / f64::from(slices));
    for k in 0..slices {
        let x = -(radius + half) + (f64::from(k) + 0.5) * step;
        let beyond = (x.abs() - half).max(0.0);
        let square = radius * radius - beyond * beyond;
        let area = std::f64::consts::PI * square;
        sums = [
            sums[0] + area * step,
            sums[1] + area * square / 2.0 * step,
            sums[2] + area * (square / 4.0 + x * x) * step,
        ];
    }
    let found = whole(r#"type="capsule" size="0.3" fromto="-0.5 0 0.2 0.5 0 0.2" density="1""#).0;
    let lifted = sums[0] * 0.04;
    close(&[found[0], found[4], found[7], found[9]], &[sums[0], sums[1] + lifted, sums[2] + lifted, sums[2]], 1e-6);
}

#[test]
fn settings_and_classes_of_mjcf_count() {
    let text = r#"<mujoco model="m"><compiler angle="radian"/><option gravity="1 2 3"/>
<default><joint damping="0.5"/><default class="big"><joint armature="0.1" range="-1 2"/><geom density="10" size="1"/></default></default>
<worldbody><body childclass="big" pos="0 0 1" euler="0.1 0.2 0.3"><joint name="a" pos="0.1 0 0" ref="0.4"/><joint name="b" type="slide" axis="1 0 0" frictionloss="2" damping="3"/><geom/></body></worldbody>
<actuator/></mujoco>"#;
    let (system, notes) = parse_robot(text).unwrap();
    assert!(notes.iter().any(|note| note.contains("<actuator>")));
    assert_eq!((system.validation(2).positions[0], system.validation(2).positions[1]), ((-1.0, 2.0), (-1.0, 2.0)));
    let read = instance(text);
    assert_eq!(["Fv1", "Fv2", "Fc2", "Ia1", "Ia2"].map(|symbol| value(&read, symbol)), [0.5, 3.0, 2.0, 0.1, 0.1]);
    close(&[value(&read, "m2")], &[10.0 * 4.0 / 3.0 * std::f64::consts::PI], 1e-12);
    for (old, new, part) in [
        ("radian", "gon", "degree"),
        ("<worldbody>", "<worldbody><include file=\"x\"/>", "include"),
        ("<geom/>", "<geom type=\"mesh\"/>", "<inertial>"),
        ("<geom/>", "<geom class=\"none\"/>", "none"),
        ("euler=\"0.1 0.2 0.3\"", "quat=\"0 0 0 0\"", "not zero"),
        ("<compiler", "<compiler eulerseq=\"zyx\"", "eulerseq"),
        ("damping=\"3\"", "damping=\"x\"", "damping"),
    ] {
        let (line, problem) = parse_robot(&text.replacen(old, new, 1)).unwrap_err();
        assert!(line <= 4 && (problem.contains(part)), "{new}: {line}: {problem}");
    }
}

//! A model file of every kind that the program writes, with weights of no meaning.

use lnn::lagrangian::Description;
use lnn::network::{
    ActivationChoice, Architecture, Factor, Form, InputLayer, JointFriction, Layout, Radial, Sizes, Structure,
};
use lnn::network::{Header, ModelFile, StoredPrecision};
use serde_json::json;
use std::collections::BTreeMap;

/// States of every kind: an angle and two distances.
pub const STATES: &str =
    "x,theta,y,y_dot,theta_dot,x_dot\n0.5,0.1,-3,2,1.5,-1\n-4,7,1.5,3,0.2,0.3\n0.9,-20,2.5,0,0,0\n2.5,3,4,-0.5,1,2\n";

/// A Lagrangian written down, with two constants to be learned: one positive, one of any sign.
fn description(name: &str) -> Description {
    let coordinates = ["theta", "x", "y"].map(|name| {
        let bounds = [-1.0, 1.0];
        json!({ "name": name, "periodic": name == "theta", "bounds": bounds, "velocity_bounds": bounds })
    });
    let parameters = json!({
        "mass": { "default": 2, "unit": "kg", "range": "positive", "learn": true },
        "bend": { "default": 0.5, "unit": "J", "range": "any", "learn": true },
        "g": 9.81,
    });
    let lagrangian = "mass*(theta_dot^2 + x_dot^2 + y_dot^2)/2 - mass*g*y + bend*cos(theta)";
    let described =
        json!({ "name": name, "lagrangian": lagrangian, "coordinates": coordinates, "parameters": parameters });
    serde_json::from_value(described).unwrap()
}

/// A black box. All fields are spelled out: a new one has to be thought of here.
fn black_box() -> Header {
    let form = Form {
        structure: Structure::BlackBox,
        factor: Factor::Triangle,
        cyclic: Vec::new(),
        even_in_v: false,
        learn_alpha: false,
        radial: Vec::new(),
        known: None,
        joint_friction: JointFriction::None,
        sizes: None,
    };
    let architecture = Architecture {
        coordinates: 3,
        hidden: vec![6, 4],
        activation: ActivationChoice::Gelu,
        alpha: 0.3,
        time_like: None,
        scale: vec![1.5, 2.0, 0.7],
        periodic: vec![true, false, false],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: None,
        form,
    };
    Header {
        format: Header::FORMAT,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        architecture,
        system: "recorded".to_string(),
        description: None,
        parameters: BTreeMap::new(),
        columns: ["theta", "x", "y", "theta_dot", "x_dot", "y_dot"].map(String::from).to_vec(),
        forces: Vec::new(),
        constraints: BTreeMap::new(),
        precision: StoredPrecision::F64,
        position: vec![[-10.0, 10.0]; 3],
        velocity: vec![[-10.0, 10.0]; 3],
        seed: 1,
        validation_loss: 0.25,
    }
}

fn sizes() -> Sizes {
    Sizes { velocity: vec![1.5, 0.25, 3.0], potential: 7.0, friction: vec![0.5, 2.0, 1.25] }
}

/// A model of every kind, by name.
pub fn kinds() -> Vec<(String, ModelFile<f64>)> {
    let mut kinds = Vec::new();
    let mut add = |name: &str, change: &dyn Fn(&mut Header)| {
        let mut header = black_box();
        change(&mut header);
        let count = Layout::new(&header.architecture).parameters;
        let weights = (0..count).map(|k| f64::from((1.3 * k as f32).sin() / 2.0)).collect();
        kinds.push((name.to_string(), ModelFile { header, weights }));
    };
    for activation in ActivationChoice::ALL {
        add(activation.name(), &|h| h.architecture.activation = activation);
    }
    add("single precision", &|h| h.precision = StoredPrecision::F32);
    add("angles as they are", &|h| h.architecture.embed_periodic = false);
    add("input layer", &|h| h.architecture.input_layer = InputLayer::Dyt);
    add("input layers of a hybrid", &|h| {
        h.architecture.activation = ActivationChoice::QuadraticSoftplus;
        h.architecture.input_layer = InputLayer::Dyt;
    });
    add("friction", &|h| h.architecture.dissipation = Some(3));
    add("joint friction", &|h| h.architecture.form.joint_friction = JointFriction::Dry);
    add("joint friction beside friction", &|h| {
        h.architecture.dissipation = Some(3);
        h.architecture.form.joint_friction = JointFriction::Stribeck;
        h.architecture.form.sizes = Some(sizes());
    });
    add("forces", &|h| h.forces = ["f_theta", "f_x", "f_y"].map(String::from).to_vec());
    add("a described system", &|h| {
        h.description = Some(description(&h.system));
        h.parameters = BTreeMap::from([("mass".to_string(), 2.0)]);
    });
    let formulas = |all: &[(&str, &str)]| -> BTreeMap<String, String> {
        all.iter().map(|(name, formula)| (name.to_string(), formula.to_string())).collect()
    };
    add("constraints", &|h| {
        h.constraints = formulas(&[("rod", "x^2 + x*y - 1"), ("rolling", "x_dot - 0.5*theta_dot*cos(theta) - 1")]);
    });
    add("constraints of a described system", &|h| {
        let constraints = formulas(&[("rod", "(x^2 + y^2)/mass - 1")]);
        let mut system = description(&h.system);
        system.constraints = constraints;
        h.description = Some(system);
        h.parameters = BTreeMap::from([("mass".to_string(), 2.5)]);
    });
    let radial = || vec![Radial { coordinates: vec![2, 1], unit: 1.25 }];
    for (kind, structure, factor, time_like) in [
        ("black box", Structure::BlackBox, Factor::Triangle, None),
        ("black box with a time", Structure::BlackBox, Factor::Triangle, Some(1)),
        ("mechanical triangle", Structure::Mechanical, Factor::Triangle, None),
        ("mechanical rectangle", Structure::Mechanical, Factor::Rectangle, None),
        ("triangle of a constant mass", Structure::ConstantMass, Factor::Triangle, None),
        ("rectangle of a constant mass", Structure::ConstantMass, Factor::Rectangle, None),
        ("triangle of a metric", Structure::Metric, Factor::Triangle, None),
        ("rectangle of a metric", Structure::Metric, Factor::Rectangle, None),
        ("triangle of a spacetime", Structure::Metric, Factor::Triangle, Some(1)),
        ("rectangle of a spacetime", Structure::Metric, Factor::Rectangle, Some(0)),
    ] {
        let shape = |h: &mut Header| {
            h.architecture.time_like = time_like;
            (h.architecture.form.structure, h.architecture.form.factor) = (structure, factor);
        };
        add(kind, &shape);
        let mut with = |what: &str, change: &dyn Fn(&mut Form)| {
            add(&format!("{kind}, {what}"), &|h| {
                shape(h);
                change(&mut h.architecture.form);
            });
        };
        with("sizes", &|form| form.sizes = Some(sizes()));
        with("even", &|form| form.even_in_v = true);
        with("cyclic", &|form| form.cyclic = vec![0, 2]);
        with("radial", &|form| form.radial = radial());
        with("known part", &|form| form.known = Some(Box::new(description("known"))));
        if structure == Structure::BlackBox {
            with("learned alpha", &|form| form.learn_alpha = true);
        }
    }
    kinds
}

//! Tests round trips, damaged files and files of other programs.

use super::*;
use crate::lagrangian::EulerLagrange;
use crate::network::{ActivationChoice, Form, InputLayer, NetworkLagrangian};
use crate::storage::container::{MAX_HEADER, checksum_field};
use proptest::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use std::collections::{BTreeMap, HashMap};

fn header(hidden: Vec<usize>, embed_periodic: bool, precision: StoredPrecision) -> Header {
    Header {
        format: Header::FORMAT,
        crate_version: "0.1.0".to_string(),
        architecture: Architecture {
            coordinates: 2,
            hidden,
            activation: ActivationChoice::Gelu,
            alpha: 0.1,
            time_like: None,
            scale: vec![0.1 + 0.2, 10.0 / 3.0],
            periodic: vec![true, false],
            embed_periodic,
            input_layer: InputLayer::None,
            dissipation: None,
            form: Form::default(),
        },
        system: "spring-pendulum".to_string(),
        parameters: BTreeMap::from([("m".to_string(), 1.0), ("g".to_string(), 9.81)]),
        columns: ["theta", "r", "theta_dot", "r_dot"].map(String::from).to_vec(),
        forces: Vec::new(),
        constraints: BTreeMap::new(),
        description: None,
        precision,
        position: vec![[0.0, std::f64::consts::TAU], [0.5, 1.5]],
        velocity: vec![[-10.0, 10.0]; 2],
        seed: u64::MAX,
        validation_loss: 0.1 / 3.0,
    }
}

fn model(hidden: Vec<usize>, precision: StoredPrecision) -> ModelFile<f64> {
    with_numbers(header(hidden, true, precision))
}

/// Models with one or two branches, with and without an input layer, and one branch with dissipation, in both precisions.
fn every_kind(hidden: &[usize]) -> Vec<ModelFile<f64>> {
    let mut models = Vec::new();
    for precision in [StoredPrecision::F32, StoredPrecision::F64] {
        for activation in [ActivationChoice::Gelu, ActivationChoice::QuadraticSoftplus] {
            for input_layer in [InputLayer::None, InputLayer::Dyt] {
                let mut header = header(hidden.to_vec(), true, precision);
                header.architecture.activation = activation;
                header.architecture.input_layer = input_layer;
                models.push(with_numbers(header));
            }
        }
        models.push(with_numbers(damped(hidden.to_vec(), precision)));
    }
    models
}

/// A network with a dissipation of three units.
fn damped(hidden: Vec<usize>, precision: StoredPrecision) -> Header {
    let mut header = header(hidden, true, precision);
    header.architecture.dissipation = Some(3);
    header
}

fn with_numbers(header: Header) -> ModelFile<f64> {
    let count = Layout::new(&header.architecture).parameters;
    let weights = (0..count).map(|k| f64::from((k as f32 * 0.37).sin())).collect();
    ModelFile { header, weights }
}

/// Unpacks a file and packs it again with changed metadata or tensors.
fn rebuilt(bytes: &[u8], change: impl FnOnce(&mut String, &mut Vec<(String, Dtype, Vec<usize>, Vec<u8>)>)) -> Vec<u8> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    let file = SafeTensors::deserialize(bytes).unwrap();
    let text = &metadata.metadata().as_ref().unwrap()[MODEL.key];
    let mut body = text[..text.len() - checksum_field(0).len()].to_string();
    let mut tensors: Vec<_> =
        file.iter().map(|(n, t)| (n.to_string(), t.dtype(), t.shape().to_vec(), t.data().to_vec())).collect();
    tensors.sort();
    change(&mut body, &mut tensors);
    let views: Vec<_> =
        tensors.iter().map(|(n, d, s, b)| (n.clone(), TensorView::new(*d, s.clone(), b).unwrap())).collect();
    let start = |text: &str| {
        let views = views.iter().map(|(n, v)| (n.clone(), v.clone()));
        safetensors::serialize(views, Some(HashMap::from([(MODEL.key.to_string(), text.to_string())]))).unwrap()
    };
    let draft = start(&body);
    let (length, _) = SafeTensors::read_metadata(&draft).unwrap();
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    checksum.update(&draft[8 + length..]);
    start(&format!("{body}{}", checksum_field(checksum.finalize())))
}

fn refusal(bytes: &[u8]) -> ModelFileError {
    ModelFile::<f64>::from_bytes(bytes).unwrap_err()
}

#[test]
fn saves_and_loads_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.safetensors");
    for model in every_kind(&[6, 4]) {
        model.save(&path).unwrap();
        let loaded = ModelFile::<f64>::load(&path).unwrap();
        assert_eq!(loaded, model);
        assert_eq!(loaded.to_bytes().unwrap(), std::fs::read(&path).unwrap());
        let narrow = ModelFile::<f32>::load(&path).unwrap();
        assert!(narrow.weights.iter().zip(&model.weights).all(|(&a, &b)| f64::from(a) == b));
        let wide = ModelFile::<crate::scalar::Dd>::load(&path).unwrap();
        assert_eq!(wide.to_bytes().unwrap(), model.to_bytes().unwrap());
    }
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1);
}

/// Duplicates the tensors for both branches of a hybrid.
fn in_both_branches(tensors: Vec<(String, Vec<usize>)>) -> Vec<(String, Vec<usize>)> {
    let branch = |b: usize| tensors.iter().map(move |(name, shape)| (format!("branches.{b}.{name}"), shape.clone()));
    branch(0).chain(branch(1)).collect()
}

/// The first files of format 1 had no field `input_layer`; a model without an input layer is still written without it.
#[test]
fn files_from_before_the_input_layer_load_and_keep_their_bytes() {
    let plain = model(vec![2], StoredPrecision::F64);
    let text = serde_json::to_string(&plain.header.architecture).unwrap();
    let expected = concat!(
        r#"{"coordinates":2,"hidden":[2],"activation":"gelu","alpha":0.1,"#,
        r#""scale":[0.30000000000000004,3.3333333333333335],"periodic":[true,false],"embed_periodic":true}"#
    );
    assert_eq!(text, expected);
    let bytes = plain.to_bytes().unwrap();
    let loaded = ModelFile::<f64>::from_bytes(&bytes).unwrap();
    assert_eq!(loaded.header.architecture.input_layer, InputLayer::None);
    assert_eq!(loaded.to_bytes().unwrap(), bytes);
}

/// The same holds for the field `time_like`; a model with a time-like coordinate keeps it.
#[test]
fn files_name_a_time_like_coordinate_if_there_is_one() {
    let mut model = model(vec![2], StoredPrecision::F64);
    let before = model.to_bytes().unwrap();
    assert_eq!(ModelFile::<f64>::from_bytes(&before).unwrap().header.architecture.time_like, None);
    model.header.architecture.time_like = Some(1);
    assert!(serde_json::to_string(&model.header).unwrap().contains(r#""alpha":0.1,"time_like":1,"#));
    assert_eq!(ModelFile::<f64>::from_bytes(&model.to_bytes().unwrap()).unwrap(), model);
    model.header.architecture.time_like = Some(2);
    let error = model.to_bytes().unwrap_err().to_string();
    assert!(error.contains("expected a time-like coordinate below 2, found 2"), "{error}");
}

#[test]
fn tensors_have_the_documented_names_and_shapes() {
    let dense = |widths: [usize; 2]| {
        let [a, b] = widths;
        let shapes = [vec![a], vec![a, 5], vec![b], vec![b, a], vec![1, b]];
        let names = ["layers.0.bias", "layers.0.weight", "layers.1.bias", "layers.1.weight", "layers.2.weight"];
        names.map(String::from).into_iter().zip(shapes).collect::<Vec<_>>()
    };
    let dyt = || ["dyt.alpha", "dyt.beta", "dyt.gamma"].map(String::from).into_iter().zip([vec![1], vec![5], vec![5]]);
    let friction = [("direction", vec![3, 2]), ("gamma", vec![3]), ("weight", vec![3, 3])]
        .map(|(part, shape)| (format!("dissipation.{part}"), shape));
    let expected = [
        dense([6, 4]),
        dyt().chain(dense([6, 4])).collect(),
        in_both_branches(dense([3, 2])),
        in_both_branches(dyt().chain(dense([3, 2])).collect()),
        friction.into_iter().chain(dense([6, 4])).collect(),
    ];
    for (model, expected) in every_kind(&[6, 4]).into_iter().zip(expected.iter().cycle()) {
        let bytes = model.to_bytes().unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let mut shapes: Vec<_> = file.iter().map(|(name, t)| (name.to_string(), t.shape().to_vec())).collect();
        shapes.sort();
        assert_eq!(shapes, *expected);
    }
}

#[test]
fn every_prefix_and_every_flipped_bit_is_refused() {
    for model in every_kind(&[2]) {
        let bytes = model.to_bytes().unwrap();
        for length in 0..bytes.len() {
            assert!(ModelFile::<f64>::from_bytes(&bytes[..length]).is_err(), "prefix of {length} bytes");
        }
        let mut flipped = bytes.clone();
        for bit in 0..8 * bytes.len() {
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(ModelFile::<f64>::from_bytes(&flipped).is_err(), "bit {bit}");
            flipped[bit / 8] ^= 1 << (bit % 8);
        }
        flipped.push(0);
        assert!(matches!(refusal(&flipped), ModelFileError::NotSafetensors(_)));
    }
}

#[test]
fn foreign_newer_and_ambiguous_files_are_named() {
    let bytes = model(vec![2], StoredPrecision::F64).to_bytes().unwrap();
    let view = TensorView::new(Dtype::F32, vec![1], &[0; 4]).unwrap();
    let foreign = safetensors::serialize([("w", view.clone())], None).unwrap();
    assert!(matches!(refusal(&foreign), ModelFileError::Foreign { kind: "model", key: "lnn" }));
    assert!(matches!(refusal(b"not a model at all"), ModelFileError::NotSafetensors(_)));

    let newer = rebuilt(&bytes, |body, _| *body = body.replace("\"format\":1", "\"format\":7,\"novelty\":{}"));
    let text = refusal(&newer).to_string();
    assert!(text.contains("format 7") && text.contains("format 1") && text.contains("0.1.0"), "{text}");

    let twice = rebuilt(&bytes, |body, _| *body = body.replace("\"seed\"", "\"seed\":1,\"seed\""));
    assert!(matches!(refusal(&twice), ModelFileError::Header(_)));

    let text =
        r#"{"w":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"w":{"dtype":"U8","shape":[1],"data_offsets":[0,1]}}"#;
    let mut two = (text.len() as u64).to_le_bytes().to_vec();
    two.extend(text.as_bytes());
    two.push(0);
    assert!(refusal(&two).to_string().contains("duplicate key \"w\""));
    for length in [u64::MAX, 1 << 63, 1 << 32, MAX_HEADER + 1] {
        assert!(matches!(refusal(&length.to_le_bytes()), ModelFileError::NotSafetensors(_)));
    }
}

#[test]
fn tensors_that_do_not_fit_are_named() {
    let bytes = model(vec![2], StoredPrecision::F64).to_bytes().unwrap();
    assert!(ModelFile::<f64>::from_bytes(&rebuilt(&bytes, |_, _| ())).is_ok());

    let missing = rebuilt(&bytes, |_, tensors| drop(tensors.remove(0)));
    assert!(matches!(refusal(&missing), ModelFileError::MissingTensor(name) if name == "layers.0.bias"));
    let extra = rebuilt(&bytes, |_, tensors| {
        let mut copy = tensors[0].clone();
        copy.0 = "layers.9.bias".to_string();
        tensors.push(copy);
    });
    assert!(matches!(refusal(&extra), ModelFileError::ExtraTensor(name) if name == "layers.9.bias"));
    let turned = rebuilt(&bytes, |_, tensors| tensors[1].2.reverse());
    assert_eq!(refusal(&turned).to_string(), "tensor layers.0.weight: expected shape [2, 5], found [5, 2]");
    let untold = rebuilt(&bytes, |body, _| {
        *body = body.replace("\"embed_periodic\":true", "\"embed_periodic\":true,\"input_layer\":\"dyt\"");
    });
    assert!(matches!(refusal(&untold), ModelFileError::MissingTensor(name) if name == "dyt.alpha"));
    let claims = |units: &'static str| {
        rebuilt(&bytes, move |body, _| {
            let plain = "\"embed_periodic\":true";
            *body = body.replace(plain, &format!("{plain},\"dissipation\":{units}"));
        })
    };
    assert!(matches!(refusal(&claims("2")), ModelFileError::MissingTensor(name) if name == "dissipation.gamma"));
    for units in ["0", "65537", "18446744073709551615", "-1", "1.5"] {
        assert!(matches!(refusal(&claims(units)), ModelFileError::Header(_)), "{units}");
    }
    let stored = with_numbers(damped(vec![2], StoredPrecision::F64)).to_bytes().unwrap();
    let frictionless = rebuilt(&stored, |body, _| *body = body.replace(",\"dissipation\":3", ""));
    assert!(matches!(refusal(&frictionless), ModelFileError::ExtraTensor(name) if name == "dissipation.direction"));
    let other = rebuilt(&stored, |body, _| *body = body.replace("\"dissipation\":3", "\"dissipation\":4"));
    assert_eq!(refusal(&other).to_string(), "tensor dissipation.gamma: expected shape [4], found [3]");
    let hybrid = rebuilt(&bytes, |body, _| *body = body.replace("\"gelu\"", "\"quadratic-softplus\""));
    assert!(matches!(refusal(&hybrid), ModelFileError::ExtraTensor(name) if name == "layers.0.bias"));
    let integers = rebuilt(&bytes, |_, tensors| tensors[0].1 = Dtype::I64);
    assert_eq!(refusal(&integers).to_string(), "tensor layers.0.bias: expected f64, found i64");
    for bad in [f64::NAN, f64::INFINITY] {
        let poisoned = rebuilt(&bytes, |_, tensors| tensors[1].3[24..32].copy_from_slice(&bad.to_le_bytes()));
        assert_eq!(refusal(&poisoned).to_string(), "tensor layers.0.weight: number 3 is not finite");
    }
}

#[test]
fn claims_of_the_description_are_checked() {
    let bytes = model(vec![2], StoredPrecision::F64).to_bytes().unwrap();
    for (old, new) in [
        ("\"hidden\":[2]", "\"hidden\":[]"),
        ("\"hidden\":[2]", "\"hidden\":[0]"),
        ("\"hidden\":[2]", "\"hidden\":[18446744073709551615]"),
        ("\"hidden\":[2]", "\"hidden\":[1048576,1048576,1048576]"),
        ("\"hidden\":[2],\"activation\":\"gelu\"", "\"hidden\":[3],\"activation\":\"quadratic-softplus\""),
        ("\"hidden\":[2],\"activation\":\"gelu\"", "\"hidden\":[1],\"activation\":\"quadratic-softplus\""),
        ("\"activation\":\"gelu\"", "\"activation\":\"identity\""),
        ("\"embed_periodic\":true", "\"embed_periodic\":true,\"input_layer\":\"layer-norm\""),
        ("\"coordinates\":2", "\"coordinates\":1099511627776"),
        ("\"coordinates\":2", "\"coordinates\":0"),
        ("\"periodic\":[true,false]", "\"periodic\":[true]"),
        ("\"alpha\":0.1", "\"alpha\":null"),
        ("\"r_dot\"]", "\"r\"]"),
        ("[0.5,1.5]", "[1.5,0.5]"),
    ] {
        let changed = rebuilt(&bytes, |body, _| {
            assert!(body.contains(old), "{old}");
            *body = body.replace(old, new);
        });
        assert!(matches!(refusal(&changed), ModelFileError::Header(_)), "{new}");
    }
}

/// A list of numbers takes a few bytes per coordinate, but a mass matrix takes their square.
#[test]
fn coordinates_and_widths_are_bounded() {
    let sized = |n: usize, width: usize| {
        let mut header = header(vec![width], true, StoredPrecision::F32);
        header.architecture.coordinates = n;
        header.architecture.scale = vec![1.0; n];
        header.architecture.periodic = vec![false; n];
        header.columns = (0..2 * n).map(|k| k.to_string()).collect();
        header.position = vec![[0.0, 1.0]; n];
        header.velocity = vec![[0.0, 1.0]; n];
        header.validate().map_err(|e| e.to_string())
    };
    assert_eq!(sized(MAX_COORDINATES, MAX_WIDTH), Ok(()));
    assert!(sized(MAX_COORDINATES + 1, 1).unwrap_err().contains("coordinates: expected at most 256"));
    assert!(sized(1, MAX_WIDTH + 1).unwrap_err().contains("hidden: expected widths of at most 65536"));
}

#[test]
fn what_cannot_be_read_back_is_not_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.safetensors");
    let good = model(vec![2], StoredPrecision::F32);
    good.save(&path).unwrap();

    let mut bad = good.clone();
    bad.weights[3] = 1e300;
    assert!(matches!(bad.save(&path), Err(ModelFileError::NotFinite { index: 3, .. })) || bad.weights.len() < 4);
    bad = good.clone();
    bad.weights.pop();
    assert!(matches!(bad.save(&path), Err(ModelFileError::WrongLength { .. })));
    bad = good.clone();
    bad.header.validation_loss = f64::NAN;
    assert!(matches!(bad.save(&path), Err(ModelFileError::Header(_))));
    assert!(matches!(good.save(directory.path()), Err(ModelFileError::Write(_))));
    assert_eq!(ModelFile::<f64>::load(&path).unwrap(), good);
    assert!(matches!(ModelFile::<f64>::load(directory.path()), Err(ModelFileError::Read(_))));
}

proptest! {
    #![proptest_config(crate::properties::properties(256))]

    #[test]
    fn random_models_survive(
        hidden in prop::collection::vec(1usize..6, 1..4),
        embed in any::<bool>(),
        activation in prop::sample::select(&ActivationChoice::ALL[..]),
        input_layer in prop::sample::select(vec![InputLayer::None, InputLayer::Dyt]),
        dissipation in prop::option::of(1usize..5),
        seed in any::<u64>(),
        scale in prop::array::uniform2(f64::MIN_POSITIVE..1e300),
        numbers in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 200),
    ) {
        let hidden = hidden.into_iter().map(|w| w * activation.branches().len()).collect();
        let mut header = header(hidden, embed, StoredPrecision::F64);
        header.architecture.activation = activation;
        header.architecture.input_layer = input_layer;
        header.architecture.dissipation = dissipation;
        header.seed = seed;
        header.architecture.scale = scale.to_vec();
        let count = Layout::new(&header.architecture).parameters;
        let weights: Vec<f64> = numbers.iter().cycle().take(count).copied().collect();
        let model = ModelFile { header, weights };
        let bytes = model.to_bytes().unwrap();
        let loaded = ModelFile::<f64>::from_bytes(&bytes).unwrap();
        prop_assert_eq!(&loaded, &model);
        prop_assert_eq!(loaded.to_bytes().unwrap(), bytes);
    }

    #[test]
    fn arbitrary_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(ModelFile::<f64>::from_bytes(&bytes).is_err());
    }
}

#[test]
fn names_of_forces_are_kept_and_counted() {
    let plain = header(vec![4], true, StoredPrecision::F64);
    let text = |header: &Header| serde_json::to_string(header).unwrap();
    // A file without forces reads and writes as before.
    assert!(!text(&plain).contains("forces"));
    assert_eq!(serde_json::from_str::<Header>(&text(&plain)).unwrap(), plain);
    let driven = Header { forces: vec!["tau1".to_string(), "tau2".to_string()], ..plain.clone() };
    assert_eq!(serde_json::from_str::<Header>(&text(&driven)).unwrap(), driven);
    assert!(driven.validate().is_ok());
    let one = Header { forces: vec!["tau1".to_string()], ..plain };
    assert!(one.validate().unwrap_err().to_string().contains("forces: expected one name per coordinate"));
}

#[test]
fn constraints_of_a_header_hold_its_motion() {
    let mut plain = header(vec![3], true, StoredPrecision::F64);
    plain.constraints = BTreeMap::from([("rod".to_string(), "r - 1".to_string())]);
    let weights: Vec<f64> = (0..Layout::new(&plain.architecture).parameters).map(|k| (k as f64).sin()).collect();
    let file = ModelFile { header: plain.clone(), weights };
    let back = ModelFile::<f64>::from_bytes(&file.to_bytes().unwrap()).unwrap();
    assert_eq!((&back.header, back.header.is_constrained()), (&file.header, true));
    let network = NetworkLagrangian::new(back.header.architecture.clone(), back.weights).unwrap();
    let motion = back.header.constrain::<f64>(Box::new(network)).unwrap();
    let a = motion.acceleration(&[0.3, 1.0], &[0.2, 0.0]).unwrap();
    assert!(a[0] != 0.0 && a[1].abs() < 1e-14, "{a:?}");
    for (name, formula) in [("rod", "r - x"), ("rod", "r_dot^2"), ("", "r - 1")] {
        let constraints = BTreeMap::from([(name.to_string(), formula.to_string())]);
        let wrong = Header { constraints, ..plain.clone() };
        assert!(matches!(wrong.validate(), Err(ModelFileError::Header(text)) if text.starts_with("constraints")));
    }
}

//! The keys of configuration files: one table, from which commented configurations and the reference page are made.

use crate::configuration::{Config, Regularizer};
use crate::lagrangian::configure;
use crate::network::{ActivationChoice, Structure};
use crate::optimizers::Method;
use crate::presets::Preset;
use crate::shooting::Shooting;
use serde_json::Value;

/// A key of a configuration file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// Allowed values, with their unit.
    pub values: &'static str,
    /// Purpose.
    pub purpose: &'static str,
    /// A value in TOML, for keys that may be left out and mean something by that; empty for all others.
    pub example: &'static str,
}

/// A table of a configuration file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section<'a> {
    /// Its name, empty for the keys that stand before any table.
    pub name: &'a str,
    /// Purpose.
    pub purpose: &'static str,
    /// Its keys; empty for a table whose keys the system decides.
    pub keys: &'static [Key],
}

const fn key(name: &'static str, values: &'static str, purpose: &'static str) -> Key {
    Key { name, values, purpose, example: "" }
}

const fn optional(name: &'static str, example: &'static str, values: &'static str, purpose: &'static str) -> Key {
    Key { name, values, purpose, example }
}

/// Everything that determines a training run: the tables of [`Config`], in the order of a file.
pub const TRAINING_SECTIONS: [Section<'static>; 9] = [
    Section {
        name: "",
        purpose: "",
        keys: &[
            key("system", "a name, see `lnn systems`", "Name of the system."),
            key("seed", "a whole number from 0", "Seed of everything random: states, weights, order of the data."),
            key("precision", "f32, f64", "Precision of weights and arithmetic."),
            optional(
                "from",
                "\"runs/other\"",
                "a model file or the directory of a run",
                "Model whose weights the training starts from, instead of random ones; [network] must be the model's.",
            ),
        ],
    },
    Section {
        name: "parameters",
        purpose: "Parameters of the system, in its units (`lnn systems` lists them).",
        keys: &[],
    },
    Section {
        name: "description",
        purpose: "A system that is none of the program's own: what its file says, see the page on system files.",
        keys: &[],
    },
    Section {
        name: "data",
        purpose: "States that are drawn, uniformly within bounds unless said otherwise.",
        keys: &[
            key("training", "1 to 2^30", "Number of training states of every phase."),
            key("validation", "1 to 2^30", "Number of validation states; the best epoch is chosen on them."),
            optional(
                "rescaled_fraction",
                "0.75",
                "0 to 1; 0 unless set",
                "Fraction of the training states of a geodesic that are slowed down or reversed, off the mass shell: on the \
                 shell alone the metric is not identifiable.",
            ),
            optional(
                "trajectory_fraction",
                "0.3",
                "0 to 1; 0 unless set",
                "Fraction of the training states that lie on exact motions from the starts of the trajectory test.",
            ),
            optional(
                "acceleration_weighting",
                "0.1",
                "from 0; 0 unless set",
                "With f above 0 a state weighs f m / (f m + |a|), |a| its scaled acceleration and m the mean of all: a few \
                 huge accelerations do not outweigh the others. A fit adds the error to expect to |a|.",
            ),
            optional(
                "shell",
                "[\"x\", \"y\", \"z\"]",
                "names of Cartesian coordinates around a centre",
                "All states lie in a shell around the centre, instead of their bounds: directions uniform, distances uniform in their \
                 logarithm, velocities time-like; acceleration_weighting then compares with states about as far from the centre.",
            ),
            optional(
                "shell_radius",
                "[1.2, 40]",
                "[low, high] above 0, in the unit of the coordinates",
                "Lowest and highest distance of the shell from its centre.",
            ),
            optional(
                "rapidity",
                "1.2",
                "from 0; 1 unless set",
                "Largest rapidity of states in a shell, in the frame of an observer at rest in the surface of equal time.",
            ),
            key("test", "1 to 2^30", "Number of fresh states on which the final model is judged."),
            key(
                "validation_position",
                "[low, high] for each coordinate, in its unit",
                "Bounds of the coordinates of validation and test states; recorded states need none of the four bounds.",
            ),
            key(
                "validation_velocity",
                "[low, high] for each coordinate, in its unit per unit of time",
                "Bounds of their velocities; those of a velocity that a mass shell fixes mean nothing.",
            ),
        ],
    },
    Section {
        name: "network",
        purpose: "Shape of the network.",
        keys: &[
            key(
                "hidden",
                "1 to 64 widths of 1 to 65536",
                "Widths of the hidden layers; a hybrid's branches share them.",
            ),
            key(
                "activation",
                ActivationChoice::NAMES,
                "Activation of the hidden layers; quadratic-softplus is two networks of half the widths.",
            ),
            key("structure", Structure::NAMES, "How the Lagrangian is made of the network's outputs; see structures."),
            key(
                "factor",
                "triangle, rectangle",
                "How kinetic energy or metric of a structure are factored: a triangle, or a rectangle of three squares a coordinate, which \
                 is smooth where a triangle has a root.",
            ),
            optional(
                "cyclic",
                "[\"t\"]",
                "names of coordinates",
                "Coordinates that the Lagrangian does not depend on.",
            ),
            optional(
                "radial",
                "[[\"x\", \"y\", \"z\"]]",
                "lists of names of Cartesian coordinates",
                "Coordinates that enter by direction and distance R from a centre, as (x_i/R) ln(R/u) and (x_i/R) (u/R): for \
                 fields that reach from near to far.",
            ),
            optional("radial_unit", "1.2", "a positive number; 1 unless set", "The distance u of radial coordinates."),
            key("even_in_v", "true, false", "Make the Lagrangian even in the velocities."),
            key("alpha", "a finite number", "Factor of the added |v|^2 of scaled velocities, of a black box."),
            key("learn_alpha", "true, false", "Learn alpha too; a black box only."),
            optional(
                "known",
                "\"pendulum.toml\"",
                "a system file, or its tables",
                "A Lagrangian that is known and added; its parameters marked learn are learned beside the weights.",
            ),
            optional(
                "time_like",
                "\"t\"",
                "a coordinate",
                "Its square counts negative in the added term, alpha (-t'^2 + x'^2 + ..); without it all squares are added.",
            ),
            key(
                "scaling",
                "physical, none",
                "physical divides q, v and a of a coordinate by the largest of |q| and |v| over the training states.",
            ),
            key("embed_periodic", "true, false", "Feed sine and cosine of angles instead of the angles."),
            key("input_layer", "none, dyt", "What stands before the first dense layer: nothing or a dynamic tanh."),
            optional(
                "dissipation",
                "16",
                "1 to 65536 units",
                "Units of a learned friction, a Rayleigh dissipation; without it the motion keeps its energy.",
            ),
            key(
                "initialization",
                "default, variance-preserving, cranmer, cranmer-paper, near-zero",
                "Distribution of the initial weights.",
            ),
        ],
    },
    Section {
        name: "penalty",
        purpose: "Penalty on a wrong signature of the mass matrix.",
        keys: &[
            key(
                "kind",
                Regularizer::NAMES,
                "What is penalised. Beside a time-like coordinate signature, which wants one negative eigenvalue and names no time, or \
                 lorentzian-sylvester, which wants a negative element of the time: not for metrics inside of a horizon or of an \
                 ergosphere, where it is positive.",
            ),
            optional("lambda", "100.0", "0 to 10^12", "Weight beside the loss; not with kind none."),
            optional("time", "\"t\"", "a coordinate", "The time-like coordinate; with lorentzian-sylvester only."),
        ],
    },
    Section {
        name: "optimizer",
        purpose: "How weights are updated.",
        keys: &[
            key("method", Method::NAMES, "Update rule."),
            key("batch", "1 to 2^30 states", "States per step."),
            key(
                "weight_decay",
                "from 0",
                "Weight decay: added to the gradient (L2), or, by adamw, a shrinking by the rate times it.",
            ),
            key("clip", "above 0, inf for none", "The gradient's norm is cut to this."),
            key(
                "averaging",
                "0 to below 1",
                "Weights are averaged over about 1/(1 - averaging) steps for validation and the final model.",
            ),
            key(
                "on_failure",
                "skip, stop",
                "What happens to a state or a step that is not finite: it is left out, or training stops.",
            ),
        ],
    },
    Section {
        name: "phase",
        purpose: "A stretch of training; may stand several times, each from the best weights of the one before.",
        keys: &[
            key("epochs", "1 to 2^24", "Passes through the training states."),
            key("rate", "above 0 to 1000", "Learning rate at the start."),
            key("eta_min", "0 to the rate", "Lowest learning rate."),
            key(
                "schedule",
                "constant, cosine, cosine-annealing",
                "How the rate moves: not at all, by half a cosine over the phase, falling and rising again every 2 t_max.",
            ),
            key("t_max", "above 0, in epochs", "Epochs from highest to lowest rate of cosine-annealing."),
            key(
                "position",
                "[low, high] for each coordinate, in its unit",
                "Bounds of the training states' coordinates.",
            ),
            key(
                "velocity",
                "[low, high] for each coordinate, in its unit per unit of time",
                "Bounds of their velocities; those of a velocity that a mass shell fixes mean nothing.",
            ),
            optional(
                "log_uniform",
                "[true, false]",
                "true or false for each coordinate",
                "For which coordinates half of the states are uniform in the logarithm.",
            ),
        ],
    },
    Section {
        name: "lbfgs",
        purpose: "Full-batch L-BFGS in double precision after the last phase; without this table there is none.",
        keys: &[
            optional("iterations", "100", "1 to 2^24", "Iterations at most."),
            optional("memory", "20", "1 to 1000", "Pairs of steps and gradient differences that are kept."),
        ],
    },
];

/// Multiple shooting: the table of [`Shooting`].
pub const SHOOTING_SECTION: Section<'static> = Section {
    name: "shooting",
    purpose: "Multiple shooting, of a fit to the motion itself.",
    keys: &[
        key("samples_per_segment", "2 to 65536", "Samples predicted from one start, about."),
        optional("steps", "8", "1 to 65536", "Integration steps per segment; without it as many as the noise demands."),
        key("epochs", "1 to 2^24", "Passes through all segments."),
        key("batch", "1 to 2^30", "Segments per update of the weights."),
        key("method", Method::NAMES, "Update rule of the weights."),
        key("rate", "above 0 to 1000", "Learning rate at the start, falling to 0 by half a cosine."),
        key(
            "weight_decay",
            "from 0",
            "Weight decay: added to the gradient (L2), or, by adamw, a shrinking by the rate times it.",
        ),
        key("clip", "above 0, inf for none", "The gradient's norm is cut to this."),
        key("continuity", "from 0", "Weight of the gap of a joint, in units of noise, beside one observation."),
        key("huber", "above 0, inf for plain squares", "Residuals beyond so many standard deviations count linearly."),
        key("start_share", "above 0 to 1", "Part of a Gauss-Newton step that a start takes when it is visited."),
        key("curvature_every", "1 to 2^24", "Epochs between two linearisations of the motion by the starts."),
    ],
};

/// The reference of configuration files as a page of Markdown: a table for every section, with the values of the quick
/// preset for the double pendulum.
pub fn configuration_reference() -> String {
    let quick = configure::<f64>("double-pendulum", &[]).ok().and_then(|system| Preset::Quick.config(&system));
    let quick: Option<Config> = quick;
    let training = serde_json::to_value(quick).unwrap_or_default();
    let shooting = serde_json::json!({ "shooting": serde_json::to_value(Shooting::default()).unwrap_or_default() });
    let mut page = String::new();
    for section in &TRAINING_SECTIONS {
        page += &section_reference(section, &training, "quick preset");
    }
    page + &section_reference(&SHOOTING_SECTION, &shooting, "default")
}

/// A section of the reference; `values` holds its tables, and `whose` says whose values they are.
pub fn section_reference(section: &Section<'_>, values: &Value, whose: &str) -> String {
    let heading = match section.name {
        "" => String::new(),
        "phase" => "### `[[phase]]`\n\n".to_string(),
        name => format!("### `[{name}]`\n\n"),
    };
    let purpose = if section.purpose.is_empty() { String::new() } else { format!("{}\n\n", section.purpose) };
    let mut text = heading + &purpose;
    if section.keys.is_empty() {
        return text;
    }
    let table = match &values[section.name] {
        Value::Array(phases) => phases.first().unwrap_or(&Value::Null),
        _ if section.name.is_empty() => values,
        table => table,
    };
    text += &format!("| key | values | {whose} | what it is |\n|---|---|---|---|\n");
    for key in section.keys {
        let value = match &table[key.name] {
            Value::Null => "-".to_string(),
            value => format!("`{value}`"),
        };
        // Brackets outside of code would be links.
        let cell = |text: &str| text.replace('|', "\\|").replace('[', "\\[");
        text += &format!("| `{}` | {} | {value} | {} |\n", key.name, cell(key.values), cell(key.purpose));
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::{Known, Lbfgs, Regularizer};
    use crate::network::{ActivationChoice, InputLayer};
    use std::collections::BTreeSet;

    /// Paths of all keys of a value, tables of lists included; what stands in `open` is not descended into.
    fn paths(value: &Value, before: &str, found: &mut BTreeSet<String>) {
        let Value::Object(table) = value else { return };
        for (name, value) in table {
            let path = if before.is_empty() { name.clone() } else { format!("{before}.{name}") };
            match value {
                Value::Object(_) => paths(value, &path, found),
                Value::Array(items) if items.iter().any(Value::is_object) => paths(&items[0], &path, found),
                _ => drop(found.insert(path)),
            }
        }
    }

    fn listed(sections: &[Section<'_>]) -> BTreeSet<String> {
        let path = |section: &Section<'_>, key: &Key| match section.name {
            "" => key.name.to_string(),
            name => format!("{name}.{}", key.name),
        };
        sections.iter().flat_map(|s| s.keys.iter().map(move |key| path(s, key))).collect()
    }

    #[test]
    fn the_table_lists_the_keys_that_there_are() {
        let system = configure::<f64>("ads4-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        config.from = Some("a".to_string());
        config.network.dissipation = Some(16);
        config.network.cyclic = vec!["t".to_string()];
        config.network.known = Some(Known::File("a.toml".to_string()));
        config.lbfgs = Some(Lbfgs::default());
        config.data.trajectory_fraction = 0.5;
        config.data.shell = vec!["x".to_string()];
        (config.data.shell_radius, config.data.rapidity) = (Some([1.0, 2.0]), Some(1.0));
        (config.network.radial, config.network.radial_unit) = (vec![vec!["x".to_string()]], Some(2.0));
        let mut found = BTreeSet::new();
        paths(&serde_json::to_value(&config).unwrap(), "", &mut found);
        assert_eq!(found, listed(&TRAINING_SECTIONS));
        let mut found = BTreeSet::new();
        let shooting = Shooting { steps: Some(3), ..Shooting::default() };
        paths(&serde_json::json!({ "shooting": shooting }), "", &mut found);
        assert_eq!(found, listed(&[SHOOTING_SECTION]));
    }

    #[test]
    fn every_choice_that_is_listed_is_one() {
        let values = |section: &str, key: &str| -> Vec<&str> {
            let section = TRAINING_SECTIONS.iter().find(|s| s.name == section).unwrap();
            section.keys.iter().find(|k| k.name == key).unwrap().values.split(", ").collect()
        };
        let mut known = ActivationChoice::ALL.map(ActivationChoice::name).to_vec();
        let mut listed = values("network", "activation");
        known.sort_unstable();
        listed.sort_unstable();
        assert_eq!(listed, known);
        let read = |value: &str| serde_json::from_value::<Value>(Value::from(value)).unwrap();
        for kind in values("penalty", "kind") {
            let table = serde_json::json!({ "kind": kind, "lambda": 1.0, "time": "t" });
            let mut table = table.as_object().unwrap().clone();
            if kind != "lorentzian-sylvester" {
                table.remove("time");
            }
            assert!(serde_json::from_value::<Regularizer>(Value::from(table)).is_ok(), "{kind}");
        }
        for layer in values("network", "input_layer") {
            assert!(serde_json::from_value::<InputLayer>(read(layer)).is_ok(), "{layer}");
        }
        let system = configure::<f64>("double-pendulum", &[]).unwrap();
        let config = serde_json::to_value(Preset::Quick.config(&system).unwrap()).unwrap();
        for (section, key) in [
            ("network", "initialization"),
            ("network", "scaling"),
            ("optimizer", "method"),
            ("optimizer", "on_failure"),
            ("", "precision"),
        ] {
            for value in values(section, key) {
                let mut config = config.clone();
                match section {
                    "" => config[key] = read(value),
                    _ => config[section][key] = read(value),
                }
                assert!(serde_json::from_value::<Config>(config).is_ok(), "{section}.{key} = {value}");
            }
        }
    }

    #[test]
    fn the_reference_is_a_page_of_tables() {
        let page = configuration_reference();
        assert!(page.contains("| `hidden` | 1 to 64 widths of 1 to 65536 | `[128,128,128]` |"), "{page}");
        assert!(page.contains("### `[[phase]]`") && page.contains("### `[shooting]`") && page.contains("\\|v\\|^2"));
    }
}

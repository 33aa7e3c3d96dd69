//! Pages of the folder `docs`: guides, references, figures. Their code is tested with that of the library.
//!
//! | page | for |
//! |---|---|
//! | [`tutorial_film`] | a quarter of an hour: from a film's tracked points to a law with its constants |
//! | [`tutorial_robot`] | the same from a robot's log of angles and torques to its constants and to inverse dynamics |
//! | [`tutorial_urdf`] | the same from the URDF of an arm and a log to the URDF of the arm that was built |
//! | [`tutorial_motor`] | the same from a log of voltages and angles to the constants of a motor and its pendulum |
//! | [`tutorial_star`] | the same from observations of a binary star to its orbit |
//! | [`tutorial_metric`] | the same from a metric to its curvature, its geodesics, and a picture of its sky |
//! | [`commands`] | every command and option of the program, exit codes, files |
//! | [`many_machines`] | running an experiment on a cluster or in many processes |
//! | [`system_files`] | describing your own system in a text file, by a Lagrangian or a metric |
//! | [`configuration`] | every key of `config.toml`, presets |
//! | [`recorded_motion`] | learning from your own data: formats, noise, friction, films |
//! | [`structures`] | mass matrices and metrics whose signature is built in, cyclic coordinates, known terms |
//! | [`geometry`] | metric, connection and curvature of a Lagrangian, learned or written down |
//! | [`black_holes`] | the metric of a black hole learned from free fall, its orbits and its shadow |
//! | [`symmetries`] | symmetries of a Lagrangian, charges along motion, comparison of two Lagrangians |
//! | [`constraints`] | constraints beside a Lagrangian, found in data, kept in roll-outs; degenerate Lagrangians |
//! | [`formula`] | a Lagrangian as a formula, from recorded motion or from a model |
//! | [`identify`] | the constants of a Lagrangian whose form is known, from recorded motion |
//! | [`limits`] | what motion does not determine: gauge, factor, factors of blocks |
//! | [`certificates`] | proofs that a mass matrix has its signature |
//! | [`summary`] | `summary.json` and `evaluation.json`, key by key |
//! | [`method`] | equations, penalties, identities, units and conventions |
//! | [`library`] | using the Rust crate: features, your own Lagrangian, your own states, examples |
//! | [`python`] | the Python package; models in JAX, PyTorch and numpy |
//! | [`model_format`] | `model.safetensors`, readable without this crate |
//! | [`results`] | accuracy on five systems, limits, time to accuracy, what made training exact, the tables of others |
//! | [`paper`] | the paper's tables and ours, what they confirm, where a training needs the penalty, all experiments |
//! | [`accuracy`] | errors of the numerics, run time against error |
//! | [`hessians`] | second derivatives and accelerations of one state and of batches, few and many coordinates, beside CasADi |
//! | [`performance`] | times of training steps, evaluations and small matrices, beside PyTorch and JAX |
//! | [`architecture`] | flow of data, modules, how to add a system, an operation, an integrator |
//! | [`building`] | test programs, fuzzing, benchmarks |

/// A page after the definitions of its links: the first definition of a label counts, so that these definitions, to modules, precede the
/// page's own, to files.
macro_rules! page {
    ($file:literal) => {
        concat!(
            "[commands]: crate::docs::commands\n",
            "[drives]: crate::docs::formula#periodic-drives\n",
            "[many-machines]: crate::docs::many_machines\n",
            "[rollout]: crate::docs::commands#lnn-rollout\n",
            "[inverse]: crate::docs::commands#forces-from-accelerations\n",
            "[configuration]: crate::docs::configuration\n",
            "[system-files]: crate::docs::system_files\n",
            "[links]: crate::docs::system_files#a-chain-of-links\n",
            "[forces]: crate::docs::system_files#forces\n",
            "[robots]: crate::docs::system_files#robots-from-files\n",
            "[inputs]: crate::docs::system_files#inputs\n",
            "[measured]: crate::docs::system_files#measured-quantities\n",
            "[events]: crate::docs::system_files#events\n",
            "[time]: crate::docs::system_files#time\n",
            "[formulas]: crate::docs::system_files#formulas\n",
            "[summary]: crate::docs::summary\n",
            "[presets]: crate::docs::configuration#presets\n",
            "[recorded-motion]: crate::docs::recorded_motion\n",
            "[guess]: crate::docs::recorded_motion#how-columns-are-guessed\n",
            "[guesses]: crate::docs::verdicts#checks-and-guesses\n",
            "[recorded]: crate::docs::recorded_motion#ways-to-learn\n",
            "[by-forces]: crate::docs::recorded_motion#residuals-of-force\n",
            "[tube]: crate::docs::recorded_motion#tubes\n",
            "[structures]: crate::docs::structures\n",
            "[grey-boxes]: crate::docs::structures#grey-boxes\n",
            "[ranges]: crate::docs::recorded_motion#how-well-the-data-determine-the-model\n",
            "[geometry]: crate::docs::geometry\n",
            "[horizons]: crate::docs::geometry#horizons-and-ergosurfaces\n",
            "[black-holes]: crate::docs::black_holes\n",
            "[orbits]: crate::docs::black_holes#recorded-orbits\n",
            "[wormholes]: crate::docs::black_holes#wormholes-a-second-sky\n",
            "[symmetries]: crate::docs::symmetries\n",
            "[canonical]: crate::docs::symmetries#canonical-form\n",
            "[constraints]: crate::docs::constraints\n",
            "[formula]: crate::docs::formula\n",
            "[identify]: crate::docs::identify\n",
            "[certificates]: crate::docs::certificates\n",
            "[verdicts]: crate::docs::verdicts\n",
            "[method]: crate::docs::method\n",
            "[conventions]: crate::docs::method#units-and-conventions\n",
            "[friction]: crate::docs::method#friction\n",
            "[residuals]: crate::docs::method#residuals-of-force\n",
            "[penalties]: crate::docs::method#penalties\n",
            "[valid]: crate::docs::method#time-of-valid-prediction\n",
            "[off-shell]: crate::docs::method#metrics-from-geodesics\n",
            "[derivatives]: crate::docs::method#derivatives-of-the-network\n",
            "[compiled-once]: crate::docs::architecture#what-is-compiled-where\n",
            "[page]: crate::docs::commands#lnn-page\n",
            "[library]: crate::docs::library\n",
            "[stability]: crate::docs::library#stability\n",
            "[no-std]: crate::docs::library#without-the-standard-library\n",
            "[python]: crate::docs::python\n",
            "[model-format]: crate::docs::model_format\n",
            "[results]: crate::docs::results\n",
            "[paper]: crate::docs::paper\n",
            "[experiments]: crate::docs::paper#experiments\n",
            "[time-to-accuracy]: crate::docs::results#time-to-accuracy\n",
            "[accuracy]: crate::docs::accuracy\n",
            "[hessians]: crate::docs::hessians\n",
            "[performance]: crate::docs::performance\n",
            "[without-faer]: crate::docs::performance#without-faer\n",
            "[small-matrices]: crate::docs::performance#small-symmetric-matrices\n",
            "[architecture]: crate::docs::architecture\n",
            "[building]: crate::docs::building\n",
            "[studies]: crate::docs::building#studies\n",
            "[the-factor]: crate::docs::limits#the-factor\n",
            "[limits]: crate::docs::limits\n",
            "[tutorial-film]: crate::docs::tutorial_film\n",
            "[tutorial-robot]: crate::docs::tutorial_robot\n",
            "[tutorial-urdf]: crate::docs::tutorial_urdf\n",
            "[tutorial-motor]: crate::docs::tutorial_motor\n",
            "[tutorial-star]: crate::docs::tutorial_star\n",
            "[tutorial-metric]: crate::docs::tutorial_metric\n",
            "[fitted-to-forces]: crate::docs::identify#constants-fitted-to-forces\n",
            "[functions]: crate::docs::symmetries#functions\n",
            "[comparison]: crate::docs::symmetries#comparing-two-lagrangians\n",
            "[search]: crate::docs::formula#how-it-is-found\n",
            "[known-forces]: crate::docs::recorded_motion#known-forces\n",
            "[base-parameters]: crate::docs::tutorial_robot#identify\n",
            "\n",
            include_str!(concat!("../docs/", $file))
        )
    };
}

macro_rules! pages {
    ($($name:ident $file:literal;)*) => {
        $(#[doc = page!($file)] pub mod $name {})*
    };
}

pages! {
    tutorial_film "tutorial-film.md";
    tutorial_robot "tutorial-robot.md";
    tutorial_urdf "tutorial-urdf.md";
    tutorial_motor "tutorial-motor.md";
    tutorial_star "tutorial-star.md";
    tutorial_metric "tutorial-metric.md";
    commands "commands.md";
    many_machines "many-machines.md";
    system_files "system-files.md";
    configuration "configuration.md";
    recorded_motion "recorded-motion.md";
    structures "structures.md";
    geometry "geometry.md";
    black_holes "black-holes.md";
    symmetries "symmetries.md";
    constraints "constraints.md";
    formula "formula.md";
    identify "identify.md";
    limits "limits.md";
    certificates "certificates.md";
    verdicts "verdicts.md";
    summary "summary.md";
    method "method.md";
    library "library.md";
    python "python.md";
    model_format "model-format.md";
    results "results.md";
    paper "paper.md";
    accuracy "accuracy.md";
    hessians "hessians.md";
    performance "performance.md";
    architecture "architecture.md";
    building "building.md";
}

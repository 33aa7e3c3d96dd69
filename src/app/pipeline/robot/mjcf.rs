//! MJCF, the files of MuJoCo: bodies within bodies, with joints, inertials and defaults by class,
//! <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.

use super::geoms;
use super::rigid::{Body, Place, turned as rotated};
use super::xml::{Fault, child, fault, list, numbers};
use super::{Link, Part, Robot};
use crate::lagrangian::turned;
use crate::pipeline::thresholds::MAX_ELEMENTS;
use roxmltree::Node;
use std::collections::BTreeMap;

type Outcome<T> = Result<T, Fault>;

/// Elements of the world that are read, or that do not affect the motion.
const READ: [&str; 8] = ["body", "joint", "geom", "inertial", "site", "camera", "light", "freejoint"];
/// Elements of the root that are read, or that do not affect the motion.
const READ_OF_ROOT: [&str; 8] = ["compiler", "option", "default", "worldbody", "asset", "visual", "statistic", "size"];
/// Unsupported elements that contain bodies; ignoring them would change the robot.
const REFUSED: [&str; 7] = ["include", "frame", "replicate", "composite", "flexcomp", "attach", "plugin"];
/// Attributes of joint springs, which are not read.
const OF_SPRINGS: [&str; 2] = ["stiffness", "springdamper"];

/// Settings of a file, and its defaults by class and element.
pub(super) struct Settings<'a, 'i> {
    /// Value of the unit of angle in radians.
    angle: f64,
    /// `None` for an unsupported sequence of Euler angles.
    euler: Option<bool>,
    /// `true` if geoms determine the inertia even if there is an inertial element, `false` if they never do.
    from_geoms: Option<bool>,
    /// A class with the class around it and its own elements.
    classes: BTreeMap<&'a str, (Option<&'a str>, Node<'a, 'i>)>,
    main: Option<&'a str>,
}

/// An element, with missing attributes taken from its class.
#[derive(Clone, Copy)]
pub(super) struct Styled<'s, 'a, 'i> {
    pub node: Node<'a, 'i>,
    class: Option<&'a str>,
    settings: &'s Settings<'a, 'i>,
}

impl<'a, 'i> Settings<'a, 'i> {
    fn of(root: Node<'a, 'i>) -> Outcome<Self> {
        let mut settings = Self {
            angle: 1f64.to_radians(),
            euler: Some(true),
            from_geoms: None,
            classes: BTreeMap::new(),
            main: None,
        };
        for node in root.children().filter(|node| node.has_tag_name("compiler")) {
            match node.attribute("angle") {
                None | Some("degree") => {}
                Some("radian") => settings.angle = 1.0,
                Some(_) => return Err(fault(node, "`angle`: expected degree or radian")),
            }
            if node.attribute("coordinate").is_some_and(|kind| kind != "local") {
                return Err(fault(node, "`coordinate`: expected local"));
            }
            settings.euler = match node.attribute("eulerseq") {
                None | Some("xyz") => settings.euler,
                Some("XYZ") => Some(false),
                Some(_) => None,
            };
            settings.from_geoms = match node.attribute("inertiafromgeom") {
                Some("true") => Some(true),
                Some("false") => Some(false),
                _ => settings.from_geoms,
            };
        }
        let mut waiting: Vec<(Node<'a, 'i>, Option<&'a str>)> =
            root.children().filter(|node| node.has_tag_name("default")).map(|node| (node, None)).collect();
        while let Some((node, around)) = waiting.pop() {
            let name = node.attribute("class").unwrap_or("main");
            if settings.classes.insert(name, (around, node)).is_some() {
                return Err(fault(node, format!("there is a class {name:?} before")));
            }
            if around.is_none() {
                settings.main = Some(name);
            }
            let inner = node.children().filter(|node| node.has_tag_name("default"));
            waiting.extend(inner.map(|node| (node, Some(name))));
        }
        Ok(settings)
    }

    /// Combines an element with its own class, or with the class that its body sets.
    fn styled(&self, node: Node<'a, 'i>, of_body: Option<&'a str>) -> Outcome<Styled<'_, 'a, 'i>> {
        let class = node.attribute("class").or(of_body).or(self.main);
        match class.filter(|class| !self.classes.contains_key(class)) {
            Some(class) if class != "main" => Err(fault(node, format!("no default has the class {class:?}"))),
            _ => Ok(Styled { node, class, settings: self }),
        }
    }
}

impl<'a, 'i> Styled<'_, 'a, 'i> {
    /// Finds the element that defines an attribute: this one, its class, or an enclosing class.
    fn holder(&self, key: &str) -> Node<'a, 'i> {
        let mut class = self.class;
        let mut holder = self.node;
        let tag = self.node.tag_name().name();
        while !holder.has_attribute(key) {
            let Some((around, node)) = class.and_then(|class| self.settings.classes.get(class)) else {
                return self.node;
            };
            if let Some(own) = node.children().find(|node| node.has_tag_name(tag)) {
                holder = own;
            }
            class = *around;
        }
        holder
    }

    pub fn text(&self, key: &str) -> Option<&'a str> {
        self.holder(key).attribute(key)
    }

    pub fn numbers(&self, key: &str, allowed: &[usize]) -> Outcome<Option<Vec<f64>>> {
        numbers(self.holder(key), key, allowed)
    }

    fn number(&self, key: &str, usual: f64) -> Outcome<f64> {
        Ok(self.numbers(key, &[1])?.map_or(usual, |found| found[0]))
    }

    pub fn triple(&self, key: &str, usual: [f64; 3]) -> Outcome<[f64; 3]> {
        Ok(self.numbers(key, &[3])?.map_or(usual, |found| [found[0], found[1], found[2]]))
    }

    /// Place of the element in the surrounding frame.
    pub fn place(&self) -> Outcome<Place> {
        let at = self.triple("pos", [0.0; 3])?;
        let degenerate = || fault(self.node, "expected a turn of vectors that are not zero");
        let angle = self.settings.angle;
        let turn = if let Some(q) = self.numbers("quat", &[4])? {
            geoms::of_quaternion([q[0], q[1], q[2], q[3]]).ok_or_else(degenerate)?
        } else if let Some(x) = self.numbers("axisangle", &[4])? {
            geoms::about([x[0], x[1], x[2]], x[3] * angle).ok_or_else(degenerate)?
        } else if let Some(x) = self.numbers("euler", &[3])? {
            let [a, b, c] = [0, 1, 2].map(|i| x[i] * angle);
            match self.settings.euler {
                Some(true) => {
                    let turns =
                        [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]].map(|x| Place { turn: turned(x), at: [0.0; 3] });
                    turns[0].then(&turns[1]).then(&turns[2]).turn
                }
                Some(false) => turned([a, b, c]),
                None => return Err(fault(self.node, "`euler`: expected the compiler's `eulerseq` to be xyz or XYZ")),
            }
        } else if let Some(x) = self.numbers("xyaxes", &[6])? {
            geoms::of_axes([x[0], x[1], x[2]], [x[3], x[4], x[5]]).ok_or_else(degenerate)?
        } else if let Some(z) = self.numbers("zaxis", &[3])? {
            geoms::onto([z[0], z[1], z[2]]).ok_or_else(degenerate)?
        } else {
            Place::HERE.turn
        };
        Ok(Place { turn, at })
    }
}

/// A body that is still to be read: its element, the link that carries it, the place of the surrounding frame in that link, and the class
/// of its elements.
type Waiting<'a, 'i> = (Node<'a, 'i>, Option<usize>, Place, Option<&'a str>);

/// Reads the robot of a root element.
pub(super) fn read(root: Node<'_, '_>) -> Outcome<Robot> {
    let settings = Settings::of(root)?;
    let world = child(root, "worldbody")?.ok_or_else(|| fault(root, "missing element <worldbody>"))?;
    if let Some(node) = root.descendants().find(|node| REFUSED.contains(&node.tag_name().name())) {
        return Err(fault(
            node,
            "an element that holds others in this way is not read; let MuJoCo write the model without it",
        ));
    }
    let count = world.descendants().filter(Node::is_element).count();
    if count > MAX_ELEMENTS {
        return Err(fault(world, format!("expected at most {MAX_ELEMENTS} elements in it, found {count}")));
    }
    let gravity = match child(root, "option")? {
        Some(node) => super::xml::triple(node, "gravity", [0.0, 0.0, -9.81])?,
        None => [0.0, 0.0, -9.81],
    };
    let name = root.attribute("model").unwrap_or("robot").to_string();
    let mut reader = Reader {
        settings: &settings,
        robot: Robot { name, gravity, links: Vec::new(), notes: Vec::new() },
        held: Vec::new(),
    };
    let mut waiting: Vec<Waiting<'_, '_>> = Vec::new();
    push_bodies(&mut waiting, world, (None, Place::HERE, None));
    while let Some((node, carrier, place, class)) = waiting.pop() {
        let class = node.attribute("childclass").or(class);
        let (carrier, place) = reader.read_body(node, (carrier, place), class)?;
        push_bodies(&mut waiting, node, (carrier, place, class));
    }
    let Reader { mut robot, held, .. } = reader;
    if !held.is_empty() {
        robot.notes.push(format!("joints of other kinds are held fixed: {}", list(&held)));
    }
    robot.notes.extend(left_out(root, world));
    Ok(robot)
}

/// Pushes the bodies inside another one onto the stack, so that the first one is popped first.
fn push_bodies<'a, 'i>(
    waiting: &mut Vec<Waiting<'a, 'i>>,
    node: Node<'a, 'i>,
    (carrier, place, class): (Option<usize>, Place, Option<&'a str>),
) {
    let first = waiting.len();
    waiting.extend(node.children().filter(|node| node.has_tag_name("body")).map(|node| (node, carrier, place, class)));
    waiting[first..].reverse();
}

/// Lists the elements that are not read.
fn left_out(root: Node<'_, '_>, world: Node<'_, '_>) -> Option<String> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let of_root = root.children().filter(|node| !READ_OF_ROOT.contains(&node.tag_name().name()));
    let of_world = world.descendants().skip(1).filter(|node| !READ.contains(&node.tag_name().name()));
    for node in of_root.chain(of_world).filter(Node::is_element) {
        *counts.entry(format!("<{}>", node.tag_name().name())).or_default() += 1;
    }
    for joint in world.descendants().filter(|node| node.has_tag_name("joint")) {
        for key in OF_SPRINGS.into_iter().filter(|key| joint.has_attribute(*key)) {
            *counts.entry(format!("`{key}` of <joint>")).or_default() += 1;
        }
    }
    let counts: Vec<String> = counts.into_iter().map(|(what, count)| format!("{what} ({count})")).collect();
    (!counts.is_empty()).then(|| format!("not read: {}", list(&counts)))
}

struct Reader<'s, 'a, 'i> {
    settings: &'s Settings<'a, 'i>,
    robot: Robot,
    /// Joints that are fixed because they are not supported.
    held: Vec<String>,
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    /// Reads a body in a frame of the link that carries it; returns the carrier of the bodies inside, and the place of the body's frame in
    /// that carrier.
    fn read_body(
        &mut self,
        node: Node<'a, 'i>,
        (mut carrier, place): (Option<usize>, Place),
        class: Option<&'a str>,
    ) -> Outcome<(Option<usize>, Place)> {
        let mut place = place.then(&Styled { node, class: None, settings: self.settings }.place()?);
        let name = node.attribute("name").unwrap_or("body").to_string();
        for joint in node.children().filter(Node::is_element) {
            let shown = joint.attribute("name").map_or_else(|| format!("of {name}"), String::from);
            match joint.tag_name().name() {
                "freejoint" => self.held.push(format!("{shown} (free)")),
                "joint" => {
                    let joint = self.settings.styled(joint, class)?;
                    match joint.text("type").unwrap_or("hinge") {
                        kind @ ("hinge" | "slide") => {
                            let at = joint.triple("pos", [0.0; 3])?;
                            let anchor = Place { turn: Place::HERE.turn, at };
                            let link = self.link(&joint, &name, (carrier, place.then(&anchor)), kind == "slide")?;
                            self.robot.links.push(link);
                            carrier = Some(self.robot.links.len() - 1);
                            // The frame of the body, seen from that of the joint.
                            place = Place { at: at.map(|x| -x), ..anchor };
                        }
                        kind => self.held.push(format!("{shown} ({kind})")),
                    }
                }
                _ => {}
            }
        }
        let body = self.body(node, class)?;
        if let Some(carrier) = carrier {
            let link = &mut self.robot.links[carrier];
            link.body = link.body.plus(&body.seen(&place), 1.0);
            link.parts.push(Part { name, place, body });
        }
        Ok((carrier, place))
    }

    /// Creates the link that a joint moves, without a body for now.
    fn link(
        &self,
        joint: &Styled<'_, 'a, 'i>,
        body: &str,
        (parent, place): (Option<usize>, Place),
        slides: bool,
    ) -> Outcome<Link> {
        let axis = joint.triple("axis", [0.0, 0.0, 1.0])?;
        let unit = if slides { 1.0 } else { self.settings.angle };
        let turn =
            geoms::about(axis, 0.0).ok_or_else(|| fault(joint.node, "`axis`: expected a vector that is not zero"))?;
        // The position of the joint in the pose that the file describes.
        let reference = joint.number("ref", 0.0)? * unit;
        let length = axis[0].hypot(axis[1]).hypot(axis[2]);
        let moved = match slides {
            true => Place { turn, at: axis.map(|x| -x / length * reference) },
            false => Place { turn: geoms::about(axis, -reference).unwrap_or(turn), at: [0.0; 3] },
        };
        let range = joint.numbers("range", &[2])?.filter(|_| joint.text("limited") != Some("false"));
        let bounds = range.map(|range| (range[0] * unit, range[1] * unit)).filter(|(low, high)| low < high);
        let mut losses = [0.0; 3];
        for (loss, key) in losses.iter_mut().zip(["armature", "damping", "frictionloss"]) {
            *loss = joint.number(key, 0.0)?;
            if *loss < 0.0 {
                return Err(fault(joint.node, format!("`{key}`: expected at least 0, found {loss}")));
            }
        }
        let number = self.robot.links.len() + 1;
        Ok(Link {
            name: body.to_string(),
            joint: joint.node.attribute("name").map_or_else(|| format!("joint{number}"), String::from),
            parent,
            place: place.then(&moved),
            axis,
            slides,
            is_free: !slides && bounds.is_none(),
            bounds,
            speed: None,
            body: Body::default(),
            parts: Vec::new(),
            losses,
            follows: None,
        })
    }

    /// Computes the body of an element from its inertial or from its geoms.
    fn body(&self, node: Node<'a, 'i>, class: Option<&'a str>) -> Outcome<Body> {
        if let Some(inertial) = child(node, "inertial")?.filter(|_| self.settings.from_geoms != Some(true)) {
            return self.inertial(&Styled { node: inertial, class: None, settings: self.settings });
        }
        let mut whole = Body::default();
        if self.settings.from_geoms == Some(false) {
            return Ok(whole);
        }
        for geom in node.children().filter(|node| node.has_tag_name("geom")) {
            whole = whole.plus(&geoms::body(&self.settings.styled(geom, class)?)?, 1.0);
        }
        Ok(whole)
    }

    fn inertial(&self, node: &Styled<'_, 'a, 'i>) -> Outcome<Body> {
        let place = node.place()?;
        let mass = node.number("mass", f64::NAN)?;
        if mass.is_nan() || mass < 0.0 {
            return Err(fault(node.node, "`mass`: expected a number of at least 0"));
        }
        let inertia = match (node.numbers("fullinertia", &[6])?, node.numbers("diaginertia", &[3])?) {
            (Some(i), None) => [[i[0], i[3], i[4]], [i[3], i[1], i[5]], [i[4], i[5], i[2]]],
            (None, Some(i)) => [[i[0], 0.0, 0.0], [0.0, i[1], 0.0], [0.0, 0.0, i[2]]],
            _ => return Err(fault(node.node, "expected `diaginertia` or `fullinertia`")),
        };
        Ok(Body::about(mass, place.at, &rotated(&place.turn, &inertia)))
    }
}

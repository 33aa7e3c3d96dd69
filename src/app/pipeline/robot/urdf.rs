//! URDF: `<link>` and `<joint>` by name, <https://wiki.ros.org/urdf/XML>.

use super::rigid::{Body, Place, turned as rotated};
use super::xml::{Fault, child, children, fault, list, number, required, triple};
use super::{Link, Part, Robot};
use crate::lagrangian::turned;
use crate::names::unknown;
use crate::pipeline::thresholds::{GRAVITY, MAX_ELEMENTS};
use roxmltree::Node;
use std::collections::BTreeMap;

/// Elements that do not affect the motion.
const OF_LOOKS: [&str; 3] = ["visual", "collision", "material"];
/// Elements that are read: of the robot, of a link, of a joint.
const READ: [&[&str]; 3] =
    [&["link", "joint"], &["inertial"], &["parent", "child", "origin", "axis", "limit", "dynamics", "mimic"]];

type Outcome<T> = Result<T, Fault>;

/// The elements of a file by name, not yet interpreted.
struct Elements<'a, 'i> {
    links: BTreeMap<&'a str, Node<'a, 'i>>,
    joints: Vec<Element<'a, 'i>>,
}

/// A joint as written in the file.
struct Element<'a, 'i> {
    node: Node<'a, 'i>,
    name: &'a str,
    kind: Kind,
    parent: &'a str,
    child: &'a str,
}

/// Joints to be read by their order in the file, each with the link that carries its parent, and the place of the parent in that link.
type Waiting<'e, 'a, 'i> = BTreeMap<usize, (&'e Element<'a, 'i>, Option<usize>, Place)>;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Fixed,
    /// Rotates without limits.
    Continuous,
    Revolute,
    Prismatic,
    /// A joint with several coordinates or of an unknown type; it is fixed.
    Other,
}

/// Reads the robot of a root element.
pub(super) fn read(root: Node<'_, '_>) -> Outcome<Robot> {
    let elements = Elements::of(root)?;
    let base = elements.base(root)?;
    let mut robot = Robot {
        name: root.attribute("name").unwrap_or("robot").to_string(),
        gravity: GRAVITY,
        links: Vec::new(),
        notes: elements.left_out(root),
    };
    // Joints whose parents have been read, in the order of the file, so that coordinates keep that order as far as a tree allows.
    let mut waiting = Waiting::new();
    let mut numbers: BTreeMap<&str, Option<usize>> = BTreeMap::new();
    elements.push_children(&mut waiting, (base, None, Place::HERE));
    let mut reached = 1;
    while let Some((joint, carrier, place)) = waiting.pop_first().map(|(_, joint)| joint) {
        reached += 1;
        let place = place.then(&origin(joint.node)?);
        let part =
            Part { name: joint.child.to_string(), place: Place::HERE, body: inertial(elements.links[joint.child])? };
        if joint.moves() {
            numbers.insert(joint.name, Some(robot.links.len()));
            robot.links.push(joint.link((carrier, place), part)?);
            elements.push_children(&mut waiting, (joint.child, Some(robot.links.len() - 1), Place::HERE));
            continue;
        }
        numbers.insert(joint.name, None);
        if let Some(carrier) = carrier {
            let link = &mut robot.links[carrier];
            link.body = link.body.plus(&part.body.seen(&place), 1.0);
            link.parts.push(Part { place, ..part });
        }
        elements.push_children(&mut waiting, (joint.child, carrier, place));
    }
    if reached < elements.links.len() {
        return Err(fault(root, "expected a tree: some links carry each other in a circle"));
    }
    elements.follow(&mut robot, &numbers)?;
    let light = robot.links.iter().filter(|link| link.body.0[0] == 0.0).map(|link| link.name.clone());
    let light: Vec<String> = light.collect();
    if !light.is_empty() {
        robot.notes.push(format!("links that move have no mass: {}", list(&light)));
    }
    Ok(robot)
}

impl<'a, 'i> Elements<'a, 'i> {
    fn of(root: Node<'a, 'i>) -> Outcome<Self> {
        let mut links = BTreeMap::new();
        let count = root.children().filter(Node::is_element).count();
        if count > MAX_ELEMENTS {
            return Err(fault(root, format!("expected at most {MAX_ELEMENTS} elements in it, found {count}")));
        }
        for node in children(root, "link") {
            if links.insert(required(node, "name")?, node).is_some() {
                return Err(fault(node, "there is a link of this name before"));
            }
        }
        let mut joints: Vec<Element<'a, 'i>> = Vec::new();
        for node in children(root, "joint") {
            let end = |tag: &str| -> Outcome<&'a str> {
                let end = child(node, tag)?.ok_or_else(|| fault(node, format!("missing element <{tag}>")))?;
                let name = required(end, "link")?;
                match links.contains_key(name) {
                    true => Ok(name),
                    false => Err(fault(end, unknown("link", name, links.keys().copied().collect::<Vec<_>>()))),
                }
            };
            let (name, parent, child) = (required(node, "name")?, end("parent")?, end("child")?);
            let kind = match required(node, "type")? {
                "fixed" => Kind::Fixed,
                "continuous" => Kind::Continuous,
                "revolute" => Kind::Revolute,
                "prismatic" => Kind::Prismatic,
                _ => Kind::Other,
            };
            joints.push(Element { node, name, kind, parent, child });
        }
        let (mut names, mut ends) = (BTreeMap::new(), BTreeMap::new());
        for joint in &joints {
            if names.insert(joint.name, ()).is_some() {
                return Err(fault(joint.node, "there is a joint of this name before"));
            }
            if let Some(other) = ends.insert(joint.child, joint.name) {
                return Err(fault(joint.node, format!("its child {:?} is that of joint {other:?} too", joint.child)));
            }
        }
        Ok(Self { links, joints })
    }

    /// Finds the only link that no joint moves.
    fn base(&self, root: Node<'_, '_>) -> Outcome<&'a str> {
        let is_free = |name: &&&str| !self.joints.iter().any(|joint| joint.child == **name);
        let free: Vec<&&str> = self.links.keys().filter(is_free).collect();
        match free[..] {
            [base] => Ok(base),
            [] => Err(fault(root, "expected a link that is no joint's child, the base")),
            [first, second, ..] => Err(fault(
                self.links[*second],
                format!("expected one link that is no joint's child, {first:?} is one too"),
            )),
        }
    }

    /// Adds the joints of a link to the waiting list.
    fn push_children<'e>(
        &'e self,
        waiting: &mut Waiting<'e, 'a, 'i>,
        (name, carrier, place): (&str, Option<usize>, Place),
    ) {
        let own = self.joints.iter().enumerate().filter(|(_, joint)| joint.parent == name);
        waiting.extend(own.map(|(at, joint)| (at, (joint, carrier, place))));
    }

    /// Lists the elements that are not read.
    fn left_out(&self, root: Node<'_, '_>) -> Vec<String> {
        let mut notes = Vec::new();
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let inside = [vec![root], self.links.values().copied().collect(), self.joints.iter().map(|j| j.node).collect()];
        for (nodes, known) in inside.iter().zip(READ) {
            for node in nodes.iter().flat_map(|node| node.children()).filter(Node::is_element) {
                let tag = node.tag_name().name();
                if !known.contains(&tag) && !OF_LOOKS.contains(&tag) {
                    *counts.entry(format!("<{tag}>")).or_default() += 1;
                }
            }
        }
        let counts: Vec<String> = counts.into_iter().map(|(tag, count)| format!("{tag} ({count})")).collect();
        if !counts.is_empty() {
            notes.push(format!("not read: {}", list(&counts)));
        }
        let others = self.joints.iter().filter(|joint| joint.kind == Kind::Other);
        let held: Vec<String> = others
            .map(|joint| format!("{} ({})", joint.name, joint.node.attribute("type").unwrap_or_default()))
            .collect();
        if !held.is_empty() {
            notes.push(format!("joints of other kinds are held fixed: {}", list(&held)));
        }
        notes
    }

    /// Connects joints with `<mimic>` to the joints that they follow.
    fn follow(&self, robot: &mut Robot, numbers: &BTreeMap<&str, Option<usize>>) -> Outcome<()> {
        for joint in self.joints.iter().filter(|joint| joint.moves()) {
            let Some(own) = numbers.get(joint.name).copied().flatten() else { continue };
            let (mut ratio, mut offset, mut at) = (1.0, 0.0, joint);
            // A mimic joint may follow another one; no chain is longer than the number of joints.
            for _ in 0..=self.joints.len() {
                let Some(mimic) = child(at.node, "mimic")? else { break };
                offset += ratio * number(mimic, "offset")?.unwrap_or(0.0);
                ratio *= number(mimic, "multiplier")?.unwrap_or(1.0);
                let name = required(mimic, "joint")?;
                let names = || self.joints.iter().filter(|joint| joint.moves()).map(|joint| joint.name);
                let next = self.joints.iter().find(|joint| joint.name == name && joint.moves());
                at =
                    next.ok_or_else(|| fault(mimic, unknown("joint that moves", name, names().collect::<Vec<_>>())))?;
            }
            if child(at.node, "mimic")?.is_some() {
                return Err(fault(joint.node, "joints follow each other in a circle"));
            }
            let leader = numbers.get(at.name).copied().flatten().filter(|leader| *leader != own);
            if let Some(leader) = leader {
                if ratio == 0.0 || !ratio.is_finite() || !offset.is_finite() {
                    return Err(fault(joint.node, format!("expected a multiplier other than 0, found {ratio}")));
                }
                robot.links[own].follows = Some((leader, ratio, offset));
            }
        }
        Ok(())
    }
}

impl Element<'_, '_> {
    fn moves(&self) -> bool {
        !matches!(self.kind, Kind::Fixed | Kind::Other)
    }

    /// Creates the link that the joint moves.
    fn link(&self, (parent, place): (Option<usize>, Place), part: Part) -> Outcome<Link> {
        let slides = self.kind == Kind::Prismatic;
        let axis = child(self.node, "axis")?.map_or(Ok([1.0, 0.0, 0.0]), |node| {
            let axis = triple(node, "xyz", [1.0, 0.0, 0.0])?;
            match axis.iter().any(|x| *x != 0.0) {
                true => Ok(axis),
                false => Err(fault(node, "`xyz`: expected a vector that is not zero")),
            }
        })?;
        let (mut bounds, mut speed) = (None, None);
        if let Some(limit) = child(self.node, "limit")? {
            let pair = (number(limit, "lower")?.unwrap_or(0.0), number(limit, "upper")?.unwrap_or(0.0));
            if pair.0 > pair.1 {
                return Err(fault(limit, format!("expected lower <= upper, found {} and {}", pair.0, pair.1)));
            }
            bounds = Some(pair).filter(|(low, high)| low < high && self.kind != Kind::Continuous);
            speed = number(limit, "velocity")?.filter(|speed| *speed > 0.0);
        }
        let mut losses = [0.0; 3];
        if let Some(dynamics) = child(self.node, "dynamics")? {
            for (loss, key) in losses[1..].iter_mut().zip(["damping", "friction"]) {
                *loss = number(dynamics, key)?.unwrap_or(0.0);
                if *loss < 0.0 {
                    return Err(fault(dynamics, format!("`{key}`: expected at least 0, found {loss}")));
                }
            }
        }
        Ok(Link {
            name: self.child.to_string(),
            joint: self.name.to_string(),
            parent,
            place,
            axis,
            slides,
            is_free: self.kind == Kind::Continuous,
            bounds,
            speed,
            body: part.body,
            parts: vec![part],
            losses,
            follows: None,
        })
    }
}

/// The place given by the `<origin>` of an element.
pub(super) fn origin(node: Node<'_, '_>) -> Outcome<Place> {
    let Some(origin) = child(node, "origin")? else { return Ok(Place::HERE) };
    Ok(Place { turn: turned(triple(origin, "rpy", [0.0; 3])?), at: triple(origin, "xyz", [0.0; 3])? })
}

/// Reads the body of a link; without `<inertial>` it has no mass.
fn inertial(link: Node<'_, '_>) -> Outcome<Body> {
    let Some(node) = child(link, "inertial")? else { return Ok(Body::default()) };
    let place = origin(node)?;
    let mass = match child(node, "mass")? {
        Some(mass) => number(mass, "value")?.ok_or_else(|| fault(mass, "missing attribute `value`"))?,
        None => return Err(fault(node, "missing element <mass>")),
    };
    if mass < 0.0 {
        return Err(fault(node, format!("expected a mass of at least 0, found {mass}")));
    }
    let Some(given) = child(node, "inertia")? else { return Ok(Body::about(mass, place.at, &[[0.0; 3]; 3])) };
    let entry = |key: &str| Ok(number(given, key)?.unwrap_or(0.0));
    let [xx, xy, xz, yy, yz, zz] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"].map(entry);
    let (xx, xy, xz, yy, yz, zz) = (xx?, xy?, xz?, yy?, yz?, zz?);
    let inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    Ok(Body::about(mass, place.at, &rotated(&place.turn, &inertia)))
}

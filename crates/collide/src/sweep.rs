//! Bodies that move along a segment, against bodies at rest.
//!
//! # Conservative advancement
//! Two convex shapes at a distance are separated by the plane across their nearest points. The one that moves cannot touch the other before it has
//! passed the gap at its speed across that plane, so time advances by that (van den Bergen 2004, Ray casting against general convex objects). Where the speed is not
//! positive they never touch. No step goes beyond the contact. Faces take a few steps, and curved surfaces converge quadratically, where they are only grazed
//! by a constant factor.
//!
//! Pairs of nodes are visited by the time when their boxes may first touch, along the axes of the separating-axis test; what begins after the first
//! contact that is known is skipped. Boxes are larger by [`CONTACT`], so that the answer is that of a loop over all pairs.

use canted_obb::Aabb;
use canted_obb::round::{down, up};
use canted_obb::vector::{Vector, cross, dot, length, reach, scale, sub};
use canted_tlas::Tlas;
use canted_trace::{InstanceId, Intersect};

use crate::body::Body;
use crate::boxes::{Frame, PlacedBox};
use crate::closest::{closest_points, touch};
use crate::pose::Pose;
use crate::query::PrimitivePair;
use crate::scene::{placed, world_box};
use crate::walk::{PlacedLeaf, PlacedShape};

/// A gap, relative to the coordinates, that counts as contact of what moves.
const CONTACT: f64 = 1.0 / (1_u64 << 41) as f64;

/// How far before the contact of boxes a search begins, relative to the shapes.
const START: f64 = 1.0 / 1024.0;

/// Steps of a search, far more than it takes.
const MOST_STEPS: usize = 512;

/// The first contact of a body that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// When the bodies touch: the second one is then moved by `t·motion`. 0 where they overlap at the start.
    pub t: f64,
    /// The primitives that touch. Of several at one `t` the lowest pair.
    pub primitives: PrimitivePair,
    /// The point of the first body that is touched, in the space of the query; where they overlap at the start, a point of both.
    pub position: [f64; 3],
    /// Across the contact, from the first body to the second, of unit length; zero where they overlap at the start.
    pub normal: [f64; 3],
    /// Whether they overlap, or touch, at the start.
    pub starts_inside: bool,
}

/// The first contact of the body `b`, which moves by `t·motion` for `t` from 0 to `t_max`, with the body `a` at rest; touching counts.
///
/// Bodies may be meshes, BVHs of spheres and boxes, and single shapes: a capsule, a box or the hull of points that moves. The answer is that of a loop over all pairs of
/// primitives. `t` is not after the contact, and the gap at `t` is below 2^-40 of the coordinates; where surfaces only graze each other within that gap, they may count as
/// touching. The body rests where `motion` is zero. `None` also for a motion that is not finite, and for a `t_max` that is NaN or negative.
///
/// ```
/// use canted_collide::{Capsule, Pose, cast};
/// use canted_wide::TriangleBvh;
///
/// let floor = TriangleBvh::build(&[[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]], &[[0, 1, 2]])?;
/// let person = Capsule { ends: [[1.0, 1.0, 5.0], [1.0, 1.0, 6.5]], radius: 0.5 };
/// let contact = cast(&floor, Pose::IDENTITY, &person, Pose::IDENTITY, [0.0, 0.0, -2.0], 10.0).expect("the person falls onto the floor");
/// assert_eq!((contact.t, contact.normal), (2.25, [0.0, 0.0, 1.0]));
/// # Ok::<(), canted_lbvh::GeometryError>(())
/// ```
#[must_use]
pub fn cast<A: Body, B: Body>(
    a: &A,
    a_pose: impl Into<Pose>,
    b: &B,
    b_pose: impl Into<Pose>,
    motion: [f64; 3],
    t_max: f64,
) -> Option<Contact> {
    let (a_pose, b_pose) = (a_pose.into(), b_pose.into());
    let is_valid = motion.iter().all(|x| x.is_finite()) && t_max >= 0.0 && a_pose.is_usable() && b_pose.is_usable();
    let ((a_root, b_root), true) = ((a.root()?, b.root()?), is_valid) else { return None };
    let origin = a_pose.point_f64(a.reference_point());
    let frames = [Frame::new(a, &a_root.1, &a_pose, origin), Frame::new(b, &b_root.1, &b_pose, origin)];
    let [a_frame, b_frame] = &frames;
    let slack = a_frame.slack(b_frame, CONTACT);
    let across = across(motion);
    let mut first: Option<Contact> = None;
    let (mut a_leaf, mut b_leaf) = (PlacedLeaf::default(), PlacedLeaf::default());
    let (mut a_filled, mut b_filled) = (None, None);
    let begin = |one: &PlacedBox, other: &PlacedBox, limit: f64| {
        let [from, to] = one.meeting(other, motion, &across, slack);
        let from = from.max(0.0);
        // A box that is not a number may be anywhere.
        (!(from > to || from > limit)).then_some(from)
    };
    let mut waiting = vec![(0.0, a_root, b_root)];
    while let Some((from, a_node, b_node)) = waiting.pop() {
        let limit = first.map_or(t_max, |first| first.t);
        if from > limit {
            continue;
        }
        let (a_lanes, b_lanes) = (a.lanes(a_node.0), b.lanes(b_node.0));
        let base = waiting.len();
        match (a_lanes.is_some(), b_lanes.is_some()) {
            (false, false) => {
                if a_filled != Some(a_node.0) {
                    a_leaf.fill(a, a_node.0, &a_pose);
                    a_filled = Some(a_node.0);
                }
                if b_filled != Some(b_node.0) {
                    b_leaf.fill(b, b_node.0, &b_pose);
                    b_filled = Some(b_node.0);
                }
                for one in a_leaf.shapes() {
                    for other in b_leaf.shapes() {
                        let limit = first.map_or(t_max, |first| first.t);
                        let found = first_contact(one, other, motion, limit);
                        let is_earlier = |found: &Contact| {
                            first.is_none_or(|first| (found.t, found.primitives) < (first.t, first.primitives))
                        };
                        first = found.filter(is_earlier).or(first);
                    }
                }
            }
            (is_open, other) if is_open && (!other || a_frame.size_of(&a_node.1) >= b_frame.size_of(&b_node.1)) => {
                let single = b_frame.placed(&b_node.1);
                for child in (0..8).filter_map(|lane| a.child(a_node.0, lane)) {
                    if let Some(from) = begin(&a_frame.placed(&child.1), &single, limit) {
                        waiting.push((from, child, b_node));
                    }
                }
            }
            _ => {
                let single = a_frame.placed(&a_node.1);
                for child in (0..8).filter_map(|lane| b.child(b_node.0, lane)) {
                    if let Some(from) = begin(&single, &b_frame.placed(&child.1), limit) {
                        waiting.push((from, a_node, child));
                    }
                }
            }
        }
        waiting[base..].sort_by(|one, other| other.0.total_cmp(&one.0));
    }
    first
}

/// Two axes across a vector; coordinate axes for zero.
fn across(motion: Vector) -> [Vector; 2] {
    let least = (0..3).min_by(|&i, &j| motion[i].abs().total_cmp(&motion[j].abs())).unwrap_or(0);
    let axis = std::array::from_fn(|k| f64::from(u8::from(k == least)));
    let size = reach(motion);
    let unit = |v: Vector| canted_obb::vector::normalized(v).unwrap_or([0.0; 3]);
    let first = unit(cross(if size > 0.0 { scale(motion, 1.0 / size) } else { motion }, axis));
    [first, unit(cross(if size > 0.0 { scale(motion, 1.0 / size) } else { motion }, first))]
}

/// When one shape first touches another at rest.
fn first_contact(one: &PlacedShape, other: &PlacedShape, motion: Vector, t_max: f64) -> Option<Contact> {
    let size = |shape: &PlacedShape| shape.points.iter().fold(shape.radius, |most, &point| most.max(reach(point)));
    let (rest, speed) = (size(one), reach(motion));
    let slack = 2.0 * CONTACT * (rest + size(other));
    let [from, to] = one.meeting(other, motion, slack);
    let contact = |t: f64, position: Vector, normal: Vector| Contact {
        t,
        primitives: [one.primitive, other.primitive],
        position,
        normal,
        starts_inside: normal == [0.0; 3],
    };
    if from > to || from > t_max || to < 0.0 {
        return None;
    }
    if from <= 0.0 && touch(one, other) {
        return Some(contact(0.0, closest_points(one, other).points[0], [0.0; 3]));
    }
    // The boxes do not touch before; a little earlier, so that there is a gap whose direction is certain.
    let mut t = (from - START * (rest + size(other)) / speed).max(0.0);
    let (mut moved, mut normal) = (other.clone(), None);
    for step in 0.. {
        moved.clone_from(other);
        moved.move_by(scale(motion, t));
        let closest = closest_points(one, &moved);
        // What the coordinates are at `t`: those of the motion have roundings, too.
        let tolerance = CONTACT * (rest + size(&moved) + t * speed);
        let between = sub(closest.points[1], closest.points[0]);
        let (apart, gap) = (length(between), closest.distance);
        let is_apart = gap > tolerance && step < MOST_STEPS;
        // The direction of the last gap that was not all roundings.
        if apart > 0.0 && (is_apart || normal.is_none()) {
            let unit = scale(between, 1.0 / apart);
            let approach = -dot(unit, motion);
            if approach <= 0.0 {
                return None;
            }
            normal = Some(unit);
            if is_apart {
                t += gap / approach;
                if t <= t_max {
                    continue;
                }
                return None;
            }
        }
        let backward = || canted_obb::vector::normalized(scale(motion, -1.0 / speed)).unwrap_or([0.0; 3]);
        return Some(contact(t, closest.points[0], normal.unwrap_or_else(backward)));
    }
    None
}

/// The first contact of a body that moves by `t·motion`, for `t` from 0 to `t_max`, with the instances of a TLAS; ties go to the lowest instance. See [`cast`]; the first body
/// is that of the instance, in world space.
#[must_use]
pub fn cast_at_instances<B: Intersect + Body, S: Body>(
    tlas: &Tlas<B>,
    body: &S,
    pose: impl Into<Pose>,
    motion: [f64; 3],
    t_max: f64,
) -> Option<(InstanceId, Contact)> {
    let pose = pose.into();
    let start = world_box(body, &pose)?;
    if !(t_max >= 0.0 && motion.iter().all(|x| x.is_finite())) {
        return None;
    }
    // Where the body is at the end, rounded outward; of an infinite motion, everything on its side.
    let shift = |k: usize| if motion[k] == 0.0 { 0.0 } else { motion[k] * t_max };
    let swept = Aabb {
        min: std::array::from_fn(|k| down(f64::from(start.min[k]) + shift(k).min(0.0)).next_down().max(f32::MIN)),
        max: std::array::from_fn(|k| up(f64::from(start.max[k]) + shift(k).max(0.0)).next_up().min(f32::MAX)),
    };
    let mut first: Option<(InstanceId, Contact)> = None;
    tlas.each_instance_in(&swept, |id| {
        let (own, own_pose) = placed(tlas, id);
        let limit = first.map_or(t_max, |first| first.1.t);
        if let Some(found) = cast(own, own_pose, body, pose, motion, limit)
            && first.is_none_or(|(other, first)| (found.t, id) < (first.t, other))
        {
            first = Some((id, found));
        }
        std::ops::ControlFlow::Continue(())
    });
    first
}

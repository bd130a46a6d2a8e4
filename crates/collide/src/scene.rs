//! Whole scenes: which instances of a TLAS touch each other, and which primitives of them a body touches.
//!
//! The broad phase asks the top level for the instances near a box; the narrow phase descends over both bodies in world space, by the rules of
//! [`pairs`](crate::pairs). Instances that rays cannot hit, removed or hidden by their mask or a scale by zero, touch nothing. Moving instances are where they are as
//! the shutter opens.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use canted_obb::Aabb;
use canted_obb::round::{down, up};
use canted_tlas::{InstancePrimitive, Tlas};
use canted_trace::{InstanceId, Intersect, forms};
use canted_wide::{NodeBox, WideBvh};

use crate::body::Body;
use crate::pose::Pose;
use crate::query::{Distance, distance, each_pair, overlaps};
use crate::walk::Bodies;

/// Two instances, the lower one first.
pub type InstancePair = [InstanceId; 2];

/// Two instances and their nearest points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceDistance {
    /// The instances, the lower one first.
    pub instances: InstancePair,
    /// Their distance, nearest points in world space, and primitives.
    pub nearest: Distance,
}

/// The body of an instance, and where it is.
pub(crate) fn placed<B: Intersect>(tlas: &Tlas<B>, instance: InstanceId) -> (&B, Pose) {
    let given = tlas.instance(instance).expect("an instance of the TLAS");
    (&tlas.blas()[given.blas as usize], Pose::from(given.world_from_object))
}

/// Roundings of a pose, relative to the terms: far more than they are.
const ROUNDING: f64 = 1.0 / (1_u64 << 44) as f64;

/// The bounds of an instance, larger by what its pose may round.
fn grown_bounds<B: Intersect>(tlas: &Tlas<B>, instance: InstanceId) -> Option<Aabb> {
    let Aabb { min, max } = tlas.instance_bounds(instance)?;
    let (own, pose) = placed(tlas, instance);
    let reach = own.bounds().corners().as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let by: [f64; 3] = std::array::from_fn(|k| {
        let [x, y, z, w] = pose.columns.map(|column| column[k].abs());
        ROUNDING * ((x + y + z) * reach + w)
    });
    Some(Aabb {
        min: std::array::from_fn(|k| down((f64::from(min[k]) - by[k]).next_down()).max(f32::MIN)),
        max: std::array::from_fn(|k| up((f64::from(max[k]) + by[k]).next_up()).min(f32::MAX)),
    })
}

/// All pairs of instances that share a point, touching included, in ascending order. Replaces the contents of `found`.
///
/// What [`overlaps`] says of each two instances under their transforms: surfaces that touch. A mesh inside of a closed one does not touch it.
pub fn instance_pairs<B: Intersect + Body>(tlas: &Tlas<B>, found: &mut Vec<InstancePair>) {
    found.clear();
    for id in (0..tlas.n_numbers() as u32).map(InstanceId) {
        each_partner(tlas, id, |other| {
            // The other one finds this pair.
            if id < other && instances_touch(tlas, [id, other]) {
                found.push([id, other]);
            }
        });
    }
    found.sort_unstable();
}

/// Whether two instances share a point.
fn instances_touch<B: Intersect + Body>(tlas: &Tlas<B>, pair: InstancePair) -> bool {
    let [(a, a_pose), (b, b_pose)] = pair.map(|instance| placed(tlas, instance));
    overlaps(a, a_pose, b, b_pose)
}

/// Calls `visit` with the instances whose bounds meet those of one.
fn each_partner<B: Intersect>(tlas: &Tlas<B>, id: InstanceId, mut visit: impl FnMut(InstanceId)) {
    let Some(bounds) = grown_bounds(tlas, id) else { return };
    tlas.each_instance_in(&bounds, |other| {
        if other != id {
            visit(other);
        }
        ControlFlow::Continue(())
    });
}

/// The pairs of instances that touch, from frame to frame: an update costs what the instances cost that changed.
///
/// ```
/// use canted_collide::Contacts;
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_trace::InstanceId;
/// use canted_wide::TriangleBvh;
///
/// let triangle = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
/// let at = |x: f32| Affine::translation([x, 0.0, 0.0]);
/// let mut tlas = Tlas::new(vec![triangle], &[Instance::new(0, at(0.0)), Instance::new(0, at(5.0))], Default::default())?;
/// let mut contacts = Contacts::new(&tlas);
/// assert_eq!(contacts.pairs().count(), 0);
/// tlas.set_transform(InstanceId(1), at(1.0))?;
/// let changes = contacts.update(&tlas, &[InstanceId(1)]);
/// assert_eq!(changes.begun, [[InstanceId(0), InstanceId(1)]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// Each pair in both orders.
    pairs: BTreeSet<[u32; 2]>,
}

/// Pairs of instances whose contact begins or ends, in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContactChanges {
    /// Pairs that touch and did not touch before.
    pub begun: Vec<InstancePair>,
    /// Pairs that touched and do not touch any more.
    pub ended: Vec<InstancePair>,
}

impl Contacts {
    /// All pairs of instances that touch.
    #[must_use]
    pub fn new<B: Intersect + Body>(tlas: &Tlas<B>) -> Self {
        let mut found = vec![];
        instance_pairs(tlas, &mut found);
        Self { pairs: found.into_iter().flat_map(|[a, b]| [[a.0, b.0], [b.0, a.0]]).collect() }
    }

    /// The pairs of [`instance_pairs`], in ascending order.
    pub fn pairs(&self) -> impl Iterator<Item = InstancePair> {
        self.pairs.iter().filter(|[a, b]| a < b).map(|pair| pair.map(InstanceId))
    }

    /// The instances that touch one, in ascending order.
    pub fn of(&self, instance: InstanceId) -> impl Iterator<Item = InstanceId> {
        let id = instance.0;
        self.pairs.range([id, 0]..=[id, u32::MAX]).map(|pair| InstanceId(pair[1]))
    }

    /// Brings the pairs up to date after these instances were inserted, removed, moved, masked, or got another mesh, in any order; one may be named twice.
    ///
    /// The pairs are then those of [`Contacts::new`].
    pub fn update<B: Intersect + Body>(&mut self, tlas: &Tlas<B>, changed: &[InstanceId]) -> ContactChanges {
        let (mut before, mut after) = (BTreeSet::new(), BTreeSet::new());
        let in_order = |a: u32, b: u32| [a.min(b), a.max(b)].map(InstanceId);
        for &id in changed {
            before.extend(self.of(id).map(|other| in_order(id.0, other.0)));
        }
        for &id in changed {
            each_partner(tlas, id, |other| {
                let pair = in_order(id.0, other.0);
                if !after.contains(&pair) && instances_touch(tlas, pair) {
                    after.insert(pair);
                }
            });
        }
        let changes = ContactChanges {
            begun: after.difference(&before).copied().collect(),
            ended: before.difference(&after).copied().collect(),
        };
        for [a, b] in &changes.ended {
            self.pairs.remove(&[a.0, b.0]);
            self.pairs.remove(&[b.0, a.0]);
        }
        self.pairs.extend(changes.begun.iter().flat_map(|[a, b]| [[a.0, b.0], [b.0, a.0]]));
        changes
    }
}

/// The `k` pairs of instances with the least distances, of those at most `max_distance` apart, nearest first; ties go to the lowest pair. Replaces the
/// contents of `nearest`. Distances are those of [`distance`].
pub fn closest_instance_pairs<B: Intersect + Body>(
    tlas: &Tlas<B>,
    k: usize,
    max_distance: f64,
    nearest: &mut Vec<InstanceDistance>,
) {
    nearest.clear();
    let ids: Vec<InstanceId> = (0..tlas.n_numbers() as u32).map(InstanceId).collect();
    let (ids, boxes): (Vec<_>, Vec<_>) = ids.into_iter().filter_map(|id| Some((id, grown_bounds(tlas, id)?))).unzip();
    let Ok(boxes) = WideBvh::over(boxes) else { return };
    if k == 0 || max_distance.is_nan() || max_distance < 0.0 {
        return;
    }
    let bodies = Bodies { a: (&boxes, Pose::IDENTITY), b: (&boxes, Pose::IDENTITY) };
    bodies.walk(max_distance, true, |a, b, mut limit| {
        for one in a.shapes() {
            for other in b.shapes() {
                if one.primitive >= other.primitive || !one.is_near(other, limit) {
                    continue;
                }
                let instances = [one, other].map(|one| ids[one.primitive.index()]);
                let [(a, a_pose), (b, b_pose)] = instances.map(|instance| placed(tlas, instance));
                let Some(found) = distance(a, a_pose, b, b_pose, limit) else { continue };
                let order = |one: &InstanceDistance| (one.nearest.distance, one.instances);
                let found = InstanceDistance { instances, nearest: found };
                let place = nearest.partition_point(|other| order(other) < order(&found));
                nearest.insert(place, found);
                nearest.truncate(k);
                if nearest.len() == k {
                    limit = limit.min(nearest[k - 1].nearest.distance);
                }
            }
        }
        limit
    });
}

/// All primitives of instances that share a point with a body, by instance, then primitive. Replaces the contents of `found`.
///
/// The body may be a single [`Shape`](crate::Shape), such as a capsule, a box or the hull of points, or a mesh. What is exact is said at [`pairs`](crate::pairs).
///
/// ```
/// use canted_collide::{Capsule, Pose, touching};
/// use canted_obb::Affine;
/// use canted_tlas::{Instance, Tlas};
/// use canted_wide::TriangleBvh;
///
/// let triangle = TriangleBvh::build(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
/// let at = |z: f32| Instance::new(0, Affine::translation([0.0, 0.0, z]));
/// let tlas = Tlas::new(vec![triangle], &[at(0.0), at(1.0), at(2.0)], Default::default())?;
/// let capsule = Capsule { ends: [[0.2, 0.2, 0.75], [0.2, 0.2, 1.75]], radius: 0.25 };
/// let mut found = vec![];
/// touching(&tlas, &capsule, Pose::IDENTITY, &mut found);
/// assert_eq!(found.iter().map(|(instance, _)| instance.0).collect::<Vec<_>>(), [1, 2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn touching<B: Intersect + Body, S: Body>(
    tlas: &Tlas<B>,
    body: &S,
    pose: impl Into<Pose>,
    found: &mut Vec<InstancePrimitive>,
) {
    forms::all(found, |visit| each_touching(tlas, body, pose, visit));
}

/// Whether any instance shares a point with a body.
#[must_use]
pub fn touches<B: Intersect + Body, S: Body>(tlas: &Tlas<B>, body: &S, pose: impl Into<Pose>) -> bool {
    forms::is_any(|visit| each_touching(tlas, body, pose, visit))
}

/// The lowest (instance, primitive) that shares a point with a body.
#[must_use]
pub fn first_touching<B: Intersect + Body, S: Body>(
    tlas: &Tlas<B>,
    body: &S,
    pose: impl Into<Pose>,
) -> Option<InstancePrimitive> {
    forms::first(|visit| each_touching(tlas, body, pose, visit))
}

/// How many primitives of instances share a point with a body.
#[must_use]
pub fn count_touching<B: Intersect + Body, S: Body>(tlas: &Tlas<B>, body: &S, pose: impl Into<Pose>) -> usize {
    forms::count(|visit| each_touching(tlas, body, pose, visit))
}

/// Calls `visit` with each primitive of an instance that shares a point with a body, in any order, until it breaks. A primitive may come twice.
pub fn each_touching<B: Intersect + Body, S: Body>(
    tlas: &Tlas<B>,
    body: &S,
    pose: impl Into<Pose>,
    mut visit: impl FnMut(InstancePrimitive) -> ControlFlow<()>,
) {
    let pose = pose.into();
    let Some(bounds) = world_box(body, &pose) else { return };
    tlas.each_instance_in(&bounds, |id| {
        let (own, own_pose) = placed(tlas, id);
        let mut flow = ControlFlow::Continue(());
        each_pair(own, own_pose, body, pose, |[primitive, _]| {
            flow = visit((id, primitive));
            flow
        });
        flow
    });
}

/// A box around a body under its pose; `None` without primitives and where it is nowhere.
pub(crate) fn world_box<S: Body>(body: &S, pose: &Pose) -> Option<Aabb> {
    let (_, NodeBox { rows, lo, hi }) = body.root().filter(|_| pose.is_usable())?;
    let center = pose.point_f64(body.reference_point());
    let images = rows.map(|row| pose.vector(row.map(f64::from)));
    let ends = |side: f64| -> [f64; 3] {
        std::array::from_fn(|k| {
            let reach =
                center[k].abs() + (0..3).map(|i| images[i][k].abs() * lo[i].abs().max(hi[i].abs())).sum::<f64>();
            let along = (0..3).map(|i| {
                let ends = [images[i][k] * lo[i], images[i][k] * hi[i]];
                if side < 0.0 { ends[0].min(ends[1]) } else { ends[0].max(ends[1]) }
            });
            // Roundings here and of vertices, and bounds of a single shape, are below that.
            center[k] + along.sum::<f64>() + side * (1e-12 * reach + f64::MIN_POSITIVE)
        })
    };
    let (min, max) = (ends(-1.0), ends(1.0));
    let is_number = min.iter().chain(&max).all(|x| !x.is_nan());
    is_number.then(|| Aabb {
        min: min.map(|x| down(x).next_down().max(f32::MIN)),
        max: max.map(|x| up(x).next_up().min(f32::MAX)),
    })
}

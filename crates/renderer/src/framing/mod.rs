//! Automatic choice of a camera.
//!
//! ```text
//! rays from points inside -> interior? -> one open side -> from outside, through that side
//!                                      -> closed        -> from the point and direction with the best view
//!                         -> flat      -> from the front
//!                         -> object    -> from outside, from the front, the right and above
//! ```
//!
//! From points inside its bounding box, an interior shows front faces nearly everywhere. A closed object shows back
//! faces, and an open one shows mostly the background. A pipe or a vessel shows front faces inside and outside, and is an object.
//! A floor that is wider than what stands on it, and small things far away, do not count; see `subject`.

mod fit;
mod probe;
mod room;
mod subject;
mod turn;
mod up;

use std::collections::BTreeSet;

use canted_obb::Aabb;
use canted_scene::{Camera, Scene};
use canted_trace::Intersect;
use glam::DVec3;

use crate::{View, narrow, wide};
use fit::{fit, within};
use probe::{Probe, RayResult, is_front};
use subject::{Rest, rest};
use turn::Turn;
pub use up::{FlatBase, stands_on_z};

/// The direction from which objects are viewed: 35 degrees to the right of the front, which is +z in glTF files, and 22 degrees above.
const THREE_QUARTERS: DVec3 = DVec3::new(0.7, 0.5, 1.0);

/// What a camera shows that was chosen for a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// An object, from outside.
    Object,
    /// A flat object that is upright, from its front.
    Chart,
    /// An interior, from inside or through its open side.
    Room,
}

/// Chooses a camera for `scene` and an image whose width is `aspect` times its height, with +y up; see [`Subject::frame`].
#[must_use]
pub fn frame(scene: &Scene, bvh: &dyn Intersect, aspect: f64) -> Camera {
    Subject::new(scene, [0.0, 1.0, 0.0]).frame(scene, bvh, aspect).0
}

/// What a picture of a scene is about: the scene without a floor that is wider than what stands on it, and without small things far away.
#[derive(Clone, Copy, Debug)]
pub struct Subject {
    turn: Turn,
    /// Local bounds of the whole scene.
    whole: Aabb,
    /// Local bounds.
    bounds: Aabb,
    n_pieces: usize,
    /// Whether the scene has a floor that is wider than what stands on it.
    pub has_floor: bool,
}

impl Subject {
    /// The subject of a scene. `up` is the scene's up direction in world space; a direction without length counts as +y.
    #[must_use]
    pub fn new(scene: &Scene, up: [f32; 3]) -> Self {
        let turn = Turn::of_up(up);
        let whole = turn.bounds(scene);
        let Rest { bounds, has_floor, n_pieces } = rest(scene, turn);
        let bounds = if bounds.is_empty() { whole } else { bounds };
        Self { turn, whole, bounds, n_pieces, has_floor }
    }

    /// Width, height and depth in world units, as seen from the front; zero for a scene without triangles.
    #[must_use]
    pub fn extent(&self) -> [f64; 3] {
        self.bounds.extent()
    }

    /// The point below the center, at the height of the lowest point; world space.
    #[must_use]
    pub fn foot(&self) -> [f32; 3] {
        let [_, height, _] = self.extent();
        let foot = DVec3::from(self.bounds.center()) - DVec3::new(0.0, 0.5 * height, 0.0);
        narrow(self.turn.to_world(foot))
    }

    /// The height of a point in world space above [`Subject::foot`].
    #[must_use]
    pub fn height_of(&self, point: [f32; 3]) -> f64 {
        self.turn.to_local(wide(point)).y - f64::from(self.bounds.min[1])
    }

    /// Whether a point in world space is inside the box of the whole scene.
    #[must_use]
    pub fn is_within(&self, point: [f32; 3]) -> bool {
        let local: [f32; 3] = narrow(self.turn.to_local(wide(point)));
        (0..3).all(|k| self.whole.min[k] < local[k] && local[k] < self.whole.max[k])
    }

    /// Whether the subject is flat and upright.
    #[must_use]
    pub fn is_chart(&self) -> bool {
        thin_axis(self.extent().into()).is_some()
    }

    /// Whether rays from straight below meet fronts in at least half of the box: objects are closed there, landscapes are not.
    #[must_use]
    pub fn has_underside(&self, scene: &Scene, bvh: &dyn Intersect) -> bool {
        const SIDE: u32 = 32;
        let probe = self.of_bounds(scene, bvh, self.bounds);
        let below = DVec3::Y * probe.extent().length();
        let is_front = |i: &u32| {
            let [x, z] = [i % SIDE, i / SIDE].map(|k| (f64::from(k) + 0.5) / f64::from(SIDE));
            let from = probe.point_at(DVec3::new(x, 0.0, z)) - below;
            matches!(probe.cast(from, DVec3::Y), RayResult::Front { .. })
        };
        2 * (0..SIDE * SIDE).filter(is_front).count() >= (SIDE * SIDE) as usize
    }

    /// Chooses a camera for an image whose width is `aspect` times its height.
    ///
    /// Objects are viewed from direction (0.7, 0.5, 1), or from a side where their single-sided surfaces are drawn, as large as the image allows; flat and upright ones from the front; interiors with
    /// one open side from outside, through it; closed interiors from inside, at two fifths of their height, from the point and direction
    /// with the best view. Directions are those of a scene with +y up. The result does not depend on the acceleration structure.
    #[must_use]
    pub fn frame(&self, scene: &Scene, bvh: &dyn Intersect, aspect: f64) -> (Camera, Shown) {
        let of_whole = Self { bounds: self.whole, ..*self };
        let is_whole = self.bounds == self.whole || room::is_interior(&self.of_bounds(scene, bvh, self.whole));
        let (camera, shown) = if is_whole { &of_whole } else { self }.view(scene, bvh, aspect);
        // Something else may hide it.
        let (camera, shown) = if is_whole || self.is_seen(scene, bvh, &self.turn.camera(&camera), aspect) {
            (camera, shown)
        } else {
            of_whole.view(scene, bvh, aspect)
        };
        (self.turn.camera(&camera), shown)
    }

    /// Whether a camera shows it: at least a hundredth of an image whose width is `aspect` times its height is filled by it, the camera
    /// is not inside of it, and does not nearly touch it.
    #[must_use]
    pub fn is_shown_by(&self, scene: &Scene, bvh: &dyn Intersect, camera: &Camera, aspect: f64) -> bool {
        scene.instances.is_empty() || self.is_seen(scene, bvh, camera, aspect)
    }

    fn of_bounds<'a>(&self, scene: &'a Scene, bvh: &'a dyn Intersect, bounds: Aabb) -> Probe<'a> {
        Probe::new(scene, bvh, bounds, self.turn)
    }

    /// The local camera.
    fn view(&self, scene: &Scene, bvh: &dyn Intersect, aspect: f64) -> (Camera, Shown) {
        let probe = self.of_bounds(scene, bvh, self.bounds);
        let from = |direction| fit(scene, self.turn, &self.bounds, direction, aspect);
        if room::is_interior(&probe) && !(is_plain(scene) && room::is_closed_object(&probe)) {
            match room::open_side(&probe) {
                Some(side) => return (from(side), Shown::Room),
                None if self.n_pieces > 1 || !is_plain(scene) || has_colors(scene) => {
                    return (room::view(&probe, aspect), Shown::Room);
                }
                // An object whose triangles have the wrong winding.
                None => {}
            }
        }
        match front_of_chart(&probe) {
            Some(front) => (from(front), Shown::Chart),
            None => (from(side_of_fronts(&probe)), Shown::Object),
        }
    }

    /// Whether a camera shows what is inside of the bounds.
    fn is_seen(&self, scene: &Scene, bvh: &dyn Intersect, camera: &Camera, aspect: f64) -> bool {
        /// Rays along the longer side of the picture.
        const N_RAYS: f64 = 48.0;
        /// Part of the rays that meet the subject.
        const SEEN: f64 = 0.01;
        /// Part of the rays that meet backs where the camera is inside of an object.
        const INSIDE: f64 = 0.95;
        /// What a camera that nearly touches a surface shows: few triangles, and a small part of the subject.
        const FEW: usize = 8;
        const SMALL: f64 = 0.03;
        let longest = aspect.max(1.0);
        let [width, height] = [aspect / longest, 1.0 / longest].map(|side| ((N_RAYS * side) as u32).max(1));
        let Ok(view) = View::new(camera, width, height) else { return false };
        let is_inside = within(&self.bounds);
        let (mut n_seen, mut n_back) = (0_u32, 0_u32);
        let (mut region, mut triangles) = (Aabb::EMPTY, BTreeSet::new());
        for i in 0..width * height {
            let ray = view.ray([f64::from(i % width) + 0.5, f64::from(i / width) + 0.5]);
            let Some(hit) = bvh.closest_hit(&ray) else { continue };
            n_back += u32::from(!is_front(scene, &hit, ray.direction));
            let point = wide(ray.origin) + wide(ray.direction) * f64::from(hit.t);
            let point = self.turn.to_local(point);
            if Some(hit.instance.0) != scene.ground && is_inside(point) {
                n_seen += 1;
                region.grow(narrow(point));
                triangles.insert((hit.instance, hit.primitive));
            }
        }
        let diagonal = |bounds: &Aabb| DVec3::from(bounds.extent()).length();
        let is_patch = triangles.len() <= FEW && diagonal(&region) < SMALL * diagonal(&self.bounds);
        let n_rays = f64::from(width * height);
        !is_patch && f64::from(n_seen) >= SEEN * n_rays && f64::from(n_back) < INSIDE * n_rays
    }
}

/// Whether a scene has few materials, as a pipe or a vessel has; buildings, whose walls may have fronts on both sides, have many.
fn is_plain(scene: &Scene) -> bool {
    const MAX_PARTS: usize = 4;
    scene.meshes.iter().map(|mesh| mesh.parts.len()).sum::<usize>() <= MAX_PARTS
}

/// Whether surfaces have colors that vary, as those of a scanned room do.
fn has_colors(scene: &Scene) -> bool {
    let is_textured = scene.materials.iter().any(|material| material.textures().next().is_some());
    is_textured || scene.meshes.iter().any(|mesh| mesh.colors.is_some())
}

/// The direction from which objects are viewed, from above; from below or behind where only hidden backs are seen from there.
fn side_of_fronts(probe: &Probe) -> DVec3 {
    let others =
        [[1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]].map(|signs| DVec3::from(signs) * THREE_QUARTERS);
    std::iter::once(THREE_QUARTERS).chain(others).find(|&from| probe.is_drawn_from(from)).unwrap_or(THREE_QUARTERS)
}

/// The horizontal axis along which a box is thin, if it is flat and upright.
fn thin_axis(DVec3 { x, y, z }: DVec3) -> Option<DVec3> {
    /// Depth relative to the shorter of the other sides.
    const FLAT: f64 = 0.15;
    match () {
        () if z <= FLAT * x.min(y) && y > 0.0 => Some(DVec3::Z),
        () if x <= FLAT * y.min(z) && y > 0.0 => Some(DVec3::X),
        () => None,
    }
}

/// The direction to the front of a flat and upright object: the side on which rays meet more fronts, else +z or +x.
fn front_of_chart(probe: &Probe) -> Option<DVec3> {
    const SIDE: u32 = 16;
    let front = thin_axis(probe.extent())?;
    let (mut n_front, mut n_back) = (0_u32, 0_u32);
    for i in 0..SIDE * SIDE {
        let [a, b] = [i % SIDE, i / SIDE].map(|k| (f64::from(k) + 0.5) / f64::from(SIDE));
        let relative = if front == DVec3::Z { DVec3::new(a, b, 0.5) } else { DVec3::new(0.5, b, a) };
        let from = probe.point_at(relative) + front * probe.extent().length();
        match probe.cast(from, -front) {
            RayResult::Front { .. } => n_front += 1,
            RayResult::Back { .. } => n_back += 1,
            RayResult::Miss => {}
        }
    }
    Some(if n_back > n_front { -front } else { front })
}

//! Boxes of an acceleration structure, drawn over a picture.
//!
//! ```text
//! SceneBvh -> boxes of a level, world space -> edges -> View -> lines over a Picture
//! ```

use std::fmt;
use std::str::FromStr;

use canted_film::Picture;
use canted_obb::Obb;
use canted_trace::InstanceId;
use glam::{DVec3, Vec3};

use crate::{SceneBvh, SceneLevels, View};

/// Which boxes of a structure are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxLevel {
    /// Those at this distance from the root, which is at level 0.
    ///
    /// In two levels of BVHs, the levels of the top level come first, and then those of the BVHs of all instances, whose roots are at
    /// the level after the last of the top level.
    Level(u32),
    /// Those of the leaves over triangles.
    Leaves,
}

impl FromStr for BoxLevel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "leaves" => Ok(Self::Leaves),
            _ => text.parse().map(Self::Level).map_err(|_| "expected a level, 0 for the root, or leaves".to_owned()),
        }
    }
}

impl fmt::Display for BoxLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Level(level) => write!(f, "{level}"),
            Self::Leaves => f.write_str("leaves"),
        }
    }
}

impl SceneBvh {
    /// The boxes that rays are tested with at a level, world space, up to rounding; as the shutter opens where instances move.
    #[must_use]
    pub fn boxes(&self, shown: BoxLevel) -> Vec<Obb> {
        let mut boxes = vec![];
        let mut keep = |obb: &dyn Fn() -> Obb, level: u32, is_leaf: bool| {
            let is_shown = match shown {
                BoxLevel::Level(wanted) => level == wanted,
                BoxLevel::Leaves => is_leaf,
            };
            if is_shown {
                boxes.push(obb());
            }
        };
        match &self.levels {
            SceneLevels::One(flat) => flat.bvh.each_box(|obb, level, is_leaf| keep(&|| obb, level, is_leaf)),
            SceneLevels::Two(tlas) => {
                tlas.each_box(|obb, level, _| keep(&|| obb, level, false));
                let first = self.n_top_levels();
                for instance in (0..tlas.n_numbers() as u32).filter_map(|i| tlas.instance(InstanceId(i))) {
                    let to_world = &instance.world_from_object;
                    tlas.blas()[instance.blas as usize].each_box(|obb, level, is_leaf| {
                        keep(&|| obb.transformed(to_world), first + level, is_leaf);
                    });
                }
            }
        }
        boxes
    }

    /// The number of levels with boxes.
    #[must_use]
    pub fn n_levels(&self) -> u32 {
        let mut n_below = 0;
        for bvh in self.bottom() {
            bvh.each_box(|_, level, _| n_below = n_below.max(level + 1));
        }
        self.n_top_levels() + n_below
    }

    /// The number of levels of the top level.
    fn n_top_levels(&self) -> u32 {
        let mut n = 0;
        if let SceneLevels::Two(tlas) = &self.levels {
            tlas.each_box(|_, level, _| n = n.max(level + 1));
        }
        n
    }
}

/// Linear color of axis-aligned boxes: blue.
const ALIGNED: [f32; 3] = [0.02, 0.3, 1.0];

/// Linear color of oriented boxes: orange.
const ORIENTED: [f32; 3] = [1.0, 0.22, 0.0];

/// Draws the edges of boxes in world space over a picture, or over the part of one that begins at `corner`. Nothing hides them.
/// Axis-aligned boxes are blue, others orange.
///
/// `view` is that of the whole picture. Colors are linear; a picture that is to be encoded has its tone curve already.
pub fn draw_boxes(picture: &mut Picture, corner: [u32; 2], view: &View, boxes: &[Obb]) {
    let canvas = &mut Canvas { part: picture, corner, size: view.size() };
    // Oriented boxes last, on top: there are usually fewer.
    for is_oriented in [false, true] {
        let color = if is_oriented { ORIENTED } else { ALIGNED };
        for obb in boxes.iter().filter(|obb| is_aligned(obb) != is_oriented) {
            let corners = obb.corners();
            for (a, b) in EDGES {
                if let Some([from, to]) = view.line(corners[a].into(), corners[b].into()) {
                    draw_line(canvas, from, to, color);
                }
            }
        }
    }
}

/// The pairs of corners, as [`Obb::corners`] numbers them, that differ in one bit.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

/// Whether each axis is along one of the coordinates.
fn is_aligned(obb: &Obb) -> bool {
    obb.frame.iter().all(|axis| axis.iter().filter(|x| **x != 0.0).count() == 1)
}

impl View {
    /// The image positions, in pixels, of the ends of a line in world space, cut off behind the eye; `None` where all of it is.
    fn line(&self, a: DVec3, b: DVec3) -> Option<[[f64; 2]; 2]> {
        /// The depth at which lines are cut off, relative to the greater depth of their ends.
        const NEAR: f64 = 1e-4;
        if !self.is_perspective {
            return Some([a, b].map(|point| self.position(point, 1.0)));
        }
        let [near_a, near_b] = [a, b].map(|point| self.depth(point.into()));
        let near = NEAR * near_a.max(near_b);
        if near.is_nan() || near <= 0.0 {
            return None;
        }
        let cut = |point: DVec3, depth: f64, other: DVec3, other_depth: f64| {
            if depth >= near {
                return (point, depth);
            }
            let part = (near - depth) / (other_depth - depth);
            (point + (other - point) * part, near)
        };
        let ends = [cut(a, near_a, b, near_b), cut(b, near_b, a, near_a)];
        Some(ends.map(|(point, depth)| self.position(point, depth)))
    }
}

/// How much a line covers what is behind it.
const OPACITY: f32 = 0.85;

/// A picture, or the part of one of `size` that begins at `corner`.
struct Canvas<'a> {
    part: &'a mut Picture,
    corner: [u32; 2],
    size: [f64; 2],
}

/// Draws a line one pixel wide with soft edges: in each column, or each row of a steep line, it covers two pixels by the distances of
/// their centers. The parts outside the picture are cut off.
fn draw_line(canvas: &mut Canvas, from: [f64; 2], to: [f64; 2], color: [f32; 3]) {
    // Pixel centers are at integers from here on.
    let Some([from, to]) = clipped(from.map(|x| x - 0.5), to.map(|x| x - 0.5), canvas.size) else { return };
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let (along, across) = if dx.abs() >= dy.abs() { (0, 1) } else { (1, 0) };
    let (start, end) = if from[along] <= to[along] { (from, to) } else { (to, from) };
    let length = end[along] - start[along];
    let slope = if length > 0.0 { (end[across] - start[across]) / length } else { 0.0 };
    // A line that is shorter than a pixel covers the nearest one.
    let first = start[along].round();
    let last = end[along].round().max(first);
    let mut position = first;
    while position <= last {
        let center = start[across] + slope * (position - start[along]).clamp(0.0, length);
        let below = center.floor();
        let part = center - below;
        for (offset, coverage) in [(0.0, 1.0 - part), (1.0, part)] {
            let mut pixel = [0.0; 2];
            (pixel[along], pixel[across]) = (position, below + offset);
            blend(canvas, pixel, coverage, color);
        }
        position += 1.0;
    }
}

/// Mixes a color into a pixel, if the part has it.
fn blend(Canvas { part: picture, corner, .. }: &mut Canvas, [x, y]: [f64; 2], coverage: f64, color: [f32; 3]) {
    let [x, y] = [x - f64::from(corner[0]), y - f64::from(corner[1])];
    if x < 0.0 || y < 0.0 || x >= f64::from(picture.width) || y >= f64::from(picture.height) {
        return;
    }
    let index = picture.index(x as u32, y as u32);
    let opacity = OPACITY * coverage as f32;
    let pixel = &mut picture.pixels[index];
    let before = Vec3::from(*pixel);
    *pixel = (before + opacity * (Vec3::from(color) - before)).into();
}

/// The part of a line that is within a pixel of a picture of this size (Liang, Barsky 1984); `None` where there is none.
fn clipped(from: [f64; 2], to: [f64; 2], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let step = to[k] - from[k];
        if !step.is_finite() {
            return None;
        }
        let (low, high) = (-1.0 - from[k], size[k] - from[k]);
        if step == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
        } else {
            let (near, far) = if step > 0.0 { (low / step, high / step) } else { (high / step, low / step) };
            (enter, leave) = (enter.max(near), leave.min(far));
        }
    }
    let at = |t: f64| std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
    (enter <= leave).then(|| [at(enter), at(leave)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wide;
    use crate::{BvhKind, Levels, SceneBvhConfig, flatten};
    use canted_lbvh::Strategy;
    use canted_obb::Affine;
    use canted_scene::{Camera, Instance, Mesh, MeshId, Projection, Scene};

    /// The sum of a line's coverage, and the pixels that it touches.
    fn drawn(from: [f64; 2], to: [f64; 2]) -> (f32, Vec<[u32; 2]>) {
        let mut picture = Picture::filled(8, 6, [0.0; 3]);
        draw_line(&mut Canvas { part: &mut picture, corner: [0, 0], size: [8.0, 6.0] }, from, to, [1.0; 3]);
        let pixels = (0..48).map(|i| [i % 8, i / 8]);
        let touched = pixels.filter(|&[x, y]| picture.pixels[picture.index(x, y)][0] > 0.0).collect();
        (picture.pixels.iter().map(|p| p[0] / OPACITY).sum(), touched)
    }

    #[test]
    fn a_line_covers_a_pixel_in_each_column_or_row() {
        assert_eq!(drawn([0.5, 2.5], [7.5, 2.5]), (8.0, (0..8).map(|x| [x, 2]).collect()));
        assert_eq!(drawn([3.5, 5.5], [3.5, 0.5]), (6.0, (0..6).map(|y| [3, y]).collect()));
        // Between two rows, it covers half of each.
        let (sum, touched) = drawn([0.5, 3.0], [7.5, 3.0]);
        assert!((sum - 8.0).abs() < 1e-5 && touched.len() == 16);
        let (sum, _) = drawn([0.5, 0.5], [7.5, 5.5]);
        assert!((sum - 8.0).abs() < 1e-5, "{sum}");
        assert_eq!(drawn([2.6, 2.4], [2.4, 2.6]).1, [[2, 2]], "a point is a pixel");
    }

    #[test]
    fn what_is_outside_is_cut_off() {
        // From far outside to far outside, through the picture along its third row.
        assert_eq!(drawn([-1e12, 2.5], [1e12, 2.5]).1.len(), 8);
        assert_eq!(drawn([-5.0, -5.0], [-1.0, 9.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([20.0, 1.0], [30.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([f64::NAN, 1.0], [3.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([f64::INFINITY, 1.0], [3.0, 1.0]).1, [[0; 2]; 0]);
        assert_eq!(drawn([9.0, 7.0], [9.0, 7.0]).1, [[0; 2]; 0]);
    }

    /// Two instances of thin ribbons in a few directions, so that some structures have oriented boxes.
    fn scene() -> Scene {
        let mut mesh = Mesh::default();
        for i in 0..120_u16 {
            let [x, y, z] = [7, 11, 13].map(|n| f32::from(i * n % 31) / 8.0);
            let (sin, cos) = (0.4 + f32::from(i % 3)).sin_cos();
            let first = u32::from(4 * i);
            let along = [2.0 * cos, 2.0 * sin, 0.5];
            let end: [f32; 3] = std::array::from_fn(|k| [x, y, z][k] + along[k]);
            let lift = |p: [f32; 3]| [p[0], p[1], p[2] + 0.02];
            mesh.positions.extend([[x, y, z], end, lift(end), lift([x, y, z])]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        let (sin, cos) = 0.6_f32.sin_cos();
        let instance = |shift: f32, first_primitive: u32| Instance {
            mesh: MeshId(0),
            world_from_object: Affine {
                columns: [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0], [shift, -0.25, 0.0]],
            },
            world_from_object_close: None,
            first_primitive,
        };
        Scene { meshes: vec![mesh], instances: vec![instance(0.5, 0), instance(9.0, 0)], ..Scene::default() }
    }

    fn built(scene: &Scene, config: SceneBvhConfig, levels: Levels) -> SceneBvh {
        SceneBvh::build(scene, &SceneBvhConfig { levels, ..config }).unwrap()
    }

    fn configs() -> [SceneBvhConfig; 6] {
        let of_kind = |kind, volumes| SceneBvhConfig { kind, volumes, ..SceneBvhConfig::default() };
        [
            of_kind(BvhKind::Wide, Strategy::Aabb),
            of_kind(BvhKind::Bvh2, Strategy::Aabb),
            of_kind(BvhKind::Bvh2, Strategy::Dop),
            of_kind(BvhKind::Bvh2, Strategy::Combined),
            of_kind(BvhKind::Bih, Strategy::Aabb),
            of_kind(BvhKind::KdTree, Strategy::Aabb),
        ]
    }

    /// The number of triangles of which no box contains all corners, or of a kd-tree, whose cells cut triangles, of which some corner is
    /// in no cell. Boxes may be smaller by the rounding of their axes and center, less than 16 roundings of the greatest coordinate.
    fn n_uncovered(scene: &Scene, boxes: &[Obb], cuts: bool) -> usize {
        let (positions, triangles, _) = flatten(scene).unwrap();
        let reach = positions.iter().flatten().fold(0.0_f32, |reach, x| reach.max(x.abs()));
        let boxes: Vec<Obb> = boxes.iter().map(|obb| obb.grown(f64::from(16.0 * f32::EPSILON * reach))).collect();
        let is_covered = |corners: &[[f32; 3]; 3]| match cuts {
            false => boxes.iter().any(|obb| corners.iter().all(|&p| obb.contains(p))),
            true => corners.iter().all(|&p| boxes.iter().any(|obb| obb.contains(p))),
        };
        triangles.iter().filter(|t| !is_covered(&t.map(|i| positions[i as usize]))).count()
    }

    /// The scene far from the origin: its mesh, or its instances.
    fn far_scenes() -> [Scene; 2] {
        const SHIFT: [f32; 3] = [1e5, -3e4, 2e4];
        let add = |p: &mut [f32; 3]| (0..3).for_each(|k| p[k] += SHIFT[k]);
        let [mut far_mesh, mut far_instances] = [scene(), scene()];
        far_mesh.meshes[0].positions.iter_mut().for_each(add);
        far_instances.instances.iter_mut().for_each(|instance| add(&mut instance.world_from_object.columns[3]));
        [far_mesh, far_instances]
    }

    #[test]
    fn leaves_cover_all_triangles_and_levels_are_complete() {
        let [far_mesh, far_instances] = far_scenes();
        for (scene, levels) in
            [scene(), far_mesh, far_instances].iter().flat_map(|s| [(s, Levels::One), (s, Levels::Two)])
        {
            for config in configs() {
                let bvh = built(scene, config, levels);
                let leaves = bvh.boxes(BoxLevel::Leaves);
                let cuts = config.kind == BvhKind::KdTree;
                assert_eq!(n_uncovered(scene, &leaves, cuts), 0, "{config:?} {levels:?}");
                // The check sees a leaf that is missing.
                let missing: Vec<Obb> = leaves.iter().skip(leaves.len() / 2).copied().collect();
                assert!(n_uncovered(scene, &missing, cuts) > 0, "{config:?} {levels:?}");
                let n = bvh.n_levels();
                let sizes: Vec<usize> = (0..n).map(|level| bvh.boxes(BoxLevel::Level(level)).len()).collect();
                assert_eq!(sizes[0], 1, "{config:?} {levels:?}: {sizes:?}");
                assert!(sizes.iter().all(|&n| n > 0), "{config:?} {levels:?}: {sizes:?}");
                assert!(bvh.boxes(BoxLevel::Level(n)).is_empty(), "{config:?} {levels:?}");
            }
        }
    }

    #[test]
    fn oriented_boxes_are_drawn_as_such() {
        let scene = scene();
        let has_oriented = |volumes| {
            let config = SceneBvhConfig { kind: BvhKind::Bvh2, volumes, ..SceneBvhConfig::default() };
            let boxes = built(&scene, config, Levels::One).boxes(BoxLevel::Leaves);
            boxes.iter().any(|obb| !is_aligned(obb))
        };
        assert!(has_oriented(Strategy::PcaBounded));
        assert!(!has_oriented(Strategy::Aabb));
    }

    /// The position of a point on a ray is the image position that the ray was made for.
    #[test]
    fn positions_are_the_inverse_of_rays() {
        let camera = Camera::pinhole([3.0, 2.0, 5.0], [0.5, 0.0, -1.0], [0.0, 1.0, 0.0], 50.0);
        let parallel = Camera { projection: Projection::Orthographic { height: 4.0 }, ..camera };
        for camera in [camera, parallel] {
            let view = View::new(&camera, 64, 36).unwrap();
            for position in [[0.5, 0.5], [32.0, 18.0], [63.0, 2.25]] {
                let ray = view.ray(position);
                let point = wide(ray.origin) + 3.0 * wide(ray.direction);
                let depth = if view.is_perspective { view.depth(point.into()) } else { 1.0 };
                let found = view.position(point, depth);
                assert!(found.iter().zip(position).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} is not {position:?}");
            }
        }
    }

    /// A box in front of the camera is drawn, one behind it is not, and one around it does not fail.
    #[test]
    fn boxes_behind_the_eye_are_cut_off() {
        let camera = Camera::pinhole([0.0; 3], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 90.0);
        let view = View::new(&camera, 32, 32).unwrap();
        let drawn = |center: [f32; 3], half: f32| {
            let mut picture = Picture::filled(32, 32, [0.5; 3]);
            let obb = Obb { center, frame: Obb::IDENTITY_FRAME, half_extents: [half; 3] };
            draw_boxes(&mut picture, [0, 0], &view, &[obb]);
            assert!(picture.pixels.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
            picture.pixels.iter().filter(|pixel| **pixel != [0.5; 3]).count()
        };
        assert!(drawn([0.0, 0.0, -4.0], 1.0) > 40);
        assert_eq!(drawn([0.0, 0.0, 4.0], 1.0), 0);
        // The far face is seen from inside, and the edges that lead to it.
        assert!(drawn([0.0; 3], 2.0) > 60);
    }

    /// A crop shows the same lines.
    #[test]
    fn a_part_of_the_picture_has_the_lines_of_the_whole() {
        let camera = Camera::pinhole([2.0, 1.5, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0);
        let view = View::new(&camera, 40, 30).unwrap();
        let boxes = [Obb { center: [0.0; 3], frame: Obb::IDENTITY_FRAME, half_extents: [0.5, 0.8, 0.3] }];
        let [mut whole, mut part] = [[40, 30], [20, 15]].map(|[w, h]| Picture::filled(w, h, [0.25; 3]));
        draw_boxes(&mut whole, [0, 0], &view, &boxes);
        draw_boxes(&mut part, [12, 9], &view, &boxes);
        assert!(part.pixels.iter().flatten().any(|x| *x != 0.25));
        assert!(part == whole.cropped([12, 9], [20, 15]));
    }

    #[test]
    fn levels_are_named() {
        assert_eq!("3".parse(), Ok(BoxLevel::Level(3)));
        assert_eq!("leaves".parse(), Ok(BoxLevel::Leaves));
        for wrong in ["-1", "", "leaf", "1.5"] {
            assert!(wrong.parse::<BoxLevel>().is_err(), "{wrong}");
        }
        assert_eq!([BoxLevel::Level(7), BoxLevel::Leaves].map(|level| level.to_string()), ["7", "leaves"]);
    }
}

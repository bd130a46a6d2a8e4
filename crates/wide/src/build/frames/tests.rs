use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Leaf, NodeId, Tree};
use canted_obb::Aabb;
use canted_sah::PlocConfig;
use canted_trace::{RoundCubic, RoundSegment};
use glam::Vec3A;

use super::{BoxAreas, Fit, Fits, Fitted, FrameConfig, ScaledBalls, ScaledShape, ScaledTriangle, fit};
use crate::leaf::{Placed, Primitive};

const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Bound of a row's length less one: 4u.
const LENGTH_ERROR: f64 = 2.0 * f32::EPSILON as f64;

/// The error of an estimate, relative to the area in the worst frame: extents of rounded projections.
const AREA_ERROR: f64 = 64.0 * f32::EPSILON as f64;

/// A tree, its triangles in leaf order, and the areas of its boxes.
struct Input {
    tree: Tree,
    corners: Vec<Corners>,
    inner: Vec<f32>,
    leaf: Vec<f32>,
    scale: f32,
}

impl Input {
    fn of(mesh: &Mesh) -> Self {
        let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let boxes: Vec<Aabb> = corners.iter().map(Leaf::aabb).collect();
        let sorted =
            lbvh::sort_by_code(&lbvh::morton_codes_of_boxes(&Domain::new(&bounds, 2, Bits::B63), &boxes), Bits::B63);
        let in_order: Vec<Aabb> = sorted.leaves.iter().map(|leaf| boxes[leaf.index()]).collect();
        let tree = canted_sah::ploc(sorted, &in_order, &PlocConfig::default());
        let corners = lbvh::in_leaf_order(&corners, &tree.leaves);
        let extent = bounds.extent().into_iter().fold(0.0, f64::max);
        let scale = if extent > 0.0 { 2.0f64.powi(-(extent.log2().floor() as i32)) as f32 } else { 1.0 };
        let area = |triangles: &[Corners]| narrow(area_along(triangles, &IDENTITY, scale));
        let inner = tree.nodes.iter().map(|n| area(&corners[n.first as usize..=n.last as usize])).collect();
        let leaf = corners.iter().map(|&triangle| area(&[triangle])).collect();
        Self { tree, corners, inner, leaf, scale }
    }

    fn fit(&self, config: &FrameConfig) -> Fits {
        let areas = BoxAreas { inner: &self.inner, leaf: &self.leaf };
        fit(&self.tree, &ScaledTriangle::all(&self.corners, self.scale), IDENTITY, &areas, config)
    }

    /// Every fit with the triangles it is for and the area in the mesh frame.
    fn all<'a>(&'a self, fits: &'a Fits) -> impl Iterator<Item = (&'a [Corners], &'a Fit, f32)> {
        let leaves = self.corners.chunks(1).zip(&fits.leaf).zip(&self.leaf);
        let below = |id: usize| {
            let node = &self.tree.nodes[id];
            &self.corners[node.first as usize..=node.last as usize]
        };
        let inner = (0..fits.inner.len()).map(move |id| (below(id), &fits.inner[id], self.inner[id]));
        leaves.map(|((triangles, fit), &area)| (triangles, fit, area)).chain(inner)
    }
}

fn narrow(area: f64) -> f32 {
    area as f32
}

/// The oracle: half of the area of the box along `rows`, in `f64` from the vertices.
fn area_along(triangles: &[Corners], rows: &[[f32; 3]; 3], scale: f32) -> f64 {
    let [x, y, z] = rows.map(|row| {
        let along = |p: &[f32; 3]| (0..3).map(|k| f64::from(row[k]) * f64::from(p[k])).sum::<f64>();
        let projections = || triangles.iter().flatten().map(along);
        (projections().fold(f64::MIN, f64::max) - projections().fold(f64::MAX, f64::min)) * f64::from(scale)
    });
    (x + z) * y + z * x
}

/// The first fit without the stated properties.
fn first_flaw(input: &Input, fits: &Fits) -> Option<String> {
    for (i, (triangles, fit, aligned)) in input.all(fits).enumerate() {
        for row in fit.rows {
            let length = row.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
            let is_unit = (length - 1.0).abs() <= LENGTH_ERROR;
            if !is_unit {
                return Some(format!("{i}: row {row:?} is {length} long"));
            }
        }
        if !(fit.half_area >= 0.0 && fit.half_area <= aligned) {
            return Some(format!("{i}: area {} of {aligned}", fit.half_area));
        }
        let exact = area_along(triangles, &fit.rows, input.scale);
        let error = AREA_ERROR * (f64::from(aligned) + f64::from(aligned).sqrt());
        if (exact - f64::from(fit.half_area)).abs() > error {
            return Some(format!("{i}: area {} is {exact}", fit.half_area));
        }
    }
    None
}

/// The sum over the inner nodes, relative to the sum in the mesh frame.
fn share(input: &Input, fits: &Fits) -> f64 {
    let sum = |areas: &mut dyn Iterator<Item = f32>| areas.map(f64::from).sum::<f64>();
    sum(&mut fits.inner.iter().map(|fit| fit.half_area)) / sum(&mut input.inner.iter().copied())
}

fn moved(mesh: &Mesh, scale: f32, by: f32) -> Mesh {
    let positions = mesh.positions.iter().map(|p| p.map(|x| x * scale + by)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

fn of_triangles(corners: &[Corners]) -> Mesh {
    let positions = corners.iter().flatten().copied().collect();
    let indices = (0..u32::try_from(corners.len()).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Mesh { positions, triangles: indices.collect() }
}

fn ugly() -> Vec<(&'static str, Mesh)> {
    let truss = fixtures::truss(4);
    let part = Mesh { triangles: truss.triangles[..3_000].to_vec(), positions: truss.positions.clone() };
    let needles: Vec<Corners> =
        (0..64u8).map(|i| [[0.0; 3], [1.0, f32::from(i), 3.0], [1.0, f32::from(i), 3.0 + f32::EPSILON]]).collect();
    let points: Vec<Corners> = (0..40u8).map(|i| [[f32::from(i), 0.5, -2.0]; 3]).collect();
    vec![
        ("far", moved(&part, 1.0, 1e7)),
        ("small", moved(&part, 1e-6, 0.0)),
        ("tiny", moved(&part, 1e-30, 0.0)),
        ("huge", moved(&part, 1e30, 0.0)),
        ("part", part),
        ("identical", fixtures::identical(200)),
        ("needles", of_triangles(&needles)),
        ("points", of_triangles(&points)),
        ("one point", of_triangles(&[[[7.0; 3]; 3]; 9])),
        ("one triangle", of_triangles(&[[[0.0; 3], [1.0, 2.0, 3.0], [1.0, 0.0, 0.0]]])),
        ("none", Mesh::default()),
    ]
}

#[test]
fn fits_have_the_stated_properties_at_any_position_and_size() {
    for (name, mesh) in ugly() {
        let input = Input::of(&mesh);
        let fits = input.fit(&FrameConfig::default());
        assert_eq!(fits.inner.len(), input.tree.nodes.len(), "{name}");
        assert_eq!(fits.leaf.len(), input.tree.leaves.len(), "{name}");
        assert_eq!(first_flaw(&input, &fits), None, "{name}");
    }
}

#[test]
fn the_check_detects_a_long_row_a_wrong_area_and_a_nan() {
    let (_, mesh) = ugly().swap_remove(4);
    let input = Input::of(&mesh);
    let changed = |change: fn(&mut Fit)| {
        let mut fits = input.fit(&FrameConfig::default());
        change(&mut fits.inner[17]);
        first_flaw(&input, &fits)
    };
    assert!(changed(|_| ()).is_none());
    assert!(changed(|fit| fit.rows[1] = fit.rows[1].map(|x| x * 1.000_001)).is_some());
    assert!(changed(|fit| fit.rows[1] = [f32::NAN; 3]).is_some());
    assert!(changed(|fit| fit.half_area *= 0.9).is_some());
    assert!(changed(|fit| fit.half_area = f32::NAN).is_some());
}

/// Each node of a strut, whatever its direction, gets a box as small as the strut.
#[test]
fn a_rotated_strut_gets_a_box_along_itself() {
    let rotation = fixtures::Rotation::off_axis();
    let strut = of_triangles(&box_triangles([1.0, 0.02, 0.01]));
    let input = Input::of(&strut.rotated(&rotation));
    let fits = input.fit(&FrameConfig::default());
    let root = fits.inner[NodeId::ROOT.index()];
    let want = 1.0 * 0.02 + 0.02 * 0.01 + 0.01 * 1.0;
    let scale = f64::from(input.scale);
    assert!(f64::from(root.half_area) < 1.001 * want * scale * scale, "{}", root.half_area);
    // Along the coordinate axes it is many times as large.
    assert!(f64::from(input.inner[0]) > 10.0 * want * scale * scale);
}

/// What is aligned with the axes keeps them.
#[test]
fn an_aligned_strut_keeps_its_frame() {
    let input = Input::of(&of_triangles(&box_triangles([1.0, 0.02, 0.01])));
    for (_, fit, area) in input.all(&input.fit(&FrameConfig::default())) {
        assert_eq!((fit.rows, fit.half_area), (IDENTITY, area));
    }
}

/// Measured sums of areas, plus a tenth.
#[test]
fn lattices_shrink_as_measured() {
    let cases = [("truss", fixtures::truss(4), 0.119), ("scaffold", fixtures::scaffold(1, false), 0.48)];
    for (name, mesh, most) in cases {
        let input = Input::of(&mesh);
        let plain = share(&input, &input.fit(&FrameConfig::default()));
        assert!(plain < most, "{name}: {plain}");
    }
}

#[test]
fn large_nodes_keep_the_mesh_frame() {
    let input = Input::of(&fixtures::scaffold(1, false));
    let fits = input.fit(&FrameConfig { max_leaves: 100 });
    let is_oriented = |i: usize| fits.inner[i].rows != IDENTITY;
    for (i, node) in input.tree.nodes.iter().enumerate() {
        assert!(node.n_leaves() <= 100 || !is_oriented(i), "{i}");
    }
    assert!((0..fits.inner.len()).any(is_oriented));
}

#[cfg(feature = "parallel")]
#[test]
fn threads_change_nothing() {
    let input = Input::of(&fixtures::scaffold(1, false));
    let fit = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| input.fit(&FrameConfig::default()))
    };
    assert!(input.tree.tasks.len() > 4);
    assert_eq!(fit(1), fit(7));
}

/// By how much the extents by balls differ at most from those that primitives report, in nodes of a few along random rows.
fn difference_of_balls<P: Primitive>(
    random: impl Fn(&mut SplitMix64) -> P,
    change: impl Fn(&mut Vec<ScaledBalls>),
) -> f32 {
    let mut rng = SplitMix64::new(5);
    let mut greatest = 0.0_f32;
    for n in (1..=6).cycle().take(600) {
        let primitives: Vec<P> = (0..n).map(|_| random(&mut rng)).collect();
        let placed: Vec<Placed> = primitives.iter().map(|primitive| Placed::given(primitive)).collect();
        let mut balls = ScaledBalls::all(&placed, 0.25).unwrap();
        change(&mut balls);
        let shapes: Vec<ScaledShape> = placed.iter().map(|&placed| ScaledShape { placed, scale: 0.25 }).collect();
        let rows = [0; 3].map(|_| Vec3A::from_array(rng.signed3().map(narrow)).normalize());
        let [a, b] = [ScaledBalls::extents(&balls, 1, &rows), ScaledShape::extents(&shapes, 1, &rows)];
        greatest = a.iter().zip(b).fold(greatest, |greatest, (a, b)| greatest.max((a - b).abs()));
    }
    greatest
}

/// Extents by balls are those of segments up to rounding; of curves each end differs by at most a fifth of the distance between control points and
/// chord. Scaled by a quarter.
#[test]
fn balls_have_about_the_extents_of_curves() {
    let point = |rng: &mut SplitMix64| rng.signed3().map(narrow);
    let segment = |rng: &mut SplitMix64| RoundSegment { ends: [point(rng), point(rng)], radii: [0.1, 0.02] };
    let curve = |rng: &mut SplitMix64| {
        let [a, d] = [point(rng), point(rng)];
        let length = (0..3).map(|k| (d[k] - a[k]).powi(2)).sum::<f32>().sqrt();
        let mut bent = |part: f32| {
            let by = Vec3A::from_array(point(rng)).normalize().to_array();
            [0, 1, 2].map(|k| a[k] + part * (d[k] - a[k]) + 0.1 * length * by[k])
        };
        RoundCubic { points: [a, bent(1.0 / 3.0), bent(2.0 / 3.0), d], radii: [0.1, 0.08, 0.05, 0.02] }
    };
    assert!(difference_of_balls(segment, |_| ()) < 1e-6);
    // At both ends, a fifth of a tenth of the greatest length.
    let bound = 0.25 * 2.0 * 0.02 * 2.0 * 3.0_f32.sqrt();
    assert!(difference_of_balls(curve, |_| ()) < bound);
    // One end missing of one primitive is seen: the second ball, which segments have twice, and the last.
    let drop_end = |balls: &mut Vec<ScaledBalls>| {
        balls.last_mut().expect("one at least").copy_ball(0, 1);
        balls.last_mut().expect("one at least").copy_ball(0, 3);
    };
    assert!(difference_of_balls(segment, drop_end) > bound);
    assert!(difference_of_balls(curve, drop_end) > bound);
}

/// The twelve triangles of a box of these sides.
fn box_triangles(sides: [f32; 3]) -> Vec<Corners> {
    let corner = |bits: usize| std::array::from_fn(|k| if bits >> k & 1 == 1 { sides[k] } else { 0.0 });
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c].map(corner), [a, c, d].map(corner)]).collect()
}

//! Rays without pads lose hits, on either side: the tests for lost hits can fail.

use canted_fixtures::{Grazing, Mesh, SplitMix64, displaced_icosphere};
use canted_obb::PrimId;
use canted_trace::{Hit, Intersect, Kernel, Ray, ReferencePoint, ScaledRay, Shear, Watertight};

use super::pass::{PADS, pass_hits};
use super::sink::{AllHits, BestHit};
use crate::leaf::StoredTriangles;
use crate::node::LeafLayout;
use crate::node::checked::Hierarchy;
use crate::simd::{Simd, Task};
use crate::traverse::{BoxPads, Pads, TracedRay};
use crate::update::write_boxes;
use crate::{Config, Costs, SimdPath, TriangleBvh};

const NONE: Pads = Pads { aligned: 0.0, rotated: 0.0, oriented: 0.0 };

/// The closest hit with pads of the test's choice.
struct Padded<'a> {
    bvh: &'a TriangleBvh,
    pads: Pads,
    ray: &'a Ray,
}

impl Task for Padded<'_> {
    type Output = Option<canted_trace::Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Self::Output {
        let ray = ScaledRay::new(self.ray)?;
        let (query, stack) = (&mut (), &mut vec![0; self.bvh.stack_len()][..]);
        let mut best = BestHit::<true>::new(query);
        let ray = TracedRay::new(&ray, &self.bvh.frame, self.pads);
        pass_hits::<S, _, true>(simd, self.bvh, &ray, stack, &mut best);
        best.hit(&ray.scaled)
    }
}

/// The BVH with boxes padded by other relative pads.
fn with_box_pads(mut bvh: TriangleBvh, pads: Pads) -> TriangleBvh {
    let hierarchy = Hierarchy::of(&bvh.nodes, bvh.leaves.halves.len(), &LeafLayout::BLOCKS).expect("a valid BVH");
    let triangles = StoredTriangles::read(&hierarchy, &bvh.leaves.halves);
    write_boxes(
        &hierarchy,
        &triangles.corners,
        &bvh.frame,
        &BoxPads::new(pads, bvh.frame.is_identity),
        &mut bvh.nodes.lines,
    );
    bvh
}

/// The BVH with boxes relative to another point, padded as proven.
fn relative_to(mut bvh: TriangleBvh, point: [f32; 3]) -> TriangleBvh {
    bvh.frame.reference = ReferencePoint::new(point).expect("a small point");
    with_box_pads(bvh, PADS)
}

fn build(mesh: &Mesh, config: Config) -> TriangleBvh {
    TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).expect("a valid mesh")
}

/// How many rays get another hit than with the proven pads, if rays and boxes have these.
fn n_different(bvh: &TriangleBvh, rays: &[Ray], of_rays: Pads, of_boxes: Pads, path: SimdPath) -> usize {
    let proven = bvh.clone().with_path(path);
    let bvh = with_box_pads(bvh.clone(), of_boxes);
    let is_lost =
        |ray: &&Ray| path.available().run(Padded { bvh: &bvh, pads: of_rays, ray }) != proven.closest_hit(ray);
    rays.iter().filter(is_lost).count()
}

fn grazing(mesh: &Mesh) -> Vec<Ray> {
    let rays = Grazing::ALL.into_iter().flat_map(|class| canted_fixtures::grazing(mesh, class, 2000, 1));
    rays.map(|ray| Ray::new(ray.origin, ray.direction)).collect()
}

fn paths() -> impl Iterator<Item = SimdPath> {
    SimdPath::ALL.into_iter().filter(|path| path.is_available())
}

#[test]
fn rays_without_pads_lose_hits() {
    let proven = Pads::of(canted_trace::HIT_ERROR);
    let mesh = canted_fixtures::scaffold_of(1, true, 3);
    let flat = canted_fixtures::coplanar_quads(20).off_axis();
    for path in paths() {
        for (name, mesh, config) in [
            ("aligned nodes", &flat, Config::default().axis_aligned()),
            ("oriented nodes", &flat, Config::default()),
            ("struts", &mesh, Config::default()),
        ] {
            let (bvh, rays) = (build(mesh, config), grazing(mesh));
            assert_eq!(n_different(&bvh, &rays, proven, proven, path), 0, "{name}");
            let lost = n_different(&bvh, &rays, NONE, NONE, path);
            assert!(lost > 0, "{name}, {}: no hit is lost without pads", path.name());
        }
    }
}

#[test]
fn walks_without_oriented_nodes_lose_hits_in_them() {
    let mesh = canted_fixtures::scaffold_of(1, true, 3);
    let (bvh, rays) = (build(&mesh, Config::default()), grazing(&mesh));
    assert!(bvh.nodes.has_oriented);
    let mut without = bvh.clone();
    without.nodes.has_oriented = false;
    assert!(rays.iter().any(|ray| without.closest_hit(ray) != bvh.closest_hit(ray)));
}

/// Rays at corners of triangles, from near them and from as far as `far`, and back.
fn at_corners(mesh: &Mesh, far: f64, n: usize) -> Vec<Ray> {
    let mut rng = SplitMix64::new(7);
    let mut ray = || {
        let target = mesh.positions[rng.below(mesh.positions.len())].map(f64::from);
        let direction = rng.on_sphere();
        let distance = far * rng.unit();
        let [origin, direction] =
            [std::array::from_fn(|k| (target[k] - distance * direction[k]) as f32), direction.map(|x| x as f32)];
        Ray::new(origin, direction)
    };
    (0..n).map(|_| ray()).collect()
}

/// Each part of the padding is needed: that of the ray where origins are far, that of the boxes where meshes are.
#[test]
fn either_part_of_the_padding_alone_loses_hits() {
    let flat = canted_fixtures::coplanar_quads(20).off_axis();
    let away = flat.placed(|[x, y, z]| [x + 1e4, y - 3e4, z + 2e4]);
    for config in [Config::default().axis_aligned(), Config::default()] {
        let near_mesh = build(&flat, config);
        let far_mesh = relative_to(build(&away, config), [0.0; 3]);
        let from_afar = at_corners(&flat, 1e6, 20_000);
        // Shifted so that the origins are near that of the space, and the mesh is not.
        let mut to_far: Vec<Ray> = at_corners(&away, 4e4, 40_000);
        to_far.retain(|ray| ray.origin.iter().all(|x| x.abs() < 3e3));
        let mut own: Vec<Ray> = (0..20_000usize)
            .map(|i| {
                let [x, y, z] = away.positions[i * 7 % away.positions.len()];
                let s = i as f32 * 1e-3;
                Ray::new([s, -s, 0.5 * s], [x - s, y + s, z - 0.5 * s])
            })
            .collect();
        own.append(&mut to_far);
        let proven = PADS;
        for path in paths() {
            let name = path.name();
            assert_eq!(n_different(&near_mesh, &from_afar, proven, proven, path), 0, "{name}");
            assert_eq!(n_different(&far_mesh, &own, proven, proven, path), 0, "{name}");
            assert!(n_different(&near_mesh, &from_afar, NONE, proven, path) > 0, "{name}: rays need no pad");
            assert!(n_different(&far_mesh, &own, proven, NONE, path) > 0, "{name}: boxes need no pad");
        }
    }
}

/// Pads are relative to the reference point: where it is far from both, those of the coordinates as they were given lose hits. A point
/// nearby needs smaller pads and loses nothing.
#[test]
fn pads_relative_to_the_wrong_point_lose_hits() {
    let flat = canted_fixtures::coplanar_quads(20).off_axis();
    let rays = at_corners(&flat, 10.0, 20_000);
    let proven = PADS;
    for config in [Config::default().axis_aligned(), Config::default()] {
        let near = build(&flat, config);
        let far = relative_to(near.clone(), [2.1e4, -3.3e4, 1.7e4]);
        for path in paths() {
            let name = path.name();
            let hits = |bvh: &TriangleBvh| rays.iter().map(|ray| bvh.closest_hit(ray)).collect::<Vec<_>>();
            assert_eq!(hits(&far.clone().with_path(path)), hits(&near), "{name}");
            assert_eq!(n_different(&far, &rays, proven, proven, path), 0, "{name}");
            // Both parts are of one size here, so that either suffices for these rays, but no pad at all does not.
            assert!(n_different(&far, &rays, NONE, NONE, path) > 0, "{name}: no pad is needed");
            // What pads relative to the origin of the space are, seen from the reference point.
            let of_origin = |x: f32| x * 10.0 / 3.3e4;
            let Pads { aligned, rotated, oriented } = proven;
            let small =
                Pads { aligned: of_origin(aligned), rotated: of_origin(rotated), oriented: of_origin(oriented) };
            assert!(n_different(&far, &rays, small, small, path) > 0, "{name}: pads of given coordinates suffice");
        }
    }
}

/// A mesh far from the origin is as it would be there, up to rounding: boxes are relative to a point inside, and pads as small.
#[test]
fn far_meshes_have_a_reference_point_inside() {
    let mesh = canted_fixtures::icosphere(4);
    let away = mesh.placed(|[x, y, z]| [x + 1e4, y - 3e4, z + 2e4]);
    let (near, far) = (build(&mesh, Config::default()), build(&away, Config::default()));
    assert!(near.frame.reference.is_origin());
    let [x, y, z] = far.frame.reference.point();
    assert!((x - 1e4).abs() <= 1.0 && (y + 3e4).abs() <= 1.0 && (z - 2e4).abs() <= 1.0, "{x} {y} {z}");
}

/// All hits in the order in which they are found, with so many entries more on the stack than a walk needs; `t` scaled.
struct AllFound<'a> {
    bvh: &'a TriangleBvh,
    ray: &'a ScaledRay,
    n_more: usize,
}

impl Task for AllFound<'_> {
    type Output = Vec<Hit>;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> Self::Output {
        let (mut query, mut hits, mut stack) = ((), vec![], vec![0; self.bvh.stack_len() + self.n_more]);
        let ray = TracedRay::new(self.ray, &self.bvh.frame, PADS);
        pass_hits::<S, _, true>(simd, self.bvh, &ray, &mut stack, &mut AllHits::new(&mut query, &mut hits));
        hits
    }
}

/// Walks in any order put subtrees off where the stack has room: they find what a loop over all triangles finds, in another order.
#[test]
fn walks_that_put_subtrees_off_lose_no_hit() {
    let sphere = displaced_icosphere(4, 5);
    let mesh = [0.9, 0.8].iter().fold(sphere.clone(), |all, s| all.joined(&sphere.placed(|p| p.map(|x| s * x))));
    let bits = |hit: &Hit| (hit.t.to_bits(), hit.primitive.0, hit.u.to_bits(), hit.v.to_bits());
    for [aligned_node, oriented_node] in [[0.01, 1e6], [1e6, 0.01]] {
        let costs = Costs { aligned_node, oriented_node, leaf: 0.0, block: 0.01, max_leaf: 1 };
        let bvh = build(&mesh, Config { costs, ..Config::default() });
        let mut n_reordered = 0;
        for ray in at_corners(&mesh, 3.0, 30).iter().filter_map(ScaledRay::new) {
            let shear = Shear::new(&ray);
            let of = |(i, corners): (usize, &[u32; 3])| {
                let found =
                    Watertight::intersect(&shear, &ray, &corners.map(|k| mesh.positions[k as usize]), ray.t_max)?;
                Some((found.t.to_bits(), i as u32, found.u.to_bits(), found.v.to_bits()))
            };
            let mut expected: Vec<_> = mesh.triangles.iter().enumerate().filter_map(of).collect();
            expected.sort_unstable();
            for path in paths() {
                let found =
                    [0, 9, 12, 100].map(|n_more| path.available().run(AllFound { bvh: &bvh, ray: &ray, n_more }));
                let order = |hits: &[Hit]| hits.iter().map(|hit| hit.primitive).collect::<Vec<PrimId>>();
                n_reordered += usize::from(order(&found[0]) != order(&found[3]));
                for mut hits in found.map(|hits| hits.iter().map(bits).collect::<Vec<_>>()) {
                    hits.sort_unstable();
                    assert_eq!(hits, expected, "{ray:?}, {}", path.name());
                }
            }
        }
        assert!(n_reordered > 20, "{n_reordered} rays find their hits in another order");
    }
}

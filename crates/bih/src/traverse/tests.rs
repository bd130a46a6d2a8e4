//! Each half of the padding is needed, and both together are enough.

use super::*;
use crate::partition::{Content, Item};
use crate::{BihConfig, LeafSize};
use canted_fixtures::{Grazing, Mesh, coplanar_quads, grazing, soup};
use canted_obb::Aabb;
use canted_trace::{AABB_PAD, Kernel, LeafTriangles, Ray, ReferencePoint, ScaledRay, TriangleTest, Watertight};

/// A traversal whose rays carry no padding.
struct WithoutRayPads<'a>(&'a BoxBih, Ray);

impl Leaves for WithoutRayPads<'_> {
    fn traverse<const ORDERED: bool, Q: Query>(
        &self,
        _: &SlabRay,
        t_max: f32,
        query: &mut Q,
        leaf: impl FnMut(u32, f32, &mut Q) -> f32,
    ) {
        let ray = ScaledRay::new(&self.1).expect("it was scaled before");
        self.0.traverse::<ORDERED, Q>(&SlabRay::with_pads(&ray, 0.0, 0.0), t_max, query, leaf);
    }
}

/// Numbers of rays that hit, and of those that the BIH loses: with both pads, without those of planes, without those of rays.
struct Outcome {
    n_hits: usize,
    n_lost: [usize; 3],
}

fn trace(mesh: &Mesh, rays: &[Ray]) -> Outcome {
    let corners: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect();
    let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::from_points(*corners)).collect();
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
    let config = BihConfig { leaf_size: LeafSize::AtMost(1), tight_factor: 1.0, ..BihConfig::default() };
    let bih = |pad: f32| {
        let items: Vec<Item> = (0..).zip(&boxes).map(|(i, aabb)| Item::new(i, aabb)).collect();
        let content = Content::of(&items);
        let mut bih = BoxBih::with_pad(items, content, &config, pad);
        // The box of the root stays padded: the planes of nodes are tested here.
        bih.padded_bounds = canted_trace::pad_aabb(&bounds, 8.0 * bounds.reach());
        bih
    };
    let (padded, bare) = (bih(AABB_PAD), bih(0.0));
    fn hits(nodes: &impl Leaves, bih: &BoxBih, corners: &[[[f32; 3]; 3]], ray: &Ray) -> usize {
        let sorted = bih.primitives.iter().map(|primitive| corners[primitive.index()]).collect();
        let triangles = LeafTriangles::new(TriangleTest::Watertight, sorted, ReferencePoint::ORIGIN);
        let (ray, mut hits) = (ScaledRay::new(ray).expect("rays of fixtures are valid"), vec![]);
        triangles.all_hits(nodes, &bih.primitives, &ray, &mut (), &mut hits);
        hits.len()
    }
    let mut outcome = Outcome { n_hits: 0, n_lost: [0; 3] };
    for ray in rays {
        let scaled = ScaledRay::new(ray).expect("rays of fixtures are valid");
        let prepared = Watertight::prepare(&scaled);
        let is_hit = |c: &[[f32; 3]; 3]| {
            Watertight::intersect(&prepared, &scaled, &Watertight::record(*c), scaled.t_max).is_some()
        };
        let want = corners.iter().filter(|corners| is_hit(corners)).count();
        let found = [
            hits(&padded, &padded, &corners, ray),
            hits(&bare, &bare, &corners, ray),
            hits(&WithoutRayPads(&padded, *ray), &padded, &corners, ray),
        ];
        outcome.n_hits += want;
        for (lost, found) in outcome.n_lost.iter_mut().zip(found) {
            *lost += want - found;
        }
    }
    outcome
}

#[test]
fn each_half_of_the_padding_is_needed() {
    // Far content needs the padding of planes, far origins that of rays.
    // At an edge of flat content, a ray enters through one plane and leaves through another at the same point.
    let near = coplanar_quads(8).placed(|p| p.map(|x| 0.1 * x + 0.3)).joined(&soup(3, 100));
    let far = near.placed(|p| [p[0] + 1e4, p[1] - 1e4, p[2] + 1e4]);
    let mut n_lost = [0; 3];
    for (mesh, origin_scale) in [(&far, 1.0), (&near, 1e4)] {
        let rays: Vec<Ray> = Grazing::ALL
            .into_iter()
            .flat_map(|class| grazing(mesh, class, 2_000, 4))
            .map(|ray| {
                // From near the origin of the space, or from far away, at the point that the ray aims at.
                let aim: [f32; 3] = std::array::from_fn(|k| ray.origin[k] + ray.direction[k]);
                let origin: [f32; 3] = std::array::from_fn(|k| (aim[k] - mesh.center()[k] as f32) * origin_scale);
                Ray::new(origin, std::array::from_fn(|k| aim[k] - origin[k]))
            })
            .collect();
        let outcome = trace(mesh, &rays);
        assert!(outcome.n_hits > 1_000, "{} hits", outcome.n_hits);
        for (sum, n) in n_lost.iter_mut().zip(outcome.n_lost) {
            *sum += n;
        }
    }
    let [with_both, without_planes, without_rays] = n_lost;
    assert_eq!(with_both, 0);
    assert!(without_planes > 0 && without_rays > 0, "lost {without_planes} and {without_rays} hits");
}

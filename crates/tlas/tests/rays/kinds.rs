//! Any kind of BVH below a TLAS, another TLAS included.

use std::sync::Arc;

use canted_bih::{Bih, BihConfig};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{Grazing, Mesh, SplitMix64, grazing, soup, torus};
use canted_kdtree::{KdTraversal, KdTree, KdTreeConfig};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas};
use canted_trace::{Accept, Counts, Crossings, Hit, InstanceId, Intersect, Ray, SurfacePoint};
use canted_wide::TriangleBvh;

use crate::oracle::affine;

fn bvh(mesh: &Mesh) -> TriangleBvh {
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

#[test]
fn instances_of_kd_trees_have_the_hits_of_bvhs() {
    let mesh = torus(12, 9);
    let mut rng = SplitMix64::new(4);
    let instances: Vec<Instance> = (0..12)
        .map(|_| {
            let columns = [0; 4].map(|_| [0; 3].map(|_| (rng.unit() * 4.0 - 2.0) as f32));
            Instance::new(0, Affine { columns })
        })
        .collect();
    let bvh = Bvh2::build(&mesh.positions, &mesh.triangles, &Bvh2Config::default()).unwrap();
    let of_bvhs = Tlas::new(vec![bvh], &instances, Default::default()).unwrap();
    for traversal in [KdTraversal::Stack, KdTraversal::Ropes] {
        let config = KdTreeConfig { traversal, traversal_cost: 0.1, ..KdTreeConfig::default() };
        let tree = KdTree::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        let of_trees = Tlas::new(vec![tree], &instances, Default::default()).unwrap();
        let (mut n_hit, mut hits, mut want) = (0, vec![], vec![]);
        for ray in Grazing::ALL.into_iter().flat_map(|class| grazing(&mesh, class, 400, 8)) {
            let ray = Ray::new(ray.origin, ray.direction);
            of_trees.all_hits(&ray, &mut hits);
            of_bvhs.all_hits(&ray, &mut want);
            assert_eq!(hits, want, "{ray:?}");
            assert_eq!(of_trees.closest_hit(&ray), of_bvhs.closest_hit(&ray), "{ray:?}");
            assert_eq!(of_trees.occluded(&ray), !want.is_empty(), "{ray:?}");
            n_hit += usize::from(!want.is_empty());
        }
        assert!(n_hit > 500, "{n_hit} rays hit");
    }
}

/// Four kinds in one TLAS, each instance of another, have the hits of one kind.
#[test]
fn kinds_mix() {
    let mesh = torus(12, 9);
    let Mesh { positions, triangles } = &mesh;
    let kinds: Vec<Box<dyn Intersect>> = vec![
        Box::new(bvh(&mesh)),
        Box::new(Bvh2::build(positions, triangles, &Bvh2Config::default()).unwrap()),
        Box::new(Bih::build(positions, triangles, &BihConfig::default()).unwrap()),
        Box::new(KdTree::build(positions, triangles, &KdTreeConfig::default()).unwrap()),
    ];
    let shared: Arc<dyn Intersect> = Arc::new(bvh(&mesh));
    let at = |i: u32, blas: u32| {
        let x = f64::from(i);
        let map = affine([[1.0, 0.3, 0.0], [-0.2, 1.0, 0.1], [0.0, 0.2, 1.0], [0.4 * x, -0.3 * x, 0.2 * x]]);
        Instance::new(blas, map).with_mask(1 << i)
    };
    let mixed = Tlas::new(kinds, &[0, 1, 2, 3].map(|i| at(i, i)), Default::default()).unwrap();
    let same = Tlas::new(vec![shared], &[0, 1, 2, 3].map(|i| at(i, 0)), Default::default()).unwrap();
    let (mut hits, mut want, mut n_hits) = (vec![], vec![], 0);
    for (i, ray) in (0..).zip(Grazing::ALL.into_iter().flat_map(|class| grazing(&mesh, class, 300, 8))) {
        let ray = Ray::new(ray.origin, ray.direction).with_mask([u32::MAX, 0b1010, 0b0100][i % 3]);
        mixed.all_hits(&ray, &mut hits);
        same.all_hits(&ray, &mut want);
        assert_eq!(hits, want, "{ray:?}");
        n_hits += hits.len();
        let odd = |hit: &Hit| hit.primitive.0 % 2 == 1 && hit.instance != InstanceId(1);
        let first = want.iter().copied().find(odd);
        assert_eq!(mixed.closest_hit_with(&ray, &mut Accept(odd)), first, "{ray:?}");
        assert_eq!(mixed.occluded_with(&ray, &mut Accept(odd)), first.is_some(), "{ray:?}");
    }
    assert!(n_hits > 500, "{n_hits} hits");
}

/// A map that scales, rotates and moves.
fn random_map(rng: &mut SplitMix64) -> Affine {
    let angle = 6.3 * rng.unit();
    let (scale, (sin, cos)) = (0.5 + rng.unit(), angle.sin_cos());
    let [x, y, z] = rng.signed3();
    affine([[scale * cos, scale * sin, 0.0], [-scale * sin, scale * cos, 0.0], [0.0, 0.0, scale], [x, y, z]])
}

/// Hits of a TLAS of TLASes are those of its instances one by one: each in the space of the inner TLAS.
#[test]
fn a_tlas_of_tlases_loses_no_hit() {
    let mut rng = SplitMix64::new(9);
    let mesh = soup(6, 200);
    for offset in [0.0, 3e4] {
        let inner = |rng: &mut SplitMix64, n: usize| {
            let instances: Vec<Instance> = (0..n)
                .map(|i| {
                    let open = random_map(rng);
                    let mut close = open;
                    close.columns[3][0] += 0.5;
                    let instance = if i % 3 == 2 { Instance::moving(0, open, close) } else { Instance::new(0, open) };
                    instance.with_mask(1 << (i % 2))
                })
                .collect();
            Tlas::new(vec![bvh(&mesh)], &instances, Default::default()).unwrap()
        };
        let inners = vec![inner(&mut rng, 7), inner(&mut rng, 4), inner(&mut rng, 0)];
        let outer: Vec<Instance> = (0..9)
            .map(|i| {
                let mut map = random_map(&mut rng);
                map.columns[3][1] += offset;
                Instance::new(i % 3, map)
            })
            .collect();
        let singles: Vec<_> = outer
            .iter()
            .map(|instance| {
                Tlas::new(
                    vec![&inners[instance.blas as usize]],
                    &[Instance { blas: 0, ..*instance }],
                    Default::default(),
                )
                .unwrap()
            })
            .collect();
        let tlas = Tlas::new(inners.iter().collect(), &outer, Default::default()).unwrap();
        let (mut counts, mut n_hits) = (Counts::default(), 0);
        for i in 0..3_000 {
            let [mut origin, direction] = [rng.signed3().map(|x| 3.0 * x as f32), rng.on_sphere().map(|x| x as f32)];
            origin[1] += offset;
            let ray =
                Ray::new(origin, direction).with_mask([u32::MAX, 1, 2][i % 3]).at_time([0.0, 0.4, 1.0][i / 3 % 3]);
            let mut want = vec![];
            for (number, single) in (0..).zip(&singles) {
                let mut hits = vec![];
                single.all_hits(&ray, &mut hits);
                want.extend(hits.iter().map(|hit| Hit { instance: InstanceId(number), ..*hit }));
                // The same by every triangle of every inner instance, without boxes.
                assert_eq!(hits.len(), n_by_loop(&mesh, &inners, &outer[number as usize], &ray), "{ray:?}");
            }
            let mut hits = vec![];
            tlas.all_hits(&ray, &mut hits);
            assert_eq!(sorted(&hits), sorted(&want), "{ray:?}");
            assert_eq!(tlas.closest_hit_with(&ray, &mut counts), hits.first().copied(), "{ray:?}");
            let mut crossings = vec![];
            tlas.crossings(&ray, &mut crossings);
            assert!(crossings.iter().all(|crossing| hits.contains(crossing)), "{ray:?}");
            n_hits += hits.len();
        }
        assert!(n_hits > 100 && counts.boxes < 3_000 * 200, "{n_hits} hits, {counts:?}");
    }
}

fn sorted(hits: &[Hit]) -> Vec<(u32, u32, u32)> {
    let mut keys: Vec<_> = hits.iter().map(|hit| (hit.t.to_bits(), hit.instance.0, hit.primitive.0)).collect();
    keys.sort_unstable();
    keys
}

/// Hits of all inner instances of an outer one: each alone below the outer map, so that no box of theirs is shared.
fn n_by_loop(mesh: &Mesh, inners: &[Tlas<TriangleBvh>], outer: &Instance, ray: &Ray) -> usize {
    let Some(scaled) = crate::oracle::in_object(outer, ray) else { return 0 };
    let inner = &inners[outer.blas as usize];
    let seen: Vec<Instance> = inner.instances().iter().filter(|i| i.mask & ray.mask != 0).copied().collect();
    crate::oracle::all_hits(std::slice::from_ref(mesh), &seen, &scaled, ray.time).len()
}

/// Rays that continue from instances, static and moving, do not hit what they leave.
#[test]
fn surface_points_are_in_world_space() {
    let mesh = canted_fixtures::icosphere(2);
    let mut rng = SplitMix64::new(12);
    let instances: Vec<Instance> = (0..6)
        .map(|i| {
            let (open, mut close) = (random_map(&mut rng), Affine::IDENTITY);
            close.columns = open.columns;
            close.columns[3] = [0, 1, 2].map(|k| open.columns[3][k] + 0.3);
            if i % 2 == 0 { Instance::new(0, open) } else { Instance::moving(0, open, close) }
        })
        .collect();
    let tlas = Tlas::new(vec![bvh(&mesh)], &instances, Default::default()).unwrap();
    let mut n_hits = 0;
    for i in 0..1_000 {
        let [origin, direction] = [rng.signed3().map(|x| 5.0 * x as f32), rng.on_sphere().map(|x| x as f32)];
        let ray = Ray::new(origin, direction).at_time([0.0, 0.7][i % 2]);
        let Some(hit) = tlas.closest_hit(&ray) else { continue };
        n_hits += 1;
        let point: SurfacePoint = tlas.surface_point_at(&hit, ray.time);
        let at = ray.at(hit.t.into());
        let distance = (0..3).fold(0.0, |most: f64, k| most.max((at[k] - point.position[k]).abs()));
        assert!(distance < 1e-4, "{distance}: {ray:?}");
        let outward = point.spawn_ray_f64(point.normal).at_time(ray.time);
        let next = tlas.closest_hit(&outward);
        assert!(next.is_none_or(|next| next.primitive != hit.primitive || next.instance != hit.instance), "{next:?}");
    }
    assert!(n_hits > 50, "{n_hits} hits");
}

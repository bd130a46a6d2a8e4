//! Hits are those of the loop, to the bit.

use canted_bih::{Bih, BihConfig};
use canted_fixtures::Mesh;
use canted_fixtures::kinds::{self, RayKind};
use canted_trace::{Accept, BaldwinWeber, Hit, Intersect, MollerTrumbore, Ray, Watertight};

use crate::common::{Named, build, config, configs, doubled, loop_over_all, meshes, placed_meshes, rays};

/// Compares all single queries with the loop. Returns the number of rays that hit.
fn agrees(name: &str, bih: &Bih, rays: &[Ray], wants: &[Vec<Hit>]) -> usize {
    let mut hits = vec![];
    for (ray, want) in rays.iter().zip(wants) {
        let first = want.first().copied();
        assert_eq!(bih.closest_hit(ray), first, "{name}, {bih:?}, {ray:?}");
        assert_eq!(bih.occluded(ray), first.is_some(), "{name}, {bih:?}, {ray:?}");
        bih.all_hits(ray, &mut hits);
        assert_eq!(&hits, want, "{name}, {bih:?}, {ray:?}");
    }
    wants.iter().filter(|want| !want.is_empty()).count()
}

fn agrees_on<K: Named>(name: &str, mesh: &Mesh, n: usize, configs: &[BihConfig]) -> usize {
    let rays = rays(mesh, n);
    let wants: Vec<_> = rays.iter().map(|ray| loop_over_all::<K>(mesh, ray)).collect();
    configs.iter().map(|config| agrees(name, &build::<K>(mesh, config), &rays, &wants)).sum()
}

#[test]
fn every_configuration_agrees_with_the_loop() {
    for (name, mesh) in meshes() {
        agrees_on::<Watertight>(name, &mesh, 15, &configs());
    }
}

#[test]
fn watertight_agrees_with_the_loop() {
    for (name, mesh) in placed_meshes() {
        let n_hits = agrees_on::<Watertight>(&name, &mesh, 80, &[config(1, 1.3), config(4, 1.3)]);
        assert!(n_hits > 100 || mesh.triangles.len() < 3, "{name}: {n_hits} hits");
    }
}

#[test]
fn moller_trumbore_agrees_with_the_loop() {
    for (name, mesh) in placed_meshes() {
        agrees_on::<MollerTrumbore>(&name, &mesh, 30, &[config(1, 1.0), config(3, 1.3)]);
    }
}

#[test]
fn baldwin_weber_agrees_with_the_loop() {
    for (name, mesh) in placed_meshes() {
        agrees_on::<BaldwinWeber>(&name, &mesh, 30, &[config(2, 1.3)]);
    }
}

#[test]
fn slices_are_single_queries() {
    let mesh = doubled();
    let rays = rays(&mesh, 100);
    let n = rays.len();
    let bih = build::<Watertight>(&mesh, &config(2, 1.3)).clone();
    let accepts = |i: usize, hit: &Hit| (hit.primitive.index() + i).is_multiple_of(2);
    let (mut closest, mut occluded, mut all) =
        ([vec![None; n], vec![None; n]], [vec![false; n], vec![false; n]], [vec![vec![]; n], vec![vec![]; n]]);
    bih.closest_hits(&rays, &mut closest[0]);
    bih.par_closest_hits(&rays, &mut closest[1]);
    bih.occluded_many(&rays, &mut occluded[0]);
    bih.par_occluded_many(&rays, &mut occluded[1]);
    bih.all_hits_many(&rays, &mut all[0]);
    bih.par_all_hits_many(&rays, &mut all[1]);
    for (i, ray) in rays.iter().enumerate() {
        let want = loop_over_all::<Watertight>(&mesh, ray);
        for k in [0, 1] {
            assert_eq!((closest[k][i], occluded[k][i], &all[k][i]), (want.first().copied(), !want.is_empty(), &want));
        }
    }
    bih.closest_hits_with(&rays, &mut closest[0], &|i, _, hit| accepts(i, hit));
    bih.par_closest_hits_with(&rays, &mut closest[1], &|i, _, hit| accepts(i, hit));
    bih.occluded_many_with(&rays, &mut occluded[0], &|i, _, hit| accepts(i, hit));
    bih.par_occluded_many_with(&rays, &mut occluded[1], &|i, _, hit| accepts(i, hit));
    bih.all_hits_many_with(&rays, &mut all[0], &|i, _, hit| accepts(i, hit));
    bih.par_all_hits_many_with(&rays, &mut all[1], &|i, _, hit| accepts(i, hit));
    let mut hits = vec![];
    for (i, ray) in rays.iter().enumerate() {
        let mut want = loop_over_all::<Watertight>(&mesh, ray);
        want.retain(|hit| accepts(i, hit));
        for k in [0, 1] {
            assert_eq!((closest[k][i], occluded[k][i], &all[k][i]), (want.first().copied(), !want.is_empty(), &want));
        }
        assert_eq!(bih.closest_hit_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), closest[0][i]);
        assert_eq!(bih.occluded_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit))), occluded[0][i]);
        bih.all_hits_with(ray, &mut Accept(|hit: &Hit| accepts(i, hit)), &mut hits);
        assert_eq!(hits, all[0][i]);
    }
}

#[test]
fn scales_by_powers_of_two_change_no_bit() {
    let mesh = canted_fixtures::torus(12, 7);
    let rays = rays(&mesh, 40);
    let hits = |exponent: i32| -> Vec<_> {
        let scale = 2.0f32.powi(exponent);
        let bih = build::<Watertight>(&mesh.placed(|p| p.map(|x| x * scale)), &config(1, 1.3));
        let scaled = |ray: &Ray| Ray {
            origin: ray.origin.map(|x| x * scale),
            t_min: 0.0,
            t_max: f32::INFINITY,
            direction: ray.direction.map(|d| d.clamp(-1e6, 1e6)),
            ..*ray
        };
        let hits = rays.iter().map(|ray| bih.closest_hit(&scaled(ray)).map(|h| (h.t / scale, h.u, h.v, h.primitive)));
        hits.collect()
    };
    assert!(hits(0).iter().flatten().count() > 100);
    for exponent in [-40, -20, 20, 40] {
        assert_eq!(hits(exponent), hits(0), "2^{exponent}");
    }
}

#[test]
fn every_kind_of_scene_agrees_with_the_loop() {
    for kind in kinds::all() {
        let scene = kind.generate(2_000, 11);
        let of_kinds = RayKind::ALL.into_iter().flat_map(|kind| scene.rays(kind, 40, 5));
        let of_kinds = of_kinds.map(|ray| Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) });
        let mesh = &scene.meshes[0];
        let rays: Vec<Ray> = of_kinds.chain(rays(mesh, 8)).collect();
        let bihs = [BihConfig::default(), config(1, 1.0)].map(|config| build::<Watertight>(mesh, &config));
        for ray in &rays {
            let want = loop_over_all::<Watertight>(mesh, ray).first().copied();
            for bih in &bihs {
                assert_eq!(bih.closest_hit(ray), want, "{}, {bih:?}, {ray:?}", kind.name);
                assert_eq!(bih.occluded(ray), want.is_some(), "{}, {bih:?}, {ray:?}", kind.name);
            }
        }
    }
}

//! Stacks of equal triangles: hits are those of a loop over all triangles, and a ray tests few of them.

use canted_renderer::{
    CountedHitFilter, Cull, HitFilter, Levels, SceneBvh, SceneBvhConfig, Surfaces, UpdateOptions, View,
};
use canted_scene::{AlphaMode, Camera, Material, MaterialId, Mesh, Part, Scene};
use canted_trace::{Counts, Hit, Intersect, Kernel, Ray, ScaledRay, Watertight};

use crate::common::{camera, gray, mesh, place, prepared, rays_from_all_around, scene};

const N: usize = 3000;

/// Triangles around the origin, each [`N`] times: in the same order of corners, rotated, and the other way round. The last is there once.
fn stacks(material: u32) -> Mesh {
    let positions = vec![[-1.0, -1.0, 0.1], [1.2, -0.9, -0.1], [0.1, 1.1, 0.0], [-0.9, 0.2, 1.0], [0.3, 0.4, -1.5]];
    let of = |i: usize| [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 3, 4]][i % 4];
    let mut triangles: Vec<[u32; 3]> = (0..4 * N).map(of).collect();
    triangles.push([1, 3, 4]);
    mesh(positions, triangles, material)
}

/// The mesh with vertices of its own for each triangle: equal corners have different indices.
fn unindexed(Mesh { positions, triangles, parts, .. }: Mesh) -> Mesh {
    let positions: Vec<[f32; 3]> = triangles.iter().flatten().map(|&vertex| positions[vertex as usize]).collect();
    let triangles = (0..u32::try_from(triangles.len()).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh { positions, triangles, parts, ..Mesh::default() }
}

/// The first hit of a loop over all triangles of all instances, which are placed where they are.
fn loop_over_all(scene: &Scene, ray: &Ray) -> Option<(f32, usize, usize)> {
    let scaled = ScaledRay::new(ray)?;
    let prepared = Watertight::prepare(&scaled);
    let mut first: Option<(f32, usize, usize)> = None;
    for (i, instance) in scene.instances.iter().enumerate() {
        let Mesh { positions, triangles, .. } = &scene.meshes[instance.mesh.0 as usize];
        for (k, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| positions[vertex as usize]);
            let t_max = first.map_or(scaled.t_max, |(t, ..)| t);
            if let Some(hit) = Watertight::intersect(&prepared, &scaled, &Watertight::record(corners), t_max)
                && first.is_none_or(|(t, ..)| hit.t < t)
            {
                first = Some((hit.t, i, k));
            }
        }
    }
    first.map(|(t, i, k)| (scaled.caller_t(t), i, k))
}

fn found(hit: &Hit) -> (f32, usize, usize) {
    (hit.t, hit.instance.0 as usize, hit.primitive.index())
}

#[test]
fn hits_are_those_of_a_loop_and_few_triangles_are_tested() {
    let materials = || vec![gray(0.5), gray(0.2)];
    for (name, scene) in [
        ("one mesh", scene(vec![stacks(0)], materials())),
        ("unindexed", scene(vec![unindexed(stacks(0))], materials())),
        ("stacked meshes", scene(vec![stacks(0), unindexed(stacks(1)), stacks(0)], materials())),
    ] {
        let surfaces = Surfaces::new(&scene);
        for levels in [Levels::One, Levels::Two] {
            let bvh = prepared(&scene, levels);
            for (i, ray) in rays_from_all_around(200).enumerate() {
                let mut query = CountedHitFilter { filter: HitFilter::new(&surfaces), counts: Counts::default() };
                let hit = bvh.closest_hit_with(&ray, &mut query);
                assert_eq!(hit.as_ref().map(found), loop_over_all(&scene, &ray), "{name}, {levels:?}, ray {i}");
                assert!(query.counts.triangles <= 500, "{name}, {levels:?}, ray {i}: {:?}", query.counts);
            }
        }
    }
}

/// What the first of a stack lets pass meets the others: alpha, and faces that are culled.
#[test]
fn rays_that_pass_the_first_hit_the_next() {
    let up = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let invisible = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, alpha: 0.0, ..gray(0.5) };
    let single_sided = Material { double_sided: false, ..gray(0.5) };
    let view: Camera = camera([0.0, 0.0, -5.0], [0.0; 3], 40.0);
    let view = View::new(&view, 8, 8).unwrap();
    let from_behind = Ray::new([0.1, -0.2, -5.0], [0.0, 0.0, 1.0]);
    for (name, passed) in [("alpha", invisible), ("culled", single_sided)] {
        let mut stack = mesh(up.clone(), vec![[0, 1, 2]; N], 0);
        stack.parts.push(Part { first_triangle: 7, material: MaterialId(1) });
        let scene = scene(vec![stack], vec![passed, gray(0.5)]);
        let surfaces = Surfaces::new(&scene);
        for levels in [Levels::One, Levels::Two] {
            let mut query = HitFilter::new(&surfaces).culling(Cull::Auto, &view);
            let hit = prepared(&scene, levels).closest_hit_with(&from_behind, &mut query).expect("a hit");
            assert_eq!(found(&hit), (5.0, 0, 7), "{name}, {levels:?}");
        }
    }
}

/// A mirroring instance has its fronts on the other side.
#[test]
fn mirrored_copies_are_no_copies() {
    let symmetric = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    let sides = mesh(symmetric, [[3, 1, 2], [0, 3, 2]].repeat(N), 0);
    let mut mirrored = canted_obb::Affine::IDENTITY;
    mirrored.columns[0][0] = -1.0;
    let other = mesh(sides.positions.iter().map(|&[x, y, z]| [-x, y, z]).collect(), sides.triangles.clone(), 0);
    let mut scene = scene(vec![sides, other], vec![Material { double_sided: false, ..gray(0.5) }]);
    // In world space both are the same.
    scene.instances[1] =
        canted_scene::Instance { first_primitive: scene.instances[1].first_primitive, ..place(1, mirrored) };
    let surfaces = Surfaces::new(&scene);
    let view = View::new(&camera([0.0, 0.0, -5.0], [0.0; 3], 40.0), 8, 8).unwrap();
    for levels in [Levels::One, Levels::Two] {
        let mut query = HitFilter::new(&surfaces).culling(Cull::Auto, &view);
        let ray = Ray::new([0.1, -0.2, -5.0], [0.0, 0.0, 1.0]);
        let hit = prepared(&scene, levels).closest_hit_with(&ray, &mut query).expect("a hit");
        assert_eq!(found(&hit), (5.0, 1, 0), "{levels:?}");
    }
}

/// A stack whose triangles part, and one whose first becomes transparent.
#[test]
fn updates_follow_stacks() {
    for levels in [Levels::One, Levels::Two] {
        let config = SceneBvhConfig { levels, ..SceneBvhConfig::default() };
        let before = scene(vec![unindexed(stacks(0))], vec![gray(0.5)]);
        let mut parted = before.clone();
        for (i, position) in parted.meshes[0].positions.iter_mut().enumerate().skip(30) {
            position[2] += 0.01 * (i / 3 % 50) as f32;
        }
        let mut faded = parted.clone();
        faded.materials[0] = Material { alpha_mode: AlphaMode::Blend, alpha: 0.5, ..gray(0.5) };
        let mut bvh = SceneBvh::build(&before, &config).unwrap();
        for now in [&parted, &before, &faded] {
            let updates = bvh.update(now, &UpdateOptions::default()).unwrap();
            assert_eq!(updates.unchanged, 0, "{levels:?}");
            let fresh = SceneBvh::build(now, &config).unwrap();
            for ray in rays_from_all_around(100) {
                let want = loop_over_all(now, &ray);
                assert_eq!(bvh.closest_hit(&ray).as_ref().map(found), want, "{levels:?}");
                assert_eq!(fresh.closest_hit(&ray).as_ref().map(found), want, "{levels:?}");
            }
        }
    }
}

//! The built-in scene is valid, within its triangle budget, and fills the image.

use canted_obb::vector::{Vector as Vec3, cross, dot, length, sub};

use super::{
    build::{MeshBuilder, Paint, hills, noise, tilted, unit},
    builtin,
    landscape::ground,
};
use crate::{Light, Mesh, Scene};

/// Unit roundoff of `f32`.
const U: f64 = 0.5 * f32::EPSILON as f64;

fn corners(mesh: &Mesh, triangle: usize) -> [Vec3; 3] {
    mesh.triangles[triangle].map(|index| mesh.positions[index as usize].map(f64::from))
}

/// Checks that indices are in range, positions finite, and transforms invertible.
fn check(scene: &Scene) -> Result<(), String> {
    let require = |holds: bool, flaw: &dyn Fn() -> String| if holds { Ok(()) } else { Err(flaw()) };
    for mesh in &scene.meshes {
        let name = &mesh.name;
        require(mesh.positions.iter().flatten().all(|x| x.is_finite()), &|| {
            format!("{name}: a position is not finite")
        })?;
        let in_range = |&index: &u32| (index as usize) < mesh.positions.len();
        require(mesh.triangles.iter().flatten().all(in_range), &|| format!("{name}: an index is out of range"))?;
        let starts = mesh.parts.iter().map(|part| part.first_triangle as usize);
        require(starts.clone().next() == Some(0), &|| format!("{name}: the first part starts late"))?;
        let ends = starts.clone().skip(1).chain([mesh.triangles.len()]);
        require(starts.zip(ends).all(|(start, end)| start < end), &|| format!("{name}: an empty part"))?;
        let painted = mesh.parts.iter().all(|part| (part.material.0 as usize) < scene.materials.len());
        require(painted, &|| format!("{name}: no such material"))?;
    }
    let mut n_primitives = 0;
    for (i, instance) in scene.instances.iter().enumerate() {
        let map = &instance.world_from_object;
        let mesh = scene.meshes.get(instance.mesh.0 as usize).ok_or(format!("instance {i}: no such mesh"))?;
        // Without shear the determinant is the product of the axis lengths, up to rounding.
        let stretch: f64 = map.columns[..3].iter().map(|column| length(column.map(f64::from))).product();
        let invertible = map.is_finite() && stretch > 0.0 && map.determinant().abs() > 0.999 * stretch;
        require(invertible, &|| format!("instance {i}: cannot be inverted"))?;
        require(instance.first_primitive as usize == n_primitives, &|| format!("instance {i}: wrong numbering"))?;
        n_primitives += mesh.triangles.len();
    }
    Ok(())
}

/// Number of triangles with their centroid in a 16:9 image of the first camera.
fn n_in_view(scene: &Scene) -> usize {
    let camera = scene.cameras[0];
    let crate::Projection::Perspective { fov_degrees } = camera.projection else { panic!("{:?}", camera.projection) };
    let eye = camera.eye.map(f64::from);
    let forward = unit(sub(camera.target.map(f64::from), eye));
    let right = unit(cross(forward, camera.up.map(f64::from)));
    let up = cross(right, forward);
    let half_height = (0.5 * f64::from(fov_degrees)).to_radians().tan();
    let in_view = |centroid: Vec3| {
        let from_eye = sub(centroid, eye);
        let depth = dot(from_eye, forward);
        let [across, height] = [right, up].map(|axis| dot(from_eye, axis).abs() / depth);
        depth > 0.0 && height < half_height && across < half_height * 16.0 / 9.0
    };
    let of_instance = |instance: &crate::Instance| {
        let mesh = &scene.meshes[instance.mesh.0 as usize];
        let centroid = |triangle: usize| {
            let [a, b, c] = corners(mesh, triangle);
            let mean = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
            instance.world_from_object.point_f64(mean)
        };
        (0..mesh.triangles.len()).filter(|&triangle| in_view(centroid(triangle))).count()
    };
    scene.instances.iter().map(of_instance).sum()
}

#[test]
fn scene_is_valid() {
    let scene = builtin();
    assert_eq!(check(&scene), Ok(()));
    assert!(scene.materials.iter().flat_map(|material| material.base_color).all(|x| (0.0..=1.0).contains(&x)));
    let [Light::Sun { direction, .. }] = scene.lights[..] else { panic!("one sun: {:?}", scene.lights) };
    assert!((length(direction.map(f64::from)) - 1.0).abs() <= 2.0 * U && direction[1] < 0.0);
}

#[test]
fn check_detects_each_error() {
    let spoil = |damage: fn(&mut Scene)| {
        let mut scene = builtin();
        damage(&mut scene);
        check(&scene).expect_err("a flaw")
    };
    assert!(spoil(|scene| scene.meshes[3].positions[2][1] = f32::NAN).contains("not finite"));
    assert!(spoil(|scene| scene.meshes[3].triangles[5][0] = 1 << 20).contains("out of range"));
    assert!(spoil(|scene| scene.meshes[3].parts[0].first_triangle = 1).contains("starts late"));
    assert!(spoil(|scene| scene.meshes[0].parts[1].first_triangle = 0).contains("empty part"));
    assert!(spoil(|scene| scene.materials.truncate(5)).contains("no such material"));
    assert!(spoil(|scene| scene.meshes.truncate(5)).contains("no such mesh"));
    assert!(spoil(|scene| scene.instances[9].world_from_object.columns[1] = [0.0; 3]).contains("inverted"));
    assert!(spoil(|scene| scene.instances[9].first_primitive += 1).contains("numbering"));
}

#[test]
fn triangle_counts_are_within_budget() {
    let scene = builtin();
    assert!(scene.n_unique_triangles() <= 60_000, "{}", scene.n_unique_triangles());
    assert!(scene.n_placed_triangles() >= 300_000, "{}", scene.n_placed_triangles());
    assert!(n_in_view(&scene) >= 100_000, "{}", n_in_view(&scene));
    let [x, y, z] = scene.cameras[0].eye.map(f64::from);
    assert!(y > ground(x, z) + 2.0, "camera above ground");
}

#[test]
fn generation_is_deterministic() {
    let [first, second] = [builtin(), builtin()];
    assert_eq!(first.instances, second.instances);
    for (a, b) in first.meshes.iter().zip(&second.meshes) {
        assert_eq!((&a.positions, &a.triangles, &a.parts), (&b.positions, &b.triangles, &b.parts), "{}", a.name);
    }
}

#[test]
fn triangles_are_not_degenerate() {
    for mesh in &builtin().meshes {
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] = corners(mesh, triangle);
            assert!(length(cross(sub(b, a), sub(c, a))) > 0.0, "{} {triangle}", mesh.name);
        }
    }
}

#[test]
fn water_covers_the_visible_river() {
    let scene = builtin();
    let is_water = |i: usize| scene.meshes[i].name == "water";
    let tiles: Vec<[f32; 3]> = scene
        .instances
        .iter()
        .filter(|instance| is_water(instance.mesh.0 as usize))
        .map(|instance| instance.world_from_object.columns[3])
        .collect();
    let under_water = |x: f64, z: f64| {
        tiles.iter().any(|tile| {
            (0.0..=160.0).contains(&(x - f64::from(tile[0]))) && (0.0..=160.0).contains(&(f64::from(tile[2]) - z))
        })
    };
    for x in (-480..1700).step_by(10).map(f64::from) {
        for z in (-1900..480).step_by(10).map(f64::from) {
            assert!(ground(x, z) >= 0.0 || under_water(x, z), "dry at ({x}, {z})");
        }
    }
}

#[test]
fn normals_point_outward() {
    let mut block = MeshBuilder::default();
    block.block(Paint::Wood, [1.0, 2.0, 3.0], [2.0, 5.0, 7.0]);
    let mesh = block.finish("block");
    let cone = |i: usize| {
        let [a, b, c] = corners(&mesh, i);
        dot(a, cross(b, c)) / 6.0
    };
    assert_eq!((0..12).map(cone).sum::<f64>(), 12.0);

    for (axis, widths) in
        [([0.0, 3.0, 0.0], [2.0, 1.0]), ([0.0, -3.0, 0.0], [2.0, 0.0]), ([1.0, 2.0, -1.0], [1.0, 1.0])]
    {
        let mut frustum = MeshBuilder::default();
        frustum.frustum(Paint::Wood, [[0.0; 3], axis], widths, 5);
        let mesh = frustum.finish("frustum");
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = corners(&mesh, i);
            let normal = cross(sub(b, a), sub(c, a));
            // Relative to the axis, the centroid lies on the side of the normal.
            let centroid: Vec3 = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
            let foot = axis.map(|x| x * dot(centroid, axis) / dot(axis, axis));
            assert!(dot(normal, sub(centroid, foot)) > 0.0, "{axis:?} {i}");
        }
    }
}

#[test]
fn terrain_and_water_face_up() {
    for mesh in builtin().meshes.iter().filter(|mesh| ["terrain", "water"].contains(&mesh.name.as_str())) {
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] = corners(mesh, triangle);
            assert!(cross(sub(b, a), sub(c, a))[1] > 0.0, "{} {triangle}", mesh.name);
        }
    }
}

#[test]
fn parts_are_sorted_by_material() {
    let mut mesh = MeshBuilder::default();
    for paint in [Paint::Wood, Paint::Steel, Paint::Wood] {
        mesh.block(paint, [0.0; 3], [1.0; 3]);
    }
    let mesh = mesh.finish("three blocks");
    let parts: Vec<_> = mesh.parts.iter().map(|part| (part.first_triangle, part.material)).collect();
    assert_eq!(parts, [(0, Paint::Steel.material()), (12, Paint::Wood.material())]);
}

#[test]
fn tilted_keeps_axes_orthogonal() {
    let upward = [0.3, 2.0, -0.7];
    let map = tilted([1.0, 2.0, 3.0], upward, 0.8, [2.0, 3.0, 5.0]);
    let axes = [0, 1, 2].map(|k| map.columns[k].map(f64::from));
    // Each component is rounded once to f32; the longest axis has length 5.
    let error = 2.0 * 3.0_f64.sqrt() * U * 25.0;
    for (k, scale) in [2.0, 3.0, 5.0].into_iter().enumerate() {
        assert!((length(axes[k]) - scale).abs() < error && dot(axes[k], axes[(k + 1) % 3]).abs() < error);
    }
    assert!(length(cross(unit(axes[1]), unit(upward))) < error);
    assert!((map.determinant() - 30.0).abs() < 30.0 * error);
}

#[test]
fn noise_is_bounded_and_periodic() {
    for i in 0..2000 {
        let [x, y] = [0.37, 0.71].map(|step| step * f64::from(i) - 300.0);
        assert!(noise(x, y, 7, 1).abs() <= 1.0 && hills(x, y, 1).abs() <= 1.0);
        // Coordinates are below 2,000 with one rounding; the gradient of the noise is below 4.
        assert!((noise(x, y, 7, 1) - noise(x + 7.0, y - 14.0, 7, 1)).abs() < 8.0 * 2000.0 * f64::EPSILON);
    }
    let spread = (0..100).map(|i| noise(f64::from(i), 0.5, 1000, 1)).fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(spread > 0.5, "not constant");
}

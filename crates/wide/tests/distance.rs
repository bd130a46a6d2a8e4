//! Distance, containment and overlap queries against loops over all primitives and exact integer arithmetic.
//!
//! Not covered here: the tests of single triangles, which `canted-trace` compares with exact rationals.

use canted_fixtures::{self as fixtures, Mesh, SplitMix64};
use canted_obb::{Obb, PrimId};
use canted_trace::{Convex, Overlaps, Sphere, closest_point_on_triangle};
use canted_wide::{Config, Costs, NearestPoint, Preset, SimdPath, TriangleBvh, WideBvh};

fn corners(mesh: &Mesh, triangle: usize) -> [[f32; 3]; 3] {
    mesh.triangles[triangle].map(|vertex| mesh.positions[vertex as usize])
}

fn build(mesh: &Mesh, preset: Preset) -> TriangleBvh {
    TriangleBvh::build_with(&mesh.positions, &mesh.triangles, preset).unwrap()
}

/// Meshes that are thin, flat, far, of mixed scale, and with duplicates.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let far = |mesh: Mesh| mesh.placed(|p| p.map(|x| x + 1e7));
    let tiny = |mesh: Mesh| mesh.placed(|p| p.map(|x| x * 1e-6));
    vec![
        ("soup", fixtures::soup(1, 300)),
        ("slivers", fixtures::slivers(2, 200)),
        ("scaffold", fixtures::scaffold_of(1, true, 3)),
        ("identical", fixtures::identical(40)),
        ("outlier", fixtures::outlier(60)),
        ("coplanar", fixtures::coplanar_quads(30)),
        ("far", far(fixtures::icosphere(2))),
        ("tiny", tiny(fixtures::torus(12, 8))),
        ("nothing", Mesh { positions: vec![], triangles: vec![] }),
    ]
}

/// Points around a mesh: near, far, on vertices, and with zeros of both signs.
fn points(mesh: &Mesh, seed: u64, n: usize) -> Vec<[f32; 3]> {
    let mut rng = SplitMix64::new(seed);
    let [min, max] = mesh.bounds();
    let size = mesh.diagonal().max(1e-3);
    let mut point = |i: usize| -> [f32; 3] {
        if i.is_multiple_of(5) && !mesh.positions.is_empty() {
            return mesh.positions[rng.below(mesh.positions.len())];
        }
        let distance = if i.is_multiple_of(7) { 1e3 * size } else { 0.6 * size };
        let offset = rng.signed3();
        std::array::from_fn(|k| (0.5 * (f64::from(min[k]) + f64::from(max[k])) + distance * offset[k]) as f32)
    };
    let mut points: Vec<[f32; 3]> =
        if mesh.positions.is_empty() { vec![[1.0; 3]] } else { (0..n).map(&mut point).collect() };
    points.extend([[0.0; 3], [-0.0; 3]]);
    points
}

/// All triangles by distance and number, as a loop finds them.
fn by_distance(mesh: &Mesh, point: [f32; 3]) -> Vec<(f64, u32)> {
    let distance = |i: u32| closest_point_on_triangle(point, &corners(mesh, i as usize)).distance_squared;
    let mut all: Vec<(f64, u32)> =
        (0..u32::try_from(mesh.triangles.len()).unwrap()).map(|i| (distance(i), i)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

fn rounded(all: &[(f64, u32)]) -> Vec<(f32, u32)> {
    all.iter().map(|&(squared, primitive)| (squared.sqrt() as f32, primitive)).collect()
}

fn named(nearest: &[NearestPoint]) -> Vec<(f32, u32)> {
    nearest.iter().map(|nearest| (nearest.distance, nearest.primitive.0)).collect()
}

#[test]
fn nearest_triangles_are_those_of_a_loop() {
    for (name, mesh) in meshes() {
        for preset in [Preset::Fast, Preset::Quality] {
            let bvh = build(&mesh, preset);
            let mut nearest = vec![];
            for point in points(&mesh, 7, 60) {
                let all = by_distance(&mesh, point);
                for k in [1, 2, 9, usize::MAX] {
                    bvh.nearest_points(point, k, f32::INFINITY, &mut nearest);
                    assert_eq!(named(&nearest), rounded(&all[..k.min(all.len())]), "{name}, {k} of {point:?}");
                }
                // A radius between two triangles, and one that ends on a triangle.
                if let Some(&(_, third)) = all.get(2) {
                    let radius = rounded(&all)[2].0;
                    let within =
                        all.iter().filter(|(squared, _)| *squared <= f64::from(radius) * f64::from(radius)).count();
                    bvh.nearest_points(point, usize::MAX, radius, &mut nearest);
                    assert_eq!(nearest.len(), within, "{name}, radius {radius} of {point:?}, third {third}");
                }
                assert_eq!(
                    bvh.nearest_point(point, f32::INFINITY).map(|nearest| nearest.primitive.0),
                    all.first().map(|t| t.1)
                );
            }
        }
    }
}

/// Leaves of at most two triangles give the same answers.
#[test]
fn nearest_answers_do_not_depend_on_the_leaves() {
    for (name, mesh) in meshes() {
        let usual = build(&mesh, Preset::Balanced);
        let balanced = Config::preset(Preset::Balanced);
        let config = Config { costs: Costs { max_leaf: 2, ..balanced.costs }, ..balanced };
        let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config).unwrap();
        let points = points(&mesh, 19, 100);
        let (mut nearest, mut others) = (vec![None; points.len()], vec![None; points.len()]);
        usual.nearest_point_many(&points, f32::INFINITY, &mut nearest);
        bvh.nearest_point_many(&points, f32::INFINITY, &mut others);
        assert_eq!(nearest, others, "{name}");
        let mut n_leaves = 0;
        bvh.each_box(|_, _, is_leaf| n_leaves += usize::from(is_leaf));
        assert!(2 * n_leaves >= mesh.triangles.len(), "{name}: {n_leaves} leaves");
    }
}

#[test]
fn nearest_answers_do_not_depend_on_the_simd_path() {
    let mesh = fixtures::scaffold_of(2, true, 3);
    let bvh = build(&mesh, Preset::Quality);
    let scalar = bvh.clone().with_path(SimdPath::Scalar);
    for point in points(&mesh, 3, 200) {
        assert_eq!(bvh.nearest_point(point, f32::INFINITY), scalar.nearest_point(point, f32::INFINITY));
        assert_eq!(bvh.contains(point), scalar.contains(point));
    }
}

#[test]
fn points_without_an_answer() {
    let bvh = build(&fixtures::icosphere(1), Preset::Fast);
    for point in [[f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0]] {
        assert_eq!(bvh.nearest_point(point, f32::INFINITY), None);
        assert!(!bvh.contains(point));
    }
    assert_eq!(bvh.nearest_point([0.0; 3], -1.0), None);
    assert_eq!(bvh.nearest_point([0.0; 3], f32::NAN), None);
    assert_eq!(bvh.nearest_point([0.0; 3], 0.1), None);
    let nothing = TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap();
    assert_eq!((nothing.contains([0.0; 3]), nothing.signed_distance([0.0; 3])), (false, f32::INFINITY));
    for bvh in [bvh, nothing] {
        let winding = bvh.winding_numbers();
        for point in [[f32::NAN, 0.0, 0.0], [0.0, f32::NEG_INFINITY, f32::NAN]] {
            assert!(bvh.signed_distance(point).is_nan() && winding.signed_distance(&bvh, point).is_nan());
        }
        let infinite = [0.0, f32::NEG_INFINITY, 0.0];
        assert_eq!([bvh.signed_distance(infinite), winding.signed_distance(&bvh, infinite)], [f32::INFINITY; 2]);
    }
}

/// A closed mesh with integer coordinates, and whether a point with integer coordinates is inside, on the surface included.
struct Integers {
    mesh: Mesh,
    triangles: Vec<[[i128; 3]; 3]>,
}

impl Integers {
    fn new(mesh: &Mesh, scale: f32, offset: f32) -> Self {
        let mesh = mesh.placed(|p| p.map(|x| (scale * x).round() + offset));
        let corners = (0..mesh.triangles.len()).map(|i| corners(&mesh, i).map(|p| p.map(|x| x as i128)));
        Self { triangles: corners.collect(), mesh }
    }

    fn contains(&self, point: [i128; 3], rng: &mut SplitMix64) -> bool {
        if self.triangles.iter().any(|triangle| is_on(point, triangle)) {
            return true;
        }
        // A direction along which no edge is hit exactly.
        loop {
            let direction: [i128; 3] = std::array::from_fn(|_| i128::try_from(rng.below(2001)).unwrap() - 1000);
            if let Some(n) =
                self.triangles.iter().map(|triangle| crosses(point, direction, triangle)).sum::<Option<u32>>()
            {
                return n % 2 == 1;
            }
        }
    }
}

fn sub(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn det(a: [i128; 3], b: [i128; 3], c: [i128; 3]) -> i128 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// Crossings of a ray with a triangle: 0 or 1, `None` where it hits the border exactly.
fn crosses(origin: [i128; 3], direction: [i128; 3], triangle: &[[i128; 3]; 3]) -> Option<u32> {
    let [a, b, c] = triangle.map(|vertex| sub(vertex, origin));
    let sides = [det(direction, a, b), det(direction, b, c), det(direction, c, a)].map(i128::signum);
    if sides.contains(&1) && sides.contains(&-1) {
        return Some(0);
    }
    if sides.contains(&0) {
        return None;
    }
    Some(u32::from(det(a, b, c).signum() == sides[0]))
}

/// Whether a point is on a triangle.
fn is_on(point: [i128; 3], triangle: &[[i128; 3]; 3]) -> bool {
    let [a, b, c] = triangle.map(|vertex| sub(vertex, point));
    let cross =
        |a: [i128; 3], b: [i128; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [i128; 3], b: [i128; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let normal = cross(sub(b, a), sub(c, a));
    let inside = |a, b| dot(cross(a, b), normal) >= 0;
    normal != [0; 3] && det(a, b, c) == 0 && inside(a, b) && inside(b, c) && inside(c, a)
}

/// Points inside, outside, on vertices, edges and faces, and straight below and above vertices and edges.
#[test]
fn containment_is_exact() {
    let shapes = [
        ("sphere", fixtures::icosphere(2)),
        ("displaced sphere", fixtures::displaced_icosphere(3, 2)),
        ("torus", fixtures::torus(12, 8)),
        ("thin box", fixtures::thin_box(0.3)),
        ("sphere in a sphere", fixtures::icosphere(2).joined(&fixtures::icosphere(1).placed(|p| p.map(|x| 0.5 * x)))),
    ];
    for (name, mesh) in shapes {
        for (scale, offset) in [(6.0, 0.0), (1000.0, 0.0), (50.0, 16_000_000.0)] {
            let integers = Integers::new(&mesh, scale, offset);
            let bvh = build(&integers.mesh, Preset::Balanced);
            let mut rng = SplitMix64::new(5);
            let [min, max] = integers.mesh.bounds();
            let mut counts = [0; 2];
            for i in 0..400 {
                let vertex = integers.mesh.positions[rng.below(integers.mesh.positions.len())];
                let point: [f32; 3] = std::array::from_fn(|k| {
                    let anywhere = (min[k] + (max[k] - min[k]) * (1.4 * rng.unit() - 0.2) as f32).round();
                    match i % 4 {
                        0 => vertex[k],
                        // Straight below or above a vertex.
                        1 if k < 2 => vertex[k],
                        _ => anywhere,
                    }
                });
                let want = integers.contains(point.map(|x| x as i128), &mut rng);
                assert_eq!(bvh.contains(point), want, "{name} times {scale} at {offset}: {point:?}");
                counts[usize::from(want)] += 1;
            }
            assert!(counts[0] > 20 && counts[1] > 20, "{name}: {counts:?}");
            let points: Vec<[f32; 3]> = integers.mesh.positions.clone();
            let (mut serial, mut parallel) = (vec![false; points.len()], vec![false; points.len()]);
            bvh.contains_many(&points, &mut serial);
            bvh.par_contains_many(&points, &mut parallel);
            assert!(serial.iter().all(|&inside| inside) && serial == parallel, "{name}: vertices are on the surface");
        }
    }
}

#[test]
fn a_wrong_parity_would_be_noticed() {
    // Without one triangle the points below it change sides.
    let integers = Integers::new(&fixtures::icosphere(2), 1000.0, 0.0);
    let mut open = integers.mesh.clone();
    open.triangles.pop();
    let bvh = build(&open, Preset::Fast);
    let mut rng = SplitMix64::new(1);
    let wrong = (0..2000).filter(|_| {
        let point: [i16; 3] = std::array::from_fn(|_| i16::try_from(rng.below(1401)).unwrap() - 700);
        bvh.contains(point.map(f32::from)) != integers.contains(point.map(i128::from), &mut rng)
    });
    assert!(wrong.count() > 0);
}

#[test]
fn signed_distances_of_a_sphere() {
    let bvh = build(&fixtures::icosphere(4), Preset::Balanced);
    for (point, distance) in
        [([0.0; 3], -1.0), ([0.5, 0.0, 0.0], -0.5), ([0.0, 3.0, 0.0], 2.0), ([0.0, 0.0, -1.5], 0.5)]
    {
        assert!((bvh.signed_distance(point) - distance).abs() < 0.005, "{point:?}: {}", bvh.signed_distance(point));
    }
    assert_eq!(bvh.signed_distance(fixtures::icosphere(4).positions[7]), -0.0);
}

/// The distance is zero exactly where the point is on the surface, for faces of any orientation.
#[test]
fn signed_distances_are_zero_on_the_surface() {
    let mut rng = SplitMix64::new(6);
    let (mut n_on, mut n_near) = (0, 0);
    for scale in [1.0, 2_f32.powi(-66), 2_f32.powi(35)] {
        // Sums of such coordinates are exact, so midpoints of edges and points of faces are on the surface.
        let mesh = fixtures::displaced_icosphere(2, 2).placed(|p| p.map(|x| (x * 1024.0).round() * 8.0 * scale));
        let bvh = build(&mesh, Preset::Balanced);
        let winding = bvh.winding_numbers();
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = corners(&mesh, i);
            let weights = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.25, 0.75, 0.0], [0.25, 0.25, 0.5]][rng.below(4)];
            let on: [f32; 3] = std::array::from_fn(|k| (weights[0] * a[k] + weights[1] * b[k]) + weights[2] * c[k]);
            let near = [on[0], on[1].next_up(), on[2]];
            for point in [on, near] {
                let is_on = by_exact_sides(&mesh, point);
                n_on += usize::from(is_on);
                n_near += usize::from(!is_on);
                for distance in [bvh.signed_distance(point), winding.signed_distance(&bvh, point)] {
                    assert!(!is_on || distance == 0.0, "{point:?}: {distance:e}");
                }
                // A sum of angles does not tell on which side of the surface a point is that all but touches it.
                if is_on || bvh.signed_distance(point).abs() > 1e-9 * 8192.0 * scale {
                    assert_eq!(winding.contains(point), bvh.contains(point), "{point:?}");
                }
            }
        }
    }
    assert!(n_on > 200 && n_near > 200, "{n_on}, {n_near}");
}

/// Whether a point is on a triangle: in its plane, and on no outer side of an edge, all exact.
fn by_exact_sides(mesh: &Mesh, point: [f32; 3]) -> bool {
    (0..mesh.triangles.len()).any(|i| {
        let triangle = corners(mesh, i);
        let greatest = triangle.iter().flatten().chain(&point).fold(0.0_f32, |most, x| most.max(x.abs()));
        // To integers: coordinates are multiples of the last bit of the greatest, or finer ones of points next to them.
        let unit = 2_f64.powi(25) / f64::from(greatest);
        let unit = 2_f64.powi(unit.log2().floor() as i32);
        let integer = |p: [f32; 3]| p.map(|x| (f64::from(x) * unit) as i128);
        let is_exact = |p: [f32; 3]| p.iter().all(|&x| (f64::from(x) * unit).fract() == 0.0);
        is_exact(point) && is_on(integer(point), &triangle.map(integer))
    })
}

fn ids(mesh: &Mesh, is_in: impl Fn(usize) -> bool) -> Vec<PrimId> {
    (0..mesh.triangles.len()).filter(|&i| is_in(i)).map(|i| PrimId(u32::try_from(i).unwrap())).collect()
}

#[test]
fn overlaps_are_those_of_a_loop() {
    let (mut found, mut n_found) = (vec![], 0);
    for (name, mesh) in meshes() {
        let bvh = build(&mesh, Preset::Quality);
        let points = points(&mesh, 11, 40);
        let size = 0.1 * mesh.diagonal() as f32;
        for (i, &point) in points.iter().enumerate() {
            let half = [size, if i % 3 == 0 { 0.0 } else { 0.3 * size }, 2.0 * size];
            let s = 0.5_f32.sqrt();
            let frame = if i % 2 == 0 { Obb::IDENTITY_FRAME } else { [[s, s, 0.0], [-s, s, 0.0], [0.0, 0.0, 1.0]] };
            let obb = Obb { center: point, frame, half_extents: half };
            let face = |reach: f32, z: f32| {
                [[-reach, -reach], [reach, -reach], [reach, reach], [-reach, reach]]
                    .map(|[x, y]| [point[0] + x, point[1] + y, point[2] + z])
            };
            let frustum = Convex::from_frustum(face(0.1 * size, 0.0), face(size, 5.0 * size));
            bvh.overlapping_obb(&obb, &mut found).unwrap();
            let region = Convex::from_obb(&obb);
            assert_eq!(found, ids(&mesh, |i| region.overlaps_triangle(&corners(&mesh, i))), "{name}, {obb:?}");
            n_found += found.len();
            bvh.overlapping(&frustum, &mut found);
            assert_eq!(bvh.first_overlapping(&frustum), found.first().copied());
            assert_eq!((bvh.overlaps(&frustum), bvh.count_overlapping(&frustum)), (!found.is_empty(), found.len()));
            assert_eq!(
                found,
                ids(&mesh, |i| frustum.overlaps_triangle(&corners(&mesh, i))),
                "{name}, frustum at {point:?}"
            );
            let (min, max) = (point.map(|x| x - size), point.map(|x| x + size));
            bvh.overlapping_aabb(min, max, &mut found).unwrap();
            let region = Convex::from_aabb(min, max);
            assert_eq!(
                found,
                ids(&mesh, |i| region.overlaps_triangle(&corners(&mesh, i))),
                "{name}, {min:?} to {max:?}"
            );
            bvh.overlapping_sphere(point, size, &mut found);
            let squared = f64::from(size) * f64::from(size);
            let within = |i| closest_point_on_triangle(point, &corners(&mesh, i)).distance_squared <= squared;
            assert_eq!(found, ids(&mesh, within), "{name}, radius {size} around {point:?}");
        }
    }
    assert!(n_found > 1000, "{n_found}");
}

/// Shapes of any kind have the same queries.
#[test]
fn nearest_spheres_are_those_of_a_loop() {
    let mut rng = SplitMix64::new(9);
    let spheres: Vec<Sphere> = (0..300)
        .map(|_| Sphere { center: rng.signed3().map(|x| 10.0 * x as f32), radius: 0.3 * rng.unit() as f32 })
        .collect();
    let bvh = WideBvh::over(spheres.clone()).unwrap();
    for _ in 0..300 {
        let point = rng.signed3().map(|x| 12.0 * x as f32);
        let distance = |sphere: &Sphere| {
            let offset: [f64; 3] = std::array::from_fn(|k| f64::from(point[k]) - f64::from(sphere.center[k]));
            (offset.iter().map(|x| x * x).sum::<f64>().sqrt() - f64::from(sphere.radius)).abs()
        };
        let best = spheres.iter().map(distance).fold(f64::INFINITY, f64::min);
        let nearest = bvh.nearest_point(point, f32::INFINITY).unwrap();
        assert!((distance(&spheres[nearest.primitive.index()]) - best).abs() < 1e-9);
        assert!((f64::from(nearest.distance) - best).abs() <= 1e-6 * best.max(1.0));
    }
}

/// Below 1e-19 squared distances are not normal in single precision, and lower bounds may be rounded upward.
#[test]
fn nearest_points_of_the_smallest_meshes() {
    let mesh = fixtures::soup(5, 200);
    for power in [-60, -66, -70, -73, -74, -76, -78, -90, -126] {
        let size = 2_f32.powi(power) / mesh.diagonal() as f32;
        let small = mesh.placed(|p| p.map(|x| x * size));
        for preset in [Preset::Fast, Preset::Quality] {
            let bvh = build(&small, preset);
            for point in points(&mesh, 3, 200).into_iter().map(|p| p.map(|x| x * size)) {
                let (squared, primitive) = by_distance(&small, point)[0];
                let nearest = bvh.nearest_point(point, f32::INFINITY).unwrap();
                assert_eq!((nearest.distance, nearest.primitive.0), (squared.sqrt() as f32, primitive), "2^{power}");
            }
        }
    }
}

/// Zeros of both signs are equal, also where each triangle has vertices of its own.
#[test]
fn negative_zeros_change_no_side() {
    let octahedron = fixtures::icosphere(0).placed(|p| p.map(|x| (2.0 * x).round()));
    let mut rng = SplitMix64::new(4);
    let mut n_inside = 0;
    for _ in 0..20 {
        let mut loose = Mesh { positions: vec![], triangles: vec![] };
        for i in 0..octahedron.triangles.len() {
            let first = u32::try_from(loose.positions.len()).unwrap();
            let signed = |x: f32, rng: &mut SplitMix64| if x == 0.0 && rng.below(2) == 0 { -0.0 } else { x + 0.0 };
            loose.positions.extend(corners(&octahedron, i).map(|p| p.map(|x| signed(x, &mut rng))));
            loose.triangles.push([first, first + 1, first + 2]);
        }
        let [bvh, plain] = [&loose, &octahedron].map(|mesh| build(mesh, Preset::Balanced));
        for i in 0..1000 {
            let point = [i % 10, i / 10 % 10, i / 100].map(|x| 0.5 * (x - 5) as f32);
            assert_eq!(bvh.contains(point), plain.contains(point), "{point:?}");
            n_inside += usize::from(plain.contains(point));
        }
    }
    assert!(n_inside > 100, "{n_inside}");
}

/// The sum of all solid angles, divided by 4π, and a bound of its error: 64 roundings of an angle's sine and cosine, which are relative to
/// the greatest, 4.
fn summed_winding(mesh: &Mesh, point: [f32; 3]) -> [f64; 2] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut sum = [0.0; 2];
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = corners(mesh, i).map(|v| {
            let v: [f64; 3] = std::array::from_fn(|k| f64::from(v[k]) - f64::from(point[k]));
            v.map(|x| x / dot(v, v).sqrt())
        });
        let volume = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        let rest = 1.0 + dot(a, b) + dot(b, c) + dot(c, a);
        sum[0] += 2.0 * volume.atan2(rest);
        sum[1] += 4.0 * 64.0 * f64::EPSILON / volume.hypot(rest);
    }
    sum.map(|x| x / (4.0 * std::f64::consts::PI))
}

#[test]
fn winding_numbers_are_those_of_a_loop_within_their_tolerance() {
    let mut open = fixtures::icosphere(4);
    open.triangles.truncate(3 * open.triangles.len() / 4);
    let all = meshes().into_iter().chain([("sphere", fixtures::icosphere(5)), ("open sphere", open)]);
    let (mut worst, mut n) = (0.0_f64, 0);
    for (name, mesh) in all {
        for preset in [Preset::Dynamic, Preset::Quality] {
            let winding = build(&mesh, preset).winding_numbers();
            for point in points(&mesh, 8, 60)
                .into_iter()
                .filter(|point| by_distance(&mesh, *point).first().is_some_and(|near| near.0 > 0.0))
            {
                let [summed, rounding] = summed_winding(&mesh, point);
                for tolerance in [0.1, 1e-3, 0.0] {
                    let error = (winding.number(point, tolerance) - summed).abs();
                    // Both round.
                    assert!(
                        error <= tolerance + 2.0 * rounding,
                        "{name}, {point:?}: {error:e} > {tolerance:e} + {rounding:e}, {summed}"
                    );
                    worst = worst.max(error);
                    n += 1;
                }
                if (summed.abs() - 0.5).abs() > 2.0 * rounding {
                    assert_eq!(winding.contains(point), summed.abs() > 0.5, "{name}, {point:?}: {summed}");
                }
            }
        }
    }
    // Clusters are used: nothing would differ if each triangle were summed.
    assert!(worst > 1e-6 && n > 1000, "{worst:e}, {n}");
}

#[test]
fn solids_that_overlap_are_inside_of_both() {
    let cube = |at: f32| fixtures::thin_box(1.0).placed(|p| p.map(|x| x + at));
    let one = cube(0.0);
    let [min, max] = one.bounds();
    let at = |f: f32| -> [f32; 3] { std::array::from_fn(|k| min[k] + f * (max[k] - min[k])) };
    let shift = 0.5 * (max[0] - min[0]);
    let two = build(&one.joined(&cube(shift)), Preset::Balanced).winding_numbers();
    let mut listed_twice = one.clone();
    listed_twice.triangles.extend_from_within(..);
    let twice = build(&listed_twice, Preset::Balanced);
    let mut inside_out = one.clone();
    inside_out.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
    let inside_out = build(&inside_out, Preset::Balanced).winding_numbers();
    for (f, n) in [(0.3, 1.0), (0.7, 2.0), (-0.2, 0.0)] {
        let number = two.number(at(f), 1e-9);
        assert!((number.abs() - n).abs() < 1e-9, "{f}: {number}");
        assert_eq!(two.contains(at(f)), n > 0.5);
        let is_in_first = (0.0..1.0).contains(&f);
        assert_eq!(twice.winding_numbers().contains(at(f)), is_in_first);
        assert_eq!(inside_out.contains(at(f)), is_in_first);
    }
    // Neighbors agree in all of them, but not where one triangle is turned.
    let mut turned = one.clone();
    turned.triangles[3].swap(1, 2);
    assert!(two.is_oriented() && twice.winding_numbers().is_oriented() && inside_out.is_oriented());
    assert!(!build(&turned, Preset::Balanced).winding_numbers().is_oriented());
    // On a face the number is 1/2, within the tolerance as elsewhere.
    let sphere = fixtures::icosphere(3);
    let [a, b, c] = corners(&fixtures::thin_box(1.0), 0);
    let on: [f32; 3] = std::array::from_fn(|k| 0.5 * a[k] + 0.25 * b[k] + 0.25 * c[k]);
    let both = build(&one.joined(&sphere.placed(|[x, y, z]| [x + 9.0, y, z])), Preset::Balanced).winding_numbers();
    assert!((both.number(on, 1e-9).abs() - 0.5).abs() < 1e-9, "{}", both.number(on, 1e-9));
    // The surface belongs to it: corners, edges and faces. Parity is wrong for doubled faces.
    assert!(one.positions.iter().all(|&corner| two.contains(corner)));
    assert!(two.contains([at(0.3)[0], at(0.4)[1], min[2]]) && !twice.contains(at(0.5)));
    assert!(two.number([f32::NAN, 0.0, 0.0], 0.1).is_nan() && !two.contains([f32::INFINITY, 0.0, 0.0]));
}

/// Pyramids, wedges, quads, segments and points as regions.
#[test]
fn regions_without_volume_have_the_overlaps_of_a_loop() {
    let mut rng = SplitMix64::new(12);
    let (mut found, mut n_found) = (vec![], 0);
    for (name, mesh) in meshes() {
        let bvh = build(&mesh, Preset::Quality);
        let size = 0.2 * mesh.diagonal() as f32;
        for (i, &point) in points(&mesh, 13, 60).iter().enumerate() {
            let mut vector = || rng.signed3().map(|x| size * x as f32);
            let (a, b, c) = (vector(), vector(), vector());
            let zero = [0.0; 3];
            let [a, b, c] = match i % 6 {
                0 => [a, b, c],
                1 => [a, b, zero],
                2 => [a, zero, zero],
                3 => [zero; 3],
                4 => [a, a, c],
                _ => [a, b, a],
            };
            let shrink = [1.0, 0.5, 0.0][i % 3];
            let at = |u: f32, v: f32, w: f32| -> [f32; 3] {
                std::array::from_fn(|k| point[k] + u * a[k] + v * b[k] + w * c[k])
            };
            let face = |s: f32, w: f32| [at(-s, -s, w), at(s, -s, w), at(s, s, w), at(-s, s, w)];
            for region in [
                Convex::from_frustum(face(shrink, 0.0), face(1.0, 1.0)),
                Convex::from_frustum(face(1.0, 1.0), face(shrink, 0.0)),
            ] {
                bvh.overlapping(&region, &mut found);
                assert_eq!(found, ids(&mesh, |i| region.overlaps_triangle(&corners(&mesh, i))), "{name}, {region:?}");
                n_found += found.len();
            }
        }
        let beyond = Convex::from_frustum([[0.0; 3]; 4], [[f32::INFINITY; 3]; 4]);
        bvh.overlapping(&beyond, &mut found);
        assert!(found.is_empty() && !beyond.overlaps_triangle(&[[0.0; 3]; 3]));
    }
    assert!(n_found > 500, "{n_found}");
}

/// Points of a grid take over the side of their neighbors, where a mesh is closed; so they do after a motion, and no longer where that opens the mesh.
#[test]
fn grids_of_signed_distances() {
    let bits = |distances: &[f32]| distances.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let check = |what: &str, bvh: &TriangleBvh, points: &[[f32; 3]]| {
        let (mut parity, mut winding) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        bvh.par_signed_distance_many(points, &mut parity);
        let singles: Vec<f32> = points.iter().map(|&point| bvh.signed_distance(point)).collect();
        assert_eq!(bits(&parity), bits(&singles), "{what}");
        let numbers = bvh.winding_numbers();
        numbers.par_signed_distance_many(bvh, points, &mut winding);
        for (&point, &distance) in points.iter().zip(&winding) {
            assert_eq!(distance.to_bits(), numbers.signed_distance(bvh, point).to_bits(), "{what} {point:?}");
            assert_eq!(distance < 0.0, distance != 0.0 && numbers.number(point, 0.0).abs() > 0.5, "{what} {point:?}");
        }
        winding
    };
    let mut turned = fixtures::torus(24, 12);
    (0..turned.triangles.len()).step_by(3).for_each(|i| turned.triangles[i].swap(1, 2));
    let nested = fixtures::icosphere(2).joined(&fixtures::icosphere(2).placed(|p| p.map(|x| 0.5 * x)));
    let far = fixtures::torus(24, 12).placed(|p| p.map(|x| x + 1e5));
    // Much larger than the grid, with points along the normals of a side through the origin: distances grow by the step itself, but for roundings of the size of the mesh.
    let wall = Mesh {
        positions: vec![
            [1068.0, 8814.0, -9348.0],
            [-2058.0, -3954.0, 4983.0],
            [16370.0, -8537.0, 352.0],
            [1e4, 2e4, 2e4],
        ],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let meshes =
        [("torus", fixtures::torus(24, 12)), ("turned", turned), ("nested", nested), ("far", far), ("wall", wall)];
    for (name, mesh) in meshes {
        let ([min, max], n) = if name == "wall" { ([[-10.0; 3], [10.0; 3]], 20) } else { (mesh.bounds(), 12) };
        let at = |i: usize, k: usize| min[k] + (max[k] - min[k]) * ((i as f32 + 0.5) * 1.4 / n as f32 - 0.2);
        let normals = (0..400)
            .flat_map(|i| [0.5_f32, 1.0, -0.25, -2.0].map(|x| [1.0, 2.0, 2.0].map(|n| n * x * (1.0 + i as f32))));
        let grid = (0..n * n * n).map(|i| [at(i / n / n, 0), at(i / n % n, 1), at(i % n, 2)]);
        let points: Vec<[f32; 3]> = grid.chain(normals).collect();
        let mut bvh = build(&mesh, Preset::Balanced);
        let closed = check(name, &bvh, &points);
        let opened = |i: u32| mesh.triangles[i as usize].map(|_| mesh.triangles[0][0]);
        let open: Vec<[u32; 3]> = (0..mesh.triangles.len() as u32)
            .map(|i| if i % 7 == 0 { opened(i) } else { mesh.triangles[i as usize] })
            .collect();
        bvh.refit(&mesh.positions, &open).unwrap();
        let open = check(&format!("open {name}"), &bvh, &points);
        assert!(matches!(name, "turned" | "wall") || bits(&open) != bits(&closed), "{name}");
        bvh.refit(&mesh.positions, &mesh.triangles).unwrap();
        assert_eq!(bits(&check(name, &bvh, &points)), bits(&closed), "{name}");
    }
}

/// Where distances are greater than `f32` holds, and where they are no normal numbers.
#[test]
fn signed_distances_at_the_ends_of_the_range() {
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let least = |x: [i32; 3]| x.map(|x| x as f32 * f32::from_bits(1));
    let small = [[-2, 1, 21], [26, 36, -20], [36, -38, -29], [-15, 30, -6]].map(least);
    let great =
        [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|p: [f32; 3]| p.map(|x| 2e38 + 1e38 * x));
    let points = [[[-18, -8, 2], [1, 3, 3]].map(least), [[-3e38; 3], [2.1e38; 3]]];
    for (positions, points) in [small, great].iter().zip(points) {
        let bvh = TriangleBvh::build(positions, &faces).unwrap();
        for points in [points, [points[1], points[0]]] {
            let mut signed = [0.0; 2];
            bvh.signed_distance_many(&points, &mut signed);
            let singles = points.map(|point| bvh.signed_distance(point));
            assert_eq!(signed.map(f32::to_bits), singles.map(f32::to_bits), "{points:?} {signed:?} {singles:?}");
        }
    }
}

/// Answers of slices are those of single points, to the bit: of rows of a grid, and of points anywhere, bad ones too.
#[test]
fn slices_of_points() {
    for (name, mesh) in meshes() {
        let bvh = build(&mesh, Preset::Balanced);
        let mut all = points(&mesh, 5, 300);
        let ([min, max], first) = (mesh.bounds(), all[0]);
        all.extend((0..300).map(|i| {
            std::array::from_fn(|k| if k == 0 { first[0] + (max[0] - min[0]) * i as f32 / 300.0 } else { first[k] })
        }));
        all.extend([[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], first]);
        for max_distance in [f32::INFINITY, 0.1 * mesh.diagonal() as f32, -1.0] {
            let (mut nearest, mut parallel) = (vec![None; all.len()], vec![None; all.len()]);
            bvh.nearest_point_many(&all, max_distance, &mut nearest);
            bvh.par_nearest_point_many(&all, max_distance, &mut parallel);
            let singles: Vec<_> = all.iter().map(|&point| bvh.nearest_point(point, max_distance)).collect();
            assert!(nearest == singles && parallel == singles, "{name}");
        }
        let bits = |distances: &[f32]| distances.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let (mut signed, mut parallel) = (vec![0.0; all.len()], vec![0.0; all.len()]);
        bvh.signed_distance_many(&all, &mut signed);
        bvh.par_signed_distance_many(&all, &mut parallel);
        let singles: Vec<f32> = all.iter().map(|&point| bvh.signed_distance(point)).collect();
        assert!(bits(&signed) == bits(&singles) && bits(&parallel) == bits(&singles), "{name}");
        let winding = bvh.winding_numbers();
        winding.signed_distance_many(&bvh, &all, &mut signed);
        winding.par_signed_distance_many(&bvh, &all, &mut parallel);
        let singles: Vec<f32> = all.iter().map(|&point| winding.signed_distance(&bvh, point)).collect();
        assert!(bits(&signed) == bits(&singles) && bits(&parallel) == bits(&singles), "{name}");
    }
}

//! `canted cast`, judged by a linear scan over all triangles in `f64`; `canted tree`.

use std::collections::HashSet;

use crate::{
    gpu::adapter,
    support::{BUILDERS, Folder, Random, SMALL, rows},
};

const HEADER: &str = "t,prim,u,v,instance";

const N_RAYS: usize = 2000;

fn csv(rays: &[Judged]) -> String {
    let row = |([o, d], _): &Judged| format!("{},{},{},{},{},{},inf\n", o[0], o[1], o[2], d[0], d[1], d[2]);
    "ox,oy,oz,dx,dy,dz,tmax\n".to_owned() + &rays.iter().map(row).collect::<String>()
}

/// Triangles that often occlude each other, and rays of which between a quarter and three quarters hit.
fn model_and_rays(by: By) -> (Model, Vec<Judged>) {
    let model = model(60);
    let rays = judged_rays(&model, N_RAYS, by);
    let n_hits = rays.iter().filter(|(_, answer)| answer.is_some()).count();
    assert!((N_RAYS / 4..N_RAYS * 3 / 4).contains(&n_hits), "{n_hits} of {N_RAYS} rays hit");
    (model, rays)
}

/// A folder with the model and the rays.
fn folder_and_rays(by: By) -> (Folder, Vec<Judged>) {
    let (model, rays) = model_and_rays(by);
    let folder = Folder::new();
    folder.write("model.obj", &model.obj);
    folder.write("rays.csv", csv(&rays));
    (folder, rays)
}

#[track_caller]
fn assert_answers(hits: &[Vec<f64>], rays: &[Judged], what: &str) {
    assert_eq!(hits.len(), rays.len(), "{what}");
    for (hit, (ray, answer)) in hits.iter().zip(rays) {
        let Some((prim, crossing)) = answer else {
            assert_eq!((hit[1], hit[4]), (-1.0, -1.0), "{what}: {ray:?}");
            continue;
        };
        assert_eq!(hit[1], f64::from(u32::try_from(*prim).unwrap()), "{what}: {ray:?}");
        for (got, (want, bound)) in [hit[0], hit[2], hit[3]].iter().zip(crossing.tuv.iter().zip(crossing.bounds)) {
            assert!((got - want).abs() <= bound, "{what}: {ray:?}: {got} is not {want} within {bound}");
        }
    }
}

#[test]
fn hits_match_a_linear_scan() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv --triangles {triangles}")).done();
        assert_answers(&rows(&folder.text("hits.csv"), HEADER), &rays, triangles);
    }
}

#[test]
fn json_reports_the_number_of_hits() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    let n_hits = rays.iter().filter(|(_, answer)| answer.is_some()).count();
    for options in ["", "--occluded"] {
        let facts =
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv --json {options}")).done().json();
        assert_eq!((&facts["rays"], &facts["hits"]), (&N_RAYS.into(), &n_hits.into()), "{options}: {facts}");
        assert!(facts.get("gpu_exact_rays").is_none());
        assert!(facts["trace_seconds"].as_f64().unwrap() > 0.0 && facts["rays_per_second"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn every_preset_and_builder_matches_a_linear_scan() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    for preset in ["dynamic", "fast", "balanced", "quality"] {
        for builder in BUILDERS {
            let options = format!("--preset {preset} --builder {builder}");
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options}")).done();
            assert_answers(&rows(&folder.text("hits.csv"), HEADER), &rays, &options);
        }
    }
}

#[test]
fn a_gpu_matches_a_linear_scan() {
    let Some(_) = adapter("a_gpu_matches_a_linear_scan") else { return };
    let (folder, rays) = folder_and_rays(By::Device);
    // The device builds the BVHs of `lbvh` and `ploc`.
    for (levels, builder) in [("one", "auto"), ("two", "auto"), ("one", "lbvh"), ("two", "ploc")] {
        let options = format!("--levels {levels} --builder {builder} --device gpu");
        let cast = |more: &str| -> Vec<Vec<f64>> {
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options} {more}")).done();
            rows(&folder.text("hits.csv"), HEADER)
        };
        assert_answers(&cast(""), &rays, &options);
        for (hit, (ray, answer)) in cast("--occluded").iter().zip(&rays) {
            let expected = if answer.is_some() { [0.0; 5] } else { [f64::INFINITY, -1.0, 0.0, 0.0, -1.0] };
            assert_eq!(hit[..], expected, "{options}: {ray:?}");
        }
        // `f32` decides almost all rays.
        let facts =
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options} --json")).done().json();
        let (n_exact, n_rays) = (facts["gpu_exact_rays"].as_u64().unwrap(), facts["rays"].as_u64().unwrap());
        assert!(100 * n_exact <= n_rays, "{options}: {facts}");
    }
}

#[test]
fn the_oracle_detects_two_swapped_primitives() {
    let (mut model, rays) = model_and_rays(By::Cpu);
    let hit = rays.iter().find_map(|(_, answer)| answer.as_ref()).unwrap().0;
    let other = (hit + 1) % model.triangles.len();
    model.triangles.swap(hit, other);
    let swapped = judged_rays(&model, N_RAYS, By::Cpu);
    let prim = |(_, answer): &Judged| answer.as_ref().map(|(prim, _)| *prim);
    assert_ne!(rays.iter().map(prim).collect::<Vec<_>>(), swapped.iter().map(prim).collect::<Vec<_>>());
}

#[test]
fn hits_are_the_same_for_all_structures() {
    let (folder, _) = folder_and_rays(By::Cpu);
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        let mut first: Option<String> = None;
        for levels in ["auto", "one", "two"] {
            for (builder, volumes) in [
                ("lbvh", "auto"),
                ("lbvh", "aabb"),
                ("lbvh", "pca-unbounded"),
                ("lbvh", "pca-bounded"),
                ("lbvh", "quaternion"),
                ("lbvh", "combined"),
                ("lbvh", "dop"),
                #[cfg(feature = "baseline")]
                ("obvhs", "auto"),
                #[cfg(feature = "baseline")]
                ("obvhs", "dop"),
                ("auto", "auto"),
                ("auto", "dop"),
                ("sah", "auto"),
                ("sah", "aabb"),
                ("sbvh", "auto"),
                ("sbvh", "aabb"),
                ("sbvh", "combined"),
                ("hlbvh", "auto"),
                ("hlbvh", "aabb"),
                ("midpoint", "auto"),
                ("midpoint", "combined"),
                ("median", "auto"),
                ("median", "aabb"),
                ("auto --preset fast", "auto"),
                ("auto --preset quality", "auto"),
                ("auto --preset dynamic", "auto"),
                ("auto --accel bvh2", "auto"),
                ("auto --accel bih", "auto"),
                ("auto --accel kdtree", "auto"),
            ] {
                let options =
                    format!("--triangles {triangles} --levels {levels} --builder {builder} --volumes {volumes}");
                folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options}")).done();
                let hits = folder.text("hits.csv");
                assert_eq!(first.get_or_insert_with(|| hits.clone()), &hits, "{options}");
            }
        }
    }
}

#[test]
fn binary_files_contain_the_same_numbers_as_text_files() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    let numbers = rays.iter().flat_map(|(ray, _)| {
        ray.iter().flatten().map(|&x| f32::from(i16::try_from(x).unwrap())).chain([f32::INFINITY])
    });
    folder.write("rays.bin", numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    for rays in ["rays.csv", "rays.bin"] {
        folder.run(&format!("cast model.obj --rays {rays} --hits hits.csv")).done();
        folder.run(&format!("cast model.obj --rays {rays} --hits hits.bin")).done();
        let text: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
        let bytes = folder.bytes("hits.bin");
        assert_eq!(bytes.len(), 16 * text.len());
        for (row, chunk) in text.iter().zip(bytes.chunks_exact(16)) {
            let word = |k: usize| <[u8; 4]>::try_from(&chunk[4 * k..4 * k + 4]).unwrap();
            let float = |k: usize| f32::from_le_bytes(word(k));
            assert_eq!([row[0], row[2], row[3]], [float(0), float(2), float(3)]);
            assert_eq!(row[1].to_string(), i32::from_le_bytes(word(1)).to_string());
        }
    }
}

#[test]
fn the_interval_is_closed_and_t_is_in_units_of_the_direction() {
    let folder = Folder::with_small();
    // From z = 5, the roof at z = 1 occludes the floor at z = 0.
    let row = |dz: f32, t_max: f32| format!("0.25,0.25,5,0,0,{dz},{t_max}\n");
    let below = f32::from_bits(4.0f32.to_bits() - 1);
    let rays =
        [(-1.0, 9.0), (-2.0, 9.0), (-0.5, 9.0), (-1.0, 4.0), (-1.0, below), (-2.0, 2.0), (1.0, 9.0), (-1.0, -1.0)];
    folder.write("rays.csv", rays.map(|(dz, t_max)| row(dz, t_max)).concat());
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        folder.run(&format!("cast small.obj --rays rays.csv --hits hits.csv --triangles {triangles}")).done();
        let hits: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
        assert_eq!(hits.iter().map(|hit| hit[1]).collect::<Vec<_>>(), [2.0, 2.0, 2.0, 2.0, -1.0, 2.0, -1.0, -1.0]);
        assert_eq!([0, 1, 2, 3, 5].map(|i: usize| hits[i][0]), [4.0, 2.0, 8.0, 4.0, 2.0], "{triangles}");
        folder.run(&format!("cast small.obj --rays rays.csv --hits any.csv --occluded --triangles {triangles}")).done();
        let any: Vec<Vec<f32>> = rows(&folder.text("any.csv"), HEADER);
        let is_hit = |hits: &[Vec<f32>]| hits.iter().map(|hit| hit[1] >= 0.0).collect::<Vec<_>>();
        assert_eq!(is_hit(&any), is_hit(&hits), "{triangles}");
    }
}

#[test]
fn degenerate_faces_are_numbered_too() {
    let folder = Folder::new();
    folder.write(
        "flat.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 1 2\nf 1 2 3\nf 4 5 4\nf 4 5 6\n",
    );
    folder.write("rays.csv", "0.25,0.25,5,0,0,-1,9\n0.25,0.25,-5,0,0,1,9\n");
    folder.run("cast flat.obj --rays rays.csv --hits hits.csv").done();
    let hits: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
    assert_eq!(hits.iter().map(|hit| hit[1]).collect::<Vec<_>>(), [3.0, 1.0]);
}

#[test]
fn invalid_rays_are_rejected_with_their_line() {
    let folder = Folder::with_small();
    for (rays, words) in [
        ("0,0,1,0,0,-1,9\n0,0,1,0,0,-1\n", ["line 2", "found 6"]),
        ("0,0,1,0,0,down,9\n", ["line 1", "down"]),
        ("0,0,nan,0,0,-1,9\n", ["line 1", "finite"]),
        ("0,0,1,0,0,-1,nan\n", ["line 1", "tmax"]),
    ] {
        folder.write("rays.csv", rays);
        folder.run("cast small.obj --rays rays.csv --hits hits.csv").refused(&[&["rays.csv"], &words[..]].concat());
    }
    folder.write("rays.bin", [0; 27]);
    folder.run("cast small.obj --rays rays.bin --hits hits.csv").refused(&["rays.bin", "27 bytes"]);
    folder.write("rays.csv", "");
    folder.run("cast small.obj --rays rays.csv --hits hits.csv").done();
    assert_eq!(folder.text("hits.csv"), format!("{HEADER}\n"));
}

// A linear scan over all triangles in `f64`, with bounds for the rounding errors of the program.

/// Relative error of `n` roundings (Higham 2002, §3.1), in units of `f32`.
fn gamma(n: f64) -> f64 {
    let u = f64::from(f32::EPSILON) / 2.0;
    n * u / (1.0 - n * u)
}

/// Whose rounding errors are bounded.
#[derive(Clone, Copy)]
enum By {
    /// The CPU: differences, shear, two products, sums and the division, for each term of a determinant.
    Cpu,
    /// The GPU: hits are off their triangles by at most 64 rounding errors, each twice that of the CPU, of the largest
    /// coordinates of origin and triangle (`canted_gpu::HIT_ERROR`).
    Device,
}

impl By {
    /// Error of coordinates, for the largest distance between origin and triangle and the largest coordinates.
    fn error(self, distance: f64, size: f64) -> f64 {
        match self {
            Self::Cpu => gamma(16.0) * distance,
            Self::Device => gamma(128.0) * size,
        }
    }
}

/// Terms of all three edge functions: each is a difference of two products of sheared coordinates of two terms.
const TERMS: f64 = 24.0;

type Point = [i32; 3];

/// Triangles in file order, and the file.
struct Model {
    triangles: Vec<[Point; 3]>,
    obj: String,
}

/// Triangles and parallelograms in alternating objects and groups.
fn model(n_faces: usize) -> Model {
    let mut random = Random(11);
    let (mut triangles, mut obj, mut n_vertices) = (vec![], String::new(), 0);
    for face in 0..n_faces {
        match face % 12 {
            0 => obj.push_str(&format!("o object{}\n", face / 12)),
            4 => obj.push_str(&format!("g group{}\n", face % 5)),
            6 => obj.push_str("s off\n"),
            _ => {}
        }
        let [a, b, d] = [random.point(8), random.point(8), random.point(8)];
        let sum = |k: usize| b[k] + d[k] - a[k];
        let c = [sum(0), sum(1), sum(2)];
        let corners = if face % 3 == 0 { vec![a, b, c, d] } else { vec![a, b, d] };
        for [x, y, z] in &corners {
            obj.push_str(&format!("v {x} {y} {z}\n"));
        }
        let indices: Vec<String> = (1..=corners.len()).map(|i| (n_vertices + i).to_string()).collect();
        obj.push_str(&format!("f {}\n", indices.join(" ")));
        n_vertices += corners.len();
        // A convex polygon is a fan around its first corner.
        triangles.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
    }
    Model { triangles, obj }
}

fn sub(a: Point, b: Point) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(a[k] - b[k]))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The intersection of a line and the plane of a triangle: `[t, u, v]`, each with a bound of the program's error.
struct Crossing {
    tuv: [f64; 3],
    bounds: [f64; 3],
}

impl Crossing {
    /// By Cramer's rule; not finite where the line is parallel to the plane.
    fn of(origin: Point, direction: Point, [a, b, c]: [Point; 3], by: By) -> Self {
        let (e1, e2, s, d) = (sub(b, a), sub(c, a), sub(origin, a), direction.map(f64::from));
        let determinant = dot(cross(d, e2), e1);
        let tuv = [dot(cross(s, e1), e2), dot(cross(d, e2), s), dot(cross(s, e1), d)].map(|x| x / determinant);
        let largest = |v: [f64; 3]| v.into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let reach = [a, b, c].map(|p| largest(sub(p, origin))).into_iter().fold(0.0, f64::max);
        let speed = largest(d);
        let size = largest(origin.map(f64::from))
            + [a, b, c].map(|p| largest(p.map(f64::from))).into_iter().fold(0.0, f64::max);
        // The error of numerator and denominator, relative to the determinant.
        let term = TERMS * by.error(reach, size) * reach / determinant.abs();
        let unit = |x: f64| term * speed * (1.0 + x.abs());
        let bounds = [term * (reach + tuv[0].abs() * speed), unit(tuv[1]), unit(tuv[2])];
        Self { tuv, bounds }
    }

    /// Whether the ray hits; `None` if rounding may decide.
    fn is_hit(&self) -> Option<bool> {
        let ([t, u, v], [bt, bu, bv]) = (self.tuv, self.bounds);
        // Distances inside the limits, each with its error bound.
        let margins = [(t, bt), (u, bu), (v, bv), (1.0 - u - v, bu + bv)];
        if margins.iter().any(|(x, bound)| *x < -bound) {
            Some(false)
        } else if margins.iter().all(|(x, bound)| x > bound) {
            Some(true)
        } else {
            None
        }
    }
}

/// The closest triangle; `Err` if rounding may decide which it is.
fn closest(model: &Model, origin: Point, direction: Point, by: By) -> Result<Option<(usize, Crossing)>, TooClose> {
    let mut best: Option<(usize, Crossing)> = None;
    for (i, &triangle) in model.triangles.iter().enumerate() {
        let crossing = Crossing::of(origin, direction, triangle, by);
        if !crossing.is_hit().ok_or(TooClose)? {
            continue;
        }
        if let Some((_, other)) = &best {
            let gap = crossing.tuv[0] - other.tuv[0];
            if gap.abs() <= crossing.bounds[0] + other.bounds[0] {
                return Err(TooClose);
            }
            if gap > 0.0 {
                continue;
            }
        }
        best = Some((i, crossing));
    }
    Ok(best)
}

/// Rounding may decide the result.
struct TooClose;

/// A ray and the result of the oracle.
type Judged = ([Point; 2], Option<(usize, Crossing)>);

/// Rays whose result does not depend on rounding.
fn judged_rays(model: &Model, n: usize, by: By) -> Vec<Judged> {
    let mut random = Random(12);
    let mut rays = vec![];
    while rays.len() < n {
        let origin = random.point(16);
        let aim = random.point(24);
        let direction = std::array::from_fn(|k| aim[k] - origin[k]);
        if let Ok(answer) = closest(model, origin, direction, by) {
            rays.push(([origin, direction], answer));
        }
    }
    rays
}

// `canted tree` against codes and topology computed from their definitions.

/// The bits of the cell of a coordinate sum on one axis.
fn cell(sum: f32, three_m: f32, scale: f32, k: i32) -> u64 {
    let cell = f64::from((sum - three_m) * scale).floor();
    let last = 2f64.powi(k) - 1.0;
    // NaN is the product of 0 and infinity, and belongs to the first cell.
    let cell = if cell.is_nan() { 0.0 } else { cell.clamp(0.0, last) };
    (0..k).filter(|bit| (cell / 2f64.powi(*bit)).floor() % 2.0 == 1.0).map(|bit| 1 << bit).sum()
}

/// Morton codes in the order of the triangles.
fn codes(triangles: &[[[f32; 3]; 3]], k: i32) -> Vec<u64> {
    let corners = || triangles.iter().flatten();
    let least: [f32; 3] = std::array::from_fn(|axis| corners().map(|p| p[axis]).fold(f32::INFINITY, f32::min));
    let greatest: [f32; 3] = std::array::from_fn(|axis| corners().map(|p| p[axis]).fold(f32::NEG_INFINITY, f32::max));
    let extent = (0..3).map(|axis| greatest[axis] - least[axis]).fold(0.0, f32::max);
    let scale = 2f32.powi(k) / (3.0 * extent);
    let scale = if scale.is_finite() { scale } else { 0.0 };
    let code = |[a, b, c]: &[[f32; 3]; 3]| {
        let cells: [u64; 3] =
            std::array::from_fn(|axis| cell((a[axis] + b[axis]) + c[axis], 3.0 * least[axis], scale, k));
        // From the highest bit down, x before y before z.
        (0..k).rev().flat_map(|bit| cells.map(|cell| cell >> bit & 1)).fold(0, |code, bit| code << 1 | bit)
    };
    triangles.iter().map(code).collect()
}

/// Nodes `[left, right, first, last]`, by splitting ranges top-down at the highest differing bit.
fn nodes(codes: &[u64]) -> Vec<Vec<i64>> {
    let n = codes.len();
    let mut nodes = vec![vec![]; n.saturating_sub(1)];
    let mut open = if n > 1 { vec![(0, 0, n - 1)] } else { vec![] };
    let number = |i: usize| i64::try_from(i).unwrap();
    while let Some((node, first, last)) = open.pop() {
        // Equal codes are split by position.
        let key = |i: usize| u128::from(codes[i]) << 64 | i as u128;
        let highest = 127 - (key(first) ^ key(last)).leading_zeros();
        let split = (first..last).rfind(|&i| key(i) >> highest & 1 == 0).unwrap();
        let mut child = |first: usize, last: usize, inner: usize| {
            if first == last {
                return -number(first) - 1;
            }
            open.push((inner, first, last));
            number(inner)
        };
        nodes[node] = vec![child(first, split, split), child(split + 1, last, split + 1), number(first), number(last)];
    }
    nodes
}

fn obj(triangles: &[[[f32; 3]; 3]]) -> String {
    let vertex = |[x, y, z]: &[f32; 3]| format!("v {x} {y} {z}\n");
    let face = |i: usize| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3);
    let vertices: String = triangles.iter().flatten().map(vertex).collect();
    vertices + &(0..triangles.len()).map(face).collect::<String>()
}

#[track_caller]
fn assert_tree(name: &str, obj: &str, triangles: &[[[f32; 3]; 3]]) {
    let folder = Folder::new();
    folder.write("scene.obj", obj);
    for (bits, k) in [(30, 10), (63, 21)] {
        folder.run(&format!("tree scene.obj --bits {bits} --codes codes.csv --nodes nodes.csv")).done();
        let of_prim = codes(triangles, k);
        let mut want: Vec<(u64, usize)> = of_prim.iter().copied().zip(0..).collect();
        want.sort_unstable();
        let got: Vec<Vec<u64>> = rows(&folder.text("codes.csv"), "code,prim");
        let want_rows: Vec<Vec<u64>> = want.iter().map(|&(code, prim)| vec![code, prim as u64]).collect();
        assert_eq!(got, want_rows, "{name}, {bits} bits");
        let sorted: Vec<u64> = want.iter().map(|&(code, _)| code).collect();
        let got: Vec<Vec<i64>> = rows(&folder.text("nodes.csv"), "left,right,first,last");
        assert_eq!(got, nodes(&sorted), "{name}, {bits} bits");
    }
}

/// Triangles with corners `center + size * integers`, of which every tenth is a duplicate.
fn soup(n: usize, center: f32, size: f32) -> Vec<[[f32; 3]; 3]> {
    let mut random = Random(3);
    let mut triangles: Vec<[[f32; 3]; 3]> = vec![];
    while triangles.len() < n {
        let base = random.point(1000);
        let mut corner = || {
            let near = random.point(20);
            std::array::from_fn(|k| center + size * f32::from(i16::try_from(base[k] + near[k]).unwrap()))
        };
        let triangle =
            if triangles.len() % 10 == 9 { triangles[triangles.len() / 2] } else { [corner(), corner(), corner()] };
        let distinct: HashSet<[u32; 3]> = triangle.iter().map(|p| p.map(f32::to_bits)).collect();
        if distinct.len() == 3 {
            triangles.push(triangle);
        }
    }
    triangles
}

#[test]
fn random_triangles_of_all_sizes_and_positions() {
    for (name, center, size) in [
        ("as they are", 0.0, 1.0),
        ("tiny", 0.0, 1e-15),
        ("large", 0.0, 1e10),
        ("far away", 1e7, 8.0),
        ("inexact", 0.1, 0.3),
    ] {
        let triangles = soup(300, center, size);
        assert_tree(name, &obj(&triangles), &triangles);
    }
}

#[test]
fn one_two_and_equal_triangles() {
    let one = soup(1, 0.0, 1.0);
    assert_tree("one", &obj(&one), &one);
    let two = soup(2, 0.0, 1.0);
    assert_tree("two", &obj(&two), &two);
    let equal = vec![one[0]; 77];
    assert_tree("equal", &obj(&equal), &equal);
}

#[test]
fn prim_numbers_the_triangles_of_polygons_across_groups() {
    let triangles = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]],
    ];
    assert_tree("small", SMALL, &triangles);
}

#[test]
fn unused_vertices_do_not_change_the_codes() {
    let triangles = soup(50, 0.0, 1.0);
    assert_tree("unused vertex", &(obj(&triangles) + "v 1e6 -1e6 1e6\n"), &triangles);
}

#[test]
fn the_oracle_detects_changes() {
    let triangles = soup(100, 0.0, 1.0);
    let mut moved = triangles.clone();
    moved[42] = moved[42].map(|[x, y, z]| [x, y + 100.0, z]);
    assert_ne!(codes(&triangles, 21), codes(&moved, 21));
    let mut sorted = codes(&triangles, 21);
    sorted.sort_unstable();
    // Equal codes are split by position.
    assert_ne!(nodes(&sorted), nodes(&[0; 100]));
}

/// Three strands in `.hair`, thick at the root; a polyline in OBJ.
#[test]
fn lines_are_numbered_by_segment() {
    let folder = Folder::new();
    let mut hair = b"HAIR".to_vec();
    for number in [2_u32, 5, 1 | 2 | 4, 0, 1.0_f32.to_bits(), 0, 0, 0, 0] {
        hair.extend(number.to_le_bytes());
    }
    hair.resize(128, 0);
    hair.extend([2_u16, 1].iter().flat_map(|n| n.to_le_bytes()));
    let points: [[f32; 3]; 5] = [[0.0; 3], [4.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 9.0, 0.0], [4.0, 9.0, 0.0]];
    let thickness = [1.0_f32, 1.0, 1.0, 2.0, 2.0];
    hair.extend(points.as_flattened().iter().chain(&thickness).flat_map(|x| x.to_le_bytes()));
    folder.write("a.hair", hair);
    // Onto the middle of each segment; from inside the first one, along it; beside.
    let rays = "1,0,5,0,0,-1,inf\n6,0,5,0,0,-2,inf\n3,9,5,0,0,-1,inf\n1,0,0,1,0,0,inf\n1,2,5,0,0,-1,inf\n";
    folder.write("rays.csv", rays);
    for device in ["cpu", "auto"] {
        folder.run(&format!("cast a.hair --rays rays.csv --hits hits.csv --device {device}")).done();
        let hits: Vec<Vec<f64>> = rows(&folder.text("hits.csv"), HEADER);
        // From inside, the first segment is left through the ball at its end, at 4.5; the second one is entered at its ball, at 3.5.
        let want = [[4.5, 0.0, 0.25], [2.25, 1.0, 0.5], [4.0, 2.0, 0.75], [2.5, 1.0, 0.0], [f64::INFINITY, -1.0, 0.0]];
        for (hit, want) in hits.iter().zip(want) {
            assert_eq!([hit[0], hit[1], hit[2], hit[3]], [want[0], want[1], want[2], 0.0], "{hits:?}");
        }
    }
    folder.write("b.obj", "v 0 0 0\nv 4 0 0\nv 8 0 0\nl 1 2 3\n");
    folder.run("cast b.obj --line-radius 0.25 --rays rays.csv --hits hits.csv").done();
    let hits: Vec<Vec<f64>> = rows(&folder.text("hits.csv"), HEADER);
    assert_eq!(
        hits[..3].iter().map(|hit| [hit[0], hit[1]]).collect::<Vec<_>>(),
        [[4.75, 0.0], [2.375, 1.0], [f64::INFINITY, -1.0]]
    );
    // Balls of the atoms, then the bond.
    folder.write("c.xyz", "2\n\nC 1 0 0\nC 2.5 0 0\n");
    folder.write("d.csv", "1,0,5,0,0,-1,inf\n1.75,0,5,0,0,-1,inf\n");
    for (options, want) in [("", [4.62, 4.9]), ("--point-radius 0.5 --line-radius 0.25", [4.5, 4.75])] {
        folder.run(&format!("cast c.xyz {options} --rays d.csv --hits hits.csv")).done();
        let hits: Vec<Vec<f64>> = rows(&folder.text("hits.csv"), HEADER);
        assert_eq!([hits[0][1], hits[1][1]], [0.0, 2.0], "{hits:?}");
        assert!((0..2).all(|i| (hits[i][0] - want[i]).abs() < 1e-6), "{hits:?}");
    }
    folder
        .run("cast a.hair --rays rays.csv --hits hits.csv --accel kdtree")
        .refused(&["a.hair", "lines are traced through a wide BVH"]);
    folder.run("render a.hair -o a.png --size 8x6 --spp 1").done();
    folder
        .run("render a.hair -o a.png --accel kdtree")
        .refused(&["curves are traced through wide BVHs; use --accel wide"]);
    // Segments of curves are numbered after the triangles of assets.
    folder.write("t.obj", "v 50 0 0\nv 51 0 0\nv 50 1 0\nf 1 2 3\n");
    let tables = "[[assets]]\nname = \"t\"\nfile = \"t.obj\"\n[[curves]]\nradii = 0.5\npoints = [[0, 0, 0], [4, 0, 0], [8, 0, 0]]\n\
                  [[curves]]\nbasis = \"bezier\"\nradii = 1\npoints = [[0, 9, 0], [2, 9, 0], [4, 9, 0], [6, 9, 0]]\n\
                  [[patches]]\npoints = [[-12, -2, 1], [-12, 0, 1], [-12, 2, 1], [-12, 4, 1], [-10, -2, 1], [-10, 0, 1], [-10, 2, 1], [-10, 4, 1], \
                  [-8, -2, 1], [-8, 0, 1], [-8, 2, 1], [-8, 4, 1], [-6, -2, 1], [-6, 0, 1], [-6, 2, 1], [-6, 4, 1]]\n";
    folder.write("c.toml", tables);
    folder.write("rays.csv", format!("{rays}-9,-0.5,5,0,0,-1,inf\n"));
    folder.run("cast c.toml --rays rays.csv --hits hits.csv").done();
    let hits: Vec<Vec<f64>> = rows(&folder.text("hits.csv"), HEADER);
    let want = [[4.5, 1.0, 0.25, 0.0, 1.0], [2.25, 2.0, 0.5, 0.0, 1.0], [4.0, 3.0, 0.5, 0.0, 2.0]];
    assert_eq!(hits[..3], want.map(|row| row.to_vec()));
    // Patches are numbered after the curves, and have both parameters.
    assert_eq!(hits[5], [4.0, 4.0, 0.5, 0.25, 3.0]);
}

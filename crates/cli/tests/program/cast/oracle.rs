//! A linear scan over all triangles in `f64`, with bounds for the rounding errors of the program.

use crate::random::Random;

/// Relative error of `n` roundings (Higham 2002, §3.1), in units of `f32`.
fn gamma(n: f64) -> f64 {
    let u = f64::from(f32::EPSILON) / 2.0;
    n * u / (1.0 - n * u)
}

/// Whose rounding errors are bounded.
#[derive(Clone, Copy)]
pub(super) enum By {
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

pub(super) type Point = [i32; 3];

/// Triangles in file order, and the file.
pub(super) struct Model {
    pub(super) triangles: Vec<[Point; 3]>,
    pub(super) obj: String,
}

/// Triangles and parallelograms in alternating objects and groups.
pub(super) fn model(n_faces: usize) -> Model {
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
pub(super) struct Crossing {
    pub(super) tuv: [f64; 3],
    pub(super) bounds: [f64; 3],
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
pub(super) type Judged = ([Point; 2], Option<(usize, Crossing)>);

/// Rays whose result does not depend on rounding.
pub(super) fn judged_rays(model: &Model, n: usize, by: By) -> Vec<Judged> {
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

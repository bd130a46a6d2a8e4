//! Hits that are sure without the exact test.

use canted_fixtures::SplitMix64;
use canted_trace::Ray;

use super::*;
use crate::SimdPath;
use crate::simd::Task;

/// Sure lanes of a block of one triangle, and whether a test without error bound is sure.
struct Sure<'a> {
    ray: &'a ScaledRay,
    vertices: &'a [[f32; 3]; 3],
    t_max: f32,
}

impl Task for Sure<'_> {
    type Output = bool;

    #[inline(always)]
    fn on<S: Simd>(self, simd: S) -> bool {
        let mut rows = [[0.0; 8]; 10];
        for (row, x) in rows.iter_mut().zip(self.vertices.as_flattened()) {
            *row = [*x; 8];
        }
        let ray = RayTriangles::new(simd, self.ray);
        let found = Block::Eight(&rows).candidates::<S, true, true, false>(simd, &ray, self.t_max);
        assert_eq!(found.sure & !found.mask, 0);
        found.sure != 0
    }
}

#[test]
fn sure_hits_are_hits_however_near_the_end_of_the_ray() {
    let mut rng = SplitMix64::new(5);
    let mut unit = || (rng.next_u64() >> 40) as f32 / (1 << 23) as f32 - 1.0;
    let (mut n_sure, mut n_near, mut n_naive_wrong) = (0, 0, 0);
    for round in 0..60_000 {
        let far = [1.0, 100.0, 1e6][round % 3];
        let offset = [unit() * far, unit() * far, unit() * far];
        let mut point = |size: f32| [0, 1, 2].map(|k| offset[k] + size * unit());
        let size = [1.0, 1e-3, 30.0][round / 3 % 3];
        let (vertices, origin) = ([point(size), point(size), point(size)], point(3.0));
        let weights = [0.2, 0.3, 0.5];
        let target = [0, 1, 2].map(|k| (0..3).map(|i| weights[i] * vertices[i][k]).sum::<f32>());
        let direction = [0, 1, 2].map(|k| target[k] - origin[k]);
        let Some(mut ray) = ScaledRay::new(&Ray::new(origin, direction)) else { continue };
        let kernel = Watertight::prepare(&ray);
        let Some(hit) = Watertight::intersect(&kernel, &ray, &vertices, f32::INFINITY) else { continue };
        // The ray ends, or begins, a few roundings from the hit.
        let steps = i32::try_from(round % 9).expect("less than nine") - 4;
        let at = f32::from_bits(hit.t.to_bits().saturating_add_signed(steps));
        let (t_min, t_max) = if round % 2 == 0 { (0.0, at) } else { (at, f32::INFINITY) };
        for (t_min, t_max) in [(t_min, t_max), (0.0, f32::INFINITY)] {
            ray.t_min = t_min;
            let hits = Watertight::intersect(&kernel, &ray, &vertices, t_max).is_some();
            let [a, b, c] = vertices.map(|v| kernel.vertex(&ray, v));
            let edge = |p: [f32; 3], q: [f32; 3]| q[0] * p[1] - q[1] * p[0];
            let (u, v, w) = (edge(b, c), edge(c, a), edge(a, b));
            let d_z = ray.direction[kernel.axis().index()];
            let t = (u * a[2] + v * b[2] + w * c[2]) / ((u + v + w) * d_z);
            n_naive_wrong += usize::from((t_min < t && t < t_max) && !hits);
            for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                let sure = path.available().run(Sure { ray: &ray, vertices: &vertices, t_max });
                assert!(hits || !sure, "{ray:?} {vertices:?} {t_max} {}", path.name());
                n_sure += usize::from(sure);
                n_near += usize::from(sure && (t_min > 0.0 || t_max < f32::INFINITY));
            }
        }
    }
    assert!(n_sure > 10_000 && n_naive_wrong > 100, "{n_sure} sure, {n_naive_wrong} wrong without the bound");
    assert_eq!(n_near, 0, "a hit at the end of the ray cannot be sure");
}

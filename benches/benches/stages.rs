//! Each build stage alone, named `stage/scene/triangles`, and the shortest rays.

use canted_lbvh::{Bits, Domain, Strategy, VolumeConfig};
use canted_trace::Ray;
use canted_wide::{Config, Triangle, WideBvh};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn stages(criterion: &mut Criterion) {
    let mesh = canted_fixtures::grid(5, [300, 300]);
    let n = mesh.triangles.len();
    let name = |stage: &str| format!("{stage}/grid/{n}");
    let (corners, bounds) = canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles).expect("a valid mesh");
    let domain = Domain::new(&bounds, 3, Bits::B63);
    let codes = canted_lbvh::morton_codes(&domain, &corners);
    let sorted = canted_lbvh::sort_by_code(&codes, Bits::B63);
    let tree = canted_lbvh::radix(sorted.clone());
    let leaves = canted_lbvh::in_leaf_order(&corners, &tree.leaves);
    criterion.bench_function(&name("gather"), |b| {
        b.iter(|| canted_lbvh::triangle_corners(&mesh.positions, &mesh.triangles))
    });
    criterion.bench_function(&name("codes"), |b| b.iter(|| canted_lbvh::morton_codes(&domain, &corners)));
    criterion.bench_function(&name("sort"), |b| b.iter(|| canted_lbvh::sort_by_code(&codes, Bits::B63)));
    criterion.bench_function(&name("tree"), |b| b.iter(|| canted_lbvh::radix(sorted.clone())));
    criterion.bench_function(&name("leaf order"), |b| b.iter(|| canted_lbvh::in_leaf_order(&corners, &tree.leaves)));
    for strategy in Strategy::ALL {
        let config = VolumeConfig { strategy, fallback: true };
        criterion.bench_function(&name(&format!("volumes {strategy:?}")), |b| {
            b.iter(|| canted_lbvh::volumes(&tree, &leaves, &config));
        });
    }
}

/// Rays that hit the only triangle of a BVH, one by one and as a slice: what starts and ends a ray.
fn one_triangle(criterion: &mut Criterion) {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bvh = WideBvh::<Triangle>::build(&positions, &[[0, 1, 2]], &Config::default()).expect("a valid mesh");
    let origins = (0_u16..4096).map(|i| [f32::from(i % 64) / 130.0, f32::from(i / 64) / 130.0]);
    let rays: Vec<Ray> = origins.map(|[x, y]| Ray::new([x + 0.1, y - 0.05, 1.0], [-0.1, 0.05, -1.0])).collect();
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    bvh.closest_hits(&rays, &mut hits);
    assert!(hits.iter().all(Option::is_some), "every ray hits");
    let mut group = criterion.benchmark_group("one triangle");
    group.throughput(Throughput::Elements(4096));
    group.bench_function("closest_hit", |b| b.iter(|| rays.iter().filter_map(|ray| bvh.closest_hit(ray)).count()));
    group.bench_function("occluded", |b| b.iter(|| rays.iter().filter(|ray| bvh.occluded(ray)).count()));
    group.bench_function("closest_hits", |b| b.iter(|| bvh.closest_hits(&rays, &mut hits)));
    group.bench_function("occluded_many", |b| b.iter(|| bvh.occluded_many(&rays, &mut occluded)));
    group.finish();
}

criterion_group!(benches, stages, one_triangle);
criterion_main!(benches);

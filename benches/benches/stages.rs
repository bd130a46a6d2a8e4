//! Each build stage alone, named `stage/scene/triangles`.

use canted_lbvh::{Bits, Domain, Strategy, VolumeConfig};
use criterion::{Criterion, criterion_group, criterion_main};

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

criterion_group!(benches, stages);
criterion_main!(benches);

//! Shared meshes, and the CPU's results for them.

use canted_fixtures::{
    Hair, Mesh, SplitMix64, Strand, hair, icosphere, identical, outlier, scaffold_of, slivers, soup, thin_box,
};
use canted_gpu::{Gpu, build::Primitives};
use canted_lbvh::{self as lbvh, Bits, Corners, Domain, Sorted, Tree};
use canted_obb::{Aabb, Obb};
pub(crate) use canted_tests::device::gpu;

pub(crate) const BOTH: [Bits; 2] = [Bits::B30, Bits::B63];

/// The CPU's results for the items of one tree, stage by stage.
pub(crate) struct Twin<L = Corners> {
    pub(crate) primitives: Vec<L>,
    pub(crate) domain: Domain,
    pub(crate) codes: Vec<u64>,
    pub(crate) sorted: Sorted,
    pub(crate) tree: Tree,
}

impl Twin {
    pub(crate) fn of(mesh: &Mesh, bits: Bits) -> Self {
        let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let domain = Domain::new(&bounds, 3, bits);
        let codes = lbvh::morton_codes(&domain, &corners);
        Self::coded(corners, domain, codes)
    }
}

impl Twin<Obb> {
    pub(crate) fn of_boxes(boxes: &[Obb], bits: Bits) -> Self {
        let aabbs: Vec<Aabb> = boxes.iter().map(Obb::aabb).collect();
        let bounds = aabbs.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
        let domain = Domain::new(&bounds, 2, bits);
        let codes = lbvh::morton_codes_of_boxes(&domain, &aabbs);
        Self::coded(boxes.to_vec(), domain, codes)
    }
}

impl<L: Copy> Twin<L> {
    fn coded(primitives: Vec<L>, domain: Domain, codes: Vec<u64>) -> Self {
        let sorted = lbvh::sort_by_code(&codes, domain.bits);
        let tree = lbvh::radix(sorted.clone());
        Self { primitives, domain, codes, sorted, tree }
    }

    /// The items in leaf order.
    pub(crate) fn leaves(&self) -> Vec<L> {
        self.tree.leaves.iter().map(|leaf| self.primitives[leaf.index()]).collect()
    }
}

/// The CPU's results for each mesh.
pub(crate) fn twins(meshes: &[Mesh], bits: Bits) -> Vec<Twin> {
    meshes.iter().map(|mesh| Twin::of(mesh, bits)).collect()
}

/// The meshes on the device, one tree each.
pub(crate) fn primitives(gpu: &Gpu, twins: &[Twin]) -> Primitives {
    Primitives::triangles(gpu, twins.iter().map(|twin| &twin.primitives[..])).unwrap()
}

/// The two words of each code, of all meshes in sequence.
pub(crate) fn words<'a>(codes: impl Iterator<Item = &'a u64> + Clone) -> [Vec<u32>; 2] {
    [codes.clone().map(|&code| code as u32).collect(), codes.map(|&code| (code >> 32) as u32).collect()]
}

/// Small, empty, equal, flat and far meshes, as many of each as a scene might have.
pub(crate) fn meshes() -> Vec<Mesh> {
    let far = icosphere(2);
    let far = Mesh { positions: far.positions.iter().map(|p| p.map(|x| x * 50.0 + 1e7)).collect(), ..far };
    let mut meshes = vec![soup(1, 0), soup(2, 1), soup(3, 2), soup(4, 0), soup(5, 255), soup(6, 256), soup(7, 257)];
    meshes.extend([identical(100), thin_box(0.0), slivers(8, 200), outlier(300), far, point(), soup(9, 0)]);
    meshes
}

/// Triangles that are one point.
fn point() -> Mesh {
    Mesh { positions: vec![[0.1, -2.0, 3.0]], triangles: vec![[0; 3]; 20] }
}

/// A mesh that takes several slices and tiles.
pub(crate) fn large(seed: u64, n: u32) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let mut mesh = soup(seed, n);
    // Some triangles coincide.
    for _ in 0..mesh.triangles.len() / 10 {
        let [from, to] = [(); 2].map(|()| rng.below(mesh.triangles.len()));
        mesh.triangles[to] = mesh.triangles[from];
    }
    mesh
}

/// Long thin shapes in all directions, which suit oriented boxes.
pub(crate) fn needles() -> Vec<Mesh> {
    let tubes = Hair { n_strands: 40, n_segments: 8, width: 0.0006, strand: Strand::Tube };
    vec![hair(3, &tubes), scaffold_of(1, true, 3), slivers(9, 600)]
}

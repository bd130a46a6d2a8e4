//! The loop over all triangles, and rays that graze them.

use canted_fixtures::{Grazing, Mesh, grazing, soup};
use canted_kdtree::{KdTraversal, KdTree, KdTreeConfig};
use canted_obb::PrimId;
use canted_trace::{BaldwinWeber, Hit, InstanceId, Kernel, MollerTrumbore, Ray, ScaledRay, TriangleTest, Watertight};

/// A kernel, and its name in a configuration.
pub(crate) trait NamedKernel: Kernel {
    const TEST: TriangleTest;
}

impl NamedKernel for Watertight {
    const TEST: TriangleTest = TriangleTest::Watertight;
}

impl NamedKernel for MollerTrumbore {
    const TEST: TriangleTest = TriangleTest::MollerTrumbore;
}

impl NamedKernel for BaldwinWeber {
    const TEST: TriangleTest = TriangleTest::BaldwinWeber;
}

/// All triangles, tested one after the other.
pub(crate) struct Oracle<K: Kernel>(Vec<K::Record>);

impl<K: Kernel> Oracle<K> {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        Self(mesh.triangles.iter().map(|t| K::record(t.map(|v| mesh.positions[v as usize]))).collect())
    }

    /// Every hit: least `t` first, then lowest primitive.
    pub(crate) fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        let Some(ray) = ScaledRay::new(ray) else { return vec![] };
        let prepared = K::prepare(&ray);
        let mut hits: Vec<Hit> = (0..)
            .map(PrimId)
            .zip(&self.0)
            .filter_map(|(primitive, record)| {
                let hit = K::intersect(&prepared, &ray, record, ray.t_max)?;
                Some(Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance: InstanceId(0), side: hit.side })
            })
            .collect();
        hits.sort_by(|a, b| if a.before(b) { std::cmp::Ordering::Less } else { std::cmp::Ordering::Greater });
        hits.into_iter().map(|hit| Hit { t: ray.caller_t(hit.t), ..hit }).collect()
    }
}

/// Two soups in the same position, so that every hit is a tie.
pub(crate) fn doubled() -> Mesh {
    let Mesh { positions, triangles } = soup(5, 120);
    let triangles = [&triangles[..], &triangles].concat();
    Mesh { positions, triangles }
}

/// `n` rays of each class at the mesh, with several intervals.
pub(crate) fn rays(mesh: &Mesh, n: usize) -> Vec<Ray> {
    let at_edges = Grazing::ALL.into_iter().flat_map(|class| grazing(mesh, class, n, 9));
    at_edges
        .enumerate()
        .map(|(i, ray)| {
            let (t_min, t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY)][i % 3];
            Ray::new(ray.origin, ray.direction).between(t_min, t_max)
        })
        .collect()
}

/// A tree traced both ways.
pub(crate) fn both<K: NamedKernel>(mesh: &Mesh, config: &KdTreeConfig) -> [KdTree; 2] {
    let tree = KdTree::build(&mesh.positions, &mesh.triangles, &KdTreeConfig { test: K::TEST, ..*config }).unwrap();
    assert_eq!(tree.test(), K::TEST);
    [tree.clone().with_traversal(KdTraversal::Stack), tree.with_traversal(KdTraversal::Ropes)]
}

/// Small leaves, so that there are many planes.
pub(crate) fn deep() -> KdTreeConfig {
    KdTreeConfig { traversal_cost: 0.01, ..KdTreeConfig::default() }
}

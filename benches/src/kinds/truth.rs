//! The true answers: a loop over all triangles, and over all instances.
//!
//! Reads: a model, a ray. Writes: the closest hit.
//! Holds: no box is tested; rays enter object space as `canted-tlas` documents it.

use canted_fixtures::Mesh;
use canted_obb::Affine;
use canted_tests::brute;
use canted_trace::{Hit, Kernel, Ray, Watertight};

use crate::models::Model;

type Records = Vec<<Watertight as Kernel>::Record>;

/// The triangles of a model, for a loop.
pub(super) struct Truth {
    meshes: Vec<Records>,
    /// The mesh and the transform of each instance; empty for one mesh in world space.
    instances: Vec<(usize, Affine)>,
    n_triangles: usize,
}

impl Truth {
    pub(super) fn new(model: &Model) -> Self {
        let records = |mesh: &Mesh| brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
        let Some(placed) = &model.placed else {
            let meshes = vec![records(&model.mesh)];
            return Self { n_triangles: meshes[0].len(), meshes, instances: vec![] };
        };
        let meshes: Vec<Records> = placed.meshes.iter().map(records).collect();
        let instances: Vec<_> =
            placed.instances.iter().map(|instance| (instance.blas as usize, instance.world_from_object)).collect();
        Self { n_triangles: instances.iter().map(|&(mesh, _)| meshes[mesh].len()).sum(), meshes, instances }
    }

    /// Triangles that a loop tests.
    pub(super) fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The closest hit, ties to the lowest (instance, primitive).
    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        if self.instances.is_empty() {
            return brute::closest_hit::<Watertight>(&self.meshes[0], ray);
        }
        let transforms: Vec<Affine> = self.instances.iter().map(|&(_, transform)| transform).collect();
        let trace = |i: usize, ray: &Ray| brute::closest_hit::<Watertight>(&self.meshes[self.instances[i].0], ray);
        brute::closest_hit_of_instances(&transforms, ray, trace)
    }
}

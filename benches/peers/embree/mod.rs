//! Embree, versions 3 and 4: triangle meshes, round curves, instances, closest and any hit for single rays, trees of its builders.
//!
//! `builder`, `library`, `scene` and `curves` contain the unsafe code of the C interface.

mod builder;
mod curves;
mod library;
mod scene;

pub use builder::{Bounds, Part, Shape, Split, Subtree, Tree, build};
pub use curves::{CurveKind, Curves};
pub use library::{Library, LoadError, libraries};
pub use scene::{MovingInstances, MovingMesh, Scene, SceneError, Update};

/// A triangle mesh, object space.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// Vertices.
    pub positions: &'a [[f32; 3]],
    /// Vertex indices of each triangle.
    pub triangles: &'a [[u32; 3]],
}

/// A placed mesh.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Index of the mesh.
    pub mesh: usize,
    /// Columns of the affine transform, translation last.
    pub world_from_object: [[f32; 3]; 4],
}

/// Build quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Morton codes, in a dynamic scene: the fastest build.
    Low,
    /// A mesh of a dynamic scene that is refitted when its vertices move.
    Refit,
    /// Binned surface area heuristic: Embree's default.
    Medium,
    /// With spatial splits.
    High,
}

/// How a scene is built.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Quality of the build.
    pub quality: Quality,
    /// Watertight triangle test and conservative boxes.
    pub is_robust: bool,
    /// Number of build threads.
    pub n_threads: usize,
}

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
    /// Triangle of its mesh.
    pub primitive: u32,
    /// Placement; 0 for a scene that is one mesh.
    pub instance: u32,
}

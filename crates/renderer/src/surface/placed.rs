use std::hint::black_box;

use canted_scene::{Mesh, UvSet};
use canted_trace::Hit;

use crate::placement::Pose;
use crate::vector::{Vector, cross, sub, unit};

/// The three vertices of a hit triangle and the weights of the point between them.
pub(super) struct Corners<'a> {
    pub(super) mesh: &'a Mesh,
    indices: [u32; 3],
    weights: Vector,
}

impl<'a> Corners<'a> {
    pub(super) fn of(mesh: &'a Mesh, hit: &Hit) -> Self {
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        Self { mesh, indices: mesh.triangles[hit.primitive.index()], weights: [1.0 - u - v, u, v] }
    }

    /// Reads of the vertices what every surface is made from.
    pub(super) fn read(&self) {
        let mesh = self.mesh;
        black_box(self.indices.map(|i| mesh.positions[i as usize][0]));
        black_box(mesh.uvs.as_ref().map(|uvs| self.indices.map(|i| uvs[i as usize][0])));
        black_box(mesh.normals.as_ref().map(|normals| self.indices.map(|i| normals[i as usize][0])));
    }

    fn of_3<const N: usize>(&self, values: &[[f32; N]]) -> [[f64; N]; 3] {
        self.indices.map(|i| values[i as usize].map(f64::from))
    }

    /// What the vertices have, at the point.
    pub(super) fn blend<const N: usize>(&self, values: &[[f32; N]]) -> [f64; N] {
        self.between(self.of_3(values))
    }

    /// What lies between three values at the point.
    pub(super) fn between<const N: usize>(&self, [a, b, c]: [[f64; N]; 3]) -> [f64; N] {
        let [u, v, w] = self.weights;
        std::array::from_fn(|k| u * a[k] + v * b[k] + w * c[k])
    }

    /// Texture coordinates of the point.
    pub(super) fn uv(&self, set: UvSet) -> Option<[f64; 2]> {
        self.mesh.uv_set(set).map(|uvs| self.blend(uvs))
    }

    /// Texture coordinates of the three vertices.
    pub(super) fn uvs(&self, set: UvSet) -> Option<[[f64; 2]; 3]> {
        self.mesh.uv_set(set).map(|uvs| self.of_3(uvs))
    }

    /// Colour and alpha of the vertices at the point; white where there are none.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn color(&self) -> [f32; 4] {
        let colors = self.mesh.colors.as_ref();
        colors.map_or([1.0; 4], |colors| self.blend(colors).map(|x| x as f32))
    }
}

/// A hit triangle where its instance is.
pub(super) struct Placed<'a> {
    pub(super) corners: Corners<'a>,
    pub(super) pose: &'a Pose,
    pub(super) is_mirrored: bool,
    /// The point, object space.
    position_object: Vector,
    /// From the first vertex to the second and to the third, object space.
    edges_object: [Vector; 2],
    /// The cross product of the edges in world space: along it the triangle runs counter-clockwise.
    pub(super) winding: Vector,
}

impl<'a> Placed<'a> {
    pub(super) fn new(corners: Corners<'a>, pose: &'a Pose, is_mirrored: bool) -> Self {
        let vertices @ [v0, v1, v2] = corners.of_3(&corners.mesh.positions);
        let edges_object @ [a, b] = [sub(v1, v0), sub(v2, v0)];
        let winding = pose.normal_world(cross(a, b));
        Self { position_object: corners.between(vertices), corners, pose, is_mirrored, edges_object, winding }
    }

    /// The point, world space.
    pub(super) fn position(&self) -> Vector {
        self.pose.point_world(self.position_object)
    }

    /// Edges of the triangle from its first vertex, world space.
    pub(super) fn edges_world(&self) -> [Vector; 2] {
        self.edges_object.map(|edge| self.pose.vector_world(edge))
    }

    /// The unit normal that the vertices' say, on their side; `None` where they say none.
    pub(super) fn smooth_normal(&self) -> Option<Vector> {
        let normals = self.corners.mesh.normals.as_ref()?;
        unit(self.pose.normal_world(self.corners.blend(normals)))
    }
}

use std::hint::black_box;

use canted_scene::{Mesh, UvSet};
use canted_trace::{Hit, position_at};

use crate::placement::Pose;
use crate::vector::{Vector, cross, sub, unit, wide};

/// The vertices of a hit triangle, with the barycentric weights of the hit.
pub(super) struct HitTriangle<'a> {
    pub(super) mesh: &'a Mesh,
    indices: [u32; 3],
    weights: Vector,
    /// Shutter time of the ray.
    time: f32,
}

impl<'a> HitTriangle<'a> {
    pub(super) fn new(mesh: &'a Mesh, hit: &Hit, time: f32) -> Self {
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        Self { mesh, indices: mesh.triangles[hit.primitive.index()], weights: [1.0 - u - v, u, v], time }
    }

    /// The vertices as the ray hits them.
    fn vertices(&self) -> [Vector; 3] {
        let Mesh { positions, close, .. } = self.mesh;
        match close {
            None => self.gather(positions),
            Some(close) => self.indices.map(|i| {
                let i = i as usize;
                wide(position_at(&positions[i], &close.positions[i], self.time))
            }),
        }
    }

    /// Interpolates a vertex attribute between vertices, and between both ends of the shutter where it changes.
    pub(super) fn moving_attribute<const N: usize>(
        &self,
        open: &[[f32; N]],
        close: Option<&Vec<[f32; N]>>,
    ) -> [f64; N] {
        let at_open = self.attribute(open);
        let Some(close) = close else { return at_open };
        let (at_close, time) = (self.attribute(close), f64::from(self.time));
        std::array::from_fn(|k| (1.0 - time) * at_open[k] + time * at_close[k])
    }

    /// Reads the vertex attributes that every surface needs.
    pub(super) fn prefetch(&self) {
        let mesh = self.mesh;
        black_box(self.indices.map(|i| mesh.positions[i as usize][0]));
        black_box(mesh.uvs.as_ref().map(|uvs| self.indices.map(|i| uvs[i as usize][0])));
        black_box(mesh.normals.as_ref().map(|normals| self.indices.map(|i| normals[i as usize][0])));
    }

    fn gather<const N: usize>(&self, values: &[[f32; N]]) -> [[f64; N]; 3] {
        self.indices.map(|i| values[i as usize].map(f64::from))
    }

    /// Interpolates a vertex attribute.
    pub(super) fn attribute<const N: usize>(&self, values: &[[f32; N]]) -> [f64; N] {
        self.interpolate(self.gather(values))
    }

    /// Interpolates three values.
    pub(super) fn interpolate<const N: usize>(&self, [a, b, c]: [[f64; N]; 3]) -> [f64; N] {
        let [u, v, w] = self.weights;
        std::array::from_fn(|k| u * a[k] + v * b[k] + w * c[k])
    }

    /// Texture coordinates at the hit.
    pub(super) fn uv(&self, set: UvSet) -> Option<[f64; 2]> {
        self.mesh.uv_set(set).map(|uvs| self.attribute(uvs))
    }

    /// Texture coordinates of the three vertices.
    pub(super) fn uvs(&self, set: UvSet) -> Option<[[f64; 2]; 3]> {
        self.mesh.uv_set(set).map(|uvs| self.gather(uvs))
    }

    /// Vertex color and alpha at the hit; white without vertex colors.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
    pub(super) fn color(&self) -> [f32; 4] {
        let colors = self.mesh.colors.as_ref();
        colors.map_or([1.0; 4], |colors| self.attribute(colors).map(|x| x as f32))
    }
}

/// A hit triangle in its instance.
pub(super) struct PlacedTriangle<'a> {
    pub(super) triangle: HitTriangle<'a>,
    pub(super) pose: &'a Pose,
    pub(super) is_mirrored: bool,
    /// The hit point, object space.
    position_object: Vector,
    /// From the first vertex to the second and to the third, object space.
    edges_object: [Vector; 2],
    /// World-space normal on the side from which the triangle is counter-clockwise, any length.
    pub(super) winding: Vector,
}

impl<'a> PlacedTriangle<'a> {
    pub(super) fn new(triangle: HitTriangle<'a>, pose: &'a Pose, is_mirrored: bool) -> Self {
        let vertices @ [v0, v1, v2] = triangle.vertices();
        let edges_object @ [a, b] = [sub(v1, v0), sub(v2, v0)];
        let winding = pose.normal_world(cross(a, b));
        Self { position_object: triangle.interpolate(vertices), triangle, pose, is_mirrored, edges_object, winding }
    }

    /// The hit point, world space.
    pub(super) fn position(&self) -> Vector {
        self.pose.point_world(self.position_object)
    }

    /// Edges from the first vertex, world space.
    pub(super) fn edges_world(&self) -> [Vector; 2] {
        self.edges_object.map(|edge| self.pose.vector_world(edge))
    }

    /// The interpolated unit vertex normal; `None` without vertex normals.
    pub(super) fn smooth_normal(&self) -> Option<Vector> {
        let Mesh { normals, close, .. } = self.triangle.mesh;
        let close = close.as_ref().and_then(|close| close.normals.as_ref());
        unit(self.pose.normal_world(self.triangle.moving_attribute(normals.as_ref()?, close)))
    }
}

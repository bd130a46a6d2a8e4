use canted_scene::{Instance, Mesh, UvSet};
use canted_trace::Hit;

use crate::motion::Pose;
use crate::placement::Placement;
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

    fn of_3<const N: usize>(&self, values: &[[f32; N]]) -> [[f64; N]; 3] {
        self.indices.map(|i| values[i as usize].map(f64::from))
    }

    /// What the vertices have, at the point.
    pub(super) fn blend<const N: usize>(&self, values: &[[f32; N]]) -> [f64; N] {
        let values = self.of_3(values);
        std::array::from_fn(|k| (0..3).map(|i| self.weights[i] * values[i][k]).sum())
    }

    /// From the first vertex to the second and to the third, object space.
    fn edges(&self) -> [Vector; 2] {
        let [v0, v1, v2] = self.of_3(&self.mesh.positions);
        [sub(v1, v0), sub(v2, v0)]
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
    pub(super) instance: &'a Instance,
    pub(super) placement: &'a Placement,
    /// Of an instance that moves.
    pub(super) pose: Option<Pose>,
}

impl Placed<'_> {
    /// The point, world space.
    pub(super) fn position(&self) -> Vector {
        let position_object = self.corners.blend(&self.corners.mesh.positions);
        match &self.pose {
            None => self.instance.world_from_object.point_f64(position_object),
            Some(pose) => pose.point_world(position_object),
        }
    }

    /// World-space image of an object-space direction along the surface.
    pub(super) fn vector_world(&self, vector_object: Vector) -> Vector {
        match &self.pose {
            None => self.instance.world_from_object.vector_f64(vector_object),
            Some(pose) => pose.vector_world(vector_object),
        }
    }

    /// Edges of the triangle from its first vertex, world space.
    pub(super) fn edges_world(&self) -> [Vector; 2] {
        self.corners.edges().map(|edge| self.vector_world(edge))
    }

    /// The cross product of the edges in world space: along it the triangle runs counter-clockwise.
    pub(super) fn winding_world(&self) -> Vector {
        let [a, b] = self.corners.edges();
        self.placement.normal_world(self.pose.as_ref(), cross(a, b))
    }

    /// The unit normal that the vertices' say, on their side; `None` where they say none.
    pub(super) fn smooth_normal(&self) -> Option<Vector> {
        let normals = self.corners.mesh.normals.as_ref()?;
        unit(self.placement.normal_world(self.pose.as_ref(), self.corners.blend(normals)))
    }
}

use std::borrow::Cow;
use std::hint::black_box;

use canted_obb::Affine;
use canted_scene::{Mesh, TextureRef, UvSet};
use canted_tlas::Motion;
use canted_trace::{Hit, SurfacePoint, position_at, position_error};
use glam::DVec3;

use crate::texture::{Footprint, Plane, Textures};
use crate::{Cone, Lod, wide};

/// The vertices of a hit triangle, with the barycentric weights of the hit.
pub(super) struct HitTriangle<'a> {
    pub(super) mesh: &'a Mesh,
    indices: [u32; 3],
    weights: DVec3,
    /// Shutter time of the ray.
    time: f32,
}

impl<'a> HitTriangle<'a> {
    pub(super) fn new(mesh: &'a Mesh, hit: &Hit, time: f32) -> Self {
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        Self { mesh, indices: mesh.triangles[hit.primitive.index()], weights: DVec3::new(1.0 - u - v, u, v), time }
    }

    /// The vertices as the ray hits them.
    fn vertices(&self) -> [DVec3; 3] {
        let Mesh { positions, close, .. } = self.mesh;
        match close {
            None => self.gather(positions).map(DVec3::from),
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

    /// A vertex attribute at the three vertices, between both ends of the shutter where it changes.
    fn moving_corners<const N: usize>(&self, open: &[[f32; N]], close: Option<&Vec<[f32; N]>>) -> [[f64; N]; 3] {
        let at_open = self.gather(open);
        let Some(close) = close else { return at_open };
        let (at_close, time) = (self.gather(close), f64::from(self.time));
        std::array::from_fn(|i| std::array::from_fn(|k| (1.0 - time) * at_open[i][k] + time * at_close[i][k]))
    }

    /// Interpolates three values.
    pub(super) fn interpolate<const N: usize>(&self, [a, b, c]: [[f64; N]; 3]) -> [f64; N] {
        let DVec3 { x: u, y: v, z: w } = self.weights;
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
    position_object: DVec3,
    /// From the first vertex to the second and to the third, object space.
    edges_object: [DVec3; 2],
    /// World-space normal on the side from which the triangle is counter-clockwise, any length.
    pub(super) winding: DVec3,
}

impl<'a> PlacedTriangle<'a> {
    pub(super) fn new(triangle: HitTriangle<'a>, pose: &'a Pose, is_mirrored: bool) -> Self {
        let vertices @ [v0, v1, v2] = triangle.vertices();
        let edges_object @ [a, b] = [v1 - v0, v2 - v0];
        let winding = pose.normal_world(a.cross(b));
        Self {
            position_object: triangle.interpolate(vertices.map(DVec3::into)).into(),
            triangle,
            pose,
            is_mirrored,
            edges_object,
            winding,
        }
    }

    /// The hit point, world space.
    pub(super) fn position(&self) -> DVec3 {
        self.pose.point_world(self.position_object)
    }

    /// Edges from the first vertex, world space.
    pub(super) fn edges_world(&self) -> [DVec3; 2] {
        self.edges_object.map(|edge| self.pose.vector_world(edge))
    }

    /// The interpolated unit vertex normal; `None` without vertex normals.
    pub(super) fn smooth_normal(&self) -> Option<DVec3> {
        let Mesh { normals, close, .. } = self.triangle.mesh;
        let close = close.as_ref().and_then(|close| close.normals.as_ref());
        self.pose.normal_world(self.triangle.moving_attribute(normals.as_ref()?, close).into()).try_normalize()
    }
}

/// A point of the surface that vertex normals describe, over a point of its triangle. World space.
///
/// The triangles of a coarse mesh face away from light that still reaches the surface they stand for, and shade each other, so that their
/// edges are seen where light grazes. Where this surface bulges out of the triangle, its horizon counts instead of that of the triangle,
/// and rays between both start here. Source: Hanika 2021, *Hacking the Shadow Terminator* (Ray Tracing Gems II, chapter 4).
///
/// Departures from the source: rays above the horizon of the triangle start on it, as the bulge may reach into what touches the mesh; and
/// scattered rays start like shadow rays, so that both find the same light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothSurface {
    /// The point.
    pub position: [f64; 3],
    /// Unit normal, interpolated between the vertices, on the viewer's side.
    pub normal: [f64; 3],
}

/// How far the planes of the vertices must lie above a point in the mean, relative to their mean distance from it: more than rounding
/// in `f32` explains where they do not.
const MIN_BULGE: f64 = 1.0 / 1024.0;

impl PlacedTriangle<'_> {
    /// The smooth surface over the hit; `None` without vertex normals, where it lies in the triangle or behind, and where one of the
    /// normals faces away from the triangle or their mean from the viewer.
    ///
    /// `smooth` is the [interpolated normal](Self::smooth_normal), `normal` that of the triangle on the viewer's side. Each vertex has a plane perpendicular to its normal. The point is raised to the
    /// planes that lie above it, each by its barycentric weight. Planes of equal normals that are tilted against the triangle lie
    /// as far above the point as below, and in a hollow they lie below.
    pub(super) fn smooth_surface(
        &self,
        smooth: Option<DVec3>,
        normal: DVec3,
        towards_viewer: DVec3,
    ) -> Option<SmoothSurface> {
        let smooth = smooth?;
        let Mesh { normals, close, .. } = self.triangle.mesh;
        let close = close.as_ref().and_then(|close| close.normals.as_ref());
        let side = if smooth.dot(normal) < 0.0 { -1.0 } else { 1.0 };
        if side * smooth.dot(towards_viewer) <= 0.0 {
            return None;
        }
        let corners = self.triangle.moving_corners(normals.as_ref()?, close);
        let (position, vertices) = (self.position(), self.triangle.vertices().map(|v| self.pose.point_world(v)));
        let weights = self.triangle.weights.to_array();
        let mut raised = position;
        let (mut height, mut size) = (0.0, 0.0);
        for k in 0..3 {
            let of_vertex = side * self.pose.normal_world(corners[k].into()).try_normalize()?;
            if of_vertex.dot(normal) <= 0.0 {
                return None;
            }
            let above = weights[k] * (vertices[k] - position).dot(of_vertex);
            (height, size) = (height + above, size + above.abs());
            raised += above.max(0.0) * of_vertex;
        }
        (height > MIN_BULGE * size).then(|| SmoothSurface { position: raised.into(), normal: (side * smooth).into() })
    }
}

// An instance prepared for shading: its transform for points and normals, and the error bound of rays that leave it
// (derived at [`canted_trace::SurfacePoint`]).

/// `world_from_object` at one time, prepared for points and normals.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    pub(crate) columns: [DVec3; 4],
    /// Columns of the cofactor matrix, which maps object normals to world normals up to length and sign.
    pub(crate) cofactor: [DVec3; 3],
}

impl Pose {
    fn new(columns: [DVec3; 4]) -> Self {
        let [x, y, z, _] = columns;
        Self { columns, cofactor: [y.cross(z), z.cross(x), x.cross(y)] }
    }

    pub(crate) fn at_time(motion: &Motion, time: f32) -> Self {
        Self::new(motion.world_from_object(time).map(DVec3::from))
    }

    pub(crate) fn fixed(map: &Affine) -> Self {
        Self::new(map.columns.map(wide))
    }

    pub(crate) fn point_world(&self, point_object: DVec3) -> DVec3 {
        self.vector_world(point_object) + self.columns[3]
    }

    pub(crate) fn vector_world(&self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        let [a, b, c, _] = self.columns;
        a * x + b * y + c * z
    }

    /// World-space normal of the image of a plane with normal `normal_object`; any length, either side.
    ///
    /// Same direction as the inverse transpose, without a division.
    pub(crate) fn normal_world(&self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        let [a, b, c] = self.cofactor;
        a * x + (b * y + c * z)
    }
}

/// One instance, prepared for shading.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    /// Pose of a static instance, or of a moving one as the shutter opens.
    fixed: Pose,
    /// Error along each world axis between the plane of a triangle and a ray that leaves it.
    slack: f64,
    is_mirrored: bool,
    /// The motion of a moving instance.
    motion: Option<Box<Motion>>,
}

impl Placement {
    /// Prepares an instance of a mesh whose maximum absolute coordinate is `reach_object`.
    ///
    /// An instance that moves to `close` uses the larger reach of both ends: every coordinate is convex along a
    /// straight line, so no time in between exceeds it.
    pub(crate) fn new(world_from_object: &Affine, close: Option<&Affine>, reach_object: f32) -> Self {
        let reach_world =
            std::iter::once(world_from_object).chain(close).map(|map| map.reach(reach_object)).fold(0.0, f64::max);
        Self {
            fixed: Pose::fixed(world_from_object),
            // No intermediate transform is singular, so the sign is constant.
            is_mirrored: world_from_object.determinant() < 0.0,
            motion: close.map(|close| Box::new(Motion::new(world_from_object, close))),
            slack: position_error(reach_world),
        }
    }

    /// Whether the transform mirrors, which reverses the winding of triangles.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// The pose at a shutter time.
    pub(crate) fn pose(&self, time: f32) -> Cow<'_, Pose> {
        match &self.motion {
            None => Cow::Borrowed(&self.fixed),
            Some(motion) => Cow::Owned(Pose::at_time(motion, time)),
        }
    }

    /// Distance at which rays start from a surface with this unit normal, in world units.
    pub(crate) fn offset(&self, normal_world: DVec3) -> f64 {
        SurfacePoint::with_error([0.0; 3], normal_world.into(), self.slack).offset
    }
}

/// The context of texture lookups at a hit.
pub(super) struct TextureLookup<'a> {
    pub(super) textures: &'a Textures<'a>,
    pub(super) lod: Lod,
    pub(super) triangle: &'a HitTriangle<'a>,
    pub(super) plane: Plane,
    /// Direction of the ray, world space, any length.
    pub(super) direction: DVec3,
    /// Cone of the ray at the hit.
    pub(super) cone: Cone,
}

impl TextureLookup<'_> {
    /// The value of a texture; ones without a texture or without its UV set.
    pub(super) fn texel(&self, slot: Option<&TextureRef>) -> [f32; 4] {
        slot.and_then(|slot| self.sample(slot)).unwrap_or([1.0; 4])
    }

    /// The value of a texture; `None` if the mesh lacks its UV set.
    pub(super) fn sample(&self, slot: &TextureRef) -> Option<[f32; 4]> {
        let uvs = self.triangle.uvs(slot.uv_set)?;
        let uv = slot.texture_from_mesh.point(self.triangle.interpolate(uvs));
        let mip_map = self.textures.get(slot.texture);
        let footprint = if self.lod == Lod::None || self.cone.is_zero() {
            Footprint::POINT
        } else {
            Footprint::new(self.lod, &self.cone, self.direction, &self.plane, edges(slot, uvs), mip_map.size())
        };
        Some(mip_map.lookup(uv, &footprint))
    }

    /// Differences of texture coordinates along the edges of the triangle.
    pub(super) fn uv_edges(&self, slot: &TextureRef) -> Option<[[f64; 2]; 2]> {
        self.triangle.uvs(slot.uv_set).map(|uvs| edges(slot, uvs))
    }
}

/// Differences of texture coordinates from the first vertex to the second and to the third.
fn edges(slot: &TextureRef, uvs: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
    let [a, b, c] = uvs.map(|uv| slot.texture_from_mesh.point(uv));
    [b, c].map(|uv| std::array::from_fn(|k| uv[k] - a[k]))
}

use canted_obb::Aabb;
use canted_scene::{AlphaMode, Material, Mesh, Scene, TextureRef, UvSet};
use canted_trace::{Hit, InstanceId, Ray};

use crate::placement::Placement;
use crate::texture;
use crate::vector::{Vector, add, cross, dot, narrow, scale, sub, unit, wide};

/// A point of a surface, ready for shading. World space; colours linear RGB.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in the plane of its triangle but for a few roundings of `f64`.
    pub position: [f64; 3],
    /// Unit normal of the triangle, on the side that the incoming ray came from.
    pub normal: [f64; 3],
    /// Unit normal to shade with, on the same side of the triangle as `normal`.
    pub shading_normal: [f64; 3],
    /// Diffuse reflectance.
    pub albedo: [f32; 3],
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Distance that new rays keep off the triangle's plane, in world units.
    pub offset: f64,
}

impl Surface {
    /// A ray without end that leaves along `direction`, on the side of the triangle to which `direction` points.
    ///
    /// It starts [`Surface::offset`] off the plane, which is as much as rounding can ask for; no constant of length is
    /// involved.
    #[must_use]
    pub fn leave(&self, direction: [f32; 3]) -> Ray {
        Ray::new(self.origin_towards(wide(direction)), direction)
    }

    /// A ray that ends short of `target`: its direction spans the whole way, its `t_max` stays below 1.
    ///
    /// The gap is the distance that rays keep off this surface, so that a surface through the target does not count,
    /// and four roundings of the direction. `None` where the target is too close to tell apart.
    #[must_use]
    pub fn reach(&self, target: [f32; 3]) -> Option<Ray> {
        let origin = self.origin_towards(sub(wide(target), self.position));
        let way = sub(wide(target), wide(origin));
        let gap = self.offset / dot(way, way).sqrt() + 2.0 * f64::from(f32::EPSILON);
        // False for a way of no length, whose gap is infinite or not a number.
        (gap < 1.0).then(|| {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is within the gap")]
            let t_max = (1.0 - gap) as f32;
            Ray { t_max, ..Ray::new(origin, narrow(way)) }
        })
    }

    fn origin_towards(&self, direction: Vector) -> [f32; 3] {
        let side = self.offset.copysign(dot(self.normal, direction));
        narrow(add(self.position, scale(self.normal, side)))
    }

    /// Turns `direction` to the outer side of the triangle, where shading normal and triangle disagree about it.
    ///
    /// A direction that is above the shading normal's horizon and below the triangle's is mirrored in the triangle's
    /// plane: no ray enters the body, and no light is lost as it would be by dropping the sample.
    #[must_use]
    pub fn outward(&self, direction: [f32; 3]) -> [f32; 3] {
        let height = dot(self.normal, wide(direction));
        if height >= 0.0 { direction } else { narrow(sub(wide(direction), scale(self.normal, 2.0 * height))) }
    }
}

/// The surfaces of a scene: what is looked up for each hit, with what is computed once for each instance.
#[derive(Clone, Debug)]
pub struct Surfaces<'a> {
    scene: &'a Scene,
    placements: Vec<Placement>,
}

impl<'a> Surfaces<'a> {
    /// Prepares all instances of `scene`.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let reaches: Vec<f32> = scene.meshes.iter().map(reach).collect();
        let placements = scene
            .instances
            .iter()
            .map(|instance| {
                let close = instance.world_from_object_close.as_ref().filter(|c| **c != instance.world_from_object);
                Placement::new(&instance.world_from_object, close, reaches[instance.mesh.0 as usize])
            })
            .collect();
        Self { scene, placements }
    }

    /// The scene they belong to.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The surface at a hit of a world-space ray along `direction`, as the shutter opens.
    #[must_use]
    pub fn at(&self, hit: &Hit, direction: [f32; 3]) -> Surface {
        self.at_time(hit, direction, 0.0)
    }

    /// The surface at a hit of a world-space ray along `direction` that flew at `time`: 0 as the shutter opens, 1 as it
    /// closes.
    ///
    /// The point comes from the barycentric weights, not from `t`: it does not move along the ray with the rounding of
    /// a distance.
    #[must_use]
    pub fn at_time(&self, hit: &Hit, direction: [f32; 3], time: f32) -> Surface {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let placement = &self.placements[hit.instance.0 as usize];
        let corners = Corners::of(&self.scene.meshes[instance.mesh.0 as usize], hit);
        let [v0, v1, v2] = corners.of_3(&corners.mesh.positions);

        let pose = placement.pose(time);
        let position_object = corners.blend([v0, v1, v2]);
        let position = match &pose {
            None => instance.world_from_object.point_f64(position_object),
            Some(pose) => pose.point_world(position_object),
        };
        let towards_viewer = scale(wide(direction), -1.0);
        let normal_object = cross(sub(v1, v0), sub(v2, v0));
        // A triangle that was hit has an area; for a tracer that errs, facing the viewer is a harmless answer.
        let normal = unit(placement.normal_world(pose.as_ref(), normal_object))
            .map(|n| facing(n, towards_viewer))
            .or_else(|| unit(towards_viewer))
            .unwrap_or([0.0, 0.0, 1.0]);
        let shading_normal = corners
            .mesh
            .normals
            .as_ref()
            .and_then(|normals| unit(placement.normal_world(pose.as_ref(), corners.blend(corners.of_3(normals)))))
            .map_or(normal, |n| facing(n, normal));

        let material = self.material(corners.mesh, hit);
        let tint = self.texel(material.base_color_texture.as_ref(), &corners);
        Surface {
            position,
            normal,
            shading_normal,
            albedo: std::array::from_fn(|k| material.base_color[k] * tint[k]),
            emission: material.emission,
            offset: placement.offset(normal),
        }
    }

    /// Whether the surface is present at a hit: not cut out by its material's mask.
    #[must_use]
    pub fn is_present(&self, hit: &Hit) -> bool {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        let material = self.material(mesh, hit);
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => return true,
            AlphaMode::Mask { cutoff } => cutoff,
            AlphaMode::Blend => 0.5,
        };
        let [.., alpha] = self.texel(material.alpha_texture.as_ref(), &Corners::of(mesh, hit));
        material.alpha * alpha >= cutoff
    }

    /// The texel of a texture at a point of a mesh; white where there is none.
    fn texel(&self, texture: Option<&TextureRef>, corners: &Corners) -> [f32; 4] {
        let uv = texture.and_then(|texture| Some(texture.texture_from_mesh.point(corners.uv(texture.uv_set)?)));
        match (texture, uv) {
            (Some(texture), Some(uv)) => texture::lookup(&self.scene.textures[texture.texture.0 as usize], uv),
            _ => [1.0; 4],
        }
    }

    /// Distance that rays keep off a surface of an instance that stands still, by its unit normal; world units.
    pub(crate) fn offset(&self, instance: InstanceId, normal: Vector) -> f64 {
        self.placements[instance.0 as usize].offset(normal)
    }

    fn material(&self, mesh: &Mesh, hit: &Hit) -> &'a Material {
        &self.scene.materials[mesh.material_of(hit.primitive.0).0 as usize]
    }
}

/// Greatest absolute coordinate among the vertices that triangles use.
fn reach(mesh: &Mesh) -> f32 {
    Aabb::of_points(mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize])).reach()
}

/// `v` or its opposite, whichever is on the side of `towards`.
fn facing(v: Vector, towards: Vector) -> Vector {
    if dot(v, towards) < 0.0 { scale(v, -1.0) } else { v }
}

/// The three vertices of a hit triangle and the weights of the point between them.
struct Corners<'a> {
    mesh: &'a Mesh,
    indices: [u32; 3],
    weights: Vector,
}

impl<'a> Corners<'a> {
    fn of(mesh: &'a Mesh, hit: &Hit) -> Self {
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        Self { mesh, indices: mesh.triangles[hit.primitive.index()], weights: [1.0 - u - v, u, v] }
    }

    fn of_3<const N: usize>(&self, values: &[[f32; N]]) -> [[f64; N]; 3] {
        self.indices.map(|i| values[i as usize].map(f64::from))
    }

    fn blend<const N: usize>(&self, values: [[f64; N]; 3]) -> [f64; N] {
        std::array::from_fn(|k| (0..3).map(|i| self.weights[i] * values[i][k]).sum())
    }

    fn uv(&self, set: UvSet) -> Option<[f64; 2]> {
        self.mesh.uv_set(set).map(|uvs| self.blend(self.of_3(uvs)))
    }
}

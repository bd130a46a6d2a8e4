mod curve;
pub(crate) mod hit_filter;
mod hit_triangle;
mod shading_normal;

use std::hint::black_box;

use canted_obb::Aabb;
use canted_scene::{AlphaMode, Material, MaterialId, Mesh, Scene, TextureRef};
use canted_trace::{Hit, InstanceId, Ray, SurfacePoint};
use glam::DVec3;

use crate::sampler::{mix, net_single, unit};
use crate::texture::{MipMaps, Plane, Textures, filtered_textures};
use crate::{Bsdf, Cone, Hemisphere, Lod, narrow, wide};
pub use hit_filter::{CountedHitFilter, HitFilter};
#[cfg(feature = "gpu")]
pub(crate) use hit_triangle::Pose;
pub use hit_triangle::SmoothSurface;
use hit_triangle::{HitTriangle, PlacedTriangle, Placement, TextureLookup};
use shading_normal::{anisotropy, facing, lobes, shading_normal};

/// A surface point, ready for shading. World space; colors linear RGB.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in the plane of its triangle up to a few `f64` roundings.
    pub position: [f64; 3],
    /// Unit geometric normal, on the side of the incoming ray.
    pub normal: [f64; 3],
    /// Unit shading normal, interpolated and perturbed by a normal map. Always on the viewer's side; falls back to
    /// [`Self::normal`].
    pub shading_normal: [f64; 3],
    /// The surface that the vertex normals describe, where it bulges out of the triangle.
    pub smooth: Option<SmoothSurface>,
    /// Whether the ray came from the front: the side from which the triangle is counter-clockwise in object space.
    pub is_front: bool,
    /// The BSDF.
    pub bsdf: Bsdf,
    /// Direction of the longer highlights of an anisotropic surface, world space, of any length.
    pub along: Option<[f64; 3]>,
    /// Emitted radiance, the same on both sides.
    pub emission: [f32; 3],
    /// Distance from the triangle's plane at which new rays start, in world units; see [`SurfacePoint`].
    pub offset: f64,
    /// The ray cone of the incoming ray, at this point.
    pub cone: Cone,
    /// The time of the incoming ray, and of those that continue from here.
    pub time: f32,
}

impl Surface {
    /// The point from which new rays start, with its error bound.
    #[must_use]
    pub fn point(&self) -> SurfacePoint {
        SurfacePoint { position: self.position, normal: self.normal, offset: self.offset }
    }

    /// Unit normal of the plane that separates light from the viewer's side from light from behind.
    #[must_use]
    pub fn horizon(&self) -> [f64; 3] {
        self.smooth.map_or(self.normal, |smooth| smooth.normal)
    }

    /// An infinite ray along `direction`: [`SurfacePoint::spawn_ray`].
    #[must_use]
    pub fn spawn_ray(&self, direction: [f32; 3]) -> Ray {
        self.point_towards(wide(direction)).spawn_ray(direction).at_time(self.time)
    }

    /// A ray that ends just before `target`: [`SurfacePoint::spawn_ray_to`].
    #[must_use]
    pub fn spawn_ray_to(&self, target: [f32; 3]) -> Option<Ray> {
        let towards = wide(target) - DVec3::from(self.position);
        Some(self.point_towards(towards).spawn_ray_to(target)?.at_time(self.time))
    }

    /// Where rays along `direction` start.
    fn point_towards(&self, direction: DVec3) -> SurfacePoint {
        match self.smooth {
            Some(SmoothSurface { position, normal })
                if DVec3::from(self.normal).dot(direction) < 0.0 && DVec3::from(normal).dot(direction) > 0.0 =>
            {
                SurfacePoint { position, normal, offset: self.offset }
            }
            _ => self.point(),
        }
    }

    /// Mirrors a direction below the horizon to the outside.
    ///
    /// A direction may be above the horizon of the shading normal and below that of the surface. Mirroring keeps rays
    /// out of the solid without losing energy, as rejecting the sample would.
    #[must_use]
    pub fn mirror_outward(&self, direction: [f32; 3]) -> [f32; 3] {
        let horizon = DVec3::from(self.horizon());
        let height = horizon.dot(wide(direction));
        if height >= 0.0 { direction } else { narrow(wide(direction) - horizon * (2.0 * height)) }
    }
}

/// The surfaces of a scene, with everything that is precomputed per instance and per texture.
#[derive(Clone, Debug)]
pub struct Surfaces<'a> {
    scene: &'a Scene,
    placements: Vec<Placement>,
    textures: Textures<'a>,
    lod: Lod,
    /// For each material, whether it has textures other than alpha.
    is_textured: Vec<bool>,
    /// Whether all materials have the diffuse lobe alone.
    are_lambert: bool,
    /// For each mesh, where its segments are along strands, if it has curves with textures.
    strands: Vec<Option<Vec<[f32; 2]>>>,
    /// For each instance, whether any of its materials uses alpha.
    uses_alpha: Vec<bool>,
    /// For each instance, whether any of its materials is single-sided.
    is_single_sided: Vec<bool>,
}

impl<'a> Surfaces<'a> {
    /// Prepares all instances of `scene`, without mip maps.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        Self::with_lod(scene, Lod::None)
    }

    /// Prepares all instances and textures of `scene`, in the current thread pool.
    #[must_use]
    pub fn with_lod(scene: &'a Scene, lod: Lod) -> Self {
        Self::with_textures(scene, lod, Textures::new(scene, lod))
    }

    /// As [`Surfaces::with_lod`], with the mip maps of an earlier frame of the same textures and materials.
    #[must_use]
    pub fn with_mip_maps(scene: &'a Scene, lod: Lod, known: &MipMaps) -> Self {
        Self::with_textures(scene, lod, Textures::with_mip_maps(scene, lod, known))
    }

    /// The mip maps, for later frames.
    #[must_use]
    pub fn mip_maps(&self) -> MipMaps {
        self.textures.mip_maps(self.lod)
    }

    fn with_textures(scene: &'a Scene, lod: Lod, textures: Textures<'a>) -> Self {
        let max_coordinates: Vec<f32> = scene.meshes.iter().map(max_coordinate).collect();
        let placements = scene
            .instances
            .iter()
            .map(|instance| {
                let close = instance.world_from_object_close.as_ref().filter(|c| **c != instance.world_from_object);
                Placement::new(&instance.world_from_object, close, max_coordinates[instance.mesh.0 as usize])
            })
            .collect();
        let is_textured = scene.materials.iter().map(|material| filtered_textures(material).next().is_some()).collect();
        let of_instances = |is: &dyn Fn(&Material) -> bool| {
            let meshes = scene.instances.iter().map(|instance| &scene.meshes[instance.mesh.0 as usize]);
            let any = |mesh: &Mesh| mesh.parts.iter().any(|part| is(&scene.materials[part.material.0 as usize]));
            meshes.map(any).collect()
        };
        let uses_alpha = of_instances(&Material::uses_alpha);
        let is_single_sided = of_instances(&|material| hit_filter::is_single_sided(material, false));
        let strands = scene.meshes.iter().map(|mesh| curve::strands(mesh, &scene.materials)).collect();
        let are_lambert = scene.materials.iter().all(is_lambert);
        Self { scene, placements, textures, lod, is_textured, are_lambert, strands, uses_alpha, is_single_sided }
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Whether all materials have the diffuse lobe alone.
    pub(crate) fn are_lambert(&self) -> bool {
        self.are_lambert
    }

    /// Its textures.
    #[cfg(feature = "gpu")]
    pub(crate) fn textures(&self) -> &Textures<'a> {
        &self.textures
    }

    /// The surface at a hit of a world-space ray along `direction`, at shutter time 0, with textures at full
    /// resolution.
    #[must_use]
    pub fn at(&self, hit: &Hit, direction: [f32; 3]) -> Surface {
        self.at_time(hit, direction, 0.0, Cone::ZERO)
    }

    /// The surface at a hit of a ray in world space. `cone` is the ray cone at its origin.
    #[must_use]
    pub fn at_ray(&self, hit: &Hit, ray: &Ray, cone: Cone) -> Surface {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        match &mesh.curves {
            Some(curves) => self.on_curve(hit, ray, cone, mesh, curves),
            None => self.at_time(hit, ray.direction, ray.time, cone),
        }
    }

    /// The surface of a triangle at a hit of a world-space ray along `direction` at shutter time `time` in 0..=1. `cone` is the ray
    /// cone at the origin.
    ///
    /// The point is interpolated from the vertices, not computed from `t`, whose rounding would move it along the ray.
    #[must_use]
    pub fn at_time(&self, hit: &Hit, direction: [f32; 3], time: f32, cone: Cone) -> Surface {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let placement = &self.placements[hit.instance.0 as usize];
        let triangle = HitTriangle::new(&self.scene.meshes[instance.mesh.0 as usize], hit, time);
        let pose = placement.pose(time);
        let placed = PlacedTriangle::new(triangle, &pose, placement.is_mirrored());

        let direction = wide(direction);
        let towards_viewer = -direction;
        let winding = placed.winding;
        // A triangle that was hit has an area; otherwise the direction to the viewer is a safe fallback.
        let normal = winding
            .try_normalize()
            .map(|n| facing(n, towards_viewer))
            .or_else(|| towards_viewer.try_normalize())
            .unwrap_or(DVec3::Z);
        // A mirroring transform reverses the winding.
        let is_front = (winding.dot(direction) <= 0.0) != placement.is_mirrored();

        let id = placed.triangle.mesh.material_of(hit.primitive.0);
        let material = self.material(id);
        let cone = cone.grown(f64::from(hit.t) * direction.length());
        let lookups = self.is_textured[id.0 as usize].then(|| TextureLookup {
            textures: &self.textures,
            lod: self.lod,
            triangle: &placed.triangle,
            plane: Plane { edges: placed.edges_world(), normal: winding },
            direction,
            cone,
        });
        let texel = |slot: &Option<TextureRef>| lookups.as_ref().map_or([1.0; 4], |all| all.texel(slot.as_ref()));
        let emission_texel = if material.is_emissive() { texel(&material.emission_texture) } else { [1.0; 4] };
        let smooth = placed.smooth_normal();
        let shading_normal = shading_normal(material, &placed, lookups.as_ref(), smooth, normal, towards_viewer);
        let mut bsdf = bsdf(material, placed.triangle.color(), is_front, texel);
        let mut along = None;
        if let Some(source) = &material.lobes {
            let (at_hit, specular) = lobes(source, texel);
            bsdf.specular *= specular;
            bsdf.lobes = Some(at_hit);
            if at_hit.anisotropy > 0.0 {
                along = anisotropy(source, &placed, lookups.as_ref(), shading_normal);
            }
        }
        Surface {
            position: placed.position().into(),
            normal: normal.into(),
            shading_normal: shading_normal.into(),
            smooth: if material.transmission > 0.0 {
                None
            } else {
                placed.smooth_surface(smooth, normal, towards_viewer)
            },
            is_front,
            bsdf,
            along: along.map(DVec3::into),
            emission: std::array::from_fn(|k| material.emission[k] * emission_texel[k]),
            offset: placement.offset(normal),
            cone,
            time,
        }
    }

    /// Whether the surface at a hit is opaque to a ray with this key, by alpha.
    ///
    /// A blended surface is opaque with probability alpha over all keys, and in a fraction alpha of each aligned block of `2^m` samples of
    /// a key. The answer depends only on key, sample, instance and triangle, and so not on the traversal.
    #[must_use]
    pub fn is_present(&self, hit: &Hit, key: u32, sample: u32) -> bool {
        let presence = self.presence(hit);
        presence >= 1.0 || alpha_threshold(key, sample, hit) < presence
    }

    /// Probability that the surface at a hit is opaque: alpha if blended, else 0 or 1.
    #[must_use]
    pub fn presence(&self, hit: &Hit) -> f32 {
        // Fast path.
        if !self.uses_alpha[hit.instance.0 as usize] {
            return 1.0;
        }
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        let material = self.material(mesh.material_of(hit.primitive.0));
        let alpha = || match &mesh.curves {
            Some(curves) => self.alpha_of_curve(hit, material, curves),
            None => self.alpha(material, &HitTriangle::new(mesh, hit, 0.0)),
        };
        match material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha() >= cutoff)),
            AlphaMode::Blend => alpha(),
        }
    }

    /// Whether the material at a hit is hair.
    pub(crate) fn is_hair(&self, hit: &Hit) -> bool {
        let mesh = &self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize];
        mesh.curves.is_some() && !mesh.has_patches() && self.material(mesh.material_of(hit.primitive.0)).hair.is_some()
    }

    /// Whether the material at a hit is single-sided, or may be where `all` are, see [`hit_filter::is_single_sided`].
    pub(crate) fn is_single_sided(&self, hit: &Hit, all: bool) -> bool {
        // Fast path.
        if !(all || self.is_single_sided[hit.instance.0 as usize]) {
            return false;
        }
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        if mesh.curves.is_some() && !mesh.has_patches() {
            return false;
        }
        hit_filter::is_single_sided(self.material(mesh.material_of(hit.primitive.0)), all)
    }

    /// The point at a hit on a triangle or a patch, and the normal of any length on the front side, the one from which it is counter-clockwise in
    /// object space. World space.
    pub(crate) fn face(&self, hit: &Hit, time: f32) -> (DVec3, DVec3) {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let placement = &self.placements[hit.instance.0 as usize];
        let pose = placement.pose(time);
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        if let Some((position, normal)) = curve::point_of_patch(mesh, hit, time) {
            let outward = pose.normal_world(normal) * if placement.is_mirrored() { -1.0 } else { 1.0 };
            return (pose.point_world(position), outward);
        }
        let triangle = HitTriangle::new(mesh, hit, time);
        let placed = PlacedTriangle::new(triangle, &pose, placement.is_mirrored());
        // A mirroring transform reverses the winding.
        (placed.position(), if placement.is_mirrored() { -placed.winding } else { placed.winding })
    }

    /// Ray offset of a static instance's surface with this unit normal, in world units.
    pub(crate) fn offset(&self, instance: InstanceId, normal: DVec3) -> f64 {
        self.placements[instance.0 as usize].offset(normal)
    }

    /// Alpha at a hit, from textures at full resolution.
    fn alpha(&self, material: &Material, triangle: &HitTriangle) -> f32 {
        let texture = material.alpha_texture.as_ref().and_then(|slot| {
            let uv = slot.texture_from_mesh.point(triangle.uv(slot.uv_set)?);
            Some(self.textures.get(slot.texture).alpha(uv))
        });
        let [.., vertices] = triangle.color();
        material.alpha * texture.unwrap_or(1.0) * vertices
    }

    fn material(&self, id: MaterialId) -> &'a Material {
        &self.scene.materials[id.0 as usize]
    }
}

/// The BSDF of a material, where `tint` is the vertex color and `texel` evaluates a texture.
fn bsdf(material: &Material, tint: [f32; 4], is_front: bool, texel: impl Fn(&Option<TextureRef>) -> [f32; 4]) -> Bsdf {
    let color = texel(&material.base_color_texture);
    let [_, rough, metal, _] = texel(&material.metallic_roughness_texture);
    let [through, ..] = texel(&material.transmission_texture);
    let transmission = material.transmission * through;
    Bsdf {
        base_color: std::array::from_fn(|k| material.base_color[k] * color[k] * tint[k]),
        metallic: material.metallic * metal,
        roughness: material.roughness * rough,
        specular: material.specular,
        transmission,
        ior: material.ior,
        thin_walled: material.thin_walled,
        is_inside: !is_front && transmission > 0.0 && !material.thin_walled,
        // A setting of the integrator.
        is_compensated: false,
        hemisphere: Hemisphere::Cosine,
        lobes: None,
        hair: None,
    }
}

/// Whether surfaces of a material have the diffuse lobe alone, see [`Bsdf::is_lambert`].
fn is_lambert(material: &Material) -> bool {
    let Material { metallic, specular, transmission, lobes, hair, .. } = material;
    *metallic == 0.0 && *specular == 0.0 && *transmission == 0.0 && lobes.is_none() && hair.is_none()
}

/// A uniform number in `[0, 1)` for a ray and a triangle, stratified over the samples of a key.
fn alpha_threshold(key: u32, sample: u32, hit: &Hit) -> f32 {
    let seed = mix(mix(key ^ hit.instance.0) ^ hit.primitive.0);
    unit(net_single(sample, seed) >> 8)
}

/// Maximum absolute coordinate of the vertices that triangles use, at any shutter time.
fn max_coordinate(mesh: &Mesh) -> f32 {
    let reach = |positions: &Vec<[f32; 3]>| {
        Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| positions[i as usize])).reach()
    };
    let of_curves = mesh.curves.iter().flat_map(|curves| {
        let indices = curves.segments.indices().iter().map(|&i| i as usize);
        let greatest = |point: [f32; 3]| point.iter().fold(0.0, |most: f32, x| most.max(x.abs()));
        indices.map(move |i| {
            let at_close = mesh
                .close
                .as_ref()
                .map_or(0.0, |close| greatest(close.positions[i]) + close.radii.as_ref().unwrap_or(&curves.radii)[i]);
            (greatest(mesh.positions[i]) + curves.radii[i]).max(at_close)
        })
    });
    of_curves
        .fold(reach(&mesh.positions), f32::max)
        .max(mesh.close.as_ref().map_or(0.0, |close| reach(&close.positions)))
}

// Prefetching of the memory that shading reads.

impl Surfaces<'_> {
    /// Reads what [`Surfaces::at_time`] needs for these hits, so that it is in the cache.
    ///
    /// Each loop reads one thing for every hit, at an address that the previous loop determined. Its iterations are
    /// short and independent, so that an out-of-order processor overlaps many cache misses; a full shading evaluation
    /// would wait for them one by one. Texels are read only for lookups in level 0: smaller mip levels are mostly in
    /// the cache.
    pub(crate) fn prefetch<'h>(&self, hits: impl Iterator<Item = &'h Hit>) {
        let hits = hits.filter(|hit| !self.is_curve(hit));
        let triangles: Vec<(HitTriangle, u32)> = hits.map(|hit| (self.hit_triangle(hit), hit.primitive.0)).collect();
        for (triangle, _) in &triangles {
            triangle.prefetch();
        }
        if self.lod != Lod::None {
            return;
        }
        let mut texels = Vec::with_capacity(triangles.len());
        for (triangle, primitive) in &triangles {
            let id = triangle.mesh.material_of(*primitive);
            if !self.is_textured[id.0 as usize] {
                continue;
            }
            for slot in filtered_textures(self.material(id)) {
                if let Some(uv) = triangle.uv(slot.uv_set) {
                    texels.extend(self.textures.get(slot.texture).texels(slot.texture_from_mesh.point(uv)));
                }
            }
        }
        for four in texels {
            black_box(four.map(|row| row.map(|texel| texel[0])));
        }
    }

    fn is_curve(&self, hit: &Hit) -> bool {
        self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize].curves.is_some()
    }

    fn hit_triangle(&self, hit: &Hit) -> HitTriangle<'_> {
        HitTriangle::new(&self.scene.meshes[self.scene.instances[hit.instance.0 as usize].mesh.0 as usize], hit, 0.0)
    }
}

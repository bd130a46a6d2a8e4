use canted_obb::Aabb;
use canted_scene::{AlphaMode, Material, MaterialId, Mesh, Scene, TextureRef};
use canted_trace::{Hit, InstanceId};

use super::Surface;
use super::lookups::Lookups;
use super::placed::{Corners, Placed};
use super::shading_normal::{facing, shading_normal};
use crate::placement::Placement;
use crate::query::alpha_threshold;
use crate::texture::{Plane, Textures, averaged};
use crate::vector::{Vector, dot, length, scale, unit, wide};
use crate::{Bsdf, Cone, Lod};

/// The surfaces of a scene: what is looked up for each hit, with what is computed once for each instance and texture.
#[derive(Clone, Debug)]
pub struct Surfaces<'a> {
    pub(super) scene: &'a Scene,
    placements: Vec<Placement>,
    pub(super) textures: Textures<'a>,
    pub(super) lod: Lod,
    /// Of each material, whether what it looks like depends on textures.
    pub(super) is_textured: Vec<bool>,
    /// Of each instance, whether rays may pass where it is hit.
    uses_alpha: Vec<bool>,
}

impl<'a> Surfaces<'a> {
    /// Prepares all instances of `scene`; textures are looked up at full size.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        Self::with_lod(scene, Lod::None)
    }

    /// Prepares all instances and textures of `scene`, in the caller's thread pool.
    #[must_use]
    pub fn with_lod(scene: &'a Scene, lod: Lod) -> Self {
        let reaches: Vec<f32> = scene.meshes.iter().map(reach).collect();
        let placements = scene
            .instances
            .iter()
            .map(|instance| {
                let close = instance.world_from_object_close.as_ref().filter(|c| **c != instance.world_from_object);
                Placement::new(&instance.world_from_object, close, reaches[instance.mesh.0 as usize])
            })
            .collect();
        let is_textured = scene.materials.iter().map(|material| averaged(material).next().is_some()).collect();
        let uses_alpha = scene
            .instances
            .iter()
            .map(|instance| &scene.meshes[instance.mesh.0 as usize])
            .map(|mesh| mesh.parts.iter().any(|part| scene.materials[part.material.0 as usize].uses_alpha()))
            .collect();
        Self { scene, placements, textures: Textures::new(scene, lod), lod, is_textured, uses_alpha }
    }

    /// The scene they belong to.
    #[must_use]
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Its textures, ready to be looked up.
    pub(crate) fn textures(&self) -> &Textures<'a> {
        &self.textures
    }

    /// The surface at a hit of a world-space ray along `direction`, as the shutter opens, with textures at full size.
    #[must_use]
    pub fn at(&self, hit: &Hit, direction: [f32; 3]) -> Surface {
        self.at_time(hit, direction, 0.0, Cone::ZERO)
    }

    /// The surface at a hit of a world-space ray along `direction` that flew at `time`: 0 as the shutter opens, 1 as it
    /// closes. `cone` is what the ray stands for at its origin.
    ///
    /// The point comes from the barycentric weights, not from `t`: it does not move along the ray with the rounding of
    /// a distance.
    #[must_use]
    pub fn at_time(&self, hit: &Hit, direction: [f32; 3], time: f32, cone: Cone) -> Surface {
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let placement = &self.placements[hit.instance.0 as usize];
        let corners = Corners::of(&self.scene.meshes[instance.mesh.0 as usize], hit);
        let pose = placement.pose(time);
        let placed = Placed::new(corners, &pose, placement.is_mirrored());

        let direction = wide(direction);
        let towards_viewer = scale(direction, -1.0);
        let winding = placed.winding;
        // A triangle that was hit has an area; for a tracer that errs, facing the viewer is a harmless answer.
        let normal = unit(winding)
            .map(|n| facing(n, towards_viewer))
            .or_else(|| unit(towards_viewer))
            .unwrap_or([0.0, 0.0, 1.0]);
        // A mirror turns what is counter-clockwise.
        let is_front = (dot(winding, direction) <= 0.0) != placement.is_mirrored();

        let id = placed.corners.mesh.material_of(hit.primitive.0);
        let material = self.material(id);
        let cone = cone.grown(f64::from(hit.t) * length(direction));
        let lookups = self.is_textured[id.0 as usize].then(|| Lookups {
            textures: &self.textures,
            lod: self.lod,
            corners: &placed.corners,
            plane: Plane { edges: placed.edges_world(), normal: winding },
            direction,
            cone,
        });
        let texel = |slot: &Option<TextureRef>| lookups.as_ref().map_or([1.0; 4], |all| all.texel(slot.as_ref()));
        let glow = if material.is_emissive() { texel(&material.emission_texture) } else { [1.0; 4] };
        Surface {
            position: placed.position(),
            normal,
            shading_normal: shading_normal(material, &placed, lookups.as_ref(), normal, towards_viewer),
            is_front,
            bsdf: bsdf(material, placed.corners.color(), is_front, texel),
            emission: std::array::from_fn(|k| material.emission[k] * glow[k]),
            offset: placement.offset(normal),
            cone,
        }
    }

    /// Whether a ray meets the surface at a hit, or passes where alpha says that there is none.
    ///
    /// A blended surface is there for the share alpha of all keys: each ray should have a key of its own. The answer depends
    /// on key, instance and triangle alone, so it is the same whatever way a tracer takes.
    #[must_use]
    pub fn is_present(&self, hit: &Hit, key: u32) -> bool {
        let presence = self.presence(hit);
        presence >= 1.0 || alpha_threshold(key, hit) < presence
    }

    /// The share of rays that meet the surface at a hit: alpha where it is blended, else all or none.
    #[must_use]
    pub fn presence(&self, hit: &Hit) -> f32 {
        // Nearly every hit is on an instance that is all there.
        if !self.uses_alpha[hit.instance.0 as usize] {
            return 1.0;
        }
        let instance = &self.scene.instances[hit.instance.0 as usize];
        let mesh = &self.scene.meshes[instance.mesh.0 as usize];
        let material = self.material(mesh.material_of(hit.primitive.0));
        match material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => {
                let is_there = self.alpha(material, &Corners::of(mesh, hit)) >= cutoff;
                if is_there { 1.0 } else { 0.0 }
            }
            AlphaMode::Blend => self.alpha(material, &Corners::of(mesh, hit)),
        }
    }

    /// Distance that rays keep off a surface of an instance that stands still, by its unit normal; world units.
    pub(crate) fn offset(&self, instance: InstanceId, normal: Vector) -> f64 {
        self.placements[instance.0 as usize].offset(normal)
    }

    /// Alpha at a point, of textures at full size.
    fn alpha(&self, material: &Material, corners: &Corners) -> f32 {
        let texture = material.alpha_texture.as_ref().and_then(|slot| {
            let uv = slot.texture_from_mesh.point(corners.uv(slot.uv_set)?);
            Some(self.textures.get(slot.texture).alpha(uv))
        });
        let [.., vertices] = corners.color();
        material.alpha * texture.unwrap_or(1.0) * vertices
    }

    pub(super) fn material(&self, id: MaterialId) -> &'a Material {
        &self.scene.materials[id.0 as usize]
    }
}

/// The material at a point, with `tint` of the vertices, where `texel` tells what a texture says.
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
    }
}

/// Greatest absolute coordinate among the vertices that triangles use.
fn reach(mesh: &Mesh) -> f32 {
    Aabb::from_points(mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize])).reach()
}

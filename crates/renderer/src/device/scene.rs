//! The buffers of a scene, and nothing that it does not need.

use canted_gpu::{Buffer, Gpu, GpuError, MotionPolynomials, NamedBinding, Number, Variant, choice};
use canted_scene::{Material, MaterialId, Mesh, Scene};
use canted_trace::InstanceId;

use super::geometry::{Geometry, PackedPlacement, Placed};
use super::lights::SampledLights;
use super::materials::{
    Columns, ImageHeads, Images, Materials, PackedHair, PackedMaterial, Slot, Texels, used_textures,
};
use super::streams::Masked;
use super::vertices::PackedTriangle;
use crate::light::{ListLight, is_shape};
use crate::scene_bvh::instances;
use crate::surface::hit_filter;
use crate::texture::Textures;
use crate::{Hemisphere, Integrator, Lod, Settings, bsdf};

/// A scene on the GPU, without its acceleration structure.
pub(super) struct PackedScene {
    materials: Buffer<PackedMaterial>,
    triangles: Buffer<PackedTriangle>,
    vertices: Buffer<f32>,
    firsts: Option<Buffer<u32>>,
    placements: Option<Buffer<PackedPlacement>>,
    images: Option<(Buffer<Slot>, Buffer<[u32; 4]>, Texels)>,
    lights: Option<Buffer<ListLight>>,
    /// What rough glass scatters.
    glass: Option<Buffer<[f32; 2]>>,
    /// Hair on curves.
    hairs: Option<Buffer<PackedHair>>,
    columns: Columns,
    has: Has,
    lod: Lod,
    /// Ray offset of a scene in world space, and of each instance otherwise, see `slack`.
    pub(super) slack: f32,
    slacks: Vec<f32>,
    /// The scene's material of each packed one.
    material_ids: Vec<MaterialId>,
}

/// Features of a scene.
#[derive(Clone, Copy, Debug)]
struct Has {
    instances: bool,
    motion: bool,
    normals: bool,
    normal_maps: bool,
    masks: bool,
    mask_textures: bool,
    /// Whether rays pass faces.
    single_sided: bool,
    shape_lights: bool,
    /// Materials that are not diffuse.
    gloss: bool,
    glass: bool,
    /// Rough glass that refracts, and gets back what its facets lose.
    compensated_glass: bool,
    /// Whether some meshes have curves, and some curves are hair.
    curves: bool,
    hair: bool,
    /// Whether some have patches.
    patches: bool,
}

impl PackedScene {
    /// Packs and uploads what an integrator reads of `scene`, with meshes in world space if `is_flat`.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &Scene,
        textures: &Textures,
        &Settings { lod, cull, energy_compensation, .. }: &Settings,
        is_flat: bool,
        integrator: Integrator,
    ) -> Result<Self, GpuError> {
        let images = Images::pack(scene, textures, integrator);
        let used = |which: usize| {
            let slots = scene.materials.iter().map(|material| used_textures(material, integrator)[which]);
            slots.flatten().next().is_some()
        };
        let (normal_maps, mask_textures) = (used(NORMAL_MAP), used(ALPHA));
        let columns = Columns::of(scene, images.is_some(), normal_maps);
        let none = ImageHeads::none();
        let heads = images.as_ref().map_or(&none, |images| &images.heads);
        let mut materials = Materials::new(scene, integrator, cull, &columns, heads);
        let geometry = Geometry::pack(scene, &columns, is_flat, &mut materials);
        let slacks = match &geometry.placed {
            Placed::Instances(placements) => placements.iter().map(|placement| placement.slack).collect(),
            Placed::One | Placed::Flat(_) => vec![],
        };
        let (firsts, placements) = match &geometry.placed {
            Placed::One => (None, None),
            Placed::Flat(firsts) => (Some(gpu.read_only("first triangles", firsts)?), None),
            Placed::Instances(placements) => (None, Some(gpu.read_only("placements", placements)?)),
        };
        let refracts = |material: &Material| material.transmission > 0.0 && !material.thin_walled;
        let compensated_glass =
            integrator == Integrator::Path && energy_compensation && scene.materials.iter().any(refracts);
        let has_hair = !materials.hairs.is_empty();
        let has = Has {
            instances: placements.is_some(),
            motion: instances(scene).iter().any(|instance| MotionPolynomials::of(instance).is_some()),
            normals: columns.normal > 0,
            normal_maps,
            masks: hit_filter::uses_alpha(scene),
            single_sided: hit_filter::culls(scene, cull),
            mask_textures,
            // The kernels of hair are those of all materials.
            gloss: has_hair || scene.materials.iter().any(is_glossy),
            glass: has_hair || scene.materials.iter().any(|material| material.transmission > 0.0),
            compensated_glass,
            curves: scene.has_curves(),
            patches: scene.meshes.iter().any(Mesh::has_patches),
            hair: has_hair,
            shape_lights: scene.lights.iter().any(is_shape),
        };
        let images = match &images {
            None => None,
            Some(images) => {
                let slots = gpu.read_only("texture slots", &materials.slots)?;
                Some((slots, gpu.read_only("images", &images.images)?, images.upload(gpu)?))
            }
        };
        let lights: Vec<ListLight> = scene.lights.iter().map(ListLight::from).collect();
        let lights = if lights.is_empty() { None } else { Some(gpu.read_only("lights", &lights)?) };
        let hairs = has_hair.then(|| gpu.read_only("hairs", &materials.hairs)).transpose()?;
        let glass = compensated_glass.then(|| gpu.read_only("albedos of glass", bsdf::glass::table())).transpose()?;
        Ok(Self {
            materials: gpu.read_only("materials", &materials.packed)?,
            triangles: gpu.read_only("triangles", &geometry.triangles)?,
            vertices: gpu.read_only("vertices", &geometry.vertices)?,
            firsts,
            placements,
            images,
            lights,
            glass,
            hairs,
            columns,
            has,
            lod,
            slack: geometry.slack,
            slacks,
            material_ids: materials.ids,
        })
    }

    /// The variables that kernels may bind.
    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound: Vec<NamedBinding<'_>> =
            vec![("materials", &self.materials), ("triangles", &self.triangles), ("vertices", &self.vertices)];
        bound.extend(self.firsts.as_ref().map(|firsts| -> NamedBinding<'_> { ("firsts", firsts) }));
        bound.extend(self.placements.as_ref().map(|placements| -> NamedBinding<'_> { ("placements", placements) }));
        bound.extend(self.lights.as_ref().map(|lights| -> NamedBinding<'_> { ("lights", lights) }));
        bound.extend(self.glass.as_ref().map(|glass| -> NamedBinding<'_> { ("glass_albedos", glass) }));
        bound.extend(self.hairs.as_ref().map(|hairs| -> NamedBinding<'_> { ("hairs", hairs) }));
        if let Some((slots, images, texels)) = &self.images {
            bound.push(("slots", slots));
            bound.push(("images", images));
            bound.extend(
                Texels::NAMES
                    .into_iter()
                    .zip(&texels.bindings)
                    .map(|(name, buffer)| -> NamedBinding<'_> { (name, buffer) }),
            );
        }
        bound
    }

    /// Selects the parts of a kernel that read the scene.
    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        let Has { instances, motion, normals, normal_maps, masks, single_sided, curves, hair, patches, .. } = self.has;
        let placed = match (instances, &self.firsts) {
            (true, _) if motion => choice::Placed::Moving,
            (true, _) => choice::Placed::Instances,
            (false, Some(_)) => choice::Placed::Flat,
            (false, None) => choice::Placed::Single,
        };
        let bent = match (normal_maps, normals) {
            (true, _) => choice::Normal::Mapped,
            (false, true) => choice::Normal::Smooth,
            (false, false) => choice::Normal::Flat,
        };
        let mask = match (masks, single_sided) {
            (false, false) => choice::Mask::None,
            (true, false) => choice::Mask::Alpha,
            (false, true) => choice::Mask::Faces,
            (true, true) => choice::Mask::Both,
        };
        let has_kinds = self.columns.radius > 0;
        let shapes = match (curves, has_kinds) {
            (false, _) => choice::Shapes::Triangles,
            (true, false) => choice::Shapes::Curves,
            (true, true) if patches => choice::Shapes::Patches,
            (true, true) => choice::Shapes::Kinds,
        };
        let chosen = chosen
            .with(shapes)
            .with(placed)
            .with(bent)
            .with(mask)
            .number(Number::Stride, self.columns.stride)
            .number(Number::Color, self.columns.color);
        let chosen = match self.columns {
            Columns { radius, close, .. } if has_kinds => {
                chosen.number(Number::Radius, radius).number(Number::Close, close)
            }
            _ => chosen,
        };
        let exits = if hair { choice::Exits::Hair } else { choice::Exits::Kept };
        let chosen = if curves { chosen.with(exits) } else { chosen };
        let chosen = if normals || normal_maps { chosen.number(Number::Normal, self.columns.normal) } else { chosen };
        let chosen = if normal_maps { chosen.number(Number::Tangent, self.columns.tangent) } else { chosen };
        let chosen = if masks { self.with_alpha(chosen) } else { chosen };
        match &self.images {
            Some((.., texels)) => {
                let coordinates = if curves { choice::Coordinates::Curves } else { choice::Coordinates::Triangles };
                texels.specialize(chosen.with(coordinates), self.lod)
            }
            None => chosen.with(choice::Texture::None),
        }
    }

    /// Selects the parts of the hybrid integrator.
    pub(super) fn specialize_hybrid(&self, chosen: Variant, settings: &Settings) -> Variant {
        let chosen = chosen.with(hemisphere(settings));
        let direct = if self.lights.is_some() { choice::Direct::List } else { choice::Direct::None };
        self.with_shape_lights(self.specialize(chosen)).with(direct)
    }

    /// Selects the parts of the path integrator.
    pub(super) fn specialize_path(&self, chosen: Variant, lights: &SampledLights, settings: &Settings) -> Variant {
        let chosen = chosen.with(hemisphere(settings));
        let chosen = lights.specialize(self.with_shape_lights(self.specialize(chosen)));
        // Textured emission reads alpha even without an alpha test.
        let chosen = if lights.needs_textured_emission() && !self.has.masks { self.with_alpha(chosen) } else { chosen };
        if !self.has.gloss {
            return self.with_material(chosen).with(choice::Bsdf::Lambert);
        }
        let through = if self.has.glass { choice::Transmission::Glass } else { choice::Transmission::None };
        let energy = match (settings.energy_compensation, self.has.compensated_glass) {
            (false, _) => choice::Energy::Single,
            (true, false) => choice::Energy::Compensated,
            (true, true) => choice::Energy::Refracting,
        };
        let bsdf = if self.has.hair { choice::Bsdf::Hair } else { choice::Bsdf::Full };
        self.with_material(chosen).with(bsdf).with(through).with(energy)
    }

    /// Selects the parts of the kernel that writes AOVs.
    pub(super) fn specialize_guide(&self, chosen: Variant) -> Variant {
        self.with_material(self.with_shape_lights(self.specialize(chosen)))
    }

    fn with_material(&self, chosen: Variant) -> Variant {
        let part = match (self.has.hair, self.has.gloss) {
            (true, _) => choice::Material::Hair,
            (false, true) => choice::Material::Full,
            (false, false) => choice::Material::Lambert,
        };
        chosen.with(part)
    }

    fn with_shape_lights(&self, chosen: Variant) -> Variant {
        chosen.with(if self.has.shape_lights { choice::ShapeLights::List } else { choice::ShapeLights::None })
    }

    fn with_alpha(&self, chosen: Variant) -> Variant {
        chosen.with(if self.has.mask_textures { choice::Alpha::Texture } else { choice::Alpha::Plain })
    }

    /// Which rays need more than the BVHs, if those mark the triangles with alpha or do not.
    pub(super) fn masked(&self, are_marked: bool) -> Masked {
        match (self.has.single_sided || self.has.motion, self.has.masks) {
            (false, false) => Masked::None,
            (false, true) if are_marked => Masked::Some,
            _ => Masked::All,
        }
    }

    /// Whether some meshes have curves.
    pub(super) fn has_curves(&self) -> bool {
        self.has.curves
    }

    /// The scene's material of a packed one.
    pub(super) fn material(&self, number: u32) -> MaterialId {
        self.material_ids[number as usize]
    }

    /// Ray offset of an instance.
    pub(super) fn slack_of(&self, instance: InstanceId) -> f32 {
        self.slacks.get(instance.0 as usize).copied().unwrap_or(self.slack)
    }
}

/// The part that samples diffuse directions.
fn hemisphere(settings: &Settings) -> choice::Hemisphere {
    match settings.hemisphere {
        Hemisphere::Cosine => choice::Hemisphere::Cosine,
        Hemisphere::Uniform => choice::Hemisphere::Uniform,
    }
}

/// Whether a material is not purely diffuse; textures can only reduce its factors.
fn is_glossy(material: &Material) -> bool {
    material.metallic != 0.0 || material.specular != 0.0 || material.transmission != 0.0
}

/// Indices in `used_textures`.
const NORMAL_MAP: usize = 3;
const ALPHA: usize = 5;

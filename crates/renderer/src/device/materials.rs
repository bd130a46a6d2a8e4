//! Packs materials, the layout of vertices that they ask for, and images as words of a few long arrays.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use canted_gpu::{Buffer, Gpu, GpuError, Number, Variant, choice};
use canted_scene::{
    AlphaMode, CurveSegments, CurveShape, Curves, Encoding, Hair as HairSource, Magnification, Material, MaterialId,
    Mesh, Scene, Texture, TextureId, TextureRef, UvSet, Wrap,
};

use crate::surface::hit_filter::is_single_sided;
use crate::texture::{MipMap, Textures};
use crate::{Cull, Hair, Integrator, Lod};

/// Offsets of the attributes of a vertex, in words; 0 for an attribute that no vertex has. Positions come first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) stride: u32,
    pub(super) normal: u32,
    pub(super) tangent: u32,
    pub(super) color: u32,
    pub(super) uv: u32,
    pub(super) second_uv: u32,
    /// The radius of points of curves, and their positions and radii at shutter closing, in scenes with other curves than segments that do not move.
    pub(super) radius: u32,
    pub(super) close: u32,
}

impl Columns {
    /// The attributes that the meshes of `scene` have and its materials use.
    pub(super) fn of(scene: &Scene, has_textures: bool, has_normal_maps: bool) -> Self {
        let any = |has: fn(&Mesh) -> bool| scene.meshes.iter().any(has);
        let mut columns = Self { stride: 3, ..Self::default() };
        let mut add = |is_present: bool, n_words: u32| {
            let column = columns.stride;
            columns.stride += if is_present { n_words } else { 0 };
            if is_present { column } else { 0 }
        };
        let normal = add(any(|mesh| mesh.normals.is_some()), 3);
        let tangent = add(has_normal_maps && any(|mesh| mesh.tangents.is_some()), 4);
        let color = add(any(|mesh| mesh.colors.is_some()), 4);
        let uv = add(has_textures && any(|mesh| mesh.uvs.is_some()), 2);
        let second_uv = add(has_textures && any(|mesh| mesh.second_uvs.is_some()), 2);
        let has_kinds = scene.meshes.iter().any(has_other_curves);
        let radius = add(has_kinds, 1);
        let close = add(has_kinds && any(|mesh| mesh.close.is_some()), 4);
        Self { normal, tangent, color, uv, second_uv, radius, close, ..columns }
    }
}

/// Whether a mesh has curves that are not round segments, or move.
fn has_other_curves(mesh: &Mesh) -> bool {
    let is_plain = |Curves { segments, shape, .. }: &Curves| {
        matches!((segments, shape), (CurveSegments::Linear(_), CurveShape::Tube))
    };
    mesh.curves.as_ref().is_some_and(|curves| !is_plain(curves) || mesh.close.is_some())
}

/// No texture.
const NO_SLOT: u32 = u32::MAX;

/// Marks blended materials; thresholds are below it.
const IS_BLENDED: f32 = 2.0;

/// `Material` of `shared/surface`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedMaterial {
    pub(super) base_color: [f32; 3],
    pub(super) alpha: f32,
    pub(super) emission: [f32; 3],
    pub(super) cutoff: f32,
    pub(super) metallic: f32,
    pub(super) roughness: f32,
    pub(super) specular: f32,
    pub(super) transmission: f32,
    pub(super) ior: f32,
    pub(super) thin_walled: u32,
    pub(super) normal_scale: f32,
    pub(super) base_color_slot: u32,
    pub(super) rough_metal_slot: u32,
    pub(super) transmission_slot: u32,
    pub(super) normal_slot: u32,
    pub(super) emission_slot: u32,
    pub(super) alpha_slot: u32,
    pub(super) single_sided: u32,
    pub(super) hair: u32,
    padding: u32,
}

/// No hair.
const NO_HAIR: u32 = u32::MAX;

/// `HairMaterial` of `shared/surface/material/hair`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedHair {
    pub(super) absorption: [f32; 3],
    pub(super) roughness: f32,
    pub(super) roughness_around: f32,
    pub(super) tilt_rad: f32,
    pub(super) ior: f32,
    pub(super) of_color: f32,
}

impl PackedHair {
    fn new(source: &HairSource, ior: f32) -> Self {
        let Hair { absorption, roughness, roughness_around, tilt_rad, .. } = Hair::new(source, [1.0; 3], ior);
        let of_color =
            if source.melanin > 0.0 || source.pheomelanin > 0.0 { 0.0 } else { Hair::color_scale(roughness_around) };
        Self { absorption, roughness, roughness_around, tilt_rad, ior, of_color }
    }
}

/// `Slot` of `shared/texture/lookup`: a texture as a material refers to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Slot {
    pub(super) u: [f32; 3],
    pub(super) head: u32,
    pub(super) v: [f32; 3],
    pub(super) column: u32,
}

/// Packed materials: one for each combination of a material and the texture coordinates that meshes have.
pub(super) struct Materials<'a> {
    scene: &'a Scene,
    integrator: Integrator,
    cull: Cull,
    columns: &'a Columns,
    heads: &'a ImageHeads,
    /// Of a material, of the texture coordinates, and of whether it is on curves.
    numbers: BTreeMap<(u32, [bool; 2], bool), u32>,
    pub(super) packed: Vec<PackedMaterial>,
    /// What is hair.
    pub(super) hairs: Vec<PackedHair>,
    /// The scene's material of each packed one.
    pub(super) ids: Vec<MaterialId>,
    pub(super) slots: Vec<Slot>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        integrator: Integrator,
        cull: Cull,
        columns: &'a Columns,
        heads: &'a ImageHeads,
    ) -> Self {
        let numbers = BTreeMap::new();
        Self {
            scene,
            integrator,
            cull,
            columns,
            heads,
            numbers,
            packed: vec![],
            hairs: vec![],
            ids: vec![],
            slots: vec![],
        }
    }

    /// Number of the packed material for triangles or curves of `mesh`.
    pub(super) fn number(&mut self, id: MaterialId, mesh: &Mesh) -> u32 {
        let is_curve = mesh.curves.is_some();
        let is_line = is_curve && !mesh.has_patches();
        // Every curve has coordinates along its strand and across.
        let has = [UvSet::First, UvSet::Second].map(|set| is_curve || mesh.uv_set(set).is_some());
        let key = (id.0, has, is_line);
        if let Some(&number) = self.numbers.get(&key) {
            return number;
        }
        let number = self.packed.len() as u32;
        let material = &self.scene.materials[id.0 as usize];
        let mut packed = self.pack(material, has);
        if is_line {
            // Curves have no faces, and only they are hair.
            packed.single_sided = 0;
            if let Some(hair) = &material.hair {
                packed.hair = self.hairs.len() as u32;
                self.hairs.push(PackedHair::new(hair, material.ior));
            }
        }
        self.packed.push(packed);
        self.ids.push(id);
        self.numbers.insert(key, number);
        number
    }

    fn pack(&mut self, material: &Material, has: [bool; 2]) -> PackedMaterial {
        let slots = used_textures(material, self.integrator).map(|slot| self.slot(slot, has));
        let [base_color_slot, rough_metal_slot, transmission_slot, normal_slot, emission_slot, alpha_slot] = slots;
        PackedMaterial {
            base_color: material.base_color,
            alpha: material.alpha,
            emission: crate::light::bounded(material.emission),
            cutoff: match material.alpha_mode {
                AlphaMode::Opaque => -1.0,
                // Alpha is at most 1, so thresholds above it are equivalent.
                AlphaMode::Mask { cutoff } => cutoff.clamp(0.0, 1.5),
                AlphaMode::Blend => IS_BLENDED,
            },
            metallic: material.metallic,
            roughness: material.roughness,
            specular: material.specular,
            transmission: material.transmission,
            ior: material.ior,
            thin_walled: material.thin_walled.into(),
            normal_scale: material.normal_scale,
            base_color_slot,
            rough_metal_slot,
            transmission_slot,
            normal_slot,
            emission_slot,
            alpha_slot,
            single_sided: (self.cull != Cull::Off && is_single_sided(material, self.cull == Cull::Back)).into(),
            hair: NO_HAIR,
            padding: 0,
        }
    }

    fn slot(&mut self, slot: Option<&TextureRef>, [first, second]: [bool; 2]) -> u32 {
        let Some(slot) = slot else { return NO_SLOT };
        let (has, column) = match slot.uv_set {
            UvSet::First => (first, self.columns.uv),
            UvSet::Second => (second, self.columns.second_uv),
        };
        if !has {
            return NO_SLOT;
        }
        let [u, v] = slot.texture_from_mesh.rows;
        let number = self.slots.len() as u32;
        self.slots.push(Slot { u, head: self.heads.of(slot.texture), v, column });
        number
    }
}

/// Bindings over which texels may be split.
const MAX_BINDINGS: usize = 4;

/// Words before the first texel: the sRGB curve.
const CURVE: u32 = 256;

/// The texel of an empty texture: opaque white.
const WHITE: [u8; 4] = [255; 4];

/// The textures of a material that an integrator reads, in the order of the slots.
pub(super) fn used_textures(material: &Material, integrator: Integrator) -> [Option<&TextureRef>; 6] {
    let is_path = integrator == Integrator::Path;
    [
        material.base_color_texture.as_ref(),
        material.metallic_roughness_texture.as_ref().filter(|_| is_path),
        material.transmission_texture.as_ref().filter(|_| is_path),
        material.normal_texture.as_ref(),
        material.emission_texture.as_ref().filter(|_| material.is_emissive()),
        material.alpha_texture.as_ref().filter(|_| material.uses_alpha()),
    ]
}

/// The index of the first image of each texture.
pub(super) struct ImageHeads(Vec<u32>);

impl ImageHeads {
    /// No textures.
    pub(super) fn none() -> Self {
        Self(vec![])
    }

    pub(super) fn of(&self, texture: TextureId) -> u32 {
        self.0[texture.0 as usize]
    }
}

/// All mip levels of the textures that an integrator reads.
pub(super) struct Images {
    pub(super) heads: ImageHeads,
    /// Heads and levels, see `shared/texture/lookup`.
    pub(super) images: Vec<[u32; 4]>,
    /// The sRGB curve, then texels.
    words: Vec<u32>,
}

/// Texels on the GPU, in one binding or four.
pub(super) struct Texels {
    pub(super) bindings: Vec<Buffer<u32>>,
    per_binding: u32,
}

impl Images {
    /// The images that materials of `scene` use; `None` without textures.
    pub(super) fn pack(scene: &Scene, textures: &Textures, integrator: Integrator) -> Option<Self> {
        let mut is_used = vec![false; scene.textures.len()];
        for slot in scene.materials.iter().flat_map(|material| used_textures(material, integrator)).flatten() {
            is_used[slot.texture.0 as usize] = true;
        }
        if !is_used.contains(&true) {
            return None;
        }
        let curve = canted_film::srgb::linear().iter().map(|x| x.to_bits()).collect();
        let mut all = Self { heads: ImageHeads(vec![0; is_used.len()]), images: vec![], words: curve };
        for (index, texture) in (0..).zip(&scene.textures).filter(|&(index, _)| is_used[index as usize]) {
            all.heads.0[index as usize] = all.count();
            all.add(texture, textures.get(TextureId(index)));
        }
        Some(all)
    }

    fn count(&self) -> u32 {
        self.images.len() as u32
    }

    fn add(&mut self, texture: &Texture, mip_map: &MipMap) {
        let [wrap_u, wrap_v] = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0_u32,
            Wrap::Clamp => 1,
            Wrap::Mirror => 2,
        });
        let is_srgb = u32::from(texture.encoding == Encoding::Srgb);
        let is_nearest = u32::from(texture.magnification == Magnification::Nearest);
        let facts = wrap_u | wrap_v << 2 | is_srgb << 4 | is_nearest << 5;
        if texture.texels.is_empty() {
            self.images.push([1, facts, 0, 0]);
            return self.add_level([1, 1], &[WHITE]);
        }
        self.images.push([mip_map.n_levels() as u32, facts, 0, 0]);
        for level in 0..mip_map.n_levels() {
            let image = mip_map.level(level);
            self.add_level(image.size, image.texels);
        }
    }

    fn add_level(&mut self, [width, height]: [u32; 2], texels: &[[u8; 4]]) {
        // An offset beyond 32 bits exceeds the memory of any device, so `upload` rejects it.
        let first = u32::try_from(self.words.len()).unwrap_or(u32::MAX).saturating_sub(CURVE);
        self.images.push([first, width, height, 0]);
        self.words.extend(texels.iter().map(|&texel| u32::from_le_bytes(texel)));
    }

    /// Uploads the texels in as few bindings as the limits of the device allow.
    ///
    /// # Errors
    /// More texels than all bindings hold.
    pub(super) fn upload(&self, gpu: &Gpu) -> Result<Texels, GpuError> {
        let limits = gpu.limits();
        let most_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let per_binding = u32::try_from(most_bytes / 4).unwrap_or(u32::MAX).max(1);
        let chunks: Vec<&[u32]> = self.words.chunks(per_binding as usize).collect();
        if chunks.len() > MAX_BINDINGS {
            return Err(GpuError::Limit {
                what: "the textures".to_owned(),
                need: 4 * self.words.len() as u64,
                limit: "bytes of four storage bindings",
                most: 4 * most_bytes,
                remedy: "use smaller textures or no mip maps",
            });
        }
        let n = if chunks.len() == 1 { 1 } else { MAX_BINDINGS };
        let chunk = |k: usize| gpu.read_only("texels", chunks.get(k).copied().unwrap_or_default());
        Ok(Texels { bindings: (0..n).map(chunk).collect::<Result<_, _>>()?, per_binding })
    }
}

impl Texels {
    /// Names of the variables, in the order of the bindings.
    pub(super) const NAMES: [&'static str; MAX_BINDINGS] = ["texels_0", "texels_1", "texels_2", "texels_3"];

    /// Selects how kernels read and average texels.
    pub(super) fn specialize(&self, chosen: Variant, lod: Lod) -> Variant {
        let lod = match lod {
            Lod::None => choice::Lod::None,
            Lod::Cone => choice::Lod::Cone,
            Lod::Aniso => choice::Lod::Aniso,
        };
        let chosen = chosen.with(choice::Texture::Lookup).with(lod);
        if self.bindings.len() == 1 {
            return chosen.with(choice::Texels::One);
        }
        chosen.with(choice::Texels::Four).number(Number::TexelsPerBinding, self.per_binding)
    }
}

//! Packs materials.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use canted_scene::{AlphaMode, Material, MaterialId, Mesh, Scene, TextureRef, UvSet};

use super::columns::Columns;
use super::textures::{ImageHeads, used_textures};
use crate::Integrator;

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
    padding: [u32; 3],
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
    columns: &'a Columns,
    heads: &'a ImageHeads,
    numbers: BTreeMap<(u32, [bool; 2]), u32>,
    pub(super) packed: Vec<PackedMaterial>,
    /// The scene's material of each packed one.
    pub(super) ids: Vec<MaterialId>,
    pub(super) slots: Vec<Slot>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(scene: &'a Scene, integrator: Integrator, columns: &'a Columns, heads: &'a ImageHeads) -> Self {
        Self { scene, integrator, columns, heads, numbers: BTreeMap::new(), packed: vec![], ids: vec![], slots: vec![] }
    }

    /// Number of the packed material for triangles of `mesh`.
    pub(super) fn number(&mut self, id: MaterialId, mesh: &Mesh) -> u32 {
        let has = [UvSet::First, UvSet::Second].map(|set| mesh.uv_set(set).is_some());
        if let Some(&number) = self.numbers.get(&(id.0, has)) {
            return number;
        }
        let number = self.packed.len() as u32;
        let packed = self.pack(&self.scene.materials[id.0 as usize], has);
        self.packed.push(packed);
        self.ids.push(id);
        self.numbers.insert((id.0, has), number);
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
            padding: [0; 3],
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

//! Packs and uploads lights: the list, the environment, and the data for sampling them.

use bytemuck::{Pod, Zeroable};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, Variant, choice};
use canted_scene::{Environment, Scene};
use canted_trace::InstanceId;

use crate::light::environment::{SkyImage, SkyRow, SkySampler};
use crate::light::tree::LightNode;
use crate::light::triangle::PackedEmitter;
use crate::light::{Choice, bounded};
use crate::{LightSampler, environment_of};

/// Leaf of a light that is not in the tree.
const NO_LEAF: u32 = u32::MAX;

/// Flag of emissive triangles among the lights of the tree.
const EMITTER: u32 = 1 << 31;

/// Selection probabilities: `LightProbabilities` of `shared/light/sampler`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct LightProbabilities {
    local: f32,
    sky: f32,
}

/// A sun and its selection probability: `SampledSun` of `shared/light/sun`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct SampledSun {
    light: u32,
    probability: f32,
}

/// The buffers that the path integrator samples lights from.
pub(super) struct SampledLights {
    probabilities: Buffer<LightProbabilities>,
    tree: Option<Buffer<LightNode>>,
    emitters: Option<Buffer<PackedEmitter>>,
    /// Leaf of each listed light, if the tree has listed lights.
    leaves: Option<Buffer<u32>>,
    suns: Option<Buffer<SampledSun>>,
    sky: Option<(Buffer<SkyRow>, Buffer<f32>)>,
    /// Whether a constant sky is sampled.
    sky_is_sampled: bool,
    emission_is_textured: bool,
}

impl SampledLights {
    /// Packs and uploads; `slack` is the ray offset of an instance.
    ///
    /// # Errors
    /// Too little memory on the device.
    pub(super) fn new(
        gpu: &Gpu,
        sampler: &LightSampler<'_>,
        slack: impl Fn(InstanceId) -> f32,
    ) -> Result<Self, GpuError> {
        let probabilities = LightProbabilities {
            local: sampler.kind_probability(Choice::Tree) as f32,
            sky: sampler.kind_probability(Choice::Environment) as f32,
        };
        let suns = sampler.kinds.iter().filter_map(|&(choice, probability)| match choice {
            Choice::Sun(light) => Some(SampledSun { light, probability: probability as f32 }),
            Choice::Tree | Choice::Environment => None,
        });
        let n_emitters = sampler.emitters.len();
        // Emissive triangles come first in the tree, and then lights of the scene file.
        let light = |number: u32| match (number as usize).checked_sub(n_emitters) {
            None => number | EMITTER,
            Some(listed) => sampler.listed[listed],
        };
        let tree = sampler.tree.as_ref();
        let nodes = tree.map_or_else(Vec::new, |tree| tree.packed(light));
        let leaf_of = tree.map_or(&[][..], |tree| &tree.leaves);
        let has_listed = !sampler.listed.is_empty();
        let leaves = sampler.tree_lights.iter().map(|light| light.map_or(NO_LEAF, |light| leaf_of[light as usize]));
        let leaves: Vec<u32> = if has_listed { leaves.collect() } else { Vec::new() };
        Ok(Self {
            probabilities: gpu.read_only_uniform("light probabilities", &probabilities)?,
            tree: some(gpu, "light nodes", &nodes)?,
            emitters: some(gpu, "emitters", &sampler.emitters.packed(leaf_of, slack))?,
            leaves: some(gpu, "light leaves", &leaves)?,
            suns: some(gpu, "sampled suns", &suns.collect::<Vec<_>>())?,
            sky: match sampler.sky.as_ref().map(SkySampler::packed) {
                Some((rows, sums)) => Some((gpu.read_only("sky rows", &rows)?, gpu.read_only("sky sums", &sums)?)),
                None => None,
            },
            sky_is_sampled: probabilities.sky > 0.0,
            emission_is_textured: sampler.emitters.are_textured(),
        })
    }

    /// The bindings of `shared/light/sampler`, except the list and the image of the environment.
    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        let mut bound: Vec<NamedBinding<'_>> = vec![("light_probabilities", &self.probabilities)];
        if let Some(tree) = &self.tree {
            bound.push(("light_nodes", tree));
        }
        if let Some(emitters) = &self.emitters {
            bound.push(("emitters", emitters));
        }
        if let Some(leaves) = &self.leaves {
            bound.push(("light_leaves", leaves));
        }
        if let Some(suns) = &self.suns {
            bound.push(("sampled_suns", suns));
        }
        if let Some((rows, sums)) = &self.sky {
            bound.extend([("sky_rows", rows as &dyn canted_gpu::AsBinding), ("sky_sums", sums)]);
        }
        bound
    }

    /// Whether kernels evaluate the emission of surfaces, by `shared/light/triangle/emission/textured`.
    pub(super) fn needs_textured_emission(&self) -> bool {
        self.emitters.is_some() && self.emission_is_textured
    }

    /// Selects the parts that the scene needs.
    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        let local = match (&self.emitters, &self.leaves) {
            (None, None) => choice::Local::None,
            (Some(_), None) => choice::Local::Emitters,
            (None, Some(_)) => choice::Local::Lights,
            (Some(_), Some(_)) => choice::Local::Both,
        };
        let skylight = match (&self.sky, self.sky_is_sampled) {
            (Some(_), _) => choice::Skylight::Image,
            (None, true) => choice::Skylight::Cosine,
            (None, false) => choice::Skylight::Black,
        };
        let suns = if self.suns.is_some() { choice::Suns::List } else { choice::Suns::None };
        let chosen = chosen.with(local).with(skylight).with(suns);
        match (&self.emitters, self.needs_textured_emission()) {
            (None, _) => chosen,
            (Some(_), false) => chosen.with(choice::Emission::Constant),
            (Some(_), true) => chosen.with(choice::Emission::Textured),
        }
    }
}

/// The environment on the GPU.
pub(super) enum DeviceSky {
    /// No light.
    Black,
    /// Constant radiance, stored with the picture.
    Constant,
    /// An image and its texels.
    Image(Buffer<SkyImage>, Buffer<f32>),
}

impl DeviceSky {
    /// Uploads the environment of a scene.
    ///
    /// # Errors
    /// More texels than a binding holds.
    pub(super) fn new(gpu: &Gpu, scene: &Scene) -> Result<Self, GpuError> {
        let image = match environment_of(scene) {
            Environment::Image(image) => image,
            Environment::Constant(radiance) if bounded(*radiance) == [0.0; 3] => return Ok(Self::Black),
            Environment::Constant(_) => return Ok(Self::Constant),
        };
        let texels: Vec<f32> = image.texels.iter().flat_map(|texel| bounded(*texel)).collect();
        let texels = gpu.read_only("texels of the environment", &texels)?;
        Ok(Self::Image(gpu.read_only_uniform("environment", &SkyImage::new(image))?, texels))
    }

    /// The bindings of the part.
    pub(super) fn bindings(&self) -> Vec<NamedBinding<'_>> {
        match self {
            Self::Black | Self::Constant => vec![],
            Self::Image(image, texels) => vec![("sky_image", image), ("sky_texels", texels)],
        }
    }

    /// Selects the part that the scene needs.
    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        chosen.with(match self {
            Self::Black => choice::Sky::Black,
            Self::Constant => choice::Sky::Constant,
            Self::Image(..) => choice::Sky::Image,
        })
    }
}

/// A buffer, unless it would be empty.
fn some<T: Pod>(gpu: &Gpu, what: &str, values: &[T]) -> Result<Option<Buffer<T>>, GpuError> {
    if values.is_empty() { Ok(None) } else { gpu.read_only(what, values).map(Some) }
}

//! Packs lights: the list, and the data for sampling them.

use bytemuck::{Pod, Zeroable};
use canted_gpu::{Buffer, Gpu, GpuError, NamedBinding, Variant};
use canted_scene::Light;
use canted_trace::InstanceId;

use crate::LightSampler;
pub(super) use crate::light::packed::bounded;
use crate::light::packed::{Emitter, LightNode, LightProbabilities, SampledSun, SkyRow};

/// `ListLight` of `shared/light/list`, where each kind is documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct ListLight {
    pub(super) position: [f32; 3],
    pub(super) kind: u32,
    pub(super) direction: [f32; 3],
    pub(super) extent: f32,
    pub(super) color: [f32; 3],
    pub(super) cos_outer: f32,
}

impl From<&Light> for ListLight {
    fn from(light: &Light) -> Self {
        let light = match *light {
            Light::Sun { direction, irradiance } => Self { kind: 0, direction, color: irradiance, ..Self::default() },
            Light::Point { position, intensity } => Self { kind: 1, position, color: intensity, ..Self::default() },
            Light::Spot { position, direction, intensity, cos_inner, cos_outer } => {
                Self { kind: 2, position, direction, color: intensity, extent: cos_inner, cos_outer }
            }
            Light::Sphere { center, radius, radiance } => {
                Self { kind: 3, position: center, extent: radius, color: radiance, ..Self::default() }
            }
            Light::Disk { center, normal, radius, radiance } => {
                Self { kind: 4, position: center, direction: normal, extent: radius, color: radiance, cos_outer: 0.0 }
            }
        };
        Self { color: bounded(light.color), ..light }
    }
}

/// The buffers that the path integrator samples lights from.
pub(super) struct SampledLights {
    probabilities: Buffer<LightProbabilities>,
    tree: Option<Buffer<LightNode>>,
    emitters: Option<Buffer<Emitter>>,
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
        let packed = sampler.packed(slack);
        let in_tree = packed.nodes.len().div_ceil(2) > packed.emitters.len();
        Ok(Self {
            probabilities: gpu.read_only_uniform("light probabilities", &packed.probabilities)?,
            tree: some(gpu, "light nodes", &packed.nodes)?,
            emitters: some(gpu, "emitters", &packed.emitters)?,
            leaves: some(gpu, "light leaves", if in_tree { &packed.leaves } else { &[] })?,
            suns: some(gpu, "sampled suns", &packed.suns)?,
            sky: match &packed.sky {
                Some((rows, sums)) => Some((gpu.read_only("sky rows", rows)?, gpu.read_only("sky sums", sums)?)),
                None => None,
            },
            sky_is_sampled: packed.probabilities.sky > 0.0,
            emission_is_textured: packed.emission_is_textured,
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

    /// Whether kernels evaluate the emission of surfaces, by `shared/emission/textured`.
    pub(super) fn needs_textured_emission(&self) -> bool {
        self.emitters.is_some() && self.emission_is_textured
    }

    /// Selects the parts that the scene needs.
    pub(super) fn specialize(&self, chosen: Variant) -> Variant {
        let local = match (&self.emitters, &self.leaves) {
            (None, None) => "shared/local/none",
            (Some(_), None) => "shared/local/emitters",
            (None, Some(_)) => "shared/local/lights",
            (Some(_), Some(_)) => "shared/local/both",
        };
        let skylight = match (&self.sky, self.sky_is_sampled) {
            (Some(_), _) => "shared/skylight/image",
            (None, true) => "shared/skylight/cosine",
            (None, false) => "shared/skylight/black",
        };
        let suns = if self.suns.is_some() { "shared/suns/list" } else { "shared/suns/none" };
        let chosen = chosen.part("local", local).part("skylight", skylight).part("suns", suns);
        match (&self.emitters, self.needs_textured_emission()) {
            (None, _) => chosen,
            (Some(_), false) => chosen.part("emission", "shared/emission/constant"),
            (Some(_), true) => chosen.part("emission", "shared/emission/textured"),
        }
    }
}

/// A buffer, unless it would be empty.
fn some<T: Pod>(gpu: &Gpu, what: &str, values: &[T]) -> Result<Option<Buffer<T>>, GpuError> {
    if values.is_empty() { Ok(None) } else { gpu.read_only(what, values).map(Some) }
}

//! The GPU layout of a [`LightSampler`], in `f32`.

use bytemuck::{Pod, Zeroable};
use canted_scene::EnvironmentImage;
use canted_trace::InstanceId;

use super::emitters::Emitters;
use super::environment::{SkySampler, cosine_above, solid_angle};
use super::sampler::{Choice, LightSampler};
use super::tree::Tree;

/// Maximum radiance on the GPU: prevents overflow in products.
const MAX_RADIANCE: f32 = 1e18;

/// Flag of emissive triangles among the lights of the tree.
const EMITTER: u32 = 1 << 31;

/// Leaf of a light that is not in the tree.
const NO_LEAF: u32 = u32::MAX;

/// A node of the light tree: `LightNode` of `shared/light/tree`, which documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightNode {
    pub(crate) center: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) axis: [f32; 3],
    pub(crate) cos_emission: f32,
    pub(crate) spread: [f32; 2],
    pub(crate) intensity: f32,
    pub(crate) is_two_sided: u32,
    pub(crate) parent: u32,
    pub(crate) first_child: u32,
    pub(crate) light: u32,
    pub(crate) padding: u32,
}

/// An emissive triangle: `Emitter` of `shared/light/emitters`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Emitter {
    pub(crate) corner: [f32; 3],
    pub(crate) instance: u32,
    pub(crate) first: [f32; 3],
    pub(crate) primitive: u32,
    pub(crate) second: [f32; 3],
    pub(crate) leaf: u32,
    pub(crate) radiance: [f32; 3],
    pub(crate) slack: f32,
}

/// Selection probabilities: `LightProbabilities` of `shared/light/sampler`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LightProbabilities {
    pub(crate) local: f32,
    pub(crate) sky: f32,
}

/// A sun and its selection probability: `SampledSun` of `shared/suns/list`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct SampledSun {
    pub(crate) light: u32,
    pub(crate) probability: f32,
}

/// An environment map: `SkyImage` of `shared/sky/image`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct SkyImage {
    pub(crate) scale: [f32; 3],
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) turn: f32,
    pub(crate) padding: [u32; 2],
}

/// The distribution over rows of the environment map: `SkyRow` of `shared/skylight/image`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct SkyRow {
    pub(crate) sum: f32,
    pub(crate) cosine: f32,
    pub(crate) per_steradian: f32,
}

/// A packed light sampler.
pub(crate) struct PackedLights {
    pub(crate) probabilities: LightProbabilities,
    /// Empty without lights that have a position.
    pub(crate) nodes: Vec<LightNode>,
    pub(crate) emitters: Vec<Emitter>,
    /// Leaf of each light of the scene file.
    pub(crate) leaves: Vec<u32>,
    pub(crate) suns: Vec<SampledSun>,
    /// Rows and running sums of an environment map that is importance sampled.
    pub(crate) sky: Option<(Vec<SkyRow>, Vec<f32>)>,
    /// Whether the radiance of any emitter varies over its surface.
    pub(crate) emission_is_textured: bool,
}

impl LightSampler<'_> {
    /// Packs the sampler. `slack` is the ray offset of an instance per axis, on the GPU.
    pub(crate) fn packed(&self, slack: impl Fn(InstanceId) -> f32) -> PackedLights {
        let probability = |wanted: Choice| narrowed(self.kind_probability(wanted));
        let suns = self.kinds.iter().filter_map(|&(choice, probability)| match choice {
            Choice::Sun(light) => Some(SampledSun { light, probability: narrowed(probability) }),
            _ => None,
        });
        let (nodes, leaves) = self.tree.as_ref().map_or_else(Default::default, |tree| self.nodes(tree));
        PackedLights {
            probabilities: LightProbabilities {
                local: probability(Choice::Tree),
                sky: probability(Choice::Environment),
            },
            emitters: emitters(&self.emitters, &leaves, slack),
            leaves: self
                .tree_lights
                .iter()
                .map(|light| light.map_or(NO_LEAF, |light| leaves[light as usize]))
                .collect(),
            nodes,
            suns: suns.collect(),
            sky: self.sky.as_ref().map(|sky| (rows(sky), sums(sky))),
            emission_is_textured: self.emitters.are_textured(),
        }
    }

    /// The nodes of the tree, and the leaf of each light.
    fn nodes(&self, tree: &Tree) -> (Vec<LightNode>, Vec<u32>) {
        let n_emitters = self.emitters.len();
        let all = tree.nodes[0].bounds.intensity;
        let nodes = tree.nodes.iter().map(|node| {
            let bounds = &node.bounds;
            let number = node.light as usize;
            LightNode {
                center: bounds.center.map(narrowed),
                radius: narrowed(bounds.radius),
                axis: bounds.axis.map(narrowed),
                cos_emission: narrowed(bounds.cos_emission),
                spread: [bounds.spread.cos, bounds.spread.sin].map(narrowed),
                // Relative to the total, which fits f32; never zero, however weak the light.
                intensity: narrowed(bounds.intensity / all).max(1e-30),
                is_two_sided: bounds.is_two_sided.into(),
                parent: node.parent.unwrap_or(0),
                first_child: node.children.map_or(0, |children| children[0]),
                light: if number < n_emitters { node.light | EMITTER } else { self.listed[number - n_emitters] },
                padding: 0,
            }
        });
        (nodes.collect(), tree.leaves.clone())
    }
}

impl Emitters<'_> {
    /// Whether the radiance of any emitter varies over its surface.
    fn are_textured(&self) -> bool {
        let material = |emitter: &super::emitters::Emitter| self.material(emitter.instance, emitter.primitive);
        self.list.iter().map(material).any(|material| material.uses_alpha() || material.emission_texture.is_some())
    }

    /// Radiance of an emitter without its texture, linear RGB.
    fn emission(&self, emitter: &super::emitters::Emitter) -> [f32; 3] {
        self.material(emitter.instance, emitter.primitive).emission
    }
}

fn emitters(all: &Emitters<'_>, leaves: &[u32], slack: impl Fn(InstanceId) -> f32) -> Vec<Emitter> {
    let packed = all.list.iter().zip(leaves).map(|(emitter, &leaf)| {
        let [a, b, c] = emitter.corners.map(|corner| corner.map(f64::from));
        let from_a = |corner: [f64; 3]| std::array::from_fn(|k| narrowed(corner[k] - a[k]));
        Emitter {
            corner: emitter.corners[0],
            instance: emitter.instance.0,
            first: from_a(b),
            primitive: emitter.primitive.0,
            second: from_a(c),
            leaf,
            radiance: bounded(all.emission(emitter)),
            slack: slack(emitter.instance),
        }
    });
    packed.collect()
}

/// An environment map without its texels.
pub(crate) fn sky_image(image: &EnvironmentImage) -> SkyImage {
    SkyImage {
        scale: bounded(image.scale),
        width: image.width,
        height: image.height,
        turn: narrowed((f64::from(image.turn_degrees) / 360.0).rem_euclid(1.0)),
        padding: [0; 2],
    }
}

fn rows(sky: &SkySampler<'_>) -> Vec<SkyRow> {
    let total = sky.rows[sky.rows.len() - 1];
    let row = |(number, sum): (usize, &f64)| SkyRow {
        sum: narrowed(sum / total),
        cosine: narrowed(cosine_above(sky.image, number)),
        per_steradian: narrowed(1.0 / solid_angle(sky.image, number)),
    };
    sky.rows.iter().enumerate().map(row).collect()
}

/// Running sums of each row, normalized. A black row is never chosen.
fn sums(sky: &SkySampler<'_>) -> Vec<f32> {
    let rows = 0..sky.rows.len() - 1;
    rows.flat_map(|row| {
        let sums = sky.row(row);
        let total = sums[sums.len() - 1];
        sums.iter().map(move |sum| if total > 0.0 { narrowed(sum / total) } else { 0.0 })
    })
    .collect()
}

/// A color clamped for the GPU; NaN becomes black.
#[expect(clippy::manual_clamp, reason = "clamp keeps NaN")]
pub(crate) fn bounded(color: [f32; 3]) -> [f32; 3] {
    color.map(|x| x.max(0.0).min(MAX_RADIANCE))
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is the result")]
fn narrowed(x: f64) -> f32 {
    x as f32
}

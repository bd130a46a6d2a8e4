//! Texture lookups: filtered over the ray's footprint, or at a point.
//!
//! ```text
//! textures of the scene    -> mip_map (mip levels, filtered in linear light)
//! ray cone, triangle       -> footprint (an ellipse) -> lookup in the mip_map -> values in 0..=1
//! ```

mod mip_map;

use std::sync::Arc;

use canted_scene::{Material, Scene, Texture, TextureId, TextureRef};
use glam::DVec3;
use rayon::prelude::*;

pub(crate) use mip_map::MipMap;
use mip_map::Reduced;

/// Texture filtering.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Lod {
    /// No mip maps: bilinear lookups at full resolution.
    None,
    /// Isotropic: a square as wide as the longer axis of the ray cone's footprint. Never aliases, but blurs at grazing
    /// angles.
    Cone,
    /// Anisotropic: the elliptical footprint of the cone, up to 16:1, for directly visible surfaces and mirror
    /// reflections; after other scattering, [`Lod::Cone`].
    #[default]
    Aniso,
}

impl Lod {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Cone, Self::Aniso];

    /// Its name in options, scene files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Cone => "cone",
            Self::Aniso => "aniso",
        }
    }
}

/// The textures of a scene with their mip maps.
#[derive(Clone, Debug)]
pub(crate) struct Textures<'a> {
    mip_maps: Vec<MipMap<'a>>,
}

impl<'a> Textures<'a> {
    /// Prepares all textures of `scene`. Filtered textures get mip maps.
    ///
    /// Alpha textures do not: averaging alpha would move the edges of cutouts.
    pub(crate) fn new(scene: &'a Scene, lod: Lod) -> Self {
        let mut uses = vec![Use::default(); scene.textures.len()];
        for material in &scene.materials {
            // A texture that is visible only where its own alpha is high is filtered with alpha weights.
            let mask = material.alpha_texture.as_ref().filter(|_| material.uses_alpha());
            for slot in filtered_textures(material) {
                let usage = &mut uses[slot.texture.0 as usize];
                usage.is_filtered = lod != Lod::None;
                usage.ignores_alpha |= mask != Some(slot);
            }
        }
        let mip_map = |(texture, usage): (&'a Texture, &Use)| {
            if usage.is_filtered { MipMap::new(texture, !usage.ignores_alpha) } else { MipMap::flat(texture) }
        };
        Self { mip_maps: scene.textures.par_iter().zip(&uses).map(mip_map).collect() }
    }

    /// As [`Textures::new`] with the mip levels of another frame; builds them where they are not those of such textures.
    pub(crate) fn with_mip_maps(scene: &'a Scene, lod: Lod, known: &MipMaps) -> Self {
        let sizes = scene.textures.iter().map(|texture| [texture.width, texture.height]);
        if lod != known.lod || !sizes.eq(known.levels.iter().map(|(size, _)| *size)) {
            return Self::new(scene, lod);
        }
        let levels = known.levels.iter().map(|(_, levels)| levels);
        Self { mip_maps: scene.textures.iter().zip(levels).map(|(t, levels)| MipMap::with_levels(t, levels)).collect() }
    }

    /// The mip levels.
    pub(crate) fn mip_maps(&self, lod: Lod) -> MipMaps {
        let of_one = |mip_map: &MipMap| (mip_map.level(0).size, Arc::clone(mip_map.shared_levels()));
        MipMaps { lod, levels: self.mip_maps.iter().map(of_one).collect() }
    }

    pub(crate) fn get(&self, id: TextureId) -> &MipMap<'a> {
        &self.mip_maps[id.0 as usize]
    }
}

/// Mip levels of the textures of a scene, for later frames of the same scene.
#[derive(Clone, Debug)]
pub struct MipMaps {
    lod: Lod,
    /// Size of each texture, and its levels above 0.
    levels: Vec<([u32; 2], Arc<Vec<Reduced>>)>,
}

/// How materials use a texture.
#[derive(Clone, Copy, Default)]
struct Use {
    is_filtered: bool,
    /// Whether any material shows it regardless of its alpha.
    ignores_alpha: bool,
}

/// The textures of a material except for alpha.
pub(crate) fn filtered_textures(material: &Material) -> impl Iterator<Item = &TextureRef> {
    [
        &material.base_color_texture,
        &material.metallic_roughness_texture,
        &material.transmission_texture,
        &material.normal_texture,
        &material.emission_texture,
    ]
    .into_iter()
    .flatten()
    .chain(material.lobes.iter().flat_map(|lobes| lobes.textures()))
}

/// A ray cone: the width of the region around a ray that a sample represents. It determines the texture footprint.
///
/// Source: Akenine-Möller et al. 2019 ("Texture level of detail strategies for real-time ray tracing"), with two
/// changes:
///
/// * Sample number `i` of a pixel has a cone `1/√(i + 1)` times as wide as the pixel. A single sample covers its pixel;
///   with many samples, texture blur vanishes and the image converges to the unfiltered one. The number of a sample is
///   known even if their count is not, so partial renders can be merged.
/// * Scattering widens the cone by the solid angle that a direction represents, the reciprocal of its PDF (Colbert and
///   Křivánek 2007), at most `π`, that of a diffuse surface. Rough surfaces widen the cone, mirrors do not.
///
/// The curvature of mirrors is ignored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Diameter at the origin of the ray, world units.
    width: f64,
    /// Growth of the diameter with distance.
    spread: f64,
    /// Width relative to the full pixel or scattering lobe.
    scale: f64,
    /// Whether only mirrors lie between the ray and the camera.
    is_direct: bool,
}

impl Cone {
    /// Zero width: textures are looked up at full resolution, also after scattering.
    pub const ZERO: Self = Self { width: 0.0, spread: 0.0, scale: 0.0, is_direct: true };

    /// The cone of a pixel's sample with this number; `width` and `spread` are those of the pixel.
    pub(crate) fn of_pixel(width: f64, spread: f64, sample: u32) -> Self {
        let scale = 1.0 / (f64::from(sample) + 1.0).sqrt();
        Self { width: width * scale, spread: spread * scale, scale, is_direct: true }
    }

    /// The cone further along the ray, by a distance in world units.
    #[must_use]
    pub fn grown(self, distance: f64) -> Self {
        Self { width: self.width + self.spread * distance, ..self }
    }

    /// The cone after scattering into a direction sampled with a finite PDF, per steradian.
    ///
    /// Do not call this for delta lobes, which keep the cone.
    #[must_use]
    pub fn scattered(self, density: f32) -> Self {
        let solid_angle = (1.0 / f64::from(density)).min(std::f64::consts::PI);
        let spread = (self.spread * self.spread + solid_angle * self.scale * self.scale).sqrt();
        Self { spread, is_direct: false, ..self }
    }

    /// Diameter, world units.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Whether the width is zero, so that lookups need no filter.
    pub(crate) fn is_zero(&self) -> bool {
        self.width == 0.0
    }

    pub(crate) fn is_direct(&self) -> bool {
        self.is_direct
    }
}

/// Maximum number of probes along the longer axis.
const MAX_PROBES: f64 = 16.0;

/// The plane of a triangle, world space, for texture derivatives.
pub(crate) struct Plane {
    /// From the first vertex to the second and to the third.
    pub(crate) edges: [DVec3; 2],
    /// The cross product of the edges.
    pub(crate) normal: DVec3,
}

impl Plane {
    /// Change of texture coordinates along a vector in the plane, given their changes `along` the edges.
    ///
    /// Not finite if the triangle has no area.
    fn change(&self, vector: DVec3, along: [[f64; 2]; 2]) -> [f64; 2] {
        let square = self.normal.dot(self.normal);
        let s = vector.cross(self.edges[1]).dot(self.normal) / square;
        let t = self.edges[0].cross(vector).dot(self.normal) / square;
        std::array::from_fn(|k| s * along[0][k] + t * along[1][k])
    }
}

/// The region of a texture that a lookup filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Footprint {
    /// Mip level: binary logarithm of the width in texels; unfiltered at 0 and below.
    level: f64,
    /// Longer axis from end to end, in texture coordinates, sampled with `n_probes` probes.
    along: [f64; 2],
    n_probes: u32,
}

impl Footprint {
    /// No filter.
    pub(crate) const POINT: Self = Self { level: 0.0, along: [0.0; 2], n_probes: 1 };

    fn round(level: f64) -> Self {
        Self { level, ..Self::POINT }
    }

    /// The footprint of a ray along `direction` in a texture of `size`, whose coordinates change by `along` along the
    /// edges of the plane. `cone` is the ray cone at the hit.
    pub(crate) fn new(
        lod: Lod,
        cone: &Cone,
        direction: DVec3,
        plane: &Plane,
        along: [[f64; 2]; 2],
        size: [f64; 2],
    ) -> Self {
        match lod {
            Lod::None => Self::POINT,
            Lod::Aniso if cone.is_direct() => Self::ellipse(cone, direction, plane, along, size),
            Lod::Cone | Lod::Aniso => Self::square(cone, direction, plane, along, size),
        }
    }

    /// Isotropic, as wide as the longer axis: `½·log2(texel area over triangle area) + log2(w / cosine)`.
    fn square(cone: &Cone, direction: DVec3, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = along;
        let n_texels = (a * d - b * c).abs() * size[0] * size[1];
        let area = plane.normal.length();
        // The cosine times the area; the lookup clamps infinities.
        let projected = plane.normal.dot(direction).abs() / direction.length();
        let stretch = cone.width() / projected;
        Self::round(0.5 * (n_texels * area * stretch * stretch).log2())
    }

    /// The ellipse in which a narrow cone intersects the plane (Akenine-Möller et al. 2021).
    fn ellipse(cone: &Cone, direction: DVec3, plane: &Plane, along: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let (Some(normal), Some(direction)) = (plane.normal.try_normalize(), direction.try_normalize()) else {
            return Self::POINT;
        };
        let cosine = normal.dot(direction);
        let down = direction - normal * cosine;
        // The longer axis is along the projected ray; at normal incidence all axes are equal.
        let [long, short] = match down.try_normalize() {
            Some(down) => [down * (cone.width() / cosine.abs()), normal.cross(down) * cone.width()],
            None => [plane.edges[0], normal.cross(plane.edges[0])].map(|v| v * (cone.width() / v.length())),
        };
        Self::of_axes([long, short].map(|axis| plane.change(axis, along)), size)
    }

    /// The ellipse with these conjugate diameters in texture coordinates.
    fn of_axes(diameters: [[f64; 2]; 2], size: [f64; 2]) -> Self {
        let [[a, b], [c, d]] = diameters.map(|v| [v[0] * size[0], v[1] * size[1]]);
        // The squared axes are the eigenvalues of the sum of outer products; the product of the axes is the
        // determinant.
        let [xx, xy, yy] = [a * a + c * c, a * b + c * d, b * b + d * d];
        let half_difference = (0.5 * (xx - yy)).hypot(xy);
        let largest = 0.5 * (xx + yy) + half_difference;
        let (longest, width) = (largest.sqrt(), (a * d - b * c).abs() / largest.sqrt());
        // At least one texel wide. An ellipse longer than the maximum number of probes is widened.
        let width = width.max(1.0).max(longest / MAX_PROBES);
        if !longest.is_finite() || longest <= width {
            return Self::round(longest.log2());
        }
        let (x, y) =
            if xx >= yy { (0.5 * (xx - yy) + half_difference, xy) } else { (xy, 0.5 * (yy - xx) + half_difference) };
        let stretch = longest / x.hypot(y);
        // Rounded, so that a circle needs one probe; then the probes are widened until they touch.
        let n_probes = (longest / width).round();
        let level = width.max(longest / n_probes).log2();
        let n_probes = n_probes as u32;
        Self { level, along: [x * stretch / size[0], y * stretch / size[1]], n_probes }
    }
}

#[cfg(test)]
mod tests {
    use canted_scene::{AlphaMode, Encoding, Magnification, UvSet, Wrap};

    use super::*;

    /// The color of the coarsest mip level of a texture that is half white and half black, the black half transparent.
    fn smallest(materials: Vec<Material>) -> u8 {
        let texels = vec![[255; 4], [0; 4]];
        let (name, encoding, wrap) = (String::new(), Encoding::Linear, [Wrap::Repeat; 2]);
        let texture =
            Texture { name, width: 2, height: 1, texels, encoding, wrap, magnification: Magnification::Linear };
        let scene = Scene { textures: vec![texture], materials, ..Scene::default() };
        let textures = Textures::new(&scene, Lod::Aniso);
        let mip_map = textures.get(TextureId(0));
        mip_map.level(mip_map.n_levels() - 1).texels[0][0]
    }

    /// Colors are weighted by alpha only if it is the texture's own alpha that cuts it out.
    #[test]
    fn alpha_weights_only_colors_that_it_cuts_out() {
        const ALL: u8 = 128;
        const SEEN: u8 = 255;
        let slot = Some(TextureRef::new(TextureId(0)));
        let mask = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() };
        let leaf = Material { base_color_texture: slot, alpha_texture: slot, ..mask.clone() };
        let sign = Material { emission_texture: slot, alpha_texture: slot, ..mask.clone() };
        let blended = Material { alpha_mode: AlphaMode::Blend, ..leaf.clone() };
        for weighted in [&leaf, &sign, &blended] {
            assert_eq!(smallest(vec![weighted.clone()]), SEEN, "{weighted:?}");
        }
        let elsewhere = Some(TextureRef { uv_set: UvSet::Second, ..TextureRef::new(TextureId(0)) });
        for unweighted in [
            Material { alpha_mode: AlphaMode::Opaque, ..leaf.clone() },
            Material { base_color_texture: slot, ..mask.clone() },
            Material { emission_texture: slot, ..mask.clone() },
            Material { roughness: 0.5, metallic_roughness_texture: slot, ..mask },
            Material { base_color_texture: elsewhere, ..leaf.clone() },
        ] {
            assert_eq!(smallest(vec![unweighted.clone()]), ALL, "{unweighted:?}");
            assert_eq!(smallest(vec![leaf.clone(), unweighted]), ALL);
        }
    }

    #[test]
    fn cones_grow_with_distance_and_shrink_with_sample_number() {
        assert_eq!(Cone::of_pixel(1.0, 0.5, 0).grown(4.0).width(), 3.0);
        assert_eq!(Cone::of_pixel(1.0, 0.5, 3).grown(4.0).width(), 1.5);
        assert_eq!(Cone::ZERO.grown(1e9).scattered(0.1).grown(1e9).width(), 0.0);
    }

    #[test]
    fn scattering_widens_by_inverse_pdf_up_to_diffuse() {
        let width = |density: f32| Cone::of_pixel(1.0, 0.0, 0).scattered(density).grown(1.0).width();
        assert_eq!(width(100.0), 1.1);
        for density in [0.0, 1e-30, 0.1] {
            assert_eq!(width(density), 1.0 + std::f64::consts::PI.sqrt(), "{density}");
        }
        assert!(!Cone::ZERO.scattered(1.0).is_direct());
    }

    fn plane(edges: [DVec3; 2]) -> Plane {
        Plane { edges, normal: edges[0].cross(edges[1]) }
    }

    /// A plane with one texture repeat per unit, rotated around the x axis.
    fn tilted(tilt_rad: f64) -> Plane {
        plane([DVec3::X, DVec3::new(0.0, tilt_rad.cos(), tilt_rad.sin())])
    }

    const UNIT: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
    const SIZE: [f64; 2] = [1024.0, 1024.0];
    const DOWN: DVec3 = DVec3::new(0.0, 0.0, -2.0);

    fn at(lod: Lod, width: f64, tilt_rad: f64) -> Footprint {
        let cone = Cone::of_pixel(width, 0.0, 0);
        Footprint::new(lod, &cone, DOWN, &tilted(tilt_rad), UNIT, SIZE)
    }

    /// Rounding error of a logarithm of a quotient of a few products.
    const BOUND: f64 = 64.0 * f64::EPSILON;

    #[test]
    fn level_is_log2_of_width_in_texels() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let footprint = at(lod, 8.0 / 1024.0, 0.0);
            assert!((footprint.level - 3.0).abs() < BOUND && footprint.n_probes == 1, "{lod:?} {footprint:?}");
        }
        assert_eq!(at(Lod::None, 1.0, 0.0), Footprint::POINT);
    }

    #[test]
    fn tilted_plane_has_elliptical_footprint() {
        // Cosine 1/4: four times as long as wide, down the slope.
        let tilt = 0.25_f64.acos();
        let footprint = at(Lod::Aniso, 8.0 / 1024.0, tilt);
        assert!((footprint.level - 3.0).abs() < BOUND, "{footprint:?}");
        assert!(footprint.n_probes == 4 && footprint.along[0].abs() < BOUND);
        assert!((footprint.along[1].abs() - 32.0 / 1024.0).abs() < BOUND);
        assert!((at(Lod::Cone, 8.0 / 1024.0, tilt).level - 5.0).abs() < BOUND);
    }

    #[test]
    fn footprint_is_independent_of_scale_and_side() {
        for lod in [Lod::Cone, Lod::Aniso] {
            let cone = |width| Cone::of_pixel(width, 0.0, 0);
            let small = tilted(1.0);
            let footprint = Footprint::new(lod, &cone(0.5), DOWN, &small, UNIT, SIZE);
            let large = plane(small.edges.map(|e| e * 1024.0));
            assert_eq!(footprint, Footprint::new(lod, &cone(512.0), DOWN, &large, UNIT, SIZE));
            let behind = Footprint::new(lod, &cone(0.5), -DOWN, &small, UNIT, SIZE);
            assert_eq!((footprint.level, footprint.n_probes), (behind.level, behind.n_probes));
        }
    }

    #[test]
    fn grazing_planes_have_at_most_16_probes() {
        for tilt in [1.5, 1.57, std::f64::consts::FRAC_PI_2] {
            let footprint = at(Lod::Aniso, 8.0 / 1024.0, tilt);
            assert!(footprint.n_probes <= 16 && !footprint.level.is_nan(), "{footprint:?}");
        }
    }
}

// choice none
// No textures.

fn texel(slot: u32, lookup: TextureLookup) -> vec4<f32> {
    return vec4(1.0);
}

fn texel_alpha(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return 1.0;
}

fn uv_edges(slot: u32, lookup: TextureLookup) -> mat2x2<f32> {
    return mat2x2(vec2(0.0), vec2(0.0));
}

// choice lookup
// Texture lookup at a point, or averaged over the footprint of a ray. `?lod` gives the footprint, `?texels` the images.
// Formulas are those of the CPU. Coordinates are f32, so repeated textures lose precision far from the origin: 2^-23 of the
// coordinate.
// `?coordinates` are those of triangles, or also of curves.
// use ?lod
// use ?texels
// use ?coordinates
// use shared/invocation/iterations

/// A texture as used by a material.
struct Slot {
    /// Rows of the affine map from the mesh's coordinates to the texture's.
    u: vec3<f32>,
    /// Index of the texture's header in `images`.
    head: u32,
    v: vec3<f32>,
    /// Column of the coordinates in a vertex.
    column: u32,
}

/// The footprint over which a texture is averaged.
struct Footprint {
    /// Binary logarithm of the width in texels; 0 or less is a point.
    level: f32,
    /// From end to end, in texture coordinates.
    along: vec2<f32>,
    n_probes: u32,
}

@group(2) @binding(4) var<storage, read> slots: array<Slot>;
/// For each texture a header (number of levels; wrap modes, two bits each, then an sRGB flag and one for the nearest texel), followed by its levels (first
/// texel, columns, rows).
@group(2) @binding(5) var<storage, read> images: array<vec4<u32>>;

/// Texture value with alpha, in linear RGB or as plain numbers; ones for no texture.
fn texel(slot: u32, lookup: TextureLookup) -> vec4<f32> {
    if slot == NO_SLOT {
        return vec4(1.0);
    }
    let head = slots[slot].head;
    let level_0 = images[head + 1u];
    let ellipse = footprint(lookup, uv_edges(slot, lookup), vec2<f32>(level_0.yz));
    let uv = uv_of_lookup(slot, lookup);
    let n_levels = images[head].x;
    let level = clamp(ellipse.level, 0.0, f32(n_levels - 1u));
    let n = f32(ellipse.n_probes);
    var sum = vec4(0.0);
    iterations += ellipse.n_probes;
    for (var probe = 0u; probe < ellipse.n_probes; probe++) {
        let offset = (f32(probe) + 0.5) / n - 0.5;
        sum += trilinear(head, uv + offset * ellipse.along, level);
    }
    return sum / n;
}

/// Alpha at a point, at full resolution.
fn texel_alpha(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> f32 {
    return bilinear(slots[slot].head, 0u, uv_of_alpha(slot, corners, weights)).a;
}

/// Texture coordinates of a point.
fn uv_of(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> vec2<f32> {
    return weights.x * uv_at(slot, corners.x) + weights.y * uv_at(slot, corners.y) + weights.z * uv_at(slot, corners.z);
}

/// Changes of texture coordinates along the edges of a triangle.
fn uv_edges_of_triangle(slot: u32, lookup: TextureLookup) -> mat2x2<f32> {
    let first = uv_at(slot, lookup.vertices.x);
    return mat2x2(uv_at(slot, lookup.vertices.y) - first, uv_at(slot, lookup.vertices.z) - first);
}

/// The edges of a triangle in world space.
fn world_edges_of_triangle(lookup: TextureLookup) -> mat2x3<f32> {
    let found = edges(lookup.vertices);
    return mat2x3(vector_world(lookup.instance, found[0]), vector_world(lookup.instance, found[1]));
}

/// Texture coordinates of a vertex.
fn uv_at(slot: u32, vertex: u32) -> vec2<f32> {
    let first = vertex * STRIDE + slots[slot].column;
    let uv = vec3(vertices[first], vertices[first + 1u], 1.0);
    return vec2(dot(slots[slot].u, uv), dot(slots[slot].v, uv));
}

fn trilinear(head: u32, uv: vec2<f32>, level: f32) -> vec4<f32> {
    let finer = u32(level);
    let weight = level - floor(level);
    let fine = bilinear(head, finer, uv);
    if weight == 0.0 {
        return fine;
    }
    return fine + weight * (bilinear(head, finer + 1u, uv) - fine);
}

fn bilinear(head: u32, level: u32, uv: vec2<f32>) -> vec4<f32> {
    let facts = images[head].y;
    let image = images[head + 1u + level];
    var columns = neighbors(uv.x, image.y, facts & 3u);
    // `v` points up, rows go down.
    var rows = neighbors(1.0 - uv.y, image.z, (facts >> 2u) & 3u);
    let is_srgb = ((facts >> 4u) & 1u) == 1u;
    if (facts >> 5u) == 1u && level == 0u {
        columns.weight = step(0.5, columns.weight);
        rows.weight = step(0.5, rows.weight);
    }
    let upper = image.x + rows.first * image.y;
    let lower = image.x + rows.second * image.y;
    let top = blend(decoded(upper + columns.first, is_srgb), decoded(upper + columns.second, is_srgb), columns.weight);
    let bottom = blend(decoded(lower + columns.first, is_srgb), decoded(lower + columns.second, is_srgb), columns.weight);
    return blend(top, bottom, rows.weight);
}

/// `a` at weight 0, `b` at weight 1.
fn blend(a: vec4<f32>, b: vec4<f32>, weight: f32) -> vec4<f32> {
    return a + weight * (b - a);
}

/// The two texels next to a coordinate along one axis, and the weight of the second.
struct Neighbors {
    first: u32,
    second: u32,
    weight: f32,
}

const REPEAT: u32 = 0u;
const CLAMP: u32 = 1u;

fn neighbors(coordinate: f32, n: u32, wrap: u32) -> Neighbors {
    // Reduced first, to keep the integers small.
    var reduced = coordinate - 2.0 * floor(0.5 * coordinate);
    if wrap == REPEAT {
        reduced = coordinate - floor(coordinate);
    } else if wrap == CLAMP {
        reduced = clamp(coordinate, 0.0, 1.0);
    }
    let position = reduced * f32(n) - 0.5;
    let first = floor(position);
    return Neighbors(wrapped(i32(first), i32(n), wrap), wrapped(i32(first) + 1, i32(n), wrap), position - first);
}

/// Index of texel `i` in a row of `n` texels under a wrap mode; `i` is at most one outside of the period.
fn wrapped(i: i32, n: i32, wrap: u32) -> u32 {
    if wrap == REPEAT {
        return u32(select(select(i, 0, i >= n), n - 1, i < 0));
    }
    if wrap == CLAMP {
        return u32(clamp(i, 0, n - 1));
    }
    // The mirrored copy ends where the next starts: both neighbors of that edge are texel 0.
    return u32(select(min(i, 2 * n - 1 - i), 0, i < 0 || i >= 2 * n));
}

fn decoded(index: u32, is_srgb: bool) -> vec4<f32> {
    let word = texel_word(256u + index);
    let bytes = vec4(word & 0xffu, (word >> 8u) & 0xffu, (word >> 16u) & 0xffu, word >> 24u);
    let plain = vec4<f32>(bytes) / 255.0;
    if !is_srgb {
        return plain;
    }
    let red = bitcast<f32>(texel_word(bytes.x));
    let green = bitcast<f32>(texel_word(bytes.y));
    let blue = bitcast<f32>(texel_word(bytes.z));
    return vec4(red, green, blue, plain.a);
}

// choice coordinates/triangles
// Coordinates of triangles alone.

fn uv_of_lookup(slot: u32, lookup: TextureLookup) -> vec2<f32> {
    return uv_of(slot, lookup.vertices, lookup.weights);
}

fn uv_of_alpha(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> vec2<f32> {
    return uv_of(slot, corners, weights);
}

fn uv_edges(slot: u32, lookup: TextureLookup) -> mat2x2<f32> {
    return uv_edges_of_triangle(slot, lookup);
}

fn world_edges(lookup: TextureLookup) -> mat2x3<f32> {
    return world_edges_of_triangle(lookup);
}

// choice coordinates/curves
// Coordinates of triangles, and of curves along their strands and across; the first and the last vertex of a curve are equal.
// use shared/surface_curve/along

fn uv_of_lookup(slot: u32, lookup: TextureLookup) -> vec2<f32> {
    return uv_of_alpha(slot, lookup.vertices, lookup.weights);
}

fn uv_of_alpha(slot: u32, corners: vec3<u32>, weights: vec3<f32>) -> vec2<f32> {
    if corners.x != corners.z {
        return uv_of(slot, corners, weights);
    }
    // At least half a texel from the ends and edges of the strand: beyond, a texture that repeats is a mixture of both.
    let texels = vec2<f32>(images[slots[slot].head + 1u].yz);
    let per_u = max(max(abs(texels.x * slots[slot].u.x), abs(texels.y * slots[slot].v.x)), 1.0);
    let per_v = max(max(abs(texels.x * slots[slot].u.y), abs(texels.y * slots[slot].v.y)), 1.0);
    let margin = 0.5 / vec2(per_u, per_v);
    let uv = vec3(clamp(curve_uv, margin, 1.0 - margin), 1.0);
    return vec2(dot(slots[slot].u, uv), dot(slots[slot].v, uv));
}

fn uv_edges(slot: u32, lookup: TextureLookup) -> mat2x2<f32> {
    if lookup.vertices.x != lookup.vertices.z {
        return uv_edges_of_triangle(slot, lookup);
    }
    let u = slots[slot].u;
    let v = slots[slot].v;
    return mat2x2(vec2(u.x, v.x) * curve_part, vec2(u.y, v.y));
}

fn world_edges(lookup: TextureLookup) -> mat2x3<f32> {
    if lookup.vertices.x != lookup.vertices.z {
        return world_edges_of_triangle(lookup);
    }
    return mat2x3(curve_along, curve_width);
}

// part lod/square
// Square texture footprints.

/// As wide as the longer axis of the cone's footprint: `log2(√(texels per area of the triangle) · width / cosine)`.
fn square_footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    let n_texels_root = sqrt(abs(determinant(along)) * texels.x * texels.y);
    let cosine = abs(dot(lookup.winding, lookup.direction));
    // The lookup clamps both ends of the range; the logarithm only needs positive arguments.
    let width = log2(max(n_texels_root, 1e-30)) + log2(max(lookup.cone.width, 1e-30));
    return Footprint(width - log2(max(lookup.area_root, 1e-30)) - log2(max(cosine, 1e-30)), vec2(0.0), 1u);
}

// choice lod/none
// Bilinear lookup at full resolution.

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return Footprint(0.0, vec2(0.0), 1u);
}

// choice lod/cone
// Isotropic footprint from the ray cone.
// use shared/texture/lod/square

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return square_footprint(lookup, along, texels);
}

// choice lod/aniso
// Elliptic footprint from the ray cone, with an aspect ratio up to 16, where only mirrors lie between surface and camera.
// Square footprint after scattering.
// use shared/texture/lod/square

/// Maximum number of lookups along the longer axis.
const MAX_PROBES: f32 = 16.0;

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    if !lookup.cone.is_direct {
        return square_footprint(lookup, along, texels);
    }
    let cosine = dot(lookup.winding, lookup.direction);
    let edge_vectors = world_edges(lookup);
    let scale = 1.0 / max(lookup.area_root, 1e-18);
    let first = edge_vectors[0] * scale;
    let second = edge_vectors[1] * scale;
    // The longer axis follows the slope; at normal incidence all axes are equal.
    let slope = unit(lookup.direction - lookup.winding * cosine);
    let down = select(slope, unit(first), all(slope == vec3(0.0)));
    let long = (lookup.cone.width * scale / max(abs(cosine), 1e-4)) * down;
    let short = (lookup.cone.width * scale) * cross(lookup.winding, down);
    // Derivatives in texels along both axes, from plane coordinates by edges over the root of the area.
    let long_texels = change(long, first, second, lookup.winding, along) * texels;
    let short_texels = change(short, first, second, lookup.winding, along) * texels;
    return of_axes(long_texels, short_texels, texels);
}

/// Change of texture coordinates along a vector in the plane. It and the edges are in units of the root of twice the area.
fn change(v: vec3<f32>, first: vec3<f32>, second: vec3<f32>, normal: vec3<f32>, along: mat2x2<f32>) -> vec2<f32> {
    return along * vec2(dot(cross(v, second), normal), dot(cross(first, v), normal));
}

/// The ellipse with these conjugate diameters in texels.
fn of_axes(first: vec2<f32>, second: vec2<f32>, texels: vec2<f32>) -> Footprint {
    // Longer axes cover any texture, and their squares would overflow.
    let a = clamp(first, vec2(-1e9), vec2(1e9));
    let b = clamp(second, vec2(-1e9), vec2(1e9));
    // The squared axes are the eigenvalues of the sum of outer products; their product is that of the determinant.
    let xx = a.x * a.x + b.x * b.x;
    let xy = a.x * a.y + b.x * b.y;
    let yy = a.y * a.y + b.y * b.y;
    let half_gap = length(vec2(0.5 * (xx - yy), xy));
    let longest = sqrt(0.5 * (xx + yy) + half_gap);
    // The footprint is at least one texel. An ellipse longer than the probes can cover is widened, not cut off.
    let narrow = abs(a.x * b.y - a.y * b.x) / max(longest, 1e-30);
    let width = max(max(narrow, 1.0), longest / MAX_PROBES);
    if longest <= width {
        return Footprint(log2(max(longest, 1e-30)), vec2(0.0), 1u);
    }
    let axis = select(vec2(xy, 0.5 * (yy - xx) + half_gap), vec2(0.5 * (xx - yy) + half_gap, xy), xx >= yy);
    // Rounded, so that a circle needs one probe. Probes are then widened until they touch.
    let n_probes = floor(longest / width + 0.5);
    let level = log2(max(width, longest / n_probes));
    return Footprint(level, normalize(axis) * longest / texels, u32(n_probes));
}

// choice texels/one
// Texels in one binding: the sRGB table, one f32 per byte value, then all levels of all textures.

@group(2) @binding(6) var<storage, read> texels_0: array<u32>;

fn texel_word(index: u32) -> u32 {
    return texels_0[index];
}

// choice texels/four
// Texels in four bindings, for more data than one may hold: the sRGB table, one f32 per byte value, then all levels of all
// textures, split every `TEXELS_PER_BINDING`.
// const TEXELS_PER_BINDING

@group(2) @binding(6) var<storage, read> texels_0: array<u32>;
@group(2) @binding(7) var<storage, read> texels_1: array<u32>;
@group(2) @binding(8) var<storage, read> texels_2: array<u32>;
@group(2) @binding(9) var<storage, read> texels_3: array<u32>;

fn texel_word(index: u32) -> u32 {
    let within = index % TEXELS_PER_BINDING;
    switch index / TEXELS_PER_BINDING {
        case 0u: { return texels_0[within]; }
        case 1u: { return texels_1[within]; }
        case 2u: { return texels_2[within]; }
        default: { return texels_3[within]; }
    }
}

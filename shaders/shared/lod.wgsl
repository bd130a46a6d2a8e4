// part square
// Square texture footprints.

/// As wide as the longer axis of the cone's footprint: `log2(√(texels per area of the triangle) · width / cosine)`.
fn square_footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    let n_texels_root = sqrt(abs(determinant(along)) * texels.x * texels.y);
    let cosine = abs(dot(lookup.winding, lookup.direction));
    // The lookup clamps both ends of the range; the logarithm only needs positive arguments.
    let width = log2(max(n_texels_root, 1e-30)) + log2(max(lookup.cone.width, 1e-30));
    return Footprint(width - log2(max(lookup.area_root, 1e-30)) - log2(max(cosine, 1e-30)), vec2(0.0), 1u);
}

// choice none
// Bilinear lookup at full resolution.

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return Footprint(0.0, vec2(0.0), 1u);
}

// choice cone
// Isotropic footprint from the ray cone.
// use shared/lod/square

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    return square_footprint(lookup, along, texels);
}

// choice aniso
// Elliptic footprint from the ray cone, with an aspect ratio up to 16, where only mirrors lie between surface and camera.
// Square footprint after scattering.
// use shared/lod/square

/// Maximum number of lookups along the longer axis.
const MAX_PROBES: f32 = 16.0;

fn footprint(lookup: TextureLookup, along: mat2x2<f32>, texels: vec2<f32>) -> Footprint {
    if !lookup.cone.is_direct {
        return square_footprint(lookup, along, texels);
    }
    let cosine = dot(lookup.winding, lookup.direction);
    let edge_vectors = edges(lookup.vertices);
    let scale = 1.0 / max(lookup.area_root, 1e-18);
    let first = vector_world(lookup.instance, edge_vectors[0]) * scale;
    let second = vector_world(lookup.instance, edge_vectors[1]) * scale;
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

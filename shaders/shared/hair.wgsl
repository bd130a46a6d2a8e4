// Light that a hair scatters; twin of crates/renderer/src/bsdf/hair.rs, whose documentation has the model. In the frame of the BSDF x is along the hair.
//
// Differences of large numbers are written as products here: the exponent of a longitudinal lobe as a sum of squares, the cosine of a sampled elevation as its
// difference from 1, the smaller tail of the logistic distribution.
// use shared/numbers
// use shared/angle
// use shared/bsdf/scattering
// use shared/fiber
// use shared/invocation/iterations

/// The lobes for one direction to the viewer. Components stand for terms: reflected, transmitted, after an inner reflection, after more.
struct HairLobes {
    /// Azimuth of the viewer, of the normal relative to it, and the same inside.
    phi: f32,
    gamma: f32,
    gamma_inner: f32,
    /// Sines and cosines of elevations, tilted by the scales.
    sines: vec4<f32>,
    cosines: vec4<f32>,
    variances: vec4<f32>,
    /// Scale of the azimuthal logistic distributions.
    scale: f32,
    attenuations: array<vec3<f32>, 4>,
    /// How probable each term is in samples.
    probabilities: vec4<f32>,
}

/// Terms with a lobe of their own around the hair.
const N_LOBES: u32 = 3u;

/// Smaller densities are no samples.
const LEAST_DENSITY: f32 = 1e-30;

fn evaluate_hair(outgoing: vec3<f32>, incident: vec3<f32>) -> Evaluation {
    if outgoing.z < MIN_COSINE || abs(incident.z) < MIN_COSINE {
        return no_evaluation();
    }
    return evaluate_lobes(hair_lobes(outgoing), incident);
}

fn sample_hair(outgoing: vec3<f32>, square: vec2<f32>, choice: f32) -> BsdfSample {
    if outgoing.z < MIN_COSINE {
        return no_bsdf_sample();
    }
    let lobes = hair_lobes(outgoing);
    let incident = sample_lobes(lobes, square, choice);
    let found = evaluate_lobes(lobes, incident);
    if found.density < LEAST_DENSITY || abs(incident.z) < MIN_COSINE {
        return no_bsdf_sample();
    }
    return BsdfSample(incident, found.density, found.value / found.density, false, incident.z < 0.0, true);
}

fn hair_lobes(outgoing: vec3<f32>) -> HairLobes {
    var lobes: HairLobes;
    let b = fiber.roughness;
    let n = fiber.roughness_around;
    let root = 0.726 * b + 0.812 * b * b + 3.7 * high_power(b, 20u);
    let variance = max(root * root, 1e-6);
    lobes.variances = variance * vec4(1.0, 0.25, 4.0, 4.0);
    lobes.scale = max(0.626657069 * (0.265 * n + 1.194 * n * n + 5.372 * high_power(n, 22u)), 1e-3);
    let sine = clamp(outgoing.x, -1.0, 1.0);
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    // The normal is z: the azimuth of the viewer from it is the angle at which light meets the circle.
    lobes.phi = angle_of(outgoing.z, outgoing.y);
    lobes.gamma = lobes.phi - 0.5 * PI;
    let across_hair = max(length(outgoing.yz), 1e-18);
    let offset = -outgoing.y / across_hair;
    let ior = max(fiber.ior, 1.0001);
    let inner_sine = sine / ior;
    let inner_cosine = sqrt((1.0 - inner_sine) * (1.0 + inner_sine));
    // The index of refraction in the plane across the hair.
    let across = sqrt((ior - sine) * (ior + sine)) / max(cosine, 1e-9);
    let inner_offset = clamp(offset / across, -1.0, 1.0);
    let inner_depth = sqrt((1.0 - inner_offset) * (1.0 + inner_offset));
    lobes.gamma_inner = angle_of(inner_offset, inner_depth);
    let way = 2.0 * inner_depth / inner_cosine;
    let reflectance = hair_reflectance(cosine * outgoing.z / across_hair, ior);
    let passed = exp(-fiber.absorption * way);
    let first = (1.0 - reflectance) * (1.0 - reflectance) * passed;
    let second = first * passed * reflectance;
    let rest = second * passed * reflectance / max(1.0 - passed * reflectance, vec3(1e-7));
    lobes.attenuations = array<vec3<f32>, 4>(vec3(reflectance), first, second, rest);
    let sums = vec4(3.0 * reflectance, sum_of(first), sum_of(second), sum_of(rest));
    let bounded_sums = max(sums, vec4(1e-12));
    lobes.probabilities = bounded_sums / (bounded_sums.x + bounded_sums.y + bounded_sums.z + bounded_sums.w);
    for (var p = 0u; p < N_LOBES; p++) {
        let turned = circle(vec3(2.0, -1.0, -4.0)[p] * fiber.tilt_rad / TAU);
        lobes.sines[p] = sine * turned.x - cosine * turned.y;
        lobes.cosines[p] = abs(cosine * turned.x + sine * turned.y);
    }
    lobes.sines.w = sine;
    lobes.cosines.w = cosine;
    iterations += N_LOBES + 1u;
    return lobes;
}

/// The power 20 or 22.
fn high_power(x: f32, n: u32) -> f32 {
    let square = x * x;
    let fourth = square * square;
    let eighth = fourth * fourth;
    let sixteenth = eighth * eighth;
    return sixteenth * fourth * select(1.0, square, n == 22u);
}

fn sum_of(color: vec3<f32>) -> f32 {
    return color.x + color.y + color.z;
}

/// Azimuth after `p` inner paths, relative to the viewer.
fn turn_of(lobes: HairLobes, p: u32) -> f32 {
    return 2.0 * f32(p) * lobes.gamma_inner - 2.0 * lobes.gamma + f32(p) * PI;
}

/// Value times cosine, and density.
fn evaluate_lobes(all: HairLobes, incident: vec3<f32>) -> Evaluation {
    var lobes = all;
    let sine = clamp(incident.x, -1.0, 1.0);
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    let phi = angle_of(incident.z, incident.y) - lobes.phi;
    var sum = no_evaluation();
    iterations += N_LOBES + 2u;
    for (var p = 0u; p <= N_LOBES; p++) {
        var around = 0.5 / PI;
        if p < N_LOBES {
            around = trimmed_logistic(wrapped_angle(phi - turn_of(lobes, p)), lobes.scale);
        }
        let both = longitudinal(vec2(sine, cosine), vec2(lobes.sines[p], lobes.cosines[p]), lobes.variances[p]) * around;
        sum.value += lobes.attenuations[p] * both;
        sum.density += lobes.probabilities[p] * both;
    }
    return sum;
}

fn sample_lobes(all: HairLobes, square: vec2<f32>, choice: f32) -> vec3<f32> {
    var lobes = all;
    var p = 0u;
    var rest = choice;
    iterations += N_LOBES + 1u;
    for (var k = 0u; k < N_LOBES; k++) {
        if p == k && rest >= lobes.probabilities[k] {
            rest -= lobes.probabilities[k];
            p += 1u;
        }
    }
    // What is left of the choice is uniform again.
    rest = clamp(rest / lobes.probabilities[p], 0.0, 1.0);
    let variance = lobes.variances[p];
    // One minus the cosine of the angle from the mirrored elevation.
    let below = clamp(-variance * log(max(square.x, 1e-9) + (1.0 - square.x) * exp(-2.0 / variance)), 0.0, 2.0);
    let aside = sqrt(below * (2.0 - below)) * circle(square.y).x;
    let sine = clamp((below - 1.0) * lobes.sines[p] + aside * lobes.cosines[p], -1.0, 1.0);
    let cosine = sqrt((1.0 - sine) * (1.0 + sine));
    var turn = TAU * rest;
    if p < N_LOBES {
        // The part of the distribution in the tail that is nearer.
        let is_upper = rest > 0.5;
        let tail = exp(-PI / lobes.scale);
        let low = tail / (1.0 + tail);
        let part = clamp(low + select(rest, 1.0 - rest, is_upper) * (1.0 - 2.0 * low), 1e-12, 0.5);
        let angle = max(lobes.scale * log(part / (1.0 - part)), -PI);
        turn = turn_of(lobes, p) + select(angle, -angle, is_upper);
    }
    let turned = circle(wrapped_angle(lobes.phi + turn) / TAU);
    return vec3(sine, cosine * turned.x, cosine * turned.y);
}

/// Reflectance of a dielectric boundary from outside.
fn hair_reflectance(cosine: f32, ior: f32) -> f32 {
    let sine_square = (1.0 - cosine) * (1.0 + cosine);
    let inner = sqrt(max(1.0 - sine_square / (ior * ior), 0.0));
    let parallel = (ior * cosine - inner) / (ior * cosine + inner);
    let across = (cosine - ior * inner) / (cosine + ior * inner);
    return 0.5 * (parallel * parallel + across * across);
}

/// An angle moved into -pi..=pi.
fn wrapped_angle(angle: f32) -> f32 {
    return angle - TAU * round(angle / TAU);
}

/// The logistic distribution on -pi..=pi.
fn trimmed_logistic(x: f32, scale: f32) -> f32 {
    let e = exp(-abs(x) / scale);
    let tail = exp(-PI / scale);
    return e / (scale * (1.0 + e) * (1.0 + e)) * ((1.0 + tail) / (1.0 - tail));
}

/// The longitudinal lobe of a variance, for sines and cosines of both elevations.
fn longitudinal(incident: vec2<f32>, outgoing: vec2<f32>, variance: f32) -> f32 {
    let a = incident.y * outgoing.y / variance;
    let sines = incident.x + outgoing.x;
    let cosines = incident.y - outgoing.y;
    // The sum of the angles, from the difference of the cosine of it and 1.
    let exponent = -0.5 * (sines * sines + cosines * cosines) / variance;
    if variance <= 0.1 {
        return exp(exponent + scaled_log_i0(a)) / variance;
    }
    // With the factor of the exponential of a in the exponent.
    let edge = exp(-2.0 / variance);
    return exp(exponent + scaled_log_i0(a)) / (variance * (1.0 - edge));
}

/// The logarithm of the modified Bessel function of the first kind and order 0, less its argument.
fn scaled_log_i0(x: f32) -> f32 {
    if x > 12.0 {
        return 0.5 * (1.0 / (4.0 * x) - log(TAU * x));
    }
    let quarter = 0.25 * x * x;
    var sum = 1.0;
    var term = 1.0;
    iterations += 32u;
    for (var k = 1u; k < 32u; k++) {
        term *= quarter / f32(k * k);
        sum += term;
    }
    return log(sum) - x;
}

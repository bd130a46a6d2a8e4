// Surface areas that round alike on all devices.
// use shared/build/slice

/// Half the surface area of a box. Products are stored, so that no compiler fuses them with the sum.
fn half_area_of(low: vec3<f32>, high: vec3<f32>) -> f32 {
    let size = high - low;
    let products = stored(vec3<f32>((size.x + size.z) * size.y, size.z * size.x, 0.0));
    return products.x + products.y;
}

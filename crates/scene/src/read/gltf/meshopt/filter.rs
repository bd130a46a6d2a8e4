//! The filters: what decoded elements are made of. Results are rounded to nearest; the reference decoder's differ by 1 where
//! it uses approximate instructions.

/// Replaces elements of `N` components of `B` bytes.
fn replace<T: Copy, const B: usize, const N: usize>(
    bytes: &mut [u8],
    from: fn([u8; B]) -> T,
    to: fn(T) -> [u8; B],
    filter: impl Fn([T; N]) -> [T; N],
) {
    for element in bytes.as_chunks_mut::<B>().0.as_chunks_mut::<N>().0 {
        *element = filter(element.map(from)).map(to);
    }
}

/// Unit vectors of normalized 8-bit integers; the fourth component is kept.
pub(super) fn octahedral_8(bytes: &mut [u8]) {
    replace(bytes, i8::from_le_bytes, i8::to_le_bytes, |[x, y, z, w]: [i8; 4]| {
        let [x, y, z] = octahedral([x, y, z].map(f32::from), f32::from(i8::MAX)).map(|x| x as i8);
        [x, y, z, w]
    });
}

/// Unit vectors of normalized 16-bit integers; the fourth component is kept.
pub(super) fn octahedral_16(bytes: &mut [u8]) {
    replace(bytes, i16::from_le_bytes, i16::to_le_bytes, |[x, y, z, w]: [i16; 4]| {
        let [x, y, z] = octahedral([x, y, z].map(f32::from), f32::from(i16::MAX)).map(|x| x as i16);
        [x, y, z, w]
    });
}

/// The unit vector times `max` of a point `x`, `y` on an unfolded octahedron, whose size is `one`.
fn octahedral([x, y, one]: [f32; 3], max: f32) -> [f32; 3] {
    let z = one - x.abs() - y.abs();
    // The lower half is folded outward.
    let fold = z.min(0.0);
    let unfolded = |x: f32| if x >= 0.0 { x + fold } else { x - fold };
    let [x, y] = [x, y].map(unfolded);
    let scale = max / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|x| (x * scale).round())
}

/// Unit quaternions of normalized 16-bit integers, whose largest component is not stored.
pub(super) fn quaternion(bytes: &mut [u8]) {
    replace(bytes, i16::from_le_bytes, i16::to_le_bytes, |[x, y, z, last]: [i16; 4]| {
        // The two lowest bits are the number of that component, the others the scale.
        let (largest, one) = ((last & 3) as usize, f32::from(last | 3));
        let scale = f32::from(i16::MAX) / std::f32::consts::SQRT_2 / one;
        let stored = [x, y, z].map(f32::from);
        let rest = 2.0 * one * one - stored.iter().map(|x| x * x).sum::<f32>();
        let mut quaternion = [(rest.max(0.0).sqrt() * scale).round() as i16; 4];
        for (k, x) in (1..).zip(stored) {
            quaternion[(largest + k) % 4] = (x * scale).round() as i16;
        }
        quaternion
    });
}

/// Numbers of 32 bits: a signed exponent of 8 bits above a signed mantissa of 24 bits.
pub(super) fn exponential(bytes: &mut [u8]) {
    replace(bytes, i32::from_le_bytes, i32::to_le_bytes, |[word]: [i32; 1]| {
        let power = f32::from_bits((((word >> 24) + 127) as u32) << 23);
        let mantissa = (word << 8 >> 8) as f32;
        [(power * mantissa).to_bits().cast_signed()]
    });
}

/// Colors of normalized 8-bit integers.
pub(super) fn color_8(bytes: &mut [u8]) {
    replace(bytes, u8::from_le_bytes, u8::to_le_bytes, |[y, co, cg, a]: [u8; 4]| {
        color([y.into(), co.cast_signed().into(), cg.cast_signed().into(), a.into()], u8::MAX.into()).map(|x| x as u8)
    });
}

/// Colors of normalized 16-bit integers.
pub(super) fn color_16(bytes: &mut [u8]) {
    replace(bytes, u16::from_le_bytes, u16::to_le_bytes, |[y, co, cg, a]: [u16; 4]| {
        color([y.into(), co.cast_signed().into(), cg.cast_signed().into(), a.into()], u16::MAX.into()).map(|x| x as u16)
    });
}

/// Red, green, blue and alpha up to `max` of a luma, two chromas and an alpha, whose highest set bit gives the scale of all.
fn color([y, co, cg, a]: [i32; 4], max: f32) -> [f32; 4] {
    let one = ((1_u32 << (32 - a.leading_zeros())) - 1) as i32;
    let alpha = (a << 1 & one) | (a & 1);
    let scale = max / one as f32;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|x| (x as f32 * scale).round())
}

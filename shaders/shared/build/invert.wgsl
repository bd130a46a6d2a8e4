// The inverse of an affine map, with the CPU's operations in the CPU's order, each rounded to f64: the CPU's bits, but for the signs
// of zeros.
//
// Numbers are f32, so products of two are exact, and no operation leaves the range of f64.
// use shared/exact/number

/// Rows of an inverse, translations last. It is not sound if the map is singular, or if an entry is at least 2^MOST_BITS.
struct Inverted {
    rows: array<array<Number, 4>, 3>,
    is_sound: bool,
}

/// Entries up to this power of two are f32, and so are sums of three.
const MOST_BITS: i32 = 100;

/// `1 / a` of a number that is not zero, not rounded.
fn inverse_of(a: Number) -> Number {
    // 2^126 over the mantissa, bit by bit: the remainder is below it.
    var rest = vec2<u32>(0x80000000u, 0u);
    var quotient = vec2<u32>(0u);
    if a.high == 0x80000000u && a.low == 0u {
        rest = vec2<u32>(0u);
        quotient = vec2<u32>(0u, 1u);
    }
    for (var bit = 0u; bit < 63u; bit++) {
        let carry = rest.x >> 31u;
        rest = vec2<u32>((rest.x << 1u) | (rest.y >> 31u), rest.y << 1u);
        quotient = vec2<u32>((quotient.x << 1u) | (quotient.y >> 31u), quotient.y << 1u);
        if carry != 0u || rest.x > a.high || (rest.x == a.high && rest.y >= a.low) {
            rest = vec2<u32>(rest.x - a.high - u32(rest.y < a.low), rest.y - a.low);
            quotient.y |= 1u;
        }
    }
    quotient.y |= u32((rest.x | rest.y) != 0u);
    return normalized(quotient, -126 - a.exponent, a.is_negative);
}

/// `a b - c d` of f32.
fn difference_of_products(a: Number, b: Number, c: Number, d: Number) -> Number {
    return as_f64(added(multiplied(a, b), negated(multiplied(c, d))));
}

fn crossed(p: array<Number, 3>, q: array<Number, 3>) -> array<Number, 3> {
    return array<Number, 3>(
        difference_of_products(p[1], q[2], p[2], q[1]),
        difference_of_products(p[2], q[0], p[0], q[2]),
        difference_of_products(p[0], q[1], p[1], q[0]),
    );
}

/// The product of an f32 and an f64.
fn product_of(a: Number, b: Number) -> Number {
    return as_f64(multiplied(a, b));
}

fn dotted(p: array<Number, 3>, q: array<Number, 3>) -> Number {
    let two = as_f64(added(product_of(p[0], q[0]), product_of(p[1], q[1])));
    return as_f64(added(two, product_of(p[2], q[2])));
}

/// The inverse of the map with these columns.
fn inverted(a: array<Number, 3>, b: array<Number, 3>, c: array<Number, 3>, origin: array<Number, 3>) -> Inverted {
    var inverse: Inverted;
    var rows = array<array<Number, 3>, 3>(crossed(b, c), crossed(c, a), crossed(a, b));
    let determinant = dotted(a, rows[0]);
    inverse.is_sound = determinant.high != 0u;
    if !inverse.is_sound {
        return inverse;
    }
    let scale = as_f64(inverse_of(determinant));
    for (var k = 0u; k < 3u; k++) {
        for (var j = 0u; j < 3u; j++) {
            let entry = product_of(rows[k][j], scale);
            rows[k][j] = entry;
            inverse.rows[k][j] = entry;
            // The highest bit of the mantissa is worth 2^(63 + exponent).
            inverse.is_sound = inverse.is_sound && (entry.high == 0u || entry.exponent + 64 <= MOST_BITS);
        }
        inverse.rows[k][3] = negated(dotted(rows[k], origin));
    }
    return inverse;
}

/// The words of an f64, the lower half first; zero below its normal numbers.
fn f64_words(a: Number) -> vec2<u32> {
    let biased = a.exponent + (63 + 1023);
    if a.high == 0u || biased <= 0 {
        return vec2<u32>(0u);
    }
    let high = (u32(a.is_negative) << 31u) | (u32(biased) << 20u) | ((a.high >> 11u) & 0xfffffu);
    return vec2<u32>((a.high << 21u) | (a.low >> 11u), high);
}

/// The bits of the nearest f32 of a number below 2^MOST_BITS.
fn f32_word(a: Number) -> u32 {
    let b = as_f32(a);
    if b.high == 0u {
        return 0u;
    }
    let biased = b.exponent + (63 + 127);
    let sign = u32(b.is_negative) << 31u;
    if biased > 0 {
        return sign | (u32(biased) << 23u) | ((b.high >> 8u) & 0x7fffffu);
    }
    return sign | (b.high >> u32(9 - biased));
}

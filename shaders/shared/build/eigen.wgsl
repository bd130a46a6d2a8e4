// Principal axes: eigenvectors of symmetric matrices.
// use shared/build/frame

/// Maximum number of sweeps. Convergence is quadratic.
const MAX_SWEEPS: u32 = 6u;

/// Relative off-diagonal entry that counts as zero: the precision of `f32`.
const COUPLING: f32 = 2.4e-7;

/// Squared off-diagonal entry that counts as zero for entries near one.
const NEGLIGIBLE: f32 = 1e-30;

/// A symmetric matrix during diagonalization. Entry k of `coupling` is the off-diagonal entry of the two axes other than k.
struct Diagonalization {
    diagonal: vec3<f32>,
    coupling: vec3<f32>,
    axes: mat3x3<f32>,
}

/// Rotates axes p and q about axis r so that their off-diagonal entry becomes zero (Jacobi 1846).
fn jacobi_rotation(given: Diagonalization, p: u32, q: u32, r: u32) -> Diagonalization {
    var before = given;
    var rotated = given;
    let coupled = before.coupling[r];
    if coupled * coupled <= COUPLING * COUPLING * abs(before.diagonal[p] * before.diagonal[q]) + NEGLIGIBLE {
        return rotated;
    }
    let difference = before.diagonal[q] - before.diagonal[p];
    let twice = 2.0 * coupled;
    let adjacent = abs(difference) + sqrt(difference * difference + twice * twice);
    let opposite = select(twice, -twice, difference < 0.0);
    let hypotenuse = sqrt(adjacent * adjacent + opposite * opposite);
    if !(hypotenuse > 1e-15) {
        return rotated;
    }
    let cosine = adjacent / hypotenuse;
    let sine = opposite / hypotenuse;
    let change = opposite / adjacent * coupled;
    rotated.diagonal[p] -= change;
    rotated.diagonal[q] += change;
    rotated.coupling[r] = 0.0;
    let with_p = before.coupling[q];
    let with_q = before.coupling[p];
    rotated.coupling[q] = cosine * with_p - sine * with_q;
    rotated.coupling[p] = sine * with_p + cosine * with_q;
    rotated.axes[p] = cosine * before.axes[p] - sine * before.axes[q];
    rotated.axes[q] = sine * before.axes[p] + cosine * before.axes[q];
    return rotated;
}

/// Orthonormal eigenvectors of a matrix with entries near one, the longest axis first. `diagonal` is xx, yy, zz; `coupling` is
/// yz, xz, xy.
fn principal_axes(diagonal: vec3<f32>, coupling: vec3<f32>) -> mat3x3<f32> {
    var rotated = Diagonalization(diagonal, coupling, mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0));
    for (var sweep = 0u; sweep < MAX_SWEEPS; sweep++) {
        rotated = jacobi_rotation(rotated, 0u, 1u, 2u);
        rotated = jacobi_rotation(rotated, 0u, 2u, 1u);
        rotated = jacobi_rotation(rotated, 1u, 2u, 0u);
    }
    let values = rotated.diagonal;
    let x_first = values.x >= values.y && values.x >= values.z;
    let y_first = !x_first && values.y >= values.z;
    if x_first {
        let y_second = values.y >= values.z;
        return axes_along(rotated.axes[0], select(rotated.axes[2], rotated.axes[1], y_second));
    }
    if y_first {
        return axes_along(rotated.axes[1], select(rotated.axes[2], rotated.axes[0], values.x >= values.z));
    }
    return axes_along(rotated.axes[2], select(rotated.axes[1], rotated.axes[0], values.x >= values.y));
}

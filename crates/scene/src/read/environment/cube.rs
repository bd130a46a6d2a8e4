//! Cube maps of OpenEXR as images of longitude and latitude.
//!
//! Source: OpenEXR, `ImfEnvmap.h` and `ImfEnvmap.cpp`: six squares from top to bottom, +x, -x, +y, -y, +z, -z, whose outer texels lie on
//! the edges of the cube.

use std::f64::consts::{PI, TAU};

use super::Texels;

/// The image of longitude and latitude of about the same resolution, in which the sides lie where their axes point to.
pub(super) fn unfolded(cube: &Texels) -> Result<Texels, String> {
    let side = cube.width.min(cube.height / 6) as usize;
    if side == 0 {
        return Err(format!("a cube map of {} x {} has no sides", cube.width, cube.height));
    }
    let (width, height) = (4 * side, 2 * side);
    let mut list = Vec::with_capacity(width * height);
    for row in 0..height {
        let (sine, cosine) = (PI * (row as f64 + 0.5) / height as f64).sin_cos();
        for column in 0..width {
            // The middle of the image is towards -z, its right half towards +x.
            let (s, c) = (TAU * ((column as f64 + 0.5) / width as f64 - 0.5)).sin_cos();
            list.push(lookup(cube, side, [sine * s, cosine, -sine * c]));
        }
    }
    Ok(Texels { width: width as u32, height: height as u32, list })
}

/// The color in a direction, interpolated within a side.
fn lookup(cube: &Texels, side: usize, direction: [f64; 3]) -> [f32; 3] {
    let [x, y, z] = direction;
    let axis = (0..3).fold(0, |most, k| if direction[k].abs() > direction[most].abs() { k } else { most });
    let is_negative = direction[axis] < 0.0;
    let last = (side - 1) as f64;
    // Position in the side, by its two other axes.
    let at = |x: f64| (x / direction[axis].abs() + 1.0) / 2.0 * last;
    // Column from the left, row from the top.
    let (across, down) = match (axis, is_negative) {
        (0, false) => (at(z), last - at(y)),
        (0, true) => (last - at(z), last - at(y)),
        (1, false) => (at(x), last - at(z)),
        (1, true) => (at(x), at(z)),
        (_, false) => (last - at(x), last - at(y)),
        (_, true) => (at(x), last - at(y)),
    };
    let first_row = (2 * axis + usize::from(is_negative)) * side;
    let neighbors = |at: f64| {
        let at = at.clamp(0.0, last);
        let first = at.floor() as usize;
        (first, (first + 1).min(side - 1), (at - at.floor()) as f32)
    };
    let ((left, right, along), (top, bottom, below)) = (neighbors(across), neighbors(down));
    let texel = |row: usize, column: usize| cube.list[(first_row + row) * cube.width as usize + column];
    let mix = |a: [f32; 3], b: [f32; 3], part: f32| std::array::from_fn(|k| a[k] + part * (b[k] - a[k]));
    let upper = mix(texel(top, left), texel(top, right), along);
    let lower = mix(texel(bottom, left), texel(bottom, right), along);
    mix(upper, lower, below)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corner directions of the first and last texel of each side and of the one right of the first, computed by hand from the table of
    /// `ImfEnvmap.h`: the position in a side is (y, z), (x, z) or (x, y), and the picture of a side turns or mirrors it.
    const CORNERS: [[[i8; 3]; 3]; 6] = [
        [[1, 1, -1], [1, -1, 1], [1, 1, 1]],
        [[-1, 1, 1], [-1, -1, -1], [-1, 1, -1]],
        [[-1, 1, 1], [1, 1, -1], [1, 1, 1]],
        [[-1, -1, -1], [1, -1, 1], [1, -1, -1]],
        [[1, 1, 1], [-1, -1, 1], [-1, 1, 1]],
        [[-1, 1, -1], [1, -1, -1], [1, 1, -1]],
    ];

    /// A cube map in which each texel has its direction as color.
    fn directions(side: usize) -> Texels {
        let last = (side - 1) as f64;
        let mut list = Vec::new();
        for corners in CORNERS {
            for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
                let [first, end, right] = corners.map(|corner| corner.map(f64::from));
                let (u, v) = (column as f64 / last, row as f64 / last);
                list.push(std::array::from_fn(|k| {
                    (first[k] + u * (right[k] - first[k]) + v * (end[k] - right[k])) as f32
                }));
            }
        }
        Texels { width: side as u32, height: 6 * side as u32, list }
    }

    #[test]
    fn each_direction_has_its_color() {
        let image = unfolded(&directions(9)).unwrap();
        assert_eq!((image.width, image.height), (36, 18));
        for (k, color) in image.list.iter().enumerate() {
            let theta = PI * ((k / 36) as f64 + 0.5) / 18.0;
            let phi = TAU * (((k % 36) as f64 + 0.5) / 36.0 - 0.5);
            let want = [theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos()];
            // The color is linear in a side, so interpolation gives the direction scaled onto the cube.
            let scale = want.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            for (got, want) in color.iter().zip(want) {
                assert!((f64::from(*got) * scale - want).abs() < 1e-6, "{k}: {color:?}");
            }
        }
    }

    #[test]
    fn the_smallest_cube_and_none() {
        let list = (0..6).map(|k| [k as f32; 3]).collect();
        let image = unfolded(&Texels { width: 1, height: 6, list }).unwrap();
        assert_eq!((image.width, image.height), (4, 2));
        assert!(unfolded(&Texels { width: 4, height: 5, list: vec![[0.0; 3]; 20] }).is_err());
    }
}

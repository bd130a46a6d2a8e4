//! The boxes of children of oriented nodes as devices read them, with a frame of 32 bits: `shared/bvh/node_kinds/any`.
//!
//! On the CPU a child has nine numbers for its frame. Here a frame is rounded to one of 2^32, and the box of a child becomes the smallest
//! one in that frame around its old box.

use canted_obb::vector::{cross, dot};

/// As in `shared/frame`: steps of the components of a quaternion, and its real component.
const STEP: f32 = 1.0 / 2048.0;
const REAL: f32 = 2470.0 * STEP;

/// Roundings of a box in `f64`, relative to its terms: less than 30.
const ROUNDINGS: f64 = 32.0 * f64::EPSILON;

/// Three slabs, each of which is a row, a center along it and a half-extent.
pub(super) type Slabs = [[f32; 5]; 3];

/// A child's box: the frame, and for each of its rows the center and the half-extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PackedBox {
    pub(super) frame: u32,
    pub(super) ends: [[f32; 2]; 3],
}

/// A box with rows of unit length around one of a device.
///
/// A row errs by half of 2^-24 in each component, so along it a point of the box moves by less than 1.2 · 2^-24 of the sum of its coordinates
/// along all three rows; the division and the rounding of center and half-extent take as much again.
pub(super) fn unit_slabs(frame: u32, ends: [[f32; 2]; 3]) -> Slabs {
    let rows = rows_of(frame).map(|row| row.map(f64::from));
    let unit = 1.0 / dot(rows[0], rows[0]).sqrt();
    let size: f64 = ends.iter().map(|[center, half]| f64::from(center.abs() + half.abs())).sum();
    std::array::from_fn(|k| {
        let [x, y, z] = rows[k].map(|x| (x * unit) as f32);
        let [center, half] = ends[k].map(|x| f64::from(x) * unit);
        [x, y, z, center as f32, (half + 4.0 * f64::from(f32::EPSILON) * size) as f32]
    })
}

/// A box that no ray enters.
pub(super) const NOWHERE: PackedBox = PackedBox { frame: 0, ends: [[0.0, -9.223_372e18]; 3] };

impl PackedBox {
    /// A box around another one of a scene whose coordinates are at most `reach`.
    ///
    /// A point of the old box has coordinates along its rows within the half-extents of the centers. The inverse of the rows takes these
    /// to the point, and the new rows take that to the new coordinates: `w` takes one to the other. Bounds that exceed those of the
    /// scene, which no content does, are replaced by them; this also bounds boxes of rows without an inverse.
    pub(super) fn around(slabs: &Slabs, reach: f32) -> Self {
        let old = slabs.map(|slab| [0, 1, 2].map(|k| f64::from(slab[k])));
        let columns = [cross(old[1], old[2]), cross(old[2], old[0]), cross(old[0], old[1])];
        let determinant = dot(old[0], columns[0]);
        let frame = nearest(&old, determinant);
        let ends = rows_of(frame).map(|row| {
            let row = row.map(f64::from);
            let most = (row[0].abs() + row[1].abs() + row[2].abs()) * f64::from(reach) * (1.0 + ROUNDINGS);
            let (mut center, mut half, mut size) = (0.0, 0.0, 0.0);
            for (column, slab) in columns.iter().zip(slabs) {
                let w = dot(row, *column) / determinant;
                center += w * f64::from(slab[3]);
                half += w.abs() * f64::from(slab[4]);
                // The terms of the dot products, whose rows are no longer than 1.
                size += f64::from(slab[3].abs()) + f64::from(slab[4]);
            }
            half += ROUNDINGS * size;
            // `max` and `min` skip NaN.
            rounded_out((center - half).max(-most), (center + half).min(most))
        });
        Self { frame, ends }
    }
}

/// A center and a half-extent around an interval.
fn rounded_out(low: f64, high: f64) -> [f32; 2] {
    let center = (0.5 * (low + high)) as f32;
    let half = (high - f64::from(center)).max(f64::from(center) - low);
    [center, ((half * (1.0 + ROUNDINGS)) as f32).next_up()]
}

/// The frame nearest to the axes of a box, whose order and directions do not matter: of all that differ in these, the one nearest to no
/// rotation.
fn nearest(rows: &[[f64; 3]; 3], determinant: f64) -> u32 {
    let is_mirrored = determinant < 0.0;
    let (mut most, mut sines) = (0.0, [0.0; 3]);
    for order in 0..6 {
        // The first three orders are even.
        let first = order % 3;
        let second = (first + if order < 3 { 1 } else { 2 }) % 3;
        let [x, y, z] = [rows[first], rows[second], rows[3 - first - second]];
        let diagonal = [x[0], y[1], z[2]];
        let mut signs = diagonal.map(|x| if x < 0.0 { -1.0 } else { 1.0 });
        if (signs[0] * signs[1] * signs[2] < 0.0) != (is_mirrored != (order >= 3)) {
            let least = (1..3).fold(0, |least, k| if diagonal[k].abs() < diagonal[least].abs() { k } else { least });
            signs[least] = -signs[least];
        }
        let trace = dot(signs, diagonal);
        if trace > most {
            most = trace;
            let sine = |[a, i]: [usize; 2], [b, j]: [usize; 2]| signs[a] * [x, y, z][a][i] - signs[b] * [x, y, z][b][j];
            sines = [sine([2, 1], [1, 2]), sine([0, 2], [2, 0]), sine([1, 0], [0, 1])];
        }
    }
    let steps = sines.map(|sine| sine / (1.0 + most) * f64::from(REAL / STEP));
    let whole = |steps: f64, least: f64, most: f64| (steps.clamp(least, most).round() as i32).cast_unsigned();
    let [a, b] = [0, 1].map(|k| whole(steps[k], -1023.0, 1023.0));
    // Odd where b is negative.
    let half_of_c = whole(0.5 * (steps[2] - f64::from(b >> 31)), -512.0, 511.0);
    let [a_steps, b_steps, c_steps] = [a, b, half_of_c << 1 | b >> 31].map(u32::cast_signed);
    if 2470 * 2470 + a_steps * a_steps + b_steps * b_steps + c_steps * c_steps > 1 << 23 {
        // Of axes that are far from orthogonal: rows would be longer than 1. The box is around the old one in any frame.
        return 0;
    }
    (a & 0x7ff) | (b & 0x7ff) << 11 | half_of_c << 22
}

/// The rows of a frame, without rounding.
fn rows_of(frame: u32) -> [[f32; 3]; 3] {
    // Eleven bits each, up to bit 11, 22 and 32.
    let [a, b, c] = [21, 10, 0].map(|above| ((frame << above).cast_signed() >> 21) as f32 * STEP);
    let rest = 0.5 * ((REAL * REAL - a * a) - (b * b + c * c));
    [
        [rest + a * a, a * b - REAL * c, a * c + REAL * b],
        [a * b + REAL * c, rest + b * b, b * c - REAL * a],
        [a * c - REAL * b, b * c + REAL * a, rest + c * c],
    ]
}

#[cfg(test)]
mod tests {
    use canted_fixtures::{Hair, Mesh, SplitMix64, Strand, hair, scaffold_of, slivers};
    use canted_wide::{Config, Costs, TriangleBvh};

    use canted_wide::RawBvh;

    use super::super::layout::{EMPTY, LEAF, WIDTH};
    use super::super::leaf_triangles::UploadedBvh;
    use super::super::octants::by_octants;
    use super::super::packed::{children, first_word, is_oriented, nodes_below, packed, unpacked};
    use super::*;

    /// Words of an oriented node, and the rows with its frames and with centers and half-extents.
    const NODE: usize = 64;
    const FRAMES: usize = 1;
    const ENDS: usize = 2;

    /// The matrix by integers, in units of 2^-23.
    fn whole_rows(frame: u32) -> [[i32; 3]; 3] {
        let signed = |shift: u32| {
            let field = (frame >> shift & 0x7ff).cast_signed();
            if field < 1024 { field } else { field - 2048 }
        };
        let [w, x, y, z] = [2470, signed(0), signed(11), signed(21)];
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    }

    fn random_rotation(random: &mut SplitMix64) -> [[f64; 3]; 3] {
        let mut vector = || [0; 3].map(|_| random.below(2001) as f64 / 1000.0 - 1.0);
        let unit = |v: [f64; 3]| v.map(|x| x / dot(v, v).sqrt().max(1e-9));
        let x = unit(vector());
        let z = unit(cross(x, vector()));
        [x, cross(z, x), z]
    }

    #[test]
    fn rows_have_no_rounding() {
        let mut random = SplitMix64::new(3);
        let ends = [0x3ff, 0x400, 0x401, 0x3ff << 11, 0x400 << 11, 0x3ff << 21, 0x400 << 21, u32::MAX];
        let others = (0..100_000).map(|_| random.below(1 << 32) as u32).collect::<Vec<_>>();
        for frame in ends.into_iter().chain(others) {
            let expected = whole_rows(frame).map(|row| row.map(|x| x as f32 / 8_388_608.0));
            assert!(whole_rows(frame).as_flattened().iter().all(|x| x.abs() < 1 << 24));
            assert_eq!(rows_of(frame), expected, "{frame:#x}");
        }
    }

    /// Axes in any order and direction get a frame within a thousandth of them, whose rows are not longer than 1.
    #[test]
    fn a_frame_is_near_the_axes() {
        let mut random = SplitMix64::new(4);
        let mut farthest = 0.0_f64;
        for _ in 0..100_000 {
            let [mut x, y, mut z] = random_rotation(&mut random);
            if random.below(2) == 0 {
                (x, z) = (z.map(|z| -z), x);
            }
            if random.below(2) == 0 {
                x = x.map(|x| -x);
            }
            let old = [y, x, z];
            let rows = rows_of(nearest(&old, dot(old[0], cross(old[1], old[2])))).map(|row| row.map(f64::from));
            for row in rows {
                let length = dot(row, row).sqrt();
                assert!((0.72..=1.0).contains(&length), "{length}");
                let sine = |axis: &[f64; 3]| dot(cross(row, *axis), cross(row, *axis)).sqrt() / length;
                farthest = farthest.max(old.iter().map(sine).fold(1.0, f64::min));
            }
        }
        // Half a step of two components and at most 1.1 of the third, twice, since a rotation is by twice the angle of its quaternion.
        assert!(farthest < 2.0 * (0.25 + 0.25 + 1.21_f64).sqrt() / 2470.0 && farthest > 5e-4, "{farthest}");
    }

    /// Records of others may have axes that are far from orthogonal: no row gets longer than 1, as one of the nearest frame of these would.
    #[test]
    fn skewed_axes_get_no_longer_rows() {
        let axis = |[x, y, z]: [f64; 3]| [x, y, z].map(|k| k / 3.0_f64.sqrt());
        let old = [axis([1.0, 1.0, -1.0]), axis([1.0, -1.0, -1.0]), axis([1.0, -1.0, 1.0])];
        let frame = nearest(&old, dot(old[0], cross(old[1], old[2])));
        let square_of = |rows: [[f32; 3]; 3]| rows[0].map(f64::from).iter().map(|x| x * x).sum::<f64>();
        assert!(square_of(rows_of(frame)) <= 1.0);
        assert!(square_of(rows_of(0x401 | 0x401 << 11 | 0x200 << 22)) > 1.0);
    }

    /// A vertex of a triangle outside of a box above it, in a BVH of a device.
    fn flaw(bvh: &UploadedBvh<'_>) -> Option<String> {
        let nodes = &bvh.words.nodes;
        let mut waiting: Vec<(u32, Vec<(u32, usize)>)> = vec![(bvh.words.root, vec![])];
        while let Some((word, above)) = waiting.pop() {
            if word & LEAF != 0 {
                let (first, n) = ((word & 0x03ff_ffff) as usize, (word >> 26 & 31) as usize + 1);
                for quad in bvh.triangles[first..first + n].as_flattened() {
                    let point = [0, 1, 2].map(|k| f64::from(f32::from_bits(quad[k])));
                    for &(node, child) in &above {
                        let at = first_word(node) + child;
                        let end = |row: usize| f64::from(f32::from_bits(nodes[at + (ENDS + row) * WIDTH]));
                        // Products have no rounding, and sums less than the pads of the boxes.
                        let rows =
                            whole_rows(nodes[at + FRAMES * WIDTH]).map(|row| row.map(|x| f64::from(x) / 8_388_608.0));
                        if let Some(k) = (0..3).find(|&k| (dot(rows[k], point) - end(2 * k)).abs() > end(2 * k + 1)) {
                            return Some(format!(
                                "{point:?} is outside of child {child} of node {node:#x} along axis {k}"
                            ));
                        }
                    }
                }
                continue;
            }
            for (child, below) in children(nodes, word).into_iter().enumerate().filter(|(_, below)| *below != EMPTY) {
                let mut above = above.clone();
                if is_oriented(word) {
                    above.push((word, child));
                }
                waiting.push((below, above));
            }
        }
        None
    }

    fn needles() -> [Mesh; 4] {
        let tubes = Hair { n_strands: 40, n_segments: 8, width: 0.0006, strand: Strand::Tube };
        let far = |mesh: Mesh| Mesh {
            positions: mesh.positions.iter().map(|p| p.map(|x| x * 1e-3 + 700.0)).collect(),
            ..mesh
        };
        [hair(3, &tubes), scaffold_of(1, true, 3), slivers(9, 600), far(slivers(10, 600))]
    }

    fn oriented(mesh: &Mesh) -> TriangleBvh {
        let costs = Costs { aligned_node: 1.0, oriented_node: 0.5, leaf: 0.5, block: 0.1, max_leaf: 4 };
        TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config { costs, ..Config::default() }).unwrap()
    }

    #[test]
    fn boxes_hold_their_triangles() {
        for (number, mesh) in needles().iter().enumerate() {
            let bvh = oriented(mesh);
            let words = packed(by_octants(&bvh.raw()));
            let mut uploaded = UploadedBvh::over_triangles(words, &[]);
            assert_eq!(flaw(&uploaded), None);
            let reached = nodes_below(uploaded.words.root, |word| children(&uploaded.words.nodes, word));
            let with_oriented: Vec<u32> = reached.into_iter().filter(|word| is_oriented(*word)).collect();
            assert!(with_oriented.len() > 10, "{}", with_oriented.len());
            // Boxes that are a tenth smaller are found, and boxes in other frames, but for small ones, most of which is padding.
            let (mut n_found, mut n_changed) = (0, 0);
            for &word in with_oriented.iter().step_by(7) {
                let at = first_word(word);
                let before = uploaded.words.nodes[at..at + NODE].to_vec();
                for is_smaller in [true, false] {
                    let (rows, change): (&[usize], fn(u32) -> u32) = match is_smaller {
                        true => (&[ENDS + 1, ENDS + 3, ENDS + 5], |half| (0.9 * f32::from_bits(half)).to_bits()),
                        false => (&[FRAMES], |frame| frame ^ 0x3c0),
                    };
                    for slot in rows.iter().flat_map(|row| at + row * WIDTH..at + row * WIDTH + WIDTH) {
                        let nodes = uploaded.words.nodes.to_mut();
                        nodes[slot] = change(nodes[slot]);
                    }
                    n_found += usize::from(flaw(&uploaded).is_some());
                    n_changed += 1;
                    uploaded.words.nodes.to_mut()[at..at + NODE].copy_from_slice(&before);
                }
            }
            assert!(number == 3 || 10 * n_found > 8 * n_changed, "{n_found} of {n_changed} changes were found");
        }
    }

    /// Nodes of a device become nodes of the CPU that hold their triangles, with the same hierarchy.
    #[test]
    fn unpacked_nodes_are_checked_by_the_cpu() {
        for mesh in needles() {
            let bvh = oriented(&mesh);
            let raw = bvh.raw();
            let words = packed(raw.clone());
            let (nodes, root) = unpacked(&words.nodes, words.root).unwrap();
            let back = RawBvh { nodes: nodes.clone().into(), root, ..raw.clone() };
            let loaded = TriangleBvh::from_raw(&back, canted_trace::TriangleTest::Watertight).unwrap();
            assert_eq!(loaded.raw().nodes.len(), raw.nodes.len());
            // A word that names no node is reported.
            let mut damaged = words.nodes.to_vec();
            damaged[first_word(words.root)] = 0x1000_0000;
            assert!(unpacked(&damaged, words.root).unwrap_err().contains("names no node"));
        }
    }
}

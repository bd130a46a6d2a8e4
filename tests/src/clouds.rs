//! Difficult point sets for box fits, by name.

use canted_fixtures::SplitMix64;
use canted_obb::Quaternion;

/// Point sets of one kind.
pub struct Cloud {
    /// The kind.
    pub case: &'static str,
    /// Sets of at least one finite point.
    pub sets: Vec<Vec<[f32; 3]>>,
}

/// Uniform over all rotations (Marsaglia's rejection, in four dimensions).
#[must_use]
pub fn random_rotation(rng: &mut SplitMix64) -> Quaternion {
    loop {
        let q = Quaternion { w: rng.signed(), x: rng.signed(), y: rng.signed(), z: rng.signed() };
        let square = q.dot(q);
        if square > 0.01 && square <= 1.0 {
            return q.normalized();
        }
    }
}

/// `turn · (scale ∘ x) + offset`, rounded.
#[must_use]
pub fn placed(turn: &Quaternion, scale: [f64; 3], offset: [f64; 3], x: [f64; 3]) -> [f32; 3] {
    let columns = turn.columns();
    std::array::from_fn(|k| ((0..3).map(|a| columns[a][k] * scale[a] * x[a]).sum::<f64>() + offset[k]) as f32)
}

/// All kinds; `effort` multiplies the number of random sets.
#[must_use]
pub fn extreme(effort: usize) -> Vec<Cloud> {
    let mut rng = SplitMix64::new(30);
    let mut sets = |n: usize, scale: [f64; 3], offset: [f64; 3]| -> Vec<Vec<[f32; 3]>> {
        let mut set = || {
            let turn = random_rotation(&mut rng);
            (0..n).map(|_| placed(&turn, scale, offset, rng.signed3())).collect()
        };
        (0..10 * effort).map(|_| set()).collect()
    };
    let corners = |side: f64, rows: [[f64; 3]; 3]| -> Vec<[f32; 3]> {
        let sign = |i: usize, k: usize| if i >> k & 1 == 1 { side } else { -side };
        let turn = Quaternion::from_columns(rows);
        (0..8).map(|i| placed(&turn, [1.0; 3], [0.0; 3], [0, 1, 2].map(|k| sign(i, k)))).collect()
    };
    let diagonal = std::f64::consts::FRAC_1_SQRT_2;
    let third = 1.0 / 3.0;
    vec![
        Cloud { case: "one point", sets: sets(1, [1.0; 3], [0.1, -7.3, 1e6]) },
        Cloud { case: "two points", sets: sets(2, [4.0, 1.0, 9.0], [0.1, 0.2, 0.3]) },
        Cloud { case: "collinear", sets: sets(30, [4.0, 0.0, 0.0], [9.0, 0.0, 0.0]) },
        Cloud { case: "coplanar", sets: sets(60, [4.0, 3.0, 0.0], [0.1, 0.2, 0.3]) },
        Cloud { case: "one point, 1,000 times", sets: vec![vec![[0.1, -3.7, 123.456]; 1000]] },
        Cloud {
            case: "equal eigenvalues: cubes, octahedron, tetrahedron",
            sets: vec![
                corners(1.0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
                corners(1.0, [[diagonal, diagonal, 0.0], [-diagonal, diagonal, 0.0], [0.0, 0.0, 1.0]]),
                corners(
                    1.0,
                    [[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]].map(|column| column.map(|x| third * x)),
                ),
                [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
                    .iter()
                    .flat_map(|axis: &[i8; 3]| [axis.map(f32::from), axis.map(|x| -f32::from(x))])
                    .collect(),
                vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]],
            ],
        },
        Cloud { case: "needle, 1e6 : 1", sets: sets(40, [1e3, 1e-3, 1e-3], [0.0; 3]) },
        Cloud { case: "at 1e7, size 1e-3", sets: sets(60, [1e-3; 3], [1e7, -1e7, 3e6]) },
        Cloud { case: "at 1e7 along x only, size 1e-3", sets: sets(60, [1e-3, 2e-3, 1e-3], [1e7, 0.0, -0.5]) },
        Cloud { case: "scale 1e-20", sets: sets(40, [1e-20, 2e-20, 1e-21], [0.0; 3]) },
        Cloud { case: "scale 1e20", sets: sets(40, [1e20, 2e20, 1e19], [-1e20; 3]) },
        Cloud { case: "scale ratio 1e12 in one set", sets: mixed(&sets(20, [1e6; 3], [0.0; 3]), effort) },
        Cloud { case: "denormal", sets: sets(40, [1e-40, 2e-40, 1e-41], [0.0; 3]) },
        Cloud {
            case: "full range of f32",
            sets: vec![vec![[f32::MAX, f32::MAX, f32::MIN], [f32::MIN, f32::MAX, 0.0], [0.0, f32::MIN, f32::MIN]]],
        },
        Cloud { case: "negative zeros", sets: vec![vec![[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, -0.0]]] },
    ]
}

/// Each set with as many points again, scaled by 1e-12.
fn mixed(large: &[Vec<[f32; 3]>], effort: usize) -> Vec<Vec<[f32; 3]>> {
    let small = |p: &[f32; 3]| p.map(|x| x * 1e-12);
    large.iter().take(10 * effort).map(|set| set.iter().copied().chain(set.iter().map(small)).collect()).collect()
}

use std::ops::Add;

/// AOV sums of one pixel in `f64`, in world space. A sample that misses adds zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guide {
    /// Samples that hit.
    pub n_hits: u32,
    /// Instance and primitive of the first sample that hits.
    pub first: Option<[u32; 2]>,
    /// Distance along the view axis.
    pub depth: f64,
    /// Geometric unit normal, towards the camera.
    pub normal: [f64; 3],
    /// Unit shading normal.
    pub shading_normal: [f64; 3],
    /// Reflectance, linear RGB.
    pub albedo: [f64; 3],
    /// Box and triangle tests of the camera ray, including misses.
    pub tests: [f64; 2],
}

/// `f64` sums of a guide.
const N_SUMS: usize = 12;

impl Guide {
    /// All sums in the order of the fields.
    pub(crate) fn sums(&self) -> [f64; N_SUMS] {
        let mut sums = [0.0; N_SUMS];
        sums[0] = self.depth;
        for (at, part) in [(1, &self.normal[..]), (4, &self.shading_normal), (7, &self.albedo), (10, &self.tests)] {
            sums[at..at + part.len()].copy_from_slice(part);
        }
        sums
    }

    /// The guide with these sums.
    pub(crate) fn from_sums(n_hits: u32, first: Option<[u32; 2]>, sums: [f64; N_SUMS]) -> Self {
        let three = |at: usize| [sums[at], sums[at + 1], sums[at + 2]];
        Self {
            n_hits,
            first,
            depth: sums[0],
            normal: three(1),
            shading_normal: three(4),
            albedo: three(7),
            tests: [sums[10], sums[11]],
        }
    }
}

impl Add for Guide {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (a, b) = (self.sums(), other.sums());
        let sums = std::array::from_fn(|k| a[k] + b[k]);
        Self::from_sums(self.n_hits + other.n_hits, self.first.or(other.first), sums)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addition_keeps_the_first_hit() {
        let miss = Guide { tests: [4.0, 1.0], ..Guide::default() };
        let hit = |id: u32, x: f64| Guide {
            n_hits: 1,
            first: Some([id, id + 1]),
            depth: x,
            normal: [x + 1.0, x + 2.0, x + 3.0],
            shading_normal: [x + 4.0, x + 5.0, x + 6.0],
            albedo: [x + 7.0, x + 8.0, x + 9.0],
            tests: [x + 10.0, x + 11.0],
        };
        let sum = miss + hit(5, 0.0) + hit(7, 100.0);
        let expected = Guide {
            n_hits: 2,
            first: Some([5, 6]),
            depth: 100.0,
            normal: [102.0, 104.0, 106.0],
            shading_normal: [108.0, 110.0, 112.0],
            albedo: [114.0, 116.0, 118.0],
            tests: [124.0, 123.0],
        };
        assert_eq!(sum, expected);
    }
}

//! Colors of other primaries than those of Rec. 709.
//!
//! Sources: SMPTE RP 177 (matrices of primaries); Lindbloom, chromatic adaptation by Bradford.

/// Chromaticities x and y of red, green, blue and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries(pub(super) [[f64; 2]; 4]);

/// Three rows.
type Matrix = [[f64; 3]; 3];

/// Cone responses of Bradford from XYZ.
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// Chromaticities that differ by less are the same: files round them to four digits.
const SAME: f64 = 2e-4;

impl Primaries {
    /// Of ITU-R BT.709, as of sRGB.
    pub(super) const REC_709: Self = Self([[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]]);
    /// Of Radiance, where a file does not say others.
    pub(super) const RADIANCE: Self = Self([[0.64, 0.33], [0.29, 0.6], [0.15, 0.06], [1.0 / 3.0, 1.0 / 3.0]]);
    /// The three of CIE XYZ; as white any.
    const XYZ: [[f64; 2]; 3] = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];

    /// The matrix that gives Rec. 709 colors, with white as white (Bradford); `None` if nothing changes.
    ///
    /// Primaries that are those of XYZ say that colors are tristimulus values, which have no white to adapt.
    ///
    /// # Errors
    /// Primaries that enclose no colors.
    pub(super) fn to_rec_709(self) -> Result<Option<Matrix>, String> {
        let invalid = || self.invalid();
        if is_same(&self.0, &Self::REC_709.0) {
            return Ok(None);
        }
        let from_xyz = Self::REC_709.rgb_from_xyz()?;
        if is_same(&self.0[..3], &Self::XYZ) {
            return Ok(Some(from_xyz));
        }
        let to_xyz = self.xyz_from_rgb().ok_or_else(invalid)?;
        let [own, white] = [self, Self::REC_709].map(|primaries| times(&BRADFORD, xyz_of(primaries.0[3])));
        if own.iter().any(|&response| response <= 0.0) {
            return Err(invalid());
        }
        let mut scaled = BRADFORD;
        for (k, row) in scaled.iter_mut().enumerate() {
            *row = row.map(|x| x * white[k] / own[k]);
        }
        let adapted = product(&inverse(&BRADFORD).ok_or_else(invalid)?, &scaled);
        Ok(Some(product(&from_xyz, &product(&adapted, &to_xyz))))
    }

    /// The matrix that gives colors of these primaries from XYZ, without adaptation.
    ///
    /// # Errors
    /// Primaries that enclose no colors.
    pub(super) fn rgb_from_xyz(self) -> Result<Matrix, String> {
        self.xyz_from_rgb().and_then(|matrix| inverse(&matrix)).ok_or_else(|| self.invalid())
    }

    fn invalid(self) -> String {
        format!("chromaticities {:?} are not those of red, green, blue and white", self.0)
    }

    /// Weights of red, green and blue in luminance; they add up to 1.
    pub(super) fn luminance(self) -> Option<[f64; 3]> {
        self.xyz_from_rgb().map(|matrix| matrix[1])
    }

    /// The matrix that gives XYZ, where white has Y = 1; `None` if there is none.
    fn xyz_from_rgb(self) -> Option<Matrix> {
        let [red, green, blue, white] = self.0;
        // Columns of any length, which are scaled so that they add up to white.
        let columns = [red, green, blue].map(|[x, y]| [x, y, 1.0 - x - y]);
        let rows: Matrix = std::array::from_fn(|row| columns.map(|column| column[row]));
        let scale = times(&inverse(&rows)?, xyz_of(white));
        let matrix: Matrix = rows.map(|row| std::array::from_fn(|k| row[k] * scale[k]));
        matrix.as_flattened().iter().all(|x| x.is_finite()).then_some(matrix)
    }
}

/// Multiplies each color.
pub(super) fn apply(matrix: &Matrix, colors: &mut [[f32; 3]]) {
    for color in colors {
        *color = times(matrix, color.map(f64::from)).map(|x| x as f32);
    }
}

fn is_same(a: &[[f64; 2]], b: &[[f64; 2]]) -> bool {
    a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < SAME)
}

/// XYZ of a chromaticity, with Y = 1.
fn xyz_of([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

fn times(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| std::array::from_fn(|k| row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]))
}

/// The inverse; `None` for a singular matrix.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let cofactor = |i: usize, j: usize| {
        let [r, s] = [(i + 1) % 3, (i + 2) % 3];
        let [p, q] = [(j + 1) % 3, (j + 2) % 3];
        m[r][p] * m[s][q] - m[r][q] * m[s][p]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    let is_regular = determinant.is_finite() && determinant.abs() > 1e-9;
    is_regular.then(|| std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn is_near(got: &Matrix, want: &Matrix, error: f64) {
        let errors = got.as_flattened().iter().zip(want.as_flattened()).map(|(a, b)| (a - b).abs());
        assert!(errors.fold(0.0, f64::max) <= error, "{got:?} for {want:?}");
    }

    #[test]
    fn matrices_are_the_published_ones() {
        // IEC 61966-2-1, four digits.
        let of_srgb = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        is_near(&Primaries::REC_709.xyz_from_rgb().unwrap(), &of_srgb, 1e-4);
        // ACES AP0 to Rec. 709 by Bradford, of the OpenColorIO configuration of ACES.
        let ap0 = Primaries([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]]);
        let of_aces = [
            [2.521_686_186_74, -1.134_130_988_24, -0.387_555_198_50],
            [-0.276_479_914_23, 1.372_719_087_67, -0.096_239_173_44],
            [-0.015_378_064_97, -0.152_975_335_87, 1.168_353_400_84],
        ];
        is_near(&ap0.to_rec_709().unwrap().unwrap(), &of_aces, 1e-4);
        // Rec. 2020 to Rec. 709, ITU-R BT.2087: the same white.
        let rec_2020 = Primaries([[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]]);
        let of_bt_2087 = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]];
        is_near(&rec_2020.to_rec_709().unwrap().unwrap(), &of_bt_2087, 1e-4);
    }

    #[test]
    fn white_stays_white_and_xyz_has_none() {
        let white = |primaries: Primaries| times(&primaries.to_rec_709().unwrap().unwrap(), [1.0; 3]);
        for x in white(Primaries::RADIANCE) {
            assert!((x - 1.0).abs() < 1e-12, "{x}");
        }
        let [x, y, z] = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];
        let xyz = Primaries([x, y, z, [1.0 / 3.0; 2]]).to_rec_709().unwrap().unwrap();
        let d65 = times(&xyz, xyz_of([0.3127, 0.329]));
        assert!(d65.iter().all(|x| (x - 1.0).abs() < 1e-12), "{d65:?}");
        assert_eq!(Primaries::REC_709.to_rec_709(), Ok(None));
    }

    #[test]
    fn impossible_primaries_are_errors() {
        let [red, green, blue, white] = Primaries::REC_709.0;
        for wrong in [
            [red, red, blue, white],
            [red, green, blue, [0.3, 0.0]],
            [red, green, blue, [f64::NAN; 2]],
            [[f64::INFINITY; 2], green, blue, white],
            [[0.0; 2]; 4],
        ] {
            assert!(Primaries(wrong).to_rec_709().is_err(), "{wrong:?}");
        }
    }
}

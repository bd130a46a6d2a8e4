use crate::{
    frame::Frame,
    vector::{self, Vector},
};

/// A rotation as a quaternion, of any length but zero: `w + x·i + y·j + z·k`.
///
/// `q` and `-q` are the same rotation; [`Quaternion::canonical`] chooses one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    /// Real part.
    pub w: f64,
    /// Imaginary part along the first axis.
    pub x: f64,
    /// Imaginary part along the second axis.
    pub y: f64,
    /// Imaginary part along the third axis.
    pub z: f64,
}

impl Quaternion {
    /// The identity rotation.
    pub const IDENTITY: Self = Self { w: 1.0, x: 0.0, y: 0.0, z: 0.0 };

    /// The rotation whose matrix has the columns of `rotation`, at length one and canonical.
    ///
    /// Divides by the largest component (Shepperd 1978), so rotations by 180° are exact. The columns should be orthonormal
    /// and right-handed; if they are only nearly so, the result is a nearby rotation.
    #[inline]
    #[must_use]
    pub fn from_columns(rotation: [[f64; 3]; 3]) -> Self {
        let [c0, c1, c2] = rotation;
        let trace = c0[0] + c1[1] + c2[2];
        // Four times the square of each component, up to a common factor.
        let squares = [1.0 + trace, 1.0 + 2.0 * c0[0] - trace, 1.0 + 2.0 * c1[1] - trace, 1.0 + 2.0 * c2[2] - trace];
        let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
        let s = squares[largest];
        let (wx, wy, wz) = (c1[2] - c2[1], c2[0] - c0[2], c0[1] - c1[0]);
        let (xy, xz, yz) = (c1[0] + c0[1], c2[0] + c0[2], c2[1] + c1[2]);
        let [w, x, y, z] = match largest {
            0 => [s, wx, wy, wz],
            1 => [wx, s, xy, xz],
            2 => [wy, xy, s, yz],
            _ => [wz, xz, yz, s],
        };
        Self { w, x, y, z }.normalized().canonical()
    }

    /// [`Quaternion::from_columns`] for a frame.
    #[inline]
    #[must_use]
    pub fn from_frame(frame: Frame) -> Self {
        Self::from_columns(frame.map(vector::to_f64))
    }

    /// The rotation about `axis` (of length one) by `angle_rad`.
    #[must_use]
    pub fn from_axis_angle(axis: [f64; 3], angle_rad: f64) -> Self {
        let (sin, cos) = vector::sin_cos(0.5 * angle_rad);
        let [x, y, z] = vector::scale(axis, sin);
        Self { w: cos, x, y, z }
    }

    /// Columns of the rotation matrix of a unit quaternion.
    #[inline]
    #[must_use]
    pub fn columns(self) -> [[f64; 3]; 3] {
        let Self { w, x, y, z } = self;
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    /// The axes of the rotation matrix, rounded to `f32`.
    #[inline]
    #[must_use]
    pub fn frame(self) -> Frame {
        self.columns().map(vector::to_f32)
    }

    /// The same rotation, with the first non-zero of `w, x, y, z` positive.
    #[inline]
    #[must_use]
    pub fn canonical(self) -> Self {
        let first = [self.w, self.x, self.y, self.z].into_iter().find(|&c| c != 0.0);
        if first.is_some_and(|c| c < 0.0) { self.scaled(-1.0) } else { self }
    }

    /// The unit quaternion; the identity for zero.
    #[inline]
    #[must_use]
    pub fn normalized(self) -> Self {
        let reach = self.w.abs().max(self.x.abs()).max(self.y.abs()).max(self.z.abs());
        if reach == 0.0 {
            return Self::IDENTITY;
        }
        let near_one = self.scaled(crate::round::binade_inverse(reach));
        near_one.scaled(1.0 / vector::sqrt(near_one.dot(near_one)))
    }

    /// Dot product: for unit quaternions the cosine of half the angle between the rotations, up to sign.
    #[inline]
    #[must_use]
    pub fn dot(self, other: Self) -> f64 {
        self.w * other.w + self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The inverse of a unit quaternion.
    #[inline]
    #[must_use]
    pub fn conjugate(self) -> Self {
        Self { w: self.w, x: -self.x, y: -self.y, z: -self.z }
    }

    /// The rotation `right` followed by `self`.
    #[inline]
    #[must_use]
    pub fn times(self, right: Self) -> Self {
        let (a, b): (Vector, Vector) = ([self.x, self.y, self.z], [right.x, right.y, right.z]);
        let cross = vector::cross(a, b);
        Self {
            w: self.w * right.w - vector::dot(a, b),
            x: self.w * b[0] + right.w * a[0] + cross[0],
            y: self.w * b[1] + right.w * a[1] + cross[1],
            z: self.w * b[2] + right.w * a[2] + cross[2],
        }
    }

    /// Every component times `s`.
    #[inline]
    #[must_use]
    pub fn scaled(self, s: f64) -> Self {
        Self { w: self.w * s, x: self.x * s, y: self.y * s, z: self.z * s }
    }

    /// Sum of the components.
    #[inline]
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self { w: self.w + other.w, x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

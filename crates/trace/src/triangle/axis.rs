/// A coordinate axis, chosen once for a ray or a triangle to take the role of z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The first coordinate.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// The axis of the greatest absolute component, the first of equals.
    #[inline]
    pub(super) fn from_greatest<T: Copy + PartialOrd>([x, y, z]: [T; 3], abs: impl Fn(T) -> T) -> Self {
        let (x, y, z) = (abs(x), abs(y), abs(z));
        if x >= y && x >= z {
            Self::X
        } else if y >= z {
            Self::Y
        } else {
            Self::Z
        }
    }

    /// The components permuted cyclically so that this axis is last.
    #[inline]
    #[must_use]
    pub fn permute<T: Copy>(self, [x, y, z]: [T; 3]) -> [T; 3] {
        match self {
            Self::X => [y, z, x],
            Self::Y => [z, x, y],
            Self::Z => [x, y, z],
        }
    }
}

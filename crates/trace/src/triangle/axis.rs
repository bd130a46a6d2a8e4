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
    /// The axis of the greatest absolute component, the first of equals. Without branches, as for [`Axis::indices`].
    #[inline]
    pub(super) fn from_greatest<T: Copy + PartialOrd>([x, y, z]: [T; 3], abs: impl Fn(T) -> T) -> Self {
        let (x, y, z) = (abs(x), abs(y), abs(z));
        const AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];
        let (is_x, y_is_first) = ((x >= y) & (x >= z), y >= z);
        AXES[usize::from(!is_x) * (2 - usize::from(y_is_first))]
    }

    /// Its index.
    #[inline]
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// The indices of the axes, permuted cyclically so that this axis is last. From a table: rays of a slice differ in their
    /// axis, so a branch would be mispredicted.
    #[inline]
    #[must_use]
    pub fn indices(self) -> [usize; 3] {
        const INDICES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];
        INDICES[self as usize]
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

/// What a traversal tells its caller about its work. `()` counts nothing and costs nothing.
pub trait Count {
    /// `n` ray-box tests were made.
    fn boxes(&mut self, n: u32);
    /// `n` ray-triangle tests were made.
    fn triangles(&mut self, n: u32);
}

impl Count for () {
    #[inline(always)]
    fn boxes(&mut self, _: u32) {}
    #[inline(always)]
    fn triangles(&mut self, _: u32) {}
}

/// Sums of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ray-box tests.
    pub boxes: u64,
    /// Ray-triangle tests.
    pub triangles: u64,
}

impl Count for Counts {
    #[inline]
    fn boxes(&mut self, n: u32) {
        self.boxes += u64::from(n);
    }
    #[inline]
    fn triangles(&mut self, n: u32) {
        self.triangles += u64::from(n);
    }
}

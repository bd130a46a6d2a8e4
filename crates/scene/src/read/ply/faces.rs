//! Faces as lists of vertex indices: meshes of triangles, which are the most and the largest, need no ends of lists.

/// Vertex indices of all faces, unchecked.
#[derive(Debug, Default)]
pub(super) struct Faces {
    /// All faces, as long as each has three corners.
    triangles: Vec<[u32; 3]>,
    /// All faces, from the first that has not.
    polygons: Option<Polygons>,
}

/// Faces of any number of corners.
#[derive(Debug)]
pub(super) struct Polygons {
    /// Vertex indices of all faces, concatenated.
    corners: Vec<u32>,
    /// End of each face in `corners`.
    ends: Vec<usize>,
}

impl Faces {
    /// Makes room for `n` more triangles.
    pub(super) fn reserve(&mut self, n: usize) {
        self.triangles.reserve_exact(n);
    }

    /// Adds a face.
    pub(super) fn push(&mut self, face: &[u32]) {
        match (&mut self.polygons, face) {
            (None, &[a, b, c]) => self.triangles.push([a, b, c]),
            (Some(polygons), face) => polygons.push(face),
            (None, face) => {
                let ends = (1..=self.triangles.len()).map(|n| 3 * n).collect();
                let mut polygons = Polygons { corners: std::mem::take(&mut self.triangles).into_flattened(), ends };
                polygons.push(face);
                self.polygons = Some(polygons);
            }
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.polygons.is_none()
    }

    /// All faces where each has three corners, in the memory that holds them; else all faces as polygons.
    pub(super) fn into_triangles(self) -> Result<Vec<[u32; 3]>, Polygons> {
        self.polygons.map_or(Ok(self.triangles), Err)
    }
}

impl Polygons {
    /// The faces, in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(&start, &end)| &self.corners[start..end])
    }

    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    fn push(&mut self, face: &[u32]) {
        self.corners.extend_from_slice(face);
        self.ends.push(self.corners.len());
    }
}

//! Strands: chains of segments of curves, of which each begins where the one before ends.

use std::ops::Range;

use crate::{CurveSegments, Mesh};

impl Mesh {
    /// The segments of each strand of the mesh's curves, in order; none without curves.
    ///
    /// A segment continues a strand if it begins at the position at which the one before it ends. Balls, which begin where they end, are strands of their
    /// own unless they share a position; patches always are.
    ///
    /// ```
    /// use canted_scene::{CurveSegments, CurveShape, Curves, Mesh};
    ///
    /// let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    /// let segments = CurveSegments::Linear(vec![[0, 1], [1, 2], [3, 4]]);
    /// let curves = Curves { radii: vec![0.1; 5], segments, shape: CurveShape::Tube };
    /// let mesh = Mesh { positions, curves: Some(curves), ..Mesh::default() };
    /// assert_eq!(mesh.strands(), [0..2, 2..3]);
    /// // By length: a quarter of the first strand is before its second point.
    /// assert_eq!(mesh.strand_coordinates(), [[0.0, 0.25], [0.25, 1.0], [0.0, 1.0]]);
    /// ```
    #[must_use]
    pub fn strands(&self) -> Vec<Range<usize>> {
        let Some(curves) = &self.curves else { return Vec::new() };
        let n = curves.segments.len();
        let is_first =
            |&i: &usize| i == 0 || self.has_patches() || self.segment_ends(i - 1)[1] != self.segment_ends(i)[0];
        let mut starts: Vec<usize> = (0..n).filter(is_first).collect();
        starts.push(n);
        starts.windows(2).map(|pair| pair[0]..pair[1]).filter(|strand| !strand.is_empty()).collect()
    }

    /// The position along the strand at the start and at the end of each segment: 0 where the strand begins, 1 where it ends.
    ///
    /// Positions are in proportion to the lengths of the segments: exact for straight ones, and for cubic ones the mean of the chord and the control
    /// polygon (Gravesen 1997). A strand without length is divided into equal parts.
    #[must_use]
    pub fn strand_coordinates(&self) -> Vec<[f32; 2]> {
        let mut coordinates = Vec::with_capacity(self.curves.as_ref().map_or(0, |curves| curves.segments.len()));
        for strand in self.strands() {
            let lengths: Vec<f64> = strand.map(|i| self.segment_length(i)).collect();
            let (sum, n) = (lengths.iter().sum::<f64>(), lengths.len() as f64);
            let mut at = 0.0;
            for length in lengths {
                let from = at as f32;
                at += if sum > 0.0 { length / sum } else { 1.0 / n };
                coordinates.push([from, at as f32]);
            }
            // The roundings of the sum.
            if let Some([_, last]) = coordinates.last_mut() {
                *last = 1.0;
            }
        }
        coordinates
    }

    /// For each segment, a point towards which the next segment of the strand leads; the end of the segment itself where none follows.
    ///
    /// The last segment of a strand of three or more that ends where it begins is followed by the first.
    #[must_use]
    pub fn following_points(&self) -> Vec<[f32; 3]> {
        self.following_indices().into_iter().map(|i| self.positions[i as usize]).collect()
    }

    /// As [`Mesh::following_points`], by the indices of the points.
    #[must_use]
    pub fn following_indices(&self) -> Vec<u32> {
        let mut following = Vec::with_capacity(self.curves.as_ref().map_or(0, |curves| curves.segments.len()));
        for strand in self.strands() {
            let is_closed =
                strand.len() > 2 && self.segment_ends(strand.end - 1)[1] == self.segment_ends(strand.start)[0];
            for i in strand.clone() {
                let end = self.segment_ends(i)[1];
                let last = self.segment_indices(i).last().copied().unwrap_or(0);
                let next = if i + 1 < strand.end { Some(i + 1) } else { is_closed.then_some(strand.start) };
                let is_ahead = |i: &&u32| self.positions[**i as usize] != end;
                let ahead = next.and_then(|next| self.segment_indices(next).iter().find(is_ahead));
                following.push(ahead.copied().unwrap_or(last));
            }
        }
        following
    }

    /// Indices of the control points of a segment.
    fn segment_indices(&self, i: usize) -> &[u32] {
        match self.curves.as_ref().map(|curves| &curves.segments) {
            Some(CurveSegments::Linear(list)) => &list[i][..],
            Some(CurveSegments::Cubic(list)) => &list[i][..],
            Some(CurveSegments::Patches(list)) => &list[i][..],
            None => &[],
        }
    }

    /// Control points of a segment.
    fn segment_points(&self, i: usize) -> impl Iterator<Item = [f32; 3]> {
        self.segment_indices(i).iter().map(|&index| self.positions[index as usize])
    }

    fn segment_ends(&self, i: usize) -> [[f32; 3]; 2] {
        let mut points = self.segment_points(i);
        let first = points.next().unwrap_or_default();
        [first, points.last().unwrap_or(first)]
    }

    fn segment_length(&self, i: usize) -> f64 {
        let distance =
            |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (f64::from(b[k]) - f64::from(a[k])).powi(2)).sum::<f64>().sqrt();
        let [from, to] = self.segment_ends(i);
        let polygon: f64 =
            self.segment_points(i).zip(self.segment_points(i).skip(1)).map(|(a, b)| distance(a, b)).sum();
        0.5 * (distance(from, to) + polygon)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CurveShape, Curves};

    fn mesh(positions: Vec<[f32; 3]>, segments: CurveSegments) -> Mesh {
        let curves = Curves { radii: vec![0.1; positions.len()], segments, shape: CurveShape::Ribbon };
        Mesh { positions, curves: Some(curves), ..Mesh::default() }
    }

    /// Segments of scene files have points of their own at joints.
    #[test]
    fn cubic_segments_are_joined_by_position() {
        let line = |from: f32, to: f32| [0, 1, 2, 3].map(|k| [from + (to - from) * k as f32 / 3.0, 0.0, 0.0]);
        let positions = [line(0.0, 3.0), line(3.0, 4.0), line(5.0, 6.0)].concat();
        let mesh = mesh(positions, CurveSegments::Cubic(vec![[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]));
        assert_eq!(mesh.strands(), [0..2, 2..3]);
        assert_eq!(mesh.strand_coordinates(), [[0.0, 0.75], [0.75, 1.0], [0.0, 1.0]]);
        assert_eq!(mesh.following_points(), [mesh.positions[5], mesh.positions[7], mesh.positions[11]]);
    }

    /// The first point that differs from the joint leads on.
    #[test]
    fn following_points_differ_from_the_joint() {
        let mut positions: Vec<[f32; 3]> = (0..8).map(|i| [i as f32, 0.0, 0.0]).collect();
        for joint in [4, 5] {
            positions[joint] = positions[3];
        }
        let mesh = mesh(positions, CurveSegments::Cubic(vec![[0, 1, 2, 3], [4, 5, 6, 7]]));
        assert_eq!(mesh.following_points()[0], [6.0, 0.0, 0.0]);
    }

    #[test]
    fn closed_strands_go_on_at_their_start() {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let closed = mesh(corners.clone(), CurveSegments::Linear(vec![[0, 1], [1, 2], [2, 0]]));
        let [strand] = &closed.strands()[..] else { panic!("one strand") };
        assert_eq!(*strand, 0..3);
        assert_eq!(closed.following_points(), [corners[2], corners[0], corners[1]]);
        let open = mesh(corners.clone(), CurveSegments::Linear(vec![[0, 1], [1, 2]]));
        assert_eq!(open.following_points(), [corners[2], corners[2]]);
    }

    #[test]
    fn strands_without_length_have_equal_parts() {
        let mesh = mesh(vec![[1.0; 3]; 3], CurveSegments::Linear(vec![[0, 1], [1, 2]]));
        assert_eq!(mesh.strand_coordinates(), [[0.0, 0.5], [0.5, 1.0]]);
        assert_eq!(Mesh::default().strands(), []);
        assert_eq!(Mesh::default().strand_coordinates(), [[0.0_f32; 2]; 0]);
    }

    /// A quarter of a circle, whose length is known.
    #[test]
    fn lengths_of_cubics_are_about_those_of_the_curves() {
        let k = 0.552_284_8;
        let quarter = vec![[1.0, 0.0, 0.0], [1.0, k, 0.0], [k, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let length = mesh(quarter, CurveSegments::Cubic(vec![[0, 1, 2, 3]])).segment_length(0);
        assert!((length / std::f64::consts::FRAC_PI_2 - 1.0).abs() < 0.01, "{length}");
    }
}

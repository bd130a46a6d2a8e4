//! RasterPipeline passes in pieces that take about as long as a dispatch.

use std::{collections::VecDeque, time::Duration};

use crate::Draw;

/// How long a piece should take: short enough for a display that waits behind it.
const WANTED: Duration = Duration::from_millis(100);

/// Triangles of the first piece, before anything is known of the device, and of the least.
const FIRST: u32 = 1 << 14;
const LEAST: u32 = 1 << 8;

/// Draws that are cut into pieces, in their order.
pub(crate) struct DrawBatches {
    waiting: VecDeque<Draw>,
    /// Triangles of the next piece.
    n_triangles: u32,
}

impl DrawBatches {
    pub(crate) fn new(draws: &[Draw]) -> Self {
        Self { waiting: draws.iter().cloned().collect(), n_triangles: FIRST }
    }

    /// The next piece, `None` where all is drawn.
    pub(crate) fn next(&mut self) -> Option<Vec<Draw>> {
        let mut piece = vec![];
        let mut left = self.n_triangles;
        while left > 0 {
            let Some(draw) = self.waiting.pop_front() else { break };
            let (first, rest) = cut(&draw, left);
            rest.into_iter().rev().for_each(|draw| self.waiting.push_front(draw));
            left = left.saturating_sub(n_triangles(&first));
            piece.push(first);
        }
        (!piece.is_empty()).then_some(piece)
    }

    /// Sizes the next piece by the time that the last one took.
    pub(crate) fn took(&mut self, time: Duration) {
        let times = WANTED.as_nanos() / time.as_nanos().max(1);
        self.n_triangles = match times {
            0 => (self.n_triangles / 2).max(LEAST),
            1 => self.n_triangles,
            2 | 3 => self.n_triangles.saturating_mul(2),
            _ => self.n_triangles.saturating_mul(4),
        };
    }
}

fn n_triangles(draw: &Draw) -> u32 {
    let n_vertices = u32::try_from(draw.vertices.len()).unwrap_or(u32::MAX);
    let n_instances = u32::try_from(draw.instances.len()).unwrap_or(u32::MAX);
    (n_vertices / 3).saturating_mul(n_instances)
}

/// The first of a draw, about `most` triangles, and the rest: instances are drawn one after another, so their order stays.
fn cut(draw: &Draw, most: u32) -> (Draw, Vec<Draw>) {
    let Draw { vertices, instances } = draw.clone();
    let of_one = n_triangles(&Draw { vertices: vertices.clone(), instances: 0..1 });
    if of_one <= most {
        let n = most.checked_div(of_one).unwrap_or(u32::MAX);
        let middle = instances.start.saturating_add(n).min(instances.end);
        let first = Draw { vertices: vertices.clone(), instances: instances.start..middle };
        let rest = (middle < instances.end).then_some(Draw { vertices, instances: middle..instances.end });
        return (first, rest.into_iter().collect());
    }
    let one = instances.start..instances.start + 1;
    let middle = vertices.start + 3 * most;
    let first = Draw { vertices: vertices.start..middle, instances: one.clone() };
    let mut rest = vec![Draw { vertices: middle..vertices.end, instances: one.clone() }];
    if one.end < instances.end {
        rest.push(Draw { vertices, instances: one.end..instances.end });
    }
    (first, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each triangle in the order in which it is drawn: its first vertex, and its instance.
    fn triangles(draws: &[Draw]) -> Vec<(u32, u32)> {
        let of_draw = |draw: &Draw| {
            let vertices = draw.vertices.clone().step_by(3);
            let of_instance = move |i: u32| vertices.clone().map(move |v| (v, i));
            draw.instances.clone().flat_map(of_instance).collect::<Vec<_>>()
        };
        draws.iter().flat_map(of_draw).collect()
    }

    #[test]
    fn pieces_are_the_whole_in_its_order() {
        let draws = [
            Draw { vertices: 0..300, instances: 0..7 },
            Draw { vertices: 0..0, instances: 7..9 },
            Draw { vertices: 30..39, instances: 9..10 },
        ];
        for size in [1, 2, 99, 100, 101, 250, 10_000] {
            let mut pieces = DrawBatches { n_triangles: size, ..DrawBatches::new(&draws) };
            let mut found = vec![];
            while let Some(piece) = pieces.next() {
                let drawn = triangles(&piece);
                assert!(drawn.len() <= size as usize, "{} in a piece of {size}", drawn.len());
                found.extend(drawn);
            }
            assert_eq!(found, triangles(&draws), "{size}");
        }
    }

    #[test]
    fn pieces_grow_and_shrink_by_their_time() {
        let mut pieces = DrawBatches::new(&[]);
        pieces.took(Duration::from_millis(1));
        assert_eq!(pieces.n_triangles, 4 * FIRST);
        pieces.took(Duration::from_millis(250));
        assert_eq!(pieces.n_triangles, 2 * FIRST);
        (0..20).for_each(|_| pieces.took(Duration::from_secs(9)));
        assert_eq!(pieces.n_triangles, LEAST);
        assert_eq!(pieces.next(), None);
    }
}

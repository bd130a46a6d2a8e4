//! Raster passes in batches of bounded time.

use std::{collections::VecDeque, ops::Range, time::Duration};

/// Target time of a batch, short enough for a display that waits for it.
const TARGET_TIME: Duration = Duration::from_millis(100);

/// Triangles of the first batch, and minimum.
const FIRST_BATCH: u32 = 1 << 14;
const MIN_BATCH: u32 = 1 << 8;

/// A range of vertices for a range of instances.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draw {
    /// Vertex indices, three per triangle.
    pub vertices: Range<u32>,
    /// Instance indices.
    pub instances: Range<u32>,
}

/// Draws split into batches, in order.
pub(crate) struct DrawBatches {
    waiting: VecDeque<Draw>,
    /// Triangles of the next batch.
    n_triangles: u32,
}

impl DrawBatches {
    pub(crate) fn new(draws: &[Draw]) -> Self {
        Self { waiting: draws.iter().cloned().collect(), n_triangles: FIRST_BATCH }
    }

    /// The next batch; `None` after the last.
    pub(crate) fn next(&mut self) -> Option<Vec<Draw>> {
        let mut batch = vec![];
        let mut left = self.n_triangles;
        while left > 0 {
            let Some(draw) = self.waiting.pop_front() else { break };
            let (first, rest) = cut(&draw, left);
            rest.into_iter().rev().for_each(|draw| self.waiting.push_front(draw));
            left = left.saturating_sub(n_triangles(&first));
            batch.push(first);
        }
        (!batch.is_empty()).then_some(batch)
    }

    /// Adjusts the batch size by the time of the last batch.
    pub(crate) fn adapt(&mut self, time: Duration) {
        let times = TARGET_TIME.as_nanos() / time.as_nanos().max(1);
        self.n_triangles = match times {
            0 => (self.n_triangles / 2).max(MIN_BATCH),
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

/// Splits off about `most` triangles of a draw. Instances are drawn one after another, so the order is kept.
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

    /// First vertex and instance of each triangle, in drawing order.
    fn triangles(draws: &[Draw]) -> Vec<(u32, u32)> {
        let of_draw = |draw: &Draw| {
            let vertices = draw.vertices.clone().step_by(3);
            let of_instance = move |i: u32| vertices.clone().map(move |v| (v, i));
            draw.instances.clone().flat_map(of_instance).collect::<Vec<_>>()
        };
        draws.iter().flat_map(of_draw).collect()
    }

    #[test]
    fn batches_cover_all_draws_in_order() {
        let draws = [
            Draw { vertices: 0..300, instances: 0..7 },
            Draw { vertices: 0..0, instances: 7..9 },
            Draw { vertices: 30..39, instances: 9..10 },
        ];
        for size in [1, 2, 99, 100, 101, 250, 10_000] {
            let mut batches = DrawBatches { n_triangles: size, ..DrawBatches::new(&draws) };
            let mut found = vec![];
            while let Some(batch) = batches.next() {
                let drawn = triangles(&batch);
                assert!(drawn.len() <= size as usize, "{} in a batch of {size}", drawn.len());
                found.extend(drawn);
            }
            assert_eq!(found, triangles(&draws), "{size}");
        }
    }

    #[test]
    fn batch_size_adapts_to_time() {
        let mut batches = DrawBatches::new(&[]);
        batches.adapt(Duration::from_millis(1));
        assert_eq!(batches.n_triangles, 4 * FIRST_BATCH);
        batches.adapt(Duration::from_millis(250));
        assert_eq!(batches.n_triangles, 2 * FIRST_BATCH);
        (0..20).for_each(|_| batches.adapt(Duration::from_secs(9)));
        assert_eq!(batches.n_triangles, MIN_BATCH);
        assert_eq!(batches.next(), None);
    }
}

use std::collections::BinaryHeap;

use canted_lbvh::ChildKind;

use crate::pairs::{Pairs, Slot};

/// The `n` slots with the largest boxes, except the root, by descending area, then by number.
///
/// Areas do not increase from parent to child, so only the top of the tree is visited.
pub(crate) fn largest(pairs: &Pairs, n: usize) -> Vec<Slot> {
    let mut front = BinaryHeap::with_capacity(n + 2);
    let open = |child: canted_lbvh::Child, front: &mut BinaryHeap<_>| {
        if let ChildKind::Inner(id) = child.kind() {
            let areas = pairs.pair(id).boxes.half_areas();
            for (side, area) in (0..).zip(areas) {
                let slot = Slot::new(id, side);
                // Areas are not negative, so their bits are ordered.
                front.push((area.to_bits(), std::cmp::Reverse(slot)));
            }
        }
    };
    open(pairs.child(pairs.top()), &mut front);
    let mut largest = Vec::with_capacity(n);
    while largest.len() < n
        && let Some((_, std::cmp::Reverse(slot))) = front.pop()
    {
        largest.push(slot);
        open(pairs.child(slot), &mut front);
    }
    largest
}

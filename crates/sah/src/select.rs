use std::collections::BinaryHeap;

use canted_lbvh::ChildKind;

use crate::pairs::{Pairs, Slot};

/// The `n` places of largest boxes, the root's left out, by falling area and then by number.
///
/// Areas never grow on the way down, so the largest are the top of the tree and the rest need not be seen.
pub(crate) fn largest(pairs: &Pairs, n: usize) -> Vec<Slot> {
    let mut front = BinaryHeap::with_capacity(n + 2);
    let open = |child: canted_lbvh::Child, front: &mut BinaryHeap<_>| {
        if let ChildKind::Inner(id) = child.kind() {
            let areas = pairs.pair(id).boxes.half_areas();
            for (side, area) in (0..).zip(areas) {
                let slot = Slot::new(id, side);
                // Areas are not negative, so their bits are in order.
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

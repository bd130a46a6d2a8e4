//! A BVH and its links while a primitive changes.

use canted_obb::{Aabb, PrimId};

use crate::build::item::Item;
use crate::bvh::WideBvh;
use crate::leaf::{Placed, Primitive};
use crate::node::{
    ALIGNED_LINES, Change, ChildWord, Content, DecodedWord, Link, Links, NO_NODE, NodeBox, NodeKind, Row, node_words,
    set_word, write_box,
};
use crate::traverse::{BoxPads, Pads};
use crate::update::{Sums, content_of, half_area, predicted, visit};

/// See the module. The root is a node, unless there is no primitive.
pub(super) struct Tree<'a, P: Primitive> {
    pub(super) bvh: &'a mut WideBvh<P>,
    /// Taken from the nodes until the change is complete: one that fails half-way, by a panic of the caller's code, leaves none behind.
    pub(super) links: Box<Links>,
    pads: BoxPads,
}

/// Where a primitive is in its leaf.
struct Place {
    slot: usize,
    first: usize,
    n: usize,
    at: usize,
}

/// The number of a node that starts with a line.
fn number(line: u32) -> u32 {
    line / ALIGNED_LINES as u32
}

impl<'a, P: Primitive> Tree<'a, P> {
    pub(super) fn open(bvh: &'a mut WideBvh<P>) -> Self {
        let pads = BoxPads::new(Pads::of(P::ERROR), bvh.frame.is_identity);
        let known = bvh.nodes.links.take();
        let is_known = known.is_some();
        let mut tree = Self { bvh, links: known.unwrap_or_default(), pads };
        if !is_known {
            tree.bvh.leaves.unsort();
            tree.find_links();
        }
        tree
    }

    /// Completes a change.
    pub(super) fn close(self) {
        let Self { bvh, links, .. } = self;
        let root = match bvh.nodes.root.kind() {
            DecodedWord::Node(_, line) => links.nodes[number(line) as usize].content,
            _ => Content::EMPTY,
        };
        bvh.bounds = root.bounds;
        let sums = Sums { area: links.area.get(), weighted: links.weighted.get(), visits: links.visits.get() };
        let now = predicted(sums, visit(bvh.nodes.root, &bvh.baseline.costs), &bvh.bounds);
        bvh.baseline.built.get_or_insert(now);
        bvh.baseline.now = Some(now);
        bvh.nodes.links = Some(links);
    }

    /// Finds all links, contents and unused memory; makes a root that is a leaf a node.
    fn find_links(&mut self) {
        let nodes = &self.bvh.nodes;
        let n_primitives = self.bvh.n_primitives;
        let mut is_used_place = vec![false; self.bvh.leaves.order.len()];
        let mut is_used_node = vec![false; nodes.lines.len() / ALIGNED_LINES];
        let (mut found, mut open) = (vec![], vec![(nodes.root, NO_NODE)]);
        let mut links = Links {
            nodes: vec![Link::NEW; is_used_node.len()],
            holders: vec![NO_NODE; n_primitives],
            ..Links::default()
        };
        while let Some((word, parent)) = open.pop() {
            match word.kind() {
                DecodedWord::Empty => {}
                DecodedWord::Leaf { first, n } => {
                    let places = first as usize..(first + n) as usize;
                    is_used_place[places.clone()].fill(true);
                    self.bvh.leaves.order[places].iter().for_each(|id| links.holders[id.index()] = parent);
                }
                DecodedWord::Node(kind, line) => {
                    let node = number(line) as usize;
                    is_used_node[node..node + kind.n_lines() / ALIGNED_LINES].fill(true);
                    links.nodes[node] = Link { parent, kind, ..Link::NEW };
                    found.push(node as u32);
                    open.extend(node_words(&nodes.lines, kind, line).iter().map(|&word| (word, node as u32)));
                }
            }
        }
        let free = |used: &[bool]| (0..used.len() as u32).rev().filter(|&i| !used[i as usize]).collect();
        (links.free_nodes, links.free_places) = (free(&is_used_node), free(&is_used_place));
        (links.first_depth, links.most_primitives) = (nodes.depth.max(1), n_primitives);
        // A BVH that was changed before may have unused memory.
        links.is_scattered = !(links.free_nodes.is_empty() && links.free_places.is_empty());
        *self.links = links;
        for id in 0..n_primitives {
            self.add_area(id, 1.0);
        }
        for &node in found.iter().rev() {
            self.links.nodes[node as usize].content = self.joined(node);
            (0..8).for_each(|slot| self.weigh(node, slot, 1.0));
        }
        let root = self.bvh.nodes.root;
        if let DecodedWord::Leaf { .. } = root.kind() {
            let node = self.new_node();
            let content = self.content(root);
            self.set(node, 0, root, &content);
            self.links.nodes[node as usize].content = content;
            self.set_root(node);
        }
        // What was built; a change follows.
        let before =
            Sums { area: self.links.area.get(), weighted: self.links.weighted.get(), visits: self.links.visits.get() };
        let WideBvh { baseline, nodes, bounds, .. } = &mut *self.bvh;
        let before = baseline.now.unwrap_or_else(|| predicted(before, visit(nodes.root, &baseline.costs), bounds));
        if n_primitives > 0 {
            baseline.built.get_or_insert(before);
        }
    }

    fn set_root(&mut self, node: u32) {
        let kind = self.links.nodes[node as usize].kind;
        self.bvh.nodes.root = ChildWord::node(kind, node as usize * ALIGNED_LINES);
        self.bvh.nodes.depth = self.bvh.nodes.depth.max(1);
        self.links.nodes[node as usize].parent = NO_NODE;
        self.links.is_scattered = true;
    }

    fn root(&self) -> Option<u32> {
        match self.bvh.nodes.root.kind() {
            DecodedWord::Node(_, line) => Some(number(line)),
            _ => None,
        }
    }

    pub(super) fn words(&self, node: u32) -> [ChildWord; 8] {
        *node_words(&self.bvh.nodes.lines, self.links.nodes[node as usize].kind, node * ALIGNED_LINES as u32)
    }

    /// What the box of a child depends on.
    pub(super) fn content(&self, word: ChildWord) -> Content {
        match word.kind() {
            DecodedWord::Empty => Content::EMPTY,
            DecodedWord::Node(_, line) => self.links.nodes[number(line) as usize].content,
            DecodedWord::Leaf { first, n } => {
                let leaves = &self.bvh.leaves;
                let ids = &leaves.order[first as usize..(first + n) as usize];
                content_of(&leaves.primitives, ids, &self.bvh.frame)
            }
        }
    }

    /// The contents of all children, together.
    fn joined(&self, node: u32) -> Content {
        self.words(node).into_iter().fold(Content::EMPTY, |all, word| all.union(self.content(word)))
    }

    /// Adds what a slot contributes to the predicted cost, as its record says, or subtracts it.
    fn weigh(&mut self, node: u32, slot: usize, sign: f64) {
        let word = self.words(node)[slot];
        if word == ChildWord::EMPTY {
            return;
        }
        let NodeBox { lo, hi, .. } = self.slot_box(node, slot);
        // Costs may be infinite, which would not cancel.
        let cost = sign * visit(word, &self.bvh.baseline.costs).min(f64::from(f32::MAX));
        self.links.weighted.add(cost * half_area(lo, hi));
        self.links.visits.add(cost);
    }

    /// The padded box in a slot, as rays test it.
    fn slot_box(&self, node: u32, slot: usize) -> NodeBox {
        let kind = self.links.nodes[node as usize].kind;
        NodeBox::of_slot(&self.bvh.nodes.lines, kind, node * ALIGNED_LINES as u32, slot, self.bvh.frame.rows)
    }

    fn add_area(&mut self, id: usize, sign: f64) {
        let area = Placed::given(&self.bvh.leaves.primitives[id]).area();
        self.links.area.add(sign * area);
    }

    /// Puts a child into a slot of an aligned node; what is below the child now knows the node.
    pub(super) fn set(&mut self, node: u32, slot: usize, word: ChildWord, content: &Content) {
        self.weigh(node, slot, -1.0);
        let line = node as usize * ALIGNED_LINES;
        let lines = &mut self.bvh.nodes.lines[line..line + ALIGNED_LINES];
        let pad = self.pads.of(NodeKind::Aligned, content.reach);
        let rows: &mut [Row] = bytemuck::cast_slice_mut(lines);
        write_box(&mut rows[..6], slot, (word != ChildWord::EMPTY).then_some((content.aligned, pad)));
        set_word(lines, NodeKind::Aligned, 0, slot, word);
        self.weigh(node, slot, 1.0);
        match word.kind() {
            DecodedWord::Empty => {}
            DecodedWord::Node(_, line) => self.links.nodes[number(line) as usize].parent = node,
            DecodedWord::Leaf { first, n } => {
                for id in &self.bvh.leaves.order[first as usize..(first + n) as usize] {
                    self.links.holders[id.index()] = node;
                }
            }
        }
    }

    /// Empties a slot.
    pub(super) fn clear(&mut self, node: u32, slot: usize) {
        self.set(node, slot, ChildWord::EMPTY, &Content::EMPTY);
    }

    /// Makes an oriented node an aligned one.
    pub(super) fn align(&mut self, node: u32) {
        if self.links.nodes[node as usize].kind == NodeKind::Aligned {
            return;
        }
        let words = self.words(node);
        (0..8).for_each(|slot| self.weigh(node, slot, -1.0));
        self.links.nodes[node as usize].kind = NodeKind::Aligned;
        self.empty_record(node);
        for (slot, &word) in words.iter().enumerate() {
            let content = self.content(word);
            self.set(node, slot, word, &content);
        }
        self.links.free_nodes.push(node + 1);
        self.links.is_scattered = true;
        // Its word has another kind; the box around it in an oriented node stays.
        let word = ChildWord::node(NodeKind::Aligned, node as usize * ALIGNED_LINES);
        match self.links.nodes[node as usize].parent {
            NO_NODE => self.bvh.nodes.root = word,
            parent => {
                let slot = self.slot_of(parent, node);
                self.weigh(parent, slot, -1.0);
                let kind = self.links.nodes[parent as usize].kind;
                set_word(&mut self.bvh.nodes.lines, kind, parent as usize * ALIGNED_LINES, slot, word);
                self.weigh(parent, slot, 1.0);
            }
        }
    }

    /// The slot of a node in the node above.
    fn slot_of(&self, parent: u32, node: u32) -> usize {
        let line = node * ALIGNED_LINES as u32;
        let is_node = |word: &ChildWord| matches!(word.kind(), DecodedWord::Node(_, of_word) if of_word == line);
        self.words(parent).iter().position(is_node).expect("links name the node above")
    }

    fn place_of(&self, id: PrimId) -> Place {
        let in_slot = |(slot, word): (usize, &ChildWord)| {
            let DecodedWord::Leaf { first, n } = word.kind() else { return None };
            let (first, n) = (first as usize, n as usize);
            let at = self.bvh.leaves.order[first..first + n].iter().position(|&other| other == id)?;
            Some(Place { slot, first, n, at: first + at })
        };
        let words = self.words(self.links.holders[id.index()]);
        words.iter().enumerate().find_map(in_slot).expect("links name the node above")
    }

    /// An aligned node without children.
    pub(super) fn new_node(&mut self) -> u32 {
        if self.links.free_nodes.is_empty() {
            let n = self.links.nodes.len();
            let more = n + (n / 2).max(4);
            self.bvh.nodes.lines = self.bvh.nodes.lines.grown(more * ALIGNED_LINES);
            self.links.nodes.resize(more, Link::NEW);
            self.links.free_nodes.extend((n as u32..more as u32).rev());
        }
        let node = self.links.free_nodes.pop().expect("there is free memory");
        self.links.nodes[node as usize] = Link::NEW;
        self.links.is_scattered = true;
        self.empty_record(node);
        node
    }

    /// Writes eight empty slots, whatever the record was.
    fn empty_record(&mut self, node: u32) {
        let line = node as usize * ALIGNED_LINES;
        let lines = &mut self.bvh.nodes.lines[line..line + ALIGNED_LINES];
        for slot in 0..8 {
            set_word(lines, NodeKind::Aligned, 0, slot, ChildWord::EMPTY);
            write_box(&mut bytemuck::cast_slice_mut::<_, Row>(lines)[..6], slot, None);
        }
    }

    /// Returns a node without children to free memory.
    pub(super) fn free_node(&mut self, node: u32) {
        self.links.nodes[node as usize] = Link::NEW;
        self.links.free_nodes.push(node);
    }

    /// Writes the boxes above a node in which one thing has changed, came or went, until nothing changes. Oriented boxes above depend on more than the
    /// contents, on every primitive below: all of them become aligned.
    fn refit(&mut self, mut node: u32, mut change: Change) {
        loop {
            let old = self.links.nodes[node as usize].content;
            let new = old.after_change(&change).unwrap_or_else(|| self.joined(node));
            let link = &mut self.links.nodes[node as usize];
            link.content = new;
            let parent = link.parent;
            if parent == NO_NODE || new == old && !self.bvh.nodes.has_oriented {
                return;
            }
            self.align(parent);
            if new != old {
                let slot = self.slot_of(parent, node);
                self.set(parent, slot, self.words(parent)[slot], &new);
            }
            (node, change) = (parent, Change { old, new });
        }
    }

    /// Adds a primitive, the last one.
    pub(super) fn insert(&mut self, primitive: P) {
        let id = self.bvh.n_primitives;
        self.bvh.leaves.primitives.push(primitive);
        self.bvh.n_primitives += 1;
        self.links.holders.push(NO_NODE);
        self.links.most_primitives = self.links.most_primitives.max(self.bvh.n_primitives);
        self.add_area(id, 1.0);
        self.attach(PrimId(id as u32));
    }

    /// Makes a leaf of a primitive.
    fn attach(&mut self, id: PrimId) {
        let order = &mut self.bvh.leaves.order;
        let place = self.links.free_places.pop().unwrap_or_else(|| {
            order.push(id);
            order.len() as u32 - 1
        });
        order[place as usize] = id;
        self.links.is_scattered = true;
        let leaf = ChildWord::leaf(place as usize, 1);
        let content = self.content(leaf);
        let (mut node, mut depth) = match self.root() {
            Some(root) => (root, 1),
            None => {
                let root = self.new_node();
                self.set_root(root);
                (root, 1)
            }
        };
        loop {
            let words = self.words(node);
            if let Some(slot) = words.iter().position(|&word| word == ChildWord::EMPTY) {
                self.align(node);
                self.set(node, slot, leaf, &content);
                break;
            }
            let slot = self.cheapest(node, &words, &content.aligned);
            depth += 1;
            if let DecodedWord::Node(_, line) = words[slot].kind() {
                node = number(line);
                continue;
            }
            // A node of both leaves in place of the old one.
            self.align(node);
            let pair = self.new_node();
            let old = self.content(words[slot]);
            self.set(pair, 0, words[slot], &old);
            self.set(pair, 1, leaf, &content);
            let both = old.union(content);
            self.links.nodes[pair as usize].content = both;
            self.set(node, slot, ChildWord::node(NodeKind::Aligned, pair as usize * ALIGNED_LINES), &both);
            break;
        }
        self.refit(node, Change { old: Content::EMPTY, new: content });
        if depth > self.links.most_depth() {
            let holder = self.links.holders[id.index()];
            depth = self.balance(holder, depth);
        }
        self.bvh.nodes.depth = self.bvh.nodes.depth.max(depth);
    }

    /// The child of a full node that a box is added to at the least predicted cost: a node grows, a leaf becomes a node.
    fn cheapest(&self, node: u32, words: &[ChildWord; 8], added: &Aabb) -> usize {
        // Ends by axis, then by slot.
        let (mut lo, mut hi) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        let is_aligned = self.links.nodes[node as usize].kind == NodeKind::Aligned;
        for slot in 0..8 {
            // The padded box will do, and is near; oriented ones are along other axes.
            let (min, max) = if is_aligned {
                let NodeBox { lo, hi, .. } = self.slot_box(node, slot);
                (lo, hi)
            } else {
                let Aabb { min, max } = self.content(words[slot]).aligned;
                (min.map(f64::from), max.map(f64::from))
            };
            for k in 0..3 {
                (lo[k][slot], hi[k][slot]) = (min[k], max[k]);
            }
        }
        let (mut own, mut grown) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for k in 0..3 {
            let ends = (f64::from(added.min[k]), f64::from(added.max[k]));
            for slot in 0..8 {
                own[k][slot] = hi[k][slot] - lo[k][slot];
                grown[k][slot] = hi[k][slot].max(ends.1) - lo[k][slot].min(ends.0);
            }
        }
        let area = |[x, y, z]: &[[f64; 8]; 3], i: usize| x[i] * y[i] + y[i] * z[i] + z[i] * x[i];
        let costs: [f64; 8] = std::array::from_fn(|slot| {
            let is_node = matches!(words[slot].kind(), DecodedWord::Node(..));
            area(&grown, slot) - if is_node { area(&own, slot) } else { 0.0 }
        });
        (1..8).fold(0, |best, slot| if costs[slot] < costs[best] { slot } else { best })
    }

    /// Takes a primitive out of its leaf, whose content was `before` with it.
    fn detach(&mut self, id: PrimId, before: &Content) {
        let node = self.links.holders[id.index()];
        self.align(node);
        let Place { slot, first, n, at } = self.place_of(id);
        let last = first + n - 1;
        let order = &mut self.bvh.leaves.order;
        order.swap(at, last);
        // No stale number stays behind.
        order[last] = PrimId(0);
        self.links.free_places.push(last as u32);
        self.links.is_scattered = true;
        let mut rest = Content::EMPTY;
        if n > 1 {
            let leaf = ChildWord::leaf(first, n - 1);
            rest = self.content(leaf);
            self.set(node, slot, leaf, &rest);
        } else {
            self.clear(node, slot);
        }
        if let Some(changed) = self.dissolve(node) {
            self.refit(changed, Change { old: *before, new: rest });
        }
    }

    /// Moves the children of a node that has lost one into the node above if they fit, and so on. Returns the node whose children changed
    /// last; none where no primitive is left.
    fn dissolve(&mut self, mut node: u32) -> Option<u32> {
        loop {
            let words = self.words(node);
            let used = (0..8).filter(|&slot| words[slot] != ChildWord::EMPTY).collect::<Vec<_>>();
            let parent = self.links.nodes[node as usize].parent;
            if parent == NO_NODE {
                match used[..] {
                    [] => {
                        self.free_node(node);
                        self.bvh.nodes.root = ChildWord::EMPTY;
                        self.bvh.nodes.depth = 0;
                        return None;
                    }
                    [only] => {
                        let DecodedWord::Node(_, line) = words[only].kind() else { return Some(node) };
                        // Its content is that of the child, which is up to date.
                        self.align(node);
                        self.clear(node, only);
                        self.free_node(node);
                        self.set_root(number(line));
                        self.bvh.nodes.depth -= 1;
                        return Some(number(line));
                    }
                    _ => return Some(node),
                }
            }
            let above = self.words(parent);
            let n_free = above.iter().filter(|&&word| word == ChildWord::EMPTY).count();
            if used.len() > n_free + 1 {
                return Some(node);
            }
            self.align(parent);
            self.align(node);
            let own = self.slot_of(parent, node);
            self.clear(parent, own);
            let free: Vec<usize> = (0..8).filter(|&slot| slot == own || above[slot] == ChildWord::EMPTY).collect();
            for (&slot, &to) in used.iter().zip(&free) {
                let content = self.content(words[slot]);
                self.clear(node, slot);
                self.set(parent, to, words[slot], &content);
            }
            self.free_node(node);
            node = parent;
        }
    }

    /// Removes a primitive; the last one takes its number.
    pub(super) fn remove(&mut self, id: PrimId) -> P {
        self.add_area(id.index(), -1.0);
        let Place { first, n, .. } = self.place_of(id);
        self.detach(id, &self.content(ChildWord::leaf(first, n)));
        let last = PrimId(self.bvh.n_primitives as u32 - 1);
        if last != id {
            let Place { at, .. } = self.place_of(last);
            self.bvh.leaves.order[at] = id;
        }
        self.links.holders.swap_remove(id.index());
        self.bvh.n_primitives -= 1;
        self.bvh.leaves.primitives.swap_remove(id.index())
    }

    /// Replaces a primitive; it gets other neighbors where it leaves its own, and now and then.
    pub(super) fn move_one(&mut self, id: PrimId, moved: P) -> P {
        let node = self.links.holders[id.index()];
        let Place { slot, .. } = self.place_of(id);
        let words = self.words(node);
        let before = self.content(words[slot]);
        self.add_area(id.index(), -1.0);
        let old = std::mem::replace(&mut self.bvh.leaves.primitives[id.index()], moved);
        self.add_area(id.index(), 1.0);
        let content = self.content(words[slot]);
        self.links.n_moves = self.links.n_moves.wrapping_add(1);
        // Neighbors that part step by step stay neighbors, so that all are looked for again in turn.
        let is_due = self.links.n_moves.is_multiple_of(MOVES);
        let around = self.links.nodes[node as usize].content.aligned;
        if is_due || is_apart(&before.aligned, &content.aligned) || !around.contains_box(&content.aligned) {
            self.detach(id, &before);
            self.attach(id);
        } else {
            self.align(node);
            self.set(node, slot, words[slot], &content);
            self.refit(node, Change { old: before, new: content });
        }
        old
    }
}

/// A primitive is taken out and inserted again at one of this many moves, wherever it moves to.
const MOVES: u32 = 8;

/// Whether two boxes have no point in common.
fn is_apart(a: &Aabb, b: &Aabb) -> bool {
    (0..3).any(|k| a.max[k] < b.min[k] || b.max[k] < a.min[k])
}

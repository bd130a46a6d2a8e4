//! Tree or loop: the binary tree of Embree's builder, with its spatial splits, in our nodes beside our own trees and Embree itself.
//!
//! ```text
//! mesh -> boxes -> Embree's builder -> two children a node -> TriangleBvh, timed and counted with ours
//!                                   -> eight children      -> a plain walk, counted
//! ```
//!
//! Holds: all `TriangleBvh`s have the same hits, bit for bit.

use std::fmt::Write;

use anyhow::{Context, Result, ensure};
use canted_fixtures::{
    SplitMix64,
    kinds::{self, RayKind},
};
use canted_lbvh::{Child, Corners, NodeId, Tree, triangle_corners};
use canted_obb::{Aabb, PrimId};
use canted_peers::embree::{self, Bounds, Library, Quality, Scene, Shape, Subtree};
use canted_sah::clip;
use canted_trace::Ray;
use canted_wide::{Config, Preset, TriangleBvh};

use super::Subject;
use crate::{
    options::Options,
    timing::ratio,
    wide::{
        embree::Embree,
        engine::{self, Engine, cpu},
    },
};

/// The kinds on which rays are slowest relative to Embree.
const KINDS: [&str; 4] = ["cave", "ribbons", "creature", "crystals"];

/// A tree of Embree's builder in our form: leaves are parts of triangles.
pub(crate) struct Converted {
    pub(crate) tree: Tree,
    /// The boxes of the leaves.
    pub(crate) parts: Vec<Aabb>,
}

/// Embree's tree of high quality over triangles, with nodes of this width.
pub(crate) fn built(library: &Library, corners: &[Corners], shape: &Shape) -> Result<embree::Tree> {
    let boxes: Vec<Bounds> = corners.iter().map(|corners| bounds_of(&Aabb::from_points(*corners))).collect();
    let split = |primitive: u32, [min, max]: Bounds, axis: usize, plane: f32| {
        let whole = Aabb { min, max };
        clip(&corners[primitive as usize], &whole, axis, plane).map(|part| bounds_of(&part.unwrap_or(Aabb::EMPTY)))
    };
    Ok(embree::build(library, &boxes, &split, shape)?)
}

fn bounds_of(aabb: &Aabb) -> Bounds {
    [aabb.min, aabb.max]
}

/// Writes nodes of two children; several children, and the triangles of a leaf, are halved in their order.
struct Pairs<'a> {
    tree: &'a embree::Tree,
    children: Vec<[Child; 2]>,
    parts: Vec<embree::Part>,
}

impl Pairs<'_> {
    fn subtree(&mut self, subtree: Subtree) -> Child {
        let tree = self.tree;
        match subtree {
            Subtree::Node(node) => self.halves(&tree.nodes[node], &|pairs, &(child, _)| pairs.subtree(child)),
            Subtree::Leaf(leaf) => self.halves(&tree.leaves[leaf], &|pairs, part| {
                pairs.parts.push(*part);
                Child::leaf(pairs.parts.len() as u32 - 1)
            }),
        }
    }

    fn halves<T>(&mut self, items: &[T], one: &impl Fn(&mut Self, &T) -> Child) -> Child {
        if let [item] = items {
            return one(self, item);
        }
        let id = NodeId(self.children.len() as u32);
        self.children.push([Child::inner(NodeId::ROOT); 2]);
        let (left, right) = items.split_at(items.len() / 2);
        self.children[id.index()] = [self.halves(left, one), self.halves(right, one)];
        Child::inner(id)
    }
}

impl Converted {
    /// # Errors Fewer than two leaves.
    pub(crate) fn of(tree: &embree::Tree) -> Result<Self> {
        let mut pairs = Pairs { tree, children: vec![], parts: vec![] };
        pairs.subtree(tree.root.context("no triangles")?);
        let mut found = Tree::from_children(&pairs.children)?;
        let part = |leaf: &PrimId| pairs.parts[leaf.index()];
        let aabb = |leaf| {
            let [min, max] = part(leaf).bounds;
            Aabb { min, max }
        };
        let parts = found.leaves.iter().map(aabb).collect();
        found.leaves.iter_mut().for_each(|leaf| *leaf = PrimId(part(leaf).primitive));
        Ok(Self { tree: found, parts })
    }
}

/// Visits of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Visited {
    pub(crate) nodes: u64,
    pub(crate) leaves: u64,
    /// Of four triangles, as Embree's leaves have them; of ours, of eight.
    pub(crate) blocks: u64,
    /// Only of ours.
    pub(crate) exact: u64,
}

impl Visited {
    pub(crate) fn of(bvh: &TriangleBvh, rays: &[Ray]) -> Self {
        let counts = bvh.traversal_counts(rays);
        Self { nodes: counts.nodes.iter().sum(), leaves: counts.leaves, blocks: counts.blocks, exact: counts.exact }
    }

    /// Per ray, as cells of the table.
    pub(crate) fn cells(&self, n_rays: usize) -> String {
        let per_ray = |n: u64| n as f64 / n_rays as f64;
        let exact = if self.exact > 0 { format!("{:.2}", per_ray(self.exact)) } else { "–".to_owned() };
        format!("{:.1} / {:.2} / {:.2} / {exact}", per_ray(self.nodes), per_ray(self.leaves), per_ray(self.blocks))
    }
}

/// The nearest hit in `f64` by a plain walk through Embree's tree, nearer children first; counts what it visits.
pub(crate) fn walk(tree: &embree::Tree, corners: &[Corners], ray: &Ray, visited: &mut Visited) -> Option<f64> {
    let (origin, direction) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let (mut t_max, mut hit) = (f64::from(ray.t_max), None);
    let mut open: Vec<(f64, Subtree)> = tree.root.map(|root| (0.0, root)).into_iter().collect();
    while let Some((near, subtree)) = open.pop() {
        if near > t_max {
            continue;
        }
        match subtree {
            Subtree::Node(node) => {
                visited.nodes += 1;
                let first = open.len();
                for &(child, [min, max]) in &tree.nodes[node] {
                    let (mut near, mut far) = (f64::from(ray.t_min), t_max);
                    for k in 0..3 {
                        let [a, b] = [min[k], max[k]].map(|plane| f64::from(plane) - origin[k]);
                        // A parallel ray is between both planes or nowhere: 0 / 0 is in none of these.
                        let [a, b] = if direction[k] != 0.0 {
                            [a / direction[k], b / direction[k]]
                        } else if a <= 0.0 && 0.0 <= b {
                            continue;
                        } else {
                            [f64::INFINITY; 2]
                        };
                        near = near.max(a.min(b));
                        far = far.min(a.max(b));
                    }
                    if near <= far {
                        open.push((near, child));
                    }
                }
                open[first..].sort_by(|a, b| b.0.total_cmp(&a.0));
            }
            Subtree::Leaf(leaf) => {
                let parts = &tree.leaves[leaf];
                visited.leaves += 1;
                visited.blocks += parts.len().div_ceil(4) as u64;
                for part in parts {
                    let t = hit_of(&corners[part.primitive as usize], origin, direction);
                    if let Some(t) = t.filter(|&t| f64::from(ray.t_min) <= t && t <= t_max) {
                        (t_max, hit) = (t, Some(t));
                    }
                }
            }
        }
    }
    hit
}

/// Where the line meets a triangle (Möller and Trumbore 1997).
fn hit_of(corners: &Corners, origin: [f64; 3], direction: [f64; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| glam::DVec3::from_array(corner.map(f64::from)));
    let (origin, direction) = (glam::DVec3::from_array(origin), glam::DVec3::from_array(direction));
    let (e1, e2, s) = (b - a, c - a, origin - a);
    let p = direction.cross(e2);
    let recip = 1.0 / e1.dot(p);
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) * recip, direction.dot(q) * recip);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q) * recip)
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let library = embree::libraries().into_iter().next().context("no Embree in the system or at `CANTED_EMBREE`")?;
    let _ = writeln!(
        out,
        "\n## Tree or loop\n\nSeed {}; one thread; engines take turns every 8,192 rays, {} rounds after a warm-up. Rates: rays a second relative \
         to Embree high, thread time, medians. *Its tree*: the binary tree of Embree's builder of high quality (spatial splits) in our nodes. \
         Visits a ray of the search for the closest hit: nodes of eight / leaves / blocks / triangles decided alone, of ours blocks of \
         eight; *its walk*: Embree's own nodes of eight and blocks of four, by a plain walk. The hits of all of ours are equal.\n\n\
         | kind | triangles | rays | quality | aligned | its tree | its tree, aligned | visits: quality | aligned | its tree, aligned | its walk |\n|{}",
        options.seed,
        options.rounds,
        " --- |".repeat(11)
    );
    let mut rng = SplitMix64::new(options.seed);
    for name in options.scenes(&KINDS) {
        let kind = kinds::named(&name).with_context(|| format!("there is no kind '{name}'"))?;
        let subject = Subject::generated(kind, super::size(kind, options.is_quick, &mut rng), options)?;
        ensure!(subject.model.placed.is_none(), "{name}: a scene of two levels has more than one tree");
        // A pool of one thread builds and traces everything on one thread.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        out.push_str(&one.install(|| rows(&library, &subject, options.rounds))?);
    }
    Ok(())
}

/// Rows of a kind, one for each kind of rays.
fn rows(library: &Library, subject: &Subject, rounds: usize) -> Result<String> {
    let mesh = &subject.model.mesh;
    let (corners, bounds) = triangle_corners(&mesh.positions, &mesh.triangles)?;
    let wide = built(library, &corners, &Shape::HIGH)?;
    let Converted { tree, parts } = Converted::of(&built(library, &corners, &Shape { width: 2, ..Shape::HIGH })?)?;
    let quality = Config::preset(Preset::Quality);
    let ours = [quality, quality.axis_aligned()]
        .map(|config| TriangleBvh::build_with(&mesh.positions, &mesh.triangles, config));
    let theirs = [quality, quality.axis_aligned()]
        .map(|config| TriangleBvh::from_tree_of_parts(&tree, parts.clone(), &corners, &bounds, config));
    let bvhs = ours.into_iter().chain(theirs).collect::<Result<Vec<_>, _>>()?;
    let options = embree::Options { quality: Quality::High, is_robust: false, n_threads: 1 };
    let mesh_of = embree::Mesh { positions: &mesh.positions, triangles: &mesh.triangles };
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Embree(Scene::of_mesh(library, &mesh_of, &options)?))];
    engines.extend(bvhs.iter().map(|bvh| Box::new(bvh.clone()) as Box<dyn Engine>));
    let mut text = String::new();
    for (kind, rays) in &subject.sets {
        let is_occlusion = *kind == RayKind::Occlusion;
        let (seconds, answers) = engine::answers(&engines, rays, rounds, is_occlusion);
        ensure!(answers[2..].iter().all(|other| *other == answers[1]), "{}: the tree changes a hit", subject.name);
        let cpu: Vec<Vec<f64>> = seconds.iter().map(|seconds| cpu(seconds)).collect();
        let _ = write!(text, "| {} | {} | {} |", subject.name, corners.len(), kind.name());
        for ours in &cpu[1..] {
            let _ = write!(text, " {:.2} |", ratio(&cpu[0], ours));
        }
        if is_occlusion {
            let _ = writeln!(text, "{}", " – |".repeat(4));
            continue;
        }
        for bvh in [&bvhs[0], &bvhs[1], &bvhs[3]] {
            let _ = write!(text, " {} |", Visited::of(bvh, rays).cells(rays.len()));
        }
        let mut visited = Visited::default();
        for ray in rays {
            walk(&wide, &corners, ray, &mut visited);
        }
        let _ = writeln!(text, " {} |", visited.cells(rays.len()));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use canted_fixtures::kinds;

    use super::*;

    fn quick() -> Options {
        Options::read(["trees", "--quick", "--rounds", "1"].map(str::to_owned).into_iter()).unwrap()
    }

    /// A tree as Embree's callbacks leave it: three children in the root, a leaf of three parts, one triangle in two leaves.
    fn small() -> embree::Tree {
        let part = |primitive: u32| embree::Part { primitive, bounds: [[primitive as f32; 3], [9.0; 3]] };
        let above = |z: f32| [[-9.0, -9.0, z], [9.0; 3]];
        embree::Tree {
            root: Some(Subtree::Node(1)),
            nodes: vec![
                vec![(Subtree::Leaf(0), above(1.0)), (Subtree::Leaf(2), above(4.0))],
                vec![(Subtree::Node(0), above(1.0)), (Subtree::Leaf(1), above(3.0)), (Subtree::Leaf(3), above(1.0))],
            ],
            leaves: vec![vec![part(4), part(1), part(0)], vec![part(2)], vec![part(3)], vec![part(0)]],
        }
    }

    #[test]
    fn every_part_is_a_leaf_with_its_box() {
        let Converted { tree, parts } = Converted::of(&small()).unwrap();
        assert_eq!(tree.leaves.iter().map(|leaf| leaf.0).collect::<Vec<_>>(), [4, 1, 0, 3, 2, 0]);
        assert!(tree.leaves.iter().zip(&parts).all(|(leaf, part)| part.min[0] == leaf.0 as f32));
        let alone = embree::Tree { root: Some(Subtree::Leaf(1)), ..small() };
        assert!(Converted::of(&alone).is_err(), "one leaf is no tree of pairs");
        assert!(Converted::of(&embree::Tree::default()).is_err());
    }

    #[test]
    fn a_walk_counts_and_finds_what_a_loop_finds() {
        let corners: Vec<Corners> =
            (0..5u8).map(|i| f32::from(i) + 1.0).map(|z| [[-9.0, -9.0, z], [9.0, -9.0, z], [0.0, 9.0, z]]).collect();
        let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
        let mut visited = Visited::default();
        assert_eq!(walk(&small(), &corners, &ray, &mut visited), Some(1.0));
        // Two of the four leaves start behind the hit.
        assert_eq!(visited, Visited { nodes: 2, leaves: 2, blocks: 2, exact: 0 });
        let away = Ray::new([0.0, 0.0, 10.0], [0.0, 0.0, 1.0]);
        assert_eq!(walk(&small(), &corners, &away, &mut Visited::default()), None);
    }

    #[test]
    fn embrees_tree_has_every_triangle_and_the_hits_of_ours() {
        let Some(library) = embree::libraries().into_iter().next() else { return };
        let options = quick();
        let subject = Subject::generated(kinds::named("crystals").unwrap(), 3_000, &options).unwrap();
        let mesh = &subject.model.mesh;
        let (corners, _) = triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
        let tree = built(&library, &corners, &Shape::HIGH).unwrap();
        let mut references = BTreeMap::new();
        for part in tree.leaves.iter().flatten() {
            *references.entry(part.primitive).or_insert(0) += 1;
        }
        assert_eq!(references.len(), corners.len());
        assert!(references.values().any(|&n| n > 1), "long triangles are split");
        assert!(tree.nodes.iter().all(|node| (2..=8).contains(&node.len())));
        let rows = rows(&library, &subject, 1).unwrap();
        assert_eq!(rows.lines().count(), 4, "{rows}");
        // The walk finds what a loop finds, and another hit where triangles are missing.
        let looped = |ray: &Ray| {
            let t = |corners| hit_of(corners, ray.origin.map(f64::from), ray.direction.map(f64::from));
            let is_on_ray = |t: &f64| f64::from(ray.t_min) <= *t && *t <= f64::from(ray.t_max);
            corners.iter().filter_map(t).filter(is_on_ray).min_by(f64::total_cmp)
        };
        let rays = &subject.sets[0].1[..400];
        let n_wrong = |tree: &embree::Tree| {
            rays.iter().filter(|ray| walk(tree, &corners, ray, &mut Visited::default()) != looped(ray)).count()
        };
        assert_eq!(n_wrong(&tree), 0);
        let mut broken = tree;
        broken.leaves.iter_mut().step_by(2).for_each(Vec::clear);
        assert!(n_wrong(&broken) > 0);
    }
}

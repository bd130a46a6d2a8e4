//! BVHs from device memory, checked, as those of the CPU.
//!
//! Nodes on the device lie apart: a binary tree leaves the slot of its last leaf empty, and every wide tree has memory for the largest
//! possible number of nodes. So the hierarchy is followed from the root, and what it reaches is moved together.

use canted_bvh2::{Bvh2, PairOrder};
use canted_lbvh::{self as lbvh, Child, ChildKind, Corners, NodeId, Tree, VolumeConfig, Volumes};
use canted_obb::vector::{dot, sub, to_f64};
use canted_obb::{Aabb, Frame, Obb, PrimId};
use canted_trace::TriangleTest;
use canted_wide::{RawBvh, TriangleBvh};

use super::TracedScene;
use super::layout::{BvhHeader, EMPTY, LEAF, Quad};
use super::leaf_triangles::in_blocks;
use super::nodes::{Nodes, WideNodes};
use super::packed::unpacked;
use crate::{Gpu, GpuError};

/// A BVH that was read back from a device: see [`TracedScene::download`].
#[derive(Clone, Debug)]
pub enum DownloadedBvh {
    /// A binary one, which the device built.
    Binary(Bvh2),
    /// A wide one, which the device or the CPU built.
    Wide(TriangleBvh),
}

impl TracedScene {
    /// The BVH of a scene of one level as one of the CPU, with the watertight test: its hierarchy and the axes of its boxes are those on the
    /// device. Waits for the device.
    ///
    /// All of it is checked: each triangle is in one leaf, and inside of all boxes above it. Boxes have the extents and the padding of the CPU, so hits
    /// are those of any BVH of the CPU over the same triangles.
    ///
    /// # Errors
    /// A scene of two levels, for which [`TracedScene::download_mesh`] is; structures of the driver; a BVH that is damaged; the device is
    /// lost.
    pub async fn download(&self, gpu: &Gpu) -> Result<DownloadedBvh, GpuError> {
        self.check_downloads()?;
        if self.tables().instances().is_some() {
            let what = "a download of a scene of two levels as one BVH; download its meshes".to_owned();
            return Err(GpuError::Unsupported { what });
        }
        self.download_number(gpu, 0).await
    }

    /// As [`TracedScene::download`], the BVH of a mesh, in its object space.
    ///
    /// # Errors
    /// A mesh that the scene does not have; as for [`TracedScene::download`].
    pub async fn download_mesh(&self, gpu: &Gpu, mesh: usize) -> Result<DownloadedBvh, GpuError> {
        self.check_downloads()?;
        // The first header of two levels is that of the top level.
        let n_above = usize::from(self.tables().instances().is_some());
        let n_meshes = self.tables().headers().len() - n_above;
        if mesh >= n_meshes {
            return Err(GpuError::Input {
                message: format!("there is no mesh {mesh} in a scene of {n_meshes} meshes"),
            });
        }
        self.download_number(gpu, mesh + n_above).await
    }

    /// Rejects scenes whose BVHs have no form here.
    fn check_downloads(&self) -> Result<(), GpuError> {
        let what = match self.nodes {
            Nodes::Driver(_) => "structures of the driver",
            _ if self.has_curves() => "a scene with curves",
            _ => return Ok(()),
        };
        Err(GpuError::Unsupported { what: format!("a download of {what}") })
    }

    /// The BVH with a header.
    async fn download_number(&self, gpu: &Gpu, number: usize) -> Result<DownloadedBvh, GpuError> {
        let header = gpu.read(self.tables().headers()).await?[number];
        let flawed = |flaw: String| GpuError::Input { message: format!("the BVH on the device is damaged: {flaw}") };
        match &self.nodes {
            Nodes::Binary(pairs) => {
                let read = ReadPairs {
                    quads: gpu.read(&pairs.pairs).await?,
                    corners: gpu.read(&pairs.corners).await?,
                    is_oriented: pairs.is_oriented,
                };
                read.bvh(&header).map(DownloadedBvh::Binary).map_err(flawed)
            }
            Nodes::Wide(WideNodes { nodes, triangles, .. }) => {
                let [nodes, triangles] = [gpu.read(nodes).await?, gpu.read(triangles).await?];
                wide(&nodes, &triangles, &header).map(DownloadedBvh::Wide).map_err(flawed)
            }
            Nodes::Driver(_) => Err(flawed("the driver has it".to_owned())),
        }
    }
}

/// A wide BVH in these words.
fn wide(nodes: &[Quad], triangles: &[Quad], header: &BvhHeader) -> Result<TriangleBvh, String> {
    let [mut root, first_quad, first_triangle, _] = header.words;
    let own = nodes.get(first_quad as usize..).zip(triangles.get(first_triangle as usize..));
    let (nodes, triangles) = own.ok_or("it starts beyond its memory")?;
    let mut nodes = nodes.as_flattened().to_vec();
    let blocks = in_blocks(&mut nodes, &mut root, triangles)?;
    let (nodes, root) = unpacked(&nodes, root)?;
    let frame = header.rows.map(|[x, y, z, _]| [x, y, z]);
    let raw =
        RawBvh { nodes: nodes.into(), blocks: &blocks, order: &[], root, depth: 0, frame, reach: header.rows[0][3] };
    TriangleBvh::from_raw(&raw, TriangleTest::Watertight).map_err(|error| error.to_string())
}

/// Binary BVHs as they are in device memory: see `build/scene/pairs`.
struct ReadPairs {
    quads: Vec<Quad>,
    corners: Vec<Corners>,
    is_oriented: bool,
}

/// A child: its word and its box.
#[derive(Clone, Copy)]
struct ReadChild {
    word: u32,
    /// Axes, the point that the ends are relative to, lower and upper ends.
    axes: Frame,
    center: [f32; 3],
    ends: [[f32; 3]; 2],
}

impl ReadPairs {
    /// Quads of a child.
    fn n_quads(&self) -> usize {
        if self.is_oriented { 4 } else { 2 }
    }

    /// The children of a node; `None` if there is no such node.
    fn children(&self, node: u32) -> Option<[ReadChild; 2]> {
        let n = self.n_quads();
        let first = 2 * n * node as usize;
        let quads = self.quads.get(first..first + 2 * n)?;
        Some([0, 1].map(|i| self.child(&quads[i * n..(i + 1) * n])))
    }

    fn child(&self, quads: &[Quad]) -> ReadChild {
        let three = |quad: &Quad| [0, 1, 2].map(|k| f32::from_bits(quad[k]));
        if !self.is_oriented {
            let ends = [three(&quads[0]), three(&quads[1])];
            return ReadChild { word: quads[0][3], axes: Obb::IDENTITY_FRAME, center: [0.0; 3], ends };
        }
        let halves = [0, 1, 2].map(|k| f32::from_bits(quads[k][3]));
        let axes = [0, 1, 2].map(|k| three(&quads[k]));
        ReadChild { word: quads[3][3], axes, center: three(&quads[3]), ends: [halves.map(|half| -half), halves] }
    }

    /// The BVH with a header.
    fn bvh(&self, header: &BvhHeader) -> Result<Bvh2, String> {
        let [root, _, first_triangle, _] = header.words;
        let tree = self.tree(root, first_triangle)?;
        let n = tree.leaves.len();
        let own = self.corners.get(first_triangle as usize..).and_then(|own| own.get(..n));
        let own = own.ok_or_else(|| format!("{n} triangles from {first_triangle} on of {}", self.corners.len()))?;
        if let Some(primitive) = own.iter().position(|corners| !corners.as_flattened().iter().all(|x| x.is_finite())) {
            return Err(format!("primitive {primitive} is not finite"));
        }
        let sorted = lbvh::in_leaf_order(own, &tree.leaves);
        let bounds = Aabb::from_points(own.iter().flatten().copied());
        let volumes = self.volumes(root, &tree, &sorted, &bounds)?;
        lbvh::check(&tree, &volumes, &sorted).map_err(|flaw| flaw.to_string())?;
        Ok(Bvh2::new(tree, &volumes, sorted, &bounds, PairOrder::DepthFirst, TriangleTest::Watertight))
    }

    /// The topology below a root, over triangles from the first one of a mesh on.
    fn tree(&self, root: u32, first_triangle: u32) -> Result<Tree, String> {
        let primitive = |word: u32| (word & !LEAF).checked_sub(first_triangle).ok_or_else(|| no_node(word));
        if root == EMPTY {
            return Ok(lbvh::radix(lbvh::sort_by_code(&[], lbvh::Bits::B30)));
        }
        if root & LEAF != 0 {
            let of_one = lbvh::radix(lbvh::sort_by_code(&[0], lbvh::Bits::B30));
            return if primitive(root)? == 0 { Ok(of_one) } else { Err(no_node(root)) };
        }
        // Each node that is reached, in place of its number on the device.
        let mut children: Vec<[Child; 2]> = vec![[Child::leaf(0); 2]];
        let mut is_seen = vec![false; self.quads.len() / (2 * self.n_quads())];
        let mut open = vec![(root, 0_usize)];
        while let Some((node, number)) = open.pop() {
            let pair = self.children(node).ok_or_else(|| no_node(node))?;
            if std::mem::replace(&mut is_seen[node as usize], true) {
                return Err(format!("node {node} has two parents"));
            }
            for (side, child) in pair.iter().enumerate() {
                children[number][side] = if child.word & LEAF != 0 {
                    Child::leaf(primitive(child.word)?)
                } else {
                    open.push((child.word, children.len()));
                    children.push([Child::leaf(0); 2]);
                    Child::inner(NodeId(children.len() as u32 - 1))
                };
            }
        }
        Tree::from_children(&children).map_err(|error| error.to_string())
    }

    /// The volumes of a tree that has the topology below a root; all boxes must hold what is below them.
    fn volumes(&self, root: u32, tree: &Tree, sorted: &[Corners], bounds: &Aabb) -> Result<Volumes, String> {
        // The box of the root is not stored.
        let mut frames = vec![Obb::IDENTITY_FRAME; tree.nodes.len()];
        let slack = f64::from(f32::EPSILON) * f64::from(bounds.reach());
        let mut open = vec![(root, tree.root())];
        while let Some((word, of_tree)) = open.pop() {
            let Some(ChildKind::Inner(id)) = of_tree.map(Child::kind) else { continue };
            let node = &tree.nodes[id.index()];
            let pair = self.children(word).ok_or_else(|| no_node(word))?;
            for (child, of_tree) in pair.iter().zip([node.left, node.right]) {
                let leaves = match of_tree.kind() {
                    ChildKind::Leaf(position) => position..position + 1,
                    ChildKind::Inner(id) => {
                        frames[id.index()] = child.axes;
                        let node = &tree.nodes[id.index()];
                        node.first..node.last + 1
                    }
                };
                for position in leaves {
                    if !sorted[position as usize].iter().all(|vertex| child.holds(*vertex, slack)) {
                        let PrimId(primitive) = tree.leaves[position as usize];
                        return Err(format!("primitive {primitive} is outside of a box of node {word}"));
                    }
                }
                open.push((child.word, Some(of_tree)));
            }
        }
        Ok(match self.is_oriented {
            true => lbvh::volumes_along(tree, sorted, &frames),
            false => lbvh::volumes(tree, sorted, &VolumeConfig::default()),
        })
    }
}

impl ReadChild {
    /// Whether the box holds a vertex, but for a rounding of its numbers.
    fn holds(&self, vertex: [f32; 3], slack: f64) -> bool {
        let from_center = sub(to_f64(vertex), to_f64(self.center));
        (0..3).all(|k| {
            let at = dot(to_f64(self.axes[k]), from_center);
            // False for NaN, too.
            f64::from(self.ends[0][k]) - slack <= at && at <= f64::from(self.ends[1][k]) + slack
        })
    }
}

fn no_node(word: u32) -> String {
    format!("word {word:#010x} names nothing of this BVH")
}

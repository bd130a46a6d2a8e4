//! Camera rays of pictures from a moving camera (Silva's animations, Novak's real time), and packets of neighboring rays (Silva).

use std::time::Instant;

use anyhow::Result;
use canted_fixtures::View;
use canted_gpu::{AdapterKind, Choice, Gpu, Options, Outcome, Source, TracedScene, block_on};
use canted_lbvh::{ChildKind, NodeId, Tree, VolumeConfig, Volumes, volumes};
use canted_obb::{Aabb, Obb};
use canted_sah::{TopDownConfig, top_down};
use canted_trace::{Hit, Intersect, Ray, ray_aabb};
use canted_wide::{Config, Preset, TriangleBvh};
use rayon::prelude::*;

use super::{Found, scenes};
use crate::{
    models::{self, Model},
    report::{
        model::{Axis, Cell, Chapter, Effort, Point, Series, Table},
        samples::{Samples, number},
    },
    timing,
};

/// The camera of a picture on a closed way through the views of a model.
fn view(views: &[View; 4], picture: usize, n_pictures: usize) -> View {
    let along = (picture * views.len()) as f64 / n_pictures as f64;
    let (from, part) = (along as usize % views.len(), along.fract());
    let [a, b] = [views[from], views[(from + 1) % views.len()]];
    let between = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| a[k] + part * (b[k] - a[k]));
    View { eye: between(a.eye, b.eye), target: between(a.target, b.target), ..a }
}

/// Rays of one job.
const CHUNK: usize = 1024;

/// A hundred pictures of a moving camera: rays a second of each.
pub(super) fn moving(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let (n_pictures, resolution) = effort.pick((5, 8), (100, 128), (100, 256));
    let n_threads = rayon::current_num_threads();
    let title = format!(
        "Camera rays of {n_pictures} pictures of {resolution} x {resolution} from a moving camera, {n_threads} threads, WideBvh balanced"
    );
    let head = ["scene", "on", "rays", "seconds", "M rays/s", "least", "most", "pictures a second", "hit"];
    let mut table = Table::new(title, &head);
    let (mut series, mut found) = (vec![], vec![]);
    let gpu = block_on(Gpu::open(&Choice::Best)).ok();
    for (name, model) in scenes(effort, &["sponza", "country_kitchen", models::BUILT_IN], chapter)? {
        let bvh =
            TriangleBvh::build_with(&model.mesh.positions, &model.mesh.triangles, Config::preset(Preset::Balanced))?;
        let on_cpu = |rays: &[Ray]| -> Result<usize> {
            let of = |rays: &[Ray]| {
                let mut hits = vec![None; rays.len()];
                bvh.closest_hits(rays, &mut hits);
                hits.iter().flatten().count()
            };
            Ok(rays.par_chunks(CHUNK).map(of).sum())
        };
        let pictures = pictures(&model, n_pictures, resolution, on_cpu)?;
        found.push(format!("{name} {} M", number(Samples::from(pictures.rates.clone()).median())));
        let point = |(i, &rate): (usize, &f64)| Point::new(String::new(), i as f64, rate);
        series.push(Series::line(name, pictures.rates.iter().enumerate().map(point).collect()));
        table.rows.push(pictures.row(name, "CPU".to_owned()));
        let Some(gpu) = &gpu else { continue };
        let scene = block_on(TracedScene::new(gpu, Source::wide(&bvh), Options::default()))?;
        let on_device = |rays: &[Ray]| -> Result<usize> {
            let hits = block_on(scene.closest_hits(gpu, rays))?;
            Ok(hits.iter().filter(|hit| matches!(hit, Outcome::Complete(Some(_)))).count())
        };
        // A software driver takes a second for 65,536 rays.
        let resolution = if gpu.info().kind == AdapterKind::Software { resolution.min(64) } else { resolution };
        let device = self::pictures(&model, n_pictures, resolution, on_device)?;
        table.rows.push(device.row(name, format!("{}, {resolution} x {resolution}, with transfers", gpu.info().name)));
    }
    table.says = format!(
        "Silva and Novak state no rays of their animations. Here, camera rays a second (median of pictures, wall time; other processes were running): {}.",
        found.join(", ")
    );
    let says = table.says.clone();
    chapter.tables.push(table);
    chapter.plot(
        "Camera rays a second along the way of a camera",
        Axis::linear("picture"),
        Axis::linear("M rays/s"),
        series,
    );
    Ok(Found::from(says))
}

/// Rates of pictures.
struct Pictures {
    n_rays: usize,
    n_hits: usize,
    seconds: f64,
    /// Million rays a second of each picture.
    rates: Vec<f64>,
}

impl Pictures {
    fn row(&self, scene: &str, on: String) -> Vec<Cell> {
        let [least, most] = timing::range(&self.rates);
        let hit = 100.0 * self.n_hits as f64 / self.n_rays as f64;
        let texts = [
            scene.to_owned(),
            on,
            self.n_rays.to_string(),
            number(self.seconds),
            number(timing::median(&self.rates)),
            number(least),
            number(most),
            number(self.rates.len() as f64 / self.seconds),
            format!("{hit:.0}%"),
        ];
        texts.map(Cell::text).to_vec()
    }
}

/// Traces all pictures, of which `trace` returns the number of hits; the first is traced once more before, as a warm-up.
fn pictures(
    model: &Model,
    n_pictures: usize,
    resolution: u32,
    trace: impl Fn(&[Ray]) -> Result<usize>,
) -> Result<Pictures> {
    let mut all = Pictures { n_rays: 0, n_hits: 0, seconds: 0.0, rates: vec![] };
    for (turn, picture) in std::iter::once(0).chain(0..n_pictures).enumerate() {
        let rays: Vec<Ray> = view(&model.views, picture, n_pictures).rays(resolution).iter().map(models::ray).collect();
        let start = Instant::now();
        let n_hits = trace(&rays)?;
        let seconds = start.elapsed().as_secs_f64();
        if turn == 0 {
            continue;
        }
        all.n_rays += rays.len();
        all.n_hits += n_hits;
        all.seconds += seconds;
        all.rates.push(rays.len() as f64 * 1e-6 / seconds);
    }
    Ok(all)
}

/// Rays of a packet: blocks of pixels.
const PACKETS: [[usize; 2]; 3] = [[2, 2], [4, 2], [4, 4]];

/// How many rays of a packet visit the nodes that any of them visits.
pub(super) fn packets(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = ["scene", "rays", "rays a packet", "nodes a ray", "nodes a packet", "rays at a node", "lanes in use"];
    let mut table =
        Table::new("Packets of neighboring and of scattered rays (Silva): nodes on the way to the hits", &head);
    let mut found = vec![];
    let resolution = effort.pick(8, 64, 128);
    for (name, model) in scenes(effort, &["bunny", "sponza", "truss"], chapter)? {
        let mesh = &model.mesh;
        let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::preset(Preset::Balanced))?;
        let boxes: Vec<Aabb> = (0..mesh.triangles.len())
            .map(|i| Aabb::from_points(mesh.corners(i).map(|p| p.map(|x| x as f32))))
            .collect();
        let nodes = Nodes::over(&boxes);
        let camera = models::camera(&model, resolution);
        let mut hits = vec![None; camera.len()];
        bvh.closest_hits(&camera, &mut hits);
        let [scattered, _] = models::secondary(&model, &camera, &hits);
        for (kind, rays) in [("camera", camera), ("scattered", scattered)] {
            let ends = ended(&bvh, &rays);
            for [width, height] in PACKETS {
                let size = width * height;
                // Scattered rays are in the order of their pixels, without those that miss.
                let order = if kind == "camera" {
                    blocks(resolution as usize, [width, height], rays.len())
                } else {
                    (0..rays.len()).collect()
                };
                let ordered: Vec<Ray> = order.iter().map(|&i| ends[i]).collect();
                let [n_packets, n_visits] = ordered.chunks_exact(size).fold([0, 0], |[packets, visits], packet| {
                    let [nodes, rays] = nodes.visits(packet);
                    [packets + nodes, visits + rays]
                });
                let n_whole = (ordered.len() / size).max(1) as f64;
                let at_a_node = n_visits as f64 / n_packets.max(1) as f64;
                let values = [n_visits as f64 / n_whole / size as f64, n_packets as f64 / n_whole, at_a_node];
                let mut row = [name.to_owned(), kind.to_owned(), size.to_string()].map(Cell::text).to_vec();
                row.extend(values.map(|x| Cell::text(number(x))));
                row.push(Cell::text(format!("{:.0}%", 100.0 * at_a_node / size as f64)));
                table.rows.push(row);
                if size == 8 {
                    found.push(format!("{name} {kind} {:.0}%", 100.0 * at_a_node / size as f64));
                }
            }
        }
    }
    table.says = format!(
        "Silva expects a gain from packets of coherent rays and does not build them. A packet of eight rays keeps this part of its lanes busy: {}. One ray of a \
         WideBvh tests the eight boxes of a node at once and keeps all of them busy, so packets save only where rays share memory and bounds; those that were built \
         gained for camera rays alone (`benches/TRIED.md`) and are not kept.",
        found.join(", ")
    );
    let says = table.says.clone();
    chapter.tables.push(table);
    Ok(Found::from(says))
}

/// The rays up to their hits.
fn ended(bvh: &TriangleBvh, rays: &[Ray]) -> Vec<Ray> {
    let mut hits = vec![None; rays.len()];
    bvh.closest_hits(rays, &mut hits);
    let end = |(ray, hit): (&Ray, Option<Hit>)| ray.between(ray.t_min, hit.map_or(ray.t_max, |hit| hit.t));
    rays.iter().zip(hits).map(end).collect()
}

/// The order of `n` pixels of square pictures by blocks, row by row.
fn blocks(resolution: usize, [width, height]: [usize; 2], n: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|&i| {
        let (row, column) = (i / resolution, i % resolution);
        (row / height, column / width, row, column)
    });
    order
}

/// A binary tree by SAH with its boxes.
struct Nodes {
    tree: Tree,
    volumes: Volumes,
}

impl Nodes {
    fn over(boxes: &[Aabb]) -> Self {
        let tree = top_down(boxes, &TopDownConfig::BINNED);
        let leaves: Vec<Obb> = tree.leaves.iter().map(|leaf| Obb::from_aabb(&boxes[leaf.index()])).collect();
        let volumes = volumes(&tree, &leaves, &VolumeConfig::default());
        Self { tree, volumes }
    }

    /// Inner nodes that any ray of a packet enters before its end, and how many rays enter each, summed.
    fn visits(&self, rays: &[Ray]) -> [usize; 2] {
        let mut found = [0; 2];
        let mut stack = vec![(NodeId::ROOT, (0..rays.len()).collect::<Vec<_>>())];
        while let Some((id, entering)) = stack.pop() {
            let aabb = &self.volumes.aabbs[id.index()];
            let entered: Vec<usize> = entering.into_iter().filter(|&i| ray_aabb(&rays[i], aabb).is_some()).collect();
            if entered.is_empty() {
                continue;
            }
            found = [found[0] + 1, found[1] + entered.len()];
            let node = &self.tree.nodes[id.index()];
            for child in [node.left, node.right] {
                if let ChildKind::Inner(id) = child.kind() {
                    stack.push((id, entered.clone()));
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_rays_fill_a_packet_and_opposite_ones_do_not() {
        let at = |x: f32| Aabb { min: [x, 0.0, 0.0], max: [x + 0.5, 1.0, 1.0] };
        let nodes = Nodes::over(&(0..16u8).map(|i| at(f32::from(i))).collect::<Vec<_>>());
        let along = Ray::new([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0]);
        let [n_nodes, n_visits] = nodes.visits(&[along; 4]);
        assert_eq!((n_nodes, n_visits), (15, 60));
        let away = Ray::new([-1.0, 0.5, 0.5], [-1.0, 0.0, 0.0]);
        assert_eq!(nodes.visits(&[along, away, away, away]), [15, 15]);
        // A ray that ends in the first box enters the nodes around it alone.
        let [n_short, _] = nodes.visits(&[along.between(0.0, 1.2)]);
        assert!((1..6).contains(&n_short), "{n_short}");
    }

    #[test]
    fn blocks_hold_neighbors() {
        let order = blocks(4, [2, 2], 16);
        assert_eq!(order[..8], [0, 1, 4, 5, 2, 3, 6, 7]);
    }

    #[test]
    fn the_camera_passes_the_views() {
        let views = canted_fixtures::SPONZA_VIEWS;
        for (picture, at) in [(0, 0), (25, 1), (75, 3)] {
            assert_eq!(view(&views, picture, 100).eye, views[at].eye);
        }
        assert_eq!(view(&views, 50 + 12, 100).fov_degrees, views[0].fov_degrees);
    }
}

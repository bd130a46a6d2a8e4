//! BVHs with oriented nodes everywhere, with none, and with counters.

use anyhow::{Context, Result};
use canted_trace::{Counts, Hit, InstanceId, Ray, Watertight};
use canted_wide::{Config, Costs, Preset, TriangleBvh};

use crate::models::Model;
use crate::report::{
    effort::Effort,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, faster},
    subjects,
};
use crate::wide::{alternate, closest_sets, engine::Engine};

/// Factor on the cost of oriented nodes that forces them in.
const FORCED_COST: f32 = 0.1;

/// A BVH whose traversal counts box and triangle tests.
struct Counted(TriangleBvh<Watertight>);

impl Engine for Counted {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let mut counts = Counts::default();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.closest_hit_with(ray, InstanceId(0), &mut counts);
        }
        std::hint::black_box(counts);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.0.occluded_many(rays, occluded);
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(self.0.n_bytes())
    }
}

/// The same traversal, ray by ray, without counters.
struct Uncounted(TriangleBvh<Watertight>);

impl Engine for Uncounted {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.closest_hit_with(ray, InstanceId(0), &mut ());
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.0.occluded_many(rays, occluded);
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(self.0.n_bytes())
    }
}

const NAMES: [&str; 5] =
    ["as built", "oriented nodes forced in", "no oriented nodes", "ray by ray", "ray by ray, counted"];

fn engines(model: &Model) -> Result<Vec<Box<dyn Engine>>> {
    let mesh = &model.mesh;
    let usual = Config::preset(Preset::Balanced);
    let build = |config| TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &config);
    let oriented_node = FORCED_COST * usual.costs.oriented_node;
    let chosen = build(usual)?;
    Ok(vec![
        Box::new(chosen.clone()),
        Box::new(build(Config { costs: Costs { oriented_node, ..usual.costs }, oriented: true, ..usual })?),
        Box::new(build(Config { oriented: false, rotate_mesh: false, ..usual })?),
        Box::new(Uncounted(chosen.clone())),
        Box::new(Counted(chosen)),
    ])
}

/// Adds the BVHs and returns a sentence for each scene.
pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Vec<String>> {
    let mut table =
        Table::new("BVHs: a camera or diffuse ray, and bytes", &["scene", "BVH", "per ray", "bytes", "same hits"]);
    let (mut series, mut says): (Vec<Series>, Vec<String>) = (vec![], vec![]);
    for name in effort.pick(&[subjects::SMALL][..], &["grid", "truss"], &["grid", "truss", "bunny", "sponza"]) {
        let Some(model) = subjects::load(name)? else {
            chapter.skipped.push(format!("{name}: the model is not available."));
            continue;
        };
        let engines = engines(&model)?;
        let tree = TriangleBvh::build(&model.mesh.positions, &model.mesh.triangles, &Config::preset(Preset::Fast))?;
        let rays = closest_sets(&model, &tree, effort.pick(16, 128, 128)).concat();
        let (seconds, hits) = alternate::closest(&engines, &rays, effort.pick(2, 7, 11));
        #[expect(clippy::cast_precision_loss, reason = "rays are counted in thousands")]
        let to_ns = 1e9 / rays.len() as f64;
        let ns: Vec<Samples> =
            seconds.iter().map(|s| s.iter().map(|s| s.cpu * to_ns).collect::<Vec<_>>().into()).collect();
        let mut points = vec![];
        for (i, what) in NAMES.into_iter().enumerate() {
            let n_bytes = engines[i].n_bytes().with_context(|| format!("'{what}' does not report its bytes"))?;
            table.rows.push(vec![
                Cell::text(*name),
                Cell::text(what),
                Cell::measured(ns[i].clone(), "ns"),
                Cell::text(n_bytes.to_string()),
                Cell::text(if hits[i] == hits[0] { "yes" } else { "no" }),
            ]);
            #[expect(clippy::cast_precision_loss, reason = "bytes are fewer than 2^53")]
            let x = n_bytes as f64;
            points.push(Point { label: what.to_owned(), x: x.into(), y: ns[i].clone() });
        }
        series.push(Series { name: (*name).to_owned(), points, is_joined: false });
        let sentences = [
            ("the BVH as built", 0, "the one with oriented nodes", 1),
            ("the traversal", 3, "the one with counters", 4),
        ]
        .map(|(a, i, b, k)| faster((a, &ns[i]), (b, &ns[k])));
        says.push(format!("On {name} {}.", sentences.join("; ")));
    }
    chapter.tables.push(table);
    chapter.plots.push(Plot {
        title: "BVHs: time per ray over bytes, as built and with or without oriented nodes".to_owned(),
        x: Axis::log("bytes"),
        y: Axis::log("ns per ray"),
        series,
    });
    Ok(says)
}

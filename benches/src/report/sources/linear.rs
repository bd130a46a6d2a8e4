//! With and without a hierarchy: Silva's lost chart of seconds over primitives.

use anyhow::Result;
use canted_tests::brute;
use canted_trace::{Hit, Kernel, Ray, Watertight};
use canted_wide::{Config, Preset, TriangleBvh};

use super::builders::scaffold;
use super::orders::Found;
use crate::report::{
    effort::Effort,
    fits,
    model::{Axis, Cell, Chapter, Plot, Point, Series, Table},
    samples::{Samples, number},
};
use crate::wide::{alternate, engine::Engine, sets};

/// Tests every triangle in a loop.
struct Every(Vec<<Watertight as Kernel>::Record>);

impl Engine for Every {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = brute::closest_hit::<Watertight>(&self.0, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = brute::closest_hit::<Watertight>(&self.0, ray).is_some();
        }
    }

    fn n_bytes(&self) -> Option<usize> {
        Some(size_of_val(&self.0[..]))
    }
}

const NAMES: [&str; 2] = ["every triangle", "WideBvh, balanced"];

#[expect(clippy::cast_precision_loss, reason = "counts of rays and triangles")]
pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let mut table = Table::new(
        "With and without a hierarchy (Silva's chart): a camera ray",
        &["triangles", NAMES[0], NAMES[1], "gain"],
    );
    let mut points: [Vec<(usize, Samples)>; 2] = Default::default();
    for &log2 in effort.pick(&[7, 8, 9][..], &[8, 10, 12], &[8, 10, 12, 14]) {
        let model = scaffold(log2);
        let mesh = &model.mesh;
        let n = mesh.triangles.len();
        let tree =
            TriangleBvh::<Watertight>::build(&mesh.positions, &mesh.triangles, &Config::preset(Preset::Balanced))?;
        let every = Every(brute::records::<Watertight>(&mesh.positions, &mesh.triangles));
        let engines: [Box<dyn Engine>; 2] = [Box::new(every), Box::new(tree)];
        let rays = sets::camera(&model, effort.pick(8, 48, 48));
        let (seconds, _) = alternate::closest(&engines, &rays, effort.pick(2, 5, 7));
        let ns = |i: usize| -> Samples {
            seconds[i].iter().map(|s| s.cpu * 1e9 / rays.len() as f64).collect::<Vec<_>>().into()
        };
        let gain = number(ns(0).median() / ns(1).median());
        table.rows.push(vec![
            Cell::text(n.to_string()),
            Cell::measured(ns(0), "ns"),
            Cell::measured(ns(1), "ns"),
            Cell::text(gain),
        ]);
        for (i, points) in points.iter_mut().enumerate() {
            points.push((n, ns(i)));
        }
    }
    let exponents = points.each_ref().map(|points| {
        let of_one = points.iter().map(|(n, ns)| (Samples::from(*n as f64), ns.median()));
        fits::formatted(fits::exponent(&of_one.collect::<Vec<_>>()))
    });
    table.rows.push(vec![
        Cell::text("exponent"),
        Cell::text(&exponents[0]),
        Cell::text(&exponents[1]),
        Cell::text("Silva: 'quadratic' and 'much more linear', without numbers"),
    ]);
    table.says = format!(
        "Silva calls the time without a hierarchy quadratic. It is not: with every triangle tested, the time of a ray grows as their number to the power {}, with \
         a BVH to the power {}.",
        exponents[0], exponents[1]
    );
    chapter.tables.push(table);
    let series = NAMES.into_iter().zip(points).map(|(name, points)| Series {
        name: name.to_owned(),
        points: points
            .into_iter()
            .map(|(n, ns)| Point { label: format!("{n} triangles"), x: (n as f64).into(), y: ns })
            .collect(),
        is_joined: true,
    });
    chapter.plots.push(Plot {
        title: "A camera ray over triangles, without a hierarchy and with one".to_owned(),
        x: Axis::log("triangles"),
        y: Axis::log("ns"),
        series: series.collect(),
    });
    let [every, tree] = exponents;
    Ok(Found::from(format!(
        "The time per ray grows as triangles to the power {every} without a hierarchy, and {tree} with a BVH."
    )))
}

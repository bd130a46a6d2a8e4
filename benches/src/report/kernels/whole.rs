//! Single triangle tests in one table: on one core and on all, eight at a time, and on a device without and with transfers.

use std::hint::black_box;

use anyhow::Result;
use canted_lbvh::Corners;
use canted_trace::{BaldwinWeber, Hit, Intersect, Kernel, MollerTrumbore, Projected, Ray, ScaledRay, Watertight};
use canted_wide::{SimdPath, TriangleBvh};
use rayon::prelude::*;

use super::{Device, LEAST_TESTS, lanes};
use crate::{
    report::{
        kernels::{Pair, Tested},
        model::{Cell, Table},
        samples::{Samples, number},
    },
    timing::{self, Contender},
};

/// A test of all pairs, on the calling thread.
struct Sweep {
    name: String,
    /// Bytes that are stored for a triangle.
    n_bytes: usize,
    n_tests: usize,
    run: Box<dyn Fn() + Send + Sync>,
}

impl Sweep {
    fn of_kernel<K: Kernel<Prepared: Send + Sync + 'static>>(name: &str, pairs: &[Pair]) -> Self {
        let ready = |(ray, corners): &Pair| {
            let ray = ScaledRay::new(ray)?;
            Some((ray, K::prepare(&ray), K::record(*corners)))
        };
        let ready: Vec<_> = pairs.iter().filter_map(ready).collect();
        Self {
            name: name.to_owned(),
            n_bytes: size_of::<K::Record>(),
            n_tests: ready.len(),
            run: Box::new(move || {
                for (ray, prepared, record) in &ready {
                    black_box(K::intersect(prepared, ray, record, ray.t_max));
                }
            }),
        }
    }

    /// Rays through leaves of their triangles on a path, each ray through all triangles of its leaf.
    fn on_path(path: SimdPath, pairs: &[Pair]) -> Result<Self> {
        let (rays, corners): (Vec<Ray>, Vec<Corners>) = pairs.iter().copied().unzip();
        let leaves = corners.chunks(lanes::LEAF).map(lanes::leaf).collect::<Result<Vec<_>>>()?;
        let leaves: Vec<TriangleBvh> = leaves.into_iter().map(|leaf| leaf.with_path(path)).collect();
        let n_stored: usize = leaves.iter().map(TriangleBvh::n_primitives).sum();
        let n_bytes = leaves.iter().map(TriangleBvh::n_bytes).sum::<usize>() / n_stored.max(1);
        let n_tests = leaves.iter().zip(rays.chunks(lanes::LEAF)).map(|(leaf, rays)| leaf.n_primitives() * rays.len());
        Ok(Self {
            name: format!("watertight, {}, eight at a time", path.name()),
            n_bytes,
            n_tests: n_tests.sum(),
            run: Box::new(move || {
                let mut hits: [Option<Hit>; lanes::LEAF] = [None; lanes::LEAF];
                for (leaf, rays) in leaves.iter().zip(rays.chunks(lanes::LEAF)) {
                    leaf.closest_hits(rays, &mut hits[..rays.len()]);
                    black_box(&hits);
                }
            }),
        })
    }

    fn repeats(&self) -> usize {
        (10 * LEAST_TESTS).div_ceil(self.n_tests.max(1))
    }
}

/// All sweeps over the pairs of all cases.
fn sweeps(pairs: &[Pair]) -> Result<Vec<Sweep>> {
    let mut sweeps = vec![
        Sweep::of_kernel::<Watertight>("watertight", pairs),
        Sweep::of_kernel::<MollerTrumbore>("Möller, Trumbore", pairs),
        Sweep::of_kernel::<BaldwinWeber>("Baldwin, Weber", pairs),
        Sweep::of_kernel::<Projected>("projected", pairs),
    ];
    for path in lanes::paths().0 {
        sweeps.push(Sweep::on_path(path, pairs)?);
    }
    Ok(sweeps)
}

/// The table, and its sentence.
pub(super) fn measure(pairs: &[Pair], rounds: usize, device: Option<&Device>) -> Result<(Table, String)> {
    let n_threads = rayon::current_num_threads();
    let title = Device::titled(&format!("Single triangle tests on one core, on {n_threads}, and on a device"), device);
    let head = ["test", "bytes a triangle", "one core", "M tests/s", "all cores, M tests/s", "over one core"];
    let mut table = Table::new(title, &head);
    let sweeps = sweeps(pairs)?;
    let contenders = sweeps.iter().flat_map(|sweep| {
        let n = sweep.repeats();
        let alone = Contender::new(&*sweep.name, move || (0..n).for_each(|_| (sweep.run)()));
        let on_all =
            Contender::new(&*sweep.name, move || (0..n * n_threads).into_par_iter().for_each(|_| (sweep.run)()));
        [alone, on_all]
    });
    let timings = timing::run(rounds, contenders.collect());
    let mut gains = vec![];
    for (sweep, both) in sweeps.iter().zip(timings.chunks(2)) {
        let n_tests = (sweep.repeats() * sweep.n_tests) as f64;
        let ns = Samples::from(both[0].seconds.clone()).scaled(1e9 / n_tests);
        let [one, all] = [n_tests / both[0].median(), n_threads as f64 * n_tests / both[1].median()].map(|x| x * 1e-6);
        let gain = n_threads as f64 * timing::ratio(&both[0].seconds, &both[1].seconds);
        gains.push(gain);
        let rates = [one, all, gain].map(|x| Cell::text(number(x)));
        let first = [Cell::text(&sweep.name), Cell::text(sweep.n_bytes.to_string()), Cell::measured(ns, "ns")];
        table.rows.push(first.into_iter().chain(rates).collect());
    }
    if let Some(device) = device {
        let (rays, corners): (Vec<Ray>, Vec<Corners>) = pairs.iter().copied().unzip();
        let Tested { ns, with_transfer, .. } = device.triangles(&lanes::singles(&corners)?, &rays, rounds)?;
        for (name, ns) in [("without transfer", Some(ns)), ("rays up and hits down", with_transfer)] {
            let Some(ns) = ns else { continue };
            let rate = number(1e3 / ns.median());
            let texts = ["–".to_owned(), rate.clone(), rate].map(Cell::text);
            let name = Cell::text(format!("watertight, {}, {name}", device.name()));
            let [dash, each, all] = texts;
            table.rows.push(vec![name, dash, Cell::measured(ns, "ns"), each, all, Cell::text("–")]);
        }
    }
    let [least, most] = timing::range(&gains);
    table.says = format!(
        "On {n_threads} threads, tests run at {} to {} times the rate of one. Silva states about 30 times one core for a GPU, without transfers.",
        number(least),
        number(most)
    );
    let says = table.says.clone();
    Ok((table, says))
}

//! Scenes that change: single edits of many instances, and a game's frame, compared with parry3d and Embree by `--peers`.
//!
//! ```text
//! 100,000 instances -> move, insert, remove, mask;  2,000 instances -> move 200, update, 100,000 rays
//! ```
//!
//! All work on one thread, in turn.

use std::fmt::Write;

use anyhow::Result;
use canted_fixtures::{Mesh, Rotation, SplitMix64, displaced_icosphere, torus};
use canted_obb::{Aabb, Affine, PrimId};
use canted_tlas::{Instance, Tlas};
use canted_trace::{Hit, InstanceId, Intersect, Ray};
use canted_wide::{Config, Preset, TriangleBvh, WideBvh};

use crate::options::Options;
use crate::timing::{Seconds, median, time};

/// A map into a cube of half this size, at random.
fn placed(rng: &mut SplitMix64, half: f64) -> Affine {
    let turn = Rotation::euler(6.0 * rng.unit(), 6.0 * rng.unit(), 6.0 * rng.unit());
    let axis = |k: usize| turn.apply(std::array::from_fn(|i| f64::from(u8::from(i == k)))).map(|x| x as f32);
    Affine { columns: [axis(0), axis(1), axis(2), rng.signed3().map(|x| (half * x) as f32)] }
}

/// A step aside.
fn step(rng: &mut SplitMix64, mut map: Affine, size: f64) -> Affine {
    rng.signed3().into_iter().enumerate().for_each(|(k, x)| map.columns[3][k] += (size * x) as f32);
    map
}

fn bvh(mesh: &Mesh, preset: Preset) -> Result<TriangleBvh> {
    Ok(TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::preset(preset))?)
}

/// Measures and writes both tables.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| {
        edits(out, options)?;
        frames(out, options)
    })
}

/// Changes of each kind in a round.
const N_EDITS: usize = 2000;

const EDITS: [&str; 6] = ["move anywhere", "move a step", "insert", "remove", "mask", "another BVH of ten instances"];

/// Microseconds of single edits.
fn edits(out: &mut String, options: &Options) -> Result<()> {
    let n = if options.is_quick { 10_000 } else { 100_000 };
    let half = f64::cbrt(n as f64);
    let mut rng = SplitMix64::new(1);
    let meshes = [torus(12, 8), displaced_icosphere(1, 2)].map(|mesh| bvh(&mesh, Preset::Fast));
    let [first, second] = meshes;
    let bottom = [first?, second?];
    // Ten instances of each BVH.
    let blas: Vec<TriangleBvh> = (0..n / 10).map(|i| bottom[i % 2].clone()).collect();
    let instance = |rng: &mut SplitMix64, i: usize| Instance::new((i / 10 % (n / 10)) as u32, placed(rng, half));
    let instances: Vec<Instance> = (0..n).map(|i| instance(&mut rng, i)).collect();
    let mut tlas = Tlas::new(blas, &instances, canted_tlas::TopConfig::default())?;
    let bounds = |tlas: &Tlas<TriangleBvh>, i: u32| tlas.instance_bounds(InstanceId(i)).unwrap_or(Aabb::EMPTY);
    let boxes: Vec<Aabb> = (0..n as u32).map(|i| bounds(&tlas, i)).collect();
    let mut wide = WideBvh::over(boxes.clone())?;
    let mut peer = peer::Boxes::new(&boxes);
    let mut times: [[Vec<f64>; 3]; 6] = Default::default();
    // What the first changes prepare is not of every one.
    tlas.set_mask(InstanceId(0), 1)?;
    tlas.replace_blas(0, bottom[0].clone())?;
    for round in 0..=options.rounds {
        let mut now: [[Option<f64>; 3]; 6] = Default::default();
        let chosen: Vec<u32> = (0..N_EDITS).map(|_| rng.below(n) as u32).collect();
        let far: Vec<Affine> = chosen.iter().map(|_| placed(&mut rng, half)).collect();
        for (kind, now) in now.iter_mut().enumerate().take(2) {
            // Known before the clock starts: where each instance goes, and its box there.
            let mut last = tlas.clone();
            let targets: Vec<(InstanceId, Affine, Aabb)> = chosen
                .iter()
                .zip(&far)
                .map(|(&i, &far)| {
                    let old = last.instance(InstanceId(i)).map_or(far, |old| old.world_from_object);
                    let to = if kind == 0 { far } else { step(&mut rng, old, 0.2) };
                    last.set_transform(InstanceId(i), to)?;
                    Ok((InstanceId(i), to, bounds(&last, i)))
                })
                .collect::<Result<_>>()?;
            now[0] = Some(each(&targets, |&(id, to, _)| tlas.set_transform(id, to))?);
            now[1] = Some(each(&targets, |&(id, _, aabb)| wide.move_one(PrimId(id.0), aabb))?);
            if let Some(peer) = &mut peer {
                now[2] = Some(each(&targets, |&(id, _, aabb)| peer.set(id.0, &aabb))?);
            }
        }
        let new: Vec<Instance> = chosen.iter().map(|&i| instance(&mut rng, i as usize)).collect();
        let new_boxes: Vec<Aabb> = chosen.iter().map(|&i| bounds(&tlas, i)).collect();
        let numbered: Vec<(u32, Aabb)> = (n as u32..).zip(new_boxes).collect();
        let mut added = vec![];
        now[2][0] = Some(each(&new, |&instance| tlas.insert(instance).map(|id| added.push(id)))?);
        now[2][1] = Some(each(&numbered, |&(_, aabb)| wide.insert(aabb))?);
        now[3][0] = Some(each(&added, |&id| tlas.remove(id))?);
        let backward: Vec<(u32, Aabb)> = numbered.iter().rev().copied().collect();
        now[3][1] = Some(each(&backward, |&(id, _)| wide.remove(PrimId(id)))?);
        if let Some(peer) = &mut peer {
            now[2][2] = Some(each(&numbered, |&(id, aabb)| peer.set(id, &aabb))?);
            now[3][2] = Some(each(&numbered, |&(id, _)| peer.remove(id))?);
        }
        let masks: Vec<(InstanceId, u32)> = chosen.iter().map(|&i| (InstanceId(i), 1 + i % 3)).collect();
        now[4][0] = Some(each(&masks, |&(id, mask)| tlas.set_mask(id, mask))?);
        let replaced: Vec<(u32, TriangleBvh)> =
            chosen[..N_EDITS / 10].iter().map(|&i| (i / 10, bottom[rng.below(2)].clone())).collect();
        now[5][0] = Some(each(&replaced, |(index, bvh)| tlas.replace_blas(*index, bvh.clone()))?);
        if round > 0 {
            for (all, now) in times.iter_mut().flatten().zip(now.into_iter().flatten()) {
                all.extend(now);
            }
        }
    }
    let _ = writeln!(
        out,
        "\n### Edits of one among {n}\n\nMicroseconds of processor time, medians of {} rounds of {N_EDITS} edits in turn. Boxes: `WideBvh<Aabb>` and the `Bvh` of parry3d, which move \
         boxes that are known; a `Tlas` also inverts the transform and bounds the error of hits. Drift of the top level at the end: {:.3}.\n\n| edit | Tlas | WideBvh of boxes | parry3d |\n\
         | --- | --- | --- | --- |",
        options.rounds,
        tlas.drift()
    );
    for (edit, times) in EDITS.into_iter().zip(&times) {
        let [tlas, wide, peer] = times.each_ref().map(|all| match all[..] {
            [] => String::new(),
            _ => format!("{:.2}", median(all)),
        });
        let _ = writeln!(out, "| {edit} | {tlas} | {wide} | {peer} |");
    }
    Ok(())
}

/// Microseconds of one change.
fn each<T, R, E>(all: &[T], mut change: impl FnMut(&T) -> Result<R, E>) -> Result<f64>
where
    anyhow::Error: From<E>,
{
    let (done, Seconds { cpu, .. }) = time(|| all.iter().try_for_each(|one| change(one).map(drop)));
    done?;
    Ok(1e6 * cpu / all.len() as f64)
}

const N_INSTANCES: usize = 2000;
const N_MOVED: usize = 200;
const N_RAYS: usize = 100_000;

/// Instances move, then rays are traced; the number of hits, and the time of the update and of the rays.
type Frame<'a> = Box<dyn FnMut(&[(InstanceId, Affine)], &[Ray]) -> Result<(usize, [Seconds; 2])> + 'a>;

/// One that computes frames.
struct Engine<'a> {
    name: String,
    frame: Frame<'a>,
    took: Vec<[f64; 2]>,
}

/// A game's frame.
fn frames(out: &mut String, options: &Options) -> Result<()> {
    let meshes = [torus(100, 50), displaced_icosphere(1, 4), displaced_icosphere(2, 5)];
    let (mut rng, half) = (SplitMix64::new(2), 24.0);
    let mut maps: Vec<Affine> = (0..N_INSTANCES).map(|_| placed(&mut rng, half)).collect();
    let instances: Vec<Instance> = maps.iter().enumerate().map(|(i, &map)| Instance::new(i as u32 % 3, map)).collect();
    let _ = writeln!(
        out,
        "\n### A frame\n\n{N_MOVED} of {N_INSTANCES} instances of three meshes of 5,120 to 20,480 triangles move a step, the top level is updated, and {N_RAYS} rays find their first hit: half of them \
         from a camera, half between random points. Milliseconds of processor time, medians of {} frames, one thread, in turn. The meshes of Embree are built with high quality, its top \
         level as named.\n\n| engine | update | rays | frame | relative to ours |\n| --- | --- | --- | --- | --- |",
        4 * options.rounds
    );
    let mut engines = vec![ours(&meshes, &instances)?];
    peer::frames(&meshes, &instances, &mut engines)?;
    for frame in 0..=4 * options.rounds {
        let moved: Vec<(InstanceId, Affine)> = (0..N_MOVED)
            .map(|k| {
                // No instance twice in a frame.
                let i = k * (N_INSTANCES / N_MOVED) + rng.below(N_INSTANCES / N_MOVED);
                maps[i] = step(&mut rng, maps[i], 1.0);
                (InstanceId(i as u32), maps[i])
            })
            .collect();
        let rays = rays(&mut rng, half);
        let mut counts = vec![];
        for engine in &mut engines {
            let (n_hits, [update, traced]) = (engine.frame)(&moved, &rays)?;
            counts.push(n_hits);
            if frame > 0 {
                engine.took.push([1e3 * update.cpu, 1e3 * traced.cpu]);
            }
        }
        // Rays at edges may differ where Embree is not robust.
        anyhow::ensure!(counts.iter().all(|n| n.abs_diff(counts[0]) < N_RAYS / 1000), "other hits: {counts:?}");
    }
    let frame_of = |engine: &Engine<'_>| median(&engine.took.iter().map(|[a, b]| a + b).collect::<Vec<_>>());
    let own = frame_of(&engines[0]);
    for engine in &engines {
        let of = |k: usize| median(&engine.took.iter().map(|took| took[k]).collect::<Vec<_>>());
        let frame = frame_of(engine);
        let _ = writeln!(out, "| {} | {:.2} | {:.1} | {frame:.1} | {:.2} |", engine.name, of(0), of(1), frame / own);
    }
    Ok(())
}

/// Rays of a frame.
fn rays(rng: &mut SplitMix64, half: f64) -> Vec<Ray> {
    let side = (N_RAYS as f64 / 2.0).sqrt() as usize;
    let eye = [0.1, 0.2, 2.0 * half as f32];
    let pixel = |i: usize| 1.6 * (i as f32 / side as f32 - 0.5);
    let mut rays: Vec<Ray> =
        (0..side * side).map(|i| Ray::new(eye, [pixel(i % side), pixel(i / side), -1.0])).collect();
    let mut point = || rng.signed3().map(|x| (half * x) as f32);
    rays.extend((side * side..N_RAYS).map(|_| {
        let (from, to) = (point(), point());
        Ray::new(from, std::array::from_fn(|k| to[k] - from[k]))
    }));
    rays
}

fn ours<'a>(meshes: &[Mesh], instances: &[Instance]) -> Result<Engine<'a>> {
    let blas = meshes.iter().map(|mesh| bvh(mesh, Preset::Quality)).collect::<Result<Vec<_>>>()?;
    let mut tlas = Tlas::new(blas, instances, canted_tlas::TopConfig::default())?;
    let mut hits: Vec<Option<Hit>> = vec![None; N_RAYS];
    let frame = move |moved: &[(InstanceId, Affine)], rays: &[Ray]| {
        let (done, update) = time(|| {
            for &(id, map) in moved {
                tlas.set_transform(id, map)?;
            }
            if tlas.rebuild_advised() {
                tlas.rebuild();
            }
            anyhow::Ok(())
        });
        done?;
        let (n, traced) = time(|| {
            tlas.closest_hits(rays, &mut hits);
            hits.iter().flatten().count()
        });
        Ok((n, [update, traced]))
    };
    Ok(engine("Tlas".to_owned(), frame))
}

fn engine<'a>(
    name: String,
    frame: impl FnMut(&[(InstanceId, Affine)], &[Ray]) -> Result<(usize, [Seconds; 2])> + 'a,
) -> Engine<'a> {
    Engine { name, frame: Box::new(frame), took: vec![] }
}

#[cfg(feature = "peers")]
mod peer {
    use std::hint::black_box;

    use canted_fixtures::Mesh;
    use canted_obb::Aabb;
    use canted_peers::embree::{self, MovingInstances, Placement, Quality};
    use parry3d::bounding_volume::Aabb as TheirBox;
    use parry3d::math::Point;
    use parry3d::partitioning::{Bvh, BvhBuildStrategy};

    use super::*;

    pub(super) struct Boxes(Bvh);

    fn theirs(Aabb { min, max }: &Aabb) -> TheirBox {
        TheirBox::new(Point::from(*min), Point::from(*max))
    }

    impl Boxes {
        pub(super) fn new(boxes: &[Aabb]) -> Option<Self> {
            let leaves: Vec<TheirBox> = boxes.iter().map(theirs).collect();
            Some(Self(Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves)))
        }

        /// Inserts a box, or moves it.
        pub(super) fn set(&mut self, number: u32, aabb: &Aabb) -> Result<()> {
            self.0.insert(theirs(aabb), number);
            Ok(())
        }

        pub(super) fn remove(&mut self, number: u32) -> Result<()> {
            self.0.remove(number);
            Ok(())
        }
    }

    pub(super) fn frames<'a>(meshes: &[Mesh], instances: &[Instance], engines: &mut Vec<Engine<'a>>) -> Result<()> {
        let meshes: Vec<embree::Mesh<'_>> =
            meshes.iter().map(|mesh| embree::Mesh { positions: &mesh.positions, triangles: &mesh.triangles }).collect();
        let placements: Vec<Placement> = instances
            .iter()
            .map(|one| Placement { mesh: one.blas as usize, world_from_object: one.world_from_object.columns })
            .collect();
        for library in embree::libraries().into_iter().take(1) {
            let version = library.version();
            for (quality, name) in [(Quality::Low, "low"), (Quality::Medium, "medium")] {
                let mut moving = MovingInstances::new(&library, &meshes, &placements, (1, quality))?;
                let frame = move |moved: &[(InstanceId, Affine)], rays: &[Ray]| {
                    let (done, update) = time(|| moving.update(moved.iter().map(|(id, map)| (id.0, &map.columns))));
                    done?;
                    let (n, traced) = time(|| {
                        let scene = moving.scene();
                        let hit =
                            |ray: &&Ray| scene.closest(ray.origin, ray.direction, [ray.t_min, ray.t_max]).is_some();
                        black_box(rays.iter().filter(hit).count())
                    });
                    Ok((n, [update, traced]))
                };
                engines.push(engine(format!("Embree {}.{}, {name}", version / 10_000, version / 100 % 100), frame));
            }
        }
        Ok(())
    }
}

/// Without peers.
#[cfg(not(feature = "peers"))]
mod peer {
    use canted_fixtures::Mesh;
    use canted_obb::Aabb;

    use super::*;

    pub(super) enum Boxes {}

    impl Boxes {
        pub(super) fn new(_: &[Aabb]) -> Option<Self> {
            None
        }

        pub(super) fn set(&mut self, _: u32, _: &Aabb) -> Result<()> {
            match *self {}
        }

        pub(super) fn remove(&mut self, _: u32) -> Result<()> {
            match *self {}
        }
    }

    pub(super) fn frames(_: &[Mesh], _: &[Instance], _: &mut Vec<Engine<'_>>) -> Result<()> {
        Ok(())
    }
}

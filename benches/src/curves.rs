//! Round curves and spheres: `WideBvh` over segments, compared with Embree's curve geometry by `--peers`, and with tubes of triangles.
//!
//! ```text
//! strands -> segments, cubic B-splines, spheres, tubes -> camera, diffuse and occlusion rays -> rays a second, builds, bytes
//! ```
//!
//! Holds: everything works on one thread; engines alternate every few milliseconds.

use std::{fmt::Write, sync::Mutex};

use anyhow::Result;
use canted_fixtures::{
    DIFFUSE_SEED, Mesh, OCCLUSION_SEED, Strands, SurfacePoint, diffuse, head_of_hair, object_views, occlusion,
    streamlines,
};
use canted_trace::{Hit, Ray, RoundCubic, RoundSegment, Sphere};
use canted_wide::{Config, Preset, Primitive, TriangleBvh, WideBvh};

use crate::models::{Kind, ray};
use crate::options::Options;
use crate::timing::{median, ratio, time};
use crate::wide::engine::{self, Answers, Build, Engine, Entry, Owner, Promise, WithBytes, cpu};

/// Sides of the tubes.
const SIDES: u32 = 8;

/// Strands and their name.
struct Scene {
    name: &'static str,
    strands: Strands,
}

fn scenes(options: &Options) -> Vec<Scene> {
    let n = if options.is_quick { 4 } else { 1 };
    let scaled = |mut strands: Strands, factor: f32| {
        strands.radii.iter_mut().for_each(|radius| *radius *= factor);
        strands
    };
    let seed = options.seed;
    vec![
        Scene { name: "hair", strands: head_of_hair(seed, 20_000 / n) },
        Scene { name: "fine hair", strands: scaled(head_of_hair(seed + 1, 60_000 / n), 0.2) },
        Scene { name: "thick hair", strands: scaled(head_of_hair(seed + 2, 6000 / n), 4.0) },
        Scene { name: "streamlines", strands: streamlines(seed + 3, 20_000 / n) },
    ]
}

/// One form of the strands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Linear,
    Bspline,
    Spheres,
}

impl Form {
    const ALL: [Self; 3] = [Self::Linear, Self::Bspline, Self::Spheres];

    fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Bspline => "B-spline",
            Self::Spheres => "spheres",
        }
    }
}

/// The points of strands as the engines take them.
struct Parts {
    points: Vec<[f32; 4]>,
    /// The first point of each segment.
    firsts: Vec<u32>,
    /// Whether a segment has one before it (1) and after it (2), for Embree.
    #[cfg_attr(not(feature = "peers"), expect(dead_code, reason = "peers alone need it"))]
    neighbors: Vec<u8>,
}

impl Parts {
    fn new(strands: &Strands, form: Form) -> Self {
        let points = strands.points.iter().zip(&strands.radii).map(|(&[x, y, z], &radius)| [x, y, z, radius]).collect();
        let (mut firsts, mut neighbors, mut start) = (vec![], vec![], 0);
        let n_used = if form == Form::Bspline { 3 } else { 1 };
        for &length in &strands.lengths {
            let n = u32::from(length) - n_used;
            firsts.extend(start..start + n);
            neighbors.extend((0..n).map(|i| u8::from(i > 0) | u8::from(i + 1 < n) << 1));
            start += u32::from(length);
        }
        Self { points, firsts, neighbors }
    }

    fn segments(&self) -> Vec<RoundSegment> {
        let segment = |&first: &u32| {
            let [[ax, ay, az, a], [bx, by, bz, b]] = [0, 1].map(|i| self.points[first as usize + i]);
            RoundSegment { ends: [[ax, ay, az], [bx, by, bz]], radii: [a, b] }
        };
        self.firsts.iter().map(segment).collect()
    }

    /// The Bézier form of each span of the B-splines.
    fn cubics(&self) -> Vec<RoundCubic> {
        let cubic = |&first: &u32| {
            let given: [[f32; 4]; 4] = std::array::from_fn(|i| self.points[first as usize + i]);
            let sum = |weights: [f32; 4]| -> [f32; 4] {
                std::array::from_fn(|k| (0..4).map(|i| weights[i] / 6.0 * given[i][k]).sum())
            };
            let controls =
                [[1.0, 4.0, 1.0, 0.0], [0.0, 4.0, 2.0, 0.0], [0.0, 2.0, 4.0, 0.0], [0.0, 1.0, 4.0, 1.0]].map(sum);
            RoundCubic { points: controls.map(|[x, y, z, _]| [x, y, z]), radii: controls.map(|[.., radius]| radius) }
        };
        self.firsts.iter().map(cubic).collect()
    }

    fn spheres(&self) -> Vec<Sphere> {
        self.points.iter().map(|&[x, y, z, radius]| Sphere { center: [x, y, z], radius: 2.0 * radius }).collect()
    }
}

/// Tubes around segments, without ends.
fn tubes(segments: &[RoundSegment]) -> Mesh {
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    for RoundSegment { ends: [a, b], radii } in segments {
        let axis: [f32; 3] = std::array::from_fn(|k| b[k] - a[k]);
        let [u, v] = across(axis);
        let first = mesh.positions.len() as u32;
        for i in 0..SIDES {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / SIDES as f32).sin_cos();
            for (end, radius) in [(a, radii[0]), (b, radii[1])] {
                mesh.positions.push(std::array::from_fn(|k| end[k] + radius * (cos * u[k] + sin * v[k])));
            }
            let [p, q] = [first + 2 * i, first + 2 * ((i + 1) % SIDES)];
            mesh.triangles.extend([[p, q, p + 1], [q, q + 1, p + 1]]);
        }
    }
    mesh
}

/// Two unit vectors across `axis` and each other.
fn across(axis: [f32; 3]) -> [[f32; 3]; 2] {
    let least = (0..3).fold(0, |best, k| if axis[k].abs() < axis[best].abs() { k } else { best });
    let unit = |v: [f32; 3]| {
        let length = v.iter().map(|x| x * x).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        v.map(|x| x / length)
    };
    let cross =
        |a: [f32; 3], b: [f32; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let u = unit(cross(axis, std::array::from_fn(|k| f32::from(u8::from(k == least)))));
    [u, unit(cross(axis, u))]
}

/// Measures and writes the section.
pub(crate) fn section(out: &mut String, options: &Options) -> Result<()> {
    let _ = writeln!(
        out,
        "\n## Curves\n\nRound linear segments, round cubic B-splines and spheres of the same points, one thread, medians of {} rounds, seed {}. Numbers \
         are millions of rays a second, and how many times those of each other engine `quality` reaches; tubes are of {SIDES} sides, without ends, traced \
         as triangles with `quality`. `differing`: rays whose answer in Embree's robust mode is another, in parts per million. Ours hold the primitives; Embree reads points of 16 \
         bytes and indices in place, which its bytes do not count.\n\n\
         | scene | form | rays | quality | balanced | Embree | Embree robust | tubes | differing |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        options.rounds, options.seed
    );
    let mut builds =
        "\n| scene | form | primitives | engine | seconds | bytes a primitive |\n| --- | --- | --- | --- | --- | --- |\n".to_owned();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    one.install(|| -> Result<()> {
        for Scene { name, strands } in scenes(options) {
            for form in Form::ALL {
                let parts = Parts::new(&strands, form);
                measure(out, &mut builds, (name, form, &parts), options)?;
            }
        }
        Ok(())
    })?;
    out.push_str(&builds);
    Ok(())
}

/// Builds once: a program hands its primitives over, and a copy takes up to a twentieth of a build.
fn over<P: Primitive + 'static>(primitives: Vec<P>, preset: Preset) -> Build<'static> {
    let primitives = Mutex::new(primitives);
    Box::new(move |_| {
        // A second build would have nothing to build over.
        assert!(!primitives.lock().expect("no build panics").is_empty(), "a build of each engine");
        let bvh = WideBvh::over_with(std::mem::take(&mut *primitives.lock().expect("no build panics")), preset)?;
        let n_bytes = bvh.n_bytes();
        Ok(Box::new(WithBytes(bvh, n_bytes)))
    })
}

fn entry<'a>(name: &str, owner: Owner, build: Build<'a>) -> Entry<'a> {
    Entry { name: name.to_owned(), owner, promise: Promise::Watertight, is_placed: false, is_parallel: false, build }
}

/// Names of our engines.
const OURS: [(&str, Preset); 2] = [("quality", Preset::Quality), ("balanced", Preset::Balanced)];

fn entries(form: Form, parts: &Parts) -> Vec<Entry<'_>> {
    let ours = OURS.map(|(name, preset)| {
        let build = match form {
            Form::Linear => over(parts.segments(), preset),
            Form::Bspline => over(parts.cubics(), preset),
            Form::Spheres => over(parts.spheres(), preset),
        };
        entry(name, Owner::Ours, build)
    });
    let mut entries = Vec::from(ours);
    #[cfg(feature = "peers")]
    entries.extend(peer::entries(form, parts));
    if form == Form::Linear {
        let mesh = tubes(&parts.segments());
        let build: Build<'_> = Box::new(move |_| {
            let bvh = TriangleBvh::build_with(&mesh.positions, &mesh.triangles, Config::preset(Preset::Quality))?;
            let n_bytes = bvh.n_bytes();
            Ok(Box::new(WithBytes(bvh, n_bytes)))
        });
        entries.push(entry("tubes", Owner::Ours, build));
    }
    entries
}

/// The surface at hits: the direction from the axis or the center.
fn surface(form: Form, parts: &Parts, rays: &[Ray], hits: &[Option<Hit>]) -> Vec<SurfacePoint> {
    let cubics = if form == Form::Bspline { parts.cubics() } else { vec![] };
    let point = |(ray, hit): (&Ray, &Option<Hit>)| {
        let hit = hit.as_ref()?;
        let (position, u) = (ray.at(f64::from(hit.t)), f64::from(hit.u));
        let center: [f64; 3] = match form {
            Form::Linear => {
                let [a, b] = [0, 1].map(|i| parts.points[parts.firsts[hit.primitive.index()] as usize + i]);
                std::array::from_fn(|k| f64::from(a[k]) * (1.0 - u) + f64::from(b[k]) * u)
            }
            Form::Bspline => {
                let ([x, y, z, _], _) = cubics[hit.primitive.index()].ball(u);
                [x, y, z]
            }
            Form::Spheres => std::array::from_fn(|k| f64::from(parts.points[hit.primitive.index()][k])),
        };
        let normal = std::array::from_fn(|k| (position[k] - center[k]) as f32);
        (normal != [0.0; 3]).then(|| SurfacePoint { position: position.map(|x| x as f32), normal })
    };
    rays.iter().zip(hits).filter_map(point).collect()
}

/// One kind of rays through all engines.
struct Set {
    kind: Kind,
    n_rays: usize,
    /// Of each engine, in each round.
    seconds: Vec<Vec<f64>>,
    answers: Vec<Answers>,
}

/// Traces rays of every kind; diffuse and occlusion rays start where the first engine hits.
fn traced(form: Form, parts: &Parts, engines: &[Box<dyn Engine>], options: &Options) -> Vec<Set> {
    let positions: Vec<_> = parts.points.iter().map(|&[x, y, z, _]| [x, y, z]).collect();
    // Its bounds are those of the points that triangles use.
    let cloud = Mesh { triangles: (0..positions.len() as u32).map(|i| [i; 3]).collect(), positions };
    let resolution = canted_fixtures::RESOLUTION / if options.is_quick { 2 } else { 1 };
    let views = object_views(&cloud);
    let camera: Vec<Ray> = views.iter().flat_map(|view| view.rays(resolution)).map(|data| ray(&data)).collect();
    let mut hits = vec![None; camera.len()];
    engines[0].closest(&camera, &mut hits);
    let points = surface(form, parts, &camera, &hits);
    let diagonal = cloud.diagonal();
    let [diffuse, occlusion] = [diffuse(&points, diagonal, DIFFUSE_SEED), occlusion(&points, diagonal, OCCLUSION_SEED)]
        .map(|rays| rays.iter().map(ray).collect::<Vec<_>>());
    let set = |(kind, rays): (Kind, Vec<Ray>)| {
        let (seconds, answers) = engine::answers(engines, &rays, options.rounds, kind == Kind::Occlusion);
        Set { kind, n_rays: rays.len(), seconds: seconds.iter().map(|seconds| cpu(seconds)).collect(), answers }
    };
    Kind::ALL.into_iter().zip([camera, diffuse, occlusion]).map(set).collect()
}

/// Rays a second of `quality` through round linear segments of hair, relative to Embree's robust mode and to its default mode, for each
/// kind of rays; `None` where Embree is not found.
pub(crate) fn of_hair(options: &Options) -> Result<Option<[[f64; 3]; 2]>> {
    let parts = Parts::new(&head_of_hair(options.seed, 20_000), Form::Linear);
    let mut entries = entries(Form::Linear, &parts);
    entries.retain(|entry| ["quality", "robust", "high"].contains(&entry.name.as_str()));
    if entries.len() < 3 {
        return Ok(None);
    }
    let engines = entries.iter().map(|entry| (entry.build)(1)).collect::<Result<Vec<_>>>()?;
    let sets = traced(Form::Linear, &parts, &engines, options);
    let of = |name: &str| -> [f64; 3] {
        let i = entries.iter().position(|entry| entry.name == name).expect("all three are there");
        std::array::from_fn(|kind| ratio(&sets[kind].seconds[i], &sets[kind].seconds[0]))
    };
    Ok(Some([of("robust"), of("high")]))
}

fn measure(
    out: &mut String,
    builds: &mut String,
    (scene, form, parts): (&str, Form, &Parts),
    options: &Options,
) -> Result<()> {
    let entries = entries(form, parts);
    let mut engines: Vec<Box<dyn Engine>> = vec![];
    let n_primitives = if form == Form::Spheres { parts.points.len() } else { parts.firsts.len() };
    for entry in &entries {
        let (built, seconds) = time(|| (entry.build)(1));
        let built = built?;
        let bytes = built.n_bytes().map_or_else(String::new, |n| format!("{:.0}", n as f64 / n_primitives as f64));
        let _ = writeln!(
            builds,
            "| {scene} | {} | {n_primitives} | {} | {:.2} | {bytes} |",
            form.name(),
            entry.name,
            seconds.cpu
        );
        engines.push(built);
    }
    for Set { kind, n_rays, seconds, answers } in traced(form, parts, &engines, options) {
        let find = |name: &str| entries.iter().position(|entry| entry.name == name);
        let speed = |i: usize| n_rays as f64 / 1e6 / median(&seconds[i]);
        let ratio = |name| find(name).map_or_else(String::new, |i| format!("{:.2}", ratio(&seconds[i], &seconds[0])));
        let differing = find("robust").map_or_else(String::new, |i| {
            format!("{:.0}", 1e6 * n_differing(&answers[0], &answers[i]) as f64 / n_rays as f64)
        });
        let _ = writeln!(
            out,
            "| {scene} | {} | {} | {:.2} | {:.2} | {} | {} | {} | {differing} |",
            form.name(),
            kind.name(),
            speed(0),
            speed(1),
            ratio("high"),
            ratio("robust"),
            ratio("tubes")
        );
    }
    Ok(())
}

/// Answers that differ by more than a thousandth.
fn n_differing(ours: &Answers, theirs: &Answers) -> usize {
    match (ours, theirs) {
        (Answers::Closest(ours), Answers::Closest(theirs)) => {
            let is_same = |a: &Option<Hit>, b: &Option<Hit>| match (a, b) {
                (Some(a), Some(b)) => (a.t - b.t).abs() <= 1e-3 * a.t,
                (a, b) => a.is_some() == b.is_some(),
            };
            ours.iter().zip(theirs).filter(|(a, b)| !is_same(a, b)).count()
        }
        (Answers::Occluded(ours), Answers::Occluded(theirs)) => ours.iter().zip(theirs).filter(|(a, b)| a != b).count(),
        _ => unreachable!("both are of the same kind of rays"),
    }
}

#[cfg(feature = "peers")]
mod peer {
    //! Embree's curves.

    use canted_peers::embree::{self, CurveKind, Curves, Library, Options, Quality, Scene};

    use super::{Entry, Form, Owner, Parts, entry};
    use crate::wide::embree::Embree;

    /// The newest version, in its high quality and its robust mode.
    pub(super) fn entries(form: Form, parts: &Parts) -> Vec<Entry<'_>> {
        let modes = |library: Library| {
            [("high", false), ("robust", true)].map(|(name, is_robust)| {
                let build = move |n_threads| {
                    let options = Options { quality: Quality::High, is_robust, n_threads };
                    let kind = match form {
                        Form::Linear => CurveKind::RoundLinear,
                        Form::Bspline => CurveKind::RoundBspline,
                        Form::Spheres => CurveKind::Sphere,
                    };
                    let mut points = parts.points.clone();
                    if form == Form::Spheres {
                        points.iter_mut().for_each(|point| point[3] *= 2.0);
                    }
                    let curves = Curves { kind, points: &points, firsts: &parts.firsts, neighbors: &parts.neighbors };
                    let scene = Scene::of_curves(&library, &curves, &options)?;
                    Ok(Box::new(Embree(scene)) as _)
                };
                entry(name, Owner::Peer, Box::new(build))
            })
        };
        embree::libraries().into_iter().take(1).flat_map(modes).collect()
    }
}

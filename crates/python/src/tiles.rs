//! Meshes larger than memory: stores of tiles.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use canted::distance::{NearestPoint, NearestSurface};
use canted::file::tiles::{OpenOptions, TileError, TileErrorKind, TileWriter, TiledBvh, WriteOptions};
use canted::kernel::HitLists;
use canted::{Config, Hit, InstanceId, PrimId, Ray, Side};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arrays::{self, NO_ORIGIN, Table, shaped};
use crate::error::invalid;
use crate::frame::{Extent, Near, Origin, OriginArgument, Rounding};
use crate::hits::Hits;
use crate::names::{self, Inside};
use crate::nearest::{self, Found, Nearest, Wanted, distances};
use crate::points::Surface;
use crate::query::{Columns, RayArrays, Read};
use crate::work::{Call, run_watched};

/// Rays or points of a call without the lock: as many wait at tiles at once.
const BATCH: usize = 1 << 20;

/// The error of a store as Python shows it.
fn raised(error: TileError) -> PyErr {
    match error.kind() {
        TileErrorKind::System => PyOSError::new_err(error.to_string()),
        TileErrorKind::Damaged | TileErrorKind::Input => invalid(error),
    }
}

/// A point, how many triangles are asked for, within which distance of the point rounded to `f32`, and of itself.
type Asked = ([f64; 3], usize, f32, f64);

/// Bytes where a call does not say how many.
const MEMORY: u64 = 2 << 30;

/// The argument `memory`: a number of bytes, or a text such as "2G".
fn memory_of(argument: Option<&Bound<'_, PyAny>>) -> PyResult<u64> {
    let Some(argument) = argument else { return Ok(MEMORY) };
    let bytes = match argument.extract::<String>() {
        Ok(text) => of_text(&text),
        Err(_) => argument.extract::<f64>().ok().and_then(whole_bytes),
    };
    match bytes {
        Some(bytes) => Ok(bytes),
        None => {
            let shown = argument.repr()?;
            Err(invalid(format!("memory is {shown}; use a number of bytes, or a text such as '500M' or '2G'")))
        }
    }
}

fn whole_bytes(bytes: f64) -> Option<u64> {
    (bytes >= 1.0 && bytes < (1_u64 << 60) as f64).then_some(bytes as u64)
}

fn of_text(text: &str) -> Option<u64> {
    let text = text.trim().trim_end_matches(['b', 'B']).trim_end_matches('i');
    let unit = text.chars().last()?.to_ascii_lowercase();
    let power = ['k', 'm', 'g', 't'].iter().position(|known| unit == *known);
    let (digits, shift) = power.map_or((text, 0), |power| (&text[..text.len() - 1], 10 * (power + 1)));
    whole_bytes(digits.trim().parse::<f64>().ok()? * (1_u64 << shift) as f64)
}

/// A mesh in a folder of tiles, larger than memory: the queries and the answers of Bvh, bit for bit.
///
/// Tiles are read when rays need them, and those that were least recently used are forgotten. Rays of one call wait for each other at tiles, so few
/// large calls read less than many small ones.
///
/// Parameters
/// ----------
/// path : path
///     A folder that Tiles.build or `canted tiles` wrote.
/// memory : number or str
///     Bytes of tiles that are held, such as "2G"; at least one tile is.
///
/// Raises
/// ------
/// ValueError
///     A folder that is not a store; a tile that is missing, damaged or of another store, with its file. A store above 256 MiB is checked tile
///     by tile when they are read, a smaller one when it is opened.
#[pyclass(frozen, weakref, module = "canted")]
pub(crate) struct Tiles {
    bvh: Arc<TiledBvh>,
    path: PathBuf,
    memory: u64,
}

impl Tiles {
    fn origin(&self, argument: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 3]> {
        Ok(arrays::origin(argument)?.unwrap_or(self.bvh.origin()))
    }

    /// Whether hits have an instance.
    fn has_instances(&self) -> bool {
        !self.bvh.is_one_mesh()
    }

    /// The numbers of a hit: of one mesh those of the mesh, else those of the whole.
    ///
    /// Columns hold 32-bit integers, as those of Bvh: `check_numbers` refuses stores with more.
    fn numbers(&self, hit: &Hit) -> (u64, u32) {
        if self.has_instances() { self.bvh.in_whole(hit.instance, hit.primitive) } else { (hit.primitive.0.into(), 0) }
    }

    /// Answers `items` a batch at a time, without Python's lock.
    fn batches<I: Copy + Send + 'static, T: Send + 'static>(
        &self,
        call: &Call<'_>,
        items: &[I],
        answer: fn(&TiledBvh, &[I]) -> Result<T, TileError>,
        mut take: impl FnMut(T),
    ) -> PyResult<()> {
        for (i, part) in items.chunks(BATCH).enumerate() {
            let (bvh, part) = (Arc::clone(&self.bvh), part.to_vec());
            let fraction = (i * BATCH) as f64 / items.len() as f64;
            let found = run_watched(call.py, &call.threads, move || answer(&bvh, &part), |_| call.report(fraction))?;
            take(found.map_err(raised)?);
        }
        call.report(1.0)
    }

    /// What rays start near, if they do.
    fn rays_start(&self) -> Option<Near> {
        let aabb = self.bvh.aabb();
        (self.bvh.is_near() && !aabb.is_empty()).then(|| Near::new(&aabb))
    }

    fn surface(&self, origin: [f64; 3]) -> Surface {
        Surface::Tiles { bvh: Arc::clone(&self.bvh), origin }
    }

    /// All hits, or the crossings.
    fn list(
        &self,
        call: &Call<'_>,
        arrays: &RayArrays<'_>,
        origin: [f64; 3],
        answer: fn(&TiledBvh, &[Ray]) -> Result<HitLists, TileError>,
    ) -> PyResult<Hits> {
        let mut columns = Columns { ray: Some(vec![]), ..Columns::default() };
        let read = arrays.rays(origin, self.rays_start()).all();
        let mut n = 0;
        self.batches(call, &read.rays, answer, |lists| {
            for hits in lists.of_rays() {
                for hit in hits {
                    columns.add(hit, self.numbers(hit), self.has_instances());
                    columns.starts.extend(read.starts.get(n));
                    if let Some(rays) = &mut columns.ray {
                        rays.push(n as i64);
                    }
                }
                n += 1;
            }
        })?;
        Hits::new(call.py, columns, self.surface(origin), arrays.shape())
    }

    fn near(
        &self,
        call: &Call<'_>,
        points: &Bound<'_, PyAny>,
        wanted: &Wanted,
        origin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Nearest> {
        let (points, origin) = (Table::of_any_shape(points, "points")?, self.origin(origin)?);
        let all = points.rows(origin).all_exact()?;
        let found = match self.has_instances() {
            true => self.nearest_surfaces(call, &all, wanted)?,
            false => self.nearest_triangles(call, &all, wanted)?,
        };
        let flags = (self.has_instances(), self.bvh.is_near());
        nearest::of_lists(call.py, (&all, &found), origin, wanted, flags, &points.shape)
    }

    /// The same of a store with placements.
    fn nearest_surfaces(&self, call: &Call<'_>, points: &[[f64; 3]], wanted: &Wanted) -> PyResult<Vec<Vec<Found>>> {
        let items: Vec<_> = points.iter().map(|&point| (point, wanted.k.unwrap_or(1), wanted.max_distance)).collect();
        let answer = |bvh: &TiledBvh, items: &[([f64; 3], usize, f64)]| {
            let points: Vec<[f64; 3]> = items.iter().map(|item| item.0).collect();
            let mut near = vec![vec![]; items.len()];
            let (k, max_distance) = items.first().map_or((1, 0.0), |item| (item.1, item.2));
            bvh.try_nearest_surfaces(&points, k, max_distance, &mut near)?;
            let in_whole = |found: NearestSurface| {
                let (number, instance) = bvh.in_whole(found.instance, found.primitive);
                let primitive = PrimId(u32::try_from(number).unwrap_or(u32::MAX));
                Found::from(NearestSurface { primitive, instance: InstanceId(instance), ..found })
            };
            Ok(near.into_iter().map(|near| near.into_iter().map(in_whole).collect()).collect())
        };
        let mut found = vec![];
        self.batches(call, &items, answer, |part: Vec<Vec<Found>>| found.extend(part))?;
        Ok(found)
    }

    /// The nearest triangles to each point, which is relative to the origin.
    fn nearest_triangles(&self, call: &Call<'_>, points: &[[f64; 3]], wanted: &Wanted) -> PyResult<Vec<Vec<Found>>> {
        let (k, is_near) = (wanted.k.unwrap_or(1), self.bvh.is_near());
        let reach = if is_near { nearest::reach_from(points, wanted.max_distance) } else { wanted.max_distance as f32 };
        // What differs from call to call travels with each point.
        let items: Vec<Asked> = points.iter().map(|&point| (point, k, reach, wanted.max_distance)).collect();
        let answer = |bvh: &TiledBvh, items: &[Asked]| {
            let points: Vec<[f32; 3]> = items.iter().map(|item| item.0.map(|x| x as f32)).collect();
            let mut near = vec![vec![]; items.len()];
            let (k, reach, max_distance) = items.first().map_or((1, 0.0, 0.0), |item| (item.1, item.2, item.3));
            bvh.try_nearest_points(&points, k, reach, &mut near)?;
            if !bvh.is_near() {
                return Ok(near.into_iter().map(|near| near.into_iter().map(Found::from).collect()).collect());
            }
            let numbers: Vec<u32> = near.iter().flatten().map(|near| near.primitive.0).collect();
            let mut triangles = bvh.try_triangles(&numbers)?.into_iter();
            let of_point = |(item, near): (&Asked, Vec<NearestPoint>)| {
                let triangles =
                    near.iter().zip(&mut triangles).filter_map(|(near, triangle)| Some((near.primitive.0, triangle?)));
                nearest::exact(triangles, item.0, max_distance)
            };
            Ok(items.iter().zip(near).map(of_point).collect())
        };
        let mut found = vec![];
        self.batches(call, &items, answer, |part: Vec<Vec<Found>>| found.extend(part))?;
        Ok(found)
    }
}

/// An error where numbers of triangles do not fit into the columns of hits.
fn check_numbers(bvh: &TiledBvh) -> PyResult<()> {
    let n = bvh.n_primitives();
    if n > i32::MAX as u64 {
        let folder = bvh.folder().display();
        return Err(invalid(format!(
            "{folder}: {n} triangles; hits in Python number at most 2^31 - 1, `canted cast` more"
        )));
    }
    Ok(())
}

/// Only parity is answered by tiles.
fn check_mode(mode: Option<&str>) -> PyResult<()> {
    match names::inside(mode)? {
        Some(Inside::Winding) => Err(invalid("mode is 'winding'; tiles answer 'parity'")),
        _ => Ok(()),
    }
}

#[pymethods]
impl Tiles {
    #[new]
    #[pyo3(signature = (path, memory=None), text_signature = "(path, memory='2G')")]
    fn new(py: Python<'_>, path: PathBuf, memory: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let memory = memory_of(memory)?;
        let (folder, options) = (path.clone(), OpenOptions { memory, ..OpenOptions::default() });
        let bvh = Call::plain(py)?.run(move || TiledBvh::open(folder, options))?.map_err(raised)?;
        check_numbers(&bvh)?;
        Ok(Self { bvh: Arc::new(bvh), path, memory })
    }

    /// Tiles of which only `n` answer, from the number `first` on: for canted.distributed.
    #[staticmethod]
    fn _part(py: Python<'_>, path: PathBuf, memory: Option<&Bound<'_, PyAny>>, first: u32, n: u32) -> PyResult<Self> {
        let memory = memory_of(memory)?;
        let options = OpenOptions { memory, part: Some([first, n]), ..OpenOptions::default() };
        let folder = path.clone();
        let bvh = Call::plain(py)?.run(move || TiledBvh::open(folder, options))?.map_err(raised)?;
        check_numbers(&bvh)?;
        Ok(Self { bvh: Arc::new(bvh), path, memory })
    }

    /// build(vertices, triangles, path, tile_triangles=262144, *, memory='2G', preset='balanced', origin='auto', threads=None, progress=None)
    ///
    /// Writes a store and opens it: Tiles.
    ///
    /// Arrays are read a part at a time, so memory maps may be larger than memory. The folder appears when it is complete; until then it is
    /// `path.partial`, which the same call continues after it was killed. A store of that name is replaced.
    ///
    /// Parameters
    /// ----------
    /// vertices : (n, 3) floats, or (m, 3, 3) floats without triangles, or a mesh
    ///     As those of Bvh.
    /// triangles : (m, 3) integers or None
    ///     Vertex indices from 0.
    /// path : path
    ///     The folder.
    /// tile_triangles : int
    ///     The most triangles of a tile, each of which takes about 60 bytes.
    /// memory : number or str
    ///     Bytes to take, about.
    /// preset : "dynamic", "fast", "balanced" or "quality"
    ///     As that of Bvh.
    /// origin : "auto", "near", (3,) floats or None
    ///     As that of Bvh. To choose it, float64 arrays are read once more.
    /// threads, progress
    ///     As those of Bvh.
    #[staticmethod]
    #[pyo3(
        signature = (vertices, triangles, path, tile_triangles=262_144, *, memory=None, preset="balanced", origin=OriginArgument::auto(), threads=None, progress=None),
        text_signature = "(vertices, triangles, path, tile_triangles=262144, *, memory='2G', preset='balanced', origin='auto', threads=None, progress=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn build(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        path: PathBuf,
        tile_triangles: i64,
        memory: Option<&Bound<'_, PyAny>>,
        preset: &str,
        origin: OriginArgument<'_>,
        threads: Option<i64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let call = Call::new(py, threads, progress)?;
        let Some(tile_triangles) = usize::try_from(tile_triangles).ok().filter(|&n| n > 0) else {
            return Err(invalid(format!("tile_triangles is {tile_triangles}; use 1 or more")));
        };
        let (config, bytes) = (Config::preset(names::preset(preset)?), memory_of(memory)?);
        let python = py.import("canted.tiles")?;
        let (origin, is_near) = match origin.read()? {
            Origin::At(origin) => (origin, false),
            chosen => {
                let survey = Bound::new(py, Survey::default())?;
                let is_near = chosen == Origin::Near;
                python.call_method1("survey", (&survey, vertices, triangles, is_near))?;
                let (extent, rounding) = *lock(&survey.get().seen);
                let is_near = is_near || rounding.is_harmful();
                (if is_near { extent.origin() } else { NO_ORIGIN }, is_near)
            }
        };
        let options = WriteOptions { tile_triangles, memory: bytes, config, origin, is_near };
        let writer = Mutex::new(Some(TileWriter::create(&path, options).map_err(raised)?));
        let writer = Bound::new(py, Writer { writer, origin })?;
        python.call_method1("push", (&writer, vertices, triangles))?;
        let writer = lock(&writer.get().writer).take();
        let Some(writer) = writer else { return Err(invalid("the writer has ended")) };
        let done = Arc::new(Mutex::new(0.0));
        let of_task = Arc::clone(&done);
        let task = move || writer.finish(&mut |fraction| *lock(&of_task) = fraction);
        let written = run_watched(py, &call.threads, task, |_| call.report(*lock(&done)))?;
        written.map_err(raised)?;
        call.report(1.0)?;
        Self::new(py, path, memory)
    }

    /// closest_hit(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The first hit of each ray: Hits, as Bvh.closest_hit, whose parameters it has.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn closest_hit<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let (call, origin) = (Call::new(py, threads, progress)?, self.origin(origin)?);
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let Read { rays, starts } = arrays.rays(origin, self.rays_start()).all();
        let mut columns = Columns { starts, ..Columns::default() };
        let answer = |bvh: &TiledBvh, rays: &[Ray]| {
            let mut hits = vec![None; rays.len()];
            bvh.try_closest_hits(rays, &mut hits).map(|()| hits)
        };
        self.batches(&call, &rays, answer, |hits| {
            for hit in hits {
                match hit {
                    Some(hit) => columns.add(&hit, self.numbers(&hit), self.has_instances()),
                    None => columns.add_miss(self.has_instances()),
                }
            }
        })?;
        Hits::new(py, columns, self.surface(origin), arrays.shape())
    }

    /// occluded(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Whether each ray hits anything: (...,) bool, as Bvh.occluded.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let (call, origin) = (Call::new(py, threads, progress)?, self.origin(origin)?);
        let arrays = RayArrays::new(origins, directions, [t_min, t_max])?;
        let mut occluded = vec![];
        let answer = |bvh: &TiledBvh, rays: &[Ray]| {
            let mut occluded = vec![false; rays.len()];
            bvh.try_occluded(rays, &mut occluded).map(|()| occluded)
        };
        let rays = arrays.rays(origin, self.rays_start()).all().rays;
        self.batches(&call, &rays, answer, |part| occluded.extend(part))?;
        shaped(py, occluded, arrays.shape(), &[])
    }

    /// all_hits(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Every hit of every ray: Hits, as Bvh.all_hits.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let (call, origin) = (Call::new(py, threads, progress)?, self.origin(origin)?);
        self.list(&call, &RayArrays::new(origins, directions, [t_min, t_max])?, origin, |bvh, rays| {
            let mut lists = HitLists::new();
            bvh.try_all_hits(rays, &mut lists).map(|()| lists)
        })
    }

    /// crossings(origins, directions, t_min=0, t_max=inf, *, origin=None, threads=None, progress=None)
    ///
    /// Every crossing of a surface once: Hits, as Bvh.crossings.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, origin=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn crossings<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let (call, origin) = (Call::new(py, threads, progress)?, self.origin(origin)?);
        self.list(&call, &RayArrays::new(origins, directions, [t_min, t_max])?, origin, |bvh, rays| {
            let mut lists = HitLists::new();
            bvh.try_crossings(rays, &mut lists).map(|()| lists)
        })
    }

    /// contains(points, mode=None, *, origin=None, threads=None, progress=None)
    ///
    /// Whether each point is inside of a closed mesh or on its surface, by parity: (...,) bool, as Bvh.contains with mode "parity", which is the
    /// only mode of tiles.
    #[pyo3(signature = (points, mode=None, *, origin=None, threads=None, progress=None))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        check_mode(mode)?;
        let (call, points) = (Call::new(py, threads, progress)?, Table::of_any_shape(points, "points")?);
        let mut inside = vec![];
        if self.has_instances() {
            let answer = |bvh: &TiledBvh, points: &[[f64; 3]]| {
                let mut inside = vec![false; points.len()];
                bvh.try_contains_placed(points, &mut inside).map(|()| inside)
            };
            let all = points.rows(self.origin(origin)?).all_exact()?;
            self.batches(&call, &all, answer, |part| inside.extend(part))?;
            return shaped(py, inside, &points.shape, &[]);
        }
        let answer = |bvh: &TiledBvh, points: &[[f32; 3]]| {
            let mut inside = vec![false; points.len()];
            bvh.try_contains(points, &mut inside).map(|()| inside)
        };
        self.batches(&call, &points.rows(self.origin(origin)?).all()?, answer, |part| inside.extend(part))?;
        shaped(py, inside, &points.shape, &[])
    }

    /// nearest(points, max_distance=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The nearest point of the mesh to each point: Nearest, as Bvh.nearest.
    #[pyo3(signature = (points, max_distance=f64::INFINITY, *, origin=None, threads=None, progress=None))]
    fn nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        max_distance: f64,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        self.near(&Call::new(py, threads, progress)?, points, &Wanted::one(max_distance), origin)
    }

    /// k_nearest(points, k, max_distance=inf, *, origin=None, threads=None, progress=None)
    ///
    /// The k nearest triangles to each point, nearest first: Nearest, as Bvh.k_nearest.
    #[pyo3(signature = (points, k, max_distance=f64::INFINITY, *, origin=None, threads=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn k_nearest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        k: i64,
        max_distance: f64,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Nearest> {
        self.near(&Call::new(py, threads, progress)?, points, &Wanted::some(k, max_distance)?, origin)
    }

    /// signed_distance(points, mode=None, *, origin=None, threads=None, progress=None)
    ///
    /// Distance of each point to the surface of a closed mesh, (...,) floats, negative inside by parity: as Bvh.signed_distance with mode "parity".
    #[pyo3(signature = (points, mode=None, *, origin=None, threads=None, progress=None))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        mode: Option<&str>,
        origin: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        check_mode(mode)?;
        let (call, points) = (Call::new(py, threads, progress)?, Table::of_any_shape(points, "points")?);
        let mut signed: Vec<f64> = vec![];
        let answer = |bvh: &TiledBvh, points: &[[f32; 3]]| {
            let mut signed = vec![0.0; points.len()];
            bvh.try_signed_distances(points, &mut signed).map(|()| signed)
        };
        let all = points.rows(self.origin(origin)?).all_exact()?;
        if self.has_instances() {
            let answer = |bvh: &TiledBvh, points: &[[f64; 3]]| {
                let mut signed = vec![0.0; points.len()];
                bvh.try_signed_distances_placed(points, &mut signed).map(|()| signed)
            };
            self.batches(&call, &all, answer, |part| signed.extend(part))?;
            return distances(py, signed, self.bvh.is_near(), &points.shape, &[]);
        }
        self.batches(&call, &nearest::rounded(&all), answer, |part| signed.extend(part.into_iter().map(f64::from)))?;
        if self.bvh.is_near() {
            // Their sizes by the points that are not rounded.
            let found = self.nearest_triangles(&call, &all, &Wanted::one(f64::INFINITY))?;
            for (signed, found) in signed.iter_mut().zip(found).filter(|(x, _)| x.is_finite() && **x != 0.0) {
                *signed = found.first().map_or(*signed, |near| near.distance.copysign(*signed));
            }
        }
        distances(py, signed, self.bvh.is_near(), &points.shape, &[])
    }

    /// check()
    ///
    /// Reads all files and compares them with the manifest.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The first file that is missing, damaged or of another store.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let bvh = Arc::clone(&self.bvh);
        Call::plain(py)?.run(move || bvh.check())?.map_err(raised)
    }

    /// stats()
    ///
    /// Numbers about the store, as a dict: triangles, tiles, bytes of all files; reads so far, held and held_bytes now, most_held_bytes.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (stats, counts) = (PyDict::new(py), self.bvh.counts());
        stats.set_item("triangles", self.bvh.n_primitives())?;
        stats.set_item("tiles", self.bvh.n_tiles())?;
        stats.set_item("bytes", self.bvh.n_file_bytes())?;
        stats.set_item("reads", counts.reads)?;
        stats.set_item("held", counts.held)?;
        stats.set_item("held_bytes", counts.held_bytes)?;
        stats.set_item("most_held_bytes", counts.most_bytes)?;
        Ok(stats)
    }

    /// The least and the greatest coordinates, (2, 3) float64 in the space of the caller; None for an empty mesh.
    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        let (aabb, origin) = (self.bvh.aabb(), self.bvh.origin());
        let given = |end: [f32; 3]| (0..3).map(move |k| f64::from(end[k]) + origin[k]);
        let ends = || given(aabb.min).chain(given(aabb.max)).collect();
        (!aabb.is_empty()).then(|| shaped(py, ends(), &[2], &[3])).transpose()
    }

    /// What is subtracted from coordinates, as a tuple of three floats.
    #[getter]
    #[pyo3(name = "origin")]
    fn origin_of_store(&self) -> (f64, f64, f64) {
        self.bvh.origin().into()
    }

    /// The folder.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    fn __len__(&self) -> usize {
        usize::try_from(self.bvh.n_primitives()).unwrap_or(usize::MAX)
    }

    fn __bool__(&self) -> bool {
        true
    }

    fn __repr__(&self) -> String {
        let (n, tiles, mib) = (self.bvh.n_primitives(), self.bvh.n_tiles(), self.bvh.n_file_bytes().div_ceil(1 << 20));
        format!("Tiles({n} triangles in {tiles} tiles, {mib} MiB)")
    }

    /// For pickle and copy: the path, which another process must be able to read.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        Ok((py.get_type::<Self>(), (&self.path, self.memory).into_pyobject(py)?))
    }
}

/// Takes triangles and vertices of Python, by which an origin is chosen.
#[pyclass(frozen, module = "canted._canted")]
#[derive(Default)]
pub(crate) struct Survey {
    seen: Mutex<(Extent, Rounding)>,
}

#[pymethods]
impl Survey {
    /// Adds triangles as rows of vertices, three for each.
    fn triangles(&self, corners: &Bound<'_, PyAny>) -> PyResult<()> {
        let corners = Table::new(corners, "vertices")?.rows(NO_ORIGIN).all_exact()?;
        let (extent, rounding) = &mut *lock(&self.seen);
        for &triangle in corners.as_chunks::<3>().0 {
            rounding.add(triangle);
            triangle.into_iter().for_each(|vertex| extent.add(vertex));
        }
        Ok(())
    }

    /// Adds vertices.
    fn vertices(&self, vertices: &Bound<'_, PyAny>) -> PyResult<()> {
        let (vertices, mut seen) = (Table::new(vertices, "vertices")?.rows(NO_ORIGIN).all_exact()?, lock(&self.seen));
        vertices.into_iter().for_each(|vertex| seen.0.add(vertex));
        Ok(())
    }
}

/// Takes triangles of Python for a store that is being written.
#[pyclass(frozen, module = "canted._canted")]
pub(crate) struct Writer {
    writer: Mutex<Option<TileWriter>>,
    origin: [f64; 3],
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl Writer {
    /// Adds triangles as rows of vertices, three for each.
    fn push(&self, py: Python<'_>, corners: &Bound<'_, PyAny>) -> PyResult<()> {
        let corners: Vec<[f32; 3]> = Table::new(corners, "vertices")?.rows(self.origin).all()?;
        py.detach(|| {
            let triangles: Vec<[[f32; 3]; 3]> = corners.as_chunks::<3>().0.to_vec();
            lock(&self.writer).as_mut().map_or(Ok(()), |writer| writer.push(&triangles))
        })
        .map_err(raised)
    }
}

/// The columns of hits, row by row.
impl Columns {
    fn add(&mut self, hit: &Hit, (number, instance): (u64, u32), has_instances: bool) {
        self.t.push(hit.t);
        self.primitive.push(i32::try_from(number).unwrap_or(i32::MAX));
        self.u.push(hit.u);
        self.v.push(hit.v);
        self.entering.push(hit.side == Side::Front);
        if has_instances {
            self.instance.push(i32::try_from(instance).unwrap_or(i32::MAX));
        }
    }

    fn add_miss(&mut self, has_instances: bool) {
        self.t.push(f32::INFINITY);
        self.primitive.push(-1);
        self.u.push(0.0);
        self.v.push(0.0);
        self.entering.push(false);
        if has_instances {
            self.instance.push(-1);
        }
    }
}

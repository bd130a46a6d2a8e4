"""Queries and pictures on Dask: on the threads of this machine, a LocalCluster, several hosts, Slurm or Kubernetes.

>>> import dask.array as da, numpy as np                                            # doctest: +SKIP
>>> from dask.distributed import Client                                             # doctest: +SKIP
>>> client = Client(n_workers=2, threads_per_worker=1)                              # doctest: +SKIP
>>> hits = canted.distributed.closest_hit("city.tiles", origins, directions)        # doctest: +SKIP
>>> hits.t.min().compute()                                                          # doctest: +SKIP

`bvh` is a Bvh, whose bytes each worker gets once; a Tiles; or a path or an fsspec URL (s3://...) of a file of Bvh.save or of a folder of tiles, which each
worker opens once. Rays and points are NumPy or Dask arrays; NumPy arrays are divided into chunks of `chunk` rows. Results are lazy, with the fields of the
local call as Dask arrays, and their bits: a hit does not depend on chunks, workers or tiles. A task uses one thread.

A worker that dies costs the tasks that it ran: Dask runs them again, as often as `distributed.scheduler.allowed-failures` says.
A worker with another version of canted is an error that names both. Nothing here unpickles what a file contains.

docs/cluster.md has complete ways to start a cluster, and what larger queries take.
"""

import hashlib
import json
import os
import tempfile
import threading
from collections import OrderedDict
from pathlib import Path

import numpy as np

from . import Bvh, Tiles, __version__

try:
    import dask
    import dask.array as da
    from dask.highlevelgraph import HighLevelGraph
except ImportError as error:
    raise ImportError("canted.distributed needs dask; pip install 'canted[distributed]'", name="dask") from error

__all__ = ["Hits", "Nearest", "all_hits", "closest_hit", "contains", "cost", "crossings", "nearest", "occluded", "render", "signed_distance"]

# Rows of a chunk of a NumPy array: a second or so of work, so that Dask's overhead, about a millisecond for each task, does not count.
CHUNK = 1_000_000

# BVHs that a worker holds open: the one in use, and one of a query before.
_MOST_OPEN = 2


class _Source:
    """What a worker needs to open a BVH: a path, or bytes."""

    def __init__(self, key, path=None, data=None, memory=None):
        self.key, self.path, self.data, self.memory = key, path, data, memory

    def __dask_tokenize__(self):
        return (type(self).__name__, self.key, self.memory)

    def open(self):
        """The BVH; of several threads that ask for it, one opens it."""
        key = (self.key, self.memory)
        with _LOCK:
            lock = _LOCKS.setdefault(key, threading.Lock())
        with lock:
            if key not in _OPEN:
                opened = self._read()
                with _LOCK:
                    _OPEN[key] = opened
                    while len(_OPEN) > _MOST_OPEN:
                        _OPEN.popitem(last=False)
            else:
                opened = _OPEN[key]
        return opened

    def _read(self):
        if self.data is not None:
            # The checked format of Bvh.save, not a pickle.
            return Bvh._from_bytes(self.data)
        path = _fetched(self.path, self.key) if "://" in self.path else self.path
        if os.path.isdir(path):
            return Tiles(path) if self.memory is None else Tiles(path, self.memory)
        return Bvh.load(path)


_LOCK = threading.Lock()
_LOCKS = {}
_OPEN = OrderedDict()


def _fetched(url, key):
    """A local copy of a file or of a folder of tiles; complete or absent, as several workers of a host share it."""
    fsspec = _fsspec()
    system, remote = fsspec.core.url_to_fs(url)
    folder = Path(tempfile.gettempdir()) / f"canted-{os.getuid() if hasattr(os, 'getuid') else 0}" / hashlib.sha256(repr(key).encode()).hexdigest()[:32]
    if not folder.exists():
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as partial:
            target = Path(partial) / "bvh"
            system.get(remote, str(target), recursive=system.isdir(remote))
            whole = Path(partial) / "whole"
            whole.mkdir()
            target.rename(whole / "bvh")
            try:
                whole.rename(folder)
            except OSError:
                # Another worker was faster.
                if not folder.exists():
                    raise
    return str(folder / "bvh")


def _fsspec():
    try:
        import fsspec
    except ImportError as error:
        raise ImportError("a URL of a BVH needs fsspec; pip install 'canted[distributed]'", name="fsspec") from error
    return fsspec


def _stamp(path):
    """What changes when the file at a path does: so that workers open it again."""
    if "://" in path:
        system, remote = _fsspec().core.url_to_fs(path)
        if system.isdir(remote):
            remote = remote.rstrip("/") + "/manifest.json"
        return str(system.ukey(remote)) if hasattr(system, "ukey") else ""
    file = os.path.join(path, "manifest.json") if os.path.isdir(path) else path
    try:
        found = os.stat(file)
    except FileNotFoundError:
        # Workers may see what this process does not.
        return ""
    return f"{found.st_mtime_ns} {found.st_size} {found.st_ino}"


def _source(bvh, memory):
    """The source as a value of the graph, which each worker gets once, and the type of t."""
    if isinstance(bvh, Bvh):
        data = bvh.__reduce__()[1][0]
        source = _Source(hashlib.sha256(data).hexdigest(), data=data)
        near = bvh.nearest(np.zeros((0, 3))).distance.dtype
    else:
        if isinstance(bvh, Tiles):
            bvh = bvh.path
        if not isinstance(bvh, (str, os.PathLike)):
            raise TypeError(f"bvh is a {type(bvh).__name__}; use a Bvh, a Tiles, or a path or URL of one that is saved")
        path = os.fspath(bvh)
        if "://" not in path:
            path = os.path.abspath(path)
        source = _Source((path, _stamp(path)), path=path, memory=memory)
        near = _type_of_file(path)
    name = "canted-bvh-" + dask.base.tokenize(source)
    graph = HighLevelGraph.from_collections(name, {name: source})
    return dask.delayed(source, name=name, traverse=False) if graph is None else _delayed(name, graph), near


def _delayed(name, graph):
    from dask.delayed import Delayed

    return Delayed(name, graph)


def _type_of_file(path):
    """float64 for a saved Bvh or for tiles whose origin was chosen near them, else float32."""
    try:
        head = _start_of(path, 24)
        is_near = head[:8] == b"CANTEDPY" and len(head) == 24 and head[20] & 2
    except OSError:
        try:
            # A folder of tiles.
            is_near = json.loads(_start_of(path.rstrip("/") + "/manifest.json")).get("is_near", False)
        except (OSError, ValueError, AttributeError):
            # What only workers see, or what they find to be damaged.
            is_near = False
    return np.dtype(np.float64 if is_near else np.float32)


def _start_of(path, n=-1):
    with _fsspec().open(path, "rb") if "://" in path else open(path, "rb") as file:
        return file.read(n)


def _ask(block, *others, source, version, method, given):
    """A task: the answer of one chunk, an object of canted."""
    if version != __version__:
        raise RuntimeError(f"this worker has canted {__version__}, the client {version}; install one version on all")
    return getattr(source.open(), method)(block, *others, threads=1, **given)


def _ask_rays(origins, directions, t_min, t_max, **given):
    # The rows of t have an axis more, so that chunks align.
    ends = [end[..., 0] if isinstance(end, np.ndarray) and end.ndim else end for end in (t_min, t_max)]
    return _ask(origins, directions, *ends, **given)


def _field(answer, name):
    return getattr(answer, name)


def _count(answer):
    return np.array([len(answer)])


class _Result:
    """Fields of the answers of all chunks, as Dask arrays. Ask for all that you need in one call of dask.compute, or persist() the result: the query then runs
    once."""

    # Fields that the answers of chunks do not have.
    _COUNTED = ()

    def __init__(self, answers, **types):
        self._answers, self._types = answers, types

    def __getattr__(self, name):
        if name.startswith("_") or name not in self._types:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}; it has {', '.join([*self._COUNTED, *self.__dict__.get('_types', ())])}")
        dtype, inner = self._types[name]
        if dtype is None:
            return None
        return self._of(name, dtype, inner)

    def _of(self, name, dtype, inner):
        ndim = self._answers.ndim
        return da.map_blocks(
            _field,
            self._answers,
            name,
            dtype=dtype,
            chunks=self._answers.chunks + tuple((n,) for n in inner),
            new_axis=list(range(ndim, ndim + len(inner))) or None,
            meta=np.empty((0,) * (ndim + len(inner)), dtype),
        )

    def persist(self, **options):
        """The result with its queries started, which stay on the workers."""
        other = type(self).__new__(type(self))
        other.__dict__.update(self.__dict__)
        (other._answers,) = dask.persist(self._answers, **options)
        return other

    def compute(self, *names, **options):
        """The named fields, or all but position and normal, as a dict of NumPy arrays: one run of the query."""
        own = [name for name, (dtype, _) in self._types.items() if dtype is not None and name not in ("position", "normal")]
        names = names or [*self._COUNTED, *own]
        return dict(zip(names, dask.compute(*(getattr(self, name) for name in names), **options)))

    def __dir__(self):
        return [*super().__dir__(), *self._types]


class Hits(_Result):
    """The fields of canted.Hits as Dask arrays: t, primitive, u, v, entering, ray, hit, position, normal; instance is None but for scenes of tiles.

    For all_hits and crossings, the number of rows is known only when they are computed.
    """

    _COUNTED = ("ray",)


class Nearest(_Result):
    """The fields of canted.Nearest as Dask arrays: distance, primitive, position; instance is None."""


def _rows(array, name, chunk, rest=()):
    """A Dask array of rows of three numbers, none of which is divided."""
    if not isinstance(array, da.Array):
        array = np.asarray(array)
        if array.ndim == 1:
            return array
        shape = array.shape
        # The first axis is divided.
        n = max(1, int(chunk // max(1, np.prod(shape[1:-1], dtype=np.int64))))
        array = da.from_array(array, chunks=(n, *shape[1:]), name=False if array.size > 1 << 27 else None)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{name} have shape {array.shape}; the last axis must have 3 numbers")
    return array.rechunk({array.ndim - 1: 3}) if array.ndim > 1 else array


def _rays(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk, is_list):
    source, near = _source(bvh, memory)
    arrays = [_rows(origins, "origins", chunk), _rows(directions, "directions", chunk)]
    if all(array.ndim == 1 for array in arrays):
        arrays = [da.asarray(np.asarray(array)[None]) for array in arrays]
    # The chunks are those of a Dask array that was given.
    own = [array for array, given in zip(arrays, (origins, directions)) if array.ndim > 1 and isinstance(given, da.Array)]
    shape = (own or [array for array in arrays if array.ndim > 1])[0]
    if all(array.ndim > 1 for array in arrays) and arrays[0].shape != arrays[1].shape:
        _check_sizes(arrays[0].shape + arrays[1].shape, "origins or directions")
        raise ValueError(f"there are origins of shape {arrays[0].shape}, but directions of shape {arrays[1].shape}")
    if is_list and shape.ndim > 2:
        # Rays are numbered row by row, so chunks must be in this order.
        arrays = [array.reshape(-1, 3) if array.ndim > 1 else array for array in arrays]
        shape = shape.reshape(-1, 3)
    arrays = [array.rechunk(shape.chunks) if array.ndim > 1 else array for array in arrays]
    ends = [_end(end, name, shape, default) for end, name, default in ((t_min, "t_min", 0.0), (t_max, "t_max", np.inf))]
    given = {} if origin is None else {"origin": origin}
    options = dict(source=source, version=__version__, method=method, given=given)
    parts = [array if isinstance(array, da.Array) else np.asarray(array) for array in arrays]
    answers = da.map_blocks(
        _whole_rows, *parts, *ends, **options, drop_axis=shape.ndim - 1, dtype=object, meta=np.empty((0,) * (shape.ndim - 1), object)
    )
    return answers, near


def _whole_rows(*blocks, source, version, method, given):
    return _ask_rays(*blocks, source=source, version=version, method=method, given=given)


def _check_sizes(sizes, name):
    """Refuses what needs the sizes of chunks that are not known before they are computed."""
    if np.isnan(sizes).any():
        raise ValueError(f"{name} have chunks of unknown sizes; call their compute_chunk_sizes() first")


def _end(end, name, shape, default):
    """An end of the interval: a number, or rows in the chunks of the rays with an axis more."""
    if end is None:
        return default
    if np.ndim(end) == 0 and not isinstance(end, da.Array):
        return float(end)
    end = end if isinstance(end, da.Array) else np.asarray(end)
    _check_sizes(end.shape + shape.shape, f"{name} or the rays")
    if end.size != int(np.prod(shape.shape[:-1])):
        raise ValueError(f"{name} has shape {end.shape}; the rays have shape {shape.shape[:-1]}")
    if not isinstance(end, da.Array):
        end = da.from_array(end.reshape(shape.shape[:-1]), chunks=shape.chunks[:-1])
    return end.reshape(shape.shape[:-1]).rechunk(shape.chunks[:-1])[..., None]


_HIT_TYPES = {
    "primitive": (np.int32, ()),
    "u": (np.float32, ()),
    "v": (np.float32, ()),
    "entering": (np.bool_, ()),
    "hit": (np.bool_, ()),
    "instance": (None, ()),
    "position": (np.float64, (3,)),
    "normal": (np.float64, (3,)),
}


def closest_hit(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """The first hit of each ray, as Bvh.closest_hit: Hits with Dask arrays in the shape of the rays.

    Parameters
    ----------
    bvh : Bvh, Tiles, path or URL
        See the module.
    origins, directions : (..., 3) NumPy or Dask arrays
        As for Bvh.closest_hit. Chunks of Dask arrays stay.
    t_min, t_max : float or (...,) arrays
        The closed interval of t.
    origin : (3,) floats, optional
        Subtracted from origins. Default: that of the BVH.
    memory : int or str, optional
        For tiles: bytes that each worker holds, such as "2G".
    chunk : int
        Rows of a chunk of a NumPy array.
    """
    answers, near = _rays(bvh, "closest_hit", origins, directions, t_min, t_max, origin, memory, chunk, False)
    return _Closest(answers, t=(near, ()), **_HIT_TYPES)


class _Closest(Hits):
    @property
    def ray(self):
        """The index of each ray, counted row by row."""
        shape = self._answers.shape
        _check_sizes(shape, "the rays")
        return da.arange(int(np.prod(shape)), dtype=np.int64).reshape(shape).rechunk(self._answers.chunks)


class _Listed(Hits):
    @property
    def ray(self):
        """The index of the ray of each hit."""
        sizes = self._sizes
        _check_sizes(sizes, "the rays")
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        return self._of("ray", np.int64, ()) + _per_block(starts, self._answers.chunks)


def _per_block(starts, chunks):
    """A Dask array with one number for each chunk, which is broadcast."""
    blocks = da.from_array(starts, chunks=1)
    return da.map_blocks(lambda block: block, blocks, chunks=chunks, dtype=np.int64, meta=np.empty(0, np.int64))


def _list(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk):
    answers, near = _rays(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk, True)
    sizes = answers.chunks[0]
    unknown = da.map_blocks(lambda answer: answer, answers, chunks=((np.nan,) * len(sizes),), dtype=object, meta=np.empty(0, object))
    found = _Listed(unknown, t=(near, ()), **_HIT_TYPES)
    found._sizes = sizes
    return found


def all_hits(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """Every hit of every ray, as Bvh.all_hits: Hits with rows in order of ray, then t; parameters as closest_hit."""
    return _list(bvh, "all_hits", origins, directions, t_min, t_max, origin, memory, chunk)


def crossings(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """Every crossing of a surface once, as Bvh.crossings: Hits with rows in order of ray, then t; parameters as closest_hit."""
    return _list(bvh, "crossings", origins, directions, t_min, t_max, origin, memory, chunk)


def occluded(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """Whether each ray hits anything, as Bvh.occluded: a Dask array of bool; parameters as closest_hit."""
    answers, _ = _rays(bvh, "occluded", origins, directions, t_min, t_max, origin, memory, chunk, False)
    return _plain(answers, np.bool_)


def _plain(answers, dtype):
    return da.map_blocks(np.asarray, answers, dtype=dtype, meta=np.empty((0,) * answers.ndim, dtype))


def _points(bvh, method, points, given, memory, chunk):
    source, near = _source(bvh, memory)
    points = _rows(points, "points", chunk)
    if points.ndim == 1:
        points = da.asarray(np.asarray(points)[None])
    options = dict(source=source, version=__version__, method=method, given={k: v for k, v in given.items() if v is not None})
    answers = da.map_blocks(_ask, points, **options, drop_axis=points.ndim - 1, dtype=object, meta=np.empty((0,) * (points.ndim - 1), object))
    return answers, near


def contains(bvh, points, mode=None, *, origin=None, memory=None, chunk=CHUNK):
    """Whether each point is inside of a mesh or on its surface, as the contains of the BVH: a Dask array of bool. Tiles have the mode "parity" only."""
    answers, _ = _points(bvh, "contains", points, {"mode": mode, "origin": origin}, memory, chunk)
    return _plain(answers, np.bool_)


def nearest(bvh, points, max_distance=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """The nearest point of the mesh to each point, as Bvh.nearest: Nearest with Dask arrays."""
    answers, near = _points(bvh, "nearest", points, {"max_distance": float(max_distance), "origin": origin}, memory, chunk)
    return Nearest(answers, distance=(near, ()), primitive=(np.int32, ()), instance=(None, ()), position=(np.float64, (3,)))


def signed_distance(bvh, points, mode=None, *, origin=None, memory=None, chunk=CHUNK):
    """Distance of each point to the surface, negative inside, as the signed_distance of the BVH: a Dask array."""
    answers, near = _points(bvh, "signed_distance", points, {"mode": mode, "origin": origin}, memory, chunk)
    return _plain(answers, near)


def render(scene=None, size=None, spp=None, *, parts=None, client=None, progress=None, **options):
    """A picture, rendered as ranges of its samples on the workers and joined there, two by two: the picture of canted_render.render, bit for bit.

    Parameters
    ----------
    scene : path or dict, optional
        As for canted_render.render; every worker must be able to read the path.
    size, spp, **options
        As for canted_render.render.
    parts : int, optional
        Ranges of samples, at most spp. Default: two for each thread of the cluster.
    client : dask.distributed.Client, optional
        Default: the current client; without one, the threads of this process.
    progress : callable, optional
        Called with the finished fraction of the parts, with a client.

    Returns
    -------
    Picture
        As of canted_render.render, which has no noise threshold here: parts are of fixed samples.
    """
    import canted_render

    if options.get("noise") is not None:
        raise ValueError("noise needs all samples of a pixel in one place; use spp")
    if options.pop("threads", None) is not None:
        raise ValueError("threads is given; a task has one thread, so start workers with as many threads as tasks are to run at once")
    spp = canted_render.samples_per_pixel(scene, spp)
    if client is None:
        client = _current_client()
    if parts is None:
        parts = 2 * sum(client.nthreads().values()) if client is not None else 2 * (os.cpu_count() or 1)
    if parts < 1:
        raise ValueError(f"parts is {parts}; use 1 or more")
    ranges = _ranges(spp, min(parts, spp))
    request = dask.delayed((scene, size, spp, options), traverse=False, pure=False)
    if isinstance(scene, (str, os.PathLike)) and os.path.exists(scene):
        request = dask.delayed((os.path.abspath(scene), size, spp, options), traverse=False, pure=False)
    render_part, merge = dask.delayed(_render_part, pure=False), dask.delayed(_merge, pure=False)
    first = [render_part(request, __version__, a, b) for a, b in ranges]
    level = first
    while len(level) > 1:
        level = [merge(level[i : i + 2]) if i + 1 < len(level) else level[i] for i in range(0, len(level), 2)]
    (whole,) = level
    if client is None:
        return canted_render.picture_of_part(dask.compute(whole, scheduler="threads")[0])
    future = client.compute(whole)
    if progress is not None:
        _watch(future, client.compute(first), progress)
    try:
        return canted_render.picture_of_part(future.result())
    except BaseException:
        # Ctrl-C and failures end what is left.
        future.cancel()
        raise


def _ranges(spp, parts):
    """Ranges of samples of similar sizes, from multiples of 64 on where there are enough: such parts store the fewest sums."""
    unit = 64 if spp >= 64 * parts else 1
    n = spp // unit
    ends = [unit * (n * i // parts) for i in range(parts)] + [spp]
    return list(zip(ends, ends[1:]))


def _current_client():
    try:
        from distributed import get_client

        return get_client()
    except (ImportError, ValueError):
        return None


def _watch(whole, futures, progress):
    from distributed import as_completed

    progress(0.0)
    for done, _ in enumerate(as_completed(futures), 1):
        progress(done / len(futures))


def _render_part(request, version, first, last):
    if version != __version__:
        raise RuntimeError(f"this worker has canted {__version__}, the client {version}; install one version on all")
    import canted_render

    scene, size, spp, options = request
    return canted_render.render_part(scene, size, spp, first, last, threads=1, **options)


def _merge(parts):
    import canted_render

    return canted_render.merge_parts(parts)


def cost(rays, triangles, workers, *, ray_seconds=1e-6, triangle_bytes=60, memory=8 << 30, read=1 << 30, network=1 << 30, chunk=CHUNK, task_seconds=1e-3, coherent=True):
    """What a query takes, by a simple model: a dict of seconds, moved bytes and bytes of memory.

    Work is divided evenly, with a last round that is not full; the scheduler starts a task after the other. A BVH that fits into the memory of a worker is read
    once by each; of a larger one, coherent rays read each tile that they reach once for every batch of a million rays of a worker, and incoherent ones read
    all tiles.

    Parameters
    ----------
    rays, triangles, workers : int
        What is asked, of how large a mesh, of how many workers of one thread.
    ray_seconds : float
        Of one ray on one thread with the BVH in memory.
    triangle_bytes : float
        Of a tile, for each triangle.
    memory : float
        Bytes of tiles that a worker holds.
    read, network : float
        Bytes a second that a worker reads, and that the network of the client or of all rays carries.
    chunk : int
        Rays of a task.
    task_seconds : float
        Of the scheduler for a task.
    coherent : bool
        Whether the rays of a chunk are close to each other: they then need about the square root of the part of tiles that a chunk is of all rays, at least one.
    """
    tasks = max(1, -(-rays // chunk))
    rounds = -(-tasks // workers)
    size = triangles * triangle_bytes
    if size <= memory:
        reads = size
    else:
        batches = rounds * max(1, chunk // (1 << 20))
        part = min(1.0, (chunk / max(rays, 1)) ** 0.5) if coherent else 1.0
        reads = batches * size * part
    traced = rounds * min(chunk, rays) * ray_seconds
    scheduled = tasks * 2 * task_seconds
    moved = rays * (28 + 17)
    seconds = max(traced + reads / read, scheduled, moved / network)
    parts = {"trace": traced, "read": reads / read, "schedule": scheduled, "move": moved / network}
    return {
        "seconds": seconds,
        "limit": max(parts, key=parts.get),
        "moved_bytes": moved,
        "read_bytes": reads * min(workers, tasks),
        "memory_bytes": min(size, memory) + chunk * 200,
        "tasks": tasks,
        **{f"{name}_seconds": value for name, value in parts.items()},
    }

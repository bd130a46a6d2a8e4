"""Queries of rays and points, a task for each chunk."""

import json
import os
import uuid
import weakref

import dask
import dask.array as da
import numpy as np

from .. import Bvh, Tiles, __version__, _canted
from .results import Closest, Listed, Nearest, check_sizes
from .travel import choose, holders, in_graph, of_parts
from .worker import Source, fsspec_module, run

# Rows of a chunk of a NumPy array: a second or so of work, so that Dask's overhead, about a millisecond for each task, does not count.
CHUNK = 1_000_000


def _stamp(path):
    """What changes when the file at a path does: so that workers open it again."""
    if "://" in path:
        system, remote = fsspec_module().core.url_to_fs(path)
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
    """The source as a value of the graph, which each worker gets once; the type of t; whether hits have an instance."""
    source, near, has_instances, _ = _opened(bvh, memory)
    return _in_graph(source), near, has_instances


def _in_graph(source):
    return in_graph("canted-bvh-" + dask.base.tokenize(source), source)


def _opened(bvh, memory):
    """The source; the type of t; whether hits have an instance; the bytes of each tile."""
    sizes = []
    if isinstance(bvh, Bvh):
        source = _source_of_memory(bvh)
        near, has_instances = bvh.nearest(np.zeros((0, 3))).distance.dtype, False
    else:
        if isinstance(bvh, Tiles):
            bvh = bvh.path
        if not isinstance(bvh, (str, os.PathLike)):
            raise TypeError(f"bvh is a {type(bvh).__name__}; use a Bvh, a Tiles, or a path or URL of one that is saved")
        path = os.fspath(bvh)
        if "://" not in path:
            path = os.path.abspath(path)
        source = Source((path, _stamp(path)), path=path, memory=memory)
        is_near, has_instances, sizes = _kind_of_file(path)
        near = np.dtype(np.float64 if is_near else np.float32)
    return source, near, has_instances, sizes


# The sources of BVHs in memory, which later queries of the same BVH share.
_SOURCES = weakref.WeakKeyDictionary()


def _source_of_memory(bvh):
    """A BVH as it is now: a refit makes another one."""
    source = _SOURCES.get(bvh)
    if source is None or not _canted.is_same(source.bvh, bvh):
        source = _SOURCES[bvh] = Source(uuid.uuid4().hex, bvh=_canted.snapshot(bvh))
    return source


def _kind_of_file(path):
    """Of a saved Bvh or of tiles, whether its origin was chosen near it, whether it has placements, and the bytes of each tile."""
    try:
        head = _start_of(path, 24)
        return bool(head[:8] == b"CANTEDPY" and len(head) == 24 and head[20] & 2), False, []
    except OSError:
        pass
    try:
        # A folder of tiles.
        manifest = json.loads(_start_of(path.rstrip("/") + "/manifest.json"))
        columns = [placement["world_from_object"] for placement in manifest["placements"]]
        is_plain = len(manifest["meshes"]) == 1 and np.array_equal(columns, [np.eye(4, 3)])
        sizes = [tile["bytes"] + 4 * tile["triangles"] for tile in manifest["tiles"]]
        return manifest.get("is_near", False), not is_plain, sizes
    except (OSError, ValueError, AttributeError, KeyError, TypeError):
        # What only workers see, or what they find to be damaged.
        return False, False, []


def _start_of(path, n=-1):
    with fsspec_module().open(path, "rb") if "://" in path else open(path, "rb") as file:
        return file.read(n)


def _rows(array, name, chunk):
    """A Dask array of rows of three numbers, none of which is divided."""
    if not isinstance(array, da.Array):
        array = np.asarray(array)
        if array.ndim == 1:
            return array
        shape = array.shape
        # The first axis is divided. Without a name, Dask would hash all numbers.
        n = max(1, int(chunk // max(1, np.prod(shape[1:-1], dtype=np.int64))))
        array = da.from_array(array, chunks=(n, *shape[1:]), name=False)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{name} have shape {array.shape}; the last axis must have 3 numbers")
    return array.rechunk({array.ndim - 1: 3}) if array.ndim > 1 else array


def _rays(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk, is_list, travel="tiles"):
    source, near, has_instances, sizes = _opened(bvh, memory)
    arrays = [_rows(origins, "origins", chunk), _rows(directions, "directions", chunk)]
    if all(array.ndim == 1 for array in arrays):
        arrays = [da.asarray(np.asarray(array)[None]) for array in arrays]
    # The chunks are those of a Dask array that was given.
    own = [array for array, given in zip(arrays, (origins, directions)) if array.ndim > 1 and isinstance(given, da.Array)]
    shape = (own or [array for array in arrays if array.ndim > 1])[0]
    if all(array.ndim > 1 for array in arrays) and arrays[0].shape != arrays[1].shape:
        check_sizes(arrays[0].shape + arrays[1].shape, "origins or directions")
        raise ValueError(f"there are origins of shape {arrays[0].shape}, but directions of shape {arrays[1].shape}")
    if is_list and shape.ndim > 2:
        # Rays are numbered row by row, so chunks must be in this order.
        arrays = [array.reshape(-1, 3) if array.ndim > 1 else array for array in arrays]
        shape = shape.reshape(-1, 3)
    arrays = [array.rechunk(shape.chunks) if array.ndim > 1 else array for array in arrays]
    ends = [_end(end, name, shape, default) for end, name, default in ((t_min, "t_min", 0.0), (t_max, "t_max", np.inf))]
    given = {} if origin is None else {"origin": origin}
    types = {"t": (near, ()), **_HIT_TYPES, "instance": (np.int32 if has_instances else None, ())}
    # Where t is rounded on the way to the caller, hits of parts are not compared exactly.
    is_exact = near == np.float32 and not has_instances
    n_rays, n_chunks = float(np.prod(shape.shape[:-1])), int(np.prod(shape.numblocks))
    parts = choose(travel, sizes if is_exact else [], memory, n_rays, n_chunks)
    if parts:

        def ask(arrays, part):
            return _answers("ask_part", arrays, shape, part, method, given)

        return of_parts(ask, [*arrays, *ends], holders(source, parts, sizes)), types
    return _answers("ask_rays", [*arrays, *ends], shape, _in_graph(source), method, given), types


def _answers(task, arrays, shape, source, method, given):
    """A Dask array with the answers of all chunks, each an object of canted that is a block in the shape of the rows."""
    ndim = shape.ndim - 1
    return da.map_blocks(
        run,
        __version__,
        task,
        *arrays,
        source=source,
        method=method,
        given=given,
        # What the dashboard shows.
        token=f"canted-{method}",
        drop_axis=ndim,
        dtype=object,
        meta=np.empty((0,) * ndim, object),
    )


def _end(end, name, shape, default):
    """An end of the interval: a number, or rows in the chunks of the rays with an axis more."""
    if end is None:
        return default
    if np.ndim(end) == 0 and not isinstance(end, da.Array):
        return float(end)
    end = end if isinstance(end, da.Array) else np.asarray(end)
    check_sizes(end.shape + shape.shape, f"{name} or the rays")
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
    "position": (np.float64, (3,)),
    "normal": (np.float64, (3,)),
}


def closest_hit(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK, travel="auto"):
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
    travel : "auto", "rays" or "tiles"
        For tiles: whether rays go to workers that each hold a part of `memory` bytes, or workers read the tiles that their rays need. By itself, what
        moves fewer bytes; rays only where the workers of the current client together hold all tiles, in a store of one mesh whose origin was not chosen near it.
    """
    answers, types = _rays(bvh, "closest_hit", origins, directions, t_min, t_max, origin, memory, chunk, False, travel)
    return Closest(answers, **types)


def _list(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk):
    answers, types = _rays(bvh, method, origins, directions, t_min, t_max, origin, memory, chunk, True)
    sizes = answers.chunks[0]
    unknown = da.map_blocks(lambda answer: answer, answers, chunks=((np.nan,) * len(sizes),), dtype=object, meta=np.empty(0, object))
    found = Listed(unknown, **types)
    found._sizes = sizes
    return found


def all_hits(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """Every hit of every ray, as Bvh.all_hits: Hits with rows in order of ray, then t; parameters as closest_hit."""
    return _list(bvh, "all_hits", origins, directions, t_min, t_max, origin, memory, chunk)


def crossings(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """Every crossing of a surface once, as Bvh.crossings: Hits with rows in order of ray, then t; parameters as closest_hit."""
    return _list(bvh, "crossings", origins, directions, t_min, t_max, origin, memory, chunk)


def occluded(bvh, origins, directions, t_min=0.0, t_max=np.inf, *, origin=None, memory=None, chunk=CHUNK, travel="auto"):
    """Whether each ray hits anything, as Bvh.occluded: a Dask array of bool; parameters as closest_hit."""
    answers, _ = _rays(bvh, "occluded", origins, directions, t_min, t_max, origin, memory, chunk, False, travel)
    return _plain(answers, np.bool_)


def _plain(answers, dtype):
    return da.map_blocks(np.asarray, answers, dtype=dtype, meta=np.empty((0,) * answers.ndim, dtype))


def _points(bvh, method, points, given, memory, chunk):
    source, near, has_instances = _source(bvh, memory)
    points = _rows(points, "points", chunk)
    if points.ndim == 1:
        points = da.asarray(np.asarray(points)[None])
    return _answers("ask", [points], points, source, method, {k: v for k, v in given.items() if v is not None}), near, has_instances


def contains(bvh, points, mode=None, *, origin=None, memory=None, chunk=CHUNK):
    """Whether each point is inside of a mesh or on its surface, as the contains of the BVH: a Dask array of bool. Tiles have the mode "parity" only."""
    answers, *_ = _points(bvh, "contains", points, {"mode": mode, "origin": origin}, memory, chunk)
    return _plain(answers, np.bool_)


def nearest(bvh, points, max_distance=np.inf, *, origin=None, memory=None, chunk=CHUNK):
    """The nearest point of the mesh to each point, as Bvh.nearest: Nearest with Dask arrays."""
    answers, near, has_instances = _points(bvh, "nearest", points, {"max_distance": float(max_distance), "origin": origin}, memory, chunk)
    return Nearest(answers, distance=(near, ()), primitive=(np.int32, ()), instance=(np.int32 if has_instances else None, ()), position=(np.float64, (3,)))


def signed_distance(bvh, points, mode=None, *, origin=None, memory=None, chunk=CHUNK):
    """Distance of each point to the surface, negative inside, as the signed_distance of the BVH: a Dask array."""
    answers, near, _ = _points(bvh, "signed_distance", points, {"mode": mode, "origin": origin}, memory, chunk)
    return _plain(answers, near)

"""Rays that travel to workers, each of which holds a part of a store of tiles.

    chunk of rays -> worker with the first part -> worker with the second -> ... -> hits of the whole

A part is a run of tiles, which are near each other, that fits into the memory of a worker. A ray goes on with the closest hit so far as the end of its
interval, so a part behind that hit costs it next to nothing. Hits combine to those of one BVH: by the least t, then the lowest number.
"""

import dask
import dask.array as da
import numpy as np
from dask.delayed import Delayed
from dask.highlevelgraph import HighLevelGraph

# Bytes that a ray and its hit take on the way from a worker to the next, about.
_RAY_BYTES = 150

# Bytes of tiles that a worker holds where a call does not say how many.
_MEMORY = 2 << 30

CHOICES = ("auto", "rays", "tiles")


def choose(choice, sizes, memory, n_rays, n_chunks):
    """The parts of a store whose tiles have these sizes, as (first, n) tiles, or None where tiles travel to the rays.

    By itself, rays travel where no worker holds all tiles but all workers do, and rays through all parts are fewer bytes than all tiles for every chunk.
    """
    if choice not in CHOICES:
        raise ValueError(f"travel is {choice!r}; use {', '.join(CHOICES)}")
    if choice == "tiles" or not sizes:
        return None
    limit = _MEMORY if memory is None else dask.utils.parse_bytes(memory)
    parts = divided(sizes, limit)
    if choice == "auto":
        is_held = 1 < len(parts) <= len(_workers()[1])
        if not is_held or not n_rays * _RAY_BYTES * len(parts) < n_chunks * sum(sizes):
            return None
    return parts


def divided(sizes, limit):
    """Runs of tiles of at most `limit` bytes, or of one tile."""
    parts, held = [], 0
    for tile, size in enumerate(sizes):
        if not parts or held + size > limit:
            parts.append((tile, 0))
            held = 0
        first, n = parts[-1]
        parts[-1] = (first, n + 1)
        held += size
    return parts


def _workers():
    """The client and the addresses of its workers, if there is one."""
    try:
        from distributed import default_client

        client = default_client()
    except (ImportError, ValueError):
        return None, []
    return client, sorted(client.ncores())


def holders(source, parts, sizes):
    """What opens each part, on the worker that holds it: tasks go there, as it says that it is as large as its tiles."""
    client, workers = _workers()
    for i, (first, n) in enumerate(parts):
        own = source.of_part(first, n, sum(sizes[first : first + n]))
        name, value = "canted-part-" + dask.base.tokenize(own), own
        if workers:
            value = client.submit(own.held, key=name, workers=[workers[i % len(workers)]], allow_other_workers=True)
        yield in_graph(name, value)


def in_graph(name, value):
    """A value of a graph, which each worker gets once."""
    return Delayed(name, HighLevelGraph.from_collections(name, {name: value}))


def of_parts(ask, arrays, sources):
    """A Dask array with the answers of all chunks, part after part. `ask` makes those of one part, whose last array has the answers before it."""
    found = None
    for source in sources:
        found = ask([*arrays, *([] if found is None else [_with_axis(found)])], source)
    return found


def _with_axis(found):
    """Answers with an axis more, so that their chunks align with those of rays."""
    ndim = found.ndim + 1
    return da.map_blocks(boxed, found, ndim, new_axis=found.ndim, chunks=(*found.chunks, (1,)), dtype=object, meta=np.empty((0,) * ndim, object))


def boxed(answer, ndim):
    """An answer as the one element of an array, as Dask joins the blocks of an axis that is dropped."""
    box = np.empty((1,) * ndim, object)
    box.flat[0] = answer
    return box

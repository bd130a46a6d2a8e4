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

try:
    import dask.array
except ImportError as error:
    raise ImportError("canted.distributed needs dask; pip install 'canted[distributed]'", name="dask") from error

from .model import cost, simulate
from .pictures import render
from .queries import all_hits, closest_hit, contains, crossings, nearest, occluded, signed_distance
from .results import Hits, Nearest

__all__ = ["Hits", "Nearest", "all_hits", "closest_hit", "contains", "cost", "crossings", "nearest", "occluded", "render", "signed_distance", "simulate"]

del dask

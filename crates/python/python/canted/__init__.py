"""Ray and distance queries on triangle meshes.

>>> import numpy as np
>>> import canted
>>> vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
>>> bvh = canted.Bvh(vertices, [[0, 1, 2]])
>>> hits = bvh.closest_hit([[0.25, 0.5, 1.0]], [[0.0, 0.0, -1.0]])
>>> hits.t[0].item(), hits.primitive[0].item(), hits.position[0].tolist()
(1.0, 0, [0.25, 0.5, 0.0])

Every answer is that of a loop over all triangles; there is no epsilon. Bvh and Tlas answer queries. canted.trimesh and
canted.open3d have the interfaces of these packages.
"""

import importlib

from ._canted import Bvh, Hits, Nearest, Tlas, __version__

__all__ = ["Bvh", "Heatmap", "Hits", "Nearest", "Tlas", "__version__", "open3d", "trimesh"]

# Loaded on first use, so that `import canted` takes milliseconds.
_MODULES = ("open3d", "trimesh")


def __getattr__(name):
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    if name == "Heatmap":
        return importlib.import_module(f"{__name__}.heatmap").Heatmap
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted([*globals(), *__all__])

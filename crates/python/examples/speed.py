"""Times of this package and of its peers on the same mesh and rays, interleaved.

    python speed.py [MODEL] [RAYS] [ROUNDS]

Default: a sphere of 80,000 triangles, 20,000 rays, 3 rounds. Prints the least wall time of the rounds, the greatest, and the least processor
time of all threads, which says more on a busy machine.
"""

import sys
import time
import warnings

import numpy as np
import trimesh

import canted
import canted.trimesh


def rays(mesh, n):
    """From a sphere around the mesh to points of its box."""
    random = np.random.default_rng(0)
    center, radius = mesh.bounds.mean(axis=0), np.linalg.norm(mesh.extents)
    outward = random.normal(size=(n, 3))
    origins = center + radius * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    return origins, random.uniform(*mesh.bounds, (n, 3)) - origins


def tasks(mesh, n):
    """Names and calls: of the first hit, then of all hits."""
    origins, directions = rays(mesh, n)
    single = origins.astype(np.float32), directions.astype(np.float32)
    bvh = canted.Bvh(mesh.vertices, mesh.faces)
    ours = canted.trimesh.RayMeshIntersector(mesh)
    first = {
        "canted.Bvh": lambda: bvh.closest_hit(*single),
        "canted.trimesh": lambda: ours.intersects_first(origins, directions),
    }
    every = {
        "canted.Bvh": lambda: bvh.crossings(*single),
        "canted.trimesh": lambda: ours.intersects_id(origins, directions, multiple_hits=True),
    }
    try:
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        peer = RayMeshIntersector(mesh)
        first["trimesh + embreex"] = lambda: peer.intersects_first(origins, directions)
        every["trimesh + embreex"] = lambda: peer.intersects_id(origins, directions, multiple_hits=True)
    except ImportError:
        print("skipped trimesh + embreex: embreex is not installed")
    try:
        from open3d.core import Tensor
        from open3d.t.geometry import RaycastingScene

        scene = RaycastingScene()
        scene.add_triangles(Tensor(np.asarray(mesh.vertices, np.float32)), Tensor(np.asarray(mesh.faces, np.uint32)))
        tensor = Tensor(np.concatenate(single, axis=1))
        first["Open3D"] = lambda: scene.cast_rays(tensor)
        every["Open3D"] = lambda: scene.list_intersections(tensor)
    except (ImportError, OSError):
        print("skipped Open3D: it is not installed")
    return {"first hit": first, "all hits": every}


def main(model=None, n=20_000, n_rounds=3):
    """Prints a line for each engine and query."""
    mesh = trimesh.creation.icosphere(subdivisions=6) if model is None else trimesh.load(model, force="mesh")
    print(f"{len(mesh.faces)} triangles, {n} rays")
    for query, calls in tasks(mesh, n).items():
        times = {name: [] for name in calls}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for i in range(n_rounds + 1):
                for name, call in calls.items():
                    wall, processors = time.perf_counter(), time.process_time()
                    call()
                    # The first round builds what is built on first use.
                    if i > 0:
                        times[name].append((1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - processors)))
        for name, found in times.items():
            walls, processors = zip(*found)
            spread = f"{min(walls):9.1f} ms  (to {max(walls):.1f})"
            print(f"{query:<10} {name:<18} {spread:<28} {min(processors):9.1f} ms of processors")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main(*arguments[:1], *map(int, arguments[1:]))

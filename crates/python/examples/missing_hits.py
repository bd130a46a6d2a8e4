"""Rays that other libraries lose or count twice, from their issue trackers; a table of wrong answers.

    python missing_hits.py

Each case has rays whose number of surface crossings is known without tracing. The engines that are installed answer: trimesh with
this package, with embreex, and with its own loop (needs rtree), and Open3D.
"""

import warnings

import numpy as np
import trimesh

import canted.trimesh


class Case:
    """Rays against a mesh, with the number of times that each ray crosses its surface."""

    def __init__(self, trackers, mesh, origins, directions, expected):
        self.trackers, self.mesh, self.expected = trackers, mesh, np.broadcast_to(expected, len(origins))
        self.origins, self.directions = (np.asarray(rays, dtype=np.float64) for rays in (origins, directions))


def _outward(mesh, targets):
    """Rays from the center of a convex mesh: one crossing each."""
    return np.zeros_like(targets), targets, 1


def _grid(n, low, high, z):
    x, y = np.meshgrid(np.linspace(low, high, n), np.linspace(low, high, n))
    return np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3)


def cases():
    """All cases: from what the trackers describe, with meshes that anyone can make."""
    box, ball = trimesh.creation.box(extents=[40, 40, 40]).subdivide_to_size(20), trimesh.creation.icosphere(subdivisions=4)
    big = trimesh.creation.box(extents=[60, 60, 60]).subdivide_to_size(20)
    yield Case("trimesh #1496", box, *_outward(box, big.vertices))
    yield Case("trimesh #1180, Embree #174, #181", ball, *_outward(ball, ball.vertices))
    edges = ball.vertices[ball.edges_unique].mean(axis=1)
    yield Case("trimesh #242, mitsuba3 #1149, Embree #188", ball, *_outward(ball, edges))
    square = trimesh.Trimesh([[-1, -1, 0], [-1, 1, 0], [1, 1, 0], [1, -1, 0]], [(0, 1, 2), (2, 3, 0)])
    diagonal = np.linspace(-0.96875, 0.96875, 63)
    origins = np.stack([diagonal, diagonal, np.ones(63)], axis=1)
    yield Case("trimesh #1766", square, origins, np.tile([0.0, 0.0, -1.0], (63, 1)), 1)
    column = trimesh.creation.cylinder(radius=1.0, height=4.0, sections=32)
    origins = _grid(33, -0.625, 0.625, -5.0)
    yield Case("trimesh #457", column, origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)), 2)
    origins = _grid(33, -0.5e-3 * 0.9375, 0.5e-3 * 0.9375, 1e4)
    tiny = trimesh.creation.box(extents=[1e-3, 1e-3, 1e-3])
    yield Case("trimesh #2504", tiny, origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)), 2)
    for scale in (1e-4, 1.0, 1e8):
        scaled = trimesh.creation.box().subdivide().subdivide()
        scaled.apply_scale(scale)
        origins = _grid(17, -0.375, 0.375, 0.5) * scale
        yield Case(f"trimesh #2520, scale {scale:g}", scaled, origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)), 2)
    # Thin shells: the walls are closer than the offset that others add after each hit.
    shells = [trimesh.creation.box(extents=[2, 2, 2 + 2e-6 * i]) for i in range(20)]
    origins = _grid(16, -0.9, 0.9, 5.0)
    yield Case("trimesh #2520, walls 1e-6 apart", trimesh.util.concatenate(shells), origins,
               np.tile([0.0, 0.0, -1.0], (len(origins), 1)), 40)  # fmt: skip
    # A point on a vertex's height is where rays of a containment test pass through vertices.
    ring = trimesh.creation.torus(major_radius=2.0, minor_radius=0.5)
    origins = ring.vertices - [8.0, 0.0, 0.0]
    yield Case("trimesh #1919", ring, origins, np.tile([1.0, 0.0, 0.0], (len(origins), 1)), -1)


def engines():
    """Names and functions that count the crossings of each ray of a case."""
    found = {"canted": lambda case: _count(canted.trimesh.RayMeshIntersector(case.mesh), case)}
    try:
        from trimesh.ray.ray_pyembree import RayMeshIntersector as Embree

        if Embree is not canted.trimesh.RayMeshIntersector:
            found["trimesh + embreex"] = lambda case: _count(Embree(case.mesh), case)
    except ImportError:
        pass
    try:
        import rtree  # noqa: F401

        from trimesh.ray.ray_triangle import RayMeshIntersector as Native

        found["trimesh, own loop"] = lambda case: _count(Native(case.mesh), case)
    except ImportError:
        pass
    try:
        from open3d.core import Tensor
        from open3d.t.geometry import RaycastingScene

        def count(case):
            scene = RaycastingScene()
            scene.add_triangles(
                Tensor(np.asarray(case.mesh.vertices, np.float32)), Tensor(np.asarray(case.mesh.faces, np.uint32))
            )
            rays = np.concatenate([case.origins, case.directions], axis=1).astype(np.float32)
            return scene.count_intersections(Tensor(rays)).numpy()

        found["Open3D"] = count
    except (ImportError, OSError):
        pass
    return found


def _count(intersector, case):
    with warnings.catch_warnings():
        # Engines divide by zero where rays run in planes.
        warnings.simplefilter("ignore")
        index_ray = intersector.intersects_location(case.origins, case.directions, multiple_hits=True)[1]
    return np.bincount(index_ray, minlength=len(case.origins))


def wrong(case, counts):
    """How many rays have a wrong count; -1 stands for any even number, which rays through a closed mesh have."""
    if (case.expected == -1).all():
        return int((counts % 2 != 0).sum())
    return int((counts != case.expected).sum())


def main():
    """Prints the table: rays with a wrong number of crossings."""
    all_engines = engines()
    widths = [max(len(name), 8) for name in all_engines]
    print(f"{'case':<45}{'rays':>6}  " + "  ".join(f"{name:>{w}}" for name, w in zip(all_engines, widths)))
    for case in cases():
        found = [wrong(case, count(case)) for count in all_engines.values()]
        line = "  ".join(f"{n:>{w}}" for n, w in zip(found, widths))
        print(f"{case.trackers:<45}{len(case.origins):>6}  {line}")


if __name__ == "__main__":
    main()

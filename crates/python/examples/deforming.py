"""A mesh that moves in every frame: refit instead of rebuild, until a rebuild is advised.

    python deforming.py

A rod twists. Each frame moves its vertices, refits the BVH and traces rays; the first hits are those of a new BVH, bit for bit.
"""

import time

import numpy as np
import trimesh

import canted


def twisted(vertices, angle):
    """The vertices, turned about x by the angle for each unit of x."""
    x, y, z = vertices.T
    cosine, sine = np.cos(angle * x), np.sin(angle * x)
    return np.stack([x, cosine * y - sine * z, sine * y + cosine * z], axis=1)


def main():
    """Prints a line for each frame."""
    rod = trimesh.creation.box(extents=[8, 1, 0.25]).subdivide_to_size(0.1)
    random = np.random.default_rng(0)
    origins = random.uniform(-5, 5, (20_000, 3))
    directions = random.uniform(rod.bounds[0], rod.bounds[1], (20_000, 3)) - origins
    bvh = canted.Bvh(rod.vertices, rod.faces)
    n_rebuilds = 0
    print("frame  refit ms  drift  hits")
    for frame in range(12):
        vertices = twisted(rod.vertices, 0.1 * frame)
        start = time.perf_counter()
        report = bvh.refit(vertices)
        milliseconds = 1e3 * (time.perf_counter() - start)
        hits = bvh.closest_hit(origins, directions)
        new = canted.Bvh(vertices, rod.faces)
        expected = new.closest_hit(origins, directions)
        assert (hits.t == expected.t).all() and (hits.primitive == expected.primitive).all()
        print(f"{frame:5}  {milliseconds:8.2f}  {report['drift']:5.2f}  {hits.hit.sum()}")
        if report["rebuild_advised"]:
            bvh, n_rebuilds = new, n_rebuilds + 1
    print(f"rebuilt {n_rebuilds} times")


if __name__ == "__main__":
    main()

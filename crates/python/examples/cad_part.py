"""Containment and wall thickness of a CAD part, without an epsilon.

    python cad_part.py

The part is a housing: a box with a cavity and a bore, made of closed surfaces. Its thickness at a point of the surface is how far a
ray runs inward until it leaves the part; the picture shows it from above. A second way to the volume checks the first.
"""

import numpy as np
import trimesh

import canted


def housing():
    """A closed box of 8 x 6 x 4 with a cavity, open nowhere, whose walls are 0.5 to 1.5 thick."""
    outer = trimesh.creation.box(bounds=[[-4, -3, 0], [4, 3, 4]])
    # A cavity is a closed surface that is turned inside out.
    cavity = trimesh.creation.box(bounds=[[-3.5, -2.25, 0.75], [2.5, 2.25, 3.25]])
    cavity.invert()
    return trimesh.util.concatenate([outer, cavity])


def thickness_from_above(bvh, n=64):
    """Thickness of the topmost wall along rays downward: (n, n); NaN beside the part."""
    (x0, y0, _), (x1, y1, z1) = bvh.bounds
    x, y = np.meshgrid(x0 + (np.arange(n) + 0.5) * (x1 - x0) / n, y0 + (np.arange(n) + 0.5) * (y1 - y0) / n)
    origins = np.stack([x, y, np.full_like(x, z1 + 1.0)], axis=-1).reshape(-1, 3)
    hits = bvh.crossings(origins, [0.0, 0.0, -1.0])
    # Crossings of a ray alternate: in, out, in, out. The first two bound the topmost wall.
    first = np.searchsorted(hits.ray, np.arange(n * n))
    counts = np.bincount(hits.ray, minlength=n * n)
    thickness = np.full(n * n, np.nan)
    found = counts >= 2
    thickness[found] = hits.t[first[found] + 1] - hits.t[first[found]]
    return thickness.reshape(n, n), counts.reshape(n, n)


def main():
    """Prints what it finds, and writes thickness.png."""
    mesh = housing()
    bvh = canted.Bvh(mesh.vertices, mesh.faces)
    print(bvh)
    points = np.random.default_rng(0).uniform(mesh.bounds[0], mesh.bounds[1], (200_000, 3))
    share = bvh.contains(points).mean()
    box_volume = np.prod(mesh.extents)
    print(f"volume: {share * box_volume:.2f} by random points, {mesh.volume:.2f} by the triangles")
    assert abs(share * box_volume - mesh.volume) < 0.02 * box_volume
    thickness, counts = thickness_from_above(bvh)
    assert (counts % 2 == 0).all()
    print(f"walls seen from above: {np.nanmin(thickness):g} to {np.nanmax(thickness):g} thick")
    # Above the cavity the wall has 0.75, elsewhere the whole part.
    assert set(np.unique(thickness).tolist()) == {0.75, 4.0}
    distance = bvh.signed_distance([[0.0, 0.0, 0.25], [0.0, 0.0, 2.0], [3.25, 0.0, 2.0]])
    print(f"signed distances: {distance[0]:g} in the floor, {distance[1]:g} in the cavity, {distance[2]:g} in the thick wall")
    canted.Heatmap(thickness).save("thickness.png")


if __name__ == "__main__":
    main()

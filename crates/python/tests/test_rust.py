"""The answers of the Rust library, bit for bit."""

import subprocess

import canted
import meshes
import numpy as np
import pytest


def of_rust(program, folder, vertices, triangles, rays, points):
    """All answers of the library: a dict of arrays of 32-bit words."""
    counts = [len(vertices), len(triangles), len(rays), len(points)]
    parts = [np.array(counts, "<u4"), vertices.astype("<f4"), triangles.astype("<u4"), rays.astype("<f4"), points.astype("<f4")]
    (folder / "in").write_bytes(b"".join(part.tobytes() for part in parts))
    subprocess.run([program, folder / "in", folder / "out"], check=True)
    words = np.frombuffer((folder / "out").read_bytes(), "<u4")
    n, p = len(rays), len(points)
    found = {}
    for name, shape in [("closest", (n, 5)), ("occluded", (n,)), ("all", None), ("crossings", None),
                        ("contains", (p,)), ("nearest", (p, 5)), ("signed", (p,))]:  # fmt: skip
        if shape is None:
            shape, words = (int(words[0]), 6), words[1:]
        size = int(np.prod(shape))
        found[name], words = words[:size].reshape(shape), words[size:]
    assert len(words) == 0
    return found


def rows(hits):
    """Hits as words: t, u, v, triangle, front side."""
    columns = [hits.t, hits.u, hits.v, hits.primitive, hits.entering.astype(np.uint32)]
    return np.stack([column.view(np.uint32) for column in columns], axis=1)


@pytest.mark.parametrize("name", ["soup", "sphere", "far soup"])
def test_every_query_has_the_bits_of_rust(answers, tmp_path, name):
    vertices, triangles = {
        "soup": lambda: meshes.soup(2000),
        "sphere": lambda: meshes.sphere(4),
        "far soup": lambda: meshes.soup(500, scale=10.0, offset=1e6),
    }[name]()
    scale, offset = (10.0, 1e6) if name == "far soup" else (1.0, 0.0)
    origins, directions = meshes.rays(5000, scale=scale, offset=offset)
    if name == "sphere":
        edges = meshes.through_edges(vertices, triangles, 5000)
        origins, directions = np.concatenate([origins, edges[0]]), np.concatenate([directions, edges[1]])
    n = len(origins)
    random = np.random.default_rng(7)
    t_min = np.where(random.random(n) < 0.5, 0.0, random.random(n)).astype(np.float32)
    t_max = np.where(random.random(n) < 0.5, np.inf, t_min + random.random(n)).astype(np.float32)
    points = (random.uniform(-1.5, 1.5, (1000, 3)) * scale + offset).astype(np.float32)
    rays = np.concatenate([origins, directions, t_min[:, None], t_max[:, None]], axis=1)
    rust = of_rust(answers, tmp_path, vertices, triangles, rays, points)
    bvh = canted.Bvh(vertices, triangles)
    for threads in (1, 3, None):
        arguments = (origins, directions, t_min, t_max)
        assert (rows(bvh.closest_hit(*arguments, threads=threads)) == rust["closest"]).all()
        assert (bvh.occluded(*arguments, threads=threads) == rust["occluded"]).all()
        for query, name in ((bvh.all_hits, "all"), (bvh.crossings, "crossings")):
            hits = query(*arguments, threads=threads)
            assert len(hits) == len(rust[name]) > 1000
            assert (hits.ray == rust[name][:, 0]).all() and (rows(hits) == rust[name][:, 1:]).all()
        assert (bvh.contains(points, "parity", threads=threads) == rust["contains"]).all()
        near = bvh.nearest(points, threads=threads)
        assert (near.distance.view(np.uint32) == rust["nearest"][:, 0]).all()
        assert (near.primitive.view(np.uint32) == rust["nearest"][:, 1]).all()
        assert (near.position.astype(np.float32).view(np.uint32) == rust["nearest"][:, 2:]).all()
        assert (bvh.signed_distance(points, "parity", threads=threads).view(np.uint32) == rust["signed"]).all()
    # The comparison notices one changed bit.
    hits = bvh.closest_hit(origins, directions, t_min, t_max)
    hits.t.view(np.uint32)[17] ^= 1
    assert (rows(hits) != rust["closest"]).sum() == 1

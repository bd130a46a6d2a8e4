"""Meshes and rays that the tests share. All coordinates are float32."""

import numpy as np

BOX_TRIANGLES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6],
     [1, 3, 5], [3, 7, 5]]
)  # fmt: skip


def box(low=(0, 0, 0), high=(1, 1, 1)):
    """A closed box whose triangles run counter-clockwise as seen from outside."""
    corners = [[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]
    return np.array(corners, np.float32), BOX_TRIANGLES.copy()


def soup(n, seed=0, scale=1.0, offset=0.0):
    """Random triangles: large, small, needles, flats and duplicates."""
    random = np.random.default_rng(seed)
    center = random.uniform(-1, 1, (n, 1, 3))
    size = 10.0 ** random.uniform(-3, 0, (n, 1, 1))
    corners = center + size * random.uniform(-1, 1, (n, 3, 3))
    corners[: n // 8, 2] = corners[: n // 8, 1] + 1e-4 * random.uniform(-1, 1, (n // 8, 3))
    corners[n // 8 : n // 6, 2] = corners[n // 8 : n // 6, 0]
    corners[n // 6 : n // 4] = corners[n // 4 : n // 4 + n // 4 - n // 6]
    corners[::5, :, 2] = np.round(corners[::5, :1, 2], 1)
    corners[0, 0] = -0.0
    vertices = (corners * scale + offset).astype(np.float32).reshape(-1, 3)
    return vertices, np.arange(3 * n, dtype=np.int32).reshape(-1, 3)


def sphere(subdivisions=3):
    """A closed sphere of radius 1."""
    low, high = -np.ones(3), np.ones(3)
    vertices, triangles = box(low, high)
    for _ in range(subdivisions):
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        corners = np.concatenate([a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2])
        i = np.arange(len(triangles)) + len(triangles) * np.arange(6)[:, None]
        parts = [[i[0], i[3], i[5]], [i[3], i[1], i[4]], [i[5], i[4], i[2]], [i[3], i[4], i[5]]]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        vertices, index = np.unique(corners, axis=0, return_inverse=True)
        triangles = index.reshape(-1)[triangles]
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices.astype(np.float32), triangles


def rays(n, seed=1, scale=1.0, offset=0.0):
    """Rays of any length and direction, also along axes, from around a mesh."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-2, 2, (n, 3))
    targets = random.uniform(-1, 1, (n, 3))
    directions = (targets - origins) * 10.0 ** random.uniform(-3, 3, (n, 1))
    directions[::7] = np.eye(3)[random.integers(0, 3, len(directions[::7]))] * random.choice([-1, 1], (len(directions[::7]), 1))
    directions[::14] *= -0.0 + 1.0
    return (origins * scale + offset).astype(np.float32), (directions * scale).astype(np.float32)


def through_edges(vertices, triangles, n, seed=2):
    """Rays from outside exactly at vertices and at midpoints of edges, as far as float32 holds them."""
    random = np.random.default_rng(seed)
    edges = triangles[random.integers(0, len(triangles), n)]
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    targets = np.where(random.random((n, 1)) < 0.5, a, (a + b) / 2)
    origins = random.integers(-8, 9, (n, 3)).astype(np.float32)
    origins[np.abs(origins).max(axis=1) < 4, 0] = 8
    return origins, (targets - origins).astype(np.float32)

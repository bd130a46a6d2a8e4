"""A crane lowers its hook onto a bridge: when it first touches, and which triangles touch.

    python crane_hook.py [hook.obj]

The hook moves straight down until `cast` finds the contact; `pairs` names the triangles. The scene is written as OBJ, where the hook touches:
the touching triangles of the bridge are red. docs/pictures/hook.png is this file by
`canted render hook.obj -o hook.png --size 960x540 --spp 64 --eye 4.6,5.4,4.2 --target 0.3,3.4,-0.9`.
"""

import sys

import numpy as np

import canted


def beam(start, end, width):
    """A closed bar with a square section between two points: vertices, triangles."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, [0, 0, 1] if abs(along[2]) < 0.9 else [1, 0, 0])
    across *= 0.5 * width / np.linalg.norm(across)
    up = np.cross(along, across)
    ring = [across + up, up - across, -across - up, across - up]
    # In pieces of a few widths, so that triangles that touch are where the contact is.
    n = max(1, round(np.linalg.norm(end - start) / (6 * width)))
    vertices = np.array([start + (end - start) * i / n + corner for i in range(n + 1) for corner in ring])
    quads = [[4 * i + k, 4 * i + (k + 1) % 4, 4 * i + 4 + (k + 1) % 4, 4 * i + 4 + k] for i in range(n) for k in range(4)]
    quads += [[3, 2, 1, 0], [4 * n, 4 * n + 1, 4 * n + 2, 4 * n + 3]]
    triangles = np.array([triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])])
    return vertices, triangles


def joined(parts):
    """Meshes as one."""
    first = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    return np.concatenate([v for v, _ in parts]), np.concatenate([t + n for (_, t), n in zip(parts, first)])


def truss(n, side, height, width):
    """A lattice girder along x of n cells with diagonal members, centered at the origin."""
    x = (np.arange(n + 1) - n / 2) * side
    parts = []
    for y, z in [(-1, 0), (1, 0), (-1, 1), (1, 1)]:
        parts.append(beam([x[0], y * side / 2, z * height], [x[-1], y * side / 2, z * height], 1.5 * width))
    for i in range(n + 1):
        for y in (-1, 1):
            parts.append(beam([x[i], y * side / 2, 0], [x[i], y * side / 2, height], width))
        for z in (0, 1):
            parts.append(beam([x[i], -side / 2, z * height], [x[i], side / 2, z * height], width))
    for i in range(n):
        for y in (-1, 1):
            ends = (0, height) if i % 2 == 0 else (height, 0)
            parts.append(beam([x[i], y * side / 2, ends[0]], [x[i + 1], y * side / 2, ends[1]], width))
        parts.append(beam([x[i], -side / 2, height], [x[i + 1], side / 2, height], width))
    return joined(parts)


def tube(points, radius, n=24):
    """A round bar along a curve in the plane x, z: vertices, triangles; open ends are closed by fans."""
    points = np.asarray(points, float)
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.cross(along, [0.0, 1.0, 0.0])
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    size = np.broadcast_to(radius, len(points))
    rings = [p + r * (np.cos(angle)[:, None] * m + np.sin(angle)[:, None] * [0, 1, 0]) for p, m, r in zip(points, normal, size)]
    vertices = np.concatenate(rings + [points[:1], points[-1:]])
    i, j = np.meshgrid(np.arange(len(points) - 1), np.arange(n), indexing="ij")
    a, b = i * n + j, i * n + (j + 1) % n
    sides = np.stack([a, b, b + n, a, b + n, a + n], axis=-1).reshape(-1, 3)
    k, last = np.arange(n), (len(points) - 1) * n
    caps = [np.stack([np.full(n, last + n), (k + 1) % n, k], axis=1), np.stack([np.full(n, last + n + 1), last + k, last + (k + 1) % n], axis=1)]
    return vertices, np.concatenate([sides, *caps])


def hook():
    """A hook with its block, whose lowest point is the origin."""
    angle = np.linspace(-0.9 * np.pi, 0.5 * np.pi, 60)
    bow = np.stack([0.7 * np.cos(angle), 0 * angle, 0.7 * np.sin(angle)], axis=1)
    shank = np.array([[0, 0, 0.7 + 0.1 * k] for k in range(1, 9)])
    # From a thin tip to a thick shank.
    bar = tube(np.concatenate([bow[:-1], np.array([[0.0, 0.0, 0.71]]), shank]), np.concatenate([np.linspace(0.07, 0.2, 60), np.full(8, 0.16)]))
    block = beam([0, -0.35, 1.9], [0, 0.35, 1.9], 0.9)
    vertices, triangles = joined([bar, block])
    return vertices - [0, 0, vertices[:, 2].min()], triangles


def write(path, parts):
    """Named parts with a color each, as OBJ and MTL."""
    name = path.rsplit(".", 1)[0]
    with open(f"{name}.mtl", "w") as file:
        for part, (_, _, color) in parts.items():
            file.write(f"newmtl {part}\nKd {color[0]} {color[1]} {color[2]}\n")
    first = 1
    with open(path, "w") as file:
        file.write(f"mtllib {name.rsplit('/', 1)[-1]}.mtl\n")
        for part, (vertices, triangles, _) in parts.items():
            file.write(f"usemtl {part}\n")
            # OBJ has y up.
            file.writelines(f"v {x:.6f} {z:.6f} {-y:.6f}\n" for x, y, z in vertices)
            file.writelines("f {} {} {}\n".format(*(triangle + first)) for triangle in triangles)
            first += len(vertices)


def main(path=None):
    """Prints the contact, and writes the scene."""
    bridge, load = truss(9, 2.0, 2.2, 0.16), hook()
    at_rest, moving = canted.Bvh(*bridge), canted.Bvh(*load)
    start = np.eye(4)
    start[:3, 3] = [0.55, 0.8, 9.0]
    contact = at_rest.cast(moving, [0, 0, -1], start)
    print(f"{len(bridge[1])} triangles of the bridge, {len(load[1])} of the hook")
    print(f"the hook touches the bridge after {contact.t:.4f} m, at {np.round(contact.position, 3)}")
    assert not at_rest.overlaps(moving, start)
    end = start.copy()
    end[2, 3] -= contact.t * (1 - 1e-6)
    assert not at_rest.overlaps(moving, end), "not before the contact"
    # A tenth of a millimeter later.
    end[2, 3] = start[2, 3] - contact.t - 1e-4
    pairs = at_rest.pairs(moving, end)
    assert contact.primitives.tolist() in pairs.tolist()
    touched = np.unique(pairs[:, 0])
    print(f"triangles {touched.tolist()} of the bridge touch {len(np.unique(pairs[:, 1]))} of the hook")
    if path is not None:
        vertices, triangles = bridge
        rest = np.delete(triangles, touched, axis=0)
        lowered = load[0] + end[:3, 3]
        cable = beam(end[:3, 3] + [0, 0, 2.3], [end[0, 3], end[1, 3], 9.5], 0.07)
        jib_vertices, jib_triangles = truss(8, 0.9, 0.9, 0.09)
        write(path, {
            "bridge": (vertices, rest, (0.33, 0.45, 0.55)),
            "touched": (vertices, triangles[touched], (0.9, 0.05, 0.03)),
            "hook": (lowered, load[1], (0.9, 0.6, 0.08)),
            "cable": (*cable, (0.1, 0.1, 0.1)),
            "jib": (jib_vertices + [end[0, 3] - 2.5, end[1, 3], 9.4], jib_triangles, (0.85, 0.5, 0.05)),
        })


if __name__ == "__main__":
    main(*sys.argv[1:2])

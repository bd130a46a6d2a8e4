"""Meshes against meshes, and spheres that move."""

import copy
import pickle
from fractions import Fraction
from itertools import product

import canted
import meshes
import numpy as np
import pytest


def _exact(vertices):
    return [[Fraction(float(x)) for x in vertex] for vertex in vertices]


def _sub(a, b):
    return [x - y for x, y in zip(a, b)]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def _touch(a, b):
    """Whether two triangles share a point, by fractions: no axis separates them."""
    a, b = _exact(a), _exact(b)
    edges = [[_sub(t[1], t[0]), _sub(t[2], t[1]), _sub(t[0], t[2])] for t in (a, b)]
    between = [_sub(p, q) for p, q in product(a, b)]
    axes = [_cross(e[0], e[1]) for e in edges] + [_cross(e, f) for e, f in product(*edges)] + between
    axes += [_cross(e, _cross(offset, e)) for e in edges[0] + edges[1] for offset in between]
    for axis in axes:
        one, other = ([_dot(p, axis) for p in t] for t in (a, b))
        if max(one) < min(other) or max(other) < min(one):
            return False
    return True


def _brute(a, b):
    """All touching pairs of triangles by their vertices, (n, 3, 3) float64."""
    low, high = a[:, None].min(axis=2), a[:, None].max(axis=2)
    near = ((low <= b[None].max(axis=2)) & (b[None].min(axis=2) <= high)).all(axis=2)
    return [[i, j] for i, j in zip(*np.nonzero(near)) if _touch(a[i], b[j])]


def _moved(vertices, pose):
    return vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]


def _rotation(angle):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose


def test_pairs_are_those_of_a_loop():
    (a, ta), (b, tb) = meshes.soup(350, 0), meshes.soup(350, 1)
    one, other = canted.Bvh(a, ta), canted.Bvh(b, tb)
    found = one.pairs(other)
    assert found.dtype == np.int32 and found.shape[1] == 2
    expected = _brute(a[ta].astype(np.float64), b[tb].astype(np.float64))
    assert found.tolist() == expected and len(expected) > 10
    assert one.overlaps(other) is True and one.distance_to(other).distance == 0
    mirrored = np.diag([-1.0, 1.0, 1.0, 1.0])
    assert one.pairs(other, pose=mirrored).tolist() == _brute(a[ta].astype(np.float64), _moved(b, mirrored)[tb])
    assert one.pairs(other, np.eye(4)).tolist() == expected
    assert np.unique(found, axis=0).tolist() == found.tolist(), "sorted by row, each once"


def test_a_pose_places_the_other_mesh():
    box = canted.Bvh(*meshes.box())
    pose = np.eye(4)
    for x, touch in [(0, True), (1, True), (np.nextafter(1, 2), False), (-1, True), (-1.5, False)]:
        pose[0, 3] = x
        assert box.overlaps(box, pose) is touch and (len(box.pairs(box, pose=pose)) > 0) is touch
        near = box.distance_to(box, pose)
        assert near.distance == pytest.approx(max(0, abs(x) - 1), abs=1e-15) and (near.distance == 0) is touch
    pose[0, 3] = 3
    near = box.distance_to(box, pose=pose)
    assert near.distance == 2 and near.points.shape == (2, 3) and near.primitives.shape == (2,)
    assert near.points[:, 0].tolist() == [1, 3] and near.points.dtype == np.float64
    turned = _rotation(np.pi / 4)
    turned[0, 3] = 3
    # The corner of the turned box nearest to the other: (0, 1) turned and moved, at x = 3 - sqrt(1/2).
    assert box.distance_to(box, turned).distance == pytest.approx(2 - 0.5**0.5)
    scaled = np.diag([4.0, 4.0, 4.0, 1.0])
    scaled[:3, 3] = [-1, -1, -1]
    assert not box.overlaps(box, scaled), "a surface inside of another does not touch it"


def test_touching_counts_and_degenerate_triangles_have_answers():
    base = canted.Bvh([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    cases = [
        ([[1, 1, 0], [1, 1, 3], [2, 1, 3]], True),
        ([[4, 0, 0], [5, 0, 1], [5, 1, 1]], True),
        ([[1, 1, 1e-30], [1, 1, 3], [2, 1, 3]], False),
        ([[0.5, 0.5, 0], [1, 0.5, 0], [0.5, 1, 0]], True),
        ([[5, 0, 0], [6, 0, 0], [5, 1, 0]], False),
        ([[1, 1, 0]] * 3, True),
        ([[1, 1, 0.5]] * 3, False),
        ([[1, 1, -1], [1, 1, 1], [1, 1, 1]], True),
    ]
    for corners, touch in cases:
        other = canted.Bvh(np.array(corners, np.float32), [[0, 1, 2]])
        assert base.overlaps(other) is touch and other.overlaps(base) is touch, corners
        assert base.pairs(other).tolist() == ([[0, 0]] if touch else [])


def test_only_what_touches_has_the_distance_zero():
    """Roundings of a pose part what would touch in real numbers: the distance is roundings, and not 0."""
    random = np.random.default_rng(5)
    n_apart = 0
    for _ in range(1000):
        a, b = random.integers(-2, 3, (2, 1, 3, 3)).astype(np.float32)
        pose = np.eye(4)
        pose[:3, :3] = random.integers(-9, 10, (3, 3)) / 10
        one, other = canted.Bvh(a), canted.Bvh(b)
        near, pairs = one.distance_to(other, pose), one.pairs(other, pose).tolist()
        assert (near.distance == 0) is bool(pairs)
        assert not pairs or near.primitives.tolist() == pairs[0], "of several the lowest"
        n_apart += 0 < near.distance < 1e-14
    assert n_apart > 3


def test_empty_meshes():
    empty, one = canted.Bvh(np.zeros((0, 3)), np.zeros((0, 3), int)), canted.Bvh(*meshes.box())
    for a, b in [(empty, one), (one, empty), (empty, empty)]:
        assert a.pairs(b).shape == (0, 2) and a.pairs(b).dtype == np.int32 and a.overlaps(b) is False
        near = a.distance_to(b)
        assert near.distance == np.inf and np.isnan(near.points).all() and near.primitives.tolist() == [-1, -1]
    assert empty.self_intersections().shape == (0, 2)
    near = canted.Bvh(np.zeros((0, 3)), np.zeros((0, 3), int), origin="near")
    hits = near.closest_hit(np.zeros((5, 3)), [0, 0, 1])
    assert hits.t.tolist() == [np.inf] * 5 and hits.t.dtype == np.float64 and np.isnan(hits.position).all()
    assert not empty.cast_sphere([[0, 0, 0]], [[0, 0, 1]], 1.0).hit.any()


def test_self_intersections():
    vertices, triangles = meshes.sphere(2)
    assert len(canted.Bvh(vertices, triangles).self_intersections()) == 0
    # Without indices, neighbors are those with equal vertices.
    assert len(canted.Bvh(vertices[triangles]).self_intersections()) == 0
    moved = vertices + np.float32(0.5)
    both = canted.Bvh(np.concatenate([vertices, moved]), np.concatenate([triangles, triangles + len(vertices)]))
    found = both.self_intersections()
    n = len(triangles)
    between = canted.Bvh(vertices, triangles).pairs(canted.Bvh(moved, triangles))
    assert found.dtype == np.int32 and (found - [0, n]).tolist() == between.tolist() and len(between) > 20
    twice = canted.Bvh(vertices, np.concatenate([triangles, triangles[:1]]))
    assert [0, n] in twice.self_intersections().tolist(), "coincident triangles are reported"


def test_far_meshes_keep_their_origins():
    """Meshes that float32 does not hold, each with an origin of its own."""
    vertices, triangles = meshes.box()
    at = np.array([4e6 + 0.3, 5e5, 100.0])
    one, other = canted.Bvh(vertices + at, triangles), canted.Bvh(vertices + at + [1.5, 0, 0], triangles)
    assert one.origin != (0, 0, 0)
    near = one.distance_to(other)
    assert near.distance == pytest.approx(0.5, abs=1e-6) and np.allclose(near.points[:, 0] - at[0], [1, 1.5], atol=1e-6)
    home = canted.Bvh(vertices, triangles)
    pose = np.eye(4)
    pose[:3, 3] = -at + [0.5, 0.5, 0.5]
    assert home.overlaps(other, pose) is False and home.overlaps(one, pose) is True
    back = np.eye(4)
    back[:3, 3] = at + [0, 0, 3]
    assert one.distance_to(home, back).distance == pytest.approx(2, abs=1e-6)
    hits = one.cast_sphere([at + [0.5, 0.5, 100]], [[0, 0, -1]], 0.25)
    assert hits.t.dtype == np.float64 and hits.t[0] == pytest.approx(98.75, abs=1e-5)


def test_spheres_that_move():
    box = canted.Bvh(*meshes.box())
    hits = box.cast_sphere([[0.5, 0.5, 5], [9, 9, 5], [0.5, 0.5, 1.1]], [[0, 0, -2], [0, 0, -1], [0, 0, 1]], 0.5)
    assert isinstance(hits, canted.Hits) and hits.t.tolist() == [1.75, np.inf, 0]
    assert hits.primitive[1] == -1 and hits.position[0].tolist() == [0.5, 0.5, 1] and hits.hit.tolist() == [True, False, True]
    assert box.cast_sphere([0.5, 0.5, 5], [0, 0, -1], 0.5, t_max=3.4).t[0] == np.inf
    assert box.cast_sphere([0.5, 0.5, 5], [0, 0, -1], 0.5, 3.5).t[0] == 3.5
    radii = np.array([[0.1], [0.2]])
    rays = np.broadcast_to(np.array([0.5, 0.5, 5.0]), (2, 1, 3))
    assert np.allclose(box.cast_sphere(rays, [0, 0, -1], radii).t, 4 - radii)
    for radius in (-1, np.nan, np.inf):
        with pytest.raises(ValueError, match="the radius of sphere 0 is"):
            box.cast_sphere([0.5, 0.5, 5], [0, 0, -1], radius)
    with pytest.raises(ValueError, match="radius has shape"):
        box.cast_sphere(rays, [0, 0, -1], [1.0, 2.0, 3.0])


def test_a_sphere_touches_when_the_mesh_is_as_near_as_its_radius():
    vertices, triangles = meshes.soup(80, 3)
    bvh = canted.Bvh(vertices, triangles)
    random = np.random.default_rng(4)
    origins = random.uniform(-3, 3, (200, 3)).astype(np.float32)
    directions = (random.uniform(-0.5, 0.5, (200, 3)) - origins).astype(np.float32)
    hits = bvh.cast_sphere(origins, directions, 0.2)
    assert 50 < hits.hit.sum()
    for origin, direction, t in zip(origins.astype(np.float64), directions.astype(np.float64), hits.t.astype(np.float64)):
        times = np.linspace(0, 3 if np.isinf(t) else t, 200)
        distance = bvh.nearest(origin + times[:, None] * direction).distance
        assert t == 0 or (distance[:-1] > 0.2 - 1e-5).all()
        assert np.isinf(t) or distance[-1] <= 0.2 + 1e-5


def test_what_is_refused():
    box = canted.Bvh(*meshes.box())
    bad = np.eye(4)
    bad[3, 0] = 1
    for pose, message in [
        (np.eye(3), "pose has shape \\(3, 3\\), not \\(4, 4\\)"),
        (bad, "pose has the last row \\[1.0, 0.0, 0.0, 1.0\\], not 0, 0, 0, 1"),
        (np.full((4, 4), np.nan), "pose has"),
        (np.diag([np.inf, 1, 1, 1]), "pose has a number that is not finite"),
    ]:
        for query in (box.pairs, box.overlaps, box.distance_to):
            with pytest.raises(ValueError, match=message):
                query(box, pose)
    with pytest.raises(TypeError):
        box.pairs("a box")


def test_distances_are_pickled():
    box = canted.Bvh(*meshes.box())
    pose = np.eye(4)
    pose[0, 3] = 3
    near = box.distance_to(box, pose)
    assert repr(near).startswith("Distance(2 between triangles ")
    for other in (pickle.loads(pickle.dumps(near)), copy.deepcopy(near)):
        assert other.distance == 2 and (other.points == near.points).all() and (other.primitives == near.primitives).all()


def test_meshes_that_move():
    box = canted.Bvh(*meshes.box())
    pose = np.eye(4)
    pose[:3, 3] = [3, 0.25, 0.25]
    found = box.cast(box, [-1, 0, 0], pose)
    assert found.t == pytest.approx(2) and found.normal.tolist() == [1, 0, 0] and found.position[0] == 1
    assert found.starts_inside is False and found.primitives.dtype == np.int32 and found.primitives.shape == (2,)
    assert box.cast(box, [-1, 0, 0], pose, t_max=1.9) is None and box.cast(box, [1, 0, 0], pose) is None
    inside = box.cast(box, [-1, 0, 0])
    assert inside.t == 0 and inside.starts_inside is True and inside.normal.tolist() == [0, 0, 0]
    for other in (pickle.loads(pickle.dumps(found)), copy.copy(found)):
        assert other.t == found.t and (other.normal == found.normal).all() and repr(other) == repr(found)
    for motion, t_max in [([np.nan, 0, 0], 1), ([1, 0, 0], -1), ([1, 0, 0], np.nan)]:
        with pytest.raises(ValueError, match="the motion"):
            box.cast(box, motion, t_max=t_max)
    # Exactly: nothing touches before, and the pair touches just after.
    (a, ta), (b, tb) = meshes.soup(150, 5), meshes.soup(150, 6)
    one, other = canted.Bvh(a, ta), canted.Bvh(b, tb)
    pose[:3, 3] = start = np.array([9.0, 0.5, -0.25])
    motion = np.array([-3.0, 0.1, 0.2])
    found = one.cast(other, motion, pose)

    def at(t):
        moved = np.eye(4)
        moved[:3, 3] = start + t * motion
        return one.pairs(other, moved).tolist()

    assert all(at(found.t * part) == [] for part in (0, 0.3, 0.7, 0.9, 0.99, 1 - 1e-9))
    assert found.primitives.tolist() in at(found.t + 1e-7)
    far = np.array([4e6 + 0.3, 5e5, 100.0])
    home = canted.Bvh(meshes.box()[0] + far, meshes.box()[1])
    pose[:3, 3] = [0, 0, 3]
    found = home.cast(home, [0, 0, -1], pose)
    assert found.t == pytest.approx(2, abs=1e-6) and found.position[2] - far[2] == pytest.approx(1, abs=1e-6)


def _near_hull(triangles, points, radius, n=150):
    """How far the hull of points is from each triangle, less the radius, by steps toward the nearest points (Gilbert 1966)."""
    rows = np.arange(len(triangles))
    a, b = triangles.mean(axis=1), np.repeat(points.mean(axis=0)[None], len(triangles), axis=0)
    best = np.full(len(triangles), np.inf)
    for _ in range(n):
        to = b - a
        best = np.minimum(best, np.linalg.norm(to, axis=1))
        p = triangles[rows, np.einsum("nkc,nc->nk", triangles, to).argmax(axis=1)]
        q = points[(to @ points.T).argmin(axis=1)]
        step = (p - q) + to
        length = (step * step).sum(axis=1)
        part = np.clip((to * step).sum(axis=1) / np.where(length > 0, length, 1), 0, 1)[:, None]
        a, b = a + part * (p - a), b + part * (q - b)
    return best - radius


def test_regions_in_all_forms():
    vertices, triangles = meshes.soup(120, 8)
    bvh = canted.Bvh(vertices, triangles)
    random = np.random.default_rng(9)
    hulls = random.uniform(-1.5, 1.5, (3, 4, 5, 3))
    radius = random.uniform(0, 0.3, (3, 4))
    found = bvh.overlapping_hull(hulls, radius)
    loose = vertices[triangles].astype(np.float64)
    for i, (points, r) in enumerate(zip(hulls.reshape(-1, 5, 3), radius.ravel())):
        gaps = _near_hull(loose, points, r)
        mine = set(found["primitive"][found["region"] == i])
        assert set(np.nonzero(gaps < -0.05)[0]) <= mine and mine <= set(np.nonzero(gaps < 0.05)[0])
    assert 20 < len(found["region"])
    tlas = canted.Tlas([bvh])
    low = random.uniform(-1.5, 1, (3, 4, 3)).astype(np.float32)
    faces = np.float32([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    for answers in (bvh, tlas):
        for query, arguments in [
            (answers.overlapping_hull, (hulls, radius)),
            (answers.overlapping_box, (low, low + np.float32(0.5))),
            (answers.overlapping_sphere, (low, radius)),
            (answers.overlapping_frustum, (low[..., None, :] + faces, low[..., None, :] + faces + np.float32([0.1, 0, 1]))),
        ]:
            rows = query(*arguments)
            count = np.bincount(rows["region"], minlength=12).reshape(3, 4)
            assert query(*arguments, form="count").tolist() == count.tolist() and count.sum() > 5
            some = query(*arguments, form="any")
            assert some.dtype == bool and some.tolist() == (count > 0).tolist()
            first = query(*arguments, form="first")
            assert set(first) == set(rows) - {"region"} and first["primitive"].shape == (3, 4)
            for i in range(12):
                mine = rows["primitive"][rows["region"] == i]
                assert first["primitive"].ravel()[i] == (mine[0] if len(mine) else -1)
            with pytest.raises(ValueError, match="form is 'some'; use 'all', 'any', 'first' or 'count'"):
                query(*arguments, form="some")
    # A capsule, and a hull without points.
    capsule = [[0.5, 0.5, 2], [0.5, 0.5, 1.25]]
    box = canted.Bvh(*meshes.box())
    assert box.overlapping_hull(capsule, 0.25, form="any").tolist() == [True]
    assert box.overlapping_hull(capsule, 0.24, form="any").tolist() == [False]
    assert box.overlapping_hull(np.zeros((2, 0, 3)), form="count").tolist() == [0, 0]
    with pytest.raises(ValueError, match="the radius of hull 0 is -1"):
        box.overlapping_hull(capsule, -1)
    with pytest.raises(ValueError, match=r"points has shape \(3,\), not \(..., k, 3\)"):
        box.overlapping_hull([1.0, 2.0, 3.0])

"""Queries against loops over all triangles."""

import brute
import canted
import meshes
import numpy as np
import pytest

TESTS = ["watertight", "moller-trumbore", "baldwin-weber"]
PRESETS = ["fast", "balanced", "quality"]


def disagreements(hits, vertices, triangles, origins, directions):
    """Rows where hits differ from the loop, and the number of rows that the loop decides."""
    wrong, n_decided = [], 0
    for i, (origin, direction) in enumerate(zip(origins, directions)):
        expected = brute.closest(vertices, triangles, origin, direction)
        if expected is None:
            continue
        n_decided += 1
        primitive, t = expected
        is_right = hits.primitive[i] == primitive
        if not is_right and primitive >= 0 and hits.primitive[i] >= 0:
            # Equal triangles tie, the lowest wins; others are as near in float32.
            is_right = abs(hits.t[i] - t) <= 1e-5 * max(abs(t), 1e-6)
        if not is_right:
            wrong.append(i)
    return wrong, n_decided


@pytest.mark.parametrize("test", TESTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_closest_hits_are_those_of_a_loop(test, preset):
    vertices, triangles = meshes.soup(200)
    origins, directions = meshes.rays(400)
    hits = canted.Bvh(vertices, triangles, preset, test).closest_hit(origins, directions)
    wrong, n_decided = disagreements(hits, vertices, triangles, origins, directions)
    assert n_decided > 200
    assert wrong == []


@pytest.mark.parametrize(("scale", "offset"), [(1e-6, 0.0), (1e6, 0.0), (100.0, 1e7)])
def test_scale_and_offset_lose_no_hit(scale, offset):
    vertices, triangles = meshes.soup(200, scale=scale, offset=offset)
    origins, directions = meshes.rays(300, scale=scale, offset=offset)
    hits = canted.Bvh(vertices, triangles).closest_hit(origins, directions)
    wrong, n_decided = disagreements(hits, vertices, triangles, origins, directions)
    assert wrong == []
    assert offset > 0.0 or n_decided > 150


def test_the_loop_notices_wrong_hits():
    vertices, triangles = meshes.soup(200)
    origins, directions = meshes.rays(400)
    hits = canted.Bvh(vertices, triangles).closest_hit(origins, directions)
    hits.primitive[::3] = -1
    wrong, _ = disagreements(hits, vertices, triangles, origins, directions)
    assert len(wrong) > 30


def test_columns_have_the_documented_types_and_values():
    vertices, triangles = meshes.sphere()
    origins, directions = meshes.rays(1000)
    bvh = canted.Bvh(vertices, triangles)
    hits = bvh.closest_hit(origins, directions)
    shapes = {"t": "float32", "primitive": "int32", "u": "float32", "v": "float32", "entering": "bool", "ray": "int64"}
    for name, dtype in shapes.items():
        assert getattr(hits, name).shape == (1000,) and getattr(hits, name).dtype == dtype, name
    assert hits.position.shape == hits.normal.shape == (1000, 3)
    hit = hits.hit
    assert 100 < hit.sum() < 1000 and len(hits) == 1000 and hits.instance is None
    assert (hits.primitive[~hit] == -1).all() and np.isinf(hits.t[~hit]).all() and np.isnan(hits.position[~hit]).all()
    assert (hits.ray == np.arange(1000)).all()
    o, d = origins[hit].astype(np.float64), directions[hit].astype(np.float64)
    reach = np.abs(o).max() + 1.0
    along = o + hits.t[hit, None].astype(np.float64) * d
    # A reported t and the barycentric point are both within the hit's error of one point; t itself is rounded.
    bound = 4 * brute.HIT_ERROR * reach + 2.0**-23 * np.abs(along - o).max()
    assert np.abs(along - hits.position[hit]).max() <= bound
    a, b, c = (vertices[triangles[hits.primitive[hit], k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.abs(normal - hits.normal[hit]).max() < 1e-12
    assert ((normal * d).sum(axis=1) < 0.0)[np.abs((normal * d).sum(axis=1)) > 1e-6 * np.linalg.norm(d, axis=1)].tolist() == (
        hits.entering[hit][np.abs((normal * d).sum(axis=1)) > 1e-6 * np.linalg.norm(d, axis=1)].tolist()
    )


def test_occluded_and_intervals_agree_with_closest_hits():
    vertices, triangles = meshes.soup(300)
    origins, directions = meshes.rays(2000)
    bvh = canted.Bvh(vertices, triangles)
    hits = bvh.closest_hit(origins, directions)
    assert (bvh.occluded(origins, directions) == hits.hit).all()
    hit = hits.hit
    o, d, t = origins[hit], directions[hit], hits.t[hit]
    # The interval is closed: exactly t is inside, for one number and for an array.
    assert (bvh.closest_hit(o, d, t_min=t, t_max=t).primitive == hits.primitive[hit]).all()
    beyond = bvh.closest_hit(o, d, t_min=np.nextafter(t, np.float32(np.inf)))
    assert (beyond.t > t).all()
    assert not bvh.occluded(o, d, 0.0, np.nextafter(t, np.float32(0))).any()
    assert (bvh.closest_hit(o, d, 0.5, 0.75).t >= 0.5).all()


@pytest.mark.parametrize("test", TESTS)
def test_all_hits_begin_with_the_closest_and_are_sorted(test):
    vertices, triangles = meshes.soup(300)
    origins, directions = meshes.rays(600)
    bvh = canted.Bvh(vertices, triangles, triangle_test=test)
    closest, every = bvh.closest_hit(origins, directions), bvh.all_hits(origins, directions)
    assert (np.diff(every.ray) >= 0).all()
    assert every.hit.all()
    for i in range(600):
        rows = every.ray == i
        t, primitive = every.t[rows], every.primitive[rows]
        assert (np.diff(t) >= 0).all() and len(set(primitive.tolist())) == len(primitive)
        assert (t[:1] == closest.t[i : i + 1][closest.hit[i : i + 1]]).all() and len(t[:1]) == closest.hit[i]
        expected, depth = brute.intersections(vertices, triangles, origins[i], directions[i])
        reach = np.abs(origins[i]).max() + 2.0
        certain = (depth > 4 * brute.HIT_ERROR * reach) & (expected > 1e-3)
        outside = (depth < -4 * brute.HIT_ERROR * reach) | (expected < -1e-3)
        assert set(np.flatnonzero(certain)) <= set(primitive.tolist())
        assert not set(np.flatnonzero(outside)) & set(primitive.tolist())


@pytest.mark.parametrize("mesh", [meshes.box((-2, -1, -1), (3, 1, 2)), meshes.sphere(2)])
def test_crossings_through_edges_and_vertices_are_balanced(mesh):
    vertices, triangles = mesh
    origins, directions = meshes.through_edges(vertices, triangles, 3000)
    bvh = canted.Bvh(vertices, triangles)
    crossings = bvh.crossings(origins, directions)
    entering = np.bincount(crossings.ray[crossings.entering], minlength=3000)
    leaving = np.bincount(crossings.ray[~crossings.entering], minlength=3000)
    assert (entering == leaving).all()
    assert entering.sum() > 1500
    # A box is entered once at most.
    assert entering.max() == 1 or len(triangles) > 12
    # Entering and leaving take turns, also where a ray touches an edge of the outline.
    turn = np.arange(len(crossings)) - np.searchsorted(crossings.ray, crossings.ray)
    assert (crossings.entering == (turn % 2 == 0)).all() or (np.diff(crossings.t)[crossings.entering[1:] == crossings.entering[:-1]] != 0).all()
    # The same rays hit several triangles, so the test sees edges.
    every = np.bincount(bvh.all_hits(origins, directions).ray, minlength=3000)
    assert (every > 2).sum() > 1000


def test_crossings_need_the_watertight_test():
    vertices, triangles = meshes.box()
    bvh = canted.Bvh(vertices, triangles, triangle_test="moller-trumbore")
    with pytest.raises(ValueError, match="crossings need triangle_test='watertight'; this BVH has 'moller-trumbore'"):
        bvh.crossings([[0, 0, 9]], [[0, 0, -1]])


def test_containment_is_exact_on_a_box_and_that_of_solid_angles_on_a_sphere():
    vertices, triangles = meshes.box((-1, -2, -1), (3, 2, 1))
    grid = np.stack(np.meshgrid(*[np.arange(-3, 4, 0.5)] * 3), axis=-1).reshape(-1, 3)
    expected = ((grid >= [-1, -2, -1]) & (grid <= [3, 2, 1])).all(axis=1)
    bvh = canted.Bvh(vertices, triangles)
    assert (bvh.contains(grid) == expected).all()
    # Nested boxes alternate.
    inner_vertices, inner_triangles = meshes.box((0, 0, 0), (0.5, 0.5, 0.5))
    hollow = canted.Bvh(np.concatenate([vertices, inner_vertices]), np.concatenate([triangles, inner_triangles + 8]))
    assert hollow.contains([[0.25, 0.25, 0.25], [0.75, 0.25, 0.25]], mode="parity").tolist() == [False, True]
    # By winding numbers, where the inner one is turned.
    turned = canted.Bvh(np.concatenate([vertices, inner_vertices]), np.concatenate([triangles, inner_triangles[:, ::-1] + 8]))
    for mode in ("parity", "winding", None):
        assert turned.contains([[0.25, 0.25, 0.25], [0.75, 0.25, 0.25]], mode=mode).tolist() == [False, True]
    vertices, triangles = meshes.sphere(2)
    points = np.random.default_rng(3).uniform(-1.2, 1.2, (2000, 3)).astype(np.float32)
    bvh = canted.Bvh(vertices, triangles)
    far = bvh.nearest(points).distance > 1e-4
    assert far.sum() > 1900
    winding = brute.winding(vertices, triangles, points[far])
    for mode in ("parity", "winding", None):
        assert (bvh.contains(points, mode)[far] == (winding > 0.5)).all()
        signed = bvh.signed_distance(points, mode)
        assert ((signed[far] < 0) == bvh.contains(points, mode)[far]).all()
    for tolerance in (0.1, 1e-6, 0.0):
        # Both sum angles of float64.
        assert np.abs(bvh.winding_number(points, tolerance)[far] - winding).max() <= tolerance + 1e-11
    with pytest.raises(ValueError, match="tolerance is -1; use 0 or more"):
        bvh.winding_number(points, -1)
    with pytest.raises(ValueError, match="mode is 'both'; use winding or parity"):
        bvh.contains(points, "both")
    assert (np.abs(signed) == bvh.nearest(points).distance).all()


def test_what_is_inside_of_solids_that_overlap_and_of_doubled_faces():
    one, triangles = meshes.box((0, 0, 0), (2, 2, 2))
    points = [[1.5, 1.5, 1.5], [0.5, 0.5, 0.5], [2.5, 2.5, 2.5], [4, 4, 4], [2, 2, 2], [0, 1, 1]]
    two = canted.Bvh(np.concatenate([one, one + 1]), np.concatenate([triangles, triangles + 8]))
    assert two.contains(points).tolist() == [True, True, True, False, True, True]
    assert two.contains(points, "parity").tolist() == [False, True, True, False, True, True]
    assert np.abs(two.winding_number(points)[:4] - [2, 1, 1, 0]).max() < 1e-12 and abs(two.winding_number(points[5])[0] - 0.5) < 1e-12
    # To the nearest surface, be it inside of the other solid.
    signed = two.signed_distance(points)
    assert signed.tolist() == [-0.5, -0.5, -0.5, np.float32(np.sqrt(3)), 0, 0]
    twice = canted.Bvh(one, np.concatenate([triangles, triangles]))
    assert twice.contains([1, 1, 1])[0] and not twice.contains([1, 1, 1], "parity")[0] and not twice.contains([3, 1, 1])[0]
    some = canted.Bvh(one, np.concatenate([triangles, triangles[:2]]))
    assert some.contains(np.random.default_rng(0).uniform(0.1, 1.9, (1000, 3))).all()
    # Inside out, and with one face turned: then parity decides.
    assert canted.Bvh(one, triangles[:, ::-1]).contains([[1, 1, 1], [3, 1, 1]]).tolist() == [True, False]
    mixed = np.concatenate([triangles[:6], triangles[6:, ::-1]])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.9, 2.9, 12)] * 3), axis=-1).reshape(-1, 3)
    bvh = canted.Bvh(one, mixed)
    assert (bvh.contains(grid) == ((grid >= 0) & (grid <= 2)).all(axis=1)).all()
    assert (bvh.contains(grid) == bvh.contains(grid, "parity")).all() and (bvh.contains(grid) != bvh.contains(grid, "winding")).any()


def test_an_open_scan_has_an_inside():
    vertices, triangles = meshes.sphere(3)
    bvh = canted.Bvh(vertices, triangles[vertices[triangles].min(axis=1)[:, 2] > -0.7])
    points = [[0, 0, 0], [0.5, 0.5, 0.3], [0, 0, -1.5], [1.2, 0, 0], [0.3, 0, 5]]
    assert bvh.contains(points, "winding").tolist() == [True, True, False, False, False]
    number = bvh.winding_number(points)
    assert ((number > 0.5) == [True, True, False, False, False]).all() and (np.abs(number) < 1).all()
    # Of the part of a sphere above z = -0.7: 1 - (1 - 0.7) / 2, seen from the center.
    assert abs(number[0] - 0.85) < 0.05


def test_zeros_of_both_signs_are_equal():
    """Loose triangles: each has vertices of its own, with -0.0 or 0.0 by chance."""
    random = np.random.default_rng(12)
    corners = np.float32([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[a, b, c] if (a == 0) == ((b == 2) == (c == 4)) else [a, c, b] for a in (0, 1) for b in (2, 3) for c in (4, 5)]
    grid = np.stack(np.meshgrid(*[np.arange(-2, 2, 0.5)] * 3), axis=-1).reshape(-1, 3)
    expected = np.abs(grid).sum(axis=1) <= 1
    for _ in range(20):
        loose = corners[faces].reshape(-1, 3)
        loose = np.where((loose == 0) & (random.random(loose.shape) < 0.5), np.float32(-0.0), loose)
        bvh = canted.Bvh(loose, np.arange(24).reshape(8, 3))
        for mode in ("parity", "winding", None):
            assert (bvh.contains(grid, mode) == expected).all()
            signed = bvh.signed_distance(grid, mode)
            assert ((signed <= 0) == expected).all() and ((signed == 0) == (np.abs(grid).sum(axis=1) == 1)).all()


def test_regions_overlap_what_they_touch():
    vertices, triangles = meshes.box()
    bvh = canted.Bvh(vertices, triangles)
    low, high = np.float32([[0.25, 0.25, 0.25], [0.25, 0.25, 1.0], [2, 2, 2], [np.inf] * 3, [-9, -9, -9]]), np.float32([0.5, 0.5, 0.5])
    found = bvh.overlapping_box(low, [high, [0.5, 0.5, 3], [3, 3, 3], [-np.inf] * 3, [9, 9, 9]])
    assert found["region"].dtype == "int64" and found["primitive"].dtype == "int32" and set(found) == {"region", "primitive"}
    count = np.bincount(found["region"], minlength=5)
    # Within the box there is no face; one touches the top; one is elsewhere; one is empty; one has all.
    assert count.tolist() == [0, count[1], 0, 0, 12] and 1 <= count[1] <= 2
    assert (vertices[triangles[found["primitive"][found["region"] == 1]]][:, :, 2] == 1).all()
    assert len(bvh.overlapping_sphere([0.5, 0.5, 0.5], [0.25])["region"]) == 0
    assert len(bvh.overlapping_sphere([0.5, 0.5, 0.5], 0.5)["region"]) == 12
    assert bvh.overlapping_sphere([[0.5, 0.5, 5], [0.5, 0.5, 5]], [4.0, 3.5])["region"].tolist() == [0, 0]
    # A cube whose top is cut by a slanted plane, in both orders of its faces, and a triangle above that plane.
    near = [[-1, -1, 1.2], [1, -1, 2.8], [1, 1, 2.8], [-1, 1, 1.2]]
    far = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    above = canted.Bvh([[[-0.9, 0, 2.6], [-0.8, 0, 2.6], [-0.85, 0.1, 2.6]], [[-0.9, 0, 1.1], [-0.8, 0, 1.1], [-0.85, 0.1, 1.1]]])
    for faces in ((near, far), (far, near)):
        assert above.overlapping_frustum(*faces)["primitive"].tolist() == [1]
    with pytest.raises(ValueError, match=r"near has shape \(3, 3\), not \(..., 4, 3\)"):
        above.overlapping_frustum(near[:3], far)
    with pytest.raises(ValueError, match=r"there are regions of shape \(5,\) in low, but of shape \(1,\) in high"):
        bvh.overlapping_box(low, high)
    for answers in (bvh, canted.Tlas([bvh])):
        with pytest.raises(ValueError, match="box 1 is inverted: low is 1 in y, high is 0.5; exchange both"):
            answers.overlapping_box([[0, 0, 0], [0, 1, 0]], [[1, 1, 1], [1, 0.5, 1]])


def test_the_k_nearest_are_those_of_a_loop():
    vertices, triangles = meshes.soup(100)
    points = np.random.default_rng(14).uniform(-2, 2, (4, 25, 3)).astype(np.float32)
    bvh = canted.Bvh(vertices, triangles)
    found = bvh.k_nearest(points, 7)
    assert found.distance.shape == found.primitive.shape == (4, 25, 7) and found.position.shape == (4, 25, 7, 3)
    assert (bvh.nearest(points).distance == found.distance[..., 0]).all() and bvh.nearest(points).primitive.shape == (4, 25)
    for point, distance, primitive in zip(points.reshape(-1, 3), found.distance.reshape(-1, 7), found.primitive.reshape(-1, 7)):
        distances = brute.nearest(vertices, triangles, point)
        assert np.allclose(distance, np.sort(distances)[:7], rtol=1e-6, atol=1e-7) and len(set(primitive.tolist())) == 7
    few = bvh.k_nearest(points[0], 300, max_distance=0.25)
    for distance, primitive in zip(few.distance, few.primitive):
        n = np.isfinite(distance).sum()
        assert (distance[:n] <= 0.25).all() and (primitive[n:] == -1).all() and (primitive[:n] >= 0).all()
    with pytest.raises(ValueError, match="k is 0; use 1 or more"):
        bvh.k_nearest(points, 0)


def test_nearest_points_are_those_of_a_loop():
    vertices, triangles = meshes.soup(200)
    points = np.random.default_rng(4).uniform(-2, 2, (500, 3)).astype(np.float32)
    bvh = canted.Bvh(vertices, triangles)
    found, near = bvh.nearest(points), bvh.nearest(points, max_distance=0.1)
    assert found.distance.dtype == "float32" and found.primitive.dtype == "int32" and found.position.shape == (500, 3)
    for i, point in enumerate(points):
        distances = brute.nearest(vertices, triangles, point)
        # The result is rounded to float32 once; the loop is exact to some 2^-48 of the coordinates.
        error = 2.0**-24 * distances.min() + 1e-12
        assert abs(found.distance[i] - distances.min()) <= error
        assert distances[found.primitive[i]] <= distances.min() + 1e-12
        assert abs(np.linalg.norm(found.position[i] - point) - distances.min()) <= 1e-6
        if distances.min() > 0.1 + 1e-6:
            assert near.primitive[i] == -1 and np.isinf(near.distance[i]) and np.isnan(near.position[i]).all()
        elif distances.min() < 0.1 - 1e-6:
            assert near.primitive[i] == found.primitive[i] and near.distance[i] == found.distance[i]


@pytest.mark.parametrize("n", [4, 70000])
def test_a_refit_answers_as_a_new_bvh(n):
    """Also of a mesh so large that it is refitted on a copy."""
    vertices, triangles = meshes.soup(n)
    moved = (vertices * 1.5 + np.float32(0.25)).astype(np.float32)
    origins, directions = meshes.rays(500)
    bvh = canted.Bvh(vertices, triangles)
    before = bvh.closest_hit(origins, directions)
    report = bvh.refit(moved)
    assert set(report) == {"cost_built", "cost_before", "cost_now", "drift", "rebuild_advised"}
    after, new = bvh.closest_hit(origins, directions), canted.Bvh(moved, triangles).closest_hit(origins, directions)
    for name in ("t", "primitive", "u", "v"):
        assert (getattr(after, name) == getattr(new, name)).all()
    # Hits from before the refit keep the mesh of then.
    hit = before.hit
    a, b, c = (vertices[triangles[before.primitive[hit], k]].astype(np.float64) for k in range(3))
    u, v = before.u[hit, None].astype(np.float64), before.v[hit, None].astype(np.float64)
    assert np.abs(before.position[hit] - (a + u * (b - a) + v * (c - a))).max(initial=0.0) < 1e-12
    with pytest.raises(ValueError, match=f"the BVH was built over {3 * n} vertices, but {3 * n - 1} are given"):
        bvh.refit(moved[:-1])
    moved[3] = np.nan
    with pytest.raises(ValueError, match="triangle 1 has a vertex that is not finite"):
        bvh.refit(moved)
    assert (bvh.closest_hit(origins, directions).t == after.t).all()

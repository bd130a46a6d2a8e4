"""Instances against the same meshes with transformed vertices."""

import pickle

import canted
import meshes
import numpy as np
import pytest


def transform(linear=np.eye(3), shift=(0, 0, 0)):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, shift
    return matrix


def test_instances_hit_where_transformed_meshes_do():
    box = canted.Bvh(*meshes.box((-1, -1, -1), (1, 1, 1)))
    ball = canted.Bvh(*meshes.sphere(2))
    shear = [[2, 1, 0], [0, 1, 0], [0, 0, -0.5]]
    matrices = [transform(shift=(4, 0, 0)), transform(shear), transform(shift=(-3, 1, 0))]
    tlas = canted.Tlas([box, ball], instances=[(0, matrices[0]), (0, matrices[1]), (1, matrices[2].tolist())])
    assert len(tlas) == 3 and tlas.stats()["instances"] == 3 and "3 instances of 2 meshes" in repr(tlas)
    parts = [(meshes.box((-1, -1, -1), (1, 1, 1)), matrices[0]), (meshes.box((-1, -1, -1), (1, 1, 1)), matrices[1])]
    parts.append((meshes.sphere(2), matrices[2]))
    vertices = [mesh[0] @ matrix[:3, :3].T + matrix[:3, 3] for mesh, matrix in parts]
    starts = np.cumsum([0] + [len(v) for v in vertices])
    world = canted.Bvh(np.concatenate(vertices), np.concatenate([m[1] + s for (m, _), s in zip(parts, starts)]))
    origins, directions = meshes.rays(3000, scale=3.0)
    hits, expected = tlas.closest_hit(origins, directions), world.closest_hit(origins, directions)
    same = hits.hit & expected.hit
    # Rays that graze a silhouette may differ: vertices are rounded in two spaces.
    assert same.sum() > 800 and (hits.hit != expected.hit).sum() <= 3
    assert np.allclose(hits.t[same], expected.t[same], rtol=1e-5, atol=1e-6)
    assert np.abs(hits.position[same] - expected.position[same]).max() < 1e-4
    firsts = np.array([0, 12, 24])
    row = same & (firsts[hits.instance] + hits.primitive == expected.primitive)
    assert row.sum() > 0.99 * same.sum()
    # A mirror keeps the front side of object space; the mesh in world space has the other winding.
    mirror = np.where(hits.instance[row] == 1, -1, 1)[:, None]
    assert np.abs(hits.normal[row] * mirror - expected.normal[row]).max() < 1e-4
    assert (tlas.occluded(origins, directions) == hits.hit).all()
    every = tlas.all_hits(origins, directions)
    first = np.searchsorted(every.ray, np.flatnonzero(hits.hit))
    assert (every.t[first] == hits.t[hits.hit]).all() and (every.instance[first] == hits.instance[hits.hit]).all()
    assert (hits.instance[~hits.hit] == -1).all() and hits.instance.dtype == "int32"


def test_identity_instances_are_the_mesh_bit_for_bit():
    vertices, triangles = meshes.soup(300)
    origins, directions = meshes.rays(1000)
    bvh = canted.Bvh(vertices, triangles)
    for tlas in (canted.Tlas([bvh]), canted.Tlas([bvh], [(0, np.eye(4))])):
        hits, expected = tlas.closest_hit(origins, directions), bvh.closest_hit(origins, directions)
        for name in ("t", "primitive", "u", "v"):
            assert (getattr(hits, name) == getattr(expected, name)).all()
        # Padded by the rounding of transformed rays.
        assert (tlas.bounds[0] <= bvh.bounds[0]).all() and (tlas.bounds[1] >= bvh.bounds[1]).all()
        assert np.abs(tlas.bounds - bvh.bounds).max() < 1e-5


def test_the_origin_of_a_mesh_is_part_of_its_transform():
    vertices, triangles = meshes.box()
    far = canted.Bvh(vertices.astype(np.float64) + 1e8, triangles, origin=(1e8, 1e8, 1e8))
    hits = canted.Tlas([far], [(0, transform(shift=(-1e8, -1e8, -1e8)))]).closest_hit([[0.25, 0.5, 3]], [[0, 0, -1]])
    assert hits.t.tolist() == [2.0] and hits.position.tolist() == [[0.25, 0.5, 1.0]]


def test_a_tlas_keeps_the_mesh_that_it_was_made_of():
    vertices, triangles = meshes.box()
    bvh = canted.Bvh(vertices, triangles)
    tlas = canted.Tlas([bvh])
    bvh.refit(vertices + 10)
    assert tlas.closest_hit([[0.25, 0.5, 3]], [[0, 0, -1]]).t.tolist() == [2.0]
    assert not bvh.occluded([[0.25, 0.5, 3]], [[0, 0, -1]])[0]


BAD = [
    ([(1, np.eye(4))], "instance 0 has BVH 1, but the list bvhs has 1"),
    ([(-1, np.eye(4))], "instance 0 has BVH -1, but the list bvhs has 1"),
    ([(0, np.eye(4)), (0, np.eye(3))], "the matrix of instance 1 has shape (3, 3), not (4, 4)"),
    ([(0, np.eye(4)[::-1])], "the matrix of instance 0 has the last row"),
    ([(0, np.diag([1, 1, 0, 1]))], "the transform of instance 0 is too close to singular"),
    ([(0, np.diag([1, np.nan, 1, 1]))], "the transform of instance 0 is not finite"),
    ([0], "instance 0 is not a pair of an index and a matrix"),
    ([("a", np.eye(4))], "instance 0 has an index that is no integer"),
    (7, "instances is not a sequence"),
]


@pytest.mark.parametrize(("instances", "sentence"), BAD, ids=lambda value: None)
def test_bad_instances_are_value_errors_with_a_sentence(instances, sentence):
    with pytest.raises(ValueError) as error:
        canted.Tlas([canted.Bvh(*meshes.box())], instances)
    assert sentence in str(error.value)
    with pytest.raises(ValueError, match="item 0 of bvhs is not a Bvh"):
        canted.Tlas([3])


def test_a_scale_by_zero_hides_an_instance():
    bvh = canted.Bvh(*meshes.box())
    tlas = canted.Tlas([bvh], [(0, np.diag([0, 0, 0, 1])), (0, transform(shift=(0, 0, -5)))])
    hits = tlas.closest_hit([[0.25, 0.5, 3]], [[0, 0, -1]])
    assert (hits.instance.tolist(), hits.t.tolist(), len(tlas)) == ([1], [7.0], 2)
    assert tlas.bounds[1][2] < -3.9 and canted.Tlas([bvh], [(0, np.diag([0, 0, 0, 1]))]).bounds is None


def world_mesh():
    """Instances, and the same mesh in world space, in order of (instance, triangle)."""
    box, ball = meshes.box((-1, -1, -1), (1, 1, 1)), meshes.sphere(2)
    shear = transform([[2, 1, 0], [0, 1, 0], [0, 0, 0.5]], (0, 6, 0))
    placed = [(0, transform(shift=(4, 0, 0))), (0, shear), (1, transform(np.eye(3) * 1.5, (-3, 1, 0))), (1, transform(shift=(5, 0.5, 0)))]
    parts = [((box, ball)[index], matrix) for index, matrix in placed]
    vertices = [(mesh[0] @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32) for mesh, matrix in parts]
    starts = np.cumsum([0] + [len(v) for v in vertices])
    triangles = [mesh[1] + start for (mesh, _), start in zip(parts, starts)]
    tlas = canted.Tlas([canted.Bvh(*box), canted.Bvh(*ball)], placed)
    firsts = np.cumsum([0] + [len(part) for part in triangles])[:-1]
    return tlas, canted.Bvh(np.concatenate(vertices), np.concatenate(triangles)), firsts


def test_points_have_the_answers_of_the_mesh_in_world_space():
    tlas, world, firsts = world_mesh()
    points = np.random.default_rng(15).uniform(-6, 8, (20, 50, 3))
    near, expected = tlas.nearest(points), world.nearest(points)
    assert near.distance.shape == (20, 50) and near.distance.dtype == "float32" and near.instance.dtype == "int32"
    assert np.allclose(near.distance, expected.distance, rtol=1e-5, atol=1e-5)
    assert ((firsts[near.instance] + near.primitive) == expected.primitive).mean() > 0.9
    assert np.abs(np.linalg.norm(near.position - points, axis=-1) - near.distance).max() < 1e-5
    several, all_expected = tlas.k_nearest(points, 5), world.k_nearest(points, 5)
    assert several.distance.shape == (20, 50, 5) and np.allclose(several.distance, all_expected.distance, rtol=1e-5, atol=1e-5)
    assert np.isinf(tlas.nearest(points, max_distance=0.01).distance).mean() > 0.9
    # The fourth instance overlaps the first.
    assert tlas.contains([4.9, 0.5, 0])[0]
    for mode in (None, "winding", "parity"):
        # By parity the mesh in world space has no inside where two solids overlap.
        agree = (tlas.contains(points, mode) == world.contains(points, "winding")) | (expected.distance < 1e-4)
        assert agree.all() and 0.005 < tlas.contains(points, mode).mean() < 0.5
        signed = tlas.signed_distance(points, mode)
        assert (np.abs(signed) == near.distance).all() and ((signed < 0) == tlas.contains(points, mode))[near.distance > 0].all()


def test_crossings_are_those_of_each_instance():
    tlas, world, _ = world_mesh()
    origins, directions = meshes.rays(2000, scale=6.0)
    crossings, expected = tlas.crossings(origins, directions), world.crossings(origins, directions)
    counts = [np.bincount(hits.ray, minlength=2000) for hits in (crossings, expected)]
    # Rays that graze a silhouette may differ.
    assert (counts[0] != counts[1]).sum() <= 3 and counts[0].sum() > 500
    assert crossings.instance.shape == crossings.t.shape and (np.diff(crossings.t)[np.diff(crossings.ray) == 0] >= 0).all()
    loose = canted.Tlas([canted.Bvh(*meshes.box()), canted.Bvh(*meshes.box(), triangle_test="baldwin-weber")])
    with pytest.raises(ValueError, match="crossings need triangle_test='watertight'; item 1 of bvhs has 'baldwin-weber'"):
        loose.crossings(origins, directions)


def test_regions_overlap_instances_as_the_mesh_in_world_space():
    tlas, world, firsts = world_mesh()
    low = np.random.default_rng(16).uniform(-6, 8, (200, 3)).astype(np.float32)
    high = low + np.float32(1.5)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    faces = [np.stack([np.stack([low[:, 0] + x * 1.5, low[:, 1] + y * 1.5, low[:, 2] + z], axis=-1) for x, y in corners], axis=1) for z in (0, 1.5)]
    queries = [
        lambda answers: answers.overlapping_box(low, high),
        lambda answers: answers.overlapping_sphere(low, 1.25),
        lambda answers: answers.overlapping_frustum(*faces),
    ]
    for query in queries:
        found, expected = query(tlas), query(world)
        assert set(found) == {"region", "instance", "primitive"}
        found = set(zip(found["region"].tolist(), (firsts[found["instance"]] + found["primitive"]).tolist()))
        expected = set(zip(expected["region"].tolist(), expected["primitive"].tolist()))
        # Vertices are rounded in world space: what all but touches may differ.
        assert len(found) > 200 and len(found ^ expected) <= 3


def test_empty_meshes_have_no_bounds():
    nothing = canted.Bvh(np.zeros((0, 3)), [])
    box = canted.Bvh(*meshes.box((1, 1, 1), (2, 3, 4)))
    assert nothing.bounds is None and canted.Tlas([]).bounds is None and canted.Tlas([nothing]).bounds is None
    assert np.abs(canted.Tlas([nothing, box]).bounds - [[1, 1, 1], [2, 3, 4]]).max() < 1e-5


def test_no_instances():
    tlas = canted.Tlas([], [])
    assert np.isinf(tlas.signed_distance([0, 0, 0]))[0] and not tlas.contains([0, 0, 0])[0] and tlas.nearest([0, 0, 0]).instance[0] == -1
    assert not tlas.occluded([[0, 0, 0]], [[0, 0, 1]])[0] and len(tlas.all_hits([[0, 0, 0]], [[0, 0, 1]])) == 0


def _at(x, scale=1.0):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[0, 3] = x
    return matrix


def test_instances_are_edited_in_place():
    box, ball = canted.Bvh(*meshes.box()), canted.Bvh(*meshes.sphere(2))
    instances = [(0, _at(0)), (1, _at(5)), (0, _at(10))]
    tlas = canted.Tlas([box, ball], instances)
    down = [[0.5, 0.5, 9]], [[0, 0, -1]]
    before = tlas.closest_hit(*down)
    tlas.set_transform(0, _at(50))
    assert not tlas.closest_hit(*down).hit[0] and before.position[0].tolist() == [0.5, 0.5, 1], "hits keep their scene"
    assert tlas.insert(1, _at(0.5)) == 3 and len(tlas) == 4
    tlas.remove(1)
    tlas.set_mask(2, 0)
    assert len(tlas) == 3 and tlas.insert(0, _at(-4)) == 1, "the number of a removed instance is used again"
    same = canted.Tlas([box, ball], [(0, _at(50)), (0, _at(-4)), (0, _at(10, 0.0)), (1, _at(0.5))])
    random = np.random.default_rng(1)
    origins = random.uniform([-6, -2, -2], [60, 2, 2], (2000, 3)).astype(np.float32)
    directions = random.normal(size=(2000, 3)).astype(np.float32)
    for one in (tlas, pickle.loads(pickle.dumps(tlas))):
        hits, others = one.closest_hit(origins, directions), same.closest_hit(origins, directions)
        assert (hits.t == others.t).all() and (hits.instance == others.instance).all() and 20 < hits.hit.sum()
        assert (one.nearest(origins).distance == same.nearest(origins).distance).all()
    tlas.set_mask(2, 1)
    assert tlas.closest_hit([[10.5, 0.5, 9]], [[0, 0, -1]]).instance.tolist() == [2]
    bad = np.eye(4)
    bad[3, 0] = 1
    for change, message in [
        (lambda: tlas.set_transform(9, np.eye(4)), "there is no instance 9; the Tlas has 4"),
        (lambda: tlas.remove(-1), "there is no instance -1"),
        (lambda: tlas.insert(2, np.eye(4)), "there is no BVH 2; the list bvhs has 2"),
        (lambda: tlas.set_transform(0, bad), "matrix has the last row"),
        (lambda: tlas.set_transform(0, np.diag([1.0, 1.0, 1e-9, 1.0])), "instance 0"),
        (lambda: tlas.set_mask(0, -1), "mask is -1; use 0 to 2\\^32 - 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            change()
    assert len(tlas) == 4


def test_hits_stay_as_they_are_when_instances_change():
    """Positions and normals are computed later, of what was hit then."""
    box, ball = canted.Bvh(*meshes.box((-1, -1, -1), (1, 1, 1))), canted.Bvh(*meshes.sphere(2))
    matrices = [transform(shift=(4, 0, 0)), transform([[2, 1, 0], [0, 1, 0], [0, 0, -0.5]]), transform(shift=(-3, 1, 0))]
    origins, directions = meshes.rays(500, scale=3.0)
    for name in ("closest_hit", "all_hits", "crossings"):
        tlas = canted.Tlas([box, ball], list(zip((0, 0, 1), matrices)))
        before, expected = (getattr(tlas, name)(origins, directions) for _ in range(2))
        expected.position, expected.normal
        assert len(np.unique(expected.instance[expected.instance >= 0])) == 3
        tlas.set_transform(0, transform(shift=(0, 9, 0)))
        tlas.remove(1)
        assert tlas.insert(1, transform(shift=(5, 5, 5))) == 1
        tlas.set_mask(2, 0)
        one = before[before.hit][3]
        for hits, mine in ((before, expected), (pickle.loads(pickle.dumps(before)), expected), (one, expected[expected.hit][3])):
            assert np.array_equal(hits.position, mine.position, equal_nan=True)
            assert np.array_equal(hits.normal, mine.normal, equal_nan=True)


def test_touching_instances_are_those_of_pairs_of_meshes():
    (a, ta), (b, tb) = meshes.soup(60, 1), meshes.soup(60, 2)
    bvhs = [canted.Bvh(a, ta), canted.Bvh(b, tb)]
    random = np.random.default_rng(5)
    instances = []
    for i in range(25):
        matrix = _at(0, 0.4)
        matrix[:3, 3] = random.uniform(-1.2, 1.2, 3)
        instances.append((i % 2, matrix.astype(np.float32).astype(np.float64)))
    tlas = canted.Tlas(bvhs, instances)

    def touch(i, j):
        (a, at), (b, to) = instances[i], instances[j]
        return bvhs[a].overlaps(bvhs[b], np.linalg.inv(at) @ to)

    found = tlas.instance_pairs()
    expected = [[i, j] for i in range(25) for j in range(i + 1, 25) if touch(i, j)]
    assert found.dtype == np.int32 and found.shape[1] == 2 and found.tolist() == expected and 3 < len(expected) < 280
    tlas.set_mask(int(found[0, 0]), 0)
    assert tlas.instance_pairs().tolist() == [pair for pair in expected if found[0, 0] not in pair]


def test_winding_numbers_of_instances_add_up():
    ball = canted.Bvh(*meshes.sphere(3))
    tlas = canted.Tlas([ball], [(0, _at(0)), (0, _at(1)), (0, np.diag([-0.5, 0.5, 0.5, 1.0]))])
    points = np.array([[0.1, 0, 0], [1.2, 0.1, 0], [-0.8, 0, 0.1], [5, 0, 0], [np.nan, 0, 0]])
    numbers = tlas.winding_number(points)
    # The mirrored one is counted negatively.
    assert np.allclose(numbers[:4], [1, 1, 1, 0], atol=1e-5) and np.isnan(numbers[4])
    assert np.allclose(tlas.winding_number([0.3, 0.1, 0.1]), 1, atol=1e-5)

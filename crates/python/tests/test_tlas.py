"""Instances against the same meshes with transformed vertices."""

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


def test_no_instances():
    tlas = canted.Tlas([], [])
    assert not tlas.occluded([[0, 0, 0]], [[0, 0, 1]])[0] and len(tlas.all_hits([[0, 0, 0]], [[0, 0, 1]])) == 0

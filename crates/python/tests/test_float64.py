"""Meshes in float64 that float32 does not hold: an origin is chosen near them, and results are float64."""

import copy
import pickle

import canted
import meshes
import numpy as np
import pytest
from canted.open3d import RaycastingScene

# Zone 32 of UTM, in meters.
UTM = np.array([500_123.4, 5_412_345.6, 321.7])


def utm_cube(size=0.1):
    vertices, triangles = meshes.box()
    return UTM + size * (vertices.astype(np.float64) - 0.5), triangles


def test_a_cube_in_utm_coordinates():
    vertices, triangles = utm_cube()
    bvh = canted.Bvh(vertices, triangles)
    assert np.abs(np.array(bvh.origin) - UTM).max() < 0.1 and (np.abs(bvh.bounds - [vertices.min(axis=0), vertices.max(axis=0)]) < 1e-8).all()
    signed = bvh.signed_distance([UTM, UTM + [0.07, 0, 0]])
    assert signed.dtype == "float64" and np.abs(signed - [-0.05, 0.02]).max() < 1e-8
    assert bvh.contains([UTM, UTM + [0.06, 0, 0]]).tolist() == [True, False]
    near = bvh.nearest(UTM + [0.25, 0.01, 0.02])
    assert near.distance.dtype == "float64" and abs(near.distance[0] - 0.2) < 1e-8
    assert np.abs(near.position[0] - (UTM + [0.05, 0.01, 0.02])).max() < 1e-8
    # From far above, along a direction that float32 rounds.
    origin, target = UTM + [300.3, -200.2, 1000.1], UTM + [0.01, 0.02, 0.05]
    hits = bvh.closest_hit(origin, target - origin)
    assert hits.t.dtype == "float64" and abs(hits.t[0] - 1) < 1e-10 and np.abs(hits.position[0] - target).max() < 1e-7
    beyond, within = bvh.occluded([origin] * 2, target - origin, t_max=[0.99999, 1.00001])
    assert not beyond and within
    assert not bvh.occluded(origin, target - origin, t_min=1.001)[0]
    every = bvh.all_hits(origin, target - origin)
    assert len(every) == 2 and every.t[0] == hits.t[0] and every.t[1] > 1
    found = bvh.overlapping_box(UTM + [0.04, -0.01, -0.01], UTM + [0.06, 0.01, 0.01])["primitive"]
    assert 1 <= len(found) <= 2 and np.allclose(vertices[triangles[found]][:, :, 0], UTM[0] + 0.05)
    # As before: rounded to half a meter.
    rounded = canted.Bvh(vertices, triangles, origin=None)
    assert rounded.origin == (0, 0, 0) and rounded.signed_distance(UTM).dtype == rounded.closest_hit(origin, [0, 0, -1]).t.dtype == "float32"


def test_the_rays_of_a_loop_in_float64():
    vertices, triangles = meshes.sphere(3)
    far = vertices.astype(np.float64) * 0.05 + UTM
    bvh = canted.Bvh(far, triangles)
    random = np.random.default_rng(3)
    origins = random.uniform(-1, 1, (500, 3)) * [30, 30, 1000] + UTM
    directions = far[triangles].mean(axis=1)[random.integers(0, len(triangles), 500)] - origins
    hits = bvh.closest_hit(origins, directions)
    a, b, c = (far[triangles[hits.primitive, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    t = ((a - origins) * normal).sum(axis=1) / (directions * normal).sum(axis=1)
    # Where a ray grazes a triangle, rounding its start by 3e-9 moves the hit by more.
    assert hits.hit.all() and np.median(np.abs(hits.t - t)) < 1e-10 and np.abs(hits.t - t).max() < 1e-7
    points = random.uniform(-0.1, 0.1, (500, 3)) + UTM
    near = bvh.nearest(points)
    # The sphere is inscribed, with edges of 0.01.
    assert np.abs(near.distance - np.abs(np.linalg.norm(points - UTM, axis=1) - 0.05)).max() < 1e-3
    assert np.abs(np.linalg.norm(near.position - points, axis=1) - near.distance).max() < 1e-8


@pytest.mark.parametrize(
    ("shift", "size", "is_near"),
    [(0.0, 1.0, False), (100.3, 1.0, False), (1000.3, 1.0, False), (4100.3, 1.0, True), (1e7 + 0.3, 1.0, True), (1e7, 16.0, False), (0.3, 1e-6, True)],
)
def test_an_origin_is_chosen_where_a_vertex_moves_by_a_part_of_an_edge(shift, size, is_near):
    vertices, triangles = meshes.box()
    vertices = vertices.astype(np.float64) * size + shift
    bvh = canted.Bvh(vertices, triangles)
    moved = np.linalg.norm(vertices - vertices.astype(np.float32), axis=1).max()
    assert (moved > 1e-4 * size) == is_near
    precision = np.float64 if is_near else np.float32
    assert bvh.closest_hit([0, 0, 0], [1, 1, 1]).t.dtype == bvh.signed_distance([0, 0, 0]).dtype == precision
    assert (bvh.origin != (0, 0, 0)) == is_near
    # Numbers of float32 are not rounded.
    assert canted.Bvh(vertices.astype(np.float32), triangles).origin == (0, 0, 0)
    assert canted.Bvh(vertices, triangles, origin=None).origin == (0, 0, 0)
    # Always, where it is asked for.
    assert canted.Bvh(vertices, triangles, origin="near").nearest([0, 0, 0]).distance.dtype == "float64"


def test_copies_refits_and_files_keep_the_origin(tmp_path):
    vertices, triangles = utm_cube()
    bvh = canted.Bvh(vertices, triangles)
    bvh.save(tmp_path / "x.bvh")
    for other in (pickle.loads(pickle.dumps(bvh)), copy.copy(bvh), canted.Bvh.load(tmp_path / "x.bvh")):
        assert other.origin == bvh.origin and other.signed_distance(UTM).dtype == "float64"
        other.refit(vertices + 0.01)
        assert abs(other.signed_distance(UTM)[0] + 0.04) < 1e-8
    assert np.abs(bvh.vertices - vertices).max() < 1e-8 and (bvh.triangles == triangles).all()
    assert canted.Bvh(bvh).signed_distance(UTM).dtype == "float64"


def test_instances_are_relative_to_an_origin_as_well():
    vertices, triangles = utm_cube()
    bvh = canted.Bvh(vertices, triangles)
    shift = np.eye(4)
    shift[:3, 3] = (0.5, 0.25, 0.125)
    tlas = canted.Tlas([bvh], [(0, np.eye(4)), (0, shift)])
    points = [UTM, UTM + shift[:3, 3]]
    for other in (tlas, pickle.loads(pickle.dumps(tlas))):
        signed = other.signed_distance(points)
        assert signed.dtype == "float64" and np.abs(signed + 0.05).max() < 1e-7 and other.contains(points).all()
        hits = other.closest_hit([UTM + [0.01, 0, 7], UTM + [0.51, 0.25, 7]], [0, 0, -1])
        assert hits.t.dtype == "float64" and np.abs(hits.t - [6.95, 6.825]).max() < 1e-7 and hits.instance.tolist() == [0, 1]
        assert np.abs(hits.position[0] - (UTM + [0.01, 0, 0.05])).max() < 1e-7
        assert np.abs(other.bounds - [vertices.min(axis=0), vertices.max(axis=0) + shift[:3, 3]]).max() < 1e-6
        assert np.abs(np.array(other.origin) - UTM).max() < 1


def test_scenes_with_open3d_s_names():
    vertices, triangles = utm_cube()
    scene = RaycastingScene()
    scene.add_triangles(vertices, triangles)
    scene.add_triangles(vertices + [1, 0, 0], triangles)
    # Relative to an origin within one meter, the extent of both.
    assert abs(scene.compute_signed_distance([UTM])[0] + 0.05) < 1e-7 and scene.compute_distance([UTM]).dtype == "float64"
    found = scene.cast_rays([[*(UTM + [1.01, 0, 3]), 0, 0, -1]])
    assert found["geometry_ids"].tolist() == [1] and abs(found["t_hit"][0] - 2.95) < 1e-7
    nearest = scene.compute_closest_points([UTM + [0.2, 0, 0.01]])
    assert np.abs(nearest["points"][0] - (UTM + [0.05, 0, 0.01])).max() < 1e-7
    # As Open3D where float32 is enough.
    near = RaycastingScene()
    near.add_triangles(*meshes.box())
    assert near.cast_rays([[0.25, 0.5, 3, 0, 0, -1]])["t_hit"].dtype == near.compute_distance([[0, 0, 2]]).dtype == "float32"


@pytest.mark.parametrize("shift", [1e3, 1e5, 4321987.654])
def test_a_near_mesh_placed_far_away(shift):
    """Distances from inside and outside of a cube of 10 cm, known without a computer."""
    vertices, triangles = meshes.box()
    box = canted.Bvh(0.1 * (vertices - 0.5), triangles)
    center = np.array([shift + 0.0123, -shift, 0.3])
    matrix = np.eye(4)
    matrix[:3, 3] = center
    far = canted.Tlas([box], [(0, matrix)])
    assert far.signed_distance(center) == pytest.approx(-0.05, abs=1e-6)
    assert far.contains(center + [0.049, 0, 0]) and not far.contains(center + [0.051, 0, 0])
    assert far.nearest(center + [0.06, 0, 0]).distance == pytest.approx(0.01, abs=1e-6)
    hit = far.closest_hit(center + [1, 0.02, 0.01], [-1, 0, 0])
    assert hit.t == pytest.approx(0.95, abs=1e-6)


def test_wide_scenes_and_near_ones_have_no_origin():
    """Around zero no origin gains anything."""
    vertices, triangles = meshes.box()
    box = canted.Bvh(vertices - 0.5, triangles)
    ends = [np.eye(4), np.eye(4)]
    ends[0][0, 3], ends[1][0, 3] = -1e6, 1e6
    for instances in ([(0, np.eye(4))], [(0, ends[0]), (0, ends[1])]):
        assert canted.Tlas([box], instances).origin == (0, 0, 0)

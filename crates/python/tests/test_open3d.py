"""The names of Open3D's RaycastingScene, against queries of this package and, where it is installed, against Open3D."""

import canted
import meshes
import numpy as np
import pytest
from canted.open3d import RaycastingScene


def scene_of(scene):
    """Two meshes, with an empty one between them."""
    ids = [scene.add_triangles(*mesh) for mesh in two_meshes()]
    assert ids == [0, 1, 2]
    return scene


def two_meshes():
    vertices, triangles = meshes.sphere(2)
    shift = np.float32([3, 0, 0])
    box_vertices, box_triangles = meshes.box((-1, -1, -1), (1, 1, 1))
    return [(vertices, triangles), (np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)), (box_vertices + shift, box_triangles)]


def rays(n):
    origins, directions = meshes.rays(n, scale=4.0)
    return np.concatenate([origins, directions], axis=1)


def test_ids_and_shapes():
    scene, all_rays = scene_of(RaycastingScene()), rays(6000).reshape(20, 300, 6)
    found = scene.cast_rays(all_rays)
    vertices = np.concatenate([mesh[0] for mesh in two_meshes()])
    triangles = np.concatenate([two_meshes()[0][1], two_meshes()[2][1] + len(two_meshes()[0][0])])
    hits = canted.Bvh(vertices, triangles).closest_hit(all_rays.reshape(-1, 6)[:, :3], all_rays.reshape(-1, 6)[:, 3:])
    assert found["t_hit"].shape == (20, 300) and (found["t_hit"].reshape(-1) == hits.t).all()
    n_first = len(two_meshes()[0][1])
    geometry, primitive = found["geometry_ids"].reshape(-1), found["primitive_ids"].reshape(-1)
    hit = hits.hit
    assert (geometry[hit] == np.where(hits.primitive[hit] < n_first, 0, 2)).all() and {0, 2} <= set(geometry[hit].tolist())
    assert (primitive[hit] == np.where(geometry[hit] == 0, hits.primitive[hit], hits.primitive[hit] - n_first)).all()
    assert (geometry[~hit] == scene.INVALID_ID).all() and (primitive[~hit] == scene.INVALID_ID).all()
    assert found["primitive_uvs"].shape == (20, 300, 2) and found["primitive_normals"].shape == (20, 300, 3)
    assert (scene.test_occlusions(all_rays) == np.isfinite(found["t_hit"])).all()
    count = scene.count_intersections(all_rays)
    listed = scene.list_intersections(all_rays)
    assert count.dtype == "int32" and (np.diff(listed["ray_splits"]) == count.reshape(-1)).all()
    assert (count % 2 == 0).sum() > 5000 and len(listed["t_hit"]) == count.sum()


def test_distances_and_closest_points():
    scene = scene_of(RaycastingScene(nthreads=2))
    points = np.random.default_rng(9).uniform(-2, 5, (10, 50, 3)).astype(np.float32)
    found = scene.compute_closest_points(points)
    flat = found["primitive_ids"].reshape(-1)
    for i in range(0, 500, 17):
        vertices, triangles = two_meshes()[found["geometry_ids"].reshape(-1)[i]]
        corners = vertices[triangles[flat[i]]].astype(np.float64)
        u, v = found["primitive_uvs"].reshape(-1, 2)[i]
        expected = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0])
        assert np.abs(found["points"].reshape(-1, 3)[i] - expected).max() < 1e-5
    distance = scene.compute_distance(points)
    assert distance.shape == (10, 50)
    assert np.allclose(distance, np.linalg.norm(found["points"] - points, axis=-1), atol=1e-5)
    signed, occupancy = scene.compute_signed_distance(points, nsamples=3), scene.compute_occupancy(points)
    assert (np.abs(signed) == distance).all() and ((signed < 0) == (occupancy == 1)).all() and occupancy.sum() > 10


def test_empty_scenes_and_bad_input():
    scene = RaycastingScene()
    assert np.isinf(scene.cast_rays(rays(5))["t_hit"]).all() and scene.count_intersections(rays(5)).tolist() == [0] * 5
    assert (scene.compute_closest_points(np.zeros((2, 3), np.float32))["geometry_ids"] == scene.INVALID_ID).all()
    for arguments in ((rays(5)[:, :5],), (np.float32(1),)):
        with pytest.raises(ValueError, match="rays has shape"):
            scene.cast_rays(*arguments)
    with pytest.raises(ValueError, match="triangle 0 has vertex index 9, but there are 8 vertices"):
        scene.add_triangles(meshes.box()[0], [[0, 1, 9]])
    with pytest.raises(ValueError, match="add_triangles takes"):
        scene.add_triangles(1, 2, 3)
    assert scene.add_triangles(vertex_positions=meshes.box()[0], triangle_indices=meshes.box()[1]) == 0


def test_open3d_agrees_where_no_edge_is_met():
    try:
        import open3d
    except (ImportError, OSError) as error:
        pytest.skip(f"open3d is not installed: {error}")
    ours, theirs = scene_of(RaycastingScene()), open3d.t.geometry.RaycastingScene()
    for vertices, triangles in two_meshes():
        theirs.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles.astype(np.uint32)))
    all_rays = rays(4000)
    a, b = ours.cast_rays(all_rays), theirs.cast_rays(open3d.core.Tensor(all_rays))
    b = {name: value.numpy() for name, value in b.items()}
    same = (a["primitive_ids"] == b["primitive_ids"]) & (a["geometry_ids"] == b["geometry_ids"])
    assert same.mean() > 0.995
    assert np.allclose(a["t_hit"][same], b["t_hit"][same], rtol=1e-4, atol=1e-5)
    assert np.allclose(a["primitive_uvs"][same], b["primitive_uvs"][same], atol=1e-3)
    assert np.allclose(a["primitive_normals"][same], b["primitive_normals"][same], atol=1e-4)
    points = np.random.default_rng(9).uniform(-2, 5, (500, 3)).astype(np.float32)
    tensor = open3d.core.Tensor(points)
    assert np.allclose(ours.compute_signed_distance(points), theirs.compute_signed_distance(tensor).numpy(), atol=1e-4)
    assert (ours.compute_occupancy(points) == theirs.compute_occupancy(tensor).numpy()).mean() > 0.995
    assert (ours.count_intersections(all_rays) == theirs.count_intersections(open3d.core.Tensor(all_rays)).numpy()).mean() > 0.98
    view = {"fov_deg": 60, "center": [0, 0, 0], "eye": [4, 3, 2], "up": [0, 0, 1], "width_px": 8, "height_px": 6}
    assert np.allclose(ours.create_rays_pinhole(**view), theirs.create_rays_pinhole(**view).numpy(), atol=1e-5)
    matrices = (np.diag([5.0, 6.0, 1.0]), np.eye(4), 4, 3)
    tensors = [open3d.core.Tensor(matrix) for matrix in matrices[:2]]
    assert np.allclose(ours.create_rays_pinhole(*matrices), theirs.create_rays_pinhole(*tensors, 4, 3).numpy(), atol=1e-5)

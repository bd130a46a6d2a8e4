"""The drop-in for trimesh: trimesh's own tests, and its interface."""

import copy
import inspect
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

import canted.trimesh  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

import missing_hits  # noqa: E402

CASES = {case.trackers: case for case in missing_hits.cases()}


def test_a_wrong_count_is_noticed():
    case = CASES["trimesh #457"]
    assert missing_hits.wrong(case, np.full(len(case.origins), 3)) == len(case.origins)


def test_trimesh_s_own_ray_tests_pass_unchanged(tmp_path):
    folder = os.environ.get("TRIMESH_SOURCE")
    if not folder:
        pytest.skip("there is no checkout of trimesh with its tests (set TRIMESH_SOURCE)")
    (tmp_path / "enable_canted.py").write_text("import canted.trimesh\n\ncanted.trimesh.enable()\n")
    tests = [f"tests/{name}" for name in ("test_ray.py", "test_ray_upstream.py") if Path(folder, "tests", name).is_file()]
    # Needs a backend for booleans, whatever traces rays.
    command = [sys.executable, "-m", "pytest", "-q", "-p", "enable_canted", "--deselect", "tests/test_ray.py::test_contains_cavity"]
    result = subprocess.run(
        [*command, *tests], cwd=folder, env={**os.environ, "PYTHONPATH": str(tmp_path)}, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stdout[-3000:]


def test_methods_and_names_are_those_of_trimesh():
    native = trimesh.ray.ray_triangle.RayMeshIntersector
    ours = canted.trimesh.RayMeshIntersector
    for name, method in inspect.getmembers(native, inspect.isfunction):
        if not name.startswith("_"):
            expected = [p for p in inspect.signature(method).parameters if p != "kwargs"]
            assert set(expected) <= set(inspect.signature(getattr(ours, name)).parameters), name
    try:
        from trimesh.ray.ray_pyembree import RayMeshIntersector as peer
    except ImportError:
        return
    for name in ("__init__", "intersects_location", "intersects_id", "intersects_first", "intersects_any", "contains_points"):
        parameters = list(inspect.signature(getattr(peer, name)).parameters)
        if parameters == ["args", "kwargs"]:
            # Wrapped for logging.
            continue
        # In this order, so that positional arguments mean the same.
        assert list(inspect.signature(getattr(ours, name)).parameters)[: len(parameters)] == parameters, name


def test_results_have_the_types_of_trimesh():
    mesh = trimesh.creation.icosphere()
    ray = canted.trimesh.RayMeshIntersector(mesh)
    origins, directions = np.random.default_rng(1).uniform(-2, 2, (2, 500, 3))
    for multiple in (True, False):
        locations, index_ray, index_tri = ray.intersects_location(origins, directions, multiple_hits=multiple)
        assert index_ray.dtype == index_tri.dtype == "int64" and locations.dtype == "float64"
        assert locations.shape == (len(index_ray), 3) and len(index_ray) == len(index_tri) > 50
        # On the float64 plane of the triangle and on the float64 ray.
        normals, d = mesh.face_normals[index_tri], directions[index_ray] / np.linalg.norm(directions[index_ray], axis=1)[:, None]
        from_corner = locations - mesh.triangles[index_tri, 0]
        assert np.abs((from_corner * normals).sum(axis=1)).max() < 1e-12
        offset = np.linalg.norm(np.cross(locations - origins[index_ray], d), axis=1)
        assert np.median(offset) < 1e-15 and offset.max() < 1e-6
        assert len(ray.intersects_id(origins, directions, multiple)) == 2
    first = ray.intersects_first(origins, directions)
    assert first.dtype == "int64" and (first[index_ray] == index_tri).all() and (first == -1).sum() == 500 - len(index_ray)
    assert (ray.intersects_any(origins, directions) == (first != -1)).all()
    assert (ray.intersects_id(origins, directions, max_hits=1)[1] == np.unique(ray.intersects_id(origins, directions)[1])).all()
    for empty in (np.zeros((0, 3)), []):
        assert [len(part) for part in ray.intersects_location(empty, empty)] == [0, 0, 0]
    with pytest.raises(ValueError, match="don't match"):
        ray.intersects_id(origins, directions[:3])
    with pytest.raises(ValueError, match="rays have shape"):
        ray.intersects_any(origins[0], directions[0])


@pytest.mark.parametrize("shift", [0.0, 1e7])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_far_meshes_and_rays_are_as_exact_as_near_ones(scale, shift):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    origins = np.random.default_rng(2).uniform(-1, 1, (300, 3)) + [0, 0, 1000]
    directions = mesh.triangles_center[np.arange(300) % len(mesh.faces)] - origins
    expected = canted.trimesh.RayMeshIntersector(mesh).intersects_first(origins, directions)
    mesh.apply_scale(scale)
    mesh.apply_translation([shift * scale] * 3)
    found = canted.trimesh.RayMeshIntersector(mesh).intersects_first(origins * scale + shift * scale, directions)
    assert (expected != -1).all() and (found == expected).all()


def test_enable_disable_pickle_and_changes_of_the_mesh():
    before = type(trimesh.creation.box().ray)
    canted.trimesh.enable()
    canted.trimesh.enable()
    try:
        mesh = trimesh.creation.box()
        assert type(mesh.ray) is canted.trimesh.RayMeshIntersector
        assert type(mesh.copy().ray) is canted.trimesh.RayMeshIntersector
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        assert RayMeshIntersector is canted.trimesh.RayMeshIntersector
    finally:
        canted.trimesh.disable()
        canted.trimesh.disable()
    assert type(trimesh.creation.box().ray) is before
    for ray in (mesh.ray, pickle.loads(pickle.dumps(mesh.ray)), copy.deepcopy(mesh.ray)):
        assert ray.intersects_any([[0, 0, 5]], [[0, 0, -1]])[0]
    mesh.apply_translation([10, 0, 0])
    assert not mesh.ray.intersects_any([[0, 0, 5]], [[0, 0, -1]])[0]
    assert mesh.contains([[10, 0, 0], [0, 0, 0]]).tolist() == [True, False]

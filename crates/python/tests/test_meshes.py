"""Meshes of other packages, memory of other packages, and what a BVH gives back."""

import weakref

import canted
import meshes
import numpy as np
import pytest
from canted.open3d import RaycastingScene

VERTICES, TRIANGLES = meshes.sphere(2)
ORIGINS, DIRECTIONS = meshes.rays(300)
EXPECTED = canted.Bvh(VERTICES, TRIANGLES).closest_hit(ORIGINS, DIRECTIONS)


def has_its_hits(bvh):
    hits = bvh.closest_hit(ORIGINS, DIRECTIONS)
    return np.array_equal(hits.t, EXPECTED.t) and np.array_equal(hits.primitive, EXPECTED.primitive)


class Foreign:
    """An array in the memory of another package, which NumPy does not convert by itself."""

    def __init__(self, array, device=None):
        self._array, self._device = array, device

    def __dlpack__(self, **options):
        if self._device is not None:
            raise BufferError("on another device")
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._device or self._array.__dlpack_device__()


class Tensor:
    """What Open3D's tensors have in common with arrays."""

    def __init__(self, array):
        self._array = array

    def numpy(self):
        return self._array


class Parts:
    def __init__(self, **parts):
        self.__dict__.update(parts)


SOUP = VERTICES[TRIANGLES]
MESHES = {
    "soup": SOUP,
    "packed soup": SOUP.reshape(-1, 3),
    "soup of float64": SOUP.astype(np.float64),
    "list": SOUP.tolist(),
    "faces": Parts(vertices=VERTICES, faces=TRIANGLES, triangles=SOUP),
    "triangles": Parts(vertices=VERTICES.astype(np.float64), triangles=TRIANGLES),
    "tensors": Parts(vertex={"positions": Tensor(VERTICES)}, triangle={"indices": Tensor(TRIANGLES.astype(np.uint32))}),
    "scene": Parts(geometry={}, dump=lambda concatenate: Parts(vertices=VERTICES, faces=TRIANGLES)),
    "BVH": canted.Bvh(VERTICES, TRIANGLES, origin=None),
    "DLPack": Foreign(SOUP.copy()),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_of_another_package_is_one_argument(name):
    assert has_its_hits(canted.Bvh(MESHES[name])) and has_its_hits(canted.Bvh.from_mesh(MESHES[name], "fast", threads=1))


def test_meshes_of_trimesh():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(VERTICES, TRIANGLES, process=False)
    scene = trimesh.Scene([mesh])
    for given in (mesh, scene):
        assert has_its_hits(canted.Bvh(given))
    with pytest.raises(ValueError, match="a PointCloud without triangles is no mesh"):
        canted.Bvh(trimesh.PointCloud(VERTICES))


def test_meshes_of_open3d():
    try:
        import open3d
    except (ImportError, OSError) as error:
        pytest.skip(f"open3d is not installed: {error}")
    legacy = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(VERTICES.astype(np.float64)), open3d.utility.Vector3iVector(TRIANGLES.astype(np.int32))
    )
    tensor = open3d.t.geometry.TriangleMesh.from_legacy(legacy)
    for mesh in (legacy, tensor):
        assert has_its_hits(canted.Bvh(mesh))
        assert RaycastingScene().add_triangles(mesh) == 0
    assert len(canted.Bvh(open3d.geometry.TriangleMesh())) == len(canted.Bvh(open3d.t.geometry.TriangleMesh())) == 0
    core = open3d.core.Tensor
    bvh = canted.Bvh(core(VERTICES), core(TRIANGLES.astype(np.int64)))
    hits = bvh.closest_hit(core(ORIGINS), core(DIRECTIONS))
    assert np.array_equal(hits.t, EXPECTED.t)


def test_arrays_in_the_memory_of_others():
    bvh = canted.Bvh(Foreign(VERTICES.copy()), Foreign(TRIANGLES.astype(np.int32)))
    hits = bvh.closest_hit(Foreign(ORIGINS.copy()), Foreign(DIRECTIONS.copy()))
    assert has_its_hits(bvh) and np.array_equal(hits.t, EXPECTED.t)
    assert np.array_equal(np.from_dlpack(hits.t), EXPECTED.t)
    with pytest.raises(ValueError, match="vertices cannot be converted to an array: on another device"):
        canted.Bvh(Foreign(VERTICES, device=(2, 0)), TRIANGLES)


def test_vertices_and_triangles_are_those_of_the_build():
    vertices = np.concatenate([VERTICES, [[9, 9, 9]]]).astype(np.float32)
    for origin in (None, (0.5, 0.25, -1)):
        bvh = canted.Bvh(vertices, TRIANGLES, origin=origin)
        assert bvh.vertices.shape == vertices.shape and bvh.vertices.dtype == "float64" and bvh.triangles.dtype == "int64"
        assert np.abs(bvh.vertices[:-1] - VERTICES).max() < 1e-7 and np.isnan(bvh.vertices[-1]).all()
        assert (bvh.triangles == TRIANGLES).all()
    moved = canted.Bvh(VERTICES, TRIANGLES)
    moved.refit(VERTICES * 2)
    assert (moved.vertices == VERTICES * 2).all()
    nothing = canted.Bvh([], [])
    assert nothing.vertices.shape == nothing.triangles.shape == (0, 3)


def test_rays_of_any_shape_have_results_of_that_shape():
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    tlas = canted.Tlas([bvh])
    origins, directions = ORIGINS.reshape(10, 5, 6, 3), DIRECTIONS.reshape(10, 5, 6, 3)
    for answers in (bvh, tlas):
        hits = answers.closest_hit(origins, directions)
        for name in ("t", "primitive", "u", "v", "entering", "ray", "hit"):
            assert getattr(hits, name).shape == (10, 5, 6), name
        assert hits.position.shape == hits.normal.shape == (10, 5, 6, 3) and len(hits) == 10
        assert np.array_equal(hits.t.reshape(-1), EXPECTED.t) and (hits.ray.reshape(-1) == np.arange(300)).all()
        assert np.array_equal(hits.position.reshape(-1, 3), EXPECTED.position, equal_nan=True) and "300 rays" in repr(hits)
        assert (answers.occluded(origins, directions) == hits.hit).all()
        assert answers.all_hits(origins, directions).t.ndim == 1
        assert answers.closest_hit(ORIGINS[0], directions, t_max=np.ones((10, 5, 6))).t.shape == (10, 5, 6)
        assert answers.closest_hit(np.zeros((4, 0, 3)), np.zeros((4, 0, 3))).position.shape == (4, 0, 3)
        assert answers.contains(origins).shape == answers.signed_distance(origins).shape == (10, 5, 6)
        assert answers.nearest(origins).position.shape == (10, 5, 6, 3)
    assert bvh.winding_number(origins).shape == (10, 5, 6)
    # In memory of any order.
    assert np.array_equal(bvh.closest_hit(np.asfortranarray(origins), directions[::-1][::-1]).t, hits.t)


def test_hits_are_indexed_and_iterated():
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    hits = bvh.closest_hit(ORIGINS.reshape(100, 3, 3), DIRECTIONS.reshape(100, 3, 3))
    for index in (5, -1, slice(10, 40, 3), (slice(None), 1), (7, 2), hits.hit, [3, 3, 1], (..., 0), np.int64(4), (None, 2)):
        part = hits[index]
        assert isinstance(part, canted.Hits)
        for name in ("t", "primitive", "u", "v", "entering", "ray", "hit"):
            assert np.array_equal(getattr(part, name), getattr(hits, name)[index]), name
        shape = np.shape(part.t)
        rows = np.arange(300).reshape(100, 3)[index]
        assert part.position.shape == part.normal.shape == (*shape, 3)
        assert np.array_equal(part.position, EXPECTED.position[rows], equal_nan=True)
    with pytest.raises(IndexError):
        hits[100]
    flat = bvh.closest_hit(ORIGINS, DIRECTIONS)
    rows = list(flat)
    assert len(rows) == 300 and [row.t for row in rows] == flat.t.tolist() and [bool(row) for row in rows] == flat.hit.tolist()
    assert isinstance(float(rows[0].t), float) and rows[7].position.shape == (3,) and rows[7].ray == 7
    with pytest.raises(TypeError, match="a single row has no len"):
        len(rows[0])
    listed = bvh.all_hits(ORIGINS, DIRECTIONS)
    assert sum(1 for _ in listed) == len(listed) and (listed[listed.ray == listed.ray[0]].ray == listed.ray[0]).all()
    assert bool(listed) and not bvh.all_hits([[9, 9, 9]], [[1, 0, 0]])
    columns = flat.to_dict()
    assert list(columns) == ["ray", "t", "primitive", "u", "v", "entering", "hit", "position", "normal"]
    assert all(np.array_equal(column, getattr(flat, name), equal_nan=column.dtype.kind == "f") for name, column in columns.items())
    assert "instance" in canted.Tlas([bvh]).closest_hit(ORIGINS, DIRECTIONS).to_dict()


def test_weak_references():
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    for item in (bvh, canted.Tlas([bvh]), bvh.closest_hit(ORIGINS, DIRECTIONS), bvh.nearest(ORIGINS)):
        assert weakref.ref(item)() is item
    reference = weakref.ref(bvh)
    del bvh, item
    assert reference() is None

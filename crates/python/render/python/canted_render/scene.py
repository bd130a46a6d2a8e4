"""Scenes as dicts: the tables of a scene file, and meshes of arrays."""

import json
from collections.abc import Mapping

import numpy as np

_KEYS = ("name", "vertices", "triangles", "normals", "uvs", "colors", "color", "material")


def scene_file(scene):
    """The text of a scene file, and the meshes: tuples of name, vertices, triangles, normals, uvs, colors."""
    if not isinstance(scene, Mapping):
        raise ValueError(f"scene is of type {type(scene).__name__}; use a path or a dict")
    tables = dict(scene)
    meshes = tables.pop("meshes", ())
    assets, materials = list(tables.get("assets", ())), list(tables.get("materials", ()))
    contents = []
    for i, mesh in enumerate(meshes):
        if not isinstance(mesh, Mapping):
            raise ValueError(f"mesh {i} is of type {type(mesh).__name__}, not a dict")
        contents.append(_content(i, mesh))
        name = contents[-1][0]
        # What is written here stands for the arrays.
        asset = {"name": name, "builtin": True}
        if mesh.get("color") is not None or mesh.get("material") is not None:
            asset["material"] = _material(name, mesh, materials)
        assets.append(asset)
    if assets:
        tables["assets"] = assets
    if materials:
        tables["materials"] = materials
    return "".join(f"{_key(name)} = {_value(table, str(name))}\n" for name, table in tables.items()), contents


def _material(name, mesh, materials):
    """The name of the mesh's material, which is added where the mesh describes it."""
    color, material = mesh.get("color"), mesh.get("material")
    if color is not None and material is not None:
        raise ValueError(f"mesh '{name}' has both color and material; use one of them")
    if isinstance(material, str):
        return material
    if color is not None:
        material = {"base_color": color}
    if not isinstance(material, Mapping):
        raise ValueError(f"the material of mesh '{name}' is of type {type(material).__name__}; use a name or a dict")
    own = {"name": f"material of {name}", **material}
    materials.append(own)
    return own["name"]


def _content(i, mesh):
    name = mesh.get("name", f"mesh {i}")
    if not isinstance(name, str):
        raise ValueError(f"the name of mesh {i} is of type {type(name).__name__}, not str")
    unknown = [key for key in mesh if key not in _KEYS]
    if unknown:
        raise ValueError(f"mesh '{name}' has the unknown key {unknown[0]!r}; use {', '.join(_KEYS)}")
    vertices = _rows(mesh.get("vertices"), f"vertices of mesh '{name}'", (3,))
    triangles = np.asarray(mesh.get("triangles"))
    if triangles.dtype.kind not in "iu" or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ValueError(f"triangles of mesh '{name}' are {triangles.dtype} of shape {triangles.shape}, not integers of shape (m, 3)")
    wrong = ((triangles < 0) | (triangles >= len(vertices))).any(axis=1)
    if wrong.any():
        raise ValueError(f"mesh '{name}': triangle {wrong.argmax()} has vertices {triangles[wrong.argmax()].tolist()}, "
                         f"but there are {len(vertices)}")  # fmt: skip
    wrong = ~np.isfinite(vertices[triangles]).all(axis=(1, 2))
    if wrong.any():
        raise ValueError(f"mesh '{name}': triangle {wrong.argmax()} has a vertex that is not finite")
    of_vertices = []
    for key, widths in (("normals", (3,)), ("uvs", (2,)), ("colors", (3, 4))):
        rows = None if mesh.get(key) is None else _rows(mesh[key], f"{key} of mesh '{name}'", widths)
        if rows is not None and len(rows) != len(vertices):
            raise ValueError(f"mesh '{name}' has {len(rows)} {key}, but {len(vertices)} vertices")
        if rows is not None and not np.isfinite(rows).all():
            raise ValueError(f"{key} of mesh '{name}' are not all finite")
        of_vertices.append(rows)
    normals, uvs, colors = of_vertices
    if normals is not None:
        # Of length 1 or 0; zero stands for the normal of the triangle.
        length = np.linalg.norm(normals.astype(np.float64), axis=1, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros(normals.shape), where=length > 0.0).astype(np.float32)
    if colors is not None and colors.shape[1] == 3:
        colors = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
    return name, vertices, np.ascontiguousarray(triangles, dtype=np.uint32), normals, uvs, colors


def _rows(rows, what, widths):
    try:
        with np.errstate(over="ignore"):
            array = np.ascontiguousarray(rows, dtype=np.float32)
    except (TypeError, ValueError):
        raise ValueError(f"{what} are no array of numbers") from None
    if array.ndim != 2 or array.shape[1] not in widths:
        raise ValueError(f"{what} have shape {array.shape}, not (n, {' or '.join(map(str, widths))})")
    return array


def _key(key):
    return json.dumps(str(key), ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value, name):
    """A value in TOML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item, f'{name}.{key}')}" for key, item in value.items()) + "}"
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        # The shortest number with these bits, also of float32.
        return str(value)
    if hasattr(value, "__fspath__"):
        value = value.__fspath__()
    if isinstance(value, str):
        return _key(value)
    if isinstance(value, np.ndarray) or (hasattr(value, "__iter__") and hasattr(value, "__len__")):
        return "[" + ", ".join(_value(item, name) for item in value) + "]"
    raise ValueError(f"{name} is of type {type(value).__name__}, which a scene cannot hold")

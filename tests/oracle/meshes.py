"""Triangles and materials of OBJ and GLB files, read by an independent reader.

A model is a list of parts; a part is one material's triangles as a soup: `corners` (n, 3, 3) in world space, `uvs`
(n, 3, 2) with v up, or None. Shading normals are not read: both renderers are compared on flat triangles.
"""

import io
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image


@dataclass
class Material:
    name: str
    color: tuple = (0.8, 0.8, 0.8)
    emission: tuple = (0.0, 0.0, 0.0)
    image: np.ndarray | None = None  # (rows, columns, 3) of 8-bit sRGB, row 0 at the top
    mask: np.ndarray | None = None  # (rows, columns) of 8-bit alpha, transparent below one half
    metallic: float = 0.0
    roughness: float = 1.0
    transmission: float = 0.0


@dataclass
class Part:
    material: Material
    corners: np.ndarray
    uvs: np.ndarray | None = field(default=None)


def pixels(source, mode):
    return np.asarray(Image.open(source).convert(mode))


def read(path):
    path = Path(path)
    return read_glb(path) if path.suffix == ".glb" else read_obj(path)


def read_mtl(path):
    materials, current = {}, None
    for line in path.read_text().splitlines():
        key, _, rest = line.strip().partition(" ")
        if key == "newmtl":
            current = materials[rest] = Material(rest)
        elif key == "Kd":
            current.color = tuple(map(float, rest.split()))
        elif key == "Ke":
            current.emission = tuple(map(float, rest.split()))
        elif key == "map_Kd":
            current.image = pixels(path.parent / rest, "RGB")
        elif key == "map_d":
            image = Image.open(path.parent / rest)
            current.mask = np.asarray(image.getchannel("A") if "A" in image.getbands() else image.convert("L"))
    return materials


def read_obj(path):
    """Splits polygons into fans, which is correct for convex ones such as Sponza's quads."""
    positions, coordinates, faces = [], [], {}
    materials, using = {}, None
    for line in path.read_text().splitlines():
        key, *rest = line.split() or [""]
        if key == "v":
            positions.append(tuple(map(float, rest[:3])))
        elif key == "vt":
            coordinates.append(tuple(map(float, rest[:2])))
        elif key == "mtllib":
            materials |= read_mtl(path.parent / rest[0])
        elif key == "usemtl":
            using = faces.setdefault(rest[0], [])
        elif key == "f":
            corners = [(word.split("/") + [""])[:2] for word in rest]
            using += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    positions, coordinates = np.float32(positions), np.float32(coordinates or [(0, 0)])
    parts = []
    for name, triangles in faces.items():
        has_uvs = bool(triangles[0][0][1])
        index = np.array([[int(v) - 1 for v, _ in triangle] for triangle in triangles])
        uvs = coordinates[[[int(t) - 1 for _, t in triangle] for triangle in triangles]] if has_uvs else None
        parts.append(Part(materials[name], positions[index], uvs))
    return parts


COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def read_glb(path):
    """Meshes with node transforms; triangle primitives without skins, morphs or sparse accessors."""
    data = path.read_bytes()
    n = struct.unpack("<I", data[12:16])[0]
    gltf, binary = json.loads(data[20 : 20 + n]), data[28 + n :]

    def view(i):
        view = gltf["bufferViews"][i]
        start = view.get("byteOffset", 0)
        return binary[start : start + view["byteLength"]], view.get("byteStride")

    def accessor(i):
        accessor = gltf["accessors"][i]
        data, stride = view(accessor["bufferView"])
        kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        shape, stride = (accessor["count"], width), stride or kind.itemsize * width
        return np.ndarray(shape, kind, data, accessor.get("byteOffset", 0), (stride, kind.itemsize))

    def image(info):
        source = gltf["images"][gltf["textures"][info["index"]]["source"]]
        return pixels(io.BytesIO(view(source["bufferView"])[0]), "RGB")

    materials = []
    for entry in gltf["materials"]:
        rough = entry["pbrMetallicRoughness"]
        material = Material(entry.get("name", ""), tuple(rough.get("baseColorFactor", [1, 1, 1])[:3]))
        material.metallic, material.roughness = rough.get("metallicFactor", 1.0), rough.get("roughnessFactor", 1.0)
        extension = entry.get("extensions", {}).get("KHR_materials_transmission", {})
        material.transmission = extension.get("transmissionFactor", 0.0)
        material.image = image(rough["baseColorTexture"]) if "baseColorTexture" in rough else None
        materials.append(material)

    soups = {}

    def place(node, outer):
        node = gltf["nodes"][node]
        here = outer @ local(node)
        for primitive in gltf["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            attributes = primitive["attributes"]
            index = accessor(primitive["indices"]).reshape(-1, 3)
            corners = accessor(attributes["POSITION"])[index] @ here[:3, :3].T + here[:3, 3]
            uvs = None
            if "TEXCOORD_0" in attributes:
                uvs = np.float32([0, 1]) + accessor(attributes["TEXCOORD_0"])[index] * np.float32([1, -1])
            soups.setdefault((primitive["material"], uvs is None), []).append((corners, uvs))
        for child in node.get("children", []):
            place(child, here)

    for root in gltf["scenes"][gltf.get("scene", 0)]["nodes"]:
        place(root, np.eye(4))
    parts = []
    for (material, is_bare), runs in soups.items():
        corners, uvs = zip(*runs)
        parts.append(Part(materials[material], np.concatenate(corners), None if is_bare else np.concatenate(uvs)))
    return parts


def local(node):
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.get("scale", [1, 1, 1])
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def write_ply(path, part):
    """A soup as binary PLY; v is flipped, because row 0 of Mitsuba's images is at v = 0."""
    n = len(part.corners)
    columns = [part.corners.reshape(-1, 3)]
    names = ["x", "y", "z"]
    if part.uvs is not None:
        columns.append(part.uvs.reshape(-1, 2) * [1, -1] + [0, 1])
        names += ["u", "v"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {3 * n}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {n}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.zeros(n, [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, np.arange(3 * n).reshape(-1, 3)
    vertices = np.concatenate(columns, axis=1).astype("<f4")
    path.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())

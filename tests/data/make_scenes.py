#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Makes the scene files of this folder again, byte for byte. Needs nothing but Python.
import base64
import json
import math
import pathlib
import struct
import zlib

FOLDER = pathlib.Path(__file__).parent


# ---- pictures


def png(width, height, pixel):
    """pixel(x, y) -> (r, g, b), y down."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rows += bytes(pixel(x, y))

    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


def crate(x, y):
    """Planks with a frame; a white arrow points to the picture's top-right corner."""
    size = 128
    edge = min(x, y, size - 1 - x, size - 1 - y)
    grain = int(10 * math.sin(0.9 * x + 3 * math.sin(0.12 * y)))
    if edge < 10:
        base = (118, 78, 40)
    elif (y - 10) % 27 < 2:
        base = (60, 38, 20)
    else:
        base = (186, 132, 74)
    on_shaft = abs(x + y - size) < 7 and 34 < x < 88
    on_head = x < 98 and y > 30 and x - y > 38
    if on_shaft or on_head:
        return (245, 243, 235)
    return tuple(max(0, min(255, c + grain)) for c in base)


def checker(x, y):
    return (214, 208, 196) if (x // 16 + y // 16) % 2 == 0 else (92, 104, 116)


# ---- meshes: (positions, normals, uvs, indices)


def box(half):
    positions, normals, uvs, indices = [], [], [], []
    for axis in range(3):
        for sign in (1, -1):
            u, v = [(2, 1), (0, 2), (0, 1)][axis]
            # Seen from outside, u runs right and v up.
            right = [0, 0, 0]
            right[u] = {0: -sign, 1: 1, 2: sign}[axis]
            up = [0, 0, 0]
            up[v] = 1 if axis != 1 else -sign
            out = [0, 0, 0]
            out[axis] = sign
            first = len(positions)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                positions.append([half * (out[k] + a * right[k] + b * up[k]) for k in range(3)])
                normals.append([float(c) for c in out])
                uvs.append([(a + 1) / 2, (1 - b) / 2])
            indices += [first, first + 1, first + 2, first, first + 2, first + 3]
    return positions, normals, uvs, indices


def ball(columns=32, rows=16):
    positions, uvs, indices = [], [], []
    for j in range(rows + 1):
        for i in range(columns + 1):
            a, b = 2 * math.pi * i / columns, math.pi * j / rows
            positions.append([math.sin(b) * math.sin(a), math.cos(b), math.sin(b) * math.cos(a)])
            uvs.append([i / columns, j / rows])
    width = columns + 1
    for j in range(rows):
        for i in range(columns):
            k = j * width + i
            if j > 0:
                indices += [k, k + width, k + 1]
            if j < rows - 1:
                indices += [k + 1, k + width, k + width + 1]
    return positions, positions, uvs, indices


def quad(width, depth, repeats):
    """A square on the ground, facing up."""
    positions = [[-width, 0, depth], [width, 0, depth], [width, 0, -depth], [-width, 0, -depth]]
    uvs = [[0, repeats * depth / width], [repeats, repeats * depth / width], [repeats, 0], [0, 0]]
    return positions, [[0, 1, 0]] * 4, uvs, [0, 1, 2, 0, 2, 3]


def pyramid():
    corners = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
    positions, normals, indices = [], [], []
    for i in range(4):
        face = [corners[i], corners[(i + 1) % 4], [0, 2.2, 0]]
        e = [[face[k][c] - face[0][c] for c in range(3)] for k in (1, 2)]
        n = [e[0][1] * e[1][2] - e[0][2] * e[1][1], e[0][2] * e[1][0] - e[0][0] * e[1][2],
             e[0][0] * e[1][1] - e[0][1] * e[1][0]]
        length = math.sqrt(sum(c * c for c in n))
        indices += [len(positions) + k for k in range(3)]
        positions += face
        normals += [[c / length for c in n]] * 3
    return positions, normals, None, indices


# ---- glTF


class Gltf:
    def __init__(self):
        self.buffer = bytearray()
        self.json = {"asset": {"version": "2.0", "generator": "make_scenes.py"}, "scene": 0,
                     "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [],
                     "accessors": [], "bufferViews": []}

    def add(self, kind, thing):
        self.json.setdefault(kind, []).append(thing)
        return len(self.json[kind]) - 1

    def accessor(self, values, kind, component=5126, target=None):
        flat = [c for v in values for c in (v if isinstance(v, (list, tuple)) else [v])]
        while len(self.buffer) % 4:
            self.buffer.append(0)
        view = {"buffer": 0, "byteOffset": len(self.buffer)}
        self.buffer += struct.pack("<%d%s" % (len(flat), "f" if component == 5126 else "H"), *flat)
        view["byteLength"] = len(self.buffer) - view["byteOffset"]
        if target:
            view["target"] = target
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": component,
                    "count": len(values), "type": kind}
        width = len(flat) // len(values)
        finite = all(math.isfinite(c) for c in flat)
        if component == 5126 and finite:
            rounded = [struct.unpack("f", struct.pack("f", c))[0] for c in flat]
            accessor["min"] = [min(rounded[k::width]) for k in range(width)]
            accessor["max"] = [max(rounded[k::width]) for k in range(width)]
        return self.add("accessors", accessor)

    def mesh(self, name, shape, material):
        positions, normals, uvs, indices = shape
        attributes = {"POSITION": self.accessor(positions, "VEC3", target=34962)}
        if normals:
            attributes["NORMAL"] = self.accessor(normals, "VEC3", target=34962)
        if uvs:
            attributes["TEXCOORD_0"] = self.accessor(uvs, "VEC2", target=34962)
        primitive = {"attributes": attributes, "material": material,
                     "indices": self.accessor(indices, "SCALAR", 5123, 34963)}
        return self.add("meshes", {"name": name, "primitives": [primitive]})

    def material(self, name, colour, metallic=0.0, roughness=0.9, texture=None):
        pbr = {"baseColorFactor": list(colour) + [1.0], "metallicFactor": metallic,
               "roughnessFactor": roughness}
        if texture is not None:
            pbr["baseColorTexture"] = {"index": texture}
        return self.add("materials", {"name": name, "pbrMetallicRoughness": pbr})

    def texture(self, uri):
        return self.add("textures", {"source": self.add("images", {"uri": uri})})

    def node(self, **node):
        index = self.add("nodes", node)
        self.json["scenes"][0]["nodes"].append(index)
        return index

    def save(self, name, buffer_file=None):
        if buffer_file:
            (FOLDER / buffer_file).write_bytes(self.buffer)
            uri = buffer_file
        else:
            uri = data_uri("application/octet-stream", bytes(self.buffer))
        if self.buffer:
            self.json["buffers"] = [{"uri": uri, "byteLength": len(self.buffer)}]
        text = {k: v for k, v in self.json.items() if v != []}
        (FOLDER / name).write_text(json.dumps(text, indent=1) + "\n")


def data_uri(kind, data):
    return "data:%s;base64,%s" % (kind, base64.b64encode(data).decode())


def turn(axis, degrees):
    half = math.radians(degrees) / 2
    return [math.sin(half) * a for a in axis] + [math.cos(half)]


def turning_box():
    g = Gltf()
    (FOLDER / "crate.png").write_bytes(png(128, 128, crate))
    wood = g.material("crate", (1, 1, 1), 0.0, 0.7, g.texture("crate.png"))
    tiles = g.material("tiles", (1, 1, 1), 0.0, 0.9,
                       g.texture(data_uri("image/png", png(32, 32, checker))))
    red = g.material("red", (0.75, 0.03, 0.02), 0.0, 0.25)
    gold = g.material("gold", (1.0, 0.72, 0.25), 1.0, 0.35)
    green = g.material("green", (0.05, 0.38, 0.08), 0.0, 0.8)
    blue = g.material("wall", (0.30, 0.42, 0.62), 0.0, 1.0)

    ball_mesh = g.mesh("ball", ball(), red)
    gold_mesh = g.mesh("gold ball", ball(), gold)
    crate_mesh = g.mesh("crate", box(1.0), wood)
    crate_node = g.add("nodes", {"name": "crate", "mesh": crate_mesh, "translation": [0, 1.0, 0]})
    turntable = g.node(name="turntable", children=[crate_node])
    g.node(name="floor", mesh=g.mesh("floor", quad(8, 4, 16), tiles))
    g.node(name="wall", mesh=g.mesh("wall", quad(8, 4, 1), blue),
           translation=[0, 4, -4], rotation=turn((1, 0, 0), 90))
    g.node(name="ball in front", mesh=ball_mesh, translation=[-2.2, 0.55, 2.2],
           scale=[0.55, 0.55, 0.55])
    g.node(name="ball behind", mesh=ball_mesh, translation=[-2.6, 0.8, -2.4],
           scale=[0.8, 0.8, 0.8])
    hop = g.node(name="hopping ball", mesh=gold_mesh, translation=[2.0, 0.4, 1.8],
                 scale=[0.4, 0.4, 0.4])
    g.node(name="pyramid", mesh=g.mesh("pyramid", pyramid(), green), translation=[2.6, 0, -2.2],
           rotation=turn((0, 1, 0), 30))

    g.json["extensionsUsed"] = ["KHR_lights_punctual"]
    g.json["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"name": "sun", "type": "directional", "color": [1, 0.96, 0.88], "intensity": 3.0},
        {"name": "lamp", "type": "point", "color": [0.7, 0.85, 1.0], "intensity": 60.0}]}}
    sun = turn((0, 1, 0), -35)
    tilt = turn((1, 0, 0), -50)
    # The product turns the light down first, then aside.
    rotation = [sun[3] * tilt[0] + sun[1] * tilt[2], sun[3] * tilt[1] + sun[1] * tilt[3],
                sun[3] * tilt[2] - sun[1] * tilt[0], sun[3] * tilt[3] - sun[1] * tilt[1]]
    g.node(name="sun", rotation=rotation, extensions={"KHR_lights_punctual": {"light": 0}})
    g.node(name="lamp", translation=[4, 5, 5], extensions={"KHR_lights_punctual": {"light": 1}})

    seen, distance, down = 4.4, 12.0, 13.0
    fov = 2 * math.atan(seen / 2 / distance)
    g.add("cameras", {"name": "viewer", "type": "perspective",
                      "perspective": {"yfov": fov, "aspectRatio": 16 / 9, "znear": 0.1}})
    g.node(name="viewer", camera=0, rotation=turn((1, 0, 0), -down),
           translation=[0, 1.3 + distance * math.sin(math.radians(down)),
                        distance * math.cos(math.radians(down))])

    times = [0.0, 0.5, 1.0, 1.5, 2.0]
    turns = [turn((0, 1, 0), 25 + 90 * k) for k in range(5)]
    hops = [[2.0, 0.4 + h, 1.8] for h in (0, 0.9, 0, 0.9, 0)]
    time = g.accessor(times, "SCALAR")
    g.json["animations"] = [{"name": "turn", "samplers": [
        {"input": time, "output": g.accessor(turns, "VEC4"), "interpolation": "LINEAR"},
        {"input": time, "output": g.accessor(hops, "VEC3"), "interpolation": "LINEAR"}],
        "channels": [{"sampler": 0, "target": {"node": turntable, "path": "rotation"}},
                     {"sampler": 1, "target": {"node": hop, "path": "translation"}}]}]
    g.save("turning-box.gltf", "turning-box.bin")


def small_gltf_files():
    g = Gltf()
    tiles = g.material("tiles", (1, 1, 1), texture=g.texture(
        data_uri("image/png", png(32, 32, checker))))
    g.node(name="quad", mesh=g.mesh("quad", quad(1, 1, 1), tiles), rotation=turn((1, 0, 0), 90))
    g.save("textured-quad.gltf")

    g = Gltf()
    lost = g.material("lost", (0.2, 0.4, 0.8), texture=g.texture("there-is-no-such.png"))
    g.node(name="quad", mesh=g.mesh("quad", quad(1, 1, 1), lost))
    g.save("missing-texture.gltf")

    g = Gltf()
    g.node(name="nothing")
    g.save("broken/empty-scene.gltf")

    whole = (FOLDER / "turning-box.gltf").read_bytes()
    (FOLDER / "broken/truncated.gltf").write_bytes(whole[: len(whole) // 2])
    (FOLDER / "broken/truncated.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 4000) + b"{}")


def text_files():
    (FOLDER / "pyramid.mtl").write_text(
        "newmtl sides\nKd 0.8 0.3 0.1\nKs 0.5 0.5 0.5\nNs 40\nillum 2\nmap_Kd crate.png\n"
        "newmtl base\nKd 0.1 0.1 0.6\nKs 1 1 1\nNs 100\nillum 3\n")
    (FOLDER / "pyramid.obj").write_text(
        "# a pyramid: four textured sides, one plain base\nmtllib pyramid.mtl\no pyramid\n"
        "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nv 0 2 0\n"
        "vt 0 0\nvt 1 0\nvt 0.5 1\nusemtl sides\n"
        "f 1/1 2/2 5/3\nf 2/1 3/2 5/3\nf 3/1 4/2 5/3\nf 4/1 1/2 5/3\n"
        "usemtl base\nf 4 3 2 1\n")
    (FOLDER / "tetrahedron.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    (FOLDER / "tetrahedron.stl").write_text(
        "solid tetrahedron\n" + "".join(
            "facet normal %s\nouter loop\n%sendloop\nendfacet\n"
            % (n, "".join("vertex %s\n" % v for v in f)) for n, f in [
                ("0 0 -1", ["0 0 0", "0 1 0", "1 0 0"]), ("0 -1 0", ["0 0 0", "1 0 0", "0 0 1"]),
                ("-1 0 0", ["0 0 0", "0 0 1", "0 1 0"]),
                ("0.57735 0.57735 0.57735", ["1 0 0", "0 1 0", "0 0 1"])])
        + "endsolid tetrahedron\n")
    (FOLDER / "broken/empty.obj").write_text("# nothing\n")
    (FOLDER / "broken/nan-vertex.nff").write_text(
        "f 1 1 1 1 0 1 0 1\np 3\n0 0 0\n1 0 0\n0 nan 0\n")


(FOLDER / "broken").mkdir(exist_ok=True)
turning_box()
small_gltf_files()
text_files()

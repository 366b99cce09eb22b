"""Meshes: in formats that are read, cut off, with wrong counts, or naming files outside; and in formats that are not read."""
import base64
import json
import os
import struct
import zipfile

import views


def tetrahedron():
    return [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def obj(head="", vertices=None, faces=None, textured=False):
    corners, triangles = tetrahedron()
    out = head + "".join("v %g %g %g\n" % v for v in (vertices or corners))
    if textured:
        out += "vt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nusemtl m\n"
    for face in faces or [[i + 1 for i in t] for t in triangles]:
        out += "f " + " ".join(f"{i}/{i}" if textured else str(i) for i in face) + "\n"
    return out


def ply(vertices="3", faces="1", ending="ascii", body=None, extra=""):
    head = (f"ply\nformat {ending} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n{extra}"
            f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n")
    return head.encode() + (b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" if body is None else body)


def objs(maker):
    choose = maker.random.choice
    def put(kind, text, files={}, pipe=None, links={}):
        folder, name = maker.folder(f"obj/{kind}"), maker.word() + ".obj"
        for other, content in files.items():
            maker.write(os.path.join(folder, other), content)
        for other, target in links.items():
            os.symlink(target, os.path.join(folder, other))
        if pipe:
            os.mkfifo(os.path.join(folder, pipe))
        maker.file(f"obj/{kind}", "mesh", name, text)
    for kind, target in {**maker.outside(), "bait": "../../bait/bait.mtl"}.items():
        put(f"mtllib_{kind}", obj(f"mtllib {target}\n", textured=True))
        name = maker.word() + ".mtl"
        texture = target.replace(".mtl", ".png")
        put(f"{choose(('map_Kd', 'map_Ka', 'map_d'))}_{kind}" if kind not in ("bait", "zero") else f"map_Kd_{kind}", obj(f"mtllib {name}\n", textured=True),
            {name: f"newmtl m\nKd 1 1 1\nmap_Kd {texture}\n"})
    for kind in views.PATHS:  # of materials, and of a texture, in another folder than that of the list of cameras
        put(f"mtllib_path_{kind}", obj(f"mtllib {views.path_that(maker, kind, 'a', '.mtl')}\n".replace("\n\n", "\n"), textured=True), {"a.mtl": "newmtl m\nKd 1 0 0\n"})
        put(f"map_Kd_path_{kind}", obj("mtllib a.mtl\n", textured=True), {"a.mtl": f"newmtl m\nmap_Kd {views.path_that(maker, kind, 'a')}\n"})
    put("mtllib_pipe", obj("mtllib pipe\n", textured=True), pipe="pipe")
    put("mtllib_folder", obj("mtllib .\n", textured=True))
    put("mtllib_link", obj("mtllib a.mtl\n", textured=True), links={"a.mtl": "/dev/zero"})
    put("map_Kd_pipe", obj("mtllib a.mtl\n", textured=True), {"a.mtl": "newmtl m\nmap_Kd pipe.png\n"}, pipe="pipe.png")
    put("map_Kd_link", obj("mtllib a.mtl\n", textured=True), {"a.mtl": "newmtl m\nmap_Kd x.png\n"}, links={"x.png": choose(("/dev/zero", "/etc/passwd", "../../bait/bait.png"))})
    put("map_Kd_escape", obj("mtllib a.mtl\n", textured=True), {"a.mtl": f"newmtl m\nmap_Kd {maker.escape().strip()}x.png\n"})
    put("mtllib_escape", obj(f"mtllib {maker.escape().strip()}\n", textured=True))
    put("mtl_junk", obj("mtllib a.mtl\n", textured=True), {"a.mtl": bytes(maker.random.randrange(256) for _ in range(4000))})
    put("index_beyond", obj(faces=[[1, 2, choose((5, 1000, 2**31 - 1, 2**31, 2**32 + 1, 10**30))]]))
    put("index_negative", obj(faces=[[1, 2, choose((-5, -2**31, 0))]]))
    put("nan", obj(vertices=[(0, 0, 0), (float("nan"), 0, 0), (0, 1, 0), (0, 0, float("inf"))]))
    put("huge", obj(vertices=[(0, 0, 0), (1e38, 0, 0), (0, -3e38, 0), (0, 0, 1)]))
    put("flat", obj(vertices=[(0, 0, 0)] * 4))
    put("no_faces", obj(faces=[[]]))
    put("long_line", "v " + "1" * maker.random.randint(2_000_000, 5_000_000) + "\n" + obj())
    put("wide_face", obj(faces=[[1 + i % 4 for i in range(maker.random.randint(100_000, 300_000))]]))
    put("cut", obj(textured=True)[:maker.random.randint(1, 120)])
    put("zero_bytes", b"\0" * maker.random.randint(1, 50_000))
    n = choose((2_000, 9_999, 10_001, 100_000))
    put("concave", obj(vertices=[(i, i % 2, 0) for i in range(n)], faces=[list(range(1, n + 1))]))
    name = maker.word() + ".mtl"
    put("map_Kd_options", obj(f"mtllib {name}\n", textured=True), {name: f"newmtl m\nmap_Kd -s {choose(('', 'nan', '1e999', '1 2 3 4'))} -o {maker.escape().strip()} -mm {choose(('1', '0 1', 'x'))} -clamp\n"})
    put("colours", "".join("v 0 %d 0 %s 0 0\n" % (i, choose(("nan", "1e30", "-1", "255"))) for i in range(4)) + "f 1 2 3\n")
    put("many_objects", "".join(f"o a{i}\nv 0 0 {i}\nf -1 -1 -1\n" for i in range(maker.random.randint(20_000, 40_000))))


def plys(maker):
    choose = maker.random.choice
    put = lambda kind, data: maker.file(f"ply/{kind}", "mesh", maker.word() + ".ply", data)
    sound = ply()
    put("cut_header", sound[:maker.random.randint(25, sound.index(b"end_header"))])
    put("cut_body", sound[:sound.index(b"end_header\n") + 11 + maker.random.randint(0, 15)])
    for i, text in enumerate((b"ply", b"ply\n", b"ply\nformat ascii 1.0\n", b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n")):
        put(f"min{i}", text)
    put("huge_vertices", ply(vertices=choose((2**31 - 1, 2**32 - 1, 2**62, 2**64, 10**30))))
    put("huge_faces", ply(faces=choose((2**31 - 1, 2**32 - 1, 2**62, 2**64))))
    put("negative_vertices", ply(vertices=-maker.random.randint(1, 2**31)))
    put("index_beyond", ply(body=b"0 0 0\n1 0 0\n0 1 0\n3 0 1 %d\n" % choose((3, 1000, 2**31 - 1, -1, -2**31))))
    put("huge_list", ply(body=b"0 0 0\n1 0 0\n0 1 0\n255 0 1 2\n"))
    binary = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    put("binary_index", ply(ending="binary_little_endian", body=binary + struct.pack("<B3i", 3, 0, 1, choose((3, 2**31 - 1, -1)))))
    put("binary_list", ply(ending="binary_little_endian", body=binary + struct.pack("<B3i", 255, 0, 1, 2)))
    put("binary_cut", ply(ending="binary_little_endian", body=binary[:maker.random.randint(0, 35)]))
    put("binary_huge", ply(vertices=2**maker.random.randint(31, 40), ending="binary_big_endian", body=binary))
    put("misspelt", sound.replace(b"element", b"elemant", 1))
    put("junk", sound[:60] + bytes(maker.random.randrange(256) for _ in range(80)) + sound[60:])
    put("escape", ply(extra=f"comment {maker.escape()}\nproperty {maker.escape()} a\n"))
    put("nan", ply(body=b"nan 0 0\n1 inf 0\n0 1 0\n3 0 1 2\n"))
    put("many_properties", ply(extra="".join(f"property float p{i}\n" for i in range(maker.random.randint(20_000, 50_000)))))
    put("texture", ply(extra=f"comment TextureFile {choose(('../../bait/bait.png', '/dev/zero', '/etc/passwd'))}\n"))


def stls(maker):
    put = lambda kind, data: maker.file(f"stl/{kind}", "mesh", maker.word() + ".stl", data)
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    put("huge_count", b"\0" * 80 + struct.pack("<I", maker.random.choice((2**32 - 1, 2**31, 85_899_346))) + triangle)
    put("cut", b"\0" * 80 + struct.pack("<I", 3) + triangle * 2)
    put("min", b"\0" * maker.random.randint(1, 83))
    put("nan", b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12fH", *[float("nan")] * 12, 0))
    put("text_cut", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0"[:maker.random.randint(8, 60)])
    put("text_junk", b"solid " + maker.escape().encode() + b"\nfacet normal " + b"9" * maker.random.randint(1000, 1_000_000))


def gltf_of(change=None, buffer=None, texture=None):
    data = struct.pack("<9f3H2x", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode() if buffer is None else buffer
    out = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
           "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}], "buffers": [{"uri": uri, "byteLength": 44}],
           "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
           "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
                         {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}]}
    if texture is not None:
        out["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 0
        out["meshes"][0]["primitives"][0]["material"] = 0
        out.update(images=[{"uri": texture}], textures=[{"source": 0}], materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])
    if change:
        change(out)
    return out


def sparse(count, **fields):
    return {"count": count, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}, **fields}


def gltfs(maker):
    choose, number = maker.random.choice, maker.random.randint
    def put(kind, change=None, pipe=None, text=None, **given):
        maker.file(f"gltf/{kind}", "mesh", maker.word() + ".gltf", text if text is not None else json.dumps(gltf_of(change, **given)))
        if pipe:
            os.mkfifo(os.path.join(maker.out, "gltf", kind, pipe))
    field = lambda where, index, **values: lambda g: g[where][index].update(values)
    depth = number(20_000, 60_000)
    put("deep", lambda g: g.update(nodes=[{"children": [i + 1]} for i in range(depth)] + [{"mesh": 0}]))
    put("json_deep", text='{"asset":{"version":"2.0"},"extras":' + "[" * depth + "]" * depth + "}")
    levels = number(25, 40)
    put("dag", lambda g: g.update(nodes=[{"children": [i + 1] * number(2, 3)} for i in range(levels)] + [{"mesh": 0}]))
    put("cycle", lambda g: g.update(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}]))
    put("self_cycle", field("nodes", 0, children=[0]))
    put("sparse_no_indices", field("accessors", 0, sparse={"count": number(1, 9)}))
    put("sparse_count", field("accessors", 0, sparse=sparse(choose((1000, 2**31 - 1, 2**32 - 1)))))
    put("sparse_index", field("accessors", 0, count=2, sparse=sparse(3)))
    put("sparse_view", field("accessors", 0, sparse=sparse(1, values={"bufferView": number(2, 99)})))
    put("view_beyond", field("bufferViews", 0, byteLength=number(45, 2**31)))
    put("view_offset", field("bufferViews", 0, byteOffset=choose((-number(1, 10**6), 2**31 - 1, 2**40, 40))))
    put("view_missing", field("accessors", 0, bufferView=choose((2, 99, -1, 2**31))))
    put("accessor_beyond", field("accessors", 0, byteOffset=choose((number(1, 10**7), 2**32, 2**63 - 1))))
    put("accessor_count", field("accessors", 0, count=choose((2**31, 2**32 - 1, 5 * 10**8, 4))))
    put("accessor_alone", lambda g: (g["accessors"][0].pop("bufferView"), g["accessors"][0].update(count=choose((2**31, 2**32 - 1, 5 * 10**8)))))
    put("accessor_type", field("accessors", 0, type=choose(("junk", maker.escape(), "MAT4"))))
    put("component_type", field("accessors", 0, componentType=choose((0, 5130, -1, 2**31))))
    put("index_beyond", field("accessors", 1, byteOffset=choose((2, 4))))
    put("stride", field("bufferViews", 0, byteStride=choose((1, 2**31 - 1, -12, 252))))
    put("buffer_missing", field("bufferViews", 0, buffer=choose((1, 99, -1))))
    put("buffer_length", field("buffers", 0, byteLength=choose((2**31, 2**40, -1, 2**63 - 1))))
    put("mesh_missing", field("nodes", 0, mesh=choose((1, 99, -1))))
    put("nan_matrix", field("nodes", 0, matrix=[float("nan")] * 16))
    put("huge_scale", field("nodes", 0, scale=[1e38, 1e38, 1e38]))
    put("zero_scale", field("nodes", 0, scale=[0, 0, 0]))
    put("kinds", lambda g: g.update({choose(("nodes", "meshes", "accessors", "bufferViews")): choose((1, "x", {"a": []}, [1, "x", None]))}))
    put("mode", lambda g: g["meshes"][0]["primitives"][0].update(mode=choose((7, -1, 2**31))))
    put("many_meshes", lambda g: g.update(nodes=[{"mesh": 0}] * 20_000, scenes=[{"nodes": list(range(20_000))}]))
    for kind, target in {**maker.outside(), "bait": "../../bait/bait.bin", "http": "https://example.invalid/x.bin", "file": "file:///etc/passwd"}.items():
        put(f"buffer_{kind}", buffer=target)
        put(f"texture_{kind}", texture=target.replace(".bin", ".png"))
    for kind in views.PATHS:
        put(f"buffer_path_{kind}", buffer=views.path_that(maker, kind, "a", ".bin"))
        put(f"texture_path_{kind}", texture=views.path_that(maker, kind, "a"))
    put("buffer_escape", buffer=maker.escape() + ".bin")
    put("texture_escape", texture=maker.escape() + ".png")
    put("buffer_percent", buffer="%2e%2e/%2e%2e/bait/bait.bin")
    put("buffer_pipe", buffer="pipe", pipe="pipe")
    put("texture_pipe", texture="pipe.png", pipe="pipe.png")
    put("data_junk", buffer="data:application/octet-stream;base64," + choose(("!!!!", "A" * 3, "AAAA" * 100_000)))
    put("data_no_comma", buffer="data:application/octet-stream;base64")
    put("data_texture", texture="data:image/png;base64," + base64.b64encode(b"\x89PNG\r\n\x1a\n" + b"\0" * 40).decode())
    put("data_texture_huge", texture="data:image/png;base64," + base64.b64encode(png_claim(65535, 4096)).decode())
    put("cut", text=json.dumps(gltf_of())[:number(1, 400)])
    put("percent_zero", buffer="data%00.bin")
    put("percent_out", texture="%2e%2e%2f%2e%2e%2fbait%2fbait.png")
    put("percent_junk", texture="%zz%" + maker.escape() + "%2")
    primitive = lambda g: g["meshes"][0]["primitives"][0]
    put("required", lambda g: g.update(extensionsRequired=[choose(("KHR_texture_basisu", "ACME_" + maker.escape(), 7, None))]))
    def packed(g, **values):
        g["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0, "byteOffset": 0, "byteLength": 36, "byteStride": 12, "count": 3,
                                                                         "mode": "ATTRIBUTES", **values}}
    put("meshopt_junk", packed)
    put("meshopt_count", lambda g: packed(g, count=choose((2**31, 2**40, 2**53, 2000)), byteStride=choose((4, 256))))
    put("meshopt_stride", lambda g: packed(g, byteStride=choose((0, 3, 260, 2**32, -4))))
    put("meshopt_mode", lambda g: packed(g, mode=choose(("TRIANGLES", "INDICES", maker.escape())), byteStride=choose((2, 4)), filter=choose(("NONE", "QUATERNION", "x"))))
    def draco(g):
        primitive(g)["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": choose((0, 1, 99)), "attributes": {"POSITION": choose((0, 2**32, -1))}}}
    put("draco_junk", draco)
    put("draco_head", draco, buffer="data:;base64," + base64.b64encode(b"DRACO\x02\x02\x01\x01\0\0" + bytes(maker.random.randrange(256) for _ in range(60))).decode())
    def skin(g, **values):
        g["nodes"][0]["skin"] = 0
        primitive(g)["attributes"].update(JOINTS_0=choose((0, 1, 99)), WEIGHTS_0=choose((0, 1)))
        g["skins"] = [{"joints": [choose((0, 99, -1))] * choose((1, 100_000)), **values}]
    put("skin", skin)
    put("skin_bind", lambda g: skin(g, inverseBindMatrices=choose((0, 1, 99))))
    put("morph", lambda g: (primitive(g).update(targets=[{"POSITION": choose((0, 1, 99))}] * choose((1, 20_000))), g["meshes"][0].update(weights=[choose((1, 1e308))] * 5)))
    def instances(g, count):
        g["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3"})
        g["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "SCALE": choose((0, 1, 2))}}}
    put("instances", lambda g: instances(g, choose((2**31, 10**7, 3, 0))))
    def textured(g, **info):
        g["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update(info)
    put("uv_set", lambda g: textured(g, texCoord=choose((2**31, 2**53, -1, 1))), texture="x.png")
    put("uv_transform", lambda g: textured(g, extensions={"KHR_texture_transform": {"scale": [1e308, choose((-1e308, float("nan")))], "rotation": choose((1e300, "x"))}}), texture="x.png")
    put("texture_source", lambda g: g.update(textures=[{"extensions": {choose(("EXT_texture_webp", "KHR_texture_basisu")): {"source": choose((0, 9))}}}]), texture="x.png")
    maker.file("gltf/no_utf8", "mesh", maker.word() + ".gltf", json.dumps(gltf_of()).encode().replace(b'"version"', b'"ver\xff\xfe"'))

    def glb(kind, text, *, total=None, length=None, chunk=b"", version=2):
        text += b" " * (-len(text) % 4)
        body = struct.pack("<II", len(text) if length is None else length, 0x4E4F534A) + text + chunk
        maker.file(f"glb/{kind}", "mesh", maker.word() + ".glb", struct.pack("<4sII", b"glTF", version, 12 + len(body) if total is None else total) + body)
    text = json.dumps(gltf_of()).encode()
    glb("json_length", text, length=choose((2**32 - 1, 2**31, len(text) + 1000, 0)))
    glb("total_length", text, total=choose((2**32 - 1, 0, 12)))
    glb("cut", text[:number(0, len(text))])
    glb("chunk_length", text, chunk=struct.pack("<II", choose((2**32 - 1, 2**31 - 1)), 0x004E4942) + b"\0" * 8)
    glb("version", text, version=choose((0, 1, 2**32 - 1)))
    glb("nested", b'{"asset":' + b"[" * depth + b"]" * depth + b"}")


def png_claim(width, height):
    import pictures
    return pictures.png(width, height, b"", depth=16, colour=6)


def others(maker):
    """Formats that are not read, some of which broke their reader."""
    put = lambda name, data: maker.file(f"unsupported/{name.replace('.', '_')}", "mesh", name, data)
    put("a.off", f"OFF\n3 {maker.random.choice((1, 2**32 - 1))} 0\n0 0 0\n1 0 1 0\n0 1 0\n3 0 1 {maker.random.choice((2, 99))}\n")
    put("a.ase", "*3DSMAX_ASCIIEXPORT 200\n*GEOMOBJECT {\n*MESH {\n*MESH_NUMVERTEX 3\n*MESH_NUMFACES 1\n*MESH_FACE_LIST {\n*MESH_FACE 0: A: %d B: 1 C: 2\n}\n}\n}\n" % maker.random.choice((99, -1)))
    put("a.md5mesh", "MD5Version 10\nnumJoints 1\nnumMeshes 1\nmesh {\nnumverts 3\nvert 0 ( 0 0 ) 0 1\nnumtris 1\ntri 0 0 1 %d\nnumweights 1\n}\n" % maker.random.choice((99, 2**31)))
    for name, head in (("a.dae", b"<?xml version=\"1.0\"?><COLLADA>"), ("a.fbx", b"Kaydara FBX Binary  \0\x1a\0"), ("a.3ds", b"MM\xff\xff\xff\xff"), ("a.blend", b"BLENDER-v300"),
                       ("a.x", b"xof 0303txt 0032\n"), ("a.ply2", b"ply"), ("a", b"v 0 0 0\n")):
        put(name, head + bytes(maker.random.randrange(256) for _ in range(200)))
    folder = maker.folder("unsupported/a_3mf")
    path = os.path.join(folder, "a.3mf")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("[Content_Types].xml", "<Types/>")
        z.writestr("3D/3dmodel.model", "<model><resources><object id='1'><mesh><vertices>" + "<vertex x='0' y='0' z='0'/>" * maker.random.randint(200_000, 400_000) + "</vertices>")
    maker.add("unsupported/a_3mf", "mesh", path)


def make(maker):
    objs(maker)
    plys(maker)
    stls(maker)
    gltfs(maker)
    others(maker)

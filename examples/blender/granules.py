"""A bed in Blender: the frames that `bed N FILE` wrote as one object of smooth spheres, which follows Blender's frames.

    import granules
    bed = granules.Bed("out/bed.vtp.series")     # the list of times that stands beside the files
    bed.show()                                   # an object "bed"; it changes with the frame, in renders too

Blender 3.4 or newer. The spheres are points with a radius: Cycles draws them exactly, blurs them by `velocity`, and a million takes
some 50 MB. Each point has the attributes radius, velocity, id, state and tint (0 to 1, its own for as long as it lives).

    bed.show(granules.stones())                  # copies of some stones in place of spheres, turned as the granules are

The files then need the word `spin`. Each granule is the same stone in each frame. Any object with a radius of 1 serves as a stone.
"""
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from solidcull_runs import orientations, vtp  # noqa: E402


class Bed:
    """Files and their times. Between two of them granules go on as they moved, along the cubic that their velocities give."""

    def __init__(self, listed, name="bed", speed=1.0):
        """speed: seconds of the deck in a second of film."""
        self.frames, self.name, self.speed = vtp.frames(listed), name, speed
        self.times = np.array([time for time, _ in self.frames])
        self.kept = {}  # the two files around the present frame
        self.turned, self.turned_to, self.quaternions = None, -1, None  # the orientations in the file of that number

    def read(self, k):
        if k not in self.kept:
            self.kept = {j: bed for j, bed in self.kept.items() if abs(j - k) < 2}
            self.kept[k] = vtp.read(self.frames[k][1])
        return self.kept[k]

    def turned_in(self, k):
        """The quaternions w x y z of the granules in file k. It reads the files before."""
        if k < self.turned_to or self.turned is None:
            self.turned, self.turned_to = orientations.Orientations(), -1
        while self.turned_to < k:
            self.turned_to += 1
            self.quaternions = self.turned.follow(self.read(self.turned_to))
        return self.quaternions

    def orientations_at(self, time):
        """Of the granules that at(time) gives: quaternions w x y z."""
        k, span, s = self.moment(time)
        turned = self.turned_in(k)
        if s == 0:
            return turned
        bed, later = self.read(k), self.read(k + 1)
        spin = bed["w"].astype(float)
        _, a, b = np.intersect1d(bed["id"], later["id"], assume_unique=True, return_indices=True)
        spin[a] += s / 2 * (later["w"][b] - bed["w"][a])  # the mean since the file
        return orientations.times(orientations.by_vectors(spin * s * span), turned)

    def moment(self, time):
        """The file at or before a time, the time to the next one, and the share of it that has passed."""
        k = int(np.clip(np.searchsorted(self.times, time + 1e-9) - 1, 0, len(self.times) - 1))
        span = self.times[k + 1] - self.times[k] if k + 1 < len(self.times) else 0
        since = time - self.times[k]
        return k, span, 0 if span <= 0 or since < 1e-6 * span else since / span

    def time_of(self, frame):
        """Of a frame of Blender (s); the first one is frame 1."""
        render = bpy.context.scene.render
        return self.times[0] + (frame - 1) * render.fps_base / render.fps * self.speed

    def last_frame(self):
        render = bpy.context.scene.render
        return 1 + int((self.times[-1] - self.times[0]) / self.speed * render.fps / render.fps_base + 1e-6)

    def at(self, time):
        """The granules at a time (s)."""
        k, span, s = self.moment(time)
        bed = self.read(k)
        if s == 0:
            return bed
        later = self.read(k + 1)
        _, a, b = np.intersect1d(bed["id"], later["id"], assume_unique=True, return_indices=True)
        points, v = bed["points"] + (time - self.times[k]) * bed["v"], bed["v"].copy()
        p, q, u, w = bed["points"][a], later["points"][b], span * bed["v"][a], span * later["v"][b]
        near = np.abs(q - p).max(axis=1, initial=0) <= 2 * span * np.linalg.norm(bed["v"], axis=1).max(initial=0) + 1e-3  # not through a periodic side
        points[a[near]] = ((2 * s**3 - 3 * s**2 + 1) * p + (s**3 - 2 * s**2 + s) * u + (3 * s**2 - 2 * s**3) * q + (s**3 - s**2) * w)[near]
        v[a] = (1 - s) * bed["v"][a] + s * later["v"][b]
        return {**bed, "points": points, "v": v}

    def show(self, stones=None):
        """The object, as it is at the present frame. stones: a collection whose objects stand in place of spheres."""
        self.stones = stones
        self.object = bpy.data.objects.new(self.name, bpy.data.meshes.new(self.name))
        bpy.context.collection.objects.link(self.object)
        self.object.modifiers.new("spheres", "NODES").node_group = stone_nodes(stones) if stones else sphere_nodes()
        self.update(bpy.context.scene)
        bpy.app.handlers.frame_change_pre.append(self.update)
        return self.object

    def update(self, scene, _=None):
        time = self.time_of(scene.frame_current)
        bed = self.at(time)
        mesh, n = self.object.data, len(bed["id"])
        mesh.clear_geometry()
        mesh.vertices.add(n)
        mesh.vertices.foreach_set("co", bed["points"].astype("f4").ravel())
        tint = (bed["id"].astype("u4") * np.uint32(2654435761) >> np.uint32(8)) / 2.0**24
        put(mesh, "radius", "FLOAT", bed["radius"])
        put(mesh, "velocity", "FLOAT_VECTOR", bed["v"] * self.speed)
        put(mesh, "tint", "FLOAT", tint)
        put(mesh, "state", "INT", bed["state"])
        put(mesh, "id", "INT", bed["id"])
        if self.stones:
            put(mesh, "turned", "FLOAT_VECTOR", orientations.angles(self.orientations_at(time)))
            put(mesh, "stone", "INT", (tint * 7919 % 1 * len(self.stones.objects)).astype("i4"))
        mesh.update()


def put(mesh, name, kind, values):
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
    to, number = ("vector", "f4") if kind == "FLOAT_VECTOR" else ("value", "i4" if kind == "INT" else "f4")
    attribute.data.foreach_set(to, np.ascontiguousarray(values, number).ravel())


def new_group():
    """A group of geometry nodes, its first and its last node."""
    group = bpy.data.node_groups.new("granules", "GeometryNodeTree")
    group.inputs.new("NodeSocketGeometry", "Geometry")
    group.outputs.new("NodeSocketGeometry", "Geometry")
    return group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")


def named(group, name, kind):
    """The values of an attribute of points."""
    node = group.nodes.new("GeometryNodeInputNamedAttribute")
    node.data_type = kind
    node.inputs["Name"].default_value = name
    return next(o for o in node.outputs if o.enabled and o.name == "Attribute")


def sphere_nodes():
    """Vertices become points of their own radius, with the material "granule"."""
    group, start, end = new_group()
    points, paint = (group.nodes.new(f"GeometryNode{kind}") for kind in ("MeshToPoints", "SetMaterial"))
    paint.inputs["Material"].default_value = material()
    for come, go in ((start.outputs[0], points.inputs["Mesh"]), (named(group, "radius", "FLOAT"), points.inputs["Radius"]),
                     (points.outputs[0], paint.inputs["Geometry"]), (paint.outputs[0], end.inputs[0])):
        group.links.new(come, go)
    return group


def stone_nodes(stones):
    """Vertices become copies of stones: each granule always of the same one, of its radius, turned as it is."""
    group, start, end = new_group()
    which, copies = (group.nodes.new(f"GeometryNode{kind}") for kind in ("CollectionInfo", "InstanceOnPoints"))
    which.inputs["Collection"].default_value = stones
    which.inputs["Separate Children"].default_value = which.inputs["Reset Children"].default_value = True
    copies.inputs["Pick Instance"].default_value = True
    for come, go in ((start.outputs[0], copies.inputs["Points"]), (which.outputs[0], copies.inputs["Instance"]),
                     (named(group, "stone", "INT"), copies.inputs["Instance Index"]),
                     (named(group, "turned", "FLOAT_VECTOR"), copies.inputs["Rotation"]),
                     (named(group, "radius", "FLOAT"), copies.inputs["Scale"]), (copies.outputs[0], end.inputs[0])):
        group.links.new(come, go)
    return group


def stones(kinds=8, fineness=4, name="stones"):
    """A collection of rough stones with a radius of 1 or somewhat more or less, as no two of sand or gravel are alike."""
    made = bpy.data.collections.new(name)
    rng = np.random.default_rng(1)
    for k in range(kinds):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=fineness, radius=1)
        stone = bpy.context.object
        stone.name = f"{name} {k}"
        for collection in stone.users_collection:
            collection.objects.unlink(stone)
        made.objects.link(stone)
        way = np.empty(3 * len(stone.data.vertices), "f4")
        stone.data.vertices.foreach_get("co", way)
        way = way.reshape(-1, 3)
        faces = rng.normal(size=(14, 3))  # cut by planes, as broken stone is, with somewhat worn edges
        faces /= np.linalg.norm(faces, axis=1, keepdims=True)
        far = rng.uniform(0.82, 1.05, len(faces))
        cut = far / np.maximum(way @ faces.T, 1e-3)
        radius = -np.log(np.exp(-14 * cut).sum(axis=1) + np.exp(-14 * 1.08)) / 14
        stone.data.vertices.foreach_set("co", (way * radius[:, None]).astype("f4").ravel())
        stone.data.polygons.foreach_set("use_smooth", np.ones(len(stone.data.polygons), bool))
        stone.data.materials.append(material("stone", tint_of="INSTANCER"))
    return made


def material(name="granule", colours=((0.50, 0.27, 0.12), (0.80, 0.56, 0.30), (0.93, 0.80, 0.60), (0.30, 0.17, 0.10)), tint_of="GEOMETRY"):
    """Each granule has a colour of its own between these."""
    made = bpy.data.materials.get(name)
    if made:
        return made
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    tint, ramp, surface = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeValToRGB"), nodes["Principled BSDF"]
    tint.attribute_name, tint.attribute_type = "tint", tint_of
    ends = ramp.color_ramp.elements
    for k, colour in enumerate(colours):
        end = ends[k] if k < 2 else ends.new(1)
        end.color = (*colour, 1)
    for k, end in enumerate(ends):
        end.position = k / (len(ends) - 1)
    links.new(tint.outputs["Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], surface.inputs["Base Color"])
    surface.inputs["Roughness"].default_value = 0.55
    surface.inputs["Specular"].default_value = 0.35
    return made

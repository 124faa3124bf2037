"""A bed in Blender: the frames that `bed N FILE` wrote as one object of smooth spheres, which follows Blender's frames.

    import granules
    bed = granules.Bed("out/bed.vtp.series")     # the list of times that stands beside the files
    bed.show()                                   # an object "bed"; it changes with the frame, in renders too

Blender 3.4 or newer. The spheres are points with a radius: Cycles draws them exactly, blurs them by `velocity`, and a million takes
some 50 MB. Each point has the attributes radius, velocity, id, state and tint (0 to 1, its own for as long as it lives).
"""
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from solidcull_runs import vtp  # noqa: E402


class Bed:
    """Files and their times. Between two of them granules go on as they moved, along the cubic that their velocities give."""

    def __init__(self, listed, name="bed", speed=1.0):
        """speed: seconds of the deck in a second of film."""
        self.frames, self.name, self.speed = vtp.frames(listed), name, speed
        self.times = np.array([time for time, _ in self.frames])
        self.kept = {}  # the two files around the present frame

    def read(self, k):
        if k not in self.kept:
            self.kept = {j: bed for j, bed in self.kept.items() if abs(j - k) < 2}
            self.kept[k] = vtp.read(self.frames[k][1])
        return self.kept[k]

    def time_of(self, frame):
        """Of a frame of Blender (s); the first one is frame 1."""
        render = bpy.context.scene.render
        return self.times[0] + (frame - 1) * render.fps_base / render.fps * self.speed

    def last_frame(self):
        render = bpy.context.scene.render
        return 1 + int((self.times[-1] - self.times[0]) / self.speed * render.fps / render.fps_base + 1e-6)

    def at(self, time):
        """The granules at a time (s)."""
        k = int(np.clip(np.searchsorted(self.times, time + 1e-9) - 1, 0, len(self.times) - 1))
        bed = self.read(k)
        span = self.times[k + 1] - self.times[k] if k + 1 < len(self.times) else 0
        if span <= 0 or time - self.times[k] < 1e-6 * span:
            return bed
        later, s = self.read(k + 1), (time - self.times[k]) / span
        _, a, b = np.intersect1d(bed["id"], later["id"], assume_unique=True, return_indices=True)
        points, v = bed["points"] + (time - self.times[k]) * bed["v"], bed["v"].copy()
        p, q, u, w = bed["points"][a], later["points"][b], span * bed["v"][a], span * later["v"][b]
        near = np.abs(q - p).max(axis=1, initial=0) <= 2 * span * np.linalg.norm(bed["v"], axis=1).max(initial=0) + 1e-3  # not through a periodic side
        points[a[near]] = ((2 * s**3 - 3 * s**2 + 1) * p + (s**3 - 2 * s**2 + s) * u + (3 * s**2 - 2 * s**3) * q + (s**3 - s**2) * w)[near]
        v[a] = (1 - s) * bed["v"][a] + s * later["v"][b]
        return {**bed, "points": points, "v": v}

    def show(self):
        """The object, as it is at the present frame."""
        self.object = bpy.data.objects.new(self.name, bpy.data.meshes.new(self.name))
        bpy.context.collection.objects.link(self.object)
        self.object.modifiers.new("spheres", "NODES").node_group = sphere_nodes()
        self.update(bpy.context.scene)
        bpy.app.handlers.frame_change_pre.append(self.update)
        return self.object

    def update(self, scene, _=None):
        bed = self.at(self.time_of(scene.frame_current))
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
        mesh.update()


def put(mesh, name, kind, values):
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
    to, number = ("vector", "f4") if kind == "FLOAT_VECTOR" else ("value", "i4" if kind == "INT" else "f4")
    attribute.data.foreach_set(to, np.ascontiguousarray(values, number).ravel())


def sphere_nodes():
    """Geometry nodes: vertices become points of their own radius, with the material "granule"."""
    group = bpy.data.node_groups.new("granules", "GeometryNodeTree")
    group.inputs.new("NodeSocketGeometry", "Geometry")
    group.outputs.new("NodeSocketGeometry", "Geometry")
    nodes, links = group.nodes, group.links
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    radius, points, paint = (nodes.new(f"GeometryNode{kind}") for kind in ("InputNamedAttribute", "MeshToPoints", "SetMaterial"))
    radius.data_type = "FLOAT"
    radius.inputs["Name"].default_value = "radius"
    paint.inputs["Material"].default_value = material()
    links.new(start.outputs[0], points.inputs["Mesh"])
    links.new(next(o for o in radius.outputs if o.type == "VALUE"), points.inputs["Radius"])
    links.new(points.outputs[0], paint.inputs["Geometry"])
    links.new(paint.outputs[0], end.inputs[0])
    return group


def material(name="granule", colours=((0.50, 0.27, 0.12), (0.80, 0.56, 0.30), (0.93, 0.80, 0.60), (0.30, 0.17, 0.10))):
    """Each granule has a colour of its own between these."""
    made = bpy.data.materials.get(name)
    if made:
        return made
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    tint, ramp, surface = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeValToRGB"), nodes["Principled BSDF"]
    tint.attribute_name = "tint"
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

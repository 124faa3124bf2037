"""A film, or one frame, of a bed on a floor, drawn by Blender's Cycles.

    blender -b -P film.py -- out/bed.vtp.series film/ [--frames 1-64] [--size 960x540] [--samples 48] [--speed 1] [--fps 24]
                             [--look X Y Z] [--from X Y Z] [--turn 0] [--lens 50] [--stones]

Writes film/0001.png, film/0002.png, ... A frame that is there is not drawn again. `--speed`: seconds of the deck in a second of film.
`--turn`: degrees that the camera goes around what it looks at.
"""
import argparse
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Vector

sys.path.insert(0, str(Path(__file__).resolve().parent))
import granules  # noqa: E402
from solidcull_runs import errors  # noqa: E402


def options(words):
    p = argparse.ArgumentParser(prog="film.py")
    p.add_argument("series")
    p.add_argument("folder", type=Path)
    p.add_argument("--frames", default=None, metavar="FIRST-LAST")
    p.add_argument("--size", default="960x540")
    p.add_argument("--samples", type=int, default=48)
    p.add_argument("--speed", type=float, default=1.0)
    p.add_argument("--fps", type=int, default=24)
    p.add_argument("--look", type=float, nargs=3, default=None, help="what the camera looks at (m); somewhat below the middle of the first frame")
    p.add_argument("--from", dest="eye", type=float, nargs=3, default=None, help="where it stands (m)")
    p.add_argument("--turn", type=float, default=0.0)
    p.add_argument("--stones", action="store_true", help="copies of rough stones in place of spheres; the files need the word 'spin'")
    p.add_argument("--lens", type=float, default=50.0, help="mm")
    return p.parse_args(words)


def floor(height, size):
    bpy.ops.mesh.primitive_plane_add(size=size, location=(0, 0, height))
    made = bpy.data.materials.new("floor")
    made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (0.20, 0.205, 0.215, 1)
    surface.inputs["Roughness"].default_value = 0.6
    bpy.context.object.data.materials.append(made)


def light(kind, place, at, strength, size, colour):
    lamp = bpy.data.lights.new(kind, "AREA")
    lamp.energy, lamp.size, lamp.color = strength, size, colour
    lit = bpy.data.objects.new(kind, lamp)
    lit.location = place
    lit.rotation_euler = (Vector(at) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(lit)


def camera(look, eye, lens, turn, frames):
    """It looks at one place, and goes around it by `turn` degrees in all frames."""
    made = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    made.data.lens = lens
    bpy.context.collection.objects.link(made)
    bpy.context.scene.camera = made
    first, last = frames
    for frame in (first, last):
        angle = math.radians(turn) * (frame - first) / max(last - first, 1)
        way = Vector(eye) - Vector(look)
        way.rotate(Euler((0, 0, angle)))
        made.location = Vector(look) + way
        made.rotation_euler = (-way).to_track_quat("-Z", "Y").to_euler()
        made.keyframe_insert("location", frame=frame)
        made.keyframe_insert("rotation_euler", frame=frame)
    for curve in made.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def main(o):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = o.fps
    bed = granules.Bed(o.series, speed=o.speed)
    first, last = (int(n) for n in o.frames.split("-")) if o.frames else (1, bed.last_frame())
    scene.frame_start, scene.frame_end = first, last
    points = bed.read(0)["points"]
    low, high = points.min(axis=0), points.max(axis=0)
    look = o.look or [*((low + high) / 2)[:2], 0.3 * (low + high)[2]]  # what falls comes lower
    reach = float(np.linalg.norm(high - low))
    eye = o.eye or [look[0] + 0.8 * reach, look[1] - 2.7 * reach, look[2] + 1.1 * reach]  # the horizon is above the picture
    bed.show(granules.stones() if o.stones else None)
    floor(0, 60 * reach)
    light("key", [look[0] - 1.9 * reach, look[1] - 0.7 * reach, look[2] + 1.7 * reach], look, 110 * reach**2, 0.5 * reach, (1.0, 0.85, 0.68))
    light("rim", [look[0] + 1.8 * reach, look[1] + 1.8 * reach, look[2] + 1.2 * reach], look, 70 * reach**2, 1.5 * reach, (0.60, 0.77, 1.0))
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.035, 0.042, 0.055, 1)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    scene.world = world
    camera(look, eye, o.lens, o.turn, (first, last))

    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = (int(n) for n in o.size.split("x"))
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.use_adaptive_sampling = o.samples, 5, True
    scene.cycles.use_denoising = False  # Debian's Blender has no denoiser
    render.use_motion_blur, render.motion_blur_shutter = True, 0.4
    render.use_persistent_data = False
    scene.view_settings.view_transform, scene.view_settings.look = "Filmic", "Medium High Contrast"
    render.image_settings.file_format = "PNG"
    o.folder.mkdir(parents=True, exist_ok=True)
    for frame in range(first, last + 1):
        file = o.folder / f"{frame:04d}.png"
        if file.exists():
            continue
        scene.frame_set(frame)
        render.filepath = str(o.folder / ".part.png")
        bpy.ops.render.render(write_still=True)
        (o.folder / ".part.png").rename(file)
        print(f"frame {frame} of {last}: {len(bed.object.data.vertices):,} granules", flush=True)


errors.command("film", lambda: main(options(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else ["-h"])))

"""A plate presses slowly on a culled bed; it taps the bed for the pulse."""
import numpy as np

from solidcull_runs import measures, meshes

deck, bed = "press.in", "../../shared/pour.in"
bed_uses = ("bed_granules", "L", "W", "small", "large", "dt", "pour")
of_both = {"small": 0.0024, "large": 0.0028, "dt": 5e-5, "skin": 0.001, "relax": 500, "rest": 200, "tap": 0, "plate": 0.02, "press": 0.003, "rows": 4}
quick = {**of_both, "granules": 6000, "bed_granules": 6000, "L": 0.125, "W": 0.125, "pour": 0.2, "pressing": 2000, "hold": 1000}
full = {**of_both, "granules": 20000, "bed_granules": 20000, "L": 0.2, "W": 0.2, "pour": 0.25, "pressing": 3000, "hold": 1500, "frames": 300}
scenes = {"slow": {}, "tap": {"press": 0.001, "pressing": 100, "tap": 1}}
aside = "aside"
by_hand = "sphere $(v_L/2) $(v_W/2) ${top} $(0.4*v_L)"
curves = {"force on the plate": "v_force", "floor's centre": "v_p0"}
AROUND = 1e-3                       # s: the profile is a mean over so long before and after the centre's peak
STAYS = 0.03                        # s: what stays is a mean over so long at the end: the bed rings for 20 ms after a tap
HALVES = (0.0075, 0.0175, 0.0325)  # m: half the sides of the floor's squares: the centre, and the rings around it


def square_ring(inner, outer, middle):
    """Triangles of the floor between two squares around the middle (x, y), each (half side in x, half side in y)."""
    (x, y), (a, b), (c, d) = middle, inner, outer
    low = [meshes.grid((x - c, y - d, 0), (2 * c, 0, 0), (0, d - b, 0), 1, 1), meshes.grid((x - c, y + b, 0), (2 * c, 0, 0), (0, d - b, 0), 1, 1)]
    side = [meshes.grid((x - c, y - b, 0), (c - a, 0, 0), (0, 2 * b, 0), 1, 1), meshes.grid((x + a, y - b, 0), (c - a, 0, 0), (0, 2 * b, 0), 1, 1)]
    return [t for part in (*low, *side) for t in part]


def files(folder, v):
    middle, h = (v["L"] / 2, v["W"] / 2), HALVES
    meshes.write_stl(folder / "centre.stl", meshes.grid((middle[0] - h[0], middle[1] - h[0], 0), (2 * h[0], 0, 0), (0, 2 * h[0], 0), 1, 1))
    meshes.write_stl(folder / "ring1.stl", square_ring((h[0],) * 2, (h[1],) * 2, middle))
    meshes.write_stl(folder / "ring2.stl", square_ring((h[1],) * 2, (h[2],) * 2, middle))
    meshes.write_stl(folder / "ring3.stl", square_ring((h[2],) * 2, (v["L"] / 2 + 0.0009, v["W"] / 2 + 0.0009), middle))
    half = v["plate"] / 2
    meshes.write_stl(folder / "plate.stl", meshes.block((-half, -half, 0), (half, half, 0.01)))


def measure(run, v):
    t = measures.time(run)
    force, *p = measures.series(run, "v_force", "v_p0", "v_p1", "v_p2", "v_p3")
    resting = t < (v["rest"] + 0.5) * v["dt"]
    rise = np.array([x - x[resting].mean() for x in p])
    centre, total, began = rise[0], rise.sum(axis=0), t[resting][-1]
    late, at_peak = t >= t[-1] - STAYS, np.abs(t - t[np.argmax(centre)]) <= AROUND
    profile = rise[:, at_peak].mean(axis=1)
    middles = np.array([0, *(np.array(HALVES[:-1]) + HALVES[1:]) / 2, (HALVES[-1] + v["L"] / 2) / 2])
    return {"force on the plate": force.max(), "floor's centre": centre.max(), "floor": total.max(),
            "arrival": t[np.argmax(centre >= centre.max() / 2)] - began, "share of the centre": profile[0] / profile.sum(),
            "width": np.sum(profile * middles) / profile.sum(), "force that stays": force[late].mean(),
            "floor's rise that stays": total[late].mean()}


def laws(values):
    of = values["slow"]
    return [("floor's rise over the force on the plate, held", of["floor's rise that stays"] / of["force that stays"], "1, less what the walls carry")]

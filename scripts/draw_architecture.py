#!/usr/bin/python3
"""Draws fix_solid_cull/architecture.png: the floors of the house, and the way of one granule through them.

    scripts/draw_architecture.py [FILE]
"""
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.patches import Circle, FancyBboxPatch  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
TAN, BLUE, GREEN, GREY, ORANGE, INK = "#d9b98c", "#3f73cc", "#529e52", "#6e6e6e", "#f08c1e", "#222222"

# floor: its classes, from left to right
FLOORS = [
    ("liggghts/", "knows LIGGGHTS", "#f3e3cd", [["FixSolidCull"], ["EngineAtoms", "EngineContacts", "EngineWalls", "EngineInsertions",
                                                               "EngineRanks", "EngineRun", "EngineMemory"]]),
    ("culling/", "decides and acts", "#dfe8f7", [
        ["Culling"],
        ["Look", "Change", "BetweenRuns", "RankTrees", "Balance"],
        ["WallSurvey", "Survey", "Cover", "Pacing", "Grounding", "WakeRequests", "EffectiveGravity"],
        ["Shell", "BodyMotion", "BodyGroups", "MembershipChange", "ContactFreezing", "DeepGranules", "StoreExchange"],
        ["ShellClosure", "Refill", "Handover", "Parcels", "Snapshot", "BodyMeshes", "Report"]]),
    ("solid/", "what is culled", "#dcefdc", [["Solid"], ["SolidBodies", "GranuleStore", "FrozenContacts", "FrozenWallLoads", "Ledger"]]),
    ("packing/", "of spheres", "#eeeeee", [["Sites", "SphereRelaxation"]]),
    ("laws/", "what the user sets", "#eeeeee", [["Scales", "SolidStateLaw", "WakeUpLaw", "CullingBenefit"]]),
    ("containers/", "maps and cells", "#eeeeee", [["FlatMap", "TagIndex", "SphereCells", "PackedRows", "ChunkedArray"]]),
]
# the way of one granule from the engine to the store
WAY = ["Survey", "MembershipChange", "ContactFreezing", "SolidBodies", "DeepGranules", "StoreExchange", "GranuleStore"]
WIDTH, LEFT, ROW, GAP = 15.0, 1.9, 0.62, 0.28


def main():
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "fix_solid_cull" / "architecture.png"
    figure, axes = plt.subplots(figsize=(12, 8.4))
    places, places_width, top = {}, {}, 0.0
    for folder, what, colour, rows in FLOORS:
        if folder == "culling/":
            axes.text(WIDTH / 2 + LEFT / 2, top - 0.17, "ports.h:  Atoms · Contacts · Walls · Insertions · Ranks · Run · Memory", ha="center",
                      va="center", fontsize=10, color=INK, style="italic")
            top -= 0.45
        height = ROW * len(rows) + GAP
        axes.add_patch(FancyBboxPatch((0, top - height), WIDTH, height, boxstyle="round,pad=0,rounding_size=0.12", fc=colour, ec=GREY, lw=1))
        axes.text(0.15, top - height / 2 + 0.12, folder, fontsize=12, weight="bold", va="center", color=INK)
        axes.text(0.15, top - height / 2 - 0.2, what, fontsize=8.5, va="center", color=GREY)
        for r, row in enumerate(rows):
            y = top - GAP / 2 - ROW * (r + 0.5)
            step = (WIDTH - LEFT - 0.2) / max(len(row), 1)
            for k, name in enumerate(row):
                x = LEFT + step * (k + 0.5)
                width = min(step - 0.12, 1.86 if len(row) > 5 else 2.4)
                on_way = name in WAY
                axes.add_patch(FancyBboxPatch((x - width / 2, y - 0.2), width, 0.4, boxstyle="round,pad=0,rounding_size=0.08", fc="white",
                                              ec=ORANGE if on_way else GREY, lw=2 if on_way else 0.8))
                axes.text(x, y, name, ha="center", va="center", fontsize=7.4 if len(name) > 14 else 8.6, color=INK)
                places[name], places_width[name] = (x, y), width
        top -= height + 0.14
    for number, name in enumerate(WAY, 1):
        x, y = places[name]
        axes.add_patch(Circle((x - places_width[name] / 2, y + 0.18), 0.15, fc=ORANGE, ec="white", lw=1, zorder=3))
        axes.text(x - places_width[name] / 2, y + 0.175, str(number), ha="center", va="center", fontsize=8, color="white", weight="bold", zorder=4)
    axes.text(0, top - 0.12, "1 to 7: the way of one granule from LIGGGHTS to the store. Each floor knows those below it, never one above.",
              fontsize=9.5, color=INK, va="center")
    axes.set_xlim(-0.05, WIDTH + 0.05)
    axes.set_ylim(top - 0.4, 0.1)
    axes.axis("off")
    figure.savefig(file, dpi=100, bbox_inches="tight", pad_inches=0.05)
    print(f"wrote {file.name}")


if __name__ == "__main__":
    main()

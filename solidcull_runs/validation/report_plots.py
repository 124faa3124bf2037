"""Plots of the validation report: metrics against time, run time against error, error against tolerance."""
import numpy as np

from ..plots import plt, save
from . import verdicts
from .points import ALSO, BY_HAND, FAMILIES, LIVE, PAPER, SLEEP, UNCULLED

COLOURS = {UNCULLED: "0.35", SLEEP: "tab:blue", LIVE: "tab:orange", PAPER: "tab:red", BY_HAND: "tab:green", ALSO: "tab:purple"}
MARKS = {UNCULLED: "s", SLEEP: "o", LIVE: "^", PAPER: "X", BY_HAND: "D", ALSO: "*"}
LEAST = 1e-3  # margins: below, an error is drawn here


def grid(n, width=3.6, height=2.6, columns=3):
    columns = min(n, columns)
    rows = -(-n // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(width * columns, height * rows), squeeze=False)
    for ax in axes.flat[n:]:
        ax.axis("off")
    return figure, list(axes.flat[:n])


def curves(result, file):
    """Each metric that has a curve against time: culled over the band of the unculled runs. False where there is none."""
    scene = verdicts.main_scene(result)
    unculled = verdicts.unculled_of(scene)
    names = list(next((r["curves"] for r in (unculled or {"runs": []})["runs"] if r.get("curves")), {}))
    if not names:
        return False
    units = {m["name"]: m["unit"] for m in result["metrics"]}
    figure, axes = grid(len(names))
    for ax, name in zip(axes, names):
        runs = [r["curves"][name] for r in unculled["runs"] if r.get("curves")]
        end = min(t[-1] for t, _ in runs)
        t = np.linspace(max(t[0] for t, _ in runs), end, 200)
        band = np.array([np.interp(t, *r) for r in runs])
        ax.fill_between(t, band.min(axis=0), band.max(axis=0), color="0.75", lw=0, label=f"unculled, {len(runs)} runs")
        ax.plot(t, band.mean(axis=0), color="0.35", lw=1)
        for entry in scene["points"].values():
            if entry["default"] and entry["family"] != UNCULLED:
                for k, r in enumerate(r for r in entry["runs"] if r.get("curves")):
                    ax.plot(*r["curves"][name], color=COLOURS[entry["family"]], lw=0.9, label=None if k else entry["family"])
        ax.set(xlabel="time (s)", ylabel=f"{name} ({units[name]})")
    axes[0].legend(fontsize=7)
    save(figure, file)
    return True


def shown(error):
    return max(error, LEAST)


def cost_against_error(ax, result, judged):
    """Time over that of the unculled runs against the largest error, in margins."""
    noise = verdicts.noise_of(result)
    for family in FAMILIES:
        points = sorted((j for j in judged.values() if j.family == family and not j.share), key=lambda j: j.absolute or 0)
        if points:
            ax.plot([j.of_unculled for j in points], [shown(j.error) for j in points], MARKS[family], ls="" if family == ALSO else "-",
                    color=COLOURS[family], ms=6, lw=0.8, label=family)
        relative = [j for j in judged.values() if j.family == family and j.share]
        ax.plot([j.of_unculled for j in relative], [shown(j.error) for j in relative], MARKS[family], color=COLOURS[family], mfc="none", ms=6)
        for j in [*points, *relative]:
            if j.absolute or family == ALSO:
                name = j.name if family == ALSO else f"{j.absolute:g}" + f" {j.share:g}" * bool(j.share)
                ax.annotate(name, (j.of_unculled, shown(j.error)), fontsize=6, xytext=(3, 3), textcoords="offset points")
    ax.plot([1], [shown(noise)], MARKS[UNCULLED], color=COLOURS[UNCULLED], label=UNCULLED)
    ax.axhspan(LEAST / 2, shown(noise), color="0.9", lw=0)
    ax.axhline(1, color="0.5", lw=0.8, ls=":")
    bound = result["bound"] and result["bound"]["N/N_moving"]
    if bound:
        ax.axvline(1 / bound, color="0.5", lw=0.8, ls="--")
    ax.set(xscale="log", yscale="log", xlabel="time over unculled", ylabel="largest error (margins)", ylim=(LEAST / 2, None))
    shares(ax)


def case_plots(result, judged, file):
    """Run time against error, and error against tolerance."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6))
    cost_against_error(left, result, judged)
    left.legend(fontsize=7)
    names = [m["name"] for m in result["metrics"]]
    for family in (SLEEP, LIVE):
        points = sorted((j for j in judged.values() if j.family == family and j.absolute and not j.share), key=lambda j: j.absolute)
        for k, name in enumerate(names):
            right.plot([j.absolute for j in points], [shown(j.verdicts[name].in_margins) for j in points], "o-" if family == SLEEP else "^--",
                       color=f"C{k}", ms=4, lw=0.8, label=f"{name}" if family == SLEEP else None)
    right.axhline(shown(verdicts.noise_of(result)), color="0.5", lw=0.8)
    right.axhline(1, color="0.5", lw=0.8, ls=":")
    right.set(xscale="log", yscale="log", xlabel="tolerance (m g)", ylabel="error (margins)", ylim=(LEAST / 2, None))
    right.legend(fontsize=6)
    save(figure, file)


def shares(ax):
    """Times over the unculled time as plain numbers."""
    ax.set_xticks([0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2], ["0.1", "0.2", "0.3", "0.5", "0.7", "1", "1.5", "2"])
    ax.set_xticks([], minor=True)


def without_overlap(ax, labels):
    """Names beside their points (x, y, text), moved down where they would lie on one another."""
    height, width = 9, 5.2  # of a line and of a letter, in points
    to_points = ax.transData.transform
    scale = 72 / ax.figure.dpi
    placed = []
    for x, y, text in sorted(labels, key=lambda label: -label[1]):
        at = to_points((x, y)) * scale
        low, left, right = at[1], at[0] + 6, at[0] + 6 + width * len(text)
        for other_low, other_left, other_right in placed:  # from above to below
            if left < other_right and other_left < right and abs(other_low - low) < height:
                low = other_low - height
        placed.append((low, left, right))
        placed.sort(reverse=True)
        ax.annotate(text, (x, y), fontsize=7, xytext=(6, low - at[1] - 3), textcoords="offset points",
                    arrowprops={"arrowstyle": "-", "lw": 0.3, "color": "0.6", "shrinkA": 0, "shrinkB": 2})


def all_cases(results, file):
    """Run time against error of all cases: the defaults named, the rest of the sweep small."""
    figure, ax = plt.subplots(figsize=(9, 6))
    labels = []
    for result in results:
        judged = verdicts.judge(result)
        for j in judged.values():
            ax.plot(j.of_unculled, shown(j.error), MARKS[j.family], color=COLOURS[j.family], ms=8 if j.default else 3.5, alpha=1 if j.default else 0.4)
            if j.default and j.family == SLEEP:
                labels.append((j.of_unculled, shown(j.error), result["case"].replace("_", " ")))
    seen = {j.family for result in results for j in verdicts.judge(result).values()}
    for family in FAMILIES:
        if family in seen:
            ax.plot([], [], MARKS[family], color=COLOURS[family], label=family)
    ax.axhline(1, color="0.5", lw=0.8, ls=":")
    ax.axvline(1, color="0.5", lw=0.8, ls=":")
    ax.set(xscale="log", yscale="log", xlabel="time over unculled", ylabel="largest error (margins)", ylim=(LEAST / 3, None))
    ax.set_xlim(right=ax.get_xlim()[1] * 1.3)
    shares(ax)
    without_overlap(ax, labels)
    ax.legend(fontsize=8, loc="lower left")
    save(figure, file)

#!/usr/bin/python3
"""Run time against error of the fix's choices, on the impact of scale.py: what the defaults were chosen by.

    validation/scale/choices.py [--size 20k] [--runs n] [--few-steps]

Runs the bed unculled and with each of CHOICES, every run kept and used again as those of scale.py are, and prints for each its run
time over that of the unculled run and its errors over their margins (the larger of 2 % and the noise floor): 1 is just allowed.
All figures: out/choices.json, table out/choices.txt, plot out/choices.png. Exit: 0, or 2 if a run failed.
"""
import argparse
import json
import statistics

import scale
from solidcull_runs import errors, plots  # scale.py has made them known

CHOICES = {"live": "exterior live", "live, depth 1": "exterior live depth 1", "live, tolerance 1": "exterior live tolerance 1 0",
           "live, tolerance 10": "exterior live tolerance 10 0", "sleep": "exterior sleep",
           "sleep, depth 1": "exterior sleep depth 1", "sleep, tolerance 1": "exterior sleep tolerance 1 0",
           "sleep, tolerance 10": "exterior sleep tolerance 10 0", "sleep, calm 6": "exterior sleep calm 6"}


def file_name(choice):
    return choice.replace(",", "").replace(" ", "-")


def measure(size, settings):
    """Name of a choice: run time over the unculled one, errors over margins, N over mean exterior."""
    unculled, runs = [], {choice: [] for choice in CHOICES}
    for k in range(settings.runs):
        unculled.append(scale.one_run("impact", size, "unculled", k, settings))
        for choice, keywords in CHOICES.items():
            settings.culling = keywords
            runs[choice].append(scale.one_run("impact", size, "culled", k, settings, file_name(choice)))
    report = {}
    for choice, own in runs.items():
        c = scale.compared({"unculled": unculled, "culled": own}, "culled")
        shares = {name: m["error"] / m["margin"] if m["margin"] else 0.0 for name, m in c["metrics"].items()}
        report[choice] = {"keywords": CHOICES[choice], "time": 1 / c["speed_up"], "errors": shares, "largest": max(shares.values()),
                          "mean": statistics.fmean(shares.values()), "over_exterior": c["over_exterior"], "lost": c["lost"]}
    return report


def table(report, size):
    lines = [f"{size}: {'choice':20} {'time':>6} {'N / exterior':>12} {'error / margin, mean':>20} {'largest':>8}  of"]
    for choice, r in sorted(report.items(), key=lambda row: row[1]["time"]):
        worst = max(r["errors"], key=r["errors"].get)
        lines.append(f"{size}: {choice:20} {r['time']:6.3f} {r['over_exterior']:12.1f} {r['mean']:20.2f} {r['largest']:8.2f}  {worst}")
    return "\n".join(lines)


def plot(report, file):
    fig, ax = plots.plt.subplots(figsize=(6.5, 4.5))
    for choice, r in report.items():
        colour = "tab:blue" if choice.startswith("sleep") else "tab:brown"
        ax.plot([r["time"]] * 2, [r["mean"], r["largest"]], "-", color=colour, lw=0.8)
        ax.plot(r["time"], r["mean"], "o", color=colour)
        ax.plot(r["time"], r["largest"], "_", color=colour, ms=10)
        ax.annotate(choice, (r["time"], r["largest"]), xytext=(3, 3), textcoords="offset points", fontsize=7)
    ax.axhline(1, color="0.5", ls="--", lw=0.8)
    ax.set(xlabel="run time over that of the unculled run", ylabel="error over margin: mean (o) and largest (-)")
    ax.grid(alpha=0.3)
    plots.save(fig, file)


def main(argv=None):
    p = argparse.ArgumentParser(prog="choices.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--size", help="a bed of scale.py; default 20k")
    p.add_argument("--runs", type=int, default=1, help="of each choice; three give the noise floor")
    p.add_argument("--few-steps", action="store_true")
    settings = p.parse_args(argv)
    settings.steps, settings.table, settings.reach = None, False, 0.04
    scale.few_steps = settings.few_steps
    if settings.few_steps:
        vars(scale).update(scale.FEW)
        settings.steps = 120
    size = settings.size or ("tiny" if settings.few_steps else "20k")
    if size not in scale.BEDS or not 1 <= settings.runs <= len(scale.SHIFTS):
        p.error(f"sizes are {', '.join(scale.BEDS)}, runs 1 to {len(scale.SHIFTS)}")
    scale.OUT.mkdir(parents=True, exist_ok=True)
    scale.bed(size)
    report = measure(size, settings)
    (scale.OUT / "choices.json").write_text(json.dumps(report, indent=1) + "\n")
    text = table(report, size)
    (scale.OUT / "choices.txt").write_text(text + "\n")
    plot(report, scale.OUT / "choices.png")
    print("\n" + text)
    return 0


if __name__ == "__main__":
    errors.command("choices", main)

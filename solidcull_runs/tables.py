"""Comparisons as text."""
from .comparisons import outside


def percent(part, whole):
    """A share of the whole; the part itself where the whole is nothing beside it."""
    return f"{100 * part / abs(whole):.2f} %" if abs(part) < 100 * abs(whole) else f"{part:.3g}"


def times(s):
    span = f" ({min(s['own_times']):.1f}-{max(s['own_times']):.1f})" if len(s["own_times"]) > 1 else ""
    return f"{s['own_time']:.1f} s{span}"


def table(result):
    """A comparison: granules, times, and each metric's error beside the noise floor."""
    u, c, book = result["unculled"], result["culled"], result["ledger"]
    lines = []
    if book:
        least, most = book["granules_of_runs"]
        lines.append(f"granules            {f'{least:,}' if least == most else f'{least:,} to {most:,}'}; lost {book['lost']:,}, ids missing {book['ids_missing']:,}, "
                     f"mass lost {book['mass_lost']:.3g} of {book['mass']:.4g} kg")
    else:
        lines.append("granules            not checked: a run did not reach the last line of the deck")
    if "exterior" in c:
        lines.append(f"mean while culled   exterior {c['exterior']:,.0f}, interface {c['interface']:,.0f}, "
                     f"interior {c['interior']:,.0f}")
    lines.append(f"loop time           unculled {times(u)}, culled {times(c)}: speed-up {result['speed_up']:.2f}")
    if "seconds" in c:
        share = percent(c["seconds"], c["loop_time"])
        lines.append(f"in the fix          {c['seconds']:.1f} s ({share} of the culled loop time); "
                     f"{c['carves']:,.0f} carves, {c['restored']:,.0f} restored")
    if result["metrics"]:
        lines += ["", *metric_rows(result["metrics"]), ""]
        names = outside(result)
        lines.append(f"OUTSIDE its margin: {', '.join(names)}" if names else "all metrics within their margins")
    if result["no_scatter"]:
        lines.append("the unculled runs are all alike: no granules were moved apart, or it made no difference; name a variable with --vary")
    return "\n".join(lines)


def explained(result):
    """A comparison, and what its columns mean."""
    unculled, culled = (len(result[kind]["own_times"]) for kind in ("unculled", "culled"))
    return "\n".join([
        table(result), "",
        f"error        distance of the mean of the culled runs ({culled}) from that of the unculled runs ({unculled})",
        "noise floor  largest minus smallest value of the unculled runs" + (": one run has none" if unculled == 1 else ""),
        "margin       the larger of a share of the unculled mean (2 % if nothing else is said) and the noise floor",
        "loop time    median; without the time in which others had the processor"])


def metric_rows(metrics):
    width = max(12, *map(len, metrics))
    rows = [f"{'metric':{width}} {'unculled':>12} {'culled':>12} {'error':>10} {'worst run':>10} {'noise floor':>11} "
            f"{'error/floor':>11} {'margin':>9}"]
    for name, m in metrics.items():
        ratio = f"{m['of_spread']:.2f}" if m["of_spread"] is not None else "-"
        floor = percent(m["spread"], m["mean"]) if len(m["unculled"]) > 1 else "-"
        rows.append(f"{name:{width}} {m['mean']:12.6g} {m['culled_mean']:12.6g} {percent(m['error'], m['mean']):>10} "
                    f"{percent(m['worst'], m['mean']):>10} {floor:>11} {ratio:>11} "
                    f"{percent(m['margin'], m['mean']):>9} {'good' if m['good'] else 'OUTSIDE'}")
    return rows


def check_rows(checks):
    """Figures with bars of their own."""
    if not checks:
        return []
    width = max(len(c["what"]) for c in checks)
    return [f"{'check':{width}} {'value':>12} {'bar':>12}"] + [
        f"{c['what']:{width}} {c['value']:12.5g} {c['bar']:12.5g} {'good' if c['good'] else 'OUTSIDE'}" for c in checks]


def print_scene(parts, checks=(), notes=()):
    """Prints all tables of a scene: comparisons by name, checks, notes."""
    for name, result in parts.items():
        print(f"\n{name}\n{table(result)}")
    print("\n".join(["", *check_rows(checks), *notes]))

"""Which pairs of runs a case still lacks for a verdict on each of its metrics."""
from . import sequential, verdicts
from .points import UNCULLED, points


def values_of(case, done, scene, family):
    """Of the default point of a family, by metric and number of the run."""
    runs = {job.k: run for job, run in done.items() if job.scene == scene and job.point.default and job.point.family == family and not isinstance(run, str)}
    return {m.name: {k: run.metrics[m.name] for k, run in runs.items()} for m in case.metrics}


def is_decided(case, unculled, culled):
    """Whether each metric is, of the values of both kinds."""
    for m in case.metrics:
        if len(set(unculled[m.name]) & set(culled[m.name])) < 2:
            return False
        if verdicts.in_looks(unculled[m.name], culled[m.name], m.allowed).word == verdicts.OPEN:
            return False
    return True


def further(case, done):
    """The runs up to the next look: {scene: [(point, number), ...]}, of each mode with a metric that is not decided, beside unculled
    ones; {} where there is no more to be done. `done`: as from run_all(), of the case's jobs so far."""
    defaults = {p.family: p for p in points() if p.default}
    wanted = {}
    for scene in case.scenes:
        tried = {family: {job.k for job in done if job.scene == scene and job.point.default and job.point.family == family} for family in defaults}
        unculled = values_of(case, done, scene, UNCULLED)
        new = []
        for family, point in defaults.items():
            look = sequential.next_look(len(tried[family]))
            if family == UNCULLED or not tried[family] or look is None or is_decided(case, unculled, values_of(case, done, scene, family)):
                continue
            new += [(p, k) for k in range(look) for p in (defaults[UNCULLED], point) if k not in tried[p.family] and (p, k) not in new]
        if new:
            wanted[scene] = sorted(new, key=lambda one: one[1])
    return wanted

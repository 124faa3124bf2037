"""Runs of a case that were made before, on this or another machine, and of which only the result is left. They are not made again as
long as deck, bed, variables, case and fix are the same: each run in a result has a mark of these (CaseJob.mark)."""
from dataclasses import dataclass


@dataclass(frozen=True)
class EarlierRun:
    """Stands for a twins.Run. Its files are gone."""
    data: dict  # as in the result

    @property
    def metrics(self):
        return self.data["values"]


class Earlier:
    """The runs of a result that was kept; none of them if one of `jobs` would be another run today, for fields of the bed are those of
    several runs. `result`: of that case, or None."""

    def __init__(self, result=None, jobs=()):
        self.runs, self.taken = {}, False  # taken: whether one was
        self.fields, self.bound = (result["fields"], result["bound"]) if result else ({}, None)
        for scene, of_scene in result["scenes"].items() if result else ():
            self.runs |= {(scene, point, run["k"]): run for point, entry in of_scene["points"].items() for run in entry["runs"]}
        if any(self.key(job) in self.runs and not self.is_of(job) for job in jobs):
            self.runs = {}

    @staticmethod
    def key(job):
        return job.scene, job.point.name, job.k

    def is_of(self, job):
        return self.runs[self.key(job)].get("mark") == job.mark

    def run_of(self, job):
        """The run of this job; None if it must be made."""
        if self.key(job) not in self.runs or not self.is_of(job):
            return None
        self.taken = True
        return EarlierRun(self.runs[self.key(job)])

    def add_to(self, result):
        """What only files of its runs could tell."""
        if self.taken:
            result["fields"] |= self.fields
            result["bound"] = self.bound or result["bound"]

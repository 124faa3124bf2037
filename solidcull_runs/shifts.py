"""Moves all granules of a deck a little, as soon as there are any: lines for the deck's text.

Where none are there before a run, the run goes in parts until some are: 1, 10, 100, ... steps, an eighth of the run at most. Runs that
are to be compared go in the same parts, whether their granules are moved or not. Granules are moved once. Where `fix insert/stream`
makes them they are moved again and again, for it holds each on its way until it lets it go.
"""
SHIFT = 1e-5  # granule diameters, between two unculled runs
SHORT = 1000  # steps: a run that goes in parts only until granules are there
FOLLOWING = "$(10*v_twin_part*(80*v_twin_part<v_twin_length)+ceil(v_twin_length/8)*(80*v_twin_part>=v_twin_length))"  # part


class Shift:
    """Of one run of a deck. `seed`: None for the one whose granules stay where they are; `lines`: of the deck."""

    def __init__(self, seed, lines):
        self.seed, self.runs = seed, 0
        self.again = any(line.split()[3:4] and line.split()[3].startswith("insert/stream") for line in lines)

    def begin(self):
        """Lines for the place from which granules may be moved."""
        long_enough = f"*(v_twin_length>{SHORT})" if self.again else ""
        return ["variable twin_there equal count(all)>0", "variable twin_waits equal 1", "variable twin_part equal 1", "variable twin_end equal 0",
                "variable twin_length equal 0", f"variable twin_on equal v_twin_waits*((step+v_twin_part)<v_twin_end){long_enough}",
                *(f"variable twin_{axis} atom {axis}+{2 * SHIFT:g}*r*random(-1,1,{self.seed + k})" for k, axis in enumerate("xyz") if self.seed)]

    def move(self, quote='"'):
        """A command that moves the granules if any are there."""
        moves = [f"set group all {axis} v_twin_{axis}" for axis in "xyz" if self.seed]
        no_more = [] if self.again else ["variable twin_there equal 0", "variable twin_waits equal 0"]
        made = moves + no_more or ["variable twin_waits equal 1"]
        return " ".join(["if", f"{quote}${{twin_there}}{quote}", "then", *(f"{quote}{command}{quote}" for command in made)])

    def before(self, w, line):
        """A run (its words, and as the deck says it), and what it needs for that its granules are moved."""
        if "every" in w:
            interrupted = line.split("#")[0].rstrip()
            interrupted = interrupted[:-len("NULL")] if w[-1] == "NULL" else interrupted + " "
            return [self.move(), f'{interrupted}"{self.move(chr(39))}"']
        if " pre no" in " ".join(w):
            return [line]  # it takes the neighbour lists of the run before
        self.runs += 1
        here, rest = f"twin_part_{self.runs}", [word for word in w[2:] if word != "upto"]
        return [f"variable twin_steps string {w[1]}", f"variable twin_end equal $({'' if 'upto' in w else 'step+'}v_twin_steps)",
                "variable twin_length equal $(v_twin_end-step)", "variable twin_part equal 1", f"label {here}", self.move(),
                f'if "${{twin_on}}" then "run ${{twin_part}}" "variable twin_part equal {FOLLOWING}" "jump SELF {here}"',
                " ".join(["run ${twin_end} upto", *rest])]

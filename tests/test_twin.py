"""validation/twin.py and solidcull_runs: decks with and without the fix line, logs, figures, and each refusal by its text."""
import ast
import contextlib
import graphlib
import io
import json
import os
import re
import stat
import subprocess
import sys
import tempfile
import time
import types
import unittest
import zlib
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.dont_write_bytecode = True
sys.path[:0] = [str(ROOT), str(ROOT / "validation")]
import twin  # noqa: E402
from solidcull_runs import beds, comparisons, cutaways, decks, dumps, engine, errors, few_steps, halving, logs, measures, meshes, plots, shifts, tables, twins, vtp  # noqa: E402

DECK = """\
variable dx index 0
read_restart bed.restart
compute top all reduce max z
fix cull all solid/cull &
    every 50   # a comment
variable share equal f_cull/100
variable size index 1
compute mine all reduce sum f_cull
region solid interface/mesh cull
group inner region solid
dump d all custom 100 d.* id x f_cull
thermo_style custom step ke c_top f_cull[1] v_share c_mine
print "share ${share}"
run 1000
unfix cull
thermo_style custom step ke
run 0
"""

LOG = f"""\
LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)
thermo_style custom step ke c_top f_wall[3]
run 0
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
       0              1            0.5             77
Loop time of 7e-07 on 1 procs for 0 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026

Nlocal:    20 ave 20 max 20 min
print "{logs.FROM_HERE}"
{logs.FROM_HERE}
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
       0              1            0.5              8
insertion: proc 0 at 50 %
     100              4            0.7              4
     200              3            0.6              5
Loop time of 2.5 on 1 procs for 200 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
Memory usage per processor = 9.97283 Mbytes
    Step         KinEng            top        wall[3]
     200              3            0.6             10
     300              2            0.4              5
Loop time of 1.5 on 1 procs for 100 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
{logs.TO_HERE}
    Step    Atoms         KinEng
     300       20             99
Loop time of 9 on 1 procs for 0 steps with 20 atoms, finish time Sat Nov 21 04:56:08 2026
"""

# stands in for LIGGGHTS: prints a log that depends on the deck's name and writes what twin asks for
FAKE = """\
#!/usr/bin/python3
import os, re, signal, sys, time
deck = open(sys.argv[sys.argv.index("-in") + 1]).read()
if "read_restart missing" in deck:
    print("ERROR: Cannot open restart file missing (./src/read_restart.cpp:533)")
    sys.exit(1)
if "killed" in deck:
    os.kill(os.getpid(), signal.SIGKILL)
if "forever" in deck:
    if "# fix cull" in deck:
        print("ERROR: the first of two runs fails")
        sys.exit(1)
    open("pid", "w").write(str(os.getpid()))
    time.sleep(600)
culled = re.search(r"(?m)^fix cull", deck) is not None
shift = 0.01 * ("set group all x" in deck)
speed = re.search(r"(?m)^fix cull.* speed (\\S+)", deck)
of_limits = float(speed[1]) / 0.01 if speed else 1
print("twin: counted from here\\n    Step    depth")
print(f"  0  0.5\\n  10  {1 + shift + 0.001 * culled * of_limits}")
print(f"Loop time of {4 if culled else 10} on 1 procs\\ntwin: end of the deck")
if culled:
    file = re.search(r'ave/time.* file "(.*)"', deck)[1]
    open(file, "w").write("# Time-averaged data\\n# TimeStep\\n" + "".join(f"{s} 5 3 12 1 .1 20 8 2 .5 .4 0 0\\n" for s in (10, 20)))
final = re.search(r'write_dump all custom "(.*?)"', deck)[1]
rows = "".join(f"{i} 0.5 0.1 0 0 0\\n" for i in (3, 1, 2)[:2 if culled and "lossy" in deck else 3])
open(final, "w").write("ITEM: TIMESTEP\\n20\\nITEM: ATOMS id mass radius x y z \\n" + rows)
"""


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self, name, text):
        return self.write_bytes(name, text.encode())

    def write_bytes(self, name, content):
        (self.folder / name).write_bytes(content)
        return self.folder / name

    def refused(self, text, call, *args, **keywords):
        with self.assertRaises(errors.RunError) as e:
            call(*args, **keywords)
        self.assertIn(text, str(e.exception))
        self.assertNotIn("\n", str(e.exception))


class Decks(Folder):
    def setUp(self):
        super().setUp()
        self.lines = decks.read_deck(self.write("in.deck", DECK))

    def made(self, culled, seed=None, lines=None):
        lines = lines or self.lines
        return decks.make_deck(lines, "cull", culled, shifts.Shift(seed, lines) if seed else None, "out/run-1")

    def test_the_fix_is_found_over_continued_lines(self):
        self.assertEqual(decks.cull_fix(self.lines), "cull")

    def test_the_fix_is_found_in_an_included_file(self):
        self.write("rest.in", "fix c2 all solid/cull\nrun 10\n")
        self.assertEqual(decks.cull_fix(decks.read_deck(self.write("in.outer", "units si\ninclude rest.in\n"))), "c2")

    def test_unculled_keeps_nothing_that_hangs_on_the_fix(self):
        live = [line for line in self.made(False) if not line.lstrip().startswith("#")]
        for gone in ("f_cull", "share", "mine", "region", "group", "unfix", "twin_counts"):
            self.assertFalse([line for line in live if gone in line], gone)
        self.assertIn("thermo_style custom step ke c_top", live)
        self.assertIn("dump d all custom 100 d.* id x", live)
        self.assertIn("variable size index 1", live)
        self.assertEqual(sum(line.startswith("run") for line in live), 2)

    def test_culled_is_the_deck_and_the_counts(self):
        made = self.made(True)
        self.assertTrue(set(self.lines) <= set(made))
        self.assertEqual(made.index("unfix twin_counts") + 1, made.index("unfix cull"))
        self.assertTrue(made[-1].startswith('write_dump all custom "out/run-1.final"'))

    def test_culled_takes_its_dependents_away_where_the_deck_does_not(self):
        tail = self.made(True, lines=self.lines[:-3])
        tail = tail[tail.index(f'print "{logs.TO_HERE}"'):]
        self.assertEqual(tail[1:-1], ["thermo_style one", "unfix twin_counts", "undump d", "region solid delete",
                                      "uncompute mine", "variable share delete", "unfix cull", "run 0"])

    def test_the_shift_stands_before_the_first_run_behind_the_fix(self):
        made = self.made(False, seed=decks.SEEDS[0])
        run = made.index("run ${twin_end} upto")
        self.assertIn("variable twin_steps string 1000", made[:run])
        self.assertEqual(made[run - 2].count("set group all"), 3)
        self.assertTrue(made[run - 2].endswith('"variable twin_there equal 0" "variable twin_waits equal 0"'))
        self.assertGreater(made.index("variable twin_there equal count(all)>0"), made.index(f'print "{logs.FROM_HERE}"'))

    def test_the_run_that_nothing_is_moved_in_goes_in_the_same_parts(self):
        lines = self.lines[:-3]
        moved, still = (decks.make_deck(lines, "cull", False, shifts.Shift(seed, lines), "out/run-1") for seed in (decks.SEEDS[0], None))
        self.assertFalse([line for line in still if "set group" in line or "random" in line])
        self.assertEqual([line for line in moved if line.startswith(("run", 'if "${twin_on}"'))], [line for line in still if line.startswith(("run", 'if "${twin_on}"'))])

    def test_runs_that_cannot_go_in_parts(self):
        for line, text in (('run 100 every 10 "print a" # all', 'run 100 every 10 "print a" "if \'${twin_there}\' then \'variable'), ("run 100 every 10 NULL", 'run 100 every 10 "if'),
                           ("run 100 pre no", "run 100 pre no")):
            made = shifts.Shift(None, []).before(decks.words_of(line), line)
            self.assertTrue(made[-1].startswith(text), made)

    def test_what_a_stream_holds_is_moved_again(self):
        stream = ["fix ins all insert/stream seed 32452843"]
        for lines, times in ((stream, 0), ([], 1)):
            self.assertEqual(shifts.Shift(decks.SEEDS[0], lines).move().count("twin_there equal 0"), times)

    def test_what_cannot_be_left_out_is_refused(self):
        lines = self.lines[:6] + ['if "${share} > 3" then "run 10"']
        self.refused("hangs on the solid/cull fix and cannot be left out: if", self.made, False, lines=lines)

    def test_what_has_no_meaning_without_the_fix_ends_the_comparison_behind_a_run(self):
        lines = self.lines[:-3] + ["variable inside equal count(inner)", 'print "${inside}"', "delete_atoms region solid", "run 77"]
        number = lines.index("delete_atoms region solid") + 1
        for culled in (False, True):
            made = self.made(culled, lines=lines)
            self.assertEqual(decks.ends_before(made), number)
            self.assertFalse([line for line in made if line.startswith(("delete_atoms", "run 77"))])
            self.assertEqual("variable inside equal count(inner)" in made, culled)
        self.assertIsNone(decks.ends_before(self.made(False)))

    def test_culled_granules_of_a_restart_file_are_taken_up_before_anything_asks_for_them(self):
        lines = ["variable f index a.restart", "read_restart ${f}", "fix cull all solid/cull", "compute top all reduce max z", "label go", "run 10", "jump SELF go"]
        self.assertEqual(decks.restart_of(lines, "cull", {}), "a.restart")
        self.assertEqual(decks.restart_of(lines, "cull", {"f": "b.restart"}), "b.restart")
        self.assertIsNone(decks.restart_of(["fix cull all solid/cull", "read_restart late"], "cull", {}))
        for culled, taken_up in ((False, ["run 0", "unfix cull"]), (True, ["run 0"])):
            made = decks.make_deck(lines, "cull", culled, None, "out/run-1", restored=True)
            at = made.index("label go")
            self.assertEqual(made[at - len(taken_up):at], taken_up)
            self.assertIn("fix cull all solid/cull", made)
        self.assertTrue(beds.holds_culled(self.write_bytes("a.restart", b"engine" + b"SDCULLE1" + bytes(64))))
        self.assertFalse(beds.holds_culled(self.write_bytes("b.restart", b"engine" * 20)))
        self.assertFalse(beds.holds_culled(self.folder / "none.restart"))

    def test_a_variable_that_takes_no_value_from_outside_is_refused(self):
        decks.check_vary("s", ["1", "2"], 2, ["variable s index 5", "fix ins all insert/pack seed ${s}"])
        decks.check_vary("s", ["1", "2"], 2, ["fix ins all insert/pack seed $s"])
        self.refused("--vary s has 1 values for 2 runs", decks.check_vary, "s", ["1"], 2, ["print $s"])
        self.refused("only a variable of style index takes a value from outside; write `variable s index ...` in place of `variable s equal 5`",
                     decks.check_vary, "s", ["1", "2"], 2, ["variable s equal 5", "print $s"])
        self.refused("--vary seed: the deck does not use it; write ${seed}", decks.check_vary, "seed", ["1", "2"], 2, ["variable s index 5", "print $s"])

    def test_refusals(self):
        self.refused("has no `fix ID group solid/cull` line", decks.cull_fix, ["run 10"], "in.deck")
        self.refused("has 2 solid/cull lines", decks.cull_fix, ["fix a all solid/cull", "fix b all solid/cull"])
        self.refused("cannot read the deck", decks.read_deck, self.folder / "none.in")
        made = self.made(False)
        decks.check_metrics(["c_top", "top:max", "ke", "KinEng:mean"], made)
        self.refused("height is not among the thermo columns of the deck without the fix: step, ke, c_top",
                     decks.check_metrics, ["height"], made)
        self.refused("f_cull[1] is not among", decks.check_metrics, ["f_cull[1]"], made)
        self.refused("`median` is not one of end, max, min, mean", decks.check_metrics, ["ke:median"], made)


class Logs(Folder):
    tables = logs.parse_log(LOG)

    def test_tables(self):
        self.assertEqual([len(t.rows) for t in self.tables], [1, 3, 2, 1])
        self.assertEqual([t.counted for t in self.tables], [False, True, True, False])
        self.assertEqual(sum(t.loop_time for t in self.tables if t.counted), 4.0)

    def test_reducers(self):
        for metric, value in {"ke": 2, "KinEng:max": 4, "c_top:min": 0.4, "top:mean": 1.7 / 3}.items():
            self.assertAlmostEqual(logs.metric_of(self.tables, metric), value, msg=metric)

    def test_a_row_that_a_run_repeats_does_not_count(self):
        self.assertEqual(logs.metric_of(self.tables, "f_wall[3]:max"), 5)

    def test_steps_made_so_far(self):
        for text, steps in ((LOG, 300), (LOG[:LOG.index("     200")], 100), (LOG[:100], 0)):
            self.assertEqual(logs.steps_made(self.write("a.log", text)), steps)
        self.assertEqual(logs.steps_made(self.folder / "none.log"), 0)

    def test_a_log_that_breaks_off(self):
        self.assertEqual(len(logs.parse_log(LOG[:LOG.index("     200")])), 2)

    def test_refusals(self):
        self.refused("c_height is not among the thermo columns printed after the solid/cull line: Step, KinEng, top, wall[3]",
                     logs.metric_of, self.tables, "c_height")
        self.refused("line: none", logs.metric_of, [], "ke")
        self.assertEqual(engine.error_in("WARNING: x\nERROR: first\nERROR: last (a.cpp:3)\nmpirun noise\n"), "ERROR: last (a.cpp:3)")
        self.assertEqual(engine.error_in("Segmentation fault\n\n"), "Segmentation fault")


class Figures(unittest.TestCase):
    def judged(self, unculled, culled, **more):
        runs = [[twins.Run("r", [], 1.0, metrics={"m": v}) for v in values] for values in (unculled, culled)]
        return comparisons.judge(*runs, margin=0.02, **more)["metrics"]["m"]

    def test_margin_is_the_larger_of_two_percent_and_the_floor(self):
        self.assertTrue(self.judged([1.0, 1.0, 1.0], [1.019])["good"])
        self.assertFalse(self.judged([1.0, 1.0, 1.0], [1.021])["good"])
        m = self.judged([0.9, 1.0, 1.1], [1.1])
        self.assertTrue(m["good"])
        self.assertAlmostEqual(m["of_spread"], 0.5)

    def test_several_culled_runs_are_judged_by_their_mean(self):
        m = self.judged([1.0, 1.0], [0.97, 1.03])
        self.assertTrue(m["good"])
        self.assertAlmostEqual(m["worst"], 0.03)

    def test_ledger(self):
        kind = [("id", int), ("mass", float)]
        a = np.array([(1, 0.5), (2, 0.5), (3, 0.25)], kind)
        self.assertEqual(comparisons.ledger([a], [a[[0, 2]]]),
                         {"granules": 3, "granules_of_runs": [3, 3], "lost": 1, "ids_missing": 1, "mass": 1.25, "mass_lost": 0.5})
        self.assertIsNone(comparisons.ledger([a], [a, None]))
        self.assertEqual(comparisons.ledger([a], [a], granules=5)["lost"], 2, "the unculled run counts as little as the culled one")

    def test_where_chance_says_how_many_granules_come_all_unculled_runs_count(self):
        kind = [("id", int), ("mass", float)]
        a = np.array([(k, 0.5) for k in range(1, 7)], kind)
        book = comparisons.ledger([a[:3], a[[0, 1, 2, 4, 5]]], [a[:4]])
        self.assertEqual((book["granules_of_runs"], book["lost"], book["ids_missing"], book["mass_lost"]), ([3, 5], 0, 0, 0))
        self.assertEqual([comparisons.ledger([a[:3], a[:5]], [culled])["lost"] for culled in (a[:2], a)], [1, -1])
        self.assertEqual(comparisons.ledger([a[:3], a[:5]], [a[1:4]])["ids_missing"], 1, "all unculled runs have granule 1")

    def test_a_figure_outside_its_margin_is_named(self):
        runs = [[twins.Run("r", [], 1.0, metrics={"good one": 1.0, "bad one": v})] for v in (1.0, 1.1)]
        text = tables.table(comparisons.judge(*runs))
        self.assertIn("OUTSIDE its margin: bad one\n", text + "\n")
        self.assertIn("all metrics within their margins", tables.table(comparisons.judge(runs[0], runs[0])))

    def test_speed_up_is_of_the_time_in_which_a_run_had_its_core(self):
        unculled, culled = twins.Run("u", [], 10.0, wall=20.0, cpu=10.0), twins.Run("c", [], 4.0, wall=8.0, cpu=8.0)
        self.assertAlmostEqual(comparisons.judge([unculled], [culled])["speed_up"], 5 / 4)
        self.assertEqual(twins.Run("r", [], 3.0).own_time, 3.0)

    def test_noise_is_the_largest_distance_of_two_unculled_runs(self):
        self.assertEqual(comparisons.apart([0, 1, 5], [2], lambda a, b: abs(a - b)), ((2 + 1 + 3) / 3, 5))


class Halving(unittest.TestCase):
    """Half the limits: what is halved, and what that says of the error."""

    def test_what_is_halved(self):
        for line, made in (("fix c all solid/cull", "tolerance 1.5 0 speed 0.005"),
                           ("  fix c all solid/cull speed 0.5 tolerance 1 0.3 # speed 7", "tolerance 0.5 0.15 speed 0.25"),
                           ("fix c all solid/cull tolerance 1 0 speed 1 tolerance 3e1 0", "tolerance 15 0 speed 0.5"),
                           ("fix c all solid/cull tolerance ${a} $r speed $(2*v_s)", "tolerance $(0.5*(v_a)) $(0.5*(v_r)) speed $(0.5*((2*v_s)))")):
            self.assertEqual(halving.keywords(["run 0", line], 0.5), made, line)

    def test_defaults_are_those_of_the_fix(self):
        page = (ROOT / "fix_solid_cull" / "fix_solid_cull.md").read_text().partition("\n## Default\n")[2]
        for name, values in halving.DEFAULTS.items():
            self.assertIn(f" {name} {' '.join(values)} ", page)

    def test_keywords_stand_before_a_comment(self):
        self.assertEqual(decks.with_keywords("run 0\n  fix c all solid/cull every 3  # why\n", "speed 1"), "run 0\n  fix c all solid/cull every 3 speed 1  # why\n")
        self.assertEqual(decks.with_keywords("# fix a all solid/cull\nfix c all solid/cull\n", "speed 1"), "# fix a all solid/cull\nfix c all solid/cull speed 1\n")

    def test_without_scatter(self):
        told = halving.extrapolate([2.0, 2.0], [1.0, 1.0])
        self.assertTrue(told.low < 0 < told.error < told.high, told)
        # 5 of 100 lie beyond either bound: a fifth of the errors that grow, a tenth of those that shrink
        self.assertAlmostEqual(told.low, 1 / (1 - 2**0.38), delta=0.05)
        self.assertAlmostEqual(told.high, 1 / (1 - 2**-0.24), delta=0.05)
        other = halving.extrapolate([1.0, 1.0], [2.0, 2.0])
        for one, two in ((other.low, -told.high), (other.high, -told.low), (other.error, -told.error)):
            self.assertAlmostEqual(one, two, 12)

    def held(self, runs, alike, least, most):
        """How many of 200 errors of `least` to `most` scatters are held, where half the limits do what they are taken to do."""
        random, held = np.random.default_rng(7), []
        for _ in range(200):
            error, p, start = random.uniform(least, most), random.uniform(*halving.EXPONENTS), 5 * random.standard_normal(runs) * alike
            left = error * random.choice([2**-p, 2**-p, -2**-p, 2**p])
            whole, halved = (list(e + start + random.standard_normal(runs)) for e in (error, left))
            told = halving.extrapolate(whole, halved, alike)
            held.append(told.low <= error <= told.high)
        return np.mean(held)

    def test_the_interval_holds_what_it_says(self):
        """90 of 100 of errors that stand out of the scatter, and no fewer of those that do not; whatever the number of runs."""
        for runs, alike in ((2, False), (4, False), (5, True)):
            with self.subTest(runs=runs):
                self.assertAlmostEqual(self.held(runs, alike, 50, 200), halving.LEVEL, delta=0.07)  # 3.3 standard deviations of 200 trials
                self.assertGreater(self.held(runs, alike, 0, 3), halving.LEVEL)


class Command(Folder):
    def setUp(self):
        super().setUp()
        self.launcher = self.write("launcher", FAKE)
        self.launcher.chmod(self.launcher.stat().st_mode | stat.S_IXUSR)

    def run_twin(self, deck, *options):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            words = [str(self.write("in.deck", deck)), "--launcher", str(self.launcher), *options]
            status = errors.status_of("twin", lambda: twin.main(words))
        return status, out.getvalue(), err.getvalue()

    DECK = "fix cull all solid/cull\nthermo_style custom step v_depth\nrun 20\n"

    def test_table_and_files(self):
        status, out, _ = self.run_twin(self.DECK, "--metrics", "v_depth", "--plot")
        self.assertEqual(status, 0, out)
        result = json.loads((self.folder / "in.deck.twin" / "twin.json").read_text())
        self.assertEqual([result[kind]["loop_times"] for kind in twins.KINDS], [[10] * 3, [4]])
        self.assertAlmostEqual(result["speed_up"], result["unculled"]["own_time"] / result["culled"]["own_time"])
        self.assertIn(f"speed-up {result['speed_up']:.2f}", out)
        self.assertIn("exterior 5, interface 3, interior 12", out)
        self.assertIn("lost 0, ids missing 0", out)
        self.assertRegex(out, r"v_depth +1\.00667 +1\.001 .* good")
        for file in ("twin.json", "twin.png", "culled-1.in", "unculled-3.log"):
            self.assertTrue((self.folder / "in.deck.twin" / file).exists(), file)

    def test_half_the_limits(self):
        status, out, _ = self.run_twin(self.DECK, "--metrics", "v_depth", "--halve", "--plot")
        self.assertEqual(status, 0, out)
        result = json.loads((self.folder / "in.deck.twin" / "twin.json").read_text())
        m = result["metrics"]["v_depth"]
        self.assertEqual(result["keywords"], "tolerance 1.5 0 speed 0.005")
        for kind, share in halving.KINDS.items():
            for k, value in enumerate(m[kind]):
                self.assertAlmostEqual(value, 1 + 0.01 * (k > 0) + 0.001 * share * halving.VARIED[k], 7)
        self.assertAlmostEqual(m["difference"], 0.0005 * np.mean(halving.VARIED[:4]), 7)
        self.assertAlmostEqual(m["error"], halving.MIDDLE * m["difference"], 12)
        self.assertTrue(m["low"] < 0 < m["error"] < m["high"], m)
        self.assertRegex(out, r"v_depth +1\.00853 +1\.00802 +\+0\.05 % +0\.50 % +\+0\.06 % ")
        self.assertIn("lost 0, ids missing 0", out)
        for file in ("twin.png", "culled-4.log", "halved-4.in"):
            self.assertTrue((self.folder / "in.deck.twin" / file).exists(), file)
        self.assertFalse((self.folder / "in.deck.twin" / "unculled-1.in").exists())
        self.assertIn("fix cull all solid/cull tolerance 1.5 0 speed 0.005\n", (self.folder / "in.deck.twin" / "halved-1.in").read_text())

    def test_half_the_limits_of_runs_that_are_all_alike(self):
        _, out, _ = self.run_twin('print "${dx}"\n' + self.DECK.replace("step v_depth", "step v_other v_depth"), "--metrics", "v_depth", "--halve", "--vary", "dx=0,1,2,3")
        self.assertNotIn("all alike", out, "their limits differ")

    def test_what_does_not_go_with_half_the_limits(self):
        for words in (("--unculled", "2"), ("--margin", "0.1"), ("--culled", "1")):
            with self.subTest(words), self.assertRaises(SystemExit), contextlib.redirect_stderr(io.StringIO()) as said:
                twin.main(["deck", "--halve", *words])
            self.assertRegex(said.getvalue(), "leave --unculled and --margin out|--culled 2 to 10")

    def test_a_lost_granule_is_no_success(self):
        status, out, _ = self.run_twin(self.DECK + "# lossy\n", "--metrics", "v_depth")
        self.assertEqual(status, 1)
        self.assertIn("lost 1, ids missing 1, mass lost 0.5 of 1.5 kg", out)

    def test_errors_are_one_line(self):
        for deck, options, text in (
                ("run 10\n", (), "twin: in.deck has no `fix ID group solid/cull` line"),
                ("read_restart missing\n" + self.DECK, (), "unculled-1: LIGGGHTS stopped with status 1: ERROR: Cannot open restart"),
                ("# killed\n" + self.DECK, (), "unculled-1: LIGGGHTS was killed by signal 9 (SIGKILL): it printed nothing (all of it: "),
                (self.DECK, ("--metrics", "c_nope"), "c_nope is not among the thermo columns"),
                (self.DECK, ("--metrics", "v_depth:median"), "`median` is not one of end, max, min, mean"),
                (self.DECK, ("--launcher", "/nowhere/liggghts-solidcull"), "no launcher at /nowhere/liggghts-solidcull"),
                (self.DECK, ("--vary", "dx=0,1"), "--vary dx has 2 values for 3 runs"),
                (self.DECK, ("--halve", "--vary", "dx=0,1"), "--vary dx has 2 values for 4 runs"),
                (self.DECK, ("--halve", "--metrics", "c_nope"), "c_nope is not among the thermo columns"),
                (self.DECK.replace("cull\n", "cull speed fast\n", 1), ("--halve",), "`fast` is no number, so it cannot be halved: fix cull all solid/cull speed fast"),
                (self.DECK.replace("cull\n", "cull tolerance 1\n", 1), ("--halve",), "`tolerance` lacks a number: fix cull all solid/cull tolerance 1"),
                (self.DECK, ("--vary", "dx=0,1,2"), "--vary dx: the deck does not use it")):
            status, out, err = self.run_twin(deck, *options)
            self.assertEqual((status, out), (2, ""), text)
            self.assertIn(text, err)
            self.assertEqual(err.count("\n"), 1, err)

    def test_runs_at_once_give_the_same_in_the_same_order(self):
        _, one, _ = self.run_twin(self.DECK, "--metrics", "v_depth", "--culled", "2")
        _, two, said = self.run_twin(self.DECK, "--metrics", "v_depth", "--culled", "2", "--at-once", "2")
        self.assertEqual(*[[line for line in text.splitlines() if line.startswith("v_depth")] for text in (one, two)])
        self.assertIn("5 of 5 runs done", said)

    def test_a_run_that_fails_stops_those_beside_it(self):
        began = time.monotonic()
        status, _, err = self.run_twin("# forever\n" + self.DECK, "--at-once", "2")
        self.assertEqual((status, err.count("\n")), (2, 1), err)
        self.assertLess(time.monotonic() - began, 60)
        pid = self.folder / "pid"
        self.assertFalse(pid.exists() and Path(f"/proc/{pid.read_text()}").exists(), "the other run goes on")

    def test_runs_that_are_all_alike_are_named(self):
        _, out, _ = self.run_twin('print "${dx}"\n' + self.DECK, "--metrics", "v_depth", "--vary", "dx=0,1,2")
        self.assertIn("the unculled runs are all alike", out)


HEAD = """\
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
region reg block -.02 .02 -.02 .02 0 .08 units box
create_box 1 reg
neighbor 0.002 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 .5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 4e-5
fix grav all gravity 9.81 vector 0 0 -1
fix w4 all wall/gran model hertz tangential history primitive type 1 zplane 0
fix sides all wall/gran model hertz tangential history primitive type 1 zcylinder 0.018 0 0
fix pts all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.003
fix pdd all particledistribution/discrete 49979687 1 pts 1
region fill cylinder z 0 0 0.014 0.01 0.07 units box
fix integr all nve/sphere
compute spin all erotate/sphere
thermo 100
thermo_style custom step atoms ke c_spin
"""
PLACE = "overlapcheck yes all_in yes vel constant 0 0 -0.5 region fill"
LINE = "fix cull all solid/cull every 10 calm 1 speed 0.5 tolerance 30 0\n"


@unittest.skipUnless(os.access(ROOT / "build/liggghts-solidcull", os.X_OK), "no build/liggghts-solidcull")
class RealDecks(Folder):
    """Decks whose granules come in one way or another: each unculled run goes its own way, and nothing is lost."""

    def compared(self, deck, vary=None):
        result, _ = twins.compare(self.write("in.deck", HEAD + deck), ["ke", "c_spin"], out=self.folder / "out", vary=vary)
        self.assertEqual((result["ledger"]["lost"], result["ledger"]["ids_missing"]), (0, 0))
        return result

    def test_granules_that_come_with_a_run(self):
        pack = f"fix ins all insert/pack seed 86028157 distributiontemplate pdd insert_every once {PLACE} particles_in_region 60"
        for name, deck in (("with the first", f"{pack}\n{LINE}run 2000\n"),
                           ("with a later one", f"{LINE}run 200\n{pack}\nrun 2000 upto\n"),
                           ("on the way, in every run", f"fix ins all insert/rate/region seed 86028157 distributiontemplate pdd nparticles 90 particlerate 2000 start 300 insert_every 200 {PLACE}\n"
                                                        f"{LINE}variable n index 900\nrun ${{n}}\nrun 1500 upto post no\n"),
                           ("interrupted", f"{pack}\n{LINE}run 2000 every 500 \"print 'on the way'\"\n"),
                           ("in a loop", f"{pack}\n{LINE}variable i loop 40\nlabel here\nrun 50\nnext i\njump SELF here\n")):
            with self.subTest(granules=name):
                self.assertFalse(self.compared(deck)["no_scatter"])

    def test_a_seed_of_the_deck(self):
        result = self.compared(f"variable s index 86028157\nfix ins all insert/pack seed ${{s}} distributiontemplate pdd insert_every once {PLACE} particles_in_region 60\n{LINE}run 2000\n",
                               vary=("s", ["86028157", "32452843", "67867967"]))
        self.assertFalse(result["no_scatter"])

    def test_a_restart_file_with_culled_granules(self):
        pack = f"fix ins all insert/pack seed 86028157 distributiontemplate pdd insert_every once {PLACE} particles_in_region 60\n"
        engine.run_liggghts(self.write("fill.in", f"{HEAD}{pack}{LINE}run 12000\nunfix ins\nwrite_restart bed.restart\n"), self.folder, self.folder / "fill.log")
        self.assertTrue(beds.holds_culled(self.folder / "bed.restart"))
        head = HEAD.replace("create_box 1 reg", "read_restart bed.restart")
        deck = self.write("in.deck", f"{head}{LINE}variable h equal bound(all,zmax)\nprint \"${{h}}\"\nunfix grav\nfix grav all gravity 9.81 vector 1 0 -1\nrun 1000\n")
        result, _ = twins.compare(deck, ["ke"], out=self.folder / "out", culled=2)
        self.assertEqual((result["ledger"]["granules"], result["ledger"]["lost"], result["no_scatter"]), (60, 0, False))


    def test_half_the_limits(self):
        """A bed at rest that is tilted: what it does is told from culled runs alone, and the run without the line bears it out."""
        pack = f"fix ins all insert/pack seed 86028157 distributiontemplate pdd insert_every once {PLACE} particles_in_region 120\n"
        engine.run_liggghts(self.write("fill.in", f"{HEAD}{pack}run 12000\nunfix ins\nwrite_restart bed.restart\n"), self.folder, self.folder / "fill.log")
        head = HEAD.replace("create_box 1 reg", "read_restart bed.restart")
        tilted = "unfix grav\nfix grav all gravity 9.81 vector 0.5 0 -1\n"
        columns = "compute mid all reduce ave x\ncompute top all reduce max z\nthermo_style custom step ke c_mid c_top\n"
        deck = self.write("in.deck", f"{head}fix cull all solid/cull every 10\nrun 200\n{tilted}{columns}run 4000\nunfix cull\nthermo_style custom step c_mid c_top\nrun 0\n")
        metrics = ["c_mid", "c_top"]
        told, runs = halving.compare(deck, metrics, out=self.folder / "out")
        self.assertEqual((told["keywords"], told["ledger"]["lost"], told["ledger"]["ids_missing"], told["no_scatter"]), ("tolerance 1.5 0 speed 0.005", 0, 0, False))
        self.assertEqual([run.name for run in runs["halved"]], [f"halved-{k}" for k in (1, 2, 3, 4)])
        self.assertGreater(told["halved"]["exterior"], told["culled"]["exterior"], "half the limits leave more awake")
        truth, _ = twins.compare(deck, metrics, out=self.folder / "out")
        for name in metrics:
            t, m = truth["metrics"][name], told["metrics"][name]
            self.assertEqual(t["culled"], m["culled"][:1], "the same run")
            error = np.mean(m["culled"]) - t["mean"]
            self.assertTrue(m["low"] < error < m["high"], f"{name}: {m['low']} to {m['high']}, and it is {error}")
        self.assertIn("c_top", halving.table(told))


class Pictures(Folder):
    def vtp(self, compressor="vtkZLibDataCompressor", size=1 << 18):
        """A file of three granules and a triangle, as VTK's own writer makes it: blocks of `size` bytes."""
        head, data = [], b""

        def array(name, kind, values, width=1):
            nonlocal data
            raw = np.asarray(values).tobytes()
            blocks = [zlib.compress(raw[at:at + size]) for at in range(0, len(raw), size)]
            place = len(data)
            data += np.array([len(blocks), size, len(raw) % size, *map(len, blocks)], "<u8").tobytes() + b"".join(blocks)
            return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="appended" offset="{place}"/>'

        head = f"""<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="{compressor}"><PolyData>
<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">0.25</DataArray></FieldData>
<Piece NumberOfPoints="3" NumberOfPolys="1">
<PointData>{array("radius", "Float32", np.float32([1, 2, 3]))}{array("state", "Int32", np.int32([0, 1, 2]))}</PointData>
<Points>{array("Points", "Float32", np.float32([0, 0, 0, 5, 0, 0, 0, 5, 0]), 3)}</Points>
<Polys>{array("connectivity", "Int64", np.int64([0, 1, 2]))}{array("offsets", "Int64", np.int64([3]))}</Polys>
</Piece></PolyData><AppendedData encoding="raw">_"""
        file = self.folder / "bed.000000100.vtp"
        file.write_bytes(head.encode() + data + b"</AppendedData></VTKFile>")
        return file

    def test_vtp_is_read_whatever_its_blocks(self):
        for size in (8, 12, 1 << 18):
            bed = vtp.read(self.vtp(size=size))
            self.assertEqual(bed["points"].tolist(), [[0, 0, 0], [5, 0, 0], [0, 5, 0]])
            self.assertEqual(bed["radius"].tolist(), [1, 2, 3])
            self.assertEqual(bed["polys"].tolist(), [[0, 1, 2]])
            self.assertEqual(bed["time"], 0.25)

    def test_other_vtp_files_are_named(self):
        for file in (self.vtp(compressor="vtkLZ4DataCompressor"), self.write("other.vtp", "<VTKFile/>")):
            with self.assertRaisesRegex(ValueError, f"{file.name}: no .vtp file of fix solid/cull"):
                vtp.read(file)

    def test_steps_of_files(self):
        self.vtp()
        self.assertEqual(vtp.steps_of(self.folder / "bed.*.vtp"), [100])
        self.assertEqual(vtp.file_at(self.folder / "bed.*.vtp", 100), self.folder / "bed.000000100.vtp")
        self.assertIsNone(vtp.file_at(self.folder / "bed.*.vtp", 200))

    def test_nearer_granules_hide_others(self):
        bed = {"points": np.array([[5.0, 2, 5], [5, 8, 5]]), "radius": np.array([1.0, 1]), "state": np.array([1, 2])}
        picture = cutaways.Picture((0, 0, 0), (10, 10, 10), pixels=40, turn=0, tilt=0)
        picture.spheres(bed["points"], bed["radius"], [plots.STATES[s][1] for s in bed["state"]])
        red, green, blue = picture.image[20, 20]
        self.assertGreater(blue, green)


class FewSteps(Folder):
    """What driver's `--few-steps` must not let pass; each fault by its line."""

    def run_of(self, name="culled-1", **changed):
        final = np.array([(k, 0.5, 0.1, 0, 0, 0.1 * k) for k in (1, 2, 3)],
                         [("id", int)] + [(c, float) for c in ("mass", "radius", "x", "y", "z")])
        counts = {"exterior": np.array([3.0, 1]), "interface": np.array([0.0, 1]), "interior": np.array([0.0, 1])}
        table = logs.Table(["Step", "Atoms", "cull[3]"], [[100, 3, 0], [120, 2, 1]], counted=True)
        run = twins.Run(name, [table], 1.0, counts if name.startswith("culled") else None, final, {"m": 1.0}, reached_the_end=True)
        for key, value in changed.items():
            setattr(run, key, value)
        return run

    def check(self, culled, **how):
        few_steps.check({"unculled": [self.run_of("unculled-1")], "culled": [culled]}, 3, 20, **how)

    def test_what_is_whole_passes(self):
        self.check(self.run_of())

    def test_each_fault_is_a_line(self):
        whole = self.run_of()
        elsewhere, heavier, lost = whole.final.copy(), whole.final.copy(), whole.final.copy()[:2]
        elsewhere["z"][1], heavier["mass"][0] = np.nan, 0.6
        other = whole.final.copy()
        other["id"][2] = 7
        still = {name: np.array([3.0 * (name == "exterior")] * 2) for name in whole.counts}
        short = {**whole.counts, "interior": np.array([0.0, 0])}
        leaky = logs.Table(["Step", "Atoms", "cull[3]"], [[100, 3, 0], [120, 1, 1]], counted=True)
        silent = logs.Table(["Step", "KinEng"], [[100, 3], [120, 1]], counted=True)
        for changed, text in (({"reached_the_end": False}, "culled-1 did not reach the end of its deck"),
                              ({"final": None}, "did not reach the end of its deck"),
                              ({"tables": [logs.Table(["Step"], [[100], [110]], counted=True)]}, "made 10 steps after the fix line, not 20"),
                              ({"final": lost}, "ended with 2 granules of 2 ids, not 3"),
                              ({"final": elsewhere}, "whose place or mass is no number"),
                              ({"final": other}, "ended with other ids than unculled-1"),
                              ({"final": heavier}, "ended with 1.6 kg, unculled-1 with 1.5 kg"),
                              ({"metrics": {"m": float("nan")}}, "has no number for m"),
                              ({"counts": None}, "left no counts of the fix"),
                              ({"counts": short}, "counted 2 to 3 exterior, interface and interior granules, not 3"),
                              ({"tables": [leaky]}, "held 1 atoms and 1 stored granules, not 3 together"),
                              ({"tables": [silent]}, "printed no row with `atoms` and `f_cull[3]`"),
                              ({"counts": still}, "locked no granule")):
            with self.subTest(fault=text):
                self.refused(text, self.check, self.run_of(**changed))
        self.check(self.run_of(counts=still), locks=False)


class Progress(Folder):
    """The time left, of what is known of each kind of run."""

    def progress(self, steps=None):
        kinds = [twins.Job(self.folder / "in.deck", self.folder, kind, k) for kind, k in twins.in_turns(2, 2)]
        return kinds, twins.Progress(kinds, 2, lambda line: None, steps)

    def running(self, job, seconds, step):
        log = self.write(f"{job.name}.log", f"  90 3\n{logs.FROM_HERE}\n    Step  Atoms\n  500 3\n  {500 + step} 3\n")
        return job, types.SimpleNamespace(log=log, began=time.monotonic() - seconds)

    def test_of_finished_runs(self):
        (_, _, unculled, _), progress = self.progress()
        self.assertIsNone(progress.seconds_left([]))
        progress.walls = {"unculled": [100.0], "culled": [20.0]}
        # 100 - 40 s of the one that runs and 20 s of the one that waits, on two cores
        self.assertAlmostEqual(progress.seconds_left([self.running(unculled, 40, 0)]), 60, delta=1)

    def test_of_the_steps_of_running_ones(self):
        (unculled, culled, _, _), progress = self.progress(steps=1000)
        both = [self.running(unculled, 50, 500), self.running(culled, 50, 800)]
        self.assertAlmostEqual(progress.seconds_left(both), (50 + 12.5 + 100 + 62.5) / 2, delta=1)
        self.assertIsNone(progress.seconds_left([both[0], self.running(culled, 50, 10)]), "too early to tell")

    def test_where_all_unculled_runs_were_made_before(self):
        _, progress = self.progress()
        made = types.SimpleNamespace(name="unculled-1", loop_time=1.0)
        for _ in range(2):
            progress.skipped(made, "unculled")
        progress.walls["culled"] = [20.0]
        self.assertEqual(progress.seconds_left([]), 20 / 2)


class Kept(Folder):
    def test_a_bed_is_made_again_when_its_recipe_changes(self):
        made = []

        def bed(recipe):
            return beds.made(self.folder / "bed.restart", recipe, lambda part: (made.append(recipe), part.write_text(recipe)), say=made.append)
        for recipe in ("a", "a", "b"):
            self.assertEqual(bed(recipe).read_text(), recipe)
        self.assertEqual([m for m in made if m in "ab"], ["a", "b"])

    def test_a_bed_whose_making_failed_is_not_there(self):
        def fails(part):
            part.write_text("half")
            raise errors.RunError("no")
        for _ in range(2):
            self.refused("no", beds.made, self.folder / "bed.restart", "a", fails, say=lambda line: None)
        self.assertFalse((self.folder / "bed.restart").exists())

    def test_a_kept_run_is_not_made_again(self):
        launcher = self.write("launcher", FAKE)
        launcher.chmod(0o755)
        deck = self.write("in.deck", Command.DECK)

        def walls(**how):
            job = twins.KeptJob(deck, self.folder / "out", "culled", 0, launcher=str(launcher), **how)
            return [run.wall for run in twins.run_jobs([job])]
        first = walls()
        self.assertEqual(walls(), first)
        self.assertNotEqual(walls(made_with="another library"), first)


class Files(Folder):
    def test_the_height_map_is_that_of_a_sphere(self):
        granule = np.array([(0.5, 0.5, 0.3, 0.2)], [(c, float) for c in ("x", "y", "z", "radius")])
        height = measures.height_map(granule, (0, 0), (1, 1), 0.01, ground=-1)
        self.assertAlmostEqual(height.max(), 0.5, delta=2e-4)
        self.assertAlmostEqual((height > -1).mean(), np.pi * 0.2**2, delta=1e-3)
        self.assertAlmostEqual(height[height > -1].mean(), 0.3 + 2 / 3 * 0.2, delta=1e-3)

    def test_meshes_are_closed(self):
        for name, triangles, area in (("block", meshes.block((0, 0, 0), (1, 2, 3)), 22.0),
                                      ("drum", meshes.drum(1.0, 2.0, 360), 2 * np.pi + 4 * np.pi)):
            corners = np.array(triangles, float)
            edges = {}
            for t in corners.round(9).tolist():
                for k in range(3):
                    ends = frozenset(map(tuple, (t[k], t[(k + 1) % 3])))
                    edges[ends] = edges.get(ends, 0) + 1
            self.assertEqual(set(edges.values()), {2}, name)
            found = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
            self.assertAlmostEqual(found / area, 1, delta=1e-4, msg=name)

    def test_snapshots_of_a_dump(self):
        text = "".join(f"ITEM: TIMESTEP\n{s}\nITEM: NUMBER OF ATOMS\n{len(rows)}\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
                       f"ITEM: ATOMS id mass \n" + "".join(f"{i} {m}\n" for i, m in rows) for s, rows in ((0, []), (5, [(2, 0.5), (1, 0.25)])))
        file = self.write("a.dump", text)
        self.assertEqual([(step, columns, rows.tolist()) for step, columns, rows in dumps.snapshots(file)],
                         [(0, ["id", "mass"], []), (5, ["id", "mass"], [[2, 0.5], [1, 0.25]])])
        self.assertEqual(dumps.read_final(file).tolist(), [(1, 0.25), (2, 0.5)])
        self.refused("cannot read", dumps.read_final, self.folder / "none.dump")
        self.refused("holds no snapshot", dumps.read_final, self.write("empty.dump", ""))


class Drivers(unittest.TestCase):
    """Each driver's own command, where no run can succeed: one line, status 2."""

    DRIVERS = ("examples/impact/example.py", "examples/drum/example.py", "examples/falling_mass/example.py", "examples/plate_discharge/example.py",
               "validation/motion/motion.py", "validation/scale/scale.py", "validation/scale/choices.py", "validation/scale/weight.py", "validation/scale/tools.py",
               "validation/activity/activity.py", "validation/stress/stress.py", "validation/no_harm/no_harm.py",
               "validation/chain/chain.py", "validation/ladder/ladder.py", "validation/halving/halving.py",
               "validation/audit/audit.py")

    def test_no_launcher(self):
        for driver in self.DRIVERS:
            with self.subTest(driver=driver):
                # of few steps, so that beds of a user's own runs stay as they are
                scene = ["slide"] if "motion" in driver else ["pour"] if "activity" in driver else ["heavy"] if "stress" in driver else []
                done = subprocess.run(["/usr/bin/python3", str(ROOT / driver), "--few-steps", *scene], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                      stderr=subprocess.PIPE, text=True, timeout=100, env={**os.environ, engine.NAMED_BY: "/nowhere/liggghts-solidcull"})
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                self.assertIn("no launcher at /nowhere/liggghts-solidcull", done.stderr)


class Imports(Folder):
    """The package's modules: none imports itself by way of others, and the package says what each is for."""
    PACKAGE = ROOT / "solidcull_runs"

    def modules(self, package):
        """Its files, by name."""
        files = {".".join(f.relative_to(package).with_suffix("").parts): f for f in package.rglob("*.py")}
        return {name: f for name, f in files.items() if not name.endswith("__init__")}

    def imports(self, package):
        """The modules of the package that each of them imports, at its head or in a function."""
        files, found = self.modules(package), {}
        for name, file in files.items():
            wanted = set()
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom):
                    here = [package.name, *name.split(".")][:-node.level] if node.level else []
                    origin = ".".join([*here, *filter(None, [node.module])])
                    wanted |= {origin} | {f"{origin}.{alias.name}" for alias in node.names}
                elif isinstance(node, ast.Import):
                    wanted |= {alias.name for alias in node.names}
            found[name] = {other for other in files if f"{package.name}.{other}" in wanted}
        return found

    def circle(self, package):
        """Modules that import each other, the first again at the end; None where there are none."""
        try:
            graphlib.TopologicalSorter(self.imports(package)).prepare()
        except graphlib.CycleError as e:
            return e.args[1]
        return None

    def test_no_circle(self):
        self.assertIsNone(self.circle(self.PACKAGE))

    def test_what_all_share_needs_nothing_of_validation(self):
        imports = self.imports(self.PACKAGE)
        self.assertIn("validation.cases", imports["validation.command"])
        self.assertIn("errors", imports["validation.command"])
        self.assertEqual({name: of for name, of in imports.items() if "." not in name and any("." in other for other in of)}, {})

    def test_each_module_has_its_row(self):
        text = (self.PACKAGE / "__init__.py").read_text()
        self.assertEqual(sorted(re.findall(r"^\| `([\w.]+)` \| \w", text, re.M)), sorted(self.modules(self.PACKAGE)))

    def test_circles_are_found(self):
        package = self.folder / "package"
        (package / "part").mkdir(parents=True)
        texts = {"__init__": "", "a": "from . import b\n", "b": "import json\n", "part/__init__": "", "part/c": "from ..a import x\n"}
        for changed in ({}, {"b": "def f():\n    from .a import x\n"}, {"b": "from .part import c\n"}, {"b": "from package.part.c import x\n"},
                        {"b": "import package.part.c\n"}, {"a": "from package import a\n"}):
            with self.subTest(changed):
                for name, text in {**texts, **changed}.items():
                    (package / f"{name}.py").write_text(text)
                self.assertEqual(self.circle(package) is None, not changed)


if __name__ == "__main__":
    unittest.main()

"""Settles a bed of clumps once, strikes it five times unculled and five times culled, the ball 10 um farther in each pair of runs, and
leaves the table, a plot and pictures in out/."""
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
from solidcull_runs import errors, examples, struck  # noqa: E402

BOX, DEPTH, STRIKER = 0.06, 0.05, 0.004    # m: width of the bed, height shown, larger radii are the ball
TIME_STEP = 2.5e-5                         # s
APART = [k * 1e-5 for k in (0, 1, -1, 2, -2)]  # m: the ball's x in each pair of runs
METRICS = ("v_depth", "v_depth:max", "v_force:max", "v_bedke:max", "v_bedke:mean", "v_floor:max", "v_floor", "c_path")
SHOWN = 4                                  # moments in the picture

CLUMPS = examples.Example(
    here=HERE, deck="strike.in", bed="settle.in", bed_takes="settling 7,000 clumps of three spheres: three to five minutes",
    sources=("bed.in", "floor.stl"), granules=21001, steps=10000, wanted=METRICS, figures=struck.crater_of(BOX, STRIKER),
    plot=struck.plot_of(TIME_STEP), moments=struck.moments_of(TIME_STEP, SHOWN, BOX / 2, (BOX, BOX, DEPTH), STRIKER),
    files_every=400, vdb_every=5000, vary=("dx", APART), runs=5, at_once=2,
    few={"L": 0.02, "clumps": 300, "steps": 700},
    few_bed={"L": 0.02, "clumps": 300, "fallsteps": 2500, "dampsteps": 1000, "freesteps": 50},
    few_granules=901, few_steps=700, few_files_every=100, few_keywords="every 20")

if __name__ == "__main__":
    errors.command("clumps", lambda: examples.main(CLUMPS))

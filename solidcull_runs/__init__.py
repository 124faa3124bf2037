"""What the scripts of `examples/`, `validation/`, `benchmarks/` and `tests/` share: a deck is run with and without its `solid/cull`
line and compared.

| module | what it is for |
| --- | --- |
| `errors` | what the user has to mend, in one line; the exit status of a script |
| `engine` | LIGGGHTS: finding it, running it |
| `decks` | one deck made culled and unculled |
| `shifts` | lines of a deck that move its granules a little, from run to run |
| `logs` | what a run printed |
| `dumps` | the files that a run left |
| `beds` | beds and other files that are made once and kept |
| `meshes` | triangles, and STL files of them |
| `measures` | what is measured of a run: heights of the bed, sums over all granules |
| `hertz` | normal forces of contacts, of places alone |
| `twins` | runs of both kinds, one after the other or several at once, and their comparison |
| `comparisons` | errors beside the noise floor, and the ledger |
| `halving` | the error of culled runs, told from runs with half the limits |
| `few_steps` | what can be checked of a run after a few steps |
| `tables` | comparisons as text |
| `plots` | curves of runs of both kinds |
| `vtp` | files of `bed` and `mesh`, and their times |
| `orientations` | how granules are turned, told from the spins in files of `bed` |
| `cutaways` | pictures of a bed and its interface mesh, cut open |
| `struck` | what is drawn of a bed that a ball strikes |
| `kills` | a job on several ranks that is killed, and the newest restart file that it left |
| `examples` | the course that all examples take |

The folder `validation` is what `validation/run.sh` is made of:

| module | what it is for |
| --- | --- |
| `validation.command` | the command: its options and its course |
| `validation.cases` | what a folder of `validation/cases/` says |
| `validation.points` | the ways in which a case is run: unculled, tolerances, the paper's scheme, by hand |
| `validation.case_runs` | the beds and the runs of a case |
| `validation.short_cases` | each case's deck cut short to a few steps |
| `validation.earlier` | runs of which only the kept result is left |
| `validation.case_results` | what the runs of a case gave, as plain data |
| `validation.fields` | coarse-grained fields of a bed, and their distance |
| `validation.verdicts` | two one-sided tests on pairs of runs, and what they say of a case |
| `validation.sequential` | how far a mean may lie from what pairs of runs show, where pairs are added |
| `validation.deciding` | which pairs of runs a case still lacks for its verdicts |
| `validation.forecasts` | what the fix forecast of runs, beside what came |
| `validation.slices` | a picture of what moves, in a slice of the bed |
| `validation.report_plots` | plots of the report |
| `validation.pages` | text, tables and pictures as Markdown and HTML |
| `validation.report` | the report, and what of it is kept with the sources |
| `validation.kept_figures` | results files that are kept with the sources |
| `validation.first_page` | rows and plot of README.md, made of those files |

The folder `laid` lays beds of copies of a smaller one:

| module | what it is for |
| --- | --- |
| `laid.tiles` | as atoms, with their contact histories |
| `laid.beds` | culled, tile by tile |
| `laid.sources` | the granules of the culled bed that it is laid of |
| `laid.bodies` | the solid bodies of the bed that is laid |
| `laid.walls` | the number by which a restart file knows the walls of a deck |
| `laid.floors` | floors that are regular grids of triangles |
| `laid.columns` | columns of what is culled, as they stand in a restart file |
| `laid.culled_files` | the culled part of a restart file, read and written |

The folder `beds_on_demand` is the program [solidcull-bed](../fix_solid_cull/solidcull_bed.md):

| module | what it is for |
| --- | --- |
| `beds_on_demand.command` | its options and its course |
| `beds_on_demand.wanted` | what the user wants |
| `beds_on_demand.material` | the user's material file |
| `beds_on_demand.plan` | the numbers of its recipe: tiles, steps, margins |
| `beds_on_demand.pieces` | what a bed is laid of, made once and kept |
| `beds_on_demand.measures` | height and solid fraction |
| `beds_on_demand.handed_over` | the files that the user gets |
"""

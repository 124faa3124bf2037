"""What the drivers of `examples/` and `validation/` share: a deck is run with and without its `solid/cull` line and compared.

| module | what |
| --- | --- |
| `errors` | what the user has to mend, in one line; the exit status of a driver |
| `engine` | finding and running LIGGGHTS |
| `decks` | one deck made culled and unculled |
| `logs`, `dumps` | what a run printed, and the files that it left |
| `beds` | beds that are settled once and kept |
| `meshes` | triangles in STL files |
| `surfaces` | the height map of a bed |
| `twins` | runs of both kinds, one after the other or several at once |
| `metrics` | errors beside the noise floor, and the ledger |
| `few_steps` | what can be checked of a run after a few steps |
| `tables`, `plots`, `pictures` | text, curves and cut-away pictures |
| `examples` | the course that all examples take |

What `validation/run.sh` is made of, besides:

| module | what |
| --- | --- |
| `validate` | the command |
| `cases` | what a folder of `cases/` says |
| `points` | how each case is run: unculled, tolerances, the paper's scheme, by hand |
| `ensembles` | the runs of a case, and what they gave as plain data |
| `few` | each deck for a few steps |
| `equivalence`, `judgement` | two one-sided tests on pairs of runs; verdicts, errors in margins, orders |
| `fields` | coarse-grained fields and their distance |
| `moving` | series that several cases measure |
| `figures`, `report`, `publish` | plots, the page, and what of it is kept with the sources |
| `kept`, `first_page` | results files that are kept with the sources; rows and plot of README.md, made of them |
"""

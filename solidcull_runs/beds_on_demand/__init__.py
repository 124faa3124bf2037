"""The program solidcull-bed: a bed at rest in a box, already culled, of one tile that is poured.

| module | what it is for |
| --- | --- |
| `wanted` | what the user asks for, and what of it is refused |
| `material` | the user's material file: what a deck must say, and the numbers that are needed of it |
| `plan` | tiles, numbers of granules, and the variables of the decks |
| `measures` | height and solid fraction of a bed |
| `pieces` | tile, bed of 3 x 3 tiles and its culled file: made once and kept |
| `handed_over` | the files that the user gets |
| `command` | the command line |

`pour.in`, `rest.in` and `doze.in` make the pieces; `start.in` is what the user's deck is made of.
"""

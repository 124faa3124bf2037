"""The program solidcull-bed: a bed at rest in a box, already culled, of one tile that is poured."""

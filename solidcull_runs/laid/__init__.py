"""Beds laid of copies of a smaller one, in LIGGGHTS's restart format: as atoms (`tiles`), or culled, so that none is ever an atom (`beds`)."""

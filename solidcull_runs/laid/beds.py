"""Lays the culled restart file of a large bed of that of a smaller one: no granule of it is ever an atom.

Sides, edges and corners are those of the smaller bed. The middle is its middle, as often as it takes; the tiles around the middle of
the smaller bed are those around the middle of the large one. A ball, where there is one, goes over the middle.

It works tile by tile: what is in memory is the smaller bed and one tile. Contacts, histories and what each granule was locked with go
along; the bodies' mass properties are summed anew, and LIGGGHTS settles their motion. Where tiles meet that did not meet in the
smaller bed, the contacts are those that the western or southern one had.
"""
import hashlib
import os
import struct
from pathlib import Path

import numpy as np

from . import culled_files as files
from . import tiles
from .bodies import FORWARD, Bodies
from .columns import (BODY, C_BODY, HELD, HIGH, HISTORY, L_ELEMENT, L_FORCE, L_MESH, L_TAG, L_TORQUE, LOW, MASS, NO_MESH, PLACE, RADIUS, RECORD, TAG, WORDS,
                      numbers, words)
from .floors import elements


def on_floor(source, key):
    """Where the numbers of floor elements are among the columns of these granules."""
    columns, layout = key
    length, meshes = source.columns[layout]
    if length != columns - RECORD:
        raise files.CulledFileError("a record is not as long as its layout says")
    return [RECORD + k for k in meshes]


def packed_tile(source, t, key):
    """The columns of a tile's granules, packed where they are the same wherever it lies."""
    if (t, key) not in source.packed:
        table = source.interior[t][key]
        moving = {TAG, BODY, PLACE, PLACE + 1, *on_floor(source, key)}
        tag = [c for c in range(RECORD, RECORD + 17) if (table[c] == table[TAG] + WORDS.type(t * source.size + 1)).all() and len(table[c])]
        own = [None if c in moving else TAG if c in tag else files.packed_column(table[c]) for c in range(len(table))]
        if not tag:
            raise files.CulledFileError("no column of a granule's record is its tag")
        source.packed[t, key] = own
    return source.packed[t, key]


def lay(source, file, copies, floor, top, shift=0.0, walls=0):
    """Writes the bed of copies[0] x copies[1] tiles, of a Source, on a Floor, under an open top (m). `shift` (m): of the ball, along x.
    `walls`: the number of its walls, see walls.py; without it what is at walls is atoms in the first step of a run. Returns how many
    granules it holds."""
    size = source.size
    laid = [(i, j) for i in range(copies[0]) for j in range(copies[1])]
    like = {place: source.like(*place, copies) for place in laid}
    index = {place: k for k, place in enumerate(laid)}
    corner = {place: source.corner(*place) for place in laid}
    corner_then = [source.corner(t // source.copies[1], t % source.copies[1]) for t in range(source.copies[0] * source.copies[1])]
    bodies = Bodies(source, like, index)
    for place in laid:
        t = like[place]
        for table in [*source.interior[t].values(), source.interface[t]]:
            if not table.shape[1]:
                continue
            x = numbers(table[PLACE:PLACE + 3].T) + corner[place]
            # few granules are of other bodies: their numbers are made now, so that the part can stand before the granules
            numbers_here = bodies.numbers_of(index[place], table[BODY].astype(int))
            bodies.add(numbers_here, x, numbers(table[RADIUS]), numbers(table[MASS]), table[HELD].astype(int))
    total = size * len(laid)
    interface = sum(source.interface[t].shape[1] for t in like.values())
    identity = int.from_bytes(hashlib.sha256(struct.pack("<4q", *copies, size, source.step) + os.urandom(16)).digest()[:8], "little")
    part = Path(f"{file}.part")
    with open(part, "wb") as f:
        write_head(f, source, copies, like, index, corner, floor, total, interface, identity, top, shift, walls)
        out = files.SectionWriter(f, identity)
        write_part(out, source, bodies, source.sides(copies), top)
        contacts = 0
        for place in laid:
            t = like[place]
            table = source.interface[t]
            if not table.shape[1]:
                continue
            x = words((numbers(table[PLACE:PLACE + 3].T) + corner[place]).T)
            body = bodies.numbers_of(index[place], table[BODY].astype(int))
            tag = table[TAG] + WORDS.type(index[place] * size + 1)
            out.put(files.INTERFACE, table.shape[1], files.packed_table([tag, body, *x, *table[RADIUS:]], len(tag)),
                    files.packed_table([np.empty(0, WORDS)] * (HISTORY + source.width), 0))
        strange = 0
        for place in laid:
            t, own = like[place], []
            count = 0
            for key, table in source.interior[t].items():
                x = numbers(table[PLACE:PLACE + 3].T)
                columns = list(packed_tile(source, t, key))
                columns[TAG] = table[TAG] + WORDS.type(index[place] * size + 1)
                columns[BODY] = bodies.numbers_of(index[place], table[BODY].astype(int))
                columns[PLACE], columns[PLACE + 1] = (words(x[:, d] + corner[place][d]) for d in (0, 1))
                for c in on_floor(source, key):
                    columns[c], wrong = elements(table[c], x + corner_then[t], x + corner[place], source.floor, floor)
                    strange += wrong
                own.append(files.packed_table(columns, table.shape[1]))
                count += table.shape[1]
            edges = contacts_of(source, bodies, place, like, index, copies)
            contacts += edges.shape[1]
            loads = wall_loads(source, t, index[place], corner_then[t], corner[place], floor)
            out.put(files.INTERIOR, count, files.packed_table([np.empty(0, WORDS)] * RECORD, 0),
                    files.packed_table(list(edges), edges.shape[1]), struct.pack("<Q", len(own)), *own,
                    *[files.packed_table(list(loads), loads.shape[1])] * bool(loads.shape[1]))
        out.close(total - interface, interface, contacts)
    if strange > 0.01 * max(1, total):
        part.unlink()
        raise files.CulledFileError(f"{strange} contacts with the floor are not with the elements below their granules: is it the bed's floor?")
    part.rename(file)
    return total


def contacts_of(source, bodies, place, like, index, copies):
    """Those within a tile, and those with tiles that were laid before."""
    size, found = source.size, []

    def those(t, way, low_place, high_place):
        table = source.contacts[t].get(way)
        if table is None:
            return
        one = table.copy()
        one[LOW] += WORDS.type(index[low_place] * size + 1)
        one[HIGH] += WORDS.type(index[high_place] * size + 1)
        one[C_BODY] = bodies.numbers_of(index[low_place], table[C_BODY].astype(int))
        found.append(one)
    those(like[place], (0, 0), place, place)
    for way in FORWARD:
        before = place[0] - way[0], place[1] - way[1]
        if before in index:
            those(like[before], way, before, place)
    return np.concatenate(found, axis=1) if found else np.empty((HISTORY + source.width, 0), WORDS)


def wall_loads(source, t, tile, corner_then, corner, floor):
    """What walls press on the granules of a tile, where it lies now: on the elements that are there, torques about the origin."""
    loads = source.wall_loads[t].copy()
    local = loads[L_TAG].astype(int)
    loads[L_TAG] += WORDS.type(tile * source.size + 1)
    on_mesh = np.flatnonzero(loads[L_MESH] != NO_MESH)
    x = source.places(t)[local[on_mesh]]
    loads[L_ELEMENT, on_mesh], _ = elements(loads[L_ELEMENT, on_mesh], x + corner_then, x + corner, source.floor, floor)
    force, torque = (numbers(loads[k:k + 3, on_mesh].T) for k in (L_FORCE, L_TORQUE))
    loads[L_TORQUE:L_TORQUE + 3, on_mesh] = words((torque + np.cross(corner - corner_then, force)).T)
    return loads


def write_part(out, source, bodies, sides, top):
    low = -2 * source.radius
    pose = [0, 0, 0, 0, 0, 0, 1]
    row = [low, low, low, sides[0] - low, sides[1] - low, top, *pose, *pose, 0, 0, 0, *sides, top]
    table = bodies.table()
    out.put(files.PART, 0, files.packed_table(list(words(np.array(row)).reshape(-1, 1)), 1),
            files.packed_table(source.layouts, len(source.layouts[0])), files.packed_table(list(words(table.T)), len(table)),
            *[files.packed_table(source.meshes, len(source.meshes[0]))] * bool(source.meshes))


def write_head(f, source, copies, like, index, corner, floor, total, interface, identity, top, shift, walls):
    """LIGGGHTS's part: its numbers, and the atoms: the ball, and the interface granules."""
    sides = source.sides(copies)

    def change(state):
        state[files.STATE_INTERIOR] = total - interface
        state[files.STATE_COUNTERS:files.STATE_COUNTERS + 6] = total, 0, 0, 0, 0, 0
        state[files.STATE_IDENTITY:files.STATE_IDENTITY + 2] = identity >> 32, identity & files.LOW
        state[files.STATE_WALLS:files.STATE_WALLS + 2] = walls >> 32, walls & files.LOW
    head = bytearray(files.with_state(tiles.without_meshes(source.head), change))
    where = tiles.header_places(head)
    low = -2 * source.radius
    for flag, value in zip(tiles.BOX, (low, sides[0] - low, low, sides[1] - low, low, top)):
        struct.pack_into("d", head, where[flag], value)
    atoms = [] if source.ball is None else [ball_over(source, copies, like, corner, total, shift)]
    struct.pack_into("q", head, where[tiles.NATOMS], len(atoms) + interface)
    for place, t in like.items():
        for tag in source.interface[t][TAG].astype(np.int64):
            atoms.append(moved_atom(source, int(tag), t, place, index, corner, floor))
    f.write(head)
    f.write(struct.pack("i", sum(map(len, atoms))))
    for record in atoms:
        record.tofile(f)


def ball_over(source, copies, like, corner, total, shift):
    """The ball's record: over the middle, as far above the first granule that it will touch as it was."""
    ball, sides, then = source.ball.copy(), source.sides(copies), source.sides(source.copies)
    places_then = [(i, j) for i in range(source.copies[0]) for j in range(source.copies[1])]
    corner_then = {place: source.corner(*place) for place in places_then}
    like_then = {place: place[0] * source.copies[1] + place[1] for place in places_then}
    ball[tiles.X + 2] += touch(source, like, corner, sides, ball[tiles.RADIUS]) - touch(source, like_then, corner_then, then, ball[tiles.RADIUS])
    ball[tiles.X:tiles.X + 2] += (np.array(sides) - then) / 2
    ball[tiles.X] += shift
    ball.view(np.int64)[tiles.TAG] = total + 1
    return ball


def touch(source, like, corner, sides, radius):
    """The height at which a ball that falls onto the middle of a bed touches its first granule (m)."""
    highest, middle = -np.inf, np.array(sides) / 2
    for place, t in like.items():
        if (abs(corner[place][:2] + source.period / 2 - middle) > source.period).any():
            continue
        for table in [*source.interior[t].values(), source.interface[t]]:
            x = numbers(table[PLACE:PLACE + 3].T) + corner[place]
            r = numbers(table[RADIUS]) + radius
            under = ((x[:, :2] - middle)**2).sum(1)
            below = under < r * r
            if below.any():
                highest = max(highest, float((x[below, 2] + np.sqrt(r[below]**2 - under[below])).max()))
    return highest


def moved_atom(source, tag, t, place, index, corner, floor):
    """The record of an interface granule at another place."""
    record = source.atoms[tag + 1 + t * source.size].copy()
    whole = record.view(np.int64)
    then = source.corner(t // source.copies[1], t % source.copies[1])
    x_then = record[tiles.X:tiles.X + 3].copy()
    record[tiles.X:tiles.X + 3] += corner[place] - then
    whole[tiles.TAG] = tag + 1 + index[place] * source.size
    at = tiles.EXTRA
    for style in source.blocks:
        if style == "contacthistory" and whole[at + 1]:  # contacts inside a body wait in the section, others are with the ball alone
            raise files.CulledFileError(f"granule {tag + 1 + t * source.size} touches an exterior one: let the bed rest longer")
        if style.startswith("contacthistory/mesh"):
            per = (int(record[at]) - 2) // max(1, whole[at + 1])
            for k in range(whole[at + 1]):
                c = at + 2 + k * per
                new, _ = elements(whole[c:c + 1], x_then[None], record[None, tiles.X:tiles.X + 3], source.floor, floor)
                whole[c] = int(new[0])
        at += int(record[at])
    return record

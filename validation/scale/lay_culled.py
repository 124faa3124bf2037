#!/usr/bin/python3
"""Lays the culled restart file of a large bed of that of a smaller one: no granule of it is ever an atom.

    validation/scale/lay_culled.py SOURCE NX NY FILE MX MY --floors FLOOR NEW-FLOOR [--period P] [--margin M] [--top Z] [--shift DX]

SOURCE: restart file that doze.in wrote on one rank, of a bed that tiles.py laid of NX x NY tiles, three at least each way, or as
many as FILE has. FILE: the bed of MX x MY tiles. Its sides, edges and corners are those of SOURCE, its middle is the middle of SOURCE, as often as it
takes; the tiles around the middle of SOURCE are those around the middle of FILE. FLOOR, NEW-FLOOR: the floors' STL files, grids
as scale.py writes them. The ball goes over the middle, DX beside it, as far above the first granule that it will touch.

It works tile by tile: what is in memory is SOURCE and one tile. Contacts, histories and what each granule was locked with go
along; the bodies' mass properties are summed anew, and LIGGGHTS settles their motion. Where tiles meet that did not meet in
SOURCE, the contacts are those that the western or southern one had.
"""
import argparse
import hashlib
import os
import struct
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))
import culled_files as files  # noqa: E402
import tiles  # noqa: E402
from solidcull_runs import errors  # noqa: E402

WORDS, NUMBERS = files.WORDS, np.dtype("<f8")
# columns of granules, in the order of StoredGranule::each_number(), and of contacts: see store_section.h
TAG, BODY, PLACE, RADIUS, MASS, CHANGE, LAYOUT, CLUMP, HELD, RECORD = 0, 1, 2, 5, 6, 9, 23, 25, 27, 29
LOW, HIGH, C_BODY, KNOWN, HISTORY = range(5)
VECTOR_WIDTH = 3
# numbers of a body, in the order of SolidBody::each_number()
ORIGIN, QUATERNION, COUNT, WEIGHING, B_HELD, ABOUT, B_MASS, FIRST, SECOND, SPIN, TWIST = 0, 3, 7, 8, 9, 10, 13, 14, 17, 26, 27
FROM_END = 24
CHANGED, SPANNED, SUMMED, FELT, FELT_KNOWN, STEP_THEN, GROUNDED, GROUNDED_MASS = 0, 1, 5, 6, 9, 13, 17, 18
MAIN = 0                                            # the body that holds nearly all, in what is written
FORWARD = ((0, 1), (1, -1), (1, 0), (1, 1))         # from a tile to those that come after it
BALL_RADIUS = 11                                    # word of an atom's record


class Floor:
    """A regular grid of triangles, two a square: which element a place is on."""

    def __init__(self, file):
        corners = np.array([line.split()[1:] for line in Path(file).read_text().splitlines() if line.split()[:1] == ["vertex"]], dtype=float)
        self.triangles = corners.reshape(-1, 3, 3)[:, :, :2]
        xs, ys = (np.unique(self.triangles[:, :, d].round(9)) for d in (0, 1))
        self.low, self.step = np.array([xs[0], ys[0]]), np.array([xs[1] - xs[0], ys[1] - ys[0]])
        self.n = len(xs) - 1, len(ys) - 1
        if len(self.triangles) != 2 * self.n[0] * self.n[1]:
            raise files.CulledFileError(f"{file} is no grid of triangles, two a square")

    def element(self, place):
        """For rows of places."""
        cell = np.clip(((place[:, :2] - self.low) / self.step).astype(int), 0, np.array(self.n) - 1)
        first = 2 * (cell[:, 0] * self.n[1] + cell[:, 1])
        a, b, c = (self.triangles[first, k] for k in range(3))
        def side(p, q):
            return (q[:, 0] - p[:, 0]) * (place[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (place[:, 0] - p[:, 0])
        one, two, three = side(a, b), side(b, c), side(c, a)
        inside = ((one >= 0) & (two >= 0) & (three >= 0)) | ((one <= 0) & (two <= 0) & (three <= 0))
        return np.where(inside, first, first + 1)


def numbers(words):
    return np.ascontiguousarray(words).view(NUMBERS)


def words(values):
    return np.ascontiguousarray(values, dtype=NUMBERS).view(WORDS)


def turn_of(quaternion):
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


class Source:
    """The granules of a culled restart file, tile by tile, from the tile's own corner, in the frame of the world."""

    def __init__(self, file, copies, period, margin, floor):
        section = files.Section(file)
        with open(file, "rb") as f:
            self.head = f.read(section.start)
        start, count = files.state_places(self.head)
        state = np.frombuffer(self.head, NUMBERS, count, start)
        if state[files.STATE_RANKS] != 1 or state[files.STATE_NO_PLACES]:
            raise files.CulledFileError(f"{file} was not written on one rank with store exact")
        self.width, self.step = int(state[files.STATE_WIDTH]), int(state[files.STATE_STEP])
        self.copies, self.period, self.margin, self.floor = copies, period, margin, floor
        self.read_atoms(section, file)
        n = copies[0] * copies[1]
        # granules of a tile: {columns: list of arrays}, one set of columns for each length of record; lists while reading
        self.interior, self.interface, contacts = [{} for _ in range(n)], [[] for _ in range(n)], [{} for _ in range(n)]
        for kind, _, _, data in section.chunks():
            if kind == files.PART:
                self.read_part(data)
                continue
            table, rows, at = files.unpacked_table(data, 0)
            if rows:
                self.split_interface(np.array(files.full(table)))
            table, rows, at = files.unpacked_table(data, at)
            if rows:
                self.split_contacts(np.array(files.full(table)), contacts)
            if kind == files.INTERIOR:
                more = struct.unpack_from("<Q", data, at)[0]
                at += 8
                for _ in range(more):
                    table, rows, at = files.unpacked_table(data, at)
                    self.split_interior(np.array(files.full(table)))
        self.interior = [{length: np.concatenate(parts, axis=1) for length, parts in sorted(of.items())} for of in self.interior]
        self.interface = [np.concatenate(parts, axis=1) if parts else np.empty((RECORD, 0), WORDS) for parts in self.interface]
        self.contacts = [{way: np.concatenate(parts, axis=1) for way, parts in of.items()} for of in contacts]
        self.packed = {}
        self.body_of = np.full((n, self.size), self.main)
        for t in range(n):
            for table in [*self.interior[t].values(), self.interface[t]]:
                self.body_of[t][table[TAG].astype(int)] = table[BODY].astype(int)

    # --- what there is

    def read_atoms(self, section, file):
        offset = tiles.records_offset(self.head)
        values = np.frombuffer(self.head, NUMBERS, offset=offset + 4).copy()
        self.blocks = tiles.extra_blocks(self.head, offset)
        self.atoms, at, highest = {}, 0, 0  # of interface granules, by tag
        while at < len(values):
            record = values[at:at + int(values[at])]
            tag = int(record.view(np.int64)[tiles.TAG])
            self.atoms[tag] = record
            at += len(record)
            highest = max(highest, tag)
        granules = section.interior + section.interface
        self.size, rest = divmod(granules, self.copies[0] * self.copies[1])
        loose = [tag for tag in self.atoms if tag > granules]
        if rest or len(loose) != 1 or len(self.atoms) - 1 != section.interface:
            raise files.CulledFileError(f"{file} holds {granules} culled granules and {len(self.atoms) - section.interface} others: "
                                        f"it is no bed of {self.copies[0]} x {self.copies[1]} equal tiles, asleep under one ball")
        self.ball = self.atoms.pop(loose[0])
        self.head = self.head[:offset]

    def read_part(self, data):
        _, _, at = files.unpacked_table(data, 0)
        text, _, at = files.unpacked_table(data, at)
        self.layouts = text
        lines = bytes(int(c) for c in text[0]).decode().splitlines() if text else []
        self.columns = []  # of each layout: where the contacts with meshes are in a record
        for line in lines:
            w, at_column, meshes = line.split(), 0, []
            for fix, length in zip(w[::2], map(int, w[1::2])):
                if fix.startswith("tracker_"):
                    meshes += [at_column + 1 + k * (1 + self.width) for k in range((length - 1) // (1 + self.width))]
                at_column += length
            self.columns.append((at_column, meshes))
        table, rows, _ = files.unpacked_table(data, at)
        self.bodies = numbers(np.array(files.full(table)).T.copy()) if rows else np.empty((0, 81))
        self.tail = self.bodies.shape[1] - FROM_END
        self.turns = np.array([turn_of(b[QUATERNION:QUATERNION + 4]) for b in self.bodies])
        self.main = int(self.bodies[:, COUNT].argmax())

    def to_world(self, table, place):
        """Columns place, place + 1, place + 2 of granules, from the corner of their tile; returns the tiles."""
        tag, body = table[TAG].astype(np.int64), table[BODY].astype(int)
        tile = (tag - 1) // self.size
        x = np.einsum("nij,nj->ni", self.turns[body], numbers(table[place:place + 3].T)) + self.bodies[body, ORIGIN:ORIGIN + 3]
        x[:, 0] -= self.margin + (tile // self.copies[1]) * self.period
        x[:, 1] -= self.margin + (tile % self.copies[1]) * self.period
        table[place:place + 3] = words(x.T)
        table[CHANGE:CHANGE + 3] = words(np.einsum("nij,nj->ni", self.turns[body], numbers(table[CHANGE:CHANGE + 3].T)).T)
        table[TAG] = (tag - 1 - tile * self.size).astype(WORDS)
        return tile

    def split_interface(self, table):
        tile = self.to_world(table, PLACE)
        for t in np.unique(tile):
            self.interface[t].append(table[:, tile == t])

    def split_interior(self, table):
        if table[CLUMP].any():
            raise files.CulledFileError("the restart file holds clumps: lay a bed of spheres")
        tile = self.to_world(table, PLACE)
        # what is on a mesh is on that element there: a granule on two at once is on the one below it
        for layout in np.unique(table[LAYOUT]):
            rows = np.flatnonzero(table[LAYOUT] == layout)
            for t in np.unique(tile[rows]):
                self.interior[t].setdefault((table.shape[0], int(layout)), []).append(table[:, rows[tile[rows] == t]])

    def split_contacts(self, table, to):
        low, high = (table[k].astype(np.int64) - 1 for k in (LOW, HIGH))
        one, other = low // self.size, high // self.size
        for v in range(0, self.width - self.width % VECTOR_WIDTH, VECTOR_WIDTH):
            h = slice(HISTORY + v, HISTORY + v + VECTOR_WIDTH)
            table[h] = words(np.einsum("nij,nj->ni", self.turns[table[C_BODY].astype(int)], numbers(table[h].T)).T)
        table[LOW], table[HIGH] = (low % self.size).astype(WORDS), (high % self.size).astype(WORDS)
        i, j = other // self.copies[1] - one // self.copies[1], other % self.copies[1] - one % self.copies[1]
        if abs(i).max() > 1 or abs(j).max() > 1:
            raise files.CulledFileError("contacts reach over more than one tile")
        key = one * 16 + (i + 1) * 4 + j + 1
        for k in np.unique(key):
            way = (int(k % 16 // 4) - 1, int(k % 4) - 1)
            to[k // 16].setdefault(way, []).append(table[:, key == k])

    def like(self, i, j, copies):
        """The number of the tile to lay at (i, j)."""
        def source(k, n, of):
            if n == of:
                return k
            if of < 3:
                raise files.CulledFileError(f"of {of} tiles in a row {n} cannot be laid: three at least have a middle")
            return 0 if k == 0 else of - 1 if k == n - 1 else 1 + (k - 1 + of // 2 - n // 2) % (of - 2)
        return source(i, copies[0], self.copies[0]) * self.copies[1] + source(j, copies[1], self.copies[1])


class Bodies:
    """The bodies of the bed that is laid: one that holds nearly all, and small ones. A body of SOURCE is one in each tile that it is
    in, and those are one that contacts tie together."""

    def __init__(self, source, like, index):
        self.source, self.sums, self.number, self.likes, self.parent = source, [None], {}, [source.main], {}
        for place, t in like.items():
            for way in FORWARD:
                after = place[0] + way[0], place[1] + way[1]
                table = source.contacts[t].get(way) if after in index else None
                if table is None:
                    continue
                ends = source.body_of[t][table[LOW].astype(int)], source.body_of[like[after]][table[HIGH].astype(int)]
                for k in np.flatnonzero((ends[0] != source.main) | (ends[1] != source.main)):
                    self.unite(self.node(index[place], int(ends[0][k])), self.node(index[after], int(ends[1][k])))

    def node(self, tile, body):
        return MAIN if body == self.source.main else (tile, body)

    def root(self, node):
        while node in self.parent:
            node = self.parent[node]
        return node

    def unite(self, a, b):
        a, b = self.root(a), self.root(b)
        if a != b:
            one, kept = (b, a) if a == MAIN else (a, b)
            self.parent[one] = kept

    def numbers_of(self, tile, bodies):
        """Here, of bodies of the source in a tile of the bed."""
        here = np.zeros(len(bodies), WORDS)
        for b in np.unique(bodies):
            root = self.root(self.node(tile, int(b)))
            if root != MAIN and root not in self.number:
                self.number[root] = len(self.sums)
                self.sums.append(None)
                self.likes.append(int(b))
            here[bodies == b] = MAIN if root == MAIN else self.number[root]
        return here

    def add(self, here, place, radius, mass, held):
        for b in np.unique(here).astype(int):
            of = here == b
            x, m = place[of], mass[of]
            about = x[0] if self.sums[b] is None else self.sums[b][0]
            arm = x - about
            more = [of.sum(), m.sum(), m @ arm, (m[:, None] * arm).T @ arm, 0.4 * (m * radius[of]**2).sum(), held[of].sum()]
            self.sums[b] = [about] + (more if self.sums[b] is None else [a + c for a, c in zip(self.sums[b][1:], more)])

    def table(self):
        source, tail = self.source, self.source.tail
        rows = np.zeros((len(self.sums), source.bodies.shape[1]))
        for row, like, sums in zip(rows, self.likes, self.sums):
            was, turn = source.bodies[like], source.turns[like]
            about, count, mass, first, second, spin, held = sums
            row[QUATERNION + 3] = 1
            row[COUNT], row[WEIGHING], row[B_HELD], row[B_MASS], row[SPIN] = count, count, held, mass, spin
            row[ABOUT:ABOUT + 3], row[FIRST:FIRST + 3] = about, first
            row[SECOND:SECOND + 9] = second.T.reshape(-1)
            row[tail + CHANGED], row[tail + SUMMED] = 1, count
            row[tail + FELT:tail + FELT + 3] = turn @ was[tail + FELT:tail + FELT + 3]
            row[tail + FELT_KNOWN], row[tail + STEP_THEN] = was[tail + FELT_KNOWN], -1
            row[tail + GROUNDED] = was[tail + GROUNDED]
            row[tail + GROUNDED_MASS] = mass * min(1.0, was[tail + GROUNDED_MASS] / was[B_MASS])
        return rows


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


def elements(old, place_then, place_now, floor_then, floor_now, name):
    """Numbers of floor elements, as words, of contacts of a column."""
    known = old.astype(np.int64)
    under = floor_then.element(place_then)
    now = floor_now.element(place_now)
    return np.where(known == under, now, (now + 1) % len(floor_now.triangles)).astype(WORDS), int((known != under).sum())


def lay(source, file, copies, floor, top, shift=0.0):
    """Writes the bed of copies[0] x copies[1] tiles. Returns how many granules it holds."""
    period, margin, size = source.period, source.margin, source.size
    laid = [(i, j) for i in range(copies[0]) for j in range(copies[1])]
    like = {place: source.like(*place, copies) for place in laid}
    index = {place: k for k, place in enumerate(laid)}
    corner = {(i, j): np.array([margin + i * period, margin + j * period, 0.0]) for i, j in laid}
    corner_then = [np.array([margin + t // source.copies[1] * period, margin + t % source.copies[1] * period, 0.0])
                   for t in range(source.copies[0] * source.copies[1])]
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
        write_head(f, source, copies, like, index, corner, floor, total, interface, identity, top, shift)
        out = files.SectionWriter(f, identity)
        write_part(out, source, bodies, [c * period + 2 * margin for c in copies], top)
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
                    columns[c], wrong = elements(table[c], x + corner_then[t], x + corner[place], source.floor, floor, file)
                    strange += wrong
                own.append(files.packed_table(columns, table.shape[1]))
                count += table.shape[1]
            edges = contacts_of(source, bodies, place, like, index, copies)
            contacts += edges.shape[1]
            out.put(files.INTERIOR, count, files.packed_table([np.empty(0, WORDS)] * RECORD, 0),
                    files.packed_table(list(edges), edges.shape[1]), struct.pack("<Q", len(own)), *own)
        out.close(total - interface, interface, contacts)
    part.rename(file)
    if strange > 0.01 * max(1, total):
        raise files.CulledFileError(f"{strange} contacts with the floor are not with the elements below their granules: is it the bed's floor?")
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


def write_part(out, source, bodies, sides, top):
    low = -2 * tiles.GRANULE
    pose = [0, 0, 0, 0, 0, 0, 1]
    row = [low, low, low, sides[0] - low, sides[1] - low, top, *pose, *pose, 0, 0, 0, *sides, top]
    table = bodies.table()
    out.put(files.PART, 0, files.packed_table(list(words(np.array(row)).reshape(-1, 1)), 1),
            files.packed_table(source.layouts, len(source.layouts[0])), files.packed_table(list(words(table.T)), len(table)))


def write_head(f, source, copies, like, index, corner, floor, total, interface, identity, top, shift):
    """LIGGGHTS's part: its numbers, and the atoms: the ball, and the interface granules."""
    sides = [c * source.period + 2 * source.margin for c in copies]

    def change(state):
        state[files.STATE_INTERIOR] = total - interface
        state[files.STATE_COUNTERS:files.STATE_COUNTERS + 6] = total, 0, 0, 0, 0, 0
        state[files.STATE_IDENTITY:files.STATE_IDENTITY + 2] = identity >> 32, identity & files.LOW
    head = bytearray(files.with_state(tiles.without_meshes(source.head), change))
    where = tiles.header_places(head)
    low = -2 * tiles.GRANULE
    for flag, value in zip(tiles.BOX, (low, sides[0] - low, low, sides[1] - low, low, top)):
        struct.pack_into("d", head, where[flag], value)
    struct.pack_into("q", head, where[tiles.NATOMS], 1 + interface)
    ball = source.ball.copy()
    then = [c * source.period + 2 * source.margin for c in source.copies]
    corner_then = {(t // source.copies[1], t % source.copies[1]): np.array([source.margin + t // source.copies[1] * source.period,
                                                                          source.margin + t % source.copies[1] * source.period, 0.0])
                   for t in range(source.copies[0] * source.copies[1])}
    like_then = {place: place[0] * source.copies[1] + place[1] for place in corner_then}
    ball[tiles.X + 2] += touch(source, like, corner, sides, ball[BALL_RADIUS]) - touch(source, like_then, corner_then, then, ball[BALL_RADIUS])
    ball[tiles.X:tiles.X + 2] += (np.array(sides) - then) / 2
    ball[tiles.X] += shift
    ball.view(np.int64)[tiles.TAG] = total + 1
    atoms = [ball]
    for place, t in like.items():
        for tag in source.interface[t][TAG].astype(np.int64):
            atoms.append(moved_atom(source, int(tag), t, place, index, corner, floor))
    f.write(head)
    f.write(struct.pack("i", sum(map(len, atoms))))
    for record in atoms:
        record.tofile(f)


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
    then = np.array([source.margin + t // source.copies[1] * source.period, source.margin + t % source.copies[1] * source.period, 0])
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
                new, _ = elements(whole[c:c + 1], x_then[None], record[None, tiles.X:tiles.X + 3], source.floor, floor, "")
                whole[c] = int(new[0])
        at += int(record[at])
    return record


def main(argv=None):
    p = argparse.ArgumentParser(prog="lay_culled.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("source", type=Path)
    p.add_argument("from_copies", type=int, nargs=2, metavar="N")
    p.add_argument("file", type=Path)
    p.add_argument("copies", type=int, nargs=2, metavar="M")
    p.add_argument("--floors", nargs=2, required=True, metavar="STL")
    p.add_argument("--period", type=float, default=0.075, help="m: edge of a tile")
    p.add_argument("--margin", type=float, default=tiles.GRANULE, help="m: from the tiles to the sides")
    p.add_argument("--top", type=float, default=0.12, help="m: height of the box")
    p.add_argument("--shift", type=float, default=0.0, help="m: the ball, along x")
    a = p.parse_args(argv)
    source = Source(a.source, tuple(a.from_copies), a.period, a.margin, Floor(a.floors[0]))
    n = lay(source, a.file, tuple(a.copies), Floor(a.floors[1]), a.top, a.shift)
    print(f"{a.file}: {n} granules")
    return 0


if __name__ == "__main__":
    errors.command("lay_culled", main)

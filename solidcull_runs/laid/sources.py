"""The bed that a larger one is laid of: a culled restart file, tile by tile."""
import struct

import numpy as np

from . import culled_files as files
from . import tiles
from .columns import (C_BODY, CHANGE, CLUMP, COUNT, FROM_END, HIGH, HISTORY, L_TAG, LAYOUT, LOAD_COLUMNS, LOW, NUMBERS, ORIGIN, PLACE,
                      QUATERNION, RADIUS, RECORD, TAG, VECTOR_WIDTH, BODY, numbers, turn_of, words)
from .columns import WORDS


class Source:
    """The granules of a culled restart file, tile by tile, from the tile's own corner, in the frame of the world."""

    def __init__(self, file, copies, period, margin, floor):
        """`period` (m): edge of a tile, or its edges along x and y."""
        section = files.Section(file)
        with open(file, "rb") as f:
            self.head = f.read(section.start)
        start, count = files.state_places(self.head)
        state = np.frombuffer(self.head, NUMBERS, count, start)
        if state[files.STATE_RANKS] != 1 or state[files.STATE_NO_PLACES]:
            raise files.CulledFileError(f"{file} was not written on one rank with store exact")
        self.width, self.step = int(state[files.STATE_WIDTH]), int(state[files.STATE_STEP])
        self.copies, self.period, self.margin, self.floor = copies, np.broadcast_to(period, 2), margin, floor
        self.read_atoms(section, file)
        n = copies[0] * copies[1]
        # granules of a tile: {columns: list of arrays}, one set of columns for each length of record; lists while reading
        self.interior, self.interface, contacts = [{} for _ in range(n)], [[] for _ in range(n)], [{} for _ in range(n)]
        self.wall_loads = [[np.empty((LOAD_COLUMNS, 0), WORDS)] for _ in range(n)]
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
                table, rows = files.last_table(data, at)
                if rows:
                    self.split_wall_loads(np.array(files.full(table)))
        self.interior = [{length: np.concatenate(parts, axis=1) for length, parts in sorted(of.items())} for of in self.interior]
        self.interface = [np.concatenate(parts, axis=1) if parts else np.empty((RECORD, 0), WORDS) for parts in self.interface]
        self.contacts = [{way: np.concatenate(parts, axis=1) for way, parts in of.items()} for of in contacts]
        self.wall_loads = [np.concatenate(parts, axis=1) for parts in self.wall_loads]
        self.radius = max(float(numbers(t[RADIUS]).max()) for of in self.interior for t in of.values() if t.shape[1])
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
        if rest or len(loose) > 1 or len(self.atoms) - len(loose) != section.interface:
            raise files.CulledFileError(f"{file} holds {granules} culled granules and {len(self.atoms) - section.interface} others: "
                                        f"it is no bed of {self.copies[0]} x {self.copies[1]} equal tiles, asleep, with one ball above or none")
        self.ball = self.atoms.pop(loose[0]) if loose else None
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
        table, rows, at = files.unpacked_table(data, at)
        self.meshes, _ = files.last_table(data, at)
        self.bodies = numbers(np.array(files.full(table)).T.copy()) if rows else np.empty((0, 81))
        self.tail = self.bodies.shape[1] - FROM_END
        self.turns = np.array([turn_of(b[QUATERNION:QUATERNION + 4]) for b in self.bodies])
        self.main = int(self.bodies[:, COUNT].argmax())

    def to_world(self, table, place):
        """Columns place, place + 1, place + 2 of granules, from the corner of their tile; returns the tiles."""
        tag, body = table[TAG].astype(np.int64), table[BODY].astype(int)
        tile = (tag - 1) // self.size
        x = np.einsum("nij,nj->ni", self.turns[body], numbers(table[place:place + 3].T)) + self.bodies[body, ORIGIN:ORIGIN + 3]
        x[:, 0] -= self.margin + (tile // self.copies[1]) * self.period[0]
        x[:, 1] -= self.margin + (tile % self.copies[1]) * self.period[1]
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

    def split_wall_loads(self, table):
        tag = table[L_TAG].astype(np.int64) - 1
        table[L_TAG] = (tag % self.size).astype(WORDS)
        for t in np.unique(tag // self.size):
            self.wall_loads[t].append(table[:, tag // self.size == t])

    def places(self, t):
        """Of the interior granules of a tile, from its corner, by their tags in it."""
        at = np.full((self.size, 3), np.nan)
        for table in self.interior[t].values():
            at[table[TAG].astype(int)] = numbers(table[PLACE:PLACE + 3].T)
        return at

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

    def corner(self, i, j):
        """Of the tile (i, j) of any bed with these tiles and sides (m)."""
        return np.array([self.margin + i * self.period[0], self.margin + j * self.period[1], 0.0])

    def sides(self, copies):
        """Length and width (m) of a bed of so many tiles."""
        return [copies[axis] * self.period[axis] + 2 * self.margin for axis in (0, 1)]

    def like(self, i, j, copies):
        """The number of the tile to lay at (i, j)."""
        def source(k, n, of):
            if n == of:
                return k
            if of < 3:
                raise files.CulledFileError(f"of {of} tiles in a row {n} cannot be laid: three at least have a middle")
            return 0 if k == 0 else of - 1 if k == n - 1 else 1 + (k - 1 + of // 2 - n // 2) % (of - 2)
        return source(i, copies[0], self.copies[0]) * self.copies[1] + source(j, copies[1], self.copies[1])

"""Makes a large bed of a small one: lays copies of a settled tile, periodic in x and y, beside one another.

It works on LIGGGHTS's restart files, so that the contact histories (tangential springs) go with the granules and the copies
hold one another as the tile held itself: only at the outer sides and on the floor does anything have to settle anew.
The layout of the file is that of write_restart.cpp, atom_vec_sphere.cpp and fix_contact_history.cpp of LIGGGHTS 3.8.
"""
import re
import struct

import numpy as np

from ..errors import RunError

# the header: a flag, then its value. Flags by what follows them (all others: an int)
STRINGS, BIGINTS, DOUBLES = {0, 4, 22}, {5, 23, 25, 28, 31, 34}, set(range(37, 52))
NATOMS, PERIODIC, BOUNDARY, BOX = 23, (13, 14), (16, 17, 18, 19), (37, 38, 39, 40, 41, 42)
FIXED = 1                         # a boundary that is not periodic, `f`
X, TAG, IMAGE, EXTRA = 1, 4, 7, 17  # words of a granule's record; word 0 is its length, the fixes' values begin at EXTRA
FIRST_IMAGE = 512 << 20 | 512 << 10 | 512
NOBODY = 0                          # tag of a partner that is not there
RADIUS = 11                          # word of a granule's record


class RestartError(RunError):
    pass


def header_places(data):
    """Where the header keeps each value: offset by flag."""
    places, at = {}, 0
    while (flag := struct.unpack_from("i", data, at)[0]) >= 0:
        at += 4
        places[flag] = at
        if flag in STRINGS:
            at += 4 + struct.unpack_from("i", data, at)[0]
        else:
            at += 8 if flag in BIGINTS or flag in DOUBLES else 4
    return places


def records_offset(data):
    """Where the granules begin, which end the file: a count (int) of doubles, then the doubles."""
    for at in range(min(len(data) - 4, 1 << 20)):
        if struct.unpack_from("i", data, at)[0] * 8 == len(data) - at - 4:
            return at
    raise RestartError("no granules found in the restart file; was it written on several ranks?")


def extra_blocks(data, end):
    """Styles of the fixes that keep values with each granule, in the order of these values; their table ends at `end`."""
    def string(at):
        n = struct.unpack_from("i", data, at)[0] if at + 4 <= end else 0
        return (data[at + 4:at + 3 + n].decode("latin-1"), at + 4 + n) if 1 < n < 200 and at + 4 + n <= end else (None, end + 1)

    longest = []  # any smaller number before some entries can look like a table's count
    for start in range(end - 4, 3, -1):
        count, at, styles = struct.unpack_from("i", data, start)[0], start + 4, []
        while 0 < count < 50 and len(styles) < count and at < end:
            _, at = string(at)
            style, at = string(at)
            at += 4  # the largest size
            styles.append(style)
        if len(styles) == count and at == end and count > len(longest):
            longest = styles
    if "contacthistory" not in longest:
        raise RestartError("no contact histories found in the restart file")
    return longest


def partner_words(words, starts, block):
    """Places, in the array of all words, of the partners' tags in the contact histories; and each one's granule."""
    whole = words.view(np.int64)
    at = starts + EXTRA
    for _ in range(block):
        at = at + words[at].astype(int)
    count = whole[at + 1]
    owner = np.repeat(np.arange(len(starts)), count)
    per_partner = (words[at].astype(int) - 2) // np.maximum(count, 1)
    first = np.repeat(np.cumsum(count) - count, count)
    return np.repeat(at + 2, count) + (np.arange(len(owner)) - first) * np.repeat(per_partner, count), owner


def without_meshes(header):
    """The header with the meshes' fixes called otherwise, so that a deck's own meshes do not become those of the file."""
    def entry(name, style):
        return struct.pack("i", len(name) + 1) + name + b"\0" + struct.pack("i", len(style) + 1) + style + b"\0"
    for style in (b"mesh/surface", b"mesh/surface/stress"):
        for match in re.finditer(rb"([\w-]+)\0.{4}" + re.escape(style) + rb"\0", header, re.S):
            header = header.replace(entry(match[1], style), entry(b"-" * len(match[1]), style))
    return header


class Bed:
    """The granules of a restart file, tile by tile. `copies`: how many tiles it was laid of; (1, 1) and no margin: a periodic tile."""

    def __init__(self, file, copies, period, margin, roll):
        """`period` (m): edge of a tile, or its edges along x and y; `margin` (m): from the tiles to the sides; `roll`: the middle of a
        periodic tile becomes its corner."""
        period = np.broadcast_to(period, 2)
        data = open(file, "rb").read()
        offset = records_offset(data)
        self.header, self.copies = without_meshes(data[:offset]), copies
        words = np.frombuffer(data, dtype=np.float64, offset=offset + 4).copy()
        lengths, at = [], 0
        while at < len(words):
            lengths.append(int(words[at]))
            at += lengths[-1]
        lengths = np.array(lengths)
        starts = np.cumsum(lengths) - lengths
        whole = words.view(np.int64)
        self.radius = float(words[starts + RADIUS].max())
        tag = whole[starts + TAG]
        self.size, rest = divmod(len(starts), copies[0] * copies[1])
        if rest or not np.array_equal(np.sort(tag), np.arange(1, len(starts) + 1)):
            raise RestartError(f"the {len(starts)} granules of {file} are not {copies[0]} x {copies[1]} tiles of one size")
        tile = (tag - 1) // self.size
        place = np.empty((len(starts) + 1, 2))  # by tag, from the tile's own corner
        for axis, number in enumerate((tile // copies[1], tile % copies[1])):
            x = words[starts + X + axis] - margin - number * period[axis]
            if roll:
                x = (x + period[axis] / 2) % period[axis]
            words[starts + X + axis] = place[tag, axis] = x
        whole[starts + TAG] -= tile * self.size
        whole[starts + IMAGE] = FIRST_IMAGE
        at, owner = partner_words(words, starts, extra_blocks(data, offset).index("contacthistory"))
        held = whole[at] != NOBODY
        at, owner = at[held], owner[held]
        apart = (place[tag[owner]] - place[whole[at]]) / period
        across = np.rint(apart).astype(int)  # tiles from the granule's to the partner's
        if (np.abs(apart - across).max(axis=0) * period > 3 * self.radius).any():
            raise RestartError(f"{file}: contact partners lie far from one another")
        whole[at] = (whole[at] - 1) % self.size + 1
        self.tiles = []
        of_word, position = np.repeat(tile, lengths), np.empty(len(words), dtype=int)
        for k in range(copies[0] * copies[1]):
            mine = of_word == k
            position[mine] = np.arange(mine.sum())
            chosen = tile[owner] == k
            self.tiles.append((words[mine], position[starts[tile == k]], position[at[chosen]], across[chosen]))

    def like(self, i, j, copies):
        """The tile to lay at (i, j): of the same side or corner, or from the middle."""
        def source(k, n, of):
            return 0 if k == 0 or of == 1 else of - 1 if k == n - 1 else 1 + (k - 1) % (of - 2)
        return self.tiles[source(i, copies[0], self.copies[0]) * self.copies[1] + source(j, copies[1], self.copies[1])]


def lay(source, bed, copies, period, margin, top, beyond=None):
    """Writes the restart file `bed`: copies[0] x copies[1] tiles of the Bed `source`, between sides (the first at x = 0, y = 0)
    that stand `margin` outside of them, under an open top. Granules are numbered tile by tile. `beyond` (m): how far LIGGGHTS's box
    reaches below the floor and out of the sides."""
    period = np.broadcast_to(period, 2)
    count = source.size * copies[0] * copies[1]
    chosen = {(i, j): source.like(i, j, copies) for i in range(copies[0]) for j in range(copies[1])}
    header = bytearray(source.header)
    where = header_places(header)
    for flag in PERIODIC:
        struct.pack_into("i", header, where[flag], 0)
    for flag in BOUNDARY:
        struct.pack_into("i", header, where[flag], FIXED)
    low = -(2 * source.radius if beyond is None else beyond)
    sides = [copies[axis] * period[axis] + 2 * margin for axis in (0, 1)]
    for flag, value in zip(BOX, (low, sides[0] - low, low, sides[1] - low, low, top)):
        struct.pack_into("d", header, where[flag], value)
    struct.pack_into("q", header, where[NATOMS], count)
    with open(bed, "wb") as f:
        f.write(header)
        f.write(struct.pack("i", sum(len(words) for words, *_ in chosen.values())))
        for (i, j), (words, starts, partners, across) in chosen.items():
            one = words.copy()
            whole = one.view(np.int64)
            one[starts + X] += i * period[0] + margin
            one[starts + X + 1] += j * period[1] + margin
            whole[starts + TAG] += source.size * (i * copies[1] + j)
            tile = np.array([i, j]) + across
            there = ((tile >= 0) & (tile < copies)).all(1)
            whole[partners] = np.where(there, whole[partners] + source.size * (tile[:, 0] * copies[1] + tile[:, 1]), NOBODY)
            one.tofile(f)
    return count

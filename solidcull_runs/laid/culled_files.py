"""Restart files that hold culled granules: LIGGGHTS's part, and the section at the end. In and out, chunk by chunk.

The format of the section stands in fix_solid_cull/culling/store_section.h, that of the fix's numbers in LIGGGHTS's part in
fix_solid_cull/culling/snapshot.cpp. tests/test_lay_culled.py sees that this file agrees with them.
"""
import shutil
import struct

import numpy as np

from ..errors import RunError
from . import tiles

BEGINS, ENDS = b"SDCULLB1", b"SDCULLE1"
END = 72                                                 # bytes of a section's end
PART, INTERFACE, INTERIOR = 1, 2, 3                      # kinds of chunks
ONE, MOST, FEW, LIKE, NARROW, PLAIN = range(6)           # ways to keep a column
MARK = 20261228.0                                        # of the fix's numbers
(STATE_MARK, STATE_SIZE, STATE_INTERIOR, STATE_DIAMETER) = range(1, 5)
STATE_COUNTERS, STATE_WIDTH, STATE_RANKS, STATE_STEP, STATE_NO_PLACES, STATE_SECTION, STATE_WALLS, STATE_IDENTITY, STATE_TYPES = 9, 15, 16, 17, 18, 19, 23, 25, 27
HIGH, LOW = 0xffffffff00000000, 0xffffffff
WORDS = np.dtype("<u8")


class CulledFileError(RunError):
    pass


def section_sum(words):
    """Of an array of words: as section_sum() in store_section.cpp."""
    with np.errstate(over="ignore"):
        w = words + np.arange(1, len(words) + 1, dtype=np.uint64) * np.uint64(0x9e3779b97f4a7c15)
        w = (w ^ (w >> np.uint64(32))) * np.uint64(0xd6e8feb86659fd93)
        return np.add.reduce(w ^ (w >> np.uint64(29)), dtype=np.uint64)


def words_of(data):
    return np.frombuffer(bytes(data), dtype=WORDS)


# --- tables -----------------------------------------------------------------------------------------------------------

def packed_column(column):
    """One column of a table, without regard to the others."""
    n = len(column)
    different, which, count = np.unique(column, return_inverse=True, return_counts=True)
    usual = different[count.argmax()] if n else np.uint64(0)
    others = n - (count.max() if n else 0)
    if others == 0:
        return struct.pack("<BQ", ONE, int(usual))
    narrow = int(different[-1]) <= LOW
    sizes = {MOST: 12 + 12 * others, NARROW if narrow else PLAIN: n * (4 if narrow else 8)}
    if len(different) <= 64:
        sizes[FEW] = 1 + 8 * len(different) + n
    way = min(sizes, key=sizes.get)
    if way == MOST:
        rows = np.flatnonzero(column != usual)
        return struct.pack("<BQI", MOST, int(usual), others) + rows.astype("<u4").tobytes() + column[rows].tobytes()
    if way == FEW:
        return struct.pack("<BB", FEW, len(different)) + different.tobytes() + which.astype("u1").tobytes()
    return bytes([way]) + (column.astype("<u4") if way == NARROW else column).tobytes()


def packed_table(columns, rows):
    """`columns`: arrays of words, bytes that packed_column() gave, or numbers of earlier columns that are alike."""
    parts = [struct.pack("<II", rows, len(columns))]
    for c in columns:
        parts.append(c if isinstance(c, bytes) else struct.pack("<BI", LIKE, c) if isinstance(c, int) else packed_column(c))
    return b"".join(parts)


def unpacked_table(data, at):
    """The columns of a table as arrays of words, for those like another its number; and where the table ends."""
    rows, count = struct.unpack_from("<II", data, at)
    at += 8
    columns = []
    for _ in range(count):
        way = data[at]
        at += 1
        if way in (ONE, MOST):
            column = np.full(rows, struct.unpack_from("<Q", data, at)[0], dtype=WORDS)
            at += 8
            if way == MOST:
                n = struct.unpack_from("<I", data, at)[0]
                at += 4
                column[np.frombuffer(data, "<u4", n, at)] = np.frombuffer(data, WORDS, n, at + 4 * n)
                at += 12 * n
        elif way == FEW:
            n = data[at]
            column = np.frombuffer(data, WORDS, n, at + 1)[np.frombuffer(data, "u1", rows, at + 1 + 8 * n)]
            at += 1 + 8 * n + rows
        elif way == LIKE:
            column = struct.unpack_from("<I", data, at)[0]
            at += 4
        elif way == NARROW:
            column = np.frombuffer(data, "<u4", rows, at).astype(WORDS)
            at += 4 * rows
        elif way == PLAIN:
            column = np.frombuffer(data, WORDS, rows, at)
            at += 8 * rows
        else:
            raise CulledFileError(f"a column is kept in an unknown way, {way}")
        columns.append(column)
    return columns, rows, at


def last_table(data, at):
    """Of one that is left out where it is empty: its columns, and its rows."""
    return unpacked_table(data, at)[:2] if len(data) - at >= WORDS.itemsize else ([], 0)


def full(columns):
    return [columns[c] if isinstance(c, int) else c for c in columns]


# --- sections -----------------------------------------------------------------------------------------------------------

class Section:
    """The section of a restart file, to be read in a stream."""

    def __init__(self, file):
        self.file = open(file, "rb")
        size = self.file.seek(0, 2)
        if size >= END:
            self.file.seek(size - END)
        end = self.file.read(END)
        if len(end) < END or end[:8] != ENDS:
            raise CulledFileError(f"{file} holds no culled granules at its end: write it with the fix solid/cull, and copy it whole")
        self.identity, self.length, parts, _, self.interior, self.interface, self.contacts, total = struct.unpack("<8Q", end[8:])
        table = b""
        if self.length <= size and 32 * parts < self.length:
            self.file.seek(size - END - 32 * parts)
            table = self.file.read(32 * parts)
        if len(table) != 32 * parts or total != section_sum(words_of(table + end[:-8])):
            raise CulledFileError(f"{file} is damaged at its end")
        self.start, self.name = size - self.length, file
        self.parts = list(struct.iter_unpack("<4Q", table))

    def chunks(self):
        """Kind, rank, granules and bytes of each, parts one after the other."""
        for place, count, _, _ in self.parts:
            self.file.seek(self.start + place)
            rows = self.file.read(32 * count)
            if self.file.read(8) != struct.pack("<Q", int(section_sum(words_of(rows)))):
                raise CulledFileError(f"{self.name} is damaged among its granules")
            for at, _, _, _ in struct.iter_unpack("<4Q", rows):
                self.file.seek(self.start + at)
                head = self.file.read(40)
                kind, rank, granules, size, total = struct.unpack("<5Q", head)
                data = self.file.read(size)
                with np.errstate(over="ignore"):
                    if len(data) != size or total != section_sum(words_of(data)) + section_sum(words_of(head[:32])):
                        raise CulledFileError(f"{self.name} is damaged among its granules")
                yield kind, rank, granules, data


class SectionWriter:
    """Appends a section of one part to a file that is open."""

    def __init__(self, file, identity):
        self.file, self.identity, self.bytes, self.rows = file, identity, 16, []
        file.write(BEGINS + struct.pack("<Q", identity))

    def put(self, kind, granules, *tables):
        data = b"".join(tables)
        data += bytes(-len(data) % 8)
        head = struct.pack("<4Q", kind, 0, granules, len(data))
        with np.errstate(over="ignore"):
            total = section_sum(words_of(data)) + section_sum(words_of(head))
        self.file.write(head + struct.pack("<Q", int(total)) + data)
        self.rows.append((self.bytes, 40 + len(data), kind, granules))
        self.bytes += 40 + len(data)

    def close(self, interior, interface, contacts):
        rows = b"".join(struct.pack("<4Q", *row) for row in self.rows)
        self.file.write(rows + struct.pack("<Q", int(section_sum(words_of(rows)))))
        table = struct.pack("<4Q", self.bytes, len(self.rows), sum(row[1] for row in self.rows), sum(row[3] for row in self.rows))
        length = self.bytes + len(rows) + 8 + len(table) + END
        end = table + ENDS + struct.pack("<7Q", self.identity, length, 1, len(self.rows), interior, interface, contacts)
        self.file.write(end + struct.pack("<Q", int(section_sum(words_of(end)))))


# --- the fix's numbers ------------------------------------------------------------------------------------------------

def word_sum(numbers):
    """As WordSum."""
    total, all_bits = 14695981039346656037, (1 << 64) - 1
    for word in np.asarray(numbers, dtype="<f8").view(WORDS):
        total = (total ^ int(word)) * 1099511628211 & all_bits
        total ^= total >> 32
    return total


def state_places(head):
    """Where the numbers of the fix solid/cull lie in LIGGGHTS's part, and how many they are."""
    style = b"solid/cull\0"
    at = head.find(style)
    while at >= 0:
        size = struct.unpack_from("<i", head, at + len(style))[0]
        start = at + len(style) + 4
        if size > 0 and size % 8 == 0 and start + size <= len(head) and struct.unpack_from("<d", head, start)[0] * 8 == size:
            if struct.unpack_from("<d", head, start + 8)[0] != MARK:
                raise CulledFileError("the restart file was written by another version of solidcull: write it again with this one")
            return start, size // 8
        at = head.find(style, at + 1)
    raise CulledFileError("no fix solid/cull has written to the restart file")


def with_state(head, change):
    """The head with change(numbers) made to the fix's numbers, and their check sum."""
    start, count = state_places(head)
    numbers = np.frombuffer(head, "<f8", count, start).copy()
    change(numbers)
    total = word_sum(numbers[:-2])
    numbers[-2:] = total >> 32, total & LOW
    return head[:start] + numbers.tobytes() + head[start + 8 * count:]


def with_ball_moved(source, file, by):
    """A copy of a culled restart file whose ball, the granule of the highest tag, is farther along x by so much (m)."""
    shutil.copyfile(source, file)
    with open(source, "rb") as f:
        head = f.read(Section(source).start)
    at, highest = tiles.records_offset(head) + 4, (0, 0)
    while at < len(head):
        highest = max(highest, (struct.unpack_from("<q", head, at + 8 * tiles.TAG)[0], at))
        at += 8 * int(struct.unpack_from("<d", head, at)[0])
    with open(file, "r+b") as f:
        place = highest[1] + 8 * tiles.X
        f.seek(place)
        f.write(struct.pack("<d", struct.unpack_from("<d", head, place)[0] + by))

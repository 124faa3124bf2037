"""Solid bodies of a bed that is laid."""
import numpy as np

from .columns import (ABOUT, B_HELD, B_MASS, CHANGED, COUNT, FELT, FELT_KNOWN, FIRST, GROUNDED, GROUNDED_MASS, HIGH, LOW, MOTION, QUATERNION,
                      SECOND, SPIN, STEP_THEN, SUMMED, WEIGHING, WORDS)

MAIN = 0                                            # the body that holds nearly all, in what is written
FORWARD = ((0, 1), (1, -1), (1, 0), (1, 1))         # from a tile to those that come after it


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
            row[MOTION], row[MOTION + 1:MOTION + 4] = mass, about + first / mass  # a look asks for the weight before they are settled
            row[SECOND:SECOND + 9] = second.T.reshape(-1)
            row[tail + CHANGED], row[tail + SUMMED] = 1, count
            row[tail + FELT:tail + FELT + 3] = turn @ was[tail + FELT:tail + FELT + 3]
            row[tail + FELT_KNOWN], row[tail + STEP_THEN] = was[tail + FELT_KNOWN], -1
            row[tail + GROUNDED] = was[tail + GROUNDED]
            row[tail + GROUNDED_MASS] = mass * min(1.0, was[tail + GROUNDED_MASS] / was[B_MASS])
        return rows

"""Columns of what is culled, as they stand in a restart file, and what is computed of them."""
import numpy as np

from . import culled_files as files

WORDS, NUMBERS = files.WORDS, np.dtype("<f8")
# columns of granules, in the order of StoredGranule::each_number(), and of contacts: see store_section.h
TAG, BODY, PLACE, RADIUS, MASS, CHANGE, LAYOUT, CLUMP, HELD, RECORD = 0, 1, 2, 5, 6, 9, 23, 25, 27, 29
LOW, HIGH, C_BODY, KNOWN, HISTORY = range(5)
L_TAG, L_MESH, L_ELEMENT, L_FORCE, L_TORQUE, LOAD_COLUMNS = 0, 1, 2, 3, 6, 9  # of what walls press on granules
NO_MESH = WORDS.type(2**64 - 1)  # of a wall that reports no load
VECTOR_WIDTH = 3
# numbers of a body, in the order of SolidBody::each_number()
ORIGIN, QUATERNION, COUNT, WEIGHING, B_HELD, ABOUT, B_MASS, FIRST, SECOND, SPIN, TWIST, MOTION = 0, 3, 7, 8, 9, 10, 13, 14, 17, 26, 27, 36
FROM_END = 24  # where the numbers begin that follow, from the end of a row
CHANGED, SPANNED, SUMMED, FELT, FELT_KNOWN, STEP_THEN, GROUNDED, GROUNDED_MASS = 0, 1, 5, 6, 9, 13, 17, 18


def numbers(words):
    return np.ascontiguousarray(words).view(NUMBERS)


def words(values):
    return np.ascontiguousarray(values, dtype=NUMBERS).view(WORDS)


def turn_of(quaternion):
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])

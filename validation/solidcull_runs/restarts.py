"""What a restart file holds beside LIGGGHTS's own part."""
from pathlib import Path

ENDS, END_WORDS = b"SDCULLE1", 8  # the end of a section of culled granules, see culling/store_section.h


def holds_culled(file):
    """Whether culled granules stand at the end of a restart file; False where it cannot be read."""
    try:
        return ENDS in Path(file).read_bytes()[-8 * END_WORDS:][:len(ENDS)]
    except OSError:
        return False

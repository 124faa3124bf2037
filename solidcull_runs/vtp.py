"""Reads the .vtp files of the keywords `bed` and `mesh`, and the lists of times beside them. It needs NumPy alone, so Blender's Python
has all it takes."""
import json
import re
import xml.etree.ElementTree as xml
import zlib
from pathlib import Path

import numpy as np

TYPES = {"Float32": "<f4", "Int32": "<i4", "Int64": "<i8"}
MARK = b'<AppendedData encoding="raw">'


def read(file):
    """{"time" (s), "points", "polys" (triangles, if there are any), every array by name}; granules by id, whatever rank wrote them."""
    data = Path(file).read_bytes()
    mark = data.find(MARK)
    if mark < 0:
        raise ValueError(f"{file}: no .vtp file of fix solid/cull: it has no appended raw data")
    root = xml.fromstring(data[:mark] + b"</VTKFile>")
    if (root.get("header_type"), root.get("compressor")) != ("UInt64", "vtkZLibDataCompressor"):
        raise ValueError(f"{file}: no .vtp file of fix solid/cull: its arrays are not compressed by zlib behind UInt64 headers")
    begin = data.index(b"_", mark) + 1
    time = float(root.find("PolyData/FieldData/DataArray[@Name='TimeValue']").text)
    pieces = [arrays_of(piece, data, begin) for piece in root.findall("PolyData/Piece")]
    pieces = [p for p in pieces if len(p["points"])] or pieces[:1]  # a rank may have nothing
    return {"time": time, **(joined(pieces) if len(pieces) > 1 else pieces[0])}


def joined(pieces):
    """Granules by id; triangles with each vertex once, which borders of ranks have once for each rank."""
    whole = {name: np.concatenate([p[name] for p in pieces]) for name in pieces[0]}
    if "id" in whole:
        order = np.argsort(whole["id"], kind="stable")
        return {name: values[order] for name, values in whole.items()}
    before = np.cumsum([0, *(len(p["points"]) for p in pieces)])
    whole["points"], number = np.unique(whole["points"], axis=0, return_inverse=True)
    whole["polys"] = number.reshape(-1)[np.concatenate([p["polys"] + n for p, n in zip(pieces, before)])]
    return whole


def arrays_of(piece, data, begin):
    arrays, at = {}, {}
    for part in ("Points", "PointData", "CellData", "Polys"):
        for a in piece.findall(f"{part}/DataArray"):
            offset, width = int(a.get("offset")), int(a.get("NumberOfComponents"))
            if offset not in at:
                at[offset] = np.frombuffer(unpacked(data, begin + offset), TYPES[a.get("type")])
            arrays["points" if part == "Points" else a.get("Name")] = at[offset].reshape(-1, width) if width > 1 else at[offset]
    arrays["points"] = arrays["points"].astype(float)
    if int(piece.get("NumberOfPolys")):
        arrays["polys"] = arrays["connectivity"].reshape(-1, 3)
    arrays.pop("connectivity", None)
    arrays.pop("offsets", None)
    return arrays


def unpacked(data, at):
    """An array's bytes: blocks of one size but for a shorter last one, each compressed by itself."""
    blocks, *_ = np.frombuffer(data, "<u8", 1, at)
    sizes = np.frombuffer(data, "<u8", int(blocks), at + 24).astype(int)
    ends = at + 24 + 8 * int(blocks) + np.cumsum(sizes)
    return b"".join(zlib.decompress(data[end - size:end]) for size, end in zip(sizes, ends))


def frames(listed):
    """[(time in s, file)] of a .series file, by time."""
    listed = Path(listed)
    return sorted((f["time"], listed.parent / f["name"]) for f in json.loads(listed.read_text())["files"])


def file_at(pattern, step):
    """The file of a `*` pattern for a step, or None."""
    file = Path(str(pattern).replace("*", f"{step:09d}"))
    return file if file.exists() else None


def steps_of(pattern):
    """The steps for which files of a `*` pattern exist."""
    pattern = Path(pattern)
    before, after = pattern.name.split("*")
    names = (f.name[len(before):len(f.name) - len(after)] for f in pattern.parent.glob(pattern.name))
    return sorted(int(n) for n in names if re.fullmatch("[0-9]+", n))

#!/usr/bin/python3
"""What stands out in the code, and whether each member has one owner.

    scripts/measure_house.py [--top N] [FOLDER...]      default: fix_solid_cull region_interface_mesh

Prints classes by data members and by functions, functions by lines, files by lines; and how much the parts of the culling hold of each
other. Then every place where a class could write what another one owns: a data member that is public in a class with private ones, a
friend, a function that hands out a member to be written, and structs of culling/ and solid/ that several owners write (shared_state.py).
Reads the sources as text, formatted as .clang-format has them. Exit: 0 each member has one owner, 1 it has not, 2 misuse.
"""
import argparse
import re
import sys
from collections import defaultdict
from pathlib import Path

from shared_state import House

ROOT = Path(__file__).resolve().parents[1]
STATE = ("culling", "solid")  # folders whose structs are looked at for who writes them
MANY_FUNCTIONS = 50
# handed out to be written, on purpose: why
HANDED_OUT = {
    "Solid::body": "SolidBody's own functions change it", "Solid::bodies_in_motion": "likewise",
    "SolidBodies::body": "for Solid alone", "SolidBodies::bodies": "for Solid alone",
    "WallSurvey::rows": "for the engine's copies", "Survey::rows": "for the engine's copies", "Cover::rows": "for the engine's copies",
    "ShellClosure::rows": "for the engine's copies", "Shell::labels": "the engine reads f_ID there", "Culling::labels": "likewise",
    "ChunkedArray::row": "a container's elements", "FlatMap::find": "likewise", "Seen::data": "room on the caller's stack",
    "RestartFile::name": "the engine's interface wants it so, and may change it",
}
FRIENDS = {
    "Expose": "how the engine's private members are reached, see engine_access.cpp",
    "InterfaceMesh": "write_vdb takes the grids themselves, so that OpenVDB stays out of the headers",
}


def without_comments(text):
    text = re.sub(r'"(\\.|[^"\\\n])*"', '""', text)
    text = re.sub(r"//[^\n]*", "", text)
    return re.sub(r"/\*.*?\*/", lambda m: "\n" * m.group().count("\n"), text, flags=re.S)


def block_end(text, at):
    """Index after the brace that closes the one at `at`."""
    depth = 0
    for i in range(at, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return i + 1
    return len(text)


def flat(body):
    """A class body without what stands in inner braces."""
    out, depth = [], 0
    for c in body:
        if c == "{":
            depth += 1
            out.append("{}" if depth == 1 else "")
        elif c == "}":
            depth -= 1
        elif depth == 0:
            out.append(c)
    return "".join(out)


def classes(text):
    """(name, kind, body) of each class and struct, inner ones too."""
    for m in re.finditer(r"\b(class|struct)\s+([\w:]+)\s*(?:final\s*)?(?::[^{;()]*)?\{", text):
        yield m.group(2), m.group(1), text[m.end():block_end(text, m.end() - 1) - 1]


def members(body, kind):
    """Of a class body: data members by access, functions by access."""
    access, data, functions = "public" if kind == "struct" else "private", defaultdict(list), defaultdict(list)
    statement = ""
    for line in flat(body).split("\n"):
        m = re.match(r"\s*(public|private|protected)\s*:\s*(.*)", line)
        if m:
            access, statement = m.group(1), ""
            line = m.group(2)
        statement += " " + line.strip()
        while re.search(r";|\{\}", statement):
            part, rest = re.split(r";|\{\}", statement, maxsplit=1)
            cut = statement[len(part):len(part) + 1]
            statement = rest
            part = re.sub(r"\s+", " ", part).strip()
            if not part or re.match(r"(using|friend|static_assert|template <.*> (class|struct)|class|struct|enum|typedef|return|\W)", part):
                if part.startswith("friend"):
                    functions["friend"].append(part)
                continue
            part = re.sub(r"^template <[^()]*?> ", "", part)
            name = re.match(r"(?:[\w:<>,&*\s\[\]~=]+?)??([~\w]+|operator\W+)\s*\(", part)
            if name and not re.match(r"[^(]*=", part.split("(")[0].replace("operator=", "")):
                functions[access].append((name.group(1), part))
            elif cut == ";" or not name:
                if part.startswith(("static constexpr", "static const ", "constexpr")):
                    continue
                for n in re.findall(r"([A-Za-z]\w*)\s*(?:=[^,]*|\{\})?(?:,|$)", re.sub(r"<[^;]*>", "", part)):
                    if n not in ("const", "override", "default", "delete", "noexcept"):
                        data[access].append(n)
    return data, functions


def functions_of(text):
    """(name, first line, lines) of the functions that are defined at namespace level."""
    lines = text.split("\n")
    i = 0
    while i < len(lines):
        if re.match(r"[A-Za-z~]", lines[i]) and not re.match(r"(namespace|using|class|struct|enum|#|template|typedef|extern)", lines[i]):
            j, head = i, ""
            while j < len(lines) and "{" not in lines[j] and ";" not in lines[j]:
                head += lines[j]
                j += 1
            if j < len(lines) and "{" in lines[j] and "(" in head + lines[j]:
                name = re.search(r"([\w:~]+(?:operator\W+)?)\s*\(", head + lines[j])
                at = sum(len(l) + 1 for l in lines[:j]) + lines[j].index("{")
                end = text[:block_end(text, at)].count("\n")
                yield (name.group(1) if name else "?"), i + 1, end - i + 1
                i = end
        i += 1


def table(title, rows, top):
    print(f"\n{title}")
    for row in rows[:top]:
        print("  " + "  ".join(str(x) for x in row))


def how_parts_hold_each_other(house, files, by_class):
    """(number, what it counts) of the constructors of culling/, its structs of parts, its lines."""
    constructors = references = 0
    parts = []
    for f in files:
        if "culling" not in f.parts or f.suffix != ".h":
            continue
        for name, _, body in classes(without_comments(f.read_text())):
            for m in re.finditer(rf"(?<![\w~:]){name}\(", flat(body)):
                taken = flat(body)[m.end():].split(")")[0] if "(" not in flat(body)[m.end():].split(")")[0] else ""
                if re.fullmatch(rf"\s*(const )?{name} ?&+ ?\w*\s*", taken):
                    continue  # of another of its kind
                constructors += 1
                references += taken.count("&")
            fields = house.fields_by_file[f.stem].get(name, {})
            held = [t for t in fields.values() if house.of(t.type.replace("const ", "").split("::")[-1]) not in house.open | {None}]
            if (f.stem, name) in house.open and 2 * len(held) > len(fields):
                parts.append((len(fields), name))
    lines = sum(f.read_text().count("\n") for f in files if f.parent.name in STATE)
    over = [f"{n} ({w})" for _, w, n, _ in sorted(by_class, key=lambda r: -r[1]) if w > MANY_FUNCTIONS]
    largest = max(parts, default=(0, "none"))
    yield references, "references that constructors of culling/ take"
    yield constructors, "constructors of culling/"
    yield largest[0], f"fields of the largest struct of parts: {largest[1]}"
    yield len(over), f"classes with more than {MANY_FUNCTIONS} functions{': ' if over else ''}{', '.join(over)}"
    yield lines, "lines of culling/ and solid/"
    yield len(house.unknown), "writes whose target was not found out"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--top", type=int, default=12)
    parser.add_argument("folders", nargs="*", default=["fix_solid_cull", "region_interface_mesh"])
    args = parser.parse_args()
    files = sorted(f for d in args.folders for f in (ROOT / d).rglob("*") if f.suffix in (".h", ".cpp"))
    if not files:
        print(f"measure_house: no sources in {' '.join(args.folders)}", file=sys.stderr)
        return 2
    by_class, by_function, by_file, faults = [], [], [], []
    for f in files:
        raw = f.read_text()
        text = without_comments(raw)
        where = f.relative_to(ROOT)
        by_file.append((raw.count("\n"), where))
        for name, line, length in functions_of(text):
            by_function.append((length, f"{name}  {where}:{line}"))
        for name, kind, body in classes(text):
            data, functions = members(body, kind)
            count = sum(len(v) for v in data.values())
            written = sum(len(v) for k, v in functions.items() if k != "friend")
            by_class.append((count, written, name, where))
            private = data["private"] + data["protected"]
            if kind == "class" and private and data["public"]:
                faults.append(f"{where}: class {name} shows members beside its own: {', '.join(data['public'][:6])}")
            for friend in functions["friend"] if name not in FRIENDS else []:
                faults.append(f"{where}: {name}: {friend}")
            for function, declared in functions["public"]:
                gives = re.match(r"(?:virtual |inline )?([\w:<>,\s]+[&*]) ?" + re.escape(function) + r"\s*\(", declared)
                if gives and not gives.group(1).startswith("const") and f"{name}::{function}" not in HANDED_OUT and kind == "class" \
                        and not function.startswith("operator") and private:
                    faults.append(f"{where}: {name}::{function} hands out {gives.group(1)}")
    house = House({f: without_comments(f.read_text()) for f in files}, [f for f in files if f.parent.name in STATE], classes, functions_of)
    for struct, writes in house.shared():
        owners = defaultdict(list)
        for w in writes:
            owners[w.owner].append(f"{w.file.name}:{w.line}")
        faults.append(f"{struct} is written by {len(owners)} owners: "
                      + "; ".join(f"{o} ({', '.join(at[:3])}{', ...' if len(at) > 3 else ''})" for o, at in owners.items()))
    by_class.sort(key=lambda r: (-r[0], r[2]))
    table("classes: data members, functions", [(f"{c:4d} {w:4d}", n, p) for c, w, n, p in by_class], args.top)
    table("classes by functions", [(f"{w:4d}", n, p) for c, w, n, p in sorted(by_class, key=lambda r: -r[1])], args.top)
    table("functions: lines", [(f"{n:4d}", name) for n, name in sorted(by_function, key=lambda r: -r[0])], args.top)
    table("files: lines", [(f"{n:4d}", p) for n, p in sorted(by_file, key=lambda r: -r[0])], args.top)
    print("\nculling/ and solid/")
    for value, what in how_parts_hold_each_other(house, files, by_class):
        print(f"  {value:5d}  {what}")
    print(f"\n{len(by_file)} files, {sum(n for n, _ in by_file)} lines, {len(by_function)} functions at namespace level, {len(by_class)} classes")
    if faults:
        print("\nmembers with more than one owner:")
        for f in faults:
            print("  " + f)
        return 1
    print("each member has one owner")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Which structs without private members are written by more than one owner; read from sources as text, see measure_house.py.

An owner is a class with its header, or for a free function the file it stands in. A write is an assignment to a field or to a whole
element, or a call that changes a container (`clear`, `push_back`, ...). A value that a function or a class has for itself is its own:
what counts is written through a reference or a pointer, by one owner, while another one writes that struct too.
"""
import re
from collections import defaultdict, namedtuple

Write = namedtuple("Write", "struct field owner file line")
Declared = namedtuple("Declared", "type refers")  # refers: it is a reference or a pointer

CHANGES = {"clear", "erase", "push_back", "emplace_back", "pop_back", "resize", "insert", "emplace", "assign", "swap", "add", "add_row",
           "append", "merge", "extract", "setZero", "extend", "reset"}
ELEMENTS = {"at", "back", "front", "find", "begin", "end", "data", "row", "value", "get"}  # give part of the object they are asked of
WORDS = {"return", "new", "delete", "else", "case", "goto", "throw", "using", "const", "typename", "operator", "and", "or", "not"}
TYPE = r"(?:[A-Za-z_][\w:]*)(?:<(?:[^<>;{}()]|<(?:[^<>;{}()]|<[^<>;{}()]*>)*>|\([^()]*\))*>)?(?:::\w+)?"
DECLARATION = re.compile(r"(?:template <.*?> )?(?:(?:static|virtual|inline|explicit|mutable|constexpr) )*"
                         rf"((?:const )?{TYPE})( ?[&*]+ ?| )(.+)")
MAP = re.compile(r"std::(unordered_)?map\b")
ASSIGNMENT = re.compile(r"(?<![=!<>+\-*/|&%^])(?:<<|>>|[-+*/|&^%])?=(?![=])|\+\+|--")


def close_of(text, at, pair):
    depth = 0
    for i in range(at, len(text)):
        depth += (text[i] == pair[0]) - (text[i] == pair[1])
        if depth == 0:
            return i
    return len(text)


def open_of(text, at, pair):
    depth = 0
    for i in range(at, -1, -1):
        depth += (text[i] == pair[1]) - (text[i] == pair[0])
        if depth == 0:
            return i
    return 0


def arguments(type_):
    """Those of a template, as text."""
    at = type_.find("<")
    if at < 0:
        return []
    found, depth, start = [], 0, at + 1
    for i in range(at, len(type_)):
        depth += {"<": 1, "(": 1, ">": -1, ")": -1}.get(type_[i], 0)
        if (type_[i] == "," and depth == 1) or (type_[i] == ">" and depth == 0):
            found.append(type_[start:i].strip())
            start = i + 1
        if depth == 0:
            break
    return found


def bare(type_):
    return re.sub(r"\bconst\b|[&*]|\btypename\b", "", type_).strip()


def postfix_before(text, end):
    """The expression that ends at `end`, as `a.b[i]->c(d).e`; and where it begins."""
    i = end
    while i > 0:
        while i > 0 and text[i - 1].isspace():
            i -= 1
        if text[i - 1] in ")]":
            i = open_of(text, i - 1, "()" if text[i - 1] == ")" else "[]")
            if i > 0 and (text[i - 1].isalnum() or text[i - 1] in "_])"):
                continue
            if i > 0 and text[i - 1] == ">":  # a cast or a template's call
                return None, i
        else:
            j = i
            while j > 0 and (text[j - 1].isalnum() or text[j - 1] == "_"):
                j -= 1
            if j == i:
                return None, i
            i = j
        if text[i - 1] == "." and not text[i - 2].isdigit():
            i -= 1
        elif text[i - 2:i] == "->":
            i -= 2
        elif text[i - 2:i] == "::":
            return None, i
        else:
            break
    stars = i
    while stars > 0 and text[stars - 1] == "*" and not re.search(r"[\w)\]>] ?\*+$", text[max(0, stars - 12):stars]):
        stars -= 1
    return re.sub(r"\s+", " ", text[stars:end].strip()), stars


def steps(expression):
    """root and what follows it: ('.', name), ('->', name), ('[', ''), ('(', '')."""
    stars = len(expression) - len(expression.lstrip("*"))
    text = expression[stars:]
    while text.startswith("(") and close_of(text, 0, "()") == len(text) - 1:
        return steps(text[1:-1].strip())[0], steps(text[1:-1].strip())[1] + [("[", "")] * stars
    if text.startswith("("):
        close = close_of(text, 0, "()")
        root, after = steps(text[1:close].strip())
        text = text[close + 1:]
    else:
        m = re.match(r"\w+", text)
        if not m:
            return None, []
        root, after, text = m.group(), [], text[m.end():]
    while text:
        text = text.lstrip()
        m = re.match(r"(\.|->)\s*(\w+)", text)
        if m:
            after.append((m.group(1), m.group(2)))
            text = text[m.end():]
        elif text[:1] in "[(" and text:
            after.append((text[0], ""))
            text = text[close_of(text, 0, "[]" if text[0] == "[" else "()") + 1:]
        else:
            return None, []
    return root, after + [("[", "")] * stars


class House:
    """files: path -> text without comments. classes, members, functions_of: as measure_house has them."""

    def __init__(self, files, looked_at, classes, functions_of):
        self.files, self.classes, self.functions_of = files, classes, functions_of
        self.methods, self.home, self.aliases = defaultdict(dict), {}, {}
        self.folder_of = {path.stem: path.parent for path in files}
        self.fields_by_file, self.files_of, self.open, self.stem = defaultdict(dict), defaultdict(list), set(), ""
        for path, text in files.items():
            for m in re.finditer(r"\busing (\w+) = ([^;]+);", text):
                self.aliases.setdefault(m.group(1), re.sub(r"\s+", " ", m.group(2)))
            for name, kind, body in classes(text):
                name = name.split("::")[-1]
                fields, private = self.declared_in(name, kind, body)
                self.fields_by_file[path.stem].setdefault(name, fields)
                self.files_of[name].append(path.stem)
                self.home.setdefault(name, path.stem)
                if fields and not private and path.suffix == ".h" and path in looked_at:
                    self.open.add((path.stem, name))
        self.writes, self.unknown = [], []  # (Write, whose the object is: own, shared); (file, line, expression)
        for path in looked_at:
            self.stem = path.stem
            self.read(path, files[path])

    def declared_in(self, name, kind, body):
        """Fields with their types; whether one of them is private. Notes what functions give."""
        fields, private, access = {}, False, "public" if kind == "struct" else "private"
        depth, flat = 0, []
        for c in body:
            depth -= c == "}"
            flat.append(c if depth == 0 else "")
            depth += c == "{"
        for statement in re.split(r";|\{\}", re.sub(r"\b(public|private|protected)\s*:", r";\1:;", "".join(flat))):
            statement = re.sub(r"\s+", " ", statement).strip()
            if re.fullmatch(r"(public|private|protected):", statement):
                access = statement[:-1]
                continue
            m = DECLARATION.match(statement)
            if not m or statement.startswith(("using", "friend", "struct", "class", "enum", "return", "static constexpr")):
                continue
            gives, mark, rest = m.groups()
            called = re.match(r"(operator ?(?:\[\]|\(\)|\W+)|\w+) ?\(", rest)
            if called:
                known = self.methods[name].get(called.group(1).replace(" ", ""))
                if not known or known.type.startswith("const "):
                    self.methods[name][called.group(1).replace(" ", "")] = Declared(gives, mark.strip())
                continue
            for one in re.split(r",(?![^<(]*[>)])", rest):
                n = re.match(r"\s*([&*]?) ?(\w+)", one)
                if n:
                    fields[n.group(2)] = Declared(gives, mark.strip() or n.group(1))
                    private |= access != "public"
        return fields, private

    def of(self, name):
        """(file, name) of the class that the file which is read means by it: its own first, then one of its folder."""
        stems = self.files_of.get(name)
        if not stems:
            return None
        near = [s for s in stems if s == self.stem] or [s for s in stems if self.folder_of[s] == self.folder_of[self.stem]] or stems
        return near[0], name

    def fields(self, name):
        key = self.of(name)
        return self.fields_by_file[key[0]][name] if key else {}

    def whole(self, type_):
        """The type with aliases spelled out."""
        for _ in range(4):
            type_ = bare(type_)
            name = type_.split("::")[-1] if "<" not in type_ else ""
            if name in self.aliases and name not in self.files_of:
                type_ = self.aliases[name]
        return type_

    def structs_in(self, type_):
        """Those of which it is a container, or which it is."""
        return {self.of(s) for s in re.findall(r"\w+", self.whole(type_)) if self.of(s) in self.open}

    def element(self, type_):
        type_ = self.whole(type_)
        inside = arguments(type_)
        if not inside:
            m = self.methods.get(type_.split("::")[-1], {}).get("operator[]")
            return m.type if m else type_
        return inside[1] if MAP.match(type_) else inside[0]

    def pair_or_element(self, type_):
        """What an iterator leads to."""
        whole = self.whole(type_)
        return f"std::pair<{', '.join(arguments(whole)[:2])}>" if MAP.match(whole) else self.element(whole)

    def along(self, type_, owned, after):
        """Follows the steps; gives what the last one has, whose it is, and the structs that hold it by value."""
        holders = []
        for k, (how, name) in enumerate(after):
            if how == "->":
                whole = self.whole(type_)
                if whole.startswith("std::pair") is False and arguments(whole):
                    type_ = self.element(type_)
            if how in (".", "->"):
                whole = self.whole(type_)
                short = re.sub(r"<.*", "", whole).split("::")[-1]
                called = k + 1 < len(after) and after[k + 1][0] == "("
                if called:
                    given = self.methods.get(short, {}).get(name)
                    if name in ELEMENTS and arguments(whole):
                        type_ = self.pair_or_element(type_) if name in ("find", "begin", "end") else self.element(type_)
                    elif given:
                        type_ = given.type
                        if "const" in type_.split():
                            return None, "const", []
                        owned = "shared" if given.refers else "local"
                        holders = []
                    else:
                        return None, owned, holders
                elif whole.startswith("std::pair") and name in ("first", "second"):
                    type_ = arguments(whole)[name == "second"]
                elif name in self.fields(short):
                    field = self.fields(short)[name]
                    if self.of(short) in self.open:
                        holders.append((self.of(short), name))
                    if field.refers:
                        owned, holders = "shared", []
                    type_ = field.type
                else:
                    return None, owned, holders
            elif how == "[":
                type_ = self.element(type_)
        return type_, owned, holders

    def root_of(self, root, path, text, at, begin, class_, deep=0):
        """Type of a name at this place, and whose it is: local, own, shared."""
        if root == "this":
            return class_, "own"
        found = None
        others = r"(?:\w+(?: = [^;]*?)?, [&*]?)*?"  # declared with it
        declaration = rf"(?<![\w.:>])((?:const )?{TYPE})(?: const)?(\s*[&*]+\s*(?:const )?|\s+){others}\b{root}\b\s*(?=[;,)=({{:\[])"
        for m in re.compile(declaration).finditer(text, begin, at):
            if m.group(1).replace("const ", "") not in WORDS:
                found = m
        if not found:
            for m in re.finditer(rf"\bauto\s*(&*)\s*\[[^\]]*\b{root}\b[^\]]*\]\s*[=:]", text[begin:at]):
                found = m
            if found:
                return None, "local" if not found.group(1) else "shared"
        if not found:
            field = self.fields(class_).get(root)
            if field:
                return field.type, "shared" if field.refers else "own"
            return None, "unknown"
        type_, mark, after = found.group(1), found.group(2), text[found.end():]
        init = re.match(r"\s*(?:=|:|\{|\()\s*", after)
        if type_.startswith("const ") and "*" not in mark:
            return (None if bare(type_) == "auto" else type_), "const"
        if "&" not in mark and "*" not in mark and bare(type_) != "auto":
            return type_, "local"
        if init and deep < 4:
            stop = re.match(r"(?:[^;(){}]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)|\{[^{}]*\})*", after[init.end():]).group()
            source = stop.strip().lstrip("&").rstrip(")} ") if after.lstrip()[:1] in "{(" else stop.strip().lstrip("&")
            source = source.split(" ? ")[-1].split(" : ")[-1].strip().lstrip("&")
            first, steps_ = steps(source)
            if first:
                t, owned = self.root_of(first, path, text, found.start(), begin, class_, deep + 1)
                if t or owned in ("const",):
                    t, owned, _ = self.along(t, owned, steps_) if t else (None, owned, [])
                if after.lstrip()[:1] == ":" and t:
                    t = self.pair_or_element(t)
                leads_there = "&" in mark or "*" in mark or re.search(r"(find|begin|data|back|get)\([^()]*\)$|^&", source)
                if t and not leads_there and owned != "const":
                    owned = "local"
                return (t if bare(type_) == "auto" else type_), owned if owned != "unknown" else "shared"
        return (None if bare(type_) == "auto" else type_), "shared" if "&" in mark or "*" in mark else "local"

    def spans(self, path, text):
        """(begin, end, class) of each function at namespace level."""
        starts = [0]
        for line in text.split("\n"):
            starts.append(starts[-1] + len(line) + 1)
        for name, line, length in self.functions_of(text):
            yield starts[line - 1], starts[min(line - 1 + length, len(starts) - 1)], name.split("::")[-2] if "::" in name else None
        for m in re.finditer(r"\b(?:class|struct)\s+(\w+)\s*(?:final\s*)?(?::[^{;()]*)?\{", text):
            yield m.end(), close_of(text, m.end() - 1, "{}"), m.group(1)

    def read(self, path, text):
        spans = sorted(self.spans(path, text), key=lambda s: s[1] - s[0])
        for m in re.finditer(ASSIGNMENT.pattern + r"|(?:\.|->)(?:" + "|".join(CHANGES) + r")\(", text):
            call = m.group().endswith("(")
            grown = re.match(r"\w+(?:(?:\.|->)\w+|\[[^\]]*\])*", text[m.end():]) if m.group() in ("++", "--") else None
            if grown:
                self.note(path, text, m.start(), grown.group(), spans)
                continue
            expression, begins = postfix_before(text, m.start())
            if not expression:
                continue
            before = text[:begins].rstrip()
            simple = re.fullmatch(r"\w+", expression)
            if not call and simple and re.search(r"[\w>&*\]]$", before) and not re.search(r"\b(return|else)$", before):
                continue  # a declaration
            self.note(path, text, begins, expression, spans, call)

    def note(self, path, text, at, expression, spans, call=False):
        root, after = steps(expression)
        if not root or root in WORDS:
            return
        around = [s for s in spans if s[0] <= at < s[1]]
        if not around:
            return
        begin, _, class_ = around[0]
        owner_class = around[-1][2] if around else None
        if after and after[0][0] == "(":  # a function of its own
            given = self.methods.get(class_, {}).get(root)
            type_, owned = (given.type, "shared" if given.refers else "local") if given else (None, "unknown")
        else:
            type_, owned = self.root_of(root, path, text, at, begin if path.suffix == ".cpp" else around[-1][0], class_)
        if owned == "local" or not type_ and (owned == "const" or not any(how in (".", "->") for how, _ in after)):
            return
        line = text[:at].count("\n") + 1
        if not type_:
            self.unknown.append((path, line, expression))
            return
        holders = []
        end, owned, holders = self.along(type_, owned, after)
        if owned in ("local", "const"):
            return
        hit = dict(holders)
        if end and (after or call):
            whole = self.whole(end)
            if not call and self.of(whole.split("::")[-1]) in self.open:
                hit.setdefault(self.of(whole.split("::")[-1]), "all of it")
            elif arguments(whole) or not call:
                for s in self.structs_in(end):
                    hit.setdefault(s, "elements")
        elif end:
            for s in self.structs_in(end):
                hit.setdefault(s, "all of it")
        if not end and not holders and owned != "const" and after[-1][0] != "(":
            self.unknown.append((path, line, expression))
        owner = self.home.get(owner_class, path.stem) if owner_class else path.stem
        for struct, field in hit.items():
            self.writes.append((Write(struct, field, owner, path, line), owned))

    def shared(self):
        """struct -> writes, where more than one owner writes and one of them what is not its own."""
        by_struct = defaultdict(list)
        for write, owned in self.writes:
            by_struct[write.struct].append((write, owned))
        for struct, writes in sorted(by_struct.items()):
            telling = [(w, o) for w, o in writes if o == "shared" or w.field not in ("elements", "all of it")]
            if len({w.owner for w, _ in telling}) > 1 and any(o == "shared" for _, o in telling):
                yield struct[1], [w for w, _ in writes]

"""Pages of text, tables and pictures, as Markdown and as HTML; and tables between two marks of a page that is kept."""
import base64
import html
import re
from pathlib import Path

from ..errors import RunError

END = "<!-- end -->"


def anchor(title):
    """The name that Markdown gives a heading."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


class Page:
    """Blocks of text, tables and pictures, written as Markdown and as HTML."""

    def __init__(self):
        self.blocks = []

    def heading(self, level, text):
        self.blocks.append(("heading", level, text))

    def text(self, text):
        self.blocks.append(("text", text))

    def table(self, head, rows):
        self.blocks.append(("table", head, [[str(c) for c in row] for row in rows]))

    def picture(self, file, what):
        self.blocks.append(("picture", file, what))

    def markdown(self, pictures=None):
        """`pictures`: the names of those that are shown; all if not said."""
        out = []
        for kind, *b in self.blocks:
            if kind == "heading":
                out.append("#" * b[0] + " " + b[1])
            elif kind == "text":
                out.append(b[0])
            elif kind == "picture":
                if pictures is None or b[0].name in pictures:
                    out.append(f"![{b[1]}]({b[0].name})")
            else:
                out.append("\n".join("| " + " | ".join(cells) + " |" for cells in [b[0], ["---"] * len(b[0]), *b[1]]))
        return "\n\n".join(out) + "\n"

    def html(self, title):
        def marked(text):
            text = html.escape(text)
            text = re.sub(r"`([^`]+)`", r"<code>\1</code>", text)
            text = re.sub(r"\[([^]]+)\]\((#[^)]+)\)", r'<a href="\2">\1</a>', text)
            return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", text)
        out = [f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title><style>body{{font:15px/1.5 sans-serif;"
               "max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;"
               "padding:.2em .6em;text-align:left}img{max-width:100%}</style>"]
        for kind, *b in self.blocks:
            if kind == "heading":
                out.append(f'<h{b[0]} id="{anchor(b[1])}">{marked(b[1])}</h{b[0]}>')
            elif kind == "text":
                out.append(f"<p>{marked(b[0])}</p>")
            elif kind == "picture":
                data = base64.b64encode(b[0].read_bytes()).decode()
                out.append(f'<p><img alt="{html.escape(b[1])}" src="data:image/png;base64,{data}"></p>')
            else:
                rows = "".join("<tr>" + "".join(f"<td>{marked(c)}</td>" for c in row) + "</tr>" for row in b[1])
                out.append("<table><tr>" + "".join(f"<th>{marked(c)}</th>" for c in b[0]) + f"</tr>{rows}</table>")
        return "\n".join(out) + "\n"


def write(file, text):
    """Whole or not at all."""
    part = Path(file).with_suffix(".part")
    part.write_text(text)
    part.rename(file)


def between_marks(file, begin, table, text=None):
    """The text of a page with a table between its lines `begin` and END. `text`: the page's, if not that of the file."""
    text = Path(file).read_text() if text is None else text
    found = re.search(rf"({re.escape(begin)}\n).*?({re.escape(END)})", text, re.S)
    if not found:
        raise RunError(f"{file} has no lines '{begin}' and '{END}' to put a table between")
    return text[:found.end(1)] + table + text[found.start(2):]

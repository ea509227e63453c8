"""Let (17), Figure 3 and Table B2 in the text of a chapter lead to what they name."""

import re

from docutils import nodes

TAG = re.compile(r"\\tag\*?\{([^}]*)\}")
RESULT = re.compile(r'<figure class="result" id="((figure|table)-(\w+))"')
NUMBER = r"[A-Z]?\d\w*"
ONE = re.compile(rf"(?:(?P<kind>[Ff]igure|[Tt]able)s?\s+)?(?P<number>{NUMBER})")
SEVERAL = re.compile(
    rf"(?<!\w)\({NUMBER}(?:(?:,\s?|–|-|\sand\s){NUMBER})*\)"
    rf"|\b(?:[Ff]igure|[Tt]able)s?\s+{NUMBER}(?:(?:,\s|–|\s(?:and|to)\s|,\sand\s){NUMBER})*\b"
)
# Where a number in brackets is no reference, or is one already.
LEFT = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.reference)
LEFT = (*LEFT, nodes.title, nodes.raw, nodes.comment, nodes.target)


def places(document: nodes.document) -> dict:
    """Give each numbered equation a place; return the places of a chapter by (kind, number)."""
    found = {}
    for block in document.findall(nodes.math_block):
        if TAG.search(block.astext()):
            # As it stands: Sphinx puts what has lines into an environment that takes no tag.
            block["no-wrap"] = True
            block[:] = [nodes.Text(rf"\[{block.astext()}\]")]
        for number in re.findall(NUMBER, " ".join(TAG.findall(block.astext()))):
            if ("equation", number.lower()) not in found:
                block["ids"].append(f"equation-{number.lower()}")
                found["equation", number.lower()] = block["ids"][-1]
    for raw in document.findall(nodes.raw):
        for place, kind, number in RESULT.findall(raw.astext()):
            found[kind, number] = place
    return found


def linked(text: str, found: dict) -> list[nodes.Node]:
    """Return `text` with its references as links."""
    parts, end = [], 0
    for group in SEVERAL.finditer(text):
        kind = "equation"
        for one in ONE.finditer(text, group.start(), group.end()):
            kind = (one["kind"] or kind).lower()
            if place := found.get((kind, one["number"].lower())):
                parts += [nodes.Text(text[end : one.start()])]
                parts += [nodes.reference("", one[0], refid=place, internal=True)]
                end = one.end()
    return [part for part in [*parts, nodes.Text(text[end:])] if part.astext()]


def keep_together(document: nodes.document) -> None:
    """Let no line begin with the comma or the bracket that follows a formula."""
    for formula in list(document.findall(nodes.math)):
        after = formula.next_node(descend=False, siblings=True)
        if isinstance(after, nodes.Text) and (mark := re.match(r"[.,;:!?)\]”’]+", after)):
            both = nodes.inline("", "", classes=["together"])
            after.parent.replace(after, nodes.Text(after[mark.end() :]))
            formula.parent.replace(formula, both)
            both += [formula, nodes.Text(mark[0])]


def link(app: object, document: nodes.document) -> None:
    """Link the references in a chapter, and say which printed texts may be wrapped."""
    for block in document.findall(nodes.literal_block):
        # Columns stay below each other and scroll; sentences are wrapped on a phone.
        if "stream" in block["classes"] and not re.search(r"\S {2,}\S", block.astext()):
            block["classes"].append("wrapped")
    keep_together(document)
    found = places(document)
    for text in list(document.findall(nodes.Text)) if found else []:
        above = text.parent
        while above is not None and not isinstance(above, LEFT):
            above = above.parent
        if above is None and len(parts := linked(text.astext(), found)) > 1:
            text.parent.replace(text, parts)


def as_prose(app: object, what: str, name: str, thing: object, about: object, lines: list) -> None:
    """Let bars, stars and final underscores of a docstring be what they look like."""
    kept = re.compile(r"(``.*?``|`[^`]*`_?|\*\*[^*]+\*\*|\*[^\s*][^*]*\*(?!\w))")
    text = re.sub(r"(?<![`\w])`([^`\n]+)`(?=\w)", r"``\1``\\ ", "\n".join(lines))
    parts = kept.split(text)
    parts[::2] = [re.sub(r"[|*]|(?<=\w)_(?!\w)", r"\\\g<0>", part) for part in parts[::2]]
    lines[:] = "".join(parts).split("\n")


def setup(app: object) -> dict:
    """Join Sphinx."""
    app.connect("doctree-read", link)
    app.connect("autodoc-process-docstring", as_prose, priority=400)  # before napoleon
    return {"parallel_read_safe": True, "parallel_write_safe": True}

#!/usr/bin/env python3
"""Lays the documents out as the site's generator wants them: `stage.py FARNEAR FOLDER`.

The pages of docs/, those of the repository's root, and every command as FARNEAR's --help describes it, all in FOLDER. Formulas become
MathML, which browsers show by themselves. Links into the repository's sources lead nowhere on the site; their text stays.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

from latex2mathml.converter import convert

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Pages that are not in docs/, and where they come from.
ROOT_PAGES = {
    "index.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
    "security.md": "SECURITY.md",
}
LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
FENCED = re.compile(r"^(```.*?^```|~~~.*?^~~~)", re.M | re.S)
INLINE_CODE = re.compile(r"(`[^`\n]*`)")
FORMULA = re.compile(r"\$\$(.+?)\$\$|\$(?!\s)([^$\n]+?)(?<!\s)\$", re.S)


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs", folder, ignore=shutil.ignore_patterns("site"))
    for page, source in ROOT_PAGES.items():
        text = (ROOT / source).read_text().replace("](docs/", "](")
        for other, name in ROOT_PAGES.items():
            text = text.replace(f"]({name})", f"]({other})")
        (folder / page).write_text(text)
    (folder / "commands.md").write_text(commands(program))
    for page in folder.rglob("*.md"):
        page.write_text(staged(page.read_text(), page.parent, folder))


def staged(text, place, folder):
    """A page's text with formulas and links as the site has them; code is unchanged."""
    parts = FENCED.split(text)
    for i in range(0, len(parts), 2):
        spans = INLINE_CODE.split(parts[i])
        spans[::2] = [FORMULA.sub(formula, span) for span in spans[::2]]
        text = LINK.sub(lambda found: link(found, place, folder), "".join(spans))
        # A line that begins with a tag would end the paragraph.
        parts[i] = re.sub(r'(?<=[^\n])\n(?=<math[^>]* display="inline")', " ", text)
    return "".join(parts)


def formula(found):
    block, inline = found.groups()
    return convert(block or inline, display="block" if block else "inline").replace("\n", " ")


def link(found, place, folder):
    text, target = found.groups()
    path = target.split("#")[0]
    if not path or "://" in path or target.startswith("mailto:"):
        return found.group()
    for page, source in ROOT_PAGES.items():
        if path.startswith("../") and pathlib.PurePosixPath(path).name == source:
            return f"[{text}]({os.path.relpath(folder / page, place)})"
    return found.group() if (place / path).is_file() else text


def commands(program):
    """Every command as its --help describes it."""
    lines = ["# Commands", "", "What `--help` prints, of every command.", ""]

    def add(words):
        run = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True)
        lines.extend([f"## {' '.join(['farnear', *words])}", "", "```text", run.stdout.rstrip(), "```", ""])
        listed = re.search(r"^Commands:\n((?:  .*\n|\n(?=  ))+)", run.stdout, re.M)
        for name in re.findall(r"^  (\S+)  ", listed.group(1), re.M) if listed else []:
            if name != "help":
                add([*words, name])

    add([])
    return "\n".join(lines)


if __name__ == "__main__":
    main()

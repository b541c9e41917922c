"""What the site adds to the pages: formulas as MathML, the decisions on one page, words for links that leave the site.

Formulas stand between dollar signs, as papers have them; they become MathML when the site is built, so that a browser
draws them without any script. The page of commands is made from the parser, that of decisions from their files.
"""

import argparse
import posixpath
import re
from html import escape
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

from planarm.cli.main import build_parser

DOCS = Path(__file__).resolve().parent
CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.S)
BLOCK = re.compile(r"\$\$(.+?)\$\$", re.S)
INLINE = re.compile(r"(?<![\\$\w])\$([^$\n]+?)\$(?![\w$])")
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#]+)(#[^)]*)?\)")


def on_config(config: Any) -> Any:  # noqa: ANN401 - MkDocs' own types
    """Put pages that the navigation does not name at its end, so that a new page is found without anybody's doing."""
    named = str(config.nav)
    pages = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md") if path.parent.name != "decisions")
    omitted = [page for page in pages if f"'{page}'" not in named]
    if omitted:
        config.nav.append({"More": omitted})
    return config


def on_files(files: Any, config: Any) -> Any:  # noqa: ANN401 - MkDocs' own types
    """Add the pages that are made: all decisions, all commands."""
    files.append(File.generated(config, "decisions.md", content=decisions_page()))
    files.append(File.generated(config, "reference/commands.md", content=commands_page()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:  # noqa: ANN401 - MkDocs' own types
    """Draw formulas, and tell links to files of the repository as what they are."""
    parts = CODE.split(markdown)
    folder = posixpath.dirname(page.file.src_uri)
    for n in range(0, len(parts), 2):
        parts[n] = INLINE.sub(_inline, BLOCK.sub(_block, parts[n]))
    return LINK.sub(lambda m: _link(m, folder, files), "".join(parts))


def _block(formula: re.Match[str]) -> str:
    return f'\n<div class="formula">{convert(formula[1].strip(), display="block")}</div>\n'


def _inline(formula: re.Match[str]) -> str:
    return f'<span class="formula">{convert(formula[1])}</span>'


def _link(match: re.Match[str], folder: str, files: Any) -> str:  # noqa: ANN401 - MkDocs' own types
    text, target = match[1], match[2]
    if "://" in target or target.startswith("mailto:"):
        return match[0]
    place = posixpath.normpath(posixpath.join(folder, target))
    if place.startswith("decisions/"):
        return f"[{text}]({posixpath.relpath('decisions.md', folder or '.')})"
    if files.get_file_from_path(place) is not None:
        return match[0]
    return f"{text} (<code>{escape(posixpath.normpath(posixpath.join('docs', place)))}</code>)"


def commands_page() -> str:
    """Return the help of every command."""
    parser = build_parser()
    [commands] = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    parts = ["# Commands\n\nEvery command has `--json`: one object on stdout and nothing else there.\n"]
    for name, command in commands.choices.items():
        parts.append(f"## planarm {name}\n\n```text\n{command.format_help()}```\n")
    return "\n".join(parts)


def decisions_page() -> str:
    """Return every decision, one below the other."""
    parts = ["# Decisions\n\nWhat was decided, why, and what it costs.\n"]
    for path in sorted((DOCS / "decisions").glob("[0-9]*.md")):
        parts.append("#" + path.read_text(encoding="utf-8"))
    return "\n".join(parts)

"""Reference pages that are generated from the package, so that they cannot disagree with it.

A page says where by a line of its own, `% generated: NAME`; the line is replaced by Markdown when the page is read.
A file of the repository's root replaces the whole page.
A public name in an item of a list becomes its documentation, with all members, those that follow it, or "(attributes)" alone.
"""

from __future__ import annotations

import importlib
import inspect
import re
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer.main

from voodoo import Config
from voodoo.cli import app as command_line_app
from voodoo.cli.common import EXIT_CODES

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WIDTH = 80
ROOT = Path(__file__).resolve().parents[2]
MARK = re.compile(r"^% generated: (\S+)$", re.MULTILINE)
PUBLIC = re.compile(r"^- `(voodoo\.[\w.]+)`(?:: (`.+`)| \((attributes)\))?$", re.MULTILINE)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:|#)([^)]*)\)")
LAB = re.compile(r"\[([^\]]*)\]\((?:\.\./)+lab/([^)#]*)[^)]*\)")
"""Links to what is no page: they stay as the file's name."""
PROJECT = {f"{name.upper()}.md": f"/project/{name}.md" for name in ("architecture", "contributing", "changelog")}
"""Files beside docs/ that are pages as well."""


def command_line() -> str:
    """Every command with its arguments and options."""
    group: Any = typer.main.get_command(command_line_app)
    return "\n".join(line for name, command in group.commands.items() for line in _command(name, command))


def exit_codes() -> str:
    """The table of exit codes."""
    return "\n".join(
        ["| exit code | meaning |", "|---|---|", *(f"| {code} | {words} |" for code, words in EXIT_CODES.items())]
    )


def _command(name: str, command: Any) -> list[str]:  # noqa: ANN401 - a class of whichever click typer brings
    arguments = [item for item in command.params if item.param_type_name == "argument"]
    options = [item for item in command.params if item.param_type_name == "option"]
    usage = " ".join(["voodoo", name, "[OPTIONS]" if options else "", *(_place(item) for item in arguments)])
    lines = [f"## voodoo {name}", "", "```text", " ".join(usage.split()), "```", "", *_prose(command.help), ""]
    for item in [*arguments, *options]:
        words = [item.metavar or item.name.upper()] if item in arguments else [_spelling(item)]
        lines += [f"`{words[0]}`", f": {_marked(_plain(item.help))}{_default(item)}", ""]
    return lines


def _place(argument: Any) -> str:  # noqa: ANN401
    word = argument.metavar or argument.name.upper()
    return word if argument.required else f"[{word}]"


def _spelling(option: Any) -> str:  # noqa: ANN401
    names = ", ".join(option.opts)
    if option.secondary_opts:
        names += " / " + ", ".join(option.secondary_opts)
    if option.is_flag:
        return names
    kind = getattr(option, "type_descriptor", None) or getattr(option, "type", None)  # by the release of typer
    return f"{names} {option.metavar or '|'.join(getattr(kind, 'choices', ()) or ['VALUE'])}"


def _default(option: Any) -> str:  # noqa: ANN401
    displayed = option.default
    plain = isinstance(displayed, (str, int, float)) and not isinstance(displayed, bool)
    return f" Default: `{displayed}`." if plain and displayed != "" else ""


def _prose(text: str | None) -> list[str]:
    """Help as paragraphs; what follows "Examples" is code."""
    lines, code = [], False
    for paragraph in re.split(r"\n\s*\n", _plain(text)):
        words = " ".join(paragraph.split())
        if words in ("Example", "Examples"):
            code = True
            continue
        lines += ["```sh", *_broken(words), "```", ""] if code else [_marked(words), ""]
    return lines


def _broken(line: str) -> list[str]:
    """A shell line that fits the page: a long one goes on before an option."""
    lines = textwrap.wrap(
        line.replace(" --", "\0--").replace(" ", "\1").replace("\0", " "), WIDTH, subsequent_indent="    "
    )
    lines = [part.replace("\1", " ") for part in lines]
    return [f"{part} \\" for part in lines[:-1]] + lines[-1:]


def _marked(text: str) -> str:
    """Options in the text as code."""
    return re.sub(r"(?<![\w`-])(--[a-z][\w-]*)(?!`)", r"`\1`", text)


def _plain(text: str | None) -> str:
    """Without the marks for a terminal."""
    return re.sub(r"\[/?(bold|dim|italic|cyan|green)\]", "", text or "").replace("\b", "").strip()


def configuration() -> str:
    """Every key with its default, range and meaning, from the TOML that `voodoo config` prints."""
    lines = []
    for block in Config().to_toml().split("\n\n"):
        entry = re.match(r"((?:#.*\n)+)(\w+) = (.*)", block)
        if entry is None:
            continue
        words = [line.removeprefix("#").strip() for line in entry[1].strip().splitlines()]
        facts = words.pop().strip("()") if words[-1].startswith("(") else ""
        lines += [
            f"`{entry[2]} = {entry[3]}`",
            f": {' '.join(words)}" + (f" {facts.capitalize()}." if facts else ""),
            "",
        ]
    return "\n".join(lines)


def project_file(name: str) -> str:
    """A file of the repository's root as a page; of its links those stay that lead to pages."""

    def link(found: re.Match[str]) -> str:
        path, hash_, anchor = found[2].partition("#")
        page = PROJECT.get(path) or (f"/{path.removeprefix('docs/')}" if re.match(r"docs/.*\.md$", path) else "")
        return f"[{found[1]}]({page}{hash_}{anchor})" if page else found[1]

    return LINK.sub(link, (ROOT / name).read_text(encoding="utf-8"))


def documented(item: re.Match[str]) -> str:
    """The directive that documents a public name."""
    module, _, name = item[1].rpartition(".")
    public = getattr(importlib.import_module(module), name)
    kind = "function" if inspect.isfunction(public) else "class" if inspect.isclass(public) else "module"
    lines = [f".. auto{kind}:: {item[1]}"]
    if kind == "module" or (kind == "class" and not issubclass(public, (tuple, BaseException)) and not item[3]):
        lines += [f"   :members: {(item[2] or '').replace('`', '')}".rstrip(), "   :exclude-members: model_config"]
    return "\n".join(["```{eval-rst}", *lines, "```"])


GENERATED = {"command_line": command_line, "exit_codes": exit_codes, "configuration": configuration}


def fill(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the generated text where a page asks for it, and let links to the repository's root lead to its pages."""
    whole = next((name for name in MARK.findall(source[0]) if name in PROJECT), None)
    text = project_file(whole) if whole else MARK.sub(lambda mark: GENERATED[mark[1]](), source[0])
    text = PUBLIC.sub(documented, text)
    text = re.sub(r"\]\((?:\.\./)+([A-Z]+\.md)", lambda link: f"]({PROJECT[link[1]]}", text)
    source[0] = LAB.sub(r"\1 (`lab/\2`)", text)


def escape(_app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]) -> None:
    """Bars of a docstring are those of an absolute value, not of a substitution."""
    lines[:] = [re.sub(r"(`[^`]*`)|\|", lambda found: found[1] or r"\|", line) for line in lines]


def plain_types(
    _app: Sphinx, _what: str, _name: str, _object: object, _options: object, signature: str | None, result: str | None
) -> tuple[str | None, str | None]:
    """An alias within another type by its name alone."""
    alias = re.compile(r"TypeAliasForwardRef\('([\w.]+)'\)")
    return signature and alias.sub(r"\1", signature), result and alias.sub(r"\1", result)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", fill)
    app.connect("autodoc-process-docstring", escape)
    app.connect("autodoc-process-signature", plain_types)
    return {"parallel_read_safe": True}

"""The reference agrees with the code, and every command line and link in a README is valid."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from straw.replay.cli import parser
from straw.replay.guide.__main__ import generated

REPOSITORY = Path(__file__).resolve().parents[2]
#: What a shell would make of a command line: `runs/*.mcap` is some recordings, `...` any arguments.
EXAMPLES = {"*": "1", "...": "ABC"}

#: Names that examples give to a user's own files.
OF_A_USER = ("hardening.py", "my_controller.py")


def texts() -> list[Path]:
    """Every Markdown file of the checkout but the changelog."""
    if not (REPOSITORY / ".git").exists():
        return sorted(p for p in REPOSITORY.rglob("*.md") if ".venv" not in p.parts)
    command = ["git", "-C", str(REPOSITORY), "ls-files", "-co", "--exclude-standard", "*.md"]
    return [REPOSITORY / name for name in subprocess.check_output(command, text=True).splitlines()]


def named(path: Path) -> str:
    """A file as seen from the top."""
    return str(path.relative_to(REPOSITORY))


def command_lines(text: str) -> Iterator[str]:
    """Lines of shell blocks that call straw, continued lines joined, and what follows `&&` taken by itself."""
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE):
        if language not in ("", "sh"):
            continue
        for line in block.replace("\\\n", " ").splitlines():
            for part in line.split("&&"):
                words = part.split("#")[0].strip().removeprefix(".venv/bin/").removesuffix("&").strip()
                if re.match(r"straw [a-z]", words):
                    yield words


def without_brackets(line: str) -> str:
    """A line of usage as it could be typed: with everything optional, and the first of alternatives."""
    line = re.sub(r"\(([^|()]*)\|[^()]*\)", r"\1", line)
    return re.sub(r"(?<!\S)\[([^\[\]]*)\](?!\S)", r"\1", line).replace("[options]", "").replace(" options", "")


def written() -> list[tuple[str, str]]:
    """Each file's name and command line; the generated reference gives usage only and is left out."""
    skip = set(generated())
    found = [
        (named(path), line)
        for path in texts()
        if path not in skip
        for line in command_lines(path.read_text(encoding="utf-8"))
    ]
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("path", list(generated()), ids=lambda path: path.name)
def test_the_reference_is_up_to_date(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == generated()[path], "run: python -m straw.replay.guide"


@pytest.mark.parametrize(("place", "line"), written(), ids=lambda text: text[:60])
def test_a_command_line_in_a_readme_is_valid(place: str, line: str) -> None:
    typed = without_brackets(line)
    for sign, text in EXAMPLES.items():
        typed = typed.replace(sign, text)
    numbers = {"N": "1", "M": "1"}
    words = [numbers.get(word, word) for word in shlex.split(typed)]
    with mock.patch("argparse.ArgumentParser.exit", side_effect=lambda code=0, message="": pytest.fail(message)):
        parser().parse_args(words[1:])


def mentioned() -> list[tuple[str, str]]:
    """Each file and the commands and options its sentences mention, as `straw rig vent` or `straw track --csv`."""
    found = []
    for path in texts():
        prose = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        lines = [" ".join(code.split()) for code in re.findall(r"`(straw [a-z][^`]*)`", prose)]
        found += [(named(path), line) for line in lines]
    return list(dict.fromkeys(found))


@pytest.mark.parametrize(("place", "line"), mentioned(), ids=lambda text: text[:60])
def test_commands_and_options_that_a_sentence_mentions_exist(place: str, line: str) -> None:
    at = parser()
    for word in line.split()[1:]:
        commands = [a.choices for a in at._actions if isinstance(a.choices, dict)]
        if word.startswith("-"):
            assert word.split("=")[0] in at._option_string_actions, f"{at.prog} has no {word}"
        elif commands and re.fullmatch(r"[a-z-]+,?", word):
            assert word.strip(",") in commands[0], f"{at.prog} has no command {word}"
            at = commands[0][word.strip(",")]


def test_some_command_lines_are_found() -> None:
    """Otherwise the test above would pass without checking anything."""
    assert len(written()) > 40


@pytest.mark.parametrize("path", texts(), ids=named)
def test_a_link_in_a_text_leads_to_an_existing_file_and_heading(path: Path) -> None:
    text = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        file = (path.parent / name) if name else path
        assert file.exists(), f"{path.name} leads to {target}, which is not there"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file.read_text(encoding="utf-8")), f"{path.name}: no heading {target}"


@pytest.mark.parametrize("path", [p for p in texts() if p.name in ("README.md", "PHYSICS.md")], ids=named)
def test_a_file_that_a_text_names_exists(path: Path) -> None:
    """Relative to the text, to the top folder, or anywhere below the text."""
    folder = path.parent
    for name in re.findall(r"`([a-z_/]+\.py)`", path.read_text(encoding="utf-8")):
        if name not in OF_A_USER:
            places = [folder / name, REPOSITORY / name, *(folder.rglob(name) if folder != REPOSITORY else ())]
            assert any(place.is_file() for place in places), f"{path} names {name}, which is not there"


def anchors(text: str) -> set[str]:
    """The code host's anchors of headings: lower case, no punctuation, hyphens for spaces."""
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}

"""`python -m straw.replay.guide`: writes COMMANDS.md and API.md from the parser, the signatures and the docstrings."""

from __future__ import annotations

from pathlib import Path

from straw.replay.cli import parser
from straw.replay.guide import api, commands


def generated() -> dict[Path, str]:
    """The text of each generated file."""
    here = Path(__file__).parent
    return {here / "COMMANDS.md": commands.reference(parser()), here / "API.md": api.reference()}


def main() -> None:
    """Write the files in place."""
    for path, text in generated().items():
        path.write_text(text, encoding="utf-8", newline="\n")
        print(path)


if __name__ == "__main__":
    main()

"""The commands that README and the command guide print."""

from __future__ import annotations

import re
from pathlib import Path

#: Of the guide; run in tests/replay/test_paper.py.
PAPER = "straw paper --out paper"


def commands(repository: Path) -> list[str]:
    """Every line of the sh blocks, once, without the part that installs (this environment is installed already)."""
    texts = [(repository / name).read_text(encoding="utf-8") for name in ("README.md", "replay/guide/README.md")]
    text = "\n".join(texts)
    lines = "\n".join(re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL)).splitlines()
    found = [line.rsplit("&& ", 1)[-1].replace(".venv/bin/", "") for line in lines if line.strip()]
    return list(dict.fromkeys(found))

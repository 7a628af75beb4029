"""Opens a page in headless Chromium without a driver: a script at its end writes its result into the page."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
QUIET = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
QUIET += " --disable-component-update --disable-sync --lang=en-US --hide-scrollbars"


def chromium() -> str:
    """Path of the browser; skips the test, saying so, where there is none."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("no Chromium here: the page was not opened")
    return found


def asked(page: str, script: str, folder: Path, *options: str) -> Any:
    """What a script at the end of a page returns, with the page's own errors first, under "errors"."""
    catch = "<script>window.errors = []; addEventListener('error', (e) => errors.push(e.message));</script>"
    ask = f"""<script>
    (async () => {{ {script} }})().catch((e) => {{ errors.push(String(e)); }}).then((answer) => {{
      const out = document.createElement("pre");
      out.id = "answer";
      out.textContent = JSON.stringify({{ errors, answer, ready: Number(document.documentElement.dataset.ready) }});
      document.body.append(out);
    }});</script>"""
    path = folder / "asked.html"
    path.write_text(
        page.replace("<head>", "<head>" + catch, 1).replace("</body>", ask + "</body>", 1), encoding="utf-8"
    )
    command = [
        chromium(),
        *QUIET.split(),
        f"--user-data-dir={folder / 'profile'}",
        *options,
        "--dump-dom",
        path.as_uri(),
    ]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    found = re.search(r'<pre id="answer">(.*?)</pre>', dom, re.DOTALL)
    assert found, dom[-2000:]
    return json.loads(html.unescape(found[1]))

"""Redraws README's pictures from real outputs: ``python -m tests.replay.readme_pictures [NAME ...]``.

Each is a part of a page as Chromium shows it, in `.github`, about as wide as the code host's column. The outputs are
those of ``straw demo`` (``--demo``, made where absent, five minutes), ``straw demo --measured`` and a lab on an emulated
rig.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
from PIL import Image

from straw.tracking.camera import load_camera
from tests.replay.driven import Browser, Tab
from tests.replay.lab import ServedLab

READY = "document.documentElement.dataset.ready"
PICTURES = Path(__file__).parents[2] / ".github"
#: Displayed pixels for each of the page's: text stays legible where the code host scales the picture down.
SHARPNESS = 1.5
#: A page's flat colours and its grey video need no more; the files become a third as large.
COLOURS = 128


def straw(*arguments: str | Path) -> None:
    """Run the command of this Python's environment; its progress is shown."""
    subprocess.run([sys.executable, "-m", "straw.replay.cli", *map(str, arguments)], check=True)


def take(tab: Tab, name: str, width: int, height: int, box: str = "({x: 0, y: 0, width: innerWidth, height: innerHeight})") -> None:
    """Write the part of the page in ``box`` (JavaScript for x, y, width, height in its pixels) as a picture."""
    tab.call(
        "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=SHARPNESS, mobile=False
    )
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])
    tab.js("new Promise((drawn) => setTimeout(drawn, 600))")  # pages redraw 150 ms after they are resized
    clip = json.loads(tab.js(f"JSON.stringify({box})")) | {"scale": 1}
    taken = base64.b64decode(tab.call("Page.captureScreenshot", format="png", clip=clip)["data"])
    picture = Image.open(io.BytesIO(taken)).convert("RGB")
    where = PICTURES / name
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(where, optimize=True)
    print(f"{where}: {picture.width} x {picture.height}, {where.stat().st_size / 1e3:.0f} kB", flush=True)


def between(first: str, last: str, margin: int = 14) -> str:
    """The box from the top of the first element (a CSS selector) to the bottom of the last one, over the page's width."""
    return f"""(() => {{
      const top = document.querySelector({json.dumps(first)}).getBoundingClientRect().top + scrollY;
      const end = document.querySelector({json.dumps(last)}).getBoundingClientRect().bottom + scrollY;
      const y = Math.max(0, top - {margin});
      return {{ x: 0, y, width: document.documentElement.clientWidth, height: end + {margin} - y }};
    }})()"""


def rig(browser: Browser, demo: Path, folder: Path) -> None:
    """The operator's panel while an emulated controller folds the straw."""
    (folder / "lab").mkdir()
    with ServedLab(folder / "lab", emulate=True) as lab:
        tab = browser.tab(lab.door.url)
        tab.goto(f"http://127.0.0.1:{lab.door.port}/panel")
        tab.until(f"{READY} && state.bench")
        tab.js("tell('queue', { do: 'add', toml: field('toml').replace('for_s = 5.0', 'for_s = 15.0'), specimen: 'straw-7' })")
        tab.js("tell('arm', { on: true }).then(() => tell('start', {}))")
        tab.until("state.bench.run", 60)
        tab.js("new Promise((later) => setTimeout(later, 7000))")  # the page of the run has loaded and both cells have snapped
        take(tab, "rig.png", 1240, 800)
        tab.until("!state.bench.run", 60)


def track(browser: Browser, demo: Path, folder: Path) -> None:
    """What the tracker saw in a frame of the demo's video, beside the track."""


def overlay(browser: Browser, demo: Path, folder: Path) -> None:
    """The comparison of the demo's filmed run with the improved model, in the second snap."""
    tab = browser.tab((demo / "replay.html").resolve().as_uri())
    tab.until(READY)
    tab.js("setTime(runs[0].snaps.map(([t]) => t).sort((a, b) => a - b)[1] + 0.05)")
    take(tab, "overlay.png", 1400, 1010)


def diagnosis(browser: Browser, demo: Path, folder: Path) -> None:
    """The verdict on the demo's runs, with the place in the straw, and the fit before and after."""
    tab = browser.tab((demo / "why.html").resolve().as_uri())
    tab.until(READY)
    take(tab, "diagnosis.png", 1200, 900)


def system(browser: Browser, demo: Path, folder: Path) -> None:
    """The law that is missing from a user's own model of a measured system."""
    straw("demo", "--measured", "--out", folder / "measured")
    tab = browser.tab((folder / "measured" / "why.html").resolve().as_uri())
    tab.until(READY)
    take(tab, "system.png", 1200, 900)


DRAWN: dict[str, Callable[[Browser, Path, Path], None]] = {
    "rig": rig, "track": track, "overlay": overlay, "diagnosis": diagnosis, "system": system
}  # fmt: skip


def main() -> None:
    """Draw the pictures that are named, or all."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("names", nargs="*", metavar="NAME", help=", ".join(DRAWN) + " (all)")
    p.add_argument("--demo", type=Path, metavar="DIR", help="outputs of an earlier straw demo")
    args = p.parse_args()
    unknown = set(args.names) - set(DRAWN)
    if unknown:
        p.error(f"no picture {', '.join(sorted(unknown))}; there are {', '.join(DRAWN)}")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        demo = args.demo or folder / "demo"
        if not args.demo:
            straw("demo", "--out", demo)
        with Browser(folder / "chromium") as browser:
            for name in args.names or DRAWN:
                DRAWN[name](browser, demo, folder)


if __name__ == "__main__":
    main()

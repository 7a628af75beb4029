"""Redraws README's pictures from real outputs: ``python -m tests.replay.readme_pictures [NAME ...]``.

Each is a part of a page as Chromium shows it, in `.github`, about as wide as the code host's column. The outputs are
those of ``straw demo`` (``--demo``, else made in five minutes), ``straw demo --measured`` and a lab on an emulator.
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
import numpy as np
from PIL import Image

from straw.rig.run_read import read_run
from tests.replay.driven import Browser, Tab
from tests.replay.lab import ServedLab

READY = "document.documentElement.dataset.ready"
PICTURES = Path(__file__).parents[2] / ".github"
#: Width of a picture: twice that of the code host's column, for high-resolution screens.
WIDTH_PX = 1660
#: Width and height of the part of the demo's video around the board, px.
BOARD_PX = 380
#: The track's page reduced to a frame of the video beside the plots of the track and of its sigmas.
BESIDE = """(() => {
  const [path, sigma] = document.images, frame = Object.assign(new Image(), { src: 'frame.png' });
  const [left, right, both] = ['figure', 'div', 'div'].map((tag) => document.createElement(tag));
  const caption = Object.assign(document.createElement('figcaption'), { textContent: CAPTION });
  left.append(frame, caption);
  right.append(path, sigma);
  both.append(left, right);
  document.querySelector('table').replaceWith(both);
  while (both.nextSibling) both.nextSibling.remove();
  both.id = 'both';
  both.style = 'display: grid; grid-template-columns: 42fr 58fr; gap: 18px; align-items: center';
  left.style.margin = 0;
  frame.style.width = '100%';
  document.body.style = 'max-width: none; margin: 0 16px';
  return frame.decode();
})()"""


def straw(*arguments: str | Path) -> None:
    """Run the command of this Python's environment; its progress is shown."""
    subprocess.run([sys.executable, "-m", "straw.replay.cli", *map(str, arguments)], check=True)


def take(
    tab: Tab, name: str, width: int, height: int, box: str = "({x: 0, y: 0, width: innerWidth, height: innerHeight})"
) -> None:
    """Write the part of the page in ``box`` (JavaScript for x, y, width, height in its pixels) as a picture."""
    tab.call(
        "Emulation.setDeviceMetricsOverride",
        width=width,
        height=height,
        deviceScaleFactor=WIDTH_PX / width,
        mobile=False,
    )
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "light"}])
    tab.js("new Promise((drawn) => setTimeout(drawn, 600))")  # pages redraw 150 ms after they are resized
    clip = json.loads(tab.js(f"JSON.stringify({box})")) | {"scale": 1}
    taken = base64.b64decode(
        tab.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)["data"]
    )
    picture = Image.open(io.BytesIO(taken)).convert("RGB")
    where = PICTURES / name
    picture.quantize(256, kmeans=2, dither=Image.Dither.NONE).save(where, optimize=True)
    print(f"{where}: {picture.width} x {picture.height}, {where.stat().st_size / 1e3:.0f} kB", flush=True)


def between(first: str, last: str, margin: int = 14) -> str:
    """The box from the top of the first element (a CSS selector) to the bottom of the last, as wide as the page."""
    return f"""(() => {{
      const top = document.querySelector({json.dumps(first)}).getBoundingClientRect().top + scrollY;
      const end = [...document.querySelectorAll({json.dumps(last)})].at(-1).getBoundingClientRect().bottom + scrollY;
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
        tab.js(
            "$('#toml').value = field('toml').replace('for_s = 5.0', 'for_s = 15.0'); $('#specimen').value = 'straw-7'"
        )
        tab.js("check().then(() => $('#add').click())")
        tab.until("state.bench.queue.items.length")
        tab.js("tell('arm', { on: true }).then(() => tell('start', {}))")
        tab.until("state.bench.run", 60)
        tab.js(
            "new Promise((later) => setTimeout(later, 7000))"
        )  # until the run's page has loaded and both cells have snapped
        take(tab, "rig.png", 1240, 800)
        tab.until("!state.bench.run", 60)


def track(browser: Browser, demo: Path, folder: Path) -> None:
    """The frame of `straw track --overlay` with the largest tilt, beside the page of `straw track --report`."""
    page, film, tip = folder / "track.html", folder / "overlay.mp4", folder / "tip.mcap"
    given = (demo / "video.mp4", "--camera", demo / "camera.json", "--run", demo / "run.mcap", "--start", "-0.5")
    straw("track", *given, "-o", tip, "--report", page, "--overlay", film)
    trace = read_run(tip).tip
    assert trace is not None
    most = int(np.nanargmax(trace.phi_rad))
    x, z, phi = trace.x_m[most] * 1e3, trace.z_m[most] * 1e3, np.degrees(trace.phi_rad[most])
    sigmas = trace.sigma_x_m[most] * 1e3, trace.sigma_z_m[most] * 1e3, np.degrees(trace.sigma_phi_rad[most])
    caption = f"frame {most}: " + ", ".join(
        f"{name} {value:.3f} ± {sigma:.3f} {unit}"
        for name, value, sigma, unit in zip("XZΦ", (x, z, phi), sigmas, ("mm", "mm", "°"), strict=True)
    )
    video = cv2.VideoCapture(str(film))
    video.set(cv2.CAP_PROP_POS_FRAMES, most)
    seen, frame = video.read()
    assert seen, f"{film} has no frame {most}"
    (height, width), half = frame.shape[:2], BOARD_PX // 2
    around = frame[height // 2 - half : height // 2 + half, width // 2 - half : width // 2 + half]
    assert cv2.imwrite(str(folder / "frame.png"), around)
    tab = browser.tab(page.as_uri())
    tab.js(BESIDE.replace("CAPTION", json.dumps(caption)))
    take(tab, "track.png", 1240, 700, between("h1", "#both"))


def overlay(browser: Browser, demo: Path, folder: Path) -> None:
    """The comparison of the demo's filmed run with the improved model, in the second snap."""
    tab = browser.tab((demo / "replay.html").resolve().as_uri())
    tab.until(READY)
    tab.js("setTime(runs[0].snaps.map(([t]) => t).sort((a, b) => a - b).at(-1) + 0.05)")
    take(tab, "overlay.png", 1400, 1010, "({ ...BOX, height: 1010 })".replace("BOX", between("#run h2", "#run h2")))


def diagnosis(browser: Browser, demo: Path, folder: Path) -> None:
    """The verdict on the demo's runs, the place in the straw beside the fit before and after, and the misfits."""
    tab = told(browser, demo / "why.html")
    tab.js("""(() => {
      const both = document.createElement('div'), errors = document.querySelector('.errors');
      both.style = 'display: grid; grid-template-columns: 46fr 54fr; gap: 24px; align-items: center; margin: 10px 0';
      both.append(document.querySelector('.portrait'), document.querySelector('.fits'));
      document.querySelector('main').replaceChildren(both, errors);
    })()""")
    take(tab, "diagnosis.png", 1180, 900, between("h1", ".errors"))


def system(browser: Browser, demo: Path, folder: Path) -> None:
    """The laws that are missing from a user's own model of a measured system, typeset."""
    straw("demo", "--measured", "--out", folder / "measured")
    take(told(browser, folder / "measured" / "why.html"), "system.png", 1000, 900, between("h1", ".found"))


def told(browser: Browser, page: Path) -> Tab:
    """A diagnosis' page without its player."""
    tab = browser.tab(page.resolve().as_uri())
    tab.until(READY)
    tab.js("""(() => {
      const head = [...document.querySelectorAll('h2')].find((h) => h.textContent === 'The recordings, played');
      for (const one of [head.nextElementSibling, head, ...document.querySelectorAll('#campaign, #run')]) one.remove();
    })()""")
    return tab


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

"""The straw from the side, with clamp, line, gauge and camera, and the places of a finding marked."""

from __future__ import annotations

from collections.abc import Sequence

from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose.page.shown import Drawing
from straw.replay.diagnose.page.words import and_

#: Millimetres drawn left of the clamp and right of the tip, and above and below the axis beyond the rim.
LEFT, RIGHT, ABOVE, BELOW = 42.0, 16.0, 24.0, 9.0
#: Drawn from the tip to the board's plane, mm.
BOARD_MM = 8.8
#: Names of places, by what is marked.
PLACES = {
    "frusta": "the frusta",
    "flow": "the line and the channel",
    "gauge": "the pressure gauge",
    "camera": "the camera and its clock",
    "tip": "the tip",
}


def place_of(cause: str) -> str:
    """The parts of the picture that a cause acts on; empty where unknown."""
    if cause in TERMS:
        kind = {"flow": "flow", "body": "tip"}.get(TERMS[cause].kind, "frusta")
        return "tip" if "tip" in cause else kind
    if cause.startswith("gauge"):
        return "gauge"
    if cause.startswith(("camera", "clock", "length")):
        return "camera"
    return {"tip_offset": "tip", "odd_frusta_compliance": "frusta"}.get(cause, "")


def portrait(straw: StrawParameters, cells: Sequence[int], causes: Sequence[str]) -> Drawing:
    """An SVG in millimetres; ``cells`` are those whose snaps differ most: they deploy, and are drawn filled."""
    marked = {place_of(cause) for cause in causes} - {""}
    ri, ro = 1e3 * straw.r_i_m, 1e3 * straw.r_o_m
    x, parts, rims = 0.0, [], []
    for n in range(1, straw.cells + 1):
        first, second = 1e3 * straw.zeta0_m[n - 1, 0], -1e3 * straw.zeta0_m[n - 1, 1]
        end = x + first + second
        here = "frusta" in marked and (n in cells or not cells)
        style = "cell marked" if here else "cell located" if n in cells else "cell"
        parts += [_quad(x, ri, x + first, ro, style), _quad(x + first, ro, end, ri, style)]
        rims.append(_text(x + first, -ro - 2.2, str(n), "number"))
        x = end
    tip = x
    on = {name: " marked" if name in marked else "" for name in PLACES}
    apparatus = [
        f'<path class="line{on["flow"]}" d="M{-LEFT + 9} {ri * 0.9} H-13 Q-8 {ri * 0.9} -8 0 H0"/>',
        f'<rect class="clamp" x="-5" y="{-ro - 2}" width="5" height="{2 * ro + 4}"/>',
        f'<circle class="device{on["gauge"]}" cx="{-LEFT + 9}" cy="{ri * 0.9}" r="6.2"/>',
        f'<path class="needle" d="M{-LEFT + 9} {ri * 0.9} l3 -4"/>',
        _text(-LEFT + 9, ri * 0.9 + 11, "gauge", "word"),
        f'<path class="board{on["tip"]}" d="M{tip} 0 H{tip + BOARD_MM} M{tip + BOARD_MM} {-ro} V{ro}"/>',
        f'<path class="device{on["camera"]}" d="M{tip / 2 - 5} {-ro - 20} h10 v7 h-2.6 l1.6 4 h-8 l1.6 -4 h-2.6 z"/>',
        _text(tip / 2 + 8, -ro - 14.5, "camera", "word left"),
    ]
    low = -ro - ABOVE
    box = f"{-LEFT} {low} {LEFT + tip + BOARD_MM + RIGHT} {2 * ro + ABOVE + BELOW}"
    where = " and ".join(PLACES[name] for name in PLACES if name in marked)
    cell = f"{'cell' if len(cells) == 1 else 'cells'} {and_([str(c) for c in cells])}"
    told = [f"In red: {where}" + (f" ({cell}, whose snaps differ most)" if "frusta" in marked and cells else "")]
    if cells and "frusta" not in marked:
        told.append(f"In pale red: {cell}, whose snaps differ most")
    caption = "".join(f"{one}. " for one in (told if where else told[1:])).strip()
    label = f"The straw; marked: {where or 'nothing'}"
    svg = f'<svg role="img" aria-label="{label}" viewBox="{box}">{"".join([*apparatus, *parts, *rims])}</svg>'
    return Drawing(svg, caption)


def _quad(x1: float, r1: float, x2: float, r2: float, style: str) -> str:
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in ((x1, -r1), (x2, -r2), (x2, r2), (x1, r1)))
    return f'<polygon class="{style}" points="{points}"/>'


def _text(x: float, y: float, words: str, style: str) -> str:
    return f'<text class="{style}" x="{x:.1f}" y="{y:.1f}">{words}</text>'

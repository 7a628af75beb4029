"""STEP AP214: the body of revolution as one solid of exact planes, cylinders and cones.

Each edge of the section turned about the axis is a face: a plane across the axis, a cylinder or a cone. Its boundary
are circles where its ends lie off the axis and, as a face that closes on itself has to be cut open, a seam along
theta = 0 (ISO 10303-42: advanced_face, seam edges used twice). Written by hand: the libraries that write STEP with
wheels for every system weigh 50 MB and more.
"""

from __future__ import annotations

import math

from straw.model.solid.outline import Floats

HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('straw'),'2;1');
FILE_NAME('straw.step','2000-01-01T00:00:00',(''),(''),'straw','straw','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""
#: Below this an end of an edge lies on the axis, mm.
ON_AXIS = 1e-9


class _File:
    """Entities in order; each has a number once."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, text: str) -> str:
        self.lines.append(f"#{len(self.lines) + 1}={text};")
        return f"#{len(self.lines)}"

    def point(self, x: float, y: float, z: float) -> str:
        return self.add(f"CARTESIAN_POINT('',({_n(x)},{_n(y)},{_n(z)}))")

    def direction(self, x: float, y: float, z: float) -> str:
        return self.add(f"DIRECTION('',({_n(x)},{_n(y)},{_n(z)}))")

    def axis(self, z: float, up: float = 1.0) -> str:
        """A frame on the axis at height z, its x along X."""
        place = self.point(0, 0, z)
        return self.add(f"AXIS2_PLACEMENT_3D('',{place},{self.direction(0, 0, up)},{self.direction(1, 0, 0)})")


def _n(x: float) -> str:
    text = repr(round(float(x), 12) + 0.0)
    return text if "e" not in text else f"{x:.15f}"


def step_text(corners: Floats, name: str = "straw") -> str:
    """A STEP file of a section (corners, 2) in m, in order with the body to the left, turned about the axis; in mm."""
    f = _File()
    mm = [(1e3 * float(r), 1e3 * float(z)) for r, z in corners]
    vertices = [f.add(f"VERTEX_POINT('',{f.point(r, 0, z)})") for r, z in mm]
    circles = [_circle(f, vertices[i], r, z) if r > ON_AXIS else None for i, (r, z) in enumerate(mm)]
    faces = []
    for i in range(len(mm)):
        j = (i + 1) % len(mm)
        if mm[i][0] <= ON_AXIS and mm[j][0] <= ON_AXIS:
            continue  # along the axis: no face
        faces.append(_face(f, (mm[i], mm[j]), (vertices[i], vertices[j]), (circles[i], circles[j])))
    shell = f.add(f"CLOSED_SHELL('',({','.join(faces)}))")
    solid = f.add(f"MANIFOLD_SOLID_BREP('{name}',{shell})")
    _product(f, solid, name)
    return HEADER + "\n".join(f.lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"


def _circle(f: _File, vertex: str, r: float, z: float) -> str:
    """The closed edge of a corner turned about the axis, counter-clockwise seen from above."""
    circle = f.add(f"CIRCLE('',{f.axis(z)},{_n(r)})")
    return f.add(f"EDGE_CURVE('',{vertex},{vertex},{circle},.T.)")


def _face(
    f: _File,
    ends: tuple[tuple[float, float], tuple[float, float]],
    vertices: tuple[str, str],
    circles: tuple[str | None, str | None],
) -> str:
    """The face of one edge of the section; the body is to the left, so its outside is to the right of the edge."""
    (r0, z0), (r1, z1) = ends
    length = math.hypot(r1 - r0, z1 - z0)
    out_r, out_z = (z1 - z0) / length, -(r1 - r0) / length

    def used(edge: str, forward: bool) -> str:
        return f.add(f"ORIENTED_EDGE('',*,*,{edge},.{'T' if forward else 'F'}.)")

    if abs(z1 - z0) < ON_AXIS:  # a plane: an annulus or a disk
        surface = f.add(f"PLANE('',{f.axis(z0, math.copysign(1.0, out_z))})")
        bounds = []
        for radius, circle in sorted(((r0, circles[0]), (r1, circles[1])), reverse=True):
            if circle is None:
                continue
            outer = radius == max(r0, r1)
            forward = (out_z > 0) == outer
            loop = f.add(f"EDGE_LOOP('',({used(circle, forward)}))")
            bounds.append(f.add(f"FACE_{'OUTER_' if outer else ''}BOUND('',{loop},.T.)"))
        return f.add(f"ADVANCED_FACE('',({','.join(bounds)}),{surface},.T.)")
    if abs(r1 - r0) < ON_AXIS:
        surface = f.add(f"CYLINDRICAL_SURFACE('',{f.axis(z0)},{_n(r0)})")
    else:
        # a cone's radius grows along its axis: turned over where the section narrows upwards
        grows = (r1 - r0) * (z1 - z0) > 0
        half = math.atan2(abs(r1 - r0), abs(z1 - z0))
        surface = f.add(f"CONICAL_SURFACE('',{f.axis(z0, 1.0 if grows else -1.0)},{_n(r0)},{_n(half)})")
    along = f.direction((r1 - r0) / length, 0, (z1 - z0) / length)
    start = f.point(r0, 0, z0)
    vector = f.add(f"VECTOR('',{along},1.)")
    line = f.add(f"LINE('',{start},{vector})")
    seam = f.add(f"EDGE_CURVE('',{vertices[0]},{vertices[1]},{line},.T.)")
    # once around with the outside towards the viewer, up the seam at theta = 2 pi and down at theta = 0
    first, last = circles
    edges = []
    if first:
        edges.append(used(first, True))
    edges.append(used(seam, True))
    if last:
        edges.append(used(last, False))
    edges.append(used(seam, False))
    loop = f.add(f"EDGE_LOOP('',({','.join(edges)}))")
    bound = f.add(f"FACE_OUTER_BOUND('',{loop},.T.)")
    same = out_r > 0  # the natural normal of cylinders and cones points away from the axis
    return f.add(f"ADVANCED_FACE('',({bound}),{surface},.{'T' if same else 'F'}.)")


def _product(f: _File, solid: str, name: str) -> None:
    """What a reader needs around a solid: product, units (mm), representation."""
    app = f.add("APPLICATION_CONTEXT('automotive design')")
    f.add(f"APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,{app})")
    context = f.add(f"PRODUCT_CONTEXT('',{app},'mechanical')")
    product = f.add(f"PRODUCT('{name}','{name}','',({context}))")
    formation = f.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    stage = f.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{app},'design')")
    definition = f.add(f"PRODUCT_DEFINITION('design','',{formation},{stage})")
    shape = f.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    length = f.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    angle = f.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid_angle = f.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    accuracy = f.add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-06),{length},'distance_accuracy_value','')")
    whole = f.add(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({accuracy}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid_angle}))REPRESENTATION_CONTEXT('',''))"
    )
    frame = f.axis(0.0)
    representation = f.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',({frame},{solid}),{whole})")
    f.add(f"SHAPE_DEFINITION_REPRESENTATION({shape},{representation})")

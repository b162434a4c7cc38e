#!/usr/bin/env python3
"""Writes the centre lines of scenes/carotid.toml: lumen, plaque, and what flows, as CSV files.

    python3 tools/carotid.py scenes/carotid

World frame of the scene, mm: y towards the head, z into the neck, x away from the trachea. Sizes and angles:

- Diameters: common carotid 6.3 mm (Krejza et al. 2006, Stroke 37, 1103-1105: 6.10 in women, 6.52 in men), internal 4.84 mm
  (the same: 4.66 and 5.11), external 0.75 of the common one (Thomas et al. 2005, Stroke 36, 2450-2456, older adults), sinus
  7.59 mm at its widest (Baz et al. 2021, Medicina 57, 832).
- Angles: the internal carotid leaves the direction of the common one by 18 degrees, the external one by 30 (Thomas et
  al. 2005, young adults: 21.6 +- 6.7, and 48.5 +- 6.3 between both).
- Stenosis by NASCET: what the throat's diameter lacks of that of the internal carotid behind the sinus.

Rate of flow in a tube with the profile 1 - (r/R)^K is pi R^2 v K / (K + 2). Where a parabola is squeezed to the share a
of its area without losses, every streamline gains the same pressure head: v'^2 = v^2 + c; over all streamlines
that makes a middle of 1 + a^2 times the mean, and so K = 2 / a^2 (of a parabola, a = 1, it is twice the mean).
Behind the throat the blood goes on as a jet that widens by 1 in 4 to each side, as a round jet in unlimited water (Cress
A20.7), until it fills the lumen: no blood is lost, so that its speed falls as its area grows. What whirls beside it
stands still, and turbulence is left out.
"""

import math
import sys
from pathlib import Path

COMMON, INTERNAL, EXTERNAL = 6.3 / 2, 4.84 / 2, 0.75 * 6.3 / 2
FORK = (0.0, 0.0, 17.0)
# Slopes into the neck, degrees: the internal carotid meets a scanline straight down at 60.
COMMON_SLOPE, INTERNAL_SLOPE = 12.0, 30.0
# Radius of the internal carotid by the way from the fork, mm.
SINUS = [(0, COMMON), (3, 3.45), (6, 7.59 / 2), (9, 3.6), (12, 3.1), (15, 2.65), (18, 2.45), (20, INTERNAL), (60, INTERNAL)]
# The throat, and where plaque begins and ends; way at which the jet's profile is a parabola again, and the lumen's mesh ends.
PLAQUE, THROAT, END = (3.0, 16.0), (8.5, 10.0), 30.0
EXPONENTS = (2.0, 50.0)
JET = 1 / 4


def between(table, at):
    """The value of a table of pairs at a place, linear between them."""
    for (a, p), (b, q) in zip(table, table[1:]):
        if at <= b:
            return p + (q - p) * (at - a) / (b - a)
    return table[-1][1]


def smooth(t):
    """From 0 to 1, level at both ends."""
    t = min(max(t, 0.0), 1.0)
    return t * t * (3 - 2 * t)


def along(slope, way, off=0.0):
    """A place in the plane of x = 0: a way from the fork along a slope, and off it, deeper, mm."""
    cos, sin = math.cos(math.radians(slope)), math.sin(math.radians(slope))
    return (0.0, FORK[1] + way * cos - off * sin, FORK[2] + way * sin + off * cos)


def external():
    """Points of the external carotid: 30 degrees from the common one, to the trachea and the skin, then less."""
    points, place, way = [], list(FORK), 0.0
    while way <= 44.0:
        points.append((tuple(place), EXTERNAL, 2.0))
        angle = math.radians(30 - 20 * smooth(way / 30))
        turn = math.radians(50)  # of that to the skin rather than to the trachea
        slope = math.radians(COMMON_SLOPE)
        across = math.sin(angle)
        step = (-across * math.cos(turn),
                math.cos(angle) * math.cos(slope) + across * math.sin(turn) * math.sin(slope),
                math.cos(angle) * math.sin(slope) - across * math.sin(turn) * math.cos(slope))
        place = [p + 2 * s for p, s in zip(place, step)]
        way += 2.0
    return points


def throat(stenosis):
    """Radius of the throat."""
    return INTERNAL * (1 - stenosis)


def narrowed(stenosis, way):
    """Radius of what plaque leaves of the internal carotid."""
    whole = between(SINUS, way)
    narrow = smooth((way - PLAQUE[0]) / (THROAT[0] - PLAQUE[0])) * smooth((PLAQUE[1] - way) / (PLAQUE[1] - THROAT[1]))
    return whole + (throat(stenosis) - whole) * narrow


def pushed(stenosis, way):
    """How far plaque, which is thicker on the deep wall, pushes the throat's middle up: straight in the throat and behind it."""
    most = 0.3 * (between(SINUS, THROAT[0]) - throat(stenosis))
    return most * smooth((way - PLAQUE[0]) / 4) * smooth((THROAT[1] + 10 - way) / 8)


def lumen(stenosis, way):
    """Radius and offset of the lumen of the internal carotid."""
    if not stenosis:
        return between(SINUS, way), 0.0
    radius = narrowed(stenosis, way)
    return radius, min(pushed(stenosis, way), between(SINUS, way) - radius)


def flow(stenosis, way):
    """Radius and exponent of what flows in the internal carotid, and its offset."""
    radius, up = lumen(stenosis, way)
    if way <= PLAQUE[0]:
        return radius, EXPONENTS[0], up
    if way <= THROAT[1]:
        return radius, min(max(2 / min(radius / COMMON, 1.0) ** 4, EXPONENTS[0]), EXPONENTS[1]), up
    jet = min(radius, throat(stenosis) + JET * (way - THROAT[1]))
    fills = THROAT[1] + (INTERNAL - throat(stenosis)) / JET
    # Its flatness goes as it widens, and what is left of that until the mesh ends: drawn, not measured.
    blunt = min(2 / (throat(stenosis) / COMMON) ** 4, EXPONENTS[1])
    exponent = blunt + (4.0 - blunt) * smooth((way - THROAT[1]) / (fills - THROAT[1]))
    exponent -= 2.0 * smooth((way - fills) / (END - 2 - fills))
    return jet, exponent, min(pushed(stenosis, way), up + radius - jet)


def ways(end):
    """Places along the internal carotid: closer where it narrows."""
    out, way = [], 0.0
    while way <= end:
        out.append(way)
        way += 0.5 if 2.5 <= way < 24 else 1.5
    return out


def write(path, what, lines):
    """Lines of (place, radius, exponent) as a file."""
    rows = [f"# {what}, by tools/carotid.py. World frame of the scene, mm.", "line,x_mm,y_mm,z_mm,radius_mm,exponent"]
    for i, line in enumerate(lines, 1):
        rows += [f"{i},{x:.3f},{y:.3f},{z:.3f},{r:.3f},{k:.2f}" for (x, y, z), r, k in line]
    path.write_text("\n".join(rows) + "\n")


def internal(stenosis, of, end, start=0.0, less=0.0):
    line = []
    for way in ways(end):
        if way >= start:
            *widths, up = of(stenosis, way)
            radius, exponent = (widths + [2.0])[:2]
            line.append((along(INTERNAL_SLOPE, way, -up), radius - less, exponent))
    return line


def main(folder):
    common = [(along(COMMON_SLOPE, way), COMMON, 2.0) for way in range(-52, 1, 4)]
    write(folder / "lumen.csv", "The carotid bifurcation", [common, internal(0, lumen, 56), external()])
    write(folder / "jugular.csv", "The internal jugular vein, as blood flows in it",
          [[((10, y, 15 + 0.1 * y), 4.5, 2.0) for y in (70, -70)]])
    # Wider than the lumen, with steep flanks where hardly anything is narrowed yet: its tips hide in the blood that is left.
    begin, end = PLAQUE[0] + 0.2, PLAQUE[1] - 0.2
    places = [begin, begin + 0.6] + [w for w in ways(end - 0.8) if w >= begin + 0.8] + [end - 0.6, end]
    plaque = [(along(INTERNAL_SLOPE, w), 0.5 if w in (begin, end) else between(SINUS, w) + 0.25, 2.0) for w in places]
    write(folder / "plaque.csv", "The room of plaque in the sinus", [plaque])
    for percent in (50, 70):
        part = percent / 100
        write(folder / f"stenosis-{percent}.csv", f"What is left of the lumen by a stenosis of {percent} %",
              [internal(part, lumen, END, start=2.0, less=0.02)])
        write(folder / f"flow-{percent}.csv", f"What flows through a stenosis of {percent} %, with its jet",
              [common, internal(part, flow, 56), external()])


if __name__ == "__main__":
    main(Path(sys.argv[1]))

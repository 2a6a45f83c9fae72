"""Draws docs/studies/surfaces.svg from the first table of docs/studies/surfaces.md: python3 docs/studies/surfaces.py"""

import math
import pathlib

FOLDER = pathlib.Path(__file__).parent
MESHES = ["bunny", "horse", "armadillo"]
COLOURS = ["#b3541e", "#1f6f8b", "#6b8e23"]
LEFT, RIGHT, TOP, BOTTOM = 70, 470, 20, 350
SECONDS, ERRORS = (1, 10), (0.0007, 0.007)


def scale(value, ends, places):
    """A place on a logarithmic axis."""
    return places[0] + (places[1] - places[0]) * math.log(value / ends[0]) / math.log(ends[1] / ends[0])


x = lambda seconds: scale(seconds, SECONDS, (LEFT, RIGHT))
y = lambda error: scale(error, ERRORS, (BOTTOM, TOP))


def rows():
    """Flags, then error and seconds for each mesh."""
    for line in (FOLDER / "surfaces.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) == 10 and cells[1].startswith("."):
            yield [(float(cells[1 + 3 * k]), float(cells[3 + 3 * k])) for k in range(3) if cells[1 + 3 * k] and cells[3 + 3 * k]]


def svg():
    measured = list(rows())
    [published] = next(row for row in measured if len(row) == 1)
    runs = [row for row in measured if len(row) == 3]
    yield '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 400" font-family="sans-serif" font-size="13"><rect width="640" height="400" fill="white"/>'
    for seconds in (1, 2, 3, 5, 10):
        yield f'<line x1="{x(seconds):.1f}" x2="{x(seconds):.1f}" y1="{TOP}" y2="{BOTTOM}" stroke="#ddd"/><text x="{x(seconds):.1f}" y="368" text-anchor="middle">{seconds}</text>'
    for error in (0.001, 0.002, 0.003, 0.005):
        yield f'<line x1="{LEFT}" x2="{RIGHT}" y1="{y(error):.1f}" y2="{y(error):.1f}" stroke="#ddd"/><text x="62" y="{y(error) + 4:.1f}" text-anchor="end">{f"{error:.3f}"[1:]}</text>'
    for error, name, dashes in ((0.00145, "published, on a GPU", "5 4"), (0.00366, "published, no remeshing", "2 4")):
        yield f'<line x1="{LEFT}" x2="{RIGHT}" y1="{y(error):.1f}" y2="{y(error):.1f}" stroke="#777" stroke-dasharray="{dashes}"/><text x="{RIGHT + 8}" y="{y(error) + 4:.1f}" fill="#555">{name}</text>'
    yield f'<circle cx="{x(published[1]):.1f}" cy="{y(published[0]):.1f}" r="5" fill="#555"/>'
    ends = []
    for k in range(3):
        points = [(x(row[k][1]), y(row[k][0])) for row in runs]
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
        yield f'<polyline points="{line}" fill="none" stroke="{COLOURS[k]}" stroke-width="2.5"/>'
        yield from (f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.2" fill="{COLOURS[k]}"/>' for a, b in points)
        ends.append((points[-1], MESHES[k], COLOURS[k]))
    for (a, b), name, colour in ends:
        yield f'<text x="{a + 8:.1f}" y="{b + 4:.1f}" fill="{colour}">{name}</text>'
    yield '<text x="270" y="392" text-anchor="middle">seconds</text><text transform="translate(18 185) rotate(-90)" text-anchor="middle">error (lower is better)</text></svg>'


(FOLDER / "surfaces.svg").write_text("\n".join(svg()) + "\n", encoding="utf-8")

"""Draws docs/results/ingredients.svg from the first table of docs/findings.md: python3 docs/results/ingredients.py"""

import pathlib
import re

FOLDER = pathlib.Path(__file__).parent
ROWS = {"POSE, camera within 5°": "POSE", "POSE, transfer": "POSE, transfer", "3D SHAPE, mean error": "3D SHAPE", "3D SHAPE, transfer, mean error": "3D SHAPE, transfer"}
COLOURS = ["#1f6f8b", "#7fb4c6", "#b3541e", "#dda27f"]
STEPS = ["fixed width", "narrowing width", "+ restarts (POSE),\nfalling rate (3D SHAPE)", "the same, learned"]
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 360, 60, 150, 20, 60


def rows():
    """What is left of the failures (POSE) or of the error (3D SHAPE), in percent of fixed width."""
    left = dict(ROWS)
    for line in (FOLDER / "../findings.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if cells[0] in left:
            numbers = [float(re.match(r"[\d.]+", cell)[0]) for cell in cells[1:]]
            if "%" in cells[1]:
                numbers = [100 - number for number in numbers]
            yield left.pop(cells[0]), [100 * number / numbers[0] for number in numbers]


def svg():
    x = lambda step: LEFT + 40 + (WIDTH - LEFT - RIGHT - 80) * step / (len(STEPS) - 1)
    y = lambda percent: TOP + (HEIGHT - TOP - BOTTOM) * (1 - percent / 105)
    yield f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13"><rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    for percent in range(0, 101, 25):
        yield f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(percent):.1f}" y2="{y(percent):.1f}" stroke="#ddd"/>'
        yield f'<text x="{LEFT - 8}" y="{y(percent) + 4:.1f}" text-anchor="end">{percent} %</text>'
    for step, name in enumerate(STEPS):
        for k, part in enumerate(name.split("\n")):
            yield f'<text x="{x(step):.1f}" y="{HEIGHT - BOTTOM + 22 + 16 * k}" text-anchor="middle">{part}</text>'
    ends = []
    for (name, numbers), colour in zip(rows(), COLOURS, strict=True):
        points = " ".join(f"{x(k):.1f},{y(number):.1f}" for k, number in enumerate(numbers))
        yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="3"/>'
        yield from (f'<circle cx="{x(k):.1f}" cy="{y(number):.1f}" r="4" fill="{colour}"/>' for k, number in enumerate(numbers))
        place = y(numbers[-1]) + 4
        while any(abs(place - other) < 15 for other in ends):
            place += 3 if name.endswith("transfer") and numbers[-1] < 40 else -3
        ends.append(place)
        yield f'<text x="{x(len(STEPS) - 1) + 10:.1f}" y="{place:.1f}" fill="{colour}">{name}: {numbers[-1]:.0f} %</text>'
    yield "</svg>"


if __name__ == "__main__":
    (FOLDER / "ingredients.svg").write_text("\n".join(svg()) + "\n", encoding="utf-8")

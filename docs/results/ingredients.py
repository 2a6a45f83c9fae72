"""Draws docs/results/ingredients.svg from the first two tables of docs/findings.md: python3 docs/results/ingredients.py"""

import pathlib
import re

FOLDER = pathlib.Path(__file__).parent
# Rows of the tables, original and transfer, and the names of their columns.
PANELS = {
    "POSE: cameras beyond 5°": (["POSE, camera within 5°", "POSE, transfer"], ["fixed width", "narrowing", "+ restarts", "learned"]),
    "3D SHAPE: error": (["3D SHAPE, mean error", "3D SHAPE, transfer, mean error"], ["fixed width", "narrowing", "+ falling rate", "learned"]),
    "2D SHAPE: error": (["2D SHAPE, mean error", "2D SHAPE, transfer, mean error"], ["fixed width", "narrowing", "learned"]),
    "OCCLUSION: error": ([None, "OCCLUSION, transfer"], ["rate given,\nfixed width", "rate given,\nlearned", "searched,\nfixed width", "searched,\nnarrowing"]),
}
COLOURS = {"original": "#1f6f8b", "transfer": "#b3541e"}
WIDTH, HEIGHT, TOP, BOTTOM, LEFT, RIGHT = 440, 260, 30, 52, 52, 100


def rows():
    """Name of a row, and what is left of failures or error in percent of its first column."""
    names = {name for panel, _ in PANELS.values() for name in panel if name}
    for line in (FOLDER / "../findings.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if cells[0] in names:
            numbers = [float(re.match(r"[\d.]+", cell)[0]) for cell in cells[1:] if cell]
            if "%" in cells[1]:
                numbers = [100 - number for number in numbers]
            names.remove(cells[0])
            yield cells[0], [100 * number / numbers[0] for number in numbers]


def panel(title, names, steps, known):
    x = lambda step: LEFT + 34 + (WIDTH - LEFT - RIGHT - 54) * step / (len(steps) - 1)
    y = lambda percent: TOP + (HEIGHT - TOP - BOTTOM) * (1 - percent / 120)
    yield f'<text x="{LEFT}" y="20" font-weight="bold">{title}</text>'
    for percent in range(0, 101, 25):
        yield f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(percent):.1f}" y2="{y(percent):.1f}" stroke="#ddd"/>'
        yield f'<text x="{LEFT - 6}" y="{y(percent) + 4:.1f}" text-anchor="end">{percent} %</text>'
    for step, name in enumerate(steps):
        for k, part in enumerate(name.split("\n")):
            yield f'<text x="{x(step):.1f}" y="{HEIGHT - BOTTOM + 20 + 14 * k}" text-anchor="middle" font-size="12">{part}</text>'
    lines = [(variant, known[name]) for variant, name in zip(COLOURS, names) if name]
    ends = [y(numbers[-1]) + 4 for _, numbers in lines]
    if len(ends) == 2 and abs(ends[0] - ends[1]) < 14:
        middle, down = sum(ends) / 2, 7 if ends[0] > ends[1] else -7
        ends = [middle + down, middle - down]
    for (variant, numbers), end in zip(lines, ends):
        colour = COLOURS[variant]
        points = " ".join(f"{x(k):.1f},{y(number):.1f}" for k, number in enumerate(numbers))
        yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="3"/>'
        yield from (f'<circle cx="{x(k):.1f}" cy="{y(number):.1f}" r="4" fill="{colour}"/>' for k, number in enumerate(numbers))
        yield f'<text x="{x(len(steps) - 1) + 10:.1f}" y="{end:.1f}" fill="{colour}">{variant}: {numbers[-1]:.0f} %</text>'


def svg():
    known = dict(rows())
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} {2 * HEIGHT}" font-family="sans-serif" font-size="13">'
        f'<rect width="{2 * WIDTH}" height="{2 * HEIGHT}" fill="white"/>'
    )
    for k, (title, (names, steps)) in enumerate(PANELS.items()):
        yield f'<g transform="translate({k % 2 * WIDTH} {k // 2 * HEIGHT})">'
        yield from panel(title, names, steps, known)
        yield "</g>"
    yield "</svg>"


if __name__ == "__main__":
    (FOLDER / "ingredients.svg").write_text("\n".join(svg()) + "\n", encoding="utf-8")

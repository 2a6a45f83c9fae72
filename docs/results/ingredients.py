"""Draws docs/results/ingredients.svg from the records of docs/results: python3 docs/results/ingredients.py

Points are means relative to the first method of a panel, in percent, with the 95 % interval of the paired difference; for POSE shares of runs that end
beyond 5 degrees, with Wilson's interval.
"""

import json
import math
import pathlib

FOLDER = pathlib.Path(__file__).parent
COLOURS = {True: "#1f6f8b", False: "#b3541e"}
# Of each panel its title, task, and methods: label, runs of its search or learning, name in the records.
PANELS = [
    ("POSE: cameras beyond 5°", "pose", [
        ("fixed width", "960 runs", "FIXED"),
        ("narrowing", "960 runs", "logistic decay"),
        ("+ restarts", "no search", "pose-restarts"),
        ("learned", "1,056 runs", "preset"),
    ]),
]
WIDTH, HEIGHT, TOP, BOTTOM, LEFT, RIGHT = 440, 270, 30, 62, 52, 104
MOST = 125


def records():
    """The records by task, variant and name; the most seeds count."""
    found = {}
    for name in ("cells.jsonl", "pose.jsonl", "ingredients.jsonl"):
        for line in (FOLDER / name).read_text(encoding="utf-8").splitlines():
            one = json.loads(line)
            key = one["task"], one["original"], one["method"]
            if key not in found or len(one["returned"]) >= len(found[key]["returned"]):
                found[key] = one
    return found


def quantile(freedom):
    """The 97.5 % quantile of Student's distribution, by Hill's expansion to 1e-3 from 9 degrees of freedom on."""
    z = 1.959964
    terms = z, (z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return sum(term / freedom**k for k, term in enumerate(terms))


def relative(one, first):
    """Mean relative to that of the first method, and its interval, in percent."""
    if one["task"] == "pose":
        count = len(one["returned"])
        share, base = 1 - one["successes"] / count, 1 - first["successes"] / len(first["returned"])
        z = 1.959964
        middle, half = share + z * z / 2 / count, z * math.sqrt(share * (1 - share) / count + z * z / 4 / count**2)
        ends = [(middle + sign * half) / (1 + z * z / count) for sign in (-1, 1)]
        return [100 * x / base for x in (share, *ends)]
    pairs = list(zip(one["returned"], first["returned"]))
    base = sum(b for _, b in pairs) / len(pairs)
    differences = [a - b for a, b in pairs]
    mean = sum(differences) / len(pairs)
    spread = math.sqrt(sum((x - mean) ** 2 for x in differences) / (len(pairs) - 1) / len(pairs))
    half = quantile(len(pairs) - 1) * spread
    return [100 + 100 * x / base for x in (mean, mean - half, mean + half)]


def panel(title, task, methods, known):
    x = lambda step: LEFT + 34 + (WIDTH - LEFT - RIGHT - 54) * step / (len(methods) - 1)
    y = lambda percent: TOP + (HEIGHT - TOP - BOTTOM) * (1 - min(percent, MOST) / MOST)
    yield f'<text x="{LEFT}" y="18" font-weight="bold">{title}</text>'
    for percent in range(0, 101, 25):
        yield f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(percent):.1f}" y2="{y(percent):.1f}" stroke="#ddd"/>'
        yield f'<text x="{LEFT - 6}" y="{y(percent) + 4:.1f}" text-anchor="end">{percent} %</text>'
    for step, (label, runs, _) in enumerate(methods):
        for k, part in enumerate([*label.split("\n"), runs]):
            style = 'font-size="10" fill="#666"' if part == runs else 'font-size="12"'
            yield f'<text x="{x(step):.1f}" y="{HEIGHT - BOTTOM + 18 + 14 * k}" text-anchor="middle" {style}>{part}</text>'
    lines = []
    for original in (True, False):
        found = [known.get((task, original, name)) for _, _, name in methods]
        if all(found):
            lines.append((original, [relative(one, found[0]) for one in found]))
    ends = [y(numbers[-1][0]) + 4 for _, numbers in lines]
    if len(ends) == 2 and abs(ends[0] - ends[1]) < 14:
        middle, down = sum(ends) / 2, 7 if ends[0] > ends[1] else -7
        ends = [middle + down, middle - down]
    for (original, numbers), end in zip(lines, ends):
        colour, aside = COLOURS[original], -2 if original else 2
        points = " ".join(f"{x(k) + aside:.1f},{y(number):.1f}" for k, (number, _, _) in enumerate(numbers))
        yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="3"/>'
        for k, (number, low, high) in enumerate(numbers):
            at = f"{x(k) + aside:.1f}"
            if k:
                yield f'<line x1="{at}" x2="{at}" y1="{y(low):.1f}" y2="{y(high):.1f}" stroke="{colour}"/>'
            yield f'<circle cx="{at}" cy="{y(number):.1f}" r="4" fill="{colour}"/>'
        name = "original" if original else "transfer"
        yield f'<text x="{x(len(methods) - 1) + 12:.1f}" y="{end:.1f}" fill="{colour}">{name}: {numbers[-1][0]:.0f} %</text>'


def svg():
    known = records()
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} {2 * HEIGHT}" font-family="sans-serif" font-size="13">'
        f'<rect width="{2 * WIDTH}" height="{2 * HEIGHT}" fill="white"/>'
    )
    for k, (title, task, methods) in enumerate(PANELS):
        yield f'<g transform="translate({k % 2 * WIDTH} {k // 2 * HEIGHT})">'
        yield from panel(title, task, methods, known)
        yield "</g>"
    yield "</svg>"


if __name__ == "__main__":
    (FOLDER / "ingredients.svg").write_text("\n".join(svg()) + "\n", encoding="utf-8")

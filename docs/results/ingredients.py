"""Draws docs/results/ingredients.svg, and writes the table of docs/findings.md, from the records of docs/results: python3 docs/results/ingredients.py

Points are means in percent of that of the first method of a panel, with the 95 % interval (Student) of the paired difference; for POSE they are shares of
runs that end beyond 5 degrees, with Wilson's interval. The first method's own mean or share counts as exact.
"""

import json
import math
import pathlib
import statistics

FOLDER = pathlib.Path(__file__).parent
COLOURS = {True: "#1f6f8b", False: "#b3541e"}
# Title, task and methods of each panel; a method has a label, the runs of its search or learning, and a name in the records.
PANELS = [
    ("POSE: cameras beyond 5°", "pose", [
        ("fixed\nwidth", "960 runs", "logistic static scale 0.00144 learning-rate 1.33"),
        ("narrowing\nwidth", "960 runs", "logistic decay scale 0.00127 scale-end 0.00109 learning-rate 0.617"),
        ("with a\nsurrogate", "960 runs", "logistic decay"),
        ("restarts\nby a rule", "960 runs", "pose-restarts"),
        ("restarts,\nlearned", "1,056 runs", "preset"),
    ]),
    ("3D SHAPE: error", "shape3d", [
        ("fixed\nwidth", "687 runs", "gauss static scale 0.00522 learning-rate 0.0387"),
        ("narrowing\nwidth", "687 runs", "gauss decay scale 0.0155 scale-end 0.00354 learning-rate 0.033"),
        ("with a\nsurrogate", "390 runs", "logistic decay"),
        ("and a\nfalling rate", "687 runs", "gauss decay scale 0.00726 scale-end 0.00132 surrogate-scale 0.0229 learning-rate 0.101 rate-end 0.0751"),
        ("the same,\nlearned", "672 runs", "shape3d-learned"),
    ]),
    ("2D SHAPE: error", "shape2d", [
        ("fixed\nwidth", "394 runs", "gauss static"),
        ("narrowing\nwidth", "394 runs", "gauss decay"),
        ("and a\nfalling rate", "394 runs", "gauss decay scale 0.0426 scale-end 9.18e-4 learning-rate 0.00982 rate-end 0.127"),
        ("the same,\nlearned", "368 runs", "shape2d-learned"),
    ]),
    ("OCCLUSION: error", "occlusion", [
        ("rate given,\nfixed width", "936 runs", "gauss static scale 1.68e-4 learning-rate 0.7 depth-scale 0.29"),
        ("rate given,\nlearned", "3,700 runs", "learned"),
        ("searched,\nfixed width", "960 runs", "gauss static"),
        ("searched,\nnarrowing", "960 runs", "gauss decay"),
    ]),
]
WIDTH, HEIGHT, TOP, BOTTOM, LEFT, RIGHT = 470, 275, 30, 66, 52, 104
MOST = 155


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
    """The 97.5 % quantile of Student's distribution, by its expansion in powers of 1 / freedom: within 3e-4 from 9 degrees on."""
    z = 1.959964
    terms = z, (z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return sum(term / freedom**k for k, term in enumerate(terms))


def failing(one):
    """Share of runs beyond 5 degrees, and its interval, in percent."""
    count = len(one["returned"])
    share, z = 1 - one["successes"] / count, quantile(1e9)
    middle, half = share + z * z / 2 / count, z * math.sqrt(share * (1 - share) / count + z * z / 4 / count**2)
    return [100 * share, *(100 * (middle + sign * half) / (1 + z * z / count) for sign in (-1, 1))]


def difference(one, other):
    """Mean paired difference of errors, and its interval."""
    assert len(one["returned"]) == len(other["returned"]), (one["method"], other["method"])
    differences = [a - b for a, b in zip(one["returned"], other["returned"])]
    half = quantile(len(differences) - 1) * statistics.stdev(differences) / math.sqrt(len(differences))
    mean = statistics.mean(differences)
    return [mean, mean - half, mean + half]


def relative(one, first):
    """Failures or mean error in percent of the first method, and the interval."""
    if one["task"] == "pose":
        return [100 * x / failing(first)[0] for x in failing(one)]
    return [100 + 100 * x / statistics.mean(first["returned"]) for x in difference(one, first)]


def short(number):
    """Three digits of an error, two of a small difference."""
    return f"{number:.1e}".replace("e-0", "e-") if abs(number) < 1e-3 else f"{number:.3g}"


def table(known):
    """One row for each method: what it returns, and its difference to the row above."""
    yield "| task | method | runs of its search | original | difference to the row above | transfer | difference to the row above |"
    yield "|---|---|--:|--:|--:|--:|--:|"
    for title, task, methods in PANELS:
        above = {}
        for label, runs, name in methods:
            cells = []
            for original in (True, False):
                one = known.get((task, original, name))
                # OCCLUSION's original is solved without an error by most settings.
                if one is None or task == "occlusion" and original:
                    cells += ["", ""]
                    continue
                if task == "pose":
                    share, low, high = (100 - x for x in failing(one))
                    cells += [f"{share:.1f} % ({high:.1f} to {low:.1f}) of {len(one['returned']):,}", ""]
                    continue
                found = "" if original not in above else "{} ({} to {})".format(*map(short, difference(one, above[original])))
                cells += [short(statistics.mean(one["returned"])), found]
                above[original] = one
            yield f"| {title.split(':')[0]} | {label.replace(chr(10), ' ')} | {runs.removesuffix(' runs')} | {' | '.join(cells)} |"


def panel(title, task, methods, known):
    x = lambda step: LEFT + 34 + (WIDTH - LEFT - RIGHT - 54) * step / (len(methods) - 1)
    y = lambda percent: TOP + (HEIGHT - TOP - BOTTOM) * (1 - min(max(percent, 0), MOST) / MOST)
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
        found = [known.get((task, original, name)) for _, _, name in methods if task != "occlusion" or not original]
        assert all(found) or not any(found), (task, [name for (_, _, name), one in zip(methods, found) if one is None])
        if found and all(found):
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


def svg(known):
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
    known = records()
    (FOLDER / "ingredients.svg").write_text("\n".join(svg(known)) + "\n", encoding="utf-8")
    page = FOLDER / "../findings.md"
    before, rest = page.read_text(encoding="utf-8").split("<!-- ingredients -->\n")
    after = rest.split("<!-- end of ingredients -->")[1]
    rows = "\n".join(table(known))
    page.write_text(f"{before}<!-- ingredients -->\n\n{rows}\n\n<!-- end of ingredients -->{after}", encoding="utf-8")

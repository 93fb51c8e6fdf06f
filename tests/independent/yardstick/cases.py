"""What is rendered and tracked."""
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
RIGS = ROOT / "tests/independent"
ALAN = ROOT / "config/rigs/alan.yaml"
INFRARED = RIGS / "infrared.yaml"
MOSAIC = RIGS / "mosaic.yaml"
ROLLING = RIGS / "rolling.yaml"
EIGHT = RIGS / "eight_leds.yaml"

PAIRS = [(i, j) for i in range(6) for j in range(i + 1, 6)]
TRIPLES = [(i, j, k) for i in range(8) for j in range(i + 1, 8) for k in range(j + 1, 8)]


def commas(numbers):
    return ",".join(map(str, numbers))


class Case:
    """A sequence on disk and the rig it is tracked with."""

    def __init__(self, name, renderer, arguments, rig=ALAN, group=None):
        self.name = name
        self.renderer = renderer  # alight or other
        self.arguments = [str(a) for a in arguments]
        self.rig = rig
        self.group = group or name

    def spec(self):
        return {"renderer": self.renderer, "arguments": self.arguments,
                "rig": self.rig.read_text()}


def sequences(quick):
    """Of both renderers, the plain ones first."""
    out = []

    def add(name, arguments, rig=ALAN, group=None):
        for renderer in ("alight", "other"):
            grey = ["--grey"] if renderer == "other" and rig == INFRARED else []
            out.append(Case(f"{renderer}_{name}", renderer, [*arguments, *grey], rig,
                            f"{renderer} {group or name}"))

    for seed in range(1, 2 if quick else 5):
        add(f"clean_{seed}", ["--seed", seed], group="clean")
        add(f"hard_{seed}", ["--seed", seed, "--kind", "hard"], group="hard")
    add("blackout", ["--seed", 11, "--frames", 300, "--blackout", "2,2.5"])
    add("infrared", ["--seed", 12], INFRARED)
    for seed in range(21, 22 if quick else 24):
        add(f"mosaic_{seed}", ["--seed", seed], MOSAIC, group="mosaic")
    for seed in range(31, 32 if quick else 34):
        add(f"rolling_{seed}", ["--seed", seed], ROLLING, group="rolling")
    for seed in range(41, 42 if quick else 44):
        # Light stored by a power of it, of which the rig file says nothing.
        out.append(Case(f"other_gamma_{seed}", "other",
                        ["--seed", seed, "--gamma", 2.2], group="other gamma 2.2"))
    out.append(Case("other_gamma_hard", "other",
                    ["--seed", 44, "--kind", "hard", "--gamma", 2.2],
                    group="other hard, gamma 2.2"))
    add("strays_100", ["--seed", 13, "--frames", 300, "--stray", 100], group="100 strays")
    dead = [("one dead", ALAN, (2,)), ("two dead", ALAN, (0, 4)),
            ("three of eight dead", EIGHT, (1, 4, 6))]
    if not quick:
        dead += [("one dead", ALAN, (i,)) for i in (0, 1, 3, 4, 5)]
        dead += [("two dead", ALAN, pair) for pair in ((1, 2), (3, 4), (0, 5))]
        dead += [("three of eight dead", EIGHT, t) for t in ((0, 1, 2), (2, 3, 5), (5, 6, 7))]
    for k, (group, rig, which) in enumerate(dead):
        name = "dead_" + "_".join(map(str, which)) + ("_of_8" if rig == EIGHT else "")
        add(name, ["--seed", 14 + k, "--frames", 300, "--dead", commas(which)], rig, group)
    return out


class Study:
    """Many flights in memory, by `alight measure`."""

    def __init__(self, name, seeds, arguments, rig=ALAN, first=1001):
        self.name = name
        self.seeds = seeds
        self.first = first
        self.arguments = [str(a) for a in arguments]
        self.rig = rig


def nees_studies(quick):
    seeds, frames = (40, 120) if quick else (200, 600)
    return [Study(kind, seeds, ["--kind", kind, "--frames", frames])
            for kind in ("clean", "hard")] + [
        Study("infrared", 10 if quick else 40, ["--frames", frames], INFRARED)]


def dead_studies(quick):
    """Every single LED, every pair, every three of eight."""
    singles = [(i,) for i in range(6)]
    step = 5 if quick else 1
    out = []
    for what, rig, sets in (("one dead", ALAN, singles), ("two dead", ALAN, PAIRS[::step]),
                            ("three of eight dead", EIGHT, TRIPLES[::step])):
        for kind in ("clean", "hard"):
            for which in sets:
                out.append((what, kind, Study(
                    f"{what} {commas(which)} {kind}", 1 if quick else 2,
                    ["--kind", kind, "--frames", 300, "--dead", commas(which)], rig,
                    first=2001 + 7 * sum(5**n * i for n, i in enumerate(which)))))
    return out


def blackout_study(quick):
    return Study("blackout", 10 if quick else 60, ["--frames", 120, "--blackout", "1,1.5"],
                 first=3001)


def stray_studies(quick):
    return [(n, Study(f"strays {n}", 3 if quick else 10,
                      ["--frames", 150, "--lights", 0, "--stray", n], first=4001))
            for n in (0, 25, 50, 100, 200)]


def start_studies(quick):
    """From nothing: (stray lights, limit in us, flights)."""
    return [(n, limit, Study(f"start {n}", 40 if quick else 400,
                             ["--frames", 3, "--lights", 0, "--stray", n], first=6001))
            for n, limit in ((0, 300), (40, 1000), (100, 5000))]


def led_rig(count, folder):
    """A rig file with `count` LEDs along a zigzag at the drone's front."""
    text = ALAN.read_text()
    head, tail = text[:text.index("leds:")], text[text.index("drone:"):]
    lines = ["leds:"]
    for i in range(count):
        y = -0.085 + 0.17 * i / (count - 1)
        x = 0.06 + 0.03 * ((i * 7) % 5) / 4
        z = -0.05 + 0.05 * ((i * 3) % 4) / 3
        lines.append(f"  - {{xyz_m: [{x:.4f}, {y:.4f}, {z:.4f}], "
                     f"color: {'green' if (i * i) % 3 == 0 else 'red'}}}")
    path = folder / f"leds_{count}.yaml"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(head + "\n".join(lines) + "\n" + tail)
    return path


def led_studies(quick, folder):
    return [(n, Study(f"leds {n}", 3 if quick else 10, ["--frames", 150],
                      led_rig(n, folder), first=5001)) for n in (4, 6, 8, 10, 12, 14, 16)]

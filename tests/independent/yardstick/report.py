"""Tables for the terminal and for docs/estimation.md."""

COLUMNS = (("returned", "returned %", 100, 2), ("correct", "correct %", 100, 2),
           ("position_rmse_m", "pos mm", 1000, 2), ("rotation_rmse_deg", "rot deg", 1, 3),
           ("velocity_rmse_m_s", "vel m/s", 1, 3),
           ("velocity_rmse_settled_m_s", "settled", 1, 3),
           ("position_max_m", "max mm", 1000, 0),
           ("surely_wrong", "sure wrong", 1, 0), ("nees6_mean", "NEES6", 1, 2),
           ("nees6_inside", "in 95 %", 100, 0), ("nees9_mean", "NEES9", 1, 2),
           ("nis_mean", "NIS", 1, 2), ("us_p50", "us p50", 1, 0), ("us_p99", "us p99", 1, 0))


def cell(value, digits, scale=1.0):
    return "-" if value is None or value != value else f"{scale * value:.{digits}f}"


def percent(share):
    return "-" if share is None else cell(share, 0, 100) + " %"


def sequence_rows(rows):
    width = max([len(name) for name, _ in rows] + [8])
    yield " " * width + " " + " ".join(f"{title:>10}" for _, title, _, _ in COLUMNS)
    for name, s in rows:
        yield f"{name:{width}} " + " ".join(
            f"{cell(s.get(key), digits, scale):>10}" for key, _, scale, digits in COLUMNS)


def gap_line(name, gaps):
    listed = ", ".join(f"{k} for {n}" for k, n in gaps[:8])
    more = f" and {len(gaps) - 8} times more" if len(gaps) > 8 else ""
    return f"{name}: no pose from frame {listed}{more}"


class Verdicts:
    """Figure asked for beside figure measured."""

    def __init__(self):
        self.rows = []

    def at_most(self, what, limit, value, unit="", scale=1.0, digits=2, note=""):
        self.add(what, f"at most {scale * limit:g}{unit}", value,
                 f"{cell(value, digits, scale)}{unit}{note}",
                 None if value is None else value <= limit)

    def at_least(self, what, limit, value, unit="", scale=1.0, digits=2, note=""):
        self.add(what, f"{scale * limit:g}{unit}" + ("" if limit == 1 else " or more"), value,
                 f"{cell(value, digits, scale)}{unit}{note}",
                 None if value is None else value >= limit)

    def add(self, what, wanted, value, text, holds):
        measured = value is not None and value == value
        self.rows.append((what, wanted, text if measured else "not measured",
                          holds if measured else None))

    def lines(self):
        word = {True: "yes", False: "NO", None: "?"}
        widths = [max(len(r[i]) for r in self.rows) for i in range(3)]
        for row in self.rows:
            yield "  ".join(f"{row[i]:{widths[i]}}" for i in range(3)) + "  " + word[row[3]]

    def as_json(self):
        return [dict(zip(("what", "wanted", "measured", "holds"), row)) for row in self.rows]


def markdown(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(map(str, r)) + " |" for r in rows]) + "\n"


def bin_name(row):
    if row["by"] == "all":
        return "all"
    unit = "m" if row["by"] == "range_m" else "m/s"
    return f"{row['from']:g} to {row['to']:g} {unit}"


def documentation(document, commit, machine):
    """The measured part of docs/estimation.md."""
    text = ["Written by `script/yardstick --docs`; do not edit between the marks. "
            f"Commit {commit}, {machine}, {document['scale']}.\n"]
    verdicts = document["verdicts"]
    holds = {True: "yes", False: "**no**", None: "?"}
    text.append(markdown(("what", "wanted", "measured", "holds"),
                         [(v["what"], v["wanted"], v["measured"], holds[v["holds"]])
                          for v in verdicts]))
    text.append("Sequences of 600 frames (300 with LEDs dead, lights added or a blackout), "
                "rendered by Alight's camera model and by the independent program:\n")
    text.append(markdown(
        ("sequences", *(title for _, title, _, _ in COLUMNS[:-2])),
        [(name, *(cell(s.get(key), digits, scale) for key, _, scale, digits in COLUMNS[:-2]))
         for name, s in document["groups"].items()]))
    for kind, table in document.get("nees", {}).items():
        text.append(f"NEES over independent flights, {kind}: mean, and share of the instants "
                    "at which the mean over the flights lies inside the 95 % bounds.\n")
        text.append(markdown(
            ("flights", "pose (6), mean", "inside", "state (9), mean", "inside"),
            [(bin_name(r), cell(r["pose"]["mean"], 2), percent(r["pose"]["inside"]),
              cell(r["state"]["mean"], 2), percent(r["state"]["inside"])) for r in table]))
    if document.get("cost"):
        text.append("CPU time of a followed frame:\n")
        text.append(markdown(("picture", "p50, us", "p99, us", "first frame p50, us"),
                             [(c["what"], cell(c["us_p50"], 0), cell(c["us_p99"], 0),
                               cell(c["start_us_p50"], 0)) for c in document["cost"]]))
    return "\n".join(text)


def put_between_marks(path, title, text):
    """Replaces what stands between the marks, or appends a section with them."""
    begin, end = "<!-- yardstick -->", "<!-- /yardstick -->"
    body = f"{begin}\n{text}{end}\n"
    old = path.read_text() if path.exists() else ""
    if begin in old and end in old:
        before, rest = old.split(begin, 1)
        new = before + body.rstrip("\n") + rest.split(end, 1)[1]
    else:
        new = (old.rstrip("\n") + "\n\n" if old else "") + f"## {title}\n\n" + body
    part = path.with_suffix(".md.part")
    part.write_text(new)
    part.replace(path)

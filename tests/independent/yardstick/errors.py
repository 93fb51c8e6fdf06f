"""Estimates against the truth."""
import json
import math

import numpy as np
import yaml

WRONG_M, WRONG_DEG = 0.15, 15.0
CONFIDENT = 30.0  # squared Mahalanobis distance under which a wrong pose is told as true
SETTLED = 30      # frames until the velocity of a drone found in flight is known
RANGE_BINS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
SPEED_BINS = (0.0, 0.5, 1.0, 1.8)


def rotation(q):
    """Matrices of quaternions x, y, z, w."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
        np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
        np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1)],
        -2)


def rotation_vector(R):
    skew = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0],
                     R[..., 1, 0] - R[..., 0, 1]], -1) / 2
    sine = np.linalg.norm(skew, axis=-1)
    cosine = (np.trace(R, axis1=-2, axis2=-1) - 1) / 2
    if np.any((sine < 1e-9) & (cosine < 0)):  # half a turn: any axis will do
        return np.broadcast_to([math.pi, 0, 0], skew.shape)
    angle = np.arctan2(sine, cosine)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 1.0)
    return skew * scale[..., None]


def chi2_quantile(dof, z):
    """Wilson and Hilferty 1931; z = -1.96 and 1.96 bound 95 %."""
    return dof * (1 - 2 / (9 * dof) + z * np.sqrt(2 / (9 * dof)))**3


def rms(x):
    x = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(x * x))) if x.size else None


def mean(x):
    x = x[np.isfinite(x)]
    return float(np.mean(x)) if x.size else None


def mahalanobis(e, cov):
    """NaN for what is no covariance."""
    try:
        half = np.linalg.solve(np.linalg.cholesky(cov), e)
    except np.linalg.LinAlgError:
        return math.nan
    return float(half @ half)


class Errors:
    """Every frame of a tracked sequence against its truth."""

    FIELDS = ("tracked", "wrong", "us", "range_m", "speed", "settled", "nees6", "nees9",
              "position", "angle", "velocity")

    def __init__(self, sequence, estimate):
        truth = np.loadtxt(sequence / "truth.csv", delimiter=",", skiprows=1, ndmin=2)
        lens = np.array(yaml.safe_load((sequence / "rig_true.yaml").read_text())
                        ["mount"]["xyz_m"], float)
        lines = [json.loads(x) for x in (estimate / "frames.jsonl").read_text().splitlines()]
        if len(lines) != len(truth):
            raise RuntimeError(f"{estimate}: {len(lines)} frames, the truth has {len(truth)}")
        count = len(lines)
        self.tracked = np.array([x["tracked"] for x in lines])
        self.us = np.array([x["us"] for x in lines])
        self.range_m = np.linalg.norm(truth[:, 1:4] - lens, axis=1)
        self.speed = np.linalg.norm(truth[:, 8:11], axis=1)
        self.settled = np.arange(count) >= SETTLED
        self.nis = np.array([led["nis"] for x in lines for led in x["leds"]], float)
        self.nis_led = np.array([led["index"] for x in lines for led in x["leds"]], int)
        self.e = np.full((count, 9), np.nan)
        self.nees6 = np.full(count, np.nan)
        self.nees9 = np.full(count, np.nan)
        upper = np.triu_indices(9)
        for k, (line, row) in enumerate(zip(lines, truth)):
            if not line["tracked"]:
                continue
            if abs(line["t"] - row[0]) > 1e-6:
                raise RuntimeError(f"{estimate}: frame {k} is of {line['t']}, not {row[0]}")
            R_hat = rotation(np.array(line["q_xyzw"]))
            self.e[k] = np.concatenate([row[1:4] - line["p"],
                                        rotation_vector(R_hat.T @ rotation(row[4:8])),
                                        row[8:11] - line["v"]])
            cov = np.zeros((9, 9))
            cov[upper] = line["cov"]
            cov = cov + np.triu(cov, 1).T
            self.nees9[k] = mahalanobis(self.e[k], cov)
            self.nees6[k] = mahalanobis(self.e[k, :6], cov[:6, :6])
        self.position = np.linalg.norm(self.e[:, :3], axis=1)
        self.angle = np.degrees(np.linalg.norm(self.e[:, 3:6], axis=1))
        self.velocity = np.linalg.norm(self.e[:, 6:], axis=1)
        self.wrong = self.tracked & ~((self.position <= WRONG_M) & (self.angle <= WRONG_DEG))

    def gaps(self):
        """Runs of frames without a pose: (first frame, length)."""
        found, start = [], None
        for k, good in enumerate([*self.tracked, True]):
            if not good and start is None:
                start = k
            if good and start is not None:
                found.append((start, k - start))
                start = None
        return found


def gathered(errors):
    return {name: np.concatenate([getattr(e, name) for e in errors]) for name in Errors.FIELDS}


def figures(of):
    """Of frames with the fields of Errors."""
    tracked, wrong = of["tracked"], of["wrong"]
    some = tracked.any()
    finite6 = of["nees6"][np.isfinite(of["nees6"])]
    inside = ((finite6 > chi2_quantile(6, -1.96)) & (finite6 < chi2_quantile(6, 1.96)))
    return {
        "frames": int(tracked.size),
        "returned": float(tracked.mean()),
        "correct": float((tracked & ~wrong).mean()),
        "position_rmse_m": rms(of["position"]),
        "rotation_rmse_deg": rms(of["angle"]),
        "velocity_rmse_m_s": rms(of["velocity"]),
        "velocity_rmse_settled_m_s": rms(of["velocity"][of["settled"]]),
        "position_max_m": float(np.nanmax(of["position"])) if some else None,
        "wrong": int(wrong.sum()),
        "surely_wrong": int((wrong & ~(of["nees6"] >= CONFIDENT)).sum()),
        "nees6_mean": mean(of["nees6"]), "nees9_mean": mean(of["nees9"]),
        "nees6_inside": float(inside.mean()) if inside.size else None,
        "us_p50": float(np.percentile(of["us"], 50)),
        "us_p99": float(np.percentile(of["us"], 99)),
    }


def nis_figures(errors):
    nis = np.concatenate([e.nis for e in errors])
    led = np.concatenate([e.nis_led for e in errors])
    return {"nis_mean": mean(nis),
            "nis_inside": float(np.mean(nis < 5.991)) if nis.size else None,
            "nis_by_led": {int(i): mean(nis[led == i]) for i in np.unique(led)}}


def bins(of):
    """(name, low, high, which frames)."""
    for name, values, edges in (("range_m", of["range_m"], RANGE_BINS),
                                ("speed_m_s", of["speed"], SPEED_BINS)):
        for low, high in zip(edges, edges[1:]):
            yield name, low, high, (values >= low) & (values < high)


def figures_by_bin(of):
    out = []
    for name, low, high, which in bins(of):
        if which.any():
            out.append({"by": name, "from": low, "to": high} |
                       figures({k: v[which] for k, v in of.items()}))
    return out


class Rows:
    """The frames of `alight measure --rows`."""

    def __init__(self, path):
        with open(path) as lines:
            names = lines.readline().strip().split(",")
            table = np.loadtxt(lines, delimiter=",", ndmin=2)
        column = dict(zip(names, table.T))
        self.seed = column["seed"].astype(int)
        self.frame = column["frame"].astype(int)
        self.found = column["found"] > 0
        self.nis = (column["nis_sum"], column["observations"])
        position, angle = column["position_m"], column["rotation_deg"]
        tracked = column["tracked"] > 0
        self.of = {"tracked": tracked,
                   "wrong": tracked & ~((position <= WRONG_M) & (angle <= WRONG_DEG)),
                   "us": column["cpu_us"], "range_m": column["range_m"],
                   "speed": column["speed_m_s"], "settled": self.frame >= SETTLED,
                   "nees6": column["nees_pose"], "nees9": column["nees_state"],
                   "position": position, "angle": angle, "velocity": column["velocity_m_s"]}

    def nees_instants(self, name, dof, which):
        """Share of instants at which the mean over the runs lies inside the 95 % bounds,
        with the mean over all and the number of instants."""
        values = np.where(which, self.of[name], np.nan)
        inside = []
        for k in range(self.frame.max() + 1):
            at = values[self.frame == k]
            at = at[np.isfinite(at)]
            if at.size < 5:
                continue
            total = at.sum()
            inside.append(chi2_quantile(dof * at.size, -1.96) < total <
                          chi2_quantile(dof * at.size, 1.96))
        return {"mean": mean(values), "instants": len(inside),
                "inside": float(np.mean(inside)) if inside else None}

    def nees_table(self):
        out = []
        everywhere = np.ones(self.frame.size, bool)
        for name, low, high, which in [("all", 0, 0, everywhere), *bins(self.of)]:
            out.append({"by": name, "from": low, "to": high,
                        "pose": self.nees_instants("nees6", 6, which),
                        "state": self.nees_instants("nees9", 9, which)})
        return out

    def tracking_us(self):
        """Of frames that follow, the first of each flight and searches left out."""
        before = np.concatenate([[False], self.of["tracked"][:-1]]) & (self.frame > 0)
        return self.of["us"][before & ~self.found]

    def starting_us(self):
        return self.of["us"][self.frame == 0]

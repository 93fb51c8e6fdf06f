#!/usr/bin/env python3
"""Holds `alight plan --json` against what it says of itself, by other means.

    check_plans.py ALIGHT --rig F [--count 200] [--seed 1] [--profile default|paper|both]

Shares nothing with the planner. For random landings it rebuilds eqn:MP_OPT over all 48
control points (start, end, continuity, half-spaces, limits in I as seen from the turning
N) from the half-spaces, limits and platform in the document alone, and asks a linear
program (HiGHS) whether there is a way:

* a landing that was solved must meet every row, and the program must find a way too;
* one that was refused must have none, at the durations it names and at others of its
  samples;
* `qp` must have the cost told, at its optimum, by a second linear program on its
  optimality conditions;
* flown in I at 1 kHz by differences of positions, nothing solved exceeds a limit.

One line on standard output; each landing that breaks a law is told in full on standard
error, with the command that shows it. Exit status 1 if there is any.
"""
import argparse
import json
import math
import os
import subprocess
import sys

import numpy as np
from scipy.optimize import linprog

DEGREE = 7
POINTS = DEGREE + 1
VARIABLES = 2 * POINTS * 3
ROW_TOLERANCE = 2e-6  # m, m/s, m/s^2: what solver and program may differ by
G = 9.81


def binomial(n, k):
    return math.comb(n, k)


def raise_degree(rows, to):
    """Bernstein coefficients (rows: coefficient by variable) at a higher degree."""
    n = rows.shape[0] - 1
    while n < to:
        up = np.zeros((n + 2,) + rows.shape[1:])
        for i in range(n + 2):
            if i > 0:
                up[i] += i / (n + 1) * rows[i - 1]
            if i <= n:
                up[i] += (1 - i / (n + 1)) * rows[i]
        rows, n = up, n + 1
    return rows


class Affine:
    """A vector curve, affine in the 48 variables: coefficient x axis x (variable, 1)."""

    def __init__(self, rows):
        self.rows = rows

    @property
    def degree(self):
        return self.rows.shape[0] - 1

    @staticmethod
    def position(segment):
        rows = np.zeros((POINTS, 3, VARIABLES + 1))
        for i in range(POINTS):
            for axis in range(3):
                rows[i, axis, (segment * POINTS + i) * 3 + axis] = 1
        return Affine(rows)

    @staticmethod
    def constant(vector):
        rows = np.zeros((1, 3, VARIABLES + 1))
        rows[0, :, -1] = vector
        return Affine(rows)

    @staticmethod
    def known(coefficients):
        rows = np.zeros((len(coefficients), 3, VARIABLES + 1))
        rows[:, :, -1] = coefficients
        return Affine(rows)

    def derivative(self, duration):
        return Affine(self.degree / duration * np.diff(self.rows, axis=0))

    def __add__(self, other):
        n = max(self.degree, other.degree)
        return Affine(raise_degree(self.rows, n) + raise_degree(other.rows, n))

    def __rmul__(self, factor):
        return Affine(factor * self.rows)

    def crossed(self, w):
        """w x self, w by its Bernstein coefficients (n x 3)."""
        m = len(w) - 1
        out = np.zeros((self.degree + m + 1,) + self.rows.shape[1:])
        for j in range(m + 1):
            hat = np.array([[0, -w[j][2], w[j][1]], [w[j][2], 0, -w[j][0]],
                            [-w[j][1], w[j][0], 0]])
            for k in range(self.degree + 1):
                out[j + k] += (binomial(m, j) * binomial(self.degree, k)
                               / binomial(m + self.degree, j + k)
                               * np.tensordot(hat, self.rows[k], axes=(1, 0)))
        return Affine(out)


class Platform:
    """Motion of N from the document: components in N, changing at a constant rate."""

    def __init__(self, told):
        self.v = np.array(told["v_IN"], float)
        self.w = np.array(told["w_IN"], float)
        self.a = np.array(told["a_IN"], float)
        self.alpha = np.array(told.get("alpha_IN", [0, 0, 0]), float)
        self.g = np.array(told.get("g_N", [0, 0, -G]), float)
        # What a_IN is more than the turning of v_IN changes the speed.
        self.dv = self.a - np.cross(self.w, self.v)
        steady = np.allclose(self.dv, 0, atol=1e-9) and np.allclose(self.alpha, 0)
        self.varying = not steady and told.get("forecast", False)

    def on_segment(self, begin, duration):
        """Bernstein coefficients of v_IN, w_IN, a_IN and w' over a segment."""
        if not self.varying:
            return [self.v], [self.w], [self.a], [self.alpha]
        v = [self.v + self.dv * t for t in (begin, begin + duration)]
        w = [self.w + self.alpha * t for t in (begin, begin + duration)]
        # a = v' + w x v, quadratic in time.
        middle = 0.5 * (np.cross(w[0], v[1]) + np.cross(w[1], v[0]))
        a = [self.dv + x for x in (np.cross(w[0], v[0]), middle, np.cross(w[1], v[1]))]
        return v, w, a, [self.alpha]


class Rows:
    """A x <= b and E x = e, rebuilt from a document."""

    def __init__(self, plan, durations, paper):
        self.A, self.b = [], []
        self.build_equalities(plan, durations)
        for h in plan["halfspaces"]:
            curve = Affine.position(h["segment"])
            self.add(curve, np.array(h["a"]), h["b"])
        limits = plan["limits"]
        platform = Platform(plan["platform"])
        begin = 0
        for s in range(2):
            self.limits(s, begin, durations[s], limits, platform, paper)
            begin += durations[s]
        self.A = np.array(self.A)
        self.b = np.array(self.b)

    def add(self, curve, n, bound):
        rows = np.tensordot(curve.rows, n, axes=([1], [0]))
        for row in rows:
            self.A.append(row[:-1])
            self.b.append(bound - row[-1])

    def limits(self, s, begin, T, limits, platform, paper):
        p = Affine.position(s)
        v = p.derivative(T)
        a = v.derivative(T)
        v_IN, w, a_IN, alpha = platform.on_segment(begin, T)
        if paper:
            v_I = v + Affine.known(v_IN)
            a_I = a + Affine.known(a_IN)
        else:
            v_I = v + p.crossed(w) + Affine.known(v_IN)
            a_I = (a + 2.0 * v.crossed(w) + p.crossed(w).crossed(w) + p.crossed(alpha)
                   + Affine.known(a_IN))
            # The document's rows are control points of this degree: higher, closer.
            degree = DEGREE + 3 if platform.varying else DEGREE
            v_I = Affine(raise_degree(v_I.rows, degree))
            a_I = Affine(raise_degree(a_I.rows, degree))
        for face in limits["polyhedron"]:
            n = np.array(face["n"])
            self.add(v_I, n, face["b"] * limits["speed_m_s"])
            self.add(a_I, n, face["b"] * limits["acceleration_m_s2"])
        if paper:
            return
        f = a_I + Affine.constant(-platform.g)
        for face in limits.get("force", []):
            self.add(f, np.array(face["n"]), face["b"])
        if "body_rate_rad_s" not in limits:
            return
        # The jerk in I: the rate of the components of a_IB_N, turned with N.
        j = a_I.derivative(T) + a_I.crossed(w)
        up = np.array([0.0, 0.0, 1.0])
        n_degree = max(j.degree, f.degree)
        j = Affine(raise_degree(j.rows, n_degree))
        f = Affine(raise_degree(f.rows, n_degree))
        rate = limits["body_rate_rad_s"]
        for face in limits["polyhedron"]:
            n = np.array(face["n"])
            rows = (np.tensordot(j.rows, n, axes=([1], [0]))
                    - face["b"] * rate * np.tensordot(f.rows, up, axes=([1], [0])))
            for row in rows:
                self.A.append(row[:-1])
                self.b.append(-row[-1])

    def build_equalities(self, plan, T):
        E, e = [], []
        p = [Affine.position(s) for s in range(2)]
        v = [p[s].derivative(T[s]) for s in range(2)]
        a = [v[s].derivative(T[s]) for s in range(2)]

        def fix(row, value):
            for axis in range(3):
                E.append(row[axis, :-1])
                e.append(value[axis] - row[axis, -1])

        start, end = plan["start"], plan["end"]
        zero = [0, 0, 0]
        fix(p[0].rows[0], start["p"])
        fix(v[0].rows[0], start["v"])
        fix(a[0].rows[0], start.get("a", zero))
        fix(p[1].rows[-1], end["p"])
        fix(v[1].rows[-1], end["v"])
        fix(a[1].rows[-1], end.get("a", zero))
        for first, second in ((p[0], p[1]), (v[0], v[1]), (a[0], a[1])):
            fix(first.rows[-1] - second.rows[0], zero)
        self.E, self.e = np.array(E), np.array(e)

    def least_violation(self):
        """Least t with A x <= b + t, by scaled variables for the program's sake."""
        count = VARIABLES
        scale = np.maximum(np.linalg.norm(self.A, axis=1), 1.0)
        A = np.hstack([self.A / scale[:, None], -np.ones((len(self.A), 1))])
        E = np.hstack([self.E, np.zeros((len(self.E), 1))])
        E_scale = np.linalg.norm(self.E, axis=1)
        c = np.zeros(count + 1)
        c[-1] = 1
        # At so small a tolerance one method now and then gives up where another does not.
        for method in ("highs", "highs-ipm", "highs-ds"):
            found = linprog(c, A_ub=A, b_ub=self.b / scale, A_eq=E / E_scale[:, None],
                            b_eq=self.e / E_scale, method=method,
                            bounds=[(None, None)] * count + [(-1e-3, None)],
                            options={"primal_feasibility_tolerance": 1e-9,
                                     "dual_feasibility_tolerance": 1e-9})
            if found.success:
                return found.x[-1]
        raise RuntimeError(f"linear program: {found.message}")


def bernstein(points, u):
    """Curve of control points (n x 3) at u."""
    n = len(points) - 1
    basis = np.array([binomial(n, i) * u**i * (1 - u)**(n - i) for i in range(n + 1)])
    return basis.T @ points


def driven(platform, t):
    """R_IN and the origin of N in I at times t from 0: N turns about its own z."""
    assert not platform.w[:2].any() and not platform.alpha[:2].any()
    rate = platform.alpha[2] if platform.varying else 0.0
    change = platform.dv if platform.varying else np.zeros(3)

    def velocity(at):
        angle = platform.w[2] * at + 0.5 * rate * at**2
        v = platform.v + np.outer(at, change)
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1],
                         v[:, 2]]).T

    dt = t[1] - t[0]
    step = dt / 6 * (velocity(t[:-1]) + 4 * velocity(t[:-1] + dt / 2) + velocity(t[1:]))
    origin = np.vstack([np.zeros(3), np.cumsum(step, axis=0)])
    angle = platform.w[2] * t + 0.5 * rate * t**2
    R = np.zeros((len(t), 3, 3))
    R[:, 0, 0] = R[:, 1, 1] = np.cos(angle)
    R[:, 1, 0] = np.sin(angle)
    R[:, 0, 1] = -R[:, 1, 0]
    R[:, 2, 2] = 1
    return R, origin


def flown(plan):
    """Largest excess over speed, acceleration and tilt, sampled at 1 kHz in I."""
    T = plan["durations_s"]
    total = sum(T)
    t = np.arange(0, total, 1e-3)
    c = np.array(plan["control_points_m"])
    first = t < T[0]
    p_N = np.vstack([bernstein(c[0], t[first] / T[0]),
                     bernstein(c[1], (t[~first] - T[0]) / T[1])])
    platform = Platform(plan["platform"])
    R, origin = driven(platform, t)
    p_I = origin + np.einsum("nij,nj->ni", R, p_N)
    v = (p_I[2:] - p_I[:-2]) / 2e-3
    a = (p_I[2:] - 2 * p_I[1:-1] + p_I[:-2]) / 1e-6
    limits = plan["limits"]
    excess = {
        "speed": np.linalg.norm(v, axis=1).max() - limits["speed_m_s"],
        "acceleration": np.linalg.norm(a, axis=1).max() - limits["acceleration_m_s2"],
    }
    f = np.einsum("nji,nj->ni", R[1:-1], a) - platform.g
    if "tilt_deg" in limits:
        tilt = np.degrees(np.arctan2(np.linalg.norm(f[:, :2], axis=1), f[:, 2]))
        excess["tilt"] = math.radians(tilt.max() - limits["tilt_deg"])
    if "thrust_m_s2" in limits:
        size = np.linalg.norm(f, axis=1)
        excess["thrust"] = max(size.max() - limits["thrust_m_s2"][1],
                               limits["thrust_m_s2"][0] - size.min())
    if "body_rate_rad_s" in limits:
        f_I = a + np.array([0, 0, G]) if platform.g[2] == -G else None
        if f_I is not None:
            z = f_I / np.linalg.norm(f_I, axis=1)[:, None]
            # Across the joint the jerk may jump and differences of differences tell
            # nothing: it is left out, and every fifth sample damps their rounding.
            z = z[::5]
            at = t[1:-1][::5]
            rate = np.linalg.norm(np.diff(z, axis=0), axis=1) / 5e-3
            away = np.abs(0.5 * (at[1:] + at[:-1]) - T[0]) > 0.01
            excess["body_rate"] = rate[away].max() - limits["body_rate_rad_s"] - 2e-2
    return excess


def qp_cost_gap(plan):
    """How far the told cost lies from the optimum that the told matrices have."""
    qp = {k: np.array(v, float) for k, v in plan["qp"].items()}
    P, q, G_, h = qp["P"], qp["q"], qp["G"], qp["h"]
    n = len(q)
    A = qp["A"].reshape(-1, n)
    # The told control points are affine in x; x itself from its definition.
    T = plan["durations_s"]
    c = np.array(plan["control_points_m"])
    step = min(T)
    v = DEGREE / T[0] * (c[0][7] - c[0][6])
    a = 42 / T[0]**2 * (c[0][7] - 2 * c[0][6] + c[0][5])
    x = np.stack([c[0][3], c[0][4], c[0][7], v * step, a * step**2, c[1][3],
                  c[1][4]]).T.ravel()
    told = plan["cost"]
    scale = 1 + abs(told)
    gaps = {"cost": abs(0.5 * x @ P @ x + q @ x - told) / scale,
            "G": float((G_ @ x - h).max()),
            "A": float(np.abs(A @ x - qp["b"]).max()) if len(A) else 0.0}
    # Optimality: P x + q + G'z + A'y = 0 with z >= 0 on the rows that touch. Least
    # residual, as a linear program.
    touching = np.flatnonzero((G_ @ x - h > -1e-6) & (np.abs(G_).max(axis=1) > 0))
    push = G_[touching].T
    slope = P @ x + q
    m = len(touching)
    k = len(A)
    norm = 1 + np.abs(slope).max() + np.abs(P @ x).max()
    B = np.hstack([push, A.T, np.eye(n), -np.eye(n)])
    c_ = np.concatenate([np.zeros(m + k), np.ones(2 * n)])
    bounds = [(0, None)] * m + [(None, None)] * k + [(0, None)] * (2 * n)
    found = linprog(c_, A_eq=B / norm, b_eq=-slope / norm, bounds=bounds, method="highs")
    gaps["optimality"] = found.fun / norm if found.success else math.inf
    return gaps


def instance(rng):
    """Arguments of one random landing: many easy, many at the limit, many hopeless."""
    hard = rng.random()
    reach = 0.25 + 0.75 * hard
    p = [rng.uniform(-1.9, -0.5), rng.uniform(-0.7, 0.7) * reach, rng.uniform(0.35, 1.1)]
    if rng.random() < 0.1:  # on its way down
        p = [rng.uniform(-0.6, 0), rng.uniform(-0.1, 0.1), rng.uniform(0.08, 0.4)]
    v = rng.normal(size=3) * [1.2 * hard, 0.8 * hard, 0.5 * hard]
    arguments = {"from": p, "velocity": v}
    kind = rng.integers(4)
    if kind > 0:
        arguments["speed"] = rng.uniform(0, 3) * rng.random() ** 0.5
    if kind > 1:
        arguments["yaw_rate"] = rng.uniform(-1.2, 1.2)
    if kind > 2:
        arguments["acceleration"] = rng.uniform(-0.6, 0.6)
        arguments["yaw_acceleration"] = rng.uniform(-0.4, 0.4)
    return arguments


def command(program, rig, profile, arguments):
    def triple(x):
        return ",".join(repr(float(value)) for value in x)

    out = [program, "plan", "--rig", rig, "--profile", profile, "--json",
           f"--from={triple(arguments['from'])}",
           f"--velocity={triple(arguments['velocity'])}"]
    for name in ("speed", "yaw_rate", "acceleration", "yaw_acceleration"):
        if name in arguments:
            out.append(f"--platform-{name.replace('_', '-')}={arguments[name]!r}")
    return out


def check(plan, profile, rng, others):
    """Laws broken by one document, as sentences."""
    paper = profile == "paper"
    broken = []
    if plan["feasible"]:
        rows = Rows(plan, plan["durations_s"], paper)
        x = np.array(plan["control_points_m"]).ravel()
        excess = float((rows.A @ x - rows.b).max())
        if excess > ROW_TOLERANCE:
            broken.append(f"a row is exceeded by {excess:.3g}")
        gap = float(np.abs(rows.E @ x - rows.e).max())
        if gap > 1e-6:
            broken.append(f"start, end or continuity is off by {gap:.3g}")
        if rows.least_violation() > ROW_TOLERANCE:
            broken.append("the linear program finds no way")
        for name, gap in qp_cost_gap(plan).items():
            if gap > 3e-6:
                broken.append(f"qp: {name} is off by {gap:.3g}")
        for entry in plan["certificate"]:
            if not entry["margin"] >= -1e-6:
                broken.append(f"certificate: {entry['constraint']} {entry['margin']}")
        if not paper:
            for name, more in flown(plan).items():
                if more > 2e-3:
                    broken.append(f"flown in I it exceeds {name} by {more:.3g}")
        return broken
    samples = plan["samples"]["durations_s"]
    pairs = [plan["durations_s"]] if min(plan["durations_s"]) > 0 else []
    if not pairs:
        samples = [[0.5, 1.0, 2.0]] * 2  # Outside at once: at any durations at all.
    for _ in range(others):
        pairs.append([float(rng.choice(samples[s])) for s in range(2)])
    if len(plan["samples"].get("wide_durations_s", [[]])[0]) > 0:
        wide = plan["samples"]["wide_durations_s"]
        pairs.append([float(rng.choice(wide[s])) for s in range(2)])
    platform = Platform(plan["platform"])
    for T in pairs:
        turning = abs(platform.w[2]) + abs(platform.alpha[2]) * (sum(T) + 1)
        if turning > plan["limits"].get("heading_rate_rad_s", math.inf):
            continue  # That the heading cannot follow is no row.
        least = Rows(plan, T, paper).least_violation()
        if least <= -1e-9:
            broken.append(f"refused ({plan['reason']}), yet in {T} s there is a way "
                          f"with {-least:.3g} to spare")
            break
    return broken


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--rig", required=True)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", choices=["default", "paper", "both"], default="both")
    parser.add_argument("--others", type=int, default=3,
                        help="further samples of the durations tried per refusal")
    options = parser.parse_args()
    for wanted in (options.program, options.rig):
        if not os.path.isfile(wanted):
            sys.exit(f"check_plans: {wanted}: no such file")
    solved = refused = wrong = 0
    reasons = {}
    for k in range(options.count):
        seed = options.seed * 1000003 + k
        rng = np.random.default_rng(seed)
        arguments = instance(rng)
        profile = options.profile
        if profile == "both":
            profile = "paper" if k % 4 == 3 else "default"
        if profile == "paper":
            arguments.pop("acceleration", None)
            arguments.pop("yaw_acceleration", None)
        run = command(options.program, options.rig, profile, arguments)
        done = subprocess.run(run, capture_output=True, text=True)
        try:
            plan = json.loads(done.stdout)
            if done.returncode != (0 if plan["feasible"] else 1):
                broken = [f"exit status {done.returncode}"]
            else:
                broken = check(plan, profile, rng, options.others)
        except (ValueError, KeyError, RuntimeError) as trouble:
            plan = {"feasible": False, "reason": "none"}
            broken = [f"{type(trouble).__name__}: {trouble} {done.stderr.strip()}"]
        solved += plan["feasible"]
        refused += not plan["feasible"]
        if not plan["feasible"]:
            reasons[plan["reason"]] = reasons.get(plan["reason"], 0) + 1
        if broken:
            wrong += 1
            print(f"{' '.join(run)}\n  " + "\n  ".join(broken), file=sys.stderr, flush=True)
    told = ", ".join(f"{why}: {n}" for why, n in sorted(reasons.items(), key=lambda r: -r[1]))
    print(f"{options.count} landings: {solved} solved, {refused} refused ({told}); "
          f"{wrong} against their own document")
    return 1 if wrong or solved == 0 or refused == 0 else 0


if __name__ == "__main__":
    sys.exit(main())

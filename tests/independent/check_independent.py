#!/usr/bin/python3
"""Tests of the independent renderer and of the yardstick's arithmetic."""
import json
import subprocess
import sys
import tempfile
import types
import unittest
from pathlib import Path

try:
    import numpy as np
    import yaml
    from PIL import Image
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

HERE = Path(__file__).resolve().parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE))
import render_sequence as other  # noqa: E402
from yardstick import errors, report  # noqa: E402


def render(folder, *arguments):
    subprocess.run([HERE / "render_sequence.py", "--out", folder, "--frames", "3",
                    *map(str, arguments)], check=True)
    truth = np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1)
    rig = yaml.safe_load((folder / "rig_true.yaml").read_text())
    return truth, rig


def images_of(rig, row):
    """LED images by formulas of this file: matrices written out, nothing shared."""
    c, m = rig["camera"], rig["mount"]
    roll, pitch, yaw = np.radians(m["rpy_deg"])
    Rx = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)],
                   [0, np.sin(roll), np.cos(roll)]])
    Ry = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0],
                   [-np.sin(pitch), 0, np.cos(pitch)]])
    Rz = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0],
                   [0, 0, 1]])
    out = []
    for led in rig["leds"]:
        p = row[1:4] + errors.rotation(row[4:8]) @ led["xyz_m"]
        x, y, z = (Rz @ Ry @ Rx).T @ (p - m["xyz_m"])  # out of the lens, left, up
        out.append((c["cx"] - c["fx"] * y / x, c["cy"] - c["fy"] * z / x))
    return np.array(out)


def light_at(picture, uv, reach=3):
    """Centroid and sum of what shines about a pixel."""
    u0, v0 = np.round(uv).astype(int) - reach
    patch = picture[max(v0, 0):v0 + 2 * reach + 1, max(u0, 0):u0 + 2 * reach + 1]
    grey = patch.max(axis=2).astype(float)
    grey = np.maximum(grey - np.median(grey) - 12, 0)
    total = grey.sum()
    v, u = np.mgrid[0:grey.shape[0], 0:grey.shape[1]]
    centre = ((u * grey).sum() / total + max(u0, 0), (v * grey).sum() / total + max(v0, 0))
    return np.array(centre), total


class Pictures(unittest.TestCase):
    def test_leds_shine_where_the_truth_says(self):
        seen = 0
        for seed in (1, 2, 3):
            with tempfile.TemporaryDirectory() as name:
                truth, rig = render(Path(name), "--seed", seed, "--lights", 0)
                for k, row in enumerate(truth):
                    picture = np.asarray(Image.open(Path(name) / f"{k:05d}.png"))
                    uv = images_of(rig, row)
                    for i, at in enumerate(uv):
                        if np.sort(np.linalg.norm(uv - at, axis=1))[1] < 9:
                            continue  # the neighbour's light reaches over
                        centre, _ = light_at(picture, at)
                        self.assertLess(np.linalg.norm(centre - at), 0.35)
                        seen += 1
        self.assertGreater(seen, 10)

    def test_a_rolling_shutter_sees_leds_when_their_rows_are_exposed(self):
        along = square = 0.0
        with tempfile.TemporaryDirectory() as name:
            truth, rig = render(Path(name), "--seed", 1, "--lights", 0, "--frames", 90,
                                "--rig", HERE / "rolling.yaml")
            c = rig["camera"]
            for k in range(1, 89, 4):
                before, at_once, after = (images_of(rig, row) for row in truth[k - 1:k + 2])
                picture = np.asarray(Image.open(Path(name) / f"{k:05d}.png"))
                uv = at_once.copy()
                for _ in range(5):  # between pictures images move evenly
                    share = (1e-3 * c["readout_ms"] * c["rate_hz"] *
                             (uv[:, 1] / (c["height"] - 1) - 0.5))[:, None]
                    there = np.where(share > 0, after, before)
                    uv = at_once + np.abs(share) * (there - at_once)
                for i, at in enumerate(uv):
                    if np.sort(np.linalg.norm(uv - at, axis=1))[1] < 9:
                        continue
                    centre, _ = light_at(picture, at)
                    self.assertLess(np.linalg.norm(centre - at), 0.35)
                    along += (centre - at_once[i]) @ (at - at_once[i])
                    square += np.sum((at - at_once[i])**2)
        self.assertGreater(square, 5)  # else they hardly moved
        self.assertAlmostEqual(along / square, 1, delta=0.1)

    def test_dead_leds_and_a_blackout_are_dark(self):
        with tempfile.TemporaryDirectory() as name:
            truth, rig = render(Path(name), "--seed", 4, "--lights", 0,
                                "--dead", "0,1,2,3,4,5")
            picture = np.asarray(Image.open(Path(name) / "00000.png"))
            self.assertLess(picture.max(), 60)
        with tempfile.TemporaryDirectory() as name:
            render(Path(name), "--seed", 4, "--lights", 0, "--blackout", "0.01,0.02")
            top = [np.asarray(Image.open(Path(name) / f"{k:05d}.png")).max()
                   for k in range(3)]
            self.assertLess(top[1], 60)
            self.assertGreater(min(top[0], top[2]), 100)

    def test_gamma_stores_a_power_of_the_same_light(self):
        pictures = {}
        for gamma in (1, 2.2):
            with tempfile.TemporaryDirectory() as name:
                render(Path(name), "--seed", 6, "--frames", 1, "--gamma", gamma)
                pictures[gamma] = np.asarray(Image.open(Path(name) / "00000.png"), float)
        light, stored = pictures[1], pictures[2.2]
        # Each was rounded, or cut, once.
        least = 255 * (np.maximum(light - 0.5, 0) / 255)**(1 / 2.2) - 1
        most = 255 * (np.minimum(light + 0.5, 255) / 255)**(1 / 2.2) + 1
        self.assertTrue(((stored >= least) & (stored <= most))[light < 255].all())
        self.assertGreater(stored.mean(), light.mean() + 5)

    def test_the_same_seed_gives_the_same_files_and_kinds_share_the_path(self):
        with tempfile.TemporaryDirectory() as a, tempfile.TemporaryDirectory() as b, \
                tempfile.TemporaryDirectory() as c:
            render(Path(a), "--seed", 5)
            render(Path(b), "--seed", 5)
            render(Path(c), "--seed", 5, "--kind", "hard")
            for name in ("truth.csv", "00001.png"):
                self.assertEqual((Path(a) / name).read_bytes(), (Path(b) / name).read_bytes())
            self.assertEqual((Path(a) / "truth.csv").read_text(),
                             (Path(c) / "truth.csv").read_text())

    def test_flights_keep_what_they_promise(self):
        rig = yaml.safe_load((HERE.parents[1] / "config/rigs/alan.yaml").read_text())
        lens = other.Lens(rig)
        leds = np.array([led["xyz_m"] for led in rig["leds"]])
        for seed in range(3):
            flight, share = other.draw_flight(np.random.default_rng(seed), lens, leds, 10)
            t = np.arange(0, 10, 0.05)
            p, v, R = flight.at(t)
            h = 1e-5
            slope = (flight.at(t + h)[0] - flight.at(t - h)[0]) / (2 * h)
            np.testing.assert_allclose(v, slope, atol=1e-6)
            np.testing.assert_allclose(np.einsum("nij,nik->njk", R, R),
                                       np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
            self.assertGreater(share, 1 / 3)
            self.assertLessEqual(np.linalg.norm(v, axis=1).max(), 1.8)


class Arithmetic(unittest.TestCase):
    def test_rotation_vector_inverts_rotation(self):
        rng = np.random.default_rng(1)
        for angle in (1e-9, 1e-4, 0.3, 2.0, 3.1):
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            q = np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))
            np.testing.assert_allclose(errors.rotation_vector(errors.rotation(q)),
                                       angle * axis, atol=1e-8)
            np.testing.assert_allclose(np.abs(other.quaternion(errors.rotation(q)) @ q), 1)

    def test_chi_square_bounds_hold_95_percent(self):
        rng = np.random.default_rng(2)
        for dof in (6, 9, 1200):
            x = rng.chisquare(dof, 20000)
            share = np.mean((x > errors.chi2_quantile(dof, -1.96)) &
                            (x < errors.chi2_quantile(dof, 1.96)))
            self.assertAlmostEqual(share, 0.95, delta=0.01)

    def rows(self, scale):
        """As of `alight measure --rows`: 100 flights of 40 frames with a covariance that
        is too small by `scale`."""
        rng = np.random.default_rng(3)
        frames = np.tile(np.arange(40), 100)
        table = np.column_stack([
            np.repeat(np.arange(100), 40), frames, np.full(4000, 1.2), np.full(4000, 0.7),
            np.ones(4000), frames == 0, np.full(4000, 0.01), np.full(4000, 0.1),
            np.full(4000, 0.02), scale * rng.chisquare(6, 4000),
            scale * rng.chisquare(9, 4000), np.full(4000, 12.0), np.full(4000, 6.0),
            np.full(4000, 20.0)])
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as out:
            out.write("seed,frame,range_m,speed_m_s,tracked,found,position_m,rotation_deg,"
                      "velocity_m_s,nees_pose,nees_state,nis_sum,observations,cpu_us\n")
            np.savetxt(out, table, delimiter=",")
            out.flush()
            return errors.Rows(out.name)

    def test_a_true_covariance_is_inside_and_a_wrong_one_is_not(self):
        for row in self.rows(1.0).nees_table():
            for dof in ("pose", "state"):
                if row[dof]["instants"]:
                    self.assertGreater(row[dof]["inside"], 0.8)
        for scale in (0.7, 1.4):
            self.assertLess(self.rows(scale).nees_table()[0]["pose"]["inside"], 0.2)

    def test_a_wrong_pose_is_sure_unless_its_covariance_allows_it(self):
        of = {"tracked": np.array([True, True, True, False]),
              "wrong": np.array([True, True, False, False]),
              "nees6": np.array([10.0, 40.0, 5.0, np.nan]),
              "nees9": np.full(4, 9.0), "position": np.array([0.3, 0.3, 0.01, np.nan]),
              "angle": np.array([1, 1, 1, np.nan]), "velocity": np.full(4, 0.1),
              "settled": np.ones(4, bool), "us": np.full(4, 20.0)}
        figures = errors.figures(of)
        self.assertEqual(figures["wrong"], 2)
        self.assertEqual(figures["surely_wrong"], 1)
        self.assertEqual(figures["returned"], 0.75)
        self.assertEqual(figures["correct"], 0.25)

    def test_gaps_count_frames_without_a_pose(self):
        tracked = np.array([False, False, True, True, False, True])
        self.assertEqual(errors.Errors.gaps(types.SimpleNamespace(tracked=tracked)),
                         [(0, 2), (4, 1)])

    def test_marks_are_replaced_and_the_rest_stays(self):
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "x.md"
            path.write_text("# Title\n\nBefore.\n")
            report.put_between_marks(path, "Measured", "one\n")
            report.put_between_marks(path, "Measured", "two\n")
            self.assertEqual(path.read_text().count("<!-- yardstick -->"), 1)
            self.assertIn("Before.", path.read_text())
            self.assertIn("two", path.read_text())
            self.assertNotIn("one", path.read_text())


if __name__ == "__main__":
    unittest.main()

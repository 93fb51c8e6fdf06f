#!/usr/bin/python3
"""Renders a flight of a drone with LEDs before a camera, with its truth, as
`alight render` does, but shares nothing with Alight: what both programs agree on is not
an error that one program makes twice.

  render_sequence.py --out DIR [--kind clean|hard] [--rig F] [--seed N] ...

Leaves frames.csv and pictures (a SOURCE of `alight track`), truth.tum and truth.csv
(t,x,y,z,qx,qy,qz,qw,vx,vy,vz of the drone in the pad's frame, at mid-exposure of the
middle row), rig.yaml (as written down), rig_true.yaml (as it is) and sequence.json. Needs numpy, Pillow and
PyYAML (Debian: python3-numpy python3-pil python3-yaml).

Frames: N has its origin at the centre of the pad, x forward, y left, z up; the camera
looks along z with x right and y down; pixel centres lie at whole numbers. Every seed
also draws the look of the pictures: optics, gain, tone curve, colour balance, room.
"""
import argparse
import copy
import json
import math
import sys
from pathlib import Path

import numpy as np
import yaml
from PIL import Image, ImageDraw

ROOT = Path(__file__).resolve().parents[2]
GRAVITY = np.array([0.0, 0.0, 9.81])
TOP_SPEED = 1.8  # m/s
NEAREST, FARTHEST = 0.5, 3.0  # m from the lens
CLOSE_PX, CLOSE_SHARE = 4.0, 1 / 3


def stop(message):
    print(f"render_sequence: {message}", file=sys.stderr)
    sys.exit(1)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def rotation_rpy(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


def quaternion(R):
    """x, y, z, w of a rotation matrix, w not negative."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
                  [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
                  [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
                  [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)]])
    _, vectors = np.linalg.eigh(K, UPLO="L")
    q = vectors[:, -1]
    return q if q[3] >= 0 else -q


class Lens:
    """Pinhole with radial-tangential distortion, and its place on the platform."""

    def __init__(self, rig):
        c = rig["camera"]
        self.width, self.height = int(c["width"]), int(c["height"])
        self.f = np.array([c["fx"], c["fy"]], float)
        self.c = np.array([c["cx"], c["cy"]], float)
        self.k = [float(x) for x in c.get("distortion", [0] * 5)]
        mount = rig["mount"]
        housing = rotation_rpy(*np.radians(mount["rpy_deg"]))
        self.place = np.array(mount["xyz_m"], float)
        # Which way the LEDs of a drone face that lands with its axes along the pad's.
        level = self.place * [1, 1, 0]
        self.faced_B = (unit(level) if np.linalg.norm(level) > 0.05 else
                        np.array([1.0, 0.0, 0.0]))
        # Columns: optical x (right), y (down), z (out) in N.
        self.axes = np.stack([-housing[:, 1], -housing[:, 2], housing[:, 0]], axis=1)

    def see(self, points):
        """Pixels and distance along the optical axis of points in N."""
        q = (points - self.place) @ self.axes
        depth = q[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = q[..., 0] / depth, q[..., 1] / depth
        k1, k2, p1, p2, k3 = self.k
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return np.stack([xd, yd], axis=-1) * self.f + self.c, depth

    def ray(self, u, v):
        """Direction in N through a pixel, distortion neglected: to place things."""
        d = np.array([(u - self.c[0]) / self.f[0], (v - self.c[1]) / self.f[1], 1.0])
        return self.axes @ d

    def inside(self, uv, border):
        return ((uv[..., 0] >= border) & (uv[..., 0] <= self.width - 1 - border) &
                (uv[..., 1] >= border) & (uv[..., 1] <= self.height - 1 - border))


class Flight:
    """A quintic spline through random places, flown by a quadrotor with some drag."""

    def __init__(self, rng, lens, seconds, pace, limits):
        self.pace = pace  # spans a second
        count = int(math.ceil(seconds * pace)) + 8
        self.nodes = np.array([self.node(rng, lens, k, limits) for k in range(count)])
        self.lens = lens
        self.drag = rng.uniform(0.1, 0.4)
        self.sway = math.radians(rng.uniform(30, 40))
        self.sway_rate = 2 * math.pi * rng.uniform(0.1, 0.25)
        self.sway_phase = rng.uniform(0, 2 * math.pi)

    @staticmethod
    def node(rng, lens, k, limits):
        near, far = limits
        # Splines cut corners: the nodes reach beyond the range wanted of the path.
        distance = (near, far, rng.uniform(near, far), rng.uniform(0.6 * far, far))[
            int(rng.integers(4))]
        margin = 45 + 45 / distance
        u = rng.uniform(margin, lens.width - margin)
        v = rng.uniform(margin, lens.height - margin)
        return lens.place + distance * unit(lens.ray(u, v))

    def spline(self, t, order):
        """Derivative of the given order by time, at times t."""
        s = np.asarray(t, float) * self.pace
        i = np.floor(s).astype(int)
        x = s - i
        out = 0
        for j, weight in enumerate(QUINTIC):
            w = weight.deriv(order)(x) if order else weight(x)
            out = out + w[..., None] * self.nodes[i + j]
        return out * self.pace**order

    def at(self, t):
        """Position, velocity, rotation (columns are the drone's axes) at times t."""
        p, v, a = (self.spline(t, order) for order in range(3))
        z = unit(a + GRAVITY + self.drag * v)
        to_lens = self.lens.place - p
        yaw = (np.arctan2(to_lens[..., 1], to_lens[..., 0]) -
               math.atan2(self.lens.faced_B[1], self.lens.faced_B[0]) +
               self.sway * np.sin(self.sway_rate * np.asarray(t) + self.sway_phase))
        front = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
        y = unit(np.cross(z, front))
        return p, v, np.stack([np.cross(y, z), y, z], axis=-1)


def quintic_weights():
    """The six pieces of the uniform quintic B-spline, first for the oldest node."""
    pieces = []
    for j in range(6):
        total = np.poly1d([0.0])
        shift = 5 - j
        for k in range(shift + 1):
            total += ((-1)**k * math.comb(6, k) / 120.0) * np.poly1d([1, shift - k])**5
        pieces.append(total)
    return pieces


QUINTIC = quintic_weights()


def closest_pair(uv):
    """Smallest distance of two images, for each instant."""
    best = np.full(uv.shape[0], np.inf)
    for i in range(uv.shape[1]):
        for j in range(i):
            best = np.minimum(best, np.linalg.norm(uv[:, i] - uv[:, j], axis=1))
    return best


def judge(flight, lens, leds, seconds):
    """Why a flight does not do, or its share of close pairs."""
    t = np.arange(0, seconds, 1 / 60)
    p, v, R = flight.at(t)
    distance = np.linalg.norm(p - lens.place, axis=1)
    if distance.min() < NEAREST or distance.max() > FARTHEST:
        return None
    if distance.min() > NEAREST + 0.35 or distance.max() < FARTHEST - 0.45:
        return None
    if R[:, 2, 2].min() < math.cos(math.radians(30)):
        return None
    turn = np.einsum("nij,nij->n", R[1:], R[:-1])
    if np.arccos(np.clip((turn - 1) / 2, -1, 1)).max() * 60 > 4:
        return None
    world = p[:, None] + np.einsum("nij,lj->nli", R, leds)
    uv, depth = lens.see(world)
    if depth.min() < 0.1 or world[..., 2].min() < 0.02 or not lens.inside(uv, 8).all():
        return None
    to_lens = unit(lens.place - world)
    if np.einsum("nli,nij,j->nl", to_lens, R, lens.faced_B).min() < 0.3:
        return None
    return float((closest_pair(uv) < CLOSE_PX).mean())


def draw_flight(rng, lens, leds, seconds):
    """One that holds all of the issue's conditions, if the rig allows all of them."""
    best, best_share = None, -1.0
    for attempt in range(6000):
        pace = rng.uniform(0.7, 1.1)
        flight = Flight(rng, lens, seconds, pace, (0.35, 3.4))
        speed = np.linalg.norm(flight.spline(np.arange(0, seconds, 1 / 60), 1), axis=1).max()
        wanted = TOP_SPEED * rng.uniform(0.88, 1.0)
        flight.pace *= wanted / speed
        if flight.pace > pace:
            continue  # it would run out of nodes
        speed = np.linalg.norm(flight.spline(np.arange(0, seconds, 1 / 60), 1), axis=1).max()
        if not 0.8 * TOP_SPEED <= speed <= TOP_SPEED:
            continue
        share = judge(flight, lens, leds, seconds)
        if share is None:
            continue
        if share > best_share:
            best, best_share = flight, share
        if best_share > CLOSE_SHARE or attempt > 3000:
            break
    if best is None:
        stop("the rig's camera has no room for such a flight")
    return best, best_share


class Look:
    """Optics and sensor, drawn by the seed."""

    def __init__(self, rng, kind, grey, sites=None, yuv=False, gamma=None):
        self.grey, self.sites, self.yuv = grey, sites, yuv
        self.width_px = rng.choice([0.75, 0.95, 1.25]) * rng.uniform(0.9, 1.1)  # Moffat
        self.beta = float(rng.choice([2.5, 3.0, 4.0]))
        self.halo = rng.uniform(0.003, 0.02)
        self.halo_px = rng.uniform(2.0, 4.0)
        self.peak = math.exp(rng.uniform(math.log(1000), math.log(3000)))  # at 1 m
        self.ceiling = math.exp(rng.uniform(math.log(1200), math.log(4000)))
        self.falloff = rng.uniform(0.8, 1.4)  # power of the cosine off the LED's axis
        self.disc_m = rng.uniform(0.003, 0.005)
        self.dark = rng.uniform(0.0, 3.0)
        self.read_noise = rng.uniform(0.6, 1.6)
        self.electrons = rng.uniform(7, 15)  # a count
        self.tone = str(rng.choice(["clip", "shoulder", "gamma"], p=[0.5, 0.3, 0.2]))
        self.power = 0.7
        if gamma:
            self.tone, self.power = "gamma", 1 / gamma
        self.gradient = rng.uniform(0, 5, 3)
        self.gradient_turn = rng.uniform(0, 2 * math.pi)
        self.pad_shine = rng.choice([0.0, rng.uniform(0.02, 0.12)])
        self.balance = rng.uniform(0.85, 1.1, 3)
        leak = rng.uniform(0.85, 1.2)
        self.colors = {"red": leak * np.array([0.27, 0.30, 0]) + [0, 0, 1],
                       "green": leak * np.array([0.62, 0, 0.38]) + [0, 1, 0],
                       "blue": leak * np.array([0, 0.42, 0.2]) + [1, 0, 0],
                       "white": np.ones(3), "none": np.array([0.9, 0.85, 1.0])}
        if grey:
            self.balance = np.ones(3)
            self.colors = {name: np.ones(3) for name in self.colors}
        if kind == "hard":
            self.electrons /= 25  # five times the shot noise

    def spread(self, d2):
        """Light on a unit area at squared distance d2 from a point of unit light."""
        a2 = (1.7 * self.width_px)**2
        core = (self.beta - 1) / (math.pi * a2) * (1 + d2 / a2)**(-self.beta)
        h = self.halo_px
        wide = np.exp(-np.sqrt(d2) / h) / (2 * math.pi * h * h)
        share = self.halo * h * h / self.width_px**2
        return core + share * wide

    def top(self):
        return float(self.spread(np.zeros(1))[0])

    def develop(self, light, rng):
        """Expected counts to a picture: shot and read noise, tone curve, 8 bits."""
        counts = mosaic(light, self.sites) if self.sites else light
        bright = counts > 0.5
        noisy = counts.copy()
        lit = np.minimum(counts[bright], 6000)
        noisy[bright] = rng.poisson(lit * self.electrons) / self.electrons
        noisy += self.dark
        noisy += self.read_noise * rng.standard_normal(noisy.shape, dtype=np.float32)
        if self.tone == "shoulder":
            knee = 190.0
            over = np.maximum(noisy - knee, 0)
            noisy = np.minimum(noisy, knee) + (255 - knee) * (1 - np.exp(-over / 120))
        elif self.tone == "gamma":
            noisy = 255 * (np.clip(noisy, 0, 255) / 255)**self.power
        if self.grey:
            noisy[..., 1] = noisy[..., 0]
            noisy[..., 2] = noisy[..., 0]
        if self.sites:
            noisy = demosaic(np.clip(noisy, 0, 255), self.sites)
        if self.yuv:
            noisy = half_chroma(noisy)
        return np.clip(noisy + 0.5, 0, 255).astype(np.uint8)


def sites_of(pattern):
    """Channel (of blue, green, red), row and column of the first four photosites."""
    if pattern == "none":
        return None
    if pattern not in ("rggb", "bggr", "grbg", "gbrg"):
        stop(f"camera.mosaic: {pattern} is no pattern")
    return [("bgr".index(c), k // 2, k % 2) for k, c in enumerate(pattern)]


def mosaic(light, sites):
    """What the photosites see: each one colour."""
    raw = np.empty(light.shape[:2], np.float32)
    for channel, row, column in sites:
        raw[row::2, column::2] = light[row::2, column::2, channel]
    return raw


def convolved(raw, kernel):
    padded = np.pad(raw, 2, mode="reflect")
    height, width = raw.shape
    return sum(k * padded[i:i + height, j:j + width] for i, row in enumerate(kernel)
               for j, k in enumerate(row) if k != 0)


def demosaic(raw, sites):
    """Linear interpolation with gradients (Malvar, He and Cutler 2004)."""
    cross = convolved(raw, np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1],
                                     [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8)
    row_wise = np.array([[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1],
                         [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]) / 8
    along_row, along_column = convolved(raw, row_wise), convolved(raw, row_wise.T)
    diagonal = convolved(raw, np.array([[0, 0, -1.5, 0, 0], [0, 2, 0, 2, 0],
                                        [-1.5, 0, 6, 0, -1.5], [0, 2, 0, 2, 0],
                                        [0, 0, -1.5, 0, 0]]) / 8)
    bgr = np.repeat(raw[..., None], 3, axis=2)
    for channel, row, column in sites:
        at = (slice(row, None, 2), slice(column, None, 2))
        if channel == 1:
            beside = next(c for c, r, _ in sites if r == row and c != 1)
            bgr[(*at, beside)] = along_row[at]
            bgr[(*at, 2 - beside)] = along_column[at]
        else:
            bgr[(*at, 1)] = cross[at]
            bgr[(*at, 2 - channel)] = diagonal[at]
    return np.clip(bgr, 0, 255)


def half_chroma(bgr):
    """As sent by webcams (YUV 4:2:2): two pixels of a row share their colour."""
    y = bgr @ np.array([0.114, 0.587, 0.299], np.float32)
    colour = bgr - y[..., None]
    pairs = np.rint(colour.reshape(bgr.shape[0], -1, 2, 3).mean(axis=2))
    return np.rint(y)[..., None] + np.repeat(pairs, 2, axis=1)


SUB = 3  # samples along each side of a pixel
OFFSETS = (np.arange(SUB) + 0.5) / SUB - 0.5


def add_spot(picture, look, path, radius_px, flux, bgr):
    """Light `flux` of a disc of `radius_px` that moves along `path` (n x 2, px)."""
    if flux <= 0:
        return
    reach = 7 + 2.5 * look.halo_px * min(1.0, flux * look.top() / 800) + radius_px
    low = np.floor(path.min(axis=0) - reach).astype(int)
    high = np.ceil(path.max(axis=0) + reach).astype(int) + 1
    u0, v0 = max(low[0], 0), max(low[1], 0)
    u1, v1 = min(high[0], picture.shape[1]), min(high[1], picture.shape[0])
    if u1 <= u0 or v1 <= v0:
        return
    points = path
    if radius_px > 0.15:
        ring = np.arange(6) * math.pi / 3
        # Centre and a ring with the variance of a disc.
        offsets = np.concatenate([[[0, 0]], np.sqrt(7 / 12) * radius_px *
                                  np.stack([np.cos(ring), np.sin(ring)], axis=1)])
        points = (path[:, None] + offsets[None]).reshape(-1, 2)
    us = (np.arange(u0, u1)[:, None] + OFFSETS).ravel().astype(np.float32)
    vs = (np.arange(v0, v1)[:, None] + OFFSETS).ravel().astype(np.float32)
    total = np.zeros((vs.size, us.size), np.float32)
    for u, v in points:
        d2 = (vs[:, None] - np.float32(v))**2 + (us[None] - np.float32(u))**2
        total += look.spread(d2).astype(np.float32)
    total *= np.float32(flux / len(points))
    total = total.reshape(v1 - v0, SUB, u1 - u0, SUB).mean(axis=(1, 3))
    picture[v0:v1, u0:u1] += total[..., None] * bgr.astype(np.float32)


class Room:
    """Ceiling lights of several kinds, and lamps that could be taken for LEDs."""

    def __init__(self, rng, lens, look, lights, strays):
        self.look = look
        self.shapes = []  # corners in the inertial frame, light per pixel, colour
        height = rng.uniform(2.3, 3.8)
        turn = rng.uniform(0, math.pi)
        along = np.array([math.cos(turn), math.sin(turn), 0])
        across = np.array([-along[1], along[0], 0])
        while len(self.shapes) < lights:
            place = np.append(self.somewhere(rng, lens, height), height)
            tint = np.clip(np.array([1.0, 0.97, 0.95]) + rng.uniform(-0.1, 0.1, 3), 0, 1)
            bright = math.exp(rng.uniform(math.log(120), math.log(3000)))
            kind = rng.choice(["tube", "panel", "disc", "louvre"], p=[0.2, 0.1, 0.3, 0.4])
            if kind == "disc":
                r = rng.uniform(0.02, 0.12)
                angle = np.arange(16) * math.pi / 8
                self.add(place + r * (np.cos(angle)[:, None] * along +
                                      np.sin(angle)[:, None] * across), bright, tint)
            elif kind == "louvre":
                # Tubes behind slats: two rows of short dashes.
                for row in (-0.12, 0.12):
                    for k in range(int(rng.integers(4, 10))):
                        if len(self.shapes) < lights:
                            self.rectangle(place + row * across + 0.11 * k * along, along,
                                           across, (0.07, 0.025),
                                           bright * rng.uniform(0.6, 1.2), tint)
            else:
                size = ((rng.uniform(0.6, 1.5), 0.04) if kind == "tube" else
                        (rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.6)))
                self.rectangle(place, along, across, size, bright, tint)
        self.lamps = []
        for _ in range(strays):
            u = rng.uniform(10, lens.width - 10)
            v = rng.uniform(10, lens.height - 10)
            place = lens.place + rng.uniform(3, 9) * lens.ray(u, v)
            color = str(rng.choice(["white", "white", "none", "red", "green", "blue"]))
            peak = math.exp(rng.uniform(math.log(60), math.log(2000)))
            self.lamps.append((place, peak / look.top(), look.colors[color]))

    @staticmethod
    def somewhere(rng, lens, height):
        """Most of them where the camera looks."""
        if rng.uniform() < 0.6:
            for _ in range(50):
                d = lens.ray(rng.uniform(0, lens.width), rng.uniform(0, lens.height))
                if d[2] > 0.15:
                    reach = (height - lens.place[2]) / d[2]
                    if 1.5 < reach < 14:
                        return (lens.place + reach * d)[:2]
        return rng.uniform(-9, 9, 2)

    def rectangle(self, place, along, across, size, bright, tint):
        a, b = size[0] / 2 * along, size[1] / 2 * across
        self.add(place + np.array([-a - b, a - b, a + b, -a + b]), bright, tint)

    def add(self, corners, bright, tint):
        self.shapes.append((corners, bright, tint))

    def shine(self, picture, lens, shift):
        """`shift`: where the platform is in the inertial frame."""
        for corners, bright, tint in self.shapes:
            uv, depth = lens.see(corners - shift)
            if depth.min() < 0.3:
                continue
            self.polygon(picture, uv, bright, tint * self.look.balance)
        for place, flux, color in self.lamps:
            uv, depth = lens.see((place - shift)[None])
            if depth[0] > 0.3 and lens.inside(uv, -15)[0]:
                add_spot(picture, self.look, uv, 0.0, flux, color * self.look.balance)

    def polygon(self, picture, uv, bright, bgr):
        height, width = picture.shape[:2]
        reach = 8
        u0, v0 = np.maximum(np.floor(uv.min(axis=0)) - reach, 0).astype(int)
        u1 = min(int(math.ceil(uv[:, 0].max())) + reach + 1, width)
        v1 = min(int(math.ceil(uv[:, 1].max())) + reach + 1, height)
        if u1 <= u0 or v1 <= v0:
            return
        fine = 4
        mask = Image.new("L", ((u1 - u0) * fine, (v1 - v0) * fine))
        corners = [(float((u - u0 + 0.5) * fine - 0.5), float((v - v0 + 0.5) * fine - 0.5))
                   for u, v in uv]
        ImageDraw.Draw(mask).polygon(corners, fill=255)
        cover = np.asarray(mask, np.float32).reshape(v1 - v0, fine, u1 - u0, fine)
        cover = cover.mean(axis=(1, 3)) / 255
        # A light smaller than the grid still shines.
        area = 0.5 * abs(np.dot(uv[:, 0], np.roll(uv[:, 1], 1)) -
                         np.dot(uv[:, 1], np.roll(uv[:, 0], 1)))
        if cover.sum() > 0 and uv.min() > 0:
            cover *= np.float32(min(1.0, area / cover.sum()))
        x = np.arange(-5, 6)
        kernel = np.exp(-0.5 * (x / (1.1 * self.look.width_px))**2)
        kernel = (kernel / kernel.sum()).astype(np.float32)
        padded = np.pad(cover, 5)
        rows = sum(k * padded[:, i:i + cover.shape[1]] for i, k in enumerate(kernel))
        blurred = sum(k * rows[i:i + cover.shape[0]] for i, k in enumerate(kernel))
        picture[v0:v1, u0:u1] += (bright * blurred)[..., None] * bgr.astype(np.float32)


def background(look, lens):
    v, u = np.mgrid[0:lens.height, 0:lens.width].astype(np.float32)
    slope = (math.cos(look.gradient_turn) * (u / lens.width - 0.5) +
             math.sin(look.gradient_turn) * (v / lens.height - 0.5))
    return np.maximum(slope + 0.2, 0)[..., None] * look.gradient.astype(np.float32)


def hidden_by_pad(lens, points, pad):
    """Whether the pad's box lies between the lens and points above it; a camera beside
    the pad and above its plane sees over it."""
    return points[..., 2] < 0


def row_delay(v, lens, readout):
    """Rows are exposed one after the other, the middle one when the picture is dated."""
    return readout * (v - 0.5 * (lens.height - 1)) / (lens.height - 1)


def when_seen(t, flight, lens, led, readout):
    """Middle of the exposure of the row that the LED's image falls on."""
    delay = 0.0
    for _ in range(4 if readout > 0 else 0):
        p, _, R = (x[0] for x in flight.at(np.array([t + delay])))
        uv, depth = lens.see((p + R @ led)[None])
        if depth[0] < 0.05:
            break
        delay = row_delay(np.clip(uv[0, 1], 0, lens.height - 1), lens, readout)
    return t + delay


def led_spots(t, flight, lens, leds, gains, look, rig, exposure, readout):
    """Path, radius, light and LED of every image of an LED, mirrored ones too."""
    steps = np.linspace(-0.5, 0.5, 9) * exposure
    p, _, R = flight.at(t + steps)
    middle = len(steps) // 2
    half = 0.5 * rig.get("pad", {}).get("size_m", 0.43)
    for i, led in enumerate(leds):
        if gains[i] <= 0:
            continue
        if readout > 0:  # a mirrored image is taken to be seen with the LED itself
            p, _, R = flight.at(when_seen(t, flight, lens, led, readout) + steps)
        world = p + R @ led
        for mirrored in (False, True):
            eye = lens.place.copy()
            share = 1.0
            if mirrored:
                if look.pad_shine == 0:
                    break
                eye[2] = -eye[2]
                z = world[middle, 2]
                hit = eye + (world[middle] - eye) * (lens.place[2] / (lens.place[2] + z))
                if max(abs(hit[0]), abs(hit[1])) > half:
                    continue
                share = look.pad_shine
            ray = eye - world[middle]
            distance = np.linalg.norm(ray)
            cosine = float(ray @ R[middle] @ lens.faced_B) / distance
            if cosine <= 0:
                continue
            image = world * [1, 1, -1] if mirrored else world
            uv, depth = lens.see(image)
            if depth.min() < 0.05 or not lens.inside(uv, -20).any():
                continue
            peak = min(look.peak / distance**2, look.ceiling)
            strength = share * gains[i] * peak * cosine**look.falloff
            # The same light in fewer samples when it hardly moves.
            moved = np.linalg.norm(uv[-1] - uv[0])
            path = uv if moved > 1.5 else uv[2:7:2] if moved < 0.5 else uv[::2]
            path = path if len(path) > 3 else uv[[1, 4, 7]]
            radius = 0.5 * look.disc_m * float(lens.f.mean()) / depth[middle]
            yield i, path, radius, strength / look.top()


def load_rig(path):
    try:
        rig = yaml.safe_load(Path(path).read_text())
        Lens(rig)
        [led["xyz_m"] for led in rig["leds"]]
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as wrong:
        stop(f"{path}: not a rig file that this program can read: {wrong!r}")
    return rig


def numbers(kind, count=None):
    def parse(text):
        values = [kind(x) for x in text.split(",") if x != ""]
        if count is not None and len(values) != count:
            raise argparse.ArgumentTypeError(f"needs {count} numbers, has {len(values)}")
        return values
    return parse


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", choices=("clean", "hard"), default="clean")
    parser.add_argument("--rig", type=Path, default=ROOT / "config/rigs/alan.yaml")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--lights", type=int, default=40, help="of the ceiling")
    parser.add_argument("--stray", type=int, default=0, help="single lamps in view")
    parser.add_argument("--dead", type=numbers(int), default=[], help="LEDs: i,j,..")
    parser.add_argument("--blackout", type=numbers(float, 2), default=[0, 0],
                        help="no LED shines from t0 to t1: t0,t1")
    parser.add_argument("--led-error-mm", type=float, default=0)
    parser.add_argument("--grey", action="store_true",
                        help="a camera without colours, as for infrared")
    parser.add_argument("--gamma", type=float,
                        help="light is stored by the power 1 / GAMMA; else by what the "
                        "seed draws")
    parser.add_argument("--yuv422", action="store_true",
                        help="two pixels of a row share their colour, as from webcams")
    return parser.parse_args()


def main():
    o = parse_arguments()
    rig = load_rig(o.rig)
    count = len(rig["leds"])
    if any(not 0 <= i < count for i in o.dead):
        stop(f"--dead: the rig's LEDs are 0 to {count - 1}")
    # Streams of their own: LED errors change no noise, kind changes no path.
    rng = {name: np.random.default_rng([o.seed, k]) for k, name in
           enumerate(("path", "look", "room", "leds", "noise", "drive"))}
    true = copy.deepcopy(rig)
    for led in true["leds"]:
        moved = np.array(led["xyz_m"], float) + rng["leds"].normal(0, 1e-3 * o.led_error_mm, 3)
        led["xyz_m"] = [float(x) for x in moved]
    leds = np.array([led["xyz_m"] for led in true["leds"]], float)
    lens = Lens(true)
    sites = sites_of(rig["camera"].get("mosaic", "none"))
    if o.grey and sites:
        stop("--grey: a camera without colours has no mosaic")
    if o.gamma is not None and not 0.4 <= o.gamma <= 3:
        stop(f"--gamma: {o.gamma:g} must lie in [0.4, 3]")
    if o.yuv422 and lens.width % 2:
        stop(f"--yuv422: needs an even width, the rig's camera has {lens.width}")
    rate = float(rig["camera"].get("rate_hz", 60))
    exposure = 1e-3 * float(rig["camera"].get("exposure_ms", 2))
    readout = 1e-3 * float(rig["camera"].get("readout_ms", 0))
    if not 0 <= readout <= 1 / rate:
        stop(f"{o.rig}: camera.readout_ms is {1e3 * readout:g}, must lie in [0, {1e3 / rate:g}]")
    seconds = o.frames / rate
    flight, close = draw_flight(rng["path"], lens, leds, max(seconds, 10.0))

    look = Look(rng["look"], o.kind, o.grey, sites, o.yuv422, o.gamma)
    gains = np.exp(rng["leds"].normal(0, 0.12, count))
    if o.kind == "hard":
        gains = 3.0**(rng["leds"].permutation(count) / max(count - 1, 1) - 0.5)
    gains[o.dead] = 0
    room = Room(rng["room"], lens, look, o.lights, o.stray)
    heading = rng["drive"].uniform(0, 2 * math.pi)
    drive = rng["drive"].uniform(0, 0.6) * np.array([math.cos(heading), math.sin(heading), 0])
    base = background(look, lens)
    colors = [look.colors[led.get("color", "none")] * look.balance for led in rig["leds"]]

    o.out.mkdir(parents=True, exist_ok=True)
    start = 5.0
    lists = {"frames.csv": ["t,file"], "truth.tum": [],
             "truth.csv": ["t,x,y,z,qx,qy,qz,qw,vx,vy,vz"]}
    span = []
    for k in range(o.frames):
        t = k / rate
        picture = base.copy()
        room.shine(picture, lens, drive * t)
        if not o.blackout[0] <= t < o.blackout[1]:
            for i, path, radius, flux in led_spots(t, flight, lens, leds, gains, look, rig,
                                                   exposure, readout):
                add_spot(picture, look, path, radius, flux, colors[i])
        bgr = look.develop(picture, rng["noise"])
        image = Image.fromarray(np.ascontiguousarray(bgr[..., ::-1]))
        if o.grey:
            image = image.convert("L")
        name = f"{k:05d}.jpg" if o.kind == "hard" else f"{k:05d}.png"
        if o.kind == "hard":
            image.save(o.out / name, quality=80)
        else:
            image.save(o.out / name, compress_level=1)
        p, v, R = (x[0] for x in flight.at(np.array([t])))
        span.append((np.linalg.norm(p - lens.place), np.linalg.norm(v)))
        pose = [*p, *quaternion(R)]
        stamp = f"{start + t:.9f}"
        lists["frames.csv"].append(f"{stamp},{name}")
        lists["truth.tum"].append(" ".join([stamp] + [f"{x:.9f}" for x in pose]))
        lists["truth.csv"].append(",".join([stamp] + [f"{x:.9f}" for x in [*pose, *v]]))
    for name, lines in lists.items():
        (o.out / name).write_text("\n".join(lines) + "\n")
    (o.out / "rig.yaml").write_text(yaml.safe_dump(rig, sort_keys=False))
    (o.out / "rig_true.yaml").write_text(yaml.safe_dump(true, sort_keys=False))
    span = np.array(span)
    summary = {"kind": o.kind, "seed": o.seed, "frames": o.frames, "lights": o.lights,
               "strays": o.stray, "dead": o.dead, "dark_s": o.blackout,
               "led_error_mm": o.led_error_mm, "grey": o.grey,
               "yuv422": o.yuv422,
               "range_m": [float(span[:, 0].min()), float(span[:, 0].max())],
               "speed_max_m_s": float(span[:, 1].max()), "close_share": close,
               "look": {k: v for k, v in vars(look).items() if isinstance(v, (float, str))}}
    (o.out / "sequence.json").write_text(json.dumps(summary, indent=2) + "\n")


if __name__ == "__main__":
    main()

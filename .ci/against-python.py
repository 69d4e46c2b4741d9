"""Holds aogauge's image metrics and statistics against scikit-image, FLIP, SciPy and statsmodels.

against-python.py FIXTURE [--images FOLDER] [--write] [--time AOGAUGE]: computes the values of the peers. With --write
the fixture is written, for Rust tests that need no Python. Without, the values are compared with the fixture, versions
and largest differences go to stdout, and the end is 1 where a value differs by more than TOLERANCE. --time then times
the program against FLIP's tool on two PNGs of 3840 x 2160.

Images are not stored but made, by one recipe on both sides (`pair`). All its operations are IEEE f32, so the
pixels are the same bit for bit.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from importlib.metadata import version
from pathlib import Path

import flip_evaluator
import numpy as np
from PIL import Image
from scipy import stats
from scipy.ndimage import correlate1d
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity
from statsmodels.stats.multitest import multipletests

PACKAGES = ["flip-evaluator", "numpy", "pillow", "scikit-image", "scipy", "statsmodels"]
TOLERANCE = 1e-6  # of a repeated run: relative, absolute below 1
PPD = 67.0
RELATIVE_MSE_EPSILON = 1e-2
WEIGHTS = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333]
RECIPE = [
    "Draw: x <- 1664525 x + 1013904223 (mod 2^32) from x = seed; v = (x >> 8) / 2^24. First the whole reference is drawn, then the test image from where x stands. Rows from the top, pixels from the left, channels within a pixel. All arithmetic is f32, each operation rounded, none fused.",
    "random: reference v, test v.",
    "noise: reference = triangle(column, row, channel) = |((channel + 1) column + (3 - channel) row) mod 128 - 64| / 64, nothing drawn; test = 0.8 * reference + 0.2 * v.",
    "near: reference v, test = 0.999 * reference.",
    "constant: reference and test hold `values`.",
    "bars: reference = 0.9 where floor((column + 2 channel) / 4) is odd, 0.1 elsewhere; test the same of column + 1.",
    "hdr: v * 2^((x & 255) mod 9), x the state that gave v; test of draws of its own.",
    "hdr-noise: reference as hdr; test = reference * (0.75 + 0.5 * v).",
    "hdr-dark: as hdr-noise, but 0 where 2 row < height.",
    "grey images are scored by FLIP with the channel repeated. luma = mean of the channels.",
]
DEFINITIONS = {
    "error": "over all samples of all channels, d = test - reference, in f64: bias mean d, mae mean |d|, mse mean d^2, rmse, psnr = 10 log10(1 / mse) (scikit-image, data_range 1; null where mse = 0), rel_mse = mean d^2 / (reference^2 + 0.01), smape = mean |d| / (|test| + |reference|), 0 where both are 0",
    "ssim": "scikit-image structural_similarity(gaussian_weights, sigma 1.5, use_sample_covariance False, data_range 1): 11 x 11, K1 .01, K2 .03, mean over pixels whose window lies within; luma, mean of the channels, and samples [column, row, value] of the luma map; null below 11 pixels a side; pillow_l: of Pillow's convert('L'), Rec. 601 luma of the coded values, rounded to 8 bits",
    "ms_ssim": "of luma; our own twin in NumPy, no peer package (Wang, Simoncelli and Bovik 2003): product over 5 scales of mean(contrast-structure)^w, at the last mean(SSIM)^w, w .0448 .2856 .3001 .2363 .1333; windows as for ssim, valid region; between scales the mean of 2 x 2 pixels, an odd last row or column dropped; negative means count 0, as in tf.image.ssim_multiscale and pytorch-msssim; null below 176 pixels a side",
    "flip": "flip_evaluator.evaluate at 67 pixels per degree (its default is 67.0206): mean in f64 over its f32 map, samples [column, row, value], least, greatest, quantiles of NumPy's inverted_cdf; srgb takes the values as sRGB, linear as linear; hdr with ACES, start, stop and number of exposures as it chose them. mean_f64 and noise: mean by our own twin in f64 and the largest difference of the maps, that is the rounding of the peer",
}
AGREEMENT = 1e-5  # asked of FLIP's mean; twice that of a single pixel


def draw(seed, n):
    """n states of the generator."""
    out = np.empty(n, np.uint32)
    x = seed
    for i in range(n):
        x = (1664525 * x + 1013904223) & 0xFFFFFFFF
        out[i] = x
    return out


def unit(x):
    return (x >> 8).astype(np.float32) / np.float32(1 << 24)


def pair(case):
    """Reference and test image, f32, rows x columns x channels."""
    width, height, channels = case["width"], case["height"], case["channels"]
    shape = (height, width, channels)
    n = width * height * channels
    y, x, c = np.indices(shape)
    f = np.float32
    kind, seed = case["kind"], case.get("seed", 0)
    if kind == "constant":
        return tuple(np.full(shape, v, f) for v in case["values"])
    if kind == "bars":
        bars = [np.where((x + step + 2 * c) // 4 % 2 == 1, f(0.9), f(0.1)) for step in (0, 1)]
        return tuple(b.astype(f) for b in bars)
    if kind == "noise":
        reference = (np.abs(((c + 1) * x + (3 - c) * y) % 128 - 64).astype(f) / f(64)).astype(f)
        return reference, f(0.8) * reference + f(0.2) * unit(draw(seed, n)).reshape(shape)
    states = draw(seed, 2 * n).reshape(2, *shape)
    v = unit(states)
    if kind == "random":
        return v[0], v[1]
    if kind == "near":
        return v[0], f(0.999) * v[0]
    bright = v * np.exp2((states & 255) % 9).astype(f)
    if kind == "hdr":
        return bright[0], bright[1]
    assert kind in ("hdr-noise", "hdr-dark")
    lit = np.where((kind == "hdr-dark") & (2 * y < height), f(0), bright[0])
    return lit, lit * (f(0.75) + f(0.5) * v[1])


def errors(reference, test):
    r, t = (image.astype(np.float64) for image in (reference, test))
    d = t - r
    size = np.abs(t) + np.abs(r)
    mse = mean_squared_error(r, t)
    return {
        "bias": d.mean(),
        "mae": np.abs(d).mean(),
        "mse": mse,
        "rmse": math.sqrt(mse),
        "psnr": peak_signal_noise_ratio(r, t, data_range=1) if mse > 0 else None,
        "rel_mse": (d * d / (r * r + RELATIVE_MSE_EPSILON)).mean(),
        "smape": np.divide(np.abs(d), size, out=np.zeros_like(d), where=size > 0).mean(),
    }


def places(height, width, margin=0):
    """Corners, middle and two more pixels."""
    low, right, bottom = margin, width - 1 - margin, height - 1 - margin
    wanted = [(low, low), (right, low), (low, bottom), (right, bottom), (width // 2, height // 2),
              (width // 3, height // 2), (width // 2, 2 * height // 3)]
    return sorted({(x, y) for x, y in wanted if low <= x <= right and low <= y <= bottom})


def samples(image, margin=0):
    return [[x, y, float(image[y, x])] for x, y in places(*image.shape, margin)]


def ssim(reference, test):
    if min(reference.shape[:2]) < 11:
        return None
    r, t = (image.astype(np.float64) for image in (reference, test))
    kind = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1}
    luma, full = structural_similarity(r.mean(-1), t.mean(-1), full=True, **kind)
    return {
        "luma": luma,
        "channels": structural_similarity(r, t, channel_axis=-1, **kind),
        "samples": samples(full, 5),
    }


def ms_ssim(reference, test):
    if min(reference.shape[:2]) < 176:
        return None
    taps = np.exp(-np.arange(-5, 6) ** 2 / (2 * 1.5**2))
    taps /= taps.sum()

    def blur(image):
        return correlate1d(correlate1d(image, taps, 0), taps, 1)[5:-5, 5:-5]

    r, t = (image.astype(np.float64).mean(-1) for image in (reference, test))
    product = 1.0
    for scale, weight in enumerate(WEIGHTS):
        mr, mt = blur(r), blur(t)
        vr, vt, cov = blur(r * r) - mr * mr, blur(t * t) - mt * mt, blur(r * t) - mr * mt
        c1, c2 = 0.01**2, 0.03**2
        value = (2 * cov + c2) / (vr + vt + c2)
        if scale == len(WEIGHTS) - 1:
            value = value * (2 * mr * mt + c1) / (mr * mr + mt * mt + c1)
        product *= max(value.mean(), 0.0) ** weight
        h, w = (side // 2 * 2 for side in r.shape)
        r, t = (i[:h, :w].reshape(h // 2, 2, w // 2, 2).mean((1, 3)) for i in (r, t))
    return product


class Flip:
    """FLIP (Andersson and others 2020, 2021) in f64, to know what the f32 of the peer rounds away."""

    TO_XYZ = np.array([
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382]])
    FROM_XYZ = np.array([
        [3.241003275, -1.537398934, -0.498615861],
        [-0.969224334, 1.875930071, 0.041554224],
        [0.055639423, -0.204011202, 1.057148933]])
    WHITE = np.array([0.950428545, 1, 1.088900371])
    PER_WHITE = np.array([1.052156925, 1, 0.918357670])
    ACES = [0.36 * 2.51, 0.6 * 0.03, 0, 0.36 * 2.43, 0.6 * 0.59, 0.14]

    @staticmethod
    def opponent(f):
        return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)

    @classmethod
    def ycxcz(cls, rgb):
        return cls.opponent(rgb @ cls.TO_XYZ.T * cls.PER_WHITE)

    @classmethod
    def hunt_lab(cls, rgb):
        t, delta = rgb @ cls.TO_XYZ.T * cls.PER_WHITE, 6 / 29
        lab = cls.opponent(np.where(t > delta**3, np.cbrt(t), t / (3 * delta * delta) + 4 / 29))
        return np.concatenate([lab[..., :1], 0.01 * lab[..., :1] * lab[..., 1:]], -1)

    @staticmethod
    def distance(a, b):
        d = a - b
        return (np.abs(d[..., 0]) + np.hypot(d[..., 1], d[..., 2])) ** 0.7

    @staticmethod
    def filtered(image, across, down):
        return correlate1d(correlate1d(image, across, 1, mode="nearest"), down, 0, mode="nearest")

    @classmethod
    def seen(cls, rgb):
        radius = math.ceil(3 * math.sqrt(0.04 / (2 * math.pi**2)) * PPD)
        degrees = np.arange(-radius, radius + 1) / PPD
        achromatic, red_green, blue1, blue2 = (np.exp(-(math.pi * degrees) ** 2 / b) for b in (0.0047, 0.0053, 0.04, 0.025))
        achromatic /= achromatic.sum()
        red_green /= red_green.sum()
        blue1 *= math.sqrt(34.1 * math.sqrt(math.pi / 0.04))
        blue2 *= math.sqrt(13.5 * math.sqrt(math.pi / 0.025))
        total = math.hypot(blue1.sum(), blue2.sum())
        y, cx, cz = np.moveaxis(cls.ycxcz(rgb), -1, 0)
        y, cx = cls.filtered(y, achromatic, achromatic), cls.filtered(cx, red_green, red_green)
        cz = sum(cls.filtered(cz, blue / total, blue / total) for blue in (blue1, blue2))
        light = (y + 16) / 116
        xyz = np.stack([light + cx / 500, light, light - cz / 200], -1) * cls.WHITE
        return cls.hunt_lab(np.clip(xyz @ cls.FROM_XYZ.T, 0, 1))

    @classmethod
    def features(cls, rgb):
        s = 0.5 * 0.082 * PPD
        radius = math.ceil(3 * s)
        i = np.arange(-radius, radius + 1.0)
        gauss = np.exp(-i * i / (2 * s * s))
        first, second = -i * gauss, (i * i / (s * s) - 1) * gauss
        gauss /= gauss.sum()
        y = (cls.ycxcz(rgb)[..., 0] + 16) / 116
        found = []
        for taps in (first, second):
            taps = np.where(taps > 0, taps / taps[taps > 0].sum(), taps / -taps[taps < 0].sum())
            taps -= taps.sum() / len(taps)  # rounding
            found.append(np.hypot(cls.filtered(y, taps, gauss), cls.filtered(y, gauss, taps)))
        return found

    @classmethod
    def ldr(cls, reference, test):
        """Of linear RGB within [0, 1]."""
        greatest = cls.distance(*(cls.hunt_lab(np.array(c, float)) for c in ([0, 1, 0], [0, 0, 1])))
        knee = 0.4 * greatest
        c = cls.distance(cls.seen(reference), cls.seen(test))
        c = np.where(c < knee, 0.95 * c / knee, 0.95 + 0.05 * (c - knee) / (greatest - knee))
        edges, points = (np.abs(a - b) for a, b in zip(cls.features(reference), cls.features(test)))
        return c ** (1 - np.sqrt(np.maximum(edges, points) / math.sqrt(2)))

    @classmethod
    def hdr(cls, reference, test, start, stop, number):
        def shown(image, exposure):
            a, v = cls.ACES, image * 2**exposure
            return np.clip((v * v * a[0] + v * a[1] + a[2]) / (v * v * a[3] + v * a[4] + a[5]), 0, 1)

        exposures = np.linspace(start, stop, number)
        return np.max([cls.ldr(shown(reference, e), shown(test, e)) for e in exposures], 0)


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def flip(reference, test, mode):
    r, t = (np.array(np.broadcast_to(i, (*i.shape[:2], 3)), order="C") for i in (reference, test))
    dynamic = "HDR" if mode == "hdr" else "LDR"
    found, _, used = flip_evaluator.evaluate(r, t, dynamic, mode == "srgb", False, False, {"ppd": PPD})
    found = found[..., 0].astype(np.float64)
    r, t = (i.astype(np.float64) for i in (r, t))
    result = {}
    if mode == "hdr":
        result = {"start": used["startExposure"], "stop": used["stopExposure"], "exposures": used["numExposures"]}
        twin = Flip.hdr(r, t, *result.values())
    else:
        twin = Flip.ldr(*(map(linear, (r, t)) if mode == "srgb" else (r, t)))
    noise = np.abs(found - twin).max()
    quantiles = {str(q): np.quantile(found, q, method="inverted_cdf") for q in (0.5, 0.95, 0.99)}
    return result | {
        "mean": found.mean(), "least": found.min(), "greatest": found.max(), "quantiles": quantiles,
        "samples": samples(found), "mean_f64": twin.mean(), "noise": noise,
        # What the peer rounds away comes on top.
        "tolerance_mean": AGREEMENT + abs(found.mean() - twin.mean()), "tolerance_map": 2 * AGREEMENT + noise,
    }


def metrics(reference, test, hdr):
    values = {"error": errors(reference, test)}
    if hdr:
        return values | {"flip": {"hdr": flip(reference, test, "hdr")}}
    return values | {
        "ssim": ssim(reference, test),
        "ms_ssim": ms_ssim(reference, test),
        "flip": {mode: flip(reference, test, mode) for mode in ("srgb", "linear")},
    }


def case(name, kind, width, height, channels, **more):
    return {"name": name, "kind": kind, "width": width, "height": height, "channels": channels} | more


CASES = [
    case("random-37x29", "random", 37, 29, 3, seed=1),
    case("random-64x48", "random", 64, 48, 3, seed=2),
    case("random-129x17", "random", 129, 17, 3, seed=3),
    case("random-5x3", "random", 5, 3, 3, seed=4),
    case("random-grey-37x29", "random", 37, 29, 1, seed=5),
    case("random-grey-11x11", "random", 11, 11, 1, seed=6),
    case("noise-61x83", "noise", 61, 83, 3, seed=7),
    case("noise-grey-64x48", "noise", 64, 48, 1, seed=8),
    case("near-64x48", "near", 64, 48, 3, seed=9),
    case("constant-equal", "constant", 20, 15, 3, values=[0.5, 0.5]),
    case("constant-apart", "constant", 20, 15, 3, values=[0.5, 0.53125]),
    case("constant-far-grey", "constant", 20, 15, 1, values=[0.0, 1.0]),
    case("pixel", "random", 1, 1, 3, seed=10),
    case("pixel-grey", "random", 1, 1, 1, seed=11),
    case("bars-64x48", "bars", 64, 48, 3),
    case("bars-grey-41x23", "bars", 41, 23, 1),
    case("noise-192x176", "noise", 192, 176, 3, seed=12),
    case("noise-grey-209x181", "noise", 209, 181, 1, seed=13),
    case("random-176x176", "random", 176, 176, 1, seed=14),
    case("bars-176x192", "bars", 176, 192, 3),
    case("hdr-33x47", "hdr", 33, 47, 3, seed=15),
    case("hdr-noise-64x48", "hdr-noise", 64, 48, 3, seed=16),
    case("hdr-grey-24x25", "hdr", 24, 25, 1, seed=17),
    case("hdr-dark-24x21", "hdr-dark", 24, 21, 3, seed=18),
    case("hdr-constant", "constant", 16, 12, 3, values=[4.0, 3.0], hdr=True),
]


def images(folder):
    for made in CASES:
        hdr = made.get("hdr", made["kind"].startswith("hdr"))
        yield made | {"hdr": hdr} | metrics(*pair(made), hdr)
    eighths = [np.asarray(Image.open(folder / f"a_{n}.png").convert("RGB")) for n in ("ref", "test")]
    # v / 255 in f32, as FLIP reads them.
    reference, test = (e.astype(np.float32) / np.float32(255) for e in eighths)
    files = {"name": "a_ref, a_test", "kind": "files", "files": ["a_ref.png", "a_test.png"], "hdr": False,
             "width": reference.shape[1], "height": reference.shape[0], "channels": 3}
    values = metrics(reference, test, False)
    coded = [np.asarray(Image.fromarray(e).convert("L"))[..., None] / 255 for e in eighths]
    values["ssim"]["pillow_l"] = ssim(*coded)["luma"]
    yield files | values


def normal(seed, n, mean, sd, step=2.0**-10):
    """Near-normal values, multiples of a step, so that they are exact in JSON and in f64."""
    v = unit(draw(seed, 12 * n)).astype(np.float64).reshape(n, 12).sum(1) - 6
    return mean + np.round(v * sd / step) * step


def data():
    skew = -np.log1p(-unit(draw(30, 40)).astype(np.float64))
    return {
        "openness_a": normal(20, 16, 0.82, 0.01, 2.0**-20),
        "openness_b": normal(21, 24, 0.81, 0.02, 2.0**-20),
        "paired_before": normal(22, 12, 0.6, 0.1),
        "paired_after": normal(22, 12, 0.6, 0.1) + normal(23, 12, 0.02, 0.02),
        "offset_a": normal(24, 30, 1e9, 1.0),
        "offset_b": normal(25, 20, 1e9 + 0.5, 2.0),
        "ties": np.array([1, 1, 1, 2, 2, 3, 3, 3, 3, 5], float),
        "ties_b": np.array([2, 2, 3, 3, 3, 5, 5, 5], float),
        "far": normal(26, 60, 5.0, 0.5),
        "few": np.array([0.25, 0.75]),
        "tiny": normal(27, 9, 3.0, 1.0) * 2.0**-60,
        "skew": np.round(skew * 1024) / 1024,
        "ratio_top": normal(28, 20, 3.0, 0.5),
        "ratio_bottom": normal(29, 20, 2.0, 0.25),
    }


def exact_moments(values):
    """Mean and unbiased variance by rational arithmetic."""
    v = [Fraction(x) for x in values]
    mean = sum(v) / len(v)
    return float(mean), float(sum((x - mean) ** 2 for x in v) / (len(v) - 1))


def moments(d):
    for name, v in d.items():
        mean, variance = exact_moments(v)
        by_scipy = stats.describe(v)
        assert math.isclose(by_scipy.mean, mean, rel_tol=1e-12) and math.isclose(by_scipy.variance, variance, rel_tol=1e-9)
        yield {"sample": name, "n": len(v), "mean": mean, "variance": variance, "se": math.sqrt(variance / len(v)),
               "least": v.min(), "greatest": v.max(), "skewness": by_scipy.skewness, "kurtosis": by_scipy.kurtosis}


def tested(result):
    lo, hi = result.confidence_interval(0.95)
    return {"t": result.statistic, "df": result.df, "p_two": result.pvalue, "ci95": [lo, hi]}


def t_tests(d):
    def sided(test, *a, **k):
        p = {f"p_{side}": test(*a, alternative=side, **k).pvalue for side in ("greater", "less")}
        return tested(test(*a, **k)) | p

    one = [("openness_a", 0.82), ("far", 0.0), ("offset_a", 1e9), ("ties", 2.0), ("few", 0.0), ("tiny", 0.0), ("skew", 1.0)]
    yield from ({"kind": "one", "a": a, "against": m} | sided(stats.ttest_1samp, d[a], m) for a, m in one)
    pairs = [("paired_after", "paired_before"), ("ratio_top", "ratio_bottom")]
    yield from ({"kind": "paired", "a": a, "b": b} | sided(stats.ttest_rel, d[a], d[b]) for a, b in pairs)
    two = [("openness_a", "openness_b"), ("offset_b", "offset_a"), ("ties", "ties_b"), ("far", "skew"), ("few", "ties")]
    for a, b in two:
        for kind, equal in (("welch", False), ("pooled", True)):
            yield {"kind": kind, "a": a, "b": b} | sided(stats.ttest_ind, d[a], d[b], equal_var=equal)


def equivalences(d):
    """Two one-sided tests by shifting the second sample; non-inferiority is one of them."""
    for a, b, margin in [("openness_a", "openness_b", 0.02), ("openness_a", "openness_b", 0.05), ("offset_a", "offset_b", 2.0)]:
        for kind, equal in (("welch", False), ("pooled", True)):
            low = stats.ttest_ind(d[a], d[b] - margin, equal_var=equal, alternative="greater").pvalue
            high = stats.ttest_ind(d[a], d[b] + margin, equal_var=equal, alternative="less").pvalue
            yield {"kind": kind, "a": a, "b": b, "margin": margin, "tost": max(low, high),
                   "non_inferior_higher_better": low, "non_inferior_lower_better": high}
    for a, target, margin in [("openness_a", 0.82, 0.01), ("far", 5.0, 0.125), ("skew", 1.0, 0.5), ("offset_a", 1e9, 0.5)]:
        low = stats.ttest_1samp(d[a], target - margin, alternative="greater").pvalue
        high = stats.ttest_1samp(d[a], target + margin, alternative="less").pvalue
        yield {"kind": "one", "a": a, "target": target, "margin": margin, "tost": max(low, high),
               "non_inferior_higher_better": low, "non_inferior_lower_better": high}


def corrections():
    several = [
        [0.0001, 0.004, 0.0119, 0.019, 0.03, 0.21, 0.5],
        [0.5, 0.02, 0.02, 0.9, 1.0, 0.0, 0.02],
        [1e-30, 3e-25, 1e-20, 0.04, 1e-12],
        [0.2],
        [1.0] * 5,
        [float(v) for v in unit(draw(31, 50))],
    ]
    for p in several:
        with np.errstate(divide="ignore"):  # of p = 1
            adjusted = {m: multipletests(p, method=m)[1].tolist() for m in ("holm", "bonferroni", "sidak")}
        bh = stats.false_discovery_control(p, method="bh")
        assert np.allclose(bh, multipletests(p, method="fdr_bh")[1], rtol=1e-12)
        yield {"p": p, "bh": bh.tolist()} | adjusted


def proportions():
    for k, n in [(0, 64), (64, 64), (7, 64), (1, 3), (0, 1), (500, 1000), (3, 100000), (999999, 1000000)]:
        for confidence in (0.95, 0.99):
            intervals = {m: list(stats.binomtest(k, n).proportion_ci(confidence, m)) for m in ("wilson", "exact")}
            yield {"k": k, "n": n, "confidence": confidence} | intervals


def lines(d):
    spp = np.array([4, 16, 64, 256, 1024], float)
    sets = {
        "slope": (np.log(spp), np.log([0.212, 0.1075, 0.0522, 0.0266, 0.0131])),
        "flat": (np.arange(8.0), normal(32, 8, 2.0, 0.1)),
        "offset": (1e6 + np.arange(12.0), 3 * np.arange(12.0) + normal(33, 12, 1e6, 0.25)),
        "three": (np.array([0.0, 1, 2]), np.array([1.0, 3, 4])),
        "repeated_x": (np.array([0.0, 0, 1, 1, 1, 2, 2]), np.array([0.1, 0.2, 1.1, 0.9, 1.05, 2.2, 1.8])),
    }
    for name, (x, y) in sets.items():
        line = stats.linregress(x, y)
        yield {"name": name, "x": x.tolist(), "y": y.tolist(), "slope": line.slope, "intercept": line.intercept,
               "r": line.rvalue, "p": line.pvalue, "slope_se": line.stderr, "intercept_se": line.intercept_stderr}


def chi_squares():
    for observed, shares in [([18, 22, 16, 25, 19, 20], [1 / 6] * 6), ([90, 10], [0.75, 0.25]), ([400, 100, 100, 400], [0.25] * 4),
                             ([50, 50], [0.5, 0.5]), ([5, 15, 30, 50], [0.1, 0.2, 0.3, 0.4])]:
        found = stats.chisquare(observed, np.array(shares) * sum(observed))
        yield {"observed": observed, "shares": shares, "statistic": found.statistic, "df": len(observed) - 1, "p": found.pvalue}


def uniformities():
    sets = {
        "uniform_5": unit(draw(34, 5)), "uniform_40": unit(draw(35, 40)), "squares_60": unit(draw(36, 60)) ** 2,
        "one": [0.125], "low_30": unit(draw(37, 30)) * np.float32(0.125), "uniform_300": unit(draw(38, 300)),
        "stratified_20": (np.arange(20) + 0.5) / 20,
    }
    for name, v in sets.items():
        v = np.asarray(v, np.float64)
        p = {m: stats.kstest(v, "uniform", method=m).pvalue for m in ("exact", "asymp")}
        yield {"name": name, "values": v.tolist(), "statistic": stats.kstest(v, "uniform").statistic, "p_exact": p["exact"], "p_asymptotic": p["asymp"]}


def quantiles(d):
    levels = [0.0, 0.01, 0.05, 0.25, 1 / 3, 0.5, 0.75, 0.95, 0.99, 1.0]
    for name in ("openness_a", "ties", "few", "skew", "offset_a"):
        yield {"sample": name, "levels": levels, "values": np.quantile(d[name], levels).tolist()}


def students():
    for df in (1, 2, 3, 4.5, 7, 15, 31.7, 100, 1e4, 1e6):
        levels = [1e-12, 1e-6, 0.0005, 0.025, 0.2, 0.5, 0.8, 0.975, 0.9995]
        t = [0.0, 0.5, 2.0, 5.0, 12.0, 40.0]
        yield {"df": df, "levels": levels, "quantiles": stats.t.ppf(levels, df).tolist(), "t": t, "upper_tails": stats.t.sf(t, df).tolist()}


def of_ratio(a, b, axis=-1):
    return a.mean(axis) / b.mean(axis)


def acceleration(groups, f):
    """Of the delete-one jackknife (Efron and Tibshirani 1993, 14.15)."""
    d = []
    for rows in groups:
        n = len(rows[0])
        left_out = np.array([f([[np.delete(c, i).mean() if g is rows else c.mean() for c in g] for g in groups]) for i in range(n)])
        d += list((n - 1) / n * (left_out.mean() - left_out))
    d = np.array(d)
    return (d**3).sum() / (6 * (d**2).sum() ** 1.5)


def bootstraps(d):
    """Ends of the interval as the mean of several runs; `sd` is what an end scatters by with one resample, so an end
    of B resamples lies within 5 sd / sqrt(B) of it but for one case in a million."""
    runs, resamples = 8, 40_000
    ratio_of_columns = lambda means: means[0][0] / means[0][1]
    cases = [
        ("mean", ("skew",), False, lambda v, axis=-1: v.mean(axis), lambda m: m[0][0]),
        ("mean", ("openness_a",), False, lambda v, axis=-1: v.mean(axis), lambda m: m[0][0]),
        ("ratio_paired", ("ratio_top", "ratio_bottom"), True, of_ratio, ratio_of_columns),
        ("ratio", ("ratio_top", "ratio_bottom"), False, of_ratio, lambda m: m[0][0] / m[1][0]),
        ("ratio", ("far", "skew"), False, of_ratio, lambda m: m[0][0] / m[1][0]),
    ]
    for kind, names, paired, f, of_means in cases:
        v = tuple(d[n] for n in names)
        ends = []
        for seed in range(runs):
            found = stats.bootstrap(v, f, paired=paired, confidence_level=0.95, n_resamples=resamples, batch=4000, method="BCa",
                                    rng=np.random.default_rng(seed))
            ends.append(list(found.confidence_interval))
        ends = np.array(ends)
        groups = [list(v)] if paired else [[x] for x in v]
        yield {"kind": kind, "samples": list(names), "confidence": 0.95, "value": float(f(*v)), "ci": ends.mean(0).tolist(),
               "sd": (ends.std(0, ddof=1) * math.sqrt(resamples)).tolist(), "acceleration": acceleration(groups, of_means)}


def statistics():
    d = data()
    return {
        "samples": {name: v.tolist() for name, v in d.items()},
        "moments": list(moments(d)), "t_tests": list(t_tests(d)), "equivalence": list(equivalences(d)),
        "corrections": list(corrections()), "proportions": list(proportions()), "lines": list(lines(d)),
        "chi_square": list(chi_squares()), "uniformity": list(uniformities()), "quantiles": list(quantiles(d)),
        "student": list(students()), "bootstrap": list(bootstraps(d)),
    }


def plain(value):
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def written(value, indent=0):
    """JSON with lists of plain values on one line."""
    if isinstance(value, dict):
        if not any(isinstance(v, (dict, list)) for v in value.values()):
            return json.dumps(value)
        inner = ",\n".join(f"{' ' * (indent + 1)}{json.dumps(k)}: {written(v, indent + 1)}" for k, v in value.items())
        return f"{{\n{inner}\n{' ' * indent}}}"
    if isinstance(value, list) and any(isinstance(v, dict) for v in value):
        inner = ",\n".join(f"{' ' * (indent + 1)}{written(v, indent + 1)}" for v in value)
        return f"[\n{inner}\n{' ' * indent}]"
    return json.dumps(value)


def differences(old, new, where=""):
    """(place, relative difference) of every number; NaN where the two are of different form."""
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        for k in old:
            yield from differences(old[k], new[k], f"{where}/{k}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, (a, b) in enumerate(zip(old, new)):
            yield from differences(a, b, f"{where}/{a.get('name', i) if isinstance(a, dict) else i}")
    elif isinstance(old, (int, float)) and isinstance(new, (int, float)):
        size = max(abs(old), abs(new))
        yield where, abs(old - new) / (size if size < 1e-6 or size > 1 else 1.0) if old != new else 0.0
    elif old != new:
        yield where, math.nan


def run(command):
    """Wall time, CPU time (user and system), and what was printed."""
    before, start = os.times(), time.perf_counter()
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    wall, after = time.perf_counter() - start, os.times()
    return wall, after.children_user - before.children_user + after.children_system - before.children_system, text


def timed(program):
    """FLIP's tool, and all of the program's metrics, on a smooth image and the same with noise."""
    height, width = 2160, 3840
    random = np.random.default_rng(1)
    y, x = np.mgrid[0:height, 0:width] / height
    smooth = np.stack([0.5 + 0.25 * np.sin(7 * x + 3 * c) + 0.25 * np.cos(11 * y * x + c) for c in range(3)], -1)
    noisy = np.clip(0.97 * smooth + 0.01 + random.normal(0, 0.02, smooth.shape), 0, 1)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        paths = [str(folder / f"{name}.png") for name in ("reference", "test")]
        for path, image in zip(paths, (smooth, noisy)):
            Image.fromarray((image * 255 + 0.5).astype(np.uint8)).save(path)
        tool = [str(Path(sys.executable).parent / "flip"), "-r", paths[0], "-t", paths[1], "-ppd", str(PPD), "-d", str(folder)]
        ours = [program, "compare", *paths, "--ppd", str(PPD)]
        commands = {
            "flip, no map": [*tool, "-nerm"],
            "flip, map": tool,
            "aogauge compare, all metrics": ours,
            "aogauge compare, all metrics, all maps": [*ours, "--maps", str(folder / "maps")],
        }
        print(f"\ntwo PNGs of {width} x {height}, {os.cpu_count()} processors, best of 5 runs")
        # By turns, so that what else the machine does falls on all.
        runs = [[run(command)[:2] for command in commands.values()] for _ in range(5)]
        for name, found in zip(commands, zip(*runs)):
            wall, cpu = min(found)
            print(f"{name:40} {wall:6.2f} s, of the processors {cpu:6.2f} s")
        r, t = (flip_evaluator.load(path) for path in paths)
        mean = flip_evaluator.evaluate(r, t, "LDR", True, False, False, {"ppd": PPD})[0].astype(np.float64).mean()
        scores = json.loads(run([*ours, "--format", "json"])[2])["pairs"][0]["scores"]["scores"]
        found = next(s["value"] for s in scores if s["name"] == "flip")
        # Its tool prints a running sum in f32, which is no mean at this size.
        print(f"mean FLIP: aogauge {found:.7f}, flip-evaluator's map {mean:.7f}")
        return abs(found - mean) <= AGREEMENT


def main():
    p = argparse.ArgumentParser()
    p.add_argument("fixture", type=Path)
    p.add_argument("--images", type=Path, default=Path("tests/reference/images"))
    p.add_argument("--write", action="store_true")
    p.add_argument("--time", metavar="AOGAUGE")
    args = p.parse_args()
    values = plain({
        "made_by": ".ci/against-python.py",
        "versions": {name: version(name) for name in PACKAGES},
        "recipe": RECIPE, "definitions": DEFINITIONS,
        "images": list(images(args.images)), "statistics": statistics(),
    })
    if args.write:
        args.fixture.write_text(written(values) + "\n")
        return 0
    old = json.loads(args.fixture.read_text())
    print("  ".join(f"{k} {v}" for k, v in values["versions"].items()))
    worst = {}
    for where, difference in differences({k: old[k] for k in ("images", "statistics")}, {k: values[k] for k in ("images", "statistics")}):
        _, whole, name, *rest = where.split("/")
        part = f"{whole}/{name}" if whole == "statistics" else f"{whole}/{rest[0] if rest[0] in DEFINITIONS else 'recipe'}"
        count, most, place = worst.get(part, (0, 0.0, ""))
        # NaN, a change of form, is worse than anything.
        worse = not difference <= most and not math.isnan(most)
        worst[part] = (count + 1, difference if worse else most, where if worse else place)
    for part, (count, most, place) in worst.items():
        print(f"{part:26} {count:5} values, made again within {most:.1e} {place}")
    good = all(most <= TOLERANCE for _, most, _ in worst.values())
    if args.time:
        good &= timed(args.time)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

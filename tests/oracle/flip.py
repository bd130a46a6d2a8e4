"""FLIP of two generated pictures by the authors' program, for crates/film/src/flip.

    pip install flip-evaluator==1.7 && python tests/oracle/flip.py
"""
import numpy as np
import flip_evaluator

WIDTH, HEIGHT = 40, 28


def channel(x, y, c, shift):
    """A multiple of 1/64 in 0..=1: tiles of three heights, with grain, moved by `shift` pixels."""
    tile = ((x + shift) // 7 + y // 5) % 3
    grain = (x * 13 + y * 29 + c * 17 + x * y * (c + 3)) % 11
    return min(tile * 21 + grain * (1 + shift) + c * 4 * shift, 64) / 64.0


def picture(shift, is_hdr):
    out = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            for c in range(3):
                gain = 2.0 ** (x // 8 - 1) if is_hdr else 1.0
                out[y, x, c] = channel(x, y, c, shift) * gain
    return out


for kind in ["LDR", "HDR"]:
    reference, test = picture(0, kind == "HDR"), picture(1, kind == "HDR")
    for ppd in [67.02064327658226, 30.0]:
        errors, mean, parameters = flip_evaluator.evaluate(reference, test, kind, inputsRGB=False, applyMagma=False,
                                                  parameters={"ppd": ppd})
        errors = errors.reshape(HEIGHT, WIDTH)
        print(kind, "%.2f" % ppd, "mean %.7f" % mean, "at (0, 0), (11, 9), (39, 27), (20, 14):",
              ["%.6f" % errors[y, x] for x, y in [(0, 0), (11, 9), (39, 27), (20, 14)]], parameters)

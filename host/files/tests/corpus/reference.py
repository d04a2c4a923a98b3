"""Decodes the images of a list with Pillow: index.raw holds height, width (u32) and grey values (f32)."""

import sys
import warnings

import numpy as np
from PIL import Image, ImageFile, ImageOps

warnings.simplefilter("ignore")
ImageFile.LOAD_TRUNCATED_IMAGES = False
SCALES = {"1": 1, "L": 255, "RGB": 255, "I;16": 65535, "I;16L": 65535, "I;16B": 65535, "F": 1}


def grey(path):
    with Image.open(path) as image:
        if getattr(image, "n_frames", 1) != 1:
            return None
        # Colour times alpha (TIFF, ExtraSamples 1): Pillow divides, farnear ignores alpha.
        if 1 in getattr(image, "tag_v2", {}).get(338, ()):
            return None
        image.load()
        image = ImageOps.exif_transpose(image)
        # Alpha is ignored, palettes are looked up; other colour spaces and 16-bit colour, which Pillow halves, are not compared.
        if image.mode in ("P", "PA"):
            image = image.convert("RGBA")
        if image.mode in ("RGBA", "RGBX"):
            image = Image.merge("RGB", image.split()[:3])
        if image.mode in ("LA", "La"):
            image = image.split()[0]
        if image.mode not in SCALES:
            return None
        values = np.asarray(image).astype(np.float64) / SCALES[image.mode]
        return values.mean(axis=2) if values.ndim == 3 else values


files = open(sys.argv[1], encoding="utf-8").read().split("\n")
for index, path in enumerate(files):
    try:
        values = grey(path)
    except Exception:  # a file that Pillow refuses, for whatever reason
        continue
    if values is not None:
        with open(f"{sys.argv[2]}/{index}.raw", "wb") as out:
            out.write(np.array(values.shape, "<u4").tobytes() + values.astype("<f4").tobytes())

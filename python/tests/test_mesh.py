"""Meshes of `farnear depth`, read by trimesh: both formats have the points of the map."""

import subprocess

import numpy as np
import pytest

import farnear
from farnear.rig import find_simulator


def test_both_meshes_have_the_points_of_the_map(optics, slant, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    simulator = find_simulator()
    if simulator is None:
        pytest.skip("farnear is not built")
    from matplotlib import image

    far, near, _ = slant
    for name, pixels in (("far", far), ("near", near)):
        image.imsave(tmp_path / f"{name}.png", np.repeat(pixels[..., None], 3, axis=2))
    (tmp_path / "optics.toml").write_text(optics.dumps())
    command = [simulator.with_name("farnear"), "depth", "far.png", "near.png", "--write", "npy,mesh,glb", "--out", "out"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    found = farnear.DepthMap.load(tmp_path / "out")
    points = farnear.points_mm(found.depth_mm, optics)
    points = points[np.isfinite(points[..., 2])]
    assert len(points) > 10_000
    meshes = []
    for file, mm in (("mesh.ply", 1.0), ("mesh.glb", 1000.0)):
        mesh = trimesh.load(tmp_path / "out" / file, force="mesh", process=False)
        # The file has 32-bit floats: 0.9 m to 0.06 um.
        assert np.allclose(mm * mesh.vertices, points, atol=2e-4), file
        # The surface faces the viewer, who looks along -z.
        assert (mesh.face_normals[:, 2] > 0).mean() > 0.99, file
        meshes.append(mesh)
    assert np.array_equal(*(mesh.faces for mesh in meshes))
    assert np.array_equal(*(np.asarray(mesh.visual.vertex_colors) for mesh in meshes))

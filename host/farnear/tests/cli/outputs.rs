//! Every command's figures, messages and files on a cheap example equal their recordings in
//! `outputs/golden/NAME.toml`. A story is a list of commands that run one after another in an empty folder.
//! Outputs are compared byte for byte on the kind of processor of the recording, elsewhere by form and
//! tolerance, because rounding differs. `outputs/golden/README.md` describes the recordings.

mod digest;
mod held;

use held::Story;

#[test]
fn optics_and_operators() {
    Story {
        name: "optics",
        commands: &[
            "optics --optics rig.toml",
            "optics --optics rig.toml --json",
            "operators --optics rig.toml --out ro.toml --plot ro.svg --json",
            "operators --optics rig.toml --psf pillbox --kernel-size-px 5 --plot pillbox.png",
            "operators --optics rig.toml --psf pillbox --family raj --out raj.toml",
            "operators --optics rig.toml --psf generalised:p=1.8,k=0.4802 --out ggro.toml --json",
        ],
        ..Story::default()
    }
    .is_held();
}

#[test]
fn rendered_scenes() {
    Story {
        name: "render",
        files: &[("own.toml", "depth = \"cone/truth.npy\"\ntexture = \"fractal\"\ncontrast = 0.4\n")],
        commands: &[
            "render SMALL --scene staircase --noise none --out staircase",
            "render SMALL --scene cone,texture=fractal,contrast=0.3 --noise 12bit --seed 3 --out cone --json",
            "render SMALL --scene sphere --elliptical-distortion --psf pillbox --out sphere",
            "render SMALL --scene own.toml --psf generalised:p=1.8,k=0.4802 --out own",
        ],
        ..Story::default()
    }
    .is_held();
}

#[test]
fn depth_maps() {
    Story {
        name: "depth",
        before: &["render SMALL --scene slant --seed 2 --out pair"],
        commands: &[
            "depth pair/far.png pair/near.png",
            "depth pair/far.png pair/near.png --optics rig.toml --uncertainty --out map --json",
            "depth pair/far.png pair/near.png --operators gro --window 5 --median-px 5 --threads 1 --fill --out filled",
            "depth pair/far.png pair/near.png --uncertainty=camera:full_well_e=20000,read_noise_e=12 --out camera",
            "depth pair/near.png pair/far.png --out swapped --json",
            "depth pair/far.png pair/near.png --method subbarao --out subbarao --json",
            "depth pair/far.png pair/near.png --method subbarao-fourier --out fourier --json",
            "compare map/depth.npy pair/truth.npy --border 8 --json",
            "compare map/depth.tiff pair/truth.npy --mask map/depth.tiff --away-from-edges 4",
        ],
        ..Story::default()
    }
    .is_held();
}

#[test]
fn calibration() {
    const LIST: &str = "[[pattern]]\ndepth = \"930/depth/depth.npy\"\ntrue_mm = 930.0\n\
                        [[pattern]]\ndepth = \"920/depth/depth.npy\"\ntrue_mm = 920.0\n\
                        [[pattern]]\ndepth = \"910/depth/depth.npy\"\ntrue_mm = 910.0\n\
                        [[pattern]]\ndepth = \"900/depth/depth.npy\"\ntrue_mm = 900.0\n\
                        [[pattern]]\ndepth = \"890/depth/depth.npy\"\ntrue_mm = 890.0\n";
    Story {
        name: "calibration",
        files: &[("patterns.toml", LIST)],
        before: &[
            "render SMALL --scene plane:930 --elliptical-distortion --out 930",
            "render SMALL --scene plane:920 --elliptical-distortion --out 920",
            "render SMALL --scene plane:910 --elliptical-distortion --out 910",
            "render SMALL --scene plane:900 --elliptical-distortion --out 900",
            "render SMALL --scene plane:890 --elliptical-distortion --out 890",
            "depth 930/far.png 930/near.png",
            "depth 920/far.png 920/near.png",
            "depth 910/far.png 910/near.png",
            "depth 900/far.png 900/near.png",
            "depth 890/far.png 890/near.png",
        ],
        commands: &[
            "calibrate psf 930/far.png 930/near.png --optics rig.toml --model gaussian --out found.toml --json",
            "calibrate psf 930/far.png 930/near.png --optics rig.toml --model generalised --depth-mm 930",
            "calibrate correction patterns.toml --method clsf --out clsf.toml --json",
            "calibrate correction patterns.toml --method clsf-full --out full.toml",
            "calibrate correction patterns.toml --method cdc --window-px 5 --smoothing-px 2 --out cdc.toml",
            "calibrate correction patterns.toml --method two-step --out two-step.toml --json",
            "correct 910/depth/depth.npy --correction clsf.toml --out clsf.npy --json",
            "correct 910/depth/depth.npy --correction clsf.toml --as-board --out board.tiff",
            "correct 910/depth/depth.npy --correction cdc.toml --out cdc.npy",
        ],
    }
    .is_held();
}

#[test]
fn people() {
    const CAMERA: &str = "[camera]\nheight_m = 0.8\nazimuth_deg = 140.0\npitch_deg = 0.0\nfocal_length_mm = 1.0\n\
                          pixel_um = 6.0\nwidth_px = 180\nheight_px = 79\n";
    const THREE: &str = "--subjects 3 --activities walk,crouch,dig --views 2 --rate-hz 6 --mm-per-px 25";
    Story {
        name: "people",
        files: &[("camera.toml", CAMERA)],
        before: &[&format!("silhouettes synthetic {THREE} --out people")],
        commands: &[
            "silhouettes synthetic --subjects 1 --activities walk --views 1 --rate-hz 2 --mm-per-px 25 --out one --json",
            "activity train people/samples.toml --out model.fnm --any-view --no-search --json",
            "activity train people/samples.toml --out ordered.fnm --mode ordered --classifier knn --no-search",
            "activity recognise people/p02-crouch-1/view2 --model model.fnm --json",
            "activity recognise people/p01-dig-1/view1 people/p01-dig-1/view2 --model ordered.fnm",
            "activity evaluate people/samples.toml --leave-one-subject-out --no-search --out evaluation --json",
            "activity evaluate people/samples.toml --leave-one-subject-out --no-search --views each --epl thesis",
            "shadow remove one/p00-walk-1/view1 --camera camera.toml --lat 52.38 --lon -1.56 \
             --time 2014-06-23T11:30:00Z --out cut --json",
            "sun --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z",
            "sun --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z --model thesis --json",
        ],
    }
    .is_held();
}

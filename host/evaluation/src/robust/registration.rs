//! Our registration compared with OpenCV's ECC, from a script that is run manually because it needs OpenCV.

use anyhow::Result;

use crate::page::Page;

/// Output of `host/depth/benches/peer_ecc.py`.
const TABLE: &str = include_str!("registration.md");

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Registration compared with OpenCV's ECC");
    page.paragraph(
        "How far the found place of a pixel lies from the true one, root mean square over the image, when the near image is shifted, \
         magnified and turned and both are blurred as the scene's depth has it: planes at far focus, in the middle and at near focus, and a scene that is half the one and \
         half the other. 640 x 480, 8 bit. *ECC* is `cv2.findTransformECC` with an affine map from the identity, 100 steps, with its usual filter of 5 px and without; \
         ours is a similarity. Times are processor time on one thread, the least of three, on a machine that others used too; ours as `cargo xtask demo` builds it. Printed by \
         [`peer_ecc.py`](../host/depth/benches/peer_ecc.py), which the evaluation does not run.",
    );
    page.block(TABLE);
    Ok(())
}

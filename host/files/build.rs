//! Tells the tests whether a corpus of images is there: `FARNEAR_IMAGE_CORPUS` names folders.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(image_corpus)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=FARNEAR_IMAGE_CORPUS");
    if std::env::var_os("FARNEAR_IMAGE_CORPUS").is_some() {
        println!("cargo::rustc-cfg=image_corpus");
    }
}
